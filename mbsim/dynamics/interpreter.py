"""The stack machine of expressions, see `system.programs` for its instructions."""

from __future__ import annotations

from mbsim.core.jitable import jitable
from mbsim.core.rotation import dot, norm
from mbsim.dynamics.markers import marker_axis
from mbsim.dynamics.measures import (
    AS_THEY_ARE,
    angle,
    closing,
    distance,
    element_force,
    euler_angle,
    euler_parameter,
    net_force,
    offset,
    relative_spin,
    relative_velocity,
)
from mbsim.dynamics.subroutines import user_result
from mbsim.expressions.elementary import FIRST_MEASURE, NUMBER, TIME, apply, constant, put
from mbsim.system.programs import (
    ANGLE,
    CLOSING,
    DISTANCE,
    NET,
    OFFSET,
    ORIENT,
    SPEED,
    SPIN,
    TURN,
    TURNING,
    USER,
    VELOCITY,
)


@jitable
def displacement(scene, y, code, body, way):
    """Return the jet of a displacement measure."""
    op = code[0]
    if op == DISTANCE:
        return distance(scene, y, code[1], code[2], body, way)
    if op == OFFSET:
        return offset(scene, y, code[1], code[2], code[3], code[4], body, way)
    if op == ANGLE:
        return angle(scene, code[1], body, way)
    if op == TURN:
        return euler_angle(scene, code[1], code[2], code[3], body, way)
    return euler_parameter(scene, code[1], code[2], code[3], body, way)


@jitable
def rate_or_force(scene, y, code):
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
    if op == NET:
        return net_force(scene, y, code[1], code[2], code[3], code[4])
    return element_force(scene, y, code[1], code[2], code[3], code[5], code[4])


@jitable
def interpret(scene, t, y, program, body, way):
    """Leave the jet of a program in the first row of the stack; `body`, `way`: see measures."""
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
        elif op <= ORIENT:
            put(stack, top, displacement(scene, y, code, body, way))
            top += 1
        elif op == USER:
            put(stack, top, constant(user_result(scene, t, y, code[1], code[2])))
            top += 1
        else:
            put(stack, top, constant(rate_or_force(scene, y, code)))
            top += 1
    return 0
