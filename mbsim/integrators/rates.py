"""The largest rate of f about a point, by a power iteration on differences of f.

The stages of one step tell of the rates that the motion excites: on a motion that friction or a
stiff contact holds there is nothing of the fast ones, and every explicit step looks good until what
it amplifies shows. Here all rates are excited alike, by less than what is within the tolerance.
Source: B. P. Sommeijer, L. F. Shampine, J. G. Verwer, J. Comput. Appl. Math. 88 (1998) 315.
"""

from __future__ import annotations

import math

from mbsim.core.address import call_float, call_int
from mbsim.core.jitable import jitable
from mbsim.core.problem import EACH, POSITION, RATES, Problem
from mbsim.core.signature import FLOAT, INT
from mbsim.integrators.scheme import (
    EVALUATIONS,
    OWN_TIME,
    TOL,
    Method,
    failure_or,
    in_workspace,
    project,
)
from mbsim.integrators.stability import DIFFERENCES, rate_of

#: Of `serve`: context, time.
ASKED = FLOAT(INT, FLOAT)
#: How far the state is moved, of the tolerance, and at least: far above rounding.
MOVED, LEAST = 1e-2, 1e-9
#: How often; the last two count, for a vibration may be in its middle at one of them.
TIMES, COUNT = 5, 2
#: Parts of the golden section: a direction that is along no mode.
SECTION = 0.6180339887498949

# rows of k: f at the moved point, by how much that was moved, f where it was moved from
THERE, SHIFT, HERE = 1, 2, 3


@jitable
def scaled_to(p: Problem, m: Method, t: float, size: float) -> bool:
    """Scale the shift to this size in the norm of the error; return whether there is one."""
    shift = m.k[SHIFT]
    for i in range(len(m.y)):
        m.error[i] = shift[i]
    now = call_float(p.norm, (p.context, t, 0.0, m.error, m.y))
    if not 0.0 < now < math.inf:
        return False
    for i in range(len(m.y)):
        shift[i] *= size / now
    return True


@jitable
def moved_rate(p: Problem, m: Method, t: float) -> float:
    """Return the rate that f shows between the point and where the shift leads, < 0 for none.

    The shift becomes by how much f differs.
    """
    k, n = m.k, len(m.y)
    for i in range(n):
        m.trial[i] = m.y[i] + k[SHIFT, i]
    # along what joints allow
    project(p, m, t, 0.0, m.trial)
    m.counts[EVALUATIONS] += 1
    code = failure_or(m, call_int(p.rhs, (p.context, t, 0.0, m.trial, k[THERE])))
    if code != 0:
        return -1.0
    size = k[DIFFERENCES:]
    for j in range(RATES):
        for i in range(n):
            size[j, i] = 0.0
    for i in range(n):
        k[SHIFT, i] = k[THERE, i] - k[HERE, i]
        is_rate = m.kinds[i] != POSITION
        size[1 if is_rate else 0, i] = m.trial[i] - m.y[i]
        if is_rate:
            size[2, i] = k[SHIFT, i]
    call_float(p.norm, (p.context, t, EACH, size[0], m.y))
    return rate_of(m.memory[OWN_TIME] * size[0, 0], size[1, 0], size[2, 0])


@jitable
def largest_rate(p: Problem, m: Method, t: float) -> float:
    """Return about the largest rate of f at the committed point, 0.6 to 1 of it; inf for unknown.

    All rows of k but the first are scratch.
    """
    k = m.k
    m.counts[EVALUATIONS] += 1
    code = failure_or(m, call_int(p.rhs, (p.context, t, 0.0, m.y, k[HERE])))
    if code != 0:
        return math.inf
    for i in range(len(m.y)):
        part = (i + 1) * SECTION
        k[SHIFT, i] = part - math.floor(part) - 0.5 if m.kinds[i] != POSITION else 0.0
    size, rate = max(MOVED * m.memory[TOL], LEAST), 0.0
    for j in range(TIMES):
        if not scaled_to(p, m, t, size):
            # f is the same everywhere, or not finite
            return rate
        found = moved_rate(p, m, t)
        if found < 0.0:
            return math.inf
        if j >= TIMES - COUNT:
            rate = max(rate, found)
    return rate


def serve(context: int, t: float) -> float:
    """The largest rate about the committed point, behind an address: most runs never ask."""
    p, m = in_workspace(context)
    return largest_rate(p, m, t)
