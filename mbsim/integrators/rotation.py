"""Turning a body: what methods share that know positions from velocities."""

from __future__ import annotations

import math

from mbsim.core.arrays import F1
from mbsim.core.jitable import jitable


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
