"""Flat parts of a mesh in as few triangles as their borders need.

How finely a flat side is cut says nothing about the part, but the layer under its surface is thin
where triangles are small, and every pair of triangles that touch is measured. So vertices that
bound nothing go: those within a flat part, and those on a straight edge between two.

A vertex is moved into a neighbour (an edge is contracted) where every triangle that is left keeps
its side up. All that stay lie where they were.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from mbsim.model.elements import Array
from mbsim.model.mesh import Faces, edges_of, in_order, joined, three_corners

#: A part is flat where its vertices are off one plane by no more than this part of the largest
#: coordinate: files in single precision are (2^-24 of each coordinate, seen along any normal).
FLAT = 2.5e-7
#: Triangles that are made are at least this many times as high as that.
HEIGHT = 8.0
#: Sine of an angle over 180 degrees below which an edge within a flat part is left as it is.
DELAUNAY = 1e-4
#: Triangles that are made are at least this part as high as the lowest that go: the layer is thin
#: under low ones.
KEPT = 0.9
#: Faces whose normals differ by more than 60 degrees are no part of one plane, however thin.
FACING = 0.5

Indices = npt.NDArray[np.int64]
Marks = npt.NDArray[np.bool_]


class Flats(NamedTuple):
    """Which faces lie in one plane, and what may go."""

    part: Indices  # (m,) of each face, numbers from 0
    normal: Array  # (parts, 3)
    within: Marks  # (n,) vertices within one flat part
    straight: Marks  # (n,) vertices on a straight edge between two


def _normals(vertices: Array, faces: Faces) -> Array:
    """Return normals (m, 3) of twice the faces' areas."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    normals: Array = np.cross(b - a, c - a)
    return normals


def _beside(faces: Faces, count: int) -> tuple[Faces, Indices]:
    """Return ends (e, 2) of each edge of a closed mesh, and the two sides at it (e, 2).

    Side 3 f + k of face f goes from its corner k to the next.
    """
    edges = edges_of(faces, count)
    order = np.argsort(edges.of_face, axis=None, kind="stable")
    return edges.ends, order.reshape(-1, 2)


def _flats(vertices: Array, faces: Faces, near: float) -> Flats | None:
    """Return the flat parts of a closed mesh; None where no vertex may go.

    `near` is what a vertex may be off a plane [L].
    """
    count = len(vertices)
    normals = _normals(vertices, faces)
    twice = np.linalg.norm(normals, axis=1)
    units = normals / np.where(twice > 0.0, twice, 1.0)[:, None]
    ends, sides = _beside(faces, count)
    face, at = sides // 3, sides % 3
    small = np.argmin(twice[face], axis=1)
    row = np.arange(len(face))
    one, other = face[row, small], face[row, 1 - small]
    opposite = faces[one, (at[row, small] + 2) % 3]
    off = ((vertices[opposite] - vertices[ends[:, 0]]) * units[other]).sum(axis=1)
    alike = (units[one] * units[other]).sum(axis=1)
    same = (np.abs(off) <= near) & (alike > FACING)
    if not same.any():
        return None

    part = joined(face[same, 0], face[same, 1], len(faces))
    # all vertices of a part are to be near its plane, else its faces stay what they are
    total = np.zeros((int(part.max()) + 1, 3))
    np.add.at(total, part, normals)
    length = np.linalg.norm(total, axis=1)
    plane = total / np.where(length > 0.0, length, 1.0)[:, None]
    along = (vertices[faces] * plane[part][:, None]).sum(axis=2)
    low, high = np.full(len(total), np.inf), np.full(len(total), -np.inf)
    np.minimum.at(low, part, along.min(axis=1))
    np.maximum.at(high, part, along.max(axis=1))
    flat = (high - low <= 2.0 * near)[part] & ((units * plane[part]).sum(axis=1) > FACING)
    bent = np.zeros(len(total), dtype=bool)
    bent[part[~flat]] = True
    alone = bent[part]
    part = np.where(alone, len(total) + np.arange(len(faces)), part)
    kept, part = np.unique(part, return_inverse=True)
    part = part.reshape(-1)
    of = kept < len(total)
    normal = np.empty((len(kept), 3))
    normal[of] = plane[kept[of]]
    normal[~of] = units[kept[~of] - len(total)]

    edge = part[face[:, 0]] != part[face[:, 1]]
    meet = np.bincount(ends[edge].ravel(), minlength=count)
    straight = meet == 2
    straight[straight] = _in_line(vertices, ends[edge], straight, near)
    return Flats(part, normal, meet == 0, straight)


def parts_of(vertices: Array, faces: Faces) -> tuple[Indices, Array]:
    """Return the flat part of each face of a closed mesh, numbers from 0, and their normals."""
    flats = _flats(vertices, faces, FLAT * float(np.abs(vertices).max()))
    if flats is not None:
        return flats.part, flats.normal
    normals = _normals(vertices, faces)
    length = np.linalg.norm(normals, axis=1)
    return np.arange(len(faces)), normals / np.where(length > 0.0, length, 1.0)[:, None]


def _in_line(vertices: Array, ends: Faces, chosen: Marks, near: float) -> Marks:
    """Return which of the chosen vertices lie between the other ends of their two edges."""
    start, end = ends.ravel(), ends[:, ::-1].ravel()
    mine = chosen[start]
    order = np.argsort(start[mine], kind="stable")
    here = start[mine][order][::2]
    others = end[mine][order].reshape(-1, 2)
    a, b = vertices[others[:, 0]] - vertices[here], vertices[others[:, 1]] - vertices[here]
    chord = np.linalg.norm(b - a, axis=1)
    off = np.linalg.norm(np.cross(a, b), axis=1)
    in_line: Marks = (off <= 2.0 * near * chord) & ((a * b).sum(axis=1) < 0.0)
    return in_line


def _chosen(faces: Faces, order: Indices, may_go: Marks) -> Marks:
    """Return vertices that may go at once: the first in `order` among all two edges away."""
    count = len(order)
    rank = np.where(may_go, order, count)
    near = rank
    for _ in range(2):
        least = near[faces].min(axis=1)
        near = near.copy()
        for k in range(3):
            np.minimum.at(near, faces[:, k], least)
    chosen: Marks = may_go & (near == order)
    return chosen


def _heights(corners: Array, normals: Array) -> Array:
    """Return the least heights of triangles (k, 3, 3) [L]; below 0 for one upside down."""
    a, b, c = (corners[:, k] for k in range(3))
    twice = (np.cross(b - a, c - a) * normals).sum(axis=1)
    long = np.max([((p - q) ** 2).sum(axis=1) for p, q in ((a, b), (b, c), (c, a))], axis=0)
    heights: Array = twice / np.sqrt(long)
    return heights


def _contracted(vertices: Array, faces: Faces, flats: Flats, chosen: Marks, least: float) -> Faces:
    """Return edges (k, 2) from chosen vertices to where they go: all triangles keep their sides up.

    `least` is the least height of a triangle [L]. The best way makes the highest ones.
    """
    count = len(vertices)
    # the faces around each vertex that goes, and the edges from it with the parts at both sides
    star, corner = np.nonzero(chosen[faces])
    hub = faces[star, corner]
    by = np.argsort(hub, kind="stable")
    star, corner, hub = star[by], corner[by], hub[by]
    after, before = faces[star, (corner + 1) % 3], faces[star, (corner + 2) % 3]
    left, right = np.lexsort((after, hub)), np.lexsort((before, hub))
    border = np.empty(len(star), dtype=bool)
    border[left] = flats.part[star[left]] != flats.part[star[right]]
    open_way = border | ~flats.straight[hub]
    ways = np.column_stack([hub, after])[open_way]
    # each way with all of the faces
    first = np.searchsorted(hub, ways[:, 0], side="left")
    many = np.searchsorted(hub, ways[:, 0], side="right") - first
    way = np.repeat(np.arange(len(ways)), many)
    at = first[way] + np.arange(len(way)) - np.repeat(np.cumsum(many) - many, many)
    ahead, back, to = after[at], before[at], ways[way, 1]
    stays = (ahead != to) & (back != to)

    # neighbours that both ends have: two, or the surface would be pinched
    beside = np.zeros(count, dtype=bool)
    beside[after] = True
    near = faces[beside[faces].sum(axis=1) > 1]
    keys = np.sort((near * count + np.roll(near, -1, axis=1)).ravel())
    key = to * count + ahead
    place = np.minimum(np.searchsorted(keys, key), len(keys) - 1)
    common = np.bincount(way, weights=keys[place] == key, minlength=len(ways))

    made = np.column_stack([to[stays], ahead[stays], back[stays]])
    height = _heights(vertices[made], flats.normal[flats.part[star[at[stays]]]])
    score = np.full(len(ways), np.inf)
    np.minimum.at(score, way[stays], height)
    was = np.full(count, np.inf)
    np.minimum.at(was, hub, _heights(vertices[faces[star]], flats.normal[flats.part[star]]))
    score[(common != 2) | (score < np.maximum(least, KEPT * was[ways[:, 0]]))] = 0.0
    best = np.lexsort((ways[:, 1], -score, ways[:, 0]))
    best = best[np.append(True, np.diff(ways[best, 0]) > 0)]
    going: Faces = ways[best[score[best] > 0.0]]
    return going


def _thinned(vertices: Array, faces: Faces, flats: Flats, least: float) -> tuple[Faces, Flats]:
    """Return the mesh without vertices that may go, as far as its triangles let them."""
    order = np.random.default_rng(0).permutation(len(vertices))
    candidates = flats.within | flats.straight
    may_go = candidates & np.isin(np.arange(len(vertices)), faces)
    while may_go.any():
        chosen = _chosen(faces, order, may_go)
        going = _contracted(vertices, faces, flats, chosen, least)
        may_go &= ~chosen
        into = np.arange(len(vertices))
        into[going[:, 0]] = going[:, 1]
        moved = (into[faces] != faces).any(axis=1)
        # around what went, others that could not may go now
        again = np.zeros(len(vertices), dtype=bool)
        again[faces[moved]] = True
        again[going[:, 0]] = False
        may_go |= again & candidates
        faces = into[faces]
        left = three_corners(faces)
        faces, flats = faces[left], flats._replace(part=flats.part[left])
    return faces, flats


def _flipped(vertices: Array, faces: Faces, flats: Flats, least: float) -> tuple[Faces, Flats]:
    """Return the mesh with edges turned within flat parts (Delaunay): fewest slender triangles.

    Angles opposite to an edge are then at most 180 degrees together.
    """
    count, faces, part = len(vertices), faces.copy(), flats.part.copy()
    while True:
        ends, sides = _beside(faces, count)
        face, at = sides // 3, sides % 3
        within = part[face[:, 0]] == part[face[:, 1]]
        face, at = face[within], at[within]
        (f, g), (k, m) = face.T, at.T
        a, b = faces[f, k], faces[f, (k + 1) % 3]
        p, q = faces[f, (k + 2) % 3], faces[g, (m + 2) % 3]
        normal = flats.normal[part[f]]
        u, v = vertices[a] - vertices[p], vertices[b] - vertices[p]
        x, y = vertices[b] - vertices[q], vertices[a] - vertices[q]
        sine = (np.cross(u, v) * normal).sum(axis=1) * (x * y).sum(axis=1)
        sine += (np.cross(x, y) * normal).sum(axis=1) * (u * v).sum(axis=1)
        size = np.sqrt(((u * u).sum(axis=1)) * ((v * v).sum(axis=1)))
        size *= np.sqrt(((x * x).sum(axis=1)) * ((y * y).sum(axis=1)))
        bad = np.flatnonzero(sine < -DELAUNAY * size)
        one = np.column_stack([p, a, q])[bad]
        two = np.column_stack([q, b, p])[bad]
        keys = ends[:, 0] * count + ends[:, 1]
        key = np.minimum(p, q)[bad] * count + np.maximum(p, q)[bad]
        free = ~np.isin(key, keys)
        for made in (one, two):
            free &= _heights(vertices[made], normal[bad]) > least
        bad, one, two, key = bad[free], one[free], two[free], key[free]
        if len(bad) == 0:
            return faces, flats._replace(part=part)
        # the worst of each face, and one edge between two vertices only
        rank = np.empty(len(bad), dtype=np.int64)
        rank[np.argsort(sine[bad] / size[bad], kind="stable")] = np.arange(len(bad))
        lowest = np.full(len(faces) + len(bad), len(bad))
        _, new = np.unique(key, return_inverse=True)
        users = (f[bad], g[bad], len(faces) + new.reshape(-1))
        for user in users:
            np.minimum.at(lowest, user, rank)
        take = np.all([lowest[user] == rank for user in users], axis=0)
        faces[f[bad[take]]], faces[g[bad[take]]] = one[take], two[take]


def fewer_triangles(vertices: Array, faces: Faces) -> tuple[Array, Faces]:
    """Return a closed mesh with its flat parts in fewer triangles, itself where there are none.

    Parameters
    ----------
    vertices : ndarray, shape (n, 3)
        Positions [L].
    faces : ndarray of int, shape (m, 3)
        Triangles of a closed mesh, counter-clockwise seen from outside.

    Notes
    -----
    The surface moves by at most `FLAT` of the largest coordinate. The order of vertices and
    faces changes nothing.
    """
    near = FLAT * float(np.abs(vertices).max())
    if _flats(vertices, faces, near) is None:
        return vertices, faces
    # one order for all: vertices by their places, faces by their least corner
    by = np.lexsort(vertices.T)
    vertices = vertices[by]
    number = np.empty(len(by), dtype=np.int64)
    number[by] = np.arange(len(by))
    faces = in_order(number[faces])
    flats = _flats(vertices, faces, near)
    if flats is None:
        return vertices, faces
    least = HEIGHT * near
    while True:
        faces, flats = _flipped(vertices, faces, flats, least)
        fewer, left = _thinned(vertices, faces, flats, least)
        if len(fewer) == len(faces):
            break
        faces, flats = fewer, left
    used, faces = np.unique(faces, return_inverse=True)
    return vertices[used], in_order(faces.reshape(-1, 3))
