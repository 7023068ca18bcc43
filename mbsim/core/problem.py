"""What an integrator sees: hooks behind addresses, called in the order of this table.

    int64  hook(int64 context, double t, double h, double *a, double *b)
    double hook(the same), of those that measure: norm, check, inner, limit, stable

A mechanism (`pipeline.problem`) and a scalar test equation (the tests) look the same, and a
method is compiled once for all. A hook that acts returns 0, or the code of its failure; one that
answers returns its answer, or less the code. A trial point whose rhs fails is tried again nearer
to the committed one before the run ends, but for codes from AT_ONCE on.

| hook    | a, b                   | returns                                                    |
|---------|------------------------|------------------------------------------------------------|
| arrive  | y committed, -         | 1 if something happened by this committed point that the   |
|         |                        | caller of `advance` must act on, else 0                    |
| rhs     | y, f (out)             | code; f = f(t, y), h after the last committed point        |
| stable  | y, f   (h: tolerance)  | step of a method that has no error estimate                |
| limit   | y, f                   | longest step that may be tried; less than 0 where steps    |
|         |                        | behind it may be as long as they were before               |
| project | y (in and out), -      | code; y back onto its manifold; h = ALONG: velocities in y |
|         |                        | are displacements a time, and all that counts is what      |
|         |                        | holds positions                                            |
| norm    | local error, y         | largest error over its scale, dimensionless; h = 0: of a   |
|         |                        | difference of two states that is no step's error, with     |
|         |                        | what it changes of friction over normal forces; h =        |
|         |                        | FRICTION_ALONE: only that; h = IMPACTS_ALONE: what it      |
|         |                        | changes of speeds in impacts, over what these changed by   |
|         |                        | in the step, t being its length; h = EACH: of RATES such   |
|         |                        | differences, one behind the other, each as with h = 0 and  |
|         |                        | left in its first number. Asked for AUTO alone; h = YIELDS,|
|         |                        | of a problem that owns its contacts: the part of its step, |
|         |                        | of length t, at which friction yields that held, else 1    |
| check   | y new, -               | 1, or the part of the step to take instead                 |
| inner   | -, tolerance           | part of the step (0..1) worth a look, or < 0; h = 0, after |
|         |                        | a look: the next one                                       |
| switch- | y, out (h: ASK, ...)   | 1 if a force is on another branch than at the committed    |
| ing     |                        | point, 2 if that shall be found exactly, else 0; PASS, of  |
|         |                        | a step that was taken, PASS_CUT, of one that was cut at a  |
|         |                        | switch: 1 if one changed in it; LOAD: 1 if                 |
|         |                        | friction holds something, the largest force by which it    |
|         |                        | does over what it can in out[0]; LOAD_AT_MOST: no less, at |
|         |                        | less cost; BENDS (b: y committed): 1                       |
|         |                        | if HALF, at the step's middle, then HALVES, at its end,    |
|         |                        | are to be asked: the error of a way followed in one, in    |
|         |                        | the norm of errors, in out[0]; HIDES (b: y committed): 1   |
|         |                        | if a force may leave its branch and come back within it,   |
|         |                        | and more where it would: by so many MILLIONTHS of the step |
| happens | y, -                   | 1 if an event that is to be located has happened between   |
|         |                        | the committed point and this one, else 0                   |
| step    | y, y after (out)       | code; the state a step h after y, of a problem that owns   |
|         |                        | its contacts, less than 0 where velocities jump in it;     |
|         |                        | h < 0: -h after a y that is no committed one; h = 0: where |
|         |                        | that step from y was at its part t < 1                     |
| reject  | -, -   (h: reason)     | code; told of every rejected step                          |
| commit  | y (in and out), f      | what follows from the step that is taken: a sum of `Taken` |
| look    | y at an inner point, - | code; called where `inner` before asked for it             |
| output  | y at an output time, - | 0, or FULL: take the rows away before going on             |

Numbers of y are POSITIONs, the VELOCITYs that positions follow from, or STATEs of first order
(`scheme.make`). Bodies turn, so positions are no sums of velocities: a method that takes them for
more than numbers asks these hooks, of a problem that has any.

| hook       | a, b                                    | returns                               |
|------------|-----------------------------------------|---------------------------------------|
| retract    | y, b (velocities in, positions out)     | code; y's positions moved on for a    |
|            |                                         | time h by the velocities in b         |
| difference | y, b (h: what is asked)                 | code; AS_VELOCITIES: b's velocities   |
|            |                                         | grow by those that change y's         |
|            |                                         | positions, in a time of one, by b's;  |
|            |                                         | AS_POSITIONS: b's positions are the   |
|            |                                         | change of y's by b's velocities;      |
|            |                                         | BRACKET: b's velocities become their  |
|            |                                         | Lie bracket with y's, 0 where nothing |
|            |                                         | turns; BOW (t: a step): b's           |
|            |                                         | velocities are by how much the cubic  |
|            |                                         | of a uniform turn of y's is off in    |
|            |                                         | that step; TURNED: 1 if b's positions |
|            |                                         | are turned against y's across y's     |
|            |                                         | velocities, else 0                    |

Implicit methods need the linearisation of f as well, in y's layout and with the bodies' part in
second-order form. With d = (dx, dq, dv, dw, dz) for bodies at x with quaternion q, velocity v
and angular velocity w, and states z of first order, and real or complex c1, c2, c3, it solves

    c1 dx - dv = r_x        c1 dq - d(q') = r_q, q' = q (0, w) / 2
    c2 dx - da = r_a        (turns likewise in body axes)
    c3 dz - d(z') = r_z

da being the linearised acceleration under joints and equations. `form` says what r holds:
0: method of first order, c3 = c1, c2 = c1^2, and r is the residual of (c1 I - J) d = r: the
   problem makes r_a of it;
1: method of second order, r_x = r_q = 0 and the slots of v and w hold r_a.

| hook       | a, b                                    | returns                               |
|------------|-----------------------------------------|---------------------------------------|
| linearise  | y, f                                    | code; keeps the linearisation where   |
|            |                                         | rhs has just been asked               |
| factor     | c1, c2, c3, form; -                     | 0 or SINGULAR; of the linearisation   |
|            |                                         | kept                                  |
| solve      | r, d (out)                              | code; by the last `factor`            |
| factor_pair| re c1, im c1, re c2, .. im c3, form; -  | 0 or SINGULAR; does not disturb the   |
|            |                                         | factors of `factor`                   |
| solve_pair | r, d (out), real parts, then imaginary  | code; by the last `factor_pair`       |
"""

from __future__ import annotations

from collections.abc import Callable, Container, Mapping
from enum import IntEnum
from typing import Any, NamedTuple

from mbsim.core.signature import FLOAT, INT, POINTER

HOOK = INT(INT, FLOAT, FLOAT, POINTER, POINTER)
MEASURE = FLOAT(INT, FLOAT, FLOAT, POINTER, POINTER)
#: The hooks that measure.
MEASURES = frozenset({"norm", "check", "inner", "limit", "stable"})
#: The hooks that make arrays as long as what they find.
ALLOCATING = frozenset({"step"})


class Problem(NamedTuple):
    """Addresses of the hooks, and the context that each is given."""

    context: int
    rhs: int
    project: int
    norm: int
    check: int
    commit: int
    look: int
    inner: int
    limit: int
    output: int
    reject: int
    stable: int = 0  # only for methods without error estimate
    happens: int = 0  # this and the next only for problems with events
    arrive: int = 0
    switching: int = 0  # only for problems whose forces change their branch
    linearise: int = 0  # this and the rest only for implicit methods
    factor: int = 0
    solve: int = 0
    factor_pair: int = 0
    solve_pair: int = 0
    retract: int = 0  # this and the next only for methods that know positions from velocities
    difference: int = 0
    step: int = 0  # only for problems that step with contacts of their own


def addresses(
    hooks: Mapping[str, Callable[..., Any]], allocating: Container[str] = ALLOCATING
) -> dict[str, int]:
    """Return the addresses of compiled hooks, by their names in `Problem`.

    `allocating` are those that may make arrays.
    """
    from mbsim.core import jit

    return {
        name: jit.address(hook, MEASURE if name in MEASURES else HOOK, name in allocating)
        for name, hook in hooks.items()
    }


class Taken(IntEnum):
    """What follows from a step that is taken: `commit` returns the sum of what does."""

    Y_CHANGED = 1  # f is to be evaluated again
    ROWS_FULL = 2  # the caller is to take them away before anything else
    STABLE_IS_STALE = 4  # `stable` is to be asked again
    BEGIN_ANEW = 8  # the motion is held otherwise from here on: nothing is known of a step before


#: What `output` answers where another row may find no place.
FULL = 1

#: Steps for which what `stable` says is believed, unless `commit` says that it is stale.
STABLE_EVERY = 16

#: What `norm` is given for h where only friction counts, where only impacts do, and where it takes
#: RATES vectors at once.
FRICTION_ALONE, IMPACTS_ALONE, EACH = -1.0, -2.0, -3.0
RATES = 7
#: What `norm` is given for h where it is to say when friction yields.
YIELDS = -4.0

#: What `project` is given for h where velocities in y are displacements.
ALONG = -1.0

#: What a number of y is.
POSITION, VELOCITY, STATE = range(3)

#: What `difference` is given for h.
AS_VELOCITIES, AS_POSITIONS, BRACKET, BOW, TURNED = 0.0, 1.0, 2.0, 3.0, 4.0


# what a step changes of y, `Method.whole`: the numbers in `Method.part` alone; any; any, and what
# others are is as it was in the step before, so that the next one may change parts alone
LISTED, WHOLE, PLACED = range(3)
#: Entries of `Method.whole`: one of these, and how many rows of `Method.part` are in use.
GOES, PARTS = range(2)
#: Columns of `Method.part`.
PART_BEGINS, PART_ENDS = range(2)

# what `advance` returns
DONE, PAUSED, STEP_TOO_SMALL, FAILED, ROWS_FULL, HAPPENED, CHANGES_OVER, WATCH_DUE = range(8)
#: Columns of a timetable: where a row ends, and how far a step may go from it.
TIMETABLE_ENDS, TIMETABLE_HORIZON = range(2)

#: The rows of the timetable are over: it is to be filled from here on.
TABLE_OVER = 8
#: Steps from one WATCH_DUE to the next: the caller looks whether the run gets anywhere.
WATCH_EVERY = 5000

# what `switching` is asked: whether sides differ, to keep them too, that a step was taken, loads;
# and of friction that follows a way in closed form: whether that bends, then two halves of the
# step; whether a side may have changed twice
ASK, SETTLE, PASS, PASS_CUT, LOAD, LOAD_AT_MOST, BENDS, HALF, HALVES, HIDES = map(float, range(10))
#: In what `switching` answers to HIDES a place within the step.
MILLIONTHS = 10**6

# reasons given to `reject`
BY_ERROR, BY_CHECK, BY_NOT_FINITE, BY_NEWTON, BY_JUMP = range(5)
