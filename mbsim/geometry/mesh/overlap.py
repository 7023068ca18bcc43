"""The pieces of two meshes in each other's layers.

Which leaves may have some `candidates` tells. A node of the graph that `merging` takes is a pair of
triangles, one of I and one of J: what the one is in the other's prism, and the other in its.
"""

from __future__ import annotations

import math

import numpy as np

from mbsim.core.arrays import F1, F2, I1, I2, V3
from mbsim.core.jitable import jitable, uncounted
from mbsim.core.rotation import dot, sub, vector
from mbsim.geometry.mesh.candidates import candidates
from mbsim.geometry.mesh.oriented import (
    FLUSH,
    I_IN_J,
    J_IN_I,
    place,
    turn,
    ways_between,
)
from mbsim.geometry.mesh.polygon import CORNER as POLYGON_CORNER
from mbsim.geometry.mesh.polygon import CORNERS
from mbsim.geometry.mesh.prism import apart, piece_in_prism
from mbsim.geometry.mesh.record import PATCH_NUMBERS, PEAK, SUMS
from mbsim.model.surface import (
    AT_TRIANGLES,
    BESIDE,
    CORNER,
    DEPTH,
    INNER,
    LEAF,
    TRIANGLE,
)
from mbsim.model.surface_tree import DEEP, FIRST, LAST, THIN

#: Numbers of a triangle that the walk needs: corners, inner points, depths, order.
PRISM = 24
#: Numbers of a placed box: centre, axes by rows, half edges.
PLACED_BOX = 15
#: Edges of a pair of triangles.
EDGES = 6
#: Part of the largest psi on an edge that the piece beyond it has there at least: it has the same,
#: but for rounding.
ALIKE = 0.5


@jitable
def common_middle(a: F1, b: F1, pose: F1) -> V3:
    """Return the middle of what box a (I's axes) and b (J's) have in common, in J's axes."""
    found = np.empty(3)
    for r in range(3):
        m = 3 + 3 * r
        at = pose[r] + pose[m] * a[0] + pose[m + 1] * a[1] + pose[m + 2] * a[2]
        reach = abs(pose[m]) * a[3] + abs(pose[m + 1]) * a[4] + abs(pose[m + 2]) * a[5]
        found[r] = 0.5 * (max(at - reach, b[r] - b[3 + r]) + min(at + reach, b[r] + b[3 + r]))
    return (found[0], found[1], found[2])


@jitable
def box_gap(a: F1, b: F1, pose: F1) -> float:
    """Return a lower bound of the distance of box a (I's axes) and b (J's); 0 where they meet."""
    square = 0.0
    for r in range(3):
        m = 3 + 3 * r
        at = pose[r] + pose[m] * a[0] + pose[m + 1] * a[1] + pose[m + 2] * a[2]
        reach = abs(pose[m]) * a[3] + abs(pose[m + 1]) * a[4] + abs(pose[m + 2]) * a[5]
        out = max(0.0, abs(at - b[r]) - reach - b[3 + r])
        square += out * out
    return math.sqrt(square)


@jitable
def place_triangle(mesh: F1, t: int, pose: F1, moves: bool, origin: V3, prism: F1) -> None:
    """Write corners, inner points, depths and order of a triangle in J's axes from `origin`."""
    at = int(mesh[AT_TRIANGLES]) + TRIANGLE * t
    for k in range(0, DEPTH, 3):
        p = vector(mesh, at + k)
        if moves:
            p = (
                pose[0] + pose[3] * p[0] + pose[4] * p[1] + pose[5] * p[2],
                pose[1] + pose[6] * p[0] + pose[7] * p[1] + pose[8] * p[2],
                pose[2] + pose[9] * p[0] + pose[10] * p[1] + pose[11] * p[2],
            )
        prism[k], prism[k + 1], prism[k + 2] = p[0] - origin[0], p[1] - origin[1], p[2] - origin[2]
    for k in range(DEPTH, PRISM):
        prism[k] = mesh[at + k]


@jitable
def corners_of(prism: F1, at: int) -> tuple[V3, V3, V3]:
    """Return the corners of a placed triangle, or its inner points."""
    return (vector(prism, at), vector(prism, at + 3), vector(prism, at + 6))


@uncounted
def place_boxes(mesh: F1, node: int, pose: F1, moves: bool, origin: V3, boxes: F2) -> None:
    """Write both boxes of a node in J's axes from `origin`: centre, axes by rows, half edges."""
    for k in range(2):
        at, box = node + THIN + (DEEP - THIN) * k, boxes[k]
        c = vector(mesh, at)
        c = sub(place(pose, c) if moves else c, origin)
        box[0], box[1], box[2] = c[0], c[1], c[2]
        # what is flush with a side of a box is outside of it
        flush = FLUSH * (mesh[at + 3] + mesh[at + 4] + mesh[at + 5])
        for r in range(3):
            u = vector(mesh, node + 3 * r)
            if moves:
                u = turn(pose, u)
            box[3 + 3 * r], box[4 + 3 * r], box[5 + 3 * r] = u[0], u[1], u[2]
            box[12 + r] = mesh[at + 3 + r] - flush


@jitable
def reaches(prism: F1, points: int, box: F1) -> bool:
    """Return whether a placed triangle (3 points), or its prism (6), reaches into a placed box.

    A side of the prism that is flush with the box may hold a triangle of it.
    """
    c, flush = vector(box), 4.0 * FLUSH * (box[12] + box[13] + box[14])
    for r in range(3):
        u, least, most = vector(box, 3 + 3 * r), math.inf, -math.inf
        for k in range(0, 3 * points, 3):
            height, room = dot(u, sub(vector(prism, k), c)), flush if k >= INNER else 0.0
            least, most = min(least, height - room), max(most, height + room)
        if least >= box[12 + r] or most <= -box[12 + r]:
            return False
    return True


@uncounted
def place_leaf(
    mesh: F1,
    node: int,
    pose: F1,
    moves: bool,
    origin: V3,
    ways: int,
    boxes: F2,
    placed: F2,
    kept: I1,
) -> None:
    """Place the triangles of a leaf; `kept` gets the ways in which each one may meet another leaf.

    `boxes` are those of the other leaf.
    """
    thin, deep = (I_IN_J, J_IN_I) if moves else (J_IN_I, I_IN_J)
    first = int(mesh[node + FIRST])
    for t in range(first, int(mesh[node + LAST])):
        prism = placed[t - first]
        place_triangle(mesh, t, pose, moves, origin, prism)
        kept[t - first] = 0
        if ways & thin and reaches(prism, 3, boxes[1]):
            kept[t - first] |= thin
        if ways & deep and reaches(prism, 6, boxes[0]):
            kept[t - first] |= deep


@jitable
def measure_pair_of(
    a: F1, b: F1, ways: int, node: F1, values: F1, other: F1, work: F2, sums: F1
) -> bool:
    """Fill the node of triangles a of I and b of J; return whether there is any piece.

    `values` are the largest psi on the edges of a and of b.
    """
    for k in range(PATCH_NUMBERS):
        node[k] = 0.0
    for k in range(EDGES):
        values[k] = other[k] = 0.0
    of_a, of_b = corners_of(a, CORNER), corners_of(b, CORNER)
    if ways & I_IN_J and not apart(of_b, corners_of(b, INNER), of_a):
        piece_in_prism(b, of_a, 1.0, node, values, work, sums)
    if ways & J_IN_I and not apart(of_a, corners_of(a, INNER), of_b):
        piece_in_prism(a, of_b, -1.0, node, other, work, sums)
        for k in range(3):
            values[k] = max(values[k], other[3 + k])
            values[3 + k] = max(values[3 + k], other[k])
    return node[PEAK] > 0.0


@uncounted
def measure_leaves(
    numbers: tuple[int, int, int, int], placed: tuple[F2, F2], kept: tuple[I1, I1], count: int,
    nodes: F2, values: F2, pairs: F2, room: tuple[F1, F2, F1],
) -> int:  # fmt: skip
    """Add the nodes of two leaves' triangles, behind the first `count`; return how many there are.

    `numbers` are the first triangle of each leaf and the first behind it, of I and of J; `room` is
    for the other values on edges, polygons and sums.
    """
    first_i, last_i, first_j, last_j = numbers
    placed_i, placed_j = placed
    kept_i, kept_j = kept
    other, work, sums = room
    for a in range(first_i, last_i):
        for b in range(first_j, last_j):
            both = kept_i[a - first_i] & kept_j[b - first_j]
            if both == 0:
                continue
            if measure_pair_of(
                placed_i[a - first_i], placed_j[b - first_j], both, nodes[count],
                values[count], other, work, sums,
            ):  # fmt: skip
                pairs[count, 0], pairs[count, 1] = a, b
                count += 1
    return count


@jitable
def grown(table: F2, count: int) -> F2:
    """Return a table with twice the rows, the first `count` as they are."""
    larger = np.empty((2 * len(table), table.shape[1]))
    larger[:count] = table[:count]
    return larger


@jitable
def nodes_of(mesh_i: F1, mesh_j: F1, pose: F1, origin: V3, points: F2) -> tuple[int, F2, F2, F2]:
    """Return how many pairs of triangles overlap, their nodes, psi on their edges, the pairs.

    Sums are in J's axes, from `origin`; `points` are the pair's rows.
    """
    count, nodes, values = 0, np.empty((64, PATCH_NUMBERS)), np.empty((64, EDGES))
    pairs = np.empty((64, 2))
    work, sums = np.empty((2 * CORNERS, POLYGON_CORNER)), np.empty(SUMS)
    placed_i, placed_j = np.empty((LEAF + 1, PRISM)), np.empty((LEAF + 1, PRISM))
    kept_i, kept_j = np.empty(LEAF + 1, np.int64), np.empty(LEAF + 1, np.int64)
    other, boxes = np.empty(EDGES), np.empty((2, PLACED_BOX))
    many, leaves = candidates(mesh_i, mesh_j, pose, points)
    for k in range(many):
        box_i, box_j = int(leaves[2 * k]), int(leaves[2 * k + 1])
        ways = ways_between(mesh_i, box_i, mesh_j, box_j, I_IN_J | J_IN_I, pose, 0.0)
        if ways == 0:
            continue
        first_i, last_i = int(mesh_i[box_i + FIRST]), int(mesh_i[box_i + LAST])
        first_j, last_j = int(mesh_j[box_j + FIRST]), int(mesh_j[box_j + LAST])
        place_boxes(mesh_j, box_j, pose, False, origin, boxes)
        place_leaf(mesh_i, box_i, pose, True, origin, ways, boxes, placed_i, kept_i)
        place_boxes(mesh_i, box_i, pose, True, origin, boxes)
        place_leaf(mesh_j, box_j, pose, False, origin, ways, boxes, placed_j, kept_j)
        while count + len(placed_i) * len(placed_j) > len(nodes):
            nodes, values = grown(nodes, count), grown(values, count)
            pairs = grown(pairs, count)
        count = measure_leaves(
            (first_i, last_i, first_j, last_j), (placed_i, placed_j), (kept_i, kept_j), count,
            nodes, values, pairs, (other, work, sums),
        )  # fmt: skip
    return count, nodes, values, pairs


@jitable
def place_in(table: I1, pairs: F2, a: int, b: int) -> int:
    """Return the place of a pair of triangles in the table, or the free one where it would be."""
    mask = len(table) - 1
    at = (a * 73856093 ^ b * 19349663) & mask
    while table[at] >= 0:
        k = table[at]
        if pairs[k, 0] == a and pairs[k, 1] == b:
            return at
        at = (at + 1) & mask
    return at


@jitable
def edge_towards(beside: F1, at: int, other: int) -> int:
    """Return the edge of a triangle, whose neighbours' numbers begin at `at`, towards a neighbour.

    0 where it is none.
    """
    for e in range(3):
        if int(beside[at + e]) == other:
            return e
    return 0


@uncounted
def beyond_edge(mesh_i: F1, mesh_j: F1, table: I1, pairs: F2, values: F2, k: int, e: int) -> int:
    """Return the node beyond edge e of pair k, -1 for none.

    It has the same psi there. Where the edge lies on one of the other triangle, the neighbour may
    have its piece not with that triangle, but with one of its neighbours.
    """
    of_i, enough = e < 3, ALIKE * values[k, e]
    mesh, other = (mesh_i, mesh_j) if of_i else (mesh_j, mesh_i)
    here, there = int(pairs[k, 0 if of_i else 1]), int(pairs[k, 1 if of_i else 0])
    own, across = (0, 3) if of_i else (3, 0)
    first, last = int(mesh[AT_TRIANGLES]) + BESIDE, int(other[AT_TRIANGLES]) + BESIDE
    beyond = int(mesh[first + TRIANGLE * here + e - own])
    back = own + edge_towards(mesh, first + TRIANGLE * beyond, here)
    a, b = (beyond, there) if of_i else (there, beyond)
    direct = table[place_in(table, pairs, a, b)]
    if direct >= 0 and values[direct, back] >= enough:
        return direct
    for f in range(3):
        near = int(other[last + TRIANGLE * there + f])
        a, b = (beyond, near) if of_i else (near, beyond)
        m = table[place_in(table, pairs, a, b)]
        if m < 0:
            continue
        # rounding tells which of both edges bounds the piece there
        aside = across + edge_towards(other, last + TRIANGLE * near, there)
        if max(values[m, back], values[m, aside]) >= enough:
            return m
    return direct


@jitable
def partners_of(mesh_i: F1, mesh_j: F1, count: int, values: F2, pairs: F2) -> I2:
    """Return the nodes beyond the six edges of each pair of triangles, -1 for none."""
    size = 16
    while size < 2 * count:
        size *= 2
    table = np.full(size, -1)
    for k in range(count):
        table[place_in(table, pairs, int(pairs[k, 0]), int(pairs[k, 1]))] = k
    partners = np.full((count, EDGES), -1)
    for k in range(count):
        for e in range(EDGES):
            if values[k, e] > 0.0:
                partners[k, e] = beyond_edge(mesh_i, mesh_j, table, pairs, values, k, e)
    return partners
