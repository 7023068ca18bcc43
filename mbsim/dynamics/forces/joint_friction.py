"""Friction in joints: pressed by reactions, which it changes in turn.

With z the axis of J, v_z and w_z slide and spin of I against J, w all of the relative spin, F and
T the reaction on I, r the radius of pin or ball:

| form           | slip                 | pressed by                       |
|----------------|----------------------|----------------------------------|
| SLIDE_FRICTION | v_z z                | abs(F across z)                  |
| TURN_FRICTION  | r w_z, about z       | abs(F across z)                  |
| SCREW_FRICTION | both: (r w_z, v_z)   | abs(F across z)                  |
| BALL_FRICTION  | r w                  | abs(F)                           |

and beside by the preload and, each where its arm is given, abs(T across z)/arm, of TURN_FRICTION
abs(F along z) friction_arm/r, of SLIDE_FRICTION abs(T along z)/reaction_arm. The law's force f < 0
along the slip, of speed s, is a wrench on I, and its opposite on J; together they do f s.

With f all friction forces and g(f) what the law makes of the reactions under them, f = g(f) is
sought from f = 0 by f <- f + k (g(f) - f); k follows B. M. Irons, R. C. Tuck, Int. J. Numer.
Methods Eng. 1 (1969) 275-277, and is the secant's where there is one friction. Where friction and
reaction raise each other without end there is no such f: the joint jams.
"""

from __future__ import annotations

import math

from mbsim.arrays.codes import (
    APPLIED_FORCE,
    AT_FAULT,
    BALL_FRICTION,
    FRICTION_CALLS,
    LOST_POWER,
    OF_DAMPERS,
    SLIDE_FRICTION,
    TURN_FRICTION,
    WRENCH_FORCE,
    WRENCH_TORQUE,
)
from mbsim.arrays.scene import Scene
from mbsim.core.address import call_int
from mbsim.core.arrays import F1, V3
from mbsim.core.codes import Code
from mbsim.core.jitable import jitable
from mbsim.core.rotation import cross, dot, norm, scale, sub, vector
from mbsim.dynamics.bodies.markers import marker_axis, marker_velocity
from mbsim.dynamics.constraints.equations import restick
from mbsim.dynamics.constraints.in_use import active_count
from mbsim.dynamics.constraints.reactions import fill_stresses, sum_reactions, take_stresses
from mbsim.dynamics.forces.applied import push
from mbsim.laws.abi import FORCE_X_OUT, NFORCE_IN, TIME_IN, XDOT_IN

# columns of `Work.joint_friction`: wrench on I of a unit force (force 3, torque 3), then
SPEED, FORCE, MISS = 6, 7, 8
# entries of `Applied.par`
RADIUS, PRELOAD, ARM, AXIAL_ARM, TWIST_ARM = range(5)


#: Friction has settled when it changes by less than this part of the largest.
SETTLED = 1e-13
#: What is good enough after all rounds, where reactions are small sums of large forces.
GOOD_ENOUGH = 1e-9
MOST_ROUNDS = 60


@jitable
def fill_slip(scene: Scene, f: int) -> None:
    """Fill the wrench of a unit force along the slip of friction f, and its speed."""
    applied, row = scene.applied, scene.work.joint_friction[f]
    i, j, form, radius = applied.i[f], applied.j[f], applied.form[f], applied.par[f, RADIUS]
    w = scene.work.w
    spin = sub(vector(w[scene.markers.body[i]]), vector(w[scene.markers.body[j]]))
    slide = (0.0, 0.0, 0.0)
    if form != BALL_FRICTION:
        z = marker_axis(scene, j, 2)
        spin = scale(dot(spin, z) if form != SLIDE_FRICTION else 0.0, z)
        if form != TURN_FRICTION:
            v = sub(marker_velocity(scene, i), marker_velocity(scene, j))
            slide = scale(dot(v, z), z)
    speed = math.hypot(norm(slide), radius * norm(spin))
    row[SPEED] = speed
    row[FORCE] = row[MISS] = 0.0
    for k in range(3):
        # power of the wrench: slide^2/speed + (radius spin)^2/speed = speed
        row[k] = slide[k] / speed if speed > 0.0 else 0.0
        row[3 + k] = radius * radius * spin[k] / speed if speed > 0.0 else 0.0


@jitable
def across(a: V3, z: V3) -> float:
    """Return how much of a is across the unit vector z."""
    return norm(cross(z, a))


@jitable
def press(scene: Scene, f: int) -> float:
    """Return the normal force [F] of friction f under the reactions as they are filled."""
    applied, reaction = scene.applied, scene.work.reaction
    at = 6 * applied.connection[f]
    force = (reaction[at], reaction[at + 1], reaction[at + 2])
    preload, arm = applied.par[f, PRELOAD], applied.par[f, ARM]
    if applied.form[f] == BALL_FRICTION:
        return norm(force) + preload
    z = marker_axis(scene, applied.j[f], 2)
    torque = (reaction[at + 3], reaction[at + 4], reaction[at + 5])
    beside, par = preload, applied.par[f]
    if arm > 0.0:
        beside += across(torque, z) / arm
    if par[AXIAL_ARM] > 0.0:
        beside += abs(dot(force, z)) * par[AXIAL_ARM] / par[RADIUS]
    if par[TWIST_ARM] > 0.0:
        beside += abs(dot(torque, z)) / par[TWIST_ARM]
    return across(force, z) + beside


@jitable
def ask_law(scene: Scene, t: float, f: int) -> float:
    """Return the force along the slip that the law of friction f makes of the reactions."""
    applied, given, out = scene.applied, scene.work.law_in, scene.work.law_out
    if applied.law[f] == 0:
        return 0.0
    for k in range(len(given)):
        given[k] = 0.0
    given[TIME_IN] = t
    given[XDOT_IN] = scene.work.joint_friction[f, SPEED]
    given[NFORCE_IN] = press(scene, f)
    scene.log.counters[FRICTION_CALLS] += 1
    if call_int(applied.law[f], (applied.id[f], given, applied.law_par[f], out)) != 0:
        return math.nan
    return out[FORCE_X_OUT]


@jitable
def add_force(scene: Scene, f: int, size: float) -> None:
    """Add a force along the slip to what friction f does to both bodies."""
    applied, row = scene.applied, scene.work.joint_friction[f]
    row[FORCE] += size
    force = scale(size, vector(row[WRENCH_FORCE:]))
    torque = scale(size, vector(row[WRENCH_TORQUE:]))
    push(scene, applied.i[f], force, torque)
    push(scene, applied.j[f], scale(-1.0, force), scale(-1.0, torque))


@jitable
def compare(scene: Scene, t: float) -> tuple[float, float, int, float]:
    """Fill by how much each friction misses its law.

    Returns the largest miss (no number if a force is none), the largest force, the row that
    misses most, and the factor by which the last step was too short, 1 if that is not known.
    """
    applied, joint_friction = scene.applied, scene.work.joint_friction
    worst, largest, row, along, change = 0.0, 0.0, 0, 0.0, 0.0
    for f in range(len(applied.form)):
        if applied.connection[f] < 0:
            continue
        force = ask_law(scene, t, f)
        if not math.isfinite(force):
            return force, largest, f, 1.0
        miss = force - joint_friction[f, FORCE]
        along -= joint_friction[f, MISS] * (miss - joint_friction[f, MISS])
        change += (miss - joint_friction[f, MISS]) ** 2
        joint_friction[f, MISS] = miss
        largest = max(largest, abs(force))
        if abs(miss) > worst:
            worst, row = abs(miss), f
    return worst, largest, row, along / change if change > 0.0 and along != 0.0 else 1.0


@jitable
def settle_friction(scene: Scene, t: float, y: F1, stresses: int) -> int:
    """Find the friction forces and the accelerations under them; return 0 or a code."""
    applied, joint_friction, step = scene.applied, scene.work.joint_friction, 1.0
    for k in range(MOST_ROUNDS):
        sum_reactions(scene, y)
        take_stresses(scene, stresses)
        worst, largest, row, factor = compare(scene, t)
        scene.work.diagnostics[AT_FAULT] = row
        if not math.isfinite(worst):
            # this tells which it is, and no contact is at fault
            scene.work.applied[row, APPLIED_FORCE] = worst
            scene.work.diagnostics[AT_FAULT] = -1
            return Code.NOT_FINITE
        enough = SETTLED if k < MOST_ROUNDS - 1 else GOOD_ENOUGH
        if worst <= enough * largest:
            scene.work.diagnostics[AT_FAULT] = -1
            return 0
        step *= factor
        for f in range(len(applied.form)):
            if applied.connection[f] >= 0:
                add_force(scene, f, step * joint_friction[f, MISS])
        restick(scene, t)
    return Code.JAMMED


@jitable
def add_friction(scene: Scene, t: float, y: F1, dy: F1) -> int:
    """Add friction to the accelerations and what it dissipates to y'; return 0 or a code."""
    applied, work, lost = scene.applied, scene.work, 0.0
    for f in range(len(applied.form)):
        if applied.connection[f] >= 0:
            fill_slip(scene, f)
    stresses = 0
    if active_count(scene) < len(scene.equations.program):
        stresses = fill_stresses(scene, t, y)
        restick(scene, t)
    code = settle_friction(scene, t, y, stresses)
    if code != 0:
        return code
    for f in range(len(applied.form)):
        if applied.connection[f] < 0:
            continue
        force = work.joint_friction[f, FORCE]
        for k in range(6):
            work.applied[f, k] = force * work.joint_friction[f, k]
        work.applied[f, LOST_POWER] = -force * work.joint_friction[f, SPEED]
        lost += work.applied[f, LOST_POWER]
    dy[scene.world.accumulators[OF_DAMPERS]] += lost
    return 0
