"""A linear spring and damper side by side: F = k d + c d', of which nothing is left behind d = 0.

Template of a normal law: copy it into mbsim/laws/normal/ and change it. It takes attributes that
Force_Contact has; decks may say cnf_type="KELVIN_VOIGT" as soon as the file is there.
"""

from __future__ import annotations

from mbsim.core.arrays import V3
from mbsim.laws.catalog import normal_law


@normal_law("KELVIN_VOIGT", "stiffness", "damping")
def kelvin_voigt(depth: float, depth_rate: float, stiffness: float, damping: float) -> V3:
    """Return force [F], force at rate 0 [F] and stored energy [F L]."""
    spring = stiffness * depth
    return spring + damping * depth_rate, spring, 0.5 * spring * depth
