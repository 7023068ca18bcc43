"""Mass properties: closed forms, polyhedra and their combination against each other."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mbsim.model import mass_properties as mp
from mbsim.model.elements import Graphic
from mbsim.model.frames import rotation_313
from mbsim.model.mesh import merge_vertices, solid_fault

CUBE_VERTICES = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float)
CUBE_FACES = np.array(
    [
        [0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
        [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3],
    ]
)  # fmt: skip


def agree(a: mp.MassProperties, b: mp.MassProperties, rtol: float) -> None:
    """Assert that two sets of properties are equal relative to their size."""
    assert a.volume == pytest.approx(b.volume, rel=rtol)
    length = abs(b.volume) ** (1.0 / 3.0)
    np.testing.assert_allclose(a.centre, b.centre, rtol=rtol, atol=rtol * length)
    scale = float(np.abs(b.inertia).max())
    np.testing.assert_allclose(a.inertia, b.inertia, rtol=0, atol=rtol * scale)


def cylinder_mesh(n: int) -> tuple[np.ndarray, np.ndarray]:
    """Return a closed prism of n sides in the unit cylinder of length 2 about z."""
    angles = 2.0 * math.pi * np.arange(n) / n
    ring = np.column_stack([np.cos(angles), np.sin(angles)])
    vertices = np.vstack(
        [np.column_stack([ring, np.full(n, z)]) for z in (-1.0, 1.0)] + [[[0, 0, -1], [0, 0, 1]]]
    )
    k, after = np.arange(n), (np.arange(n) + 1) % n
    low, high = np.full(n, 2 * n), np.full(n, 2 * n + 1)
    faces = np.vstack(
        [
            np.column_stack([k, after, after + n]),
            np.column_stack([k, after + n, k + n]),
            np.column_stack([low, after, k]),
            np.column_stack([high, k + n, after + n]),
        ]
    )
    return vertices, faces


def test_closed_forms() -> None:
    ball = mp.sphere(0.5)
    assert ball.volume == pytest.approx(math.pi / 6.0, rel=1e-15)
    assert ball.inertia[0, 0] == pytest.approx(0.4 * ball.volume * 0.25, rel=1e-15)
    block = mp.box(1.0, 2.0, 3.0)
    np.testing.assert_allclose(np.diag(block.inertia), (6.5, 5.0, 2.5), rtol=1e-15)
    rod = mp.cylinder(0.1, 2.0)
    assert rod.inertia[2, 2] == pytest.approx(rod.volume * 0.01 / 2.0, rel=1e-15)
    assert rod.inertia[0, 0] == pytest.approx(rod.volume * (0.03 + 4.0) / 12.0, rel=1e-15)


def test_polyhedron_is_exact_for_a_box() -> None:
    vertices = CUBE_VERTICES * (1.0, 2.0, 3.0)
    assert solid_fault(vertices, CUBE_FACES) == ""
    expected = mp.box(1.0, 2.0, 3.0)._replace(centre=np.array([0.5, 1.0, 1.5]))
    agree(mp.polyhedron(vertices, CUBE_FACES), expected, 1e-14)


def test_polyhedron_of_a_tetrahedron() -> None:
    """Corner tetrahedron: V = 1/6, centre 1/4, integral x^2 = 1/60, integral x y = 1/120."""
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=float)
    faces = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    found = mp.polyhedron(vertices, faces)
    second = np.full((3, 3), 1.0 / 120.0) + np.eye(3) / 120.0
    second -= np.full((3, 3), 1.0 / 96.0)  # V c c' with c = 1/4
    expected = np.trace(second) * np.eye(3) - second
    agree(found, mp.MassProperties(1.0 / 6.0, np.full(3, 0.25), expected), 1e-14)


def test_polyhedra_tend_to_the_closed_form() -> None:
    errors = []
    exact = mp.cylinder(1.0, 2.0)
    for n in (32, 64, 128):
        found = mp.polyhedron(*cylinder_mesh(n))
        errors.append(np.abs(found.inertia - exact.inertia).max())
    # the error of an inscribed n-gon falls with n^2
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.01)
    assert errors[1] / errors[2] == pytest.approx(4.0, rel=0.01)


def test_frustum() -> None:
    agree(mp.frustum(1.3, 1.3, 2.0), mp.cylinder(1.3, 2.0), 1e-14)
    # a cone: V = pi r^2 l/3, centre a quarter up, I_z = 3/10 m r^2, I_x = 3/80 m (4 r^2 + l^2)
    cone = mp.frustum(1.0, 0.0, 2.0)
    assert cone.volume == pytest.approx(2.0 * math.pi / 3.0, rel=1e-14)
    assert cone.centre[2] == pytest.approx(-0.5, rel=1e-14)
    moments = cone.volume * np.array([0.3, 0.3, 0.3])
    np.testing.assert_allclose(np.diag(cone.inertia), moments, rtol=1e-14)
    # and the polyhedron around any other tends to it
    vertices, faces = cylinder_mesh(4096)
    vertices[:, :2] *= np.where(vertices[:, 2:] > 0.0, 0.4, 0.9)
    agree(mp.polyhedron(vertices, faces), mp.frustum(0.9, 0.4, 2.0), 2e-6)


def test_agrees_with_trimesh_on_a_torus() -> None:
    import trimesh

    torus = trimesh.creation.torus(0.1, 0.03, major_sections=72, minor_sections=36)
    found = mp.polyhedron(np.array(torus.vertices), np.array(torus.faces))
    theirs = mp.MassProperties(
        float(torus.volume), np.array(torus.center_mass), np.array(torus.moment_inertia)
    )
    agree(found, theirs, 1e-10)


@settings(max_examples=50, deadline=None)
@given(st.lists(st.floats(-3.0, 3.0), min_size=6, max_size=6))
def test_moving_a_mesh_moves_its_properties(numbers: list[float]) -> None:
    R = rotation_313(*numbers[:3])
    p = np.array(numbers[3:])
    vertices = CUBE_VERTICES * (1.0, 2.0, 3.0)
    turned = mp.polyhedron(p + vertices @ R.T, CUBE_FACES)
    agree(turned, mp.moved(mp.polyhedron(vertices, CUBE_FACES), p, R), 1e-12)


def test_two_half_boxes_are_one_box() -> None:
    half = mp.box(0.5, 2.0, 3.0)
    parts = [half._replace(centre=np.array([x, 0.0, 0.0])) for x in (-0.25, 0.25)]
    agree(mp.combined(parts), mp.box(1.0, 2.0, 3.0), 1e-15)


def test_graphic_offset_and_plane() -> None:
    base = Graphic(id=1, shape="CYLINDER", size=(1.0, 4.0), offset=(0.0, 0.0, 2.0))
    np.testing.assert_array_equal(mp.of_graphic(base).centre, (0.0, 0.0, 2.0))
    with pytest.raises(ValueError, match="no volume"):
        mp.of_graphic(Graphic(id=2, type="Plane", shape="PLANE"))


def test_merging_makes_a_soup_of_triangles_one_surface() -> None:
    soup = CUBE_VERTICES[CUBE_FACES].reshape(-1, 3)
    soup[soup == 0.0] *= -1.0  # 0 and -0 are one place
    loose = np.arange(36).reshape(12, 3)
    assert "open: 36 edges" in solid_fault(soup, loose)
    vertices, faces = merge_vertices(soup, loose)
    assert (len(vertices), len(faces)) == (8, 12)
    assert solid_fault(vertices, faces) == ""


@pytest.mark.parametrize(
    ("faces", "message"),
    [
        (CUBE_FACES[:-1], "3 edges belong to one triangle only"),
        (CUBE_FACES[:, ::-1], "turned inside out: its enclosed volume is -1"),
        (np.vstack([CUBE_FACES[:-1], CUBE_FACES[-1:, ::-1]]), "winding is not consistent"),
        (np.vstack([CUBE_FACES, CUBE_FACES[:1]]), "3 or more triangles"),
        (CUBE_FACES[:0], "no triangles"),
    ],
    ids=["open", "inside out", "winding", "crowded", "empty"],
)
def test_what_is_no_solid(faces: np.ndarray, message: str) -> None:
    assert message in solid_fault(CUBE_VERTICES, faces)
