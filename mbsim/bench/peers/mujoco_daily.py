"""Scenes of daily work in MuJoCo, but the walker: a chain on a box, and what rolls."""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Callable, Iterator

import numpy as np

from mbsim.bench import drum as drums
from mbsim.bench import parameters as p
from mbsim.bench.daily import CHAIN, TRAIN, draped
from mbsim.bench.peers import common
from mbsim.bench.peers.mujoco_laws import Case
from mbsim.bench.peers.mujoco_quadruped import SOFTNESS, numbers

Cases = Iterator[tuple[str, Callable[[], Case]]]
#: Shapes of the first kind touch those of the second alone.
MOVING, FIXED = 'contype="1" conaffinity="0"', 'contype="0" conaffinity="1"'


def _chain_xml(option: str, softness: str) -> str:
    c = CHAIN
    more = f'friction="{c.mu!r} 0 0" condim="3" {softness}'
    inner = ""
    for k in reversed(range(c.count)):
        free = (
            '<joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 0 1"/>' if k == 0 else ""
        )
        at = (c.start, 0.0, c.height) if k == 0 else (c.length, 0.0, 0.0)
        inner = (
            f'<body pos="{numbers(at)}">{free}<joint type="hinge" axis="0 -1 0"/>'
            f'<inertial pos="{c.length / 2.0!r} 0 0" mass="{c.mass!r}" '
            f'diaginertia="{numbers(c.inertia)}"/>'
            f'<geom type="sphere" size="{c.ball!r}" pos="{c.length!r} 0 0" {more} {MOVING}/>'
            f"{inner}</body>"
        )
    box = numbers([edge / 2.0 for edge in c.box])
    return (
        f'<mujoco><size memory="1G"/><option {option} gravity="0 0 {-p.GRAVITY!r}"/><worldbody>'
        f'<geom type="plane" size="0 0 1" pos="0 0 {c.floor!r}" {more} {FIXED}/>'
        f'<geom type="box" size="{box}" pos="0 0 {-c.box[2] / 2.0!r}" {more} {FIXED}/>'
        f"{inner}</worldbody></mujoco>"
    )


def _chain_rows(time: np.ndarray, qpos: np.ndarray, qvel: np.ndarray) -> common.Rows:
    """Rows of the links from two slides and the hinges."""
    place = qpos[:, :2] + [CHAIN.start, CHAIN.height]
    return common.Rows(time, *draped(place, qvel[:, :2], qpos[:, 2:], qvel[:, 2:]))


def chain_box() -> Cases:
    """A chain in minimal coordinates falls onto a box."""

    def case(integrator: str, cone: str, softness: str, dt: float) -> Case:
        option = f'timestep="{dt!r}" integrator="{integrator}" cone="{cone}"'
        xml = _chain_xml(option, SOFTNESS[softness](dt))
        still = np.zeros(CHAIN.count + 2)
        note = "mujoco; soft contacts"
        return Case(xml, dt, CHAIN.end_time, still, note, rows=_chain_rows)

    kinds = (("implicitfast", "pyramidal"), ("RK4", "pyramidal"))
    steps = (5e-3, 2e-3, 1e-3, 5e-4, 2e-4)
    for (integrator, cone), softness, dt in itertools.product(kinds, SOFTNESS, steps):
        if integrator == "RK4" and (dt > 2e-3 or softness != "stiff"):
            continue  # it does not hold longer steps; the default lets balls through
        name = f"{integrator} {cone} {softness} dt={dt:g}"
        yield name, functools.partial(case, integrator, cone, softness, dt)


def _train_xml(option: str, softness: str) -> str:
    t = TRAIN
    more = f'friction="{t.mu!r} 0 0" condim="3" {softness}'
    size = numbers([t.radius, t.length / 2.0])
    cylinders = "".join(
        f'<body pos="{numbers([x, 0.0, t.radius])}"><freejoint/>'
        f'<geom type="cylinder" size="{size}" zaxis="0 1 0" mass="{t.mass!r}" {more}/></body>'
        for x in t.centres().tolist()
    )
    return (
        f'<mujoco><option {option} gravity="{numbers(t.pull())}"/><worldbody>'
        f'<geom type="plane" size="0 0 1" {more}/>'
        f'<geom type="plane" size="0 0 1" pos="{t.wall!r} 0 0" zaxis="-1 0 0" {more}/>'
        f"{cylinders}</worldbody></mujoco>"
    )


def cylinder_train() -> Cases:
    """Cylinders roll down a slope to a wall."""

    def case(cone: str, softness: str, dt: float) -> Case:
        ratio = 10 if cone == "elliptic" else 1
        option = f'timestep="{dt!r}" cone="{cone}" impratio="{ratio}"'
        xml = _train_xml(option, SOFTNESS[softness](dt))
        still = np.zeros((TRAIN.count, 6))
        return Case(xml, dt, TRAIN.end_time, still, "mujoco; soft contacts")

    steps = (1e-2, 5e-3, 2e-3, 1e-3, 5e-4)
    for cone, softness, dt in itertools.product(("pyramidal", "elliptic"), SOFTNESS, steps):
        yield f"{cone} {softness} dt={dt:g}", functools.partial(case, cone, softness, dt)


def _drum_xml(drum: drums.Drum, option: str, softness: str) -> str:
    more = f'friction="{drum.mu!r} 0 0" condim="3" {softness}'
    out, long = drum.apothem + drums.THICK / 2.0, drum.half_length
    half = numbers([drums.THICK / 2.0, long, drum.face / 2.0])
    # angles are about -y in a frame where z is up
    faces = "".join(
        f'<geom type="box" size="{half}" pos="{numbers(out * normal)}" '
        f'quat="{math.cos(angle / 2.0)!r} 0 {-math.sin(angle / 2.0)!r} 0" {more}/>'
        for angle, normal in zip(drums.angles().tolist(), drums.outward(), strict=True)
    )
    cap = numbers([drum.apothem, drums.THICK / 2.0, drum.apothem])
    ends = "".join(
        f'<geom type="box" size="{cap}" pos="0 {side * (long + drums.THICK / 2.0)!r} 0" {more}/>'
        for side in (-1.0, 1.0)
    )
    spheres = "".join(
        f'<body pos="{numbers(at)}"><freejoint/>'
        f'<geom type="sphere" size="{drum.radius!r}" mass="{drum.mass!r}" {more}/></body>'
        for at in drums.places(drum)
    )
    return (
        f'<mujoco><size memory="4G"/><option {option} gravity="0 0 {-p.GRAVITY!r}"/><worldbody>'
        f'<body><joint type="hinge" axis="0 1 0"/><inertial pos="0 0 0" mass="{drums.HEAVY!r}" '
        f'diaginertia="{numbers([drums.HEAVY] * 3)}"/>{faces}{ends}</body>'
        f"{spheres}</worldbody></mujoco>"
    )


def _drum_rows(time: np.ndarray, qpos: np.ndarray, qvel: np.ndarray) -> common.Rows:
    """Rows of the drum, then of the spheres."""
    n = len(qpos)
    pose, twist = qpos[:, 1:].reshape(n, -1, 7), qvel[:, 1:].reshape(n, -1, 6)
    spheres = common.rotate(pose[..., 3:], twist[..., 3:])
    still, about = np.zeros((n, 1, 3)), np.zeros((n, 1, 3))
    about[:, 0, 1] = qpos[:, 0]
    spin = np.zeros((n, 1, 3))
    spin[:, 0, 1] = qvel[:, 0]
    return common.Rows(
        time,
        np.hstack([still, pose[..., :3]]),
        np.hstack([common.quaternion_of(about), pose[..., 3:]]),
        np.hstack([still, twist[..., :3]]),
        np.hstack([spin, spheres]),
    )


def drum_of(count: int) -> Cases:
    """Spheres in a drum that turns; its faces are boxes, for planes cannot move."""
    drum = drums.DRUMS[count]

    def case(solver: str, softness: str, dt: float) -> Case:
        xml = _drum_xml(drum, f'timestep="{dt!r}" solver="{solver}"', SOFTNESS[softness](dt))
        start = np.zeros(1 + 6 * count)
        start[0] = drum.spin
        note = "mujoco; soft contacts, pyramidal cone"
        sample = drum.sample
        return Case(xml, dt, drum.end_time, start, note, sample=sample, rows=_drum_rows)

    solvers: tuple[str, ...] = ("CG",)
    kinds: tuple[str, ...] = ("stiff",)
    steps: tuple[float, ...] = (5e-3, 2e-3)
    if count <= 300:
        solvers, kinds, steps = ("CG", "Newton"), ("stiff", "hard"), (5e-3, 2e-3, 1e-3)
    for solver, softness, dt in itertools.product(solvers, kinds, steps):
        yield f"{solver} {softness} dt={dt:g}", functools.partial(case, solver, softness, dt)
