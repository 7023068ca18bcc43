"""How positions of bodies follow from velocities: the hooks `retract` and `difference` ask it.

A body's turn is the exponential of an angular velocity in body axes; changes of its quaternion q
are q (0, w) / 2.
"""

from __future__ import annotations

import math

from mbsim.core.arrays import F1
from mbsim.core.jitable import jitable
from mbsim.core.layout import BODY_SIZE
from mbsim.core.problem import (
    AS_POSITIONS,
    AS_VELOCITIES,
    BOW,
    BRACKET,
    POSITION,
    STATE,
    VELOCITY,
)
from mbsim.core.rotation import norm

#: A turn across an angular velocity, over that, which is none but for rounding.
TURNS = 1e-14


def kinds(bodies: int, n: int) -> list[int]:
    """Return which of the n numbers of y are positions, velocities and states, `bodies` first."""
    of_a_body = [POSITION] * 7 + [VELOCITY] * 6
    return of_a_body * bodies + [STATE] * (n - BODY_SIZE * bodies)


@jitable
def turn(y: F1, at: int, h: float, wx: float, wy: float, wz: float, new: F1) -> None:
    """Write the quaternion of the body at y[at] into `new`, turned for h by w in body axes."""
    # cosine of half the angle, and sine over half the angle
    square = 0.25 * h * h * (wx * wx + wy * wy + wz * wz)
    if square < 1e-3:
        # the next terms are below 1e-17
        c = 1.0 - square * (0.5 - square * (1.0 / 24.0 - square * (1.0 / 720.0 - square / 40320.0)))
        s = 1.0 - square * (1.0 / 6.0 - square * (1.0 / 120.0 - square / 5040.0))
    else:
        half = math.sqrt(square)
        c, s = math.cos(half), math.sin(half) / half
    s *= 0.5 * h
    a, b, d = s * wx, s * wy, s * wz
    qw, qx, qy, qz = y[at + 3], y[at + 4], y[at + 5], y[at + 6]
    new[at + 3] = c * qw - qx * a - qy * b - qz * d
    new[at + 4] = c * qx + qw * a + qy * d - qz * b
    new[at + 5] = c * qy + qw * b + qz * a - qx * d
    new[at + 6] = c * qz + qw * d + qx * b - qy * a


@jitable
def move_on(y: F1, h: float, bodies: int, new: F1) -> None:
    """Write the positions in y, moved on for h by the velocities in `new`, into `new`."""
    for at in range(0, BODY_SIZE * bodies, BODY_SIZE):
        for i in range(at, at + 3):
            new[i] = y[i] + h * new[i + 7]
        turn(y, at, h, new[at + 10], new[at + 11], new[at + 12], new)


@jitable
def add_velocities(y: F1, bodies: int, change: F1) -> None:
    """Add to the velocities in `change` those that change y's positions by its own in a unit time.

    An angular velocity is 2 conj(q) q'.
    """
    for at in range(0, BODY_SIZE * bodies, BODY_SIZE):
        a, b, c, d = y[at + 3], y[at + 4], y[at + 5], y[at + 6]
        ra, rb, rc, rd = change[at + 3], change[at + 4], change[at + 5], change[at + 6]
        for i in range(at, at + 3):
            change[i + 7] += change[i]
        change[at + 10] += 2.0 * (a * rb - b * ra - c * rd + d * rc)
        change[at + 11] += 2.0 * (a * rc - c * ra - d * rb + b * rd)
        change[at + 12] += 2.0 * (a * rd - d * ra - b * rc + c * rb)


@jitable
def fill_positions(y: F1, bodies: int, change: F1) -> None:
    """Write the changes of y's positions by the velocities in `change` in a unit time into it."""
    for at in range(0, BODY_SIZE * bodies, BODY_SIZE):
        a, b, c, d = y[at + 3], y[at + 4], y[at + 5], y[at + 6]
        for i in range(at, at + 3):
            change[i] = change[i + 7]
        wx, wy, wz = 0.5 * change[at + 10], 0.5 * change[at + 11], 0.5 * change[at + 12]
        change[at + 3] = -b * wx - c * wy - d * wz
        change[at + 4] = a * wx + c * wz - d * wy
        change[at + 5] = a * wy + d * wx - b * wz
        change[at + 6] = a * wz + b * wy - c * wx


@jitable
def fill_brackets(y: F1, bodies: int, d: F1) -> None:
    """Write the Lie brackets of the velocities in d with y's into d: d x w of angular ones, 0."""
    for at in range(0, BODY_SIZE * bodies, BODY_SIZE):
        wx, wy, wz = y[at + 10], y[at + 11], y[at + 12]
        dx, dy, dz = d[at + 10], d[at + 11], d[at + 12]
        d[at + 7] = d[at + 8] = d[at + 9] = 0.0
        d[at + 10], d[at + 11], d[at + 12] = dy * wz - dz * wy, dz * wx - dx * wz, dx * wy - dy * wx


@jitable
def fill_bows(y: F1, h: float, bodies: int, off: F1) -> None:
    """Write into the velocities of `off` how far the cubic of a uniform turn is off within h.

    Through both ends of the step it is off by (w h / 2)^4 / 384 of a quaternion.
    """
    for at in range(0, BODY_SIZE * bodies, BODY_SIZE):
        spin = norm((y[at + 10], y[at + 11], y[at + 12]))
        bow = 2.0 * (0.5 * h) ** 4 * spin**3 / 384.0
        for i in range(at + 7, at + 10):
            off[i], off[i + 3] = 0.0, bow * y[i + 3]


@jitable
def is_turned_across(p: F1, bodies: int, q: F1) -> bool:
    """Return whether a body is turned between p and q across its angular velocity in p.

    The turn is twice the vector part of conj(q) q' in body axes.
    """
    for at in range(3, BODY_SIZE * bodies, BODY_SIZE):
        x = p[at] * q[at + 1] - p[at + 1] * q[at] - p[at + 2] * q[at + 3] + p[at + 3] * q[at + 2]
        y = p[at] * q[at + 2] + p[at + 1] * q[at + 3] - p[at + 2] * q[at] - p[at + 3] * q[at + 1]
        z = p[at] * q[at + 3] - p[at + 1] * q[at + 2] + p[at + 2] * q[at + 1] - p[at + 3] * q[at]
        u, v, w = p[at + 7], p[at + 8], p[at + 9]
        across = max(abs(y * w - z * v), max(abs(z * u - x * w), abs(x * v - y * u)))
        if across > TURNS * max(abs(u), max(abs(v), abs(w))):
            return True
    return False


@jitable
def differ(y: F1, h: float, bodies: int, what: float, b: F1) -> int:
    """Do what the hook `difference` is asked for (`core.problem`), and return its answer."""
    if what == AS_VELOCITIES:
        add_velocities(y, bodies, b)
    elif what == AS_POSITIONS:
        fill_positions(y, bodies, b)
    elif what == BRACKET:
        fill_brackets(y, bodies, b)
    elif what == BOW:
        fill_bows(y, h, bodies, b)
    elif is_turned_across(y, bodies, b):
        return 1
    return 0
