"""How forces change with displacements and velocities of bodies: the blocks K and D.

A force F along the rows u of two bodies (wrench on I; less that of J) has

    d F = F_x (u_i . xi_i - u_j . xi_j) + F_v (u_i . eta_i - u_j . eta_j)

with xi the displacement and eta the change of velocity of a body, both about its O. Here are the
wrenches u of units and what all forces between markers share: that they turn with axes, and that
their points move.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from mbsim.arrays.codes import WRENCH_FORCE, WRENCH_TORQUE
from mbsim.arrays.scene import Scene
from mbsim.core.arrays import F1, F2, F3, V3
from mbsim.core.jitable import jitable
from mbsim.core.rotation import add, cross, sub, vector
from mbsim.dynamics.bodies.kinematics import position
from mbsim.dynamics.bodies.markers import marker_arm, marker_point, marker_velocity
from mbsim.dynamics.expressions.measures import unit

if TYPE_CHECKING:
    from mbsim.compile_model.tangent import Linear, Pattern, Tangent


#: Differences of the laws' arguments, as parts of them and of the model's speed.
PART, PART_OF_SPEED = 1e-6, 1e-8
#: Differences of the state, as parts of length or speed, and radians.
PUSH = 1e-7
# rows of `basis` for a force between markers: a unit of it, and its turn with the line
UNIT_ROW, ACROSS_ROW = range(2)


@jitable
def lever(
    scene: Scene, linear: Linear, y: F1, b: int, p: V3, force: V3, torque: V3, row: F1
) -> None:
    """Write the wrench of a unit: force at p and torque, about O of body b; nothing for ground."""
    if b == len(scene.bodies.mass):
        for k in range(6):
            row[k] = 0.0
        return
    arm = add(sub(p, position(scene, y, b)), vector(linear.r[b]))
    moment = add(cross(arm, force), torque)
    for k in range(3):
        row[k] = moment[k]
        row[3 + k] = force[k]


@jitable
def add_product(target: F2, factor: float, u: F1, v: F1) -> None:
    """Add factor u v' to a block."""
    for i in range(target.shape[0]):
        part = factor * u[i]
        if part != 0.0:
            for j in range(target.shape[1]):
                target[i, j] += part * v[j]


@jitable
def add_two_sided(
    P: Pattern, blocks: F3, nb: int, i: int, j: int, factor: float, u: F2, v: F2
) -> None:
    """Add factor u v' of a force between bodies i and j; rows 0 of u and v are of i, 1 of j."""
    for of in range(2):
        a = i if of == 0 else j
        for by in range(2):
            b = i if by == 0 else j
            if a < nb and b < nb:
                size = factor if of == by else -factor
                add_product(blocks[P.block[a, b]], size, u[of], v[by])


@jitable
def sides_of(scene: Scene, f: int) -> tuple[int, int]:
    """Return the bodies that applied force f acts on; ground for what acts on I alone."""
    i, j = scene.markers.body[scene.applied.i[f]], scene.markers.body[scene.applied.j[f]]
    return i, (len(scene.bodies.mass) if scene.applied.alone[f] == 1 else j)


@jitable
def fill_unit(scene: Scene, T: Tangent, y: F1, f: int, force: V3, torque: V3, at_j: int) -> None:
    """Fill UNIT_ROW by a unit force and torque: on I at its origin, on J at its own or I's."""
    i, j = scene.applied.i[f], scene.applied.j[f]
    bi, bj = sides_of(scene, f)
    u = T.linear.basis[:, UNIT_ROW]
    lever(scene, T.linear, y, bi, marker_point(scene, y, i), force, torque, u[0])
    p = marker_point(scene, y, j if at_j == 1 else i)
    lever(scene, T.linear, y, bj, p, force, torque, u[1])


@jitable
def from_origin(scene: Scene, L: Linear, y: F1, b: int, p: V3) -> V3:
    """Return point p from O of body b."""
    return add(sub(p, position(scene, y, b)), vector(L.r[b]))


@jitable
def add_turn(
    scene: Scene, T: Tangent, y: F1, b: int, by: int, p: V3, force: V3, torque: V3, sign: float
) -> None:
    """Add that force at p and torque on body b turn with body `by`."""
    nb = len(scene.bodies.mass)
    if b == nb or by == nb:
        return
    block, at = T.linear.K[T.pattern.block[b, by]], from_origin(scene, T.linear, y, b, p)
    for k in range(3):
        turned = cross(unit(k), force)
        moment = add(cross(at, turned), cross(unit(k), torque))
        for i in range(3):
            block[i, k] += sign * moment[i]
            block[3 + i, k] += sign * turned[i]


@jitable
def add_lever(
    scene: Scene, T: Tangent, y: F1, b: int, by: int, p: V3, force: V3, sign: float
) -> None:
    """Add that the point p of a force on body b moves with body `by`, less that b's cg moves.

    The balance of inertia takes all forces along with the cg.
    """
    if b == len(scene.bodies.mass):
        return
    if by < len(scene.bodies.mass):
        carry(scene, T, b, by, from_origin(scene, T.linear, y, by, p), force, sign)
    carry(scene, T, b, b, vector(T.linear.r[b]), force, -sign)


@jitable
def carry(scene: Scene, T: Tangent, b: int, by: int, at: V3, force: V3, sign: float) -> None:
    """Add the moment on body b of a force whose point, at from O, moves with body `by`."""
    block = T.linear.K[T.pattern.block[b, by]]
    for k in range(3):
        moment, slide = cross(cross(unit(k), at), force), cross(unit(k), force)
        for i in range(3):
            block[i, k] += sign * moment[i]
            block[i, 3 + k] += sign * slide[i]


@jitable
def add_geometry(scene: Scene, T: Tangent, y: F1, f: int, axes: int, at_j: int) -> None:
    """Add that force f turns with a marker's body (none if negative), and its points with theirs.

    `at_j`: what acts on J does so at J's origin, not at I's.
    """
    if T.linear.stressed[0] == 0:
        return
    i, j = scene.applied.i[f], scene.applied.j[f]
    bi, bj = sides_of(scene, f)
    row = scene.work.applied[f]
    force, torque = vector(row[WRENCH_FORCE:]), vector(row[WRENCH_TORQUE:])
    p = marker_point(scene, y, i)
    q, follows = (marker_point(scene, y, j), bj) if at_j == 1 else (p, bi)
    add_lever(scene, T, y, bi, bi, p, force, 1.0)
    add_lever(scene, T, y, bj, follows, q, force, -1.0)
    if axes >= 0:
        by = scene.markers.body[axes]
        add_turn(scene, T, y, bi, by, p, force, torque, 1.0)
        add_turn(scene, T, y, bj, by, q, force, torque, -1.0)


@jitable
def add_rate_by_pose(scene: Scene, T: Tangent, f: int, u: F2, by_rate: float, n: V3) -> None:
    """Add how the rate n . (v_I - v_J) of a damper along n changes as the arms of points turn.

    theta . (arm x (n x w)); what the turning of n adds is left to its own.
    """
    P, L, nb = T.pattern, T.linear, len(scene.bodies.mass)
    markers, both = (scene.applied.i[f], scene.applied.j[f]), sides_of(scene, f)
    for side in range(2):
        b = both[side]
        if b == nb:
            continue
        w = vector(scene.work.w[b])
        rise = cross(marker_arm(scene, markers[side]), cross(n, w))
        for k in range(3):
            L.rise[k] = rise[k]
            L.rise[3 + k] = 0.0
        add_one_sided(P, L, nb, both, b, by_rate if side == 0 else -by_rate, u)


@jitable
def add_one_sided(
    P: Pattern, L: Linear, nb: int, both: tuple[int, int], b: int, factor: float, u: F2
) -> None:
    """Add factor times the row in `L.rise`, of displacements of body b, to both bodies."""
    for other in range(2):
        a = both[other]
        if a < nb:
            add_product(L.K[P.block[a, b]], factor if other == 0 else -factor, u[other], L.rise)


@jitable
def add_axis_rate(
    scene: Scene, T: Tangent, f: int, by_rate: float, n: V3, u: F2, turns: bool
) -> None:
    """Add how the rate along J's axis n changes as that turns: theta_J . (n x v)."""
    i, j = scene.applied.i[f], scene.applied.j[f]
    b, nb, both = scene.markers.body[j], len(scene.bodies.mass), sides_of(scene, f)
    if b == nb:
        return
    if turns:
        w = scene.work.w
        v = sub(vector(w[both[0]]), vector(w[both[1]]))
    else:
        v = sub(marker_velocity(scene, i), marker_velocity(scene, j))
    rise = cross(n, v)
    for k in range(3):
        T.linear.rise[k] = rise[k]
        T.linear.rise[3 + k] = 0.0
    add_one_sided(T.pattern, T.linear, nb, both, b, by_rate, u)
