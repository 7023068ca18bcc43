"""Where a mesh runs through itself: pairs of its triangles that intersect."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from mbsim.model.elements import Array
from mbsim.model.mesh import Faces

Indices = npt.NDArray[np.int64]

_CHUNK = 1 << 18
#: What reaches less far through a triangle, relative to the mesh's size, counts as touching it:
#: files with single precision scatter by 6e-8.
_TOUCH = 1e-6


def crossings(vertices: Array, faces: Faces) -> tuple[Indices, Array]:
    """Return pairs of triangles (n, 2) that intersect, and a point (n, 3) [L] of each.

    Parameters
    ----------
    vertices : ndarray, shape (n, 3)
        Positions [L].
    faces : ndarray of int, shape (m, 3)
        Vertex indices.

    Notes
    -----
    Two triangles intersect if an edge of one goes through the other. Pairs that share an edge, lie
    in one plane or only touch are not told.
    """
    points = vertices[faces]
    touch = _TOUCH * float(np.ptp(points.reshape(-1, 3), axis=0).max())
    normals = _unit_normals(points)
    pairs, places = [], []
    for i, j in near_pairs(points):
        # most near pairs lie in one plane, or one beside the other's
        may = _cuts_plane(points, normals, i, j, touch) | _cuts_plane(points, normals, j, i, touch)
        i, j = i[may], j[may]
        shared = (faces[i][:, :, None] == faces[j][:, None, :]).any(axis=2).sum(axis=1)
        i, j = i[shared < 2], j[shared < 2]
        hit = np.zeros(len(i), dtype=bool)
        place = np.zeros((len(i), 3))
        for a, b in ((i, j), (j, i)):
            for k in range(3):
                p, q = points[a, k], points[a, (k + 1) % 3]
                through, at = _through(p, q, points[b], normals[b], touch)
                place[through & ~hit] = at[through & ~hit]
                hit |= through
        pairs.append(np.column_stack([i, j])[hit])
        places.append(place[hit])
    if not pairs:
        return np.zeros((0, 2), dtype=np.int64), np.zeros((0, 3))
    return np.concatenate(pairs), np.concatenate(places)


def _unit_normals(points: Array) -> Array:
    """Return the unit normals (m, 3) of triangles (m, 3, 3), 0 of those without area."""
    normal = np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0])
    area = np.linalg.norm(normal, axis=1)
    found: Array = normal / np.where(area > 0.0, area, 1.0)[:, None]
    return found


def _cuts_plane(
    points: Array, normals: Array, i: Indices, j: Indices, touch: float
) -> npt.NDArray[np.bool_]:
    """Return which triangles i (n,) have corners on both sides of the planes of triangles j."""
    beyond, behind = np.zeros(len(i), dtype=bool), np.zeros(len(i), dtype=bool)
    start, normal = points[j, 0], normals[j]
    for k in range(3):
        above = ((points[i, k] - start) * normal).sum(axis=1)
        beyond |= above > touch
        behind |= above < -touch
    found: npt.NDArray[np.bool_] = beyond & behind
    return found


def _through(
    p: Array, q: Array, triangle: Array, normal: Array, touch: float
) -> tuple[npt.NDArray[np.bool_], Array]:
    """Return which segments p q (n, 3) go through triangles (n, 3, 3), and where."""
    a, b, c = triangle[:, 0], triangle[:, 1], triangle[:, 2]
    above, below = ((p - a) * normal).sum(axis=1), ((q - a) * normal).sum(axis=1)
    # a segment with an end on the plane touches
    through = (above * below < 0.0) & (np.minimum(abs(above), abs(below)) > touch)
    span = np.where(through, above - below, 1.0)
    at = p + (above / span)[:, None] * (q - p)
    for start, end in ((a, b), (b, c), (c, a)):
        edge = end - start
        length = np.linalg.norm(edge, axis=1)
        inward = (np.cross(normal, edge) * (at - start)).sum(axis=1)
        through &= inward > touch * length
    return through, at


def near_pairs(points: Array) -> Iterator[tuple[Indices, Indices]]:
    """Yield, in chunks, the pairs of triangles (m, 3, 3) whose boxes overlap, each once.

    Notes
    -----
    A binary tree over the triangles in the order of a space-filling curve (Z order), walked level
    by level against itself.
    """
    order = _z_order(points.mean(axis=1))
    depth = max(len(points) - 1, 0).bit_length()
    lower = np.full((1 << depth, 3), np.inf)
    upper = np.full((1 << depth, 3), -np.inf)
    lower[: len(points)] = points.min(axis=1)[order]
    upper[: len(points)] = points.max(axis=1)[order]
    levels = [(lower, upper)]
    for _ in range(depth):
        lower, upper = levels[-1]
        levels.append((np.minimum(lower[::2], lower[1::2]), np.maximum(upper[::2], upper[1::2])))
    waiting = [(depth, np.zeros(1, dtype=np.int64), np.zeros(1, dtype=np.int64))]
    while waiting:
        level, i, j = waiting.pop()
        lower, upper = levels[level]
        overlap = ((lower[i] <= upper[j]) & (lower[j] <= upper[i])).all(axis=1)
        i, j = i[overlap], j[overlap]
        if level == 0:
            apart = i != j
            yield order[i[apart]], order[j[apart]]
            continue
        for first in range(0, len(i), _CHUNK):
            a, b = 2 * i[first : first + _CHUNK], 2 * j[first : first + _CHUNK]
            # of a node with itself one of the two mixed pairs is enough
            mixed = a != b
            left = np.concatenate([a, a, a[mixed] + 1, a + 1])
            right = np.concatenate([b, b + 1, b[mixed], b + 1])
            waiting.append((level - 1, left, right))


def _z_order(points: Array) -> Indices:
    """Return the order of points (n, 3) along a curve that keeps neighbours together."""
    lower, size = points.min(axis=0), np.ptp(points, axis=0)
    cells = ((points - lower) / np.where(size > 0.0, size, 1.0) * 1023.0).astype(np.int64)
    key = np.zeros(len(points), dtype=np.int64)
    for bit in range(10):
        for axis in range(3):
            key |= ((cells[:, axis] >> bit) & 1) << (3 * bit + axis)
    return np.argsort(key, kind="stable")
