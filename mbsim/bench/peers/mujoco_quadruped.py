"""The scene `quadruped` in MuJoCo: hinges of a tree, position drives, soft contacts of its own."""

from __future__ import annotations

import functools
import itertools
from collections.abc import Callable, Iterator, Sequence

import numpy as np

from mbsim.bench import parameters as p
from mbsim.bench.peers import common
from mbsim.bench.peers.mujoco_laws import Case
from mbsim.bench.quadruped import WALKER, Link, foot_of, legs, targets

#: Softness of contacts: MuJoCo's default, a stiff one, and the hardest that a step can take.
SOFTNESS: dict[str, Callable[[float], str]] = {
    "default": lambda dt: "",
    "stiff": lambda dt: 'solref="0.004 1" solimp="0.99 0.999 0.001"',
    "hard": lambda dt: f'solref="{2 * dt!r} 1" solimp="0.9999 0.9999 0.001"',
}
STEPS = (5e-3, 2e-3, 1e-3, 5e-4, 2e-4, 1e-4)


def numbers(values: Sequence[float]) -> str:
    """Numbers as an attribute of MuJoCo's XML."""
    return " ".join(repr(float(x)) for x in values)


def _from(origin: Sequence[float], place: Sequence[float]) -> str:
    """A place in the frame of a body whose axes are global."""
    return numbers([a - b for a, b in zip(place, origin, strict=True)])


def _link(links: list[Link], k: int, origin: Sequence[float], more: str) -> str:
    """A link and what hangs on it; `origin` is its parent's."""
    link = links[k]
    inner = "".join(
        _link(links, j, link.hinge, more) for j, each in enumerate(links) if each.parent == k
    )
    if not inner:
        at = _from(link.hinge, foot_of(link))
        inner = f'<geom type="sphere" size="{WALKER.foot!r}" pos="{at}" {more}/>'
    return (
        f'<body pos="{_from(origin, link.hinge)}">'
        f'<joint name="j{k}" axis="{numbers(link.axis)}" damping="{WALKER.damping!r}"/>'
        f'<inertial pos="{_from(link.hinge, link.centre)}" mass="{link.mass!r}" '
        f'diaginertia="{numbers([link.inertia] * 3)}"/>{inner}</body>'
    )


def _xml(option: str, softness: str) -> str:
    w, links = WALKER, legs()
    more = f'friction="{w.mu!r} 0 0" condim="3" {softness}'
    at = (0.0, 0.0, w.height)
    on_trunk = "".join(_link(links, k, at, more) for k in range(len(links)) if links[k].parent < 0)
    drives = "".join(f'<position joint="j{k}" kp="{w.stiffness!r}"/>' for k in range(len(links)))
    return (
        f'<mujoco><option {option} gravity="0 0 {-p.GRAVITY!r}"/><worldbody>'
        f'<geom type="plane" size="0 0 1" {more}/>'
        f'<body pos="{numbers(at)}"><freejoint/><inertial pos="0 0 0" mass="{w.trunk_mass!r}" '
        f'diaginertia="{numbers(w.trunk_inertia)}"/>{on_trunk}</body></worldbody>'
        f"<actuator>{drives}</actuator></mujoco>"
    )


def _trunk(time: np.ndarray, qpos: np.ndarray, qvel: np.ndarray) -> common.Rows:
    """Rows of the trunk, which alone is compared."""
    q = qpos[:, None, 3:7]
    spin = common.rotate(q, qvel[:, None, 3:6])
    return common.Rows(time, qpos[:, None, :3], q, qvel[:, None, :3], spin)


def quadruped() -> Iterator[tuple[str, Callable[[], Case]]]:
    """Settings and what builds each."""

    def case(integrator: str, cone: str, softness: str, dt: float) -> Case:
        option = f'timestep="{dt!r}" integrator="{integrator}" cone="{cone}"'
        option += ' impratio="10"' if cone == "elliptic" else ""
        return Case(
            _xml(option, SOFTNESS[softness](dt)),
            dt,
            WALKER.end_time,
            np.zeros(18),
            "mujoco; soft contacts",
            rows=_trunk,
            control=targets,
        )

    kinds = (("Euler", "pyramidal"), ("Euler", "elliptic"), ("RK4", "elliptic"))
    for (integrator, cone), softness, dt in itertools.product(kinds, SOFTNESS, STEPS):
        if integrator == "RK4" and not 5e-4 <= dt <= 2e-3:
            continue  # it does not hold longer steps; shorter ones of Euler are as exact
        name = f"{integrator} {cone} {softness} dt={dt:g}"
        yield name, functools.partial(case, integrator, cone, softness, dt)
