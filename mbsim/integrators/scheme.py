"""What the driver asks of a method, and what a method keeps.

A method is one file with two functions on arrays. Both are C functions behind addresses, as the
problem's hooks are, so the driver is compiled once for all methods and a run compiles the one it
uses. With p the problem, m the `Method` and k the stages, k[0] = f at the committed point m.y:

* `attempt(p, m, t, h)` goes from (t, y) to t + h: fills the stages, `trial`, projected before
  f is taken there into k[last], and memory[LAST_ERROR] = local error over memory[TOL]. A method
  that knows before the last stage that the step fails may leave that stage out. It counts
  its evaluations and returns 0 or the code of the hook that failed (a `HOOK` of the problem's).
* `fit_dense(p, m, t, h)` fills `dense` for a step that is about to be accepted, only where an
  output or a peak lies in it. It may take more stages, if it leaves the problem evaluated at
  the trial point. Where memory[SHOWN] is 1 a method whose polynomial may be worse than its step
  raises memory[LAST_ERROR], beyond 1 for the step to be tried shorter. The polynomial in
  s = 0..1, r = 1 - s, is
  d0 + s (d1 + r (d2 + s (d3 + r (d4 + ...)))).

`order` is the power of h that the error of a step has; 0 stands for a method without an error
estimate: the step is what the problem's hook `stable` says, at most h_max, and holds for
STABLE_EVERY steps; the guards of single impacts are left out.

An implicit method solves with the problem's linearisation (`core.problem`) and says so:
the driver then extrapolates steps as it does for such methods, and keeps one that is good as it is.
What a method needs of the step before is in `kept`, where the driver puts what `attempt` left in
`ahead` once the step is taken; memory[FRESH] says that there is none, as at the start and
after an event.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from mbsim.core import tags
from mbsim.core.address import call_int, view
from mbsim.core.arrays import F1, F2, I1, I2, V3
from mbsim.core.jitable import jitable
from mbsim.core.problem import GOES, LISTED, PART_BEGINS, PART_ENDS, PARTS, STATE, WHOLE, Problem

# memory
TIME, STEP, ERROR_BEFORE, HAVE_F, H_SMALLEST, LAST_ERROR, H_LARGEST = range(7)
LAST_TIME, LAST_STEP, FIRST_MAX, TOL, AFTER_REJECTION, STALE, EVENT_DUE = range(7, 14)
# of implicit methods: whether the problem keeps a linearisation, and where it was taken;
# the step that it was factored for; the rate at which Newton's iteration converged last, and
# what is left after its first step; nothing is known of a step before; part of a step to try
# after Newton's iteration failed; the last correction's size, and that of the one before; by
# how much the step may grow for Newton's iteration to converge still; at what part of its step
# RADAU5 linearises
HAVE_JACOBIAN, JACOBIAN_TIME, FACTORED_STEP, RATE, REST, FRESH, RETRY = range(14, 21)
# of AUTO (`changing.py`): whether it watches; step times largest rate as the last step found it;
# steps found stiff, and those not stiff since; how many make it change over; steps of either
# method since the last change; whether the implicit method runs; steps a time over the last
# window of them, and when it began
WATCH, STIFFNESS, STIFF_STEPS, CALM_STEPS, PATIENCE = range(21, 26)
EXPLICIT_STEPS, IMPLICIT_STEPS, STIFF, PACE, BEGUN = range(26, 31)
CORRECTION, CORRECTION_BEFORE, GROWTH, WHERE = range(31, 35)
# whether AUTO has decided to change over, and the caller is to be told
CHANGE_DUE = 35
# how often hooks failed of late, and the end of the step whose hook failed last
FAILURES, FAILED_AT = range(36, 38)
# the problem's own time, L/V, beside which shorter ones are rounding: 1 unless the caller gives it
OWN_TIME = 38
# the most that Newton's iteration left of a step that was taken, in the norm of the error, and when
LEFT_OVER, LEFT_TIME = range(39, 41)
# of the timetable: where the row ends that holds now, and how far a step may go until then
ROW_ENDS, HORIZON = range(41, 43)
# of AUTO: steps a time when the explicit method was last found to take too many, inf before that
COSTLY = 43
# how long the step was meant to be that was cut at a switch or event and rejected then; else 0
CUT_FROM = 44
# 1 where the last step that was taken was cut at a switch or event
WAS_CUT = 45
# 1 where a row of results lies within the step that is tried
SHOWN = 46
# of AUTO: length of the step that was found stiff last
STIFF_STEP = 47
# how many steps in a row were cut at a switch and changed no side after all
VAIN = 48
# of AUTO: evaluations when its last window of steps began; how many times as much as at first has
# to speak for leaving the implicit method
BEGUN_WORK, RELUCTANCE = range(49, 51)
# 1 where the step that was tried last was cut at a switch
SWITCH_CUT = 51
# what Newton's iteration may leave unsolved, as a part of a step's error
LEFT_PART = 52
# of AUTO: 1 once explicit steps are to stay within the bound of stability
BOUNDED = 53
# of DOP853: where its last step tried began
THIRD_AT = 54
# of the step that was tried last: what is to be looked for within it, and whether friction holds
# something there (`branches`); a part of it at which a force is on another branch, 0 for none, and
# how much of it the load of what holds is known for
LOOKS, HOLDS, SWITCHED, REACH = range(55, 59)
# the most that the error of a step of order 2 may be, whatever tol is
HELD = 59
# of an explicit method alone (`stability.py`): whether it looks at its bound of stability, and goes
# beyond; how far both kinds of steps go for an evaluation, 0 for unknown; of the window of steps:
# how many, and at the bound, time and evaluations at its begin; windows since the kind was chosen
KEEPS_TO_BOUND, FREE, PACE_FREE, PACE_WITHIN = range(60, 64)
WINDOW_STEPS, WINDOW_STIFF, WINDOW_TIME, WINDOW_WORK, WINDOWS = range(64, 69)
# 1 where velocities jump within the step that was tried: it has no polynomial, and ends at a row
HITS = 69
# 1 where a force leaves the branch at once that a change has just put it on
AT_ONCE = 70
# when the run ends, as far as its caller knows: steps are asked for up to nearer times
RUN_END = 71
# of an explicit method: for how many steps still one that was at the bound is remembered; after how
# many windows within the bound the next one goes beyond
AT_BOUND, WAIT = range(72, 74)
# of AUTO: what part of a step that the error would allow those at the bound of stability are
PART = 74
# what Newton's iteration leaves, and f at a step's end, are judged as at this tol where tol is
# looser
JUDGED = 75
# of implicit methods: by how much steps may grow behind one that was hard to solve for
EASE = 76
# of an explicit method: the longest next step within the bound of stability, as its last ones tell,
# and by how much it may be longer than what was told a step before
LONGEST, LONGER = range(77, 79)
# of implicit methods: 1 where the last iteration ended at rounding
AT_ROUNDING = 79
# where in the step that was tried slip may stop for a moment, as a part of it; 0 for unknown
DIP = 80
MEMORY = 81
# counts; CODE: of a hook that failed, see `note_failure`; the last two: at how many steps the
# caller wants to look at the run, row of the timetable
STEPS, REJECTED, EVALUATIONS, NEXT_OUTPUT, LAST_REASON, CODE, OUTPUTS = range(7)
JACOBIANS, FACTORIZATIONS, NEXT_WATCH, ROW = range(7, 11)
COUNTS = 11
# numbers that `factor_pair` takes, which are more than those of `factor`
COEFFICIENTS = 7
#: What is left unsolved of a step's equations may be this part of its error, or less.
LEFT = 0.03


class Scheme(NamedTuple):
    """A method: its two functions as hooks, and its numbers."""

    attempt: Callable[..., int]
    fit_dense: Callable[..., int]
    stages: int  # rows of k
    last: int  # row of k with f at the trial point
    dense: int  # coefficients of the dense output
    order: float  # power of h in the error of a step; 0: no estimate, fixed steps
    memory: float = 0.0  # how much the last error counts in step control (`control.next_factor`)
    implicit: bool = False  # solves with the problem's linearisation
    carried: int = 0  # rows of `kept`
    pair: bool = False  # solves with complex coefficients as well
    watched: int = 0  # rows of k where its rates are looked at
    samples: int = 1  # parts of a step of others in which it sees as much, at the ends alone
    # a step that is cut to less than this part, where a force in touch ends, tells nothing of the
    # next one, which is as long as it was meant to be
    resumes: float = 1.0
    # the loosest tol by which it is judged what is left of a step's equations, where there is
    # friction
    judged: float = math.inf
    # of an explicit one: by how much steps may grow that come behind one at its bound (`stability`)
    longer: float = math.inf


@tags.state
class Method(NamedTuple):
    """What a method keeps."""

    y: F1  # (n,) the committed point
    k: F2  # (stages, n); row 0 is f at the committed point
    trial: tags.Scratch[F1]  # (n,)
    error: tags.Scratch[F1]  # (n,)
    dense: F2  # (coefficients, n) polynomial of the last step that something lay in
    memory: F1  # (MEMORY,) see the names above
    counts: I1  # (COUNTS,) see the names above
    kinds: tags.Constant[I1]  # (n,) POSITION, VELOCITY or STATE: see `core.problem`
    kept: F2  # (carried, n) what the method needs of the step before
    ahead: tags.Scratch[F2]  # (carried, n) the same of the step that was tried last
    timetable: F2  # (rows, 2) where each row ends, how far a step may go from it; see `driver`
    # (7,) of the systems that an implicit step solves, as `factor` and `factor_pair` take them
    coefficients: tags.Scratch[F1]
    # (2,) WHOLE where steps change any number of y, as they do unless a problem that steps with
    # contacts of its own says which ones alone; and how many rows of `part` say that
    whole: I1
    part: tags.Scratch[I2]  # (parts, 2) begin and end


@tags.constant
class Workspace(NamedTuple):
    """What stands behind the context of a method's two functions."""

    problem: I1  # (23,) the fields of `Problem`
    method: Method


class Steps(NamedTuple):
    """A method bound to a problem, as compiled code takes it."""

    context: int
    attempt: int
    fit_dense: int
    last: int
    order: float
    memory: float
    implicit: bool
    resumes: float
    # what only some problems need, 0 for others: `branches.serve`, `events.serve`; of AUTO's
    # implicit method `attempt` of the explicit one, and `changing.serve` that tries it; of AUTO's
    # explicit method `rates.serve`
    branches: int
    events: int
    probe: int
    calm: int
    rate: int


def make(scheme: Scheme, y0: Any, t0: float, kinds: Any = None, rows: int = 1) -> Method:
    """Return the method at rest at (t0, y0), whose numbers are of these kinds, STATEs if not given.

    Its timetable has room for so many rows, and bounds nothing.
    """
    n = len(y0)
    memory = np.zeros(MEMORY)
    memory[TIME] = t0
    memory[ERROR_BEFORE] = memory[OWN_TIME] = 1.0
    memory[H_SMALLEST] = memory[GROWTH] = memory[EASE] = math.inf
    memory[FAILED_AT] = t0
    memory[LEFT_PART] = LEFT
    memory[JUDGED] = math.inf
    memory[LONGEST], memory[LONGER] = math.inf, scheme.longer
    memory[RUN_END] = -math.inf
    memory[HELD] = math.inf
    memory[ROW_ENDS] = memory[HORIZON] = memory[COSTLY] = math.inf
    counts = np.zeros(COUNTS, dtype=np.int64)
    counts[NEXT_WATCH] = np.iinfo(np.int64).max  # nobody watches
    return Method(
        np.array(y0, dtype=np.float64),
        np.zeros((scheme.stages, n)),
        np.zeros(n),
        np.zeros(n),
        np.zeros((scheme.dense, n)),
        memory,
        counts,
        np.full(n, STATE) if kinds is None else np.array(kinds, dtype=np.int64),
        np.zeros((scheme.carried, n)),
        np.zeros((scheme.carried, n)),
        np.full((rows, 2), math.inf),
        np.zeros(COEFFICIENTS),
        np.array([WHOLE, 0]),
        np.zeros((0, 2), dtype=np.int64),
    )


def looked_at(scheme: Scheme) -> Scheme:
    """Return a scheme whose arrays hold what its rates are found by."""
    return scheme._replace(stages=max(scheme.stages, scheme.watched))


def both(one: Scheme, other: Scheme) -> Scheme:
    """Return a scheme whose arrays hold what either method needs."""
    return one._replace(
        stages=max(one.stages, other.stages, one.watched, other.watched),
        dense=max(one.dense, other.dense),
        carried=max(one.carried, other.carried),
    )


@jitable
def factor_real(p: Problem, m: Method, t: float, h: float, c: V3, form: float) -> int:
    """Let the problem factor its real system with coefficients `c`; return its code."""
    given = m.coefficients
    given[0], given[1], given[2], given[3] = c[0], c[1], c[2], form
    return call_int(p.factor, (p.context, t, h, given, given))


@jitable
def in_workspace(context: int) -> tuple[Problem, Method]:
    """Return the problem and the method that stand behind `context`."""
    workspace = view(context, Workspace)
    w = workspace.problem
    first = (w[0], w[1], w[2], w[3], w[4], w[5], w[6])
    second = (w[7], w[8], w[9], w[10], w[11], w[12], w[13])
    third = (w[14], w[15], w[16], w[17], w[18], w[19], w[20], w[21], w[22])
    return Problem(*(first + second + third)), workspace.method


@jitable
def note_failure(m: Method, code: int) -> None:
    """Keep the first code of a hook where it cannot be returned: `failure_or` hands it on."""
    if m.counts[CODE] == 0:
        m.counts[CODE] = code


@jitable
def failure_or(m: Method, code: int) -> int:
    """Return the code that `note_failure` kept, which is forgotten, or `code` if there is none."""
    noted = m.counts[CODE]
    m.counts[CODE] = 0
    return noted if noted != 0 else code


@jitable
def answer_of(m: Method, answer: int) -> int:
    """Return what a hook answers; 0 where it failed, which is noted."""
    if answer < 0:
        note_failure(m, -answer)
        return 0
    return answer


@jitable
def project(p: Problem, m: Method, t: float, h: float, y: F1) -> None:
    """Bring y back onto the problem's manifold; a failure is noted."""
    code = call_int(p.project, (p.context, t, h, y, y))
    if code != 0:
        note_failure(m, code)


@jitable
def combine(k: F2, weights: F1, count: int, out: F1) -> None:
    """Write the sum of weights[j] k[j], j < count, into `out`."""
    for i in range(len(out)):
        out[i] = 0.0
    for j in range(count):
        weight = weights[j]
        if weight != 0.0:
            for i in range(len(out)):
                out[i] += weight * k[j, i]


@jitable
def interpolate(m: Method, s: float, out: F1) -> None:
    """Write the state at the part s (0..1) of the last fitted step into `out`, as it changes."""
    d, r = m.dense, 1.0 - s
    last = len(d) - 1
    for row in range(parts(m)):
        begin, end = part_of(m, row)
        for i in range(begin, end):
            value = d[last, i]
            for j in range(last - 1, -1, -1):
                value = d[j, i] + (s if j % 2 == 0 else r) * value
            out[i] = value


@jitable
def parts(m: Method) -> int:
    """Return how many ranges of numbers of y a step changes."""
    return m.whole[PARTS] if m.whole[GOES] == LISTED else 1


@jitable
def part_of(m: Method, k: int) -> tuple[int, int]:
    """Return begin and end of the k-th of them."""
    if m.whole[GOES] == LISTED:
        return m.part[k, PART_BEGINS], m.part[k, PART_ENDS]
    return 0, len(m.y)
