"""A convex mesh and a convex solid: the direction along which they overlap least, exactly.

With n out of the mesh, far_M(n) the mesh's farthest vertex and far_S(-n) the solid's point that is
lowest along n, the overlap f(n) = n . (far_M(n) - far_S(-n)) is least, over all n,

* at the normal of a face of the mesh or of an end disc of the solid,
* on the arc between the normals of two faces, against the round of the solid at their edge,
* on the circle of the normals of a solid of revolution's side, against a vertex or an edge,
* or between a vertex and an ellipsoid.

On arcs and circles f' changes sign there: smoothly, or with a jump where both meet, which has a
closed form. Where some f < 0 the shapes are apart; how far is not asked. Force n at the points that
meet is minus the slope of f: the elastic energy depends on the pose alone.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from mbsim.geometry.support import round_normal, support

Array = np.ndarray[Any, np.dtype[np.float64]]

#: Places on an arc and on a circle between which f' is looked at, and rounds to where it is 0.
_ARC, _CIRCLE, _ROUNDS = 4, 25, 20
#: Faces whose normals differ less are one flat side.
_FLAT = 1e-9
#: Vertices are as high as each other within this part of the solid's size.
_TIE = 1e-9
#: A support point that a tilt by this moves by more than `_WIDE` of the solid's size is part of
#: a line or a disc; from a third of that on it begins to be one.
_TILT, _WIDE = 2e-3, 0.15


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
        bottom, top, half = _revolved(solid)
        radial = np.hypot(local[:, 0], local[:, 1])
        upper = top * radial + half * local[:, 2] >= bottom * radial - half * local[:, 2]
        with np.errstate(divide="ignore", invalid="ignore"):
            rim = np.where(radial > 0.0, np.where(upper, top, bottom) / radial, 0.0)
        found = np.column_stack([
            rim * local[:, 0], rim * local[:, 1], np.where(upper, half, -half)
        ])  # fmt: skip
    return np.asarray(solid.centre + found @ solid.axes.T)


def _revolved(solid: Solid) -> tuple[float, float, float]:
    """Return bottom radius, top radius and half length."""
    a, b, c = solid.size.tolist()
    return (a, b, c) if solid.shape == "FRUSTUM" else (a, a, b)


def _overlaps(hull: Hull, solid: Solid, n: Array) -> Array:
    """Return f of each n."""
    high = (n @ hull.vertices.T).max(axis=1)
    return np.asarray(high - (n * _lowest(solid, n)).sum(axis=1))


def _valleys(way: Any, slope: Any, places: Array) -> Array:
    """Return the directions where f' goes from below 0 to above it, shape (k, 3).

    ``way(row, x)`` is the direction at place x of an arc or circle, ``slope(row, x)`` is f'
    there; places has shape (rows, k).
    """
    rows = np.repeat(np.arange(len(places)), places.shape[1])
    s = slope(rows, places.ravel()).reshape(places.shape)
    row, k = np.nonzero((s[:, :-1] < 0.0) & (s[:, 1:] >= 0.0))
    low, high, f, g = places[row, k], places[row, k + 1], s[row, k], s[row, k + 1]
    x, side = low, np.zeros(len(row))
    for _ in range(_ROUNDS if len(row) else 0):
        x = (low * g - high * f) / (g - f)
        h = slope(row, x)
        down = h < 0.0
        # Illinois rule: an end that stays twice has half its weight
        g = np.where(down & (side < 0.0), 0.5 * g, np.where(down, g, h))
        f = np.where(down, h, np.where(side > 0.0, 0.5 * f, f))
        low, high = np.where(down, x, low), np.where(down, high, x)
        side = np.where(down, -1.0, 1.0)
        if (np.minimum(np.abs(h), high - low) < 1e-16).all():
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

    return _valleys(way, slope, np.linspace(0.0, 1.0, _ARC) * angle[:, None])


def _meetings(hull: Hull, solid: Solid) -> Array:
    """Return the directions normal to an edge and to a solid of revolution's side.

    There f' jumps. m = p e + q a +- w (e x a) with m.e = 0 and m.a given.
    """
    bottom, top, half = _revolved(solid)
    along = (top - bottom) / math.hypot(bottom - top, 2.0 * half)
    a = solid.axes[:, 2]
    e = np.cross(hull.beside[:, 0], hull.beside[:, 1])
    e /= np.linalg.norm(e, axis=1)[:, None]
    both = e @ a
    square = 1.0 - both * both
    good = (square > 1e-12) & (along * along < square)
    e, both, square = e[good], both[good], square[good]
    base = (along / square)[:, None] * (a - both[:, None] * e)
    w = np.sqrt((1.0 - along * along / square) / square)
    across = w[:, None] * np.cross(e, a)
    return np.vstack([base + across, base - across])


def _at_side(hull: Hull, solid: Solid) -> Array:
    """Return the directions of least overlap on the circle of the side's normals."""
    bottom, top, half = _revolved(solid)
    slant = math.hypot(bottom - top, 2.0 * half)
    along, across = (bottom - top) / slant, 2.0 * half / slant
    u, v, a = solid.axes.T

    def way(_: Any, x: Array) -> Array:
        return np.asarray(-along * a - across * (np.outer(np.cos(x), u) + np.outer(np.sin(x), v)))

    def slope(_: Any, x: Array) -> Array:
        turn = across * (np.outer(np.sin(x), u) - np.outer(np.cos(x), v))
        top_most = hull.vertices[np.argmax(way(_, x) @ hull.vertices.T, axis=1)]
        return np.asarray((turn * (top_most - solid.centre)).sum(axis=1))

    return _valleys(way, slope, np.linspace(0.0, 2.0 * np.pi, _CIRCLE)[None, :])


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
        more += [_meetings(hull, solid), _at_side(hull, solid)]
    n = np.vstack(more)
    f = _overlaps(hull, solid, n)
    k = int(np.argmin(f))
    return float(f[k]), n[k]


def _mean(points: Array, weights: Array) -> Array:
    return np.asarray(weights @ points / weights.sum())


def _crossing(edge: Array, solid: Solid, n: Array) -> Array | None:
    """Return where the solid's side line that is down along n crosses an edge (2, 3), seen along n.

    None where an end is down, or the two are parallel.
    """
    if solid.shape == "ELLIPSOID":
        return None
    a = solid.axes[:, 2]
    bottom, top, half = _revolved(solid)
    w = -n - ((-n) @ a) * a
    length = float(np.linalg.norm(w))
    if length < 0.1:
        return None
    w /= length
    low = solid.centre - half * a + bottom * w
    way = 2.0 * half * a + (top - bottom) * w
    across = np.cross(edge[1] - edge[0], n)
    rise = float(way @ across)
    if abs(rise) < 1e-6 * float(np.linalg.norm(way) * np.linalg.norm(across)):
        return None
    return np.asarray(low + min(1.0, max(0.0, float((edge[0] - low) @ across) / rise)) * way)


def touching_point(hull: Hull, solid: Solid, f: float, n: Array) -> Array:
    """Return the middle of the points that meet along n.

    One of both shapes touches with a point there, but for lines and flat sides on each other: then
    the middle of what they have in common, by how deep it is.
    """
    low = support(solid.shape, solid.size, solid.centre, solid.axes, -n)
    t = np.array([1.0, 0.0, 0.0]) if abs(n[0]) < 0.7 else np.array([0.0, 1.0, 0.0])
    t -= (t @ n) * n
    t /= np.linalg.norm(t)
    s = np.cross(n, t)
    angles = np.arange(8) * 0.25 * np.pi
    around = n + _TILT * (np.outer(np.cos(angles), t) + np.outer(np.sin(angles), s))
    lows = _lowest(solid, around / np.linalg.norm(around, axis=1)[:, None])
    wide = np.linalg.norm(lows - low, axis=1).max() / solid.size.max()
    # 1 where the solid has one lowest point, 0 where a line or a disc is down
    pointed = 1.0 - min(1.0, max(0.0, (wide - _WIDE / 3.0) / (_WIDE - _WIDE / 3.0)))
    if pointed == 1.0:
        return np.asarray(low + 0.5 * f * n)
    along = hull.vertices @ n
    ties = hull.vertices[along >= along.max() - _TIE * solid.size.max()]
    crossing = _crossing(ties, solid, n) if len(ties) == 2 else None
    if crossing is not None:
        return np.asarray(crossing + 0.5 * f * n)
    weight = np.maximum(0.0, along - along.max() + 0.5 * f)
    high = hull.vertices[weight > 0.0]
    weight = weight[weight > 0.0]
    if len(high) == 1:
        common = high[0]
    else:
        # of the lowest points those that lie over the mesh's side, and of its corners those under
        # the solid: a coarse middle of both
        heights = lows @ n
        lows = lows[heights <= heights.min() + 0.5 * f]
        axes = np.column_stack([t, s])
        a, b = high @ axes, lows @ axes
        first = np.maximum(a.min(axis=0), b.min(axis=0))
        last = np.minimum(a.max(axis=0), b.max(axis=0))
        common = axes @ (0.5 * (first + last)) + n * float(_mean(high, weight) @ n)
    level = float(low @ n) + 0.5 * f
    both = pointed * low + (1.0 - pointed) * common
    return np.asarray(both + n * (level - float(both @ n)))
