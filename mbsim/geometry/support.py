"""Support points of convex shapes: the farthest point of a shape in a direction, global frame.

With them a contact found by an iterative detector is made exact along its normal: for a given
unit normal n from J into I the depth is max over J of n.x minus min over I of n.x, and an error
of n enters it only in second order.
"""

from __future__ import annotations

from typing import Any

import numpy as np

Array = np.ndarray[Any, np.dtype[np.float64]]

#: Shapes whose support point is unique in every direction.
ROUND = {"SPHERE", "ELLIPSOID"}
CONVEX = {"SPHERE", "ELLIPSOID", "BOX", "CYLINDER", "FRUSTUM"}


def support(shape: str, size: Array, p: Array, R: Array, d: Array) -> Array:
    """Return the farthest point of a shape in direction d.

    Parameters
    ----------
    shape : {"SPHERE", "ELLIPSOID", "BOX", "CYLINDER", "FRUSTUM"}
    size : ndarray, shape (3,)
        As in `geometry.catalog` [L].
    p, R : ndarray, shapes (3,), (3, 3)
        Centre and axes of the shape, global frame.
    d : ndarray, shape (3,)
        Unit direction, global frame.
    """
    if shape == "SPHERE":
        return p + size[0] * d
    local = R.T @ d
    if shape == "ELLIPSOID":
        scaled = size * local
        return p + R @ (size * scaled / np.linalg.norm(scaled))
    if shape == "BOX":
        return p + R @ (np.sign(local) * size)
    radial = np.hypot(local[0], local[1])
    bottom, top, half = size if shape == "FRUSTUM" else (size[0], size[0], size[1])
    upper = top * radial + half * local[2] >= bottom * radial - half * local[2]
    rim = (top if upper else bottom) / radial if radial > 0.0 else 0.0
    return p + R @ np.array([rim * local[0], rim * local[1], half if upper else -half])


def _spread(shape: str, size: Array, R: Array, d: Array) -> Array:
    """Return how the support point of a round shape moves with the direction d, shape (3, 3).

    Sphere: r I. Ellipsoid with A = R diag(size) R': s = A^2 d / |A d|, so
    ds/dd = A^2 / |A d| - A^2 d (A^2 d)' / |A d|^3.
    """
    if shape == "SPHERE":
        return size[0] * np.eye(3)
    squared = (R * size**2) @ R.T
    moved = squared @ d
    length = np.sqrt(d @ moved)
    spread: Array = squared / length - np.outer(moved, moved) / length**3
    return spread


def round_normal(
    shape_i: str,
    size_i: Array,
    frame_i: tuple[Array, Array],
    shape_j: str,
    size_j: Array,
    frame_j: tuple[Array, Array],
    n: Array,
) -> Array:
    """Return the direction of least depth of two round shapes, starting from a near one.

    The depth f(n) = n . (s_J(n) - s_I(-n)) has the tangential gradient of d = s_J - s_I and
    the curvature W_I + W_J - f on the unit sphere; where d is along n, f is least. An
    iterative detector stops short of that, and a force along another direction makes energy.
    """
    for _ in range(20):
        d = support(shape_j, size_j, *frame_j, n) - support(shape_i, size_i, *frame_i, -n)
        depth = n @ d
        across = d - depth * n
        if across @ across <= (1e-14 * max(size_i.max(), size_j.max())) ** 2:
            break
        curvature = _spread(shape_i, size_i, frame_i[1], n) + _spread(
            shape_j, size_j, frame_j[1], n
        )
        # along n itself nothing is solved for: n n' fills that direction
        matrix = curvature - depth * np.eye(3) + (depth + size_i.max()) * np.outer(n, n)
        step = -np.linalg.solve(matrix, across)
        step -= (step @ n) * n
        length = np.linalg.norm(step)
        # half a radian at most keeps a first step from the far side
        n = n + step * min(1.0, 0.5 / length if length > 0.0 else 1.0)
        n = n / np.linalg.norm(n)
    return n


def face_normal(size_j: Array, frame_j: tuple[Array, Array], low: Any, n: Array) -> Array | None:
    """Return the outward normal of the face of box J that the other shape lies on, else None.

    `low(d)` gives the other shape's lowest point against d. The face is that nearest to the
    detector's normal n; it holds if the lowest point projects into it.
    """
    p, R = frame_j
    local = R.T @ n
    k = int(np.argmax(np.abs(local)))
    if abs(local[k]) < 0.9:
        return None
    face: Array = R[:, k] * np.sign(local[k])
    lateral = np.abs(R.T @ (low(face) - p))
    lateral[k] = 0.0
    return face if (lateral <= size_j).all() else None
