"""Forces between two markers: springs with dampers, scalar forces by expressions, limits.

With r = P_I - P_J, d = |r| and z the z-axis of J:

| kind        | on I                         | on J                    | x, x'                 |
|-------------|------------------------------|-------------------------|-----------------------|
| LINE_FORCE  | F r/d at I's origin          | the opposite at J's     | d, d'                 |
| AXIS_FORCE  | F z at I's origin            | nothing                 | -, v_I . z            |
| AXIS_TORQUE | torque F z                   | the opposite            | angle, (w_I - w_J) . z|
| SLIDE_LIMIT | F z at I's origin            | the opposite            | r . z, (v_I - v_J) . z|
| TURN_LIMIT  | torque F z                   | the opposite            | as AXIS_TORQUE        |

A spring has F = preload - k (x - length) - c x' and stores k (x - length)^2 / 2 - preload (x -
length); its damper loses c x'^2. What an expression's force does, F x', counts as lost,
with the sign turned, for nothing says what part of it could come back. Where the origins
coincide a line has no direction and its force is 0. A limit's F is what its normal law makes of
depth lower - x, or, turned round, x - upper. Friction in joints needs their reactions and comes
later (`forces.joint_friction`), and so do forces by expressions of reactions
(`forces.reaction_forces`); marker and vector forces are in `forces.wrenches`, dry friction in
`forces.dry_friction`.
"""

from __future__ import annotations

import math

from mbsim.arrays.codes import (
    AXIS_FORCE,
    AXIS_TORQUE,
    LINE_FORCE,
    LOST_POWER,
    MARKER_FORCE,
    RESIDUAL,
    SLIDE_LIMIT,
    STORED_ENERGY,
    TURN_LIMIT,
    VECTOR_FORCE,
)
from mbsim.arrays.scene import Scene
from mbsim.core.address import call_int
from mbsim.core.arrays import F1, V3
from mbsim.core.codes import Code
from mbsim.core.jitable import jitable
from mbsim.core.rotation import cross, dot, norm, scale, sub, vector
from mbsim.dynamics.bodies.angles import followed_angle
from mbsim.dynamics.bodies.markers import marker_arm, marker_axis, marker_point, marker_velocity
from mbsim.dynamics.expressions.jets import value
from mbsim.dynamics.forces.dry_friction import add_dry, is_dry
from mbsim.dynamics.forces.wrenches import wrench
from mbsim.laws.abi import ELASTIC, ENERGY, LOAD


@jitable
def push(scene: Scene, m: int, force: V3, torque: V3) -> None:
    """Add a force at the origin of marker m, and a torque, to those of its body about the cg."""
    work, b = scene.work, scene.markers.body[m]
    moment = cross(marker_arm(scene, m), force)
    for k in range(3):
        work.force[b, k] += force[k]
        work.torque[b, k] += moment[k] + torque[k]


@jitable
def along_line(scene: Scene, y: F1, f: int) -> tuple[V3, float, float]:
    """Return direction on I, distance and its rate."""
    i, j = scene.applied.i[f], scene.applied.j[f]
    r = sub(marker_point(scene, y, i), marker_point(scene, y, j))
    d = norm(r)
    if d == 0.0:
        return (0.0, 0.0, 0.0), 0.0, 0.0
    n = scale(1.0 / d, r)
    return n, d, dot(n, sub(marker_velocity(scene, i), marker_velocity(scene, j)))


@jitable
def along_axis(scene: Scene, f: int) -> tuple[V3, float, float]:
    """Return J's z-axis, the angle if a row of `Angles` follows it (else 0), and its rate."""
    i, j, row = scene.applied.i[f], scene.applied.j[f], scene.applied.angle[f]
    w, z = scene.work.w, marker_axis(scene, j, 2)
    spin = sub(vector(w[scene.markers.body[i]]), vector(w[scene.markers.body[j]]))
    return z, followed_angle(scene, row) if row >= 0 else 0.0, dot(z, spin)


@jitable
def along_slide(scene: Scene, y: F1, f: int) -> tuple[V3, float, float]:
    """Return J's z-axis, how far I is along it, and its rate."""
    i, j = scene.applied.i[f], scene.applied.j[f]
    z = marker_axis(scene, j, 2)
    r = sub(marker_point(scene, y, i), marker_point(scene, y, j))
    return z, dot(z, r), dot(z, sub(marker_velocity(scene, i), marker_velocity(scene, j)))


@jitable
def at_limit(scene: Scene, f: int, x: float, rate: float) -> V3:
    """Return F, stored energy and lost power of limit f at displacement x."""
    applied, out = scene.applied, scene.work.law_out
    lower, upper = applied.bounds[f, 0], applied.bounds[f, 1]
    side, depth, closing = 1.0, lower - x, -rate
    if x - upper > depth:
        side, depth, closing = -1.0, x - upper, rate
    # a displacement that is no number is passed on
    if depth <= 0.0:
        return 0.0, 0.0, 0.0
    if call_int(applied.law[f], (depth, closing, applied.law_par[f], out)) != 0:
        return math.nan, 0.0, 0.0
    return side * out[LOAD], out[ENERGY], (out[LOAD] - out[ELASTIC]) * closing


@jitable
def strength(scene: Scene, t: float, y: F1, f: int, x: float, rate: float) -> V3:
    """Return F, stored energy and lost power of applied force f at displacement x."""
    par, program = scene.applied.par[f], scene.applied.program[f]
    kind = scene.applied.kind[f]
    if kind == SLIDE_LIMIT or kind == TURN_LIMIT:
        return at_limit(scene, f, x, rate)
    if program >= 0:
        size = value(scene, t, y, program)
        return size, 0.0, -size * rate
    stretch = x - par[2]
    spring = par[3] - par[0] * stretch
    stored = stretch * (0.5 * par[0] * stretch - par[3])
    return spring - par[1] * rate, stored, par[1] * rate * rate


@jitable
def add_applied(scene: Scene, t: float, y: F1, dy: F1) -> int:  # noqa: C901
    """Add every applied force to its bodies and what it dissipates to y'; return 0.

    Many branches because kinds differ in their line or axis; how they push is one for all.
    """
    applied, work, lost = scene.applied, scene.work, 0.0
    none = (0.0, 0.0, 0.0)
    for f in range(len(applied.kind)):
        i, j, kind = applied.i[f], applied.j[f], applied.kind[f]
        if applied.with_reactions[f] == 1:
            for k in range(len(work.applied[f])):
                work.applied[f, k] = 0.0
            continue
        if kind == VECTOR_FORCE or kind == MARKER_FORCE or kind == RESIDUAL:
            code = wrench(scene, t, y, f)
            if code != 0:
                return code
            lost += work.applied[f, LOST_POWER]
            continue
        if is_dry(kind):
            lost += add_dry(scene, y, f)
            if not math.isfinite(dot(vector(work.applied[f]), vector(work.applied[f]))):
                return Code.NOT_FINITE
            continue
        if kind == LINE_FORCE:
            n, x, rate = along_line(scene, y, f)
        elif kind == AXIS_FORCE:
            n, x = marker_axis(scene, j, 2), 0.0
            rate = dot(n, marker_velocity(scene, i))
        elif kind == SLIDE_LIMIT:
            n, x, rate = along_slide(scene, y, f)
        else:
            n, x, rate = along_axis(scene, f)
        if kind == AXIS_TORQUE and applied.alone[f] == 1:
            rate = dot(n, vector(work.w[scene.markers.body[i]]))
        size, stored, power = strength(scene, t, y, f, x, rate)
        load = scale(size, n)
        turns = kind == AXIS_TORQUE or kind == TURN_LIMIT
        force, torque = (none, load) if turns else (load, none)
        push(scene, i, force, torque)
        if applied.alone[f] == 0:
            push(scene, j, scale(-1.0, force), scale(-1.0, torque))
        for k in range(3):
            work.applied[f, k] = force[k]
            work.applied[f, 3 + k] = torque[k]
        work.applied[f, STORED_ENERGY] = stored
        work.applied[f, LOST_POWER] = power
        lost += power
        if not math.isfinite(size):
            return Code.NOT_FINITE
    if scene.world.accumulators[1] >= 0:
        dy[scene.world.accumulators[1]] = lost
    return 0
