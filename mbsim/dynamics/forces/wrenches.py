"""Bushings and vector forces: force and torque at I's origin, the opposite there on J's body.

With K, C, preload F0, T0 along and about J's axes, d = P_I - P_J seen from J, d' its rate there,
w the spin of I against J, and theta the rotation vector that takes J's axes to I's, all along
J's axes, a bushing exerts on I

    F = F0 - K d - C d'            T = T0 - J(theta)^-T K theta - C w

and stores d'K d/2 - F0.d + theta'K theta/2. As theta' = J(theta)^-1 w, the torque is the exact
gradient of that:

    J(theta)^-T K theta = K theta + theta x K theta/2 + c theta x (theta x K theta)
    c = (1 - a cot a) / phi^2,  a = phi/2,  phi = abs(theta)

(left Jacobian of SO(3): T. D. Barfoot, State Estimation for Robotics, 2017, section 7.1). For a
turn about one axis of J this is K times the angle, for small ones K times each angle, as if
angles were projected. At half a turn (phi = pi) theta changes its sign: a bushing holds for
less. A constant torque T0 has no potential: its work counts as lost, with the sign turned, as
does that of a vector force.
"""

from __future__ import annotations

import math
from typing import Any

from numba.extending import overload

from mbsim.arrays.hooks import Hook
from mbsim.arrays.scene import BUSHING, LOST_POWER, STORED_ENERGY
from mbsim.core.address import call_int
from mbsim.core.codes import Code
from mbsim.core.jitable import jitable
from mbsim.core.rotation import add, cross, dot, norm, scale, sub, vector
from mbsim.dynamics.bodies.kinematics import position
from mbsim.dynamics.bodies.markers import marker_axis, marker_point
from mbsim.dynamics.expressions.jets import value

# below this angle the series of c is exact to rounding: its next term is phi^4/30240
_SMALL = 1e-3


def wrench(scene, t, y, f):
    """Add the wrench of row f to its bodies and fill its row of `Work.applied`; return 0."""
    return add_wrench(scene, t, y, f)


@overload(wrench)
def _wrench(scene: Any, t: Any, y: Any, f: Any) -> Any:
    """Give compiled code its form of `wrench`: a call of the hook."""

    def compiled(scene: Any, t: Any, y: Any, f: Any) -> Any:
        return call_int(scene.world.hooks[Hook.WRENCH], (scene, t, y, f))

    return compiled


@jitable
def along(scene, m, a):
    """Return a global vector's components along the axes of marker m."""
    return (
        dot(marker_axis(scene, m, 0), a),
        dot(marker_axis(scene, m, 1), a),
        dot(marker_axis(scene, m, 2), a),
    )


@jitable
def combined(scene, m, a):
    """Return the global vector that has components a along the axes of marker m."""
    x, y = scale(a[0], marker_axis(scene, m, 0)), scale(a[1], marker_axis(scene, m, 1))
    return add(add(x, y), scale(a[2], marker_axis(scene, m, 2)))


@jitable
def rotation_vector(scene, i, j):
    """Return the vector along J's axes that turns them into I's; its length is at most pi.

    The quaternion of the rotation comes from the largest of its four products, as S. W. Shepperd,
    J. Guidance Control 1 (1978) 223-224.
    """
    x = along(scene, j, marker_axis(scene, i, 0))
    y = along(scene, j, marker_axis(scene, i, 1))
    z = along(scene, j, marker_axis(scene, i, 2))
    w, v = 1.0 + x[0] + y[1] + z[2], (y[2] - z[1], z[0] - x[2], x[1] - y[0])
    trace = w - 1.0
    if x[0] > trace and x[0] >= y[1] and x[0] >= z[2]:
        w, v = v[0], (1.0 + x[0] - y[1] - z[2], x[1] + y[0], x[2] + z[0])
    elif y[1] > trace and y[1] >= z[2]:
        w, v = v[1], (x[1] + y[0], 1.0 + y[1] - x[0] - z[2], y[2] + z[1])
    elif z[2] > trace:
        w, v = v[2], (x[2] + z[0], y[2] + z[1], 1.0 + z[2] - x[0] - y[1])
    if w < 0.0:
        w, v = -w, scale(-1.0, v)
    sine = norm(v)
    return scale(2.0 * math.atan2(sine, w) / sine if sine > 0.0 else 0.0, v)


@jitable
def turning_torque(theta, k):
    """Return J(theta)^-T k theta, `k` the three stiffnesses about J's axes."""
    return turned_back(theta, (k[0] * theta[0], k[1] * theta[1], k[2] * theta[2]))


@jitable
def turned_back(theta, a):
    """Return J(theta)^-T a."""
    square = dot(theta, theta)
    if square < _SMALL * _SMALL:
        c = 1.0 / 12.0 + square / 720.0
    else:
        half = 0.5 * math.sqrt(square)
        c = (1.0 - half / math.tan(half)) / square
    turned = cross(theta, a)
    return add(add(a, scale(0.5, turned)), scale(c, cross(theta, turned)))


@jitable
def velocity_at(scene, y, b, p):
    """Return the velocity of the point of body b that is at p."""
    w = vector(scene.work.w[b])
    return add(vector(scene.work.v[b]), cross(w, sub(p, position(scene, y, b))))


@jitable
def push_at(scene, y, b, p, force, torque):
    """Add a force at point p, and a torque, to those of body b about its cg."""
    work = scene.work
    moment = cross(sub(p, position(scene, y, b)), force)
    for k in range(3):
        work.force[b, k] += force[k]
        work.torque[b, k] += moment[k] + torque[k]


@jitable
def bushing_wrench(scene, y, f, v, w):
    """Return force and torque of a bushing on I, stored energy and lost power.

    `v` and `w` are velocity (at I's origin) and spin of I's body against J's, global axes.
    """
    i, j, par = scene.applied.i[f], scene.applied.j[f], scene.applied.par[f]
    d = along(scene, j, sub(marker_point(scene, y, i), marker_point(scene, y, j)))
    v, w = along(scene, j, v), along(scene, j, w)
    theta = rotation_vector(scene, i, j)
    spring = turning_torque(theta, (par[3], par[4], par[5]))
    force = (
        par[12] - par[0] * d[0] - par[6] * v[0],
        par[13] - par[1] * d[1] - par[7] * v[1],
        par[14] - par[2] * d[2] - par[8] * v[2],
    )
    torque = (
        par[15] - spring[0] - par[9] * w[0],
        par[16] - spring[1] - par[10] * w[1],
        par[17] - spring[2] - par[11] * w[2],
    )
    stored, lost = 0.0, 0.0
    for k in range(3):
        stored += d[k] * (0.5 * par[k] * d[k] - par[12 + k])
        stored += 0.5 * par[3 + k] * theta[k] * theta[k]
        lost += par[6 + k] * v[k] * v[k] + (par[9 + k] * w[k] - par[15 + k]) * w[k]
    return combined(scene, j, force), combined(scene, j, torque), stored, lost


@jitable
def component_value(scene, t, y, f, k):
    """Return component k of a vector force, 0 where it has no expression."""
    program = scene.applied.components[f, k]
    return value(scene, t, y, program) if program >= 0 else 0.0


@jitable
def vector_wrench(scene, t, y, f):
    """Return force and torque of a vector force on I."""
    force = (
        component_value(scene, t, y, f, 0),
        component_value(scene, t, y, f, 1),
        component_value(scene, t, y, f, 2),
    )
    torque = (
        component_value(scene, t, y, f, 3),
        component_value(scene, t, y, f, 4),
        component_value(scene, t, y, f, 5),
    )
    m = scene.applied.axes[f]
    return combined(scene, m, force), combined(scene, m, torque)


@jitable
def add_wrench(scene, t, y, f):
    """Add the wrench of row f to its bodies and fill its row of `Work.applied`; return 0."""
    applied, row = scene.applied, scene.work.applied[f]
    i, alone = applied.i[f], applied.alone[f] == 1
    p, b = marker_point(scene, y, i), scene.markers.body[i]
    other = len(scene.bodies.mass) if alone else scene.markers.body[applied.j[f]]
    v = sub(velocity_at(scene, y, b, p), velocity_at(scene, y, other, p))
    w = sub(vector(scene.work.w[b]), vector(scene.work.w[other]))
    if applied.kind[f] == BUSHING:
        force, torque, stored, lost = bushing_wrench(scene, y, f, v, w)
    else:
        force, torque = vector_wrench(scene, t, y, f)
        stored, lost = 0.0, -dot(force, v) - dot(torque, w)
    push_at(scene, y, b, p, force, torque)
    if not alone:
        push_at(scene, y, other, p, scale(-1.0, force), scale(-1.0, torque))
    for k in range(3):
        row[k] = force[k]
        row[3 + k] = torque[k]
    row[STORED_ENERGY] = stored
    row[LOST_POWER] = lost
    return 0 if math.isfinite(dot(force, force) + dot(torque, torque)) else Code.NOT_FINITE
