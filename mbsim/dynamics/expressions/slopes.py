"""How velocity measures of markers and states change with one number of the state.

`body`, `direction`: a body and a direction. Ways 0 to 5 displace it by a unit twist (cg along
global x, y, z; turn about them), velocities staying as they are; ways 6 to 11 add a unit velocity
of the cg or a unit angular velocity, global. `A_STATE` for `body` is the number of y that stands at
`direction`. With arm r of marker m on the body, theta the turn and dv, dw the added velocities:

    d r = theta x r      d v_m = dv + dw x r + w x (theta x r)      d e = theta x e
"""

from __future__ import annotations

from mbsim.arrays.scene import Scene
from mbsim.compile_model.instructions import (
    AXIS,
    AXIS_OF_K,
    CLOSING,
    MARKER_I,
    MARKER_J,
    MARKER_K,
    MARKER_L,
    OBSERVER,
    OP,
    SPEED,
    SPIN,
    STATE,
    STATE_AT,
    TURNING,
    VELOCITY,
)
from mbsim.core.arrays import F1, I1, V3
from mbsim.core.jitable import jitable
from mbsim.core.rotation import add, cross, dot, norm, sub, vector
from mbsim.dynamics.bodies.markers import marker_arm, marker_point, marker_velocity
from mbsim.dynamics.expressions.measures import (
    axis_jet,
    point_jet,
    relative_spin,
    relative_velocity,
    unit,
)

#: Instead of a body: the way is a place in y.
A_STATE = -3
#: Ways of a body that displace it, and all.
POSES, DIRECTIONS = 6, 12


@jitable
def velocity_rise(scene: Scene, m: int, body: int, direction: int) -> V3:
    """Return the change of the velocity of marker m's origin."""
    b = scene.markers.body[m]
    if b != body:
        return 0.0, 0.0, 0.0
    arm = marker_arm(scene, m)
    if direction < POSES:
        return cross(vector(scene.work.w[b]), cross(unit(direction - 3), arm))
    return add(unit(direction - 6), cross(unit(direction - 9), arm))


@jitable
def spin_rise(scene: Scene, m: int, body: int, direction: int) -> V3:
    """Return the change of the angular velocity of marker m."""
    if scene.markers.body[m] != body or direction < POSES:
        return 0.0, 0.0, 0.0
    return unit(direction - 9)


@jitable
def between_rise(scene: Scene, y: F1, i: int, j: int, body: int, direction: int) -> V3:
    """Return the change of P_i - P_j."""
    if direction >= POSES:
        return 0.0, 0.0, 0.0
    return sub(
        point_jet(scene, y, i, body, direction)[1], point_jet(scene, y, j, body, direction)[1]
    )


@jitable
def along_unit(u: V3, rise: V3) -> float:
    """Return the change of |u|; 0 where u is."""
    size = norm(u)
    return dot(u, rise) / size if size > 0.0 else 0.0


@jitable
def relative_rise(scene: Scene, y: F1, i: int, j: int, k: int, body: int, direction: int) -> V3:
    """Return the change of the velocity of i against j as seen from k's body."""
    apart = sub(marker_point(scene, y, i), marker_point(scene, y, j))
    rise = sub(velocity_rise(scene, i, body, direction), velocity_rise(scene, j, body, direction))
    turned = cross(spin_rise(scene, k, body, direction), apart)
    w = vector(scene.work.w[scene.markers.body[k]])
    return sub(rise, add(turned, cross(w, between_rise(scene, y, i, j, body, direction))))


@jitable
def closing_rise(scene: Scene, y: F1, i: int, j: int, body: int, direction: int) -> float:
    """Return the change of VR = r.v/d: (dr.v + r.dv - VR dd)/d, dd = r.dr/d."""
    r = sub(marker_point(scene, y, i), marker_point(scene, y, j))
    d = norm(r)
    if d == 0.0:
        return 0.0
    v = sub(marker_velocity(scene, i), marker_velocity(scene, j))
    dr = between_rise(scene, y, i, j, body, direction)
    dv = sub(velocity_rise(scene, i, body, direction), velocity_rise(scene, j, body, direction))
    return (dot(dr, v) + dot(r, dv) - dot(r, v) * dot(r, dr) / (d * d)) / d


@jitable
def slope(scene: Scene, y: F1, code: I1, body: int, direction: int) -> float:
    """Return how a velocity measure or a state changes; 0 for what is not one of these.

    Accelerations and forces of other elements count as they are.
    """
    op = code[OP]
    if op == STATE:
        return 1.0 if body == A_STATE and code[STATE_AT] == direction else 0.0
    if body < 0:
        return 0.0
    if op == SPEED:
        i, j, observer = code[MARKER_I], code[MARKER_J], code[OBSERVER]
        u = relative_velocity(scene, y, i, j, observer)
        return along_unit(u, relative_rise(scene, y, i, j, observer, body, direction))
    if op == CLOSING:
        return closing_rise(scene, y, code[MARKER_I], code[MARKER_J], body, direction)
    if op == VELOCITY:
        e = axis_jet(scene, code[MARKER_K], code[AXIS], body, direction)
        v = relative_velocity(scene, y, code[MARKER_I], code[MARKER_J], code[MARKER_L])
        return dot(
            relative_rise(
                scene, y, code[MARKER_I], code[MARKER_J], code[MARKER_L], body, direction
            ),
            e[0],
        ) + dot(v, e[1])
    if op == TURNING or op == SPIN:
        w = relative_spin(scene, code[MARKER_I], code[MARKER_J])
        rise = sub(
            spin_rise(scene, code[MARKER_I], body, direction),
            spin_rise(scene, code[MARKER_J], body, direction),
        )
        if op == TURNING:
            return along_unit(w, rise)
        e = axis_jet(scene, code[MARKER_K], code[AXIS_OF_K], body, direction)
        return dot(rise, e[0]) + dot(w, e[1])
    return 0.0
