"""Forces of a step, and the motion that they and joints would give it without contacts."""

from __future__ import annotations

import math

from mbsim.arrays.codes import AIMED_AT, AIMED_WORK, OF_MOTIONS
from mbsim.arrays.hooks import Hook, Joints
from mbsim.arrays.scene import Scene
from mbsim.core.address import call_int
from mbsim.core.arrays import F1
from mbsim.core.codes import Code
from mbsim.core.jitable import jitable
from mbsim.core.layout import AT_Q, AT_V, AT_W, BODY_SIZE
from mbsim.core.rotation import (
    add,
    cross,
    matrix_from_quaternion,
    rotate,
    scale,
    sub,
    unrotate,
    vector,
)
from mbsim.dynamics.bodies.acceleration import accelerate
from mbsim.dynamics.bodies.configuration import turn
from mbsim.dynamics.bodies.kinematics import place_bodies
from mbsim.dynamics.constraints.equations import power_of_equations
from mbsim.dynamics.pipeline.evaluate import add_gravity
from mbsim.stepping.arrays import THETA, WOKEN, Stepping
from mbsim.stepping.displacements import move_bodies
from mbsim.stepping.free_motion import (
    fill_motion,
    spin_by_midpoint,
    start_from,
    turn_to_global,
)
from mbsim.stepping.implicit import choose_theta, factor_forces, is_implicit, take_into_step
from mbsim.stepping.sleep import wake_loaded


@jitable
def bring_onto_joints(scene: Scene, t: float, y: F1) -> int:
    """Bring y onto joints and equations by the least change; return 0 or a code."""
    joints = scene.world.hooks[Hook.JOINTS]
    code = call_int(joints, (scene, Joints.CLOSE, t, y, y))
    return code if code != 0 else call_int(joints, (scene, Joints.HOLD, t, y, y))


@jitable
def bring_to_end(scene: Scene, t: float, y: F1) -> int:
    """Do the same at the end of a step, with the work that motions do by that; return 0 or a code.

    Rates of motions change within a step: what its end takes of velocities is their work, too.
    """
    code, accumulator = bring_onto_joints(scene, t, y), scene.world.accumulators[OF_MOTIONS]
    if accumulator >= 0:
        y[accumulator] += scene.sweep.aimed[AIMED_WORK]
    return code


@jitable
def go_to_midst(scene: Scene, S: Stepping, h: float, y: F1) -> None:
    """Fill the state in the midst of a step h from y, with velocities by forces without joints.

    y' has angular velocities without forces.

    Forces are those at `middle`, the part theta of the step. Bodies get there by the trapezoidal
    rule. Forces but their weight go on acting where they were found: what two bodies do to each
    other has no moment then.
    """
    bodies, work, half = scene.bodies, scene.work, 0.5 * h
    middle, midst, dy = S.motion.middle, S.motion.midst, S.motion.slope
    # what of the change of velocities up to `middle` is one up to the midst
    share = 0.5 / S.forces.number[THETA]
    for k in range(len(midst)):
        midst[k] = middle[k]
    for k in range(len(scene.tree.body)):
        b = scene.tree.body[k]
        at, m = BODY_SIZE * b, bodies.mass[b]
        v, w, spin = vector(y, at + AT_V), vector(y, at + AT_W), vector(middle, at + AT_W)
        way = scale(half, add(v, scale(0.5 * share, sub(vector(middle, at + AT_V), v))))
        back = sub(sub(vector(middle, at), vector(y, at)), way)
        push = sub(vector(work.force[b]), scale(m, vector(scene.world.gravity)))
        half_way = spin_by_midpoint(bodies.inertia[b], w, (0.0, 0.0, 0.0), half)
        mean = add(w, scale(0.5 * share, sub(spin, w)))
        turn(y, at, half, mean[0], mean[1], mean[2], midst)
        matrix_from_quaternion(midst[at + AT_Q : at + AT_V], work.R[b])
        torque = unrotate(work.R[b], add(vector(work.torque[b]), cross(back, push)))
        alpha = rotate(bodies.inverse[b], torque)
        for c in range(3):
            midst[at + c] = y[at + c] + way[c]
            midst[at + AT_V + c] = v[c] + half * work.force[b, c] / m
            dy[at + AT_W + c] = half_way[c]
            midst[at + AT_W + c] = half_way[c] + half * alpha[c]


@jitable
def look_on(scene: Scene, S: Stepping, y: F1, asked: F1) -> None:
    """Fill the state in the midst of a step from y as motions by the state see it.

    Velocities are those that the step was found to have there, not those of forces alone.
    """
    midst, middle, share = S.motion.midst, S.motion.middle, 0.5 / S.forces.number[THETA]
    for k in range(len(midst)):
        asked[k] = midst[k]
    for k in range(len(scene.tree.body)):
        at = BODY_SIZE * scene.tree.body[k]
        for c in range(at + AT_V, at + BODY_SIZE):
            asked[c] = y[c] + share * (middle[c] - y[c])


@jitable
def hold_by_joints(scene: Scene, S: Stepping, t: float, h: float, y: F1) -> int:
    """Fill accelerations of bodies that joints hold in the step h from (t, y); return 0 or a code.

    What joints do is found in the step's midst, however far in it forces are taken: with P the
    nearest velocities that joints allow there, in the norm of the masses,

        v_m = P (v + h/2 M^-1 f),    v' = v + 2 (v_m - v)

    which for f = 0 has the kinetic energy of v, however long the step is: v' is v reflected at what
    joints allow. Accelerations with the squares of velocities have no such bound. Bodies spin
    freely for half a step before that and behind (G. Strang, SIAM J. Numer. Anal. 5 (1968) 506).
    They are placed in the midst behind this.
    """
    half, midst, dy = 0.5 * h, S.motion.midst, S.motion.slope
    go_to_midst(scene, S, h, y)
    joints, asked, total = scene.world.hooks[Hook.JOINTS], S.motion.aside, 0.0
    look_on(scene, S, y, asked)
    code = call_int(joints, (scene, Joints.ASK, t + half, asked, dy))
    scene.sweep.aimed[AIMED_AT] = t + half
    if code == 0:
        code = call_int(joints, (scene, Joints.HOLD, t + half, midst, dy))
    # where the step ends: `bring_to_end`
    scene.sweep.aimed[AIMED_AT] = t + h
    for k in range(len(scene.tree.body)):
        b = scene.tree.body[k]
        at, J = BODY_SIZE * b, scene.bodies.inertia[b]
        w = sub(scale(2.0, vector(midst, at + AT_W)), vector(dy, at + AT_W))
        w = spin_by_midpoint(J, w, (0.0, 0.0, 0.0), half)
        for c in range(3):
            dy[at + AT_V + c] = (midst[at + AT_V + c] - y[at + AT_V + c]) / half
            dy[at + AT_W + c] = (w[c] - y[at + AT_W + c]) / h
            total += dy[at + AT_V + c] + dy[at + AT_W + c]
    accumulator = scene.world.accumulators[OF_MOTIONS]
    if accumulator >= 0:
        dy[accumulator] = power_of_equations(scene) / half
    return code if code != 0 or math.isfinite(total) else Code.NOT_FINITE


@jitable
def find_forces(scene: Scene, t: float, y: F1, dy: F1) -> int:
    """Fill y' = f(t, y) without contacts and joints; return 0 or why it cannot be."""
    place_bodies(scene, y)
    add_gravity(scene)
    for k in range(BODY_SIZE * len(scene.bodies.mass), len(dy)):
        dy[k] = 0.0
    if scene.world.hooks[Hook.APPLIED] != 0:
        code = call_int(scene.world.hooks[Hook.APPLIED], (scene, t, y, dy))
        if code != 0:
            return code
    return 0 if math.isfinite(accelerate(scene, y, dy)) else Code.NOT_FINITE


@jitable
def find_forces_within(scene: Scene, S: Stepping, t: float, h: float, y: F1) -> int:
    """Fill y' of a step h from (t, y) by the forces at `Motion.middle`; return 0 or a code.

    Stiff forces are those of bodies as joints have them: what opens them would be a force.
    """
    M, theta, joints, code = S.motion, S.forces.number[THETA], scene.world.hooks[Hook.JOINTS], 0
    when = t + theta * h
    if theta > 0.5 and joints != 0:
        code = bring_onto_joints(scene, when, M.middle)
    if code == 0:
        code = find_forces(scene, when, M.middle, M.slope)
    if code == 0 and joints != 0 and scene.world.hooks[Hook.REACTION_FORCES] != 0:
        # forces by reactions are settled with the accelerations that joints leave
        code = call_int(joints, (scene, Joints.ACCELERATE, when, M.middle, M.slope))
    if code == 0 and joints != 0:
        code = hold_by_joints(scene, S, t, h, y)
    return code


@jitable
def factor_within(scene: Scene, S: Stepping, t: float, h: float, y: F1) -> int:
    """Linearise forces at `Motion.middle`, where they were found; return 0 or a code."""
    M, joints, code = S.motion, scene.world.hooks[Hook.JOINTS], 0
    when = t + S.forces.number[THETA] * h
    if joints != 0:
        code = call_int(joints, (scene, Joints.READY, when, M.middle, M.middle))
    if code == 0:
        code = factor_forces(scene, S, when, h, M.middle, M.slope)
    if joints != 0:
        place_bodies(scene, M.midst)
    return code


@jitable
def find_motion(scene: Scene, S: Stepping, t: float, h: float, y: F1) -> int:
    """Find the motion without contacts in a step from y; return 0 or a code.

    By the forces at its begin, where they are explicit and no joints hold the bodies.
    """
    middle, dy = S.motion.middle, S.motion.slope
    choose_theta(S, h)
    if not is_implicit(S) and scene.world.hooks[Hook.JOINTS] == 0:
        code = find_forces(scene, t, y, dy)
        wake_loaded(scene, S)
        fill_motion(scene, S, y, y, h)
        return code
    if scene.world.hooks[Hook.JOINTS] != 0:
        code = call_int(scene.world.hooks[Hook.JOINTS], (scene, Joints.AIM, t, y, y))
        if code != 0:
            return code
    place_bodies(scene, y)
    start_from(scene, S, y)
    for k in range(BODY_SIZE * len(scene.bodies.mass), len(y)):
        middle[k] = y[k]
    move_bodies(scene, S, y, S.forces.number[THETA] * h, middle)
    code = find_forces_within(scene, S, t, h, y)
    wake_loaded(scene, S)
    if code != 0 or S.rest.count[WOKEN] == 1:
        return code
    if is_implicit(S):
        code = factor_within(scene, S, t, h, y)
        if code != 0:
            return code
    turn_to_global(scene, dy)
    place_bodies(scene, y)
    fill_motion(scene, S, y, middle, h)
    return take_into_step(scene, S, h, dy, True) if is_implicit(S) else 0
