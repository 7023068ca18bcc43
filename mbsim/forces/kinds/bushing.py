"""Force_Bushing, Adams' BUSHING: springs and dampers along and about the axes of J.

    F = F0 - K d - C v            T = T0 - J(theta)^-T K theta - C w

and stored d'K d/2 - F0.d + theta'K theta/2, of which the torque is the exact gradient. For a turn
about one axis of J it is K times the angle, for small ones K times each angle, as if angles were
projected. At half a turn theta changes its sign: a bushing holds for less. A constant torque T0 has
no potential: its work counts as lost, with the sign turned.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from mbsim.core.arrays import F2, V3
from mbsim.core.jitable import jitable
from mbsim.core.rotation import add, norm, scale, sub
from mbsim.forces.catalog import Adams, Bounds, Finding, Parameter, Values, Wrench, force
from mbsim.forces.formula import Motion
from mbsim.forces.turning import turned_back, turning_torque

_AXES = ("x", "y", "z", "tx", "ty", "tz")
_STIFFNESS, _DAMPING, _PRELOAD = (
    tuple(f"{prefix}{axis}" for axis in _AXES) for prefix in ("k", "c", "preload_")
)


def _where(name: str) -> str:
    """Return along or about which axis of J an attribute is."""
    return f"about J's {name[-1]}" if "t" in name[-2:] else f"along J's {name[-1]}"


def _unit(name: str, along: str, about: str) -> str:
    return about if "t" in name[-2:] else along


#: Half of the difference of angles [rad].
_PUSH = 1e-7


def _check(values: Values) -> Iterator[Finding]:
    if not any(values.values()):
        message = "all stiffnesses, dampings and preloads are 0: the bushing does nothing"
        yield Finding(message, warns=True)


def _constants(values: Values) -> Sequence[float]:
    """Return six stiffnesses, six dampings, six preloads."""
    return tuple(values[name] for name in (*_STIFFNESS, *_DAMPING, *_PRELOAD))


def _wrench(motion: Motion, par: Sequence[float]) -> tuple[V3, V3, float, float]:
    d, theta, v, w = motion.d, motion.theta, motion.v, motion.w
    spring = turning_torque(theta, (par[3], par[4], par[5]))
    force = (
        par[12] - par[0] * d[0] - par[6] * v[0],
        par[13] - par[1] * d[1] - par[7] * v[1],
        par[14] - par[2] * d[2] - par[8] * v[2],
    )
    torque = (
        par[15] - spring[0] - par[9] * w[0],
        par[16] - spring[1] - par[10] * w[1],
        par[17] - spring[2] - par[11] * w[2],
    )
    stored, lost = 0.0, 0.0
    for k in range(3):
        stored += d[k] * (0.5 * par[k] * d[k] - par[12 + k])
        stored += 0.5 * par[3 + k] * theta[k] * theta[k]
        lost += par[6 + k] * v[k] * v[k] + (par[9 + k] * w[k] - par[15 + k]) * w[k]
    return force, torque, stored, lost


@jitable
def _turning_rise(theta: V3, k: V3, axis: int) -> V3:
    """Return how the spring's torque rises as I turns about J's axis e [per rad].

    d theta = J(theta)^-1 e, which is J^-T of -theta; the torque is asked at neighbouring theta.
    """
    e = (1.0 if axis == 0 else 0.0, 1.0 if axis == 1 else 0.0, 1.0 if axis == 2 else 0.0)
    d = turned_back(scale(-1.0, theta), e)
    up = turning_torque(add(theta, scale(_PUSH, d)), k)
    low = turning_torque(sub(theta, scale(_PUSH, d)), k)
    return (
        (up[0] - low[0]) / (2.0 * _PUSH),
        (up[1] - low[1]) / (2.0 * _PUSH),
        (up[2] - low[2]) / (2.0 * _PUSH),
    )


def _slopes(motion: Motion, par: Sequence[float], K: F2, D: F2) -> None:
    for k in range(6):
        D[k, k] = par[6 + k]
    for k in range(3):
        K[k, k] = par[k]
        rise = _turning_rise(motion.theta, (par[3], par[4], par[5]), k)
        for row in range(3):
            K[3 + row, 3 + k] = rise[row]


def _bounds(par: Sequence[float]) -> Bounds:
    k, turning_k, c, turning_c = (max(par[3 * g : 3 * g + 3]) for g in range(4))
    return Bounds(k, turning_k, c, turning_c, force=norm((par[12], par[13], par[14])))


force(
    "BUSHING",
    "Force_Bushing",
    "bushings",
    *(
        Parameter(name, about=f"stiffness {_where(name)}", unit=_unit(name, "F/L", "F L/rad"))
        for name in _STIFFNESS
    ),
    *(
        Parameter(name, about=f"damping {_where(name)}", unit=_unit(name, "F T/L", "F L T/rad"))
        for name in _DAMPING
    ),
    *(
        Parameter(
            name,
            signed=True,
            about=f"constant load on I {_where(name)}",
            unit=_unit(name, "F", "F L"),
        )
        for name in _PRELOAD
    ),
    form=Wrench(_constants, _wrench, _slopes, _bounds),
    check=_check,
    functions="BUSH",
    about="springs and dampers along and about the axes of a marker",
    adams=Adams(
        "BUSHING",
        {
            "K": _STIFFNESS[:3],
            "C": _DAMPING[:3],
            "KT": _STIFFNESS[3:],
            "CT": _DAMPING[3:],
            "FORCE": _PRELOAD[:3],
            "TORQUE": _PRELOAD[3:],
        },
    ),
)
