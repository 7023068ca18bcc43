"""HUNT_CROSSLEY: a power-law spring whose damper grows with the spring force.

    F = k d^e max(0, 1 + a d')      for depth d > 0

Stored: the spring's k d^(e+1) / (e+1). Unlike IMPACT's, the rebound follows from the speed of
the impact alone (`laws/restitution.py`), so the deck may give it instead of a.
Source: K. H. Hunt, F. R. E. Crossley, J. Appl. Mech. 42 (1975) 440-445.
"""

from __future__ import annotations

from mbsim.core.arrays import V3
from mbsim.laws.catalog import normal_law
from mbsim.laws.restitution import dissipation_of, hunt_crossley
from mbsim.laws.spring import power_spring


def hunt_crossley_constants(
    stiffness: float, exponent: float, damping: float, restitution_coef: float, ref_velocity: float
) -> V3:
    """Return stiffness k, exponent e and dissipation a, given as `damping` or by a rebound."""
    return stiffness, exponent, dissipation_of(damping, restitution_coef, ref_velocity)


@normal_law(
    "HUNT_CROSSLEY",
    *("stiffness", "exponent", "damping", "restitution_coef", "ref_velocity"),
    constants=hunt_crossley_constants,
)
def hunt_crossley_law(
    depth: float, depth_rate: float, stiffness: float, exponent: float, dissipation: float
) -> V3:
    """Return force [F], force at rate 0 [F] and stored energy [F L].

    `depth` [L] > 0 is overlap, `depth_rate` [L/T] > 0 is closing; `stiffness` [F/L^e],
    `exponent` [-], `dissipation` [T/L].
    """
    if depth <= 0.0:
        return 0.0, 0.0, 0.0
    spring, energy = power_spring(depth, stiffness, exponent)
    return hunt_crossley(spring, depth_rate, dissipation), spring, energy
