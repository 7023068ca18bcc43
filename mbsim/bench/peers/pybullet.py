"""Bullet through pybullet: rigid contact by a velocity LCP, semi-implicit Euler steps.

It knows no contact law; a law of ours enters as an external force between two steps. Its calls
per step are those a user of pybullet has to make.
"""

from __future__ import annotations

import functools
import math
import time
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np

from mbsim.bench import parameters as p
from mbsim.bench.daily import TRAIN
from mbsim.bench.outcome import Outcome
from mbsim.bench.peers import common, laws
from mbsim.bench.peers.laws import Law

NAME = "pybullet"


class Case(NamedTuple):
    """A scene under one setting; `build` returns the bodies in the order of the scene."""

    build: Callable[[Any], list[int]]
    dt: float  # s
    end_time: float  # s
    note: str = ""
    law: Law | None = None  # force (N) of penetration (m) and its rate on the one sphere
    radius: float = 0.0  # m, of that sphere
    sample: float = p.SAMPLE  # s
    cap: float = math.inf  # s of wall time


Cases = Iterator[tuple[str, Callable[[], Case]]]


@functools.cache
def _engine() -> Any:
    with common.silence():
        import pybullet
    return pybullet


def version() -> str:
    """The version of the installed package."""
    from importlib.metadata import version as installed

    return installed("pybullet")


def settings(scene: str) -> list[str]:
    """Settings of one scene, coarse to fine; empty if the engine cannot express it."""
    return list(_cases(scene))


def run(scene: str, setting: str, repeats: int) -> Outcome:
    """Run `scene` under `setting`; the wall time is the median of `repeats` loops."""
    case = _cases(scene)[setting]()
    with common.silence():
        return _run(case, repeats)


def _run(case: Case, repeats: int) -> Outcome:
    bullet = _engine()
    steps = common.plan(case.dt, case.end_time, case.sample)

    def once() -> tuple[float, Any]:
        client = bullet.connect(bullet.DIRECT)
        try:
            bodies = case.build(bullet)
            bullet.setTimeStep(case.dt)
            march = _march if case.law is None else _march_with_law
            wall, rows = march(bullet, bodies, steps, case)
            return wall, rows
        finally:
            bullet.disconnect(client)

    wall, rows = common.measure(once, repeats)
    extra = {"steps": float((len(rows.time) - 1) * steps.steps_per_row)}
    if case.cap != math.inf:
        extra |= common.s7_measures(rows.position)
    return common.outcome(wall, rows, case.note, case.end_time, extra)


def _march(bullet: Any, bodies: list[int], steps: common.Plan, case: Case) -> Any:
    """Steps with nothing between them but the rows."""
    step, pose, twist = (
        bullet.stepSimulation,
        bullet.getBasePositionAndOrientation,
        bullet.getBaseVelocity,
    )
    clock, inner = time.perf_counter, range(steps.steps_per_row)
    stored = [[(pose(b), twist(b)) for b in bodies]]
    start = clock()
    for _ in range(steps.rows):
        for _ in inner:
            step()
        stored.append([(pose(b), twist(b)) for b in bodies])
        if clock() - start > case.cap:
            break
    wall = clock() - start
    return wall, _rows(steps, stored)


def _march_with_law(bullet: Any, bodies: list[int], steps: common.Plan, case: Case) -> Any:
    """Steps with the law's force put on the one sphere before each; sphere on the plane z = 0."""
    step, pose, twist, push = (
        bullet.stepSimulation,
        bullet.getBasePositionAndOrientation,
        bullet.getBaseVelocity,
        bullet.applyExternalForce,
    )
    (body,), frame, radius, law = bodies, bullet.WORLD_FRAME, case.radius, case.law
    assert law is not None
    clock, inner = time.perf_counter, range(steps.steps_per_row)
    stored = [[(pose(body), twist(body))]]
    start = clock()
    for _ in range(steps.rows):
        for _ in inner:
            place = pose(body)[0]
            depth = radius - place[2]
            if depth > 0.0:
                rate = -twist(body)[0][2]
                push(body, -1, (0.0, 0.0, law(depth, rate)), place, frame)
            step()
        stored.append([(pose(body), twist(body))])
    wall = clock() - start
    return wall, _rows(steps, stored)


def _rows(steps: common.Plan, stored: list[Any]) -> common.Rows:
    """Rows of what pybullet returned: quaternions x, y, z, w; velocities in the global frame."""
    flat = np.array([[(*a, *b, *v, *w) for (a, b), (v, w) in row] for row in stored])
    return common.Rows(
        steps.times[: len(flat)],
        flat[..., :3],
        flat[..., [6, 3, 4, 5]],
        flat[..., 7:10],
        flat[..., 10:13],
    )


# ---------------------------------------------------------------------------------------------
# Building blocks


def _body(bullet: Any, mass: float, shape: int, place: Any, maximal: bool = True) -> int:
    """A free body without Bullet's default damping and speed limits."""
    body = bullet.createMultiBody(
        mass,
        shape,
        basePosition=[float(x) for x in place],
        useMaximalCoordinates=int(maximal),
    )
    bullet.changeDynamics(body, -1, linearDamping=0.0, angularDamping=0.0)
    return int(body)


def _sphere(bullet: Any, radius: float) -> int:
    return int(bullet.createCollisionShape(bullet.GEOM_SPHERE, radius=radius))


def _plane(bullet: Any, normal: Any = (0, 0, 1), through: Any = (0, 0, 0)) -> int:
    shape = bullet.createCollisionShape(bullet.GEOM_PLANE, planeNormal=list(normal))
    body = bullet.createMultiBody(0, shape, basePosition=[float(x) for x in through])
    return int(body)


# ---------------------------------------------------------------------------------------------
# Scenes

TICK = 1 / 200  # s, the step nearest to Bullet's default 1/240 that meets rows every 10 ms


def _cases(scene: str) -> dict[str, Callable[[], Case]]:
    """Settings of a scene and what builds each."""
    if scene.startswith("S7_"):
        return dict(_grains(int(scene[3:])))
    scenes: dict[str, Callable[[], Cases]] = {
        "S1": lambda: _free(p.S1, (1e-2, 1e-3, 1e-4)),
        "S2a": lambda: _law_drop(laws.impact, "impact"),
        "S2b": lambda: _law_drop(laws.linear, "linear"),
        "S2c": lambda: _law_drop(laws.hunt_crossley, "hc"),
        "S3": _rolling,
        "S4stick": lambda: _box(p.S4.mu_stick, p.S4.stick_end_time, (TICK, 2e-3, 1e-3, 2.5e-4)),
        "S4slip": lambda: _box(p.S4.mu_slip, p.S4.slip_end_time, (TICK, 2e-3, 1e-3, 2.5e-4, 1e-4)),
        "S5": _row,
        "S9plane": _torus,
        "S10a": _stiff_drop,
        "S10c": lambda: _free(p.S10C, (1e-3, 1e-4, 1e-5)),
        "cylinder_train": _train,
    }
    return dict(scenes[scene]()) if scene in scenes else {}


def _free(top: p.FreeBody, dts: tuple[float, ...]) -> Cases:
    def build(maximal: bool, bullet: Any) -> list[int]:
        body = _body(bullet, top.mass, _sphere(bullet, 0.1), (0.0, 0.0, 0.0), maximal)
        bullet.changeDynamics(
            body, -1, localInertiaDiagonal=list(top.inertia), maxJointVelocity=1e9
        )
        # q(0) = 1, so the spin in body axes is the spin in the global frame
        bullet.resetBaseVelocity(body, [0.0, 0.0, 0.0], list(top.spin))
        return [body]

    note = "semi-implicit Euler; Bullet limits the turn of a step to pi/4"
    for maximal in (True, False):
        for dt in dts:
            name = f"maximal={int(maximal)} dt={dt:g}"
            made = functools.partial(build, maximal)
            yield name, functools.partial(Case, made, dt, top.end_time, note)


def _law_drop(law: Law, variant: str) -> Cases:
    def build(bullet: Any) -> list[int]:
        bullet.setGravity(0.0, 0.0, -p.GRAVITY)
        place = (0.0, 0.0, p.S2.gap + p.S2.radius)
        return [_body(bullet, p.S2.mass, _sphere(bullet, p.S2.radius), place)]

    note = f"{variant}; law by applyExternalForce between steps"
    for dt in (1e-3, 1e-4, 1e-5):
        yield (
            f"applyExternalForce dt={dt:g}",
            functools.partial(Case, build, dt, p.S2.end_time, note, law, p.S2.radius),
        )


def _torus() -> Cases:
    vertices, _ = p.torus_mesh(p.S9)
    x, y, z = p.torus_inertia(p.S9)

    def build(bullet: Any) -> list[int]:
        bullet.setGravity(0.0, 0.0, -p.GRAVITY)
        bullet.changeDynamics(_plane(bullet), -1, lateralFriction=1.0)
        shape = bullet.createCollisionShape(bullet.GEOM_MESH, vertices=vertices.tolist())
        body = _body(bullet, p.S9.mass, shape, (0.0, 0.0, p.S9.height), maximal=False)
        bullet.changeDynamics(body, -1, lateralFriction=p.S9.mu, localInertiaDiagonal=[x, y, z])
        turn = bullet.getQuaternionFromAxisAngle([1.0, 0.0, 0.0], p.S9.tilt)
        bullet.resetBasePositionAndOrientation(body, [0.0, 0.0, p.S9.height], turn)
        return [body]

    note = "rigid; a moving mesh is its convex hull, which cannot meet another torus"
    for dt in (TICK, 1e-3):
        yield f"convex hull dt={dt:g}", functools.partial(Case, build, dt, p.S9.end_time, note)


def _rolling() -> Cases:
    def build(bullet: Any) -> list[int]:
        bullet.setGravity(0.0, 0.0, -p.GRAVITY)
        bullet.changeDynamics(_plane(bullet), -1, lateralFriction=1.0)
        shape = _sphere(bullet, p.S3.radius)
        body = _body(bullet, p.S3.mass, shape, (0.0, 0.0, p.S3.radius))
        # friction coefficients of a pair are multiplied
        bullet.changeDynamics(
            body, -1, lateralFriction=p.S3.mu, rollingFriction=0.0, spinningFriction=0.0
        )
        bullet.resetBaseVelocity(body, [p.S3.speed, 0.0, 0.0], [0.0, 0.0, 0.0])
        return [body]

    for dt in (1e-2, TICK, 1e-3, 1e-4, 2e-5):
        name = f"default dt={dt:.4g}"
        yield name, functools.partial(Case, build, dt, p.S3.end_time, "rigid, starts touching")


def _box(mu: float, end_time: float, dts: tuple[float, ...]) -> Cases:
    def build(bullet: Any) -> list[int]:
        tilt = p.S4.tilt
        bullet.setGravity(p.GRAVITY * math.sin(tilt), 0.0, -p.GRAVITY * math.cos(tilt))
        bullet.changeDynamics(_plane(bullet), -1, lateralFriction=1.0)
        shape = bullet.createCollisionShape(
            bullet.GEOM_BOX, halfExtents=[edge / 2 for edge in p.S4.size]
        )
        body = _body(bullet, p.S4.mass, shape, (0.0, 0.0, p.S4.size[2] / 2))
        bullet.changeDynamics(body, -1, lateralFriction=mu)
        return [body]

    for dt in dts:
        name = f"default dt={dt:.4g}"
        yield name, functools.partial(Case, build, dt, end_time, "rigid, starts touching")


def _row() -> Cases:
    def build(bullet: Any) -> list[int]:
        # by default contacts slower than 0.2 m/s have no restitution
        bullet.setPhysicsEngineParameter(restitutionVelocityThreshold=0.0)
        shape = _sphere(bullet, p.S5.radius)
        bodies = []
        for x in p.s5_positions():
            body = _body(bullet, p.S5.mass, shape, (x, 0.0, 0.0))
            bullet.changeDynamics(body, -1, restitution=1.0, lateralFriction=0.0)
            bodies.append(body)
        bullet.resetBaseVelocity(bodies[0], [p.S5.speed, 0.0, 0.0], [0.0, 0.0, 0.0])
        return bodies

    for dt in (1e-3, 1e-4):
        name = f"restitution 1 dt={dt:g}"
        note = "rigid, Newton restitution 1: knows no Hertz law"
        yield name, functools.partial(Case, build, dt, p.S5.end_time, note)


def _stiff_drop() -> Cases:
    drop = p.S10A

    def build(law: bool, bullet: Any) -> list[int]:
        bullet.setGravity(0.0, 0.0, -p.GRAVITY)
        # a contact that is foreseen loses its restitution: foresee less
        bullet.setPhysicsEngineParameter(contactBreakingThreshold=1e-5)
        place = (0.0, 0.0, drop.gap + drop.radius)
        body = _body(bullet, drop.mass, _sphere(bullet, drop.radius), place)
        for one in (_plane(bullet), body):
            if law:
                bullet.changeDynamics(
                    one, -1, contactStiffness=p.S10A_LAW.k, contactDamping=p.S10A_LAW.c
                )
            else:
                bullet.changeDynamics(one, -1, restitution=1.0)
        return [body]

    for law, name, note in (
        (True, "contactStiffness", "k and c as Bullet's contactStiffness and contactDamping"),
        (False, "restitution 1", "rigid, Newton restitution 1"),
    ):
        for dt in (1e-3, 1e-4):
            made = functools.partial(build, law)
            yield f"{name} dt={dt:g}", functools.partial(Case, made, dt, drop.end_time, note)


def _grains(count: int) -> Cases:
    half = p.s7_half_width(count)
    friction = math.sqrt(p.S7.mu)  # coefficients of a pair are multiplied

    def build(bullet: Any) -> list[int]:
        bullet.setGravity(0.0, 0.0, -p.GRAVITY)
        for normal, through in (
            ((0, 0, 1), (0.0, 0.0, 0.0)),
            ((1, 0, 0), (-half, 0.0, 0.0)),
            ((-1, 0, 0), (half, 0.0, 0.0)),
            ((0, 1, 0), (0.0, -half, 0.0)),
            ((0, -1, 0), (0.0, half, 0.0)),
        ):
            bullet.changeDynamics(_plane(bullet, normal, through), -1, lateralFriction=friction)
        shape = _sphere(bullet, p.S7.radius)
        bodies = []
        for place in p.s7_positions(count):
            body = _body(bullet, p.S7.mass, shape, place)
            bullet.changeDynamics(body, -1, lateralFriction=friction)
            bodies.append(body)
        return bodies

    note = "rigid, no restitution"
    steps = {125: (TICK, 2e-3, 1e-3), 1000: (TICK, 1e-3)}.get(count, (TICK,))
    for dt in steps:
        end, sample = p.S7.end_time, p.s7_sample(count)
        yield (
            f"maximal=1 dt={dt:.4g}",
            functools.partial(Case, build, dt, end, note, sample=sample, cap=common.WALL_CAP),
        )


def _train() -> Cases:
    friction = math.sqrt(TRAIN.mu)  # coefficients of a pair are multiplied
    along, across = TRAIN.inertia

    def build(bullet: Any) -> list[int]:
        bullet.setGravity(*TRAIN.pull())
        for normal, through in (((0, 0, 1), (0, 0, 0)), ((-1, 0, 0), (TRAIN.wall, 0, 0))):
            bullet.changeDynamics(_plane(bullet, normal, through), -1, lateralFriction=friction)
        shape = bullet.createCollisionShape(
            bullet.GEOM_CYLINDER, radius=TRAIN.radius, height=TRAIN.length
        )
        lying = bullet.getQuaternionFromAxisAngle([1.0, 0.0, 0.0], -math.pi / 2.0)
        bodies = []
        for x in TRAIN.centres().tolist():
            place = [x, 0.0, TRAIN.radius]
            # with maximal coordinates all places become NaN here
            body = _body(bullet, TRAIN.mass, shape, place, maximal=False)
            bullet.changeDynamics(
                body,
                -1,
                lateralFriction=friction,
                localInertiaDiagonal=[across, across, along],
            )
            bullet.resetBasePositionAndOrientation(body, place, lying)
            bodies.append(body)
        return bodies

    note = "rigid, no restitution, starts touching"
    for dt in (1e-2, TICK, 2e-3, 1e-3, 5e-4, 2e-4):
        yield f"default dt={dt:.4g}", functools.partial(Case, build, dt, TRAIN.end_time, note)
