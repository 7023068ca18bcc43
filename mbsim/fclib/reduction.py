"""From global problems and equality constraints to u = W r + q in blocks, and back to v and l.

Global to local: v = M^-1 (H r + G l + f), so that W = H'M^-1 H, V = H'M^-1 G, R = G'M^-1 G,
q = H'M^-1 f + w, s = G'M^-1 f + b. M falls into parts that share no entry (a rigid body, an
elastic one); each is factorised for itself, a large one as a sparse matrix with the touched
unknowns last, so that only the Schur complement on these is solved with.

Equality constraints: l = -R^-1 (V' r + s), so W - V R^-1 V' and q - V R^-1 s take the place of W
and q. Where R is singular, l is the shortest of the multipliers that fit, and there must be one.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsim.core.jitable import jitable
from mbsim.errors import ModelError
from mbsim.fclib.blocks import (
    block_rows,
    compressed_rows,
    diagonal_places,
    own_units,
    symmetric_pattern,
)
from mbsim.fclib.clock import compiled, unlimited
from mbsim.fclib.factor import factorise, partial_lu, solve, solve_many, transposed_places
from mbsim.fclib.ordering import analyse_late
from mbsim.fclib.problem import Global, Local, Matrix, matrix

if TYPE_CHECKING:
    from mbsim.fclib.problem import Vector

#: Largest part of M that is treated as a full matrix.
FULL = 48
#: Equality constraints hold in the range of R to this much, relatively.
RANGE = 1e-9


@dataclass(eq=False)
class Blocks:
    """u = W r + q, W in blocks (`blocks.block_rows`), and how to get l and v from r.

    `tangent` and `rolling` are the tuples whose lengths compiled code looks at; `rho` (nc,) turns a
    contact's velocity into the impulse that it is worth (`blocks.own_units`).
    """

    tangent: tuple[int, ...]
    rolling: tuple[int, ...]
    ptr: Any
    col: Any
    val: Any
    diagonal: Any
    q: Vector
    mu: Vector
    mu_r: Vector
    rho: Vector
    equality: Equality | None = None
    mass: tuple[Any, ...] | None = None

    @property
    def contacts(self) -> int:
        """Number of contacts."""
        return len(self.mu)


@dataclass(eq=False)
class Equality:
    """R l = -(V' r_T + s), r_T the impulses at `rows`.

    `factors`: (p, p + k + 1) R, V' of these k rows, and s after elimination: the upper triangle of
    the first p columns is that of R's factors.
    """

    rows: Any
    factors: Any


def directions(problem: Local | Global) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Return tuples as long as there are tangential and rolling directions."""
    d = problem.spacedim
    if problem.mu_r is None:
        return ((0,), ()) if d == 2 else ((0, 0), ())
    return ((0,), (0,)) if d == 3 else ((0, 0), (0, 0))


def reduce(problem: Local | Global) -> Blocks:
    """Return a problem in blocks, without equality constraints."""
    if isinstance(problem, Local):
        return _reduce_local(problem)
    return _reduce_global(problem)


def _blocks(
    problem: Local | Global, rows: tuple[Any, ...], q: Vector, equality: Equality | None
) -> Blocks:
    """Return blocks with what every problem has."""
    tangent, rolling = directions(problem)
    diagonal = compiled(diagonal_places)(rows[0], rows[1])
    mu_r = np.zeros(problem.contacts) if problem.mu_r is None else problem.mu_r
    ptr, col, val = rows
    rho = compiled(own_units)(val, diagonal)
    return Blocks(tangent, rolling, ptr, col, val, diagonal, q, problem.mu, mu_r, rho, equality)


def _rows(stored: Matrix) -> tuple[Any, ...]:
    """Return a stored matrix as compressed rows."""
    rows: tuple[Any, ...] = compiled(compressed_rows)(
        stored.m, stored.n, stored.nz, stored.p, stored.i, stored.x
    )
    return rows


def _reduce_local(problem: Local) -> Blocks:
    """Return a local problem in blocks."""
    d, nc = problem.spacedim, problem.contacts
    rows = compiled(block_rows)(d, nc, *_rows(problem.W))
    if problem.V is None or problem.R is None or problem.s is None:
        return _blocks(problem, rows, problem.q, None)
    v = compiled(full)(problem.V.m, problem.V.n, *_rows(problem.V))
    r = compiled(full)(problem.R.m, problem.R.n, *_rows(problem.R))
    rows, q, equality = _eliminate(d, rows, problem.q, v, r, problem.s)
    return _blocks(problem, rows, q, equality)


def _reduce_global(problem: Global) -> Blocks:
    """Return a global problem in blocks."""
    d, nc = problem.spacedim, problem.contacts
    n, m = problem.M.m, problem.H.n
    h = _rows(problem.H)
    if problem.G is not None:
        h = compiled(beside)(n, m, *h, *_rows(problem.G))
    p = problem.equalities
    extra = -(-p // d)
    done, mass = compiled(condense)(d, nc + extra, n, *_rows(problem.M), *h, problem.f)
    if not done[0]:
        raise ModelError("M is singular: a part of it cannot be factorised")
    ptr, col, val, free = done[1:]
    q = free[:m] + problem.w
    equality = None
    if p and problem.b is not None:
        ptr, col, val, v, r = compiled(split)(d, nc, extra, ptr, col, val)
        rows, q, equality = _eliminate(
            d, (ptr, col, val), q, v[:, :p], r[:p, :p], free[m : m + p] + problem.b
        )
        ptr, col, val = rows
    blocks = _blocks(problem, (ptr, col, val), q, equality)
    blocks.mass = mass
    return blocks


def _eliminate(
    d: int, rows: tuple[Any, ...], q: Vector, v: Any, r: Any, s: Vector
) -> tuple[tuple[Any, ...], Vector, Equality]:
    """Return blocks and q without the equality constraints' multipliers."""
    size = len(rows[0]) - 1
    touched = np.flatnonzero(np.abs(v).reshape(size, -1).max(axis=1) > 0.0).astype(np.int32)
    places = (d * touched[:, None] + np.arange(d)).reshape(-1)
    v = np.ascontiguousarray(v[places])
    factors, change, sound = compiled(without_multipliers)(v, np.ascontiguousarray(r), s)
    if not sound:
        right = np.concatenate((v.T, s[:, None]), axis=1)
        solved = np.linalg.lstsq(r, right, rcond=1e-12)[0]
        if np.abs(r @ solved - right).max(initial=0.0) > RANGE * np.abs(right).max(initial=0.0):
            raise ModelError(
                "equality constraints cannot be eliminated: V' or s is not in the range of R"
            )
        factors, change = np.concatenate((np.eye(len(s)), solved), axis=1), -(v @ solved)
    q = q.copy()
    q[places] += change[:, -1]
    rows = compiled(add_clique)(d, *rows, touched, np.ascontiguousarray(change[:, :-1]))
    return rows, q, Equality(places, factors)


@jitable
def without_multipliers(v, r, s):
    """Eliminate l from [R V' s; V 0 0], v: (k, p).

    Returns the rows of R after elimination (`Equality`), -V R^-1 [V' s] (k, k + 1), and whether R
    is regular: a nearly singular one gives enormous solutions, with a small residual or not. This
    is looked at with two right sides, sums of V' and s with signs that follow no pattern.
    """
    k, p = v.shape
    matrix = np.zeros((p + k + 1, p + k + 1))
    for i in range(p):
        for j in range(p):
            matrix[i, j] = r[i, j]
        for j in range(k):
            matrix[i, p + j] = v[j, i]
            matrix[p + j, i] = v[j, i]
        matrix[i, p + k] = s[i]
    largest, size = 0.0, 0.0
    for i in range(p):
        for j in range(p):
            largest = max(largest, abs(r[i, j]))
        for j in range(p, p + k + 1):
            size = max(size, abs(matrix[i, j]))
    sound = partial_lu(matrix, p, np.empty(p, np.int32), unlimited())
    signs = np.empty(k + 1)
    state = 1
    for _ in range(2):
        for j in range(k + 1):
            state = (1103515245 * state + 12345) % 2147483648
            signs[j] = 1.0 if state > 1073741824 else -1.0
        found = upper_solution(matrix, p, signs)
        for i in range(p):
            missing = -signs[k] * s[i]
            for j in range(k):
                missing -= signs[j] * v[j, i]
            for j in range(p):
                missing += r[i, j] * found[j]
            if not (abs(missing) <= RANGE * size and abs(found[i]) * largest <= 1e10 * size):
                sound = False
    return matrix[:p].copy(), matrix[p : p + k, p:].copy(), sound


@jitable
def upper_solution(factors, p, weights):
    """Return U^-1 Y w, U the upper triangle of the first p columns and Y those after them."""
    found = np.empty(p)
    for i in range(p - 1, -1, -1):
        row = factors[i]
        total = 0.0
        for j in range(len(weights)):
            total += row[p + j] * weights[j]
        for j in range(i + 1, p):
            total -= row[j] * found[j]
        found[i] = total / row[i]
    return found


def multipliers(blocks: Blocks, r: Vector) -> Vector | None:
    """Return l (p,) that goes with r, or None without equality constraints."""
    if blocks.equality is None:
        return None
    factors = blocks.equality.factors
    weights = -np.append(r[blocks.equality.rows], 1.0)
    found: Vector = compiled(upper_solution)(factors, len(factors), weights)
    return found


def velocities(problem: Global, blocks: Blocks, r: Vector, l: Vector | None) -> Vector:  # noqa: E741  FCLIB
    """Return v (n,) that goes with r and l: M v = H r + G l + f."""
    forces = problem.f + problem.H.apply(r)
    if problem.G is not None and l is not None:
        forces = forces + problem.G.apply(l)
    assert blocks.mass is not None
    v = np.empty(len(forces))
    compiled(mass_solve)(*blocks.mass, forces, v)
    return v


def local(problem: Global) -> Local:
    """Return the local problem that a global one condenses to; equality constraints are kept."""
    d, nc = problem.spacedim, problem.contacts
    n, m, p = problem.M.m, problem.H.n, problem.equalities
    h = _rows(problem.H)
    if problem.G is not None:
        h = compiled(beside)(n, m, *h, *_rows(problem.G))
    extra = -(-p // d)
    done, _ = compiled(condense)(d, nc + extra, n, *_rows(problem.M), *h, problem.f)
    if not done[0]:
        raise ModelError("M is singular: a part of it cannot be factorised")
    ptr, col, val, free = done[1:]
    q = free[:m] + problem.w
    from scipy import sparse

    whole = sparse.bsr_array((val, col, ptr), shape=(len(free), len(free))).tocsr()
    w = matrix(whole[:m, :m])
    if problem.b is None:
        return Local(d, w, q, problem.mu, mu_r=problem.mu_r, info=problem.info)
    v, r = matrix(whole[:m, m : m + p]), matrix(whole[m : m + p, m : m + p])
    s = free[m : m + p] + problem.b
    return Local(d, w, q, problem.mu, v, r, s, problem.mu_r, problem.info)


def globalised(problem: Local) -> Global:
    """Return a global problem with the same u and r: M = W, H = the unit matrix, f = 0.

    It needs a regular W; v is then u - q + w with w = q, that is v = W r + V l.
    """
    m = problem.W.m
    identity = matrix(_unit(m), "triplet")
    if problem.V is not None:
        raise ModelError("a local problem with V, R, s has no global form with its own matrices")
    inverse = np.linalg.inv(problem.W.csr().toarray())
    if not np.isfinite(inverse).all() or np.linalg.cond(inverse) > 1e14:
        raise ModelError("W is singular: the problem has no global form with H = 1")
    return Global(
        problem.spacedim,
        matrix(inverse, "triplet"),
        identity,
        np.zeros(m),
        problem.q,
        problem.mu,
        mu_r=problem.mu_r,
        info=problem.info,
    )


def _unit(size: int) -> Any:
    """Return a sparse unit matrix."""
    from scipy import sparse

    return sparse.eye_array(size)


# compiled


@jitable
def full(rows, columns, p, i, x):
    """Return compressed rows as a full matrix."""
    made = np.zeros((rows, columns))
    for a in range(rows):
        for k in range(p[a], p[a + 1]):
            made[a, i[k]] += x[k]
    return made


@jitable
def beside(rows, shift, p, i, x, other_p, other_i, other_x):
    """Return two matrices of compressed rows side by side, the second's columns after `shift`."""
    ptr = np.zeros(rows + 1, np.int32)
    col = np.empty(p[rows] + other_p[rows], np.int32)
    val = np.empty(len(col))
    at = 0
    for a in range(rows):
        for k in range(p[a], p[a + 1]):
            col[at] = i[k]
            val[at] = x[k]
            at += 1
        for k in range(other_p[a], other_p[a + 1]):
            col[at] = shift + other_i[k]
            val[at] = other_x[k]
            at += 1
        ptr[a + 1] = at
    return ptr, col, val


@jitable
def split(d, contacts, extra, ptr, col, val):
    """Split blocks into those among contacts, and full V and R (padded to whole blocks)."""
    v = np.zeros((d * contacts, d * extra))
    r = np.zeros((d * extra, d * extra))
    new_ptr = np.zeros(contacts + 1, np.int32)
    keep = np.empty(len(col), np.bool_)
    for a in range(contacts + extra):
        for k in range(ptr[a], ptr[a + 1]):
            b = col[k]
            keep[k] = a < contacts and b < contacts
            if keep[k]:
                new_ptr[a + 1] += 1
            elif a < contacts:
                first = d * (b - contacts)
                v[d * a : d * a + d, first : first + d] = val[k]
            elif b >= contacts:
                row, first = d * (a - contacts), d * (b - contacts)
                r[row : row + d, first : first + d] = val[k]
    for a in range(contacts):
        new_ptr[a + 1] += new_ptr[a]
    return new_ptr, col[keep], val[keep], v, r


@jitable
def add_clique(d, ptr, col, val, touched, addition):
    """Return blocks to which a full matrix among the `touched` contacts (rising) is added."""
    size = len(ptr) - 1
    place = np.full(size, -1, np.int32)
    for k in range(len(touched)):
        place[touched[k]] = k
    new_ptr = np.zeros(size + 1, np.int32)
    for a in range(size):
        count = 0
        for k in range(ptr[a], ptr[a + 1]):
            if place[a] < 0 or place[col[k]] < 0:
                count += 1
        new_ptr[a + 1] = new_ptr[a] + count + (len(touched) if place[a] >= 0 else 0)
    new_col = np.empty(new_ptr[size], np.int32)
    new_val = np.zeros((new_ptr[size], d, d))
    for a in range(size):
        at = new_ptr[a]
        if place[a] < 0:
            for k in range(ptr[a], ptr[a + 1]):
                new_col[at] = col[k]
                new_val[at] = val[k]
                at += 1
            continue
        # two rising lists into one
        k, j = ptr[a], 0
        row = d * place[a]
        while k < ptr[a + 1] or j < len(touched):
            if k < ptr[a + 1] and (j == len(touched) or col[k] < touched[j]):
                new_col[at] = col[k]
                new_val[at] = val[k]
                k += 1
            else:
                new_col[at] = touched[j]
                new_val[at] = addition[row : row + d, d * j : d * j + d]
                if k < ptr[a + 1] and col[k] == touched[j]:
                    new_val[at] += val[k]
                    k += 1
                j += 1
            at += 1
    return new_ptr, new_col, new_val


@jitable
def parts(n, p, i):
    """Return how many parts without common entries a matrix has, and every row's part."""
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
    part = np.empty(n, np.int32)
    count = 0
    for a in range(n):
        x = a
        while root[x] != x:
            x = root[x]
        if x == a:
            part[a] = count
            count += 1
        else:
            part[a] = part[x]
    return count, part


@jitable
def condense(d, nodes, n, mp, mi, mx, kp, ki, kx, f):
    """Return K' M^-1 K in blocks and K' M^-1 f, K (n, d * nodes) by compressed rows.

    Returns ((sound, ptr, col, val, free), mass); `mass` is what `mass_solve` needs.
    """
    count, part = parts(n, mp, mi)
    row_ptr = np.zeros(count + 1, np.int32)
    for a in range(n):
        row_ptr[part[a] + 1] += 1
    for c in range(count):
        row_ptr[c + 1] += row_ptr[c]
    place = row_ptr[:count].copy()
    rows = np.empty(n, np.int32)
    inside = np.empty(n, np.int32)
    for a in range(n):
        c = part[a]
        inside[a] = place[c] - row_ptr[c]
        rows[place[c]] = a
        place[c] += 1
    # nodes that each part touches
    seen = np.full(nodes, -1, np.int32)
    node_ptr = np.zeros(count + 1, np.int32)
    total = 0
    for c in range(count):
        for j in range(row_ptr[c], row_ptr[c + 1]):
            a = rows[j]
            for k in range(kp[a], kp[a + 1]):
                if seen[ki[k] // d] != c:
                    seen[ki[k] // d] = c
                    total += 1
        node_ptr[c + 1] = total
    touched = np.empty(total, np.int32)
    seen[:] = -1
    total = 0
    for c in range(count):
        for j in range(row_ptr[c], row_ptr[c + 1]):
            a = rows[j]
            for k in range(kp[a], kp[a + 1]):
                b = ki[k] // d
                if seen[b] != c:
                    seen[b] = c
                    touched[total] = b
                    total += 1
    # pattern: nodes that a part touches are neighbours
    pptr, ppart = _parts_of_nodes(nodes, count, node_ptr, touched)
    seen[:] = -1
    ptr = np.zeros(nodes + 1, np.int32)
    total = 0
    for a in range(nodes):
        seen[a] = a
        total += 1
        for j in range(pptr[a], pptr[a + 1]):
            c = ppart[j]
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
        for j in range(pptr[a], pptr[a + 1]):
            c = ppart[j]
            for k in range(node_ptr[c], node_ptr[c + 1]):
                b = touched[k]
                if seen[b] != a:
                    seen[b] = a
                    col[total] = b
                    total += 1
    ptr, col = symmetric_pattern(nodes, ptr, col)
    val = np.zeros((len(col), d, d))
    free = np.zeros(d * nodes)
    # full factors of small parts, one after the other; sparse ones of large parts in lists
    sizes = np.zeros(count + 1, np.int64)
    many = 0
    for c in range(count):
        size = row_ptr[c + 1] - row_ptr[c]
        sizes[c + 1] = sizes[c] + (size * size if size <= FULL else 0)
        many += 1 if size > FULL else 0
    dense = np.zeros(sizes[count])
    exchange = np.empty(n, np.int32)
    # of large parts: where their analysis and factors begin, unknowns of a node
    big = np.full((count, 3), -1, np.int64)
    analyses, big_factors = np.empty(0, np.int64), np.empty(0)
    local = np.empty(nodes, np.int32)
    sound = True
    until = unlimited()
    solved = np.empty(n)
    for c in range(count):
        size = row_ptr[c + 1] - row_ptr[c]
        mine = rows[row_ptr[c] : row_ptr[c + 1]]
        wide = node_ptr[c + 1] - node_ptr[c]
        for k in range(wide):
            local[touched[node_ptr[c] + k]] = k
        k_full = np.zeros((size, d * wide))
        for j in range(size):
            a = mine[j]
            for k in range(kp[a], kp[a + 1]):
                b = ki[k] // d
                k_full[j, d * local[b] + ki[k] - d * b] += kx[k]
        x = k_full.copy()
        y = np.empty(size)
        for j in range(size):
            y[j] = f[mine[j]]
        begin = 0
        if size <= FULL:
            lu = dense[sizes[c] : sizes[c + 1]].reshape(size, size)
            for j in range(size):
                a = mine[j]
                for k in range(mp[a], mp[a + 1]):
                    lu[j, inside[mi[k]]] += mx[k]
            swaps = exchange[row_ptr[c] : row_ptr[c + 1]]
            sound = partial_lu(lu, size, swaps, until) and sound
            if wide > 0:
                _full_solve(lu, swaps, x)
            _full_solve(lu, swaps, y.reshape(size, 1))
        else:
            swaps = exchange[row_ptr[c] : row_ptr[c + 1]]
            of_node, symbolic, factors, okay = _sparse_part(
                size, mine, inside, mp, mi, mx, kp, swaps
            )
            sound = okay and sound
            big[c, 0], big[c, 1], big[c, 2] = len(analyses), len(big_factors), of_node
            analyses = np.concatenate((analyses, _packed(symbolic)))
            big_factors = np.concatenate((big_factors, factors)) if len(big_factors) else factors
            begin = len(symbolic[2])
            for j in range(size):
                a = mine[j]
                if kp[a + 1] > kp[a]:
                    begin = min(begin, symbolic[4][j // of_node])
            if wide > 0:
                solve_many(
                    of_node,
                    begin,
                    symbolic,
                    factors,
                    swaps,
                    x,
                    np.empty((symbolic[6][0], d * wide)),
                )
            solve(of_node, symbolic, factors, swaps, y, np.empty(symbolic[6][0]))
        for j in range(size):
            solved[mine[j]] = y[j]
        if wide > 0:
            _add_part(
                d,
                size,
                mine,
                wide,
                touched[node_ptr[c] : node_ptr[c + 1]],
                kp,
                ki,
                kx,
                local,
                x,
                ptr,
                col,
                val,
            )
    for a in range(n):
        for k in range(kp[a], kp[a + 1]):
            free[ki[k]] += kx[k] * solved[a]
    # arrays, for lists take long to hand over
    mass = (row_ptr, rows, sizes, dense, exchange, big, analyses, big_factors)
    return (sound, ptr, col, val, free), mass


@jitable
def _parts_of_nodes(nodes, count, node_ptr, touched):
    """Return the parts that touch each node, by compressed rows."""
    pptr = np.zeros(nodes + 1, np.int32)
    for k in range(node_ptr[count]):
        pptr[touched[k] + 1] += 1
    for a in range(nodes):
        pptr[a + 1] += pptr[a]
    place = pptr[:nodes].copy()
    ppart = np.empty(node_ptr[count], np.int32)
    for c in range(count):
        for k in range(node_ptr[c], node_ptr[c + 1]):
            a = touched[k]
            ppart[place[a]] = c
            place[a] += 1
    return pptr, ppart


@jitable
def _sparse_part(size, mine, inside, mp, mi, mx, kp, exchange):
    """Factorise one large part of M, rows that K touches last; by blocks of 3 where it has them.

    Returns (unknowns of a node, symbolic, factors, soundness).
    """
    ptr = np.zeros(size + 1, np.int32)
    for j in range(size):
        ptr[j + 1] = ptr[j] + mp[mine[j] + 1] - mp[mine[j]]
    col = np.empty(ptr[size], np.int32)
    x = np.empty(ptr[size])
    at = 0
    for j in range(size):
        for k in range(mp[mine[j]], mp[mine[j] + 1]):
            col[at] = inside[mi[k]]
            x[at] = mx[k]
            at += 1
    d = 1
    if size % 3 == 0:
        bptr, bcol, val = block_rows(3, size // 3, ptr, col, x)
        d = 3 if 9 * len(bcol) <= 2 * len(col) else 1
    if d == 1:
        bptr, bcol, val = block_rows(1, size, ptr, col, x)
    nodes = size // d
    late = np.zeros(nodes, np.bool_)
    for j in range(size):
        a = mine[j]
        if kp[a + 1] > kp[a]:
            late[j // d] = True
    symbolic = analyse_late(nodes, bptr, bcol, d, late)
    factors = np.empty(symbolic[5][-1])
    back = transposed_places(nodes, bptr, bcol)
    sound = factorise(
        d, bptr, bcol, back, val, symbolic, factors, exchange,
        np.empty(symbolic[6][0] ** 2), np.empty(symbolic[6][1]), unlimited(),
    )  # fmt: skip
    return d, symbolic, factors, sound


@jitable
def _full_solve(lu, swaps, x):
    """Overwrite the columns of x by solutions with the factors of a full matrix."""
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
def _add_part(d, size, mine, wide, touched, kp, ki, kx, local, x, ptr, col, val):
    """Add K_c' X to the blocks, X = M_c^-1 K_c of one part."""
    product = np.zeros((d * wide, d * wide))
    for j in range(size):
        a = mine[j]
        source = x[j]
        for k in range(kp[a], kp[a + 1]):
            b = ki[k] // d
            target = product[d * local[b] + ki[k] - d * b]
            factor = kx[k]
            for t in range(len(target)):
                target[t] += factor * source[t]
    is_mine = np.full(len(ptr) - 1, False)
    for k in range(wide):
        is_mine[touched[k]] = True
    for k in range(wide):
        a = touched[k]
        for j in range(ptr[a], ptr[a + 1]):
            b = col[j]
            if is_mine[b]:
                first = d * local[b]
                for s in range(d):
                    for t in range(d):
                        val[j, s, t] += product[d * k + s, first + t]


@jitable
def _packed(symbolic):
    """Return what `solve` needs of an analysis as one array, sizes first."""
    front_ptr, nodes, pivots, _, _, factor_ptr, room = symbolic
    sizes = np.array([len(pivots), len(nodes), room[0]])
    return np.concatenate((sizes, front_ptr, nodes, pivots, factor_ptr))


@jitable
def _unpacked(packed):
    """Return the widest front, and what `solve` takes as `symbolic`."""
    fronts, entries, widest = packed[0], packed[1], packed[2]
    at = 3
    front_ptr = packed[at : at + fronts + 1]
    at += fronts + 1
    nodes = packed[at : at + entries]
    at += entries
    pivots = packed[at : at + fronts]
    at += fronts
    factor_ptr = packed[at : at + fronts + 1]
    return widest, (front_ptr, nodes, pivots, pivots, pivots, factor_ptr, pivots)


@jitable
def mass_solve(row_ptr, rows, sizes, dense, exchange, big, analyses, big_factors, forces, v):
    """Write M^-1 times a vector, with the factors of `condense`."""
    for c in range(len(row_ptr) - 1):
        mine = rows[row_ptr[c] : row_ptr[c + 1]]
        swaps = exchange[row_ptr[c] : row_ptr[c + 1]]
        size = len(mine)
        x = np.empty(size)
        for j in range(size):
            x[j] = forces[mine[j]]
        if big[c, 0] < 0:
            lu = dense[sizes[c] : sizes[c + 1]].reshape(size, size)
            _full_solve(lu, swaps, x.reshape(size, 1))
        else:
            widest, symbolic = _unpacked(analyses[big[c, 0] :])
            solve(big[c, 2], symbolic, big_factors[big[c, 1] :], swaps, x, np.empty(widest))
        for j in range(size):
            v[mine[j]] = x[j]
