"""A nut thrown along the thread of its bolt bounces between the flanks and does not get through."""

from __future__ import annotations

import pytest

from helpers.decks import EARTH, run_deck
from helpers.surfaces import mesh_graphic
from helpers.threads import bolt, nut

PITCH, GAP, MASS = 1.5, 0.1, 0.01
UNITS = (
    '<Param_Unit force_unit="NEWTON" mass_unit="KILOGRAM" length_unit="MILLIMETER" '
    'time_unit="SECOND"/>'
)


@pytest.mark.slow
@pytest.mark.parametrize("speed", [1e3, 1e4])
def test_a_nut_does_not_tunnel_through_its_thread(speed, tmp_path):
    model = (
        UNITS
        + EARTH
        + mesh_graphic(100, 10, *bolt(10.0, PITCH, -4.5, 4.5, 18))
        + f'<Body_Rigid id="2" cg_id="20" mass="{MASS}" inertia_xx="0.5" inertia_yy="0.5" '
        f'inertia_zz="0.5" v_ic_z="{speed}" v_ic_z_flag="TRUE"/>'
        '<Reference_Marker id="20" body_id="2"/>'
        + mesh_graphic(200, 20, *nut(10.0, PITCH, -2.0, 2.0, 18, 8.5, GAP))
        + '<Constraint_Joint id="1" type="TRANSLATIONAL" i_marker_id="20" j_marker_id="10"/>'
        '<Force_Contact id="301" i_graphics_id="200" j_graphics_id="100" cnf_type="IMPACT" '
        'stiffness="1e5" exponent="1" damping="5" dmax="1e-3" cff_type="COULOMB_ON" '
        'mu_static="0.15" mu_dynamic="0.15" stiction_trans_vel="1" friction_trans_vel="2"/>'
    )
    run = run_deck(tmp_path, model, 0.002, 2e-5)
    assert run.stats["too_deep"] == 0
    # a flank is 30 degrees aslant, and nothing is as deep as a tenth of the pitch
    assert abs(run["bodies/2/position"][:, 2]).max() < GAP + 0.1 * PITCH
    assert run["bodies/2/velocity"][:, 2].min() < 0.0
    assert abs(run["bodies/2/velocity"][-1, 2]) < speed
