"""A box on a box: least depth over 15 axes, then the overlap of the two faces that meet there.

Everything is in the axes of box J: t is I's centre from J's, R[i, j] the component of I's axis i
along J's axis j. Along a unit axis n that points from J into I the boxes overlap by

    overlap(n) = sum_k hi_k |i_k . n| + sum_k hj_k |j_k . n| - |t . n|

and are apart where some overlap is negative.  The axis of least overlap is the
direction n along which the boxes are looked at; axes of edges have to be less by `FACES_FIRST`.

The face of each box that looks most against the other is projected along n. The vertices of the
two faces' common polygon are the points; each keeps the normal and the depth of the features
that meet there and lies on the line along which they push, so that its force has a potential:

    corner of I on J's face   normal of J's face, depth below that face
    corner of J on I's face   the same with I's face
    edge of I on edge of J    normal u x e of the edges, distance of their lines

A corner has weight 1; a crossing of two edges has the polygon's exterior angle over a right
angle, so that a corner that passes over an edge of the other box becomes two crossings with
weights that add up to 1, and all weights add up to 4. At that moment the normals differ by the
tilt of the faces against each other, as they do for rigid boxes; depths differ by its square.
"""

from __future__ import annotations

import math

import numpy as np

from mbsim.core.arrays import F1, F2, V3
from mbsim.core.jitable import jitable
from mbsim.core.rotation import add, cross, dot, norm, scale, sub, vector
from mbsim.geometry.catalog import axis, near_pair, pair, put_couple, put_point, region
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
from mbsim.geometry.region import polygon_area

#: Rows: for each of I's four diagonals its corner or the crossing where the edge that comes to
#: it ends, and the crossing where the edge that leaves it begins; then a corner of J for each of
#: J's diagonals. A face has one corner of every diagonal, so a corner keeps its row when
#: another face of its box takes over.
BOX_BOX_SLOTS = 12
#: An axis of two edges must overlap less than a face's by this part: where edges are parallel
#: rounding makes both alike.
FACES_FIRST = 1e-6
#: Edges nearer to parallel than this (sine squared) give no axis of their own: the faces do.
PARALLEL = 1e-16
#: Corners of I that are outside of J's face by less than this part of its size are on it: where
#: boxes of one size lie on each other rounding would say at every evaluation whose corners touch.
TIE = 1e-8
#: Vertices a scratch polygon holds: 8, and some for what rounding may add.
CAPACITY = 12
# scratch: R (9), t (3), the overlap along each axis (15)
_T, _OVERLAP, _AXES = 9, 12, 15


@jitable
def _relative_pose(frame_i: F1, frame_j: F1, s: F1) -> None:
    """Fill R and t."""
    apart = sub(vector(frame_i), vector(frame_j))
    for j in range(3):
        along = axis(frame_j, j)
        s[_T + j] = dot(apart, along)
        for i in range(3):
            s[3 * i + j] = dot(axis(frame_i, i), along)


@jitable
def _face_overlaps(hi: F1, hj: F1, s: F1) -> float:
    """Fill the overlaps along the faces' normals, J's then I's; return the least."""
    least = math.inf
    for k in range(3):
        s[_OVERLAP + k] = (
            hj[k]
            + hi[0] * abs(s[k])
            + hi[1] * abs(s[3 + k])
            + hi[2] * abs(s[6 + k])
            - abs(s[_T + k])
        )
        along = s[3 * k] * s[_T] + s[3 * k + 1] * s[_T + 1] + s[3 * k + 2] * s[_T + 2]
        s[_OVERLAP + 3 + k] = (
            hi[k]
            + hj[0] * abs(s[3 * k])
            + hj[1] * abs(s[3 * k + 1])
            + hj[2] * abs(s[3 * k + 2])
            - abs(along)
        )
        least = min(least, s[_OVERLAP + k], s[_OVERLAP + 3 + k])
    return least


@jitable
def _edge_overlaps(hi: F1, hj: F1, s: F1) -> float:
    """Fill the overlaps along i x j of every two edges, inf if parallel; return the least."""
    least = math.inf
    for i in range(3):
        i1, i2 = (i + 1) % 3, (i + 2) % 3
        for j in range(3):
            j1, j2 = (j + 1) % 3, (j + 2) % 3
            # i x j has the components (0, i . j2, -i . j1) along (j, j1, j2)
            u1, u2 = s[3 * i + j1], s[3 * i + j2]
            square = u1 * u1 + u2 * u2
            overlap = math.inf
            if square > PARALLEL:
                reach = hi[i1] * abs(s[3 * i2 + j]) + hi[i2] * abs(s[3 * i1 + j])
                reach += hj[j1] * abs(u2) + hj[j2] * abs(u1)
                along = s[_T + j1] * u2 - s[_T + j2] * u1
                overlap = (reach - abs(along)) / math.sqrt(square)
            s[_OVERLAP + 6 + 3 * i + j] = overlap
            least = min(least, overlap)
    return least


@jitable
def _direction(s: F1, a: int) -> V3:
    """Return axis a of the 15 as a unit vector from J into I, in J's axes."""
    if a < 3:
        n = (1.0 if a == 0 else 0.0, 1.0 if a == 1 else 0.0, 1.0 if a == 2 else 0.0)
    elif a < 6:
        n = vector(s, 3 * (a - 3))
    else:
        u, j = vector(s, 3 * ((a - 6) // 3)), (a - 6) % 3
        if j == 0:
            n = (0.0, u[2], -u[1])
        elif j == 1:
            n = (-u[2], 0.0, u[0])
        else:
            n = (u[1], -u[0], 0.0)
        n = scale(1.0 / norm(n), n)
    return n if dot(n, vector(s, _T)) >= 0.0 else scale(-1.0, n)


@jitable
def _least(s: F1) -> int:
    """Return the axis of least overlap."""
    best = 0
    for a in range(1, _AXES):
        worth = 1.0 + FACES_FIRST if a >= 6 and best < 6 else 1.0
        if s[_OVERLAP + a] * worth < s[_OVERLAP + best]:
            best = a
    return best


@jitable
def _steepest(a: float, b: float, c: float) -> int:
    """Return which of three components is largest in size."""
    a, b, c = abs(a), abs(b), abs(c)
    if a >= b and a >= c:
        return 0
    return 1 if b >= c else 2


@jitable
def _diagonal(k: int, sign: float, a: float, b: float) -> int:
    """Return which of a box's 4 diagonals has the corner with these signs on axes k, k+1, k+2."""
    bits = (sign > 0.0) << k | (a > 0.0) << ((k + 1) % 3) | (b > 0.0) << ((k + 2) % 3)
    return 7 - bits if bits & 4 else bits


@jitable
def _corner_of_i(k: int, sign: float, corner: int) -> int:
    """Return the diagonal of I's corner 0..3 of the polygon: (-p, -q), (p, -q), (p, q), (-p, q)."""
    # q = -sign i_o
    return _diagonal(
        k,
        sign,
        1.0 if corner == 1 or corner == 2 else -1.0,
        -sign if corner >= 2 else sign,
    )


@jitable
def _corner_of_j(k: int, sign: float, side: int) -> int:
    """Return the diagonal of J's corner behind side 0..3: (a, b), (-a, b), (-a, -b), (a, -b)."""
    return _diagonal(
        k,
        sign,
        1.0 if side == 0 or side == 3 else -1.0,
        sign if side <= 1 else -sign,
    )


@jitable
def _edge_normal(u: V3, e: V3, n: V3) -> V3:
    """Return the unit normal of an edge along u and one along e, on the side of n."""
    g = cross(u, e)
    square = dot(g, g)
    if square <= PARALLEL:
        # edges that lie on each other have no weight either
        return n
    return scale((1.0 if dot(g, n) >= 0.0 else -1.0) / math.sqrt(square), g)


@jitable
def _turning(s: F1, a: int, n: V3, m: int, o: int, k: int, sign: float) -> tuple[int, V3, V3]:
    """Return how the axis a of the 15 turns as I does, along a, b and J's normal."""
    if a < 6:
        return turning(FACE_OF_J if a < 3 else FACE_OF_I, n, n, n)
    i, j = 3 * ((a - 6) // 3), (a - 6) % 3
    e = (1.0 if j == m else 0.0, sign if j == o else 0.0, sign if j == k else 0.0)
    return turning(EDGES_MEET, n, (s[i + m], sign * s[i + o], sign * s[i + k]), e)


@jitable
def _to_global(frame_j: F1, d: V3, m: int, o: int, k: int, sign: float) -> V3:
    """Return a vector along a, b and J's normal in global axes."""
    return add(
        scale(d[0], axis(frame_j, m)),
        add(scale(sign * d[1], axis(frame_j, o)), scale(sign * d[2], axis(frame_j, k))),
    )


@jitable
def _apart(points: F2, frame_j: F1, distance: float) -> None:
    """Write the same lower bound of the distance into every row."""
    for row in range(BOX_BOX_SLOTS):
        put_point(points[row], -distance, vector(frame_j), axis(frame_j, 2))


@jitable
def _manifold(
    frame_j: F1, hi: F1, hj: F1, s: F1, best: int, n: V3, points: F2, with_area: bool
) -> float:
    """Write the vertices of the two faces' common polygon, seen along n, into their rows.

    n is the axis `best` of the 15. Return the area of what overlaps of the polygon, seen along n,
    if that is asked for. Long because each vertex needs the components of both faces' axes, which
    are some thirty numbers.
    """
    # the faces that look at each other: J's along n, I's against it
    kj = _steepest(n[0], n[1], n[2])
    mj, oj = (kj + 1) % 3, (kj + 2) % 3
    sj = 1.0 if n[kj] > 0.0 else -1.0
    # J's face has the axes a = j_m, b = sj j_o; its normal is a x b = sj j_k
    na, nb, nn = n[mj], sj * n[oj], sj * n[kj]
    A, B = hj[mj], hj[oj]

    ni = (
        dot(vector(s, 0), n),
        dot(vector(s, 3), n),
        dot(vector(s, 6), n),
    )
    ki = _steepest(ni[0], ni[1], ni[2])
    mi, oi = (ki + 1) % 3, (ki + 2) % 3
    si = -1.0 if ni[ki] > 0.0 else 1.0
    # I's face has the axes p = i_m, q = -si i_o: counter-clockwise seen along n like a, b
    nm = si * ni[ki]
    P, Q = hi[mi], hi[oi]
    # components of p, q, I's outward normal m and the middle of I's face along a, b, J's normal
    pa, pb, pk = s[3 * mi + mj], sj * s[3 * mi + oj], sj * s[3 * mi + kj]
    qa, qb, qk = -si * s[3 * oi + mj], -si * sj * s[3 * oi + oj], -si * sj * s[3 * oi + kj]
    ma, mb, mk = si * s[3 * ki + mj], si * sj * s[3 * ki + oj], si * sj * s[3 * ki + kj]
    ca = s[_T + mj] + hi[ki] * ma
    cb = sj * s[_T + oj] + hi[ki] * mb
    ck = sj * s[_T + kj] + hi[ki] * mk - hj[kj]

    # depth over J's face at (x, y): m . (point of J's face - middle of I's) / (m . n)
    slope_x, slope_y = ma / nm, mb / nm
    depth_0 = -(ma * ca + mb * cb + mk * ck) / nm

    # I's face projected along n onto J's
    shift_a, shift_b = na / nn, nb / nn
    x0, y0 = ca - shift_a * ck, cb - shift_b * ck
    px, py = P * (pa - shift_a * pk), P * (pb - shift_b * pk)
    qx, qy = Q * (qa - shift_a * qk), Q * (qb - shift_b * qk)
    polygons = np.empty((2 * CAPACITY, 3))
    polygon, other = polygons[:CAPACITY], polygons[CAPACITY:]
    for k in range(4):
        sp = 1.0 if k == 1 or k == 2 else -1.0
        sq = 1.0 if k >= 2 else -1.0
        polygon[k, X] = x0 + sp * px + sq * qx
        polygon[k, Y] = y0 + sp * py + sq * qy
        polygon[k, TAG] = k
    # edges of I: 0 along p, 1 along q, 2 and 3 back; sides of J: 4 at x = A, 5 at y = B, 6, 7
    tie = TIE * (A + B)
    count = clip(polygon, 4, other, 1.0, 0.0, A, 4.0, tie)
    count = clip(other, count, polygon, 0.0, 1.0, B, 5.0, tie)
    count = clip(polygon, count, other, -1.0, 0.0, A, 6.0, tie)
    count = clip(other, count, polygon, 0.0, -1.0, B, 7.0, tie)

    # all along a, b and J's normal
    way, out_j, out_i = (na, nb, nn), (0.0, 0.0, 1.0), (ma, mb, mk)
    turn = _turning(s, best, way, mj, oj, kj, sj)

    before = int(polygon[count - 1, TAG])
    for k in range(count):
        x, y, after = polygon[k, X], polygon[k, Y], int(polygon[k, TAG])
        depth = depth_0 + slope_x * x + slope_y * y
        # the points of J's and I's surface that lie on each other
        on_j = (x, y, hj[kj])
        on_i = sub(on_j, scale(depth, way))
        weight, couple = 1.0, (0.0, 0.0, 0.0)
        if before >= 4 and after >= 4:
            row = 8 + _corner_of_j(kj, sj, before - 4)
            # against I's face
            g = scale(-1.0, out_i)
            d = depth * dot(g, way)
            middle = sub(on_j, scale(0.5 * d, g))
        elif before < 4 and after < 4:
            row = 2 * _corner_of_i(ki, si, (before + 1) % 4)
            # against J's face
            g = out_j
            d = depth * nn
            middle = add(on_i, scale(0.5 * d, g))
        else:
            edge, side = (before, after - 4) if before < 4 else (after, before - 4)
            # an edge of I comes to its end where edge before + 1 begins
            ends = before < 4
            corner = (before + 1) % 4 if ends else after
            row = 2 * _corner_of_i(ki, si, corner) + (0 if ends else 1)
            u = (pa, pb, pk) if edge == 0 or edge == 2 else (qa, qb, qk)
            u = scale(-1.0 if edge >= 2 else 1.0, u)
            # side 0 of J runs along b, side 1 back along a
            e = (
                (0.0, 1.0 - side, 0.0)
                if side == 0 or side == 2
                else (-1.0 if side == 1 else 1.0, 0.0, 0.0)
            )
            g = _edge_normal(u, e, way)
            weight, couple = weight_of_crossing(
                u, e, way, ends, (out_i, cross(out_i, u)), (out_j, cross(e, out_j)), turn
            )
            d = depth * dot(g, way)
            middle = middle_of_lines(on_i, u, e, g, scale(depth, way), d)
        before = after
        if weight <= LEAST_WEIGHT:
            continue
        p = add(vector(frame_j), _to_global(frame_j, middle, mj, oj, kj, sj))
        put_point(points[row], d, p, _to_global(frame_j, g, mj, oj, kj, sj), weight)
        put_couple(points[row], _to_global(frame_j, couple, mj, oj, kj, sj))
    if not with_area:
        return 0.0
    count = clip(polygon, count, other, -slope_x, -slope_y, depth_0, 8.0)
    return nn * polygon_area(other, count)


@jitable
def _box_on_box(
    frame_i: F1, size_i: F1, frame_j: F1, size_j: F1, points: F2, with_area: bool
) -> float:
    """Write the common polygon of two faces; return its area if that is asked for."""
    s = np.empty(_OVERLAP + _AXES)
    _relative_pose(frame_i, frame_j, s)
    least = _face_overlaps(size_i, size_j, s)
    if least > 0.0:
        least = min(least, _edge_overlaps(size_i, size_j, s))
    if least <= 0.0:
        _apart(points, frame_j, -least)
        return 0.0
    best = _least(s)
    n = _direction(s, best)
    j0, j1, j2 = axis(frame_j, 0), axis(frame_j, 1), axis(frame_j, 2)
    normal = add(scale(n[0], j0), add(scale(n[1], j1), scale(n[2], j2)))
    for row in range(BOX_BOX_SLOTS):
        # overlapping boxes have no distance: a row without a point says 0
        put_point(points[row], 0.0, vector(frame_j), normal)
    return _manifold(frame_j, size_i, size_j, s, best, n, points, with_area)


@pair("BOX", "BOX", slots=BOX_BOX_SLOTS, regroups=True)
def box_box(frame_i: F1, size_i: F1, frame_j: F1, size_j: F1, points: F2) -> int:
    """The common polygon of two faces; apart, the largest gap along a face's or edges' axis."""
    _box_on_box(frame_i, size_i, frame_j, size_j, points, False)
    return BOX_BOX_SLOTS


@near_pair("BOX", "BOX")
def box_box_near(frame_i: F1, size_i: F1, frame_j: F1, size_j: F1, points: F2) -> int:
    """The common polygon of two faces, also where the boxes are apart along an axis."""
    s = np.empty(_OVERLAP + _AXES)
    _relative_pose(frame_i, frame_j, s)
    _face_overlaps(size_i, size_j, s)
    _edge_overlaps(size_i, size_j, s)
    best = _least(s)
    n = _direction(s, best)
    j0, j1, j2 = axis(frame_j, 0), axis(frame_j, 1), axis(frame_j, 2)
    normal = add(scale(n[0], j0), add(scale(n[1], j1), scale(n[2], j2)))
    for row in range(BOX_BOX_SLOTS):
        put_point(points[row], s[_OVERLAP + best], vector(frame_j), normal, 0.0)
    _manifold(frame_j, size_i, size_j, s, best, n, points, False)
    return BOX_BOX_SLOTS


@region("BOX", "BOX", whole=4.0)
def box_box_region(
    frame_i: F1, size_i: F1, frame_j: F1, size_j: F1, points: F2
) -> tuple[int, float]:
    """The common polygon of two faces, and its area."""
    area = _box_on_box(frame_i, size_i, frame_j, size_j, points, True)
    return BOX_BOX_SLOTS, area
