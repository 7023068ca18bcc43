"""How deep cubes are in each other, from centres and attitudes alone."""

from __future__ import annotations

import numpy as np
import pytest

from mbsim.bench.overlap import beyond, corners, deepest_pair

UPRIGHT = np.array([1.0, 0.0, 0.0, 0.0])
#: By 45 degrees about z; so that a corner points along z.
ASIDE = np.array([np.cos(np.pi / 8), 0.0, 0.0, np.sin(np.pi / 8)])
AXIS = np.array([1.0, -1.0, 0.0]) / np.sqrt(2.0)
HALF = 0.5 * np.arccos(1.0 / np.sqrt(3.0))
ON_CORNER = np.array([np.cos(HALF), *(np.sin(HALF) * AXIS)])
EDGE = 0.2


@pytest.mark.parametrize(
    ("offset", "turn", "depth"),
    [
        ((0.19, 0.05, -0.03), UPRIGHT, 0.01),
        ((0.21, 0.0, 0.0), UPRIGHT, 0.0),
        # an edge in a face, a corner in a face
        ((0.1 + 0.1 * np.sqrt(2.0) - 0.004, 0.0, 0.01), ASIDE, 0.004),
        ((0.01, 0.02, 0.1 + 0.1 * np.sqrt(3.0) - 0.003), ON_CORNER, 0.003),
    ],
)
def test_depth_of_two_cubes(offset, turn, depth):
    places = np.array([[1.0, 2.0, 3.0], np.add([1.0, 2.0, 3.0], offset), [9.0, 9.0, 9.0]])
    turns = np.array([UPRIGHT, turn, UPRIGHT])
    assert deepest_pair(places, turns, EDGE) == pytest.approx(depth, abs=1e-12)


def test_two_edges_that_cross():
    """Both lie on an edge, one along x, the other along y."""
    s = np.sin(np.pi / 8)
    c = np.cos(np.pi / 8)
    turns = np.array([[c, s, 0.0, 0.0], [c, 0.0, s, 0.0]])
    places = np.array([[0.0, 0.0, 0.0], [0.01, 0.02, 0.2 * np.sqrt(2.0) - 0.005]])
    assert deepest_pair(places, turns, EDGE) == pytest.approx(0.005, abs=1e-12)


def test_corners_below_a_plane_and_outside_of_a_box():
    places = np.array([[0.0, 0.0, 0.1 * np.sqrt(3.0) - 0.002], [0.35, 0.0, 1.0]])
    found = corners(places, np.array([ON_CORNER, UPRIGHT]), EDGE)
    assert beyond(found) == pytest.approx(0.002, abs=1e-12)
    assert beyond(found, half=0.42) == pytest.approx(0.03, abs=1e-12)
    assert beyond(found + np.array([0.0, 0.0, 1.0]), half=1.0) == 0.0
