"""Which points close within a step, and how they are to leave: what impulses have to bring about.

A point that comes in with speed leaves with its restitution; one that others hold back, or that
impulses of the same step throw at each other, does not meet in it.
"""

from __future__ import annotations

from mbsim.core.jitable import jitable
from mbsim.stepping.arrays import (
    LENGTH,
    RESTITUTION,
    SLOP,
    SLOWEST,
    W_NN,
    Stepping,
)
from mbsim.stepping.carried import OTHERWISE, distance_held, fly_to, rests
from mbsim.stepping.displacements import NO_IMPACT, meets_at
from mbsim.stepping.one_point import apply, velocity_of
from mbsim.stepping.scales import group_at, noise_of

#: So near to a surface, over its group's length, what would meet it without rebound is held there.
NEARLY = 0.01
#: A point has landed if this part of its gap is left at most, or so many times what counts.
SHORT_OF, MANY_SLOPS = 0.1, 10.0
#: Of `Points.held`: other points keep its bodies from meeting; they meet at the step's end.
HELD, LANDS = 1, 2
#: A point that is let go of may close so many times faster than it does.
LET_GO = 100.0


@jitable
def look_ahead(S: Stepping, k: int, h: float) -> None:
    """Fill what the normal velocity of point k is held above, and the part before an impact.

    That is NO_IMPACT where it comes too slowly for one: the gap is all that may close. Else the
    point comes in at u, and leaves at e u; what accelerates it goes on behind the impact.
    """
    P, M, rule = S.points, S.motion, S.rules.number[S.points.contact[k]]
    g = group_at(S, k)
    slop = S.plan.scale[g, SLOP]
    gap, before = P.gap[k], P.closing[k]
    if P.was[k] >= 0 and 0.0 < gap <= slop:
        # it lies on: to follow what does not count would keep all that rests in motion
        gap = 0.0
    free = velocity_of(P, k, 0, M.flight)
    P.ahead[k] = max(gap, 0.0) / h
    P.part[k] = NO_IMPACT
    mean = 0.5 * (before + free)
    if gap + h * mean >= 0.0:
        # it does not close by itself
        P.ahead[k] = max(P.ahead[k], -free)
        return
    part = meets_at(gap, h, before, free)
    comes, slowest = before + part * (free - before), max(rule[SLOWEST], noise_of(S, g, h))
    if comes >= -slowest or (gap <= slop and before >= -slowest):
        return
    leaves = -rule[RESTITUTION] * comes + (1.0 - part) * (free - before)
    P.ahead[k] = -max(leaves, 0.0)
    P.part[k] = part


@jitable
def is_held(S: Stepping, k: int, h: float) -> bool:
    """Return whether other points may keep the bodies of point k from meeting there in the step.

    They fly there; with the impulses of the last step they do not. Were they taken to meet, both
    would be pushed off a place that they never come to.
    """
    P, M, gap = S.points, S.motion, S.points.gap[k]
    scale = S.plan.scale[group_at(S, k)]
    if gap <= scale[SLOP] or gap + h * P.closing[k] < 0.0:
        # it is there, or comes as it moves
        return False
    if P.ahead[k] >= 0.0 and gap <= NEARLY * scale[LENGTH]:
        # it stays where it is: what rests does not rock on what is left of velocities
        return False
    if M.changed[P.body[k, 0]] == 1 or M.changed[P.body[k, 1]] == 1:
        return True
    return gap + 0.5 * h * (P.closing[k] + velocity_of(P, k, 0, M.v)) >= 0.0


@jitable
def let_meet(S: Stepping, count: int, h: float) -> bool:
    """Let points meet that were taken to be held and press all the same; return if any do."""
    P, some = S.points, False
    for k in range(count):
        if P.held[k] == HELD and P.r[k, 0] > 0.0:
            look_ahead(S, k, h)
            P.held[k], some = 0, True
    return some


@jitable
def let_carry(S: Stepping, count: int, h: float) -> bool:
    """Let bodies be carried that are hit and stay where they are, though they were to fly.

    What held them in the last step did not tell: that was an impact, or they had none. Return
    whether there were any.
    """
    P, M, some = S.points, S.motion, False
    for k in range(count):
        if P.r[k, 0] == 0.0 or P.part[k] == NO_IMPACT:
            continue
        for b in P.body[k]:
            if b == len(S.rest.body):
                continue
            off = distance_held(S, b, M.flight, M.before)
            if off > OTHERWISE * distance_held(S, b, M.free, M.before) and rests(S, b, h):
                some = True
                fly_to(S, b, M.before)
    if some:
        for k in range(count):
            if P.part[k] != NO_IMPACT:
                look_ahead(S, k, h)
    return some


@jitable
def let_share(S: Stepping, count: int) -> bool:
    """Let impacts of a body be where the first one divides its way, where they would do work.

    Elsewhere in the step its weight had another velocity to work on than its way has. Points that
    give back all do none then, and no others do any. Return whether there were any.
    """
    P, M, some = S.points, S.motion, False
    for k in range(count):
        if P.r[k, 0] == 0.0 or P.part[k] == NO_IMPACT:
            continue
        i = P.body[k, 0] if P.body[k, 0] != len(S.rest.body) else P.body[k, 1]
        part, restitution = M.part[i], S.rules.number[P.contact[k], RESTITUTION]
        if not part < P.part[k]:
            continue
        comes, flown = P.closing[k], velocity_of(P, k, 0, M.flight) - P.closing[k]
        if restitution < 1.0 and comes + (2.0 * part - 1.0) * flown <= P.ahead[k]:
            continue
        ahead = -max((1.0 - part) * flown - restitution * (comes + part * flown), 0.0)
        some = some or abs(ahead - P.ahead[k]) > P.least[k]
        P.part[k], P.ahead[k] = part, ahead
    return some


@jitable
def let_land(S: Stepping, count: int, h: float) -> bool:
    """Let points close their gaps that were to land without rebound, and do not get there.

    A point that lands stops where it meets the surface. Where others press on its bodies, or land
    earlier, these do not go the way there: they would hang above the surface for good. Such points
    end the step at the surface, gap + h u_n' >= 0. Return whether there were any.
    """
    P, M, some = S.points, S.motion, False
    for k in range(count):
        if P.r[k, 0] == 0.0 or P.part[k] == NO_IMPACT or P.ahead[k] < 0.0:
            continue
        left = P.gap[k] + h * velocity_of(P, k, 0, M.shift)
        counts = MANY_SLOPS * S.plan.scale[group_at(S, k), SLOP]
        if left > max(counts, SHORT_OF * P.gap[k]):
            P.ahead[k], P.part[k], P.held[k] = P.gap[k] / h, NO_IMPACT, LANDS
            some = True
    return some


@jitable
def postpone(S: Stepping, count: int, h: float) -> bool:
    """Let go of points with restitution at which bodies meet that impulses threw at each other.

    Their impact begins with the next step: at the end of this one they are as near as the
    projection of positions lets them, with the velocities that bring them together. Solved in one
    with what threw them, nothing would rebound. Return whether there were any.
    """
    P, M, some = S.points, S.motion, False
    for k in range(count):
        rule = S.rules.number[P.contact[k]]
        if P.r[k, 0] == 0.0 or rule[RESTITUTION] == 0.0 or P.part[k] != NO_IMPACT:
            continue
        g = group_at(S, k)
        if P.gap[k] <= S.plan.scale[g, SLOP] or P.held[k] == LANDS:
            continue
        # without its impulse
        u = velocity_of(P, k, 0, M.v)
        for a in range(3):
            u -= P.given[k, W_NN + a] * P.r[k, a]
        if u >= -max(rule[SLOWEST], noise_of(S, g, h)):
            continue
        apply(P, k, M.v, (-P.r[k, 0], -P.r[k, 1], -P.r[k, 2]))
        P.r[k, 0] = P.r[k, 1] = P.r[k, 2] = 0.0
        P.ahead[k] = -LET_GO * u
        some = True
    return some
