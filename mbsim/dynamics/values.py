"""The value of a program, without derivatives: what forces and requests ask for."""

from __future__ import annotations

import math

from mbsim.core.jitable import jitable
from mbsim.core.rotation import dot, norm, sub
from mbsim.dynamics.angles import followed_angle
from mbsim.dynamics.curves import spline_value
from mbsim.dynamics.interpreter import displacement, rate_or_force
from mbsim.dynamics.markers import marker_axis, marker_point
from mbsim.dynamics.measures import AT_REST, relative_velocity
from mbsim.expressions.elementary import FIRST_MEASURE, NUMBER, TIME
from mbsim.expressions.values import apply_value
from mbsim.system.programs import ANGLE, DISTANCE, INCLUDED, OFFSET, SPLINE, VELOCITY


@jitable
def displacement_value(scene, y, code):
    """Return a displacement measure."""
    op = code[0]
    if op == OFFSET or op == DISTANCE:
        r = sub(marker_point(scene, y, code[1]), marker_point(scene, y, code[2]))
        return norm(r) if op == DISTANCE else dot(r, marker_axis(scene, code[3], code[4]))
    if op == ANGLE:
        return followed_angle(scene, code[1])
    return displacement(scene, y, code, AT_REST, 0)[0]


@jitable
def rate_value(scene, y, code):
    """Return a velocity, acceleration or force measure; most are velocities."""
    if code[0] == VELOCITY:
        v = relative_velocity(scene, y, code[1], code[2], code[4])
        return dot(v, marker_axis(scene, code[3], code[5]))
    return rate_or_force(scene, y, code)


@jitable
def evaluate_program(scene, t, y, program):
    """Return the value of a program; a program without instructions is no number."""
    programs = scene.programs
    s, top = programs.values, 0
    for at in range(programs.start[program], programs.start[program + 1]):
        code = programs.code[at]
        op = code[0]
        if op == NUMBER:
            s[top] = programs.number[code[1]]
            top += 1
        elif op == TIME:
            s[top] = t
            top += 1
        elif op < FIRST_MEASURE:
            top = apply_value(op, code[1], s, top)
        elif op <= INCLUDED:
            s[top] = displacement_value(scene, y, code)
            top += 1
        elif op == SPLINE:
            top -= 1
            s[top - 1] = spline_value(programs, code[1], code[2], code[3], s[top - 1], s[top])
        else:
            s[top] = rate_value(scene, y, code)
            top += 1
    return s[0] if top > 0 else math.nan
