"""A nut on the thread of its bolt does not get through: thrown along it, and under a load."""

from __future__ import annotations

import numpy as np
import pytest

from helpers.decks import EARTH, run_deck
from helpers.surfaces import mesh_graphic
from helpers.threads import bolt, nut

PITCH, GAP, MASS = 1.5, 0.1, 0.01
UNITS = (
    '<Param_Unit force_unit="NEWTON" mass_unit="KILOGRAM" length_unit="MILLIMETER" '
    'time_unit="SECOND"/>'
)
DEPTHS = {
    "LARGEST": 'stiffness="1e5" damping="5"',
    "FIELD": 'stiffness="1e5" damping="5" contact_depth="FIELD"',
}


def on_its_bolt(depth, body, others):
    """Return a bolt that is fixed, a nut on it with attributes `body`, and other statements."""
    return (
        UNITS
        + EARTH
        + mesh_graphic(100, 10, *bolt(10.0, PITCH, -4.5, 4.5, 18))
        + f'<Body_Rigid id="2" cg_id="20" mass="{MASS}" inertia_xx="0.5" inertia_yy="0.5" '
        f'inertia_zz="0.5" {body}/><Reference_Marker id="20" body_id="2"/>'
        + mesh_graphic(200, 20, *nut(10.0, PITCH, -2.0, 2.0, 18, 8.5, GAP))
        + '<Force_Contact id="301" i_graphics_id="200" j_graphics_id="100" cnf_type="IMPACT" '
        f'{DEPTHS[depth]} exponent="1" dmax="1e-3" cff_type="COULOMB_ON" mu_static="0.15" '
        'mu_dynamic="0.15" stiction_trans_vel="1" friction_trans_vel="2"/>' + others
    )


@pytest.mark.slow
@pytest.mark.parametrize("depth", DEPTHS)
def test_a_nut_bears_a_load(depth, tmp_path):
    """100 N pull it free of any joint against the flanks, in a fifth of a millisecond."""
    load = '<Force_Vector_OneBody id="1" type="ForceOnly" i_marker_id="20" fz_expression="100"/>'
    run = run_deck(tmp_path, on_its_bolt(depth, "", load), 0.003, 1e-4)
    assert run.stats["too_deep"] == 0
    late = run["time"] > 0.001
    force = run["contacts/301/force"][late]
    assert force == pytest.approx(np.tile([0.0, 0.0, -100.0], (len(force), 1)), abs=0.05)
    # it has come to the flanks, and what is left is the creep of smoothed friction
    height = run["bodies/2/position"][late, 2]
    assert height.min() > 0.05
    assert np.ptp(height) < 1e-3
    assert abs(run["bodies/2/velocity"][late]).max() < 0.1


@pytest.mark.slow
@pytest.mark.parametrize("speed", [1e3, 1e4])
def test_a_nut_does_not_tunnel_through_its_thread(speed, tmp_path):
    thrown = f'v_ic_z="{speed}" v_ic_z_flag="TRUE"'
    along = '<Constraint_Joint id="1" type="TRANSLATIONAL" i_marker_id="20" j_marker_id="10"/>'
    model = on_its_bolt("LARGEST", thrown, along)
    run = run_deck(tmp_path, model, 0.002, 2e-5)
    assert run.stats["too_deep"] == 0
    # a flank is 30 degrees aslant, and nothing is as deep as a tenth of the pitch
    assert abs(run["bodies/2/position"][:, 2]).max() < GAP + 0.1 * PITCH
    assert run["bodies/2/velocity"][:, 2].min() < 0.0
    assert abs(run["bodies/2/velocity"][-1, 2]) < speed
