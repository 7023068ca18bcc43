"""The work of forces without a potential in a step in which an impact divides a body's way.

The rate of what dampers and pushes take is found with the velocity in the midst of the step, as
forces are. Across an impact that is next to nothing, while the body goes on as `displacements` has
it: up to the impact with one velocity, and from there on with another. What such a body's kinetic
energy and its contact's loss answer to is the work h F . u along its displacement h u. With the
velocity v_m that forces were found at, their rate is put right by

    h F . (v_m - u),    F = G + dP/dq

G being all forces on the bodies but their weight, and P the energy that forces store, whose slope
along v_m - u is a difference over a step's length.
"""

from __future__ import annotations

from mbsim.arrays.codes import OF_DAMPERS, STORED_ENERGY
from mbsim.arrays.hooks import Hook
from mbsim.arrays.scene import Scene
from mbsim.core.address import call_int
from mbsim.core.arrays import F1
from mbsim.core.jitable import jitable
from mbsim.core.layout import BODY_SIZE
from mbsim.core.rotation import unrotate
from mbsim.dynamics.bodies.awake import bodies_awake, body_awake
from mbsim.dynamics.bodies.configuration import turn
from mbsim.dynamics.bodies.kinematics import place_bodies
from mbsim.stepping.arrays import ASLEEP, THETA, Stepping
from mbsim.stepping.displacements import is_hit, shift_of


@jitable
def is_divided(scene: Scene, S: Stepping) -> bool:
    """Return whether an impact divides the way of a body, and forces take or give energy."""
    if scene.world.hooks[Hook.APPLIED] == 0 or scene.world.accumulators[OF_DAMPERS] < 0:
        return False
    for k in range(bodies_awake(scene)):
        if is_hit(S, body_awake(scene, k)):
            return True
    return False


@jitable
def aside_of(S: Stepping, b: int, c: int) -> float:
    """Return v_m - u of a body that an impact divides the way of; 0 of others."""
    M = S.motion
    if S.rest.body[b, ASLEEP] == 1 or not is_hit(S, b):
        return 0.0
    before = M.before[b, c]
    found_at = before + S.forces.number[THETA] * (M.guess[b, c] - before)
    return found_at - shift_of(S, b, c)


@jitable
def stored_aside(scene: Scene, S: Stepping, t: float, length: float) -> tuple[int, float]:
    """Return 0 or a code, and what forces store where bodies are moved aside for `length`."""
    M, aside, stored = S.motion, S.motion.aside, 0.0
    place_bodies(scene, M.middle)
    for k in range(len(aside)):
        aside[k] = M.middle[k]
    for k in range(bodies_awake(scene)):
        b = body_awake(scene, k)
        at = BODY_SIZE * b
        for c in range(3):
            aside[at + c] += length * aside_of(S, b, c)
        w = (aside_of(S, b, 3), aside_of(S, b, 4), aside_of(S, b, 5))
        w = unrotate(scene.work.R[b], w)
        turn(M.middle, at, length, w[0], w[1], w[2], aside)
    place_bodies(scene, aside)
    code = call_int(scene.world.hooks[Hook.APPLIED], (scene, t, aside, M.impulse))
    for f in range(len(scene.applied.form)):
        stored += scene.work.applied[f, STORED_ENERGY]
    return code, stored


@jitable
def add_work_across(scene: Scene, S: Stepping, t: float, h: float, new: F1) -> int:
    """Put right what forces took in a step from t in `new`; return 0 or a code.

    Forces on bodies are those of the step; they are lost by this.
    """
    part, done = S.forces.number[THETA] * h, 0.0
    for k in range(bodies_awake(scene)):
        b = body_awake(scene, k)
        for c in range(3):
            weight = scene.bodies.mass[b] * scene.world.gravity[c]
            done += (scene.work.force[b, c] - weight) * aside_of(S, b, c)
            done += scene.work.torque[b, c] * aside_of(S, b, c + 3)
    code, behind = stored_aside(scene, S, t + part, -0.5 * h)
    if code == 0:
        code, ahead = stored_aside(scene, S, t + part, 0.5 * h)
        if code == 0:
            new[scene.world.accumulators[OF_DAMPERS]] += h * done + ahead - behind
    return code
