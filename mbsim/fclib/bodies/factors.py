"""I + M^-1 H D H' in blocks of 6 x 6: its pattern, its fronts and its factors.

D is block-diagonal by contacts, so that only bodies that touch are neighbours. Islands of bodies
are separate trees of fronts.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from mbsim.core.jitable import jitable
from mbsim.fclib.bodies.system import SIX, velocities_by
from mbsim.fclib.factor import (
    Factors,
    factor_work,
    factorise,
    room_for_factors,
    solve,
    transposed_places,
)
from mbsim.fclib.ordering import Analysis, analyse, elimination_flops

if TYPE_CHECKING:
    from mbsim.fclib.bodies.system import BodySystem
    from mbsim.fclib.problem import Flags, Indices, Vector


#: Contacts in the matrix over closed ones: with some that have opened it is not analysed anew.
SPARE = 1.2


class BodyMatrix(NamedTuple):
    """The matrix of a set of contacts, analysed once.

    Parameters
    ----------
    held
        (nc,) whether a contact is one of them.
    number
        (bodies,) a body's node, -1 for those that no contact moves.
    ptr, col, back, val
        The matrix in blocks; `back` by `factor.transposed_places`.
    place
        (nc, 2, 2) the block of each pair of a contact's bodies, -1: none.
    analysis, factors
        Its fronts and its factors.
    x
        (6 nodes,) a right side and its solution.
    """

    held: Flags
    number: Indices
    ptr: Indices
    col: Indices
    back: Indices
    val: Vector
    place: Indices
    analysis: Analysis
    factors: Factors
    x: Vector


@jitable
def _neighbours(
    nodes: int, number: Indices, bodies: Indices, held: Flags
) -> tuple[Indices, Indices]:
    """Return the pattern of bodies that touch, columns rising, with its diagonal."""
    counts = np.ones(nodes + 1, np.int64)
    counts[0] = 0
    for a in range(len(bodies)):
        one, two = bodies[a, 0], bodies[a, 1]
        if held[a] and one >= 0 and two >= 0 and one != two:
            counts[number[one] + 1] += 1
            counts[number[two] + 1] += 1
    for k in range(nodes):
        counts[k + 1] += counts[k]
    place = counts[:nodes].copy()
    every = np.empty(counts[nodes], np.int32)
    for k in range(nodes):
        every[place[k]] = k
        place[k] += 1
    for a in range(len(bodies)):
        one, two = bodies[a, 0], bodies[a, 1]
        if held[a] and one >= 0 and two >= 0 and one != two:
            i, j = number[one], number[two]
            every[place[i]], every[place[j]] = j, i
            place[i] += 1
            place[j] += 1
    ptr = np.zeros(nodes + 1, np.int32)
    col = np.empty(counts[nodes], np.int32)
    at = 0
    for k in range(nodes):
        mine = every[counts[k] : counts[k + 1]]
        mine.sort()
        for j in range(len(mine)):
            if j == 0 or mine[j] != mine[j - 1]:
                col[at] = mine[j]
                at += 1
        ptr[k + 1] = at
    return ptr, col[:at].copy()


@jitable
def _places(bodies: Indices, held: Flags, number: Indices, ptr: Indices, col: Indices) -> Indices:
    """Return the block of each pair of a contact's bodies (`BodyMatrix.place`)."""
    place = np.full((len(bodies), 2, 2), np.int32(-1))
    for a in range(len(bodies)):
        if not held[a]:
            continue
        for side in range(2):
            for other in range(2):
                if bodies[a, side] >= 0 and bodies[a, other] >= 0:
                    row, wanted = number[bodies[a, side]], number[bodies[a, other]]
                    low, high = ptr[row], ptr[row + 1] - 1
                    while low < high:
                        middle = (low + high) // 2
                        if col[middle] < wanted:
                            low = middle + 1
                        else:
                            high = middle
                    place[a, side, other] = low
    return place


@jitable
def _numbered(bodies: Indices, count: int, held: Flags) -> tuple[int, Indices]:
    """Return how many of `count` bodies contacts `held` move, and each body's node, else -1."""
    number = np.full(count, np.int32(-1))
    for a in range(len(bodies)):
        for side in range(2):
            if held[a] and bodies[a, side] >= 0:
                number[bodies[a, side]] = 0
    nodes = 0
    for b in range(count):
        if number[b] >= 0:
            number[b] = nodes
            nodes += 1
    return nodes, number


@jitable
def body_matrix(system: BodySystem, count: int, held: Flags) -> BodyMatrix:
    """Return the matrix of contacts `held` of `count` bodies, analysed, with room for factors."""
    bodies = system.bodies
    nodes, number = _numbered(bodies, count, held)
    ptr, col = _neighbours(nodes, number, bodies, held)
    place = _places(bodies, held, number, ptr, col)
    analysis = analyse(nodes, ptr, col, SIX)
    return BodyMatrix(
        held, number, ptr, col, transposed_places(nodes, ptr, col),
        np.empty((len(col), SIX, SIX)), place, analysis, room_for_factors(analysis, SIX * nodes),
        np.empty(SIX * nodes),
    )  # fmt: skip


@jitable
def work_of(analysis: Analysis, blocks: int, contacts: int) -> float:
    """Return the estimated seconds of a Newton iteration (`factor_work`)."""
    entries = float(analysis.factor_ptr[-1])
    factors = factor_work(elimination_flops(analysis, SIX), 4 * blocks)
    return factors + 1e-9 * entries + 5e-7 * contacts


@jitable
def newton_work(bodies: Indices, count: int) -> float:
    """Return `work_of` contacts of `count` bodies that are all closed; nothing is factorised."""
    held = np.ones(len(bodies), np.bool_)
    nodes, number = _numbered(bodies, count, held)
    ptr, col = _neighbours(nodes, number, bodies, held)
    return work_of(analyse(nodes, ptr, col, SIX), len(col), len(bodies))


@jitable
def closed_matrix(system: BodySystem, slip: Vector, matrix: BodyMatrix) -> BodyMatrix:
    """Return the matrix over the contacts that are closed now (slip[:, 0] not 0).

    It stays as it is if all of these are in it, and few others (SPARE).
    """
    closed, missing, held = 0, 0, 0
    for a in range(len(slip)):
        if slip[a, 0] != 0.0:
            closed += 1
            missing += 0 if matrix.held[a] else 1
        held += 1 if matrix.held[a] else 0
    if missing == 0 and held <= SPARE * closed:
        return matrix
    now = np.empty(len(slip), np.bool_)
    for a in range(len(slip)):
        now[a] = slip[a, 0] != 0.0 or (matrix.held[a] and held + missing <= SPARE * closed)
    return body_matrix(system, len(matrix.number), now)


@jitable
def assemble(system: BodySystem, matrix: BodyMatrix, derivative: Vector) -> None:
    """Write I + M^-1 H D H' into matrix.val; `derivative` (nc, d, d) is D, 0 for open contacts."""
    ptr, col, val, place = matrix.ptr, matrix.col, matrix.val, matrix.place
    d = 1 + len(system.tangent) + len(system.rolling)
    val[:] = 0.0
    for a in range(len(ptr) - 1):
        for k in range(ptr[a], ptr[a + 1]):
            if col[k] == a:
                for i in range(SIX):
                    val[k, i, i] = 1.0
    part = np.empty((d, SIX))
    for a in range(len(system.mu)):
        if matrix.held[a]:
            for other in range(2):
                if place[a, other, other] >= 0:
                    _add_products(system, a, other, derivative[a], place[a], part, val)


@jitable
def _add_products(
    system: BodySystem, a: int, other: int, mine: Vector, place: Indices, part: Vector, val: Vector
) -> None:
    """Add M^-1 h' D h of contact a, with h of one of its bodies on the right, to the blocks.

    `mine` (d, d) is its D, `part` (d, 6) room for D h.
    """
    d = len(part)
    for s in range(d):
        for j in range(SIX):
            part[s, j] = 0.0
            for t in range(d):
                part[s, j] += mine[s, t] * system.h[a, other, t, j]
    for side in range(2):
        k = place[side, other]
        if k < 0:
            continue
        for i in range(SIX):
            for j in range(SIX):
                total = 0.0
                for s in range(d):
                    total += system.pull[a, side, i, s] * part[s, j]
                val[k, i, j] += total


@jitable
def factor_bodies(matrix: BodyMatrix, until: Vector) -> bool:
    """Factorise; return whether that went well and in time (`clock.until`)."""
    if len(matrix.x) == 0:
        return True
    return factorise(
        SIX, matrix.ptr, matrix.col, matrix.back, matrix.val, matrix.analysis, matrix.factors, until
    )


@jitable
def solve_bodies(system: BodySystem, matrix: BodyMatrix, c: Vector, v: Vector) -> None:
    """Write v (bodies, 6) with (I + M^-1 H D H') v = M^-1 H c; c (m,) are impulses."""
    x, number = matrix.x, matrix.number
    velocities_by(system, c, v)
    for b in range(len(number)):
        if number[b] >= 0:
            for i in range(SIX):
                x[SIX * number[b] + i] = v[b, i]
    if len(x) > 0:
        solve(SIX, matrix.analysis, matrix.factors, x)
    for b in range(len(number)):
        if number[b] >= 0:
            for i in range(SIX):
                v[b, i] = x[SIX * number[b] + i]
