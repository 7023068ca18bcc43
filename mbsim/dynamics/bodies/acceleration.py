"""Accelerations of bodies from the forces on them."""

from __future__ import annotations

from mbsim.arrays.scene import Scene
from mbsim.core.arrays import F1
from mbsim.core.jitable import jitable
from mbsim.core.layout import AT_Q, AT_V, AT_W, BODY_SIZE
from mbsim.core.rotation import cross, rotate, sub, unrotate, vector
from mbsim.dynamics.bodies.awake import bodies_awake, body_awake


@jitable
def accelerate(scene: Scene, y: F1, dy: F1) -> float:
    """Fill y' of every body: x' = v, q' = q (0, w)/2, m v' = F, I w' = T - w x I w in cg axes."""
    bodies, work = scene.bodies, scene.work
    total = 0.0
    for row in range(bodies_awake(scene)):
        b = body_awake(scene, row)
        at = BODY_SIZE * b
        w = (y[at + AT_W], y[at + AT_W + 1], y[at + AT_W + 2])
        q = at + AT_Q
        qw, qx, qy, qz = y[q], y[q + 1], y[q + 2], y[q + 3]
        dy[q] = 0.5 * (-qx * w[0] - qy * w[1] - qz * w[2])
        dy[q + 1] = 0.5 * (qw * w[0] + qy * w[2] - qz * w[1])
        dy[q + 2] = 0.5 * (qw * w[1] + qz * w[0] - qx * w[2])
        dy[q + 3] = 0.5 * (qw * w[2] + qx * w[1] - qy * w[0])

        for k in range(3):
            dy[at + k] = y[at + AT_V + k]
        if scene.tree.of_body[b] >= 0:
            # joints have their say first
            continue
        torque = unrotate(work.R[b], vector(work.torque[b]))
        gyroscopic = cross(w, rotate(bodies.inertia[b], w))
        alpha = rotate(bodies.inverse[b], sub(torque, gyroscopic))
        for k in range(3):
            a = work.force[b, k] / bodies.mass[b]
            dy[at + AT_V + k] = a
            dy[at + AT_W + k] = alpha[k]
            total += a + alpha[k]
    return total
