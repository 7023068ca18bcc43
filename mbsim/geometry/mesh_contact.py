"""How deep a mesh overlaps another shape, from the triangles that FCL finds in contact.

FCL says reliably which triangles touch a shape, but what it says of them cannot be used as it is
(measured with python-fcl 0.7.0.11): with a mesh as the second object the normal is turned round;
against a sphere the depth is negative; at the rim of a face, and between two meshes, a
triangle's way out is sideways and may be 1e4 times the depth. So depth and normal are measured
here:

* on a plane, by the lowest vertex;
* under a sphere, by the distance of its centre to the nearest triangle;
* else by patches: triangles in contact that form a convex piece of surface, whose overlap with
  the other shape along n is max n.v over the patch minus the other's lowest n.x, least over the
  normals that the mesh allows there. The deepest patch counts.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from mbsim.core.golden import minimum
from mbsim.geometry.mesh_surface import SLOPE, Array, Indices, Surface

#: A direction that is no face's normal must overlap less than one by this part.
FACES_FIRST = 1e-6
#: Directions from FCL that are looked at, those that differ by more than `_SAME`.
MOST_DIRECTIONS = 48
_SAME = 2e-3
#: Pairs of triangles whose edges are crossed with each other.
_CROSSED = 24
#: Eight tilts by twice the slope.
_AROUND = 2.0 * SLOPE * np.array([[math.cos(a), math.sin(a)] for a in np.arange(8) * math.pi / 4])


def under_plane(surface: Surface, n: Array, height: float) -> tuple[float, Array]:
    """Return (depth, lowest vertex) of a mesh on the half-space n.x <= height, in its axes."""
    along = surface.vertices @ n
    lowest = int(np.argmin(along))
    return height - float(along[lowest]), surface.vertices[lowest]


def nearest_on_triangles(c: Array, corners: Array) -> Array:
    """Return the point of each triangle (k, 3, 3) that is nearest to c, shape (k, 3)."""
    best = np.empty((len(corners), 3))
    least = np.full(len(corners), np.inf)
    for k in range(3):
        p, e = corners[:, k], corners[:, (k + 1) % 3] - corners[:, k]
        part = ((c - p) * e).sum(axis=1) / np.maximum((e * e).sum(axis=1), 1e-300)
        q = p + np.clip(part, 0.0, 1.0)[:, None] * e
        away = ((c - q) ** 2).sum(axis=1)
        closer = away < least
        best[closer], least[closer] = q[closer], away[closer]
    a, b, d = (corners[:, k] for k in range(3))
    m = np.cross(b - a, d - a)
    square = np.maximum((m * m).sum(axis=1), 1e-300)
    foot = c - (((c - a) * m).sum(axis=1) / square)[:, None] * m
    over = np.ones(len(corners), dtype=bool)
    for p, q in ((a, b), (b, d), (d, a)):
        over &= (np.cross(q - p, foot - p) * m).sum(axis=1) >= 0.0
    best[over] = foot[over]
    return best


def under_sphere(
    surface: Surface, touched: Indices, c: Array, radius: float
) -> tuple[float, Array, Array]:
    """Return (depth, point, normal out of the mesh) of a sphere, all in the mesh's axes.

    Parameters
    ----------
    surface : Surface
    touched : ndarray of int
        Faces that the sphere touches: the nearest one is among them.
    c : ndarray, shape (3,)
        Centre.
    radius : float
        Radius [L].
    """
    corners = surface.vertices[surface.faces[touched]]
    near = nearest_on_triangles(c, corners)
    away = np.linalg.norm(c - near, axis=1)
    k = int(np.argmin(away))
    q, distance = near[k], float(away[k])
    # an edge or a vertex belongs to several faces: that which c is most above or below tells
    same = np.linalg.norm(near - q, axis=1) <= 1e-9 * surface.size
    m = surface.normals[touched[same]]
    heights = m @ (c - q)
    most = int(np.argmax(np.abs(heights)))
    side = 1.0 if heights[most] >= 0.0 else -1.0
    n = side * (c - q) / distance if distance > 1e-9 * surface.size else m[most]
    depth = radius - side * distance
    return depth, q - 0.5 * depth * n, n


def distinct(directions: Array) -> Array:
    """Return the unit directions that differ by more than some 1e-3, the first of each."""
    directions = directions[(directions**2).sum(axis=1) > 0.5]
    _, first = np.unique(np.round(directions / _SAME), axis=0, return_index=True)
    return directions[np.sort(first)]


def _lowest(shape: Any, n: Array) -> float:
    return float(n @ shape(-n))


def against_convex(
    surface: Surface, touched: Indices, normals: Array, shape: Any, own: Array
) -> tuple[float, Array, Array]:
    """Return (depth, point, normal out of the mesh) against a convex shape.

    Everything is in the mesh's axes.

    Parameters
    ----------
    surface : Surface
    touched : ndarray of int, shape (k,)
        Faces in contact, FCL's normals with them.
    normals : ndarray, shape (k, 3)
        FCL's normals, of either sign.
    shape : callable
        ``shape(d)`` is the shape's farthest point in direction d.
    own : ndarray, shape (l, 3)
        Directions of the shape's flat sides.
    """
    best = (-np.inf, np.zeros(3), touched)
    for group, pieces in surface.groups(np.unique(touched)):
        whole, *parts = (
            (*_patch_under(surface, patch, touched, normals, shape, own), patch)
            for patch in [group, *pieces]
        )
        # to clear the hull of all is enough to clear each: what a piece cannot know of its
        # neighbours does not make it deeper
        deepest = max(parts, key=_first) if parts else whole
        best = max(best, min(whole, deepest, key=_first), key=_first)
    depth, n, patch = best
    corners = surface.vertices[np.unique(surface.faces[patch])]
    along = corners @ n
    # what FCL saw touching may be apart when measured: then the support points alone count
    highest = corners[along >= along.max() - 0.5 * max(depth, 0.0)]
    return depth, place(highest, lowest_side(shape, n, depth), n), n


def _first(found: tuple[float, Any, Any]) -> float:
    return found[0]


def _patch_under(
    surface: Surface, patch: Indices, touched: Indices, normals: Array, shape: Any, own: Array
) -> tuple[float, Array]:
    """Return (depth, normal out of the mesh) of the hull of some faces; see `against_convex`."""
    here = np.isin(touched, patch)
    corners = np.unique(surface.faces[patch])
    points = surface.vertices[corners]
    m = distinct(surface.normals[patch])
    turned = normals[here]
    along = (turned * surface.normals[touched[here]]).sum(axis=1)
    others = distinct(np.where(along < 0.0, -1.0, 1.0)[:, None] * turned)[:MOST_DIRECTIONS]
    least, normal, vertex = np.inf, m[0], -1
    for rank, n in [*((0, n) for n in m), *((1, n) for n in own), *((2, n) for n in others)]:
        along = points @ n
        top = int(np.argmax(along))
        depth = float(along[top]) - _lowest(shape, n)
        if rank > 0 and (
            depth >= (1.0 - FACES_FIRST) * least or not surface.allows(int(corners[top]), n)
        ):
            continue
        if depth < least:
            least, normal, vertex = depth, n, int(corners[top]) if rank == 2 else -1
    if vertex >= 0:
        least, normal = _settled(surface, vertex, points, shape, normal)
    return least, normal


def _settled(
    surface: Surface, vertex: int, points: Array, shape: Any, n: Array
) -> tuple[float, Array]:
    """Return (depth, n) of least overlap near n, which FCL knows to some 1e-3 only.

    On an edge n turns about it, on a vertex any way.
    """
    ways = surface.vertices[surface.faces[surface.faces_at(vertex)].ravel()]
    ways = ways - surface.vertices[vertex]
    length = np.linalg.norm(ways, axis=1)
    ways = ways[length > 0.0] / length[length > 0.0, None]
    e = ways[int(np.argmin(np.abs(ways @ n)))]
    best = (float((points @ n).max()) - _lowest(shape, n), n)
    for on_edge in (True, False):
        if not on_edge or abs(float(e @ n)) < 4.0 * SLOPE:
            found = _turned(points, shape, n, e, on_edge)
            best = found if found[0] < best[0] else best
    return best


def _turned(points: Array, shape: Any, n: Array, e: Array, on_edge: bool) -> tuple[float, Array]:
    """Return (depth, n) of least overlap among turns about e, or about e and across it."""
    depth = np.inf
    if on_edge:
        n = n - (n @ e) * e
        n = n / np.linalg.norm(n)
    else:
        e = e - (e @ n) * n
        e = e / np.linalg.norm(e)
    for _ in range(1 if on_edge else 3):
        for t in (np.cross(e, n), e)[: 1 if on_edge else 2]:

            def turned(angle: float, n: Array = n, t: Array = t) -> Array:
                return np.asarray(np.cos(angle) * n + np.sin(angle) * t)

            def overlap(angle: float, turned: Any = turned) -> float:
                d = turned(angle)
                return float((points @ d).max()) - _lowest(shape, d)

            depth, angle = minimum(overlap, -5.0 * SLOPE, 5.0 * SLOPE, absolute=1e-9)
            n = turned(angle)
            n, e = n / np.linalg.norm(n), e if on_edge else e - (e @ n) * n
    return depth, n


def _inner_faces(
    surface: Surface, other: Surface, to_other: tuple[Array, Array], touched: Indices
) -> Indices:
    """Return the touched faces and those with a vertex inside the other mesh."""
    p, R = to_other
    inside = other.contains(surface.vertices @ R.T + p)
    return np.union1d(touched, np.flatnonzero(inside[surface.faces].any(axis=1)))


def _crossings(i: Array, j: Array) -> Array:
    """Return the unit cross products of the edges of triangle pairs (k, 3, 3)."""
    e, g = np.roll(i, -1, axis=1) - i, np.roll(j, -1, axis=1) - j
    cross = np.cross(e[:, :, None, :], g[:, None, :, :]).reshape(-1, 3)
    limit = 1e-6 * np.linalg.norm(e, axis=2).max() * np.linalg.norm(g, axis=2).max()
    length = np.linalg.norm(cross, axis=1)
    good = length > limit
    return cross[good] / length[good, None]


def of_meshes(
    surface_i: Surface,
    surface_j: Surface,
    frame: tuple[Array, Array],
    pairs: Indices,
) -> tuple[float, Array, Array]:
    """Return (depth, point, normal from J into I) of two meshes, in J's axes.

    Parameters
    ----------
    surface_i, surface_j : Surface
    frame : (ndarray (3,), ndarray (3, 3))
        Origin and axes of I in J's axes.
    pairs : ndarray of int, shape (k, 2)
        Faces of I and of J that touch.
    """
    p, R = frame
    faces_i = _inner_faces(surface_i, surface_j, (p, R), np.unique(pairs[:, 0]))
    faces_j = _inner_faces(surface_j, surface_i, (-R.T @ p, R.T), np.unique(pairs[:, 1]))
    moved = surface_i.vertices @ R.T + p
    best = (-np.inf, np.zeros(3), np.zeros(3))
    groups_j = surface_j.groups(faces_j)

    def of(patch_i: Indices, patch_j: Indices) -> tuple[float, Array, Array] | None:
        here = np.isin(pairs[:, 0], patch_i) & np.isin(pairs[:, 1], patch_j)
        if not here.any():
            return None
        few = pairs[here][:_CROSSED]
        return _of_patches(surface_i, surface_j, moved, R, (patch_i, patch_j), few)

    for group_i, pieces_i in surface_i.groups(faces_i):
        for group_j, pieces_j in groups_j:
            found = [of(group_i, group_j)]
            if pieces_i or pieces_j:
                tries = (of(i, j) for i in pieces_i or [group_i] for j in pieces_j or [group_j])
                found.append(max((t for t in tries if t is not None), key=_first, default=None))
            known = [one for one in found if one is not None]
            if known:
                best = max(best, min(known, key=_first), key=_first)
    return best


def _of_patches(
    surface_i: Surface,
    surface_j: Surface,
    moved: Array,
    R: Array,
    patches: tuple[Indices, Indices],
    pairs: Indices,
) -> tuple[float, Array, Array] | None:
    """Return (depth, point, normal) of two convex patches; None where no direction is allowed."""
    corners_i = np.unique(surface_i.faces[patches[0]])
    corners_j = np.unique(surface_j.faces[patches[1]])
    points_i, points_j = moved[corners_i], surface_j.vertices[corners_j]
    of_j = distinct(surface_j.normals[patches[1]])
    of_i = distinct(-surface_i.normals[patches[0]] @ R.T)
    edges = _crossings(
        moved[surface_i.faces[pairs[:, 0]]], surface_j.vertices[surface_j.faces[pairs[:, 1]]]
    )
    edges = distinct(np.vstack([edges, -edges]))
    directions = np.vstack([of_j, of_i, edges])
    high, low = points_j @ directions.T, points_i @ directions.T
    depths = high.max(axis=0) - low.min(axis=0)
    depths[len(of_j) + len(of_i) :] *= 1.0 + FACES_FIRST
    faces = len(of_j)
    for k in np.argsort(depths, kind="stable").tolist():
        n = directions[k]
        top, bottom = int(np.argmax(high[:, k])), int(np.argmin(low[:, k]))
        from_i = faces <= k < faces + len(of_i)
        if (k < faces or surface_j.allows(int(corners_j[top]), n)) and (
            from_i or surface_i.allows(int(corners_i[bottom]), -R.T @ n)
        ):
            depth = float(points_j[top] @ n - points_i[bottom] @ n)
            near = 0.5 * max(depth, 0.0)
            highest = points_j[high[:, k] >= high[top, k] - near]
            lowest = points_i[low[:, k] <= low[bottom, k] + near]
            return depth, place(highest, lowest, n), n
    return None


def _across(n: Array) -> tuple[Array, Array]:
    """Return two unit vectors across n and each other."""
    x, y, z = n.tolist()
    if abs(z) < 0.7:
        length = (x * x + y * y) ** 0.5
        t = (-y / length, x / length, 0.0)
    else:
        length = (y * y + z * z) ** 0.5
        t = (0.0, -z / length, y / length)
    s = (y * t[2] - z * t[1], z * t[0] - x * t[2], x * t[1] - y * t[0])
    return np.array(t), np.array(s)


def place(high: Array, low: Array, n: Array) -> Array:
    """Return the middle of what two touching sides have in common, seen along n.

    Parameters
    ----------
    high, low : ndarray, shapes (k, 3), (l, 3)
        The points of J that are highest along n, and of I that are lowest.
    n : ndarray, shape (3,)
        Unit normal from J into I.
    """
    axes = np.column_stack(_across(n))
    a, b = high @ axes, low @ axes
    first = np.maximum(a.min(axis=0), b.min(axis=0))
    last = np.minimum(a.max(axis=0), b.max(axis=0))
    level = 0.5 * (float((high @ n).max()) + float((low @ n).min()))
    return np.asarray(axes @ (0.5 * (first + last)) + level * n)


def lowest_side(shape: Any, n: Array, depth: float) -> Array:
    """Return points of a convex shape that are lowest along n, to half the depth, shape (k, 3).

    Apart (depth < 0) it is the support point alone.
    """
    ways = -(n + _AROUND @ np.array(_across(n))) / np.sqrt(1.0 + 4.0 * SLOPE**2)
    points = np.array([shape(-n), *(shape(d) for d in ways)])
    heights = points @ n
    return points[heights <= heights.min() + 0.5 * max(depth, 0.0)]
