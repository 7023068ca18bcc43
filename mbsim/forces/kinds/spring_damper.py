"""Force_SpringDamper, Adams' SPRINGDAMPER: a linear spring and damper along a line or about z.

    F = preload - k (x - length) - c x'

`type` TRANSLATIONAL: x [L] is the distance of the markers, F > 0 pushes them apart; ROTATIONAL:
x [rad] is the angle of I about J's z, whole turns counted, and F the torque on I about it. Stored:
k (x - length)^2 / 2 - preload (x - length); lost: c x'^2.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from mbsim.arrays.codes import AXIS_TORQUE, LINE_FORCE
from mbsim.core.arrays import V2, V3
from mbsim.forces.catalog import Acts, Adams, Bounds, Finding, Parameter, Scalar, Values, force


def _acts(values: Values) -> Acts:
    turns = values["type"] == "ROTATIONAL"
    return Acts(AXIS_TORQUE, turns=True) if turns else Acts(LINE_FORCE)


def _check(values: Values) -> Iterator[Finding]:
    if values["stiffness"] == values["damping"] == values["preload"] == 0.0:
        message = "stiffness, damping and preload are 0: the spring does nothing"
        yield Finding(message, warns=True)
    if values["type"] == "TRANSLATIONAL" and values["length"] < 0.0:
        yield Finding("must be a number >= 0: it is a distance", "length")


def _constants(values: Values) -> Sequence[float]:
    """Return stiffness, damping, length, preload."""
    return tuple(values[name] for name in ("stiffness", "damping", "length", "preload"))


def _force(x: float, rate: float, par: Sequence[float]) -> V3:
    stretch = x - par[2]
    spring = par[3] - par[0] * stretch
    stored = stretch * (0.5 * par[0] * stretch - par[3])
    return spring - par[1] * rate, stored, par[1] * rate * rate


def _slopes(x: float, rate: float, par: Sequence[float]) -> V2:
    return -par[0], -par[1]


def _bounds(par: Sequence[float]) -> Bounds:
    return Bounds(par[0], 0.0, par[1], 0.0, force=par[3], rest=(par[2], 0.0, 0.0))


force(
    "SPRINGDAMPER",
    "Force_SpringDamper",
    "springs",
    Parameter(
        "type",
        None,
        words=("TRANSLATIONAL", "ROTATIONAL"),
        about="along the line I-J, or about J's z",
    ),
    Parameter("stiffness", about="stiffness", unit="F/L or F L/rad"),
    Parameter("damping", about="damping", unit="F T/L or F L T/rad"),
    Parameter("length", signed=True, about="length or angle without force", unit="L or rad"),
    Parameter(
        "preload",
        signed=True,
        about="force at that length, > 0 pushes apart",
        unit="F or F L",
    ),
    form=Scalar(_acts, _constants, _force, _slopes, _bounds),
    title="spring",
    about="a linear spring with a damper",
    check=_check,
    functions="SPDP",
    adams=Adams("SPRINGDAMPER"),
    changes="stiffness damping length preload",
)
