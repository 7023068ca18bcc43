"""When AUTO changes over between its explicit and its implicit method.

The explicit method estimates the largest rate of f from its last two stages, which are at the same
time: |f(y7) - f(y6)| / |y7 - y6|. Where the step times that stays at the method's stability bound,
some 3.3, stability and not the error bounds the steps: the model is stiff. The implicit method
tries an explicit step now and then; where that is good enough, and stable, at half the length,
it costs less.
Source: E. Hairer, G. Wanner, Solving ODEs II (1996), section IV.2.
"""

from __future__ import annotations

import math

from mbsim.core.address import call_float
from mbsim.core.jitable import jitable
from mbsim.integrators.scheme import (
    CALM_STEPS,
    IMPLICIT_STEPS,
    LAST_ERROR,
    PATIENCE,
    STEP,
    STIFF_STEPS,
    STIFFNESS,
    TIME,
)

#: From here on a step is at the stability bound, or in reach of it.
BOUND, WITHIN = 3.0, 2.5
#: Steps found stiff before AUTO changes over, and others that make it forget them.
FIRST_PATIENCE, FORGET = 15, 6
#: A change is worth it for so many steps that are still to be taken.
WORTH = 2000
#: Implicit steps between trials of an explicit one.
TRY_EVERY = 20


@jitable
def is_stiff(m, h, t_end):
    """Note what the last explicit step found; return whether to change over."""
    if m.memory[STIFFNESS] > BOUND:
        m.memory[STIFF_STEPS] += 1.0
        m.memory[CALM_STEPS] = 0.0
    else:
        m.memory[CALM_STEPS] += 1.0
        if m.memory[CALM_STEPS] >= FORGET:
            m.memory[STIFF_STEPS] = 0.0
    enough = m.memory[STIFF_STEPS] >= m.memory[PATIENCE]
    return enough and t_end - m.memory[TIME] > WORTH * h


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
    code = call_float(steps.probe, (steps.context, t, h, m.y, m.trial))
    error = m.memory[LAST_ERROR]
    m.memory[LAST_ERROR] = kept
    if code != 0.0 or not error < math.inf:
        return False
    part = 0.9 * max(error, 1e-4) ** -0.2
    if m.memory[STIFFNESS] > 0.0:
        part = min(part, WITHIN / m.memory[STIFFNESS])
    if part < 0.5:
        return False
    m.memory[STEP] = min(1.0, part) * h
    return True


@jitable
def changes_over(p, m, steps, h, t_end):
    """Return whether the other method is to go on from the committed point."""
    if steps.implicit:
        return is_calm(p, m, steps, t_end)
    return is_stiff(m, h, t_end)
