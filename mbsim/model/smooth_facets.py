"""Smooth facets: a mesh cut finer along curved patches through its vertices.

Normals at the vertices are those of N. Max, exact where the vertices lie on a sphere. Edges at
which faces bend by more than the crease angle stay sharp: a side of them has its own normals, and
they follow the direction that both sides have in common (a rim stays a circle, an edge of a box
stays straight). Each face is a cubic Bezier triangle over its edges' curves, cut into n x n
triangles. n depends on the mesh alone, so contact has the same surface in every pose.

Sources: N. Max, Weights for computing vertex normals from facet normals, J. Graphics Tools 4
(1999); A. Vlachos et al., Curved PN triangles, I3D 2001, for the inner control point.
"""

from __future__ import annotations

import math

import numpy as np

from mbsim.model.elements import Array
from mbsim.model.mesh import Faces, Marks, merge_vertices

#: Faces that bend by more than this [degrees] meet in a real edge.
CREASE = 30.0
#: Normals that differ by less [degrees] are one.
ALIKE = 1.0
#: Triangles stand off the curved surface by at most this part of the mesh's size ...
SAGITTA = 4e-6
#: ... unless they would be more than this.
MOST_TRIANGLES = 420_000
#: A curve that leaves its chord by less than this part of its length is straight.
STRAIGHT = 1e-6


def _units(a: Array) -> Array:
    length = np.linalg.norm(a, axis=-1, keepdims=True)
    unit: Array = a / np.where(length > 0.0, length, 1.0)
    return unit


def _edges(faces: Faces) -> tuple[Faces, Faces, Faces]:
    """Return unique edges (e, 2) low vertex first, the edge of each side (m, 3), sides (e, 2).

    Side 3 f + k of face f goes from its corner k to the next; the first of an edge goes up.
    """
    start, end = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    key = np.minimum(start, end) * (int(faces.max()) + 1) + np.maximum(start, end)
    _, first, number = np.unique(key, return_index=True, return_inverse=True)
    number = number.reshape(-1)
    sides = np.zeros((len(first), 2), dtype=np.int64)
    up = start < end
    sides[number[up], 0], sides[number[~up], 1] = np.flatnonzero(up), np.flatnonzero(~up)
    low = np.column_stack([np.minimum(start, end), np.maximum(start, end)])[first]
    return low, number.reshape(-1, 3), sides


def smooth_by_normals(faces: Faces, normals: Array) -> Marks:
    """Return for the edges (e,) of `_edges` whether normals say that both sides go on smoothly.

    Parameters
    ----------
    faces : ndarray of int, shape (m, 3)
    normals : ndarray, shape (m, 3, 3)
        Of the corners of the faces, of any length; NaN says nothing.
    """
    unit = _units(normals).reshape(-1, 3)
    _, _, sides = _edges(faces)
    after = sides - sides % 3 + (sides + 1) % 3
    alike = np.cos(np.radians(ALIKE))
    low = (unit[sides[:, 0]] * unit[after[:, 1]]).sum(axis=1) > alike
    high = (unit[after[:, 0]] * unit[sides[:, 1]]).sum(axis=1) > alike
    both: Marks = low & high
    return both


def corner_normals(
    vertices: Array, faces: Faces, crease: float = CREASE, told: Array | None = None
) -> Array:
    """Return the normal at every corner of every face (m, 3, 3), one on both sides of no crease.

    Parameters
    ----------
    vertices : ndarray, shape (n, 3)
        Positions [L].
    faces : ndarray of int, shape (m, 3)
        Triangles of a closed mesh, counter-clockwise seen from outside.
    crease : float
        Angle between faces above which their edge is sharp [degrees].
    told : ndarray, shape (m, 3, 3), optional
        Normals that the mesh came with: where those of both sides differ, an edge is sharp.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    p = vertices[faces]
    ahead, back = np.roll(p, -1, axis=1) - p, np.roll(p, 1, axis=1) - p
    scale = (ahead**2).sum(axis=2) * (back**2).sum(axis=2)
    weighted = np.cross(ahead, back) / np.where(scale > 0.0, scale, 1.0)[:, :, None]
    unit = _units(np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]))

    _, _, sides = _edges(faces)
    face, at = sides // 3, sides % 3
    bend = (unit[face[:, 0]] * unit[face[:, 1]]).sum(axis=1)
    smooth = bend > math.cos(math.radians(crease))
    if told is not None:
        smooth &= smooth_by_normals(faces, told)
    f, g, k, m = face[smooth, 0], face[smooth, 1], at[smooth, 0], at[smooth, 1]
    # the low end of the edge is corner k of f and the corner after m of g
    rows = np.concatenate([3 * f + k, 3 * f + (k + 1) % 3])
    columns = np.concatenate([3 * g + (m + 1) % 3, 3 * g + m])
    count = 3 * len(faces)
    graph = coo_array((np.ones(len(rows)), (rows, columns)), shape=(count, count))
    _, group = connected_components(graph, directed=False)
    total = np.zeros((int(group.max()) + 1, 3))
    np.add.at(total, group, weighted.reshape(-1, 3))
    normals: Array = _units(total)[group].reshape(-1, 3, 3)
    return normals


def _control_points(vertices: Array, low: Faces, normals: Array, sides: Faces) -> Array:
    """Return the inner control points of every edge's cubic curve, shape (e, 2, 3).

    They lie in the tangent plane of a smooth edge, on the line that both tangent planes have in
    common at a sharp one, as far away as on a circle's arc: 2 c / (3 (1 + cos)), c the chord.
    """
    flat = normals.reshape(-1, 3)
    face, at = sides // 3, sides % 3
    after = 3 * face + (at + 1) % 3
    found = np.empty((len(low), 2, 3))
    for end in range(2):
        p = vertices[low[:, end]]
        chord = vertices[low[:, 1 - end]] - p
        # the first side begins at the low end, the second one ends there
        one = flat[sides[:, 0] if end == 0 else after[:, 0]]
        other = flat[after[:, 1] if end == 0 else sides[:, 1]]
        across = np.cross(one, other)
        sharp = np.linalg.norm(across, axis=1) > 1e-6
        along = np.where(
            sharp[:, None],
            across * np.sign((across * chord).sum(axis=1))[:, None],
            chord - (chord * one).sum(axis=1)[:, None] * one,
        )
        along = _units(along)
        length = np.linalg.norm(chord, axis=1)
        cosine = (along * chord).sum(axis=1) / np.where(length > 0.0, length, 1.0)
        # a direction that leaves the chord by more than 60 degrees is none of its curve
        good = cosine > 0.5
        reach = 2.0 * length / (3.0 * (1.0 + np.where(good, cosine, 1.0)))
        found[:, end] = p + np.where(good[:, None], reach[:, None] * along, chord / 3.0)
    return found


def smooth(
    vertices: Array,
    faces: Faces,
    crease: float = CREASE,
    most: int = MOST_TRIANGLES,
    told: Array | None = None,
) -> tuple[Array, Faces]:
    """Return a closed mesh cut finer along the curved surface that its vertices lie on.

    Parameters
    ----------
    vertices : ndarray, shape (n, 3)
        Positions [L]; they stay where they are.
    faces : ndarray of int, shape (m, 3)
        Triangles of a closed mesh, counter-clockwise seen from outside.
    crease : float
        Angle between faces above which their edge is sharp [degrees].
    most : int
        Triangles at most.
    told : ndarray, shape (m, 3, 3), optional
        Normals that the mesh came with, at the corners of its faces: see `corner_normals`.
    """
    normals = corner_normals(vertices, faces, crease, told)
    low, edge_of, sides = _edges(faces)
    inner = _control_points(vertices, low, normals, sides)
    chord = vertices[low[:, 1]] - vertices[low[:, 0]]
    off = inner - vertices[low[:, 0]][:, None] - chord[:, None] * np.array([[[1.0], [2.0]]]) / 3.0
    rise = 0.75 * np.linalg.norm(off, axis=2).max(axis=1)
    if (rise <= STRAIGHT * np.linalg.norm(chord, axis=1)).all():
        return vertices, faces
    size = float(np.ptp(vertices, axis=0).max())
    n = math.ceil(math.sqrt(max(1.0, float(rise.max()) / (SAGITTA * size))))
    n = max(1, min(n, math.isqrt(most // len(faces))))
    if n == 1:
        return vertices, faces
    return _cut(vertices, faces, low, edge_of, inner, n)


def _inner_points(corners: Array, beside: Array, n: int) -> tuple[Array, Array]:
    """Return the points within Bezier triangles (m, q, 3), and their grid (q, 2).

    `beside` (m, 6, 3) are the control points beside the edges, two from each corner on.
    """
    i, j = (axis.ravel() for axis in np.meshgrid(np.arange(1, n), np.arange(1, n), indexing="ij"))
    within = i + j < n
    i, j = i[within], j[within]
    v, w = i / n, j / n
    u = 1.0 - v - w
    middle = 1.5 * beside.mean(axis=1) - 0.5 * corners.mean(axis=1)
    basis = np.stack(
        [u**3, v**3, w**3, 3 * u * u * v, 3 * u * v * v, 3 * v * v * w, 3 * v * w * w,
         3 * w * w * u, 3 * w * u * u, 6 * u * v * w], axis=1,
    )  # fmt: skip
    control = np.concatenate([corners, beside, middle[:, None]], axis=1)
    return np.einsum("qb,mbx->mqx", basis, control), np.column_stack([i, j])


def _cut(
    vertices: Array, faces: Faces, low: Faces, edge_of: Faces, inner: Array, n: int
) -> tuple[Array, Faces]:
    """Return the mesh with every face cut into n x n triangles."""
    t = np.arange(1, n)[:, None] / n
    a, b = vertices[low[:, 0]][:, None], vertices[low[:, 1]][:, None]
    curve = (1 - t) ** 3 * a + t**3 * b
    curve = curve + 3 * (1 - t) ** 2 * t * inner[:, :1] + 3 * (1 - t) * t**2 * inner[:, 1:]
    up = faces < np.roll(faces, -1, axis=1)
    beside = inner[edge_of]
    beside = np.where(up[:, :, None, None], beside, beside[:, :, ::-1]).reshape(-1, 6, 3)
    points, grid = _inner_points(vertices[faces], beside, n)

    # numbers of the grid's points in every face: corners, points of edges, its own
    m, first = len(faces), len(vertices)
    number = np.empty((m, n + 1, n + 1), dtype=np.int64)
    number[:, 0, 0], number[:, n, 0], number[:, 0, n] = faces.T
    step = np.arange(1, n)
    for side in range(3):
        # edge from corner `side` to the next one: v = i/n and w = j/n along it
        i, j = ((step, 0 * step), (n - step, step), (0 * step, n - step))[side]
        place = np.where(up[:, side, None], step - 1, n - 1 - step)
        number[:, i, j] = first + edge_of[:, side, None] * (n - 1) + place
    own = first + len(low) * (n - 1)
    number[:, grid[:, 0], grid[:, 1]] = own + np.arange(m * len(grid)).reshape(m, -1)

    i, j = (axis.ravel() for axis in np.meshgrid(np.arange(n), np.arange(n), indexing="ij"))
    one, two = i + j < n, i + j < n - 1
    upright = [
        number[:, i[one], j[one]],
        number[:, i[one] + 1, j[one]],
        number[:, i[one], j[one] + 1],
    ]
    i, j = i[two], j[two]
    turned = [number[:, i + 1, j], number[:, i + 1, j + 1], number[:, i, j + 1]]
    cut = np.concatenate([np.stack(upright, axis=-1), np.stack(turned, axis=-1)], axis=1)
    every = np.concatenate([vertices, curve.reshape(-1, 3), points.reshape(-1, 3)])
    return merge_vertices(every, cut.reshape(-1, 3))
