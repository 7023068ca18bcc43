"""Overlaps of meshes below the layer under their surface are told, with time and contact."""

from __future__ import annotations

import pytest
import trimesh

from helpers.decks import GRAVITY, GROUND, run_deck
from mbsim.errors import ModelError

LARGEST = 'cnf_type="IMPACT" stiffness="1e6" exponent="1.5" damping="100" dmax="1e-4"'
FIELD = (
    'contact_depth="FIELD" cnf_type="IMPACT" stiffness="1e9" exponent="1" damping="100" dmax="1e-4"'
)
RING = trimesh.creation.torus(0.03, 0.01, 24, 12)
#: A tube; the middle of its wall is 1 from all of its surface.
TUBE = trimesh.creation.annulus(0.1, 2.1, 2.0, sections=32)


def mesh(id, marker, shape):
    nodes = " ".join(repr(float(x)) for x in shape.vertices.ravel())
    faces = " ".join(str(int(k)) for k in shape.faces.ravel())
    return (
        f'<Post_Graphic id="{id}" type="TriaMesh" rm_id="{marker}"><Nodes>{nodes}</Nodes>'
        f"<Faces>{faces}</Faces></Post_Graphic>"
    )


def scene(i, j, law, x=0.0, z=0.0):
    return (
        GROUND.partition('<Post_Graphic id="100"')[0]
        + '<Body_Rigid id="2" cg_id="20" mass="1" inertia_xx="0.006" inertia_yy="0.006" '
        f'inertia_zz="0.011"/><Reference_Marker id="20" body_id="2" pos_x="{x}" pos_z="{z}"/>'
        + mesh(100, 10, j)
        + mesh(200, 20, i)
        + f'<Force_Contact id="301" i_graphics_id="200" j_graphics_id="100" {law}/>'
        + GRAVITY
    )


def told(results):
    return [line for line in results.audit.warnings if "too deep into each other" in line]


@pytest.mark.parametrize("law", [LARGEST, FIELD])
@pytest.mark.parametrize("turned", [False, True])
def test_a_mesh_inside_of_another_one_is_told(law, turned, tmp_path):
    i, j, x = (TUBE, RING, -1.1) if turned else (RING, TUBE, 1.1)
    deck = scene(i, j, law, x=x)
    with pytest.raises(ModelError) as refused:
        run_deck(tmp_path, deck, 0.01)
    (line,) = str(refused.value).splitlines()
    assert "Force_Contact[301]: Post_Graphic[200] of Body_Rigid[2] and Post_Graphic[100] of" in line
    assert "one wholly inside the other at the start" in line
    (line,) = told(run_deck(tmp_path, deck, 0.01, allow_overlap=True))
    assert line.startswith("Post_Graphic[200] of Body_Rigid[2] and Post_Graphic[100] of Body_Rigid")
    assert "first at time 0 at Force_Contact[301]" in line


@pytest.mark.parametrize("method", ["DOPRI5", "VERLET"])
def test_what_sinks_through_the_layer_is_told_when_it_does(method, tmp_path):
    # 1e3 N/m^3 on what lies in a layer of some millimetres is less than 9.81 N: it sinks through
    soft = FIELD.replace("1e9", "1e3")
    slab = trimesh.creation.annulus(0.01, 0.3, 0.1, sections=32)
    run = run_deck(tmp_path, scene(RING, slab, soft, z=0.0602), 0.2, integrator=method)
    (line,) = told(run)
    assert "first at time 0 at" not in line
    assert run.stats["too_deep"] > 0


@pytest.mark.parametrize("law", [LARGEST, pytest.param(FIELD, marks=pytest.mark.slow)])
def test_what_lies_on_a_mesh_or_apart_in_its_box_is_not_told(law, tmp_path):
    slab = trimesh.creation.annulus(0.01, 0.3, 0.1, sections=32)
    run = run_deck(tmp_path, scene(RING, slab, law, z=0.0599999), 0.05)
    assert run.stats["too_deep"] == 0
    # in the bore of the tube: their boxes overlap, they do not
    run = run_deck(tmp_path, scene(RING, TUBE, law), 0.01)
    assert told(run) == []
    assert run["bodies/2/velocity"][-1, 2] == pytest.approx(-0.0981, rel=1e-6)


def falling(shape, wall, stiffness, speed, z=0.03):
    """A body of 1 kg that falls on a wall 2 mm thick."""
    about = 'inertia_xx="0.001" inertia_yy="0.001" inertia_zz="0.001"'
    return (
        GROUND.partition('<Post_Graphic id="100"')[0]
        + f'<Body_Rigid id="2" cg_id="20" mass="1" {about} v_ic_z="-{speed}" v_ic_z_flag="TRUE"/>'
        + f'<Reference_Marker id="20" body_id="2" pos_z="{z}"/>'
        + wall
        + shape
        + '<Force_Contact id="301" i_graphics_id="200" j_graphics_id="100" cnf_type="IMPACT" '
        f'stiffness="{stiffness}" exponent="1" damping="0"/>'
    )


BALL = '<Post_Graphic id="200" type="Sphere" center_marker_id="20" radius="0.02"/>'
#: A plate with a hole beside the ball, 2 mm thick.
PLATE = trimesh.creation.annulus(0.1, 0.3, 0.002, sections=32)
PLATE.apply_translation([0.2, 0.0, 0.0])
WALLS = {
    "mesh": mesh(100, 10, PLATE),
    "convex mesh": mesh(100, 10, trimesh.creation.box(extents=(0.3, 0.3, 0.002))),
    "box": '<Post_Graphic id="100" type="BoxDefinedFromCenter" center_marker_id="10" '
    'length_x="0.3" length_y="0.3" length_z="0.002"/>',
}


@pytest.mark.parametrize("wall", WALLS)
@pytest.mark.parametrize("speed", [0.5, 50.0])
def test_a_ball_that_passes_through_a_wall_is_told(wall, speed, tmp_path):
    # 100 N/m over 0.02 m hold back 0.02 J of 0.125 J
    run = run_deck(tmp_path, falling(BALL, WALLS[wall], 100.0, speed), 0.06 / speed, 0.001)
    assert run["bodies/2/position"][-1, 2] < -0.02
    (line,) = told(run)
    assert line.startswith("Post_Graphic[200] of Body_Rigid[2] and Post_Graphic[100] of Body_Rigid")
    since = float(line.partition("first at time ")[2].split()[0])
    assert 0.009 <= since * speed * 1.1 <= 0.06


@pytest.mark.parametrize("wall", WALLS)
def test_a_ball_that_a_wall_throws_back_is_not_told(wall, tmp_path):
    # 0.125 J in 1e6 N/m: 0.5 mm deep
    run = run_deck(tmp_path, falling(BALL, WALLS[wall], 1e6, 0.5), 0.06, 0.001)
    assert run["bodies/2/velocity"][-1, 2] == pytest.approx(0.5, rel=1e-3)
    assert told(run) == []


def test_a_box_that_passes_through_a_wall_is_told(tmp_path):
    box = (
        '<Post_Graphic id="200" type="BoxDefinedFromCenter" center_marker_id="20" '
        'length_x="0.03" length_y="0.03" length_z="0.03"/>'
    )
    run = run_deck(tmp_path, falling(box, WALLS["mesh"], 10.0, 0.5), 0.12, 0.001)
    assert run["bodies/2/position"][-1, 2] < -0.02
    assert len(told(run)) == 1


def test_a_ball_that_begins_in_a_wall_is_refused(tmp_path):
    deck = falling(BALL, WALLS["mesh"], 1e6, 0.5, z=0.0185)
    with pytest.raises(ModelError, match="or than its wall, at the start"):
        run_deck(tmp_path, deck, 0.01)
