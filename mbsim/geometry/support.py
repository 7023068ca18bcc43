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
CONVEX = {"SPHERE", "ELLIPSOID", "BOX", "CYLINDER"}


def support(shape: str, size: Array, p: Array, R: Array, d: Array) -> Array:
    """Return the farthest point of a shape in direction d.

    Parameters
    ----------
    shape : {"SPHERE", "ELLIPSOID", "BOX", "CYLINDER"}
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
    rim = size[0] / radial if radial > 0.0 else 0.0
    return p + R @ np.array([rim * local[0], rim * local[1], np.sign(local[2]) * size[1]])
