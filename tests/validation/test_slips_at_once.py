"""Friction that leaves a branch at once that a change has just put it on."""

from __future__ import annotations

import numpy as np
import pytest

import mbsim

#: An ellipsoid that rolls on a plane. What presses on it depends on how fast it comes, and so on
#: friction: where it begins to slip that falls, and the normal force grows, so that it sticks.
DECK = """<MotionSolve><Model>
<Param_Unit force_unit="NEWTON" mass_unit="KILOGRAM" length_unit="METER" time_unit="SECOND"/>
<Body_Rigid id="1" isground="TRUE"/>
<Reference_Marker id="10" body_id="1"/>
<Post_Graphic id="100" type="Plane" rm_id="10"/>
<Reference_Marker id="20" body_id="2" pos_x="0.0" pos_y="0.0" pos_z="0.2719147044599168"
 a00="-0.6745542325600662" a10="-0.5302317351417296" a20="0.5136447161062699"
 a01="0.46339478319537003" a11="0.23750028378589033" a21="0.8537323293099174"
 a02="-0.5746667401569504" a12="0.8139090380688815" a22="0.08549979828731721"/>
<Body_Rigid id="2" cg_id="20" mass="2.6747601326077173" inertia_xx="0.01008100324040298"
 inertia_yy="0.010535929774170553" inertia_zz="0.008616552048974624" v_ic_x="-0.9071772109799151"
 v_ic_x_flag="TRUE" v_ic_y="-0.03264944469885006" v_ic_y_flag="TRUE" v_ic_z="-0.851076761148666"
 v_ic_z_flag="TRUE" w_ic_x="-1.0145904647902846" w_ic_x_flag="TRUE" w_ic_y="{turning}"
 w_ic_y_flag="TRUE" w_ic_z="0.3704652200354884" w_ic_z_flag="TRUE"/>
<Post_Graphic id="200" type="Ellipsoid" center_marker_id="20"
 x_scale="0.0885053692045219" y_scale="0.05085380771020747" z_scale="0.053869741290509694"/>
<Force_Gravity grav_z="-9.81"/>
<Force_Contact id="1" num_i_graphics="1" i_graphics_id="200" num_j_graphics="1" j_graphics_id="100"
 cnf_type="POISSON" penalty="19288.43809675613" restitution_coef="{restitution}"
 normal_trans_vel="0.01" cff_type="STICTION" mu_dynamic="{sliding}" mu_static="{sticking}"/>
</Model><Command>
<Simulate analysis_type="Transient" end_time="0.35" print_interval="0.05"/>
</Command></MotionSolve>"""
#: Restitution, friction of sliding and of sticking, and how fast it turns about y.
ASKED = [(0.275, 0.378, 0.426, -1.632), (0.232, 0.424, 0.461, -0.811), (0.238, 0.364, 0.403, 0.737)]


def run(given, method, tol):
    """Return places at the rows, and kinds of events."""
    names = ("restitution", "sliding", "sticking", "turning")
    text = DECK.format(**dict(zip(names, given, strict=True)))
    with mbsim.simulate(text, integrator=method, tol=tol) as results:
        return results["bodies/2/position"], [str(kind) for kind in results["events"]["kind"]]


@pytest.mark.parametrize("given", ASKED)
def test_what_cannot_slip_on_sticks_whatever_the_step(given):
    exact, kinds = run(given, "DOP853", 1e-10)
    assert kinds.count("stick") >= 3
    for method in ("DOPRI5", "DOP853", "RADAU5"):
        for tol in (1e-5, 1e-6, 1e-7, 1e-8):
            places, seen = run(given, method, tol)
            # a step that began with a slip and ended where it could be did not see that it could
            # not be at its begin: 7e-5 to 5e-4 off, with either explicit method at each tol
            assert seen == kinds, (method, tol)
            np.testing.assert_allclose(places, exact, rtol=0, atol=2.0 * tol)
