"""Force_CubicSpring: F = -k x^3 along the line of both markers, x its length; stored k x^4/4.

Template of a force by one displacement: copy it into mbsim/forces/kinds/, change it, and add it to
the manual's table. `forces.catalog` says what each function takes and returns.
"""

from __future__ import annotations

from mbsim.arrays.codes import LINE_FORCE
from mbsim.forces.catalog import Acts, Parameter, Scalar, force


def _acts(values) -> Acts:
    return Acts(LINE_FORCE)


def _constants(values):
    """Return the numbers that `par` below holds."""
    return (values["stiffness"],)


def _force(x, rate, par):
    return -par[0] * x**3, 0.25 * par[0] * x**4, 0.0


def _slopes(x, rate, par):
    return -3.0 * par[0] * x**2, 0.0


force(
    "CUBICSPRING",
    "Force_CubicSpring",
    "cubic_springs",
    Parameter("stiffness", None, positive=True),
    form=Scalar(_acts, _constants, _force, _slopes),
)
