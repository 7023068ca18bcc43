"""What bodies would do in a step without contacts: velocities and spins, and inverse masses."""

from __future__ import annotations

import math

from mbsim.arrays.scene import Scene
from mbsim.core.arrays import F1, F2, V3
from mbsim.core.jitable import jitable
from mbsim.core.layout import AT_Q, AT_V, AT_W, BODY_SIZE
from mbsim.core.rotation import (
    add,
    cross,
    dot,
    matrix_from_quaternion,
    norm,
    rotate,
    scale,
    sub,
    unrotate,
    vector,
)
from mbsim.dynamics.bodies.awake import bodies_awake, body_awake
from mbsim.dynamics.bodies.configuration import turn
from mbsim.stepping.arrays import ASLEEP, THETA, Stepping

#: Newton iterations for the spin of a body at most.
MOST_SPINS = 12


@jitable
def is_round(J: F2) -> bool:
    """Return whether a body's inertia is the same about all axes."""
    across = J[0, 1] != 0.0 or J[0, 2] != 0.0 or J[1, 2] != 0.0
    return not across and J[0, 0] == J[1, 1] == J[2, 2]


@jitable
def spin_by_midpoint(J: F2, before: V3, T: V3, h: float) -> V3:
    """Return the angular velocity after h that a torque T and the spin itself change, body axes.

    The midpoint rule, I (w' - w) = h (T - m x I m), m = (w + w')/2: it keeps energy and the size
    of the angular momentum of what spins freely, however long the step.
    """
    w = before
    if is_round(J) and T[0] == 0.0 and T[1] == 0.0 and T[2] == 0.0:
        return w
    for _ in range(MOST_SPINS):
        m = scale(0.5, add(before, w))
        L = rotate(J, m)
        turns = cross(m, L)
        change = rotate(J, sub(w, before))
        off = add(change, scale(h, sub(turns, T)))
        k = 0.5 * h
        # I + h/2 ([m] I - [I m]) by rows, [a] b = a x b
        x = (
            J[0, 0] + k * (m[1] * J[2, 0] - m[2] * J[1, 0]),
            J[0, 1] + k * (m[1] * J[2, 1] - m[2] * J[1, 1] + L[2]),
            J[0, 2] + k * (m[1] * J[2, 2] - m[2] * J[1, 2] - L[1]),
        )
        z = (
            J[1, 0] + k * (m[2] * J[0, 0] - m[0] * J[2, 0] - L[2]),
            J[1, 1] + k * (m[2] * J[0, 1] - m[0] * J[2, 1]),
            J[1, 2] + k * (m[2] * J[0, 2] - m[0] * J[2, 2] + L[0]),
        )
        u = (
            J[2, 0] + k * (m[0] * J[1, 0] - m[1] * J[0, 0] + L[1]),
            J[2, 1] + k * (m[0] * J[1, 1] - m[1] * J[0, 1] - L[0]),
            J[2, 2] + k * (m[0] * J[1, 2] - m[1] * J[0, 2]),
        )
        p, g, r = cross(z, u), cross(u, x), cross(x, z)
        d = dot(x, p)
        if d == 0.0:
            break
        step = scale(-1.0 / d, add(scale(off[0], p), add(scale(off[1], g), scale(off[2], r))))
        w = add(w, step)
        if norm(step) <= 1e-14 * norm(w):
            break
    return w


@jitable
def midst_of(y: F1, found: F1, at: int, part: float, q: F1) -> None:
    """Write the quaternion of the body at y[at] in the midst of a step; `part` of it is `found`."""
    same, size = 0.0, 0.0
    for c in range(at + AT_Q, at + AT_V):
        same += y[c] * found[c]
    for c in range(AT_Q, AT_V):
        there = found[at + c] if same >= 0.0 else -found[at + c]
        q[c] = y[at + c] + 0.5 / part * (there - y[at + c])
        size += q[c] * q[c]
    for c in range(AT_Q, AT_V):
        q[c] /= math.sqrt(size)


@jitable
def spin_freely(scene: Scene, S: Stepping, y: F1, found: F1, b: int, h: float) -> V3:
    """Return the angular velocity after h, global axes, of a body that no joint holds.

    The attitude is turned by the mean of spins, see `spin_by_midpoint`. The torque that was found
    at `found`, at y or at the part theta of the step, turns into the body's axes in the midst.
    """
    J, T = scene.bodies.inertia[b], vector(scene.work.torque[b])
    pushed = T[0] != 0.0 or T[1] != 0.0 or T[2] != 0.0
    if is_round(J) and not pushed:
        return vector(scene.work.w[b])
    at = BODY_SIZE * b
    q, R = y[at : at + BODY_SIZE].copy(), scene.work.R[b].copy()
    if pushed:
        midst_of(y, found, at, S.forces.number[THETA], q)
        matrix_from_quaternion(q[AT_Q:], R)
        T = unrotate(R, T)
    before = vector(y, at + AT_W)
    w = spin_by_midpoint(J, before, T, h)
    m = scale(0.5, add(before, w))
    turn(y[at : at + BODY_SIZE], 0, h, m[0], m[1], m[2], q)
    matrix_from_quaternion(q[AT_Q:], R)
    return rotate(R, w)


@jitable
def stand(S: Stepping, b: int) -> None:
    """Let body b go nowhere in the step."""
    M = S.motion
    for c in range(6):
        M.before[b, c] = M.free[b, c] = M.v[b, c] = M.shift[b, c] = 0.0


@jitable
def start_from(scene: Scene, S: Stepping, y: F1) -> None:
    """Let bodies, which are at y, go on as they move there, with no change of velocities."""
    M = S.motion
    for row in range(bodies_awake(scene)):
        b = body_awake(scene, row)
        at = BODY_SIZE * b
        if S.rest.body[b, ASLEEP] == 1:
            stand(S, b)
            continue
        for c in range(3):
            M.v[b, c], M.v[b, 3 + c] = y[at + AT_V + c], scene.work.w[b, c]
        for c in range(6):
            M.before[b, c] = M.shift[b, c] = M.v[b, c]


@jitable
def turn_to_global(scene: Scene, dy: F1) -> None:
    """Turn angular accelerations of what joints hold to global axes, from where bodies are.

    They belong to the attitude that they were found in, be that the step's begin or its middle.
    """
    for row in range(bodies_awake(scene)):
        b = body_awake(scene, row)
        if scene.tree.of_body[b] >= 0:
            at = BODY_SIZE * b + AT_W
            turns = rotate(scene.work.R[b], vector(dy, at))
            for c in range(3):
                dy[at + c] = turns[c]


@jitable
def fill_motion(scene: Scene, S: Stepping, y: F1, found: F1, h: float) -> None:
    """Fill velocities before the step and without contacts, and inverse masses.

    Bodies are as at the step's begin, y; forces were found at `found`; accelerations are those of
    `turn_to_global`.
    """
    M, bodies, dy = S.motion, scene.bodies, S.motion.slope
    stand(S, len(bodies.mass))
    for row in range(bodies_awake(scene)):
        b = body_awake(scene, row)
        if S.rest.body[b, ASLEEP] == 1:
            stand(S, b)
            continue
        at, R = BODY_SIZE * b, scene.work.R[b]
        before, free, inverse = M.before[b], M.free[b], M.inverse[b]
        w = vector(scene.work.w[b])
        for c in range(3):
            before[c], before[3 + c] = y[at + AT_V + c], w[c]
            free[c] = y[at + AT_V + c] + h * dy[at + AT_V + c]
        if scene.tree.of_body[b] >= 0:
            w = add(w, scale(h, vector(dy, at + AT_W)))
        else:
            w = spin_freely(scene, S, y, found, b, h)
        for c in range(3):
            free[3 + c] = w[c]
        for r in range(3):
            # row r of R I^-1
            x = unrotate(bodies.inverse[b], vector(R[r]))
            for c in range(3):
                inverse[r, c] = inverse[r, 3 + c] = inverse[3 + r, c] = 0.0
                inverse[3 + r, 3 + c] = dot(x, vector(R[c]))
            inverse[r, r] = 1.0 / bodies.mass[b]
