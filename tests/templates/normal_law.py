"""FOUNDATION: a bed of springs of `stiffness` k that stiffens, F = k d + k d^2/dmax.

Template of a normal law: copy it into mbsim/laws/normal/ and give its name a line in
`reader/keywords.py` and its checks one in `reader/normal_force.py`. `laws.catalog` says what a law
returns: force, its elastic part and the energy stored, k d^2/2 + k d^3/(3 dmax).
"""

from __future__ import annotations

from mbsim.laws.catalog import normal_law


@normal_law("FOUNDATION", "stiffness", "dmax")
def foundation(depth, rate, stiffness, dmax):
    """Return force [F], elastic force [F], stored energy [F L]."""
    force = stiffness * depth * (1.0 + depth / dmax)
    return force, force, stiffness * depth * depth * (0.5 + depth / (3.0 * dmax))
