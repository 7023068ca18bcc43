"""W as square blocks, one for each pair of contacts that share a body; the form solvers work on."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from mbsim.core.jitable import jitable

if TYPE_CHECKING:
    from mbsim.fclib.problem import Indices, Vector


class DelassusSystem(NamedTuple):
    """u = W r + q in blocks, with the friction of its contacts, as compiled code takes it.

    To hand it over from Python takes 1 us longer than its arrays one by one.

    Parameters
    ----------
    tangent, rolling
        Tuples whose *lengths* are the numbers of tangential and rolling directions, so that
        compiled loops over them are unrolled; a contact has d = 1 + their sum of unknowns.
    ptr, col, val, diagonal
        W (`block_rows`): val is (blocks, d, d); diagonal (nc,) says where the diagonal blocks are.
    q
        (m,), m = d nc.
    mu, mu_r
        (nc,) coefficients of friction and rolling friction.
    rho
        (nc,) what turns a contact's velocity into the impulse that it is worth (`own_units`).
    """

    tangent: tuple[int, ...]
    rolling: tuple[int, ...]
    ptr: Indices
    col: Indices
    val: Vector
    diagonal: Indices
    q: Vector
    mu: Vector
    mu_r: Vector
    rho: Vector


class Rows(NamedTuple):
    """A matrix by compressed rows."""

    ptr: Indices
    col: Indices
    val: Vector


@jitable
def compressed_rows(
    rows: int, columns: int, nz: int, p: Indices, i: Indices, x: Vector
) -> tuple[Indices, Indices, Vector]:
    """Return a matrix of any FCLIB storage as compressed rows (pointers, columns, values)."""
    if nz == -2:
        return p, i, x
    count = nz if nz >= 0 else p[columns]
    ptr = np.zeros(rows + 1, np.int32)
    for k in range(count):
        ptr[i[k] + 1] += 1
    for k in range(rows):
        ptr[k + 1] += ptr[k]
    place = ptr[:rows].copy()
    col = np.empty(count, np.int32)
    val = np.empty(count)
    if nz >= 0:
        for k in range(count):
            at = place[i[k]]
            place[i[k]] += 1
            col[at] = p[k]
            val[at] = x[k]
    else:
        for c in range(columns):
            for k in range(p[c], p[c + 1]):
                at = place[i[k]]
                place[i[k]] += 1
                col[at] = c
                val[at] = x[k]
    return ptr, col, val


@jitable
def dense(rows: int, columns: int, p: Indices, i: Indices, x: Vector) -> Vector:
    """Return compressed rows as a dense matrix."""
    made = np.zeros((rows, columns))
    for a in range(rows):
        for k in range(p[a], p[a + 1]):
            made[a, i[k]] += x[k]
    return made


@jitable
def beside(
    rows: int,
    shift: int,
    p: Indices,
    i: Indices,
    x: Vector,
    other_p: Indices,
    other_i: Indices,
    other_x: Vector,
) -> tuple[Indices, Indices, Vector]:
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
def block_rows(
    d: int, contacts: int, p: Indices, i: Indices, x: Vector
) -> tuple[Indices, Indices, Vector]:
    """Return compressed rows as blocks: pointers, columns (rising), values (blocks, d, d).

    The pattern is made symmetric and every diagonal block is there, zeros included.
    """
    # a table: dividing every column takes longer than all the rest
    node = np.empty(d * contacts, np.int32)
    for a in range(contacts):
        for row in range(d * a, d * a + d):
            node[row] = a
    seen = np.full(contacts, -1, np.int32)
    counts = np.zeros(contacts + 1, np.int32)
    upper = np.empty(contacts + p[d * contacts], np.int32)  # no more than one block an entry
    total = 0
    for a in range(contacts):
        seen[a] = a
        upper[total] = a
        total += 1
        last = a  # neighbours in a row are mostly of one block
        for k in range(p[d * a], p[d * a + d]):
            b = node[i[k]]
            if b == last:
                continue
            last = b
            if seen[b] != a:
                seen[b] = a
                upper[total] = b
                total += 1
        counts[a + 1] = total
    ptr, col = symmetric_pattern(contacts, counts, upper[:total])
    val = np.zeros((len(col), d, d))
    where = np.empty(contacts, np.int32)
    for a in range(contacts):
        for k in range(ptr[a], ptr[a + 1]):
            where[col[k]] = k
        for row in range(d):
            last, place = -1, 0
            for k in range(p[d * a + row], p[d * a + row + 1]):
                b = node[i[k]]
                if b != last:
                    last, place = b, where[b]
                val[place, row, i[k] - d * b] += x[k]
    return ptr, col, val


@jitable
def diagonal_places(ptr: Indices, col: Indices) -> Indices:
    """Return where each row's diagonal block is."""
    places = np.empty(len(ptr) - 1, np.int32)
    for a in range(len(ptr) - 1):
        for k in range(ptr[a], ptr[a + 1]):
            if col[k] == a:
                places[a] = k
    return places


@jitable
def mean_diagonals(system: DelassusSystem) -> tuple[Vector, float]:
    """Return the mean diagonal of each contact's block (nc,), and that of W."""
    val = system.val
    d, nc = 1 + len(system.tangent) + len(system.rolling), len(system.diagonal)
    means = np.zeros(nc)
    mean = 0.0
    for a in range(nc):
        for s in range(d):
            means[a] += val[system.diagonal[a], s, s] / d
        mean += means[a] / nc
    return means, mean


@jitable
def _largest_of_three(a: float, b: float, c: float, e: float, f: float, g: float) -> float:
    """Return the largest eigenvalue of [[a, e, f], [e, b, g], [f, g, c]], by the roots' cosines."""
    mean = (a + b + c) / 3.0
    a, b, c = a - mean, b - mean, c - mean
    spread = math.sqrt((a * a + b * b + c * c + 2.0 * (e * e + f * f + g * g)) / 6.0)
    if not spread > 0.0:
        return mean
    half = 0.5 * (a * (b * c - g * g) - e * (e * c - g * f) + f * (e * g - b * f)) / spread**3
    return mean + 2.0 * spread * math.cos(math.acos(min(max(half, -1.0), 1.0)) / 3.0)


@jitable
def _largest_of_many(block: Vector, trace: float, power: Vector, square: Vector) -> float:
    """Return nearly the largest eigenvalue of a block's symmetric part, over the trace.

    `power` is that part over the trace; it and `square` are overwritten.
    """
    d = len(power)
    for _ in range(5):
        size = 0.0
        for s in range(d):
            for t in range(d):
                square[s, t] = 0.0
                for k in range(d):
                    square[s, t] += power[s, k] * power[k, t]
            size += square[s, s]
        for s in range(d):
            for t in range(d):
                power[s, t] = square[s, t] / size
    best = 0
    for s in range(1, d):
        best = s if power[s, s] > power[best, best] else best
    along, length = 0.0, 0.0
    for s in range(d):
        length += power[s, best] ** 2
        for t in range(d):
            along += power[s, best] * block[s, t] * power[t, best]
    return along / (length * trace)


@jitable
def own_units(val: Vector, diagonal: Indices) -> Vector:
    """Return rho (contacts,), 1 / lambda_max of the symmetric part of each diagonal block.

    Of blocks larger than 3 x 3 five squarings bring out the largest eigenvalue, and a Rayleigh
    quotient gives it to 0.3 % at worst. A block without a positive one gets the mean of the others,
    or 1.
    """
    d = val.shape[1]
    rho = np.empty(len(diagonal))
    total, found = 0.0, 0
    power, square = np.empty((d, d)), np.empty((d, d))
    for a in range(len(diagonal)):
        block = val[diagonal[a]]
        trace = 0.0
        for s in range(d):
            trace += block[s, s]
        rho[a] = 0.0
        if not trace > 0.0:
            continue
        for s in range(d):
            for t in range(d):
                power[s, t] = 0.5 * (block[s, t] + block[t, s]) / trace
        largest = 0.0
        if d == 2:
            apart = 0.5 * (power[0, 0] - power[1, 1])
            largest = 0.5 + math.sqrt(apart**2 + power[0, 1] ** 2)
        elif d == 3:
            largest = _largest_of_three(
                power[0, 0], power[1, 1], power[2, 2], power[0, 1], power[0, 2], power[1, 2]
            )
        else:
            largest = _largest_of_many(block, trace, power, square)
        if largest > 0.0:
            rho[a] = 1.0 / (largest * trace)
            total += rho[a]
            found += 1
    for a in range(len(rho)):
        if rho[a] == 0.0:
            rho[a] = total / found if found > 0 else 1.0
    return rho


@jitable
def diagonal_and_units(ptr: Indices, col: Indices, val: Vector) -> tuple[Indices, Vector]:
    """Return where each row's diagonal block is, and `own_units`."""
    diagonal = diagonal_places(ptr, col)
    return diagonal, own_units(val, diagonal)


@jitable
def transposed_pattern(
    rows: int, columns: int, ptr: Indices, col: Indices
) -> tuple[Indices, Indices]:
    """Return the transpose of a pattern, its columns rising."""
    tptr = np.zeros(columns + 1, np.int32)
    for k in range(ptr[rows]):
        tptr[col[k] + 1] += 1
    for b in range(columns):
        tptr[b + 1] += tptr[b]
    free = tptr[:columns].copy()  # where the next entry of a row of the transpose goes
    tcol = np.empty(ptr[rows], np.int32)
    for a in range(rows):
        for k in range(ptr[a], ptr[a + 1]):
            b = col[k]
            tcol[free[b]] = a
            free[b] += 1
    return tptr, tcol


@jitable
def symmetric_pattern(size: int, ptr: Indices, col: Indices) -> tuple[Indices, Indices]:
    """Return the union of a pattern and its transpose, columns rising."""
    tptr, tcol = transposed_pattern(size, size, ptr, col)
    seen = np.full(size, -1, np.int32)
    total = 0
    same = True
    for a in range(size):
        if tptr[a + 1] != ptr[a + 1]:
            same = False
            break
        for k in range(ptr[a], ptr[a + 1]):
            seen[col[k]] = a
        for k in range(tptr[a], tptr[a + 1]):
            if seen[tcol[k]] != a:
                same = False
    if same:
        return tptr, tcol
    seen[:] = -1
    for a in range(size):
        for k in range(ptr[a], ptr[a + 1]):
            seen[col[k]] = a
        total += ptr[a + 1] - ptr[a]
        for k in range(tptr[a], tptr[a + 1]):
            if seen[tcol[k]] != a:
                total += 1
    sptr = np.zeros(size + 1, np.int32)
    scol = np.empty(total, np.int32)
    seen[:] = -1
    at = 0
    for a in range(size):
        for k in range(ptr[a], ptr[a + 1]):
            seen[col[k]] = a
            scol[at] = col[k]
            at += 1
        for k in range(tptr[a], tptr[a + 1]):
            if seen[tcol[k]] != a:
                scol[at] = tcol[k]
                at += 1
        sptr[a + 1] = at
    # a symmetric pattern is its own transpose, and that comes out sorted
    return transposed_pattern(size, size, sptr, scol)


@jitable
def add_row(
    tangent: tuple[int, ...],
    rolling: tuple[int, ...],
    col: Indices,
    val: Vector,
    r: Vector,
    begin: int,
    end: int,
    out: Vector,
    first: int,
) -> None:
    """Add blocks begin:end of a row times r to `out` from place `first` on."""
    d = 1 + len(tangent) + len(rolling)
    if d == 3:
        # sums in registers: a store for each block would hold up the next one
        s0, s1, s2 = out[first], out[first + 1], out[first + 2]
        for k in range(begin, end):
            b = d * col[k]
            r0, r1, r2 = r[b], r[b + 1], r[b + 2]
            s0 += val[k, 0, 0] * r0 + val[k, 0, 1] * r1 + val[k, 0, 2] * r2
            s1 += val[k, 1, 0] * r0 + val[k, 1, 1] * r1 + val[k, 1, 2] * r2
            s2 += val[k, 2, 0] * r0 + val[k, 2, 1] * r1 + val[k, 2, 2] * r2
        out[first], out[first + 1], out[first + 2] = s0, s1, s2
        return
    for k in range(begin, end):
        b = d * col[k]
        for row in range(d):
            total = 0.0
            for c in range(d):
                total += val[k, row, c] * r[b + c]
            out[first + row] += total


@jitable
def product(system: DelassusSystem, q: Vector, r: Vector, u: Vector) -> None:
    """Write u = W r + q, q that of the system or another one."""
    tangent, rolling = system.tangent, system.rolling
    ptr, col, val = system.ptr, system.col, system.val
    d = 1 + len(tangent) + len(rolling)
    for a in range(len(ptr) - 1):
        for row in range(d):
            u[d * a + row] = q[d * a + row]
        add_row(tangent, rolling, col, val, r, ptr[a], ptr[a + 1], u, d * a)


@jitable
def product_of_stored(
    rows: int, nz: int, p: Indices, i: Indices, x: Vector, r: Vector, u: Vector
) -> None:
    """Add A r to u, A of any FCLIB storage."""
    if nz == -2:
        for a in range(rows):
            total = 0.0
            for k in range(p[a], p[a + 1]):
                total += x[k] * r[i[k]]
            u[a] += total
    elif nz == -1:
        for c in range(len(p) - 1):
            value = r[c]
            for k in range(p[c], p[c + 1]):
                u[i[k]] += x[k] * value
    else:
        for k in range(nz):
            u[i[k]] += x[k] * r[p[k]]


@jitable
def transposed_product_of_stored(
    rows: int, nz: int, p: Indices, i: Indices, x: Vector, r: Vector, u: Vector
) -> None:
    """Add A' r to u, A of any FCLIB storage."""
    if nz == -2:
        for a in range(rows):
            for k in range(p[a], p[a + 1]):
                u[i[k]] += x[k] * r[a]
    elif nz == -1:
        for c in range(len(p) - 1):
            total = 0.0
            for k in range(p[c], p[c + 1]):
                total += x[k] * r[i[k]]
            u[c] += total
    else:
        for k in range(nz):
            u[p[k]] += x[k] * r[i[k]]
