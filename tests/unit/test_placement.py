"""Placement: marker parents, body frames, mass and inertia, velocities and the extent."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from helpers.minimal_deck import BODY_LINE, MINIMAL, TETRAHEDRON, added, deck, read
from mbsim.errors import DeckError
from mbsim.model.elements import Body, Marker, Model, Units
from mbsim.model.frames import marker_frames, quaternion, rotation_313
from mbsim.model.placement import place

INERTIA = 'inertia_xx="0.02" inertia_yy="0.02" inertia_zz="0.02"'
QUARTER = f'psi="{math.pi / 2!r}"'


def test_sample_ball(tmp_path: Path) -> None:
    placement = place(read(tmp_path, MINIMAL))
    assert list(placement.bodies) == [2]
    ball = placement.bodies[2]
    np.testing.assert_array_equal(ball.p, (0.0, 0.0, 0.108))
    np.testing.assert_array_equal(ball.q, (1.0, 0.0, 0.0, 0.0))
    np.testing.assert_array_equal(ball.inertia, 0.02 * np.eye(3))
    assert ball.mass == 5.0
    # 0.216 in each direction, and the ground marker in the middle of the base
    assert pytest.approx(0.216 * math.sqrt(3.0), rel=1e-15) == placement.L


def test_mass_is_scaled_to_the_unit_of_force(tmp_path: Path) -> None:
    mm = deck(('length_unit="METER"', 'length_unit="MILLIMETER"'))
    ball = place(read(tmp_path, mm)).bodies[2]
    assert ball.mass == pytest.approx(5e-3, rel=1e-15)
    np.testing.assert_allclose(ball.inertia, 2e-5 * np.eye(3), rtol=1e-15)


def test_marker_parents(tmp_path: Path) -> None:
    """Global without lprf_id; in the LPRF with it; rm_id goes before both."""
    text = deck(
        ('cg_id="20"', 'cg_id="20" lprf_id="30"'),
        (
            "</Model>",
            f'<Reference_Marker id="30" body_id="2" pos_x="1" {QUARTER}/>'
            '<Reference_Marker id="31" body_id="2" pos_x="2"/>'
            '<Reference_Marker id="32" body_id="2" rm_id="10" pos_x="2"/>'
            '<Reference_Marker id="33" body_id="1" rm_id="31" pos_x="1"/></Model>',
        ),
    )
    markers = place(read(tmp_path, text)).markers
    expected = {10: (0, 0, 0), 20: (1, 0, 0.108), 30: (1, 0, 0), 31: (1, 2, 0), 32: (2, 0, 0)}
    expected[33] = (1, 3, 0)
    for id, position in expected.items():
        np.testing.assert_allclose(markers[id].p, position, rtol=0, atol=1e-15)
    # in its body's frame, whose axes are those of the cg marker: turned by 90 degrees
    np.testing.assert_allclose(markers[32].p_B, (0.0, -1.0, -0.108), rtol=0, atol=1e-15)
    np.testing.assert_array_equal(markers[20].p_B, np.zeros(3))
    np.testing.assert_allclose(markers[20].R_B, np.eye(3), rtol=0, atol=1e-15)
    # ground's frame is the global one
    np.testing.assert_array_equal(markers[33].p_B, markers[33].p)


def test_inertia_sign_and_im_marker(tmp_path: Path) -> None:
    """inertia_xy is +integral xy dm, so two masses on x = y make it positive."""
    # 2 masses of 1 at +-(1, 1, 0) and 2 of 1/2 at +-(0, 0, 1)
    values = 'inertia_xx="3" inertia_yy="3" inertia_zz="4" inertia_xy="2"'
    text = deck((INERTIA, values), ('mass="5"', 'mass="3"'))
    inertia = place(read(tmp_path, text)).bodies[2].inertia
    np.testing.assert_array_equal(inertia, [[3, -2, 0], [-2, 3, 0], [0, 0, 4]])

    # the same body, about a marker one off in x and turned by 90 degrees about z:
    # in its axes (x, y) -> (y, -x), so xx and yy change places and xy changes sign
    moved = deck(
        (INERTIA, 'im_id="21" inertia_xx="6" inertia_yy="3" inertia_zz="7" inertia_xy="-2"'),
        ('mass="5"', 'mass="3"'),
        (
            "</Model>",
            f'<Reference_Marker id="21" body_id="2" pos_x="1" pos_z="0.108" {QUARTER}/></Model>',
        ),
    )
    again = place(read(tmp_path, moved)).bodies[2].inertia
    np.testing.assert_allclose(again, inertia, rtol=0, atol=1e-14)


def test_velocities_are_resolved_in_their_markers(tmp_path: Path) -> None:
    velocities = 'v_ic_x="2" v_ic_x_flag="TRUE" w_ic_x="3" w_ic_x_flag="TRUE" vm_id="21" wm_id="10"'
    text = deck(
        ('cg_id="20"', f'cg_id="20" {velocities}'),
        ("</Model>", f'<Reference_Marker id="21" body_id="1" {QUARTER}/></Model>'),
    )
    ball = place(read(tmp_path, text)).bodies[2]
    np.testing.assert_allclose(ball.v, (0.0, 2.0, 0.0), rtol=0, atol=1e-15)
    np.testing.assert_array_equal(ball.w, (3.0, 0.0, 0.0))


def test_mass_from_density(tmp_path: Path) -> None:
    text = deck((f'mass="5" {INERTIA}', 'density="1000"'))
    ball = place(read(tmp_path, text)).bodies[2]
    mass = 1000.0 * 4.0 / 3.0 * math.pi * 0.108**3
    assert ball.mass == pytest.approx(mass, rel=1e-14)
    np.testing.assert_allclose(ball.inertia, 0.4 * mass * 0.108**2 * np.eye(3), rtol=1e-14)


def test_inertia_from_graphics_scaled_to_the_mass(tmp_path: Path) -> None:
    ball = place(read(tmp_path, deck((" " + INERTIA, "")))).bodies[2]
    assert ball.mass == 5.0
    np.testing.assert_allclose(ball.inertia, 0.4 * 5.0 * 0.108**2 * np.eye(3), rtol=1e-14)


@pytest.mark.parametrize(
    ("replacements", "words"),
    [
        ([(f'mass="5" {INERTIA}', "")], "mass: missing; give mass, or density"),
        (
            [(f'mass="5" {INERTIA}', 'density="10"'), ('"20" radius', '"10" radius')],
            "density=10: the body has no solid graphics",
        ),
        (
            [(INERTIA, ""), ('"20" radius', '"10" radius')],
            "inertia_xx, inertia_yy, inertia_zz: missing",
        ),
        (
            [
                (INERTIA, ""),
                ('center_marker_id="20"', 'center_marker_id="21"'),
                ("</Model>", '<Reference_Marker id="21" body_id="2" pos_x="1"/></Model>'),
            ],
            "centre of its graphics is at (1, 0, -0.108) of the cg marker",
        ),
    ],
    ids=["no mass", "no graphics", "no inertia", "off centre"],
)
def test_mass_that_cannot_be(
    tmp_path: Path, replacements: list[tuple[str, str]], words: str
) -> None:
    with pytest.raises(DeckError) as caught:
        read(tmp_path, deck(*replacements))
    fault = next(fault for fault in caught.value.faults if words in fault.message)
    assert (fault.line, fault.element) == (BODY_LINE, "Body_Rigid[2]")


def test_mass_from_an_open_mesh_is_refused(tmp_path: Path) -> None:
    mesh = TETRAHEDRON.replace("1 2 3</Faces>", "</Faces>")
    text = deck(
        (INERTIA, ""),
        ('type="Sphere" center_marker_id="20" radius="0.108"/>', 'type="Plane" rm_id="20"/>'),
        (
            "</Model>",
            f'<Post_Graphic id="9" type="TriaMesh" rm_id="20">{mesh}</Post_Graphic></Model>',
        ),
    )
    with pytest.raises(DeckError, match=r"Body_Rigid\[2\]: no mass .* Post_Graphic\[9\].* open"):
        read(tmp_path, text)


@pytest.mark.parametrize(
    "graphic",
    [
        'type="Cylinder" center_marker_id="21" radius="3" length="8"',
        'type="Ellipsoid" center_marker_id="21" x_scale="5" y_scale="3" z_scale="4"',
        'type="BoxDefinedFromCorner" corner_marker_id="21" length_x="9" length_y="3" length_z="4"',
    ],
    ids=["cylinder", "ellipsoid", "box"],
)
def test_extent_bounds_the_surface_tightly(tmp_path: Path, graphic: str) -> None:
    """Points spread over the surface stay inside the box and come near all its sides."""
    text = added(
        '<Reference_Marker id="21" body_id="1" psi="0.4" theta="0.9" phi="1.3"/>\n'
        f'<Post_Graphic id="9" {graphic}/>'
    )
    model = read(tmp_path, text)
    placement = place(model)
    shape, size, offset = (getattr(model.graphics[9], k) for k in ("shape", "size", "offset"))
    u = np.random.default_rng(7).normal(size=(400_000, 3))
    if shape == "ELLIPSOID":
        points = u / np.linalg.norm(u, axis=1)[:, None] * size
    elif shape == "BOX":
        points = np.sign(u) * np.array(size) / 2.0
    else:
        rim = u[:, :2] / np.linalg.norm(u[:, :2], axis=1)[:, None] * size[0]
        points = np.column_stack([rim, np.sign(u[:, 2]) * size[1] / 2.0])
    points = (points + offset) @ placement.markers[21].R.T

    # the ball of the minimal deck is in the box too
    lower = np.minimum(points.min(axis=0), (-0.108, -0.108, 0.0))
    upper = np.maximum(points.max(axis=0), (0.108, 0.108, 0.216))
    np.testing.assert_allclose(placement.lower, lower, rtol=0, atol=2e-4)
    np.testing.assert_allclose(placement.upper, upper, rtol=0, atol=2e-4)
    assert (placement.upper >= upper - 1e-12).all()
    assert (placement.lower <= lower + 1e-12).all()
    diagonal = np.linalg.norm(placement.upper - placement.lower)
    assert pytest.approx(diagonal, rel=1e-15) == placement.L


def test_extent_of_a_point_is_one() -> None:
    model = Model("m", "m.xml", "", Units(), {1: Body(1, is_ground=True)}, {}, {}, {})
    assert place(model).L == 1.0


def test_models_made_by_hand_are_refused_too() -> None:
    markers = {1: Marker(1, body_id=1, rm_id=2), 2: Marker(2, body_id=1, rm_id=1)}
    model = Model("m", "m.xml", "", Units(), {1: Body(1, is_ground=True)}, markers, {}, {})
    with pytest.raises(DeckError, match=r"Reference_Marker\[1\]: has no place"):
        place(model)
    moving = Model("m", "m.xml", "", Units(), {3: Body(3, mass=1.0)}, {}, {}, {})
    with pytest.raises(DeckError, match=r"Body_Rigid\[3\]: cg_id: missing"):
        place(moving)


@settings(max_examples=200, deadline=None)
@given(st.lists(st.floats(-7.0, 7.0), min_size=3, max_size=3))
def test_quaternion_gives_the_matrix_back(angles: list[float]) -> None:
    R = rotation_313(*angles)
    w, x, y, z = q = quaternion(R)
    assert np.linalg.norm(q) == pytest.approx(1.0, rel=1e-15)
    assert w >= 0.0
    v = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    np.testing.assert_allclose(np.eye(3) + 2.0 * w * v + 2.0 * v @ v, R, rtol=0, atol=3e-15)


def without_cg(more: str = "", body: str = 'density="1000"') -> str:
    """Return a deck whose body 2 has no cg marker, and more statements."""
    text = deck((f'cg_id="20" mass="5" {INERTIA}', body))
    return text.replace("</Model>", f"{more}</Model>", 1)


def test_centre_of_mass_from_density_and_graphics(tmp_path: Path) -> None:
    """Two balls and a mesh, against a cg marker typed in at their centre."""
    more = (
        '<Reference_Marker id="21" body_id="2" pos_x="2" pos_y="-1" psi="0.3" theta="0.4"/>'
        '<Post_Graphic id="8" type="Sphere" center_marker_id="21" radius="0.2"/>'
        f'<Post_Graphic id="9" type="TriaMesh" rm_id="21">{TETRAHEDRON}</Post_Graphic>'
    )
    found = place(read(tmp_path, without_cg(more))).bodies[2]
    x, y, z = (float(value) for value in found.p)
    marker = f'<Reference_Marker id="22" body_id="2" pos_x="{x!r}" pos_y="{y!r}" pos_z="{z!r}"/>'
    typed = place(read(tmp_path, without_cg(more + marker, 'cg_id="22" density="1000"'))).bodies[2]
    assert found.mass == pytest.approx(typed.mass, rel=1e-14)
    np.testing.assert_allclose(found.inertia, typed.inertia, rtol=1e-13, atol=1e-12)
    np.testing.assert_array_equal(found.R, np.eye(3))
    # the mean of the parts' centres, weighted by volume
    balls = [4.0 / 3.0 * math.pi * r**3 for r in (0.108, 0.2)]
    R = marker_frames(read(tmp_path, without_cg(more)))[21].R
    centres = np.array([[0, 0, 0.108], [2, -1, 0], [2, -1, 0] + R @ np.full(3, 0.25)])
    volumes = np.array([*balls, 1.0 / 6.0])
    np.testing.assert_allclose(found.p, volumes @ centres / volumes.sum(), rtol=1e-14)


def test_markers_of_a_body_without_a_cg_marker_move_with_it(tmp_path: Path) -> None:
    placed = place(read(tmp_path, without_cg('<Reference_Marker id="21" body_id="2" pos_x="1"/>')))
    np.testing.assert_allclose(placed.markers[21].p_B, (1.0, 0.0, -0.108), rtol=0, atol=1e-15)


def test_axes_of_a_body_without_a_cg_marker_are_those_of_lprf_id(tmp_path: Path) -> None:
    more = f'<Reference_Marker id="21" body_id="2" pos_x="4" {QUARTER}/>'
    found = place(read(tmp_path, without_cg(more, 'density="1000" lprf_id="21"'))).bodies[2]
    np.testing.assert_allclose(found.p, (4.0, 0.0, 0.108), rtol=1e-14)
    np.testing.assert_allclose(found.R[:, 0], (0.0, 1.0, 0.0), rtol=0, atol=1e-15)


def test_a_mesh_far_away_keeps_its_digits(tmp_path: Path) -> None:
    ball = 'type="Sphere" center_marker_id="20" radius="0.108"/>'
    mesh = f'type="TriaMesh" rm_id="21">{TETRAHEDRON}</Post_Graphic>'
    marker = '<Reference_Marker id="21" body_id="2" pos_x="1e6"/>'
    text = without_cg(marker).replace(ball, mesh)
    found = place(read(tmp_path, text)).bodies[2]
    np.testing.assert_allclose(np.diag(found.inertia), np.full(3, 1000.0 / 80.0), rtol=1e-13)


def test_given_mass_with_the_centre_of_the_graphics(tmp_path: Path) -> None:
    found = place(read(tmp_path, without_cg(body='density="1" mass="5"'))).bodies[2]
    assert found.mass == 5.0
    np.testing.assert_allclose(found.p, (0.0, 0.0, 0.108), rtol=1e-15)
    np.testing.assert_allclose(found.inertia, 0.4 * 5.0 * 0.108**2 * np.eye(3), rtol=1e-13)


@pytest.mark.parametrize(
    ("body", "words"),
    [
        (f'mass="5" {INERTIA}', "cg_id: missing; a moving body needs .* or density and solid"),
        ('density="1"', "density=1: the body has no solid graphics"),
        ('density="1" lprf_id="77"', 'lprf_id="77": no Reference_Marker has this id'),
    ],
)
def test_a_centre_of_mass_that_cannot_be_known(tmp_path: Path, body: str, words: str) -> None:
    text = without_cg(body=body).replace('center_marker_id="20"', 'center_marker_id="10"')
    with pytest.raises(DeckError, match=words):
        read(tmp_path, text)
