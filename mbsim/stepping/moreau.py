"""MOREAU: nonsmooth time stepping, of order 1, whose contacts are the problem's own.

The problem does the step (`stepping.step`); here its error is estimated: a step and two halves of
it, compared in positions alone, as velocities jump. The error of a step is of order 2; across an
impact it is of order 1, which a shorter step brings down all the same. Where the deck fixes the
step there is no estimate, and the step is that.
"""

from __future__ import annotations

from mbsim.core.address import call_float, call_int
from mbsim.core.arrays import Pointer
from mbsim.core.jitable import jitable
from mbsim.core.problem import POSITION, VELOCITY, Problem
from mbsim.integrators.scheme import (
    EVALUATIONS,
    LAST_ERROR,
    TOL,
    Method,
    Scheme,
    in_workspace,
    project,
)

#: Rows of k: f, the whole step, the state between both halves, which of y bend within the step.
WHOLE, MIDDLE = 1, 2
#: Numbers of a body's position, and of its velocity behind that.
OF_POSITION, SHIFT = 7, 7


@jitable
def one_step(p: Problem, m: Method, t: float, h: float) -> int:
    """Fill the trial point by one step; return a code."""
    m.counts[EVALUATIONS] += 1
    m.memory[LAST_ERROR] = 0.0
    code = call_int(p.step, (p.context, t, h, m.y, m.trial))
    if code == 0:
        project(p, m, t + h, h, m.trial)
    return code


@jitable
def attempt(p: Problem, m: Method, t: float, h: float) -> int:
    """Fill the trial point by two halves of a step, and its error by a whole one; return a code."""
    whole, middle = m.k[WHOLE], m.k[MIDDLE]
    m.counts[EVALUATIONS] += 3
    code = call_int(p.step, (p.context, t, h, m.y, whole))
    if code == 0:
        project(p, m, t + h, h, whole)
        code = call_int(p.step, (p.context, t, 0.5 * h, m.y, middle))
    if code == 0:
        project(p, m, t + 0.5 * h, 0.5 * h, middle)
        code = call_int(p.step, (p.context, t + 0.5 * h, -0.5 * h, middle, m.trial))
    if code != 0:
        return code
    project(p, m, t + h, h, m.trial)
    for i in range(len(m.y)):
        m.error[i] = m.trial[i] - whole[i] if m.kinds[i] == POSITION else 0.0
    error = call_float(p.norm, (p.context, t, h, m.error, m.trial))
    m.memory[LAST_ERROR] = error / m.memory[TOL]
    return 0


@jitable
def fit_dense(m: Method, h: float) -> None:
    """Fill the step as straight lines, of positions that velocities lead to as parabolas.

    A body whose way is that of the mean of its velocities met nothing: its way is bent.
    """
    d, y, w = m.dense, m.y, m.trial
    for i in range(len(y)):
        d[0, i] = y[i]
        d[1, i] = w[i] - y[i]
        d[2, i] = 0.0
    i = 0
    while i + SHIFT + 3 <= len(y) and m.kinds[i] == POSITION:
        off, way = 0.0, 0.0
        for c in range(3):
            rise = 0.5 * h * (y[i + SHIFT + c] + w[i + SHIFT + c])
            off = max(off, abs(w[i + c] - y[i + c] - rise))
            way = max(way, abs(0.5 * h * (w[i + SHIFT + c] - y[i + SHIFT + c])))
        if off <= 1e-6 * way:
            for c in range(3):
                d[2, i + c] = -0.5 * h * (w[i + SHIFT + c] - y[i + SHIFT + c])
        i += OF_POSITION
        while i < len(y) and m.kinds[i] == VELOCITY:
            i += 1


def _attempt(context: int, t: float, h: float, a: Pointer, b: Pointer) -> int:
    """One step with its error."""
    p, m = in_workspace(context)
    return attempt(p, m, t, h)


def _attempt_fixed(context: int, t: float, h: float, a: Pointer, b: Pointer) -> int:
    """One step of the length that the deck says."""
    p, m = in_workspace(context)
    return one_step(p, m, t, h)


def _fit_dense(context: int, t: float, h: float, a: Pointer, b: Pointer) -> int:
    """The step as a polynomial."""
    _, m = in_workspace(context)
    fit_dense(m, h)
    return 0


SCHEME = Scheme(_attempt, _fit_dense, stages=3, last=0, dense=3, order=2.0)
#: Where the deck fixes the step.
FIXED_SCHEME = Scheme(_attempt_fixed, _fit_dense, stages=1, last=0, dense=3, order=0.0)
