"""Energy and wrench of contact points under a power law, and the wrench that the energy gives."""

from __future__ import annotations

import numpy as np

from helpers.pairs import turned
from helpers.surfaces import incidents
from mbsim.geometry.catalog import (
    AT_DEPTH,
    AT_NORMAL,
    AT_POINT,
    AT_WEIGHT,
    COUPLE,
    COUPLE_OF_FORCE,
    GAIN,
)

#: Half of the steps of differences, as a length [m] and an angle [rad].
LENGTH, ANGLE = 1e-8, 1e-7


def measured(points, patches, about, exponent=1.0):
    """Return the energy and the wrench on I about a point of springs k d^exponent with k = 1."""
    if patches:
        first, numbers = incidents(points)
        gain = numbers[:, GAIN]
    else:
        first = points[points[:, AT_DEPTH] > 0.0]
        gain = np.ones(len(first))
    depth, weight = first[:, AT_DEPTH], first[:, AT_WEIGHT]
    force = depth**exponent
    energy = force * depth / (exponent + 1.0)
    push = (weight * gain * force)[:, None] * first[:, AT_NORMAL : AT_NORMAL + 3]
    torque = np.cross(first[:, AT_POINT : AT_POINT + 3] - about, push)
    torque += energy[:, None] * first[:, COUPLE : COUPLE + 3]
    torque += force[:, None] * first[:, COUPLE_OF_FORCE : COUPLE_OF_FORCE + 3]
    return (weight * energy).sum(), np.concatenate([push.sum(axis=0), torque.sum(axis=0)])


def moved(frame, k, way):
    """Return a frame moved along axis k, or turned about axis k - 3."""
    there = frame.copy()
    if k < 3:
        there[k] += way
    else:
        there[3:] = (turned(np.eye(3)[k - 3], way) @ frame[3:].reshape(3, 3)).ravel()
    return there


def slope(energy, frame):
    """Return the wrench on I about its origin that differences of the energy give."""
    found = np.zeros(6)
    for k in range(6):
        h = LENGTH if k < 3 else ANGLE
        ends = [energy(moved(frame, k, sign * h)) for sign in (1.0, -1.0)]
        found[k] = (ends[1] - ends[0]) / (2.0 * h)
    return found
