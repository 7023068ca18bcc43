"""Velocity Verlet: one evaluation a step, order 2, for scenes of many bodies.

    v+ = v + h/2 a      x' = x + h v+      q' = q (turn by h w+)
    a' = a(x', v + h a)                    v' = v+ + h/2 a'

Positions see the velocity of the middle, so that an undamped vibration below the stability limit
h w < 2 neither grows nor decays; forces that depend on velocity see the predicted one, which
keeps order 2. There is no error estimate: the step is a part of the problem's own stability
bound (hook `stable`), which falls with the root of the tolerance.
Source: L. Verlet, Phys. Rev. 159 (1967) 98; W. C. Swope et al., J. Chem. Phys. 76 (1982) 637.
"""

from __future__ import annotations

from mbsim.core.address import call_int
from mbsim.core.arrays import Pointer
from mbsim.core.jitable import jitable
from mbsim.core.problem import POSITION, Problem
from mbsim.integrators.positions import retract
from mbsim.integrators.scheme import EVALUATIONS, LAST_ERROR, Method, Scheme, in_workspace, project


@jitable
def attempt(p: Problem, m: Method, t: float, h: float) -> int:
    """Fill f at the new positions and the trial point; return a code."""
    y, f, w, new, kinds = m.y, m.k[0], m.trial, m.k[1], m.kinds
    m.counts[EVALUATIONS] += 1
    for i in range(len(y)):
        # the velocity of the middle
        w[i] = y[i] + 0.5 * h * f[i]
    retract(p, h, y, w)
    for i in range(len(y)):
        if kinds[i] != POSITION:
            w[i] = y[i] + h * f[i]
    code = call_int(p.rhs, (p.context, t + h, h, w, new))
    for i in range(len(y)):
        if kinds[i] != POSITION:
            w[i] = y[i] + 0.5 * h * (f[i] + new[i])
    project(p, m, t + h, h, w)
    m.memory[LAST_ERROR] = 0.0
    return code


@jitable
def fit_dense(p: Problem, m: Method, t: float, h: float) -> int:
    """Fill the cubic Hermite polynomial of the step from y to trial."""
    d, y, w = m.dense, m.y, m.trial
    for i in range(len(y)):
        rise = w[i] - y[i]
        bend = h * m.k[0, i] - rise
        d[0, i] = y[i]
        d[1, i] = rise
        d[2, i] = bend
        d[3, i] = rise - h * m.k[1, i] - bend
    return 0


def _attempt(context: int, t: float, h: float, a: Pointer, b: Pointer) -> int:
    """One step."""
    p, m = in_workspace(context)
    return attempt(p, m, t, h)


def _fit_dense(context: int, t: float, h: float, a: Pointer, b: Pointer) -> int:
    """The step as a polynomial."""
    p, m = in_workspace(context)
    return fit_dense(p, m, t, h)


SCHEME = Scheme(_attempt, _fit_dense, stages=2, last=1, dense=4, order=0.0)
