"""Matrices of six rows among the constants of a force, by rows."""

from __future__ import annotations

from collections.abc import Sequence

from mbsim.core.arrays import V3
from mbsim.core.jitable import jitable
from mbsim.core.rotation import add, scale


@jitable
def column(par: Sequence[float], at: int, width: int) -> tuple[V3, V3]:
    """Return the two halves of a column of six numbers from `at` on, each `width` further."""
    low = at + 3 * width
    upper = par[at], par[at + width], par[at + 2 * width]
    return upper, (par[low], par[low + width], par[low + 2 * width])


@jitable
def times(par: Sequence[float], first: int, a: V3, b: V3, width: int = 6) -> tuple[V3, V3]:
    """Return the two halves of six columns from `first` on times (a, b); rows are `width` long."""
    out = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    for k in range(3):
        by_a, by_b = column(par, first + k, width), column(par, first + k + 3, width)
        upper = add(scale(a[k], by_a[0]), scale(b[k], by_b[0]))
        lower = add(scale(a[k], by_a[1]), scale(b[k], by_b[1]))
        out = add(out[0], upper), add(out[1], lower)
    return out
