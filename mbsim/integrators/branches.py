"""Where within a step a force changes its branch, and how far the load of what holds is known.

The problem's hook `switching` tells branches apart (`core.problem`). What the driver asks of them
stands behind an address, `serve`: problems without such forces compile nothing of it.
"""

from __future__ import annotations

import math

from mbsim.core.address import call_int
from mbsim.core.arrays import F1
from mbsim.core.jitable import jitable
from mbsim.core.problem import (
    ASK,
    BENDS,
    HALF,
    HALVES,
    HIDES,
    LOAD,
    LOAD_AT_MOST,
    MILLIONTHS,
    PASS,
    PASS_CUT,
    SETTLE,
    Problem,
)
from mbsim.core.signature import FLOAT, INT
from mbsim.integrators.scheme import (
    AT_ONCE,
    DIP,
    HOLDS,
    LAST_ERROR,
    LOOKS,
    REACH,
    SWITCH_CUT,
    SWITCHED,
    TOL,
    VAIN,
    Method,
    answer_of,
    in_workspace,
    interpolate,
)

#: Of `serve`: context, what is asked, time and step, and of FIRST how long that was meant to be.
ASKED = FLOAT(INT, INT, FLOAT, FLOAT, FLOAT)
#: A step begins where nothing is known; one was tried, is fitted, may be cut; one was taken.
BEGIN, TRIED, FITTED, FIRST, TAKEN = range(5)
#: What is looked for within a step (`LOOKS`): sides that change twice, ways that bend.
SIDES, WAYS = 1.0, 2.0

#: At so many parts of a step for a side that is left and come back to: near the end of a touch what
#: holds slips for a moment, a small part of a step of a high order.
LOOKS_FOR_HIDDEN = 16
#: Switches so near to an end of a step, as a part of it, are as good as at the end: what a switch
#: makes wrong grows with the square of what is left of the step behind it, a jump's with that
#: itself.
NEAR_SWITCH = 1e-4
#: The same where what goes on is another motion, which begins there: friction that sticks or slips.
NEAR_CHANGE = 1e-9
#: So much farther behind a switch ends a step after two that were cut there in vain, up to the
#: whole of it: bodies do not move at all in a very short one, for positions have no more digits,
#: and then no side changes.
FARTHER = 10.0
#: The part of a step at which a force is looked at that leaves its branch at once: farther on it
#: may be back on it, and nothing tells there that the step began where it could not.
JUST_BEHIND = 1e-6
#: How much the load of what friction holds may bend within a step, over its limit and sqrt(tol).
BENT = 2.0
#: How many times as far from the limit as it bends it has to stay to bend as it likes.
FAR = 2.0


@jitable
def ask_switching(p: Problem, m: Method, t: float, what: float, y: F1, b: F1) -> int:
    """Return what the hook `switching` answers; 0 where it failed, which is noted."""
    return answer_of(m, call_int(p.switching, (p.context, t, what, y, b)))


@jitable
def load_of(p: Problem, m: Method, t: float, y: F1, what: float) -> float:
    """Return the load of what friction holds at y, over its limit; -1 where it holds nothing.

    `what`: LOAD, or LOAD_AT_MOST.
    """
    return m.error[0] if ask_switching(p, m, t, what, y, m.error) == 1 else -1.0


@jitable
def side_at(p: Problem, m: Method, t: float, h: float, s: float, what: float) -> bool:
    """Return whether a force is on another branch at the part s of the fitted step.

    Sides are those just behind the step's begin: before that only what is found exactly counts.
    """
    interpolate(m, s, m.error)
    differs = ask_switching(p, m, t + s * h, what, m.error, m.error)
    return differs > (0 if s >= NEAR_SWITCH else 1)


@jitable
def first_switch(p: Problem, m: Method, t: float, h: float, whole: float, behind: float) -> float:
    """Return the length of the fitted step up to its first switch that matters, h for none.

    `whole` is its length before it was cut, or more where that is little; `behind` is a part of it
    at which a side differs. The problem is left evaluated at the trial point.
    """
    farther = FARTHER ** max(0.0, m.memory[VAIN] - 1.0)
    low, high, near = NEAR_SWITCH, behind, NEAR_SWITCH * farther
    if near < behind:
        interpolate(m, low, m.error)
        if ask_switching(p, m, t + low * h, ASK, m.error, m.error) > 1:
            behind = high = low
        else:
            side_at(p, m, t, h, low, SETTLE)
    if behind < 1.0:
        interpolate(m, behind, m.error)
        differs = ask_switching(p, m, t + behind * h, ASK, m.error, m.error)
    else:
        differs = ask_switching(p, m, t + h, ASK, m.trial, m.error)
    if differs < 2 and near >= behind:
        ask_switching(p, m, t + h, ASK, m.trial, m.error)
        return h
    if differs > 1:
        # it is told from what was committed, however near that is
        # a part of the whole step: where it lies at the very begin, as behind another, a step
        # that is cut again and again would get too short to reach it
        low, near = 0.0, NEAR_CHANGE * whole / h * farther
    if differs > 0:
        while high - low > 0.1 * near:
            middle = 0.5 * (low + high)
            if side_at(p, m, t, h, middle, ASK):
                high = middle
            else:
                low = middle
    ask_switching(p, m, t + h, ASK, m.trial, m.error)
    # a little more, so that the step after it begins on the other side
    return h if high > 1.0 - near else (high + 0.5 * near) * h


@jitable
def loads_of(p: Problem, m: Method, t: float, h: float, what: float) -> tuple[float, float, float]:
    """Return the largest load of what holds over the fitted step, how much it bends there, a part.

    That is the first part of the step at which the load is above 1, and 1 for none. The problem is
    left evaluated at the trial point.
    """
    begin = load_of(p, m, t, m.y, what)
    interpolate(m, 0.25, m.error)
    first = load_of(p, m, t + 0.25 * h, m.error, what)
    interpolate(m, 0.5, m.error)
    middle = load_of(p, m, t + 0.5 * h, m.error, what)
    interpolate(m, 0.75, m.error)
    last = load_of(p, m, t + 0.75 * h, m.error, what)
    end = load_of(p, m, t + h, m.trial, what)
    bent = max(
        abs(first - 0.75 * begin - 0.25 * end),
        abs(middle - 0.5 * begin - 0.5 * end),
        abs(last - 0.25 * begin - 0.75 * end),
    )
    passed = 0.75 if last > 1.0 else 1.0
    passed = 0.5 if middle > 1.0 else passed
    passed = 0.25 if first > 1.0 else passed
    return max(begin, first, middle, last, end), bent, passed


@jitable
def horizon_of(p: Problem, m: Method, t: float, h: float) -> float:
    """Return the part of the fitted step over which the load of what holds is known, 1 for all.

    What holds does not move, so that the method's error says nothing of its load: that is to go
    straight from its begin to the trial point but for BENT sqrt(tol) of the limit, so that it
    cannot pass the limit and come back unseen, or for less than what it stays away from the limit.
    What passes it there is cut off. The problem is left evaluated at the trial point.
    """
    most, bent, _ = loads_of(p, m, t, h, LOAD_AT_MOST)
    if most + FAR * bent <= 1.0:
        return 1.0
    most, bent, passed = loads_of(p, m, t, h, LOAD)
    allowed = BENT * math.sqrt(m.memory[TOL])
    if passed < 1.0 or bent <= allowed or most + FAR * bent <= 1.0:
        return passed
    return max(0.1, 0.9 * math.sqrt(allowed / bent))


@jitable
def path_error(p: Problem, m: Method, t: float, h: float) -> float:
    """Return the error, over tol, of friction that follows the way of the fitted step in one.

    Its closed form takes the way for a cubic, whatever the method makes of it, and no difference of
    stages tells how far that is off: two halves of the step do. What they make of it is kept.
    """
    interpolate(m, 0.5, m.error)
    ask_switching(p, m, t + 0.5 * h, HALF, m.error, m.error)
    ask_switching(p, m, t + h, HALVES, m.trial, m.error)
    return m.error[0] / m.memory[TOL]


@jitable
def hidden_side(p: Problem, m: Method, t: float, h: float) -> float:
    """Return a part of the fitted step at which a side differs that does not at its end, else 0.

    Where slip is least it is looked at first. The problem is left evaluated at the trial point.
    """
    part = m.memory[DIP]
    if part > 0.0 and not side_at(p, m, t, h, part, ASK):
        part = 0.0
    for k in range(1, LOOKS_FOR_HIDDEN):
        if part == 0.0 and side_at(p, m, t, h, k / LOOKS_FOR_HIDDEN, ASK):
            part = k / LOOKS_FOR_HIDDEN
    ask_switching(p, m, t + h, ASK, m.trial, m.error)
    return part


@jitable
def look_at(p: Problem, m: Method, t: float, h: float) -> bool:
    """Ask for the branches at the trial point; return whether the step is to be looked into."""
    m.memory[LOOKS], m.memory[HOLDS] = 0.0, 0.0
    if ask_switching(p, m, t + h, ASK, m.trial, m.error) > 0:
        m.memory[SWITCHED] = 1.0
        return True
    if m.memory[AT_ONCE] == 1.0:
        m.memory[SWITCHED] = JUST_BEHIND
        return True
    hides = ask_switching(p, m, t + h, HIDES, m.trial, m.y)
    m.memory[DIP] = max(0, hides - 1) / MILLIONTHS
    if hides > 0:
        m.memory[LOOKS] += SIDES
    if ask_switching(p, m, t + h, BENDS, m.trial, m.y) > 0:
        m.memory[LOOKS] += WAYS
    m.memory[HOLDS] = 1.0 if load_of(p, m, t + h, m.trial, LOAD_AT_MOST) >= 0.0 else 0.0
    return m.memory[LOOKS] > 0.0 or m.memory[HOLDS] == 1.0


@jitable
def look_into(p: Problem, m: Method, t: float, h: float) -> None:
    """Look for what `look_at` asked for in the step, which is fitted."""
    looks = m.memory[LOOKS]
    if m.memory[HOLDS] == 1.0:
        m.memory[REACH] = horizon_of(p, m, t, h)
    if looks == SIDES or looks == SIDES + WAYS:
        m.memory[SWITCHED] = hidden_side(p, m, t, h)
    if looks >= WAYS and m.memory[SWITCHED] == 0.0:
        m.memory[LAST_ERROR] = max(m.memory[LAST_ERROR], path_error(p, m, t, h))


def serve(context: int, what: int, t: float, h: float, whole: float) -> float:
    """What the driver asks of branches; return an answer of TRIED and FIRST, else 0."""
    p, m = in_workspace(context)
    if what == TRIED:
        return 1.0 if look_at(p, m, t, h) else 0.0
    if what == FITTED:
        look_into(p, m, t, h)
    elif what == FIRST:
        return first_switch(p, m, t, h, whole, m.memory[SWITCHED])
    elif what == BEGIN:
        ask_switching(p, m, t, SETTLE, m.y, m.error)
    else:
        passed = PASS_CUT if m.memory[SWITCH_CUT] == 1.0 else PASS
        changed = ask_switching(p, m, t + h, passed, m.trial, m.error) > 0
        in_vain = m.memory[SWITCH_CUT] == 1.0 and not changed
        m.memory[VAIN] = m.memory[VAIN] + 1.0 if in_vain else 0.0
        leaves = changed and ask_switching(p, m, t + h, ASK, m.trial, m.error) > 1
        m.memory[AT_ONCE] = 1.0 if leaves else 0.0
    return 0.0
