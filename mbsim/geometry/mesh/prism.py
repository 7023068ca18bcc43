"""Pieces of one mesh's triangles in the layer under another one's.

The prism under a triangle has three tetrahedra. With its corners a, b, c in the order of their
numbers in the mesh and a', b', c' their inner points these are a b c c', a b b' c', a a' b' c':
neighbours cut their common side alike. The depth psi is linear in each.
"""

from __future__ import annotations

import math

from mbsim.core.arrays import F1, F2, V3, V4
from mbsim.core.jitable import jitable
from mbsim.core.rotation import add, cross, dot, scale, sub, vector
from mbsim.geometry.mesh.polygon import CORNERS, begin, cut, integrate
from mbsim.geometry.mesh.record import BEYOND, MOST, SUMS, add_piece
from mbsim.model.surface import DEPTH, INNER, ORDER

#: What makes an edge of a polygon besides the triangle's own edges 0, 1, 2: the sides of the prism
#: at the edges 0, 1, 2 of its triangle, the inner end, planes within the prism and its outside.
SIDE, END, WITHIN = 3, 6, 7
#: A tetrahedron whose volume is less than this part of its edges' product is flat.
FLAT = 1e-12


@jitable
def side_between(i: int, j: int) -> int:
    """Return the tag of a prism's side between two corners of its triangle."""
    # edge k is from corner k to the next
    if i + j == 1:
        return SIDE
    return SIDE + 1 if i + j == 3 else SIDE + 2


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
) -> None:
    """Add the piece of a triangle in one tetrahedron to a node.

    `depths` are psi at the corners, `tags` those of the faces opposite to them. `values` are
    the largest psi on the edges of the triangle and on the prism's sides (6).
    """
    p, q, r, s = corners
    e, f, g = sub(q, p), sub(r, p), sub(s, p)
    fg, ge, ef = cross(f, g), cross(g, e), cross(e, f)
    volume = dot(ef, g)
    if abs(volume) <= FLAT * math.sqrt(dot(e, e) * dot(f, f) * dot(g, g)):
        return
    over = 1.0 / volume
    # gradients of the weights of q, r, s; that of p is what is left
    gq, gr, gs = scale(over, fg), scale(over, ge), scale(over, ef)
    a, b, c = sub(tri[0], p), sub(tri[1], p), sub(tri[2], p)
    qa, ra, sa = dot(gq, a), dot(gr, a), dot(gs, a)
    qb, rb, sb = dot(gq, b), dot(gr, b), dot(gs, b)
    qc, rc, sc = dot(gq, c), dot(gr, c), dot(gs, c)
    pa, pb, pc = 1.0 - qa - ra - sa, 1.0 - qb - rb - sb, 1.0 - qc - rc - sc
    if (
        max(pa, pb, pc) <= 0.0
        or max(qa, qb, qc) <= 0.0
        or max(ra, rb, rc) <= 0.0
        or max(sa, sb, sc) <= 0.0
    ):
        return
    first, second = work[:CORNERS], work[CORNERS : 2 * CORNERS]
    count = begin(first)
    if min(pa, pb, pc) < 0.0:
        count = cut(first, count, (pa, pb - pa, pc - pa), tags[0], second)
        first, second = second, first
    if min(qa, qb, qc) < 0.0:
        count = cut(first, count, (qa, qb - qa, qc - qa), tags[1], second)
        first, second = second, first
    if min(ra, rb, rc) < 0.0:
        count = cut(first, count, (ra, rb - ra, rc - ra), tags[2], second)
        first, second = second, first
    if min(sa, sb, sc) < 0.0:
        count = cut(first, count, (sa, sb - sa, sc - sa), tags[3], second)
        first, second = second, first
    if count < 3:
        return
    d = depths
    at_a = d[0] * pa + d[1] * qa + d[2] * ra + d[3] * sa
    at_b = d[0] * pb + d[1] * qb + d[2] * rb + d[3] * sb
    at_c = d[0] * pc + d[1] * qc + d[2] * rc + d[3] * sc
    psi = (at_a, at_b - at_a, at_c - at_a)
    sums = work[2 * CORNERS :].ravel()
    for k in range(SUMS):
        sums[k] = 0.0
    integrate(first, count, psi, sums)
    slope = add(scale(d[1] - d[0], gq), add(scale(d[2] - d[0], gr), scale(d[3] - d[0], gs)))
    add_piece(node, sums, tri[0], sub(tri[1], tri[0]), sub(tri[2], tri[0]), slope, side, 0.5)
    note_edges(first, count, psi, values)
    for k in range(count):
        if int(first[k, 2]) == END:
            node[BEYOND] = max(node[BEYOND], sums[MOST])


@jitable
def note_edges(polygon: F2, count: int, psi: V3, values: F1) -> None:
    """Let `values` be at least psi on the polygon's edges that neighbours share."""
    after = psi[0] + psi[1] * polygon[0, 0] + psi[2] * polygon[0, 1]
    for k in range(count):
        j = k + 1 if k + 1 < count else 0
        here = after
        after = psi[0] + psi[1] * polygon[j, 0] + psi[2] * polygon[j, 1]
        tag = int(polygon[k, 2])
        if tag < END:
            values[tag] = max(values[tag], here, after)


@jitable
def piece_in_prism(
    prism: F1, tri: tuple[V3, V3, V3], side: float, node: F1, values: F1, work: F2
) -> None:
    """Add the piece of a triangle in the prism under another one to a node.

    `prism` is a packed triangle whose corners and inner points are in the same axes, from the same
    origin, as `tri`.
    """
    i, j, k = int(prism[ORDER]), int(prism[ORDER + 1]), int(prism[ORDER + 2])
    a, b, c = vector(prism, 3 * i), vector(prism, 3 * j), vector(prism, 3 * k)
    x = vector(prism, INNER + 3 * i)
    y, z = vector(prism, INNER + 3 * j), vector(prism, INNER + 3 * k)
    da, db, dc = prism[DEPTH + i], prism[DEPTH + j], prism[DEPTH + k]
    ab, bc, ca = side_between(i, j), side_between(j, k), side_between(k, i)
    piece_in_tetrahedron(
        (a, b, c, z), (0.0, 0.0, 0.0, dc), (bc, ca, WITHIN, WITHIN), tri, side, node, values, work
    )
    piece_in_tetrahedron(
        (a, b, y, z), (0.0, 0.0, db, dc), (bc, WITHIN, WITHIN, ab), tri, side, node, values, work
    )
    piece_in_tetrahedron(
        (a, x, y, z), (0.0, da, db, dc), (END, WITHIN, ca, ab), tri, side, node, values, work
    )


@jitable
def range_of(n: V3, tri: tuple[V3, V3, V3], origin: V3) -> tuple[float, float]:
    """Return the least and the largest height of three points above an origin."""
    a, b, c = dot(n, sub(tri[0], origin)), dot(n, sub(tri[1], origin)), dot(n, sub(tri[2], origin))
    return min(a, b, c), max(a, b, c)


@jitable
def apart(outer: tuple[V3, V3, V3], inner: tuple[V3, V3, V3], tri: tuple[V3, V3, V3]) -> bool:
    """Return whether a triangle has no area in a prism, by one of five directions.

    They are the normals of both triangles and, in the plane of the prism's, those of its edges.
    """
    n = cross(sub(outer[1], outer[0]), sub(outer[2], outer[0]))
    low, high = range_of(n, tri, outer[0])
    if low >= 0.0 or high <= min(0.0, range_of(n, inner, outer[0])[0]):
        return True
    n_tri = cross(sub(tri[1], tri[0]), sub(tri[2], tri[0]))
    low, high = range_of(n_tri, outer, tri[0])
    if low >= 0.0 or high <= 0.0:
        inner_low, inner_high = range_of(n_tri, inner, tri[0])
        if min(low, inner_low) >= 0.0 or max(high, inner_high) <= 0.0:
            return True
    for k in range(3):
        start = outer[k]
        out = cross(sub(outer[k + 1 if k < 2 else 0], start), n)
        if range_of(out, tri, start)[0] >= max(0.0, range_of(out, inner, start)[1]):
            return True
    return False
