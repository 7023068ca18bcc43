"""A step tried: its error, the problem's check, the branches and events within it."""

from __future__ import annotations

from mbsim.core.address import call_float, call_int
from mbsim.core.arrays import F1
from mbsim.core.jitable import jitable
from mbsim.core.problem import Problem
from mbsim.integrators.branches import FIRST, FITTED, NEAR_CHANGE, TRIED
from mbsim.integrators.control import smallest_step
from mbsim.integrators.events import AT_END
from mbsim.integrators.events import FIRST as FIRST_EVENT
from mbsim.integrators.scheme import (
    CUT_FROM,
    HITS,
    LAST_ERROR,
    NEXT_OUTPUT,
    OWN_TIME,
    REACH,
    SHOWN,
    STIFFNESS,
    SWITCH_CUT,
    SWITCHED,
    TOL,
    Method,
    Steps,
    failure_or,
)

#: An event is located to so much of the problem's own time, or of the time where that is larger.
LOCATED = 1e-11
#: So often at most a step is taken again to end at its first event.
MOST_RETAKES = 40
#: A step that is cut at a switch is so much longer than the smallest one: it may be rejected and
#: tried shorter.
NEAR_FLOORS = 100.0
#: So often at most a step is taken again to end at a switch.
MOST_CUTS = 3
#: So often at most a step is shortened for the load of what holds.
MOST_SHORT = 20
#: A row so near to an end of a step, over its length, is at that end.
AT_AN_END = 1e-9


@jitable
def output_within(m: Method, times: F1, t: float) -> bool:
    """Return whether an output is due up to time t."""
    return m.counts[NEXT_OUTPUT] < len(times) and times[m.counts[NEXT_OUTPUT]] <= t


@jitable
def row_within(m: Method, times: F1, t: float, h: float) -> float:
    """Return how far from t the first row within a step h is whose velocities jump, else 0.

    A row at its begin may not be there yet, for t is less than that by rounding.
    """
    if m.memory[HITS] == 0.0:
        return 0.0
    for row in range(m.counts[NEXT_OUTPUT], len(times)):
        away = times[row] - t
        if away > AT_AN_END * h:
            return away if away < (1.0 - AT_AN_END) * h else 0.0
    return 0.0


@jitable
def attempt(
    p: Problem, m: Method, steps: Steps, t: float, h: float, times: F1
) -> tuple[int, float, float]:
    """Try a step of length h; return a hook's code, the check's part, the inner point asked for.

    A step that fails is not checked. The dense output of one that will be taken is fitted
    before the problem is committed, while its hooks still know the step's begin. Single impacts
    are not guarded, nor their peaks looked for, by a method whose step is the problem's bound.
    """
    m.memory[SWITCHED], m.memory[REACH] = 0.0, 1.0
    code = failure_or(m, call_int(steps.attempt, (steps.context, t, h, m.y, m.trial)))
    if code != 0 or not m.memory[LAST_ERROR] <= 1.0:
        return code, 1.0, -1.0
    asked, looks = -1.0, False
    # one that ends before a switch at the end is taken for the end
    until = t + h + smallest_step(t + h, m.memory[OWN_TIME], 0.0)
    if steps.order > 0.0:
        if p.check != 0:
            part = call_float(p.check, (p.context, t + h, h, m.trial, m.k[steps.last]))
            if part < 1.0:
                return 0, part, -1.0
        if p.inner != 0:
            m.error[0] = m.memory[TOL]
            asked = call_float(p.inner, (p.context, t, h, m.y, m.error))
    if steps.branches != 0:
        looks = call_float(steps.branches, (steps.context, TRIED, t, h, 0.0)) == 1.0
    # a peak is looked for in every step of what trembles at its bound of stability: not shown
    shown = output_within(m, times, until)
    m.memory[SHOWN] = 1.0 if shown else 0.0
    if asked >= 0.0 or shown or looks or steps.events != 0:
        code = call_int(steps.fit_dense, (steps.context, t, h, m.y, m.trial))
    if looks and code == 0:
        call_float(steps.branches, (steps.context, FITTED, t, h, 0.0))
    return code, 1.0, asked


@jitable
def attempt_to_event(
    p: Problem, m: Method, steps: Steps, t: float, h: float, times: F1, floor: float
) -> tuple[int, float, float, float, float]:
    """Try a step as `attempt` does, again and shorter where an event lies in it; return h too.

    And the error of the step before it was made shorter.

    A step with a switch ends just behind it, so that none has one in its midst. One in which
    velocities jump ends at the first row within it.
    A step with an event ends at most LOCATED behind it. It is a whole step of the method, so
    the state there is no interpolated one; where that ends before the event after all, it is
    tried a little longer.
    """
    near = LOCATED * max(m.memory[OWN_TIME], abs(t))
    nudge = 1e-3 * near
    shortened, retakes, cuts, short = False, 0, 0, 0
    whole = max(h, m.memory[CUT_FROM], NEAR_FLOORS / NEAR_CHANGE * floor)
    uncut, stiffness = -1.0, 0.0
    # `attempt` is named once: each place where it is called is compiled anew
    while True:
        code, part, asked = attempt(p, m, steps, t, h, times)
        failed = code != 0 or not m.memory[LAST_ERROR] <= 1.0 or part < 1.0
        if uncut < 0.0:
            uncut, stiffness = m.memory[LAST_ERROR], m.memory[STIFFNESS]
        # whether stability bounds a step is asked of what it would be without the event
        m.memory[STIFFNESS] = stiffness
        if m.memory[SWITCHED] > 0.0 and not failed and cuts < MOST_CUTS and not shortened:
            cuts += 1
            cut = call_float(steps.branches, (steps.context, FIRST, t, h, whole))
            if floor < cut < h:
                h = cut
                continue
        if m.memory[REACH] < 1.0 and not failed and short < MOST_SHORT and not shortened:
            short += 1
            if m.memory[REACH] * h > floor:
                h *= m.memory[REACH]
                continue
        row = row_within(m, times, t, h)
        if row > 0.0 and not failed:
            h = row
            continue
        m.memory[SWITCH_CUT] = 1.0 if cuts > 0 else 0.0
        if steps.events == 0 or failed:
            return failure_or(m, code), part, asked, h, uncut
        looked = (steps.context, FIRST_EVENT, t, h, times, len(times))
        cut = call_float(steps.events, looked)
        before = cut > h
        good = (not shortened or nudge > near) if before else (h - cut <= near or h <= floor)
        if good or retakes == MOST_RETAKES:
            break
        retakes += 1
        if before:
            h += nudge
            nudge *= 2.0
        else:
            h = max(cut, floor)
            shortened = True
    # the problem's hooks expect its last evaluation at the trial point
    call_float(steps.events, (steps.context, AT_END, t, h, times, len(times)))
    return failure_or(m, code), part, asked, h, uncut
