"""A mesh that is not convex stands: on a plane, on a box, with explicit and implicit methods."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from helpers import decks
from helpers.decks import run_deck
from helpers.surfaces import GROUND, IMPACT, angle_on_ground, box, mesh_graphic

SLAB = (
    '<Post_Graphic id="100" type="BoxDefinedFromCenter" center_marker_id="11" '
    'length_x="2" length_y="2" length_z="0.2"/>'
)
#: 1 kg on k d^1.5 with k = 1e6 N/m^1.5.
SAG = (9.81 / 1e6) ** (2.0 / 3.0)


@pytest.mark.parametrize(
    ("ground", "method"), [(GROUND, "DOPRI5"), (GROUND, "RADAU5"), (SLAB, "DOPRI5")]
)
def test_an_angle_stands(ground, method, tmp_path):
    run = run_deck(
        tmp_path, angle_on_ground(0.0501, IMPACT, ground), end_time=0.6, integrator=method
    )
    assert run.stats["fcl_calls"] == 0
    assert abs(run["bodies/2/angular_velocity"][-1]).max() < 1e-3
    assert run["contacts/301/force"][-1, 2] == pytest.approx(9.81, rel=1e-3)
    assert run["contacts/301/penetration"][-1] == pytest.approx(SAG, rel=0.02)
    assert run["contacts/301/area"][-1] == pytest.approx(0.03, rel=1e-3)
    assert run["contacts/301/incidents"][-1] == 1


def test_the_inside_of_a_cup_below_the_plane_presses_nothing(tmp_path):
    # profile of a cup with a bottom of 1 mm, which sinks in by 2.1 mm
    profile = [(0, 0), (0.05, 0), (0.05, 0.05), (0.049, 0.05), (0.049, 0.001), (0, 0.001)]
    cup = trimesh.creation.revolve(np.array(profile), sections=24)
    nodes = " ".join(repr(float(x)) for x in cup.vertices.ravel())
    faces = " ".join(str(int(k)) for k in cup.faces.ravel())
    deck = (
        decks.GROUND + '<Body_Rigid id="2" cg_id="20" mass="1" inertia_xx="0.006" '
        'inertia_yy="0.006" inertia_zz="0.011"/><Reference_Marker id="20" body_id="2" '
        'pos_z="-0.0021"/><Post_Graphic id="200" type="TriaMesh" rm_id="20">'
        f"<Nodes>{nodes}</Nodes><Faces>{faces}</Faces></Post_Graphic>"
        '<Force_Contact id="301" i_graphics_id="200" j_graphics_id="100" cnf_type="IMPACT" '
        'stiffness="1e5" exponent="1.5" damping="0" dmax="1e-4"/>'
    )
    run = run_deck(tmp_path, deck + decks.GRAVITY, end_time=1e-3, print_interval=1e-3)
    assert run["contacts/301/force"][0, 2] == pytest.approx(1e5 * 0.0021**1.5, rel=1e-6)
    assert run["contacts/301/incidents"][0] == 1


@pytest.mark.parametrize("floor", ["plane", "mesh"])
@pytest.mark.parametrize("friction", ["COULOMB_ON", "STICTION"])
def test_as_deep_as_each_other_more_feet_than_slots_stand(floor, friction, tmp_path):
    """Twelve feet: what stands for those without a slot takes all of the others, which are none."""
    places = [(x, y, 0.0) for x in (-0.18, -0.06, 0.06, 0.18) for y in (-0.12, 0.0, 0.12)]
    foot = box(0.02, 0.02, 0.1)
    vertices = np.vstack([foot[0] + place for place in places])
    faces = np.vstack([foot[1] + len(foot[0]) * k for k in range(12)])
    low = vertices[:, 2].min()
    slab = trimesh.creation.box((2.0, 2.0, 0.2))
    ground = decks.GROUND
    if floor == "mesh":
        ground = decks.EARTH + mesh_graphic(100, 10, slab.vertices - [0.0, 0.0, 0.1], slab.faces)
    deck = (
        ground + '<Body_Rigid id="2" cg_id="20" mass="1" inertia_xx="0.006" inertia_yy="0.006" '
        'inertia_zz="0.01"/><Reference_Marker id="20" body_id="2" pos_x="0.3" pos_y="0.2" '
        f'pos_z="{-low - 1e-4}"/>'
        + mesh_graphic(200, 20, vertices, faces)
        + '<Force_Contact id="301" i_graphics_id="200" j_graphics_id="100" cnf_type="IMPACT" '
        'stiffness="1e5" exponent="1" damping="200" dmax="1e-5" '
        f'cff_type="{friction}" mu_static="0.3" mu_dynamic="0.3" '
        + (
            'stiction_trans_vel="0.01" friction_trans_vel="0.02"'
            if friction == "COULOMB_ON"
            else ""
        )
        + "/>"
    )
    run = run_deck(tmp_path, deck + decks.GRAVITY, end_time=0.1)
    # the sag of twelve springs
    assert run["contacts/301/penetration"][-1] == pytest.approx(9.81 / 12e5, rel=1e-5)
    assert run["contacts/301/force"][-1] == pytest.approx([0.0, 0.0, 9.81], abs=1e-4)
    assert abs(run["bodies/2/angular_velocity"][-1]).max() < 1e-6
    assert run.stats["steps"] < 3000
