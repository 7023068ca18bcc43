"""What sensitivities keep from step to step, beside a run's own arrays.

The *twin* is a second packed `Scene`: what is committed it shares with the run, constants that
parameters change and all scratch are its own. So it is evaluated beside the run and leaves it
alone. P parameters, n numbers of y, ns slots.
"""

from __future__ import annotations

from typing import NamedTuple

from mbsim.core import tags
from mbsim.core.arrays import F1, F2, F3, I1, I2

# numbers of `words`: the hooks of the run that are passed on to; tables of the run's method, of the
# twin and of its two methods; addresses of an explicit method's functions, 0 for an implicit one;
# coefficients of the dense output; numbers that a law remembers
COMMIT, OUTPUT, METHOD, TWIN, UP, DOWN, ATTEMPT, FIT_DENSE, COEFFICIENTS, REMEMBERED = range(10)
# whether the last step has a polynomial; rows of results so far; parameter that failed first, or -1
FITTED, ROWS, JOINTS = range(10, 13)
WORDS = 13


@tags.state
class Variations(NamedTuple):
    """Derivatives of y, and what they are made of."""

    words: tags.Scratch[I1]  # (WORDS,) see the names above
    d: F2  # (P, n) derivative of y at the committed point
    memory: F3  # (P, ns, most) of what friction laws remember: `State.memory`
    before: F3  # (P, ns, most) of `State.before`
    lost: F1  # (P,) time from which a derivative is not known, inf while it is
    why: I1  # (P,) for what reason: LOST_...
    dense: F3  # (P, coefficients, n) of the last step, as `Method.dense`
    next: tags.Scratch[F2]  # (P, n) derivative at the end of the step that is taken
    far: tags.Scratch[F3]  # (2, ns, most) what laws make of their memory on either side
    stage: tags.Scratch[F2]  # (STAGES, n) of an implicit method
    was: tags.Scratch[F2]  # (3, n) y before a commit, f behind it, a point
    row: tags.Scratch[F2]  # (3, n) y of a row of results, one beside it, its f
    scale: tags.Constant[F1]  # (n,) usual size of a number of y
    size: tags.Constant[F1]  # (P,) of a parameter
    first: tags.Constant[I1]  # (P + 1,) first of the numbers that a parameter changes
    place: tags.Constant[I1]  # where each of these is
    base: tags.Constant[F1]  # what it is
    slope: tags.Constant[F1]  # its derivative
    step: tags.Scratch[F2]  # (rows, P) by how much a parameter is changed for a row of results
    pair: tags.Scratch[I2]  # (0, 0)


#: Why a derivative is not known from some time on.
LOST_FAILED, LOST_JUMP, LOST_GRAZING, LOST_LARGE = range(1, 5)
