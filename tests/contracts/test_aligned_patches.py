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


def octahedron():
    """Return an octahedron with its corners on the axes."""
    v = 0.5 * np.vstack([np.eye(3), -np.eye(3)])
    faces = [[i, j, k] for i in (0, 3) for j in (1, 4) for k in (2, 5)]
    return v, [f if np.linalg.det(v[f]) > 0.0 else f[::-1] for f in faces]


def wedge():
    """Return half of an upright prism over a square, cut along a diagonal of that."""
    corners = np.array([[0.0, 0.0], [0.2, 0.0], [0.2, 0.2]])
    v = np.vstack([np.column_stack([corners, np.full(3, z)]) for z in (-0.25, 0.25)])
    sides = [[0, 1, 4], [0, 4, 3], [1, 2, 5], [1, 5, 4], [2, 0, 3], [2, 3, 5]]
    return v, [[0, 2, 1], [3, 4, 5], *sides]


SYMMETRIC = {
    "box": Meshed(*box(1.0, 1.0, 1.0)),
    "slab": Meshed(*box(4.0, 4.0, 1.0)),
    "octahedron": Meshed(*octahedron()),
    "wedge": Meshed(*wedge()),
}
UPRIGHT = turned((1.0, 0.0, 0.0), np.pi / 2)
TURNS = [
    SAME,
    turned((0.0, 0.0, 1.0), np.pi / 4),
    turned((1.0, 0.0, 0.0), np.pi / 4),
    turned((0.0, 0.0, 1.0), np.pi / 4) @ UPRIGHT,
    ON_CORNER,
]


@pytest.mark.parametrize("pair", ["SURFACE-SURFACE", "FIELD-FIELD"])
@pytest.mark.parametrize("name_j", ["box", "slab", "octahedron"])
@pytest.mark.parametrize("name_i", ["box", "octahedron", "wedge"])
def test_no_force_jumps_where_parts_have_planes_of_symmetry_in_common(name_i, name_j, pair):
    """Sides then lie in the planes between prisms under an edge or a diagonal.

    The truth is the force in poses beside, off by 1e-8.
    """
    mesh_i, mesh_j = SYMMETRIC[name_i], SYMMETRIC[name_j]
    rng, still = np.random.default_rng(0), frame(np.zeros(3), SAME)
    compared = 0
    for R in TURNS:
        for way in ([0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [1.0, 1.0, 1.0], [1.0, 1.0, 0.0]):
            n = np.array(way) / np.linalg.norm(way)
            reach = (mesh_j.vertices @ n).max() - (mesh_i.vertices @ R.T @ n).min()
            for depth in (0.05, 0.125):
                p = (reach - depth) * n
                found = wrench(
                    call(pair, frame(p, R), mesh_i.size, still, mesh_j.size), REGION_ROWS
                )
                beside = []
                for _ in range(5):
                    off, turn = 1e-8 * rng.normal(size=3), turned(rng.normal(size=3), 1e-8)
                    at = frame(p + off, turn @ R)
                    beside.append(
                        wrench(call(pair, at, mesh_i.size, still, mesh_j.size), REGION_ROWS)
                    )
                right = np.median(beside, axis=0)
                if np.linalg.norm(right[:3]) > 1e-6:
                    compared += 1
                    scale = np.linalg.norm(right[:3])
                    np.testing.assert_allclose(found, right, rtol=0.0, atol=2e-4 * scale)
    assert compared > 15
