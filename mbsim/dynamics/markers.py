"""Where markers are and how they move, in the global frame; `place_bodies` has been called.

Row 0 of the markers is the global frame itself, which belongs to ground.
"""

from __future__ import annotations

from mbsim.core.jitable import jitable
from mbsim.core.rotation import add, cross, rotate, vector
from mbsim.dynamics.kinematics import position


@jitable
def marker_arm(scene, m):
    """Return the vector from the cg of its body to the origin of marker m [L]."""
    return rotate(scene.work.R[scene.markers.body[m]], vector(scene.markers.p[m]))


@jitable
def marker_point(scene, y, m):
    """Return the origin of marker m [L]."""
    return add(position(scene, y, scene.markers.body[m]), marker_arm(scene, m))


@jitable
def marker_axis(scene, m, k):
    """Return the unit vector of axis k (0, 1, 2 for x, y, z) of marker m."""
    R = scene.markers.R[m]
    return rotate(scene.work.R[scene.markers.body[m]], (R[0, k], R[1, k], R[2, k]))


@jitable
def marker_velocity(scene, m):
    """Return the velocity of the origin of marker m, v + w x arm [L/T]."""
    b = scene.markers.body[m]
    w = vector(scene.work.w[b])
    return add(vector(scene.work.v[b]), cross(w, marker_arm(scene, m)))
