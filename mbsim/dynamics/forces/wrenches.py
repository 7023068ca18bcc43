"""Wrenches and vector forces: force and torque at I's origin, the opposite there on J's body.

What a wrench is stands in `forces.catalog`. A vector force has no potential: its work counts
as lost, with the sign turned.
"""

from __future__ import annotations

import math
from typing import Any

from mbsim.arrays.codes import LOST_POWER, STORED_ENERGY, WRENCH
from mbsim.arrays.hooks import Hook
from mbsim.arrays.scene import Scene
from mbsim.core.address import call_int
from mbsim.core.arrays import F1, V3
from mbsim.core.codes import Code
from mbsim.core.jitable import compiled_form, jitable
from mbsim.core.rotation import add, cross, dot, norm, scale, sub, vector
from mbsim.dynamics.bodies.kinematics import position
from mbsim.dynamics.bodies.markers import marker_axis, marker_point
from mbsim.dynamics.expressions.jets import value


def wrench(scene: Scene, t: float, y: F1, f: int) -> int:
    """Add the wrench of row f to its bodies and fill its row of `Work.applied`; return 0."""
    return add_wrench(scene, t, y, f)


@compiled_form(wrench)
def _wrench(scene: Any, t: Any, y: Any, f: Any) -> Any:
    """Give compiled code its form of `wrench`: a call of the hook."""

    def compiled(scene: Any, t: Any, y: Any, f: Any) -> Any:
        return call_int(scene.world.hooks[Hook.WRENCH], (scene, t, y, f))

    return compiled


@jitable
def along(scene: Scene, m: int, a: V3) -> V3:
    """Return a global vector's components along the axes of marker m."""
    return (
        dot(marker_axis(scene, m, 0), a),
        dot(marker_axis(scene, m, 1), a),
        dot(marker_axis(scene, m, 2), a),
    )


@jitable
def combined(scene: Scene, m: int, a: V3) -> V3:
    """Return the global vector that has components a along the axes of marker m."""
    x, y = scale(a[0], marker_axis(scene, m, 0)), scale(a[1], marker_axis(scene, m, 1))
    return add(add(x, y), scale(a[2], marker_axis(scene, m, 2)))


@jitable
def rotation_vector(scene: Scene, i: int, j: int) -> V3:
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
def velocity_at(scene: Scene, y: F1, b: int, p: V3) -> V3:
    """Return the velocity of the point of body b that is at p."""
    w = vector(scene.work.w[b])
    return add(vector(scene.work.v[b]), cross(w, sub(p, position(scene, y, b))))


@jitable
def push_at(scene: Scene, y: F1, b: int, p: V3, force: V3, torque: V3) -> None:
    """Add a force at point p, and a torque, to those of body b about its cg."""
    work = scene.work
    moment = cross(sub(p, position(scene, y, b)), force)
    for k in range(3):
        work.force[b, k] += force[k]
        work.torque[b, k] += moment[k] + torque[k]


@jitable
def component_value(scene: Scene, t: float, y: F1, f: int, k: int) -> float:
    """Return component k of a vector force, 0 where it has no expression."""
    program = scene.applied.components[f, k]
    return value(scene, t, y, program) if program >= 0 else 0.0


@jitable
def vector_wrench(scene: Scene, t: float, y: F1, f: int) -> tuple[V3, V3]:
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
def add_vector_force(scene: Scene, t: float, y: F1, f: int) -> int:
    """Add a vector force to its bodies and fill its row of `Work.applied`; return 0."""
    applied = scene.applied
    i, alone = applied.i[f], applied.alone[f] == 1
    p, b = marker_point(scene, y, i), scene.markers.body[i]
    other = len(scene.bodies.mass) if alone else scene.markers.body[applied.j[f]]
    v = sub(velocity_at(scene, y, b, p), velocity_at(scene, y, other, p))
    w = sub(vector(scene.work.w[b]), vector(scene.work.w[other]))
    force, torque = vector_wrench(scene, t, y, f)
    return apply(scene, y, f, force, torque, 0.0, -dot(force, v) - dot(torque, w))


@jitable
def fill_motion(scene: Scene, y: F1, f: int) -> None:
    """Fill `Work.motion` with how I of marker force f stands and moves as seen from J."""
    i, j, motion = scene.applied.i[f], scene.applied.j[f], scene.work.motion
    p, b, other = marker_point(scene, y, i), scene.markers.body[i], scene.markers.body[j]
    d = along(scene, j, sub(p, marker_point(scene, y, j)))
    theta = rotation_vector(scene, i, j)
    v = along(scene, j, sub(velocity_at(scene, y, b, p), velocity_at(scene, y, other, p)))
    w = along(scene, j, sub(vector(scene.work.w[b]), vector(scene.work.w[other])))
    for k in range(3):
        motion[k] = d[k]
        motion[3 + k] = theta[k]
        motion[6 + k] = v[k]
        motion[9 + k] = w[k]


@jitable
def add_marker_force(scene: Scene, y: F1, f: int) -> int:
    """Add a force of a kind of `forces.catalog`, as `add_vector_force`; return 0 or a code."""
    applied, out = scene.applied, scene.work.wrench
    fill_motion(scene, y, f)
    code = call_int(applied.formula[f], (scene.work.motion, applied.par[f], out))
    if code != 0:
        return code
    j = applied.j[f]
    force = combined(scene, j, (out[0], out[1], out[2]))
    torque = combined(scene, j, (out[3], out[4], out[5]))
    return apply(scene, y, f, force, torque, out[6], out[7])


@jitable
def apply(scene: Scene, y: F1, f: int, force: V3, torque: V3, stored: float, lost: float) -> int:
    """Add force and torque on I at I's origin, the opposite on J's body; return 0 or a code."""
    applied, row = scene.applied, scene.work.applied[f]
    i = applied.i[f]
    p = marker_point(scene, y, i)
    push_at(scene, y, scene.markers.body[i], p, force, torque)
    if applied.alone[f] == 0:
        other = scene.markers.body[applied.j[f]]
        push_at(scene, y, other, p, scale(-1.0, force), scale(-1.0, torque))
    for k in range(3):
        row[k] = force[k]
        row[3 + k] = torque[k]
    row[STORED_ENERGY] = stored
    row[LOST_POWER] = lost
    return 0 if math.isfinite(dot(force, force) + dot(torque, torque)) else Code.NOT_FINITE


@jitable
def add_wrench(scene: Scene, t: float, y: F1, f: int) -> int:
    """Add a vector force or a marker force; return 0 or a code."""
    if scene.applied.form[f] == WRENCH:
        return add_marker_force(scene, y, f)
    return add_vector_force(scene, t, y, f)
