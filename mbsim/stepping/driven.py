"""The work of motions in a step in which contacts press on what they drive.

A motion's force holds what forces and contacts do to the bodies that it drives. That of forces
alone is known before the contact problem is solved; here contacts are added as forces r/h, at the
middle of the step that was found.
"""

from __future__ import annotations

import math

from mbsim.arrays.codes import OF_MOTIONS
from mbsim.arrays.hooks import Hook, Joints
from mbsim.arrays.scene import Scene
from mbsim.core.address import call_int
from mbsim.core.arrays import F1
from mbsim.core.codes import Code
from mbsim.core.jitable import jitable
from mbsim.core.layout import AT_Q, AT_V, BODY_SIZE
from mbsim.dynamics.bodies.acceleration import accelerate
from mbsim.dynamics.bodies.kinematics import place_bodies
from mbsim.dynamics.pipeline.evaluate import add_gravity
from mbsim.stepping.arrays import POINTS, Stepping
from mbsim.stepping.one_point import direction


@jitable
def presses_on_driven(scene: Scene, S: Stepping) -> bool:
    """Return whether there are motions, and contacts that press on what joints hold."""
    if scene.world.accumulators[OF_MOTIONS] < 0 or scene.world.hooks[Hook.JOINTS] == 0:
        return False
    for k in range(S.tally.count[POINTS]):
        if S.points.wide[k] >= 0 and S.points.r[k, 0] != 0.0:
            return True
    return False


@jitable
def push_by_points(scene: Scene, S: Stepping, h: float) -> None:
    """Add the impulses of the step over its length to the forces on the bodies."""
    P, ground = S.points, S.plan.group.shape[0] - 1
    for k in range(S.tally.count[POINTS]):
        if P.r[k, 0] == 0.0:
            continue
        for side in range(2):
            b = P.body[k, side]
            if b == ground:
                continue
            for c in range(3):
                for a in range(3):
                    force = P.r[k, a] / h
                    scene.work.force[b, c] += direction(P, k, side, a, c) * force
                    scene.work.torque[b, c] += direction(P, k, side, a, c + 3) * force


@jitable
def add_work_of_motions(scene: Scene, S: Stepping, t: float, h: float, y: F1, new: F1) -> int:
    """Write the work of motions at the end of a step from (t, y) to `new`; return 0 or a code.

    Bodies are placed as in `new` behind that.
    """
    middle, dy, nb = S.motion.middle, S.motion.impulse, len(scene.bodies.mass)
    for k in range(len(y)):
        middle[k] = 0.5 * (y[k] + new[k])
    for b in range(nb):
        same, size = 0.0, 0.0
        for c in range(BODY_SIZE * b + AT_Q, BODY_SIZE * b + AT_V):
            same += y[c] * new[c]
        for c in range(BODY_SIZE * b + AT_Q, BODY_SIZE * b + AT_V):
            # q and -q are the same attitude
            middle[c] = 0.5 * (y[c] + math.copysign(1.0, same) * new[c])
            size += middle[c] ** 2
        for c in range(BODY_SIZE * b + AT_Q, BODY_SIZE * b + AT_V):
            middle[c] /= math.sqrt(size)
    for k in range(BODY_SIZE * nb, len(dy)):
        dy[k] = 0.0
    place_bodies(scene, middle)
    add_gravity(scene)
    code = 0
    if scene.world.hooks[Hook.APPLIED] != 0:
        code = call_int(scene.world.hooks[Hook.APPLIED], (scene, t + 0.5 * h, middle, dy))
    push_by_points(scene, S, h)
    if code == 0 and not math.isfinite(accelerate(scene, middle, dy)):
        code = Code.NOT_FINITE
    if code == 0:
        joints = scene.world.hooks[Hook.JOINTS]
        code = call_int(joints, (scene, Joints.ACCELERATE, t + 0.5 * h, middle, dy))
    at = scene.world.accumulators[OF_MOTIONS]
    new[at] = y[at] + h * dy[at]
    place_bodies(scene, new)
    return code
