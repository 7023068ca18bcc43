"""A box on a plane, and on the face of a box far from that face's edges."""

from __future__ import annotations

import math

from mbsim.core.jitable import jitable
from mbsim.core.rotation import add, dot, scale, sub, vector
from mbsim.geometry.catalog import NOT_MINE, axis, pair, put_point

BOX_SLOTS = 8


@jitable
def box_on_plane(frame_i, size_i, origin, n, points):
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
def box_plane(frame_i, size_i, frame_j, size_j, points):
    """The corners of the box against the plane."""
    return box_on_plane(frame_i, size_i, vector(frame_j), axis(frame_j, 2), points)


@jitable
def face_below(frame_j, size_j, centre, radius):
    """Return (code, sign) of the face of box J on which a ball around `centre` stands alone.

    `code` is the face's axis, or NOT_MINE where the ball's shadow reaches an edge of the
    face or its centre is not outside of it: there the face is no plane.
    """
    apart = sub(centre, vector(frame_j))
    for k in range(3):
        height = dot(apart, axis(frame_j, k))
        m, o = (k + 1) % 3, (k + 2) % 3
        inside = (
            abs(dot(apart, axis(frame_j, m))) + radius < size_j[m]
            and abs(dot(apart, axis(frame_j, o))) + radius < size_j[o]
        )
        if inside and abs(height) > size_j[k]:
            return k, 1.0 if height > 0.0 else -1.0
    return NOT_MINE, 0.0


@pair("BOX", "BOX", slots=BOX_SLOTS)
def box_box(frame_i, size_i, frame_j, size_j, points):
    """A box over a face of the other, far from its edges; the normal points from J into I."""
    radius_i = math.sqrt(size_i[0] ** 2 + size_i[1] ** 2 + size_i[2] ** 2)
    k, sign = face_below(frame_j, size_j, vector(frame_i), radius_i)
    if k >= 0:
        n = scale(sign, axis(frame_j, k))
        origin = add(vector(frame_j), scale(size_j[k], n))
        return box_on_plane(frame_i, size_i, origin, n, points)
    radius_j = math.sqrt(size_j[0] ** 2 + size_j[1] ** 2 + size_j[2] ** 2)
    k, sign = face_below(frame_i, size_i, vector(frame_j), radius_j)
    if k < 0:
        return NOT_MINE
    n = scale(sign, axis(frame_i, k))
    origin = add(vector(frame_i), scale(size_i[k], n))
    count = box_on_plane(frame_j, size_j, origin, n, points)
    for row in range(count):
        for column in range(4, 7):
            points[row, column] = -points[row, column]
    return count
