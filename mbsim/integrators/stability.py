"""The rates that stages of an explicit method show, and how its steps keep to their stability.

The error lets steps beyond the bound of stability pass as long as what they amplify is within the
tolerance. What is amplified is then rejected, or shaken: friction that turns sign from step to
step, what rests that trembles. Steps within the bound are mostly fewer in all. Their error is far
below any tolerance but where something trembles. A loose one lets that go on for good, and what
trembles leaves and touches, in steps that are shorter than the bound: within it the error may be no
more than a tolerance of CALM allows, and a looser one takes as many steps.

Not where friction shakes within a loose tolerance and the motion hardly sees it: there steps that
are many times as long go on. Which of the two goes farther for its evaluations is found by trying:
a window of the other kind, now and then.
"""

from __future__ import annotations

import math

from mbsim.core.address import call_float
from mbsim.core.arrays import F2
from mbsim.core.jitable import jitable
from mbsim.core.problem import EACH, POSITION, RATES, Problem
from mbsim.integrators.scheme import (
    AT_BOUND,
    EVALUATIONS,
    FREE,
    LAST_ERROR,
    LONGER,
    LONGEST,
    OWN_TIME,
    PACE_FREE,
    PACE_WITHIN,
    STEP,
    STIFFNESS,
    TIME,
    TOL,
    WAIT,
    WINDOW_STEPS,
    WINDOW_STIFF,
    WINDOW_TIME,
    WINDOW_WORK,
    WINDOWS,
    Method,
)

#: Of DOPRI5's k: the first row behind the stages, which hold differences between them.
DIFFERENCES = 7
#: From here on a step is at the stability bound; as long as this it stays within.
BOUND, WITHIN = 1.6, 1.8
#: A step below this error, over the allowed one, moves nothing that the rate could be of.
NOTHING = 1e-10
#: Evaluations over which it is found how far steps go, what part of these is at the bound where it
#: is that which bounds them, and windows until the other kind is tried: from steps beyond the bound
#: soon, for motions that stick and slip in turn look like others for a while. What steps beyond it
#: shake, in vain, takes some windows to come to rest: each time it is tried half as often; where it
#: paid, at once. But after MOST windows, of which one in vain is less than half a percent: models
#: change, and what was in vain may pay now.
WINDOW, STIFF_PART, SOON, FIRST, MOST = 250, 0.1, 12.0, 16.0, 256.0
#: Steps within the bound are taken though they go by so much less far: they shake nothing.
CALMER = 0.5

#: The most of tol for steps within the bound, and for how many of them one at the bound says so:
#: what trembles shows its rate now and then.
CALM, REMEMBERED = 1e-3, 40.0

#: Where the bound is so many times as long as it was, what set it has let go, as an impact does.
GONE = 20.0

#: From so many times the change of f over a step, between its last two stages, a rate is hidden,
#: if the estimate is below what shows it and the error, over the allowed one, bounds the step.
HIDES, SHOWN, BOUNDS = 4.0, 1.5, 0.01


@jitable
def rate_of(moved: float, faster: float, pulled: float) -> float:
    """Return the rate r with r^2 |dx| + r |dv| = |da| between two states, 0 where da is 0.

    Of a = -w^2 x - c v it is at most w or c, whichever is larger, whatever the units are: where dx
    or dv alone was compared with da it would be anything between nothing and w^2.
    """
    if not pulled > 0.0:
        return 0.0
    return 2.0 * pulled / (faster + math.sqrt(faster * faster + 4.0 * moved * pulled))


@jitable
def clear_differences(m: Method, d: F2) -> None:
    """Set all of `d` to 0: what is no difference between stages counts nothing."""
    for j in range(RATES):
        for i in range(len(m.y)):
            d[j, i] = 0.0


@jitable
def note_difference(m: Method, d: F2, i: int, shift: float, come: float, last: int) -> None:
    """Write into `d` what `rate_between` compares of y[i]; k[last] is f at the trial point.

    `shift` is from the stage before to the trial point, `come` from the one before that stage.
    """
    k = m.k
    # f of a position is its velocity: that says nothing
    is_rate = m.kinds[i] != POSITION
    j = 1 if is_rate else 0
    d[j, i], d[3 + j, i] = shift, come
    if is_rate:
        d[2, i], d[5, i] = k[last, i] - k[last - 1, i], k[last - 1, i] - k[last - 2, i]
        d[6, i] = k[last, i] - k[0, i]


@jitable
def rate_between(p: Problem, m: Method, t: float, h: float, size: F2) -> float:
    """Return h times the larger rate of two pairs of stages, inf where it is hidden.

    `size` has, in its rows, shifts, changes of velocity and of f of either pair, and the change of
    f over the step.
    """
    # in the norm of the error, which has no units
    call_float(p.norm, (p.context, t, EACH, size[0], m.y))
    rate, own = 0.0, m.memory[OWN_TIME]
    for j in (0, 3):
        rate = max(rate, rate_of(own * size[j, 0], size[j + 1, 0], size[j + 2, 0]))
    hidden = size[2, 0] > HIDES * size[6, 0] and m.memory[LAST_ERROR] > BOUNDS
    return math.inf if hidden and h * rate < SHOWN else h * rate


@jitable
def allowed(m: Method) -> float:
    """Return the error that a step may have: tol, or less where it is to stay within the bound."""
    calm = m.memory[AT_BOUND] > 0.0 and m.memory[FREE] == 0.0
    return min(m.memory[TOL], CALM) if calm else m.memory[TOL]


@jitable
def note_bound(m: Method, h: float, error: float) -> None:
    """Remember a step of length h and this error that was at the bound, and forget earlier ones.

    What has come to rest shows a lower rate than it has. A step three times as long, which DOP853
    amplifies by up to 1e5, would then throw what the last ones have damped: so its steps grow by
    less behind one at the bound. DOPRI5 amplifies by 1e3, and goes farther with steps that are
    beyond the bound now and then.
    """
    if m.memory[STIFFNESS] > BOUND and error > NOTHING:
        m.memory[AT_BOUND] = REMEMBERED
    else:
        m.memory[AT_BOUND] = max(0.0, m.memory[AT_BOUND] - 1.0)
    shown, known = math.inf, math.inf
    if m.memory[STIFFNESS] > 0.0:
        # a step is no more than halved, for a kink looks like a high rate
        shown = max(0.5, WITHIN / m.memory[STIFFNESS]) * h
    if m.memory[AT_BOUND] > 0.0 and shown < GONE * m.memory[LONGEST]:
        known = m.memory[LONGER] * m.memory[LONGEST]
    m.memory[LONGEST] = min(known, shown if error > NOTHING else math.inf)


@jitable
def stay_within(m: Method) -> None:
    """Let the next step end within the bound of stability."""
    m.memory[STEP] = min(m.memory[STEP], m.memory[LONGEST])


@jitable
def begin_window(m: Method) -> None:
    """Count from the committed point on."""
    m.memory[WINDOW_STEPS] = m.memory[WINDOW_STIFF] = 0.0
    m.memory[WINDOW_TIME], m.memory[WINDOW_WORK] = m.memory[TIME], m.counts[EVALUATIONS]


@jitable
def judge_window(m: Method) -> None:
    """Note how far the steps of the window went, and choose the kind of the next ones."""
    pace = (m.memory[TIME] - m.memory[WINDOW_TIME]) / (
        m.counts[EVALUATIONS] - m.memory[WINDOW_WORK]
    )
    m.memory[PACE_FREE if m.memory[FREE] == 1.0 else PACE_WITHIN] = pace
    m.memory[WINDOWS] += 1.0
    if m.memory[WINDOW_STIFF] < STIFF_PART * m.memory[WINDOW_STEPS]:
        # the error bounds them: nothing that was found of paces holds any more. How long to wait
        # does: what sticks and slips in turn comes back
        m.memory[PACE_FREE] = m.memory[PACE_WITHIN] = m.memory[FREE] = m.memory[WINDOWS] = 0.0
    elif m.memory[WINDOWS] >= (SOON if m.memory[FREE] == 1.0 else m.memory[WAIT]):
        m.memory[FREE], m.memory[WINDOWS] = 1.0 - m.memory[FREE], 0.0
    else:
        within = m.memory[PACE_WITHIN] >= CALMER * m.memory[PACE_FREE]
        if m.memory[FREE] == 1.0:
            m.memory[WAIT] = min(MOST, max(FIRST, 2.0 * m.memory[WAIT])) if within else 1.0
        m.memory[FREE] = 0.0 if within else 1.0


@jitable
def keep_to_bound(m: Method, error: float) -> None:
    """Let the step after one of this error keep to the bound, where that pays."""
    if m.memory[WINDOW_WORK] == 0.0:
        begin_window(m)
        m.memory[WAIT] = FIRST
    m.memory[WINDOW_STEPS] += 1.0
    if m.memory[STIFFNESS] > BOUND and error > NOTHING:
        m.memory[WINDOW_STIFF] += 1.0
    if m.memory[FREE] == 0.0:
        stay_within(m)
    if m.counts[EVALUATIONS] - m.memory[WINDOW_WORK] >= WINDOW:
        judge_window(m)
        begin_window(m)
