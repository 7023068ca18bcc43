"""Terms of constraint equations: residual, rate, what velocities give of its rate, gradient."""

from __future__ import annotations

import math

from mbsim.arrays.codes import HELD_AXIS, HELD_NORMAL, HELD_POINT, NORMAL_RATE, POINT_RATE
from mbsim.arrays.scene import Scene
from mbsim.core.arrays import F1, V2, V3
from mbsim.core.jitable import jitable
from mbsim.core.rotation import add, cross, dot, scale, sub, vector
from mbsim.dynamics.bodies.angles import followed_angle
from mbsim.dynamics.bodies.kinematics import position
from mbsim.dynamics.bodies.markers import (
    marker_arm,
    marker_axis,
    marker_point,
    marker_quaternion,
    marker_velocity,
)
from mbsim.dynamics.constraints.tree import origin, put
from mbsim.dynamics.expressions.jets import gradient


@jitable
def add_side(scene: Scene, y: F1, G: F1, m: int, at: V3, force: V3, torque: V3) -> None:
    """Write force at a point and torque, on the body of marker m, as a wrench about its O."""
    b = scene.markers.body[m]
    k = scene.tree.of_body[b]
    if k < 0:
        for i in range(6):
            G[i] = 0.0
        return
    put(G, add(torque, cross(sub(at, origin(scene, y, k)), force)), force)


@jitable
def centripetal(scene: Scene, m: int) -> V3:
    """Return the acceleration of marker m that the turning of its body alone causes."""
    w = vector(scene.work.w[scene.markers.body[m]])
    return cross(w, cross(w, marker_arm(scene, m)))


@jitable
def along_term(scene: Scene, y: F1, i: int, j: int, e: V3, G: F1) -> V3:
    """Return value, rate and second rate of e . (P_I - P_J), e fixed to J; fill its gradient."""
    at = marker_point(scene, y, i)
    d = sub(at, marker_point(scene, y, j))
    v = sub(marker_velocity(scene, i), marker_velocity(scene, j))
    w = vector(scene.work.w[scene.markers.body[j]])
    turned = cross(w, e)
    zero = (0.0, 0.0, 0.0)
    add_side(scene, y, G[0:6], i, at, e, zero)
    add_side(scene, y, G[6:12], j, at, scale(-1.0, e), zero)
    a = sub(centripetal(scene, i), centripetal(scene, j))
    second = dot(e, a) + 2.0 * dot(turned, v) + dot(cross(w, turned), d)
    return dot(e, d), dot(e, v) + dot(turned, d), second


@jitable
def offset_term(scene: Scene, y: F1, i: int, j: int, axis: int, G: F1) -> V3:
    """Return value, rate and second rate of e_J . (P_I - P_J), and fill its gradient."""
    return along_term(scene, y, i, j, marker_axis(scene, j, axis), G)


@jitable
def fill_turn(scene: Scene, y: F1, i: int, j: int, torque: V3, G: F1) -> None:
    """Fill the gradient of a term that only turns: opposite torques on the two bodies."""
    zero = (0.0, 0.0, 0.0)
    add_side(scene, y, G[0:6], i, zero, zero, torque)
    add_side(scene, y, G[6:12], j, zero, zero, scale(-1.0, torque))


@jitable
def cosine(
    scene: Scene, i: int, axis_i: int, j: int, axis_j: int
) -> tuple[float, float, float, V3]:
    """Return value, rate, second rate and torque of a_I . b_J."""
    a, b = marker_axis(scene, i, axis_i), marker_axis(scene, j, axis_j)
    w_i, w_j = (
        vector(scene.work.w[scene.markers.body[i]]),
        vector(scene.work.w[scene.markers.body[j]]),
    )
    da, db = cross(w_i, a), cross(w_j, b)
    second = dot(cross(w_i, da), b) + 2.0 * dot(da, db) + dot(a, cross(w_j, db))
    return dot(a, b), dot(da, b) + dot(a, db), second, cross(a, b)


@jitable
def perp_term(scene: Scene, y: F1, i: int, j: int, axis_i: int, axis_j: int, G: F1) -> V3:
    """Return value, rate and second rate of a_I . b_J, and fill its gradient."""
    value, rate, second, torque = cosine(scene, i, axis_i, j, axis_j)
    fill_turn(scene, y, i, j, torque, G)
    return value, rate, second


@jitable
def angle_term(scene: Scene, y: F1, i: int, j: int, slot: int, G: F1) -> V3:
    """Return value, rate and second rate of the angle about z, and fill its gradient.

    With c, s the cosines of x_I against x_J and y_J, n = c^2 + s^2: the rate is
    (c s' - s c')/n.
    """
    c, dc, ddc, about_c = cosine(scene, i, 0, j, 0)
    s, ds, dds, about_s = cosine(scene, i, 0, j, 1)
    n = c * c + s * s
    rate = (c * ds - s * dc) / n
    second = (c * dds - s * ddc) / n - rate * 2.0 * (c * dc + s * ds) / n
    fill_turn(scene, y, i, j, sub(scale(c / n, about_s), scale(s / n, about_c)), G)
    return followed_angle(scene, slot), rate, second


@jitable
def twist_term(scene: Scene, y: F1, i: int, j: int, G: F1) -> V3:
    """Return value, rate and second rate of 2 z of the quaternion from J to I; fill its gradient.

    With q = (w, x, y, z), W = w_I - w_J and J's axes e: q' = (0, W) q/2 in these axes, so that
    2 z' = n . W, n = w e_z + y e_x - x e_y, |n|^2 = 1 - z^2, and where no body is accelerated
    2 z'' = -z W^2/2 - n . (w_J x w_I).
    """
    a, b = marker_quaternion(scene, y, j), marker_quaternion(scene, y, i)
    # conj(a) b
    w = a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3]
    qx = a[0] * b[1] - a[1] * b[0] - a[2] * b[3] + a[3] * b[2]
    qy = a[0] * b[2] + a[1] * b[3] - a[2] * b[0] - a[3] * b[1]
    qz = a[0] * b[3] - a[1] * b[2] + a[2] * b[1] - a[3] * b[0]
    e_x, e_y = marker_axis(scene, j, 0), marker_axis(scene, j, 1)
    n = add(scale(w, marker_axis(scene, j, 2)), sub(scale(qy, e_x), scale(qx, e_y)))
    w_i = vector(scene.work.w[scene.markers.body[i]])
    w_j = vector(scene.work.w[scene.markers.body[j]])
    turning = sub(w_i, w_j)
    fill_turn(scene, y, i, j, n, G)
    second = -0.5 * qz * dot(turning, turning) - dot(n, cross(w_j, w_i))
    return 2.0 * qz, dot(n, turning), second


@jitable
def distance_term(scene: Scene, y: F1, i: int, j: int, G: F1) -> V3:
    """Return value, rate and second rate of the distance of I and J, and fill its gradient."""
    at_i, at_j = marker_point(scene, y, i), marker_point(scene, y, j)
    d = sub(at_i, at_j)
    length = math.sqrt(dot(d, d))
    e = scale(1.0 / length, d) if length > 0.0 else (0.0, 0.0, 1.0)
    v = sub(marker_velocity(scene, i), marker_velocity(scene, j))
    zero = (0.0, 0.0, 0.0)
    add_side(scene, y, G[0:6], i, at_i, e, zero)
    add_side(scene, y, G[6:12], j, at_j, scale(-1.0, e), zero)
    along = dot(e, v)
    second = dot(e, sub(centripetal(scene, i), centripetal(scene, j)))
    if length > 0.0:
        second += (dot(v, v) - along * along) / length
    return length, along, second


@jitable
def touching_term(scene: Scene, y: F1, i: int, j: int, axis: int, s: int, G: F1) -> V2:
    """Return rate and second rate of slip along x or y of slot s, and fill its gradient.

    With p where the surfaces touch, t the axis and n the normal, which all go with the contact:

        slip = t . v,  v = v_I + w_I x (p - x_I) - v_J - w_J x (p - x_J)
        its second rate by velocities = t' . v + t . (w_I x (p' - v_I) - w_J x (p' - v_J)),

    and where nothing slips t' . v = -(t . n') (n . v). `stiction.rigid_contact` places the slot.
    """
    row = scene.work.sticking_point[s]
    p, n, t = vector(row[HELD_POINT:]), vector(row[HELD_NORMAL:]), vector(row[HELD_AXIS:])
    if axis == 1:
        t = cross(n, t)
    dp, dn = vector(row[POINT_RATE:]), vector(row[NORMAL_RATE:])
    bi, bj = scene.markers.body[i], scene.markers.body[j]
    wi, wj = vector(scene.work.w[bi]), vector(scene.work.w[bj])
    vi, vj = vector(scene.work.v[bi]), vector(scene.work.v[bj])
    at_i = add(vi, cross(wi, sub(p, position(scene, y, bi))))
    v = sub(at_i, add(vj, cross(wj, sub(p, position(scene, y, bj)))))
    zero = (0.0, 0.0, 0.0)
    add_side(scene, y, G[0:6], i, p, t, zero)
    add_side(scene, y, G[6:12], j, p, scale(-1.0, t), zero)
    turning = sub(cross(wi, sub(dp, vi)), cross(wj, sub(dp, vj)))
    return dot(t, v), dot(t, turning) - dot(t, dn) * dot(n, v)


@jitable
def general_term(
    scene: Scene, t: float, y: F1, i: int, program: int, factor: float, G: F1
) -> float:
    """Fill `factor` times the gradient of a program with respect to the body of marker i.

    Returns it times the velocity of that body. A factor of 0 only names the body: what the program
    gives depends on it, and no force acts along that.
    """
    for k in range(12):
        G[k] = 0.0
    if factor == 0.0:
        return 0.0
    b = scene.markers.body[i]
    out = scene.sweep.jet
    gradient(scene, t, y, program, b, out)
    force, torque = scale(factor, vector(out)), scale(factor, vector(out[3:]))
    add_side(scene, y, G[0:6], i, position(scene, y, b), force, torque)
    return dot(force, vector(scene.work.v[b])) + dot(torque, vector(scene.work.w[b]))
