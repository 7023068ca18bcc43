"""Bristles that are damped, where what presses on them falls to 0 while they are bent."""

from __future__ import annotations

import numpy as np
import pytest

from helpers.decks import GRAVITY, GROUND, contact, run_deck, sphere


def shaken(way, rate, damping, bristles):
    """Return a ball on a plane that is shaken along a line, 0.1 rad to it, so that it rattles."""
    turn = 'psi="1.5707963267948966" theta="1.4708"'
    law = {"cnf_type": "IMPACT", "stiffness": 7e5, "exponent": 1, "damping": damping, "dmax": 1e-4}
    law |= {"cff_type": "LUGRE", "mu_static": 0.618, "mu_dynamic": 0.614, "stribeck_vel": 4e-3}
    law |= {"bristle_stiffness": 2e4, "bristle_damping": bristles}
    plate = f"""
<Body_Rigid id="3" cg_id="30" mass="5" inertia_xx="0.1" inertia_yy="0.1" inertia_zz="0.2"/>
<Reference_Marker id="30" body_id="3"/><Post_Graphic id="300" type="Plane" rm_id="30"/>
<Reference_Marker id="31" body_id="3" {turn}/><Reference_Marker id="11" body_id="1" {turn}/>
<Constraint_Joint id="1" type="TRANSLATIONAL" i_marker_id="31" j_marker_id="11"/>
<Motion_Joint id="1" joint_id="1" val_type="D" expr="{way}*(1-COS({rate}*TIME))"/>"""
    return GROUND + GRAVITY + sphere(0.1, mass=0.1) + plate + contact(j=300, **law)


@pytest.mark.parametrize("tol", [1e-7, 1e-8])
@pytest.mark.parametrize("given", [(0.03, 25, 160, 64), (0.022, 40, 50, 64), (0.022, 40, 160, 100)])
def test_newtons_iteration_ends_where_a_ball_leaves_bent_bristles(given, tol, tmp_path):
    # they rub by more than presses as that falls to 0. What velocities that differ by rounding do
    # to friction was judged by the normal force alone: the step fell to 1e-16 s at 0.04 s
    end = 0.06
    results = run_deck(tmp_path, shaken(*given), end, end / 6, integrator="RADAU5", tol=tol)
    exact = run_deck(tmp_path, shaken(*given), end, end / 6, integrator="DOP853", tol=1e-10)
    for name in ("bodies/2/position", "bodies/2/velocity"):
        np.testing.assert_allclose(results[name], exact[name], rtol=0, atol=50.0 * tol)


def test_bristles_that_a_last_stage_bent_are_straight_at_the_touch(tmp_path):
    # a step that ended just before a touch, whose last stage was in it, left them bent by 1e-6 m.
    # 80 touches: at a tenth of tol their errors fell no more
    given, end = (0.022, 40, 64, 50), 0.18
    exact = run_deck(tmp_path, shaken(*given), end, end / 9, integrator="DOP853", tol=1e-10)
    for tol in (1e-8, 1e-9):
        results = run_deck(tmp_path, shaken(*given), end, end / 9, integrator="DOPRI5", tol=tol)
        wrong = results["bodies/2/position"] - exact["bodies/2/position"]
        assert np.abs(wrong).max() < 40.0 * tol
