"""Cylinders, frustums and ellipsoids on convex meshes, against the reference in NumPy."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

import mbsim
from helpers.folders import data_file
from helpers.pairs import SIZES, entry, frame, random_rotation
from mbsim.geometry.catalog import POINT
from mbsim.geometry.hull_overlap import Solid, hull_of, least_overlap, touching_point
from mbsim.geometry.mesh_surface import Surface
from mbsim.model.hull import polyhedron_of

WEDGE = trimesh.Trimesh(
    [[0, -0.1, 0], [0.6, -0.1, 0], [0, -0.1, 0.25], [0, 0.1, 0], [0.6, 0.1, 0], [0, 0.1, 0.25]],
    [[0, 1, 2], [3, 5, 4], [0, 4, 1], [0, 3, 4], [0, 2, 5], [0, 5, 3], [1, 4, 5], [1, 5, 2]],
)
MESHES = {
    "wedge": WEDGE,
    "box": trimesh.creation.box((0.6, 0.5, 0.4)),
    "ball": trimesh.creation.icosphere(2, 0.3),
    "prism": trimesh.creation.cylinder(0.3, 0.5, sections=12),
}


class OnMesh:
    """A solid on a convex mesh, by the compiled pair and by the reference."""

    def __init__(self, shape, mesh):
        vertices, faces = np.array(mesh.vertices, float), np.array(mesh.faces)
        self.shape, self.size = shape, SIZES[shape]
        self.packed = polyhedron_of(vertices, faces)
        assert self.packed is not None
        self.mesh_size = np.array([self.packed.ctypes.data, len(self.packed), 0.0, 0.0])
        surface = Surface(vertices, faces, True)
        self.hull = hull_of(vertices, faces, surface.normals, surface.beside)
        self.middle = vertices.mean(axis=0)

    def measured(self, frame_i, frame_j):
        points = np.full((1, POINT), np.nan)
        size = np.append(self.size, 0.0)
        arrays = (frame_i, size, frame_j, self.mesh_size, points)
        assert entry(f"{self.shape}-MESH")(*(a.ctypes.data for a in arrays)) == 1
        return points[0]

    def reference(self, frame_i, frame_j):
        """Return depth, normal and point of the reference, in global axes."""
        p, R = frame_j[:3], frame_j[3:].reshape(3, 3)
        centre, axes = R.T @ (frame_i[:3] - p), R.T @ frame_i[3:].reshape(3, 3)
        solid = Solid(self.shape, self.size, centre, axes)
        depth, n = least_overlap(self.hull, solid)
        at = touching_point(self.hull, solid, depth, n) if depth > 0.0 else np.zeros(3)
        return depth, R @ n, p + R @ at

    def poses(self, count, seed, deepest):
        """Yield frames of the solid and the mesh that overlap by up to `deepest`, in any pose."""
        rng = np.random.default_rng(seed)
        for _ in range(count):
            R, Q = random_rotation(rng), random_rotation(rng)
            way = rng.normal(size=3)
            way /= np.linalg.norm(way)
            shift, depth = rng.normal(size=3), rng.uniform(-0.3, 1.0) * deepest
            at = Q @ self.middle + 0.1 * way
            for _ in range(4):
                found, n, _ = self.reference(frame(at, R), frame(np.zeros(3), Q))
                at += (found - depth) * n
            yield frame(at + shift, R), frame(shift, Q)


CASES = [(shape, mesh) for shape in ("CYLINDER", "FRUSTUM", "ELLIPSOID") for mesh in MESHES]


@pytest.fixture(scope="module", params=CASES, ids="-".join)
def on_mesh(request):
    shape, mesh = request.param
    return OnMesh(shape, MESHES[mesh])


@pytest.mark.parametrize("deepest", [1e-3, 0.05])
def test_depth_normal_and_point_are_those_of_the_reference(on_mesh, deepest):
    touched = 0
    for frame_i, frame_j in on_mesh.poses(60, 1, deepest):
        row = on_mesh.measured(frame_i, frame_j)
        depth, n, at = on_mesh.reference(frame_i, frame_j)
        if depth <= 0.0:
            assert row[0] <= 1e-12
            continue
        touched += 1
        assert row[0] == pytest.approx(depth, rel=1e-9, abs=1e-13)
        if row[4:7] @ n > 1.0 - 1e-7:
            # the middle of lines and flat sides is found by eight tilts from other axes
            assert np.linalg.norm(row[1:4] - at) < 1e-6 + 0.15 * 0.4
    assert touched > 20


def test_force_and_torque_are_the_slope_of_the_energy(on_mesh):
    step = 1e-6
    checked = 0
    for frame_i, frame_j in on_mesh.poses(40, 2, 0.01):
        row = on_mesh.measured(frame_i, frame_j)
        if row[0] <= 1e-4:
            continue
        slopes = []
        for k in range(3):
            ends = []
            for sign in (-1.0, 1.0):
                moved = frame_i.copy()
                moved[k] += sign * step
                ends.append(on_mesh.measured(moved, frame_j)[0])
            slopes.append((ends[1] - ends[0]) / (2.0 * step))
        # where another way out takes over the slope has a jump
        if abs(np.linalg.norm(slopes) - 1.0) < 1e-3:
            np.testing.assert_allclose(-np.array(slopes), row[4:7], atol=1e-4)
            checked += 1
    assert checked > 15


def test_a_roller_goes_down_a_wedge():
    """found/mesh/wedge.xml: rolling without slip down a slope of 0.25 in 0.6 and off its end."""
    deck = data_file("found/mesh/wedge.xml")
    results = mbsim.simulate(mbsim.read_model(deck))
    assert results.stats["fcl_calls"] == 0
    # NumPy's reference took 7.4 s for x = 0.815115
    assert results["bodies/3/position"][-1, 0] == pytest.approx(0.81511, abs=1e-4)
    assert results.audit.balance < 1e-5 * results.audit.of
