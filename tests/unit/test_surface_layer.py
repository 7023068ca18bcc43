"""The layer under a mesh's surface: upright, one deep, and psi the distance under flat faces."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import trimesh

from helpers.folders import data_file
from mbsim.model.mesh_file import load_mesh
from mbsim.model.surface_layer import inner_directions, layer, tetrahedra, volumes

Mesh = tuple[Any, Any]


def made(mesh: trimesh.Trimesh) -> Mesh:
    return np.array(mesh.vertices, dtype=float), np.array(mesh.faces, dtype=np.int64)


def subdivided_box() -> trimesh.Trimesh:
    box = trimesh.creation.box((1.0, 1.0, 1.0))
    for _ in range(4):
        box = box.subdivide()
    return box


def l_shape(long: float = 3.0, thick: float = 1.0) -> Mesh:
    """An L, extruded: one reentrant edge."""
    corners = [(0, 0), (long, 0), (long, thick), (thick, thick), (thick, long), (0, long)]
    vertices = np.array([[x, y, z] for z in (0.0, 1.0) for x, y in corners], dtype=float)
    cap = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5]])
    walls = [[[k, (k + 1) % 6, (k + 1) % 6 + 6], [k, (k + 1) % 6 + 6, k + 6]] for k in range(6)]
    return vertices, np.concatenate([cap[:, ::-1], cap + 6, np.array(walls).reshape(-1, 3)])


SHAPES = {
    "box": lambda: made(trimesh.creation.box((1.0, 2.0, 3.0))),
    "box of 3072": lambda: made(subdivided_box()),
    "thin plate": lambda: made(trimesh.creation.box((1.0, 1.0, 1e-3))),
    "icosphere": lambda: made(trimesh.creation.icosphere(3)),
    "torus": lambda: made(trimesh.creation.torus(1.0, 0.3)),
    "sharp cone": lambda: made(trimesh.creation.cone(0.1, 1.0)),
    "annulus": lambda: made(trimesh.creation.annulus(0.5, 1.0, 0.2)),
    "L": l_shape,
    "thin L": lambda: l_shape(3.0, 0.05),
}
FILES = ["L.stl", "bolt.stl", "gearA.stl", "plate.stl", "torus.stl"]


@pytest.fixture(params=[*SHAPES, *FILES])
def mesh(request: pytest.FixtureRequest) -> Mesh:
    if request.param in SHAPES:
        return SHAPES[request.param]()
    return load_mesh(data_file(f"found/mesh/meshes/{request.param}"))[:2]


def coordinates(points: Any, cut: Any, x: Any) -> Any:
    """Return the barycentric coordinates of a point in every tetrahedron, shape (k, 4)."""
    p = points[cut]
    matrix = np.concatenate([p.transpose(0, 2, 1), np.ones((len(cut), 1, 4))], axis=1)
    return np.linalg.solve(matrix, np.broadcast_to([*x, 1.0], (len(cut), 4))[..., None])[..., 0]


def test_all_tetrahedra_are_upright(mesh: Mesh) -> None:
    vertices, faces = mesh
    inner, depth = layer(vertices, faces)
    assert (depth > 0.0).all()
    assert (volumes(np.concatenate([vertices, inner]), tetrahedra(faces)) > 0.0).all()


def test_layers_from_opposite_sides_do_not_overlap(mesh: Mesh) -> None:
    vertices, faces = mesh
    inner, _ = layer(vertices, faces)
    cut, points = tetrahedra(faces), np.concatenate([vertices, inner])
    generator = np.random.default_rng(5)
    for tetrahedron in generator.integers(0, len(cut), 60).tolist():
        x = generator.dirichlet(np.ones(4)) @ points[cut[tetrahedron]]
        holds = (coordinates(points, cut, x) > 1e-9).all(axis=1)
        assert np.flatnonzero(holds).tolist() == [tetrahedron]


@pytest.mark.parametrize("shape", ["box", "box of 3072", "thin plate"])
def test_psi_is_the_distance_below_the_faces_of_a_box(shape: str) -> None:
    vertices, faces = SHAPES[shape]()
    inner, depth = layer(vertices, faces)
    half = np.ptp(vertices, axis=0) / 2.0
    below = (half - np.abs(inner)).min(axis=1)
    np.testing.assert_allclose(below, depth, rtol=1e-12)
    psi = np.concatenate([np.zeros(len(vertices)), depth])
    points, cut = np.concatenate([vertices, inner]), tetrahedra(faces)
    middles = points[cut].mean(axis=1)
    near = half - np.abs(middles)
    np.testing.assert_allclose(psi[cut].mean(axis=1), near.min(axis=1), rtol=1e-9)


def test_the_layer_is_as_deep_as_a_part_of_the_thickness() -> None:
    vertices, faces = SHAPES["thin plate"]()
    assert layer(vertices, faces).depth.min() > 0.3e-3
    vertices, faces = l_shape(3.0, 0.05)
    assert layer(vertices, faces).depth.min() > 0.25 * 0.05


def test_a_corner_is_solved_exactly_however_its_sides_are_cut() -> None:
    for shape in ("box", "box of 3072"):
        vertices, faces = SHAPES[shape]()
        m, least = inner_directions(vertices, faces)
        corner = np.isclose(np.abs(vertices), np.ptp(vertices, axis=0) / 2.0).all(axis=1)
        np.testing.assert_allclose(m[corner], np.sign(vertices[corner]), atol=1e-12)
        np.testing.assert_allclose(least, 1.0, rtol=1e-12)


def test_the_order_of_the_faces_changes_nothing() -> None:
    vertices, faces = l_shape()
    generator = np.random.default_rng(3)
    one = layer(vertices, faces)
    shuffled = np.roll(faces[generator.permutation(len(faces))], 1, axis=1)
    other = layer(vertices, shuffled)
    assert (other.depth == one.depth).all()
    assert (other.inner == one.inner).all()
