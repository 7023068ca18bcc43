"""Elimination of bodies from the linearised mechanism, block by block.

A body that hangs on a joint is xi_c = xi_p + S' dq: its columns and rows are added to those of
its parent, the rows of dq, S times its own and what the joint's force adds (U), are eliminated.
Children go before their parents, and among those that may go, the one with the fewest
neighbours. Along a chain this is the articulated-body recursion, and as cheap. Multipliers of
equations may be nodes as well (`Pattern.node`): they go after the bodies that these hold.

The same code serves real and complex matrices: M is `Real` or `Pair` of `compile_model.tangent`.
Loops over a block take its size from the array: unrolled, they would take long to compile.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from mbsim.arrays.codes import BLOCK_COLUMN, BLOCK_ROW
from mbsim.core.arrays import F1, F2, I1, N1, N2
from mbsim.core.jitable import jitable

if TYPE_CHECKING:
    from mbsim.compile_model.tangent import Linear, Pair, Pattern, Real


# entries of `Pattern.count`
COUPLINGS, BLOCKS, STALE = range(3)

#: A pivot below this part of the largest number in its column counts as none.
_NO_PIVOT = 1e-14
#: A pivot of a node of multipliers below this part of its row's largest diagonal is not used.
_LEFT = 1e-3


@jitable
def bodies_of(P: Pattern) -> int:
    """Return how many nodes are bodies."""
    return len(P.order) - len(P.first) + 1


@jitable
def forget_pattern(P: Pattern) -> None:
    """Start with the blocks of each body on itself."""
    nb = bodies_of(P)
    for a in range(len(P.order)):
        for b in range(len(P.order)):
            P.block[a, b] = -1
    for a in range(nb):
        P.block[a, a] = a
        P.pair[a, BLOCK_ROW] = P.pair[a, BLOCK_COLUMN] = a
    P.count[COUPLINGS] = nb
    P.count[STALE] = 1


@jitable
def couple(P: Pattern, a: int, b: int) -> bool:
    """Make room for what body b does to a and a to b; return whether there is room."""
    if P.block[a, b] >= 0 and P.block[a, b] < P.count[COUPLINGS]:
        return True
    # blocks of fill behind the couplings are found anew
    if P.count[STALE] == 0:
        drop_fill(P)
        P.count[STALE] = 1
    k = P.count[COUPLINGS]
    if k + 2 > len(P.pair):
        return False
    P.block[a, b], P.block[b, a] = k, k + 1
    P.pair[k, BLOCK_ROW], P.pair[k, BLOCK_COLUMN] = a, b
    P.pair[k + 1, BLOCK_ROW], P.pair[k + 1, BLOCK_COLUMN] = b, a
    P.count[COUPLINGS] = k + 2
    return True


@jitable
def drop_fill(P: Pattern) -> None:
    """Take away the blocks of multipliers, and those that only elimination fills."""
    nb = len(P.order)
    for a in range(nb):
        for b in range(nb):
            if P.block[a, b] >= P.count[COUPLINGS]:
                P.block[a, b] = -1


@jitable
def place_block(P: Pattern, a: int, b: int) -> bool:
    """Make room for a block; return whether there is room."""
    if P.block[a, b] < 0:
        if P.count[BLOCKS] >= len(P.neighbour):
            return False
        P.block[a, b] = P.count[BLOCKS]
        P.count[BLOCKS] += 1
    return True


@jitable
def count_neighbours(P: Pattern, a: int) -> int:
    """Return with how many nodes that are not yet eliminated node a is coupled."""
    count = 0
    for b in range(len(P.order)):
        if b != a and P.waiting[b] >= 0 and P.block[a, b] >= 0:
            count += 1
    return count


@jitable
def next_node(P: Pattern) -> int:
    """Return the node to be eliminated next."""
    best, least = -1, len(P.order) + 1
    for a in range(len(P.order)):
        if P.waiting[a] == 0 and P.degree[a] < least:
            best, least = a, P.degree[a]
    return best


@jitable
def place_known(P: Pattern) -> bool:
    """Make room for what is coupled by joints and by equations; return whether there is room."""
    nb = bodies_of(P)
    P.count[BLOCKS] = P.count[COUPLINGS]
    for c in range(len(P.order)):
        P.waiting[c] = P.children[c]
        if P.parent[c] >= 0:
            if not (place_block(P, c, P.parent[c]) and place_block(P, P.parent[c], c)):
                return False
    for c in range(nb, len(P.order)):
        if not place_block(P, c, c):
            return False
        for k in range(P.first[c - nb], P.first[c - nb + 1]):
            if not (place_block(P, c, P.held[k]) and place_block(P, P.held[k], c)):
                return False
    return True


@jitable
def note_gone(P: Pattern, c: int) -> None:
    """Let what waits for node c wait for it no longer."""
    nb = bodies_of(P)
    if P.parent[c] >= 0:
        P.waiting[P.parent[c]] -= 1
    for n in range(len(P.order) - nb):
        for k in range(P.first[n], P.first[n + 1]):
            P.waiting[nb + n] -= 1 if P.held[k] == c else 0


@jitable
def find_order(P: Pattern) -> bool:
    """Find the order of elimination and the blocks that it fills; return whether there is room."""
    many = len(P.order)
    if not place_known(P):
        return False
    for c in range(many):
        P.degree[c] = count_neighbours(P, c)
    at = 0
    for step in range(many):
        c = next_node(P)
        P.order[step] = c
        P.start[step] = at
        P.waiting[c] = -1
        for j in range(many):
            if P.waiting[j] >= 0 and P.block[c, j] >= 0:
                P.neighbour[at] = j
                at += 1
        first = P.start[step]
        for i in range(first, at):
            for j in range(first, at):
                if not place_block(P, P.neighbour[i], P.neighbour[j]):
                    return False
        note_gone(P, c)
        for i in range(first, at):
            P.degree[P.neighbour[i]] = count_neighbours(P, P.neighbour[i])
    P.start[many] = at
    P.count[STALE] = 0
    return True


@jitable
def factor_small(a: N2, swap: I1, size: int) -> bool:
    """Replace the leading part of a by its factors with row exchanges; return whether it could."""
    for k in range(size):
        best, largest = k, abs(a[k, k])
        for i in range(k + 1, size):
            if abs(a[i, k]) > largest:
                best, largest = i, abs(a[i, k])
        if not largest > 0.0:
            return False
        swap[k] = best
        if best != k:
            for j in range(size):
                a[k, j], a[best, j] = a[best, j], a[k, j]
        inverse = 1.0 / a[k, k]
        for i in range(k + 1, size):
            a[i, k] *= inverse
            part = a[i, k]
            for j in range(k + 1, size):
                a[i, j] -= part * a[k, j]
    return True


@jitable
def solve_small(a: N2, swap: I1, size: int, x: N1) -> None:
    """Replace the vector x by a^-1 x; what has no pivot is 0."""
    for k in range(size):
        if swap[k] != k:
            x[k], x[swap[k]] = x[swap[k]], x[k]
    for k in range(size):
        for j in range(k):
            x[k] -= a[k, j] * x[j]
    for k in range(size - 1, -1, -1):
        if a[k, k] == 0.0:
            x[k] = 0.0
            continue
        for j in range(k + 1, size):
            x[k] -= a[k, j] * x[j]
        x[k] /= a[k, k]


@jitable
def solve_rows(a: N2, swap: I1, size: int, X: N2) -> None:
    """Replace the first rows of X, six long, by a^-1 X."""
    for k in range(size):
        other = swap[k]
        if other != k:
            for c in range(X.shape[1]):
                X[k, c], X[other, c] = X[other, c], X[k, c]
    for k in range(size):
        for j in range(k):
            part = a[k, j]
            for c in range(X.shape[1]):
                X[k, c] -= part * X[j, c]
    for k in range(size - 1, -1, -1):
        for j in range(k + 1, size):
            part = a[k, j]
            for c in range(X.shape[1]):
                X[k, c] -= part * X[j, c]
        inverse = 1.0 / a[k, k]
        for c in range(X.shape[1]):
            X[k, c] *= inverse


@jitable
def add_block(A: N2, B: N2) -> None:
    """Add B to A."""
    for i in range(A.shape[0]):
        for j in range(A.shape[1]):
            A[i, j] += B[i, j]


@jitable
def take_product(A: N2, Q: N2, X: N2, size: int) -> None:
    """Take Q X from A; Q is 6 x size, X size x 6."""
    for i in range(A.shape[0]):
        for q in range(size):
            part = Q[i, q]
            for j in range(A.shape[1]):
                A[i, j] -= part * X[q, j]


@jitable
def times_directions(A: N2, S: F2, size: int, out: N2) -> None:
    """Write A S' into the first columns of `out`, which may be A; S has directions by rows."""
    for i in range(A.shape[0]):
        a0, a1, a2, a3, a4, a5 = A[i, 0], A[i, 1], A[i, 2], A[i, 3], A[i, 4], A[i, 5]
        for q in range(size):
            out[i, q] = (
                a0 * S[q, 0]
                + a1 * S[q, 1]
                + a2 * S[q, 2]
                + a3 * S[q, 3]
                + a4 * S[q, 4]
                + a5 * S[q, 5]
            )


@jitable
def directions_times(S: F2, A: N2, size: int, out: N2) -> None:
    """Write S A into the first rows of `out`, which is not A."""
    for q in range(size):
        for j in range(A.shape[1]):
            total = S[q, 0] * A[0, j]
            for i in range(1, A.shape[0]):
                total += S[q, i] * A[i, j]
            out[q, j] = total


@jitable
def copy_rows(A: N2, B: N2, size: int) -> None:
    """Copy the first rows of B into A."""
    for i in range(size):
        for j in range(A.shape[1]):
            A[i, j] = B[i, j]


@jitable
def hang(P: Pattern, M: Real | Pair, linear: Linear, free: I1, c: int, first: int, end: int) -> int:
    """Bring rows and columns of body c, which hangs on a joint, to its parent and its dq."""
    k, p = P.joint[c], P.parent[c]
    S, U, own, spare = linear.S[k], linear.U[k], M.work[0], M.work[1]
    size, A, pivot = free[k], M.A, M.pivot[c]
    for at in range(first, end):
        i = P.neighbour[at]
        block = A[P.block[i, c]]
        if p >= 0:
            add_block(A[P.block[i, p]], block)
        times_directions(block, S, size, block)
    body = A[P.block[c, c]]
    if p >= 0:
        add_block(A[P.block[c, p]], body)
    times_directions(body, S, size, own)
    # rows of dq
    for q in range(size):
        for j in range(size):
            total = S[q, 0] * own[0, j] + U[q, 0] * S[j, 0]
            for i in range(1, S.shape[1]):
                total += S[q, i] * own[i, j] + U[q, i] * S[j, i]
            pivot[q, j] = total
    for at in range(first, end):
        j = P.neighbour[at]
        block = A[P.block[c, j]]
        directions_times(S, block, size, spare)
        if j == p:
            for q in range(size):
                for i in range(spare.shape[1]):
                    spare[q, i] += U[q, i] + U[6 + q, i]
        if p >= 0:
            add_block(A[P.block[p, j]], block)
        copy_rows(block, spare, size)
    if p >= 0:
        above = A[P.block[p, c]]
        for i in range(above.shape[0]):
            for q in range(size):
                above[i, q] += own[i, q]
    return size


@jitable
def eliminate(P: Pattern, M: Real | Pair, linear: Linear, free: I1) -> bool:
    """Replace A by its factors; return whether that is possible."""
    nb = bodies_of(P)
    for c in range(nb, len(P.order)):
        for q in range(M.seen.shape[1]):
            M.seen[c, q] = abs(M.A[P.block[c, c], q, q])
    for step in range(len(P.order)):
        c, first, end = P.order[step], P.start[step], P.start[step + 1]
        size = P.rows[c]
        if P.joint[c] >= 0:
            size = hang(P, M, linear, free, c, first, end)
        else:
            copy_rows(M.pivot[c], M.A[P.block[c, c]], size)
        if c >= nb:
            if not factor_node(M.pivot[c], M.swap[c], M.seen[c], size):
                size = 0
        elif not factor_small(M.pivot[c], M.swap[c], size):
            return False
        M.rows[c] = size
        for at in range(first, end):
            solve_rows(M.pivot[c], M.swap[c], size, M.A[P.block[c, P.neighbour[at]]])
        for at in range(first, end):
            i = P.neighbour[at]
            Q = M.A[P.block[i, c]]
            for other in range(first, end):
                j = P.neighbour[other]
                take_product(M.A[P.block[i, j]], Q, M.A[P.block[c, j]], size)
            if i >= nb:
                see_diagonal(M.A[P.block[i, i]], M.seen[i])
    return True


@jitable
def see_diagonal(A: N2, seen: F1) -> None:
    """Keep the largest that each number of the diagonal was."""
    for q in range(len(seen)):
        seen[q] = max(seen[q], abs(A[q, q]))


@jitable
def factor_node(a: N2, swap: I1, seen: F1, size: int) -> bool:
    """Replace a by its factors; return whether enough is left of what was `seen` of each row.

    Bodies that were eliminated may be unable to move as an equation asks where others can, or the
    loop folds. The border has the equations of such a node.
    """
    if not factor_small(a, swap, size):
        return False
    for k in range(size):
        # rows were exchanged one after the other
        seen[k], seen[swap[k]] = seen[swap[k]], seen[k]
        if not abs(a[k, k]) > _LEFT * seen[k]:
            return False
    return True


@jitable
def solve_bodies(P: Pattern, M: Real | Pair, linear: Linear, free: I1, g: N2) -> None:  # noqa: C901
    """Replace the right side g, (nodes, 6) at least, by displacements of bodies and multipliers.

    Many branches because the sweeps forward and back both treat bodies on joints in their own way.
    """
    many = len(P.order)
    for step in range(many):
        c, first, end = P.order[step], P.start[step], P.start[step + 1]
        k, p, size = P.joint[c], P.parent[c], M.rows[c]
        if k >= 0:
            if p >= 0:
                for i in range(g.shape[1]):
                    g[p, i] += g[c, i]
            g0, g1, g2, g3, g4, g5 = g[c, 0], g[c, 1], g[c, 2], g[c, 3], g[c, 4], g[c, 5]
            for q in range(size):
                s = linear.S[k, q]
                total = g0 * s[0] + g1 * s[1] + g2 * s[2]
                g[c, q] = total + g3 * s[3] + g4 * s[4] + g5 * s[5]
        solve_small(M.pivot[c], M.swap[c], size, g[c])
        for at in range(first, end):
            i = P.neighbour[at]
            Q = M.A[P.block[i, c]]
            for r in range(g.shape[1]):
                for q in range(size):
                    g[i, r] -= Q[r, q] * g[c, q]
    for step in range(many - 1, -1, -1):
        c, first, end = P.order[step], P.start[step], P.start[step + 1]
        k, p, size = P.joint[c], P.parent[c], M.rows[c]
        for at in range(first, end):
            j = P.neighbour[at]
            X = M.A[P.block[c, j]]
            for q in range(size):
                for r in range(g.shape[1]):
                    g[c, q] -= X[q, r] * g[j, r]
        if k >= 0:
            x = M.work[2, 0]
            for q in range(size):
                x[q] = g[c, q]
            for i in range(g.shape[1]):
                g[c, i] = g[p, i] if p >= 0 else 0.0
            for q in range(size):
                for i in range(g.shape[1]):
                    g[c, i] += x[q] * linear.S[k, q, i]


@jitable
def factor_border(a: N2, swap: I1, size: int) -> None:
    """Replace a by its factors; rows that follow from others get no pivot (0 on the diagonal)."""
    for k in range(size):
        best, largest, scale = k, 0.0, 0.0
        for i in range(k, size):
            if abs(a[i, k]) > largest:
                best, largest = i, abs(a[i, k])
        for i in range(size):
            scale = max(scale, abs(a[i, k]))
        if not largest > _NO_PIVOT * scale:
            swap[k] = k
            for i in range(k, size):
                a[i, k] = 0.0
            continue
        swap[k] = best
        if best != k:
            for j in range(size):
                a[k, j], a[best, j] = a[best, j], a[k, j]
        for i in range(k + 1, size):
            a[i, k] /= a[k, k]
            part = a[i, k]
            for j in range(k + 1, size):
                a[i, j] -= part * a[k, j]
