"""IMPACT: a one-sided power-law spring with a damper that fades in with depth.

    F = max(0, k d^e + STEP(d, 0, 0, dmax, c) d')      for depth d > 0

Stored: the spring's k d^(e+1) / (e+1).
Source: Altair MotionSolve Reference Guide, function IMPACT, with x1 - x = d.
"""

from __future__ import annotations

import math

from mbsim.core.arrays import V3, V4
from mbsim.core.blend import step
from mbsim.laws.catalog import normal_law
from mbsim.laws.spring import power_spring


def impact_constants(stiffness: float, exponent: float, damping: float, dmax: float) -> V4:
    """Return the attributes as they are; dmax may be absent where there is no damping."""
    return stiffness, exponent, damping, math.inf if dmax is None else dmax


@normal_law("IMPACT", "stiffness", "exponent", "damping", "dmax", constants=impact_constants)
def impact(
    depth: float, depth_rate: float, stiffness: float, exponent: float, damping: float, dmax: float
) -> V3:
    """Return force [F], force at rate 0 [F] and stored energy [F L].

    `depth` [L] > 0 is overlap, `depth_rate` [L/T] > 0 is closing; `stiffness` [F/L^e],
    `exponent` [-], `damping` [F T/L] and its full depth `dmax` [L].
    """
    if depth <= 0.0:
        return 0.0, 0.0, 0.0
    spring, energy = power_spring(depth, stiffness, exponent)
    damper = step(depth, 0.0, 0.0, dmax, damping) * depth_rate

    # fast separation makes spring + damper negative; contact cannot pull
    return max(0.0, spring + damper), spring, energy
