"""LU factors of a sparse block matrix, front by front, and solving with them.

A front is a dense matrix of the unknowns that one step of elimination touches; what is left of it
after its own unknowns are eliminated is added to its parent's (Duff and Reid, The multifrontal
solution of unsymmetric sets of linear equations, SIAM J. Sci. Stat. Comput. 5, 1984). Rows are
exchanged only among a front's own unknowns. `ordering.analyse` gives the fronts; they hold for
every matrix of the same pattern.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from mbsim.core.jitable import jitable
from mbsim.fclib.clock import late

if TYPE_CHECKING:
    from mbsim.fclib.ordering import Analysis
    from mbsim.fclib.problem import Indices, Vector

#: Columns eliminated before the rest of a front is touched.
PANEL = 8
#: Size of a matrix whose panels take long enough to ask the clock before each, and the number of
#: products in smaller ones after which it is asked.
LARGE, MANY = 64, 200_000


class Factors(NamedTuple):
    """LU factors of a matrix (`ordering.Analysis`), and room to get and to use them.

    Parameters
    ----------
    values
        (factor_ptr[-1],) the factors, front by front.
    exchange
        (d * nodes,) the row of its front that each pivot's row was exchanged with.
    front, stack, part
        (widest^2,), (stacked,) and (widest,): a front, what waits for its parent, a right side.
    """

    values: Vector
    exchange: Indices
    front: Vector
    stack: Vector
    part: Vector


@jitable
def room_for_factors(analysis: Analysis, unknowns: int) -> Factors:
    """Return room for the factors of a matrix with so many unknowns."""
    return Factors(
        np.empty(analysis.factor_ptr[-1]),
        np.empty(unknowns, np.int32),
        np.empty(analysis.widest**2),
        np.empty(analysis.stacked),
        np.empty(analysis.widest),
    )


@jitable
def factor_work(flops: float, blocks: int) -> float:
    """Return the estimated seconds of a factorisation: a measure that does not depend on a clock.

    `flops` is what `ordering.elimination_flops` says, `blocks` the number of blocks.
    """
    return 1.2e-10 * flops + 3e-8 * blocks


@jitable
def transposed_places(size: int, ptr: Indices, col: Indices) -> Indices:
    """Return for every block (a, b) of a symmetric pattern, columns rising, where (b, a) is."""
    place = ptr[:size].copy()
    back = np.empty(ptr[size], np.int32)
    for a in range(size):
        for k in range(ptr[a], ptr[a + 1]):
            b = col[k]
            back[k] = place[b]  # rows come in rising order, as b's columns do
            place[b] += 1
    return back


@jitable
def factorise(
    d: int,
    ptr: Indices,
    col: Indices,
    back: Indices,
    val: Vector,
    analysis: Analysis,
    factors: Factors,
    until: Vector,
) -> bool:
    """Write the factors of the matrix (val: blocks, d, d); return whether every pivot was sound.

    `back` is what `transposed_places` returns. It is given up, as not sound, when it is late
    (`clock.until`).
    """
    front_ptr, nodes, pivots = analysis.front_ptr, analysis.nodes, analysis.pivots
    rank, stack = analysis.rank, factors.stack
    fronts = len(pivots)
    local = np.empty(len(rank), np.int32)
    runs = np.empty((len(rank) + 1, 3), np.int64)
    # what waits on the stack
    waiting = np.empty(fronts + 1, np.int32)
    depth = 0
    top = 0
    piv = 0
    sound = True
    products = 0
    for f in range(fronts):
        lo, hi = front_ptr[f], front_ptr[f + 1]
        n = d * (hi - lo)
        own = d * pivots[f]
        products += n * n * (own + 1)
        if products > MANY:
            if late(until):
                return False
            products = 0
        matrix = factors.front[: n * n].reshape(n, n)
        matrix[:] = 0.0
        for k in range(lo, hi):
            local[nodes[k]] = k - lo
        for k in range(lo, lo + pivots[f]):
            a = nodes[k]
            row = d * (k - lo)
            for j in range(ptr[a], ptr[a + 1]):
                b = col[j]
                if rank[b] < f:
                    continue
                column = d * local[b]
                for s in range(d):
                    for t in range(d):
                        matrix[row + s, column + t] = val[j, s, t]
                if rank[b] > f:
                    for s in range(d):
                        for t in range(d):
                            matrix[column + s, row + t] = val[back[j], s, t]
        for _ in range(analysis.children[f]):
            depth -= 1
            child = waiting[depth]
            members = nodes[front_ptr[child] + pivots[child] : front_ptr[child + 1]]
            size = d * len(members)
            top -= size * size
            update = stack[top : top + size * size].reshape(size, size)
            _add_update(d, update, members, local, runs, matrix)
        sound = partial_lu(matrix, own, factors.exchange[piv : piv + own], until) and sound
        _keep(matrix, own, factors.values[analysis.factor_ptr[f] : analysis.factor_ptr[f + 1]])
        size = n - own
        for i in range(size):
            target = stack[top + i * size : top + (i + 1) * size]
            target[:] = matrix[own + i, own:]
        top += size * size
        waiting[depth] = f
        depth += 1
        piv += own
    return sound


@jitable
def _add_update(
    d: int, update: Vector, members: Indices, local: Indices, runs: Indices, matrix: Vector
) -> None:
    """Add to a front what is left of a child's, among the child's `members`.

    `runs` gets those of the child's unknowns that are neighbours here, too: from, to, length.
    """
    count = 0
    for j in range(len(members)):
        place = d * local[members[j]]
        if j > 0 and place == runs[count - 1, 1] + d * j - runs[count - 1, 0]:
            runs[count - 1, 2] += d
        else:
            runs[count, 0] = d * j
            runs[count, 1] = place
            runs[count, 2] = d
            count += 1
    for i in range(len(members)):
        row = d * local[members[i]]
        for s in range(d):
            for k in range(count):
                begin, to, length = runs[k, 0], runs[k, 1], runs[k, 2]
                source = update[d * i + s, begin : begin + length]
                target = matrix[row + s, to : to + length]
                for t in range(length):
                    target[t] += source[t]


@jitable
def _keep(matrix: Vector, own: int, kept: Vector) -> None:
    """Store a front's factors: its own rows, then the multipliers of the others, transposed."""
    n = matrix.shape[0]
    at = 0
    for k in range(own):
        kept[at : at + n] = matrix[k]
        at += n
    rest = n - own
    below = kept[at:].reshape(own, rest)
    for i in range(rest):
        for k in range(own):
            below[k, i] = matrix[own + i, k]


@jitable
def partial_lu(matrix: Vector, own: int, exchange: Indices, until: Vector) -> bool:
    """Eliminate the first `own` unknowns of a dense matrix in place; rows change among these.

    Return whether every pivot was sound, and there was time for all (`clock.until`).
    """
    n = matrix.shape[0]
    sound = True
    for begin in range(0, own, PANEL):
        if n > LARGE and late(until):
            return False
        end = min(begin + PANEL, own)
        for k in range(begin, end):
            best = k
            for i in range(k + 1, own):
                if abs(matrix[i, k]) > abs(matrix[best, k]):
                    best = i
            exchange[k] = best
            if best != k:
                one, other = matrix[k], matrix[best]
                for j in range(n):
                    one[j], other[j] = other[j], one[j]
            pivot = matrix[k, k]
            if not abs(pivot) > 0.0:
                sound = False
                continue
            inverse = 1.0 / pivot
            source = matrix[k]
            for i in range(k + 1, n):
                factor = matrix[i, k] * inverse
                matrix[i, k] = factor
                for j in range(k + 1, end):
                    matrix[i, j] -= factor * source[j]
        for k in range(begin, end):
            source = matrix[k, end:]
            for i in range(k + 1, end):
                factor = matrix[i, k]
                target = matrix[i, end:]
                for j in range(len(target)):
                    target[j] -= factor * source[j]
        _subtract(matrix, begin, end)
    return sound


@jitable
def _subtract(matrix: Vector, begin: int, end: int) -> None:
    """Subtract the product of the panel's columns and rows from all that follows."""
    n = matrix.shape[0]
    if end - begin == 8:
        s0, s1, s2, s3 = (
            matrix[begin, end:],
            matrix[begin + 1, end:],
            matrix[begin + 2, end:],
            matrix[begin + 3, end:],
        )
        s4, s5, s6, s7 = (
            matrix[begin + 4, end:],
            matrix[begin + 5, end:],
            matrix[begin + 6, end:],
            matrix[begin + 7, end:],
        )
        for i in range(end, n):
            target = matrix[i, end:]
            row = matrix[i, begin:end]
            f0, f1, f2, f3 = row[0], row[1], row[2], row[3]
            f4, f5, f6, f7 = row[4], row[5], row[6], row[7]
            for j in range(len(target)):
                target[j] -= (
                    (f0 * s0[j] + f1 * s1[j])
                    + (f2 * s2[j] + f3 * s3[j])
                    + (f4 * s4[j] + f5 * s5[j])
                    + (f6 * s6[j] + f7 * s7[j])
                )
        return
    k = begin
    while k + 1 < end:
        s0, s1 = matrix[k, end:], matrix[k + 1, end:]
        for i in range(end, n):
            target = matrix[i, end:]
            f0, f1 = matrix[i, k], matrix[i, k + 1]
            for j in range(len(target)):
                target[j] -= f0 * s0[j] + f1 * s1[j]
        k += 2
    if k < end:
        s0 = matrix[k, end:]
        for i in range(end, n):
            target = matrix[i, end:]
            f0 = matrix[i, k]
            for j in range(len(target)):
                target[j] -= f0 * s0[j]


@jitable
def solve(d: int, analysis: Analysis, factors: Factors, x: Vector) -> None:  # noqa: C901
    """Overwrite the right side x by the solution.

    Many branches because both sweeps go over the same fronts with the same scratch.
    """
    front_ptr, nodes, pivots = analysis.front_ptr, analysis.nodes, analysis.pivots
    factor_ptr, values = analysis.factor_ptr, factors.values
    exchange, part = factors.exchange, factors.part
    fronts = len(pivots)
    piv = 0
    for f in range(fronts):
        lo, hi = front_ptr[f], front_ptr[f + 1]
        n = d * (hi - lo)
        own = d * pivots[f]
        for k in range(hi - lo):
            for s in range(d):
                part[d * k + s] = x[d * nodes[lo + k] + s]
        kept = values[factor_ptr[f] : factor_ptr[f + 1]]
        upper = kept[: own * n].reshape(own, n)
        below = kept[own * n :].reshape(own, n - own)
        for k in range(own):
            other = exchange[piv + k]
            if other != k:
                part[k], part[other] = part[other], part[k]
        rest = part[own:n]
        for k in range(own):
            for j in range(k):
                part[k] -= upper[k, j] * part[j]
        for k in range(own):
            value = part[k]
            if value != 0.0:
                row = below[k]
                for i in range(len(row)):
                    rest[i] -= value * row[i]
        for k in range(hi - lo):
            for s in range(d):
                x[d * nodes[lo + k] + s] = part[d * k + s]
        piv += own
    for f in range(fronts - 1, -1, -1):
        lo, hi = front_ptr[f], front_ptr[f + 1]
        n = d * (hi - lo)
        own = d * pivots[f]
        piv -= own
        for k in range(hi - lo):
            for s in range(d):
                part[d * k + s] = x[d * nodes[lo + k] + s]
        upper = values[factor_ptr[f] : factor_ptr[f] + own * n].reshape(own, n)
        for k in range(own - 1, -1, -1):
            part[k] = (part[k] - _dot(upper[k, k + 1 :], part[k + 1 : n])) / upper[k, k]
        for k in range(pivots[f]):
            for s in range(d):
                x[d * nodes[lo + k] + s] = part[d * k + s]


@jitable
def solve_many(  # noqa: C901
    d: int, begin: int, analysis: Analysis, factors: Factors, x: Vector
) -> None:
    """Overwrite the right sides, columns of x (d * nodes, k), from front `begin` on.

    Many branches because both sweeps go over the same fronts with the same scratch.

    Right sides must be zero at nodes of earlier fronts, and solutions there are not computed.
    """
    front_ptr, nodes, pivots = analysis.front_ptr, analysis.nodes, analysis.pivots
    factor_ptr, values, exchange = analysis.factor_ptr, factors.values, factors.exchange
    part = np.empty((analysis.widest, x.shape[1]))
    fronts = len(pivots)
    piv = 0
    for f in range(begin):
        piv += d * pivots[f]
    for f in range(begin, fronts):
        lo, hi = front_ptr[f], front_ptr[f + 1]
        n = d * (hi - lo)
        own = d * pivots[f]
        for k in range(hi - lo):
            for s in range(d):
                part[d * k + s] = x[d * nodes[lo + k] + s]
        kept = values[factor_ptr[f] : factor_ptr[f + 1]]
        upper = kept[: own * n].reshape(own, n)
        below = kept[own * n :].reshape(own, n - own)
        for k in range(own):
            other = exchange[piv + k]
            if other != k:
                one, two = part[k], part[other]
                for j in range(len(one)):
                    one[j], two[j] = two[j], one[j]
        for k in range(own):
            source = part[k]
            for i in range(k + 1, n):
                factor = upper[i, k] if i < own else below[k, i - own]
                target = part[i]
                for j in range(len(target)):
                    target[j] -= factor * source[j]
        for k in range(hi - lo):
            for s in range(d):
                x[d * nodes[lo + k] + s] = part[d * k + s]
        piv += own
    for f in range(fronts - 1, begin - 1, -1):
        lo, hi = front_ptr[f], front_ptr[f + 1]
        n = d * (hi - lo)
        own = d * pivots[f]
        for k in range(hi - lo):
            for s in range(d):
                part[d * k + s] = x[d * nodes[lo + k] + s]
        upper = values[factor_ptr[f] : factor_ptr[f] + own * n].reshape(own, n)
        for k in range(own - 1, -1, -1):
            target = part[k]
            for i in range(k + 1, n):
                factor = upper[k, i]
                source = part[i]
                for j in range(len(target)):
                    target[j] -= factor * source[j]
            inverse = 1.0 / upper[k, k]
            for j in range(len(target)):
                target[j] *= inverse
        for k in range(pivots[f]):
            for s in range(d):
                x[d * nodes[lo + k] + s] = part[d * k + s]


@jitable
def _dot(a: Vector, b: Vector) -> float:
    """Return the product of two vectors, summed in four parts."""
    n = len(a)
    s0, s1, s2, s3 = 0.0, 0.0, 0.0, 0.0
    quarter = n - n % 4
    for k in range(0, quarter, 4):
        s0 += a[k] * b[k]
        s1 += a[k + 1] * b[k + 1]
        s2 += a[k + 2] * b[k + 2]
        s3 += a[k + 3] * b[k + 3]
    for k in range(quarter, n):
        s0 += a[k] * b[k]
    return (s0 + s1) + (s2 + s3)
