"""The driver of the one-step methods: steps, control, guards, outputs, returns to Python.

A method (`scheme.py`) tries a step; the driver decides about it, the problem's hooks have their
say, and a step is taken. After E. Hairer, S. P. Norsett, G. Wanner, Solving ODEs I (1993), II.4.
"""

from __future__ import annotations

import math

from mbsim.core.address import call_float, call_int
from mbsim.core.arrays import F1
from mbsim.core.codes import AT_ONCE, Code
from mbsim.core.jitable import jitable
from mbsim.core.problem import (
    BY_CHECK,
    BY_ERROR,
    BY_JUMP,
    BY_NEWTON,
    BY_NOT_FINITE,
    CHANGES_OVER,
    DONE,
    FAILED,
    GOES,
    HAPPENED,
    PAUSED,
    ROWS_FULL,
    STABLE_EVERY,
    STEP_TOO_SMALL,
    TABLE_OVER,
    TIMETABLE_ENDS,
    TIMETABLE_HORIZON,
    WATCH_DUE,
    WATCH_EVERY,
    WHOLE,
    Problem,
    Taken,
)
from mbsim.integrators.attempt import LOCATED, attempt_to_event
from mbsim.integrators.branches import BEGIN, TAKEN
from mbsim.integrators.changing import begins_stiff, bound_next, changes_over
from mbsim.integrators.control import (
    HOLD,
    extrapolated_factor,
    next_factor,
    quantised,
    smallest_step,
    starting_step,
)
from mbsim.integrators.newton import check_repeats
from mbsim.integrators.positions import jumps
from mbsim.integrators.rows import look_inside, outputs
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
    NEXT_WATCH,
    OWN_TIME,
    REJECTED,
    REST,
    RETRY,
    ROW,
    ROW_ENDS,
    RUN_END,
    STALE,
    STEP,
    STEPS,
    TIME,
    TOL,
    WAS_CUT,
    WATCH,
    Method,
    Steps,
    failure_or,
    in_workspace,
    note_failure,
    part_of,
    parts,
)

#: Implicit steps that end at a touch may be the shorter the looser the tolerance is, down to
#: LOCATED from here on: what positions are rounded by makes an error of their velocities that grows
#: as steps get shorter, and one above the tolerance is above it in any shorter step too.
SHARP = 1e-7
#: Where steps are cut one after another, whole ones grow so much at most.
CUT_GROW = 2.0
#: A hook that fails is tried again at a tenth of the step, so many times; one whose numbers are
#: not finite may be so for a trial far out of reach.
MOST_FAILURES, MOST_NOT_FINITE = 5, 20
#: What a step fails by that is too long for it, and a shorter one does not.
REACHES = (Code.TOO_FAR, Code.MANY_POINTS)
#: A step that ends behind the last failure takes so much from the count of failures. Until then
#: nothing shows that the hook gives numbers there: before it a step may be too short to ask.
FORGIVEN = 0.1


@jitable
def first_step(p: Problem, m: Method, t: float, span: float, order: float) -> float:
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
def stable(p: Problem, m: Method, t: float, h_max: float) -> float:
    """Return the step of a method without error estimate."""
    if p.stable == 0:
        return h_max
    return quantised(min(h_max, call_float(p.stable, (p.context, t, m.memory[TOL], m.y, m.k[0]))))


@jitable
def bound_is_due(m: Method) -> bool:
    """Return whether the stability bound is to be found anew."""
    return m.counts[STEPS] % STABLE_EVERY == 0 or m.memory[STALE] == 1.0


@jitable
def begin(p: Problem, m: Method, steps: Steps, t: float, t_end: float, h_max: float) -> int:
    """Evaluate f at the committed point and choose a first step where there is none."""
    if m.memory[HAVE_F] == 0.0:
        m.counts[EVALUATIONS] += 1
        code = call_int(p.rhs, (p.context, t, 0.0, m.y, m.k[0]))
        if code != 0:
            return code
        m.memory[HAVE_F] = 1.0
        if steps.branches != 0:
            call_float(steps.branches, (steps.context, BEGIN, t, 0.0, 0.0))
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
def length(
    p: Problem, m: Method, steps: Steps, t: float, t_end: float, h_max: float, floor: float
) -> tuple[float, float]:
    """Return the length of the step to try from t, and that of those behind it as far as known."""
    h = min(m.memory[STEP], h_max)
    behind = 0.0
    if steps.order > 0.0:
        limit = call_float(p.limit, (p.context, t, h, m.y, m.k[0]))
        h = quantised(h)
        if limit < 0.0:
            limit, behind = -limit, h
        if steps.implicit:
            # in a shorter one velocities are rounding errors of positions over h
            own = m.memory[OWN_TIME] * max(1.0, SHARP / m.memory[TOL])
            limit = max(limit, LOCATED * max(own, abs(t)))
        h = min(h, limit)
    h = max(h, floor)
    # no sliver of a step before the end
    return (t_end - t if t + 1.01 * h >= t_end else h), behind


@jitable
def reject(p: Problem, m: Method, t: float, h: float, reason: int, cut_from: float) -> None:
    """Count a rejected step, tell the problem, and note the length h to try instead.

    `cut_from` is how long the step was meant to be, where nothing but its end is at fault, else 0.
    """
    m.counts[REJECTED] += 1
    m.counts[LAST_REASON] = reason
    code = call_int(p.reject, (p.context, t, float(reason), m.y, m.error))
    if code != 0:
        note_failure(m, code)
    check_repeats(p, m, t, h)
    m.memory[STEP] = h
    m.memory[CUT_FROM] = cut_from


@jitable
def gives_up(m: Method, code: int, t: float, h: float, floor: float) -> bool:
    """Return whether the failure of a hook in the step from t ends the run.

    Else it is tried again nearer: a trial far ahead may be where no law was meant for. What a
    shorter step is known to mend is not counted.
    """
    if code == Code.NOT_CONVERGED:
        return False
    if code in REACHES:
        return h <= floor
    m.memory[FAILURES] += 1.0
    m.memory[FAILED_AT] = t + h
    most = MOST_NOT_FINITE if code == Code.NOT_FINITE else MOST_FAILURES
    spent = m.memory[FAILURES] > most or h <= floor
    return code >= AT_ONCE or spent


@jitable
def forgive(m: Method) -> None:
    """Count fewer failures after a step that ends behind the last of them."""
    if m.memory[FAILURES] > 0.0 and m.memory[TIME] >= m.memory[FAILED_AT]:
        m.memory[FAILURES] = max(0.0, m.memory[FAILURES] - FORGIVEN)


@jitable
def look_up(m: Method, t: float) -> bool:
    """Go to the row of the timetable in which t is; return whether there is one.

    A row from which no step may go is a switch: a force jumps within it.
    """
    row, table = m.counts[ROW], m.timetable
    while row < len(table) and table[row, TIMETABLE_ENDS] <= t:
        row += 1
    m.counts[ROW] = row
    if row == len(table):
        return False
    m.memory[ROW_ENDS] = table[row, TIMETABLE_ENDS]
    m.memory[HORIZON] = table[row, TIMETABLE_HORIZON]
    return True


@jitable
def arrive_at(m: Method, t: float, h: float, bounded: bool, t_end: float) -> None:
    """Note the time at which a step from t ends; one that was bounded ends there exactly."""
    if bounded:
        m.memory[TIME] = m.memory[HORIZON]
    # a switch at the end is not gone behind
    if t + h >= t_end or t_end - m.memory[TIME] <= smallest_step(t_end, m.memory[OWN_TIME], 0.0):
        m.memory[TIME] = t_end


@jitable
def accept(p: Problem, m: Method, steps: Steps, t: float, h: float, asked: float) -> int:
    """Take the trial point; return the problem's word on it (`Taken`), or less a code."""
    word = call_int(p.commit, (p.context, t + h, h, m.trial, m.k[steps.last]))
    if steps.branches != 0:
        call_float(steps.branches, (steps.context, TAKEN, t, h, 0.0))
    for row in range(parts(m)):
        begins, ends = part_of(m, row)
        for i in range(begins, ends):
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
def choose_next(m: Method, steps: Steps, h: float, h_max: float) -> None:
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


@jitable
def go_on(  # noqa: C901
    steps: Steps, t_end: float, tol: float, h_max: float, h_min: float, times: F1, budget: int
) -> int:
    """Go on as `advance` does.

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
    # which method serves best is a matter of the run, not of how far its caller steps at once
    run_end = max(t_end, m.memory[RUN_END])
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
                if steps.order > 0.0 and jumps(p, m, m.memory[TIME]):
                    m.counts[LAST_REASON] = BY_JUMP
                    return STEP_TOO_SMALL
                continue
        t = m.memory[TIME]
        if m.memory[HAVE_F] == 0.0 or m.memory[STEP] == 0.0:
            code = begin(p, m, steps, t, t_end, h_max)
            if code != 0:
                m.counts[CODE] = code
                return FAILED
            if begins_stiff(m, steps, run_end):
                return CHANGES_OVER
        floor = smallest_step(t, m.memory[OWN_TIME], h_min)
        if steps.order == 0.0 and t >= m.memory[FAILED_AT] and bound_is_due(m):
            m.memory[STEP] = stable(p, m, t, h_max)
            m.memory[STALE] = 0.0
        whole, behind = length(p, m, steps, t, t_end, h_max, floor)
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
        if h < steps.resumes * behind:
            m.memory[STEP] = max(m.memory[STEP], behind)
        m.memory[STEP] = max(m.memory[STEP], m.memory[CUT_FROM])
        m.memory[CUT_FROM] = 0.0
        if not steps.implicit:
            bound_next(m, most, uncut)
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
        if m.memory[WATCH] == 1.0 and changes_over(m, steps, most, run_end):
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


@jitable
def advance(
    steps: Steps, t_end: float, tol: float, h_max: float, h_min: float, times: F1, budget: int
) -> int:
    """Advance to t_end, to full rows, or for about `budget` evaluations; return why it stopped.

    See `go_on`. Of what steps do not change nothing is known when it is called, nor is anything to
    be when it is back: all that is scratch may be filled with NaN in between.
    """
    _, m = in_workspace(steps.context)
    m.whole[GOES] = WHOLE
    why = go_on(steps, t_end, tol, h_max, h_min, times, budget)
    m.whole[GOES] = WHOLE
    return why
