"""When AUTO changes over between its explicit and its implicit method.

The explicit method estimates the largest rate of f from its last stages (`dopri5.stiffness`). Where
the step times that is at the bound of stability, stability and not the error bounds the steps: the
model is stiff. Of a step that is cut at an event the whole one is meant, as it was tried before.
The error lets steps go beyond that bound; where many are at it, they are kept within.

The implicit method tries an explicit step now and then. What its own last steps took, less what
explicit ones would have taken instead, is summed up; where that is as much as it would cost to be
wrong, and two trials agree, the explicit method goes on. `Methods.change_over` learns from what
came of a change. A run that is stiff from its begin begins anew: `Methods.begin_anew`. So does one
that explicit steps have thrown by then. Where the rate at the begin, measured
(`rates.largest_rate`), would bound very many steps, it does so at once. That rate is asked for as
well before the implicit method is left: the stages of a trial on a motion that holds what is fast
tell nothing of that.

How many steps are ahead is judged by the pace of the run so far, and of the last WINDOW steps once
there are so many: an impact after a flight takes little of the run, and is over before there are.
Steps are counted by their evaluations: those that are rejected or shortened count more.
Friction that turns sign from step to step within the tolerance hides its rate. That is mostly seen
all the same (`dopri5.stiffness`), and counts twice: such steps are far beyond the bound, and what
else they shake leaves the state that the implicit method would begin from. What trembles so leaves
and touches, and steps are short behind that: as calm they count by their length. Else a run that
takes as many steps a time as when it was found stiff before, or has very many steps ahead, tries
the implicit method now and then.
Models whose explicit run is short stay explicit, stiff or not, and compile nothing else: of fewer
than WORTH steps, or fewer still where the error of steps at the bound would let them be many times
as long, as of what has come to rest. There RADAU5 takes a tenth of the work.
Source: E. Hairer, G. Wanner, Solving ODEs II (1996), section IV.2.
"""

from __future__ import annotations

import math

from mbsim.core.address import call_float, call_int
from mbsim.core.jitable import jitable
from mbsim.core.problem import Problem
from mbsim.core.signature import FLOAT, INT
from mbsim.integrators.rates import largest_rate
from mbsim.integrators.scheme import (
    BEGUN,
    BEGUN_WORK,
    BOUNDED,
    CALM_STEPS,
    COSTLY,
    EVALUATIONS,
    EXPLICIT_STEPS,
    FIRST_MAX,
    H_LARGEST,
    IMPLICIT_STEPS,
    JACOBIANS,
    KEEPS_TO_BOUND,
    LAST_ERROR,
    LAST_STEP,
    PACE,
    PART,
    PATIENCE,
    RELUCTANCE,
    STEP,
    STEPS,
    STIFF_STEP,
    STIFF_STEPS,
    STIFFNESS,
    TIME,
    WAS_CUT,
    WATCH,
    Method,
    Steps,
    failure_or,
    in_workspace,
)
from mbsim.integrators.stability import BOUND, WITHIN, keep_to_bound, note_bound, stay_within

#: Of `serve`: context, `attempt` of the explicit method, end of the run.
ASKED = INT(INT, INT, FLOAT)
#: A step that is shorter than this part of one that was stiff is for what that has thrown.
THROWS = 0.1
#: Steps found stiff one after the other from which on none goes beyond the bound: a kink is one.
STEADY = 3
#: Steps found stiff before AUTO changes over, and others that make it forget them.
FIRST_PATIENCE, FORGET = 15, 6
#: A run that changes over within so many steps has been stiff from its begin: going back there
#: costs about what the implicit method takes until it runs well from anywhere else. It goes on
#: from where it is if steps at the bound are a smaller part than this of what their error allows.
BEGIN_STEPS, SHAKES = 4 * FIRST_PATIENCE, 0.2
#: And if a step before was so many times as long: it has not been stiff from its begin.
LONGER_BEFORE = 2.0
#: Steps over which their number a time is taken: an impact is shorter.
WINDOW = 200
#: Of the explicit method, where nothing is taken again: what work is counted in.
EVALUATIONS_A_STEP = 6.0
#: A change is worth it for so many steps that are still to be taken; once the implicit method has
#: run, and nothing is to be loaded for it, for fewer.
WORTH, WORTH_AGAIN = 800, 200
#: It is worth it for the first time as well where so many are saved, if steps at the bound go on as
#: they do. How much longer implicit ones are the error of RECENT ones tells.
WORTH_SMOOTH, RECENT = 100, 5.0
#: And where a run that has just begun is thrown by its steps at the bound: it begins anew.
WORTH_THROWN = 300
#: At the begin, where the largest rate is measured: what is lost if it was wrong is small then.
WORTH_AT_ONCE = 4000
#: With so many ahead the implicit method is tried after as many steps as there is patience for.
MANY = 20_000
#: For fewer steps that stability does not bound it was not worth it to leave the implicit method.
SHORT_STAY = 60
#: Implicit steps between trials of an explicit one.
TRY_EVERY = 20
#: An evaluation of the implicit method, with its share of linear algebra, takes as long as so many.
IMPLICIT_WORK = 2.5
#: What the implicit method takes, in evaluations, until it runs well again; what is lost with the
#: explicit steps until then if it was wrong to leave it. A short trial tells so much of others.
IMPLICIT_START = 250.0
#: And for a step of its own.
IMPLICIT_STEP = 25.0
WRONG, SHORT_TELLS = EVALUATIONS_A_STEP * FIRST_PATIENCE + IMPLICIT_START, 0.2
#: Where the error tells that the implicit method takes far less, it is tried again after as many
#: stiff steps as cost what it takes to begin, whatever came of it before: that may have been in an
#: impact, which is over.
MOST_PATIENCE = math.ceil(IMPLICIT_START / EVALUATIONS_A_STEP)


@jitable
def is_bounded(m: Method) -> bool:
    """Return whether the next explicit step is to end within the bound of stability.

    The error lets steps beyond it pass as long as what they amplify is within the tolerance. Where
    stability bounds one step after the other, what rests then trembles at the tolerance for good
    (a cube on a slope at 1e-5 rad/s; within the bound at 1e-11, in as many steps). A loose
    tolerance lets such steps throw what rests into the air, or what friction holds into slip: where
    far shorter ones came behind stiff ones no step goes beyond any more. Nor where the implicit
    method may begin soon: from what flies about it takes long.
    """
    return m.memory[BOUNDED] == 1.0 or m.memory[STIFF_STEPS] >= STEADY


@jitable
def bound_next(m: Method, h: float, error: float) -> None:
    """Let the explicit step after one of length h and this error keep to the bound if it has to."""
    note_bound(m, h, error)
    if is_bounded(m):
        stay_within(m)
    elif m.memory[KEEPS_TO_BOUND] == 1.0:
        keep_to_bound(m, error)


@jitable
def note_pace(m: Method, t: float) -> None:
    """Count an explicit step, and note how many there are a time."""
    m.memory[EXPLICIT_STEPS] += 1.0
    steps = m.memory[EXPLICIT_STEPS]
    # the run so far: after a change back only whole windows count, for that may be in an impact
    if steps % WINDOW == 0.0 or m.counts[STEPS] <= min(steps, WINDOW):
        work = m.counts[EVALUATIONS] - m.memory[BEGUN_WORK]
        m.memory[PACE] = work / EVALUATIONS_A_STEP / (t - m.memory[BEGUN])
    if steps % WINDOW == 0.0:
        m.memory[BEGUN], m.memory[BEGUN_WORK] = t, m.counts[EVALUATIONS]


@jitable
def count_stiff(m: Method, h: float) -> None:
    """Count a step of length h that was at the bound of stability, or one that was not."""
    if m.memory[STIFFNESS] > BOUND:
        if m.memory[STIFF_STEPS] == 0.0:
            # nothing is known of it: as long as the error allows
            m.memory[PART] = 1.0
        # a hidden rate is far beyond the bound: what else it bounds trembles soon
        m.memory[STIFF_STEPS] += 2.0 if m.memory[STIFFNESS] == math.inf else 1.0
        if m.memory[WAS_CUT] == 0.0:
            part = min(1.0, m.memory[LAST_ERROR] ** 0.2)
            over = min(m.memory[STIFF_STEPS], RECENT)
            m.memory[PART] += (part - m.memory[PART]) / over
        m.memory[CALM_STEPS] = 0.0
        m.memory[STIFF_STEP] = h
    elif m.memory[STIFF_STEPS] > 0.0:
        # what trembles leaves and touches: the short steps behind that are not what bounds it
        m.memory[CALM_STEPS] += min(1.0, m.memory[LAST_STEP] / m.memory[STIFF_STEP])
        if m.memory[CALM_STEPS] >= FORGET:
            m.memory[STIFF_STEPS] = 0.0
    if m.memory[LAST_STEP] < THROWS * m.memory[STIFF_STEP]:
        m.memory[BOUNDED] = 1.0


@jitable
def is_smooth(m: Method, ahead: float) -> bool:
    """Return whether the error tells that the implicit method takes far less for so many steps."""
    saved = EVALUATIONS_A_STEP - IMPLICIT_STEP * m.memory[PART]
    return ahead * saved - IMPLICIT_START > EVALUATIONS_A_STEP * WORTH_SMOOTH


def is_since_begin(m: Method) -> bool:
    """Return whether the model was stiff from its begin, or what rests was shaken, or thrown.

    Else longer steps went before, as of a fall, and those at the bound have errors far below the
    tolerance: the implicit method goes on as well from there, and would take long until there.
    """
    thrown = m.memory[LAST_STEP] < THROWS * m.memory[STIFF_STEP]
    found = m.counts[STEPS] > 0 and m.memory[STIFF_STEPS] >= m.memory[PATIENCE]
    longer = m.memory[H_LARGEST] > LONGER_BEFORE * m.memory[STIFF_STEP]
    return bool(thrown or m.memory[PART] >= SHAKES or not (found and longer))


@jitable
def begins_stiff(m: Method, steps: Steps, t_end: float) -> bool:
    """Return whether stability will bound so many steps that the implicit method is to begin."""
    if m.memory[WATCH] == 0.0 or steps.rate == 0 or m.counts[STEPS] > 0:
        return False
    t = m.memory[TIME]
    rate = call_float(steps.rate, (steps.context, t))
    if not WORTH_AT_ONCE * WITHIN < rate * (t_end - t) < math.inf:
        return False
    # the steps that stability would bound: shorter ones of a transient are good for either method
    m.memory[PACE] = rate / WITHIN
    # where a force jumps the first step is tiny, with either method
    most = m.memory[FIRST_MAX] if m.memory[FIRST_MAX] > 0.0 else math.inf
    m.memory[STEP] = min(WITHIN / rate, most)
    m.memory[STIFF_STEPS] = m.memory[PATIENCE]
    return True


@jitable
def is_thrown(m: Method, ahead: float) -> bool:
    """Return whether steps at the bound of stability have thrown what rests, soon after the begin.

    What flies about then is not the model's motion, and bounces for long; from the begin on the
    implicit method does not throw it. A step that was cut at a switch is short for that, and one at
    the bound that is shorter than the run's mean is of an impact, which leaves by itself.
    """
    began = m.memory[COSTLY] == math.inf and m.counts[STEPS] <= BEGIN_STEPS
    # what has flown or bounced for longer than a step at the bound does so by itself
    began = began and m.memory[CALM_STEPS] < 1.0
    thrown = m.memory[WAS_CUT] == 0.0 and m.memory[LAST_STEP] < THROWS * m.memory[STIFF_STEP]
    usual = (m.memory[TIME] - m.memory[BEGUN]) / m.memory[EXPLICIT_STEPS]
    rests = m.memory[STIFF_STEPS] >= STEADY and m.memory[STIFF_STEP] >= usual
    return began and thrown and rests and ahead > WORTH_THROWN


@jitable
def is_stiff(m: Method, steps: Steps, h: float, t_end: float) -> bool:
    """Note what the last explicit step found; return whether to change over."""
    t = m.memory[TIME]
    note_pace(m, t)
    count_stiff(m, h)
    taken = m.memory[EXPLICIT_STEPS]
    # steps that grow, as from a start, are not yet those to come
    most = (t_end - t) / m.memory[STEP] if m.memory[WAS_CUT] == 0.0 else math.inf
    ahead = min((t_end - t) * m.memory[PACE], most)
    smooth = m.memory[STIFF_STEPS] > 1.0 and most < math.inf and is_smooth(m, most)
    if m.memory[COSTLY] == math.inf:
        enough = ahead > WORTH or smooth
    elif m.memory[PACE] == 0.0:
        # until there is a window, as many a time as when it was found stiff before
        enough = min((t_end - t) * m.memory[COSTLY], most) > WORTH_AGAIN
    else:
        enough = ahead > WORTH_AGAIN
    if enough and m.memory[STIFF_STEPS] > 1.0:
        m.memory[BOUNDED] = 1.0
    if is_thrown(m, ahead):
        # no more steps at the bound are needed to know
        m.memory[STIFF_STEPS] = m.memory[PATIENCE]
        return True
    # as many steps a time as when it was stiff: it is so again, though nothing else may show it
    again = m.memory[PACE] >= m.memory[COSTLY] and taken >= max(WINDOW, m.memory[PATIENCE])
    patience = min(m.memory[PATIENCE], MOST_PATIENCE) if smooth else m.memory[PATIENCE]
    if again or m.memory[STIFF_STEPS] >= patience:
        return enough
    return ahead > MANY and taken >= m.memory[PATIENCE]


@jitable
def is_calm(p: Problem, m: Method, context: int, probe: int, t_end: float) -> bool:
    """Try an explicit step now and then; return whether to change back, with a step to begin."""
    m.memory[IMPLICIT_STEPS] += 1.0
    taken = m.memory[IMPLICIT_STEPS]
    # just behind a switch one tells of that alone
    if taken < TRY_EVERY or (m.memory[WAS_CUT] == 1.0 and taken < 2.0 * TRY_EVERY):
        return False
    m.memory[IMPLICIT_STEPS] = 0.0
    t, kept = m.memory[TIME], m.memory[LAST_ERROR]
    h = min(m.memory[STEP], t_end - t)
    if not h > 0.0:
        return False
    code = failure_or(m, call_int(probe, (context, t, h, m.y, m.trial)))
    error = m.memory[LAST_ERROR]
    m.memory[LAST_ERROR] = kept
    part = 0.0
    if code == 0 and error < math.inf:
        part = 0.9 * max(error, 1e-4) ** -0.2
        if m.memory[STIFFNESS] > 0.0:
            part = min(part, WITHIN / m.memory[STIFFNESS])
    work = m.counts[EVALUATIONS] - EVALUATIONS_A_STEP + m.counts[JACOBIANS] - m.memory[BEGUN_WORK]
    gain = -math.inf
    if part > 0.0 and IMPLICIT_WORK * work / taken > EVALUATIONS_A_STEP / part:
        # where the motion excites nothing that is fast the stages do not tell
        rate = largest_rate(p, m, t)
        if rate > 0.0:
            part = min(part, WITHIN / (rate * h))
    if part > 0.0:
        # over the time that they took, in steps of this length: shorter ones are behind an event;
        # where longer ones were among them explicit steps would have taken many
        each, passed = IMPLICIT_WORK * work / taken, (t - m.memory[BEGUN]) / h
        gain = each * min(passed, taken) - EVALUATIONS_A_STEP / part * passed
    # what it takes a time, against what the explicit method took: of that the trial is another word
    costly = IMPLICIT_WORK * work > EVALUATIONS_A_STEP * m.memory[COSTLY] * (t - m.memory[BEGUN])
    agreed = 1.0 if costly else 0.5
    m.memory[BEGUN] = t
    m.memory[BEGUN_WORK] = m.counts[EVALUATIONS] + m.counts[JACOBIANS]
    # a short step, as after a change or a switch, is good for either method: one that is shorter
    # than before the model was found stiff tells less
    short = min(1.0, part) * h * m.memory[PACE] < 1.0
    # what one trial tells is of where it was made
    gain = min(gain * (SHORT_TELLS if short else 1.0), agreed * WRONG * m.memory[RELUCTANCE])
    m.memory[CALM_STEPS] = max(0.0, m.memory[CALM_STEPS] + gain)
    if m.memory[CALM_STEPS] < WRONG * m.memory[RELUCTANCE]:
        return False
    m.memory[STEP] = min(1.0, part) * h
    return True


def serve(context: int, probe: int, t_end: float) -> int:
    """Whether the implicit method is to be left: behind an address, for most runs never take it."""
    p, m = in_workspace(context)
    return 1 if is_calm(p, m, context, probe, t_end) else 0


@jitable
def changes_over(m: Method, steps: Steps, h: float, t_end: float) -> bool:
    """Return whether the other method is to go on from the committed point."""
    if steps.implicit:
        return call_int(steps.calm, (steps.context, steps.probe, t_end)) == 1
    return is_stiff(m, steps, h, t_end)
