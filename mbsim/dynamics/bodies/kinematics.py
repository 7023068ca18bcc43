"""Where bodies and shapes are, and how they move."""

from __future__ import annotations

import math

from mbsim.arrays.scene import Scene
from mbsim.core.arrays import F1, V3
from mbsim.core.jitable import jitable
from mbsim.core.layout import AT_Q, AT_V, AT_W, BODY_SIZE
from mbsim.core.rotation import (
    dot,
    matrix_from_quaternion,
    norm,
    rotate,
    sub,
    vector,
    vector_of_turn,
)
from mbsim.dynamics.bodies.awake import bodies_awake, body_awake, graphic_awake, graphics_awake


@jitable
def place_body(scene: Scene, y: F1, b: int) -> None:
    """Fill R, v and w (global) of moving body b from y."""
    work, at = scene.work, BODY_SIZE * b
    matrix_from_quaternion(y[at + AT_Q : at + AT_V], work.R[b])
    w = rotate(work.R[b], (y[at + AT_W], y[at + AT_W + 1], y[at + AT_W + 2]))
    for k in range(3):
        work.v[b, k] = y[at + AT_V + k]
        work.w[b, k] = w[k]


@jitable
def place_bodies(scene: Scene, y: F1) -> None:
    """Fill R, v and w (global) of moving bodies from y; what sleeps stays, ground as made."""
    for k in range(bodies_awake(scene)):
        place_body(scene, y, body_awake(scene, k))


@jitable
def position(scene: Scene, y: F1, b: int) -> V3:
    """Return the cg position of body b; ground's is the global origin."""
    if b == len(scene.bodies.mass):
        return (0.0, 0.0, 0.0)
    at = BODY_SIZE * b
    return (y[at], y[at + 1], y[at + 2])


@jitable
def place_graphic(scene: Scene, y: F1, g: int) -> None:
    """Fill the frame (centre, rotation by rows) of graphic g."""
    graphics, frame = scene.graphics, scene.work.frames[g]
    b = graphics.body[g]
    R, S = scene.work.R[b], graphics.R[g]
    x = position(scene, y, b)
    c = rotate(R, (graphics.p[g, 0], graphics.p[g, 1], graphics.p[g, 2]))
    for r in range(3):
        frame[r] = x[r] + c[r]
    if graphics.turns[g] == 0:
        # nobody asks for the axes of a sphere
        return
    for r in range(3):
        for k in range(3):
            frame[3 + 3 * r + k] = R[r, 0] * S[0, k] + R[r, 1] * S[1, k] + R[r, 2] * S[2, k]


@jitable
def half_skin(scene: Scene, g: int, skin: float) -> float:
    """Return how far graphic g may go by itself: half of the skin, farther where it is fast."""
    return max(0.5 * skin, scene.broadphase.own[g])


@jitable
def plane_travel(scene: Scene, g: int) -> float:
    """Return how far plane g has come towards a point since near pairs were listed.

    h = n.(x - p) changes by (n - n0).(x - p0) - n.(p - p0): no more than that at the lever's
    distance, and in proportion to it farther away. Sliding in itself and spinning about its
    normal a plane goes nowhere.
    """
    frame, broadphase = scene.work.frames[g], scene.broadphase
    before = broadphase.reference[g]
    n = (frame[5], frame[8], frame[11])
    way = dot(n, sub(vector(frame), vector(before)))
    return abs(way) + norm(sub(n, vector(before[3:]))) * broadphase.lever[g]


@jitable
def turn_travel(y: F1, b: int, before: F1, radius: float) -> float:
    """Return how far a turn by angle a since the unit quaternion `before` moves body b's points.

    Those at a radius r by at most 2 r sin(a/2).
    """
    at = BODY_SIZE * b + AT_Q
    q = (y[at], y[at + 1], y[at + 2], y[at + 3])
    length = math.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    return 2.0 * radius * norm(vector_of_turn(q, before)) / length


@jitable
def place_graphics(scene: Scene, y: F1) -> bool:
    """Place every shape that does not sleep, and bound how far any of its points has come.

    Since the committed state the centre moved by |dx|, and a turn moves points besides. Return
    whether all shapes are where the list of near pairs still holds.
    """
    graphics, work, state = scene.graphics, scene.work, scene.state
    listed, skin = True, scene.broadphase.size[0]
    for k in range(graphics_awake(scene)):
        g = graphic_awake(scene, k)
        b = graphics.body[g]
        if b == len(scene.bodies.mass):
            continue
        place_graphic(scene, y, g)
        travel = math.inf
        if graphics.radius[g] < math.inf:
            frame, centre = work.frames[g], state.centre[g]
            dx, dy, dz = frame[0] - centre[0], frame[1] - centre[1], frame[2] - centre[2]
            travel = math.sqrt(dx * dx + dy * dy + dz * dz)
            if graphics.turns[g] == 1:
                travel += turn_travel(y, b, state.q[b], graphics.radius[g])
        work.travel[g] = travel
        room = scene.broadphase.room[g]
        if travel < math.inf:
            listed = listed and travel <= room
        elif room < math.inf:
            listed = listed and plane_travel(scene, g) <= half_skin(scene, g, skin)
    return listed
