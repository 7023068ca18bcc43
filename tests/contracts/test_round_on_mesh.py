"""Cylinders, frustums and ellipsoids on convex meshes, against the reference in NumPy."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

import mbsim
from helpers.folders import data_file
from helpers.pairs import SIZES, entry, frame, random_rotation, turned
from helpers.surfaces import mesh_graphic
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
        at = touching_point(solid, depth, n) if depth > 0.0 else np.zeros(3)
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
            assert np.linalg.norm(row[1:4] - at) < 1e-6
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


GRAPHICS = {
    "CYLINDER": 'type="Cylinder" radius="0.1"',
    "FRUSTUM": 'type="Frustum" bottom_radius="0.1" top_radius="0.06"',
}


def flung(shape, swapped, rng):
    """Return a deck: without friction or damping a solid falls nearly flat on a cube, a mesh."""
    R = turned([*rng.normal(size=2), 0.0], 0.05)
    if rng.uniform() < 0.5:
        R = R @ turned([0, 1, 0], 0.5 * np.pi)
    at = np.array([*rng.uniform(-0.1, 0.1, 2), 0.22])
    base = at - R @ [0.0, 0.0, 0.1]
    columns = " ".join(f'a{i}{j}="{float(R[i, j])!r}"' for j in range(3) for i in range(3))
    cube, (i, j) = trimesh.creation.box((0.2, 0.2, 0.2)), (200, 300) if swapped else (300, 200)
    markers = "".join(
        f'<Reference_Marker id="{id}" body_id="3" pos_x="{float(x)!r}" pos_y="{float(y)!r}" '
        f'pos_z="{float(z)!r}" {columns}/>'
        for id, (x, y, z) in ((30, at), (31, base))
    )
    return (
        '<MotionSolve><Model><Param_Unit force_unit="NEWTON" mass_unit="KILOGRAM" '
        'length_unit="METER" time_unit="SECOND"/><Body_Rigid id="1" isground="TRUE"/>'
        '<Body_Rigid id="2" cg_id="20" mass="1" inertia_xx="0.007" inertia_yy="0.007" '
        'inertia_zz="0.007"/><Reference_Marker id="20" body_id="2"/>'
        + mesh_graphic(200, 20, cube.vertices, cube.faces)
        + markers
        + '<Body_Rigid id="3" cg_id="30" mass="1" inertia_xx="0.006" inertia_yy="0.006" '
        'inertia_zz="0.005" v_ic_z="-1" v_ic_z_flag="TRUE"/>'
        f'<Post_Graphic id="300" {GRAPHICS[shape]} center_marker_id="31" length="0.2"/>'
        f'<Force_Contact id="1" i_graphics_id="{i}" j_graphics_id="{j}" cnf_type="HERTZ" '
        'stiffness="1e7"/></Model><Command><Simulate analysis_type="Transient" end_time="0.1" '
        'print_interval="0.05"/></Command></MotionSolve>'
    )


@pytest.mark.parametrize("swapped", [False, True])
@pytest.mark.parametrize("shape", GRAPHICS)
def test_a_hit_keeps_its_energy_as_far_as_tol_says(shape, swapped, tmp_path):
    rng = np.random.default_rng(2)
    for k in range(3):
        deck = tmp_path / f"{k}.xml"
        deck.write_text(flung(shape, swapped, rng))
        for tol in (1e-5, 1e-8):
            audit = mbsim.simulate(mbsim.read_model(deck), integrator="DOPRI5", tol=tol).audit
            assert audit.contacts[1].largest != 0.0
            assert audit.balance < 10.0 * tol * audit.of


def test_a_roller_goes_down_a_wedge():
    """found/mesh/wedge.xml: rolling without slip down a slope of 0.25 in 0.6 and off its end."""
    deck = data_file("found/mesh/wedge.xml")
    results = mbsim.simulate(mbsim.read_model(deck))
    assert results.stats["fcl_calls"] == 0
    # NumPy's reference took 7.4 s for x = 0.815115
    assert results["bodies/3/position"][-1, 0] == pytest.approx(0.81511, abs=1e-4)
    assert results.audit.balance < 1e-5 * results.audit.of
