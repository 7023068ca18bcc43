"""Friction of a step: its coefficient by slip, and when what sticks yields."""

from __future__ import annotations

import math

from mbsim.core.jitable import jitable
from mbsim.core.rotation import add, cross, norm, scale, vector
from mbsim.stepping.arrays import FIRST_SPEED, LEFT, LEFT_SPEED, SPEEDS, STICKING, Stepping
from mbsim.stepping.solver import velocity_of

#: Closing speeds have no restitution, and slips are none, up to so many times what the solver may
#: leave of a velocity.
NOISE = 30.0
#: Changes of mu that do not count, and loads that are as large as they may be.
YIELDS = 1e-3


@jitable
def left_of(S: Stepping, h: float) -> float:
    """Return what the solver may leave of a velocity in a step h.

    What it moves in the step does not count then; nor, over the model's own time, what is left of a
    velocity behind an impact in a step that is very short.
    """
    return min(S.plan.number[LEFT] / h, S.plan.number[LEFT_SPEED])


@jitable
def coefficient(S: Stepping, c: int, slip: float) -> float:
    """Return the coefficient of friction of contact c at a slip speed."""
    numbers, curve = S.rules.number[c], S.rules.curve[c]
    if slip <= numbers[FIRST_SPEED]:
        return numbers[STICKING]
    at = math.log2(slip / numbers[FIRST_SPEED])
    k = int(at)
    if k >= SPEEDS - 1:
        return curve[SPEEDS - 1]
    return curve[k] + (at - k) * (curve[k + 1] - curve[k])


@jitable
def load_of(S: Stepping, begin: int, end: int) -> float:
    """Return friction of all points of a pair, `begin` to `end`, over the most that it may be.

    How the points share it is not determined, and they may hold against each other: it is their
    sum that tells.
    """
    P, most = S.points, 0.0
    total = (0.0, 0.0, 0.0)
    for k in range(begin, end):
        n, x = vector(P.normal[k]), vector(P.tangent[k])
        force = add(scale(P.r[k, 1], x), scale(P.r[k, 2], cross(n, x)))
        total = add(total, force)
        most += P.mu[k] * P.r[k, 0]
    return norm(total) / most if most > 0.0 else 0.0


@jitable
def let_yield(S: Stepping, count: int, allowed: float) -> bool:
    """Lower mu where what stuck slips, to that of its slip; return whether that changed much.

    A step in which friction yields is then one that slides: how long it stuck in it is what
    halves of the step tell.
    """
    P, M, changed, begin = S.points, S.motion, False, 0
    while begin < count:
        end = begin + 1
        while end < count and P.key[end] == P.key[begin]:
            end += 1
        load = -1.0
        for k in range(begin, end):
            if P.r[k, 0] == 0.0 or P.holds[k] < S.rules.number[P.contact[k], STICKING]:
                continue
            i, j = P.body[k, 0], P.body[k, 1]
            x, z = velocity_of(P.H, k, 1, M.v, i, j), velocity_of(P.H, k, 2, M.v, i, j)
            slip = math.sqrt(x * x + z * z)
            if slip <= allowed:
                continue
            if load < 0.0:
                load = load_of(S, begin, end)
            if load < 1.0 - YIELDS and slip <= NOISE * allowed:
                continue
            mu = coefficient(S, P.contact[k], slip)
            if mu < (1.0 - YIELDS) * P.mu[k]:
                P.mu[k] = mu
                changed = True
        begin = end
    return changed


@jitable
def keep_loads(S: Stepping, count: int, committed: bool) -> None:
    """Keep the largest load of each contact's pairs that stick, of the first half or the second."""
    P, loads, half, begin = S.points, S.tally.load, 0 if committed else 1, 0
    for c in range(len(loads)):
        loads[c, half] = 0.0
    while begin < count:
        end, c = begin + 1, P.contact[begin]
        while end < count and P.key[end] == P.key[begin]:
            end += 1
        if P.holds[begin] >= S.rules.number[c, STICKING] > 0.0:
            loads[c, half] = max(loads[c, half], load_of(S, begin, end))
        begin = end


@jitable
def overdue(S: Stepping, h: float) -> float:
    """Return how long before the end of a step h what sticks yields, if its load goes on to grow.

    The halves know the load at a quarter and at three quarters of the step alone.
    """
    late = 0.0
    for c in range(len(S.tally.load)):
        first, last = S.tally.load[c, 0], S.tally.load[c, 1]
        growth = last - first
        beyond = last + 0.5 * growth - 1.0
        if last < 1.0 - YIELDS and beyond > 0.0:
            late = max(late, 0.5 * h * beyond / growth)
    return late
