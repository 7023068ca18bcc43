"""Which leaves of two meshes may have pieces in each other's layers, kept while they hardly move.

A walk through both trees with boxes that have `reach` more room finds every pair of leaves that
may overlap until a point of I has moved by `reach` in J's axes. Until then the trees are not
walked: what is measured at each pose are these leaves, in the order of the walk, and those of them
that are apart have no pieces. So results do not depend on what is kept.
"""

from __future__ import annotations

import math

import numpy as np

from mbsim.core.arrays import F1, F2
from mbsim.core.jitable import jitable, uncounted
from mbsim.geometry.mesh.oriented import I_IN_J, J_IN_I, extent, node_at, ways_between
from mbsim.geometry.mesh.tree import WAITING
from mbsim.model.surface import (
    AHEAD,
    AT_BOXES,
    AT_KEPT,
    COUNT,
    DEEP_BOX,
    KEPT,
    LAST_POSE,
    LEAVES,
    LEVELS,
    LISTS,
    MOST_LEAVES,
    NODE,
    OTHER,
    POSE,
    REACH,
    ROWS,
    TURN,
)
from mbsim.model.surface_tree import FIRST, LAST

#: Nodes of so few triangles are looked at as leaves.
FEW = 2
#: What is kept reaches as far as I moves in so many evaluations: at most, and at least to be worth
#: its walk; it grows so much from walk to walk, and is halved where the list has so many times the
#: pairs of leaves that are near now. Farther than so many parts of a leaf's size none is made.
EVALUATIONS, WORTH, GROWS, LONGER, PART = 8.0, 2.0, 1.1, 1.5, 0.25


@uncounted
def moved_at_most(mesh: F1, before: F1, pose: F1) -> float:
    """Return the most that a point in the box of a mesh and its layer moved between two poses."""
    at = int(mesh[AT_BOXES]) + NODE + DEEP_BOX
    square, total = 0.0, 0.0
    for r in range(3):
        way = pose[r] - before[r]
        for c in range(3):
            way += (pose[3 + 3 * r + c] - before[3 + 3 * r + c]) * mesh[at + c]
        square += way * way
    for c in range(3):
        turned = 0.0
        for r in range(3):
            change = pose[3 + 3 * r + c] - before[3 + 3 * r + c]
            turned += change * change
        total += mesh[at + 3 + c] * math.sqrt(turned)
    return math.sqrt(square) + total


@jitable
def leaves_within(mesh_i: F1, mesh_j: F1, pose: F1, reach: float) -> tuple[int, int, F1]:
    """Return how many pairs of leaves are nearer than `reach`, how many of them have room now.

    And where both's numbers begin.
    """
    count, now, found = 0, 0, np.empty(128)
    waiting = np.empty((4 * WAITING, 3), np.int64)
    waiting[0, 0], waiting[0, 1], waiting[0, 2] = 1, 1, I_IN_J | J_IN_I
    many = 1
    leaves_i, leaves_j = 1 << int(mesh_i[LEVELS]), 1 << int(mesh_j[LEVELS])
    while many > 0:
        many -= 1
        i, j, ways = waiting[many, 0], waiting[many, 1], waiting[many, 2]
        box_i, box_j = node_at(mesh_i, i), node_at(mesh_j, j)
        ways = ways_between(mesh_i, box_i, mesh_j, box_j, ways, pose, reach)
        if ways == 0:
            continue
        ends_i = i >= leaves_i or mesh_i[box_i + LAST] - mesh_i[box_i + FIRST] <= FEW
        ends_j = j >= leaves_j or mesh_j[box_j + LAST] - mesh_j[box_j + FIRST] <= FEW
        if ends_i and ends_j:
            if 2 * count == len(found):
                larger = np.empty(4 * count)
                larger[: 2 * count] = found
                found = larger
            found[2 * count], found[2 * count + 1] = box_i, box_j
            count += 1
            if reach == 0.0 or ways_between(mesh_i, box_i, mesh_j, box_j, ways, pose, 0.0) != 0:
                now += 1
            continue
        of_i = not ends_i and (ends_j or extent(mesh_i, box_i) > extent(mesh_j, box_j))
        for k in range(2):
            waiting[many, 0], waiting[many, 1] = (2 * i + k, j) if of_i else (i, 2 * j + k)
            waiting[many, 2] = ways
            many += 1
    return count, now, found


@jitable
def list_of(mesh: F1, rows: float, other: float) -> int:
    """Return where the list of a pair begins in a mesh; that of another one is given up for it.

    `rows` and `other` are the addresses of the pair's rows, which pairs may have one after the
    other, and of the other mesh.
    """
    first = int(mesh[AT_KEPT])
    at = first + 1 + KEPT * int(mesh[first + TURN])
    for k in range(LISTS):
        here = first + 1 + KEPT * k
        if mesh[here + ROWS] == rows:
            if mesh[here + OTHER] == other:
                return here
            at = here
    mesh[first + TURN] = (mesh[first + TURN] + 1.0) % LISTS
    mesh[at + ROWS], mesh[at + OTHER], mesh[at + REACH] = rows, other, -1.0
    mesh[at + AHEAD] = EVALUATIONS
    # nothing is known of how it moves
    mesh[at + LAST_POSE] = math.nan
    return at


@jitable
def candidates(mesh_i: F1, mesh_j: F1, pose: F1, points: F2) -> tuple[int, F1]:
    """Return how many pairs of leaves may have pieces, and where both's numbers begin.

    Parameters
    ----------
    mesh_i, mesh_j : ndarray
        Packed surfaces with layers (`model.surface`); I keeps the list.
    pose : ndarray, shape (12,)
        I in J's axes: origin, rotation by rows.
    points : ndarray
        The pair's rows: no other pair has these at the same time.
    """
    at = list_of(mesh_i, float(points.ctypes.data), float(mesh_j.ctypes.data))
    moved = moved_at_most(mesh_i, mesh_i[at + LAST_POSE :], pose)
    mesh_i[at + LAST_POSE : at + LAST_POSE + 12] = pose[:12]
    if mesh_i[at + REACH] >= moved_at_most(mesh_i, mesh_i[at + POSE :], pose):
        count = int(mesh_i[at + COUNT])
        kept = np.empty(2 * count)
        kept[:] = mesh_i[at + LEAVES : at + LEAVES + 2 * count]
        return count, kept
    ahead = mesh_i[at + AHEAD]
    most = PART * extent(mesh_i, node_at(mesh_i, 1)) / math.sqrt(1 << int(mesh_i[LEVELS]))
    reach = ahead * moved if ahead >= WORTH and ahead * moved <= most else 0.0
    count, now, found = leaves_within(mesh_i, mesh_j, pose, reach)
    fits = count <= min(LONGER * now + FEW, MOST_LEAVES)
    mesh_i[at + AHEAD] = min(GROWS * ahead, EVALUATIONS) if fits or reach == 0.0 else 0.5 * ahead
    mesh_i[at + REACH] = -1.0
    if count <= MOST_LEAVES:
        mesh_i[at + LEAVES : at + LEAVES + 2 * count] = found[: 2 * count]
        mesh_i[at + POSE : at + POSE + 12] = pose[:12]
        mesh_i[at + COUNT], mesh_i[at + REACH] = count, reach
    return count, found
