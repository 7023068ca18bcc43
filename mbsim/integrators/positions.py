"""How positions follow from velocities: what methods ask of the problem where bodies turn.

Problems without positions have no such hooks: nothing is done then.
"""

from __future__ import annotations

from mbsim.core.address import call_float, call_int
from mbsim.core.arrays import F1
from mbsim.core.jitable import jitable
from mbsim.core.problem import (
    ALONG,
    AS_POSITIONS,
    AS_VELOCITIES,
    BOW,
    BRACKET,
    POSITION,
    TURNED,
    VELOCITY,
    Problem,
)
from mbsim.integrators.scheme import LAST_ERROR, TOL, Method, project


@jitable
def has_positions(m: Method) -> bool:
    """Return whether there are numbers that follow from others as positions from velocities."""
    for i in range(len(m.kinds)):
        if m.kinds[i] == POSITION:
            return True
    return False


@jitable
def is_rate(m: Method, i: int) -> bool:
    """Return whether y[i] is a velocity or a state of first order."""
    return m.kinds[i] != POSITION


@jitable
def retract(p: Problem, h: float, y: F1, w: F1) -> None:
    """Write y's positions, moved on for a time h by the velocities in w, into w."""
    if p.retract != 0:
        call_int(p.retract, (p.context, 0.0, h, y, w))


@jitable
def as_positions(p: Problem, y: F1, w: F1) -> None:
    """Write how the velocities in w change y's positions into w's positions."""
    if p.difference != 0:
        call_int(p.difference, (p.context, 0.0, AS_POSITIONS, y, w))


@jitable
def bracket(p: Problem, y: F1, d: F1, w: F1) -> None:
    """Write the Lie bracket of the velocities in d with y's into w's, 0 where nothing turns."""
    for i in range(len(y)):
        w[i] = d[i]
    call_int(p.difference, (p.context, 0.0, BRACKET, y, w))


@jitable
def bow(p: Problem, h: float, y: F1, w: F1) -> None:
    """Write by how much the cubic of a uniform turn is off in a step of h into w's velocities."""
    if p.difference != 0:
        call_int(p.difference, (p.context, h, BOW, y, w))


@jitable
def is_turned(p: Problem, y: F1, w: F1) -> bool:
    """Return whether w's positions are turned against y's across y's velocities."""
    if p.difference == 0:
        return False
    return call_int(p.difference, (p.context, 0.0, TURNED, y, w)) == 1


@jitable
def put_along(p: Problem, m: Method, t: float, y: F1, r: F1, w: F1) -> None:
    """Leave of what r asks of positions what joints allow at (t, y).

    w is scratch. Motions of velocities and accelerations hold no positions. The rest is the
    multipliers'. Were it left in, `project` would share it out between velocities, along other
    lines than those of the forces, and their order would fall to 2.
    """
    if p.difference == 0:
        return
    for i in range(len(y)):
        w[i] = r[i] if m.kinds[i] == POSITION else y[i]
    call_int(p.difference, (p.context, 0.0, AS_VELOCITIES, y, w))
    for i in range(len(y)):
        if m.kinds[i] == POSITION:
            w[i] = y[i]
    project(p, m, t, ALONG, w)
    for i in range(len(y)):
        if m.kinds[i] == VELOCITY:
            w[i] -= y[i]
    call_int(p.difference, (p.context, 0.0, AS_POSITIONS, y, w))
    for i in range(len(y)):
        if m.kinds[i] == POSITION:
            r[i] = w[i]


@jitable
def jumps(p: Problem, m: Method, t: float) -> bool:
    """Return whether joints and motions ask for another point at t than the committed one.

    By more than the tolerance: memory[LAST_ERROR] is how many times. Steps that begin behind a jump
    could not tell it from where they lead, those of an implicit method least: its stages are put
    where the motion has them.
    """
    for i in range(len(m.y)):
        m.trial[i] = m.y[i]
    project(p, m, t, 0.0, m.trial)
    for i in range(len(m.y)):
        m.error[i] = m.trial[i] - m.y[i]
    m.memory[LAST_ERROR] = call_float(p.norm, (p.context, t, 0.0, m.error, m.trial)) / m.memory[TOL]
    return not m.memory[LAST_ERROR] <= 1.0
