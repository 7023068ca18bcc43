"""Where flats and lines just touch, points are where both solids are: not at a far corner."""

from __future__ import annotations

import numpy as np
import pytest

from helpers.pairs import SIZES, candidates, frame, turned
from mbsim.geometry.catalog import AT_DEPTH, AT_POINT, AT_WEIGHT

SIDEWAYS = turned((1, 0, 0), np.pi / 2)
#: How a solid lies on a flat, and how high its centre is then.
LIES = {
    "BOX": [
        (np.eye(3), 0.2),
        (SIDEWAYS, 0.3),
        (turned((1, 0, 0), np.pi / 4), 0.5 / np.sqrt(2.0)),
    ],
    "CYLINDER": [(np.eye(3), 0.4), (SIDEWAYS, 0.25)],
    "FRUSTUM": [(np.eye(3), 0.35)],
    "PLANE": [(np.eye(3), 0.0)],
}
PAIRS = [
    "BOX-BOX",
    "BOX-PLANE",
    "CYLINDER-BOX",
    "CYLINDER-CYLINDER",
    "CYLINDER-PLANE",
    "FRUSTUM-BOX",
    "FRUSTUM-CYLINDER",
    "FRUSTUM-FRUSTUM",
    "FRUSTUM-PLANE",
]


def outside(shape, size, at, p):
    """Return how far a point is outside of a solid, at most."""
    x = (p - at[:3]) @ at[3:].reshape(3, 3)
    if shape == "PLANE":
        return x[2]
    if shape == "BOX":
        return (np.abs(x) - size).max()
    bottom, top, half = size if shape == "FRUSTUM" else (size[0], size[0], size[1])
    radius = bottom + (top - bottom) * np.clip(0.5 + 0.5 * x[2] / half, 0.0, 1.0)
    return max(np.hypot(x[0], x[1]) - radius, abs(x[2]) - half)


def check(rng, a, b, larger):
    """Assert that of a pair whose lower solid is so many times larger."""
    sizes = {**SIZES, b: larger * SIZES[b]}
    for turn_i, high_i in LIES[a]:
        for turn_j, high_j in LIES[b]:
            for _ in range(60):
                yaw = turned((0, 0, 1), rng.uniform(0.0, 6.3))
                tilt = turned((*rng.normal(size=2), 0.0), 10.0 ** rng.uniform(-17.0, -5.0))
                deep = 10.0 ** rng.uniform(-18.0, -6.0)
                x, y = rng.uniform(-0.1, 0.1, 2)
                i = frame(np.array([x, y, high_i + larger * high_j - deep]), tilt @ yaw @ turn_i)
                j = frame(np.zeros(3), turn_j)
                _, rows = candidates(f"{a}-{b}", i, j, sizes)
                for row in rows[(rows[:, AT_DEPTH] > 0.0) & (rows[:, AT_WEIGHT] > 1e-6)]:
                    p = row[AT_POINT : AT_POINT + 3]
                    assert outside(a, sizes[a], i, p) < 2e-3
                    assert outside(b, sizes[b], j, p) < 2e-3


@pytest.mark.parametrize("name", PAIRS)
def test_points_of_what_just_touches_are_in_both(name):
    """Depths of 1e-18 to 1e-6, tilted by 1e-17 to 1e-5; the lower solid as it is, or larger."""
    rng = np.random.default_rng(5)
    a, b = name.split("-")
    for larger in (1.0, 30.0) if a != b else (1.0,):
        check(rng, a, b, larger)
