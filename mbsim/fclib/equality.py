"""Equality constraints out of u = W r + V l + q, V' r + R l + s = 0.

l = -R^-1 (V' r + s), so W - V R^-1 V' and q - V R^-1 s take the place of W and q. Where R is
singular, l is the shortest of the multipliers that fit, and there must be one.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsim.core.jitable import jitable
from mbsim.errors import ModelError
from mbsim.fclib.clock import compiled, unlimited
from mbsim.fclib.factor import partial_lu

if TYPE_CHECKING:
    from mbsim.fclib.problem import Vector

#: Equality constraints hold in the range of R to this much, relatively.
RANGE = 1e-9


@dataclass(eq=False)
class Equality:
    """R l = -(V' r_T + s), r_T the impulses at `rows`.

    `factors`: (p, p + k + 1) R, V' of these k rows, and s after elimination: the upper triangle of
    the first p columns is that of R's factors.
    """

    rows: Any
    factors: Any


def eliminate(
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
