"""Shapes, markers and what is between bodies in result files, and points of contact."""

from __future__ import annotations

import numpy as np
import pytest

import mbsim
from helpers.fake_run import SETTINGS, fake_system_of
from helpers.views import BALLS, HOSTILE, run_balls
from mbsim.errors import ModelError
from mbsim.model.frames import rotation_313
from mbsim.model.placement import place
from mbsim.results.graphics import NONE, graphics_of, quaternions
from mbsim.results.motion import matrices
from mbsim.results.reading import open_results
from mbsim.results.recorder import Recorder


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    path = tmp_path_factory.mktemp("deck") / "balls.xml"
    path.write_text(
        f"<MotionSolve><Model>{BALLS}</Model><Command><Simulate "
        'analysis_type="Transient" end_time="1" print_interval="0.1"/></Command></MotionSolve>'
    )
    return mbsim.read_model(path)


@pytest.fixture
def results(model, tmp_path):
    system = fake_system_of(model)
    recorder = Recorder(system, SETTINGS, tmp_path)
    recorder.close("interrupted", {}, system.scene.log.contacts, write_log=lambda: None)
    recorder.abandon()
    return open_results(tmp_path / "balls.h5")


def test_quaternions_are_those_of_rotations():
    random = np.random.default_rng(3)
    R = np.array([rotation_313(*random.uniform(-4.0, 4.0, 3)) for _ in range(200)])
    R[0], R[1], R[2] = np.eye(3), np.diag([1.0, -1.0, -1.0]), np.diag([-1.0, -1.0, 1.0])
    found = quaternions(R)
    # eigenvectors of well separated eigenvalues are exact to rounding
    np.testing.assert_allclose(matrices(found), R, atol=1e-14)
    assert (found[:, 0] >= 0.0).all()
    assert quaternions(np.zeros((0, 3, 3))).shape == (0, 4)


def test_a_file_holds_shapes_in_the_frames_of_their_bodies(results, model):
    shapes = {int(row["id"]): row for row in results["graphics/shapes"]}
    placement = place(model)
    assert set(shapes) == set(model.graphics)
    for id, row in shapes.items():
        graphic = model.graphics[id]
        marker = placement.markers[graphic.marker_id]
        assert row["body"] == marker.body_id
        assert row["shape"] == graphic.shape
        centre = marker.p_B + marker.R_B @ np.array(graphic.offset)
        np.testing.assert_allclose(row["position"], centre, atol=1e-15)
        np.testing.assert_allclose(row["size"][: len(graphic.size)], graphic.size)
    assert shapes[300]["color"] == (10 << 16) + (200 << 8) + 30
    assert shapes[200]["color"] == NONE
    assert [int(shapes[id]["hidden"]) for id in (200, 401)] == [0, 1]
    assert shapes[300]["label"] == HOSTILE


def test_a_mesh_of_two_graphics_is_stored_once(results, model):
    meshes = results["graphics/meshes"]
    assert len(meshes) == 1
    rows = results["graphics/shapes"]
    assert {int(row["mesh"]) for row in rows if row["shape"] == "MESH"} == {0}
    np.testing.assert_allclose(
        results["graphics/vertices"], model.graphics[400].vertices, rtol=1e-7
    )
    np.testing.assert_array_equal(results["graphics/faces"], model.graphics[400].faces)


def test_markers_and_what_is_between_bodies(results, model):
    placement = place(model)
    markers = results["markers"]
    assert list(markers["id"]) == list(model.markers)
    for row in markers:
        np.testing.assert_allclose(row["position"], placement.markers[int(row["id"])].p_B)
    found = results["connections"]
    assert [(str(c["group"]), int(c["id"])) for c in found] == [("contacts", 1), ("contacts", 2)]
    assert [(int(c["i_body"]), int(c["j_body"])) for c in found] == [(2, 1), (3, 1)]


def test_names_of_signals_do_not_have_them(results, model):
    assert not [name for name in results.keys() if name.startswith(("graphics", "markers"))]
    assert "connections" not in results.keys()
    assert results.attribute("graphics", "gravity_z") == -9.81
    assert results.attribute("graphics", "size") == place(model).L


@pytest.mark.parametrize("text", ["red", "1:2", "1:2:300", "1:2:x"])
def test_a_colour_that_is_none_is_told(tmp_path, text):
    path = tmp_path / "deck.xml"
    deck = BALLS.replace('color="10:200:30"', f'color="{text}"')
    path.write_text(f"<MotionSolve><Model>{deck}</Model></MotionSolve>")
    model = mbsim.read_model(path)
    assert model.graphics[300].color is None
    assert any("pictures take r:g:b" in note for note in model.notes)


def test_bounds_of_a_plane(tmp_path):
    path = tmp_path / "deck.xml"
    plane = '<Post_Graphic id="100" type="Plane"'
    deck = BALLS.replace(plane, plane + ' xmin="-1" xmax="2" ymin="-3" ymax="4"')
    path.write_text(f"<MotionSolve><Model>{deck}</Model></MotionSolve>")
    model = mbsim.read_model(path)
    assert model.graphics[100].bounds == (-1.0, 2.0, -3.0, 4.0)
    row = graphics_of(model, place(model))["graphics/shapes"][0]
    assert row["bounds"].tolist() == [-1.0, 2.0, -3.0, 4.0]


def test_points_of_contact_add_up_to_the_net_force(tmp_path):
    with open_results(run_balls(tmp_path, contact_points=True)) as results:
        offsets = results["contact_points/offsets"]
        assert len(offsets) == len(results["time"]) + 1
        row = np.repeat(np.arange(len(offsets) - 1), np.diff(offsets))
        force, id = results["contact_points/force"], results["contact_points/contact"]
        assert len(force) == offsets[-1] > 0
        for contact in (1, 2):
            net = np.zeros((len(offsets) - 1, 3))
            mine = id == contact
            np.add.at(net, row[mine], force[mine])
            np.testing.assert_allclose(net, results[f"contacts/{contact}/force"], rtol=1e-12)
            slip = np.zeros(len(net))
            np.maximum.at(slip, row[mine], results["contact_points/slip_speed"][mine])
            np.testing.assert_allclose(slip, results[f"contacts/{contact}/slip_speed"])
        np.testing.assert_array_equal(
            results["contact_points/position"], results["state/incidents"][:, 1:4]
        )
        assert not [name for name in results.signals() if name.startswith("contact_points")]


def test_points_are_recorded_only_where_they_are_asked_for(tmp_path):
    with open_results(run_balls(tmp_path)) as results:
        assert "contact_points/force" not in results
    with pytest.raises(ModelError, match="resume"):
        run_balls(tmp_path, contact_points=True, resume=True)
