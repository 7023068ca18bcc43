"""Derivatives through touches at which something jumps: right, or not known and said."""

from __future__ import annotations

import math

import numpy as np
import pytest

import mbsim
from helpers.folders import MODELS
from helpers.tight_runs import differences

# a box falls flat, with four corners at once, while it slides
DECK = """<Deck><Model><Body_Rigid id="1" isground="TRUE"/>
<Body_Rigid id="2" cg_id="20" mass="1" inertia_xx="0.01" inertia_yy="0.01" inertia_zz="0.01"
 v_ic_x="0.4" v_ic_x_flag="TRUE"/>
<Reference_Marker id="10" body_id="1"/><Reference_Marker id="20" body_id="2" pos_z="0.06"/>
<Post_Graphic id="100" type="Plane" rm_id="10"/>
<Post_Graphic id="200" type="BoxDefinedFromCenter" center_marker_id="20" length_x="0.2"
 length_y="0.2" length_z="0.1"/>
<Force_Contact id="301" i_graphics_id="200" j_graphics_id="100" cnf_type="IMPACT" stiffness="1e5"
 exponent="1" damping="100" dmax="1e-5" {law}/>
<Force_Gravity grav_z="-10"/></Model><Command>
<Simulate analysis_type="Transient" end_time="0.12" print_interval="0.004"/></Command></Deck>"""
#: A bristle of the first three begins to stretch at the touch; the force of STRIBECK jumps there.
LAWS = {
    "DAHL": 'cff_type="DAHL" mu_dynamic="0.25" bristle_stiffness="1e4"',
    "LUGRE": 'cff_type="LUGRE" mu_static="0.3" mu_dynamic="0.25" stribeck_vel="1e-2" '
    'bristle_stiffness="1e4" bristle_damping="50"',
    "STICTION": 'cff_type="STICTION" mu_static="0.3" mu_dynamic="0.25" tangential_stiffness="1e5"',
    "STRIBECK": 'cff_type="STRIBECK" mu_static="0.01" mu_dynamic="0.01" stribeck_vel="0.02" '
    'friction_trans_vel="0.01" viscous_coef="20"',
    "TANH": 'cff_type="TANH" mu_dynamic="0.25" friction_trans_vel="0.01"',
}


def check(deck, name, value, step, signal, integrator):
    """Return whether the derivative is known to the end; compare it while it is known."""
    run = mbsim.simulate(deck, integrator=integrator, tol=1e-9, sensitivity=[name])
    how = {"integrator": "DOP853"}
    truth = differences(deck, name, value, step, (signal,), **how)[signal]
    about = run.parameters[name]
    known = run["time"] < about["known_until"]
    found = run.sensitivity(signal, name)
    assert np.abs(found - truth)[known].max() <= 1e-4 * np.abs(truth).max()
    assert np.isnan(found[run["time"] > about["known_until"]]).all()
    return about["known_until"] == math.inf


@pytest.mark.parametrize("integrator", ["DOPRI5", "RADAU5", "GALPHA"])
@pytest.mark.parametrize("law", LAWS)
def test_a_box_falls_flat(law, integrator):
    name, signal = "Reference_Marker[20].pos_z", "bodies/2/velocity/x"
    known = check(DECK.format(law=LAWS[law]), name, 0.06, 6e-7, signal, integrator)
    # forces of smooth laws begin at zero, and nothing jumps
    assert known == (law == "TANH")


@pytest.mark.parametrize("integrator", ["DOPRI5", "RADAU5", "GALPHA"])
def test_a_slider_that_sticks_again(integrator):
    # where the slider of an element stands moves with its force
    name, deck = "Force_DryFriction[1].friction", MODELS / "dry_friction_element.xml"
    assert not check(deck, name, 1.0, 1e-5, "bodies/2/velocity/x", integrator)
