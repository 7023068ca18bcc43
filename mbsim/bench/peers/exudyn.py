"""Exudyn: Lie group integrators, penalty contact, user laws in Python or as symbolic expressions.

Its fast build (no range checks) is used. Rows are internal sensors, so no Python runs between
them; with automatic steps every step is stored, which costs nothing measurable, and rows of the
drops are read off the cubic through the steps around them, outside the timed loop.
"""

from __future__ import annotations

import functools
import itertools
import math
import sys
import time
import warnings
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np

from mbsim.bench import parameters as p
from mbsim.bench.outcome import Outcome
from mbsim.bench.peers import common
from mbsim.bench.peers import exudyn_linkages as jointed

NAME = "exudyn"


class Solver(NamedTuple):
    """An integrator of Exudyn; `tol` > 0 asks for automatic steps of at most `step`."""

    name: str
    step: float  # s
    tol: float = 0.0
    rho: float = 0.9  # spectral radius of the generalised alpha method
    fresh: bool = False  # a new Jacobian every step

    @property
    def label(self) -> str:
        """How the setting is called."""
        if self.tol:
            return f"{self.name} tol={self.tol:g} hmax={self.step:g}"
        rho = f" rho={self.rho:g}" if self.name == "GeneralizedAlpha" else ""
        fresh = " Jacobian every step" if self.fresh else ""
        return f"{self.name}{rho}{fresh} dt={self.step:g}"

    @property
    def implicit(self) -> bool:
        """Whether each step solves equations."""
        return self.name in ("GeneralizedAlpha", "TrapezoidalIndex2")


class Case(NamedTuple):
    """A scene under one setting; `build` fills a system and returns its bodies' nodes."""

    build: Callable[[Any, Any], list[Any]]
    solver: Solver
    end_time: float  # s
    note: str = ""
    grid: bool = False  # rows of automatic steps are brought to the 10-ms grid
    many: bool = False  # S7: sparse, one mass matrix a body, rows from a step function, capped
    sample: float = p.SAMPLE  # s
    rows: RowsOf | None = None  # from times, all coordinates and rates; None: one body a node


RowsOf = Callable[[np.ndarray, np.ndarray, np.ndarray], common.Rows]
Cases = Iterator[tuple[str, Callable[[], Case]]]


def _engine() -> Any:
    if "exudyn" not in sys.modules:
        sys.exudynFast = True  # type: ignore[attr-defined]  # its switch to the build without range checks
        with common.silence():
            import exudyn
    import exudyn

    exudyn.config.printToConsole = False
    return exudyn


def version() -> str:
    """The engine's version."""
    return str(_engine().__version__)


def settings(scene: str) -> list[str]:
    """Settings of one scene, coarse to fine; empty if the scene is not known."""
    return list(_cases(scene))


def run(scene: str, setting: str, repeats: int) -> Outcome:
    """Run `scene` under `setting`; the wall time is the median of `repeats` loops."""
    case = _cases(scene)[setting]()
    with common.silence(), warnings.catch_warnings():
        warnings.simplefilter("ignore")  # Exudyn's own notices of renamed parameters
        return _run(case, repeats)


def _run(case: Case, repeats: int) -> Outcome:
    exu = _engine()
    options = _options(exu, case)
    implicit = case.solver.implicit
    kind = exu.MainSolverImplicitSecondOrder if implicit else exu.MainSolverExplicit

    def once() -> tuple[float, Any]:
        # a system of its own each time: GeneralContact remembers the run before
        container = exu.SystemContainer()
        system = container.AddSystem()
        nodes = case.build(exu, system)
        store = _Steps(system, case) if case.many else _Sensors(exu, system, nodes)
        system.Assemble()
        solver = kind()
        solver.InitializeSolver(system, options)
        start = time.perf_counter()
        store.start = start
        solver.SolveSteps(system, options)
        wall = time.perf_counter() - start
        solver.FinalizeSolver(system, options)
        if case.rows is not None:
            rows = case.rows(*_coordinates(store, case))
        else:
            rows = _rows(*store.coordinates(len(nodes)), _places(exu, system, nodes))
        return wall, (rows, solver.it.currentStepIndex - 1)  # it counts from 1

    wall, (rows, steps) = common.measure(once, repeats)
    if case.solver.tol and case.grid and case.rows is None:
        rows = _on_grid(rows, case)
    extra = {"steps": float(steps)}
    if case.many:
        extra |= common.s7_measures(rows.position)
    return common.outcome(wall, rows, case.note, case.end_time, extra)


def _places(exu: Any, system: Any, nodes: list[Any]) -> np.ndarray:
    """Places of the nodes in the reference configuration (m), from which coordinates count."""
    position, reference = exu.OutputVariableType.Position, exu.ConfigurationType.Reference
    return np.array([system.GetNodeOutput(node, position, reference) for node in nodes])


def _coordinates(store: Any, case: Case) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times and all coordinates and their rates, at multiples of the sample time."""
    at_steps, x, v = store.all_coordinates()
    if not case.solver.tol:
        return at_steps, x, v
    at = np.arange(round(case.end_time / case.sample) + 1) * case.sample
    return at, *common.through_four(at_steps, x, v, at)


def _options(exu: Any, case: Case) -> Any:
    options, solver = exu.SimulationSettings(), case.solver
    options.solution.file.write = False
    # a hair less than the sample time: the sum of the steps may fall short of it
    options.solution.sensors.writePeriod = 1e-12 if solver.tol else case.sample * (1 - 1e-9)
    steps = options.timeIntegration
    steps.solverType = getattr(exu.DynamicSolverType, solver.name)
    steps.endTime = case.end_time
    steps.numberOfSteps = round(case.end_time / solver.step)
    steps.automaticStepSize = solver.tol > 0
    if solver.tol:
        steps.relativeTolerance = steps.absoluteTolerance = solver.tol
        steps.initialStepSize = min(1e-4, solver.step)
        steps.minimumStepSize = 1e-13
    steps.verboseMode = 0
    if solver.name == "TrapezoidalIndex2":  # as Exudyn's own SolveDynamic sets it
        steps.generalizedAlpha.useIndex2Constraints = steps.generalizedAlpha.useNewmark = True
    steps.newton.modifiedNewtonJacUpdatePerStep = solver.fresh
    steps.generalizedAlpha.spectralRadius = solver.rho
    steps.explicit.computeEndOfStepAccelerations = False
    if case.many:
        steps.explicit.computeMassMatrixInversePerBody = True
        options.linearSolver.solverType = exu.LinearSolverType.EigenSparse
    return options


# ---------------------------------------------------------------------------------------------
# Rows


class _Sensors:
    """Two internal sensors a body: the node's coordinates and their rates."""

    def __init__(self, exu: Any, system: Any, nodes: list[Any]) -> None:
        from exudyn.itemInterface import SensorNode

        kinds = (exu.OutputVariableType.Coordinates, exu.OutputVariableType.Coordinates_t)
        self.start = 0.0  # s, of the clock
        self._system = system
        self._sensors = [
            [
                system.AddSensor(
                    SensorNode(nodeNumber=node, storeInternal=True, outputVariableType=kind)
                )
                for kind in kinds
            ]
            for node in nodes
        ]

    def coordinates(self, bodies: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Times (n,), coordinates and rates (n, bodies, 3 or 6)."""
        stored = [[self._system.GetSensorStoredData(s) for s in pair] for pair in self._sensors]
        x = np.stack([pair[0][:, 1:] for pair in stored], axis=1)
        v = np.stack([pair[1][:, 1:] for pair in stored], axis=1)
        return stored[0][0][:, 0], x, v

    def all_coordinates(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Times (n,), coordinates and rates (n, all) of nodes of any size."""
        stored = [[self._system.GetSensorStoredData(s) for s in pair] for pair in self._sensors]
        x, v = (np.hstack([pair[k][:, 1:] for pair in stored]) for k in range(2))
        return stored[0][0][:, 0], x, v


class _Steps:
    """Rows of many bodies at once, copied by a function that runs after every step."""

    def __init__(self, system: Any, case: Case) -> None:
        self.start = 0.0  # s, of the clock
        self._times = [-case.sample]
        self._x: list[np.ndarray] = []
        self._v: list[np.ndarray] = []
        every = case.sample - case.solver.step / 2
        data = system.systemData

        def after_step(_: Any, t: float) -> bool:
            if t - self._times[-1] < every:
                return True
            self._times.append(t)
            self._x.append(np.array(data.GetODE2Coordinates()))
            self._v.append(np.array(data.GetODE2Coordinates_t()))
            # stops at a row only, so that wall time and reached time belong together
            return time.perf_counter() - self.start < common.WALL_CAP

        system.SetPostStepUserFunction(after_step)
        self._data = data

    def coordinates(self, bodies: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Times (n,), coordinates and rates (n, bodies, 6)."""
        shape = (len(self._x), bodies, 6)
        return np.array(self._times[1:]), np.reshape(self._x, shape), np.reshape(self._v, shape)


def _rows(time: np.ndarray, x: np.ndarray, v: np.ndarray, places: np.ndarray) -> common.Rows:
    """Rows of point nodes (3) or rigid nodes (and a rotation vector; spin in body axes)."""
    shape = x.shape[:2]
    if x.shape[2] == 3:
        quaternion = np.zeros((*shape, 4))
        quaternion[..., 0] = 1.0
        return common.Rows(time, x + places, quaternion, v, np.zeros((*shape, 3)))
    quaternion = common.quaternion_of(x[..., 3:])
    spin = common.rotate(quaternion, v[..., 3:])
    return common.Rows(time, x[..., :3] + places, quaternion, v[..., :3], spin)


def _on_grid(rows: common.Rows, case: Case) -> common.Rows:
    """Bodies that do not turn, at multiples of the sample time instead of at the steps."""
    at = np.arange(round(case.end_time / case.sample) + 1) * case.sample
    position = np.empty((len(at), *rows.position.shape[1:]))
    velocity = np.empty_like(position)
    for body, axis in np.ndindex(*position.shape[1:]):
        x, v = rows.position[:, body, axis], rows.velocity[:, body, axis]
        position[:, body, axis] = common.hermite(rows.time, x, v, at)
        velocity[:, body, axis] = np.interp(at, rows.time, v)
    bodies = position.shape[1]
    upright = np.tile([1.0, 0.0, 0.0, 0.0], (len(at), bodies, 1))
    return common.Rows(at, position, upright, velocity, np.zeros_like(velocity))


# ---------------------------------------------------------------------------------------------
# Building blocks


def _point(system: Any, place: Any, mass: float, velocity: Any = (0.0, 0.0, 0.0)) -> Any:
    """Node of a mass point."""
    from exudyn.itemInterface import MassPoint, NodePoint

    node = system.AddNode(
        NodePoint(referenceCoordinates=list(place), initialVelocities=list(velocity))
    )
    system.AddObject(MassPoint(mass=mass, nodeNumber=node))
    return node


def _rigid(system: Any, place: Any, mass: float, inertia: Any, twist: Any = (0.0,) * 6) -> Any:
    """Node of a rigid body whose rotation is a vector of the Lie group; spin in body axes."""
    from exudyn.itemInterface import NodeRigidBodyRotVecLG, ObjectRigidBody

    node = system.AddNode(
        NodeRigidBodyRotVecLG(
            referenceCoordinates=[*map(float, place), 0.0, 0.0, 0.0],
            initialVelocities=[*map(float, twist)],
        )
    )
    tensor = [*map(float, inertia), 0.0, 0.0, 0.0]
    system.AddObject(ObjectRigidBody(mass=mass, inertia=tensor, nodeNumber=node))
    return node


def _ball(system: Any, place: Any, mass: float, radius: float, twist: Any = (0.0,) * 6) -> Any:
    inertia = 0.4 * mass * radius**2
    return _rigid(system, place, mass, (inertia,) * 3, twist)


def _marker(system: Any, node: Any) -> Any:
    from exudyn.itemInterface import MarkerNodePosition, MarkerNodeRigid

    point = system.GetNode(node)["nodeType"] == "Point"
    return system.AddMarker((MarkerNodePosition if point else MarkerNodeRigid)(nodeNumber=node))


def _pull(system: Any, marker: Any, force: Any) -> None:
    from exudyn.itemInterface import LoadForceVector

    system.AddLoad(LoadForceVector(markerNumber=marker, loadVector=[float(f) for f in force]))


def _ground_marker(system: Any) -> Any:
    from exudyn.itemInterface import MarkerBodyRigid, ObjectGround

    return system.AddMarker(MarkerBodyRigid(bodyNumber=system.AddObject(ObjectGround())))


class _Contact:
    """GeneralContact with one friction coefficient; a law k, c between any two of its parts.

    Stiffnesses of a pair act in series and dampings add, so each side gets 2 k and c / 2.
    """

    def __init__(self, system: Any, law: p.LinearLaw, mu: float, zone: float = 1e-3) -> None:
        self._contact = system.AddGeneralContact()
        self._contact.SetFrictionPairings(mu * np.eye(1))
        self._contact.SetFrictionProportionalZone(zone)
        self._side = (2 * law.k, law.c / 2, 0)

    def sphere(self, marker: Any, radius: float) -> None:
        """A sphere about a marker."""
        self._contact.AddSphereWithMarker(marker, radius, *self._side)

    def rectangle(self, marker: Any, corners: list[tuple[float, float, float]]) -> None:
        """Two triangles through four corners, counter-clockwise seen from outside."""
        points = [list(map(float, corner)) for corner in corners]
        self._contact.AddTrianglesRigidBodyBased(
            marker, *self._side, pointList=points, triangleList=[[0, 1, 2], [0, 2, 3]]
        )

    def search(self, cells: tuple[int, int, int], low: Any, high: Any) -> None:
        """The boxes in which partners are searched."""
        self._contact.SetSearchTreeCellSize(numberOfCells=list(cells))
        self._contact.SetSearchTreeBox(pMin=list(map(float, low)), pMax=list(map(float, high)))


def _floor(system: Any, contact: _Contact, reach: tuple[float, float], width: float) -> None:
    """The plane z = 0 from reach[0] to reach[1] along x."""
    a, b = reach
    contact.rectangle(
        _ground_marker(system),
        [(a, -width, 0.0), (b, -width, 0.0), (b, width, 0.0), (a, width, 0.0)],
    )
    contact.search((1, 1, 1), (a, -width, -1.0), (b, width, 1.0))


# ---------------------------------------------------------------------------------------------
# Scenes


def _cases(scene: str) -> dict[str, Callable[[], Case]]:
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
        return [_rigid(system, (0.0, 0.0, 0.0), top.mass, top.inertia, twist)]

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
        node = _point(system, place, p.S2.mass)
        marker = _marker(system, node)
        _pull(system, marker, (0.0, 0.0, -p.GRAVITY * p.S2.mass))
        function = _user_function(exu, system, law if symbolic else plain, symbolic)
        system.AddObject(
            CartesianSpringDamper(
                markerNumbers=[_ground_marker(system), marker], springForceUserFunction=function
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
    node = _point(system, (0.0, 0.0, drop.gap + drop.radius), drop.mass)
    marker = _marker(system, node)
    _pull(system, marker, (0.0, 0.0, -p.GRAVITY * drop.mass))
    contact = _Contact(system, law, mu=0.0)
    contact.sphere(marker, drop.radius)
    _floor(system, contact, (-1.0, 1.0), 1.0)
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
        node = _ball(system, (0.0, 0.0, ball.radius - depth), ball.mass, ball.radius, twist)
        marker = _marker(system, node)
        _pull(system, marker, (0.0, 0.0, -p.GRAVITY * ball.mass))
        contact = _Contact(system, law, ball.mu, zone)
        contact.sphere(marker, ball.radius)
        _floor(system, contact, (-2.0, 12.0), 1.0)
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
        node = _rigid(system, (0.0, 0.0, c / 2 - depth), box.mass, inertia)
        _pull(system, _marker(system, node), (box.mass * along, 0.0, -box.mass * down))
        contact = _Contact(system, box.law, mu, zone)
        body = 0  # the first object of the system
        for x, y in itertools.product((-a / 2, a / 2), (-b / 2, b / 2)):
            corner = MarkerBodyRigid(bodyNumber=body, localPosition=[x, y, FOOT - c / 2])
            contact.sphere(system.AddMarker(corner), FOOT)
        _floor(system, contact, (-1.0, 5.0), 1.0)
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
            _ball(system, (x, 0.0, 0.0), p.S5.mass, p.S5.radius, (v, 0.0, 0.0, 0.0, 0.0, 0.0))
            for x, v in zip(p.s5_positions(), speeds, strict=True)
        ]
        for pair in itertools.pairwise([_marker(system, node) for node in nodes]):
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
            _point(system, (x, 0.0, 0.0), p.S5.mass, (v, 0.0, 0.0))
            for x, v in zip(p.s5_positions(), speeds, strict=True)
        ]
        for pair in itertools.pairwise([_marker(system, node) for node in nodes]):
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
        contact = _Contact(system, p.S7.law, p.S7.mu)
        nodes = []
        for place in p.s7_positions(count):
            node = _ball(system, place, p.S7.mass, p.S7.radius)
            marker = _marker(system, node)
            _pull(system, marker, (0.0, 0.0, -p.GRAVITY * p.S7.mass))
            contact.sphere(marker, p.S7.radius)
            nodes.append(node)
        half, top, side = p.s7_half_width(count), 4 * p.s7_half_width(count), p.s7_side(count)
        ground = _ground_marker(system)
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
