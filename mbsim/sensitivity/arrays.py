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
# how many numbers a law remembers
COMMIT, OUTPUT, METHOD, TWIN, UP, DOWN, ATTEMPT, FIT_DENSE, REMEMBERED = range(9)
# whether the last step has a polynomial; rows of results not taken yet; whether there are joints;
# contacts that begin or end in the step; f of the twin; whether what changes is in order of time;
# what touches on either side of a difference
FITTED, ROWS, JOINTS, CHANGES, RHS, ORDERED, ALIKE = range(9, 16)
# evaluations beside the run; derivatives of steps that were taken along the motion
ASKED, BENT = 17, 18
# whether points are on a straight line instead of on the step's polynomial; whether friction asks
# for another branch beside the run than in it at the end of a step
STRAIGHT, ODD = 19, 20
# whether the method is GALPHA: its steps are many and short, so order 3 is enough along them too
ALONG = 21
# how many times the run's own evaluations derivatives may take each, 0: as many as they do; how
# many that is by the end of the step that is taken
WORTH, MOST = 22, 23
# the parameter by which the twin was changed last
SET = 24
# whether f is no function of time in the step that is taken, nor of what laws remember; -1: unknown
STEADY = 25
# whether f of the run itself is known in the stages of the step that is taken; whether its path is
PLAIN, FOLLOWED = 26, 27
# the kept point, plus 1, whose memories of laws the twin has in place of the committed ones, or 0;
# whether the last part of a stick was gone over again
AGAIN, GONE_OVER = 28, 29
# where the linearisations of the run and of the twin are; whether the twin's own is that of the
# step that is taken
RUN_TANGENT, OWN_TANGENT, LINEARISED = range(30, 33)
# whether depths of contacts change in the step that is taken, as in impacts
COLLIDES = 33
# whether a force by an expression jumps at the end of the step that is taken
JUMPS = 34
# whether something follows time, so that it may jump
TIMED = 35
# why a derivative ends where a jump within a step moves, 0 where none may be: LOST_USER if a user's
# subroutine acts, which may jump where it likes
HIDES = 36
# whether friction acts whose force bends where slip turns round, within a step
CORNERS = 37
WORDS = 38
#: Rows of `Variations.far` and `depth`: either side of a difference, and the run itself.
UP_SIDE, DOWN_SIDE, OWN = range(3)
#: Rows of `Variations.jump`: y before the commit, f before and behind it; y and f of the straight
#: line along which times of changes are looked for.
BEFORE, F_BEFORE, F_BEHIND, LINE_Y, LINE_F = range(5)
#: How many committed points are kept, to go on from them again; of `Variations.held`: how many
#: there are, whether the first one was gone over itself, their rows from the first to the last.
HELD = 16
COUNT, SURE, LIST = range(3)
#: Number of `Variations.line`: how far from the ends of a stretch of a step both sides of a
#: difference touch alike, over its length.
APART = 1
#: How fast f changed in the last step, in usual sizes.
USUAL_CHANGE = 2
#: Where a part of a stretch ended that was too long, how long it was, its error over what that may
#: be; between which parts of a stretch f bends.
WALL, PART_TO_WALL, ERROR_TO_WALL, BEND, BEHIND_BEND = range(3, 8)
#: How long the step is that is taken [T].
LENGTH = 8
#: Numbers of a row of `Variations.later`: at the begin of the last step, behind it.
LAST_UNTIL, LAST_ON = range(2)
#: Numbers of a row of `Variations.shown`: part of the last step, `later` there.
SHOWN_AT, SHOWN_LATER = range(2)
#: Of `Variations.gap` and `moves`: the jump at the begin and at the end of the last step; when that
#: has ended.
FIRST, LAST, UNTIL = range(3)
#: Of `Variations.times`: how much later it is where a parameter is larger and smaller, by how much.
UP_TO, DOWN_TO, BY = range(3)
#: Number of `Variations.enough`: what an iteration may leave, over the derivative.
LEFT = 1
#: Numbers of a row of `Variations.about`: of the stretch that a part is in: begin, end and how its
#: parts are taken; where the part begins in it and its length; how much later what is carried is.
BEGINS, ENDS, WAY, FROM, LONG, IS_LATER = range(6)
#: Parts of a step whose polynomials are kept.
MOST_PARTS = 32
#: Contacts that may begin or end within one step.
MOST_CHANGES = 16
#: Numbers of a row of `Variations.change`: the slot, at which part of the step it changes, at which
#: with the parameter changed, how fast that time moves.
SLOT, AT_PART, UP_PART, MOVES = range(4)


@tags.state
class Variations(NamedTuple):
    """Derivatives of y, and what they are made of."""

    words: tags.Scratch[I1]  # (WORDS,) see the names above
    d: F2  # (P, n) derivative of y at the committed point
    memory: F3  # (P, ns, most) of what friction laws remember: `State.memory`
    before: F3  # (P, ns, most) of `State.before`
    end: tags.Scratch[F3]  # (P, ns, most) of what laws remember at the end of the step taken
    lost: F1  # (P,) time from which a derivative is not known, inf while it is
    why: I1  # (P,) for what reason: LOST_...
    dense: F3  # (P, coefficients, n) of the last step, as `Method.dense`
    later: F2  # (P, 2) s of `later`: LAST_UNTIL, LAST_ON [T over the parameter's unit]
    next: tags.Scratch[F2]  # (P, n) derivative at the end of the step that is taken
    # (3, ns, most) what laws make of their memory on either side; of the run itself: OWN
    far: tags.Scratch[F3]
    plain: tags.Scratch[F2]  # (3, n) f of the run itself in the stages of an implicit step
    stage: tags.Scratch[F2]  # (STAGES, n) of an implicit method
    path: tags.Scratch[F2]  # (coefficients, n) polynomial of the run's step
    work: tags.Scratch[F2]  # (WORK, n) of `along`
    error: tags.Scratch[F1]  # (P,) of the last step, over the derivative
    enough: tags.Constant[F1]  # (2,) how large that may be; LEFT
    rate: F1  # (P,) how much smaller corrections of an implicit method's stages got, one by one
    moved: F1  # (P,) what the first of them was in the last step, over the derivative
    stale: I1  # (P,) 1 where the run's linearisation was too old for it in the last step
    # (P, 4, n) a, v', v'' and v''' of a derivative in the last step of GALPHA, see `generalised`;
    # (P,) in how many steps in a row D' was found, up to what is needed
    carried: F3
    ready: I1
    bend: F2  # (P, n) h^4 times the fourth derivative in time of D in the last step
    bend_known: I1  # (P,) 1 where that is known
    bends: I1  # (P,) 1 where the last step was taken along the motion
    bent: I1  # (P,) how many steps in a row were
    jump: tags.Scratch[F2]  # (5, n) see BEFORE
    middle: tags.Scratch[F3]  # (P, ns, most) mean of both sides behind a change of branch
    mode: tags.Scratch[F1]  # (ns,) `State.mode` before it
    reach: F1  # (P,) by how much a parameter may be changed for depths, 0: not known
    odd: tags.Scratch[I2]  # (2, ns) 1 where friction asks for another branch beside the run
    depth: tags.Scratch[F2]  # (3, ns) how deep slots are at the end of a step, rows as of `far`
    # (9,) length of the straight line [T]; APART, USUAL_CHANGE, WALL and what follows
    line: tags.Scratch[F1]
    # (P, ns + 1) by how much slots change their branch later, by the parameter; what else does last
    shift: tags.Scratch[F2]
    times: tags.Scratch[F3]  # (P, ns + 1, 3) of the same: UP_TO, DOWN_TO [T], BY
    asks: tags.Scratch[I1]  # (ns + 1,) slots that ask for another branch, their number last
    reason: tags.Scratch[F1]  # (P,) why a derivative is lost at the end of the step, or 0
    breaks: tags.Constant[I1]  # (contacts,) 1 where friction jumps as nothing presses any more
    seen: tags.Scratch[I1]  # (ns + 1,) in how many points of a step slots touched, of how many
    own: tags.Scratch[F1]  # (n,) a derivative, while D + s f is in its place
    # (P, n) derivative at the begin of the last step, or at its last row where that was along it
    kept: tags.Scratch[F2]
    # (P MOST_PARTS, 5, n) polynomials of parts of the last step that was taken along the motion, as
    # `Method.dense`; (P MOST_PARTS, 6) see BEGINS; (P,) how many there are
    part: tags.Scratch[F3]
    about: tags.Scratch[F2]
    parts: tags.Scratch[I1]
    wide: tags.Scratch[F1]  # (P,) by how much it is changed where a stick is gone over again
    lasted: F1  # (P,) how long such a part may be that is tried first [T]
    fifth: I1  # (P,) 1 where parts of steps of GALPHA are by the method of order 5
    shown: tags.Scratch[F2]  # (P, 2) where that is: SHOWN_AT, SHOWN_LATER
    change: tags.Scratch[F2]  # (MOST_CHANGES, 4) slots that begin or end to touch, see SLOT
    row: tags.Scratch[F2]  # (4, n) of a row of results: -, y beside it, its f, its derivative
    # (4,) parts of usual steps of differences, of the least ones and of what depths allow that
    # those to one side take; and of usual ones those to both sides along a step
    one_sided: tags.Constant[F1]
    scale: tags.Constant[F1]  # (n,) usual size of a number of y
    # (n,) the same for errors of derivatives: also of what friction carries, in the step taken
    felt: tags.Scratch[F1]
    jumping: tags.Constant[F1]  # (n,) the same for jumps of f, also of what laws integrate
    room: tags.Constant[F1]  # (n,) by how much it may be changed for a difference
    weights: tags.Constant[F1]  # of an explicit method's stages; none where joints hold bodies
    estimates: tags.Constant[F2]  # (1 or 2, stages) of its errors, up to the one at the step's end
    # of `again`: see COUNT; of the points kept, if any law remembers: time (HELD,), y (HELD, n),
    # its derivatives (HELD, P, n), what laws remember (HELD, ns, most), its (HELD P, ns, most)
    held: I1
    held_time: F1
    held_y: F2
    held_d: F3
    held_memory: F3
    held_moves: F3
    # (3, 6, n) motions of the run and of both sides of a parameter; (7, n) slopes of one
    again: tags.Scratch[F3]
    slopes: tags.Scratch[F2]
    slope: F2  # (P, n) D' of the last stage of an explicit method, or along the motion
    smooth: I1  # (P,) 1 where that is D' at the committed point
    # (P,) 1 where it is so by other differences than those of the step that comes: sides differ
    told: I1
    # (P,) the most that a change of a parameter by its own size does, in usual sizes of y
    largest: F1
    shown_error: F1  # (P,) estimate of a step of RADAU5 for the next one, 0: not known
    size: tags.Constant[F1]  # (P,) of a parameter
    first: tags.Constant[I1]  # (P + 1,) first of the numbers that a parameter changes
    place: tags.Constant[I1]  # where each of these is
    base: tags.Constant[F1]  # what it is
    rise: tags.Constant[F1]  # its derivative
    # (3,) times at which something jumps, NaN for none, see FIRST; (P, 2) how far a parameter moves
    # them, at most, over its change, 0 where it does not; (P, n) how derivatives jump there
    gap: F1
    moves: F2
    fall: tags.Scratch[F2]
    # (P,) part of usual steps of differences that the last step takes next to a jump; 1 where it is
    shrink: F1
    close: I1
    sides: tags.Scratch[F2]  # (SIDES, n) of `timed`
    step: tags.Scratch[F2]  # (rows, P) by how much a parameter is changed for a row of results


#: Why a derivative is not known from some time on.
LOST_FAILED, LOST_JUMP, LOST_GRAZING, LOST_LARGE, LOST_WORK, LOST_USER = range(1, 7)
