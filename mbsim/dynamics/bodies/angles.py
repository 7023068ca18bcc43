"""Angles of one marker about the z-axis of another, whole turns counted."""

from __future__ import annotations

import math

from mbsim.arrays.scene import Scene
from mbsim.core.jitable import jitable
from mbsim.core.rotation import dot, norm, sub, vector
from mbsim.dynamics.bodies.markers import marker_axis

#: Most that an angle may change in a step, with room to pi for what speeds up in it.
MOST_TURN = 2.0


@jitable
def nearest_turn(angle: float, near: float) -> float:
    """Return the angle plus the whole turns that bring it nearest to another."""
    turns = math.floor((near - angle) / (2.0 * math.pi) + 0.5)
    return angle + 2.0 * math.pi * turns


@jitable
def followed_angle(scene: Scene, row: int) -> float:
    """Return angle `row` [rad], the one nearest to that of the committed state."""
    i, j = scene.angles.i[row], scene.angles.j[row]
    x = marker_axis(scene, i, 0)
    s, c = dot(x, marker_axis(scene, j, 1)), dot(x, marker_axis(scene, j, 0))
    return nearest_turn(math.atan2(s, c), scene.state.angle[row])


@jitable
def commit_angles(scene: Scene) -> int:
    """Take the angles of the point evaluated last as those of the committed state; return 0."""
    for row in range(len(scene.angles.i)):
        scene.state.angle[row] = followed_angle(scene, row)
    return 0


@jitable
def longest_turn(scene: Scene, step: float) -> float:
    """Return how much of a step may be tried so that no followed angle loses count of its turns."""
    for row in range(len(scene.angles.i)):
        i, j = scene.markers.body[scene.angles.i[row]], scene.markers.body[scene.angles.j[row]]
        rate = norm(sub(vector(scene.work.w[i]), vector(scene.work.w[j])))
        if rate * step > MOST_TURN:
            step = MOST_TURN / rate
    return step
