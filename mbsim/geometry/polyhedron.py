"""Two convex polyhedra: least overlap over their faces and edges, then the common polygon.

A polyhedron is packed as in `model.hull`. Everything is in J's axes; n points from J into I.
Along J's outward face normal, I's reversed one, or the common normal of two edges that can
meet (their arcs on the unit sphere of normals cross), the polyhedra overlap by how far the
support of J lies above that of I. The least overlap says which faces look at each other: the
face itself, and of the other polyhedron the face at the supporting corner or edge that
looks most against it. Points, depths and weights then follow as for boxes (`pairs.box_box`):
the vertices of the faces' common polygon seen along n, each with the normal and the depth of
its own features.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from mbsim.core.arrays import F1, F2, V3
from mbsim.core.jitable import jitable
from mbsim.core.rotation import add, any_tangent, cross, dot, norm, scale, sub, vector
from mbsim.geometry.catalog import axis, put_couple, put_point
from mbsim.geometry.crossing import (
    EDGES_MEET,
    FACE_OF_I,
    FACE_OF_J,
    LEAST_WEIGHT,
    middle_of_lines,
    turning,
    weight_of_crossing,
)
from mbsim.geometry.polygon import TAG, X, Y, clip
from mbsim.model.hull import (
    AT_CORNERS,
    AT_DATA,
    AT_EDGES,
    AT_LOOPS,
    AT_PLANES,
    AT_STARTS,
    COLOURS,
    CORNERS,
    EDGES,
    FACES,
    polyhedron_of,
)

Array = np.ndarray[Any, np.dtype[np.float64]]

#: Edges nearer to parallel than this (sine squared) give no axis of their own.
PARALLEL = 1e-16
#: Two edges must overlap less than a face by this part, as between boxes.
FACES_FIRST = 1e-6
#: Part of the smaller face's size by which a corner may be beyond the other face's edge and be on
#: it: corners of equal prisms coincide to the rounding of single precision in files.
TIE = 1e-6
#: Rows of two polyhedra at most, and pairs of their edges; larger ones go through FCL.
HULL_SLOTS = 64
MOST_EDGE_PAIRS = 4096
#: Edges of a polyhedron under a sphere at most.
MOST_EDGES = 512


def _cube() -> Array:
    """Return a box of half edges 1 as a polyhedron."""
    signs = (-1.0, 1.0)
    corners = np.array([[x, y, z] for x in signs for y in signs for z in signs])
    sides = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    triangles = np.array([[s[0], s[k], s[k + 1]] for s in sides for k in (1, 2)], dtype=np.int64)
    packed = polyhedron_of(corners, triangles)
    assert packed is not None
    return packed


CUBE = _cube()


@jitable
def moved(hull: F1, frame_i: F1, frame_j: F1) -> F1:
    """Return a polyhedron's packed numbers in J's axes."""
    out = hull.copy()
    shift = sub(vector(frame_i), vector(frame_j))
    x, y, z = axis(frame_j, 0), axis(frame_j, 1), axis(frame_j, 2)
    t = (dot(shift, x), dot(shift, y), dot(shift, z))
    at = int(hull[AT_CORNERS])
    for _ in range(int(hull[CORNERS])):
        p = add(to_global(frame_i, vector(hull, at)), shift)
        out[at], out[at + 1], out[at + 2] = dot(p, x), dot(p, y), dot(p, z)
        at += 3
    at = int(hull[AT_PLANES])
    for _ in range(int(hull[FACES])):
        m = to_global(frame_i, vector(hull, at))
        m = (dot(m, x), dot(m, y), dot(m, z))
        out[at], out[at + 1], out[at + 2] = m[0], m[1], m[2]
        out[at + 3] = hull[at + 3] + dot(m, t)
        at += 4
    return out


@jitable
def to_global(frame: F1, d: V3) -> V3:
    """Return a vector of a frame's axes in global axes."""
    return add(
        scale(d[0], axis(frame, 0)), add(scale(d[1], axis(frame, 1)), scale(d[2], axis(frame, 2)))
    )


@jitable
def corner(hull: F1, k: int) -> V3:
    """Return corner k."""
    return vector(hull, int(hull[AT_CORNERS]) + 3 * int(k))


@jitable
def plane(hull: F1, f: float) -> V3:
    """Return the outward normal of face f."""
    return vector(hull, int(hull[AT_PLANES]) + 4 * int(f))


@jitable
def faces_overlap(a: F1, b: F1) -> tuple[float, int, int]:
    """Return (overlap, face, corner): b's lowest corner below the faces of a, the least."""
    least, face, low = math.inf, 0, 0
    at, first, count = int(a[AT_PLANES]), int(b[AT_CORNERS]), int(b[CORNERS])
    for f in range(int(a[FACES])):
        m, deepest, which = vector(a, at), -math.inf, 0
        for k in range(count):
            depth = a[at + 3] - dot(m, vector(b, first + 3 * k))
            if depth > deepest:
                deepest, which = depth, k
        if deepest < least:
            least, face, low = deepest, f, which
        at += 4
    return least, face, low


@jitable
def edges_overlap(a: F1, b: F1) -> tuple[float, int, int, V3]:
    """Return (overlap, edge of a, edge of b, normal from b into a), the least of those that meet.

    With normals m0, m1 of the faces at an edge of a and n0, n1 at one of b, the edges meet in
    the difference of the polyhedra if the arcs m0 m1 and -n0 -n1 cross.
    """
    least, edge_a, edge_b, normal = math.inf, -1, -1, (0.0, 0.0, 1.0)
    at_a, at_b = int(a[AT_EDGES]), int(b[AT_EDGES])
    for k in range(int(a[EDGES])):
        p = corner(a, a[at_a + 4 * k])
        u = sub(corner(a, a[at_a + 4 * k + 1]), p)
        m0, m1 = plane(a, a[at_a + 4 * k + 2]), plane(a, a[at_a + 4 * k + 3])
        across_a = cross(m1, m0)
        for j in range(int(b[EDGES])):
            n0, n1 = plane(b, b[at_b + 4 * j + 2]), plane(b, b[at_b + 4 * j + 3])
            first, second = -dot(n0, across_a), -dot(n1, across_a)
            if first * second >= 0.0:
                continue
            across_b = cross(n1, n0)
            third, fourth = dot(m0, across_b), dot(m1, across_b)
            if third * fourth >= 0.0 or first * fourth <= 0.0:
                continue
            q = corner(b, b[at_b + 4 * j])
            e = sub(corner(b, b[at_b + 4 * j + 1]), q)
            g = cross(u, e)
            square = dot(g, g)
            if square <= PARALLEL * dot(u, u) * dot(e, e):
                continue
            sign = 1.0 if dot(g, add(m0, m1)) < 0.0 else -1.0
            g = scale(sign / math.sqrt(square), g)
            overlap = dot(sub(q, p), g)
            if overlap < least:
                least, edge_a, edge_b, normal = overlap, k, j, g
    return least, edge_a, edge_b, normal


@jitable
def face_at_corner(hull: F1, k: int, n: V3) -> int:
    """Return the face at corner k that looks most along n."""
    best, face = -math.inf, 0
    starts, loops = int(hull[AT_STARTS]), int(hull[AT_LOOPS])
    for f in range(int(hull[FACES])):
        for at in range(int(hull[starts + f]), int(hull[starts + f + 1])):
            if int(hull[loops + 2 * at]) == k:
                along = dot(plane(hull, f), n)
                if along > best:
                    best, face = along, f
    return face


@jitable
def face_size(hull: F1, f: int) -> float:
    """Return how far the corners of face f are from its first one at most."""
    starts, loops = int(hull[AT_STARTS]), int(hull[AT_LOOPS])
    begin, size = int(hull[starts + f]), 0.0
    first = corner(hull, hull[loops + 2 * begin])
    for at in range(begin + 1, int(hull[starts + f + 1])):
        size = max(size, norm(sub(corner(hull, hull[loops + 2 * at]), first)))
    return size


@jitable
def face_at_edge(hull: F1, k: int, n: V3) -> int:
    """Return the face at edge k that looks most along n."""
    at = int(hull[AT_EDGES]) + 4 * k
    f, g = int(hull[at + 2]), int(hull[at + 3])
    return f if dot(plane(hull, f), n) >= dot(plane(hull, g), n) else g


@jitable
def overlapping(a: F1, hull_j: F1, frame_j: F1, points: F2) -> float:
    """Write the points of two polyhedra (a is I in J's axes); return a gap, or 0 in overlap."""
    least, fj, low = faces_overlap(hull_j, a)
    if least <= 0.0:
        return -least
    kind, n = FACE_OF_J, plane(hull_j, fj)
    other, face, top = faces_overlap(a, hull_j)
    if other <= 0.0:
        return -other
    if other < least:
        least, kind, fi, n = other, FACE_OF_I, face, scale(-1.0, plane(a, face))
    else:
        fi = 0
    other, edge_i, edge_j, g = edges_overlap(a, hull_j)
    if other <= 0.0:
        return -other
    u = e = n
    if other < (1.0 - FACES_FIRST) * least:
        kind, n = EDGES_MEET, g
        at = int(a[AT_EDGES]) + 4 * edge_i
        u = sub(corner(a, a[at + 1]), corner(a, a[at]))
        at = int(hull_j[AT_EDGES]) + 4 * edge_j
        e = sub(corner(hull_j, hull_j[at + 1]), corner(hull_j, hull_j[at]))
    against = scale(-1.0, n)
    if kind == FACE_OF_J:
        fi = face_at_corner(a, low, against)
    elif kind == FACE_OF_I:
        fj = face_at_corner(hull_j, top, n)
    else:
        fi, fj = face_at_edge(a, edge_i, against), face_at_edge(hull_j, edge_j, n)
    common_polygon(a, fi, hull_j, fj, n, turning(kind, n, u, e), frame_j, points)
    return 0.0


@jitable
def common_polygon(
    a: F1, fi: int, b: F1, fj: int, n: V3, turn: tuple[int, V3, V3], frame_j: F1, points: F2
) -> None:
    """Write the vertices of two faces' common polygon, seen along n, into their rows.

    `turn` says how n turns with I. Long because all three kinds of vertices (a corner of I, one of
    J, a crossing of edges) need where both faces lie in the packed polyhedra.
    """
    starts_i, loops_i = int(a[AT_STARTS]), int(a[AT_LOOPS])
    starts_j, loops_j = int(b[AT_STARTS]), int(b[AT_LOOPS])
    end_i = int(a[starts_i + fi + 1])
    first_j = int(b[starts_j + fj])
    count_i = end_i - int(a[starts_i + fi])
    count_j = int(b[starts_j + fj + 1]) - first_j
    nj, m = plane(b, fj), plane(a, fi)
    if dot(nj, n) <= 1e-3 or dot(m, n) >= -1e-3:
        # seen edge-on a face has no common polygon
        return
    origin = corner(b, b[loops_j + 2 * first_j])
    along = any_tangent(nj)
    across = cross(nj, along)

    # I's face backwards is counter-clockwise seen from J; edge k of it goes from corner k to k+1
    capacity = count_i + count_j + 4
    polygons = np.empty((2 * capacity, 3))
    polygon, other = polygons[:capacity], polygons[capacity:]
    for k in range(count_i):
        p = sub(corner(a, a[loops_i + 2 * (end_i - 1 - k)]), origin)
        p = sub(p, scale(dot(p, nj) / dot(n, nj), n))
        polygon[k, X], polygon[k, Y], polygon[k, TAG] = dot(p, along), dot(p, across), k
    count, size = count_i, min(face_size(a, fi), face_size(b, fj))
    for k in range(count_j):
        after = k + 1 if k + 1 < count_j else 0
        p = sub(corner(b, b[loops_j + 2 * (first_j + k)]), origin)
        q = sub(corner(b, b[loops_j + 2 * (first_j + after)]), origin)
        e = sub(q, p)
        nx, ny = dot(e, across), -dot(e, along)
        limit = nx * dot(p, along) + ny * dot(p, across)
        tie = TIE * size * norm(e)
        count = clip(polygon, count, other, nx, ny, limit, count_i + k, tie)
        polygon, other = other, polygon
    if count == 0:
        return

    far = corner(a, a[loops_i + 2 * (end_i - 1)])
    before = int(polygon[count - 1, TAG])
    for k in range(count):
        after = int(polygon[k, TAG])
        # the point of J's face, and how far I's face is below it along n
        on_j = add(origin, add(scale(polygon[k, X], along), scale(polygon[k, Y], across)))
        depth = dot(m, sub(on_j, far)) / dot(m, n)
        on_i, couple = sub(on_j, scale(depth, n)), (0.0, 0.0, 0.0)
        at_i = end_i - 1 - (after if after < count_i else (before + 1) % count_i)
        name_i = int(a[loops_i + 2 * at_i])
        if before >= count_i and after >= count_i:
            name = int(b[loops_j + 2 * (first_j + after - count_i)])
            data = int(b[AT_DATA]) + 3 * name
            row = 2 * int(a[COLOURS]) + int(b[data + 1])
            g, weight = scale(-1.0, m), b[data]
            d = depth * dot(g, n)
            middle = sub(on_j, scale(0.5 * d, g))
        elif before < count_i and after < count_i:
            data = int(a[AT_DATA]) + 3 * name_i
            row = 2 * int(a[data + 1])
            g, weight = nj, a[data]
            d = depth * dot(g, n)
            middle = add(on_i, scale(0.5 * d, g))
        else:
            ends = before < count_i
            edge, side = (before, after - count_i) if ends else (after, before - count_i)
            row = 2 * int(a[int(a[AT_DATA]) + 3 * name_i + 1]) + (0 if ends else 1)
            # edge k of I backwards is the face's own edge that starts at corner k + 1
            start = end_i - 1 - (edge + 1) % count_i
            u = sub(
                corner(a, a[loops_i + 2 * start]), corner(a, a[loops_i + 2 * (end_i - 1 - edge)])
            )
            u = scale(1.0 / norm(u), u)
            behind = side + 1 if side + 1 < count_j else 0
            e = sub(
                corner(b, b[loops_j + 2 * (first_j + behind)]),
                corner(b, b[loops_j + 2 * (first_j + side)]),
            )
            e = scale(1.0 / norm(e), e)
            beyond_i, beyond_j = (
                int(a[loops_i + 2 * start + 1]),
                int(b[loops_j + 2 * (first_j + side) + 1]),
            )
            weight, couple = weight_of_crossing(
                u,
                e,
                n,
                ends,
                (m, plane(a, beyond_i)),
                (nj, plane(b, beyond_j)),
                turn,
            )
            g = cross(u, e)
            square = dot(g, g)
            if square <= PARALLEL:
                g = n
            else:
                g = scale((1.0 if dot(g, n) >= 0.0 else -1.0) / math.sqrt(square), g)
            d = depth * dot(g, n)
            middle = middle_of_lines(on_i, u, e, g, scale(depth, n), d)
        before = after
        if weight <= LEAST_WEIGHT:
            continue
        p = add(vector(frame_j), to_global(frame_j, middle))
        put_point(points[row], d, p, to_global(frame_j, g), weight)
        put_couple(points[row], to_global(frame_j, couple))


@jitable
def hull_slots(a: F1, b: F1) -> int:
    """Return the rows of two polyhedra: two a colour of I, one a colour of J."""
    return 2 * int(a[COLOURS]) + int(b[COLOURS])


@jitable
def nearest_on_face(hull: F1, f: int, c: V3) -> V3:
    """Return the point of face f that is nearest to c."""
    m = plane(hull, f)
    height = dot(m, c) - hull[int(hull[AT_PLANES]) + 4 * f + 3]
    inside, best, found = True, math.inf, c
    starts, loops = int(hull[AT_STARTS]), int(hull[AT_LOOPS])
    first, last = int(hull[starts + f]), int(hull[starts + f + 1])
    before = corner(hull, hull[loops + 2 * (last - 1)])
    for at in range(first, last):
        after = corner(hull, hull[loops + 2 * at])
        e, d = sub(after, before), sub(c, before)
        if dot(cross(e, d), m) < 0.0:
            inside = False
            part = max(0.0, min(1.0, dot(d, e) / dot(e, e)))
            q = add(before, scale(part, e))
            away = sub(c, q)
            if dot(away, away) < best:
                best, found = dot(away, away), q
        before = after
    return sub(c, scale(height, m)) if inside else found


@jitable
def way_out(hull: F1, c: V3) -> tuple[float, V3]:
    """Return the signed distance of point c from a polyhedron (< 0 inside) and the unit way out."""
    top, face = -math.inf, 0
    at = int(hull[AT_PLANES])
    for f in range(int(hull[FACES])):
        height = dot(vector(hull, at + 4 * f), c) - hull[at + 4 * f + 3]
        if height > top:
            top, face = height, f
    if top <= 0.0:
        return top, plane(hull, face)
    least, n = math.inf, plane(hull, face)
    for f in range(int(hull[FACES])):
        # the nearest point is on a face that c is above
        if dot(vector(hull, at + 4 * f), c) > hull[at + 4 * f + 3]:
            away = sub(c, nearest_on_face(hull, f, c))
            distance = norm(away)
            if distance < least and distance > 0.0:
                least, n = distance, scale(1.0 / distance, away)
    return least, n
