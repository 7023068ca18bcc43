"""Forces of a step, and the motion that they and joints would give it without contacts."""

from __future__ import annotations

import math

from mbsim.arrays.hooks import Hook, Joints
from mbsim.arrays.scene import Scene
from mbsim.core.address import call_int
from mbsim.core.arrays import F1
from mbsim.core.codes import Code
from mbsim.core.jitable import jitable
from mbsim.core.layout import BODY_SIZE
from mbsim.dynamics.bodies.acceleration import accelerate
from mbsim.dynamics.bodies.kinematics import place_bodies
from mbsim.dynamics.pipeline.evaluate import add_gravity
from mbsim.stepping.arrays import THETA, WOKEN, Stepping
from mbsim.stepping.displacements import move_bodies
from mbsim.stepping.free_motion import fill_motion, start_from, turn_to_global
from mbsim.stepping.implicit import choose_theta, factor_forces, is_implicit, take_into_step
from mbsim.stepping.sleep import wake_loaded


@jitable
def find_forces(scene: Scene, t: float, y: F1, dy: F1) -> int:
    """Fill y' = f(t, y) without contacts; return 0 or why it cannot be."""
    place_bodies(scene, y)
    add_gravity(scene)
    for k in range(BODY_SIZE * len(scene.bodies.mass), len(dy)):
        dy[k] = 0.0
    if scene.world.hooks[Hook.APPLIED] != 0:
        code = call_int(scene.world.hooks[Hook.APPLIED], (scene, t, y, dy))
        if code != 0:
            return code
    if not math.isfinite(accelerate(scene, y, dy)):
        return Code.NOT_FINITE
    if scene.world.hooks[Hook.JOINTS] != 0:
        return call_int(scene.world.hooks[Hook.JOINTS], (scene, Joints.ACCELERATE, t, y, dy))
    return 0


@jitable
def find_motion(scene: Scene, S: Stepping, t: float, h: float, y: F1) -> int:
    """Find the motion without contacts in a step from y; return 0 or a code.

    By the forces at its begin, where they are explicit.
    """
    middle, dy = S.motion.middle, S.motion.slope
    choose_theta(S, h)
    if not is_implicit(S):
        code = find_forces(scene, t, y, dy)
        wake_loaded(scene, S)
        turn_to_global(scene, dy)
        fill_motion(scene, S, y, h)
        return code
    part = S.forces.number[THETA] * h
    place_bodies(scene, y)
    start_from(scene, S, y)
    for k in range(BODY_SIZE * len(scene.bodies.mass), len(y)):
        middle[k] = y[k]
    move_bodies(scene, S, y, part, middle)
    code = find_forces(scene, t + part, middle, dy)
    wake_loaded(scene, S)
    if code != 0 or S.rest.count[WOKEN] == 1:
        return code
    code = factor_forces(scene, S, t + part, h, middle, dy)
    if code != 0:
        return code
    turn_to_global(scene, dy)
    place_bodies(scene, y)
    fill_motion(scene, S, y, h)
    return take_into_step(scene, S, h, dy, True)
