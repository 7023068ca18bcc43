"""Pieces of one mesh's triangles in the layer under another one's.

The prism under a triangle has three tetrahedra. With its corners a, b, c in the order of their
numbers in the mesh and a', b', c' their inner points these are a b c c', a b b' c', a a' b' c':
neighbours cut their common side alike. The depth psi is linear in each. A triangle that lies in a
face between two tetrahedra is counted in one of them.
"""

from __future__ import annotations

import math

from mbsim.core.arrays import F1, F2, V3, V4
from mbsim.core.jitable import jitable
from mbsim.core.rotation import add, cross, dot, norm, scale, sub, vector
from mbsim.geometry.mesh.polygon import CORNERS, begin, cut, integrate
from mbsim.geometry.mesh.record import BEYOND, MOST, OF_PSI, POTENTIAL, SUMS, add_piece
from mbsim.model.surface import DEPTH, INNER, ORDER

#: What makes an edge of a polygon besides the triangle's own edges 0, 1, 2: the sides of the prism
#: at the edges 0, 1, 2 of its triangle, the inner end, planes within the prism and its outside.
SIDE, END, WITHIN = 3, 6, 7
#: A tetrahedron whose volume is less than this part of its edges' product is flat.
FLAT = 1e-12
#: Inner points this near (as a part of the distance) to a plane may be in it.
TOUCHES = 1e-12


@jitable
def side_between(i: int, j: int) -> int:
    """Return the tag of a prism's side between two corners of its triangle."""
    # edge k is from corner k to the next
    if i + j == 1:
        return SIDE
    return SIDE + 1 if i + j == 3 else SIDE + 2


@jitable
def heights_over(x: V3, y: V3, z: V3, tri: tuple[V3, V3, V3]) -> V3:
    """Return a triangle's heights over a face, times twice its area.

    Corners of a face are given in one order, so both tetrahedra beside it find the same numbers.
    """
    n = cross(sub(y, x), sub(z, x))
    return (dot(n, sub(tri[0], x)), dot(n, sub(tri[1], x)), dot(n, sub(tri[2], x)))


@jitable
def outside(h: V3, side: float, keeps: bool) -> bool:
    """Return whether a triangle has nothing on the side of a face on which `side` h > 0.

    What lies in a face as a whole is counted on one side, where `keeps` says so.
    """
    low, high = (
        min(side * h[0], side * h[1], side * h[2]),
        max(side * h[0], side * h[1], side * h[2]),
    )
    return high < 0.0 or (high == 0.0 and (low < 0.0 or not keeps))


@jitable
def cut_at(work: F2, at: int, count: int, h: V3, side: float, tag: int) -> tuple[int, int]:
    """Cut a polygon at a face; return the first row of where it is then, and how many corners.

    There is room for two polygons in `work`, the second one from row `CORNERS` on.
    """
    if min(side * h[0], side * h[1], side * h[2]) >= 0.0:
        return at, count
    f = (side * h[0], side * (h[1] - h[0]), side * (h[2] - h[0]))
    return CORNERS - at, cut(work, at, count, f, tag, CORNERS - at)


@jitable
def add_potential(
    work: F2,
    rows: tuple[int, int],
    psi: V3,
    corners: tuple[V3, V3, V3, V3],
    depths: V4,
    tags: tuple[int, int, int, int],
    tri: tuple[V3, V3, V3],
    whole: float,
    node: F1,
) -> None:
    """Add half the integral of psi over the overlap with a tetrahedron, as far as a polygon tells.

    The polygon's corners are in rows of `work` from the first of `rows` up to the second.

    psi is 0 at the first corner a and linear, so div(psi (x - a)) = 4 psi: the integral is a
    quarter of the flux through the polygon, and through the face opposite to a, which touches
    the surface in its corner b. In its plane div(psi (x - b)) = 3 psi: what counts there are the
    polygon's edges in it, and the part of its edge c c' inside of the other mesh, which ends where
    two edges of the polygon meet. `whole` is the integral of psi over the polygon, over du dv.
    """
    a, b, c, last = corners
    e1, e2 = sub(tri[1], tri[0]), sub(tri[2], tri[0])
    n = cross(e1, e2)
    flux = whole * dot(n, sub(tri[0], a))
    if tags[0] != END:
        d = depths[3]
        on_surface = depths[2] == 0.0
        volume = abs(dot(cross(sub(b, a), sub(c, a)), sub(last, a))) if on_surface else 0.0
        way = 1.0 if dot(n, sub(last, c)) > 0.0 else -1.0
        for k in range(rows[0], rows[1]):
            tag = int(work[k, 2])
            j = k + 1 if k + 1 < rows[1] else rows[0]
            if tag == tags[0]:
                u, v, x, y = work[k, 0], work[k, 1], work[j, 0], work[j, 1]
                here = add(tri[0], add(scale(u, e1), scale(v, e2)))
                after = add(tri[0], add(scale(x, e1), scale(y, e2)))
                total = 2.0 * psi[0] + psi[1] * (u + x) + psi[2] * (v + y)
                flux -= total / 6.0 * dot(sub(b, a), cross(sub(here, b), sub(after, b)))
            beyond = int(work[j, 2])
            if on_surface and (
                (tag == tags[0] and beyond == tags[1]) or (tag == tags[1] and beyond == tags[0])
            ):
                # where c c' leaves the other mesh, or comes in
                part = (psi[0] + psi[1] * work[j, 0] + psi[2] * work[j, 1]) / d
                flux += way * part * part * d * volume / 6.0
    node[POTENTIAL] += 0.125 * flux


@jitable
def within_tetrahedron(
    corners: tuple[V3, V3, V3, V3],
    depths: V4,
    tags: tuple[int, int, int, int],
    tri: tuple[V3, V3, V3],
    work: F2,
) -> tuple[int, int, V3]:
    """Return the first row in `work` of a triangle's piece in one tetrahedron, and its corners.

    That is how many these are, less than three where there is no piece; then psi over it.

    `depths` are psi at the corners, `tags` those of the faces opposite to them. Corners are in the
    order of the mesh, those of the surface first: both sides of a face have it in one order.
    """
    none = (0, 0, (0.0, 0.0, 0.0))
    p, q, r, s = corners
    e, f, g = sub(q, p), sub(r, p), sub(s, p)
    volume = dot(cross(e, f), g)
    if abs(volume) <= FLAT * math.sqrt(dot(e, e) * dot(f, f) * dot(g, g)):
        return none
    # the corner opposite to a face is above it, or below, by the volume
    up = 1.0 if volume > 0.0 else -1.0
    hp = heights_over(q, r, s, tri)
    if outside(hp, -up, volume < 0.0 or tags[0] == END):
        return none
    hq = heights_over(p, r, s, tri)
    if outside(hq, up, volume > 0.0):
        return none
    hr = heights_over(p, q, s, tri)
    if outside(hr, -up, volume < 0.0):
        return none
    hs = heights_over(p, q, r, tri)
    if outside(hs, up, volume > 0.0):
        return none
    at, count = cut_at(work, 0, begin(work, 0), hp, -up, tags[0])
    at, count = cut_at(work, at, count, hq, up, tags[1])
    at, count = cut_at(work, at, count, hr, -up, tags[2])
    at, count = cut_at(work, at, count, hs, up, tags[3])
    # psi is the sum over corners of its depth times the height over the face opposite
    dp, dq, dr, ds = (
        -depths[0] / volume, depths[1] / volume, -depths[2] / volume, depths[3] / volume
    )  # fmt: skip
    at_a = dp * hp[0] + dq * hq[0] + dr * hr[0] + ds * hs[0]
    at_b = dp * hp[1] + dq * hq[1] + dr * hr[1] + ds * hs[1]
    at_c = dp * hp[2] + dq * hq[2] + dr * hr[2] + ds * hs[2]
    return at, count, (at_a, at_b - at_a, at_c - at_a)


@jitable
def piece_in_tetrahedron(
    corners: tuple[V3, V3, V3, V3],
    depths: V4,
    tags: tuple[int, int, int, int],
    tri: tuple[V3, V3, V3],
    side: float,
    node: F1,
    values: F1,
    work: F2,
    sums: F1,
) -> None:
    """Add the piece of a triangle in one tetrahedron to a node: see `within_tetrahedron`.

    `values` are the largest psi on the edges of the triangle and on the prism's sides (6).
    """
    at, count, psi = within_tetrahedron(corners, depths, tags, tri, work)
    if count < 3:
        return
    for k in range(SUMS):
        sums[k] = 0.0
    integrate(work, at, count, psi, sums)
    add_piece(node, sums, tri[0], sub(tri[1], tri[0]), sub(tri[2], tri[0]), side, 0.5)
    add_potential(work, (at, at + count), psi, corners, depths, tags, tri, sums[OF_PSI], node)
    note_edges(work, at, count, psi, values)
    for k in range(at, at + count):
        if int(work[k, 2]) == END:
            node[BEYOND] = max(node[BEYOND], sums[MOST])


@jitable
def note_edges(work: F2, at: int, count: int, psi: V3, values: F1) -> None:
    """Let `values` be at least psi on those edges of a polygon that neighbours share."""
    after = psi[0] + psi[1] * work[at, 0] + psi[2] * work[at, 1]
    for k in range(at, at + count):
        j = k + 1 if k + 1 < at + count else at
        here = after
        after = psi[0] + psi[1] * work[j, 0] + psi[2] * work[j, 1]
        tag = int(work[k, 2])
        if tag < END:
            values[tag] = max(values[tag], here, after)


@jitable
def tetrahedron(
    prism: F1, part: int
) -> tuple[tuple[V3, V3, V3, V3], V4, tuple[int, int, int, int]]:
    """Return corners of one of a prism's three tetrahedra, psi there, tags of the faces opposite.

    `prism` is a packed triangle.
    """
    i, j, k = int(prism[ORDER]), int(prism[ORDER + 1]), int(prism[ORDER + 2])
    a, y, z = vector(prism, 3 * i), vector(prism, INNER + 3 * j), vector(prism, INNER + 3 * k)
    da, db, dc = prism[DEPTH + i], prism[DEPTH + j], prism[DEPTH + k]
    ab, bc, ca = side_between(i, j), side_between(j, k), side_between(k, i)
    if part == 0:
        b, c = vector(prism, 3 * j), vector(prism, 3 * k)
        return (a, b, c, z), (0.0, 0.0, 0.0, dc), (bc, ca, WITHIN, WITHIN)
    if part == 1:
        return (a, vector(prism, 3 * j), y, z), (0.0, 0.0, db, dc), (bc, WITHIN, WITHIN, ab)
    return (a, vector(prism, INNER + 3 * i), y, z), (0.0, da, db, dc), (END, WITHIN, ca, ab)


@jitable
def piece_in_prism(
    prism: F1, tri: tuple[V3, V3, V3], side: float, node: F1, values: F1, work: F2, sums: F1
) -> None:
    """Add the piece of a triangle in the prism under another one to a node.

    `prism` is a packed triangle whose corners and inner points are in the same axes, from the same
    origin, as `tri`.
    """
    for part in range(3):
        corners, depths, tags = tetrahedron(prism, part)
        piece_in_tetrahedron(corners, depths, tags, tri, side, node, values, work, sums)


@jitable
def range_of(n: V3, tri: tuple[V3, V3, V3], origin: V3) -> tuple[float, float]:
    """Return the least and the largest height of three points above an origin."""
    a, b, c = dot(n, sub(tri[0], origin)), dot(n, sub(tri[1], origin)), dot(n, sub(tri[2], origin))
    return min(a, b, c), max(a, b, c)


@jitable
def apart(outer: tuple[V3, V3, V3], inner: tuple[V3, V3, V3], tri: tuple[V3, V3, V3]) -> bool:
    """Return whether a triangle has no depth in a prism, by one of five directions.

    They are the normals of both triangles and, in the plane of the prism's, those of its edges.
    What touches the prism in its surface alone has no depth; what touches its inner points may lie
    in its side, and which of both prisms there has it is not told here.
    """
    n = cross(sub(outer[1], outer[0]), sub(outer[2], outer[0]))
    low, high = range_of(n, tri, outer[0])
    if low >= 0.0 or high < min(0.0, range_of(n, inner, outer[0])[0]):
        return True
    away = TOUCHES * norm(sub(inner[0], tri[0]))
    n_tri = cross(sub(tri[1], tri[0]), sub(tri[2], tri[0]))
    low, high = range_of(n_tri, outer, tri[0])
    if low >= 0.0 or high <= 0.0:
        inner_low, inner_high = range_of(n_tri, inner, tri[0])
        room = away * norm(n_tri)
        if min(low, inner_low - room) >= 0.0 or max(high, inner_high + room) <= 0.0:
            return True
    for k in range(3):
        start = outer[k]
        out = cross(sub(outer[k + 1 if k < 2 else 0], start), n)
        low = range_of(out, tri, start)[0]
        if low >= 0.0 and low >= range_of(out, inner, start)[1] + away * norm(out):
            return True
    return False
