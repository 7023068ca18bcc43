"""Generalised-alpha on the bodies' Lie group: implicit, order 2, for stiff contact and mechanisms.

With a the algorithmic acceleration, an unknown of its own beside the true one, v':

    (1 - am) a1 + am a0 = (1 - af) v1' + af v0',   v1' = f(t1, x1, v1)
    x1 = x0 + h v0 + h^2 ((1/2 - beta) a0 + beta a1)
    v1 = v0 + h ((1 - gamma) a0 + gamma a1)

Turns are the exponential of the same mean angular velocity in body axes; states of first order
take the last line, with rates for accelerations. `a` is the acceleration at t + (am - af) h: so it
is begun at the start and after events, and moved where the step changes; with that, positions,
velocities and accelerations are of order 2 from the start. What is fast keeps RHO of itself a
step. Iterates are projected onto positions and velocities that joints allow, as in a stabilised
formulation of index 2: corrections are along joints, and what a has across them is what keeps
velocities on them. Their forces come from f.

The error of a step in positions is that of the formulas, the second derivative of the velocity
times h^3 and a constant. In velocities it is by how much they are off the trapezoidal rule over v'
at begin and end, and the error of that rule, h^3 v''' / 12: so it holds as well where a does not
follow v', behind a force that jumped. There a short step after a long one meets a v'' that nothing
extrapolated, and the difference counts in full, not as a part of the long step.
Source: J. Chung, G. M. Hulbert, J. Appl. Mech. 60 (1993) 371; M. Arnold, O. Bruls, Multibody
Syst. Dyn. 18 (2007) 185; O. Bruls, A. Cardona, M. Arnold, Mech. Mach. Theory 48 (2012) 121;
damping of Newton's iteration: P. Deuflhard, Newton Methods for Nonlinear Problems (2004), 3.3.
"""

from __future__ import annotations

import math

from mbsim.core.address import call_float, call_int
from mbsim.core.arrays import F1, Pointer
from mbsim.core.jitable import jitable
from mbsim.core.problem import FRICTION_ALONE, IMPACTS_ALONE, POSITION, VELOCITY, Problem
from mbsim.integrators.galpha_iteration import (
    A0,
    A1,
    A_BEFORE,
    ALGORITHMIC,
    BETA,
    DOT,
    GAMMA,
    LAST,
    SHIFT,
    SLOPE,
    D,
    F,
    R,
    solve_step,
    step_before,
    true_rate,
)
from mbsim.integrators.newton import QUARTER, as_failure, linearise, unless_singular, with_ease
from mbsim.integrators.positions import as_positions, bow, is_rate, put_along, retract
from mbsim.integrators.scheme import (
    EVALUATIONS,
    FACTORED_STEP,
    FACTORIZATIONS,
    FRESH,
    GROWTH,
    HAVE_JACOBIAN,
    HELD,
    JACOBIANS,
    LAST_ERROR,
    RETRY,
    TOL,
    Method,
    Scheme,
    factor_real,
    in_workspace,
    project,
)

#: Error of a step in x over h^3 v'', and of the trapezoidal rule in v over h^3 v'''.
ERROR_X = BETA + 0.5 * SHIFT - 1.0 / 6.0
TRAPEZOID = 1.0 / 12.0

#: A step's error is held to this part of tol, for steps of order 2 are many and their errors of
#: one sign: they add up.
PART = 0.2
#: A step's error may change friction by this part of the normal force. What is fast fades slowly,
#: so friction that saturates on the wrong side would chatter.
ROUGH = 1e-3

#: And by so many times tol of what a speed changes by in an impact: its steps are the more the
#: smaller tol is, and the impact as a whole is to be off by some tol.
OF_IMPACT = 6.0
#: The change of v' at the start is taken over this part of the first step.
PROBE = 0.05


@jitable
def carry_on(p: Problem, m: Method, s: float) -> None:
    """Move m.trial on for a time s with its velocities as they are; A_BEFORE keeps where it was."""
    w, before = m.trial, m.k[A_BEFORE]
    for i in range(len(w)):
        before[i] = w[i]
    retract(p, s, before, w)


@jitable
def probe_on(p: Problem, m: Method, t: float, h: float, s: float, ahead: float, gain: F1) -> int:
    """Take m.trial to t + ahead by a linearly implicit Euler step of length s; return a code.

    It is linearised about where velocities carry the bodies, put on their joints: so motions are
    followed, of which corrections along joints know nothing. `gain` is what y gains.
    """
    n = len(m.y)
    carry_on(p, m, s)
    project(p, m, t + ahead, ahead, m.trial)
    m.counts[EVALUATIONS] += 1
    code = call_int(p.rhs, (p.context, t + ahead, ahead, m.trial, m.k[F]))
    if code != 0:
        return code
    for i in range(n):
        m.k[R, i] = m.k[F, i] - (m.trial[i] - m.k[A_BEFORE, i]) / s
    put_along(p, m, t + ahead, m.trial, m.k[R], m.error)
    code = call_int(p.solve, (p.context, t, h, m.k[R], gain))
    if code != 0:
        return code
    for i in range(n):
        m.trial[i] += gain[i]
    project(p, m, t + ahead, ahead, m.trial)
    for i in range(n):
        gain[i] = m.trial[i] - m.k[A_BEFORE, i]
    return 0


@jitable
def probe(p: Problem, m: Method, t: float, h: float) -> int:
    """Begin `kept` with v' and v'' at the committed point; return a code, < 0 for no solution.

    v'' is from two linearly implicit Euler steps: it is that of the motion, not of what is fast.
    Each is projected, for only that knows how motions go on.
    """
    n = len(m.y)
    s = PROBE * h
    if m.memory[HAVE_JACOBIAN] == 0.0:
        code = linearise(p, m, t, 0.0, m.y, m.k[F])
        if code != 0:
            return code
    m.memory[FACTORED_STEP] = 0.0
    m.counts[FACTORIZATIONS] += 1
    g = 1.0 / s
    code = factor_real(p, m, t, h, (g, g * g, g), 0.0)
    if code != 0:
        return unless_singular(code)
    for i in range(n):
        m.trial[i] = m.y[i]
    for j in range(2):
        code = probe_on(p, m, t, h, s, (j + 1.0) * s, m.k[D + j])
        if code != 0:
            return code
    for i in range(n):
        m.kept[ALGORITHMIC, i] = m.k[0, i]
        m.kept[DOT, i] = m.k[0, i]
        m.kept[SLOPE, i] = (m.k[D + 1, i] - m.k[D, i]) / (s * s)
    return 0


@jitable
def position_error(m: Method, h: float, i: int) -> float:
    """Return the error of a step in what y[i] is the velocity of."""
    return ERROR_X * h * h * (m.k[A1, i] - m.k[A0, i])


@jitable
def velocity_error(m: Method, h: float, i: int, dot: float, bend: float) -> float:
    """Return the error of a step in the velocity y[i], with v' at its end and h^2 v'''.

    Both parts have one sign: of friction that turns from step to step they would cancel.
    """
    mean = (1.0 - GAMMA) * m.k[A0, i] + GAMMA * m.k[A1, i]
    off = abs(mean - 0.5 * (m.kept[DOT, i] + dot))
    return h * (TRAPEZOID * bend + math.copysign(off, bend))


@jitable
def estimate_error(p: Problem, m: Method, t: float, h: float) -> float:
    """Write the step's error, and what the next needs to know; return its norm over tol."""
    e, w, shift, before = m.error, m.trial, m.k[D], step_before(m)
    # a uniform turn is exact at the end, but not between
    bow(p, h, w, shift)
    for i in range(len(m.y)):
        if is_rate(m, i):
            dot = true_rate(m, i)
            slope = (dot - m.kept[DOT, i]) / h
            bend = h * max(1.0, 2.0 * h / (h + before)) * (slope - m.kept[SLOPE, i])
            m.ahead[ALGORITHMIC, i] = m.k[A1, i]
            m.ahead[DOT, i] = dot
            m.ahead[SLOPE, i] = slope
            e[i] = velocity_error(m, h, i, dot, bend)
        if m.kinds[i] == VELOCITY:
            off = position_error(m, h, i)
            shift[i] = off + math.copysign(PART * shift[i], off)
    as_positions(p, w, shift)
    for i in range(len(m.y)):
        if m.kinds[i] == POSITION:
            e[i] = shift[i]
    most = min(PART * m.memory[TOL], m.memory[HELD])
    error = call_float(p.norm, (p.context, t, h, e, w)) / most
    rough = call_float(p.norm, (p.context, t, FRICTION_ALONE, e, w)) / ROUGH
    lost = call_float(p.norm, (p.context, h, IMPACTS_ALONE, e, w)) / (OF_IMPACT * m.memory[TOL])
    return max(error, max(rough, lost))


@jitable
def attempt(p: Problem, m: Method, t: float, h: float) -> int:
    """Solve for the new point, fill trial point and error; return a code."""
    if m.memory[FRESH] == 1.0:
        m.memory[RETRY] = QUARTER
        code = probe(p, m, t, h)
        if code != 0:
            return as_failure(code)
    m.memory[GROWTH] = math.inf
    code = with_ease(m, m.counts[JACOBIANS], solve_step(p, m, t, h))
    if code != 0:
        return code
    m.memory[LAST_ERROR] = estimate_error(p, m, t, h)
    return 0


@jitable
def fit_dense(m: Method, h: float) -> None:
    """Fill the cubic Hermite polynomial of the step from y to trial."""
    d = m.dense
    for i in range(len(m.y)):
        rate = is_rate(m, i)
        first = m.kept[DOT, i] if rate else m.k[0, i]
        last = m.ahead[DOT, i] if rate else m.k[LAST, i]
        rise = m.trial[i] - m.y[i]
        d[0, i] = m.y[i]
        d[1, i] = rise
        d[2, i] = h * first - rise
        d[3, i] = 2.0 * rise - h * (first + last)


def _attempt(context: int, t: float, h: float, a: Pointer, b: Pointer) -> int:
    """One step, tried."""
    p, m = in_workspace(context)
    return attempt(p, m, t, h)


def _fit_dense(context: int, t: float, h: float, a: Pointer, b: Pointer) -> int:
    """Dense output of the step tried last."""
    _, m = in_workspace(context)
    fit_dense(m, h)
    return 0


SCHEME = Scheme(
    _attempt,
    _fit_dense,
    stages=LAST + 1,
    last=LAST,
    dense=4,
    order=3.0,
    implicit=True,
    carried=3,
    samples=4,
    # what is left changes friction as well, of which the error may change no more at any tol: it
    # fades slowly, and at a loose tol steps would follow it for good
    judged=ROUGH,
    # what it damps of a fast vibration is by steps of one length: a long one after a shorter one
    # feeds it
    resumes=0.03,
)
