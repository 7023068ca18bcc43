"""The power-law spring that the normal laws share: force and energy for one pow at most."""

from __future__ import annotations

import math

from mbsim.core.arrays import V2
from mbsim.core.jitable import jitable


@jitable
def power_spring(depth: float, stiffness: float, exponent: float) -> V2:
    """Return the force k d^e [F] and the energy k d^(e+1) / (e+1) [F L] at `depth` > 0 [L].

    The exponents 1, 1.5 and 2 go without pow, which costs more than all the rest of a law;
    d sqrt(d) is within 1 ulp of d^1.5.
    """
    if exponent == 1.5:
        force = stiffness * (depth * math.sqrt(depth))
    elif exponent == 1.0:
        force = stiffness * depth
    elif exponent == 2.0:
        force = stiffness * (depth * depth)
    else:
        force = stiffness * depth**exponent
    return force, force * depth / (exponent + 1.0)
