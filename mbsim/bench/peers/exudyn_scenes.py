"""The scenes in Exudyn, and the settings of each from coarse to fine."""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Callable
from typing import Any

from mbsim.bench import parameters as p
from mbsim.bench.peers import exudyn_linkages as jointed
from mbsim.bench.peers.exudyn_parts import (
    Case,
    Cases,
    Contact,
    Solver,
    add_ball,
    add_floor,
    add_ground_marker,
    add_marker,
    add_point,
    add_pull,
    add_rigid_body,
)


def cases(scene: str) -> dict[str, Callable[[], Case]]:
    """Settings of a scene and what builds each."""
    if scene.startswith("S7_"):
        return dict(_grains(int(scene[3:])))
    if scene.startswith("S8_"):
        return dict(_chain(int(scene[3:])))
    scenes: dict[str, Callable[[], Cases]] = {
        "S1": lambda: _free(p.S1),
        "S2a": lambda: _law_drop(_impact, "impact"),
        "S2b": _contact_drop,
        "S2c": lambda: _law_drop(_hunt_crossley, "hc"),
        "S3": _rolling,
        "S4stick": lambda: _box(p.S4.mu_stick, p.S4.stick_end_time, (5e-4, 1e-4)),
        "S4slip": lambda: _box(p.S4.mu_slip, p.S4.slip_end_time, (5e-4, 1e-4, 2e-5)),
        "S5": _row,
        "S8b": _slider_crank,
        "S10a": _stiff_drop,
        "S10c": lambda: _free(p.S10C),
    }
    return dict(scenes[scene]()) if scene in scenes else {}


def _auto(name: str, tols: tuple[float, ...], step: float) -> list[Solver]:
    return [Solver(name, step, tol) for tol in tols]


def _fixed(name: str, steps: tuple[float, ...], rho: float = 0.9) -> list[Solver]:
    return [Solver(name, step, rho=rho) for step in steps]


def _free(top: p.FreeBody) -> Cases:
    def build(exu: Any, system: Any) -> list[Any]:
        twist = (0.0, 0.0, 0.0, *top.spin)
        return [add_rigid_body(system, (0.0, 0.0, 0.0), top.mass, top.inertia, twist)]

    slow = top is p.S1
    steps = (1e-2, 1e-3, 1e-4) if slow else (1e-3, 1e-4, 1e-5)
    solvers = [
        *_fixed("GeneralizedAlpha", steps),
        *_fixed("RK44", steps),
        *_fixed("RK67", (0.05, 0.02, 1e-2, 1e-3) if slow else (1e-3, 5e-4, 2e-4, 1e-4)),
        *_auto("DOPRI5", (1e-4, 1e-6, 1e-9, 1e-12), 1.0 if slow else 0.1),
        # it stores at steps only: rows every 10 ms need steps as short
        *(_auto("DOPRI5", (1e-4, 1e-6, 1e-9, 1e-12), p.SAMPLE) if slow else []),
    ]
    note = "Lie group; rows at the steps where these are automatic"
    for solver in solvers:
        yield solver.label, functools.partial(Case, build, solver, top.end_time, note)


def _impact(esym: Any, depth: Any, rate: Any) -> Any:
    """S2a's law in Exudyn's expressions; depth is clipped at 0."""
    s = esym.min(depth / p.S2A_LAW.dmax, esym.Real(1.0))
    damping = p.S2A_LAW.c * s * s * (3.0 - 2.0 * s)
    force = p.S2A_LAW.k * esym.pow(depth, p.S2A_LAW.e) + damping * rate
    return esym.max(force, esym.Real(0.0))


def _impact_plain(depth: float, rate: float) -> float:
    """S2a's law; depth > 0."""
    s = depth / p.S2A_LAW.dmax
    damping = p.S2A_LAW.c if s >= 1.0 else p.S2A_LAW.c * s * s * (3.0 - 2.0 * s)
    force = p.S2A_LAW.k * depth**p.S2A_LAW.e + damping * rate
    return force if force > 0.0 else 0.0


def _hunt_crossley(esym: Any, depth: Any, rate: Any) -> Any:
    """S2c's law in Exudyn's expressions; depth is clipped at 0."""
    factor = esym.max(1.0 + p.S2C_LAW.dissipation * rate, esym.Real(0.0))
    return p.S2C_LAW.k * depth * factor


def _hunt_crossley_plain(depth: float, rate: float) -> float:
    """S2c's law; depth > 0."""
    factor = 1.0 + p.S2C_LAW.dissipation * rate
    return p.S2C_LAW.k * depth * factor if factor > 0.0 else 0.0


def _user_function(exu: Any, system: Any, law: Any, symbolic: bool) -> Any:
    """Spring force of the law on a sphere above the plane z = 0."""
    radius, zero = p.S2.radius, [0.0, 0.0, 0.0]
    if not symbolic:

        def in_python(mbs: Any, t: Any, n: Any, u: Any, v: Any, k: Any, d: Any, o: Any) -> Any:
            depth = radius - u[2]
            return zero if depth <= 0.0 else [0.0, 0.0, -law(depth, -v[2])]

        return in_python
    esym = exu.symbolic

    def in_symbols(mbs: Any, t: Any, n: Any, u: Any, v: Any, k: Any, d: Any, o: Any) -> Any:
        depth = esym.max(radius - u[2], esym.Real(0.0))
        return [0.0, 0.0, -law(esym, depth, -v[2])]

    return _symbolic(system, in_symbols)


def _symbolic(system: Any, function: Any) -> Any:
    """The user function of a spring as expressions that run without Python."""
    from exudyn.advancedUtilities import CreateSymbolicUserFunction

    made = CreateSymbolicUserFunction(
        system,
        function=function,
        userFunctionName="springForceUserFunction",
        itemTypeName="ObjectConnectorCartesianSpringDamper",
    )
    # Exudyn does not keep a symbolic function alive: it lives as long as its system
    system.variables.setdefault("functions", []).append(made)
    return made


def _law_drop(law: Any, variant: str) -> Cases:
    plain = {"impact": _impact_plain, "hc": _hunt_crossley_plain}[variant]

    def build(symbolic: bool, exu: Any, system: Any) -> list[Any]:
        from exudyn.itemInterface import CartesianSpringDamper

        place = (0.0, 0.0, p.S2.gap + p.S2.radius)
        node = add_point(system, place, p.S2.mass)
        marker = add_marker(system, node)
        add_pull(system, marker, (0.0, 0.0, -p.GRAVITY * p.S2.mass))
        function = _user_function(exu, system, law if symbolic else plain, symbolic)
        system.AddObject(
            CartesianSpringDamper(
                markerNumbers=[add_ground_marker(system), marker], springForceUserFunction=function
            )
        )
        return [node]

    solvers = [
        *_auto("DOPRI5", (1e-5, 1e-7, 1e-9, 1e-11), 1e-2),
        *_auto("DOPRI5", (1e-7, 1e-9), 1e-3),
        *_fixed("RK44", (1e-4, 1e-5)),
        *_fixed("VelocityVerlet", (1e-4, 1e-5)),
    ]
    for kind, solver in itertools.product(("Python", "symbolic"), solvers):
        note = f"{variant}; {kind} user function of a spring"
        made = functools.partial(build, kind == "symbolic")
        yield (
            f"{kind} {solver.label}",
            functools.partial(Case, made, solver, p.S2.end_time, note, True),
        )


def _sphere_drop(drop: p.Drop, law: p.LinearLaw, exu: Any, system: Any) -> list[Any]:
    node = add_point(system, (0.0, 0.0, drop.gap + drop.radius), drop.mass)
    marker = add_marker(system, node)
    add_pull(system, marker, (0.0, 0.0, -p.GRAVITY * drop.mass))
    contact = Contact(system, law, mu=0.0)
    contact.sphere(marker, drop.radius)
    add_floor(system, contact, (-1.0, 1.0), 1.0)
    return [node]


def _contact_drop() -> Cases:
    solvers = [
        *_auto("DOPRI5", (1e-5, 1e-7, 1e-8, 1e-10), 1e-2),
        *_auto("DOPRI5", (1e-8, 1e-10), 1e-3),
        *_fixed("VelocityVerlet", (1e-4, 1e-5, 1e-6)),
        *_fixed("RK44", (1e-4, 1e-5)),
        *_fixed("GeneralizedAlpha", (1e-4, 1e-5), rho=1.0),
    ]
    build = functools.partial(_sphere_drop, p.S2, p.S2B_LAW)
    note = "linear_noclip; GeneralContact, k in series, c in parallel, may pull"
    for solver in solvers:
        yield solver.label, functools.partial(Case, build, solver, p.S2.end_time, note, True)


def _stiff_drop() -> Cases:
    solvers = [
        *_fixed("VelocityVerlet", (1e-4, 1e-5, 1e-6)),
        *_fixed("GeneralizedAlpha", (1e-4, 1e-5), rho=0.6),
        *_auto("DOPRI5", (1e-4, 1e-6, 1e-8), 1e-2),
    ]
    build = functools.partial(_sphere_drop, p.S10A, p.S10A_LAW)
    note = "linear_noclip; GeneralContact, k in series, c in parallel, may pull"
    for solver in solvers:
        yield solver.label, functools.partial(Case, build, solver, p.S10A.end_time, note, True)


def _rolling() -> Cases:
    def build(zone: float, exu: Any, system: Any) -> list[Any]:
        ball, law = p.S3, p.S3.law
        depth = ball.mass * p.GRAVITY / law.k
        twist = (ball.speed, 0.0, 0.0, 0.0, 0.0, 0.0)
        node = add_ball(system, (0.0, 0.0, ball.radius - depth), ball.mass, ball.radius, twist)
        marker = add_marker(system, node)
        add_pull(system, marker, (0.0, 0.0, -p.GRAVITY * ball.mass))
        contact = Contact(system, law, ball.mu, zone)
        contact.sphere(marker, ball.radius)
        add_floor(system, contact, (-2.0, 12.0), 1.0)
        return [node]

    runs = [
        (1e-3, _fixed("VelocityVerlet", (1e-3, 2e-4, 2e-5))),
        (1e-3, _fixed("GeneralizedAlpha", (1e-3, 1e-4))),
        (1e-4, _fixed("VelocityVerlet", (1e-3, 1e-4, 2e-5))),
        (1e-5, _fixed("VelocityVerlet", (1e-3, 1e-4, 1e-5, 2e-6))),
        (1e-5, _fixed("GeneralizedAlpha", (1e-3, 1e-4))),
        (1e-4, _auto("DOPRI5", (1e-4, 1e-6), 1e-2)),
    ]
    for zone, solvers in runs:
        note = f"GeneralContact, friction linear below {zone:g} m/s, from static penetration"
        for solver in solvers:
            made = functools.partial(build, zone)
            yield (
                f"zone={zone:g} {solver.label}",
                functools.partial(Case, made, solver, p.S3.end_time, note),
            )


FOOT = 0.01  # m, radius of the spheres that stand for the corners of S4's box


def _box(mu: float, end_time: float, steps: tuple[float, ...]) -> Cases:
    def build(zone: float, exu: Any, system: Any) -> list[Any]:
        from exudyn.itemInterface import MarkerBodyRigid

        box, (a, b, c) = p.S4, p.S4.size
        along, down = p.GRAVITY * math.sin(box.tilt), p.GRAVITY * math.cos(box.tilt)
        depth = box.mass * down / (4 * box.law.k)
        inertia = tuple(
            box.mass / 12 * (s + t) for s, t in ((b * b, c * c), (a * a, c * c), (a * a, b * b))
        )
        node = add_rigid_body(system, (0.0, 0.0, c / 2 - depth), box.mass, inertia)
        add_pull(system, add_marker(system, node), (box.mass * along, 0.0, -box.mass * down))
        contact = Contact(system, box.law, mu, zone)
        body = 0  # the first object of the system
        for x, y in itertools.product((-a / 2, a / 2), (-b / 2, b / 2)):
            corner = MarkerBodyRigid(bodyNumber=body, localPosition=[x, y, FOOT - c / 2])
            contact.sphere(system.AddMarker(corner), FOOT)
        add_floor(system, contact, (-1.0, 5.0), 1.0)
        return [node]

    solvers = {
        1e-3: [*_fixed("GeneralizedAlpha", (1e-2, 2e-3, 5e-4)), *_fixed("VelocityVerlet", steps)],
        1e-5: [*_fixed("GeneralizedAlpha", (2e-3, 5e-4)), *_fixed("VelocityVerlet", steps)],
    }
    for zone, runs in solvers.items():
        note = f"box on 4 foot spheres, friction linear below {zone:g} m/s, from static penetration"
        for solver in runs:
            made = functools.partial(build, zone)
            yield (
                f"zone={zone:g} {solver.label}",
                functools.partial(Case, made, solver, end_time, note),
            )


def _row() -> Cases:
    speeds = [p.S5.speed] + [0.0] * (p.S5.count - 1)

    def connectors(exu: Any, system: Any) -> list[Any]:
        from exudyn.itemInterface import NodeGenericData, ObjectContactSphereSphere

        nodes = [
            add_ball(system, (x, 0.0, 0.0), p.S5.mass, p.S5.radius, (v, 0.0, 0.0, 0.0, 0.0, 0.0))
            for x, v in zip(p.s5_positions(), speeds, strict=True)
        ]
        for pair in itertools.pairwise([add_marker(system, node) for node in nodes]):
            history = NodeGenericData(initialCoordinates=[0.1, 0, 0, 0], numberOfDataCoordinates=4)
            system.AddObject(
                ObjectContactSphereSphere(
                    markerNumbers=list(pair),
                    nodeNumber=system.AddNode(history),
                    spheresRadii=[p.S5.radius] * 2,
                    contactStiffness=p.S5.k,
                    contactStiffnessExponent=p.S5.e,
                )
            )
        return nodes

    def springs(exu: Any, system: Any) -> list[Any]:
        from exudyn.itemInterface import CartesianSpringDamper

        esym, span = exu.symbolic, 2 * p.S5.radius

        def hertz(mbs: Any, t: Any, n: Any, u: Any, v: Any, k: Any, d: Any, o: Any) -> Any:
            depth = esym.max(span - u[0], esym.Real(0.0))
            return [-p.S5.k * esym.pow(depth, p.S5.e), 0.0, 0.0]

        nodes = [
            add_point(system, (x, 0.0, 0.0), p.S5.mass, (v, 0.0, 0.0))
            for x, v in zip(p.s5_positions(), speeds, strict=True)
        ]
        for pair in itertools.pairwise([add_marker(system, node) for node in nodes]):
            function = _symbolic(system, hertz)
            system.AddObject(
                CartesianSpringDamper(markerNumbers=list(pair), springForceUserFunction=function)
            )
        return nodes

    runs = (
        (
            "hertz; symbolic user function of a spring",
            springs,
            "symbolic ",
            [
                *_auto("DOPRI5", (1e-5, 1e-7, 1e-9, 1e-11), 1e-2),
                *_auto("DOPRI5", (1e-7, 1e-9), 1e-3),
                *_fixed("VelocityVerlet", (1e-4, 1e-5)),
                *_fixed("RK44", (1e-4, 1e-5)),
            ],
        ),
        (
            "hertz; ObjectContactSphereSphere, exponent 1.5",
            connectors,
            "connector ",
            [
                *_auto("DOPRI5", (1e-8,), 1e-3),
                *_auto("DOPRI5", (1e-8, 1e-11), 1e-4),
                *_fixed("VelocityVerlet", (1e-4, 1e-5, 1e-6)),
                *_fixed("RK44", (1e-4, 1e-5)),
                *_fixed("GeneralizedAlpha", (1e-4, 1e-5), rho=1.0),
            ],
        ),
    )
    for note, build, name, solvers in runs:
        for solver in solvers:
            made = functools.partial(Case, build, solver, p.S5.end_time, note, True)
            yield name + solver.label, made


def _grains(count: int) -> Cases:
    def build(exu: Any, system: Any) -> list[Any]:
        contact = Contact(system, p.S7.law, p.S7.mu)
        nodes = []
        for place in p.s7_positions(count):
            node = add_ball(system, place, p.S7.mass, p.S7.radius)
            marker = add_marker(system, node)
            add_pull(system, marker, (0.0, 0.0, -p.GRAVITY * p.S7.mass))
            contact.sphere(marker, p.S7.radius)
            nodes.append(node)
        half, top, side = p.s7_half_width(count), 4 * p.s7_half_width(count), p.s7_side(count)
        ground = add_ground_marker(system)
        h = half
        for corners in (
            [(-h, -h, 0.0), (h, -h, 0.0), (h, h, 0.0), (-h, h, 0.0)],
            [(-h, -h, 0.0), (-h, h, 0.0), (-h, h, top), (-h, -h, top)],
            [(h, -h, 0.0), (h, -h, top), (h, h, top), (h, h, 0.0)],
            [(-h, -h, 0.0), (-h, -h, top), (h, -h, top), (h, -h, 0.0)],
            [(-h, h, 0.0), (h, h, 0.0), (h, h, top), (-h, h, top)],
        ):
            contact.rectangle(ground, corners)
        contact.search((side, side, side), (-h, -h, 0.0), (h, h, 2.5 * h))
        return nodes

    note = "linear_noclip; GeneralContact, friction linear below 1e-3 m/s, one thread"
    # one run of 8000 takes as long as it may
    euler, verlet = {125: ((2e-4, 1e-4), (5e-4, 2e-4)), 1000: ((2e-4,), (5e-4, 2e-4))}.get(
        count, ((), (5e-4,))
    )
    solvers = [*_fixed("ExplicitEuler", euler), *_fixed("VelocityVerlet", verlet)]
    for solver in solvers:
        yield (
            solver.label,
            functools.partial(
                Case,
                build,
                solver,
                p.S7.end_time,
                note,
                many=True,
                sample=p.s7_sample(count),
            ),
        )


def _chain(count: int) -> Cases:
    def as_tree(exu: Any, system: Any) -> list[Any]:
        return jointed.tree(exu, system, count)

    def with_joints(exu: Any, system: Any) -> list[Any]:
        return jointed.jointed(exu, system, count)

    fixed = {
        2: (1e-2, 5e-3, 2e-3, 1e-3),
        10: (1e-2, 5e-3, 2e-3, 1e-3, 5e-4, 2e-4),
        40: (1e-3, 5e-4, 2e-4),
    }[count]
    # of 40 rods at 1e-11 its steps shrink without end
    tols = (1e-5, 1e-6, 1e-7, 1e-8, 1e-9) if count == 40 else tuple(10.0**-k for k in range(4, 13))
    solvers = [
        *_fixed("VelocityVerlet", (1e-3,)),
        *_fixed("RK44", fixed),
        *_fixed("RK67", fixed),
        *_auto("DOPRI5", tols, 0.1),
        *([] if count == 40 else _auto("ODE23", (1e-4, 1e-6), 0.1)),
        *_fixed("GeneralizedAlpha", (1e-3,)),
    ]
    end = p.S8.end_time[count]
    note = "kinematic tree; rows of automatic steps by polynomials through four of them"
    for solver in solvers:
        yield (
            f"tree {solver.label}",
            functools.partial(Case, as_tree, solver, end, note, rows=jointed.tree_rows),
        )
    for solver in (
        *_fixed("GeneralizedAlpha", (1e-3,)),
        *_fixed("TrapezoidalIndex2", (1e-3, 1e-4) if count == 2 else (1e-3,)),
    ):
        yield (
            f"joints {solver.label}",
            functools.partial(
                Case,
                with_joints,
                solver,
                end,
                "plane bodies with joints",
                rows=jointed.jointed_rows,
            ),
        )


def _slider_crank() -> Cases:
    def build(slide: bool, exu: Any, system: Any) -> list[Any]:
        return jointed.slider_crank(exu, system, slide)

    steps = (2e-3, 1e-3, 5e-4, 2e-4, 1e-4, 5e-5)
    for slide, name, solvers in (
        (
            True,
            "slide",
            [*_fixed("GeneralizedAlpha", (1e-3,)), *_fixed("TrapezoidalIndex2", (1e-3,))],
        ),
        (
            False,
            "axis",
            [
                *_fixed("GeneralizedAlpha", steps),
                *_fixed("TrapezoidalIndex2", steps),
                *(Solver("TrapezoidalIndex2", step, fresh=True) for step in steps),
            ],
        ),
    ):
        for solver in solvers:
            yield (
                f"{name} {solver.label}",
                functools.partial(
                    Case,
                    functools.partial(build, slide),
                    solver,
                    p.S8B.end_time,
                    "plane bodies with joints",
                    rows=jointed.crank_rows,
                ),
            )
