"""Meshes whose edges lie on each other: what rounding decides changes no force."""

from __future__ import annotations

import numpy as np
import pytest

from helpers.pairs import frame, random_rotation, turned
from helpers.surfaces import Meshed, angle, box, call, incidents, wrench
from mbsim.geometry.catalog import REGION_ROWS

SAME = np.eye(3)
ON_CORNER = turned((1.0, -1.0, 0.0), np.arccos(1.0 / np.sqrt(3.0)))
DEPTH = 1e-3


BOX = Meshed(*box(0.1, 0.1, 0.1))
#: Mesh I, how high it is where it touches, axes of both, mesh J, the part of DEPTH that presses.
CASES = {
    # the diagonals of both flat sides are one line
    "angle on slab": (Meshed(*angle()), 0.1, SAME, Meshed(*box(1.0, 1.0, 0.1)), 1.0),
    "box on equal box": (BOX, 0.1, SAME, BOX, 1.0),
    # of the depth along an edge
    "corner on corner": (BOX, 0.1 * np.sqrt(3.0), ON_CORNER, BOX, 1.0 / np.sqrt(3.0)),
}


@pytest.mark.parametrize("name", CASES)
def test_edges_that_lie_on_each_other_do_not_part_a_patch(name):
    """One incident with the depth that the overlap has, however the scene is turned or moved."""
    mesh_i, height, R, mesh_j, part = CASES[name]
    p = np.array([0.0, 0.0, height - DEPTH])
    rng = np.random.default_rng(1)
    for k in range(30):
        turn = random_rotation(rng) if k % 3 == 1 else SAME
        away = 1e3 * rng.normal(size=3) if k % 3 == 2 else np.zeros(3)
        rows = call(
            "SURFACE-SURFACE",
            frame(turn @ p + away, turn @ R),
            mesh_i.size,
            frame(away, turn @ R),
            mesh_j.size,
        )
        first, _ = incidents(rows)
        assert len(first) == 1
        found = turn.T @ wrench(rows, REGION_ROWS)[:3]
        # a place 1 km away is known to 1e-13 m
        assert found == pytest.approx([0.0, 0.0, part * DEPTH], abs=1e-9 * DEPTH + 1e-12)
