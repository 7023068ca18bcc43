"""contact_depth="FIELD": force and torque are the slopes of a potential found by other means."""

from __future__ import annotations

import ctypes

import numpy as np
import pytest
import trimesh

from helpers.fields import Shape, box_planes, potential, sliced, slopes, wrench
from helpers.pairs import frame, random_rotation, turned
from helpers.surfaces import Meshed, sphere
from mbsim.compile_model.contacts import pair_address
from mbsim.geometry.catalog import PAIRS, POINT
from mbsim.model.smooth_facets import smooth


def box():
    half = np.array([0.5, 0.4, 0.3])
    mesh = trimesh.creation.box(2.0 * half)
    return Shape(mesh.vertices, mesh.faces, [box_planes(-half, half)])


def l_shape():
    corners = [(0, 0), (3, 0), (3, 1), (1, 1), (1, 3), (0, 3)]
    vertices = [[x, y, z] for z in (0.0, 1.0) for x, y in corners]
    cap = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5]])
    walls = [[[k, (k + 1) % 6, (k + 1) % 6 + 6], [k, (k + 1) % 6 + 6, k + 6]] for k in range(6)]
    faces = np.concatenate([cap[:, ::-1], cap + 6, np.array(walls).reshape(-1, 3)])
    pieces = [box_planes((0, 0, 0), (3, 1, 1)), box_planes((0, 1, 0), (1, 3, 1))]
    return Shape(vertices, faces, pieces)


def icosphere(level):
    mesh = trimesh.creation.icosphere(level)
    return Shape(mesh.vertices, mesh.faces)


def asked(name, frame_i, size_i, frame_j, size_j):
    """Return whether the depth of the overlap is known, and the rows of a pair."""
    points = np.full((PAIRS[name].slots, POINT), np.nan)
    call = ctypes.CFUNCTYPE(ctypes.c_int64, *[ctypes.c_void_p] * 5)(pair_address(PAIRS[name]))
    count = call(*[array.ctypes.data for array in (frame_i, size_i, frame_j, size_j, points)])
    assert abs(count) == len(points)
    return count > 0, points


def rows(*given):
    return asked(*given)[1]


@pytest.mark.parametrize("made", [box, l_shape, lambda: icosphere(1)], ids=["box", "L", "sphere"])
def test_on_a_plane_force_and_torque_are_slopes_of_the_potential(made):
    shape, rng = made(), np.random.default_rng(11)
    for _ in range(4):
        R = random_rotation(rng)
        low = (shape.vertices @ R.T)[:, 2].min()
        p = np.array([rng.normal(), rng.normal(), 0.7 - low - rng.uniform(0.72, 1.1)])

        def energy(p, R):
            return sliced(shape.vertices @ R.T + p, shape.faces, 0.7)[1]

        volume, whole = sliced(shape.vertices @ R.T + p, shape.faces, 0.7)
        plane = frame(np.array([0.0, 0.0, 0.7]), np.eye(3))
        points = rows("FIELD-PLANE", frame(p, R), shape.size, plane, np.zeros(4))
        force, torque, stored = wrench(points, p)
        found = slopes(energy, p, R, turned, 1e-4)
        scale = np.linalg.norm(force)
        np.testing.assert_allclose(force, found[0], atol=1e-6 * scale)
        np.testing.assert_allclose(torque, found[1], atol=1e-6 * scale)
        np.testing.assert_allclose(force[2], volume, rtol=1e-10)
        np.testing.assert_allclose(stored, whole, rtol=1e-10)


@pytest.mark.parametrize("made", [box, l_shape], ids=["box", "L"])
def test_of_two_meshes_force_and_torque_are_slopes_of_the_potential(made):
    i, j, rng = box(), made(), np.random.default_rng(7)
    spots = [(1.0, 0.9, 1.2), (0.5, 2.0, 1.2), (1.2, 1.2, 0.5), (2.9, 0.5, 1.1)]
    spots = spots if made is l_shape else [(0.1, 0.2, 0.5), (0.5, 0.4, 0.4)]
    met = exact = 0
    for spot in spots:
        R = turned(rng.normal(size=3), 0.3 * rng.normal())
        p = np.array(spot) + 0.02 * rng.normal(size=3)
        still = frame(np.zeros(3), np.eye(3))
        known, points = asked("FIELD-FIELD", frame(p, R), i.size, still, j.size)
        force, torque, stored = wrench(points, p)
        if known:
            exact += 1
            assert stored == pytest.approx(potential(i, j, p, R), rel=1e-9)
        found = slopes(lambda p, R: potential(i, j, p, R), p, R, turned, 1e-4)
        scale = np.linalg.norm(found[0])
        met += scale > 0.0
        np.testing.assert_allclose(force, found[0], atol=1e-6 * scale)
        np.testing.assert_allclose(torque, found[1], atol=1e-6 * scale)
    assert met == len(spots)
    assert exact > 0


def test_an_overlap_that_reaches_below_the_layer_is_told():
    shape = box()
    still = frame(np.zeros(3), np.eye(3))
    for overlap, known in ((0.2, True), (0.34, False)):
        above = frame(np.array([0.02, 0.01, 0.6 - overlap]), np.eye(3))
        assert asked("FIELD-FIELD", above, shape.size, still, shape.size)[0] == known


def test_the_force_is_of_second_order_in_the_edges_of_a_sphere():
    errors = []
    d = 0.05
    exact = np.pi * d**2 * (1.0 - d / 3.0)
    rng = np.random.default_rng(2)
    turns = [random_rotation(rng) for _ in range(8)]
    plane = frame(np.zeros(3), np.eye(3))
    for level in (3, 4, 5):
        shape = icosphere(level)
        forces = [
            wrench(
                rows(
                    "FIELD-PLANE", frame(np.array([0, 0, 1.0 - d]), R), shape.size, plane,
                    np.zeros(4),
                ),
                np.zeros(3),
            )[0][2]
            for R in turns
        ]  # fmt: skip
        errors.append(1.0 - np.mean(forces) / exact)
    orders = np.log2(np.array(errors[:-1]) / np.array(errors[1:]))
    np.testing.assert_allclose(orders, 2.0, atol=0.2)
    assert abs(errors[1]) < 0.04


@pytest.mark.parametrize(("level", "smoothed", "most"), [(6, False, 3e-3), (4, True, 2e-3)])
def test_the_force_of_a_fine_or_a_smooth_sphere_is_that_of_the_true_one(level, smoothed, most):
    """81,920 flat triangles, or 5120 that are rounded: a sphere of radius 1, 0.05 deep."""
    vertices, faces = sphere(1.0, level)
    if smoothed:
        vertices, faces = smooth(vertices, faces)
    mesh, d, rng = Meshed(vertices, faces, layered=False), 0.05, np.random.default_rng(2)
    exact = np.pi * d**2 * (1.0 - d / 3.0)
    plane = frame(np.zeros(3), np.eye(3))
    for _ in range(8):
        pose = frame(np.array([0.0, 0.0, 1.0 - d]), random_rotation(rng))
        force, _, _ = wrench(rows("FIELD-PLANE", pose, mesh.size, plane, np.zeros(4)), np.zeros(3))
        assert force[2] == pytest.approx(exact, rel=most)
