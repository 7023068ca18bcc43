"""Splines: a value or a derivative, as a jet; see `compile_model.splines` for the pieces.

A spline of one curve does not look at z. Between the curves of a surface, and beyond the first and
the last of them, its value is linear in z.
"""

from __future__ import annotations

from mbsim.arrays.codes import PIECE_BEGIN
from mbsim.arrays.model import Programs
from mbsim.core.arrays import V3
from mbsim.core.jitable import jitable
from mbsim.core.rotation import add, scale, sub
from mbsim.expressions.elementary import chain, constant, times


@jitable
def piece_at(programs: Programs, curve: int, x: float) -> int:
    """Return the piece of a curve that x is in; the last knot belongs to the piece before it."""
    piece, low, high = programs.piece, programs.curve[curve], programs.curve[curve + 1] - 1
    if x <= piece[high, PIECE_BEGIN]:
        high -= 1
    while low < high:
        middle = (low + high + 1) // 2
        # the first piece reaches back from the first knot, where the second one begins
        if piece[middle, PIECE_BEGIN] <= x:
            low = middle
        else:
            high = middle - 1
    return low


@jitable
def derivatives(programs: Programs, curve: int, order: int, x: float) -> V3:
    """Return the derivative of an order of a curve at x, and the two above it."""
    p = programs.piece[piece_at(programs, curve, x)]
    s = x - p[0]
    f1 = p[2] + s * (2.0 * p[3] + s * 3.0 * p[4])
    f2 = 2.0 * p[3] + s * 6.0 * p[4]
    f3 = 6.0 * p[4]
    if order == 0:
        return p[1] + s * (p[2] + s * (p[3] + s * p[4])), f1, f2
    if order == 1:
        return f1, f2, f3
    return f2, f3, 0.0


@jitable
def level_below(programs: Programs, first: int, count: int, z: float) -> int:
    """Return the curve of the last level that is not above z, never the last of them all."""
    curve = first
    while curve < first + count - 2 and programs.level[curve + 1] <= z:
        curve += 1
    return curve


@jitable
def spline(programs: Programs, first: int, count: int, order: int, x: V3, z: V3) -> V3:
    """Return the jet of a spline of `count` curves from `first` on, at the jets x and z."""
    if count == 1:
        f, f1, f2 = derivatives(programs, first, order, x[0])
        return chain(x, f, f1, f2)
    low = level_below(programs, first, count, z[0])
    f, f1, f2 = derivatives(programs, low, order, x[0])
    g, g1, g2 = derivatives(programs, low + 1, order, x[0])
    below, above = chain(x, f, f1, f2), chain(x, g, g1, g2)
    a, b = programs.level[low], programs.level[low + 1]
    share = scale(1.0 / (b - a), sub(z, constant(a)))
    return add(below, times(share, sub(above, below)))


@jitable
def spline_value(
    programs: Programs, first: int, count: int, order: int, x: float, z: float
) -> float:
    """Return the value of a spline at x and z."""
    if count == 1:
        return derivatives(programs, first, order, x)[0]
    low = level_below(programs, first, count, z)
    f = derivatives(programs, low, order, x)[0]
    g = derivatives(programs, low + 1, order, x)[0]
    a, b = programs.level[low], programs.level[low + 1]
    return f + 1.0 / (b - a) * (z - a) * (g - f)
