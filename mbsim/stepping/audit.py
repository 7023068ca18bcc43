"""What a run with rigid contacts judges itself by, at every step that is taken.

* what the solver left: the change of a velocity that one more sweep would make, over what it may
  be by the tolerance;
* energy and momentum, as all runs (`pipeline.audit`): what a step explains of the balance is what
  it is known to leave open by the way it moves bodies on (`stepping.energy`);
* penetration at the step's begin;
* of steps as long as the deck says: how far impacts leave them off (`stepping.halves`);
* friction over mu N;
* residuals of constraints and their rates.
"""

from __future__ import annotations

import math

from mbsim.arrays.codes import (
    ANEW,
    AUDIT_EVERY,
    AUDIT_TOL,
    AUDIT_UNTIL,
    CONE,
    ERRORS_ALL,
    ERRORS_SINCE,
    LARGEST_ENERGY,
    LARGEST_FRICTION,
    PENETRATION,
    STEP_END,
    STEPS_ALL,
    STEPS_SINCE,
    TIME_THEN,
    UNSOLVED_IMPULSES,
    USUAL_ENERGY,
)
from mbsim.arrays.hooks import Hook, Joints, note_failure
from mbsim.arrays.scene import Scene
from mbsim.core.address import call_int
from mbsim.core.arrays import F1
from mbsim.core.jitable import jitable
from mbsim.dynamics.bodies.scales import fill_squares
from mbsim.dynamics.pipeline.audit import SPINS, examine_energy, examine_momentum, note
from mbsim.stepping.arrays import (
    END_OFF,
    FASTEST,
    FIXED,
    LEFT_OPEN,
    MAY_BE_LEFT,
    POINTS,
    RESIDUAL,
    SLEEPERS,
    STEP_LENGTH,
    Stepping,
)
from mbsim.stepping.forces import find_forces

#: Rounding of friction on its cone.
CONE_ROUNDING = 1e-12
#: Depth that steps explain, over the scene's length times tol.
EXPLAINED = 10.0


@jitable
def examine_points(scene: Scene, S: Stepping, t: float) -> None:
    """Note the largest depth, and the most that friction is beyond its cone."""
    P, tol, deepest = S.points, scene.audit.plan[AUDIT_TOL], S.tally.deepest
    for c in range(len(deepest)):
        if deepest[c] > 0.0:
            length = scene.scales.length[scene.scales.of_contact[c]]
            note(scene, PENETRATION, deepest[c], EXPLAINED * tol * length, t, c)
    for k in range(S.tally.count[POINTS]):
        c = P.contact[k]
        if P.r[k, 0] == 0.0 or P.mu[k] == 0.0:
            continue
        most = P.mu[k] * P.r[k, 0]
        row = scene.audit.contact[c]
        row[LARGEST_FRICTION] = max(row[LARGEST_FRICTION], most / S.tally.number[STEP_LENGTH])
        across = math.hypot(P.r[k, 1], P.r[k, 2])
        beyond = max(0.0, across / most - 1.0 - CONE_ROUNDING)
        note(scene, CONE, beyond, tol, t, c)


@jitable
def explained(scene: Scene, S: Stepping) -> float:
    """Return what the tolerance explains of a position, where the fastest contact of a step is."""
    length = scene.scales.length[scene.scales.of_contact[int(S.tally.number[FASTEST])]]
    return EXPLAINED * scene.audit.plan[AUDIT_TOL] * length


@jitable
def examine_step(scene: Scene, S: Stepping, t: float, h: float, y: F1) -> None:
    """Note what the step that ends at t leaves open."""
    tally, number = scene.audit.tally, S.tally.number
    if h == 0.0:
        tally[ANEW] = 1.0
        take_sample(scene, S, t, y)
        return
    tally[STEPS_ALL] += 1.0
    note(scene, UNSOLVED_IMPULSES, number[RESIDUAL], number[MAY_BE_LEFT], t, -1)
    examine_points(scene, S, t)
    if S.plan.number[FIXED] == 1.0 and len(scene.contacts.id) > 0:
        note(scene, STEP_END, number[END_OFF], explained(scene, S), t, int(number[FASTEST]))
    tally[STEPS_SINCE] += 1.0
    size = max(tally[LARGEST_ENERGY], tally[USUAL_ENERGY])
    if size > 0.0:
        local = number[LEFT_OPEN] / size
        tally[ERRORS_SINCE] += local
        tally[ERRORS_ALL] += local
    due = tally[STEPS_SINCE] >= scene.audit.plan[AUDIT_EVERY]
    if due or t + 1e-9 * h >= scene.audit.plan[AUDIT_UNTIL]:
        take_sample(scene, S, t, y)


@jitable
def mark_grounded(scene: Scene, S: Stepping) -> None:
    """Mark the groups that ground pressed on since the last sample, and begin anew."""
    for g in range(len(S.tally.grounded)):
        if S.tally.grounded[g] == 1 or (S.rest.count[SLEEPERS] > 0 and S.rest.grounded[g] == 1):
            scene.audit.sums[g, SPINS + 1] = 1.0
        S.tally.grounded[g] = 0


@jitable
def take_sample(scene: Scene, S: Stepping, t: float, y: F1) -> None:
    """Compare energy and momentum with what they were, and look at constraints."""
    tally = scene.audit.tally
    steps, local = tally[STEPS_SINCE], tally[ERRORS_SINCE]
    tally[STEPS_SINCE] = tally[ERRORS_SINCE] = 0.0
    if scene.world.hooks[Hook.APPLIED] != 0:
        # what springs store is that of the state
        note_failure(scene, find_forces(scene, t, y, S.motion.slope))
    fill_squares(scene, y)
    for g in range(len(scene.work.squares)):
        energy = scene.scales.mass[g] * scene.work.squares[g]
        tally[USUAL_ENERGY] = max(tally[USUAL_ENERGY], energy)
    examine_energy(scene, t, y, steps, local)
    examine_momentum(scene, t, y, steps, local)
    if tally[ANEW] == 0.0 and scene.world.hooks[Hook.JOINTS] != 0:
        joints = scene.world.hooks[Hook.JOINTS]
        note_failure(scene, call_int(joints, (scene, Joints.READY, t, y, y)))
        note_failure(scene, call_int(joints, (scene, Joints.AUDIT, t, y, y)))
    tally[TIME_THEN], tally[ANEW] = t, 0.0
