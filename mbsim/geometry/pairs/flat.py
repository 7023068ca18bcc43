"""A box on a plane."""

from __future__ import annotations

from mbsim.core.arrays import F1, F2, V3
from mbsim.core.jitable import jitable
from mbsim.core.rotation import add, dot, scale, sub, vector
from mbsim.geometry.catalog import axis, pair, put_point, region
from mbsim.geometry.region import box_cut

BOX_SLOTS = 8


@jitable
def box_on_plane(frame_i: F1, size_i: F1, origin: V3, n: V3, points: F2) -> int:
    """Every corner below the plane is a point: up to 4 for a box that stands, row = corner."""
    centre = vector(frame_i)
    ex = scale(size_i[0], axis(frame_i, 0))
    ey = scale(size_i[1], axis(frame_i, 1))
    ez = scale(size_i[2], axis(frame_i, 2))
    for corner in range(8):
        sx = 1.0 if corner & 1 else -1.0
        sy = 1.0 if corner & 2 else -1.0
        sz = 1.0 if corner & 4 else -1.0
        p = add(centre, add(scale(sx, ex), add(scale(sy, ey), scale(sz, ez))))
        depth = -dot(sub(p, origin), n)
        put_point(points[corner], depth, add(p, scale(0.5 * depth, n)), n)
    return 8


@pair("BOX", "PLANE", slots=BOX_SLOTS)
def box_plane(frame_i: F1, size_i: F1, frame_j: F1, size_j: F1, points: F2) -> int:
    """The corners of the box against the plane."""
    return box_on_plane(frame_i, size_i, vector(frame_j), axis(frame_j, 2), points)


@region("BOX", "PLANE", whole=4.0)
def box_plane_region(
    frame_i: F1, size_i: F1, frame_j: F1, size_j: F1, points: F2
) -> tuple[int, float]:
    """The corners, and the cut of the box with the plane."""
    n, origin = axis(frame_j, 2), vector(frame_j)
    count = box_on_plane(frame_i, size_i, origin, n, points)
    return count, box_cut(frame_i, size_i, origin, n)
