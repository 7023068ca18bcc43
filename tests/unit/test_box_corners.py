"""Boxes of one size on each other: corners that are on an edge but for rounding count once."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from mbsim.geometry.catalog import AT_DEPTH, AT_WEIGHT, POINT
from mbsim.geometry.pairs.box_box import BOX_BOX_SLOTS, TIE, box_box


def frame(place, turns):
    """Return origin and axes of a box."""
    return np.concatenate([place, Rotation.from_rotvec(turns).as_matrix().ravel()])


def test_weights_of_corners_near_edges_add_up_to_four():
    # of what a corner may be outside and still be on the edge: cut from there, the edge behind it
    # began outside of the other face, and its far corner counted once more
    half, random = np.array([0.1, 0.1, 0.1]), np.random.default_rng(4)
    tie = TIE * 2.0 * half[0]
    for _ in range(400):
        place = [tie * random.uniform(-3.0, 3.0), 1e-6 * random.normal(), 0.2 - 1e-4]
        turns = [1e-5 * random.normal(), 0.0, 20.0 * tie * random.normal()]
        points = np.zeros((BOX_BOX_SLOTS, POINT))
        box_box(frame(place, turns), half, frame(np.zeros(3), np.zeros(3)), half, points)
        touching = points[points[:, AT_DEPTH] > 0.0]
        assert abs(touching[:, AT_WEIGHT].sum() - 4.0) < 1e-5, (place, turns)
