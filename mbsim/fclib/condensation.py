"""W = K' M^-1 K from the masses: M component by component, factorised densely or as it is sparse.

M falls into components that share no entry (a rigid body, an elastic one); each is factorised for
itself, a large one as a sparse matrix with the unknowns that K touches last, so that only the Schur
complement on these is solved with.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from mbsim.core.jitable import jitable
from mbsim.fclib.blocks import Rows, block_rows, symmetric_pattern, transposed_pattern
from mbsim.fclib.clock import unlimited
from mbsim.fclib.factor import (
    Factors,
    factorise,
    partial_lu,
    room_for_factors,
    solve,
    solve_many,
    transposed_places,
)
from mbsim.fclib.ordering import Analysis, analyse_last

if TYPE_CHECKING:
    from mbsim.fclib.problem import Indices, Vector

#: Largest component of M that is treated as a dense matrix.
DENSE = 48


class MassFactors(NamedTuple):
    """Factors of M: arrays, for lists take long to hand over.

    Unknowns of component c are rows[row_ptr[c]:row_ptr[c + 1]], and its rows' exchanges are in the
    same places of `exchange`. Factors of a small one are in `dense` from sizes[c] on; of a large
    one sparse[c] says where its analysis (`_packed`) begins in `analyses` and its factors in
    `values`, and how many unknowns a node has. sparse[c, 0] is -1 for small ones.
    """

    row_ptr: Indices
    rows: Indices
    sizes: Indices
    dense: Vector
    exchange: Indices
    sparse: Indices
    analyses: Indices
    values: Vector


@jitable
def condense(
    d: int, nodes: int, mass: tuple[Any, ...], columns: tuple[Any, ...], f: Vector
) -> tuple[tuple[Any, ...], tuple[Any, ...]]:
    """Return K' M^-1 K in blocks and K' M^-1 f.

    `mass` and `columns` are M (n, n) and K (n, d * nodes), what `Rows` has. Returns ((sound, ptr,
    col, val, free), factors), factors being what `MassFactors` has.
    """
    m, k = Rows(*mass), Rows(*columns)
    n = len(f)
    count, component = components(n, m.ptr, m.col)
    row_ptr, rows, inside = _members(count, component)
    node_ptr, touched = _touched_nodes(d, nodes, row_ptr, rows, k)
    ptr, col = _coupling(nodes, node_ptr, touched)
    val = np.zeros((len(col), d, d))
    sizes = np.zeros(count + 1, np.int64)
    for c in range(count):
        size = row_ptr[c + 1] - row_ptr[c]
        sizes[c + 1] = sizes[c] + (size * size if size <= DENSE else 0)
    dense = np.zeros(sizes[count])
    exchange = np.empty(n, np.int32)
    sparse = np.full((count, 3), -1, np.int64)
    analyses, values = np.empty(0, np.int64), np.empty(0)
    local = np.empty(nodes, np.int32)
    solved = np.empty(n)
    sound = True
    for c in range(count):
        mine = rows[row_ptr[c] : row_ptr[c + 1]]
        swaps = exchange[row_ptr[c] : row_ptr[c + 1]]
        near = touched[node_ptr[c] : node_ptr[c + 1]]
        size = len(mine)
        for j in range(len(near)):
            local[near[j]] = j
        x, y = _right_sides(d, mine, len(near), local, k, f)
        if size <= DENSE:
            lu = dense[sizes[c] : sizes[c + 1]].reshape(size, size)
            sound = _solve_dense(mine, inside, m, lu, swaps, x, y) and sound
        else:
            of_node, analysis, found, regular = _solve_sparse(mine, inside, m, k, swaps, x, y)
            sound = regular and sound
            sparse[c, 0], sparse[c, 1], sparse[c, 2] = len(analyses), len(values), of_node
            analyses = np.concatenate((analyses, _packed(analysis)))
            values = np.concatenate((values, found)) if len(values) else found
        for j in range(size):
            solved[mine[j]] = y[j]
        if len(near) > 0:
            _add_product(d, mine, near, local, k, x, ptr, col, val)
    free = np.zeros(d * nodes)
    for a in range(n):
        for j in range(k.ptr[a], k.ptr[a + 1]):
            free[k.col[j]] += k.val[j] * solved[a]
    factors = (row_ptr, rows, sizes, dense, exchange, sparse, analyses, values)
    return (sound, ptr, col, val, free), factors


@jitable
def mass_solve(factors: tuple[Any, ...], forces: Vector, v: Vector) -> None:
    """Write M^-1 times a vector; `factors` are what `condense` returned."""
    row_ptr, rows, sizes, dense, exchange, sparse, analyses, values = factors
    for c in range(len(row_ptr) - 1):
        mine = rows[row_ptr[c] : row_ptr[c + 1]]
        swaps = exchange[row_ptr[c] : row_ptr[c + 1]]
        size = len(mine)
        x = np.empty(size)
        for j in range(size):
            x[j] = forces[mine[j]]
        if sparse[c, 0] < 0:
            lu = dense[sizes[c] : sizes[c + 1]].reshape(size, size)
            _dense_solve(lu, swaps, x.reshape(size, 1))
        else:
            analysis = _unpacked(analyses[sparse[c, 0] :])
            nothing = np.empty(0)
            found = Factors(
                values[sparse[c, 1] :], swaps, nothing, nothing, np.empty(analysis.widest)
            )
            solve(sparse[c, 2], analysis, found, x)
        for j in range(size):
            v[mine[j]] = x[j]


@jitable
def components(n: int, p: Indices, i: Indices) -> tuple[int, Indices]:
    """Return how many components without common entries a matrix has, and every row's."""
    root = np.arange(n).astype(np.int32)
    for a in range(n):
        for k in range(p[a], p[a + 1]):
            b = i[k]
            x, y = a, b
            while root[x] != x:
                root[x] = root[root[x]]
                x = root[x]
            while root[y] != y:
                root[y] = root[root[y]]
                y = root[y]
            if x < y:
                root[y] = x
            elif y < x:
                root[x] = y
    component = np.empty(n, np.int32)
    count = 0
    for a in range(n):
        x = a
        while root[x] != x:
            x = root[x]
        if x == a:
            component[a] = count
            count += 1
        else:
            component[a] = component[x]
    return count, component


@jitable
def _members(count: int, component: Indices) -> tuple[Indices, Indices, Indices]:
    """Return the rows of each component, and where in its component each row is."""
    n = len(component)
    row_ptr = np.zeros(count + 1, np.int32)
    for a in range(n):
        row_ptr[component[a] + 1] += 1
    for c in range(count):
        row_ptr[c + 1] += row_ptr[c]
    place = row_ptr[:count].copy()
    rows = np.empty(n, np.int32)
    inside = np.empty(n, np.int32)
    for a in range(n):
        c = component[a]
        inside[a] = place[c] - row_ptr[c]
        rows[place[c]] = a
        place[c] += 1
    return row_ptr, rows, inside


@jitable
def _touched_nodes(
    d: int, nodes: int, row_ptr: Indices, rows: Indices, k: Rows
) -> tuple[Indices, Indices]:
    """Return the nodes that K couples with each component, by compressed rows."""
    count = len(row_ptr) - 1
    seen = np.full(nodes, -1, np.int32)
    node_ptr = np.zeros(count + 1, np.int32)
    touched = np.empty(len(k.col), np.int32)
    total = 0
    for c in range(count):
        for j in range(row_ptr[c], row_ptr[c + 1]):
            a = rows[j]
            for i in range(k.ptr[a], k.ptr[a + 1]):
                b = k.col[i] // d
                if seen[b] != c:
                    seen[b] = c
                    touched[total] = b
                    total += 1
        node_ptr[c + 1] = total
    return node_ptr, touched[:total]


@jitable
def _coupling(nodes: int, node_ptr: Indices, touched: Indices) -> tuple[Indices, Indices]:
    """Return the pattern in which nodes that one component touches are neighbours."""
    count = len(node_ptr) - 1
    of_ptr, of_node = transposed_pattern(count, nodes, node_ptr, touched)
    seen = np.full(nodes, -1, np.int32)
    ptr = np.zeros(nodes + 1, np.int32)
    total = 0
    for a in range(nodes):
        seen[a] = a
        total += 1
        for j in range(of_ptr[a], of_ptr[a + 1]):
            c = of_node[j]
            for k in range(node_ptr[c], node_ptr[c + 1]):
                if seen[touched[k]] != a:
                    seen[touched[k]] = a
                    total += 1
        ptr[a + 1] = total
    col = np.empty(total, np.int32)
    seen[:] = -1
    total = 0
    for a in range(nodes):
        seen[a] = a
        col[total] = a
        total += 1
        for j in range(of_ptr[a], of_ptr[a + 1]):
            c = of_node[j]
            for k in range(node_ptr[c], node_ptr[c + 1]):
                b = touched[k]
                if seen[b] != a:
                    seen[b] = a
                    col[total] = b
                    total += 1
    return symmetric_pattern(nodes, ptr, col)


@jitable
def _right_sides(
    d: int, mine: Indices, wide: int, local: Indices, k: Rows, f: Vector
) -> tuple[Vector, Vector]:
    """Return K and f of one component, K with the columns of the nodes that it touches."""
    size = len(mine)
    x = np.zeros((size, d * wide))
    y = np.empty(size)
    for j in range(size):
        a = mine[j]
        for i in range(k.ptr[a], k.ptr[a + 1]):
            b = k.col[i] // d
            x[j, d * local[b] + k.col[i] - d * b] += k.val[i]
        y[j] = f[a]
    return x, y


@jitable
def _solve_dense(
    mine: Indices, inside: Indices, m: Rows, lu: Vector, swaps: Indices, x: Vector, y: Vector
) -> bool:
    """Factorise one small component into `lu` and solve; return whether it is regular."""
    for j in range(len(mine)):
        a = mine[j]
        for i in range(m.ptr[a], m.ptr[a + 1]):
            lu[j, inside[m.col[i]]] += m.val[i]
    sound = partial_lu(lu, len(mine), swaps, unlimited())
    if x.shape[1] > 0:
        _dense_solve(lu, swaps, x)
    _dense_solve(lu, swaps, y.reshape(len(mine), 1))
    return sound


@jitable
def _solve_sparse(
    mine: Indices, inside: Indices, m: Rows, k: Rows, swaps: Indices, x: Vector, y: Vector
) -> tuple[int, Analysis, Vector, bool]:
    """Factorise one large component and solve; by blocks of 3 where it has them.

    Rows that K touches come last. Returns (unknowns of a node, analysis, factors, whether it is
    regular).
    """
    size = len(mine)
    ptr = np.zeros(size + 1, np.int32)
    for j in range(size):
        ptr[j + 1] = ptr[j] + m.ptr[mine[j] + 1] - m.ptr[mine[j]]
    col = np.empty(ptr[size], np.int32)
    entries = np.empty(ptr[size])
    at = 0
    for j in range(size):
        for i in range(m.ptr[mine[j]], m.ptr[mine[j] + 1]):
            col[at] = inside[m.col[i]]
            entries[at] = m.val[i]
            at += 1
    d = 1
    if size % 3 == 0:
        bptr, bcol, val = block_rows(3, size // 3, ptr, col, entries)
        d = 3 if 9 * len(bcol) <= 2 * len(col) else 1
    if d == 1:
        bptr, bcol, val = block_rows(1, size, ptr, col, entries)
    nodes = size // d
    last = np.zeros(nodes, np.bool_)
    for j in range(size):
        a = mine[j]
        if k.ptr[a + 1] > k.ptr[a]:
            last[j // d] = True
    analysis = analyse_last(nodes, bptr, bcol, d, last)
    room = room_for_factors(analysis, 0)
    factors = Factors(room.values, swaps, room.front, room.stack, room.part)
    back = transposed_places(nodes, bptr, bcol)
    sound = factorise(d, bptr, bcol, back, val, analysis, factors, unlimited())
    begin = len(analysis.pivots)
    for a in range(nodes):
        if last[a]:
            begin = min(begin, analysis.rank[a])
    if x.shape[1] > 0:
        solve_many(d, begin, analysis, factors, x)
    solve(d, analysis, factors, y)
    return d, analysis, factors.values, sound


@jitable
def _dense_solve(lu: Vector, swaps: Indices, x: Vector) -> None:
    """Overwrite the columns of x by solutions with the factors of a dense matrix."""
    n = lu.shape[0]
    for k in range(n):
        other = swaps[k]
        if other != k:
            one, two = x[k], x[other]
            for j in range(len(one)):
                one[j], two[j] = two[j], one[j]
    for k in range(n):
        source = x[k]
        for i in range(k + 1, n):
            factor = lu[i, k]
            if factor != 0.0:
                target = x[i]
                for j in range(len(target)):
                    target[j] -= factor * source[j]
    for k in range(n - 1, -1, -1):
        target = x[k]
        for i in range(k + 1, n):
            factor = lu[k, i]
            if factor != 0.0:
                source = x[i]
                for j in range(len(target)):
                    target[j] -= factor * source[j]
        inverse = 1.0 / lu[k, k]
        for j in range(len(target)):
            target[j] *= inverse


@jitable
def _add_product(
    d: int,
    mine: Indices,
    near: Indices,
    local: Indices,
    k: Rows,
    x: Vector,
    ptr: Indices,
    col: Indices,
    val: Vector,
) -> None:
    """Add K_c' X to the blocks, X = M_c^-1 K_c of one component that touches the nodes `near`."""
    wide = len(near)
    product = np.zeros((d * wide, d * wide))
    for j in range(len(mine)):
        a = mine[j]
        source = x[j]
        for i in range(k.ptr[a], k.ptr[a + 1]):
            b = k.col[i] // d
            target = product[d * local[b] + k.col[i] - d * b]
            factor = k.val[i]
            for t in range(len(target)):
                target[t] += factor * source[t]
    is_near = np.full(len(ptr) - 1, False)
    for i in range(wide):
        is_near[near[i]] = True
    for i in range(wide):
        a = near[i]
        for j in range(ptr[a], ptr[a + 1]):
            b = col[j]
            if is_near[b]:
                first = d * local[b]
                for s in range(d):
                    for t in range(d):
                        val[j, s, t] += product[d * i + s, first + t]


@jitable
def _packed(analysis: Analysis) -> Indices:
    """Return what `solve` needs of an analysis as one array, sizes first."""
    front_ptr, nodes, pivots = analysis.front_ptr, analysis.nodes, analysis.pivots
    sizes = np.array([len(pivots), len(nodes), analysis.widest])
    return np.concatenate((sizes, front_ptr, nodes, pivots, analysis.factor_ptr))


@jitable
def _unpacked(packed: Indices) -> Analysis:
    """Return an analysis that is enough for `solve`."""
    fronts, entries, widest = packed[0], packed[1], packed[2]
    at = 3
    front_ptr = packed[at : at + fronts + 1]
    at += fronts + 1
    nodes = packed[at : at + entries]
    at += entries
    pivots = packed[at : at + fronts]
    at += fronts
    factor_ptr = packed[at : at + fronts + 1]
    return Analysis(front_ptr, nodes, pivots, pivots, pivots, factor_ptr, widest, 0)
