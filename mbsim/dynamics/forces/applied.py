"""Forces between two markers: scalar ones along a line, along an axis or about it.

With r = P_I - P_J, d = |r| and z the z-axis of `Applied.axes`, which is on J's body:

| form            | on I                    | on J              | x, x'                      |
|-----------------|-------------------------|-------------------|----------------------------|
| LINE_FORCE      | F r/d at I's origin     | opposite at J's   | d, d'                      |
| AXIS_FORCE      | F z at I's origin       | opposite at J's   | r . z, (v_I - v_J) . z     |
| AXIS_FORCE_AT_I | F z at I's origin       | opposite there    | the same, both v there     |
| AXIS_TORQUE     | torque F z              | the opposite      | angle, (w_I - w_J) . z     |

F is what the formula of the kind makes of x and x' (`forces.catalog`), or an expression, whose
work F x' counts as lost, with the sign turned, for nothing says what part of it could come back.
Where a force acts on I alone x' is I's own. Where the origins coincide a line has no direction and
its force is 0. Friction in joints needs their reactions and comes later (`forces.joint_friction`),
and so do forces by expressions of reactions (`forces.reaction_forces`); wrenches and vector forces
are in `forces.wrenches`, those of several markers in `forces.multi_point`.
"""

from __future__ import annotations

import math

from mbsim.arrays.codes import (
    AXIS_FORCE_AT_I,
    AXIS_TORQUE,
    EVENT_ELEMENT,
    EVENT_KIND,
    EVENT_SLOT,
    EVENT_TIME,
    LINE_FORCE,
    LOST_POWER,
    MULTI_POINT,
    OF_DAMPERS,
    RESIDUAL,
    SLIDER,
    SLIDER_BEFORE,
    SLIDES,
    SLIDES_BEFORE,
    SLIP,
    STICK,
    STORED_ENERGY,
    USED_EVENTS,
    VECTOR_FORCE,
    WITHIN,
    WRENCH,
)
from mbsim.arrays.hooks import Dry
from mbsim.arrays.scene import Scene
from mbsim.core.address import call_int
from mbsim.core.arrays import F1, V3
from mbsim.core.codes import Code
from mbsim.core.jitable import jitable
from mbsim.core.rotation import cross, dot, norm, scale, sub, vector
from mbsim.dynamics.bodies.angles import followed_angle
from mbsim.dynamics.bodies.markers import marker_arm, marker_axis, marker_point, marker_velocity
from mbsim.dynamics.expressions.jets import value
from mbsim.dynamics.forces.wrenches import apply, velocity_at, wrench
from mbsim.forces.formula import Asked


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
def about_axis(scene: Scene, f: int) -> tuple[V3, float, float]:
    """Return the axis, the angle if a row of `Angles` follows it (else 0), and its rate."""
    applied, w = scene.applied, scene.work.w
    row, z = applied.angle[f], marker_axis(scene, applied.axes[f], 2)
    spin = vector(w[scene.markers.body[applied.i[f]]])
    if applied.alone[f] == 0:
        spin = sub(spin, vector(w[scene.markers.body[applied.j[f]]]))
    return z, followed_angle(scene, row) if row >= 0 else 0.0, dot(z, spin)


@jitable
def along_axis(scene: Scene, y: F1, f: int) -> tuple[V3, float, float]:
    """Return the axis, how far I is along it, and its rate."""
    applied, markers = scene.applied, scene.markers
    i, j = applied.i[f], applied.j[f]
    z, p = marker_axis(scene, applied.axes[f], 2), marker_point(scene, y, i)
    if applied.alone[f] == 1:
        v = marker_velocity(scene, i)
    elif applied.form[f] == AXIS_FORCE_AT_I:
        at_i = velocity_at(scene, y, markers.body[i], p)
        v = sub(at_i, velocity_at(scene, y, markers.body[j], p))
    else:
        v = sub(marker_velocity(scene, i), marker_velocity(scene, j))
    return z, dot(z, sub(p, marker_point(scene, y, j))), dot(z, v)


@jitable
def displacement(scene: Scene, y: F1, f: int) -> tuple[V3, float, float]:
    """Return direction, x and x' of scalar force f; the bodies have been placed."""
    form = scene.applied.form[f]
    if form == LINE_FORCE:
        return along_line(scene, y, f)
    if form == AXIS_TORQUE:
        return about_axis(scene, f)
    return along_axis(scene, y, f)


@jitable
def ask_formula(
    scene: Scene, f: int, what: int, x: float, rate: float, slider: float, mode: float
) -> int:
    """Fill `Work.wrench` with what the formula of scalar force f says; return 0."""
    applied, work = scene.applied, scene.work
    kept = work.motion
    kept[0], kept[1], kept[2] = slider, mode, scene.state.frozen[0]
    law, law_par = applied.law[f], applied.law_par[f]
    return call_int(
        applied.formula[f],
        (what, x, rate, applied.par[f], kept, law, law_par, work.law_out, work.wrench),
    )


@jitable
def by_formula(scene: Scene, f: int, x: float, rate: float) -> int:
    """Fill `Work.wrench` with F, stored energy, lost power and slopes at a point; return 0."""
    kept = scene.state.dry[f]
    if scene.world.past[0] == WITHIN:
        slider, mode = kept[SLIDER_BEFORE], kept[SLIDES_BEFORE]
    else:
        slider, mode = kept[SLIDER], kept[SLIDES]
    return ask_formula(scene, f, Asked.FORCE, x, rate, slider, mode)


@jitable
def side_of(scene: Scene, y: F1, f: int) -> float:
    """Return on which side of its switches force f is; the bodies have been placed."""
    kept = scene.state.dry[f]
    _, x, rate = displacement(scene, y, f)
    ask_formula(scene, f, Asked.SIDE, x, rate, kept[SLIDER], kept[SLIDES])
    return scene.work.wrench[0]


@jitable
def strength(scene: Scene, t: float, y: F1, f: int, x: float, rate: float) -> V3:
    """Return F, stored energy and lost power of scalar force f at displacement x."""
    program, out = scene.applied.program[f], scene.work.wrench
    if program >= 0:
        size = value(scene, t, y, program)
        return size, 0.0, -size * rate
    by_formula(scene, f, x, rate)
    return out[0], out[1], out[2]


@jitable
def add_scalar(scene: Scene, t: float, y: F1, f: int) -> int:
    """Add scalar force f to its bodies and fill its row of `Work.applied`; return 0 or a code."""
    applied, row, none = scene.applied, scene.work.applied[f], (0.0, 0.0, 0.0)
    form = applied.form[f]
    n, x, rate = displacement(scene, y, f)
    size, stored, lost = strength(scene, t, y, f, x, rate)
    load = scale(size, n)
    force, torque = (none, load) if form == AXIS_TORQUE else (load, none)
    if form == AXIS_FORCE_AT_I:
        return apply(scene, y, f, force, torque, stored, lost)
    push(scene, applied.i[f], force, torque)
    if applied.alone[f] == 0:
        push(scene, applied.j[f], scale(-1.0, force), scale(-1.0, torque))
    for k in range(3):
        row[k] = force[k]
        row[3 + k] = torque[k]
    row[STORED_ENERGY] = stored
    row[LOST_POWER] = lost
    return 0 if math.isfinite(size) else Code.NOT_FINITE


@jitable
def add_applied(scene: Scene, t: float, y: F1, dy: F1) -> int:
    """Add every applied force to its bodies and what it dissipates to y'; return 0."""
    applied, work, lost = scene.applied, scene.work, 0.0
    for f in range(len(applied.form)):
        form = applied.form[f]
        if applied.with_reactions[f] == 1:
            for k in range(len(work.applied[f])):
                work.applied[f, k] = 0.0
            continue
        if form == VECTOR_FORCE or form == WRENCH or form == RESIDUAL or form == MULTI_POINT:
            code = wrench(scene, t, y, f)
        else:
            code = add_scalar(scene, t, y, f)
        if code != 0:
            return code
        lost += work.applied[f, LOST_POWER]
    if scene.world.accumulators[OF_DAMPERS] >= 0:
        dy[scene.world.accumulators[OF_DAMPERS]] = lost
    return 0


@jitable
def record_mode(scene: Scene, t: float, kind: int, f: int) -> None:
    """Append an event of force f that slides or sticks; it has no slot."""
    rows = scene.rows
    k = rows.used[USED_EVENTS]
    if k < len(rows.events):
        rows.events[k, EVENT_TIME], rows.events[k, EVENT_KIND] = t, kind
        rows.events[k, EVENT_ELEMENT], rows.events[k, EVENT_SLOT] = scene.applied.id[f], -1.0
        rows.used[USED_EVENTS] = k + 1


@jitable
def serve_kept(scene: Scene, what: int, t: float, y: F1) -> int:
    """Do what forces that remember are asked for (`Dry`) where none is rigid; return 0."""
    return commit_kept(scene, t, y) if what == Dry.KEEP else 0


@jitable
def commit_kept(scene: Scene, t: float, y: F1) -> int:
    """Keep what forces that remember make of the point evaluated last; return 0.

    What they lose at once is lost by the model. Those that equations hold have a memory of another
    kind (`stiction.rigid_friction`).
    """
    for f in range(len(scene.applied.form)):
        if scene.applied.keeps[f] == 0 or scene.applied.equation[f] >= 0:
            continue
        kept, new = scene.state.dry[f], scene.work.wrench
        before = kept[SLIDES]
        _, x, rate = displacement(scene, y, f)
        ask_formula(scene, f, Asked.COMMIT, x, rate, kept[SLIDER], before)
        kept[SLIDER_BEFORE], kept[SLIDES_BEFORE] = kept[SLIDER], before
        kept[SLIDER], kept[SLIDES] = new[0], new[1]
        if scene.world.accumulators[OF_DAMPERS] >= 0:
            y[scene.world.accumulators[OF_DAMPERS]] += new[2]
        if kept[SLIDES] != before:
            record_mode(scene, t, STICK if kept[SLIDES] == 0.0 else SLIP, f)
    return 0
