"""Cholesky's factor of a sparse symmetric matrix of blocks, in the order of `Pattern`.

Column by column: the block on the diagonal is factored by the caller, those below it are divided by
that, and what a pair of them changes is known beforehand (right-looking; T. Davis, Direct Methods
for Sparse Linear Systems, 2006, chapter 4). A pivot that is infinite leaves its row out.
"""

from __future__ import annotations

import math

from mbsim.arrays.graph import Pattern
from mbsim.core.arrays import F2
from mbsim.core.jitable import jitable
from mbsim.dynamics.constraints.tree import inner, six


@jitable
def clear(P: Pattern) -> None:
    """Let all blocks be zero."""
    for k in range(len(P.block)):
        B = P.block[k]
        for r in range(6):
            for c in range(6):
                B[r, c] = 0.0


@jitable
def multiply_in(P: Pattern, k: int, left: F2, right: F2, m: int, n: int) -> None:
    """Add left right', m and n their rows, to a block."""
    B = P.block[k]
    for c in range(n):
        other = six(right[c])
        for r in range(m):
            B[r, c] += inner(six(left[r]), other)


@jitable
def factor_diagonal(D: F2, m: int) -> None:
    """Replace the lower part of a block by L, D = L L'."""
    for r in range(m):
        for c in range(r + 1):
            total = D[r, c]
            for k in range(c):
                total -= D[r, k] * D[c, k]
            D[r, c] = math.sqrt(total) if r == c else total / D[c, c]


@jitable
def eliminate(P: Pattern, j: int, at: int) -> int:
    """Eliminate column j, whose diagonal is factored; `at`: its first update. Return the next."""
    n, m, D = len(P.size), P.size[j], P.block[j]
    first, end = P.first[j], P.first[j + 1]
    if m == 0:
        return at + (end - first) * (end - first + 1) // 2
    for p in range(first, end):
        B, rows = P.block[n + p], P.size[P.row[p]]
        for c in range(m):
            over = 1.0 / D[c, c]
            for r in range(rows):
                total = B[r, c]
                for k in range(c):
                    total -= B[r, k] * D[c, k]
                B[r, c] = total * over
        for q in range(first, p + 1):
            C, columns, T = P.block[n + q], P.size[P.row[q]], P.block[P.target[at]]
            at += 1
            for s in range(columns):
                other = six(C[s])
                for r in range(rows):
                    T[r, s] -= inner(six(B[r]), other)
    return at


@jitable
def solve_factored(P: Pattern) -> None:
    """Replace the right sides x by the solutions."""
    n = len(P.size)
    for j in range(n):
        m, D, x = P.size[j], P.block[j], P.x[j]
        for r in range(m):
            total = x[r]
            for k in range(r):
                total -= D[r, k] * x[k]
            x[r] = total / D[r, r]
        for p in range(P.first[j], P.first[j + 1]):
            i, B = P.row[p], P.block[n + p]
            for r in range(P.size[i]):
                for c in range(m):
                    P.x[i, r] -= B[r, c] * x[c]
    for j in range(n - 1, -1, -1):
        m, D, x = P.size[j], P.block[j], P.x[j]
        for p in range(P.first[j], P.first[j + 1]):
            i, B = P.row[p], P.block[n + p]
            for r in range(P.size[i]):
                for c in range(m):
                    x[c] -= B[r, c] * P.x[i, r]
        for r in range(m - 1, -1, -1):
            total = x[r]
            for k in range(r + 1, m):
                total -= D[k, r] * x[k]
            x[r] = total / D[r, r]
