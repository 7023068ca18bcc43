"""A convex mesh and a convex solid: the direction along which they overlap least, exactly.

With n out of the mesh, far_M(n) the mesh's farthest vertex and far_S(-n) the solid's point that is
lowest along n, the overlap f(n) = n . (far_M(n) - far_S(-n)) is least, over all n,

* at the normal of a face of the mesh,
* on the arc between the normals of two faces, against the solid at their edge,
* or between a vertex and the solid.

A solid of revolution is crowned (`geometry.crowned`): it has one lowest point in every direction.
On arcs f' changes sign there. Where some f < 0 the shapes are apart; how far is not asked. Force n
at the points that meet is minus the slope of f: the elastic energy depends on the pose alone.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from mbsim.geometry.convex import ROTOR, Shape
from mbsim.geometry.crowned import arcs, outside, ways_out
from mbsim.geometry.support import round_normal

Array = np.ndarray[Any, np.dtype[np.float64]]

#: Places on an arc between which f' is looked at, and rounds to where it is 0.
_ARC, _ROUNDS = 4, 100
#: Part of the solid's size that points which meet may be beside each other, along n.
_NO_LEVER = 2e-12
#: Faces whose normals differ less are one flat side.
_FLAT = 1e-9


class Hull(NamedTuple):
    """What of a convex mesh its overlaps ask for, in its axes."""

    vertices: Array  # (n, 3)
    normals: Array  # (f, 3) outward, of its flat sides
    edges: Array  # (k, 3) a point of each edge between two sides
    beside: Array  # (k, 2, 3) the normals of these sides


class Solid(NamedTuple):
    """A cylinder, frustum or ellipsoid in the mesh's axes."""

    shape: str
    size: Array  # (3,) as in `geometry.catalog`
    centre: Array
    axes: Array  # (3, 3), columns


def hull_of(vertices: Array, faces: Any, normals: Array, beside: Any) -> Hull:
    """Return the flat sides and edges of a closed convex mesh of triangles.

    Parameters
    ----------
    vertices, normals : ndarray, shapes (n, 3), (m, 3)
    faces, beside : ndarray of int, shape (m, 3)
        Corners of each triangle, and the triangle beyond each of its edges.
    """
    sides: list[Array] = []
    edges, pairs = [], []
    for f in range(len(faces)):
        if not any(normals[f] @ other > 1.0 - _FLAT for other in sides):
            sides.append(normals[f])
        for k in range(3):
            g = int(beside[f, k])
            if g > f and normals[f] @ normals[g] < 1.0 - _FLAT:
                edges.append(vertices[faces[f, k]])
                pairs.append((normals[f], normals[g]))
    return Hull(vertices, np.array(sides), np.array(edges), np.array(pairs))


def _lowest(solid: Solid, n: Array) -> Array:
    """Return the point of the solid that is lowest along each n, shape (k, 3)."""
    local = -n @ solid.axes
    size = solid.size
    if solid.shape == "ELLIPSOID":
        scaled = local * size
        found = size * scaled / np.linalg.norm(scaled, axis=1)[:, None]
    else:
        # the point of the profile that is nearest to one far outside
        bottom, top, half = _revolved(solid)
        (at, R, _), radial = arcs((bottom, top, half)), np.hypot(local[:, 0], local[:, 1])
        x, z = R * radial, at + R * local[:, 2]
        dx, dz = top - bottom, 2.0 * half
        part = np.clip(((x - bottom) * dx + (z + half) * dz) / (dx * dx + dz * dz), 0.0, 1.0)
        above, below = (z > half) & (x < top), (z < -half) & (x < bottom)
        r = np.where(above | below, x, bottom + part * dx)
        h = np.where(above, half, np.where(below, -half, part * dz - half))
        r = r / np.maximum(radial, 1e-300)
        found = np.column_stack([r * local[:, 0], r * local[:, 1], h])
    return np.asarray(solid.centre + found @ solid.axes.T)


def _revolved(solid: Solid) -> tuple[float, float, float]:
    """Return bottom radius, top radius and half length."""
    a, b, c = solid.size.tolist()
    return (a, b, c) if solid.shape == "FRUSTUM" else (a, a, b)


def _as_shape(solid: Solid) -> Shape:
    """Return a solid of revolution as compiled code takes it."""
    x, y, z = (tuple(axis) for axis in solid.axes.T.tolist())
    return ROTOR, tuple(solid.centre.tolist()), x, y, z, _revolved(solid)


def _beyond(solid: Solid, points: Array) -> Array:
    """Return how far the solid's surface, as it is taken here, is outside of points of its own."""
    if solid.shape == "ELLIPSOID":
        return np.zeros(len(points))
    at, radius, square = arcs(_revolved(solid))
    away = points - (solid.centre + at * solid.axes[:, 2])
    return np.asarray((square - (away * away).sum(axis=1)) / (2.0 * radius))


def _overlaps(hull: Hull, solid: Solid, n: Array) -> Array:
    """Return f of each n."""
    high, low = (n @ hull.vertices.T).max(axis=1), _lowest(solid, n)
    return np.asarray(high - (n * low).sum(axis=1) + _beyond(solid, low))


def _valleys(way: Any, slope: Any, places: Array, close: float) -> Array:
    """Return the directions where f' goes from below 0 to above it, shape (k, 3).

    ``way(row, x)`` is the direction at place x of an arc or circle, ``slope(row, x)`` is f'
    there, 0 where it is less than `close`; places has shape (rows, k).
    """
    rows = np.repeat(np.arange(len(places)), places.shape[1])
    s = slope(rows, places.ravel()).reshape(places.shape)
    row, k = np.nonzero((s[:, :-1] < 0.0) & (s[:, 1:] >= 0.0))
    low, high, f, g = places[row, k], places[row, k + 1], s[row, k], s[row, k + 1]
    x, side, halve = low, np.zeros(len(row)), np.zeros(len(row), dtype=bool)
    for _ in range(_ROUNDS if len(row) else 0):
        width = high - low
        x = np.where(halve, 0.5 * (low + high), (low * g - high * f) / (g - f))
        h = slope(row, x)
        down = h < 0.0
        # Illinois rule: an end that stays twice has half its weight
        g = np.where(down & (side < 0.0), 0.5 * g, np.where(down, g, h))
        f = np.where(down, h, np.where(side > 0.0, 0.5 * f, f))
        low, high = np.where(down, x, low), np.where(down, high, x)
        side = np.where(down, -1.0, 1.0)
        # where that did not halve the rest, the middle comes next
        halve = high - low > 0.5 * width
        if ((np.abs(h) < close) | (high - low < 4e-16)).all():
            break
    return np.asarray(way(row, x))


def _at_edges(hull: Hull, solid: Solid) -> Array:
    """Return the directions of least overlap on the arcs of the edges."""
    first, second = hull.beside[:, 0], hull.beside[:, 1]
    cos = (first * second).sum(axis=1)
    across = second - cos[:, None] * first
    sin = np.linalg.norm(across, axis=1)
    across = across / sin[:, None]
    angle = np.arctan2(sin, cos)

    def way(k: Any, x: Array) -> Array:
        return np.asarray(np.cos(x)[:, None] * first[k] + np.sin(x)[:, None] * across[k])

    def slope(k: Any, x: Array) -> Array:
        turn = np.cos(x)[:, None] * across[k] - np.sin(x)[:, None] * first[k]
        return np.asarray((turn * (hull.edges[k] - _lowest(solid, way(k, x)))).sum(axis=1))

    places = np.linspace(0.0, 1.0, _ARC) * angle[:, None]
    return _valleys(way, slope, places, _NO_LEVER * float(solid.size.max()))


def _at_rotor(hull: Hull, solid: Solid) -> Array:
    """Return the directions of vertices inside a solid of revolution, and the nearest outside."""
    shape = _as_shape(solid)
    corners = [tuple(p) for p in hull.vertices.tolist()]
    heights = np.array([outside(shape, p) for p in corners])
    wanted = np.flatnonzero(heights <= 0.0).tolist()
    if (heights > 0.0).any():
        wanted.append(int(np.argmin(np.where(heights > 0.0, heights, np.inf))))
    found = [ways_out(shape, corners[k], way) for k in wanted for way in range(3)]
    return np.array([n for known, _, n in found if known]).reshape(-1, 3)


def _apart_at_vertex(hull: Hull, solid: Solid) -> Array:
    """Return the direction that parts an ellipsoid from a vertex outside it, shape (0 or 1, 3).

    Where the ellipsoid is a unit ball, the vertex is the nearest to its centre. If it is the
    nearest point of the mesh too, the ellipsoid's normal there parts the shapes, although they may
    overlap along the normals of all faces and edges.
    """
    scaled = (hull.vertices - solid.centre) @ solid.axes / solid.size
    square = (scaled * scaled).sum(axis=1)
    k = int(np.argmin(square))
    if square[k] < 1.0:
        return np.empty((0, 3))
    normal = solid.axes @ (scaled[k] / solid.size)
    return np.asarray(-normal / np.linalg.norm(normal))[None, :]


def _at_vertices(hull: Hull, solid: Solid, n: Array) -> Array:
    """Return the directions of least overlap of vertices inside an ellipsoid, beginning near n."""
    inside = (((hull.vertices - solid.centre) @ solid.axes / solid.size) ** 2).sum(axis=1) < 1.0
    point, still = np.zeros(3), np.eye(3)
    frame = (solid.centre, solid.axes)
    found = [
        round_normal("ELLIPSOID", solid.size, frame, "SPHERE", point, (vertex, still), n)
        for vertex in hull.vertices[inside]
    ]
    return np.array(found).reshape(-1, 3)


def least_overlap(hull: Hull, solid: Solid) -> tuple[float, Array]:
    """Return (f, n) of the least overlap; n is out of the mesh. Where f < 0 they are apart."""
    if solid.shape == "ELLIPSOID":
        others = _apart_at_vertex(hull, solid)
    else:
        others = np.vstack([solid.axes[:, 2], -solid.axes[:, 2]])
    n = np.vstack([hull.normals, others])
    f = _overlaps(hull, solid, n)
    k = int(np.argmin(f))
    if f[k] < 0.0:
        return float(f[k]), n[k]
    more = [n[k : k + 1], _at_edges(hull, solid)]
    if solid.shape == "ELLIPSOID":
        more.append(_at_vertices(hull, solid, n[k]))
    else:
        more.append(_at_rotor(hull, solid))
    n = np.vstack(more)
    f = _overlaps(hull, solid, n)
    k = int(np.argmin(f))
    return float(f[k]), n[k]


def touching_point(solid: Solid, f: float, n: Array) -> Array:
    """Return the middle of the points that meet along n."""
    low = _lowest(solid, n[None, :])
    return np.asarray(low[0] + (0.5 * f - _beyond(solid, low)[0]) * n)
