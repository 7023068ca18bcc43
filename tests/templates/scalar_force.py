"""Force_CubicSpring: F = -k x^3 along the line of both markers, x its length; stored k x^4/4.

Template of a force by one displacement: copy it into mbsim/forces/kinds/, change it, and give it
a page in the manual. `forces.catalog` says what each function takes and returns.
"""

from __future__ import annotations

from collections.abc import Sequence

from mbsim.arrays.codes import LINE_FORCE
from mbsim.core.arrays import V2, V3
from mbsim.forces.catalog import Acts, Parameter, Scalar, Values, force


def _acts(values: Values) -> Acts:
    return Acts(LINE_FORCE)


def _constants(values: Values) -> Sequence[float]:
    """Return the numbers that `par` below holds."""
    return (values["stiffness"],)


def _force(x: float, rate: float, par: Sequence[float]) -> V3:
    return -par[0] * x**3, 0.25 * par[0] * x**4, 0.0


def _slopes(x: float, rate: float, par: Sequence[float]) -> V2:
    return -3.0 * par[0] * x**2, 0.0


force(
    "CUBICSPRING",
    "Force_CubicSpring",
    "cubic_springs",
    Parameter("stiffness", None, positive=True, about="stiffness", unit="F/L^3"),
    form=Scalar(_acts, _constants, _force, _slopes),
    about="a spring whose force is the cube of its length",
)
