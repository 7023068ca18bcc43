"""Heun's method: explicit, order 2, with the error of Euler's.

    w = y + h f(y)      y' = y + h/2 (f(y) + f(w))      error = h/2 (f(w) - f(y))

Template of an integrator: copy it into mbsim/integrators/ under the method's name in lower case,
here heun.py, and give it a line in `integrators/catalog.py`. `integrators.scheme` says what the two
functions have to fill. Source: K. Heun, Z. Math. Phys. 45 (1900) 23-38.
"""

from __future__ import annotations

from mbsim.core.address import call_float, call_int
from mbsim.core.arrays import Pointer
from mbsim.core.jitable import jitable
from mbsim.core.problem import Problem
from mbsim.integrators.scheme import (
    EVALUATIONS,
    LAST_ERROR,
    TOL,
    Method,
    Scheme,
    in_workspace,
    project,
)


@jitable
def attempt(p: Problem, m: Method, t: float, h: float) -> int:
    """Fill stages, trial point and error; return a code."""
    y, k, w = m.y, m.k, m.trial
    m.counts[EVALUATIONS] += 2
    for i in range(len(y)):
        w[i] = y[i] + h * k[0, i]
    code = call_int(p.rhs, (p.context, t + h, h, w, k[1]))
    if code != 0:
        return code
    for i in range(len(y)):
        w[i] = y[i] + 0.5 * h * (k[0, i] + k[1, i])
        m.error[i] = 0.5 * h * (k[1, i] - k[0, i])
    project(p, m, t + h, h, w)
    m.memory[LAST_ERROR] = call_float(p.norm, (p.context, t, h, m.error, w)) / m.memory[TOL]
    # the last stage is the first of the next step
    return call_int(p.rhs, (p.context, t + h, h, w, k[2]))


@jitable
def fit_dense(m: Method, h: float) -> None:
    """Fill the cubic Hermite polynomial of the step from y to trial."""
    for i in range(len(m.y)):
        rise = m.trial[i] - m.y[i]
        bend = h * m.k[0, i] - rise
        m.dense[0, i] = m.y[i]
        m.dense[1, i] = rise
        m.dense[2, i] = bend
        m.dense[3, i] = rise - h * m.k[2, i] - bend


def _attempt(context: int, t: float, h: float, a: Pointer, b: Pointer) -> int:
    """One step, tried."""
    p, m = in_workspace(context)
    return attempt(p, m, t, h)


def _fit_dense(context: int, t: float, h: float, a: Pointer, b: Pointer) -> int:
    """The step as a polynomial."""
    _, m = in_workspace(context)
    fit_dense(m, h)
    return 0


# error = h^2/2 y'': order 2
SCHEME = Scheme(_attempt, _fit_dense, stages=3, last=2, dense=4, order=2.0)
