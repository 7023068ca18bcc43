"""The pipeline, the file to read first: y' = f(t, y) in stages, each one call."""

from __future__ import annotations

import math

from mbsim.arrays.codes import NEAR_FOLD, NOISE_FORCE, NOISE_TORQUE, NOW, WITHIN
from mbsim.arrays.hooks import Contacts, Dry, Hook, Joints, Sticking, answer_of, failure_or
from mbsim.arrays.scene import Scene
from mbsim.core.address import call_int
from mbsim.core.arrays import F1
from mbsim.core.codes import Code
from mbsim.core.jitable import jitable
from mbsim.core.layout import BODY_SIZE
from mbsim.core.problem import GOES, LISTED
from mbsim.dynamics.bodies.acceleration import accelerate
from mbsim.dynamics.bodies.awake import bodies_awake, body_awake
from mbsim.dynamics.bodies.kinematics import place_bodies


@jitable
def start_force(scene: Scene, b: int, mass: float) -> None:
    """Let nothing but its weight act on body b."""
    work, g = scene.work, scene.world.gravity
    for k in range(3):
        work.force[b, k] = mass * g[k]
        work.torque[b, k] = 0.0
    work.noise[b, NOISE_FORCE] = work.noise[b, NOISE_TORQUE] = 0.0


@jitable
def add_gravity(scene: Scene) -> None:
    """Start the forces of every body with its weight; of what sleeps those that may be loaded."""
    ground = len(scene.bodies.mass)
    for k in range(bodies_awake(scene)):
        start_force(scene, body_awake(scene, k), scene.bodies.mass[body_awake(scene, k)])
    start_force(scene, ground, 0.0)
    if scene.awake.whole[GOES] == LISTED:
        for b in scene.awake.loadable:
            start_force(scene, b, scene.bodies.mass[b])


@jitable
def evaluate(scene: Scene, t: float, h: float, y: F1, dy: F1) -> int:
    """Fill dy = f(t, y), `h` after the committed state; return 0 or why it cannot be."""
    # where things are
    place_bodies(scene, y)
    if scene.sweep.quality[NEAR_FOLD] == 1.0:
        # near a position in which a loop can fold, equations are sound only where they hold
        code = call_int(scene.world.hooks[Hook.JOINTS], (scene, Joints.PROJECT_TREE, t, y, dy))
        if code != 0:
            return code

    # what pushes
    add_gravity(scene)
    for k in range(BODY_SIZE * len(scene.bodies.mass), len(dy)):
        dy[k] = 0.0
    if scene.world.hooks[Hook.CONTACTS] != 0:
        answer = call_int(scene.world.hooks[Hook.CONTACTS], (scene, Contacts.PUSH, t, h, y, dy))
        if answer < 0:
            return -answer

    if scene.world.hooks[Hook.APPLIED] != 0:
        code = call_int(scene.world.hooks[Hook.APPLIED], (scene, t, y, dy))
        if code != 0:
            return code

    # what follows
    if not math.isfinite(accelerate(scene, y, dy)):
        return Code.NOT_FINITE
    if scene.world.hooks[Hook.JOINTS] != 0:
        return call_int(scene.world.hooks[Hook.JOINTS], (scene, Joints.ACCELERATE, t, y, dy))
    return 0


@jitable
def evaluate_past(scene: Scene, t: float, h: float, y: F1, dy: F1) -> int:
    """Do the same at a point within the last step, where friction knows what it did before it."""
    scene.world.past[0] = WITHIN
    if scene.world.hooks[Hook.DRY] != 0:
        answer_of(scene, call_int(scene.world.hooks[Hook.DRY], (scene, Dry.RESTICK, t, y)))
    code = call_int(scene.world.hooks[Hook.EVALUATE], (scene, t, h, y, dy))
    if code == 0 and scene.world.hooks[Hook.STICKING] != 0:
        answer_of(scene, call_int(scene.world.hooks[Hook.STICKING], (scene, Sticking.SHARE, t, y)))
    scene.world.past[0] = NOW
    return failure_or(scene, code)
