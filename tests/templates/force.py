"""Force_Tether: a spring without length in every direction, F = -k d, T = 0; stored k d.d/2.

Template of a force between two markers: copy it into mbsim/forces/kinds/, change it, and give it
a page in the manual. `forces.catalog` says what each function takes and returns.
"""

from __future__ import annotations

from collections.abc import Sequence

from mbsim.core.arrays import F2, V3
from mbsim.core.rotation import dot, scale
from mbsim.forces.catalog import Bounds, Parameter, Values, Wrench, force
from mbsim.forces.formula import Motion


def _constants(values: Values) -> Sequence[float]:
    """Return the numbers that `par` below holds."""
    return (values["stiffness"],)


def _wrench(motion: Motion, par: Sequence[float]) -> tuple[V3, V3, float, float]:
    stored = 0.5 * par[0] * dot(motion.d, motion.d)
    return scale(-par[0], motion.d), (0.0, 0.0, 0.0), stored, 0.0


def _slopes(motion: Motion, par: Sequence[float], K: F2, D: F2) -> None:
    for k in range(3):
        K[k, k] = par[0]


def _bounds(par: Sequence[float]) -> Bounds:
    return Bounds(par[0], 0.0, 0.0, 0.0)


force(
    "TETHER",
    "Force_Tether",
    "tethers",
    Parameter("stiffness", None, positive=True, about="stiffness", unit="F/L"),
    form=Wrench(_constants, _wrench, _slopes, _bounds),
    about="a spring without length",
)
