"""The stack machine of expressions, see `compile_model.instructions` for its instructions."""

from __future__ import annotations

from mbsim.arrays.codes import SHOWN
from mbsim.arrays.scene import Scene
from mbsim.compile_model.instructions import (
    ACCELERATION,
    ANGLE,
    AXIS,
    AXIS_OF_K,
    CLOSING,
    COMPONENT,
    COUNT,
    CURVES,
    DISTANCE,
    ELEMENT_ROW,
    FIRST_CURVE,
    INCLUDED,
    JFLAG,
    KIND,
    MAGNITUDE,
    MARKER_I,
    MARKER_J,
    MARKER_K,
    MARKER_L,
    NET,
    OBSERVER,
    OFFSET,
    OP,
    ORDER,
    ROW,
    SEEN_BY,
    SENSED,
    SPEED,
    SPIN,
    SPIN_UP,
    SPLINE,
    STATE,
    STATE_AT,
    TURN,
    TURNING,
    USER,
    VELOCITY,
    WHICH,
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
from mbsim.dynamics.expressions.subroutines import user_jet
from mbsim.expressions.elementary import FIRST_MEASURE, NUMBER, TIME, apply, constant, get, put


@jitable
def displacement(scene: Scene, y: F1, code: I1, body: int, direction: int) -> V3:
    """Return the jet of a displacement measure."""
    op = code[OP]
    if op == DISTANCE:
        return distance(scene, y, code[MARKER_I], code[MARKER_J], body, direction)
    if op == OFFSET:
        return offset(
            scene,
            y,
            code[MARKER_I],
            code[MARKER_J],
            code[MARKER_K],
            code[AXIS_OF_K],
            body,
            direction,
        )
    if op == ANGLE:
        return angle(scene, code[ROW], body, direction)
    if op == TURN:
        return euler_angle(scene, code[MARKER_I], code[MARKER_J], code[WHICH], body, direction)
    if op == INCLUDED:
        return included_angle(
            scene, y, code[MARKER_I], code[MARKER_J], code[MARKER_K], body, direction
        )
    return euler_parameter(scene, code[MARKER_I], code[MARKER_J], code[WHICH], body, direction)


@jitable
def rate_or_force(scene: Scene, y: F1, code: I1) -> float:
    """Return a velocity or force measure."""
    op = code[OP]
    if op == SPEED:
        return norm(relative_velocity(scene, y, code[MARKER_I], code[MARKER_J], code[OBSERVER]))
    if op == CLOSING:
        return closing(scene, y, code[MARKER_I], code[MARKER_J])
    if op == VELOCITY:
        v = relative_velocity(scene, y, code[MARKER_I], code[MARKER_J], code[MARKER_L])
        return dot(v, marker_axis(scene, code[MARKER_K], code[AXIS]))
    if op == TURNING:
        return norm(relative_spin(scene, code[MARKER_I], code[MARKER_J]))
    if op == SPIN:
        axis = marker_axis(scene, code[MARKER_K], code[AXIS_OF_K])
        return dot(relative_spin(scene, code[MARKER_I], code[MARKER_J]), axis)
    if op == STATE:
        return y[code[STATE_AT]]
    if op == ACCELERATION:
        a = relative_acceleration(scene, y, code[MARKER_I], code[MARKER_J], code[MARKER_L])
        if code[AXIS] == MAGNITUDE:
            return norm(a)
        return dot(a, marker_axis(scene, code[MARKER_K], code[AXIS]))
    if op == SPIN_UP:
        a = relative_spin_up(scene, code[MARKER_I], code[MARKER_J], code[MARKER_L])
        if code[AXIS] == MAGNITUDE:
            return norm(a)
        return dot(a, marker_axis(scene, code[MARKER_K], code[AXIS]))
    if op == SENSED:
        return scene.state.sensed[code[ROW], SHOWN]
    if op == NET:
        return net_force(scene, y, code[MARKER_I], code[MARKER_J], code[MARKER_K], code[COMPONENT])
    kind, row = code[KIND], code[ELEMENT_ROW]
    return element_force(scene, y, kind, row, code[JFLAG], code[SEEN_BY], code[COMPONENT])


@jitable
def interpret(scene: Scene, t: float, y: F1, program: int, body: int, direction: int) -> int:
    """Leave the jet of a program in the first row of the stack; see measures for both."""
    programs = scene.programs
    stack, top = programs.stack, 0
    for at in range(programs.start[program], programs.start[program + 1]):
        code = programs.code[at]
        op = code[OP]
        if op == NUMBER:
            put(stack, top, constant(programs.number[code[ROW]]))
            top += 1
        elif op == TIME:
            put(stack, top, (t, 1.0 if body == AS_THEY_ARE else 0.0, 0.0))
            top += 1
        elif op < FIRST_MEASURE:
            top = apply(op, code[COUNT], stack, top)
        elif op <= INCLUDED:
            put(stack, top, displacement(scene, y, code, body, direction))
            top += 1
        elif op == SPLINE:
            top -= 1
            x, z = get(stack, top - 1), get(stack, top)
            first, count, order = code[FIRST_CURVE], code[CURVES], code[ORDER]
            put(stack, top - 1, spline(programs, first, count, order, x, z))
        elif op == USER:
            put(stack, top, user_jet(scene, t, y, code[ROW], body))
            top += 1
        else:
            rise = slope(scene, y, code, body, direction)
            put(stack, top, (rate_or_force(scene, y, code), rise, 0.0))
            top += 1
    return 0
