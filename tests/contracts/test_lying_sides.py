"""Flat sides that lie: force is the slope of one energy, whatever they lie on, however cut."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from helpers import virtual_work
from helpers.pairs import frame, turned
from helpers.surfaces import PLANE, Meshed, box, call, incidents, wrench
from mbsim.geometry.catalog import GAIN, REGION_ROWS
from mbsim.model.flat_parts import fewer_triangles

STILL = frame(np.zeros(3), np.eye(3))


def ring(sections=32):
    made = trimesh.creation.annulus(0.05, 0.1, 0.1, sections=sections)
    return np.asarray(made.vertices), np.asarray(made.faces)


def angle():
    """Return an L, 0.2 m along both legs, which are 0.05 m wide; 0.1 m high."""
    outline = np.array([[0, 0], [0.2, 0], [0.2, 0.05], [0.05, 0.05], [0.05, 0.2], [0, 0.2]])
    vertices = np.vstack([np.column_stack([outline, np.full(6, z)]) for z in (-0.05, 0.05)])
    flat = np.array([[0, 1, 3], [1, 2, 3], [0, 3, 5], [3, 4, 5]])
    k = np.arange(6)
    m = (k + 1) % 6
    around = np.vstack([np.column_stack([k, m, m + 6]), np.column_stack([k, m + 6, k + 6])])
    return vertices, np.vstack([flat[:, ::-1], flat + 6, around])


MESHES = {
    "ring": Meshed(*ring()),
    "angle": Meshed(*angle()),
    "slab": Meshed(*box(0.25, 0.35, 0.2)),
}


def measured(pair, frame_i, size_i, frame_j, size_j):
    """Return energy and wrench on I about its origin for springs of stiffness 1."""
    points = call(pair, frame_i, size_i, frame_j, size_j)
    return virtual_work.measured(points, True, frame_i[:3])


def slope(pair, frame_i, size_i, frame_j, size_j):
    """Return the wrench that the energy's differences give."""
    return virtual_work.slope(lambda at: measured(pair, at, size_i, frame_j, size_j)[0], frame_i)


@pytest.mark.parametrize("tilt", [0.0, 3e-4, 1e-3, 5e-3, 0.03, 0.06, 0.09, 0.2, 0.6])
@pytest.mark.parametrize("name", ["ring", "angle", "slab"])
def test_on_a_plane_the_force_is_the_slope_of_the_energy(name, tilt):
    mesh, R = MESHES[name], turned((1.0, 0.3, 0.0), tilt)
    low = (mesh.vertices @ R.T)[:, 2].min()
    at = frame([0.01, 0.02, -low - 2e-4], R)
    _, found = measured("SURFACE-PLANE", at, mesh.size, *PLANE)
    right = slope("SURFACE-PLANE", at, mesh.size, *PLANE)
    # energies of 1e-8 are differences of depths: 1e-16 over 2e-4
    assert found == pytest.approx(right, abs=2e-7 * found[2])
    assert found[2] > 0.0


@pytest.mark.parametrize("tilt", [0.0, 1e-3, 5e-3])
@pytest.mark.parametrize(
    ("upper", "lower"),
    [("ring", "slab"), ("angle", "slab"), ("angle", "ring"), ("ring", "angle"), ("slab", "ring")],
)
def test_of_two_meshes_too_also_where_sides_hang_over(upper, lower, tilt):
    i, j = MESHES[upper], MESHES[lower]
    compared = 0
    for yaw in (0.0, 0.4, 2.0):
        R = turned((1.0, 0.3, 0.0), tilt) @ turned((0.0, 0.0, 1.0), yaw)
        height = j.vertices[:, 2].max() - (i.vertices @ R.T)[:, 2].min()
        at = frame([0.013, 0.022, height - 3e-4], R)
        _, found = measured("SURFACE-SURFACE", at, i.size, STILL, j.size)
        if not found.any():
            continue
        right = slope("SURFACE-SURFACE", at, i.size, STILL, j.size)
        compared += 1
        # crossings are drawn seen along the mean normal: off by squares of the tilt
        assert found[:3] == pytest.approx(right[:3], abs=1e-4 * found[2])
        assert found[3:] == pytest.approx(right[3:], abs=1e-5 * found[2])
    assert compared > 0


def test_lying_it_has_the_force_of_its_depth_and_one_incident():
    for pair, other in (("SURFACE-PLANE", PLANE), ("SURFACE-SURFACE", (STILL, None))):
        for name in ("ring", "angle"):
            mesh, (frame_j, size_j) = MESHES[name], other
            top = 0.0
            if size_j is None:
                size_j, top = MESHES["slab"].size, 0.1
            shift = [-0.05, -0.05] if name == "angle" else [0.0, 0.0]
            at = frame([*shift, 0.05 + top - 2e-4], np.eye(3))
            first, numbers = incidents(call(pair, at, mesh.size, frame_j, size_j))
            assert len(first) == 1
            assert first[0, [0, 7]] == pytest.approx([2e-4, 1.0], rel=1e-9)
            assert numbers[0, GAIN] == pytest.approx(1.0, rel=1e-9)


def test_on_its_corner_a_slab_has_half_of_the_force_of_that_depth_then_all():
    """Tilted about a diagonal, until its side leans: then its corner is a point as others are."""
    mesh, parts = MESHES["slab"], []
    for tilt in (0.01, 0.03, 0.2):
        R = turned((0.35, -0.25, 0.0), tilt)
        low = (mesh.vertices @ R.T)[:, 2].min()
        points = call("SURFACE-PLANE", frame([0, 0, -low - 1e-5], R), mesh.size, *PLANE)
        parts.append(wrench(points, REGION_ROWS)[2] / 1e-5)
    assert parts == pytest.approx([0.5, 0.5, 1.0], rel=1e-6)


def test_how_finely_a_border_is_cut_has_no_part():
    """The side of a ring as it is, with each edge of its rims halved, and a finer circle."""
    vertices, faces = ring()
    halved = trimesh.Trimesh(vertices, faces).subdivide()
    plain, cut, fine = Meshed(vertices, faces), Meshed(halved.vertices, halved.faces), ring(512)
    fine = Meshed(*fewer_triangles(*fine), layered=False)
    for tilt in (0.0, 1e-3, 4e-3):
        R = turned((1.0, 0.3, 0.0), tilt)
        at = frame([0.0, 0.0, 0.05 - 2e-4], R)
        found = [measured("SURFACE-PLANE", at, m.size, *PLANE)[1] for m in (plain, cut, fine)]
        assert found[1] == pytest.approx(found[0], rel=1e-9, abs=1e-15)
        assert found[2] == pytest.approx(found[0], rel=1e-2, abs=1e-8)


@pytest.mark.parametrize("sections", [24, 48, 96, 360])
def test_strips_of_a_tube_do_not_add_up(sections):
    """A tube on its side, on a facet and on an edge, has about the force of its depth."""
    vertices, faces = ring(sections)
    mesh = Meshed(vertices, faces, layered=False)
    for part in (0.0, 0.25, 0.5):
        R = turned((1.0, 0.0, 0.0), 0.5 * np.pi) @ turned(
            (0.0, 0.0, 1.0), part * 2.0 * np.pi / sections
        )
        low = (mesh.vertices @ R.T)[:, 2].min()
        for depth in (1e-6, 1e-4):
            at = frame([0.0, 0.0, -low - depth], R)
            force = wrench(call("SURFACE-PLANE", at, mesh.size, *PLANE), REGION_ROWS)[2]
            assert 0.5 * depth < force < 1.01 * depth


def test_exchanging_two_meshes_turns_the_wrench():
    (a, b), touched = (MESHES["ring"], MESHES["angle"]), 0
    for tilt in (0.0, 2e-3, -0.05):
        R = turned((1.0, 0.3, 0.0), tilt) @ turned((0.0, 0.0, 1.0), 0.4)
        height = b.vertices[:, 2].max() - (a.vertices @ R.T)[:, 2].min()
        at = frame([0.05, 0.03, height - 2e-3], R)
        there = wrench(call("SURFACE-SURFACE", at, a.size, STILL, b.size), REGION_ROWS)
        back = wrench(call("SURFACE-SURFACE", STILL, b.size, at, a.size), REGION_ROWS)
        touched += bool(there.any())
        assert there == pytest.approx(-back, rel=1e-7, abs=1e-12)
    assert touched > 1
