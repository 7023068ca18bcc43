"""Smooth facets: exact on spheres, real edges stay, the mesh stays closed."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import trimesh

from mbsim.model.mesh import solid_fault
from mbsim.model.smooth_facets import corner_normals, smooth


def made(mesh: trimesh.Trimesh) -> tuple[Any, Any]:
    return np.array(mesh.vertices, dtype=float), np.array(mesh.faces, dtype=np.int64)


def test_normals_are_exact_on_a_sphere_however_it_is_cut() -> None:
    rng = np.random.default_rng(1)
    points = rng.normal(size=(80, 3))
    points /= np.linalg.norm(points, axis=1)[:, None]
    vertices, faces = made(trimesh.convex.convex_hull(points))
    normals = corner_normals(vertices, faces, 80.0)
    np.testing.assert_allclose(normals, vertices[faces], atol=1e-12)


@pytest.mark.parametrize(
    ("shape", "volume", "part"),
    [
        (trimesh.creation.icosphere(3), 4.0 / 3.0 * np.pi, 3e-4),
        (trimesh.creation.cylinder(0.5, 1.0, sections=32), 0.25 * np.pi, 2e-4),
        (trimesh.creation.torus(1.0, 0.3), 2.0 * np.pi**2 * 0.09, 1e-3),
    ],
    ids=["sphere", "cylinder", "torus"],
)
def test_the_volume_of_round_solids_is_near_that_of_the_true_ones(
    shape: trimesh.Trimesh, volume: float, part: float
) -> None:
    vertices, faces = smooth(*made(shape), most=60_000)
    assert solid_fault(vertices, faces) == ""
    found = trimesh.Trimesh(vertices, faces, process=False).volume
    assert abs(found / volume - 1.0) < part < 0.2 * abs(shape.volume / volume - 1.0)


def test_what_is_flat_stays_as_it_is() -> None:
    vertices, faces = made(trimesh.creation.box((1.0, 2.0, 3.0)).subdivide())
    same, cut = smooth(vertices, faces)
    assert same is vertices
    assert cut is faces


def test_the_rim_of_a_cylinder_stays_a_circle_and_its_ends_flat() -> None:
    vertices, _ = smooth(*made(trimesh.creation.cylinder(0.5, 1.0, sections=32)), most=20_000)
    rim = np.isclose(np.abs(vertices[:, 2]), 0.5) & (np.hypot(*vertices[:, :2].T) > 0.49)
    inward = np.hypot(*vertices[:, :2].T)[rim]
    assert np.abs(vertices[:, 2]).max() == pytest.approx(0.5, abs=1e-12)
    assert (inward > 0.499999).sum() > 200
    assert inward.max() < 0.5 + 1e-7


def test_a_smaller_crease_angle_keeps_all_edges() -> None:
    vertices, faces = made(trimesh.creation.icosphere(1))
    assert len(smooth(vertices, faces, 5.0)[1]) == len(faces)
    assert len(smooth(vertices, faces)[1]) > len(faces)


def test_the_triangles_are_no_more_than_asked_for() -> None:
    vertices, faces = made(trimesh.creation.icosphere(3))
    assert 0.5 * 30_000 < len(smooth(vertices, faces, most=30_000)[1]) <= 30_000
