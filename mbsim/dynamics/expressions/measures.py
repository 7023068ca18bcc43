"""What expressions measure of markers: displacements as jets, velocities and forces as numbers.

Velocities for a jet come from `body`: all as they are (`AS_THEY_ARE`), none (`AT_REST`), or that
body alone by a unit twist number `direction` (velocity of the cg along global x, y, z, angular
velocity about them), which makes the first derivative a column of the Jacobian. Accelerations
are what follows from velocities: bodies' own are taken as zero. A vector's jet is a
3-tuple of vectors.
"""

from __future__ import annotations

from mbsim.arrays.codes import USED_ROWS, VECTOR_FORCE
from mbsim.arrays.scene import Scene
from mbsim.compile_model.instructions import DEEPEST
from mbsim.core.arrays import F1, V3
from mbsim.core.jitable import jitable
from mbsim.core.rotation import add, cross, dot, norm, scale, sub, vector
from mbsim.dynamics.bodies.angles import nearest_turn
from mbsim.dynamics.bodies.kinematics import position
from mbsim.dynamics.bodies.markers import marker_arm, marker_axis, marker_point, marker_velocity
from mbsim.dynamics.contact.forces import DEPTH, FORCE, TORQUE, contact_of, sides
from mbsim.expressions.elementary import arc_tangent2, constant, over, root, times
from mbsim.geometry.catalog import AT_POINT

AT_REST, AS_THEY_ARE = -2, -1


@jitable
def unit(direction: int) -> V3:
    """Return the unit vector 0, 1 or 2; the zero vector for other numbers."""
    return (
        1.0 if direction == 0 else 0.0,
        1.0 if direction == 1 else 0.0,
        1.0 if direction == 2 else 0.0,
    )


@jitable
def twist(scene: Scene, b: int, body: int, direction: int) -> tuple[V3, V3]:
    """Return velocity of the cg and angular velocity of body b."""
    if body == AS_THEY_ARE:
        return vector(scene.work.v[b]), vector(scene.work.w[b])
    if body == b:
        return unit(direction), unit(direction - 3)
    return (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)


@jitable
def point_jet(scene: Scene, y: F1, m: int, body: int, direction: int) -> tuple[V3, V3, V3]:
    """Return the origin of marker m, v + w x r, and w x (w x r)."""
    b = scene.markers.body[m]
    arm = marker_arm(scene, m)
    v, w = twist(scene, b, body, direction)
    turn = cross(w, arm)
    return add(position(scene, y, b), arm), add(v, turn), cross(w, turn)


@jitable
def axis_jet(scene: Scene, m: int, k: int, body: int, direction: int) -> tuple[V3, V3, V3]:
    """Return axis k of marker m, w x e, and w x (w x e)."""
    e = marker_axis(scene, m, k)
    w = twist(scene, scene.markers.body[m], body, direction)[1]
    turn = cross(w, e)
    return e, turn, cross(w, turn)


@jitable
def between(scene: Scene, y: F1, i: int, j: int, body: int, direction: int) -> tuple[V3, V3, V3]:
    """Return the jet of P_i - P_j."""
    p, q = point_jet(scene, y, i, body, direction), point_jet(scene, y, j, body, direction)
    return sub(p[0], q[0]), sub(p[1], q[1]), sub(p[2], q[2])


@jitable
def dot_jet(a: tuple[V3, V3, V3], b: tuple[V3, V3, V3]) -> V3:
    """Return the jet of a . b."""
    return (
        dot(a[0], b[0]),
        dot(a[1], b[0]) + dot(a[0], b[1]),
        dot(a[2], b[0]) + 2.0 * dot(a[1], b[1]) + dot(a[0], b[2]),
    )


@jitable
def distance(scene: Scene, y: F1, i: int, j: int, body: int, direction: int) -> V3:
    """Return DM: d = |r|, d' = r.r'/d, d'' = (r'.r' + r.r'' - d'^2)/d; 0 where d is 0."""
    r = between(scene, y, i, j, body, direction)
    return root(dot_jet(r, r))


@jitable
def offset(scene: Scene, y: F1, i: int, j: int, k: int, axis: int, body: int, direction: int) -> V3:
    """Return (P_i - P_j) along an axis of k."""
    return dot_jet(
        between(scene, y, i, j, body, direction), axis_jet(scene, k, axis, body, direction)
    )


@jitable
def included_angle(scene: Scene, y: F1, i: int, j: int, k: int, body: int, direction: int) -> V3:
    """Return INCANG: the angle between P_i - P_j and P_k - P_j, atan2(|a x b|, a . b)."""
    a = between(scene, y, i, j, body, direction)
    b = between(scene, y, k, j, body, direction)
    twice = scale(2.0, cross(a[1], b[1]))
    turn = (
        cross(a[0], b[0]),
        add(cross(a[1], b[0]), cross(a[0], b[1])),
        add(add(cross(a[2], b[0]), twice), cross(a[0], b[2])),
    )
    return arc_tangent2(root(dot_jet(turn, turn)), dot_jet(a, b))


@jitable
def cosine(scene: Scene, i: int, axis_i: int, j: int, axis_j: int, body: int, direction: int) -> V3:
    """Return the cosine between an axis of i and one of j."""
    return dot_jet(
        axis_jet(scene, i, axis_i, body, direction), axis_jet(scene, j, axis_j, body, direction)
    )


@jitable
def angle(scene: Scene, row: int, body: int, direction: int) -> V3:
    """Return a followed angle: of I's x about J's z from J's x."""
    i, j = scene.angles.i[row], scene.angles.j[row]
    s = cosine(scene, i, 0, j, 1, body, direction)
    a = arc_tangent2(s, cosine(scene, i, 0, j, 0, body, direction))
    return (nearest_turn(a[0], scene.state.angle[row]), a[1], a[2])


@jitable
def euler_angle(scene: Scene, i: int, j: int, which: int, body: int, direction: int) -> V3:
    """Return PSI, THETA, PHI or YAW, PITCH, ROLL of i in j.

    The turns Rz(psi) Rx(theta) Rz(phi), and Rz(yaw) Ry(pitch) Rx(roll), are R_j' R_i. Where the
    first and the last are about one line, PSI has all and PHI is 0.
    """
    if which < 3:
        a = cosine(scene, i, 2, j, 0, body, direction)
        b = scale(-1.0, cosine(scene, i, 2, j, 1, body, direction))
        flat = a[0] * a[0] + b[0] * b[0] < 1e-24
        if which == 1:
            side = root(add(times(a, a), times(b, b)))
            return arc_tangent2(side, cosine(scene, i, 2, j, 2, body, direction))
        if which == 2:
            if flat:
                return constant(0.0)
            a, b = (
                cosine(scene, i, 0, j, 2, body, direction),
                cosine(scene, i, 1, j, 2, body, direction),
            )
        elif flat:
            a, b = (
                cosine(scene, i, 0, j, 1, body, direction),
                cosine(scene, i, 0, j, 0, body, direction),
            )
        return arc_tangent2(a, b)
    if which == 5:
        a, b = (
            cosine(scene, i, 1, j, 2, body, direction),
            cosine(scene, i, 2, j, 2, body, direction),
        )
        return arc_tangent2(a, b)
    a, b = cosine(scene, i, 0, j, 1, body, direction), cosine(scene, i, 0, j, 0, body, direction)
    if which == 3:
        return arc_tangent2(a, b)
    down = scale(-1.0, cosine(scene, i, 0, j, 2, body, direction))
    return arc_tangent2(down, root(add(times(a, a), times(b, b))))


@jitable
def parameter_product(
    scene: Scene, i: int, j: int, a: int, b: int, body: int, direction: int
) -> V3:
    """Return 4 e_a e_b of the Euler parameters of i in j, from the cosines m_rc of its axes.

    4 e0^2 = 1 + trace, 4 e1^2 = 1 + 2 m00 - trace, 4 e0 e1 = m21 - m12, 4 e1 e2 = m01 + m10, and
    so on in turn.
    """
    if a > b:
        a, b = b, a
    if a != b and a > 0:
        return add(
            cosine(scene, i, a - 1, j, b - 1, body, direction),
            cosine(scene, i, b - 1, j, a - 1, body, direction),
        )
    if a != b:
        r, c = (b + 1) % 3, b % 3
        return sub(
            cosine(scene, i, c, j, r, body, direction), cosine(scene, i, r, j, c, body, direction)
        )
    total = constant(1.0)
    for k in range(3):
        sign = 1.0 if a == 0 or a == k + 1 else -1.0
        total = add(total, scale(sign, cosine(scene, i, k, j, k, body, direction)))
    return total


@jitable
def euler_parameter(scene: Scene, i: int, j: int, which: int, body: int, direction: int) -> V3:
    """Return Euler parameter e0, e1, e2 or e3 of i in j, e0 being at least 0."""
    largest, most = 0, -1.0
    for k in range(4):
        square = parameter_product(scene, i, j, k, k, AT_REST, 0)[0]
        if square > most:
            largest, most = k, square
    # e_n = e_k e_n / e_k with the largest e_k
    e = scale(0.5, root(parameter_product(scene, i, j, largest, largest, body, direction)))
    if parameter_product(scene, i, j, 0, largest, AT_REST, 0)[0] < 0.0:
        e = scale(-1.0, e)
    if which == largest:
        return e
    return over(scale(0.25, parameter_product(scene, i, j, largest, which, body, direction)), e)


@jitable
def relative_velocity(scene: Scene, y: F1, i: int, j: int, k: int) -> V3:
    """Return the velocity of i's origin against j's, as seen from marker k's body."""
    v = sub(marker_velocity(scene, i), marker_velocity(scene, j))
    w = vector(scene.work.w[scene.markers.body[k]])
    return sub(v, cross(w, sub(marker_point(scene, y, i), marker_point(scene, y, j))))


@jitable
def relative_spin(scene: Scene, i: int, j: int) -> V3:
    """Return the angular velocity of marker i against marker j."""
    w = scene.work.w
    return sub(vector(w[scene.markers.body[i]]), vector(w[scene.markers.body[j]]))


@jitable
def spin_up(scene: Scene, b: int) -> V3:
    """Return the angular acceleration of body b at the output row that is being written."""
    if b >= len(scene.bodies.mass):
        return 0.0, 0.0, 0.0
    return vector(scene.rows.accel[scene.rows.used[USED_ROWS], 6 * b + 3 : 6 * b + 6])


@jitable
def marker_acceleration(scene: Scene, m: int) -> V3:
    """Return the acceleration of marker m's origin, a + alpha x r + w x (w x r), at that row."""
    b = scene.markers.body[m]
    if b >= len(scene.bodies.mass):
        return 0.0, 0.0, 0.0
    arm, w = marker_arm(scene, m), vector(scene.work.w[b])
    a = vector(scene.rows.accel[scene.rows.used[USED_ROWS], 6 * b : 6 * b + 3])
    return add(a, add(cross(spin_up(scene, b), arm), cross(w, cross(w, arm))))


@jitable
def relative_acceleration(scene: Scene, y: F1, i: int, j: int, k: int) -> V3:
    """Return how i's origin accelerates against j's, as seen from marker k's body.

    With r, v, a the differences in the global frame: a - alpha x r - 2 w x v + w x (w x r).
    """
    b = scene.markers.body[k]
    w = vector(scene.work.w[b])
    r = sub(marker_point(scene, y, i), marker_point(scene, y, j))
    v = sub(marker_velocity(scene, i), marker_velocity(scene, j))
    a = sub(marker_acceleration(scene, i), marker_acceleration(scene, j))
    carried = add(cross(spin_up(scene, b), r), cross(w, sub(scale(2.0, v), cross(w, r))))
    return sub(a, carried)


@jitable
def relative_spin_up(scene: Scene, i: int, j: int, k: int) -> V3:
    """Return the derivative of i's angular velocity against j's, as seen from marker k's body."""
    body = scene.markers.body
    alpha = sub(spin_up(scene, body[i]), spin_up(scene, body[j]))
    return sub(alpha, cross(vector(scene.work.w[body[k]]), relative_spin(scene, i, j)))


@jitable
def closing(scene: Scene, y: F1, i: int, j: int) -> float:
    """Return VR, the rate of DM; 0 where the points coincide."""
    r = sub(marker_point(scene, y, i), marker_point(scene, y, j))
    d = norm(r)
    if d == 0.0:
        return 0.0
    return dot(r, sub(marker_velocity(scene, i), marker_velocity(scene, j))) / d


@jitable
def on_j(scene: Scene, y: F1, i: int, j: int, force: V3, torque: V3) -> tuple[V3, V3]:
    """Return what acts on J's body, about J's origin, where force and torque act on I's."""
    arm = sub(marker_point(scene, y, i), marker_point(scene, y, j))
    return scale(-1.0, force), scale(-1.0, add(torque, cross(arm, force)))


@jitable
def component(scene: Scene, force: V3, torque: V3, k: int, comp: int) -> float:
    """Return component 1 to 8: |F|, Fx, Fy, Fz, |T|, Tx, Ty, Tz along marker k's axes."""
    u = force if comp <= 4 else torque
    axis = (comp - 1) % 4
    return norm(u) if axis == 0 else dot(u, marker_axis(scene, k, axis - 1))


@jitable
def on_i(scene: Scene, applied: int, row: int) -> tuple[V3, V3]:
    """Return force and torque of an applied force or a connection on I, at marker I."""
    if applied == 1:
        table = scene.work.applied[row]
        return vector(table[0:3]), vector(table[3:6])
    at = 6 * row
    return vector(scene.work.reaction[at : at + 3]), vector(scene.work.reaction[at + 3 : at + 6])


@jitable
def floats(scene: Scene, applied: int, row: int) -> bool:
    """Return whether a row's J marker is a floating one, which is wherever I is."""
    return applied == 1 and scene.applied.form[row] == VECTOR_FORCE


@jitable
def contact_force(scene: Scene, y: F1, contact: int, jflag: int, k: int, comp: int) -> float:
    """Return a component of all incidents: force, torque about the body's cg; DEEPEST: depth."""
    work, deepest = scene.work, 0.0
    force, torque = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    for h in range(work.hit[len(work.hit) - 1]):
        s = work.hit[h]
        if contact_of(scene, s) == contact:
            values, point = work.slot[s], work.points[s]
            deepest = max(deepest, values[DEPTH])
            of_i, of_j = sides(scene, s)
            graphic = of_i if jflag == 0 else of_j
            push = vector(values[FORCE : FORCE + 3])
            arm = sub(vector(point[AT_POINT:]), position(scene, y, scene.graphics.body[graphic]))
            force = add(force, push)
            torque = add(torque, add(cross(arm, push), vector(values[TORQUE : TORQUE + 3])))
    if comp == DEEPEST:
        return deepest
    sign = 1.0 if jflag == 0 else -1.0
    return component(scene, scale(sign, force), scale(sign, torque), k, comp)


@jitable
def element_force(
    scene: Scene, y: F1, applied: int, row: int, jflag: int, k: int, comp: int
) -> float:
    """Return a component of the force of a connection, applied force or contact (0, 1, 2)."""
    if applied == 2:
        return contact_force(scene, y, row, jflag, k, comp)
    force, torque = on_i(scene, applied, row)
    if jflag == 1:
        if applied == 1 and scene.applied.alone[row] == 1:
            return 0.0
        i = scene.applied.i[row] if applied == 1 else scene.connections.i[row]
        j = scene.applied.j[row] if applied == 1 else scene.connections.j[row]
        if floats(scene, applied, row):
            j = i
        force, torque = on_j(scene, y, i, j, force, torque)
    return component(scene, force, torque, k, comp)


@jitable
def add_between(
    scene: Scene, y: F1, i: int, j: int, applied: int, row: int, force: V3, torque: V3
) -> tuple[V3, V3]:
    """Return force and torque on i with those of a row added, if it acts between i and j."""
    first = scene.applied.i[row] if applied == 1 else scene.connections.i[row]
    second = scene.applied.j[row] if applied == 1 else scene.connections.j[row]
    F, T = on_i(scene, applied, row)
    if first == i and second == j:
        return add(force, F), add(torque, T)
    if first == j and second == i:
        F, T = on_j(scene, y, j, j if floats(scene, applied, row) else i, F, T)
        return add(force, F), add(torque, T)
    return force, torque


@jitable
def net_force(scene: Scene, y: F1, i: int, j: int, k: int, comp: int) -> float:
    """Return a component of all forces on i between i and j; without j, of those on i alone."""
    force, torque = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    for row in range(len(scene.connections.i)):
        force, torque = add_between(scene, y, i, j, 0, row, force, torque)
    for row in range(len(scene.applied.i)):
        if scene.applied.alone[row] == 0:
            force, torque = add_between(scene, y, i, j, 1, row, force, torque)
        elif scene.applied.i[row] == i and j == 0:
            force = add(force, vector(scene.work.applied[row, 0:3]))
            torque = add(torque, vector(scene.work.applied[row, 3:6]))
    return component(scene, force, torque, k, comp)
