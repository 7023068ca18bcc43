"""The driver of the one-step methods: steps, control, guards, outputs, returns to Python.

A method (`scheme.py`) tries a step; the driver decides about it, the problem's hooks have their
say, and a step is taken. After E. Hairer, S. P. Norsett, G. Wanner, Solving ODEs I (1993), II.4.
"""

from __future__ import annotations

import math

from mbsim.core.address import call_float, call_int
from mbsim.core.codes import AT_ONCE, Code
from mbsim.core.jitable import jitable
from mbsim.core.problem import (
    ASK,
    BENDS,
    BY_CHECK,
    BY_ERROR,
    BY_NEWTON,
    BY_NOT_FINITE,
    CHANGES_OVER,
    DONE,
    FAILED,
    HALF,
    HALVES,
    HAPPENED,
    HIDES,
    LOAD,
    PASS,
    PAUSED,
    ROWS_FULL,
    SETTLE,
    STABLE_EVERY,
    STEP_TOO_SMALL,
    TABLE_OVER,
    WATCH_DUE,
    WATCH_EVERY,
    Taken,
)
from mbsim.integrators.changing import changes_over
from mbsim.integrators.control import (
    HOLD,
    extrapolated_factor,
    next_factor,
    quantised,
    smallest_step,
    starting_step,
)
from mbsim.integrators.scheme import (
    AFTER_REJECTION,
    CHANGE_DUE,
    CODE,
    CORRECTION,
    CUT_FROM,
    ERROR_BEFORE,
    EVALUATIONS,
    EVENT_DUE,
    FAILED_AT,
    FAILURES,
    FIRST_MAX,
    FRESH,
    GROWTH,
    H_LARGEST,
    H_SMALLEST,
    HAVE_F,
    HAVE_JACOBIAN,
    HORIZON,
    LAST_ERROR,
    LAST_REASON,
    LAST_STEP,
    LAST_TIME,
    LEFT_OVER,
    LEFT_TIME,
    NEXT_OUTPUT,
    NEXT_WATCH,
    OUTPUTS,
    OWN_TIME,
    REJECTED,
    REST,
    RETRY,
    ROW,
    ROW_ENDS,
    SHOWN,
    STALE,
    STEP,
    STEPS,
    STIFFNESS,
    SWITCH_CUT,
    TIME,
    TOL,
    VAIN,
    WAS_CUT,
    WATCH,
    answer_of,
    failure_or,
    in_workspace,
    interpolate,
    note_failure,
    project,
)

#: An event is located to so much of the problem's own time, or of the time where that is larger.
LOCATED = 1e-11
#: A step is looked into for events at so many points, and at one more for each row within it,
#: up to so many.
LOOKS, MOST_LOOKS = 4, 64
#: At so many parts of a step for a side that is left and come back to: near the end of a touch what
#: holds slips for a moment, a small part of a step of a high order.
LOOKS_FOR_HIDDEN = 16
#: So often at most a step is taken again to end at its first event.
MOST_RETAKES = 40

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
#: The same over the smallest step: one that ends there may be rejected and tried shorter.
NEAR_FLOORS = 100.0
#: So often at most a step is taken again to end at a switch.
MOST_CUTS = 3
#: Where steps are cut one after another, whole ones grow so much at most.
CUT_GROW = 2.0
#: How much the load of what friction holds may bend within a step, over its limit and sqrt(tol),
#: and how often a step is shortened for that.
BENT, MOST_SHORT = 2.0, 20

#: A hook that fails is tried again at a tenth of the step, so many times; one whose numbers are
#: not finite may be so for a trial far out of reach.
MOST_FAILURES, MOST_NOT_FINITE = 5, 20
#: A step that ends behind the last failure takes so much from the count of failures. Until then
#: nothing shows that the hook gives numbers there: before it a step may be too short to ask.
FORGIVEN = 0.1


@jitable
def first_step(p, m, t, span, order):
    """Return a first step from f and a small explicit Euler probe."""
    n = len(m.y)
    rate = call_float(p.norm, (p.context, t, 0.0, m.k[0], m.y))
    # how long the run lasts only cuts it: what is found by it is of the motion
    probe = min(1e-4 / rate if rate > 0.0 else 1e-3 * m.memory[OWN_TIME], span)
    for i in range(n):
        m.trial[i] = m.y[i] + probe * m.k[0, i]
    m.counts[EVALUATIONS] += 1
    code = call_int(p.rhs, (p.context, t + probe, probe, m.trial, m.k[1]))
    curvature = 0.0
    if code == 0:
        for i in range(n):
            m.error[i] = (m.k[1, i] - m.k[0, i]) / probe
        curvature = call_float(p.norm, (p.context, t, 0.0, m.error, m.y))
    return starting_step(rate, curvature, m.memory[TOL], order, span)


@jitable
def stable(p, m, t, h_max):
    """Return the step of a method without error estimate."""
    if p.stable == 0:
        return h_max
    return quantised(min(h_max, call_float(p.stable, (p.context, t, m.memory[TOL], m.y, m.k[0]))))


@jitable
def bound_is_due(m):
    """Return whether the stability bound is to be found anew."""
    return m.counts[STEPS] % STABLE_EVERY == 0 or m.memory[STALE] == 1.0


@jitable
def ask_switching(p, m, t, what, y, b):
    """Return what the hook `switching` answers; 0 where it failed, which is noted."""
    return answer_of(m, call_int(p.switching, (p.context, t, what, y, b)))


@jitable
def load_of(p, m, t, y):
    """Return the load of what friction holds at y, over its limit; -1 where it holds nothing."""
    return m.error[0] if ask_switching(p, m, t, LOAD, y, m.error) == 1 else -1.0


@jitable
def begin(p, m, steps, t, t_end, h_max):
    """Evaluate f at the committed point and choose a first step where there is none."""
    if m.memory[HAVE_F] == 0.0:
        m.counts[EVALUATIONS] += 1
        code = call_int(p.rhs, (p.context, t, 0.0, m.y, m.k[0]))
        if code != 0:
            return code
        m.memory[HAVE_F] = 1.0
        if p.switching != 0:
            ask_switching(p, m, t, SETTLE, m.y, m.error)
        m.memory[FRESH] = 1.0
        m.memory[HAVE_JACOBIAN] = 0.0
    if m.memory[STEP] == 0.0:
        if steps.order == 0.0:
            m.memory[STEP] = stable(p, m, t, h_max)
        else:
            m.memory[STEP] = first_step(p, m, t, t_end - t, steps.order)
        if m.memory[FIRST_MAX] > 0.0:
            m.memory[STEP] = min(m.memory[STEP], m.memory[FIRST_MAX])
    return failure_or(m, 0)


@jitable
def length(p, m, steps, t, t_end, h_max, floor):
    """Return the length of the step to try from t."""
    h = min(m.memory[STEP], h_max)
    if steps.order > 0.0:
        limit = call_float(p.limit, (p.context, t, h, m.y, m.k[0]))
        if steps.implicit:
            # in a shorter one velocities are rounding errors of positions over h
            limit = max(limit, LOCATED * max(m.memory[OWN_TIME], abs(t)))
        h = min(quantised(h), limit)
    h = max(h, floor)
    # no sliver of a step before the end
    return t_end - t if t + 1.01 * h >= t_end else h


@jitable
def reject(p, m, t, h, reason, cut_from):
    """Count a rejected step, tell the problem, and note the length h to try instead.

    `cut_from` is how long the step was meant to be, where nothing but its end is at fault, else 0.
    """
    m.counts[REJECTED] += 1
    m.counts[LAST_REASON] = reason
    code = call_int(p.reject, (p.context, t, float(reason), m.y, m.error))
    if code != 0:
        note_failure(m, code)
    m.memory[STEP] = h
    m.memory[CUT_FROM] = cut_from


@jitable
def gives_up(m, code, t, h, floor):
    """Return whether the failure of a hook in the step from t ends the run.

    Else it is tried again nearer: a trial far ahead may be where no law was meant for.
    """
    if code == Code.NOT_CONVERGED:
        return False
    m.memory[FAILURES] += 1.0
    m.memory[FAILED_AT] = t + h
    most = MOST_NOT_FINITE if code == Code.NOT_FINITE else MOST_FAILURES
    spent = m.memory[FAILURES] > most or h <= floor
    return code >= AT_ONCE or spent


@jitable
def forgive(m):
    """Count fewer failures after a step that ends behind the last of them."""
    if m.memory[FAILURES] > 0.0 and m.memory[TIME] >= m.memory[FAILED_AT]:
        m.memory[FAILURES] = max(0.0, m.memory[FAILURES] - FORGIVEN)


@jitable
def look_up(m, t):
    """Go to the row of the timetable in which t is; return whether there is one.

    A row from which no step may go is a switch: a force jumps within it.
    """
    row, table = m.counts[ROW], m.timetable
    while row < len(table) and table[row, 0] <= t:
        row += 1
    m.counts[ROW] = row
    if row == len(table):
        return False
    m.memory[ROW_ENDS], m.memory[HORIZON] = table[row, 0], table[row, 1]
    return True


@jitable
def arrive_at(m, t, h, bounded, t_end):
    """Note the time at which a step from t ends; one that was bounded ends there exactly."""
    if bounded:
        m.memory[TIME] = m.memory[HORIZON]
    # a switch at the end is not gone behind
    if t + h >= t_end or t_end - m.memory[TIME] <= smallest_step(t_end, m.memory[OWN_TIME], 0.0):
        m.memory[TIME] = t_end


@jitable
def output_within(m, times, t):
    """Return whether an output is due up to time t."""
    return m.counts[NEXT_OUTPUT] < len(times) and times[m.counts[NEXT_OUTPUT]] <= t


@jitable
def looks_within(m, times, t):
    """Return at how many points a step to time t is looked into for events."""
    looks, row = LOOKS, m.counts[NEXT_OUTPUT]
    while looks < MOST_LOOKS and row < len(times) and times[row] < t:
        looks += 1
        row += 1
    return looks


@jitable
def happens_at(p, m, t, h, s):
    """Return whether an event has happened by the part s of the step, its end being m.trial."""
    if s == 1.0:
        return answer_of(m, call_int(p.happens, (p.context, t + h, 0.0, m.trial, m.error))) == 1
    interpolate(m, s, m.error)
    return answer_of(m, call_int(p.happens, (p.context, t + s * h, 0.0, m.error, m.error))) == 1


@jitable
def first_event(p, m, t, h, times):
    """Return the length of the fitted step up to just behind its first event, 2 h for none.

    Bisection on whether it has happened, to the last digit of the time. The problem is left
    evaluated at another point.
    """
    looks, low, high = looks_within(m, times, t + h), 0.0, 2.0
    for k in range(1, looks + 1):
        s = k / looks if k < looks else 1.0
        if happens_at(p, m, t, h, s):
            high = s
            break
        low = s
    if high > 1.0:
        return 2.0 * h
    for _ in range(100):
        middle = 0.5 * (low + high)
        if t + middle * h <= t + low * h or t + middle * h >= t + high * h:
            break
        if happens_at(p, m, t, h, middle):
            high = middle
        else:
            low = middle
    return high * h


@jitable
def side_at(p, m, t, h, s, what):
    """Return whether a force is on another branch at the part s of the fitted step.

    Sides are those just behind the step's begin: before that only what is found exactly counts.
    """
    interpolate(m, s, m.error)
    differs = ask_switching(p, m, t + s * h, what, m.error, m.error)
    return differs > (0 if s >= NEAR_SWITCH else 1)


@jitable
def first_switch(p, m, t, h, whole, behind):
    """Return the length of the fitted step up to its first switch that matters, h for none.

    `whole` is its length before it was cut, or more where that is little; `behind` is a part of it
    at which a side differs. The problem is left evaluated at the trial point.
    """
    farther = FARTHER ** max(0.0, m.memory[VAIN] - 1.0)
    low, high, near = NEAR_SWITCH, behind, NEAR_SWITCH * farther
    if near >= behind:
        return h
    side_at(p, m, t, h, low, SETTLE)
    if behind < 1.0:
        interpolate(m, behind, m.error)
        differs = ask_switching(p, m, t + behind * h, ASK, m.error, m.error)
    else:
        differs = ask_switching(p, m, t + h, ASK, m.trial, m.error)
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
def outputs(p, m, steps, times):
    """Write a row for every output time within the last step; return 0, FULL, or less a code."""
    t, h = m.memory[LAST_TIME], m.memory[LAST_STEP]
    t_new = m.memory[TIME]
    # forces that depend on a fixed step are shown as they acted
    within = h if steps.order == 0.0 else 0.0
    while m.counts[NEXT_OUTPUT] < len(times):
        when = times[m.counts[NEXT_OUTPUT]]
        # a row at the time of an event holds what is after it
        if when > t_new or (when == t_new and m.memory[EVENT_DUE] == 1.0):
            return 0
        interpolate(m, min(1.0, (when - t) / h), m.trial)
        project(p, m, when, 0.0, m.trial)
        m.counts[OUTPUTS] += 1
        m.counts[NEXT_OUTPUT] += 1
        full = call_int(p.output, (p.context, when, within, m.trial, m.error))
        code = failure_or(m, 0)
        if code != 0 or full != 0:
            return -code if code != 0 else full
    return 0


@jitable
def load_at(p, m, t, h, s):
    """Return the load of what holds at the part s of the fitted step."""
    interpolate(m, s, m.error)
    return load_of(p, m, t + s * h, m.error)


@jitable
def horizon_of(p, m, t, h, begin):
    """Return the part of the fitted step over which the load of what holds is known, 1 for all.

    What holds does not move, so that the method's error says nothing of its load: that is to go
    straight from `begin` to the trial point but for BENT sqrt(tol) of the limit, so that it cannot
    pass the limit and come back unseen. What passes it there is cut off. The problem is left
    evaluated at the trial point.
    """
    end = load_of(p, m, t + h, m.trial)
    bent, passed = 0.0, 1.0
    for k in range(3, 0, -1):
        s = 0.25 * k
        load = load_at(p, m, t, h, s)
        bent = max(bent, abs(load - (1.0 - s) * begin - s * end))
        if load > 1.0:
            passed = s
    load_of(p, m, t + h, m.trial)
    allowed = BENT * math.sqrt(m.memory[TOL])
    if passed < 1.0 or bent <= allowed:
        return passed
    return max(0.1, 0.9 * math.sqrt(allowed / bent))


@jitable
def way_error(p, m, t, h):
    """Return the error, over tol, of friction that follows the way of the fitted step in one.

    Its closed form takes the way for a cubic, whatever the method makes of it, and no difference of
    stages tells how far that is off: two halves of the step do. What they make of it is kept.
    """
    interpolate(m, 0.5, m.error)
    ask_switching(p, m, t + 0.5 * h, HALF, m.error, m.error)
    ask_switching(p, m, t + h, HALVES, m.trial, m.error)
    return m.error[0] / m.memory[TOL]


@jitable
def hidden_side(p, m, t, h):
    """Return a part of the fitted step at which a side differs that does not at its end, else 0.

    The problem is left evaluated at the trial point.
    """
    part = 0.0
    for k in range(1, LOOKS_FOR_HIDDEN):
        if part == 0.0 and side_at(p, m, t, h, k / LOOKS_FOR_HIDDEN, ASK):
            part = k / LOOKS_FOR_HIDDEN
    ask_switching(p, m, t + h, ASK, m.trial, m.error)
    return part


@jitable
def attempt(p, m, steps, t, h, times):
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
        part = call_float(p.check, (p.context, t + h, h, m.trial, m.k[steps.last]))
        if part < 1.0:
            return 0, part, -1.0, 0.0, 1.0
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
def attempt_to_event(p, m, steps, t, h, times, floor):
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


@jitable
def look_inside(p, m, asked):
    """Let the problem look at inner points of the last step; return 0 or its code."""
    t, h = m.memory[LAST_TIME], m.memory[LAST_STEP]
    # the force of a damped contact peaks before its depth does
    for part in (asked, 0.8 * asked, 0.5 * asked):
        interpolate(m, part, m.trial)
        project(p, m, t + part * h, 0.0, m.trial)
        m.counts[OUTPUTS] += 1
        code = call_int(p.look, (p.context, t + part * h, part * h, m.trial, m.error))
        if code != 0:
            return code
    return 0


@jitable
def accept(p, m, steps, t, h, asked):
    """Take the trial point; return the problem's word on it (`Taken`), or less a code."""
    word = call_int(p.commit, (p.context, t + h, h, m.trial, m.k[steps.last]))
    if p.switching != 0:
        changed = ask_switching(p, m, t + h, PASS, m.trial, m.error) > 0
        in_vain = m.memory[SWITCH_CUT] == 1.0 and not changed
        m.memory[VAIN] = m.memory[VAIN] + 1.0 if in_vain else 0.0
    for i in range(len(m.y)):
        m.y[i] = m.trial[i]
        m.k[0, i] = m.k[steps.last, i]
    if steps.implicit:
        left = m.memory[REST] * m.memory[CORRECTION]
        if left > m.memory[LEFT_OVER]:
            m.memory[LEFT_OVER], m.memory[LEFT_TIME] = left, t + h
        for j in range(len(m.kept)):
            for i in range(len(m.y)):
                m.kept[j, i] = m.ahead[j, i]
    m.memory[FRESH] = 0.0
    if word > 0 and word & Taken.BEGIN_ANEW:
        m.memory[FRESH] = 1.0
        m.memory[HAVE_JACOBIAN] = 0.0
    if word > 0 and word & Taken.STABLE_IS_STALE:
        m.memory[STALE] = 1.0
    m.memory[LAST_TIME], m.memory[LAST_STEP] = t, h
    m.memory[TIME] = t + h
    m.memory[H_SMALLEST] = min(m.memory[H_SMALLEST], h)
    m.memory[H_LARGEST] = max(m.memory[H_LARGEST], h)
    m.counts[STEPS] += 1
    if asked >= 0.0:
        code = look_inside(p, m, asked)
        if code != 0:
            note_failure(m, code)
    code = failure_or(m, 0)
    return -code if code != 0 else word


@jitable
def choose_next(m, steps, h, h_max):
    """Note the length of the step after one of length h that was good enough."""
    if steps.order == 0.0:
        m.memory[STEP] = h
        return
    error = m.memory[LAST_ERROR]
    if steps.implicit:
        # nothing is extrapolated from a step that was cut, for an event or a contact
        cut = h < 0.5 * m.memory[STEP]
        ratio = 0.0 if cut or m.memory[FRESH] == 1.0 else h / m.memory[LAST_STEP]
        factor = extrapolated_factor(error, m.memory[ERROR_BEFORE], steps.order, ratio)
        if m.memory[GROWTH] < factor:
            factor = m.memory[GROWTH] if m.memory[GROWTH] > HOLD else 1.0
    else:
        factor = next_factor(error, m.memory[ERROR_BEFORE], steps.order, steps.memory, False)
    m.memory[STEP] = h * (min(factor, 1.0) if m.memory[AFTER_REJECTION] == 1.0 else factor)
    m.memory[ERROR_BEFORE] = max(error, 1e-4)
    m.memory[AFTER_REJECTION] = 0.0


def advance(steps, t_end, tol, h_max, h_min, times, budget):  # noqa: C901
    """Advance to t_end, to full rows, or for about `budget` evaluations; return why it stopped.

    `times` are the output times, ascending; `m.counts[NEXT_OUTPUT]` is the next of them. Problem
    and method are taken from the workspace: a group is one word wherever it is handed on.

    `m.timetable` bounds steps by time alone: in the row of t none goes beyond its reach. It bounds
    nothing while memory[ROW_ENDS] and memory[REACH] are infinite.

    When it stops, and how often, changes nothing of the run: all that follows from a step is
    decided behind it, and kept where the caller has to be told of something else first.

    Long and of many branches because it is the loop: each is one thing that may happen to a step.
    """
    p, m = in_workspace(steps.context)
    m.memory[TOL] = tol
    # rows of the last step that found the table full
    if m.memory[LAST_STEP] > 0.0:
        full = outputs(p, m, steps, times)
        if full != 0:
            m.counts[CODE] = max(-full, 0)
            return ROWS_FULL if full > 0 else FAILED
        if m.memory[EVENT_DUE] == 1.0:
            m.memory[EVENT_DUE] = 0.0
            return HAPPENED
    if m.memory[CHANGE_DUE] == 1.0:
        m.memory[CHANGE_DUE] = 0.0
        return CHANGES_OVER
    stop_at = m.counts[EVALUATIONS] + budget
    while m.memory[TIME] < t_end:
        if m.counts[EVALUATIONS] >= stop_at:
            return PAUSED
        if m.counts[STEPS] >= m.counts[NEXT_WATCH]:
            m.counts[NEXT_WATCH] = m.counts[STEPS] + WATCH_EVERY
            return WATCH_DUE
        if m.memory[TIME] >= m.memory[ROW_ENDS]:
            if not look_up(m, m.memory[TIME]):
                return TABLE_OVER
            if m.memory[HORIZON] < m.memory[TIME]:
                # behind the switch all is known anew
                m.memory[TIME] = min(m.memory[ROW_ENDS], t_end)
                m.memory[HAVE_F] = 0.0
                continue
        t = m.memory[TIME]
        if m.memory[HAVE_F] == 0.0 or m.memory[STEP] == 0.0:
            code = begin(p, m, steps, t, t_end, h_max)
            if code != 0:
                m.counts[CODE] = code
                return FAILED
        floor = smallest_step(t, m.memory[OWN_TIME], h_min)
        if steps.order == 0.0 and t >= m.memory[FAILED_AT] and bound_is_due(m):
            m.memory[STEP] = stable(p, m, t, h_max)
            m.memory[STALE] = 0.0
        whole = length(p, m, steps, t, t_end, h_max, floor)
        most = min(whole, max(m.memory[HORIZON] - t, floor))

        # try
        code, part, asked, h, uncut = attempt_to_event(p, m, steps, t, most, times, floor)
        error = m.memory[LAST_ERROR]
        if code != 0:
            ends = gives_up(m, code, t, h, floor)
            if ends and code != Code.NOT_FINITE:
                m.counts[CODE] = code
                return FAILED
            unsolved = code == Code.NOT_CONVERGED
            shrink, reason = (m.memory[RETRY], BY_NEWTON) if unsolved else (0.1, BY_NOT_FINITE)
            reject(p, m, t, max(shrink * h, floor), reason, 0.0)
            m.memory[AFTER_REJECTION] = 1.0
            if ends or h <= floor:
                return STEP_TOO_SMALL
            continue
        if not error <= 1.0:
            shrink = 0.2
            if math.isfinite(error):
                shrink = next_factor(error, 1.0, steps.order, steps.memory, True)
            reject(p, m, t, max(shrink * h, floor), BY_ERROR, 0.0)
            m.memory[AFTER_REJECTION] = 1.0
            if h <= floor:
                return STEP_TOO_SMALL
            continue
        if part < 1.0:
            # one that was cut at a switch is as long again behind it: what is behind switches is
            # told from what lies before them by steps of some length, shorter ones are all rounding
            cut_from = max(whole, m.memory[CUT_FROM]) if h < most else m.memory[CUT_FROM]
            reject(p, m, t, max(part * h, floor), BY_CHECK, cut_from)
            if h <= floor:
                return STEP_TOO_SMALL
            continue

        # take
        may_grow = m.memory[WAS_CUT] == 1.0 and m.memory[AFTER_REJECTION] == 0.0
        choose_next(m, steps, h, h_max)
        if h < whole:
            m.memory[STEP] = max(m.memory[STEP], whole)
        if h < most and may_grow and steps.order > 0.0:
            # it was good enough, and ended for an event; where those follow each other, as when
            # stick and slip take turns, whole steps outgrow what they alternate in, as far as the
            # error that they have themselves lets them
            factor = next_factor(uncut, 1.0, steps.order, steps.memory, False)
            m.memory[STEP] = max(m.memory[STEP], min(CUT_GROW, factor) * most)
        m.memory[STEP] = max(m.memory[STEP], m.memory[CUT_FROM])
        m.memory[CUT_FROM] = 0.0
        m.memory[WAS_CUT] = 1.0 if h < whole else 0.0
        word = accept(p, m, steps, t, h, asked)
        arrive_at(m, t, h, h < whole and h == m.memory[HORIZON] - t, t_end)
        forgive(m)
        if word < 0:
            m.counts[CODE] = -word
            return FAILED
        if p.arrive != 0:
            arrived = call_int(p.arrive, (p.context, m.memory[TIME], 0.0, m.y, m.error))
            m.memory[EVENT_DUE] = float(arrived)
            if arrived < 0:
                m.counts[CODE] = -arrived
                return FAILED
        full = outputs(p, m, steps, times)
        if full < 0:
            m.counts[CODE] = -full
            return FAILED
        if word & Taken.Y_CHANGED:
            m.counts[EVALUATIONS] += 1
            code = call_int(p.rhs, (p.context, t + h, 0.0, m.y, m.k[0]))
            if code != 0:
                m.counts[CODE] = code
                return FAILED
        if m.memory[WATCH] == 1.0 and changes_over(p, m, steps, most, t_end):
            m.memory[CHANGE_DUE] = 1.0
        if full > 0 or word & Taken.ROWS_FULL:
            return ROWS_FULL
        if m.memory[EVENT_DUE] == 1.0:
            m.memory[EVENT_DUE] = 0.0
            return HAPPENED
        if m.memory[CHANGE_DUE] == 1.0:
            m.memory[CHANGE_DUE] = 0.0
            return CHANGES_OVER
    return DONE
