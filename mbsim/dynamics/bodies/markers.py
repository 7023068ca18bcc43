"""Where markers are and how they move, in the global frame; `place_bodies` has been called.

Row 0 of the markers is the global frame itself, which belongs to ground.
"""

from __future__ import annotations

import math

from mbsim.arrays.scene import Scene
from mbsim.core.arrays import F1, V3, V4
from mbsim.core.jitable import jitable
from mbsim.core.layout import BODY_SIZE
from mbsim.core.rotation import add, cross, rotate, vector
from mbsim.dynamics.bodies.kinematics import position


@jitable
def marker_arm(scene: Scene, m: int) -> V3:
    """Return the vector from the cg of its body to the origin of marker m [L]."""
    return rotate(scene.work.R[scene.markers.body[m]], vector(scene.markers.p[m]))


@jitable
def marker_point(scene: Scene, y: F1, m: int) -> V3:
    """Return the origin of marker m [L]."""
    return add(position(scene, y, scene.markers.body[m]), marker_arm(scene, m))


@jitable
def marker_axis(scene: Scene, m: int, k: int) -> V3:
    """Return the unit vector of axis k (0, 1, 2 for x, y, z) of marker m."""
    R = scene.markers.R[m]
    return rotate(scene.work.R[scene.markers.body[m]], (R[0, k], R[1, k], R[2, k]))


@jitable
def marker_velocity(scene: Scene, m: int) -> V3:
    """Return the velocity of the origin of marker m, v + w x arm [L/T]."""
    b = scene.markers.body[m]
    w = vector(scene.work.w[b])
    return add(vector(scene.work.v[b]), cross(w, marker_arm(scene, m)))


@jitable
def marker_quaternion(scene: Scene, y: F1, m: int) -> V4:
    """Return the unit quaternion of marker m, global, which moves on as its body's in y does.

    Of the products of a quaternion's components, which the rotation matrix has, the row with the
    largest square on the diagonal is the quaternion itself, but for its length.
    """
    R, b = scene.markers.R[m], scene.markers.body[m]
    ww, xx = 1.0 + R[0, 0] + R[1, 1] + R[2, 2], 1.0 + R[0, 0] - R[1, 1] - R[2, 2]
    yy, zz = 1.0 - R[0, 0] + R[1, 1] - R[2, 2], 1.0 - R[0, 0] - R[1, 1] + R[2, 2]
    wx, wy, wz = R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]
    xy, xz, yz = R[1, 0] + R[0, 1], R[0, 2] + R[2, 0], R[2, 1] + R[1, 2]
    most = max(max(ww, xx), max(yy, zz))
    if ww == most:
        q = (ww, wx, wy, wz)
    elif xx == most:
        q = (wx, xx, xy, xz)
    elif yy == most:
        q = (wy, xy, yy, yz)
    else:
        q = (wz, xz, yz, zz)
    p = (1.0, 0.0, 0.0, 0.0)
    if b < len(scene.bodies.mass):
        at = BODY_SIZE * b + 3
        p = (y[at], y[at + 1], y[at + 2], y[at + 3])
    # stages have quaternions that are not quite unit
    s = p[0] * p[0] + p[1] * p[1] + p[2] * p[2] + p[3] * p[3]
    s = 1.0 / math.sqrt(s * (q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]))
    return (
        s * (p[0] * q[0] - p[1] * q[1] - p[2] * q[2] - p[3] * q[3]),
        s * (p[0] * q[1] + p[1] * q[0] + p[2] * q[3] - p[3] * q[2]),
        s * (p[0] * q[2] - p[1] * q[3] + p[2] * q[0] + p[3] * q[1]),
        s * (p[0] * q[3] + p[1] * q[2] - p[2] * q[1] + p[3] * q[0]),
    )
