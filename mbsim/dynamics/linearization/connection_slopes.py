"""How bushings and friction in joints change with displacements and velocities: more of K and D.

Apart from `stiffness`, so that only scenes that have them compile them. The reactions that press
friction are taken as they are.
"""

from __future__ import annotations

from mbsim.arrays.scene import BALL_FRICTION, BUSHING, SCREW_FRICTION, SLIDE_FRICTION
from mbsim.core.jitable import jitable
from mbsim.core.rotation import add, cross, dot, scale, sub, vector
from mbsim.dynamics.bodies.kinematics import position
from mbsim.dynamics.bodies.markers import marker_arm, marker_axis, marker_point, marker_velocity
from mbsim.dynamics.contact.forces import velocity_at
from mbsim.dynamics.expressions.measures import unit
from mbsim.dynamics.forces.joint_friction import FORCE, RADIUS, SPEED, ask_law
from mbsim.dynamics.forces.wrenches import rotation_vector, turned_back, turning_torque
from mbsim.dynamics.linearization.stiffness import (
    add_axis_rate,
    add_geometry,
    add_one_sided,
    add_rate_by_pose,
    add_two_sided,
    lever,
    sides_of,
)

#: Differences of angles [rad], and of slip as parts of it and of the model's speed.
_PUSH, _PART, _PART_OF_SPEED = 1e-7, 1e-6, 1e-8


@jitable
def turning_rise(theta, k, way, out):
    """Fill how a bushing's spring torque changes as I turns about J's axis `way` [per rad].

    d theta = J(theta)^-1 e, which is J^-T of -theta; the torque is asked at neighbouring theta.
    """
    back = scale(-1.0, theta)
    d = turned_back(back, unit(way))
    up = turning_torque(add(theta, scale(_PUSH, d)), k)
    low = turning_torque(sub(theta, scale(_PUSH, d)), k)
    for i in range(3):
        out[i] = (up[i] - low[i]) / (2.0 * _PUSH)


@jitable
def add_bushing_rate(scene, T, y, f, e, factor, u):
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
def add_bushing_spin(scene, T, f, e, factor, u):
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
def add_bushing_slopes(scene, T, y, f):
    """Add a bushing: stiffness and damping along and about J's axes."""
    P, L, nb, par = T.pattern, T.linear, len(scene.bodies.mass), scene.applied.par[f]
    i, j = scene.applied.i[f], scene.applied.j[f]
    bi, bj = sides_of(scene, f)
    none, p = (0.0, 0.0, 0.0), marker_point(scene, y, i)
    for side in range(2):
        for k in range(6):
            e = marker_axis(scene, j, k % 3)
            force, torque = (e, none) if k < 3 else (none, e)
            lever(scene, L, y, bi if side == 0 else bj, p, force, torque, L.basis[side, k])
    theta = rotation_vector(scene, i, j)
    for k in range(6):
        e, u = marker_axis(scene, j, k % 3), L.basis[:, k]
        add_two_sided(P, L.D, nb, bi, bj, -par[6 + k], u, u)
        if k < 3:
            add_two_sided(P, L.K, nb, bi, bj, -par[k], u, u)
            add_bushing_rate(scene, T, y, f, e, -par[6 + k], u)
            continue
        add_bushing_spin(scene, T, f, e, -par[6 + k], u)
        turning_rise(theta, (par[3], par[4], par[5]), k - 3, L.rates)
        for row in range(3):
            rise = -L.rates[row]
            add_two_sided(P, L.K, nb, bi, bj, rise, L.basis[:, 3 + row], u)
    add_geometry(scene, T, y, f, j, 0)


@jitable
def rub_slopes(scene, t, f):
    """Return slip speed s, dF/ds and F/s of friction f in a joint, its normal force as it is."""
    row = scene.work.rub[f]
    s, kept = row[SPEED], _PART * row[SPEED] + _PART_OF_SPEED * scene.world.scale[1]
    low, high = max(s - kept, 0.0), s + kept
    row[SPEED] = low
    before = ask_law(scene, t, f)
    row[SPEED] = high
    by_speed = (ask_law(scene, t, f) - before) / (high - low)
    row[SPEED] = s
    return s, by_speed, row[FORCE] / s if s > 0.0 else by_speed


@jitable
def add_rub_slopes(scene, T, t, y, f):
    """Add friction in a joint: dF/ds along the slip s, F/s across it.

    Of slip and wrenches there are one (slide or turn), two (screw) or three (ball) components.
    """
    P, L, nb, kind = T.pattern, T.linear, len(scene.bodies.mass), scene.applied.kind[f]
    i, j, ball = scene.applied.i[f], scene.applied.j[f], kind == BALL_FRICTION
    bi, bj = sides_of(scene, f)
    radius, z = scene.applied.par[f, RADIUS], marker_axis(scene, j, 2)
    w = sub(vector(scene.work.w[bi]), vector(scene.work.w[bj]))
    v = sub(marker_velocity(scene, i), marker_velocity(scene, j))
    s, along, over = rub_slopes(scene, t, f)
    none, count = (0.0, 0.0, 0.0), 3 if ball else 2
    slip = L.rates
    for k in range(count):
        e = unit(k) if ball else z
        # of slide and turn, the slide is the second
        slides = not ball and k == 1
        used = ball or kind == SCREW_FRICTION or slides == (kind == SLIDE_FRICTION)
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
def add_connection_slopes(scene, T, t, y):
    """Add what bushings and friction in joints do."""
    for f in range(len(scene.applied.kind)):
        kind = scene.applied.kind[f]
        if kind == BUSHING:
            add_bushing_slopes(scene, T, y, f)
        elif SLIDE_FRICTION <= kind <= BALL_FRICTION and scene.applied.law[f] != 0:
            add_rub_slopes(scene, T, t, y, f)
