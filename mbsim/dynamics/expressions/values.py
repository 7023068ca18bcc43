"""The value of a program, without derivatives: what forces and requests ask for."""

from __future__ import annotations

import math

from mbsim.arrays.scene import Scene
from mbsim.compile_model.instructions import (
    ADD_N,
    ADD_TIME_N,
    ANGLE,
    AXIS,
    AXIS_OF_K,
    CALLS,
    COUNT,
    CURVES,
    DISTANCE,
    DIV_N,
    FIRST_CURVE,
    INCLUDED,
    MARKER_I,
    MARKER_J,
    MARKER_K,
    MARKER_L,
    MUL_N,
    N_DIV,
    N_SUB,
    OFFSET,
    OP,
    ORDER,
    POW_N,
    RESULT,
    ROW,
    SPLINE,
    SUB_N,
    TIME_N,
    USER,
    VELOCITY,
)
from mbsim.core.arrays import F1, I1
from mbsim.core.jitable import jitable
from mbsim.core.rotation import dot, norm, sub
from mbsim.dynamics.bodies.angles import followed_angle
from mbsim.dynamics.bodies.markers import marker_axis, marker_point
from mbsim.dynamics.expressions.interpreter import displacement, rate_or_force
from mbsim.dynamics.expressions.measures import AT_REST, relative_velocity
from mbsim.dynamics.expressions.splines import spline_value
from mbsim.dynamics.expressions.subroutines import user_result
from mbsim.expressions.elementary import (
    ADD,
    COS,
    DIV,
    EXP,
    FIRST_MEASURE,
    MUL,
    NUMBER,
    SIN,
    SUB,
    TIME,
)
from mbsim.expressions.values import apply_value, power_value


@jitable
def displacement_value(scene: Scene, y: F1, code: I1) -> float:
    """Return a displacement measure."""
    op = code[OP]
    if op == OFFSET or op == DISTANCE:
        r = sub(marker_point(scene, y, code[MARKER_I]), marker_point(scene, y, code[MARKER_J]))
        if op == DISTANCE:
            return norm(r)
        return dot(r, marker_axis(scene, code[MARKER_K], code[AXIS_OF_K]))
    if op == ANGLE:
        return followed_angle(scene, code[ROW])
    return displacement(scene, y, code, AT_REST, 0)[0]


@jitable
def rate_value(scene: Scene, y: F1, code: I1) -> float:
    """Return a velocity, acceleration or force measure; most are velocities."""
    if code[OP] == VELOCITY:
        v = relative_velocity(scene, y, code[MARKER_I], code[MARKER_J], code[MARKER_L])
        return dot(v, marker_axis(scene, code[MARKER_K], code[AXIS]))
    return rate_or_force(scene, y, code)


@jitable
def evaluate_program(scene: Scene, t: float, y: F1, program: int) -> float:  # noqa: C901
    """Return the value of a program.

    The topmost value is `x`; those below it stand in `values` from row 1 on. Many branches because
    of a chain of equalities a table of jumps is made.
    """
    programs = scene.programs
    s, operand = programs.values, programs.operand
    top, x = 0, 0.0
    for at in range(programs.quick_start[program], programs.quick_start[program + 1]):
        code = programs.quick[at]
        op = code[OP]
        # what is frequent stands in the chain
        if op == NUMBER:
            s[top] = x
            top += 1
            x = operand[at]
        elif op == TIME:
            s[top] = x
            top += 1
            x = t
        elif op == TIME_N:
            s[top] = x
            top += 1
            x = t * operand[at]
        elif op == ADD:
            top -= 1
            x = s[top] + x
        elif op == SUB:
            top -= 1
            x = s[top] - x
        elif op == MUL:
            top -= 1
            x = s[top] * x
        elif op == DIV:
            top -= 1
            x = s[top] / x
        elif op == ADD_N:
            x = x + operand[at]
        elif op == SUB_N:
            x = x - operand[at]
        elif op == MUL_N:
            x = x * operand[at]
        elif op == DIV_N:
            x = x / operand[at]
        elif op == N_SUB:
            x = operand[at] - x
        elif op == N_DIV:
            x = operand[at] / x
        elif op == POW_N:
            x = power_value(x, operand[at])
        elif op == ADD_TIME_N:
            x = x + t * operand[at]
        elif op == SIN:
            x = math.sin(x)
        elif op == COS:
            x = math.cos(x)
        elif op == EXP:
            x = math.exp(x)
        elif op == OFFSET or op == DISTANCE:
            s[top] = x
            top += 1
            x = displacement_value(scene, y, code)
        elif op == SPLINE:
            top -= 1
            first, count, order = code[FIRST_CURVE], code[CURVES], code[ORDER]
            x = spline_value(programs, first, count, order, s[top], x)
        elif op == USER:
            s[top] = x
            top += 1
            x = user_result(scene, t, y, code[ROW], code[RESULT], code[CALLS])
        elif op < FIRST_MEASURE:
            s[top] = x
            top = apply_value(op, code[COUNT], s, top + 1) - 1
            x = s[top]
        else:
            s[top] = x
            top += 1
            x = displacement_value(scene, y, code) if op <= INCLUDED else rate_value(scene, y, code)
    return x
