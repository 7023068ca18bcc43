"""S8_n and S8b as MuJoCo's XML: hinges about -y, so that angles count from x towards z.

Everything that the scene does not need is switched off; the chain has no constraint at all, and
the loop of the slider-crank is closed by a soft one, which is all that MuJoCo has.
"""

from __future__ import annotations

import numpy as np

from mbsim.bench import linkages
from mbsim.bench import parameters as p
from mbsim.bench.peers import common

_OFF = ("contact", "frictionloss", "limit", "actuation", "sensor", "midphase")


def _xml(option: str, off: tuple[str, ...], world: str, equality: str = "") -> str:
    flags = " ".join(f'{name}="disable"' for name in off)
    return (
        f'<mujoco><option {option} gravity="0 0 {-p.GRAVITY!r}"><flag {flags}/></option>'
        f"<worldbody>{world}</worldbody><equality>{equality}</equality></mujoco>"
    )


def _rod(x: float, mass: float, length: float, inside: str) -> str:
    """A rod hinged at its end, which is `x` along its parent, and what hangs on it."""
    inertia = " ".join(repr(value) for value in p.rod_inertia(mass, length))
    return (
        f'<body pos="{x!r} 0 0"><joint type="hinge" axis="0 -1 0"/>'
        f'<inertial pos="{length / 2!r} 0 0" mass="{mass!r}" diaginertia="{inertia}"/>'
        f"{inside}</body>"
    )


def chain(count: int, option: str) -> str:
    """The chain of S8_n."""
    length, rods = p.S8.length / count, ""
    for k in reversed(range(count)):
        rods = _rod(length if k else 0.0, p.S8.mass, length, rods)
    return _xml(option, (*_OFF, "constraint"), rods)


def slider_crank(solref: str, option: str) -> str:
    """The slider-crank of S8b: the rod's end and the slider are tied with `solref`."""
    s = p.S8B
    end = f'<site name="end" pos="{s.rod_length!r} 0 0"/>'
    rod = _rod(s.crank_length, s.rod_mass, s.rod_length, end)
    slider = (
        '<body><joint type="slide" axis="1 0 0"/>'
        f'<inertial pos="0 0 0" mass="{s.slider_mass!r}" diaginertia="0.001 0.001 0.001"/>'
        '<site name="slider"/></body>'
    )
    # .9999 is the hardest that it takes; "refsafe" would make solref softer than asked
    tie = f'<connect site1="end" site2="slider" solref="{solref}" solimp=".9999 .9999 1"/>'
    crank = _rod(0.0, s.crank_mass, s.crank_length, rod)
    return _xml(option, (*_OFF, "refsafe"), crank + slider, tie)


def crank_start() -> tuple[np.ndarray, np.ndarray]:
    """Qpos and qvel of S8b at t = 0: the rod's hinge counts from the crank."""
    s = linkages.crank_start()
    position = np.array([s.crank, s.rod - s.crank, s.slider])
    return position, np.array([s.crank_rate, s.rod_rate - s.crank_rate, s.slider_rate])


def chain_rows(time: np.ndarray, qpos: np.ndarray, qvel: np.ndarray) -> common.Rows:
    """Rows of the rods from the hinges (n, rods)."""
    return common.Rows(time, *linkages.hinged_chain(qpos, qvel))


def crank_rows(time: np.ndarray, qpos: np.ndarray, qvel: np.ndarray) -> common.Rows:
    """Rows of crank, rod and slider from hinge, hinge and slide (n, 3)."""
    angle, rate = np.cumsum(qpos[:, :2], axis=1), np.cumsum(qvel[:, :2], axis=1)
    return common.Rows(time, *linkages.slider_crank(angle, rate, qpos[:, 2], qvel[:, 2]))
