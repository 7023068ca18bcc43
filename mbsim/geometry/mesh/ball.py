"""A sphere on a mesh: the nearest points of the triangles in its reach, where they stand out."""

from __future__ import annotations

import math

import numpy as np

from mbsim.core.arrays import F1, F2, I1, I2, V3, V4
from mbsim.core.jitable import jitable
from mbsim.core.rotation import add, cross, dot, norm, scale, sub, vector
from mbsim.geometry.mesh.merging import LEAST, lead_up, root_of, saddles, sort_down
from mbsim.geometry.mesh.tree import WAITING, box_square, leaf_range
from mbsim.model.surface import (
    AT_BOXES,
    AT_MARKS,
    AT_TRIANGLES,
    BESIDE,
    CORNER_NORMAL,
    LEVELS,
    NODE,
    TRIANGLE,
    UNIT,
)

#: Numbers of a triangle in reach: depth, its nearest point to the centre (3), the normal there out
#: of the mesh (3), and what is left of its weight.
NEAR_NUMBERS = 8
NEAR_POINT, NEAR_NORMAL, NEAR_WEIGHT = 1, 4, 7
#: A wall's other side bends from its first by less than arccos of this; part of a way within which
#: a triangle is where it begins; part of a wall that a layer would reach.
SQUARE, AT_START, OF_WALL = 0.5, 1e-6, 0.36
#: Parts of a triangle on which a point may be nearest: its edges, its corners, its face.
ON_CORNER, ON_FACE = 3, 6


@jitable
def nearest_on_edge(p: V3, q: V3, c: V3) -> V4:
    """Return the point between p and q that is nearest to c, and its part of the way."""
    e = sub(q, p)
    square = dot(e, e)
    part = dot(sub(c, p), e) / square if square > 0.0 else 0.0
    part = min(1.0, max(0.0, part))
    x = add(p, scale(part, e))
    return (x[0], x[1], x[2], part)


@jitable
def nearest_on_triangle(mesh: F1, at: int, c: V3, edges: F1) -> tuple[V3, int]:
    """Return a triangle's point that is nearest to c, and where it lies; `at` is the triangle.

    `edges` gets the squared distances of the edges.
    """
    corners = (vector(mesh, at), vector(mesh, at + 3), vector(mesh, at + 6))
    n, inside, part, best = vector(mesh, at + UNIT), True, ON_FACE, math.inf
    found = corners[0]
    for k in range(3):
        p, q = corners[k], corners[k + 1 if k < 2 else 0]
        x = nearest_on_edge(p, q, c)
        y = (x[0], x[1], x[2])
        away = sub(c, y)
        edges[k] = dot(away, away)
        if edges[k] < best:
            best, found = edges[k], y
            part = k
            if x[3] == 0.0:
                part = ON_CORNER + k
            elif x[3] == 1.0:
                part = ON_CORNER + (k + 1 if k < 2 else 0)
        if dot(cross(sub(q, p), sub(c, p)), n) < 0.0:
            inside = False
    if inside and dot(n, n) > 0.0:
        return sub(c, scale(dot(sub(c, corners[0]), n), n)), ON_FACE
    return found, part


@jitable
def normal_at(mesh: F1, at: int, part: int) -> V3:
    """Return a normal that tells outside from inside for points nearest to part of a triangle."""
    n = vector(mesh, at + UNIT)
    if part == ON_FACE:
        return n
    if part >= ON_CORNER:
        return vector(mesh, at + CORNER_NORMAL + 3 * (part - ON_CORNER))
    other = int(mesh[AT_TRIANGLES]) + TRIANGLE * int(mesh[at + BESIDE + part])
    return add(n, vector(mesh, other + UNIT))


@jitable
def nearest_triangle(mesh: F1, c: V3, work: F1) -> tuple[float, int]:
    """Return the squared distance of a mesh's surface from c, and the nearest triangle."""
    waiting, far = np.empty(WAITING, np.int64), np.empty(WAITING)
    boxes, leaves = int(mesh[AT_BOXES]), 1 << int(mesh[LEVELS])
    waiting[0], far[0], count = 1, 0.0, 1
    best, found = math.inf, 0
    while count > 0:
        count -= 1
        node = waiting[count]
        if far[count] >= best:
            continue
        if node < leaves:
            left = box_square(mesh, boxes + NODE * 2 * node, c)
            right = box_square(mesh, boxes + NODE * (2 * node + 1), c)
            near = 1 if right < left else 0
            # the nearer one is looked at first, so it is put on last
            waiting[count], far[count] = 2 * node + 1 - near, max(left, right)
            waiting[count + 1], far[count + 1] = 2 * node + near, min(left, right)
            count += 2
            continue
        first, last = leaf_range(mesh, node)
        for t in range(first, last):
            q, _ = nearest_on_triangle(mesh, int(mesh[AT_TRIANGLES]) + TRIANGLE * t, c, work)
            away = sub(c, q)
            if dot(away, away) < best:
                best, found = dot(away, away), t
    return best, found


@jitable
def triangles_near(mesh: F1, c: V3, radius: float, found: I1) -> int:
    """Write the triangles of boxes nearer to c than a radius; return how many."""
    waiting = np.empty(WAITING, np.int64)
    boxes, leaves = int(mesh[AT_BOXES]), 1 << int(mesh[LEVELS])
    waiting[0], count, many = 1, 1, 0
    while count > 0:
        count -= 1
        node = waiting[count]
        if box_square(mesh, boxes + NODE * node, c) >= radius * radius:
            continue
        if node < leaves:
            waiting[count], waiting[count + 1] = 2 * node, 2 * node + 1
            count += 2
            continue
        first, last = leaf_range(mesh, node)
        for t in range(first, last):
            found[many] = t
            many += 1
    return many


@jitable
def measure_near(mesh: F1, t: int, c: V3, radius: float, row: F1, edges: F1) -> float:
    """Fill the row of a triangle; return 1 where c is outside of it, -1 inside.

    `edges` gets the depth of the edges below the sphere.
    """
    at = int(mesh[AT_TRIANGLES]) + TRIANGLE * t
    q, part = nearest_on_triangle(mesh, at, c, edges)
    away, m = sub(c, q), normal_at(mesh, at, part)
    distance = norm(away)
    side = 1.0 if dot(away, m) >= 0.0 else -1.0
    n = scale(side / distance, away) if distance > 0.0 else scale(1.0 / norm(m), m)
    row[0], row[NEAR_WEIGHT] = radius - side * distance, 1.0
    for k in range(3):
        row[NEAR_POINT + k], row[NEAR_NORMAL + k] = q[k], n[k]
        edges[k] = radius - math.sqrt(edges[k])
    return side


@jitable
def box_on_way(mesh: F1, at: int, p: V3, d: V3, reach: float) -> bool:
    """Return whether the way from p along d, so long, meets the box whose numbers begin at `at`."""
    first, last = 0.0, reach
    for k in range(3):
        low, high = mesh[at + k] - mesh[at + 3 + k] - p[k], mesh[at + k] + mesh[at + 3 + k] - p[k]
        if d[k] == 0.0:
            if low > 0.0 or high < 0.0:
                return False
            continue
        a, b = low / d[k], high / d[k]
        first, last = max(first, min(a, b)), min(last, max(a, b))
    return first <= last


@jitable
def leaves_through(mesh: F1, at: int, p: V3, d: V3, reach: float) -> bool:
    """Return whether the way from p along d, so long, goes out through a triangle, about square."""
    n = vector(mesh, at + UNIT)
    slope = dot(d, n)
    if slope < SQUARE:
        return False
    way = dot(sub(vector(mesh, at), p), n) / slope
    if way <= AT_START * reach or way > reach:
        return False
    x = add(p, scale(way, d))
    for k in range(3):
        q, r = vector(mesh, at + 3 * k), vector(mesh, at + 3 * (k + 1 if k < 2 else 0))
        if dot(cross(sub(r, q), sub(x, q)), n) < 0.0:
            return False
    return True


@jitable
def through_wall(mesh: F1, row: F1, radius: float) -> bool:
    """Return whether a sphere overlaps a mesh by more than its wall, of width w, stands.

    The depth is more than w, or the centre deeper than 0.36 w, as deep as a layer would be.
    """
    depth, n = row[0], vector(row, NEAR_NORMAL)
    reach = max(depth, (depth - radius) / OF_WALL)
    p, d = vector(row, NEAR_POINT), scale(-1.0, n)
    waiting = np.empty(WAITING, np.int64)
    boxes, leaves = int(mesh[AT_BOXES]), 1 << int(mesh[LEVELS])
    waiting[0], count = 1, 1
    while count > 0:
        count -= 1
        node = waiting[count]
        if not box_on_way(mesh, boxes + NODE * node, p, d, reach):
            continue
        if node < leaves:
            waiting[count], waiting[count + 1] = 2 * node, 2 * node + 1
            count += 2
            continue
        first, last = leaf_range(mesh, node)
        for t in range(first, last):
            if leaves_through(mesh, int(mesh[AT_TRIANGLES]) + TRIANGLE * t, p, d, reach):
                return True
    return False


@jitable
def in_reach(mesh: F1, c: V3, radius: float, nearest: int, found: I1) -> tuple[F2, F2, I2]:
    """Return the triangles that a sphere reaches, the depths of their edges, those beyond.

    Of what the centre is inside of, only the nearest triangle counts.
    """
    marks, kept = int(mesh[AT_MARKS]), 0
    rows, links = np.empty((len(found), NEAR_NUMBERS)), np.empty((len(found), 3))
    for k in range(len(found)):
        side = measure_near(mesh, found[k], c, radius, rows[kept], links[kept])
        if rows[kept, 0] > 0.0 and (side > 0.0 or found[k] == nearest):
            mesh[marks + found[k]] = kept
            found[kept] = found[k]
            kept += 1
    partners = np.empty((kept, 3), np.int64)
    for k in range(kept):
        at = int(mesh[AT_TRIANGLES]) + TRIANGLE * found[k] + BESIDE
        for e in range(3):
            beyond = int(mesh[marks + int(mesh[at + e])])
            partners[k, e] = beyond if links[k, e] > 0.0 else -1
    for k in range(kept):
        mesh[marks + found[k]] = -1.0
    return rows[:kept], links[:kept], partners


@jitable
def join_points(high: F1, low: F1, saddle: float) -> None:
    """Let the lower of two nearest points stand out above the saddle only.

    The higher one moves towards the mean of both, each counted as far as it stands out, by the
    part of the lower one that does not: nothing jumps where one overtakes the other.
    """
    u, v = max(0.0, 1.0 - saddle / low[0]), max(0.0, 1.0 - saddle / high[0])
    low[NEAR_WEIGHT] = u
    if u + v > 0.0:
        part = (1.0 - u) * u / (u + v)
        for k in range(NEAR_POINT, NEAR_WEIGHT):
            high[k] += part * (low[k] - high[k])


@jitable
def merge_points(rows: F2, links: F2, partners: I2) -> None:
    """Give each triangle in reach its weight: 0 where its neighbours are nearer."""
    count = len(rows)
    above = np.empty(count, np.int64)
    lead_up(rows, links, partners, above)
    levels, ends = saddles(above, links, partners)
    for k in range(count):
        if root_of(above, k) != k:
            rows[k, NEAR_WEIGHT] = 0.0
    order = np.arange(len(levels))
    sort_down(levels, order)
    for k in range(len(order)):
        a, b = root_of(above, ends[order[k], 0]), root_of(above, ends[order[k], 1])
        if a == b:
            continue
        if rows[a, 0] < rows[b, 0]:
            a, b = b, a
        join_points(rows[a], rows[b], levels[order[k]])
        above[b] = a


@jitable
def press(row: F1) -> tuple[float, V3]:
    """Return depth times weight of a point, and its normal of length 1."""
    n = vector(row, NEAR_NORMAL)
    return row[0] * row[NEAR_WEIGHT], scale(1.0 / norm(n), n)


@jitable
def add_to_nearest(rows: F2, kept: int, lost: F1) -> None:
    """Let the nearest of the points kept press as it and a lost one do, by a linear law."""
    nearest, least = 0, math.inf
    for k in range(kept):
        away = norm(sub(vector(rows[k, NEAR_POINT:]), vector(lost, NEAR_POINT)))
        if away < least:
            nearest, least = k, away
    row = rows[nearest]
    (a, n), (b, m) = press(row), press(lost)
    both = add(scale(a, n), scale(b, m))
    row[NEAR_WEIGHT] = norm(both) / row[0]
    if row[NEAR_WEIGHT] == 0.0:
        return
    for k in range(3):
        row[NEAR_POINT + k] += b / (a + b) * (lost[NEAR_POINT + k] - row[NEAR_POINT + k])
        row[NEAR_NORMAL + k] = both[k]


@jitable
def strongest_points(rows: F2, most: int) -> int:
    """Move the points of greatest weight times depth to the front; return how many count.

    What those behind press is added to the nearest of those in front.
    """
    kept = 0
    while kept < min(most, len(rows)):
        best = kept
        for k in range(kept + 1, len(rows)):
            if rows[k, 0] * rows[k, NEAR_WEIGHT] > rows[best, 0] * rows[best, NEAR_WEIGHT]:
                best = k
        if rows[best, 0] * rows[best, NEAR_WEIGHT] <= LEAST * rows[0, 0]:
            return kept
        for c in range(NEAR_NUMBERS):
            rows[kept, c], rows[best, c] = rows[best, c], rows[kept, c]
        kept += 1
    for k in range(kept, len(rows)):
        if rows[k, NEAR_WEIGHT] > 0.0:
            add_to_nearest(rows, kept, rows[k])
    return kept
