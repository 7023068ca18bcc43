"""IMPACT: a one-sided power-law spring with a damper that fades in with depth.

    F = max(0, k d^e + STEP(d, 0, 0, dmax, c) d')      for depth d > 0

Source: Altair MotionSolve Reference Guide, function IMPACT, with x1 - x = d.
"""

from __future__ import annotations

from mbsim.core.blend import step
from mbsim.laws.catalog import normal_law


def impact_energy(depth, stiffness, exponent, damping, dmax):
    """Return the energy [F L] stored in the spring: k d^(e+1) / (e+1)."""
    if depth <= 0.0:
        return 0.0
    return stiffness * depth**exponent * depth / (exponent + 1.0)


@normal_law("IMPACT", "stiffness", "exponent", "damping", "dmax", energy=impact_energy)
def impact(depth, depth_rate, stiffness, exponent, damping, dmax):
    """Return the normal force [F]: zero apart, pushing in contact, never pulling.

    `depth` [L] > 0 is overlap, `depth_rate` [L/T] > 0 is closing; `stiffness` [F/L^e],
    `exponent` [-], `damping` [F T/L] and its full depth `dmax` [L].
    """
    if depth <= 0.0:
        return 0.0
    spring = stiffness * depth**exponent
    damper = step(depth, 0.0, 0.0, dmax, damping) * depth_rate

    # fast separation makes spring + damper negative; contact cannot pull
    return max(0.0, spring + damper)
