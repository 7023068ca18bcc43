"""Flat parts of meshes in fewer triangles: the same solid, a layer that no cut makes thin."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from helpers.mesh_parts import angle_piece, bolt, bowl, gear, plate, prism, ratchet
from helpers.pairs import frame, turned
from helpers.surfaces import call, torus
from mbsim.compile_model.surfaces import packed
from mbsim.geometry.catalog import REGION_ROWS
from mbsim.model.elements import Graphic
from mbsim.model.flat_parts import FLAT, fewer_triangles
from mbsim.model.mass_properties import polyhedron
from mbsim.model.mesh import solid_fault
from mbsim.model.surface_layer import layer
from mbsim.model.triangle_distance import nearest_on

PARTS = {
    "gear": gear(20, 2.0, 10.0, 8),
    "ratchet": ratchet(16, 40.0, 34.0, 10.0),
    "bolt": bolt(5.0, 20.0, 8.0, 6.0),
    "plate": plate(40.0, 5.5, 8.0),
    "angle": angle_piece(30.0, 10.0, 20.0),
}
TURN = turned((0.3, 1.0, 0.2), 0.7)


def finer(vertices, faces, times=1):
    for _ in range(times):
        vertices, faces = trimesh.remesh.subdivide(vertices, faces)
    return vertices, faces.astype(np.int64)


def off_surface(points, vertices, faces):
    """Return the distances of points from a mesh."""
    corners = vertices[faces]
    away = [
        np.linalg.norm(p - nearest_on(np.broadcast_to(p, (len(faces), 3)), corners), axis=1).min()
        for p in points
    ]
    return np.array(away)


@pytest.mark.parametrize("times", [1, 3, 4])
def test_a_finely_cut_box_is_twelve_triangles(times):
    box = trimesh.creation.box((0.3, 0.2, 0.05))
    vertices, faces = finer(box.vertices @ TURN.T, box.faces, times)
    few, made = fewer_triangles(vertices, faces)
    assert len(made) == 12
    assert solid_fault(few, made) == ""
    assert polyhedron(few, made).volume == pytest.approx(0.003, rel=1e-12)
    # as deep as under the box that was never cut, where the fine one's is much thinner
    assert layer(few, made).depth.min() == pytest.approx(layer(few, made).depth.max())
    assert times < 3 or layer(vertices, faces).depth.min() < 0.5 * layer(few, made).depth.min()


@pytest.mark.parametrize("name", PARTS)
@pytest.mark.parametrize("single", [False, True])
def test_a_part_stays_the_same_solid(name, single):
    vertices, faces = finer(*PARTS[name])
    vertices = vertices @ TURN.T + [100.0, 0.0, 0.0]
    if single:
        vertices = vertices.astype(np.float32).astype(float)
    few, made = fewer_triangles(vertices, faces)
    assert len(made) < 0.6 * len(faces)
    assert solid_fault(few, made) == ""
    near = FLAT * np.abs(vertices).max()
    before, after = polyhedron(vertices, faces), polyhedron(few, made)
    area = np.linalg.norm(np.cross(*np.diff(vertices[faces], axis=1).transpose(1, 0, 2)), axis=1)
    assert abs(after.volume - before.volume) < near * area.sum()
    # what stays lies where it was, what goes is on the surface that is left
    assert {tuple(p) for p in few} <= {tuple(p) for p in vertices}
    assert off_surface(vertices[:: 1 + len(vertices) // 100], few, made).max() < 4.0 * near


def test_what_bends_stays_as_it_is():
    for vertices, faces in (torus(0.3, 0.1, 24, 12), bowl(100.0, 5.0, 32, 8)):
        few, made = fewer_triangles(vertices, faces)
        assert len(made) == len(faces)
        assert len(few) == len(vertices)
    # a long, fine bend: each triangle nearly in its neighbour's plane, all of them in none
    angle = np.linspace(-1e-3, 1e-3, 201)
    rim = 50.0 * np.column_stack([np.sin(angle), np.cos(angle) - 1.0 + 1e-2])
    outline = np.vstack([rim, rim[::-1] * [1.0, 0.0] - [0.0, 1.0]])
    vertices, faces = prism(outline[::-1] + np.array([0.0, 0.25]), 0.1)
    few, made = fewer_triangles(vertices, faces)
    middle = np.abs(few[:, 0]) < 1e-3
    assert few[middle, 1].max() == vertices[:, 1].max()
    assert off_surface(vertices, few, made).max() < 2.0 * FLAT


def test_the_order_of_vertices_and_faces_changes_nothing():
    vertices, faces = finer(*PARTS["plate"])
    few, made = fewer_triangles(vertices, faces)
    rng = np.random.default_rng(3)
    moved = rng.permutation(len(vertices))
    number = np.argsort(moved)
    other = fewer_triangles(vertices[moved], number[faces][rng.permutation(len(faces))])
    np.testing.assert_array_equal(few, other[0])
    np.testing.assert_array_equal(made, other[1])


@pytest.mark.parametrize("pair", ["SURFACE-SURFACE", "FIELD-FIELD"])
def test_a_part_with_flat_sides_presses_as_hard_however_it_is_cut(pair):
    forces = []
    for times in (0, 1, 3):
        sides = []
        for part in (angle_piece(30.0, 10.0, 20.0), plate(40.0, 5.5, 8.0)):
            vertices, faces = finer(*part, times)
            graphic = Graphic(id=1, shape="MESH", vertices=vertices, faces=faces)
            data = packed(graphic, layered=True)
            sides.append((data, np.array([0.0, 0.0, 0.0, data.ctypes.data])))
        at = frame([3.0, 9.0, 9.9], turned((1.0, 0.2, 0.1), 0.02))
        points = call(pair, at, sides[0][1], frame(np.zeros(3), np.eye(3)), sides[1][1])
        first = points[::REGION_ROWS]
        first = first[first[:, 0] > 0.0]
        forces.append((first[:, 0] * first[:, 7]) @ first[:, 4:7])
    assert np.linalg.norm(forces[0]) > 0.0
    for force in forces[1:]:
        assert np.linalg.norm(force - forces[0]) < 1e-2 * np.linalg.norm(forces[0])
