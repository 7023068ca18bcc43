"""Force_Tether: a spring without length in every direction, F = -k d, T = 0; stored k d.d/2.

Template of a force between two markers: copy it into mbsim/forces/kinds/, change it, and add it to
the manual's table. `forces.catalog` says what each function takes and returns.
"""

from __future__ import annotations

from mbsim.core.rotation import dot, scale
from mbsim.forces.catalog import Bounds, Parameter, Wrench, force


def _constants(values):
    """Return the numbers that `par` below holds."""
    return (values["stiffness"],)


def _wrench(motion, par):
    stored = 0.5 * par[0] * dot(motion.d, motion.d)
    return scale(-par[0], motion.d), (0.0, 0.0, 0.0), stored, 0.0


def _slopes(motion, par, K, D):
    for k in range(3):
        K[k, k] = par[0]


def _bounds(par) -> Bounds:
    return Bounds(par[0], 0.0, 0.0, 0.0)


force(
    "TETHER",
    "Force_Tether",
    "tethers",
    Parameter("stiffness", None, positive=True),
    form=Wrench(_constants, _wrench, _slopes, _bounds),
)
