"""What friction may do within a step of fixed length."""

from __future__ import annotations

import math

from mbsim.arrays.scene import Scene
from mbsim.core.arrays import F1, F2, V2, V3
from mbsim.core.jitable import jitable
from mbsim.core.rotation import add, cross, dot, rotate, scale, sub, unrotate, vector
from mbsim.dynamics.bodies.kinematics import position
from mbsim.dynamics.contact.forces import sides
from mbsim.geometry.catalog import AT_NORMAL, AT_POINT
from mbsim.laws.abi import FORCE_X_OUT, FORCE_Y_OUT, TORQUE_Z_OUT

#: Part of the friction that would stop a slip in one step, which a fixed-step method may use.
HELD_BACK = 0.25


@jitable
def trace(S: F2) -> float:
    """Return the sum of the diagonal, which no axis of a positive matrix has more than."""
    return S[0, 0] + S[1, 1] + S[2, 2]


@jitable
def answer(scene: Scene, y: F1, b: int, p: V3, d: V3) -> float:
    """Return the velocity along d that a unit impulse along d at p gives body b there."""
    bodies = scene.bodies
    if b == len(bodies.mass):
        return 0.0
    turning = unrotate(scene.work.R[b], cross(sub(p, position(scene, y, b)), d))
    return 1.0 / bodies.mass[b] + dot(turning, rotate(bodies.inverse[b], turning))


@jitable
def hold_back(scene: Scene, y: F1, s: int, h: float, slip: V2) -> None:
    """Reduce friction of slot s in `law_out` to a quarter of what would stop the slip in the step.

    Friction that turns sign from step to step would shake what rests; a quarter, since some
    eight contacts share a body. Explicit methods of fixed step need this, as their step does not
    follow the slope of friction at coarse tolerances; it fades as the step goes to 0, and from a
    tolerance of 1e-5 on the step follows (`events.contact_stability`).
    """
    out, p, body = scene.work.law_out, vector(scene.work.points[s, AT_POINT:]), scene.graphics.body
    gi, gj = sides(scene, s)
    force, speed = math.hypot(out[FORCE_X_OUT], out[FORCE_Y_OUT]), math.hypot(slip[0], slip[1])
    n, tx = vector(scene.work.points[s, AT_NORMAL:]), vector(scene.work.t[s])
    most = 0.0
    if speed > 0.0:
        d = add(scale(slip[0] / speed, tx), scale(slip[1] / speed, cross(n, tx)))
        inverse = answer(scene, y, body[gi], p, d) + answer(scene, y, body[gj], p, d)
        most = HELD_BACK * speed / (h * inverse)
    if force > most:
        for k in range(2):
            out[FORCE_X_OUT + k] *= most / force
    if out[TORQUE_Z_OUT] != 0.0:
        # so of the torque against spin, to the spin that it would stop
        inverse = 0.0
        for b in (body[gi], body[gj]):
            if b < len(scene.bodies.mass):
                inverse += trace(scene.bodies.inverse[b])
        w = sub(vector(scene.work.w[body[gi]]), vector(scene.work.w[body[gj]]))
        most = HELD_BACK * abs(dot(w, n)) / (h * inverse)
        out[TORQUE_Z_OUT] = max(-most, min(most, out[TORQUE_Z_OUT]))
