"""Friction of a step: its coefficient by slip, and when what sticks yields."""

from __future__ import annotations

import math

from mbsim.core.jitable import jitable
from mbsim.core.rotation import add, cross, norm, scale, vector
from mbsim.stepping.arrays import (
    AHEAD,
    DROPS,
    DUE,
    FIRST_SPEED,
    KEPT_STICKS,
    NEAR,
    OF_FIRST,
    OF_SECOND,
    OF_WHOLE,
    OWN_TIME,
    STICKING,
    TOL,
    W_XX,
    W_ZZ,
    Stepping,
)
from mbsim.stepping.displacements import NO_IMPACT
from mbsim.stepping.one_point import apply, slip_at, solve_point, velocity_of
from mbsim.stepping.scales import group_at, noise_of

#: Changes of mu that do not count, over tol, and at most.
YIELDS, LARGEST_YIELD = 10.0, 1e-3
#: Points of a pair that sticks do so up to this times the speed of those that pressed.
FASTER = 2.0
#: A load as large as it may be.
SATURATED = 1.0 - 1e-9
#: Loads from which on they are to be known, and how well, over tol.
CLOSE, SHARPER = 0.9, 1e-5
#: Friction that yields so near to a step's end, over its length, yields there.
AT_END = 2e-3
#: A step goes so far of what is left to where friction yields, while that is not known well.
CLOSER = 0.6


@jitable
def coefficient(S: Stepping, c: int, slip: float) -> float:
    """Return the coefficient of friction of contact c at a slip speed."""
    numbers, knots = S.rules.number[c], S.rules.knots
    if slip <= numbers[FIRST_SPEED]:
        return numbers[STICKING]
    low, high = S.rules.first[c], S.rules.first[c + 1] - 1
    if slip >= knots[high, 0]:
        return knots[high, 1]
    while high - low > 1:
        middle = (low + high) // 2
        if knots[middle, 0] <= slip:
            low = middle
        else:
            high = middle
    part = (slip - knots[low, 0]) / (knots[high, 0] - knots[low, 0])
    return knots[low, 1] + part * (knots[high, 1] - knots[low, 1])


@jitable
def stuck(S: Stepping, k: int) -> bool:
    """Return whether point k pressed in the last step, and stuck."""
    row = S.points.was[k]
    return row >= 0 and S.kept.table[row, KEPT_STICKS] == 1.0


@jitable
def slip_before(S: Stepping, k: int) -> float:
    """Return how fast point k slips at the step's begin."""
    v = S.motion.before
    x, z = velocity_of(S.points, k, 1, v), velocity_of(S.points, k, 2, v)
    return math.sqrt(x * x + z * z)


@jitable
def begin_friction(S: Stepping, count: int, h: float) -> None:
    """Fill the coefficients by which a step begins: those of slip, or of sticking.

    What stuck holds on: by its load it is found whether it does. It moves by what the solver left
    of it; beside what is driven, or turns, also by how far its velocity is from the mean one of a
    step, of order h. Other points of its pair that are no faster begin to press where it sticks.
    """
    P, begin = S.points, 0
    while begin < count:
        end, fastest = begin, -1.0
        while end < count and P.key[end] == P.key[begin]:
            if stuck(S, end):
                fastest = max(fastest, slip_before(S, end))
            end += 1
        for k in range(begin, end):
            slip = 0.0 if stuck(S, k) else slip_before(S, k)
            if fastest >= 0.0 and slip <= FASTER * fastest + noise_of(S, group_at(S, k), h):
                slip = 0.0
            P.holds[k] = coefficient(S, P.contact[k], slip)
        begin = end


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
def let_yield(S: Stepping, count: int, h: float) -> bool:
    """Lower mu where what stuck slips, to that of its slip; return whether that changed much.

    A step in which friction yields is then one that slides from its begin: steps by error end where
    it yields (`part_to_yield`). The solver leaves `sharp` times what it may.
    """
    P, M, changed, begin = S.points, S.motion, False, 0
    least = 1.0 - min(YIELDS * S.plan.number[TOL], LARGEST_YIELD)
    while begin < count:
        end = begin + 1
        while end < count and P.key[end] == P.key[begin]:
            end += 1
        load = -1.0
        for k in range(begin, end):
            if P.r[k, 0] == 0.0 or P.holds[k] < S.rules.number[P.contact[k], STICKING]:
                continue
            x, z = slip_at(P, k, M.v)
            slip = math.sqrt(x * x + z * z)
            if load < 0.0:
                load = load_of(S, begin, end)
            if load < SATURATED and slip <= noise_of(S, group_at(S, k), h):
                continue
            mu = coefficient(S, P.contact[k], slip)
            if mu < least * P.mu[k]:
                P.mu[k] = mu
                changed = True
        begin = end
    return changed


@jitable
def let_stick(S: Stepping, count: int, h: float) -> bool:
    """Let a pair stick by all it can whose slip turns round in the step; return whether one does.

    Or begins below what is none. On its way it stops: whether it goes on then is for its sticking
    friction to say.
    """
    P, M, changed = S.points, S.motion, False
    for k in range(count):
        sticking = S.rules.number[P.contact[k], STICKING]
        if P.r[k, 0] == 0.0 or P.holds[k] >= sticking:
            continue
        along, square, noise = 0.0, 0.0, noise_of(S, group_at(S, k), h)
        for a in range(1, 3):
            before = velocity_of(P, k, a, M.before)
            along += before * velocity_of(P, k, a, M.v)
            square += before * before
        if along < 0.0 or square <= noise * noise:
            P.holds[k] = P.mu[k] = sticking
            changed = True
    return changed


@jitable
def let_jam(S: Stepping, count: int, h: float, sharp: float) -> bool:
    """Take their rebound from points that impulses cannot give it to; return whether from any.

    A body that friction holds on both sides, as a ball in a wedge that is steeper than its angle,
    cannot leave: no impulses within the cones bring about normal velocities -e u then. Without
    rebound there always are some: those that stop everything.
    """
    P, some = S.points, False
    for k in range(count):
        if P.mu[k] == 0.0 or P.part[k] == NO_IMPACT or P.ahead[k] >= 0.0:
            continue
        if solve_point(P, S.motion.v, k) <= sharp * P.least[k]:
            continue
        apply(P, k, S.motion.v, (-P.r[k, 0], -P.r[k, 1], -P.r[k, 2]))
        P.r[k, 0] = P.r[k, 1] = P.r[k, 2] = 0.0
        P.ahead[k], P.part[k], some = max(P.gap[k], 0.0) / h, NO_IMPACT, True
    return some


@jitable
def left_near_yield(S: Stepping, count: int) -> float:
    """Return what may be left where friction is about to yield, inf where it is not.

    That is over what may be left elsewhere: so exactly is the load known then.
    """
    P, least, begin = S.points, math.inf, 0
    while begin < count:
        end, c, most = begin + 1, P.contact[begin], P.mu[begin] * P.r[begin, 0]
        while end < count and P.key[end] == P.key[begin]:
            most += P.mu[end] * P.r[end, 0]
            end += 1
        rule = S.rules.number[c]
        drops = rule[DROPS] == 1.0 and P.holds[begin] >= rule[STICKING]
        if drops and most > 0.0 and load_of(S, begin, end) > CLOSE:
            across = max(P.given[begin, W_XX], P.given[begin, W_ZZ])
            least = min(least, SHARPER * S.plan.number[TOL] * most * across / P.least[begin])
        begin = end
    return least


@jitable
def keep_loads(S: Stepping, count: int, committed: bool) -> None:
    """Keep the largest load of each contact's pairs that stick, -1 for none.

    It is asked in turn of a step, its first half, its second half.
    """
    P, loads, begin = S.points, S.tally.load, 0
    for c in range(len(loads)):
        if committed:
            loads[c, OF_WHOLE] = loads[c, OF_FIRST]
        loads[c, OF_FIRST if committed else OF_SECOND] = -1.0
    while begin < count:
        end, c = begin + 1, P.contact[begin]
        while end < count and P.key[end] == P.key[begin]:
            end += 1
        if P.holds[begin] >= S.rules.number[c, STICKING] > 0.0:
            at = OF_FIRST if committed else OF_SECOND
            loads[c, at] = max(loads[c, at], load_of(S, begin, end))
        begin = end


@jitable
def yields_at(first: float, whole: float, second: float) -> tuple[float, float]:
    """Return the part of a step at which a load gets to 1, inf for never, and how sure that is.

    Loads are those at 1/4, 1/2 and 3/4 of it. A straight line through the last two says something
    else about where it gets there than a parabola through all: that is how sure.
    """
    slope = 4.0 * (second - whole)
    bent = 8.0 * (second - 2.0 * whole + first)
    # load(s) = second + (slope + bent/4) d + bent d^2, d = s - 3/4
    rate, short = slope + 0.25 * bent, 1.0 - second
    root = rate * rate + 4.0 * bent * short
    if root < 0.0 or rate + math.sqrt(root) <= 0.0:
        return math.inf, 0.0
    at = 2.0 * short / (rate + math.sqrt(root))
    straight = short / slope if slope > 0.0 else 0.25
    return 0.75 + at, abs(at - straight)


@jitable
def part_to_yield(S: Stepping, h: float) -> float:
    """Return the part of a step h at which friction yields that stuck at its begin, 1 for none.

    Where a contact's coefficient drops as it yields its force jumps; where it does not, it needs no
    end of a step. It is found to `NEAR` by steps that end there; one that begins there slides.
    """
    part = 1.0
    for c in range(len(S.tally.load)):
        load, scale = S.tally.load[c], S.plan.scale[S.plan.of_contact[c]]
        near = max(scale[NEAR] / h, AT_END)
        if S.rules.number[c, DROPS] == 0.0 or load[DUE] == 1.0 or load[OF_FIRST] < 0.0:
            continue
        first, whole, second = load[OF_FIRST], load[OF_WHOLE], load[OF_SECOND]
        if first < SATURATED and 0.0 <= whole < SATURATED and 0.0 <= second < SATURATED:
            at, unsure = yields_at(first, whole, second)
            if at < 1.0 + near and unsure * min(h / scale[OWN_TIME], 1.0) > near:
                part = min(part, CLOSER * at)
            elif at < 1.0 - near:
                part = min(part, at)
        elif near < 0.5:
            # it has yielded in the step, before its last quarter
            at = load[AHEAD] / h
            if not 0.0 < at < 1.0 - near:
                at = 0.5
                if first < SATURATED and first < whole < SATURATED:
                    at = 0.25 + 0.25 * (1.0 - first) / (whole - first)
                elif first >= SATURATED:
                    at = 0.25
            part = min(part, max(min(at, 0.9), near))
    return part


@jitable
def keep_yield(S: Stepping, h: float) -> None:
    """Note of the step that is taken how long behind its end friction yields, or whether there."""
    for c in range(len(S.tally.load)):
        load = S.tally.load[c]
        near = max(S.plan.scale[S.plan.of_contact[c], NEAR] / h, AT_END)
        first, whole, second = load[OF_FIRST], load[OF_WHOLE], load[OF_SECOND]
        due = second < 0.0 or second >= SATURATED
        load[AHEAD] = math.inf
        if not due and 0.0 <= first < SATURATED and 0.0 <= whole < SATURATED:
            at = yields_at(first, whole, second)[0]
            load[AHEAD] = (at - 1.0) * h
            due = at <= 1.0 + near
        load[DUE] = 1.0 if due else 0.0
