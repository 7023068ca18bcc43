"""MuJoCo: soft constraints by convex optimisation, or a law of ours through ``mjcb_passive``.

Each setting is the dynamics' options and a step. Rows are copies of ``qpos`` and ``qvel``; between
two rows the steps run in compiled code (``mj_step`` with ``nstep``, or the ``rollout`` module where
every step is a row).
"""

from __future__ import annotations

import functools
import itertools
import math
import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from mbsim.bench import parameters as p
from mbsim.bench.outcome import Outcome
from mbsim.bench.peers import common
from mbsim.bench.peers import mujoco_boxes as boxes
from mbsim.bench.peers import mujoco_daily as daily
from mbsim.bench.peers import mujoco_linkages as jointed
from mbsim.bench.peers import mujoco_quadruped as walker
from mbsim.bench.peers.laws import Law, hertz, hunt_crossley, impact, linear, stiff
from mbsim.bench.peers.mujoco_laws import Case, callback

NAME = "mujoco"


def _engine() -> Any:
    import mujoco

    return mujoco


def version() -> str:
    """The engine's version."""
    return str(_engine().__version__)


def settings(scene: str) -> list[str]:
    """Settings of one scene, coarse to fine; empty if the scene is not known."""
    return list(_cases(scene))


def run(scene: str, setting: str, repeats: int) -> Outcome:
    """Run `scene` under `setting`; the wall time is the median of `repeats` loops."""
    case = _cases(scene)[setting]()
    with common.silence():
        return _run(case, repeats)


def _run(case: Case, repeats: int) -> Outcome:
    mujoco = _engine()
    warnings: list[str] = []
    mujoco.set_mju_user_warning(warnings.append)  # else it writes a file where one stands
    model = mujoco.MjModel.from_xml_string(case.xml)
    data = mujoco.MjData(model)
    steps = common.plan(case.dt, case.end_time, case.sample)
    one_a_row = steps.steps_per_row == 1 and case.law is None and case.cap == float("inf")
    rollout = one_a_row or case.control is not None
    march = functools.partial(_rollout, control=case.control) if rollout else _march
    height = _rest_height(model, data) if case.settle else None

    def once() -> tuple[float, Any]:
        mujoco.mj_resetData(model, data)
        if height is not None:
            data.qpos[2] = height
        if case.position is not None:
            data.qpos[:] = case.position
        data.qvel[:] = case.velocity.ravel()
        return march(model, data, steps, case.cap)

    try:
        mujoco.set_mjcb_passive(callback(case, data))
        wall, (qpos, qvel) = common.measure(once, repeats)
    finally:
        mujoco.set_mjcb_passive(None)
        mujoco.set_mju_user_warning(None)
    rows = (case.rows or _free_rows)(steps.times[: len(qpos)], qpos, qvel)
    note = f"{case.note}; {len(warnings)} warnings" if warnings else case.note
    extra = {"steps": float((len(qpos) - 1) * steps.steps_per_row)}
    if case.cap != float("inf"):
        extra |= common.s7_measures(rows.position)
    return common.outcome(wall, rows, note.lstrip("; "), case.end_time, extra)


def _rest_height(model: Any, data: Any) -> float:
    """Height of the one body (m) where its soft contact holds it; gravity is put back after."""
    along = np.array(model.opt.gravity[:2])
    model.opt.gravity[:2] = 0.0
    _engine().mj_step(model, data, round(2.0 / model.opt.timestep))
    model.opt.gravity[:2] = along
    return float(data.qpos[2])


# ---------------------------------------------------------------------------------------------
# Stepping


def _march(model: Any, data: Any, steps: common.Plan, cap: float) -> tuple[float, Any]:
    """Rows by ``mj_step`` with the steps between two rows in one call."""
    step, count, clock = _engine().mj_step, steps.steps_per_row, time.perf_counter
    now_q, now_v = data.qpos, data.qvel
    qpos = np.empty((steps.rows + 1, len(now_q)))
    qvel = np.empty((steps.rows + 1, len(now_v)))
    qpos[0], qvel[0] = now_q, now_v
    done = 0
    start = clock()
    for done in range(1, steps.rows + 1):
        step(model, data, count)
        qpos[done] = now_q
        qvel[done] = now_v
        if clock() - start > cap:
            break
    wall = clock() - start
    return wall, (qpos[: done + 1], qvel[: done + 1])


def _rollout(
    model: Any, data: Any, steps: common.Plan, cap: float, control: Any = None
) -> tuple[float, Any]:
    """Rows by the ``rollout`` module, which stores every step without Python between.

    `control` is read in the middle of each step.
    """
    from mujoco import rollout

    del cap  # only short scenes have a row a step or drives
    mujoco = _engine()
    spec = mujoco.mjtState.mjSTATE_FULLPHYSICS
    state = np.empty(mujoco.mj_stateSize(model, spec))
    mujoco.mj_getState(model, data, state, spec)
    count = steps.rows * steps.steps_per_row
    driven = None if control is None else control((np.arange(count) + 0.5) * steps.dt)[None]
    with rollout.Rollout(nthread=0) as roll:
        start = time.perf_counter()
        stored, _ = roll.rollout(model, data, state, driven, nstep=count)
        wall = time.perf_counter() - start
    every = steps.steps_per_row
    states = np.vstack([state, stored[0][every - 1 :: every]])[:, 1:]  # column 0 is the time
    return wall, (states[:, : model.nq], states[:, model.nq : model.nq + model.nv])


def _free_rows(time: np.ndarray, qpos: np.ndarray, qvel: np.ndarray) -> common.Rows:
    """Rows of free joints: qpos is place and quaternion; the spin is in the body's frame."""
    n = len(qpos)
    pose, twist = qpos.reshape(n, -1, 7), qvel.reshape(n, -1, 6)
    quaternion = pose[..., 3:]
    spin = common.rotate(quaternion, twist[..., 3:])
    return common.Rows(time, pose[..., :3], quaternion, twist[..., :3], spin)


# ---------------------------------------------------------------------------------------------
# Scenes


def _cases(scene: str) -> dict[str, Callable[[], Case]]:
    """Settings of a scene and what builds each."""
    if scene.startswith("S7_"):
        return dict(_grains(int(scene[3:])))
    if scene.startswith("S8_"):
        return dict(_chain(int(scene[3:])))
    scenes: dict[str, Callable[[], Iterator[tuple[str, Callable[[], Case]]]]] = {
        "S1": lambda: _free(p.S1),
        "S2a": lambda: _callback_drop(p.S2, impact, "impact"),
        "S2b": _soft_drop,
        "S2c": lambda: _callback_drop(p.S2, hunt_crossley, "hc"),
        "S3": _rolling,
        "S4stick": lambda: _box(p.S4.mu_stick, p.S4.stick_end_time, (1e-2, 2e-3, 5e-4)),
        "S4slip": lambda: _box(p.S4.mu_slip, p.S4.slip_end_time, (1e-2, 2e-3, 5e-4, 1e-4)),
        "S5": _row,
        "S6": lambda: boxes.pile([p.S6.mass] * p.S6.count, p.S6),
        "S8b": _slider_crank,
        "S9plane": _torus,
        "S10a": _stiff_drop,
        "S10b": lambda: boxes.pile([p.S10B.mass, p.S10B.above], p.S10B),
        "S10c": lambda: _free(p.S10C),
        "bin_50": lambda: boxes.bin_of(50),
        "bin_200": lambda: boxes.bin_of(200),
        "quadruped": walker.quadruped,
        "chain_box": daily.chain_box,
        "cylinder_train": daily.cylinder_train,
        "drum_300": lambda: daily.drum_of(300),
        "drum_3000": lambda: daily.drum_of(3000),
    }
    return dict(scenes[scene]()) if scene in scenes else {}


def _xml(option: str, world: str, flags: str = "", head: str = "") -> str:
    return (
        f"<mujoco>{head}<option {option}><flag {flags}/></option>"
        f"<worldbody>{world}</worldbody></mujoco>"
    )


def _sphere(at: tuple[float, float, float], radius: float, mass: float, more: str = "") -> str:
    place = " ".join(repr(float(x)) for x in at)
    return (
        f'<body pos="{place}"><freejoint/>'
        f'<geom type="sphere" size="{radius!r}" mass="{mass!r}" {more}/></body>'
    )


def _still(bodies: int) -> np.ndarray:
    return np.zeros((bodies, 6))


def _free(top: p.FreeBody) -> Iterator[tuple[str, Callable[[], Case]]]:
    steps = {
        "Euler": (1e-2, 1e-3, 1e-4),
        "implicit": (1e-2, 1e-3, 1e-4),
        "RK4": (1e-2, 1e-3, 1e-4) if top is p.S1 else (1e-3, 1e-4, 1e-5),
    }
    inertia = " ".join(map(repr, top.inertia))
    body = (
        "<body><freejoint/>"
        f'<inertial pos="0 0 0" mass="{top.mass!r}" diaginertia="{inertia}"/></body>'
    )
    velocity = np.array([[0.0, 0.0, 0.0, *top.spin]])

    def case(integrator: str, dt: float) -> Case:
        option = f'timestep="{dt!r}" integrator="{integrator}" gravity="0 0 0"'
        flags = 'contact="disable" constraint="disable"'
        return Case(_xml(option, body, flags), dt, top.end_time, velocity)

    for integrator, dts in steps.items():
        for dt in dts:
            yield f"{integrator} dt={dt:g}", functools.partial(case, integrator, dt)


def _callback_drop(
    drop: p.Drop, law: Law, variant: str, dts: tuple[float, ...] = (1e-4, 3e-5, 1e-5, 3e-6)
) -> Iterator[tuple[str, Callable[[], Case]]]:
    """The sphere and a law through mjcb_passive, first in Python, then compiled."""
    steps = tuple(p.SAMPLE / round(p.SAMPLE / dt) for dt in dts)
    world = _sphere((0.0, 0.0, drop.gap + drop.radius), drop.radius, drop.mass)

    def case(integrator: str, dt: float, compiled: bool) -> Case:
        option = f'timestep="{dt!r}" integrator="{integrator}" gravity="0 0 {-p.GRAVITY}"'
        flags = 'contact="disable" constraint="disable"'
        note = f"{variant}; law through mjcb_passive, {'compiled' if compiled else 'Python'}"
        xml = _xml(option, world, flags)
        velocity = _still(1)
        return Case(xml, dt, drop.end_time, velocity, note, law, compiled, "plane", drop.radius)

    runs = [(kind, dt) for dt in steps for kind in ("Euler", "RK4")]
    for compiled, (integrator, dt) in itertools.product((False, True), runs):
        if compiled or dt in (steps[0], steps[-1]):
            name = f"mjcb_passive{' compiled' if compiled else ''} {integrator} dt={dt:.4g}"
            yield name, functools.partial(case, integrator, dt, compiled)


def _drop_xml(drop: p.Drop, dt: float, integrator: str, soft: str, flags: str = "") -> str:
    """Sphere above the plane, frictionless, with the contact's softness on both geoms."""
    contact = f'condim="1" {soft}'
    world = f'<geom type="plane" size="0 0 1" {contact}/>' + _sphere(
        (0.0, 0.0, drop.gap + drop.radius), drop.radius, drop.mass, contact
    )
    option = f'timestep="{dt!r}" integrator="{integrator}" gravity="0 0 {-p.GRAVITY}"'
    return _xml(option, world, flags)


def _soft(k: float, c: float, mass: float) -> str:
    """Softness whose limit is the acceleration (k d + c d')/m in contact, see S2b."""
    return f'solref="{-k / mass!r} {-c / mass!r}" solimp=".9999 .9999 .001 .5 2"'


def _soft_drop() -> Iterator[tuple[str, Callable[[], Case]]]:
    def case(integrator: str, dt: float) -> Case:
        soft = _soft(p.S2B_LAW.k, p.S2B_LAW.c, p.S2.mass)
        xml = _drop_xml(p.S2, dt, integrator, soft)
        return Case(xml, dt, p.S2.end_time, _still(1), "mujoco")

    for integrator in ("Euler", "RK4"):
        for dt in (1e-3, 1e-4, 1e-5):
            yield f"soft {integrator} dt={dt:g}", functools.partial(case, integrator, dt)
    yield from _callback_drop(p.S2, linear, "linear")


def _stiff_drop() -> Iterator[tuple[str, Callable[[], Case]]]:
    def case(dt: float, direct: bool) -> Case:
        soft = _soft(p.S10A_LAW.k, p.S10A_LAW.c, p.S10A.mass) if direct else ""
        note = (
            "mujoco; soft constraint with k/m and c/m, refsafe off"
            if direct
            else "mujoco; default solref, which forgets k and c: critically damped"
        )
        flags = 'refsafe="disable"' if direct else ""
        xml = _drop_xml(p.S10A, dt, "Euler", soft, flags)
        return Case(xml, dt, p.S10A.end_time, _still(1), note)

    for dt in (1e-2, 1e-3):
        yield f"default solref dt={dt:g}", functools.partial(case, dt, False)
    for dt in (1e-3, 1e-4, 1e-5, 1e-6):
        yield f"solref -k/m -c/m dt={dt:g}", functools.partial(case, dt, True)
    yield from _callback_drop(p.S10A, stiff, "linear", (1e-5, 1e-6))


def _rolling() -> Iterator[tuple[str, Callable[[], Case]]]:
    velocity = np.array([[p.S3.speed, 0.0, 0.0, 0.0, 0.0, 0.0]])

    def case(cone: str, impratio: int, dt: float) -> Case:
        friction = f'friction="{p.S3.mu} 0 0" condim="3"'
        world = f'<geom type="plane" size="0 0 1" {friction}/>' + _sphere(
            (0.0, 0.0, p.S3.radius), p.S3.radius, p.S3.mass, friction
        )
        option = f'timestep="{dt!r}" cone="{cone}" impratio="{impratio}" gravity="0 0 {-p.GRAVITY}"'
        note = "mujoco; default soft contact, from its static penetration"
        return Case(_xml(option, world), dt, p.S3.end_time, velocity, note, settle=True)

    for cone, impratio in (("pyramidal", 1), ("elliptic", 1)):
        for dt in (1e-2, 2e-3, 1e-3, 5e-4, 1e-4):
            name = f"{cone} impratio={impratio} dt={dt:g}"
            yield name, functools.partial(case, cone, impratio, dt)


def _torus() -> Iterator[tuple[str, Callable[[], Case]]]:
    vertices, faces = p.torus_mesh(p.S9)
    points = " ".join(map(repr, vertices.ravel().tolist()))
    corners = " ".join(map(str, faces.ravel().tolist()))
    inertia = " ".join(map(repr, p.torus_inertia(p.S9)))
    turn = f"{math.cos(p.S9.tilt / 2)!r} {math.sin(p.S9.tilt / 2)!r} 0 0"

    def case(dt: float) -> Case:
        friction = f'friction="{p.S9.mu} 0 0" condim="3"'
        world = (
            f'<geom type="plane" size="0 0 1" {friction}/>'
            f'<body pos="0 0 {p.S9.height!r}" quat="{turn}"><freejoint/>'
            f'<inertial pos="0 0 0" mass="{p.S9.mass!r}" diaginertia="{inertia}"/>'
            f'<geom type="mesh" mesh="torus" {friction}/></body>'
        )
        # the file's axes are kept: the mesh is symmetric, its principal axes are its own
        head = f'<asset><mesh name="torus" vertex="{points}" face="{corners}"/></asset>'
        option = f'timestep="{dt!r}" cone="elliptic" gravity="0 0 {-p.GRAVITY}"'
        note = "mujoco; a mesh is its convex hull, which cannot meet another torus"
        xml = _xml(option, world, head=head)
        return Case(xml, dt, p.S9.end_time, _still(1), note)

    for dt in (5e-3, 2e-3, 1e-3):
        yield f"convex hull dt={dt:g}", functools.partial(case, dt)


def _box(
    mu: float, end_time: float, dts: tuple[float, ...]
) -> Iterator[tuple[str, Callable[[], Case]]]:
    half = " ".join(repr(edge / 2) for edge in p.S4.size)
    pull = (p.GRAVITY * np.sin(p.S4.tilt), 0.0, -p.GRAVITY * np.cos(p.S4.tilt))

    def case(cone: str, impratio: int, noslip: int, dt: float) -> Case:
        friction = f'friction="{mu} 0 0" condim="3"'
        world = (
            f'<geom type="plane" size="0 0 1" {friction}/>'
            f'<body pos="0 0 {p.S4.size[2] / 2}"><freejoint/>'
            f'<geom type="box" size="{half}" mass="{p.S4.mass}" {friction}/></body>'
        )
        gravity = " ".join(repr(float(g)) for g in pull)
        option = (
            f'timestep="{dt!r}" cone="{cone}" impratio="{impratio}" '
            f'noslip_iterations="{noslip}" gravity="{gravity}"'
        )
        note = "mujoco; box collider, default soft contact, from its static penetration"
        return Case(_xml(option, world), dt, end_time, _still(1), note, settle=True)

    kinds = (
        ("pyramidal", 1, 0),
        ("elliptic", 1, 0),
        ("elliptic", 100, 0),
        ("elliptic", 10000, 0),
        ("elliptic", 1, 5),
        ("elliptic", 100, 20),
    )
    for (cone, impratio, noslip), dt in itertools.product(kinds, dts):
        name = f"{cone} impratio={impratio} noslip={noslip} dt={dt:g}"
        yield name, functools.partial(case, cone, impratio, noslip, dt)


def _row() -> Iterator[tuple[str, Callable[[], Case]]]:
    velocity = _still(p.S5.count)
    velocity[0, 0] = p.S5.speed

    def world(more: str) -> str:
        places = p.s5_positions()
        return "".join(_sphere((x, 0.0, 0.0), p.S5.radius, p.S5.mass, more) for x in places)

    def soft(solref: str, dt: float) -> Case:
        option = f'timestep="{dt!r}" gravity="0 0 0"'
        balls = world(f'condim="1" solref="{solref}"')
        note = "mujoco; a soft constraint knows no Hertz law"
        return Case(_xml(option, balls), dt, p.S5.end_time, velocity, note)

    def law(integrator: str, dt: float) -> Case:
        option = f'timestep="{dt!r}" integrator="{integrator}" gravity="0 0 0"'
        xml = _xml(option, world(""), 'contact="disable" constraint="disable"')
        note = "hertz; law through mjcb_passive, compiled"
        end, radius = p.S5.end_time, p.S5.radius
        return Case(xml, dt, end, velocity, note, hertz, True, "balls", radius)

    for solref in ("0.002 0.01", "-1e7 0"):
        for dt in (1e-3, 1e-4, 1e-5):
            yield f"solref {solref} dt={dt:g}", functools.partial(soft, solref, dt)
    pairs = (("Euler", (1e-4, 1e-5, 1e-6)), ("RK4", (1e-4, 3e-5, 1e-5, 1e-6)))
    for integrator, dts in pairs:
        for dt in dts:
            exact = p.SAMPLE / round(p.SAMPLE / dt)
            name = f"mjcb_passive compiled {integrator} dt={exact:.4g}"
            yield name, functools.partial(law, integrator, exact)


def _grains(count: int) -> Iterator[tuple[str, Callable[[], Case]]]:
    def case(solver: str, solref: str, dt: float) -> Case:
        more = f'condim="3" friction="{p.S7.mu} 0 0" {solref}'
        half = p.s7_half_width(count)
        walls = "".join(
            f'<geom type="plane" size="0 0 1" pos="{x!r} {y!r} 0" zaxis="{a} {b} {c}" {more}/>'
            for x, y, a, b, c in (
                (0.0, 0.0, 0, 0, 1),
                (-half, 0.0, 1, 0, 0),
                (half, 0.0, -1, 0, 0),
                (0.0, -half, 0, 1, 0),
                (0.0, half, 0, -1, 0),
            )
        )
        spheres = "".join(
            _sphere(tuple(at), p.S7.radius, p.S7.mass, more) for at in p.s7_positions(count)
        )
        option = f'timestep="{dt!r}" solver="{solver}" gravity="0 0 {-p.GRAVITY}"'
        xml = _xml(option, walls + spheres, head='<size memory="2G"/>')
        note = f"mujoco; soft contacts, {solref or 'default solref'}, pyramidal cone"
        end, sample = p.S7.end_time, p.s7_sample(count)
        return Case(xml, dt, end, _still(count), note, sample=sample, cap=common.WALL_CAP)

    stiff = 'solref="0.004 1"'
    many = count >= 1000  # where each run takes long: smaller steps do not end before the cap
    for solver, solref, dts in (
        ("CG", "", (5e-3,) if many else (5e-3, 2e-3, 5e-4)),
        ("Newton", "", (5e-3, 2e-3) if count <= 125 else ()),
        ("CG", stiff, () if count > 1000 else (2e-3,) if many else (2e-3, 5e-4)),
    ):
        for dt in dts:
            name = f"{solver}{' stiff' if solref else ''} dt={dt:g}"
            yield name, functools.partial(case, solver, solref, dt)


def _chain(count: int) -> Iterator[tuple[str, Callable[[], Case]]]:
    def case(integrator: str, dt: float) -> Case:
        xml = jointed.chain(count, f'timestep="{dt!r}" integrator="{integrator}"')
        end, still = p.S8.end_time[count], np.zeros(count)
        return Case(xml, dt, end, still, "hinge angles", rows=jointed.chain_rows)

    fine = {2: (2e-4, 1e-4), 10: (2e-4, 1e-4), 40: (2e-4, 1e-4, 5e-5)}[count]
    for integrator, dts in (
        ("Euler", (1e-3, 1e-4)),
        ("implicitfast", (1e-3,)),
        ("implicit", (1e-3,)),
        ("RK4", (1e-2, 5e-3, 2e-3, 1e-3, 5e-4, *fine)),
    ):
        for dt in dts:
            yield f"{integrator} dt={dt:g}", functools.partial(case, integrator, dt)


def _slider_crank() -> Iterator[tuple[str, Callable[[], Case]]]:
    position, velocity = jointed.crank_start()

    def case(integrator: str, steps: float, ratio: float, dt: float) -> Case:
        # a quadratic problem: the first step of Newton's method ends at its solution
        option = f'timestep="{dt!r}" integrator="{integrator}" solver="Newton" iterations="1"'
        xml = jointed.slider_crank(f"{steps * dt!r} {ratio!r}", option)
        end, note = p.S8B.end_time, "loop closed by a soft connect equality"
        return Case(xml, dt, end, velocity, note, position=position, rows=jointed.crank_rows)

    fine = (5e-3, 2e-3, 1e-3, 5e-4, 2e-4, 1e-4, 2e-5)
    # time constant over dt, and damping ratio, of the tie: the best of a search at dt = 1e-3
    # (1.5, 2), at dt = 2e-3 (2, 1.5), and MuJoCo's advice, which is not below (2, 1)
    for integrator, ties, dts in (
        ("Euler", ((2.0, 1.0),), (1e-3,)),
        ("implicitfast", ((2.0, 1.0),), (1e-3,)),
        ("RK4", ((2.0, 1.0), (2.0, 1.5), (1.5, 2.0)), fine),
    ):
        for (steps, ratio), dt in itertools.product(ties, dts):
            name = f"{integrator} solref={steps:g}dt,{ratio:g} dt={dt:g}"
            yield name, functools.partial(case, integrator, steps, ratio, dt)
