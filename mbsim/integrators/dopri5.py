"""Explicit Runge-Kutta of order 5 with an error of order 4 and dense output of order 4.

Source: J. R. Dormand, P. J. Prince, J. Comput. Appl. Math. 6 (1980) 19; dense output and
driver after E. Hairer, S. P. Norsett, G. Wanner, Solving ODEs I (1993), section II.5-6.
The seventh stage is the first of the next step; it is taken at the projected point, so
that stays true with constraints.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from mbsim.core.address import call_float
from mbsim.core.arrays import F1, F2, I1
from mbsim.core.jitable import jitable
from mbsim.core.problem import (
    AT_ONCE,
    BY_CHECK,
    BY_ERROR,
    BY_NOT_FINITE,
    DONE,
    FAILED,
    NOT_FINITE,
    PAUSED,
    ROWS_FULL,
    STEP_TOO_SMALL,
)
from mbsim.integrators.control import next_factor, quantised, smallest_step, starting_step

ORDER = 5
STAGES = 7
#: A hook that fails is tried again at a tenth of the step, so many times.
MOST_FAILURES = 8

C2, C3, C4, C5 = 1 / 5, 3 / 10, 4 / 5, 8 / 9
A21 = 1 / 5
A31, A32 = 3 / 40, 9 / 40
A41, A42, A43 = 44 / 45, -56 / 15, 32 / 9
A51, A52, A53, A54 = 19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729
A61, A62, A63, A64, A65 = 9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656
B1, B3, B4, B5, B6 = 35 / 384, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84
# fifth minus fourth order weights
E1, E3, E4, E5, E6, E7 = (
    71 / 57600,
    -71 / 16695,
    71 / 1920,
    -17253 / 339200,
    22 / 525,
    -1 / 40,
)
D1, D3, D4 = -12715105075 / 11282082432, 87487479700 / 32700410799, -10690763975 / 1880347072
D5, D6, D7 = 701980252875 / 199316789632, -1453857185 / 822651844, 69997945 / 29380423


class Method(NamedTuple):
    """What the method keeps; `memory` is saved with the state, the rest is scratch."""

    y: F1  # (n,) the committed point
    k: F2  # (7, n) stages; row 0 is f at the committed point
    trial: F1  # (n,)
    error: F1  # (n,)
    dense: F2  # (5, n) polynomial of the last accepted step
    memory: F1  # (10,) see the names below
    counts: I1  # (8,) see the names below


# memory
TIME, STEP, ERROR_BEFORE, HAVE_F, H_SMALLEST, LAST_ERROR, H_LARGEST = range(7)
LAST_TIME, LAST_STEP, FIRST_MAX = range(7, 10)
# counts
STEPS, REJECTED, EVALUATIONS, NEXT_OUTPUT, LAST_REASON, CODE, OUTPUTS = range(7)


def make(y0: np.ndarray, t0: float) -> Method:
    """Return the method at rest at (t0, y0)."""
    n = len(y0)
    memory = np.zeros(10)
    memory[TIME] = t0
    memory[ERROR_BEFORE] = 1.0
    memory[H_SMALLEST] = math.inf
    return Method(
        np.array(y0, dtype=np.float64),
        np.zeros((STAGES, n)),
        np.zeros(n),
        np.zeros(n),
        np.zeros((5, n)),
        memory,
        np.zeros(8, dtype=np.int64),
    )


@jitable
def stages(p, m, t, h):
    """Fill stages 2..7, trial point and error estimate; return a code.

    The trial point is projected before stage 7, which makes it the next step's stage 1.
    """
    y, k, w = m.y, m.k, m.trial
    n = len(y)
    m.counts[EVALUATIONS] += 6
    for i in range(n):
        w[i] = y[i] + h * (A21 * k[0, i])
    code = call_float(p.rhs, (p.context, t + C2 * h, C2 * h, w, k[1]))
    if code != 0.0:
        return code
    for i in range(n):
        w[i] = y[i] + h * (A31 * k[0, i] + A32 * k[1, i])
    code = call_float(p.rhs, (p.context, t + C3 * h, C3 * h, w, k[2]))
    if code != 0.0:
        return code
    for i in range(n):
        w[i] = y[i] + h * (A41 * k[0, i] + A42 * k[1, i] + A43 * k[2, i])
    code = call_float(p.rhs, (p.context, t + C4 * h, C4 * h, w, k[3]))
    if code != 0.0:
        return code
    for i in range(n):
        w[i] = y[i] + h * (A51 * k[0, i] + A52 * k[1, i] + A53 * k[2, i] + A54 * k[3, i])
    code = call_float(p.rhs, (p.context, t + C5 * h, C5 * h, w, k[4]))
    if code != 0.0:
        return code
    for i in range(n):
        w[i] = y[i] + h * (
            A61 * k[0, i] + A62 * k[1, i] + A63 * k[2, i] + A64 * k[3, i] + A65 * k[4, i]
        )
    code = call_float(p.rhs, (p.context, t + h, h, w, k[5]))
    if code != 0.0:
        return code
    for i in range(n):
        w[i] = y[i] + h * (B1 * k[0, i] + B3 * k[2, i] + B4 * k[3, i] + B5 * k[4, i] + B6 * k[5, i])
    call_float(p.project, (p.context, t + h, h, w, w))
    code = call_float(p.rhs, (p.context, t + h, h, w, k[6]))
    for i in range(n):
        m.error[i] = h * (
            E1 * k[0, i] + E3 * k[2, i] + E4 * k[3, i] + E5 * k[4, i] + E6 * k[5, i] + E7 * k[6, i]
        )
    return code


@jitable
def fit_dense(m, h):
    """Fill the polynomial of the step from y to trial."""
    k, d = m.k, m.dense
    for i in range(len(m.y)):
        rise = m.trial[i] - m.y[i]
        bend = h * k[0, i] - rise
        d[0, i] = m.y[i]
        d[1, i] = rise
        d[2, i] = bend
        d[3, i] = rise - h * k[6, i] - bend
        d[4, i] = h * (
            D1 * k[0, i] + D3 * k[2, i] + D4 * k[3, i] + D5 * k[4, i] + D6 * k[5, i] + D7 * k[6, i]
        )


@jitable
def interpolate(m, s, out):
    """Write the state at the part s (0..1) of the last step into `out`."""
    d, r = m.dense, 1.0 - s
    for i in range(len(out)):
        out[i] = d[0, i] + s * (d[1, i] + r * (d[2, i] + s * (d[3, i] + r * d[4, i])))


@jitable
def first_step(p, m, t, span, tol):
    """Return a first step from f and a small explicit Euler probe."""
    n = len(m.y)
    rate = call_float(p.norm, (p.context, t, 0.0, m.k[0], m.y))
    probe = 1e-4 / rate if rate > 1e-4 / span else span
    probe = min(probe, 1e-3 * span)
    for i in range(n):
        m.trial[i] = m.y[i] + probe * m.k[0, i]
    m.counts[EVALUATIONS] += 1
    code = call_float(p.rhs, (p.context, t + probe, probe, m.trial, m.k[1]))
    curvature = 0.0
    if code == 0.0:
        for i in range(n):
            m.error[i] = (m.k[1, i] - m.k[0, i]) / probe
        curvature = call_float(p.norm, (p.context, t, 0.0, m.error, m.y))
    return starting_step(rate, curvature, tol, ORDER, span)


@jitable
def outputs(p, m, times):
    """Write a row for every output time within the last step; return 0 or what stopped it."""
    t, h = m.memory[LAST_TIME], m.memory[LAST_STEP]
    t_new = m.memory[TIME]
    while m.counts[NEXT_OUTPUT] < len(times):
        when = times[m.counts[NEXT_OUTPUT]]
        if when > t_new:
            return 0.0
        interpolate(m, min(1.0, (when - t) / h), m.trial)
        call_float(p.project, (p.context, when, 0.0, m.trial, m.trial))
        m.counts[OUTPUTS] += 1
        m.counts[NEXT_OUTPUT] += 1
        code = call_float(p.output, (p.context, when, 0.0, m.trial, m.error))
        if code != 0.0:
            return code
    return 0.0


@jitable
def reject(p, m, t, reason):
    """Count a rejected step and tell the problem."""
    m.counts[REJECTED] += 1
    m.counts[LAST_REASON] = reason
    call_float(p.reject, (p.context, t, float(reason), m.y, m.error))


@jitable
def accept(p, m, t, h):
    """Take the trial point; return the problem's word on it, or a negative code."""
    fit_dense(m, h)
    asked = call_float(p.inner, (p.context, t, h, m.y, m.error))
    word = call_float(p.commit, (p.context, t + h, h, m.trial, m.k[6]))
    for i in range(len(m.y)):
        m.y[i] = m.trial[i]
        m.k[0, i] = m.k[6, i]
    m.memory[LAST_TIME], m.memory[LAST_STEP] = t, h
    m.memory[TIME] = t + h
    m.counts[STEPS] += 1
    if asked >= 0.0:
        # the force of a damped contact peaks before its depth does
        for part in (asked, 0.8 * asked, 0.5 * asked):
            interpolate(m, part, m.trial)
            call_float(p.project, (p.context, t + part * h, 0.0, m.trial, m.trial))
            m.counts[OUTPUTS] += 1
            code = call_float(p.look, (p.context, t + part * h, part * h, m.trial, m.error))
            if code != 0.0:
                return -code
    return word


@jitable
def begin(p, m, t, t_end, tol):
    """Evaluate f at the committed point and choose a first step where there is none."""
    if m.memory[HAVE_F] == 0.0:
        m.counts[EVALUATIONS] += 1
        code = call_float(p.rhs, (p.context, t, 0.0, m.y, m.k[0]))
        if code != 0.0:
            return code
        m.memory[HAVE_F] = 1.0
    if m.memory[STEP] == 0.0:
        m.memory[STEP] = first_step(p, m, t, t_end - t, tol)
        if m.memory[FIRST_MAX] > 0.0:
            m.memory[STEP] = min(m.memory[STEP], m.memory[FIRST_MAX])
    return 0.0


def advance(p, m, t_end, tol, h_max, h_min, times, budget):
    """Advance to t_end, to full rows, or for about `budget` evaluations; return why it stopped.

    `times` are the output times, ascending; `m.counts[NEXT_OUTPUT]` is the next of them.
    """
    code = begin(p, m, m.memory[TIME], t_end, tol)
    if code != 0.0:
        m.counts[CODE] = int(code)
        return FAILED
    # rows of the last step that found the table full
    if m.memory[LAST_STEP] > 0.0:
        full = outputs(p, m, times)
        if full != 0.0:
            m.counts[CODE] = int(-full)
            return ROWS_FULL if full > 0.0 else FAILED
    stop_at = m.counts[EVALUATIONS] + budget
    rejected = False
    failures = 0
    while m.memory[TIME] < t_end:
        if m.counts[EVALUATIONS] >= stop_at:
            return PAUSED
        t = m.memory[TIME]
        floor = smallest_step(t, t_end, h_min)
        h = min(m.memory[STEP], h_max)
        h = min(h, call_float(p.limit, (p.context, t, h, m.y, m.k[0])))
        h = max(quantised(h), floor)
        # no sliver of a step before the end
        if t + 1.01 * h >= t_end:
            h = t_end - t

        # try
        code = stages(p, m, t, h)
        if code != 0.0:
            # a trial far ahead may be where no law was meant for: come nearer before giving up
            failures += 1
            if code != NOT_FINITE and (failures > MOST_FAILURES or h <= floor or code >= AT_ONCE):
                m.counts[CODE] = int(code)
                return FAILED
            reject(p, m, t, BY_NOT_FINITE)
            m.memory[STEP] = max(0.1 * h, floor)
            rejected = True
            if h <= floor:
                return STEP_TOO_SMALL
            continue
        failures = 0
        error = call_float(p.norm, (p.context, t, h, m.error, m.trial)) / tol
        m.memory[LAST_ERROR] = error
        if not error <= 1.0:
            reject(p, m, t, BY_ERROR)
            finite = math.isfinite(error)
            m.memory[STEP] = h * (next_factor(error, 1.0, ORDER, True) if finite else 0.2)
            rejected = True
            if h <= floor:
                return STEP_TOO_SMALL
            m.memory[STEP] = max(m.memory[STEP], floor)
            continue
        part = call_float(p.check, (p.context, t + h, h, m.trial, m.k[6]))
        if part < 1.0:
            reject(p, m, t, BY_CHECK)
            if h <= floor:
                return STEP_TOO_SMALL
            m.memory[STEP] = max(part * h, floor)
            continue

        # take
        factor = next_factor(error, m.memory[ERROR_BEFORE], ORDER, False)
        m.memory[STEP] = h * (min(factor, 1.0) if rejected else factor)
        m.memory[ERROR_BEFORE] = max(error, 1e-4)
        m.memory[H_SMALLEST] = min(m.memory[H_SMALLEST], h)
        m.memory[H_LARGEST] = max(m.memory[H_LARGEST], h)
        rejected = False
        word = accept(p, m, t, h)
        if t + h >= t_end:
            m.memory[TIME] = t_end
        if word < 0.0:
            m.counts[CODE] = int(-word)
            return FAILED
        full = outputs(p, m, times)
        if full < 0.0:
            m.counts[CODE] = int(-full)
            return FAILED
        if word == 1.0 or word == 3.0:
            m.counts[EVALUATIONS] += 1
            code = call_float(p.rhs, (p.context, t + h, 0.0, m.y, m.k[0]))
            if code != 0.0:
                m.counts[CODE] = int(code)
                return FAILED
        if full > 0.0 or word >= 2.0:
            return ROWS_FULL
    return DONE
