"""Newton's iteration as the implicit methods share it: linearisation, factors, when to stop.

After E. Hairer, G. Wanner, Solving ODEs II (1996), section IV.8.
"""

from __future__ import annotations

import math

from mbsim.core.address import call_float, call_int
from mbsim.core.arrays import F1
from mbsim.core.codes import AT_ONCE, Code
from mbsim.core.jitable import jitable
from mbsim.core.problem import Problem
from mbsim.integrators.scheme import (
    AT_ROUNDING,
    CORRECTION,
    CORRECTION_BEFORE,
    EASE,
    EVALUATIONS,
    FACTORED_STEP,
    FRESH,
    GROWTH,
    HAVE_JACOBIAN,
    JACOBIAN_TIME,
    JACOBIANS,
    JUDGED,
    LEFT,
    LEFT_PART,
    OWN_TIME,
    REJECTED,
    REST,
    RETRY,
    TOL,
    WATCH,
    Method,
    note_failure,
)

#: A step that took more linearisations was hard to solve for: the next is no longer, and those
#: behind it may grow by so much more from one to the next. Where the error lets steps grow by far
#: more than is left of the touch or the friction they end in, each was followed by one in vain.
EASY, EASIER = 1, 1.25
# what `judge` says
GO_ON, SOLVED, HOPELESS = range(3)
#: A step's velocities may be off by this part of its error for what f at its end is not.
OFF = 0.2
#: No correction need be smaller than this.
ROUNDING = 1e-14
#: What positions are rounded by moves velocities by so much where what is stiff presses. Where tol
#: asks for less a correction that gets no smaller may be as large, up to `OFF` of what may be left.
STIFF_ROUNDING = 3e-10
#: Friction may be left off by this part of what presses, where only rounding is left of the motion.
FELT = 1e-6
#: Hope for the first correction ends here: what was linear a step ago may press on something now.
LEAST_REST = 0.05
#: The step after one whose equations were not solved, where nothing is known of what would be.
HALF, QUARTER = 0.5, 0.25
#: Every so many rejections of steps below this part of the problem's own time it is asked whether f
#: is a function at all.
SMALL, REJECTIONS = 1e-4, 16


@jitable
def judged_by(m: Method) -> float:
    """Return the tol by which what a step leaves of its equations is judged."""
    return min(m.memory[TOL], m.memory[JUDGED])


@jitable
def target(m: Method) -> float:
    """Return how large what is left may be, in the norm of the error."""
    tol = judged_by(m)
    return max(ROUNDING, tol * min(m.memory[LEFT_PART], math.sqrt(tol)))


@jitable
def linearise(p: Problem, m: Method, t: float, h: float, y: F1, f: F1) -> int:
    """Linearise f at (t, y), h after the committed point, and write f; return a code."""
    m.counts[EVALUATIONS] += 1
    m.counts[JACOBIANS] += 1
    m.memory[FACTORED_STEP] = 0.0
    code = call_int(p.rhs, (p.context, t, h, y, f))
    if code == 0:
        code = call_int(p.linearise, (p.context, t, h, y, f))
    m.memory[HAVE_JACOBIAN] = 1.0 if code == 0 else 0.0
    m.memory[JACOBIAN_TIME] = t
    return code


@jitable
def note(m: Method, size: float) -> None:
    """Note the size of a correction, for what is said of an iteration that does not end."""
    m.memory[CORRECTION_BEFORE] = m.memory[CORRECTION]
    m.memory[CORRECTION] = size


@jitable
def begin(m: Method) -> None:
    """Be as hopeful about the first correction as the step before allows."""
    m.memory[RETRY] = HALF
    m.memory[CORRECTION] = m.memory[AT_ROUNDING] = 0.0
    note(m, 0.0)
    hope = max(m.memory[REST], LEAST_REST**1.25) ** 0.8
    m.memory[REST] = 1.0 if m.memory[FRESH] == 1.0 else hope


@jitable
def judge(
    m: Method,
    iteration: int,
    most: int,
    size: float,
    before: float,
    rate_before: float,
    late: float,
) -> tuple[int, float]:
    """Return the word on correction number `iteration` (from 1) of `size`, and its rate.

    Of a rate r = size / before what is left after this correction is r / (1 - r) of it. A method
    that would not be done after `most` corrections ends at once, and says in RETRY what part of
    the step would have been. One that does not get smaller any more, and is small enough for the
    step's error, is rounding. Only the second correction may be larger than the first, by less than
    `late`.
    """
    goal = target(m)
    note(m, size)
    if not size < math.inf:
        m.memory[RETRY] = QUARTER
        return HOPELESS, 1.0
    rate = rate_before
    if iteration > 1:
        quotient = size / before
        # the geometric mean of two: one alone may be good or bad by chance
        rate = quotient if rate_before == 0.0 else math.sqrt(quotient * rate_before)
        if size > goal:
            if not rate < 0.99:
                if size <= LEFT * judged_by(m):
                    return SOLVED, rate_before
                if iteration > 2 or not rate < late:
                    m.memory[RETRY] = HALF if rate < 2.0 else QUARTER
                    return HOPELESS, rate
                return GO_ON, rate
            # what projections undo of the first correction comes back in the second, not again
            left = rate / (1.0 - rate) * size * rate ** (most - 1 - iteration)
            if 2 < iteration < most and left >= goal:
                m.memory[RETRY] = HALF
                return HOPELESS, rate
        m.memory[REST] = rate / (1.0 - rate) if rate < 0.99 else 1.0
    if m.memory[REST] * size <= goal or size == 0.0:
        return SOLVED, rate
    return (GO_ON if iteration < most else HOPELESS), rate


@jitable
def stiff_rounding(m: Method) -> float:
    """Return `STIFF_ROUNDING` where the tolerance asks for smaller corrections, else 0."""
    return STIFF_ROUNDING if LEFT * judged_by(m) < STIFF_ROUNDING else 0.0


@jitable
def is_rounding(p: Problem, m: Method, t: float, h: float, size: float, e: F1) -> bool:
    """Return whether a correction e of `size`, no better than the one before, is rounding.

    It is if it is a small part of the step's error. Friction that turns over within 1e-3 of the
    usual speed changes by 1e3 times what velocities are rounded by, and joints near a singular
    position round these worse: of friction counts what it can do, not what tol is.
    """
    most = max(LEFT * judged_by(m), min(OFF * judged_by(m), stiff_rounding(m)))
    some = size <= most
    some = some or (size <= FELT and call_float(p.norm, (p.context, t, h, e, m.y)) <= most)
    m.memory[AT_ROUNDING] = 1.0 if some else 0.0
    return some


@jitable
def nears_rounding(m: Method, size: float, before: float) -> bool:
    """Return whether a correction that gets smaller yet is nearly what rounding makes."""
    return size < stiff_rounding(m) and size < HALF * before


@jitable
def is_at_rounding(m: Method) -> bool:
    """Return whether the last iteration ended at rounding: a new linearisation mends nothing."""
    return m.memory[AT_ROUNDING] == 1.0 and m.memory[CORRECTION] <= stiff_rounding(m)


@jitable
def with_ease(m: Method, linearised: int, code: int) -> int:
    """Let steps grow as it is easy to solve for them: not behind one that was hard, then more.

    The last one began after so many linearisations, and ended with the code, which is returned.
    One that ended at rounding was not hard: a longer one ends there too, with no more of them.
    """
    few = m.counts[JACOBIANS] - linearised <= EASY
    easy = code == 0 and (few or m.memory[AT_ROUNDING] == 1.0)
    m.memory[EASE] = max(1.0, m.memory[EASE]) * EASIER if easy else 1.0
    m.memory[GROWTH] = min(m.memory[GROWTH], m.memory[EASE])
    return code


@jitable
def stalls(m: Method, size: float) -> bool:
    """Return whether a correction is no smaller than half the one before.

    Of a linearisation of the step itself no better one or shorter step makes it smaller then.
    """
    return not size < HALF * m.memory[CORRECTION_BEFORE]


@jitable
def is_good_enough(p: Problem, m: Method, t: float, h: float, size: float, rate: float) -> bool:
    """Return whether what a correction of `size`, in m.error, leaves is small enough for the step.

    What is left is looked at besides (`OFF`). Rounding, which is above what is asked for, says
    nothing of how far the step may grow.
    """
    if stalls(m, size) and is_rounding(p, m, t, h, size, m.error):
        m.memory[GROWTH] = math.inf
        return True
    return rate < 0.99 and size * max(1.0, rate / (1.0 - rate)) <= LEFT * judged_by(m)


@jitable
def may_help(code: int) -> bool:
    """Return whether a better linearisation or a smaller correction may help against a code."""
    return code < AT_ONCE


@jitable
def unless_singular(code: int) -> int:
    """Return the code of `factor`, -1 for a singular system: another step has another."""
    return -1 if code == Code.SINGULAR else code


@jitable
def as_failure(code: int) -> int:
    """Return the code of a step whose equations were not solved for the reason `code`."""
    return code if code > 0 else Code.NOT_CONVERGED


@jitable
def repeats(p: Problem, m: Method, t: float) -> bool:
    """Return whether f at the committed point is the same, to tol, when it is asked for twice.

    A user's function that is none of its arguments leaves no equation to solve.
    """
    m.counts[EVALUATIONS] += 2
    for out in (m.trial, m.error):
        if call_int(p.rhs, (p.context, t, 0.0, m.y, out)) != 0:
            return True
    for i in range(len(m.y)):
        m.error[i] = m.memory[OWN_TIME] * (m.trial[i] - m.error[i])
    return not call_float(p.norm, (p.context, t, 0.0, m.error, m.y)) > m.memory[TOL]


@jitable
def check_repeats(p: Problem, m: Method, t: float, h: float) -> None:
    """Fail where steps of an implicit method fall because f is no function, h being the next one.

    AUTO is spared: it goes on with its explicit method.
    """
    small = m.memory[FACTORED_STEP] > 0.0 and h < SMALL * m.memory[OWN_TIME]
    if small and m.memory[WATCH] == 0.0 and m.counts[REJECTED] % REJECTIONS == 0:
        if not repeats(p, m, t):
            note_failure(m, Code.NOT_REPEATED)
