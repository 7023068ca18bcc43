"""MOREAU: nonsmooth time stepping, of order 1, whose contacts are the problem's own.

The problem does the step (`stepping.step`); here its error is estimated: a step and two halves of
it, compared in positions alone, as velocities jump; and where the whole step is in its middle,
compared with the state between both halves: what meets a second time in one step is seen. The error
of a step is of order 2; across an impact it is of order 1, which a shorter step brings down all the
same. Where the deck fixes the step there is no estimate, and the step is that.

The polynomial is that of a step in which no velocity jumps. One in which some do ends at the first
row within it (memory[HITS], `attempt`), so that rows are states of the motion at either side.
"""

from __future__ import annotations

from mbsim.core.address import call_float, call_int
from mbsim.core.arrays import F1, F2, Pointer
from mbsim.core.jitable import jitable
from mbsim.core.problem import POSITION, VELOCITY, YIELDS, Problem
from mbsim.integrators.scheme import (
    EVALUATIONS,
    HITS,
    LAST_ERROR,
    REACH,
    TOL,
    Method,
    Scheme,
    in_workspace,
    part_of,
    parts,
    project,
)

#: Rows of k: f, the whole step, its own middle, the state between both halves, and from there on
#: the polynomial.
WHOLE, WITHIN, MIDDLE, FITTED = 1, 2, 3, 4
#: Numbers of a body's position, and of its velocity behind that: v, then w in the body's axes.
OF_POSITION, SHIFT, SPIN = 7, 7, 10
#: What a body's way may be off from that of the mean of its velocities, over how far these bend it,
#: where it met nothing. Joints bring bodies back onto their circles behind a step, which is of
#: order 3; where steps follow an error, that of lines within them is in it.
BENT, BENT_BY_JOINTS = 1e-6, 0.1


@jitable
def part_step(p: Problem, m: Method, t: float, h: float, y: F1, out: F1) -> int:
    """Fill `out` by a step from y, whose begin is not the committed point where h < 0.

    Return a code.
    """
    m.counts[EVALUATIONS] += 1
    code = call_int(p.step, (p.context, t, h, y, out))
    if code < 0:
        m.memory[HITS] = 1.0
        code = 0
    if code == 0:
        project(p, m, t + abs(h), abs(h), out)
    return code


@jitable
def bends(y: F1, new: F1, h: float, i: int, part: float) -> bool:
    """Return whether the body whose numbers begin at i met nothing in the step from y to `new`.

    Its way is that of the mean of its velocities then, and bent as they change.
    """
    off, way = 0.0, 0.0
    for c in range(i, i + 3):
        v, u = y[c + SHIFT], new[c + SHIFT]
        off = max(off, abs(new[c] - y[c] - 0.5 * h * (v + u)))
        way = max(way, abs(0.5 * h * (u - v)))
    return off <= part * way


@jitable
def turns(q: F1, i: int) -> tuple[float, float, float, float]:
    """Return q' = 1/2 q (0, w) of the body whose numbers begin at i."""
    a, b, c, d = q[i + 3], q[i + 4], q[i + 5], q[i + 6]
    x, y, z = q[i + SPIN], q[i + SPIN + 1], q[i + SPIN + 2]
    return (
        0.5 * (-b * x - c * y - d * z),
        0.5 * (a * x + c * z - d * y),
        0.5 * (a * y - b * z + d * x),
        0.5 * (a * z + b * y - c * x),
    )


@jitable
def fit_dense(m: Method, h: float, d: F2, bent: float) -> None:
    """Fill the step as straight lines, and positions of bodies that met nothing as parabolas.

    What they may be off by is `bent`, see `bends`.
    """
    for row in range(parts(m)):
        begin, end = part_of(m, row)
        fit_part(m, h, d, (begin, end), bent)


@jitable
def fit_part(m: Method, h: float, d: F2, part: tuple[int, int], bent: float) -> None:
    """Fill it for these numbers, which begin with a whole body's."""
    (begin, end), y, w = part, m.y, m.trial
    for i in range(begin, end):
        d[0, i] = y[i]
        d[1, i] = w[i] - y[i]
        d[2, i] = 0.0
    i = begin
    while i + SPIN + 3 <= end and m.kinds[i] == POSITION:
        if bends(y, w, h, i, bent):
            for c in range(i, i + 3):
                d[2, c] = -0.5 * h * (w[c + SHIFT] - y[c + SHIFT])
            first, last = turns(y, i), turns(w, i)
            for c in range(4):
                d[2, i + 3 + c] = -0.5 * h * (last[c] - first[c])
        i += OF_POSITION
        while i < end and m.kinds[i] == VELOCITY:
            i += 1


@jitable
def attempt(p: Problem, m: Method, t: float, h: float) -> int:
    """Fill the trial point by two halves of a step, and its error by a whole one; return a code."""
    whole, within, middle, d = m.k[WHOLE], m.k[WITHIN], m.k[MIDDLE], m.k[FITTED : FITTED + 3]
    m.memory[HITS] = 0.0
    code = part_step(p, m, t, h, m.y, whole)
    met = m.memory[HITS] == 1.0
    if code == 0 and met:
        code = call_int(p.step, (p.context, 0.5, 0.0, m.y, within))
        if code == 0:
            project(p, m, t + 0.5 * h, 0.5 * h, within)
    if code == 0:
        code = part_step(p, m, t, 0.5 * h, m.y, middle)
    if code == 0:
        code = part_step(p, m, t + 0.5 * h, -0.5 * h, middle, m.trial)
    if code != 0:
        return code
    if not met:
        # rows are those of the polynomial
        fit_dense(m, h, d, BENT)
    for row in range(parts(m)):
        first, last = part_of(m, row)
        for i in range(first, last):
            if not met:
                within[i] = d[0, i] + 0.5 * (d[1, i] + 0.5 * d[2, i])
            m.error[i] = 0.0
            if m.kinds[i] == POSITION:
                end, half = m.trial[i] - whole[i], within[i] - middle[i]
                m.error[i] = end if abs(end) > abs(half) else half
    error = call_float(p.norm, (p.context, t, h, m.error, m.trial))
    m.memory[LAST_ERROR] = error / m.memory[TOL]
    m.memory[REACH] = call_float(p.norm, (p.context, h, YIELDS, m.error, m.trial))
    return 0


def _attempt(context: int, t: float, h: float, a: Pointer, b: Pointer) -> int:
    """One step with its error."""
    p, m = in_workspace(context)
    return attempt(p, m, t, h)


def _attempt_fixed(context: int, t: float, h: float, a: Pointer, b: Pointer) -> int:
    """One step of the length that the deck says."""
    p, m = in_workspace(context)
    m.memory[LAST_ERROR] = m.memory[HITS] = 0.0
    return part_step(p, m, t, h, m.y, m.trial)


def _fit_dense(context: int, t: float, h: float, a: Pointer, b: Pointer) -> int:
    """The step as a polynomial."""
    _, m = in_workspace(context)
    fit_dense(m, h, m.dense, BENT)
    return 0


def _fit_dense_fixed(context: int, t: float, h: float, a: Pointer, b: Pointer) -> int:
    """The step as a polynomial, of the length that the deck says."""
    _, m = in_workspace(context)
    fit_dense(m, h, m.dense, BENT_BY_JOINTS)
    return 0


SCHEME = Scheme(_attempt, _fit_dense, stages=7, last=0, dense=3, order=2.0)
#: Where the deck fixes the step.
FIXED_SCHEME = Scheme(_attempt_fixed, _fit_dense_fixed, stages=1, last=0, dense=3, order=0.0)
