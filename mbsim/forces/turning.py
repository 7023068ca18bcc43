"""Torques that have a potential in the rotation vector theta.

As theta' = J(theta)^-1 w, the torque whose power is the rate of U(theta) is J(theta)^-T dU/dtheta:

    J(theta)^-T a = a + theta x a/2 + c theta x (theta x a)
    c = (1 - a cot a) / phi^2,  a = phi/2,  phi = abs(theta)

(left Jacobian of SO(3): T. D. Barfoot, State Estimation for Robotics, 2017, section 7.1).
"""

from __future__ import annotations

import math

from mbsim.core.arrays import V3
from mbsim.core.jitable import jitable
from mbsim.core.rotation import add, cross, dot, scale

# below this angle the series of c is exact to rounding: its next term is phi^4/30240
_SMALL = 1e-3


@jitable
def turned_back(theta: V3, a: V3) -> V3:
    """Return J(theta)^-T a; of -theta it is J(theta)^-1 a."""
    square = dot(theta, theta)
    if square < _SMALL * _SMALL:
        c = 1.0 / 12.0 + square / 720.0
    else:
        half = 0.5 * math.sqrt(square)
        c = (1.0 - half / math.tan(half)) / square
    turned = cross(theta, a)
    return add(add(a, scale(0.5, turned)), scale(c, cross(theta, turned)))


@jitable
def turning_torque(theta: V3, k: V3) -> V3:
    """Return J(theta)^-T k theta, `k` the three stiffnesses about J's axes."""
    return turned_back(theta, (k[0] * theta[0], k[1] * theta[1], k[2] * theta[2]))
