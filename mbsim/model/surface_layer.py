"""The layer of tetrahedra under the surface of a closed mesh, on which depth is measured.

Every vertex v has an inner vertex v' = v - D m, where m.n = 1 for the planes of its faces and D
is its depth in the layer. The prism between a face and its inner vertices is cut into three
tetrahedra; a field psi that is linear in each, 0 on the surface and D at the inner vertices, is
continuous and is the distance under the face's plane wherever m solves its equations exactly.

The layer is as deep as is safe: no tetrahedron is turned over, and no inner point of a prism is
nearer to the surface than `KEEPS` of its depth, so that layers from opposite sides meet at most.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mbsim.model.elements import Array
from mbsim.model.mesh import Faces, in_order
from mbsim.model.triangle_distance import nearest_on

#: An inner point at depth d is at least so much times d away from the surface.
KEEPS = 0.9
#: The part of the largest depth allowed that is taken.
PART = 0.8
#: A vertex of three planes or more: directions with singular values below the first (of the
#: largest) are left at the mean normal where the equations have no solution, below the second
#: where they have one (a corner, an edge).
INEXACT, EXACT = 0.1, 1e-3
#: Residual of equations that have a solution; STL files with single precision reach 1e-7.
SOLVED = 1e-5
#: Least m.n of an inner direction by least squares; below it the mean normal is taken, and below
#: the second the direction that goes best into all of the faces.
LEAST_SLOPE, LEAST_OF_MEAN = 0.5, 0.3
#: Length of an inner direction (an edge of 2 degrees) above which it is not believed.
LONGEST = 60.0
#: Normals around one vertex among which that direction is looked for.
MOST_NORMALS = 40
#: Distances to the surface are looked for among the triangles of so many nearest samples.
NEAR = 4
#: Samples of the surface for a mesh of few triangles.
SAMPLES = 3_000
#: A sample so much farther than the nearest may be taken for it (near a sphere's centre all are
#: as near).
SLACK = 0.2
#: Rounds of shrinking; each passes the nearest point found in the round before.
ROUNDS = 30
#: Parts of the way in at which the surface is looked for, nearest first.
ALONG = (0.02, 0.06, 0.15, 0.3, 0.5, 0.75, 1.0)
#: Between vertices the depth is lowered by no more than this at once: the way in turns with it.
GENTLY = 0.8
#: Depth at which the search ends, as part of the mesh's least extent; that of a mesh with more
#: than `FINE` triangles (from a sphere's middle all of them are nearly as near, which costs).
DEEPEST, DEEPEST_FINE, FINE = 0.45, 0.22, 10_000
#: Least volume of a tetrahedron, as part of that of a prism with upright sides.
LEAST_VOLUME = 0.02


class Layer(NamedTuple):
    """The layer of a mesh: where its vertices' inner ones are, and how deep."""

    inner: Array  # (n, 3) [L]
    depth: Array  # (n,) [L]; 0 where a vertex has no direction into all of its faces


def face_normals(vertices: Array, faces: Faces) -> tuple[Array, Array]:
    """Return unit normals (m, 3), 0 for a face without area, and areas (m,) [L^2]."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    normal = np.cross(b - a, c - a)
    length = np.linalg.norm(normal, axis=1)
    return normal / np.where(length > 0.0, length, 1.0)[:, None], 0.5 * length


def corner_angles(vertices: Array, faces: Faces) -> Array:
    """Return the angle of every face at each of its corners, shape (m, 3) [rad]."""
    p = vertices[faces]
    ahead, back = np.roll(p, -1, axis=1) - p, np.roll(p, 1, axis=1) - p
    across = np.linalg.norm(np.cross(ahead, back), axis=2)
    angles: Array = np.arctan2(across, (ahead * back).sum(axis=2))
    return angles


def tetrahedra(faces: Faces) -> Faces:
    """Return the tetrahedra of the layer, shape (3 m, 4): corner k + n is the inner one of k.

    Parameters
    ----------
    faces : ndarray of int, shape (m, 3)
        Triangles; n is the largest number in them plus 1. Tetrahedra 3 f, 3 f + 1, 3 f + 2 are
        those of face f, and the first has its three outer corners.

    Notes
    -----
    The diagonal of a prism's side goes from the outer corner with the smaller number to the
    inner corner with the larger, so that neighbours cut their common side alike. With corners
    in the order found, ``dot(q - p, cross(r - p, s - p)) > 0`` for tetrahedron p q r s.
    """
    count = int(faces.max()) + 1
    order = np.argsort(faces, axis=1)
    a, b, c = np.take_along_axis(faces, order, axis=1).T
    #: an odd order turns the face over
    odd = (order[:, 1] - order[:, 0]) % 3 != 1
    cut = np.stack(
        [
            np.column_stack([c + count, a, b, c]),
            np.column_stack([b + count, c + count, a, b]),
            np.column_stack([a + count, b + count, c + count, a]),
        ],
        axis=1,
    )
    cut[odd] = cut[odd][:, :, [0, 2, 1, 3]]
    found: Faces = cut.reshape(-1, 4)
    return found


def volumes(points: Array, cut: Faces) -> Array:
    """Return the signed volume of tetrahedra (k, 4) of points (n, 3) [L^3]."""
    p, q, r, s = (points[cut[:, k]] for k in range(4))
    signed: Array = (np.cross(r - p, s - p) * (q - p)).sum(axis=1) / 6.0
    return signed


def _mean_normals(count: int, faces: Faces, normals: Array, angles: Array) -> Array:
    """Return the mean of the faces' normals at each vertex, weighted by angle, unit length."""
    total = np.zeros((count, 3))
    for k in range(3):
        np.add.at(total, faces[:, k], angles[:, k, None] * normals)
    length = np.linalg.norm(total, axis=1)
    mean: Array = total / np.where(length > 0.0, length, 1.0)[:, None]
    return mean


def _least_slope(count: int, faces: Faces, normals: Array, m: Array) -> Array:
    """Return the least m.n of each vertex over its faces, shape (n,)."""
    least = np.full(count, np.inf)
    for k in range(3):
        np.minimum.at(least, faces[:, k], (m[faces[:, k]] * normals).sum(axis=1))
    return least


def inner_directions(vertices: Array, faces: Faces) -> tuple[Array, Array]:
    """Return m (n, 3) with m.n = 1 for the faces around each vertex, and the least m.n (n,).

    Notes
    -----
    Least squares, weighted by the faces' angles at the vertex (cutting a flat side differently
    changes nothing), from the mean normal in the directions that the planes determine. Where
    m would be long or leave a face on its wrong side, it is the mean normal scaled so that the
    mean of m.n is 1. A least m.n <= 0: no direction is found that goes into all the faces.
    """
    count = len(vertices)
    normals, _ = face_normals(vertices, faces)
    angles = corner_angles(vertices, faces)
    mean = _mean_normals(count, faces, normals, angles)
    matrix, right = np.zeros((count, 3, 3)), np.zeros((count, 3))
    for k in range(3):
        v, w = faces[:, k], angles[:, k]
        left = 1.0 - (mean[v] * normals).sum(axis=1)
        np.add.at(matrix, v, w[:, None, None] * normals[:, :, None] * normals[:, None, :])
        np.add.at(right, v, (w * left)[:, None] * normals)
    values, axes = np.linalg.eigh(matrix)
    part = np.einsum("vij,vi->vj", axes, right)
    largest = np.maximum(values[:, -1:], 1e-300)

    def solution(below: float) -> Array:
        good = values > below**2 * largest
        step = np.where(good, part / np.where(good, values, 1.0), 0.0)
        found: Array = mean + np.einsum("vij,vj->vi", axes, step)
        return found

    exact, other = solution(EXACT), solution(INEXACT)
    worst = np.zeros(count)
    for k in range(3):
        error = np.abs((exact[faces[:, k]] * normals).sum(axis=1) - 1.0)
        np.maximum.at(worst, faces[:, k], np.where(angles[:, k] > 1e-6, error, 0.0))
    short = np.linalg.norm(exact, axis=1) < LONGEST
    m = np.where(((worst < SOLVED) & short)[:, None], exact, other)
    least = _least_slope(count, faces, normals, m)
    for limit, choose in ((LEAST_SLOPE, _mean), (LEAST_OF_MEAN, _most_normal)):
        for v in np.flatnonzero(least < limit).tolist():
            own, at = np.nonzero(faces == v)
            m[v] = choose(normals[own], angles[own, at])
        least = _least_slope(count, faces, normals, m)
    return m, least


def _scaled(direction: Array, normals: Array, angles: Array) -> Array:
    """Return a direction so long that its mean component along the normals is 1."""
    along = float(angles @ (normals @ direction)) / max(float(angles.sum()), 1e-300)
    scaled: Array = direction / max(along, 1.0 / LONGEST)
    return scaled


def _mean(normals: Array, angles: Array) -> Array:
    mean = angles @ normals
    length = float(np.linalg.norm(mean))
    return _scaled(mean / max(length, 1e-300), normals, angles)


def _most_normal(normals: Array, angles: Array) -> Array:
    """Return the direction whose least component along the normals is largest, scaled.

    It is the middle of the smallest cap around them: through two of them or three.
    """
    distinct = np.unique(np.round(normals[angles > 1e-6], 9), axis=0)[:MOST_NORMALS]
    i, j = np.triu_indices(len(distinct), 1)
    pairs = distinct[i] + distinct[j]
    ends = [distinct[k] for k in range(len(distinct))]
    across = [np.cross(distinct[j] - distinct[i], end - distinct[i]) for end in ends]
    threes = np.concatenate([np.zeros((0, 3)), *across])
    choice = np.concatenate([(angles @ normals)[None, :], pairs, threes, -threes])
    length = np.linalg.norm(choice, axis=1)
    choice = choice[length > 1e-9] / length[length > 1e-9, None]
    if len(choice) == 0:
        return np.zeros(3)
    least = (choice @ normals[angles > 1e-6].T).min(axis=1)
    return _scaled(choice[int(least.argmax())], normals, angles)


class _Samples:
    """Samples of the surface (weights of the corners of a triangle), and where the surface is."""

    def __init__(self, vertices: Array, faces: Faces) -> None:
        from scipy.spatial import KDTree

        self.corners = vertices[faces]
        face, weights = _spread(vertices, faces)
        self.face = face
        points = np.einsum("sk,skx->sx", weights, self.corners[face])
        self.tree = KDTree(points)
        # a vertex is a sample of one triangle only: it has the same limit in all of them
        used, first = np.unique(faces.ravel(), return_index=True)
        at_vertex = np.zeros((len(used), 3))
        at_vertex[np.arange(len(used)), first % 3] = 1.0
        if len(faces) < SAMPLES:
            self.of = faces[np.concatenate([first // 3, face])]
            self.weights = np.concatenate([at_vertex, weights])
        else:
            self.of, self.weights = faces[first // 3], at_vertex

    def nearest(self, points: Array) -> Array:
        """Return the nearest points of the surface, shape (k, 3)."""
        _, found = self.tree.query(points, k=min(NEAR, self.tree.n), eps=SLACK)
        found = found.reshape(len(points), -1)
        best, least = np.empty_like(points), np.full(len(points), np.inf)
        for column in self.face[found].T:
            q = nearest_on(points, self.corners[column])
            away = ((points - q) ** 2).sum(axis=1)
            closer = away < least
            best[closer], least[closer] = q[closer], away[closer]
        return best


def _spread(vertices: Array, faces: Faces) -> tuple[Faces, Array]:
    """Return triangles and weights of their corners (s, 3) of samples spread over the surface.

    Every triangle has one in its middle; of a mesh of few triangles, the large ones have more,
    in the order of the sequence with the plastic number (M. Roberts, 2018).
    """
    _, area = face_normals(vertices, faces)
    more = SAMPLES * area / max(float(area.sum()), 1e-300)
    each = np.ones(len(faces), dtype=np.int64)
    if len(faces) < SAMPLES:
        each += more.astype(np.int64)
    which = np.repeat(np.arange(len(faces)), each)
    rank = np.arange(len(which)) - np.repeat(np.cumsum(each) - each, each)
    plastic = 1.324717957244746
    u, v = (1.0 / 3.0 + rank / plastic) % 1.0, (1.0 / 3.0 + rank / plastic**2) % 1.0
    over = u + v > 1.0
    u, v = np.where(over, 1.0 - u, u), np.where(over, 1.0 - v, v)
    return which, np.column_stack([1.0 - u - v, u, v])


def _touch(e: Array, way: Array, depth: Array) -> Array:
    """Return the part s of a way in at which a ball of radius s `depth` meets a point.

    Parameters
    ----------
    e : ndarray, shape (k, 3)
        From the point met to the start.
    way : ndarray, shape (k, 3)
        The way in is ``start - s way``; |way| > depth.
    depth : ndarray, shape (k,)
    """
    a = (way**2).sum(axis=1) - depth**2
    b, c = (e * way).sum(axis=1), (e**2).sum(axis=1)
    root = np.sqrt(np.maximum(b * b - a * c, 0.0))
    part: Array = np.where((b > 0.0) & (a > 0.0), c / np.maximum(b + root, 1e-300), 1.0)
    return np.clip(part, 0.0, 1.0)


def _free_depths(vertices: Array, faces: Faces, m: Array, slope: Array) -> Array:
    """Return the depths (n,) at which the inner points of the layer keep off the surface."""
    samples = _Samples(vertices, faces)
    of, weights = samples.of, samples.weights
    start = np.einsum("sk,skx->sx", weights, vertices[of])
    keep = KEEPS * np.clip(slope, 0.0, 1.0)
    deepest = DEEPEST if len(faces) <= FINE else DEEPEST_FINE
    depth = np.full(len(vertices), deepest * float(np.ptp(vertices, axis=0).min()))
    depth[slope <= 0.0] = 0.0
    for part in ALONG:
        looked = np.arange(len(of))
        for _ in range(ROUNDS):
            of_d = depth[of[looked]] * weights[looked]
            way = part * np.einsum("sk,skx->sx", of_d, m[of[looked]])
            ball = part * (of_d * keep[of[looked]]).sum(axis=1)
            near = samples.nearest(start[looked] - way)
            free = np.linalg.norm(start[looked] - way - near, axis=1)
            bad = free < 0.999 * ball
            if not bad.any():
                break
            looked, way, ball, near = looked[bad], way[bad], ball[bad], near[bad]
            s = part * np.minimum(_touch(start[looked] - near, way, ball), 0.999)
            s = np.where(weights[looked].max(axis=1) < 1.0, np.maximum(s, GENTLY), s)
            lower = s[:, None] * depth[of[looked]]
            within = weights[looked] > 0.0
            np.minimum.at(depth, of[looked][within], lower[within])
    return depth


def layer(vertices: Array, faces: Faces) -> Layer:
    """Return the inner vertices and depths of the layer under a closed mesh.

    Parameters
    ----------
    vertices : ndarray, shape (n, 3)
        Positions [L].
    faces : ndarray of int, shape (m, 3)
        Triangles, counter-clockwise seen from outside; a closed surface
        (`mesh.solid_fault` says nothing).

    Notes
    -----
    Depth is first limited by the room around each way in: a ball of `KEEPS` of the depth around
    the inner point is free of the surface. `PART` of that is taken. Then the depths at
    the corners of tetrahedra that are turned over or nearly flat shrink until all are upright.
    The order of the faces changes nothing, to the last bit.
    """
    faces = in_order(faces)
    m, slope = inner_directions(vertices, faces)
    depth = PART * _free_depths(vertices, faces, m, slope)
    cut = tetrahedra(faces)
    _, area = face_normals(vertices, faces)
    whole = np.repeat(area, 3) / 3.0
    corners = cut % len(vertices)
    inner_at = cut >= len(vertices)
    for _ in range(60):
        points = np.concatenate([vertices, vertices - depth[:, None] * m])
        deepest = np.where(inner_at, depth[corners], np.inf).min(axis=1)
        bad = (volumes(points, cut) < LEAST_VOLUME * whole * deepest) & (deepest > 0.0)
        if not bad.any():
            break
        depth[np.unique(corners[bad])] *= 0.8
    else:
        depth[np.unique(corners[bad])] = 0.0
    return Layer(vertices - depth[:, None] * m, depth)
