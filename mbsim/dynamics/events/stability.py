"""How long a step of a method without error estimate may be: its stability bound.

With K = sum over contacts of B' k B and each contact between two bodies, the largest eigenvalue
of M^-1 K is at most twice the largest of the blocks of single bodies, D_b / m_b with
D_b = sum of k n n' (a contact with ground counts half, and |D_b| is bounded by its Frobenius
norm), plus the turning part, k (r x n)' I^-1 (r x n) summed. Dampers, with the slope c of their
force over velocity, give rates in the same way. A contact that is yet to come, or that has
only begun, counts with the stiffness and damping of the depth that it will reach. Springs
between markers count like contacts; forces by expressions are refused with such a method.

A body that turns bounds the step by itself. With w of the middle of a step of velocity Verlet the
rotation is off by (w h)^3 / 12 a step where w turns as fast as the body, by the part of I that is
not isotropic where that is small. And the cubic polynomial of its quaternion over the step
is off by (w h / 2)^4 / 384, whatever the inertia.
"""

from __future__ import annotations

import math

from mbsim.arrays.codes import (
    AXIS_TORQUE,
    BLOCK_DAMPING,
    BOUND_DAMPING,
    BOUND_FORCE,
    BOUND_STIFFNESS,
    BOUND_TURNING,
    BOUND_TURNING_DAMPING,
    HIGHEST_DAMPING,
    HIGHEST_FRICTION,
    HIGHEST_SQUARE,
    REST,
    TURNING_DAMPING,
    TURNING_STIFFNESS,
    WRENCH,
)
from mbsim.arrays.hooks import Hook, Stability
from mbsim.arrays.scene import Scene
from mbsim.core.address import call_float
from mbsim.core.arrays import F1, F2, V3
from mbsim.core.jitable import jitable
from mbsim.core.rotation import cross, dot, norm, rotate, scale, sub, unrotate
from mbsim.dynamics.bodies.kinematics import place_bodies, position
from mbsim.dynamics.bodies.markers import marker_arm, marker_axis, marker_point
from mbsim.dynamics.contact.fixed_step import HELD_BACK

#: Tolerance at which the step is half of the stability bound of an undamped vibration.
COARSE = 1e-3
#: Tolerance from which on steps follow friction.
FOLLOWED = 1e-5
#: Largest step over half of the bound; the bound is below the true limit.
LARGEST_PART = 1.8


@jitable
def yielding(scene: Scene, b: int, arm: V3, n: V3) -> float:
    """Return n' J I^-1 J' n: how a unit force along n at `arm` from body b's cg turns the point."""
    turning = unrotate(scene.work.R[b], cross(arm, n))
    return dot(turning, rotate(scene.bodies.inverse[b], turning))


@jitable
def translation(scene: Scene, b: int) -> float:
    """Return 1/m of body b, 0 for ground."""
    return 1.0 / scene.bodies.mass[b] if b < len(scene.bodies.mass) else 0.0


@jitable
def add_to_block(block: F1, n: V3, stiffness: float, damping: float, turn: float) -> None:
    """Add stiffness and damping along n to the block of a body; `turn`: see `yielding`."""
    for r in range(3):
        for q in range(3):
            block[3 * r + q] += stiffness * n[r] * n[q]
            block[BLOCK_DAMPING + 3 * r + q] += damping * n[r] * n[q]
    block[TURNING_STIFFNESS] += stiffness * turn
    block[TURNING_DAMPING] += damping * turn


@jitable
def add_wrench(scene: Scene, y: F1, f: int) -> None:
    """Add the largest stiffness and damping of wrench f, along every axis and about it.

    Both bodies are pushed at I's origin P, so arms go there. A turn of body b moves P by its
    arm, and turns the axes along which a force that already acts does: arm times
    force, as much again where J's axes turn with b.
    """
    applied, markers, ground = scene.applied, scene.markers, len(scene.bodies.mass)
    i, j, bound = applied.i[f], applied.j[f], applied.bound[f]
    both = 2.0 if markers.body[i] < ground and markers.body[j] < ground else 1.0
    k, c = bound[BOUND_STIFFNESS], bound[BOUND_DAMPING]
    turn_k, turn_c = bound[BOUND_TURNING], bound[BOUND_TURNING_DAMPING]
    at = marker_point(scene, y, i)
    stretch = sub(at, marker_point(scene, y, j))
    for axis in range(3):
        stretch = sub(stretch, scale(bound[REST + axis], marker_axis(scene, j, axis)))
    force = k * norm(stretch) + bound[BOUND_FORCE]
    for side in range(2):
        m = i if side == 0 else j
        b = markers.body[m]
        if b == ground:
            continue
        block, inverse = scene.work.block[b], scene.bodies.inverse[b]
        arm = sub(at, position(scene, y, b))
        square, bent = dot(arm, arm), 2.0 * norm(arm) * force
        most = inverse[0, 0] + inverse[1, 1] + inverse[2, 2]
        for r in range(3):
            block[4 * r] += both * k
            block[BLOCK_DAMPING + 4 * r] += both * c
        block[TURNING_STIFFNESS] += both * (k * square + turn_k + bent) * most
        block[TURNING_DAMPING] += both * (c * square + turn_c) * most


@jitable
def add_spring(scene: Scene, y: F1, f: int) -> None:
    """Add stiffness and damping of spring f to the blocks of its bodies.

    Along the line of a spring at distance d acts k, across it F/d, and an arm r turns with the
    torque F r. Stiffness across and by F is bounded by what the smallest moment of inertia gives.
    """
    applied, markers, ground = scene.applied, scene.markers, len(scene.bodies.mass)
    if applied.form[f] == WRENCH:
        add_wrench(scene, y, f)
        return
    i, j, bound = applied.i[f], applied.j[f], applied.bound[f]
    both = 2.0 if markers.body[i] < ground and markers.body[j] < ground else 1.0
    k, damping = both * bound[BOUND_STIFFNESS], both * bound[BOUND_DAMPING]
    line = sub(marker_point(scene, y, i), marker_point(scene, y, j))
    d = norm(line)
    n = scale(1.0 / d, line) if d > 0.0 else (0.0, 0.0, 0.0)
    pull = bound[BOUND_FORCE] - bound[BOUND_STIFFNESS] * (d - bound[REST])
    force = abs(pull) if d > 0.0 else 0.0
    for side in range(2):
        m = i if side == 0 else j
        b = markers.body[m]
        if b == ground:
            continue
        block, inverse = scene.work.block[b], scene.bodies.inverse[b]
        if applied.form[f] == AXIS_TORQUE:
            axis = unrotate(scene.work.R[b], marker_axis(scene, j, 2))
            turn = dot(axis, rotate(inverse, axis))
            block[TURNING_STIFFNESS] += k * turn
            block[TURNING_DAMPING] += damping * turn
            continue
        arm = marker_arm(scene, m)
        add_to_block(block, n, k, damping, yielding(scene, b, arm, n))
        if d > 0.0:
            across, length = both * force / d, norm(arm)
            for r in range(3):
                block[4 * r] += across
            most = inverse[0, 0] + inverse[1, 1] + inverse[2, 2]
            block[TURNING_STIFFNESS] += (across * length * length + both * force * length) * most


@jitable
def anisotropy(inertia: F2) -> float:
    """Return |I - E tr I / 3| over tr I / 3 (Frobenius): 0 of a ball, 1.22 of a thin rod."""
    mean = (inertia[0, 0] + inertia[1, 1] + inertia[2, 2]) / 3.0
    square = 0.0
    for r in range(3):
        for q in range(3):
            part = inertia[r, q] - (mean if r == q else 0.0)
            square += part * part
    return math.sqrt(square) / mean


@jitable
def turning_step(scene: Scene, tol: float) -> float:
    """Return the step over which the rotation of every body, as placed, is good to `tol`."""
    bodies, longest = scene.bodies, math.inf
    # (angle / 2)^4 / 384 = tol
    drawn = 2.0 * math.sqrt(math.sqrt(384.0 * tol))
    for b in range(len(bodies.mass)):
        w = scene.work.w[b]
        speed = norm((w[0], w[1], w[2]))
        if speed == 0.0:
            continue
        # angle^2 / 12 = tol
        uneven = anisotropy(bodies.inertia[b])
        angle = math.sqrt(12.0 * tol / uneven) if uneven > 0.0 else math.inf
        longest = min(longest, min(angle, drawn) / speed)
    return longest


@jitable
def stable_step(scene: Scene, tol: float, y: F1, f: F1) -> float:
    """Return the step that a method without error estimate is to take from the committed point."""
    work, bodies = scene.work, scene.bodies
    # what was evaluated last may be another point: an output within the step, or nothing yet
    place_bodies(scene, y)
    longest = turning_step(scene, tol)
    for b in range(len(bodies.mass)):
        for k in range(20):
            work.block[b, k] = 0.0
    hook = scene.world.hooks[Hook.STABILITY]
    work.bound[HIGHEST_FRICTION] = 0.0
    if hook != 0:
        travel = call_float(hook, (scene, Stability.TOUCHING, y, f))
        if travel < 0.0:
            return math.inf
        longest = min(travel, longest)
    for k in range(len(scene.applied.form)):
        add_spring(scene, y, k)
    bound = work.bound
    bound[HIGHEST_SQUARE] = bound[HIGHEST_DAMPING] = 0.0
    for b in range(len(bodies.mass)):
        block, stiff, damped = work.block[b], 0.0, 0.0
        for k in range(9):
            stiff += block[k] * block[k]
            damped += block[BLOCK_DAMPING + k] * block[BLOCK_DAMPING + k]
        bound[HIGHEST_SQUARE] = max(
            bound[HIGHEST_SQUARE], math.sqrt(stiff) / bodies.mass[b] + block[TURNING_STIFFNESS]
        )
        bound[HIGHEST_DAMPING] = max(
            bound[HIGHEST_DAMPING], math.sqrt(damped) / bodies.mass[b] + block[TURNING_DAMPING]
        )
    if hook != 0:
        call_float(hook, (scene, Stability.MEETING, y, f))

    # the limit of the method is (h w)^2 / 4 + h c = 1 (w frequency, c rate of damping), so h =
    # 2 / (c + sqrt(c^2 + w^2)); order 2 needs the root of the tolerance
    if bound[HIGHEST_FRICTION] > 0.0:
        # friction is held back (`contact.fixed_step`) of coarser tolerances: it is costly to follow
        more = max(math.sqrt(tol / FOLLOWED), tol / FOLLOWED)
        longest = min(longest, HELD_BACK * more / bound[HIGHEST_FRICTION])
    part = min(LARGEST_PART, math.sqrt(tol / COARSE))
    fastest = bound[HIGHEST_DAMPING] + math.sqrt(
        bound[HIGHEST_DAMPING] * bound[HIGHEST_DAMPING] + bound[HIGHEST_SQUARE]
    )
    return min(longest, part / fastest) if fastest > 0.0 else longest
