"""When AUTO changes over between its explicit and its implicit method.

The explicit method estimates the largest rate of f from its last two stages, which are at the same
time: |f(y7) - f(y6)| / |y7 - y6|. Where the step times that stays at the method's stability bound,
some 3.3, stability and not the error bounds the steps: the model is stiff. The implicit method
tries an explicit step now and then; where that is good enough, and stable, at half the length
twice running, it costs less.

How many steps are ahead is judged by the pace of the run so far, and of the last WINDOW steps once
there are so many: an impact after a flight takes little of the run, and is over before there are.
Friction that turns sign from step to step within the tolerance hides its rate. That is mostly seen
all the same (`dopri5.stiffness`), and counts twice: such steps are far beyond the bound, and what
else they shake leaves the state that the implicit method would begin from. What trembles so leaves
and touches, and steps are short behind that: as calm they count by their length. Else a run that
takes as many steps a time as when it was found stiff before, or has very many steps ahead, tries
the implicit method now and then.
Models whose explicit run is short stay explicit, stiff or not, and compile nothing else.
Source: E. Hairer, G. Wanner, Solving ODEs II (1996), section IV.2.
"""

from __future__ import annotations

import math

from mbsim.core.address import call_int
from mbsim.core.jitable import jitable
from mbsim.integrators.scheme import (
    BEGUN,
    CALM_STEPS,
    COSTLY,
    EXPLICIT_STEPS,
    IMPLICIT_STEPS,
    LAST_ERROR,
    LAST_STEP,
    PACE,
    PATIENCE,
    STEP,
    STEPS,
    STIFF_STEP,
    STIFF_STEPS,
    STIFFNESS,
    TIME,
    failure_or,
)

#: From here on a step is at the stability bound, or in reach of it.
BOUND, WITHIN = 3.0, 2.5
#: Steps found stiff before AUTO changes over, and others that make it forget them.
FIRST_PATIENCE, FORGET = 15, 6
#: Steps over which their number a time is taken: an impact is shorter.
WINDOW = 200
#: A change is worth it for so many steps that are still to be taken; once the implicit method has
#: run, and nothing is to be loaded for it, for fewer.
WORTH, WORTH_AGAIN = 2000, 200
#: With so many ahead the implicit method is tried after as many steps as there is patience for.
MANY = 20_000
#: Implicit steps between trials of an explicit one, and how many good ones change back: more of
#: them, over WINDOW steps, where it would be shorter than what the explicit method took before.
TRY_EVERY, TRIALS, TRIALS_OF_SHORT = 20, 2, 10


@jitable
def is_stiff(m, t_end):
    """Note what the last explicit step found; return whether to change over."""
    if m.memory[STIFFNESS] > BOUND:
        # a hidden rate is far beyond the bound: what else it bounds trembles soon
        m.memory[STIFF_STEPS] += 2.0 if m.memory[STIFFNESS] == math.inf else 1.0
        m.memory[CALM_STEPS] = 0.0
        m.memory[STIFF_STEP] = m.memory[LAST_STEP]
    elif m.memory[STIFF_STEPS] > 0.0:
        # what trembles leaves and touches: the short steps behind that are not what bounds it
        m.memory[CALM_STEPS] += min(1.0, m.memory[LAST_STEP] / m.memory[STIFF_STEP])
        if m.memory[CALM_STEPS] >= FORGET:
            m.memory[STIFF_STEPS] = 0.0
    m.memory[EXPLICIT_STEPS] += 1.0
    t, steps = m.memory[TIME], m.memory[EXPLICIT_STEPS]
    # the run so far: after a change back only whole windows count, for that may be in an impact
    if steps % WINDOW == 0.0 or m.counts[STEPS] <= min(steps, WINDOW):
        m.memory[PACE] = min(steps, WINDOW) / (t - m.memory[BEGUN])
    if steps % WINDOW == 0.0:
        m.memory[BEGUN] = t
    # steps that grow, as from a start, are not yet those to come
    most = (t_end - t) / m.memory[STEP]
    ahead = min((t_end - t) * m.memory[PACE], most)
    if m.memory[COSTLY] == math.inf:
        enough = ahead > WORTH
    elif m.memory[PACE] == 0.0:
        # until there is a window, as many a time as when it was found stiff before
        enough = min((t_end - t) * m.memory[COSTLY], most) > WORTH_AGAIN
    else:
        enough = ahead > WORTH_AGAIN
    # as many steps a time as when it was stiff: it is so again, though nothing else may show it
    again = m.memory[PACE] >= m.memory[COSTLY] and steps >= max(WINDOW, m.memory[PATIENCE])
    if again or m.memory[STIFF_STEPS] >= m.memory[PATIENCE]:
        return enough
    return ahead > MANY and steps >= m.memory[PATIENCE]


@jitable
def is_calm(p, m, steps, t_end):
    """Try an explicit step now and then; return whether to change back, with a step to begin."""
    m.memory[IMPLICIT_STEPS] += 1.0
    if m.memory[IMPLICIT_STEPS] % TRY_EVERY != 0.0:
        return False
    t, kept = m.memory[TIME], m.memory[LAST_ERROR]
    h = min(m.memory[STEP], t_end - t)
    if not h > 0.0:
        return False
    code = failure_or(m, call_int(steps.probe, (steps.context, t, h, m.y, m.trial)))
    error = m.memory[LAST_ERROR]
    m.memory[LAST_ERROR] = kept
    part = 0.0
    if code == 0 and error < math.inf:
        part = 0.9 * max(error, 1e-4) ** -0.2
        if m.memory[STIFFNESS] > 0.0:
            part = min(part, WITHIN / m.memory[STIFFNESS])
    m.memory[CALM_STEPS] = m.memory[CALM_STEPS] + 1.0 if part >= 0.5 else 0.0
    # a short step, as after a change or a kink, is good for either method: one that is shorter
    # than before the model was found stiff tells less
    short = min(1.0, part) * h * m.memory[PACE] < 1.0
    if m.memory[CALM_STEPS] < (TRIALS_OF_SHORT if short else TRIALS):
        return False
    m.memory[STEP] = min(1.0, part) * h
    return True


@jitable
def changes_over(p, m, steps, t_end):
    """Return whether the other method is to go on from the committed point."""
    if steps.implicit:
        return is_calm(p, m, steps, t_end)
    return is_stiff(m, t_end)
