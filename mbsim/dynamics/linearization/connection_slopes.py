"""How marker forces and friction in joints change with displacements and velocities: more of K, D.

So are forces of several markers, each of which changes with bodies that it does not act on.

Apart from `applied_slopes`, so that only scenes that have them compile them. A marker force's own
slopes are by what I does as seen from J, along J's axes (`forces.catalog`); that these axes turn is
added here. The reactions that press friction are taken as they are.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from mbsim.arrays.codes import (
    BALL_FRICTION,
    MULTI_POINT,
    SCALE_SPEED,
    SCREW_FRICTION,
    SLIDE_FRICTION,
    WRENCH,
)
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
from mbsim.dynamics.forces.multi_point import (
    own_turning,
    place_of,
    points_of,
    row_of_point,
    stiffness_column,
    strip_at,
)
from mbsim.dynamics.forces.wrenches import fill_motion
from mbsim.dynamics.linearization.stiffness import (
    PART,
    PART_OF_SPEED,
    PUSH,
    add_axis_rate,
    add_geometry,
    add_one_sided,
    add_product,
    add_rate_by_pose,
    add_two_sided,
    lever,
    sides_of,
)
from mbsim.forces.matrix import column

if TYPE_CHECKING:
    from mbsim.compile_model.tangent import Pattern, Tangent

# row of `basis` behind those of the units of the marker that is pushed
_MOVED = 6


@jitable
def add_marker_rate(
    scene: Scene, T: Tangent, y: F1, f: int, g: int, e: V3, factor: float, u: F2
) -> None:
    """Add to force f how the rate of g along J's axis e, at I's origin p, changes with poses.

    theta_I . (arm x (e x w_I)) + theta_J . (e x v) - h . (dp - dx_J), h = e x w_J, x_J J's cg.
    """
    P, L, nb = T.pattern, T.linear, len(scene.bodies.mass)
    i, work = scene.applied.i[g], scene.work
    both, (bi, bj) = sides_of(scene, f), sides_of(scene, g)
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
def add_marker_spin(scene: Scene, T: Tangent, f: int, g: int, e: V3, factor: float, u: F2) -> None:
    """Add to force f how the spin of g about J's axis e turns with it: theta_J . (e x w)."""
    bi, bj = sides_of(scene, g)
    turned = cross(e, sub(vector(scene.work.w[bi]), vector(scene.work.w[bj])))
    for k in range(3):
        T.linear.rise[k] = turned[k]
        T.linear.rise[3 + k] = 0.0
    if bj < len(scene.bodies.mass):
        both = sides_of(scene, f)
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
                add_marker_rate(scene, T, y, f, f, e, -D[r, k], L.basis[:, r])
            else:
                add_marker_spin(scene, T, f, f, e, -D[r, k], L.basis[:, r])
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


@jitable
def add_pushed(
    P: Pattern, blocks: F3, pushed: tuple[int, int], moved: tuple[int, int], factor: float,
    u: F2, v: F2,
) -> None:  # fmt: skip
    """Add factor u v' of a force between two bodies by the displacement between two others."""
    nb = P.block.shape[0]
    for of in range(2):
        for by in range(2):
            a, b = pushed[of], moved[by]
            if a < nb and b < nb:
                size = factor if of == by else -factor
                add_product(blocks[P.block[a, b]], size, u[of], v[by])


@jitable
def add_point_slopes(scene: Scene, T: Tangent, y: F1, f: int, b: int) -> None:
    """Add how the force on the marker of row f changes by marker b; its units are filled."""
    P, L, j, n = T.pattern, T.linear, scene.applied.j[f], points_of(scene, f)
    g, own = row_of_point(scene, f, b), place_of(scene, f) == b
    pushed, moved, none = sides_of(scene, f), sides_of(scene, g), (0.0, 0.0, 0.0)
    p, damping = marker_point(scene, y, scene.applied.i[g]), strip_at(n, 2) + 6 * b
    for k in range(6):
        e = marker_axis(scene, j, k % 3)
        stiff = stiffness_column(scene, y, f, b, k)
        turned = own_turning(scene, y, f, k - 3, PUSH) if own and k >= 3 else none
        slow = column(scene.applied.par[f], damping + k, 6 * n)
        for side in range(2):
            v = L.basis[side, _MOVED]
            lever(scene, L, y, moved[side], p, e if k < 3 else none, none if k < 3 else e, v)
        for r in range(6):
            u, v = L.basis[:, r], L.basis[:, _MOVED]
            part = stiff[0][r] if r < 3 else stiff[1][r - 3] + turned[r - 3]
            if part != 0.0:
                add_pushed(P, L.K, pushed, moved, -part, u, v)
            part = slow[0][r] if r < 3 else slow[1][r - 3]
            if part != 0.0:
                add_pushed(P, L.D, pushed, moved, -part, u, v)
                if k < 3:
                    add_marker_rate(scene, T, y, f, g, e, -part, u)
                else:
                    add_marker_spin(scene, T, f, g, e, -part, u)


@jitable
def add_multi_point_slopes(scene: Scene, T: Tangent, y: F1) -> None:
    """Add all of them."""
    for f in range(len(scene.applied.form)):
        if scene.applied.form[f] != MULTI_POINT:
            continue
        fill_units(scene, T, y, f)
        for b in range(points_of(scene, f)):
            add_point_slopes(scene, T, y, f, b)
        add_geometry(scene, T, y, f, scene.applied.j[f], 0)
