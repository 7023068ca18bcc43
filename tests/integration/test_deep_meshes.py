"""Overlaps of meshes below the layer under their surface are told, with time and contact."""

from __future__ import annotations

import pytest
import trimesh

from helpers.decks import GRAVITY, GROUND, run_deck

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
    return [line for line in results.audit.warnings if "deeper than the layer" in line]


@pytest.mark.parametrize("law", [LARGEST, FIELD])
@pytest.mark.parametrize("turned", [False, True])
def test_a_mesh_inside_of_another_one_is_told(law, turned, tmp_path):
    i, j, x = (TUBE, RING, -1.1) if turned else (RING, TUBE, 1.1)
    run = run_deck(tmp_path, scene(i, j, law, x=x), 0.01, allow_overlap=True)
    (line,) = told(run)
    assert "first at time 0 at Force_Contact[301]" in line


def test_what_sinks_through_the_layer_is_told_when_it_does(tmp_path):
    # 1e3 N/m^3 on what lies in a layer of some millimetres is less than 9.81 N: it sinks through
    soft = FIELD.replace("1e9", "1e3")
    slab = trimesh.creation.annulus(0.01, 0.3, 0.1, sections=32)
    run = run_deck(tmp_path, scene(RING, slab, soft, z=0.0602), 0.2)
    (line,) = told(run)
    assert "first at time 0 at" not in line
    assert run.stats["beyond_layers"] > 0


@pytest.mark.parametrize("law", [LARGEST, FIELD])
def test_what_lies_on_a_mesh_or_apart_in_its_box_is_not_told(law, tmp_path):
    slab = trimesh.creation.annulus(0.01, 0.3, 0.1, sections=32)
    run = run_deck(tmp_path, scene(RING, slab, law, z=0.0599999), 0.05)
    assert run.stats["beyond_layers"] == 0
    # in the bore of the tube: their boxes overlap, they do not
    run = run_deck(tmp_path, scene(RING, TUBE, law), 0.01)
    assert told(run) == []
    assert run["bodies/2/velocity"][-1, 2] == pytest.approx(-0.0981, rel=1e-6)
