"""A mesh on a half-space: the triangles below the plane, cut by it."""

from __future__ import annotations

import math

import numpy as np

from mbsim.core.arrays import F1, F2, I1, I2, V3
from mbsim.core.jitable import jitable, uncounted
from mbsim.core.rotation import cross, dot, sub, vector
from mbsim.geometry.mesh.polygon import CORNER as POLYGON_CORNER
from mbsim.geometry.mesh.polygon import CORNERS, begin, cut, integrate
from mbsim.geometry.mesh.record import (
    MOMENT,
    OF_SQUARE,
    PATCH_NUMBERS,
    POTENTIAL,
    PRESSURE,
    PUSH,
    SPREAD,
    SUMS,
    TWIST,
    VOLUME,
    add_piece,
)
from mbsim.geometry.mesh.tree import WAITING, leaf_range, lowest
from mbsim.model.surface import (
    AT_BOXES,
    AT_MARKS,
    AT_TRIANGLES,
    BESIDE,
    LEVELS,
    NODE,
    TRIANGLE,
)

#: A box is looked into if it may hold what is lower by more than this part of its own height.
ROUNDING = 1e-14


@jitable
def lowest_corner(mesh: F1, n: V3) -> tuple[float, V3]:
    """Return the least height of a mesh along n, and the corner that has it."""
    waiting = np.empty(WAITING, np.int64)
    waiting[0], count = 1, 1
    best, corner = math.inf, (0.0, 0.0, 0.0)
    boxes, triangles, leaves = int(mesh[AT_BOXES]), int(mesh[AT_TRIANGLES]), 1 << int(mesh[LEVELS])
    while count > 0:
        count -= 1
        node = waiting[count]
        low = lowest(mesh, boxes + NODE * node, n)
        if low >= best - ROUNDING * abs(best):
            continue
        if node < leaves:
            left, right = 2 * node, 2 * node + 1
            if lowest(mesh, boxes + NODE * left, n) < lowest(mesh, boxes + NODE * right, n):
                left, right = right, left
            waiting[count], waiting[count + 1] = left, right
            count += 2
            continue
        first, last = leaf_range(mesh, node)
        for t in range(first, last):
            for k in range(3):
                p = vector(mesh, triangles + TRIANGLE * t + 3 * k)
                height = dot(p, n)
                if height < best:
                    best, corner = height, p
    return best, corner


@jitable
def triangles_below(mesh: F1, n: V3, height: float, found: I1) -> int:
    """Write the triangles that have a corner below the plane x.n = height; return how many."""
    waiting = np.empty(WAITING, np.int64)
    waiting[0], count, many = 1, 1, 0
    boxes, triangles, leaves = int(mesh[AT_BOXES]), int(mesh[AT_TRIANGLES]), 1 << int(mesh[LEVELS])
    while count > 0:
        count -= 1
        node = waiting[count]
        if lowest(mesh, boxes + NODE * node, n) >= height:
            continue
        if node < leaves:
            waiting[count], waiting[count + 1] = 2 * node, 2 * node + 1
            count += 2
            continue
        first, last = leaf_range(mesh, node)
        for t in range(first, last):
            at = triangles + TRIANGLE * t
            a, b, c = vector(mesh, at), vector(mesh, at + 3), vector(mesh, at + 6)
            if min(dot(a, n), dot(b, n), dot(c, n)) < height:
                found[many] = t
                many += 1
    return many


@uncounted
def measure_below(
    mesh: F1, t: int, n: V3, height: float, origin: V3, node: F1, link: F1, work: F2, sums: F1
) -> None:
    """Fill the piece of triangle t below the plane x.n = height, and psi on its edges.

    `work` has room for two polygons.
    """
    at = int(mesh[AT_TRIANGLES]) + TRIANGLE * t
    a, b, c = vector(mesh, at), vector(mesh, at + 3), vector(mesh, at + 6)
    here = height - dot(a, n)
    depth = (here, height - dot(b, n) - here, height - dot(c, n) - here)
    deep = (here, here + depth[1], here + depth[2])
    for k in range(3):
        link[k] = max(deep[k], deep[k + 1 if k < 2 else 0])
    begin(work, 0)
    count = cut(work, 0, 3, depth, 3, CORNERS)
    for k in range(SUMS):
        sums[k] = 0.0
    integrate(work, CORNERS, count, depth, sums)
    e1, e2 = sub(b, a), sub(c, a)
    add_piece(node, sums, sub(a, origin), e1, e2, 1.0, 1.0)
    # psi has the slope -n: its integral is the flux of -n psi^2/2
    node[POTENTIAL] -= 0.5 * sums[OF_SQUARE] * dot(cross(e1, e2), n)
    # along the plane's normal alone the centre of pressure is that of the overlap, to the last bit
    pressure = dot(vector(node, PUSH), n)
    part = pressure / node[PRESSURE] if node[PRESSURE] > 0.0 else 0.0
    node[PRESSURE] = node[VOLUME] = pressure
    for k in range(6):
        node[SPREAD + k] *= part
    for k in range(3):
        node[MOMENT + k] *= part
        node[PUSH + k] = pressure * n[k]
    twist = cross(vector(node, MOMENT), n)
    for k in range(3):
        node[TWIST + k] = twist[k]


@jitable
def pieces_below(mesh: F1, found: I1, n: V3, height: float, origin: V3) -> tuple[F2, F2, I2]:
    """Return the pieces of the triangles `found`, psi on their edges, and the pieces beyond."""
    count, marks = len(found), int(mesh[AT_MARKS])
    nodes, links = np.zeros((count, PATCH_NUMBERS)), np.empty((count, 3))
    partners = np.empty((count, 3), np.int64)
    work, sums = np.empty((2 * CORNERS, POLYGON_CORNER)), np.empty(SUMS)
    for k in range(count):
        mesh[marks + found[k]] = k
    for k in range(count):
        measure_below(mesh, found[k], n, height, origin, nodes[k], links[k], work, sums)
        at = int(mesh[AT_TRIANGLES]) + TRIANGLE * found[k] + BESIDE
        for e in range(3):
            partners[k, e] = int(mesh[marks + int(mesh[at + e])]) if links[k, e] > 0.0 else -1
    for k in range(count):
        mesh[marks + found[k]] = -1.0
    return nodes, links, partners
