"""The stack machine of expressions, see `compile_model.instructions` for its instructions."""

from __future__ import annotations

from mbsim.arrays.codes import SHOWN
from mbsim.arrays.scene import Scene
from mbsim.compile_model.instructions import (
    ACCELERATION,
    ANGLE,
    CLOSING,
    DISTANCE,
    INCLUDED,
    NET,
    OFFSET,
    SENSED,
    SPEED,
    SPIN,
    SPIN_UP,
    SPLINE,
    STATE,
    TURN,
    TURNING,
    VELOCITY,
)
from mbsim.core.arrays import F1, I1, V3
from mbsim.core.jitable import jitable
from mbsim.core.rotation import dot, norm
from mbsim.dynamics.bodies.markers import marker_axis
from mbsim.dynamics.expressions.measures import (
    AS_THEY_ARE,
    angle,
    closing,
    distance,
    element_force,
    euler_angle,
    euler_parameter,
    included_angle,
    net_force,
    offset,
    relative_acceleration,
    relative_spin,
    relative_spin_up,
    relative_velocity,
)
from mbsim.dynamics.expressions.slopes import slope
from mbsim.dynamics.expressions.splines import spline
from mbsim.expressions.elementary import FIRST_MEASURE, NUMBER, TIME, apply, constant, get, put


@jitable
def displacement(scene: Scene, y: F1, code: I1, body: int, direction: int) -> V3:
    """Return the jet of a displacement measure."""
    op = code[0]
    if op == DISTANCE:
        return distance(scene, y, code[1], code[2], body, direction)
    if op == OFFSET:
        return offset(scene, y, code[1], code[2], code[3], code[4], body, direction)
    if op == ANGLE:
        return angle(scene, code[1], body, direction)
    if op == TURN:
        return euler_angle(scene, code[1], code[2], code[3], body, direction)
    if op == INCLUDED:
        return included_angle(scene, y, code[1], code[2], code[3], body, direction)
    return euler_parameter(scene, code[1], code[2], code[3], body, direction)


@jitable
def rate_or_force(scene: Scene, y: F1, code: I1) -> float:
    """Return a velocity or force measure."""
    op = code[0]
    if op == SPEED:
        return norm(relative_velocity(scene, y, code[1], code[2], code[3]))
    if op == CLOSING:
        return closing(scene, y, code[1], code[2])
    if op == VELOCITY:
        v = relative_velocity(scene, y, code[1], code[2], code[4])
        return dot(v, marker_axis(scene, code[3], code[5]))
    if op == TURNING:
        return norm(relative_spin(scene, code[1], code[2]))
    if op == SPIN:
        return dot(relative_spin(scene, code[1], code[2]), marker_axis(scene, code[3], code[4]))
    if op == STATE:
        return y[code[1]]
    if op == ACCELERATION:
        a = relative_acceleration(scene, y, code[1], code[2], code[4])
        return norm(a) if code[5] == 3 else dot(a, marker_axis(scene, code[3], code[5]))
    if op == SPIN_UP:
        a = relative_spin_up(scene, code[1], code[2], code[4])
        return norm(a) if code[5] == 3 else dot(a, marker_axis(scene, code[3], code[5]))
    if op == SENSED:
        return scene.state.sensed[code[1], SHOWN]
    if op == NET:
        return net_force(scene, y, code[1], code[2], code[3], code[4])
    return element_force(scene, y, code[1], code[2], code[3], code[5], code[4])


@jitable
def interpret(scene: Scene, t: float, y: F1, program: int, body: int, direction: int) -> int:
    """Leave the jet of a program in the first row of the stack; see measures for both."""
    programs = scene.programs
    stack, top = programs.stack, 0
    for at in range(programs.start[program], programs.start[program + 1]):
        code = programs.code[at]
        op = code[0]
        if op == NUMBER:
            put(stack, top, constant(programs.number[code[1]]))
            top += 1
        elif op == TIME:
            put(stack, top, (t, 1.0 if body == AS_THEY_ARE else 0.0, 0.0))
            top += 1
        elif op < FIRST_MEASURE:
            top = apply(op, code[1], stack, top)
        elif op <= INCLUDED:
            put(stack, top, displacement(scene, y, code, body, direction))
            top += 1
        elif op == SPLINE:
            top -= 1
            x, z = get(stack, top - 1), get(stack, top)
            put(stack, top - 1, spline(programs, code[1], code[2], code[3], x, z))
        else:
            rise = slope(scene, y, code, body, direction)
            put(stack, top, (rate_or_force(scene, y, code), rise, 0.0))
            top += 1
    return 0
