"""Block Gauss-Seidel in the bodies' velocities: contact by contact, each solved exactly.

A contact's velocity is read from its two bodies and its new impulse is given to them at once, so
that a sweep costs the same however many contacts a body has.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from mbsim.core.jitable import jitable
from mbsim.fclib.bodies.system import SIX
from mbsim.fclib.one_contact import contact_2d, contact_3d, contact_rolling

if TYPE_CHECKING:
    from mbsim.fclib.bodies.system import BodySystem
    from mbsim.fclib.problem import Vector


@jitable
def sweep_bodies(system: BodySystem, r: Vector, v: Vector, work: Vector) -> float:
    """Solve every contact once; v (bodies, 6) goes with r, in and out.

    `work` has room for 5 d numbers. Returns the largest change of an impulse over its size.
    """
    tangent, rolling = system.tangent, system.rolling
    bodies, h, pull, own, mu = system.bodies, system.h, system.pull, system.own, system.mu
    d = 1 + len(tangent) + len(rolling)
    change, size = 0.0, 0.0
    for a in range(len(mu)):
        first = d * a
        one, two = bodies[a, 0], bodies[a, 1]
        for k in range(d):
            total = system.w[first + k]
            for j in range(d):
                total -= own[a, k, j] * r[first + j]
            if one >= 0:
                for i in range(SIX):
                    total += h[a, 0, k, i] * v[one, i]
            if two >= 0:
                for i in range(SIX):
                    total += h[a, 1, k, i] * v[two, i]
            work[k] = total
        for k in range(d):
            work[d + k] = r[first + k]
        if len(rolling) > 0:
            contact_rolling(
                tangent, rolling, own, a, work, mu[a], system.mu_r[a], r, first, work[2 * d :]
            )
        elif len(tangent) == 1:
            r[first], r[first + 1] = contact_2d(
                own, a, work[0], work[1], mu[a], r[first], r[first + 1]
            )
        else:
            r[first], r[first + 1], r[first + 2] = contact_3d(
                own, a, work[0], work[1], work[2], mu[a], r[first], r[first + 1], r[first + 2]
            )
        moved = 0.0
        for k in range(d):
            work[d + k] = r[first + k] - work[d + k]
            moved += work[d + k] ** 2
            size += r[first + k] ** 2
        change += moved
        if moved > 0.0:
            if one >= 0:
                for i in range(SIX):
                    total = 0.0
                    for k in range(d):
                        total += pull[a, 0, i, k] * work[d + k]
                    v[one, i] += total
            if two >= 0:
                for i in range(SIX):
                    total = 0.0
                    for k in range(d):
                        total += pull[a, 1, i, k] * work[d + k]
                    v[two, i] += total
    return math.sqrt(change / size) if size > 0.0 else math.sqrt(change)
