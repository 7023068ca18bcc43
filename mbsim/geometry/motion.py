"""How one shape moves seen from another one, and how long it may until it has come some way."""

from __future__ import annotations

import math

from mbsim.core.jitable import jitable

#: Numbers of a motion: the time asked for, then velocity (3) and acceleration (3) of I's centre and
#: angular velocity (3) of I, all seen from J; how far a wall may be gone into [L], how deep
#: what touches is in each other already [L], and m: what else accelerates points of I.
MOTION = 13
ASKED, VELOCITY, ACCELERATION, SPIN, ALLOWED, OVERLAP, MORE = 0, 1, 4, 7, 10, 11, 12


@jitable
def time_for(travel: float, speed: float, push: float) -> float:
    """Return the time in which a shape can come `travel` far: way = speed h + push h^2 / 2."""
    if (speed == 0.0 and push == 0.0) or math.isinf(travel):
        return math.inf
    return 2.0 * travel / (speed + math.sqrt(speed * speed + 2.0 * push * travel))
