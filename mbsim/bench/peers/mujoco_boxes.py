"""Scenes of several cubes in MuJoCo: stacks at rest, and a bin that they fall into."""

from __future__ import annotations

import functools
import itertools
from collections.abc import Callable, Iterator, Sequence

import numpy as np

from mbsim.bench import parameters as p
from mbsim.bench.peers.mujoco_laws import Case

Cases = Iterator[tuple[str, Callable[[], Case]]]
#: Softness of contacts: MuJoCo's default, and a stiff one.
SOFTNESS = {"": "", " stiff": 'solref="0.004 1" solimp="0.99 0.999 0.001"'}


def _numbers(values: Sequence[float]) -> str:
    return " ".join(repr(float(x)) for x in values)


def _cube(place: Sequence[float], quaternion: Sequence[float], edge: float, more: str) -> str:
    return (
        f'<body pos="{_numbers(place)}" quat="{_numbers(quaternion)}"><freejoint/>'
        f'<geom type="box" size="{_numbers([edge / 2] * 3)}" {more}/></body>'
    )


def _model(option: str, world: str) -> str:
    return (
        f'<mujoco><size memory="2G"/><option {option} gravity="0 0 {-p.GRAVITY}"/>'
        f"<worldbody>{world}</worldbody></mujoco>"
    )


def pile(masses: Sequence[float], scene: p.Stack | p.HeavyOnLight) -> Cases:
    """Cubes on each other, touching, at rest."""

    def case(cone: str, softness: str, dt: float) -> Case:
        more = f'friction="{scene.mu} 0 0" condim="3" {SOFTNESS[softness]}'
        world = f'<geom type="plane" size="0 0 1" {more}/>' + "".join(
            _cube(
                (0.0, 0.0, (k + 0.5) * scene.edge),
                (1.0, 0.0, 0.0, 0.0),
                scene.edge,
                f'mass="{mass!r}" {more}',
            )
            for k, mass in enumerate(masses)
        )
        option = f'timestep="{dt!r}" cone="{cone}" impratio="{10 if cone == "elliptic" else 1}"'
        note = "mujoco; soft contacts"
        return Case(_model(option, world), dt, scene.end_time, np.zeros((len(masses), 6)), note)

    for cone, softness, dt in itertools.product(
        ("pyramidal", "elliptic"), SOFTNESS, (5e-3, 2e-3, 5e-4)
    ):
        yield f"{cone}{softness} dt={dt:g}", functools.partial(case, cone, softness, dt)


def bin_of(count: int) -> Cases:
    """Cubes that fall into an open box."""
    places, turns = p.bin_start(count)
    half = p.BIN.half_width
    sides = (
        (0.0, 0.0, 0, 0, 1),
        (-half, 0.0, 1, 0, 0),
        (half, 0.0, -1, 0, 0),
        (0.0, -half, 0, 1, 0),
        (0.0, half, 0, -1, 0),
    )

    def case(solver: str, softness: str, dt: float) -> Case:
        more = f'friction="{p.BIN.mu} 0 0" condim="3" {SOFTNESS[softness]}'
        walls = "".join(
            f'<geom type="plane" size="0 0 1" pos="{x!r} {y!r} 0" zaxis="{a} {b} {c}" {more}/>'
            for x, y, a, b, c in sides
        )
        cubes = "".join(
            _cube(at, q, p.BIN.edge, f'mass="{p.BIN.mass!r}" {more}')
            for at, q in zip(places, turns, strict=True)
        )
        option = f'timestep="{dt!r}" solver="{solver}"'
        end, still = p.BIN.end_time, np.zeros((count, 6))
        note = "mujoco; soft contacts, pyramidal cone"
        return Case(_model(option, walls + cubes), dt, end, still, note, sample=p.BIN.sample)

    solvers = ("CG", "Newton") if count <= 50 else ("CG",)
    for solver, softness, dt in itertools.product(solvers, SOFTNESS, (5e-3, 2e-3)):
        yield f"{solver}{softness} dt={dt:g}", functools.partial(case, solver, softness, dt)
