"""The work of motions in a step in which contacts press on what they drive.

A motion's force holds what forces and contacts do to the bodies that it drives. That of forces
alone is known before the contact problem is solved; here those of impulses are added, in the midst
of the step, where joints hold.
"""

from __future__ import annotations

from mbsim.arrays.codes import OF_MOTIONS
from mbsim.arrays.hooks import Hook, Joints
from mbsim.arrays.scene import Scene
from mbsim.core.address import call_int
from mbsim.core.arrays import F1
from mbsim.core.jitable import jitable
from mbsim.dynamics.bodies.kinematics import place_bodies
from mbsim.dynamics.constraints.equations import power_of_equations
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
def load_impulses(scene: Scene, S: Stepping) -> None:
    """Fill `Motion.impulse` with the impulses of the step on bodies: force, torque about the cg."""
    P, impulse, ground = S.points, S.motion.impulse, S.plan.group.shape[0] - 1
    for k in range(6 * len(scene.bodies.mass)):
        impulse[k] = 0.0
    for k in range(S.tally.count[POINTS]):
        if P.r[k, 0] == 0.0:
            continue
        for side in range(2):
            b = P.body[k, side]
            if b == ground:
                continue
            for c in range(6):
                for a in range(3):
                    impulse[6 * b + c] += direction(P, k, side, a, c) * P.r[k, a]


@jitable
def add_work_of_motions(scene: Scene, S: Stepping, t: float, h: float, new: F1) -> int:
    """Add what motions do against contacts to their work at the end of a step; return 0 or a code.

    Bodies are placed as in `new` behind that.
    """
    joints, midst = scene.world.hooks[Hook.JOINTS], S.motion.midst
    load_impulses(scene, S)
    code = call_int(joints, (scene, Joints.READY, t + 0.5 * h, midst, midst))
    if code == 0:
        code = call_int(joints, (scene, Joints.IMPULSE, t + 0.5 * h, midst, S.motion.impulse))
    # rates are those of the midst: no impulse changes what a motion gives
    new[scene.world.accumulators[OF_MOTIONS]] += power_of_equations(scene)
    place_bodies(scene, new)
    return code
