"""Sensitivities where a parameter moves the time at which a force or a motion jumps."""

from __future__ import annotations

import math

import numpy as np
import pytest

import mbsim
from helpers.tight_runs import differences

NAME, AT = "Reference_Variable[1].expr", 0.4987
PUSHED = f"""<Deck><Model>
<Body_Rigid id="1" isground="TRUE"/>
<Body_Rigid id="2" cg_id="20" mass="2" inertia_xx="1" inertia_yy="1" inertia_zz="1"/>
<Reference_Marker id="10" body_id="1"/><Reference_Marker id="20" body_id="2"/>
<Reference_Variable id="1" expr="{AT}"/>
<Force_Vector_TwoBody id="5" type="ForceOnly" i_marker_id="20" j_floating_marker_id="10"
 ref_marker_id="10" fx_expression="{{}}" fy_expression="0" fz_expression="0"/>
</Model><Command>
<Simulate analysis_type="Transient" end_time="1" print_interval="0.05"/>
</Command></Deck>"""
VELOCITY = "bodies/2/velocity/x"
METHODS = ["DOPRI5", "DOP853", "RADAU5", "GALPHA"]

#: A pendulum on a cart that a motion drives.
DRIVEN = """<Deck><Model>
<Body_Rigid id="1" isground="TRUE"/>
<Body_Rigid id="2" cg_id="20" mass="2" inertia_xx="0.1" inertia_yy="0.2" inertia_zz="0.17"/>
<Body_Rigid id="3" cg_id="30" mass="1.5" inertia_xx="0.05" inertia_yy="0.2" inertia_zz="0.17"/>
<Reference_Marker id="10" body_id="1" theta="1.5707963267948966"/>
<Reference_Marker id="20" body_id="2" theta="1.5707963267948966"/>
<Reference_Marker id="21" body_id="2" theta="1.5707963267948966" psi="1.5707963267948966"/>
<Reference_Marker id="30" body_id="3" pos_z="-0.5"/>
<Reference_Marker id="31" body_id="3" theta="1.5707963267948966" psi="1.5707963267948966"/>
<Constraint_Joint id="1" type="TRANSLATIONAL" i_marker_id="20" j_marker_id="10"/>
<Constraint_Joint id="2" type="REVOLUTE" i_marker_id="31" j_marker_id="21"/>
<Reference_Variable id="1" expr="0.4987"/>
<Motion_Joint id="3" joint_id="1" joint_type="TRANSLATIONAL" val_type="{}" expr="{}"/>
<Force_Gravity grav_z="-9.81"/>
</Model><Command>
<Simulate analysis_type="Transient" end_time="1" print_interval="0.05"/>
</Command></Deck>"""


def is_as(deck, signal, integrator, allowed, tol=1e-9):
    run = mbsim.simulate(deck, integrator=integrator, tol=tol, sensitivity=[NAME])
    truth = differences(deck, NAME, AT, 1e-5, (signal,), integrator="DOP853")[signal]
    assert run.parameters[NAME]["known_until"] == math.inf
    assert np.abs(run.sensitivity(signal, NAME) - truth).max() < allowed * np.abs(truth).max()


@pytest.mark.parametrize("integrator", METHODS)
@pytest.mark.parametrize(
    "force",
    [
        "IF(TIME-VARVAL(1):0,0,10)",
        "10*SIGN(1,TIME-VARVAL(1))",
        "5*AINT(TIME/VARVAL(1)*2)",
        "5*ANINT(TIME/VARVAL(1)*2)",
        "MAX(0,IF(TIME-VARVAL(1):0,1,10))",
        "IF(TIME-VARVAL(1):0,0,10)*(1+DX(20,10))",
        "SIN(30*TIME)*IF(TIME-VARVAL(1):0,0,10)",
        "IF(SIN(40*TIME-VARVAL(1)):-5,0,10)",
        # several at once, of which one does not move
        "IF(TIME-VARVAL(1):0,0,10)-IF(TIME-VARVAL(1)**2/0.4987:0,0,4)+IF(TIME-0.4987:0,0,1)",
        # several at once that cancel, of which one moves, or each as fast as it likes, or all alike
        "IF(TIME-VARVAL(1):0,0,10)-IF(TIME-0.4987:0,0,10)",
        "IF(TIME-VARVAL(1):0,0,10)-IF(TIME-VARVAL(1)**2/0.4987:0,0,10)",
        "IF(TIME-VARVAL(1):0,0,10)-IF(TIME-1.2*VARVAL(1)+0.2*0.4987:0,0,10)",
        "IF(TIME-VARVAL(1):0,0,10)-IF(TIME-(0.9974-VARVAL(1)):0,0,10)",
        "IF(TIME-VARVAL(1):0,0,10)-2*IF(TIME-0.4987:0,0,10)+IF(TIME-2*VARVAL(1)+0.4987:0,0,10)",
        "IF(TIME-VARVAL(1):0,0,VARVAL(1))-IF(TIME-VARVAL(1):0,0,0.4987)",
        # one that does not move at all
        "VARVAL(1)*IF(TIME-0.3:0,0,10)",
    ],
)
def test_a_force_that_jumps_at_a_time_that_a_parameter_moves(force, integrator):
    is_as(PUSHED.format(force), VELOCITY, integrator, 1e-7)


@pytest.mark.parametrize("integrator", METHODS)
@pytest.mark.parametrize("at", ["0.5", "0.25", "0.3", "0.7480500000000001"])
def test_a_jump_is_met_wherever_the_time_is_rounded_to(at, integrator):
    # the speed behind the jump is 5 (t - p)
    for jump in ("IF(TIME-VARVAL(1):0,0,10)", "5+5*SIGN(1,TIME-VARVAL(1))"):
        run = mbsim.simulate(
            PUSHED.format(jump).replace(f'expr="{AT}"', f'expr="{at}"'),
            integrator=integrator,
            tol=1e-8,
            sensitivity=[NAME],
        )
        t, found = run["time"], run.sensitivity(VELOCITY, NAME)
        behind = np.abs(t - float(at)) > 1e-6
        assert found[behind] == pytest.approx(np.where(t > float(at), -5.0, 0.0)[behind], abs=1e-7)


@pytest.mark.parametrize("integrator", METHODS)
@pytest.mark.parametrize("often", [10, 200])
def test_a_saw_tooth_whose_period_is_the_parameter(often, integrator):
    # v = 5/k (n p^2 + q^2)/2 behind n teeth of a time k t = n p + q
    run = mbsim.simulate(
        PUSHED.format(f"10*MOD({often}*TIME,VARVAL(1))"),
        integrator=integrator,
        tol=1e-8 if often == 10 else 1e-6,
        sensitivity=[NAME],
    )
    n, q = np.divmod(often * run["time"], AT)
    truth = 5.0 / often * n * (AT - q)
    found = run.sensitivity(VELOCITY, NAME)
    assert run.parameters[NAME]["known_until"] == math.inf
    assert np.abs(found - truth).max() < 1e-6 * np.abs(truth).max()


@pytest.mark.parametrize("integrator", METHODS)
def test_a_pulse_that_a_parameter_moves(integrator):
    # -1e5 (p + 1e-4 - p) / 2 in velocity, but for its place: x(1) = 5 (1 - p - 1e-4 / 2)
    run = mbsim.simulate(
        PUSHED.format("IF(TIME-VARVAL(1):0,0,1E5)-IF(TIME-VARVAL(1)-1E-4:0,0,1E5)"),
        integrator=integrator,
        tol=1e-8,
        sensitivity=[NAME],
    )
    assert run.sensitivity("bodies/2/position/x", NAME)[-1] == pytest.approx(-5.0, rel=1e-6)
    assert abs(run.sensitivity(VELOCITY, NAME)[-1]) < 1e-4


@pytest.mark.parametrize("integrator", ["DOPRI5", "RADAU5", "GALPHA"])
@pytest.mark.parametrize(
    ("kind", "motion"),
    [
        ("D", "STEP(TIME,VARVAL(1),0,VARVAL(1)+0.3,0.2)"),
        ("D", "0.2*STEP(TIME,VARVAL(1),0,0.9,1)"),
        ("V", "MAX(0,TIME-VARVAL(1))"),
        ("A", "IF(TIME-VARVAL(1):0,0,2)-IF(TIME-1.5*VARVAL(1):0,0,2)"),
    ],
)
def test_a_motion_whose_acceleration_jumps(kind, motion, integrator):
    is_as(DRIVEN.format(kind, motion), "bodies/3/velocity", integrator, 2e-6)


@pytest.mark.parametrize("integrator", METHODS)
def test_what_jumps_as_a_run_begins_has_a_derivative_to_one_side_alone(integrator):
    deck = PUSHED.format("IF(TIME-VARVAL(1):0,1,1)").replace(f'expr="{AT}"', 'expr="0"')
    run = mbsim.simulate(deck, integrator=integrator, tol=1e-8, sensitivity=[NAME])
    assert np.isnan(run.sensitivity(VELOCITY, NAME)[1:]).all()
    assert "jump" in run.parameters[NAME]["why"]


#: The same body as a box whose corners stick to a plane by springs.
STUCK = """<Reference_Marker id="11" body_id="1"/><Reference_Marker id="22" body_id="2"/>
<Post_Graphic id="100" type="Plane" rm_id="11"/>
<Post_Graphic id="200" type="BoxDefinedFromCenter" center_marker_id="22" length_x="2" length_y="2"
 length_z="1"/>
<Force_Contact id="301" num_i_graphics="1" i_graphics_id="200" num_j_graphics="1"
 j_graphics_id="100" cnf_type="IMPACT" stiffness="1e4" exponent="1" damping="100" dmax="1e-6"
 cff_type="STICTION" mu_static="0.6" mu_dynamic="0.5" tangential_stiffness="1e4"/>
<Force_Gravity grav_z="-10"/>"""


@pytest.mark.parametrize("integrator", METHODS)
def test_a_moved_jump_of_what_sticks_by_springs(integrator):
    # differences are wider where friction remembers: both sides still keep clear of the jump
    deck = PUSHED.format("IF(TIME-VARVAL(1):0,0,8)").replace(
        "<Force_Vector_TwoBody", STUCK + "<Force_Vector_TwoBody", 1
    )
    deck = deck.replace(
        '<Reference_Marker id="20" body_id="2"/>',
        '<Reference_Marker id="20" body_id="2" pos_z="0.4995"/>',
    )
    is_as(deck, VELOCITY, integrator, 1e-5)
