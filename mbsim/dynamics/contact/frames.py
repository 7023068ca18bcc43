"""The tangents of incidents: how their frames begin, and turn with the bodies."""

from __future__ import annotations

import math

from mbsim.arrays.codes import REPLAYED
from mbsim.arrays.scene import Scene
from mbsim.core.arrays import F1, V3
from mbsim.core.jitable import jitable
from mbsim.core.layout import BODY_SIZE
from mbsim.core.rotation import (
    any_tangent,
    dot,
    rotate,
    scale,
    spin,
    sub,
    turn_about,
    turn_with_normal,
    vector,
)


@jitable
def turned(scene: Scene, t: float, y: F1, b: int, n: V3, n0: V3) -> float:
    """Return the angle by which body b turned about n since the committed state, where it was n0.

    What follows a frame through many steps must not depend on how long they are.
    """
    if b == len(scene.bodies.mass):
        return 0.0
    state, at = scene.state, BODY_SIZE * b + 3
    q, w, w0 = (y[at], y[at + 1], y[at + 2], y[at + 3]), scene.work.w[b], state.w[b]
    return turn_about(q, state.q[b], vector(w), vector(w0), n, n0, t - state.since[0])


@jitable
def birth_tangent(scene: Scene, graphic_i: int, n: V3) -> V3:
    """Return the x-axis of a new incident marker: I's marker x-axis (or y), projected."""
    R = scene.work.R[scene.graphics.body[graphic_i]]
    S = scene.graphics.marker_R[graphic_i]
    x = rotate(R, (S[0, 0], S[1, 0], S[2, 0]))
    if abs(dot(x, n)) > 0.9:
        x = rotate(R, (S[0, 1], S[1, 1], S[2, 1]))
    x = sub(x, scale(dot(x, n), n))
    return scale(1.0 / math.sqrt(dot(x, x)), x)


@jitable
def tangent(
    scene: Scene, time: float, y: F1, s: int, c: int, graphic_i: int, bi: int, bj: int, n: V3
) -> V3:
    """Return the x-axis of the incident marker of slot s of contact c at the trial point.

    Since the committed state it has turned with the normal by the shortest rotation and about
    the normal by the mean of both bodies' turns; a new incident gets its axes by birth.
    """
    state = scene.state
    if scene.contacts.framed[c] == 0:
        # the law is the same in every tangent frame
        return any_tangent(n)
    if scene.world.past[0] == REPLAYED:
        return vector(state.t[s])
    if state.touching[s] == 0:
        return birth_tangent(scene, graphic_i, n)
    n0 = vector(state.n[s])
    t = turn_with_normal(vector(state.t[s]), n0, n)
    both = turned(scene, time, y, bi, n, n0) + turned(scene, time, y, bj, n, n0)
    return spin(t, n, 0.5 * both)
