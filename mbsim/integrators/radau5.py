"""Implicit Runge-Kutta of order 5: three stages of Radau IIA, for stiff equations and accuracy.

With Z the stages less y, A the method's matrix and W = T^-1 Z, where T^-1 A^-1 T is one real
number g0 and one complex pair a +- ib, Newton's equations fall into one real and one complex
system of the size of y:

    (g0/h - J) dW0 = (T^-1 F)_0 - g0/h W0
    ((a + ib)/h - J) (dW1 + i dW2) = (T^-1 F)_1 - (a W1 - b W2)/h + i ((T^-1 F)_2 - (a W2 + b W1)/h)

Stages are projected: equations of joints hold at all of them, and what the residual F asks for
across these goes to multipliers, as in a stabilised formulation of index 2. What counts of a
correction is by how much the projected stage moves.
The last stage is the new point: stiffly accurate, L-stable. The error is of order 3, filtered by
the real system. The polynomial through the stages is the dense output, and what the next step
begins its iteration with.
Source: E. Hairer, G. Wanner, Solving ODEs II (1996), section IV.8.
"""

from __future__ import annotations

import math

import numpy as np

from mbsim.core.address import call_float, call_int
from mbsim.core.arrays import Pointer
from mbsim.core.jitable import jitable
from mbsim.core.problem import VELOCITY, Problem
from mbsim.integrators.newton import (
    GO_ON,
    HALF,
    HOPELESS,
    OFF,
    SOLVED,
    as_failure,
    begin,
    is_at_rounding,
    is_good_enough,
    judge,
    linearise,
    may_help,
    nears_rounding,
    unless_singular,
    with_ease,
)
from mbsim.integrators.positions import is_rate, put_along
from mbsim.integrators.scheme import (
    EVALUATIONS,
    FACTORED_STEP,
    FACTORIZATIONS,
    FRESH,
    GROWTH,
    HAVE_JACOBIAN,
    JACOBIAN_TIME,
    JACOBIANS,
    LAST_ERROR,
    LAST_STEP,
    LEFT,
    RATE,
    REST,
    RETRY,
    TOL,
    WHERE,
    Method,
    Scheme,
    factor_real,
    in_workspace,
    note_failure,
    project,
)

_ROOT = math.sqrt(6.0)
#: Nodes, and the method's matrix.
C = np.array(((4.0 - _ROOT) / 10.0, (4.0 + _ROOT) / 10.0, 1.0))
A = np.array(
    (
        ((88 - 7 * _ROOT) / 360, (296 - 169 * _ROOT) / 1800, (-2 + 3 * _ROOT) / 225),
        ((296 + 169 * _ROOT) / 1800, (88 + 7 * _ROOT) / 360, (-2 - 3 * _ROOT) / 225),
        ((16 - _ROOT) / 36, (16 + _ROOT) / 36, 1 / 9),
    )
)
#: Eigenvalues of its inverse: one real, one complex pair.
_THIRD, _SIXTH = 81.0 ** (1.0 / 3.0), 9.0 ** (1.0 / 3.0)
_REAL = (6.0 + _THIRD - _SIXTH) / 30.0
_A, _B = (12.0 - _THIRD + _SIXTH) / 60.0, (_THIRD + _SIXTH) * math.sqrt(3.0) / 60.0
G0, G_RE, G_IM = 1.0 / _REAL, _A / (_A * _A + _B * _B), _B / (_A * _A + _B * _B)
# fmt: off
T = np.array((
    (0.09123239487089295, -0.14125529502095421, -0.030029194105147425),
    (0.241717932707107, 0.204129352293799, 0.38294211275726192),
    (0.96604818261509293, 1.0, 0.0),
))
TI = np.array((
    (4.325579890063155, 0.339199251815809842, 0.541770539935874871),
    (-4.178718591551904, -0.327682820761062387, 0.476623554500550438),
    (-0.502872634945786875, 2.57192694985560543, -0.596039204828224932),
))
# fmt: on
#: Last row of the matrix's inverse: what stages do to h times the collocation's slope at its end.
SLOPE = np.array(
    (
        (1.0 - C[1]) / (C[0] * (C[0] - C[1]) * (C[0] - 1.0)),
        (1.0 - C[0]) / (C[1] * (C[1] - C[0]) * (C[1] - 1.0)),
        5.0,
    )
)
#: Error of order 3: weights of the stages.
E = np.array((-(13.0 + 7.0 * _ROOT) / 3.0, (-13.0 + 7.0 * _ROOT) / 3.0, -1.0 / 3.0))

#: Corrections in one step at most, and linearisations at its end.
MOST, MOST_ANEW = 7, 3
#: A correction that makes a residual smaller than this part of it tells of its own linearisation.
CONTRACTED = 0.5
#: A linearisation is kept for another step where the iteration converged so fast with it.
KEEP = 0.01
#: The second correction may be so many times the first.
SECOND = 10.0
#: The step grows as far as the iteration would still converge at this rate.
GOOD_RATE = 0.2
#: A step is extrapolated from the last one up to so many times its length.
FARTHEST = 1e5

# rows of k: f at the begin, the stages' f, stages less y, the same transformed, right-hand sides
# and solutions of the real system and of the pair, f at the trial point, what the last stage's
# equation left before the last correction
F, Z, W, REAL, REAL_D, PAIR, PAIR_D, LAST, UNSOLVED = 1, 4, 7, 10, 11, 12, 14, 16, 17


@jitable
def factor(p: Problem, m: Method, t: float, h: float) -> int:
    """Factor both systems for a step of length h; return a code."""
    m.counts[FACTORIZATIONS] += 1
    m.memory[FACTORED_STEP] = 0.0
    g, re, im = G0 / h, G_RE / h, G_IM / h
    code = factor_real(p, m, t, h, (g, g * g, g), 0.0)
    if code != 0:
        return code
    pair = m.coefficients
    pair[0], pair[1], pair[2], pair[3] = re, im, re * re - im * im, 2.0 * re * im
    pair[4], pair[5], pair[6] = re, im, 0.0
    code = call_int(p.factor_pair, (p.context, t, h, pair, pair))
    if code == 0:
        m.memory[FACTORED_STEP] = h
    return code


@jitable
def carried_on(m: Method, s: float, i: int) -> float:
    """Return how much y[i] rises from the last step's end to s >= 1 of it, by its polynomial."""
    inner = m.kept[1, i] + s * m.kept[2, i]
    return s * (m.kept[0, i] + (1.0 - s) * inner) - m.kept[0, i]


@jitable
def is_short(m: Method, h: float) -> bool:
    """Return whether the last step was too short for its polynomial to tell a step of length h."""
    return h > FARTHEST * m.memory[LAST_STEP]


@jitable
def extrapolate(m: Method, h: float) -> None:
    """Write the stages as the last step's polynomial, carried on, has them."""
    fresh = m.memory[FRESH] == 1.0 or is_short(m, h)
    for j in range(3):
        s = 1.0 if fresh else 1.0 + C[j] * h / m.memory[LAST_STEP]
        for i in range(len(m.y)):
            m.k[Z + j, i] = 0.0 if fresh else carried_on(m, s, i)


@jitable
def project_stage(p: Problem, m: Method, t: float, h: float, j: int) -> None:
    """Put stage j onto the problem's manifold, and leave by how much it moved in m.error.

    On entry m.error is by how much it is to move.
    """
    z = m.k[Z + j]
    for i in range(len(m.y)):
        m.trial[i] = m.y[i] + (z[i] + m.error[i])
    project(p, m, t + C[j] * h, C[j] * h, m.trial)
    for i in range(len(m.y)):
        m.error[i] = (m.trial[i] - m.y[i]) - z[i]
        z[i] += m.error[i]


@jitable
def transform(m: Method) -> None:
    """Write the transformed stages."""
    k = m.k
    for j in range(3):
        for i in range(len(m.y)):
            k[W + j, i] = TI[j, 0] * k[Z, i] + TI[j, 1] * k[Z + 1, i] + TI[j, 2] * k[Z + 2, i]


@jitable
def evaluate_stages(p: Problem, m: Method, t: float, h: float) -> int:
    """Evaluate f at the stages; return a code."""
    for j in range(3):
        for i in range(len(m.y)):
            m.trial[i] = m.y[i] + m.k[Z + j, i]
        m.counts[EVALUATIONS] += 1
        code = call_int(p.rhs, (p.context, t + C[j] * h, C[j] * h, m.trial, m.k[F + j]))
        if code != 0:
            return code
    return 0


@jitable
def unsolved(m: Method, h: float, f: int, i: int) -> float:
    """Return what the last stage's equation leaves of y[i], with f there in row `f`."""
    k = m.k
    slope = SLOPE[0] * k[Z, i] + SLOPE[1] * k[Z + 1, i] + SLOPE[2] * k[Z + 2, i]
    return h * k[f, i] - slope


@jitable
def correct(p: Problem, m: Method, t: float, h: float) -> tuple[int, float]:
    """Correct the stages once; return a code, and the largest correction in the error's norm."""
    k, n = m.k, len(m.y)
    g, re, im = G0 / h, G_RE / h, G_IM / h
    real, pair, d, dd = k[REAL], k[PAIR : PAIR + 2], k[REAL_D], k[PAIR_D : PAIR_D + 2]
    for i in range(n):
        f0, f1, f2 = k[F, i], k[F + 1, i], k[F + 2, i]
        w0, w1, w2 = k[W, i], k[W + 1, i], k[W + 2, i]
        real[i] = TI[0, 0] * f0 + TI[0, 1] * f1 + TI[0, 2] * f2 - g * w0
        pair[0, i] = TI[1, 0] * f0 + TI[1, 1] * f1 + TI[1, 2] * f2 - (re * w1 - im * w2)
        pair[1, i] = TI[2, 0] * f0 + TI[2, 1] * f1 + TI[2, 2] * f2 - (re * w2 + im * w1)
        k[UNSOLVED, i] = unsolved(m, h, F + 2, i)
    for r in (real, pair[0], pair[1]):
        put_along(p, m, t, m.y, r, m.trial)
    code = call_int(p.solve, (p.context, t, h, real, d))
    if code != 0:
        return code, 0.0
    code = call_int(p.solve_pair, (p.context, t, h, pair, dd))
    if code != 0:
        return code, 0.0
    size = 0.0
    for j in range(3):
        for i in range(n):
            m.error[i] = T[j, 0] * d[i] + T[j, 1] * dd[0, i] + T[j, 2] * dd[1, i]
        if call_float(p.norm, (p.context, t, 0.0, m.error, m.y)) < math.inf:
            project_stage(p, m, t, h, j)
        part = call_float(p.norm, (p.context, t, 0.0, m.error, m.y))
        size = max(size, part) if part < math.inf else math.inf
    transform(m)
    return 0, size


@jitable
def linearised_at(m: Method, t: float, h: float) -> float:
    """Return the time at which a step of length h is linearised."""
    return t if m.memory[FRESH] == 1.0 or is_short(m, h) else t + m.memory[WHERE] * h


@jitable
def iterate(p: Problem, m: Method, t: float, h: float, anew: bool) -> int:
    """Solve for the stages by Newton's simplified iteration; return a code, < 0 for no solution.

    It begins where the last step's polynomial has them, `anew` where they are. The second
    correction may be larger than the first, which the extrapolated stages made small: it holds what
    projections undid of the first. The third shows whether the iteration converges.
    """
    begin(m)
    if anew:
        m.memory[REST] = 1.0
    else:
        extrapolate(m, h)
        for j in range(3):
            for i in range(len(m.y)):
                m.error[i] = 0.0
            project_stage(p, m, t, h, j)
        transform(m)
    own = anew or m.memory[JACOBIAN_TIME] == linearised_at(m, t, h)
    before, rate, slowest, word, iteration = 0.0, 0.0, 0.0, GO_ON, 0
    while word == GO_ON:
        iteration += 1
        code = evaluate_stages(p, m, t, h)
        if code != 0:
            return code
        code, size = correct(p, m, t, h)
        if code != 0:
            return code
        word, rate = judge(m, iteration, MOST, size, before, rate, 0.0)
        if iteration == 2:
            slowest = rate
            if word == HOPELESS and size < SECOND * before:
                word, rate = GO_ON, 0.0
        elif word == HOPELESS and own and iteration < MOST and nears_rounding(m, size, before):
            word = GO_ON
        if iteration > 2 and (size < HALF * before or size > LEFT * m.memory[TOL]):
            # else rounding, which is the same at any step
            slowest = max(size / before, slowest if iteration > 3 else 0.0)
        before = size
    m.memory[RATE] = rate
    m.memory[GROWTH] = max(1.0, GOOD_RATE / slowest) if slowest > 0.0 else math.inf
    if word == HOPELESS and own:
        return 0 if is_good_enough(p, m, t, h, before, rate) else -1
    return 0 if word == SOLVED else -1


@jitable
def linearise_within(p: Problem, m: Method, t: float, h: float) -> int:
    """Linearise at the step's begin or, as the last step's polynomial has it, further on.

    What turns or bends in a step is by half as much off in its middle as at its begin.
    """
    ahead = m.memory[WHERE] * h
    if m.memory[FRESH] == 1.0 or ahead == 0.0 or is_short(m, h):
        return linearise(p, m, t, 0.0, m.y, m.k[F])
    s = 1.0 + ahead / m.memory[LAST_STEP]
    for i in range(len(m.y)):
        m.trial[i] = m.y[i] + carried_on(m, s, i)
    project(p, m, t + ahead, ahead, m.trial)
    return linearise(p, m, t + ahead, ahead, m.trial, m.k[F])


@jitable
def is_stale(m: Method, t: float, h: float) -> bool:
    """Return whether there is no linearisation that is good enough to begin a step with.

    One of this step, tried longer, is; one of a step before is where the iteration converged so
    fast with it that it is worth to be tried.
    """
    if m.memory[HAVE_JACOBIAN] == 0.0:
        return True
    at = m.memory[JACOBIAN_TIME]
    within = t < at <= t + h or at == linearised_at(m, t, h)
    return not within and m.memory[RATE] > KEEP


@jitable
def solve_stages(p: Problem, m: Method, t: float, h: float) -> int:
    """Solve for the stages, with an old linearisation if there is one; return a code."""
    stale = is_stale(m, t, h)
    # at most twice: with the old one, then with one of this step
    while True:
        if stale:
            code = linearise_within(p, m, t, h)
            if code != 0:
                return code
        if m.memory[FACTORED_STEP] != h:
            code = factor(p, m, t, h)
            m.memory[RETRY] = HALF
            code = unless_singular(code)
        else:
            code = 0
        if code == 0:
            code = iterate(p, m, t, h, False)
            if code == 0:
                return 0
        if m.memory[JACOBIAN_TIME] == linearised_at(m, t, h) or not may_help(code):
            return as_failure(code)
        stale = True


@jitable
def led(m: Method, i: int, last: int) -> float:
    """Return the mean of f of y[i] over the step, with f at its end in row `last`."""
    return A[2, 0] * m.k[F, i] + A[2, 1] * m.k[F + 1, i] + A[2, 2] * m.k[last, i]


@jitable
def estimate_error(p: Problem, m: Method, t: float, h: float) -> None:
    """Write the filtered error into m.error and, over tol, into memory.

    Stages are where joints and motions have them, so these take out what accelerations do not
    lead to, as a jump of a motion's velocity. The norm sees what is put right last: the velocities
    that f at the stages leads to.
    """
    k, r, w = m.k, m.k[REAL], m.k[PAIR]
    for i in range(len(m.y)):
        r[i] = k[0, i] + (E[0] * k[Z, i] + E[1] * k[Z + 1, i] + E[2] * k[Z + 2, i]) / h
    put_along(p, m, t, m.y, r, m.error)
    error = math.inf
    code = call_int(p.solve, (p.context, t, h, r, m.error))
    if code != 0:
        note_failure(m, code)
    else:
        for i in range(len(m.y)):
            w[i] = m.trial[i]
            if m.kinds[i] == VELOCITY:
                w[i] = m.y[i] + h * led(m, i, F + 2)
        # the last stage, which the trial point is, has been projected
        project(p, m, t + h, h, w)
        error = call_float(p.norm, (p.context, t, h, m.error, m.trial)) / m.memory[TOL]
    m.memory[LAST_ERROR] = error


@jitable
def keep_polynomial(m: Method) -> None:
    """Leave the polynomial through begin, stages and trial point for the next step."""
    k = m.k
    c0, c1 = C[0], C[1]
    for i in range(len(m.y)):
        rise = m.trial[i] - m.y[i]
        first = (k[Z, i] / c0 - rise) / (1.0 - c0)
        second = (k[Z + 1, i] / c1 - rise) / (1.0 - c1)
        bend = (second - first) / (c1 - c0)
        m.ahead[0, i] = rise
        m.ahead[1, i] = first - c0 * bend
        m.ahead[2, i] = bend


@jitable
def is_off(p: Problem, m: Method, t: float, h: float) -> bool:
    """Return whether f at the trial point says that the stages are not solved for after all.

    Corrections of a linearisation in touch are small where nothing is touched any more, however
    large a residual they leave. What is truly stiff leaves one too, but the correction made that
    smaller: only what it did not counts. And so does what joints have across them, of which the
    method's sum over f of all stages has next to nothing: it matters where that sum is off, too.
    """
    most = OFF * m.memory[TOL]
    for i in range(len(m.y)):
        left = unsolved(m, h, LAST, i) if is_rate(m, i) else 0.0
        m.error[i] = left if abs(left) > CONTRACTED * abs(m.k[UNSOLVED, i]) else 0.0
    if call_float(p.norm, (p.context, t, h, m.error, m.trial)) <= most:
        return False
    for i in range(len(m.y)):
        m.error[i] = h * led(m, i, LAST) - m.k[Z + 2, i] if is_rate(m, i) else 0.0
    return not call_float(p.norm, (p.context, t, h, m.error, m.trial)) <= most


@jitable
def arrive(p: Problem, m: Method, t: float, h: float) -> int:
    """Fill trial point, error and, where that is small, f at the trial point; return a code."""
    for i in range(len(m.y)):
        m.trial[i] = m.y[i] + m.k[Z + 2, i]
    estimate_error(p, m, t, h)
    if not m.memory[LAST_ERROR] <= 1.0:
        return 0
    m.counts[EVALUATIONS] += 1
    return call_int(p.rhs, (p.context, t + h, h, m.trial, m.k[LAST]))


@jitable
def solve_anew(p: Problem, m: Method, t: float, h: float) -> int:
    """Solve for the stages, from where they are, linearised at the trial point; return a code."""
    code = linearise(p, m, t + h, h, m.trial, m.k[LAST])
    if code == 0:
        code = factor(p, m, t, h)
        m.memory[RETRY] = HALF
        if code == 0:
            code = iterate(p, m, t, h, True)
            if code == 0:
                return 0
    return as_failure(code)


@jitable
def attempt(p: Problem, m: Method, t: float, h: float) -> int:
    """Solve for the stages, fill trial point and error; return a code.

    What f at the trial point does not agree with is solved again with linearisations there.
    """
    code, anew = solve_stages(p, m, t, h), 0
    while code == 0:
        code = arrive(p, m, t, h)
        if code != 0 or not m.memory[LAST_ERROR] <= 1.0:
            return code
        if anew == MOST_ANEW or (anew > 0 and is_at_rounding(m)) or not is_off(p, m, t, h):
            keep_polynomial(m)
            return 0
        anew += 1
        code = solve_anew(p, m, t, h)
    return code


@jitable
def fit_dense(m: Method) -> None:
    """Fill the polynomial of the step from y to trial."""
    for i in range(len(m.y)):
        m.dense[0, i] = m.y[i]
        for j in range(3):
            m.dense[1 + j, i] = m.ahead[j, i]


def _attempt(context: int, t: float, h: float, a: Pointer, b: Pointer) -> int:
    """One step, tried."""
    p, m = in_workspace(context)
    return with_ease(m, m.counts[JACOBIANS], attempt(p, m, t, h))


def _fit_dense(context: int, t: float, h: float, a: Pointer, b: Pointer) -> int:
    """Dense output of the step tried last."""
    _, m = in_workspace(context)
    fit_dense(m)
    return 0


SCHEME = Scheme(
    _attempt,
    _fit_dense,
    stages=UNSOLVED + 1,
    last=LAST,
    dense=4,
    order=4.0,
    implicit=True,
    carried=3,
    pair=True,
)
