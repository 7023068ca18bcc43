"""Meshes of a sphere of radius 1 on a plane, against the true sphere: flat facets, smooth ones."""

from __future__ import annotations

import numpy as np
import pytest

from helpers.pairs import frame, random_rotation
from helpers.surfaces import PLANE, Meshed, call, incidents, overlap_volume, sphere
from mbsim.model.smooth_facets import smooth


def measured(mesh, d, count, seed=5):
    """Return volume and largest depth over those of the true sphere, in random orientations."""
    rng, found = np.random.default_rng(seed), []
    for _ in range(count):
        pose = frame([0.0, 0.0, 1.0 - d], random_rotation(rng))
        points = call("SURFACE-PLANE", pose, mesh.size, *PLANE)
        found.append((overlap_volume(points)[0], incidents(points)[0][:, 0].max()))
    return np.array(found) / [np.pi * d * d * (1.0 - d / 3.0), d]


@pytest.fixture(scope="module")
def smoothed():
    return Meshed(*smooth(*sphere(1.0, 4)), layered=False)


@pytest.mark.parametrize(("d", "ripple"), [(0.002, 1e-2), (0.05, 1e-3)])
def test_smooth_facets_are_the_sphere(d, ripple, smoothed):
    """5120 triangles: how far volume and depth go up and down, and their mean."""
    found = measured(smoothed, d, 40)
    assert np.ptp(found, axis=0).max() < ripple
    np.testing.assert_allclose(found.mean(axis=0), 1.0, atol=1e-2)


@pytest.mark.parametrize(("d", "halvings"), [(0.05, (3, 4, 5)), (0.01, (4, 5, 6))])
def test_flat_facets_are_of_second_order_in_their_edges(d, halvings):
    meshes = [Meshed(*sphere(1.0, n), layered=False) for n in halvings]
    errors = np.array([abs(1.0 - measured(mesh, d, 24)[:, 0].mean()) for mesh in meshes])
    np.testing.assert_allclose(np.log2(errors[:-1] / errors[1:]), 2.0, atol=0.2)
