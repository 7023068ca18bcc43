"""Closed-form pairs called by name, and solids and poses to call them with."""

from __future__ import annotations

import ctypes
import functools

import numpy as np

from mbsim.compile_model.contacts import pair_address
from mbsim.geometry.catalog import PAIRS, POINT

# radius, half edges, radius and half length, both radii and half length; a plane has no size
SIZES = {
    "SPHERE": np.array([0.3, 0.0, 0.0]),
    "ELLIPSOID": np.array([0.4, 0.25, 0.15]),
    "BOX": np.array([0.4, 0.3, 0.2]),
    "CYLINDER": np.array([0.25, 0.4, 0.0]),
    "FRUSTUM": np.array([0.3, 0.15, 0.35]),
    "PLANE": np.zeros(3),
}


def frame(p, R):
    return np.concatenate([p, np.asarray(R).ravel()])


def random_rotation(rng):
    q = rng.normal(size=4)
    w, x, y, z = q / np.linalg.norm(q)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


@functools.cache
def entry(name):
    """Return the compiled pair as a function of ctypes."""
    return ctypes.CFUNCTYPE(ctypes.c_int64, *[ctypes.c_void_p] * 5)(pair_address(PAIRS[name]))


def candidates(name, frame_i, frame_j, sizes=SIZES, plain=False):
    """Return count and rows of the compiled pair, or of the plain Python function."""
    pair = PAIRS[name]
    size_i, size_j = (sizes[shape] for shape in name.split("-"))
    points = np.full((pair.slots, POINT), np.nan)
    arrays = (frame_i, size_i, frame_j, size_j, points)
    call = pair.points if plain else entry(name)
    return call(*(arrays if plain else [array.ctypes.data for array in arrays])), points


def turned(axis, angle):
    """Return the rotation about an axis."""
    x, y, z = np.asarray(axis) / np.linalg.norm(axis)
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K


UPRIGHT, LYING = np.eye(3), turned((1, 0, 0), np.pi / 2)
ROLLER = np.array([0.1, 0.1, 0.0])
SLAB = (frame([0.0, 0.0, -0.5], UPRIGHT), np.array([1.0, 1.0, 0.5]))
