"""A step tried: its error, the problem's check, the branches and events within it."""

from __future__ import annotations

from mbsim.core.address import call_float, call_int
from mbsim.core.arrays import F1
from mbsim.core.jitable import jitable
from mbsim.core.problem import ASK, BENDS, HIDES, Problem
from mbsim.integrators.branches import (
    NEAR_CHANGE,
    ask_switching,
    first_switch,
    hidden_side,
    horizon_of,
    load_of,
    way_error,
)
from mbsim.integrators.control import smallest_step
from mbsim.integrators.events import first_event, happens_at
from mbsim.integrators.scheme import (
    CUT_FROM,
    LAST_ERROR,
    NEXT_OUTPUT,
    OWN_TIME,
    SHOWN,
    STIFFNESS,
    SWITCH_CUT,
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


@jitable
def output_within(m: Method, times: F1, t: float) -> bool:
    """Return whether an output is due up to time t."""
    return m.counts[NEXT_OUTPUT] < len(times) and times[m.counts[NEXT_OUTPUT]] <= t


@jitable
def attempt(
    p: Problem, m: Method, steps: Steps, t: float, h: float, times: F1
) -> tuple[int, float, float, float, float]:
    """Try a step of length h; return a hook's code, the check's part, the inner point asked for.

    And a part of it at which a force is on another branch, 0 for none, and what `horizon_of`
    allows.

    A step that fails is not checked. The dense output of one that will be taken is fitted
    before the problem is committed, while its hooks still know the step's begin. Single impacts
    are not guarded, nor their peaks looked for, by a method whose step is the problem's bound.
    """
    code = failure_or(m, call_int(steps.attempt, (steps.context, t, h, m.y, m.trial)))
    if code != 0 or not m.memory[LAST_ERROR] <= 1.0:
        return code, 1.0, -1.0, 0.0, 1.0
    asked, switched, bends, hides, begin, reach = -1.0, 0.0, False, False, -1.0, 1.0
    # one that ends before a switch at the end is taken for the end
    until = t + h + smallest_step(t + h, m.memory[OWN_TIME], 0.0)
    if steps.order > 0.0:
        if p.check != 0:
            part = call_float(p.check, (p.context, t + h, h, m.trial, m.k[steps.last]))
            if part < 1.0:
                return 0, part, -1.0, 0.0, 1.0
        if p.inner != 0:
            asked = call_float(p.inner, (p.context, t, h, m.y, m.error))
    if p.switching != 0:
        differs = ask_switching(p, m, t + h, ASK, m.trial, m.error)
        switched = 1.0 if differs > 0 else 0.0
        if switched == 0.0:
            hides = ask_switching(p, m, t + h, HIDES, m.trial, m.y) > 0
            bends = ask_switching(p, m, t + h, BENDS, m.trial, m.y) > 0
            begin = load_of(p, m, t, m.y)
    looks = switched > 0.0 or hides or bends or begin >= 0.0
    # a peak is looked for in every step of what trembles at its bound of stability: not shown
    shown = output_within(m, times, until)
    m.memory[SHOWN] = 1.0 if shown else 0.0
    if asked >= 0.0 or shown or looks or p.happens != 0:
        code = call_int(steps.fit_dense, (steps.context, t, h, m.y, m.trial))
    if begin >= 0.0 and code == 0:
        reach = horizon_of(p, m, t, h, begin)
    if hides and code == 0:
        switched = hidden_side(p, m, t, h)
    if bends and code == 0 and switched == 0.0:
        m.memory[LAST_ERROR] = max(m.memory[LAST_ERROR], way_error(p, m, t, h))
    return code, 1.0, asked, switched, reach


@jitable
def attempt_to_event(
    p: Problem, m: Method, steps: Steps, t: float, h: float, times: F1, floor: float
) -> tuple[int, float, float, float, float]:
    """Try a step as `attempt` does, again and shorter where an event lies in it; return h too.

    And the error of the step before it was made shorter.

    A step with a switch ends just behind it, so that none has one in its midst.
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
        code, part, asked, switched, reach = attempt(p, m, steps, t, h, times)
        failed = code != 0 or not m.memory[LAST_ERROR] <= 1.0 or part < 1.0
        if uncut < 0.0:
            uncut, stiffness = m.memory[LAST_ERROR], m.memory[STIFFNESS]
        # whether stability bounds a step is asked of what it would be without the event
        m.memory[STIFFNESS] = stiffness
        if switched > 0.0 and not failed and cuts < MOST_CUTS and not shortened:
            cuts += 1
            cut = first_switch(p, m, t, h, whole, switched)
            if floor < cut < h:
                h = cut
                continue
        if reach < 1.0 and not failed and short < MOST_SHORT and not shortened:
            short += 1
            if reach * h > floor:
                h *= reach
                continue
        m.memory[SWITCH_CUT] = 1.0 if cuts > 0 else 0.0
        if p.happens == 0 or failed:
            return failure_or(m, code), part, asked, h, uncut
        cut = first_event(p, m, t, h, times)
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
    happens_at(p, m, t, h, 1.0)
    return failure_or(m, code), part, asked, h, uncut
