"""Matrices of 6 x 6 among the constants of a force, by rows."""

from __future__ import annotations

from collections.abc import Sequence

from mbsim.core.arrays import V3
from mbsim.core.jitable import jitable
from mbsim.core.rotation import add, scale


@jitable
def times(par: Sequence[float], first: int, a: V3, b: V3) -> tuple[V3, V3]:
    """Return the two halves of the 6 x 6 matrix from `first` on times (a, b)."""
    out = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    for k in range(3):
        at = first + k
        by_a = (par[at], par[at + 6], par[at + 12]), (par[at + 18], par[at + 24], par[at + 30])
        at += 3
        by_b = (par[at], par[at + 6], par[at + 12]), (par[at + 18], par[at + 24], par[at + 30])
        upper = add(scale(a[k], by_a[0]), scale(b[k], by_b[0]))
        lower = add(scale(a[k], by_a[1]), scale(b[k], by_b[1]))
        out = add(out[0], upper), add(out[1], lower)
    return out
