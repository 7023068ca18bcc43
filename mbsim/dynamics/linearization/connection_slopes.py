"""How marker forces and friction in joints change with displacements and velocities: more of K, D.

Apart from `applied_slopes`, so that only scenes that have them compile them. A marker force's own
slopes are by what I does as seen from J, along J's axes (`forces.catalog`); that these axes turn is
added here. The reactions that press friction are taken as they are.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from mbsim.arrays.codes import BALL_FRICTION, SCALE_SPEED, SCREW_FRICTION, SLIDE_FRICTION, WRENCH
from mbsim.arrays.scene import Scene
from mbsim.core.address import call_int
from mbsim.core.arrays import F1, F2, F3, V3
from mbsim.core.jitable import jitable
from mbsim.core.rotation import cross, dot, scale, sub, vector
from mbsim.dynamics.bodies.kinematics import position
from mbsim.dynamics.bodies.markers import marker_arm, marker_axis, marker_point, marker_velocity
from mbsim.dynamics.contact.forces import velocity_at
from mbsim.dynamics.expressions.measures import unit
from mbsim.dynamics.forces.joint_friction import FORCE, RADIUS, SPEED, ask_law
from mbsim.dynamics.forces.wrenches import fill_motion
from mbsim.dynamics.linearization.stiffness import (
    PART,
    PART_OF_SPEED,
    add_axis_rate,
    add_geometry,
    add_one_sided,
    add_rate_by_pose,
    add_two_sided,
    lever,
    sides_of,
)

if TYPE_CHECKING:
    from mbsim.compile_model.tangent import Pattern, Tangent


@jitable
def add_marker_rate(scene: Scene, T: Tangent, y: F1, f: int, e: V3, factor: float, u: F2) -> None:
    """Add how the rate along J's axis e, at I's origin p, changes with poses.

    theta_I . (arm x (e x w_I)) + theta_J . (e x v) - h . (dp - dx_J), h = e x w_J, x_J J's cg.
    """
    P, L, nb = T.pattern, T.linear, len(scene.bodies.mass)
    i, work = scene.applied.i[f], scene.work
    both = sides_of(scene, f)
    bi, bj = both
    p, none = marker_point(scene, y, i), (0.0, 0.0, 0.0)
    v = sub(velocity_at(scene, y, bi, p), velocity_at(scene, y, bj, p))
    h = cross(e, vector(work.w[bj]))
    if bi < nb:
        lever(scene, L, y, bi, p, scale(-1.0, h), none, L.rise)
        turned = cross(marker_arm(scene, i), cross(e, vector(work.w[bi])))
        for k in range(3):
            L.rise[k] += turned[k]
        add_one_sided(P, L, nb, both, bi, factor, u)
    if bj < nb:
        lever(scene, L, y, bj, position(scene, y, bj), h, cross(e, v), L.rise)
        add_one_sided(P, L, nb, both, bj, factor, u)


@jitable
def add_marker_spin(scene: Scene, T: Tangent, f: int, e: V3, factor: float, u: F2) -> None:
    """Add how the spin about J's axis e changes as that turns: theta_J . (e x w)."""
    bi, bj = sides_of(scene, f)
    turned = cross(e, sub(vector(scene.work.w[bi]), vector(scene.work.w[bj])))
    for k in range(3):
        T.linear.rise[k] = turned[k]
        T.linear.rise[3 + k] = 0.0
    if bj < len(scene.bodies.mass):
        both = (bi, bj)
        add_one_sided(T.pattern, T.linear, len(scene.bodies.mass), both, bj, factor, u)


@jitable
def fill_units(scene: Scene, T: Tangent, y: F1, f: int) -> None:
    """Fill `basis` with the wrenches of unit forces along J's axes and unit torques about them."""
    i, j = scene.applied.i[f], scene.applied.j[f]
    bi, bj = sides_of(scene, f)
    none, p = (0.0, 0.0, 0.0), marker_point(scene, y, i)
    for side in range(2):
        for k in range(6):
            e = marker_axis(scene, j, k % 3)
            force, torque = (e, none) if k < 3 else (none, e)
            row = T.linear.basis[side, k]
            lever(scene, T.linear, y, bi if side == 0 else bj, p, force, torque, row)


@jitable
def add_column(
    P: Pattern, blocks: F3, nb: int, both: tuple[int, int], slopes: F2, k: int, basis: F3
) -> None:
    """Add column k of the slopes by one component of displacement or velocity."""
    for r in range(6):
        if slopes[r, k] != 0.0:
            u, v = basis[:, r], basis[:, k]
            add_two_sided(P, blocks, nb, both[0], both[1], -slopes[r, k], u, v)


@jitable
def add_marker_force_slopes(scene: Scene, T: Tangent, y: F1, f: int) -> None:
    """Add a marker force."""
    P, L, nb, applied = T.pattern, T.linear, len(scene.bodies.mass), scene.applied
    j, both, table = applied.j[f], sides_of(scene, f), scene.work.slopes
    fill_motion(scene, y, f)
    call_int(applied.slopes[f], (scene.work.motion, applied.par[f], table))
    fill_units(scene, T, y, f)
    K, D = table[:6], table[6:]
    for k in range(6):
        e = marker_axis(scene, j, k % 3)
        add_column(P, L.D, nb, both, D, k, L.basis)
        if k < 3:
            add_column(P, L.K, nb, both, K, k, L.basis)
        for r in range(6):
            if D[r, k] == 0.0:
                continue
            if k < 3:
                add_marker_rate(scene, T, y, f, e, -D[r, k], L.basis[:, r])
            else:
                add_marker_spin(scene, T, f, e, -D[r, k], L.basis[:, r])
        if k >= 3:
            add_column(P, L.K, nb, both, K, k, L.basis)
    add_geometry(scene, T, y, f, j, 0)


@jitable
def add_marker_forces_slopes(scene: Scene, T: Tangent, y: F1) -> None:
    """Add all of them."""
    for f in range(len(scene.applied.form)):
        if scene.applied.form[f] == WRENCH:
            add_marker_force_slopes(scene, T, y, f)


@jitable
def joint_friction_slopes(scene: Scene, t: float, f: int) -> V3:
    """Return slip speed s, dF/ds and F/s of friction f in a joint, its normal force as it is."""
    row = scene.work.joint_friction[f]
    s, kept = row[SPEED], PART * row[SPEED] + PART_OF_SPEED * scene.world.scale[SCALE_SPEED]
    low, high = max(s - kept, 0.0), s + kept
    row[SPEED] = low
    before = ask_law(scene, t, f)
    row[SPEED] = high
    by_speed = (ask_law(scene, t, f) - before) / (high - low)
    row[SPEED] = s
    return s, by_speed, row[FORCE] / s if s > 0.0 else by_speed


@jitable
def add_joint_friction_slopes(scene: Scene, T: Tangent, t: float, y: F1, f: int) -> None:
    """Add friction in a joint: dF/ds along the slip s, F/s across it.

    Of slip and wrenches there are one (slide or turn), two (screw) or three (ball) components.
    """
    P, L, nb, form = T.pattern, T.linear, len(scene.bodies.mass), scene.applied.form[f]
    i, j, ball = scene.applied.i[f], scene.applied.j[f], form == BALL_FRICTION
    bi, bj = sides_of(scene, f)
    radius, z = scene.applied.par[f, RADIUS], marker_axis(scene, j, 2)
    w = sub(vector(scene.work.w[bi]), vector(scene.work.w[bj]))
    v = sub(marker_velocity(scene, i), marker_velocity(scene, j))
    s, along, over = joint_friction_slopes(scene, t, f)
    none, count = (0.0, 0.0, 0.0), 3 if ball else 2
    slip = L.rates
    for k in range(count):
        e = unit(k) if ball else z
        # of slide and turn, the slide is the second
        slides = not ball and k == 1
        used = ball or form == SCREW_FRICTION or slides == (form == SLIDE_FRICTION)
        size = (1.0 if slides else radius) if used else 0.0
        slip[k] = size * dot(v if slides else w, e)
        wrench = scale(size, e)
        force, torque = (wrench, none) if slides else (none, wrench)
        lever(scene, L, y, bi, marker_point(scene, y, i), force, torque, L.basis[0, k])
        lever(scene, L, y, bj, marker_point(scene, y, j), force, torque, L.basis[1, k])
    for a in range(count):
        for b in range(count):
            part = over if a == b else 0.0
            if s > 0.0:
                part += (along - over) * slip[a] * slip[b] / (s * s)
            u = L.basis[:, a]
            add_two_sided(P, L.D, nb, bi, bj, part, u, L.basis[:, b])
            if ball:
                continue
            if b == 1:
                add_rate_by_pose(scene, T, f, u, part, z)
                add_axis_rate(scene, T, f, part, z, u, False)
            else:
                add_axis_rate(scene, T, f, part * radius, z, u, True)
    add_geometry(scene, T, y, f, -1 if ball else j, 1)


@jitable
def add_joint_frictions_slopes(scene: Scene, T: Tangent, t: float, y: F1) -> None:
    """Add what friction in joints does."""
    for f in range(len(scene.applied.form)):
        if scene.applied.connection[f] >= 0 and scene.applied.law[f] != 0:
            add_joint_friction_slopes(scene, T, t, y, f)
