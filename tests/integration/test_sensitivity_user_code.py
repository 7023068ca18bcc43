"""Sensitivities of models with users' subroutines, compiled, interpreted and of a library."""

from __future__ import annotations

import math

import numpy as np
import pytest

import mbsim
from helpers.libraries import example
from helpers.tight_runs import differences
from mbsim.errors import ModelError

SCRIPT = """from math import sin
{prevents}

def CNFSUB(id, time, par, npar, loci, ni, locj, nj, gap, gapdot, gapdotdot, dflag, iflag):
    {line}
    if gap >= 0.0:
        return 0.0
    return max(0.0, par[0] * (-gap) ** 1.5 * (1.0 - par[1] * gapdot))

def CFFSUB(id, time, par, npar, loci, locj, x, xdot, nforce, dflag, iflag):
    {line}
    v = sqrt(xdot[0] ** 2 + xdot[1] ** 2 + par[1] ** 2)
    return [-par[0] * nforce * xdot[0] / v, -par[0] * nforce * xdot[1] / v, 0.0]

def GFOSUB(id, time, par, npar, dflag, iflag):
    return [par[0] * sin(3.0 * time), 0.0, 0.0, 0.0, 0.0, 0.0]
"""
BALL = """<Deck><Model>
<Body_Rigid id="1" isground="TRUE"/>
<Body_Rigid id="2" cg_id="20" mass="5" inertia_xx="0.0233" inertia_yy="0.0233" inertia_zz="0.0233"
 v_ic_x="2" v_ic_x_flag="TRUE"/>
<Reference_Marker id="10" body_id="1"/>
<Reference_Marker id="20" body_id="2" pos_z="0.2"/>
<Post_Graphic id="100" type="Plane" rm_id="10"/>
<Post_Graphic id="200" type="Sphere" center_marker_id="20" radius="0.108"/>
<Force_Contact id="301" num_i_graphics="1" i_graphics_id="200" num_j_graphics="1"
 j_graphics_id="100" {law}/>
{more}<Force_Gravity grav_z="-9.81"/>
</Model><Command>
<Simulate analysis_type="Transient" end_time="0.4" print_interval="0.02"/>
</Command></Deck>"""
NORMAL = 'cnf_type="USERCNF" cnf_fnc_name="CNFSUB" cnf_param_string="USER(1e5,0.3)"'
IMPACT = 'cnf_type="IMPACT" stiffness="1e5" exponent="1.5" damping="100" dmax="1e-4"'
BUILT_IN = (
    ' cff_type="COULOMB_ON" mu_static="0.3" mu_dynamic="0.3" stiction_trans_vel="0.02"'
    ' friction_trans_vel="0.02"'
)
FRICTION = ' cff_type="USERCFF" cff_fnc_name="CFFSUB" cff_param_string="USER(0.3,0.01)"'
PUSH = """<Force_Vector_TwoBody id="5" type="ForceAndTorque" i_marker_id="20"
 j_floating_marker_id="10" ref_marker_id="10" usrsub_param_string="USER(3)"
 usrsub_fnc_name="GFOSUB" script_name="laws.py" interpreter="PYTHON"/>
"""
SIGNAL = "bodies/2/position"


def holds(deck, name, value, integrator="DOPRI5"):
    how = {"integrator": "DOP853", "tol": 1e-11}
    truth = differences(deck, name, value, 1e-5 * value, (SIGNAL,), **how)[SIGNAL]
    run = mbsim.simulate(deck, integrator=integrator, tol=1e-9, sensitivity=[name])
    assert run.parameters[name]["known_until"] == math.inf
    assert np.abs(run.sensitivity(SIGNAL, name) - truth).max() < 1e-5 * np.abs(truth).max()


def deck(tmp_path, law, more="", interpreted=False):
    line = "kept = {1: 2}" if interpreted else "kept = 0.0"
    (tmp_path / "laws.py").write_text(SCRIPT.format(line=line, prevents="from math import sqrt"))
    file = tmp_path / "ball.xml"
    file.write_text(BALL.format(law=law, more=more))
    return file


@pytest.mark.parametrize("interpreted", [False, True])
@pytest.mark.parametrize(
    "law",
    [
        NORMAL + ' script_name="laws.py"' + BUILT_IN,
        IMPACT + ' script_name="laws.py"' + FRICTION,
        NORMAL + ' script_name="laws.py"' + FRICTION,
    ],
)
def test_a_users_contact_law(law, interpreted, tmp_path):
    file = deck(tmp_path, law, interpreted=interpreted)
    for name, value in (("Body_Rigid[2].mass", 5.0), ("Body_Rigid[2].v_ic_x", 2.0)):
        holds(file, name, value)


def test_a_users_force(tmp_path):
    holds(deck(tmp_path, IMPACT + BUILT_IN, PUSH), "Body_Rigid[2].mass", 5.0, "RADAU5")


@pytest.mark.parametrize("interpreted", [False, True])
def test_numbers_that_a_users_law_is_given(interpreted, tmp_path):
    law = NORMAL + ' script_name="laws.py"' + FRICTION
    file = deck(tmp_path, law, interpreted=interpreted)
    for name, value in (
        ("Force_Contact[301].cnf_param_string[1]", 1e5),
        ("Force_Contact[301].cnf_param_string[2]", 0.3),
        ("Force_Contact[301].cff_param_string[1]", 0.3),
    ):
        holds(file, name, value)


@pytest.mark.parametrize("source", ["cffsub.c", "cffsub.f90"])
def test_numbers_that_a_library_is_given(source, tmp_path):
    library = example(tmp_path, source)
    law = FRICTION.replace("0.3,0.01", "0.3,0.25,0.02,0.04") + f' dll_name="{library.name}"'
    file = tmp_path / "ball.xml"
    file.write_text(BALL.format(law=IMPACT + law.replace("dll_name", "cff_dll_name"), more=""))
    holds(file, "Force_Contact[301].cff_param_string[2]", 0.25)


def test_numbers_that_are_not_known_are_said_to_be_none(tmp_path):
    file = deck(tmp_path, IMPACT + BUILT_IN, PUSH)
    for name, why in (
        ("Force_Vector_TwoBody[5].usrsub_param_string[1]", "keeps to itself"),
        ("Force_Vector_TwoBody[5].usrsub_param_string[2]", "has 1 numbers, no 2"),
        ("Force_Vector_TwoBody[5].usrsub_param_string", r"is no number; one of USER\(...\)"),
        ("Body_Rigid[2].mass[1]", r"is no USER\(...\)"),
    ):
        with pytest.raises(ModelError, match=why):
            mbsim.simulate(file, sensitivity=[name])
    run = mbsim.simulate(file, overrides={"Force_Vector_TwoBody[5].usrsub_param_string[1]": 0.0})
    assert abs(run["bodies/2/velocity/x"][1] - 2.0) < 1e-6


def rubbed_ball(folder, subroutine, numbers, height):
    """Write a ball that lies on the ground at its centre's height, rubbed by a subroutine."""
    (folder / "laws.py").write_text(subroutine)
    law = IMPACT + ' script_name="laws.py"' + FRICTION.replace("0.3,0.01", numbers)
    file = folder / "ball.xml"
    file.write_text(BALL.format(law=law, more="").replace('pos_z="0.2"', f'pos_z="{height}"'))
    return file


OVER_SPEED = """
def CFFSUB(id, time, par, npar, loci, locj, x, xdot, nforce, dflag, iflag):
    v = (xdot[0] ** 2 + xdot[1] ** 2 + 1e-8) ** 0.5
    mu = par[0]
    if v < par[1]:
        mu = par[2]
    return [-mu * nforce * xdot[0] / v, -mu * nforce * xdot[1] / v, 0.0]
"""


@pytest.mark.parametrize("integrator", ["DOPRI5", "DOP853", "RADAU5", "GALPHA"])
def test_a_users_friction_that_jumps_over_the_slip_speed(integrator, tmp_path):
    # a sphere at rest on its contact slides from 2 to below 1.3; it begins to roll
    file = rubbed_ball(tmp_path, OVER_SPEED, "0.3,1.3,0.2", "0.1074")
    numbers = [f"Force_Contact[301].cff_param_string[{k}]" for k in (1, 2, 3)]
    run = mbsim.simulate(file, integrator=integrator, tol=1e-8, sensitivity=numbers)
    for name in numbers[:2]:
        about = run.parameters[name]
        assert "a user's subroutine jumps" in about["why"]
        assert "Force_Contact[301]: CFFSUB" in about["why"]
        known = about["known_until"]
        assert 0.0 < known < 0.2
        assert np.isnan(run.sensitivity(SIGNAL, name)[run["time"] > known]).all()
    # before the jump nothing is known of the number behind it, and it moves nothing
    about = run.parameters[numbers[2]]
    assert about["known_until"] == math.inf
    found = run.sensitivity("bodies/2/velocity/x", numbers[2])
    assert (found[run["time"] <= known] == 0.0).all()
    assert (found[run["time"] > known + 0.03] < -1e-3).all()


LOADS_AND_UNLOADS = """
def CNFSUB(id, time, par, npar, loci, ni, locj, nj, gap, gapdot, gapdotdot, dflag, iflag):
    if gap >= 0.0:
        return 0.0
    if gapdot < 0.0:
        return par[0] * (-gap) ** 1.5
    return par[0] * par[1] * (-gap) ** 1.5
"""


@pytest.mark.parametrize("integrator", ["DOPRI5", "DOP853", "RADAU5", "GALPHA"])
def test_a_users_normal_force_that_jumps_where_the_impact_turns(integrator, tmp_path):
    (tmp_path / "laws.py").write_text(LOADS_AND_UNLOADS)
    file = tmp_path / "ball.xml"
    file.write_text(BALL.format(law=NORMAL + ' script_name="laws.py"', more=""))
    name = "Body_Rigid[2].mass"
    run = mbsim.simulate(file, integrator=integrator, tol=1e-8, sensitivity=[name])
    about, (touch, leave) = run.parameters[name], run["events"]["time"][:2]
    assert "a user's subroutine jumps" in about["why"]
    assert touch + 0.01 < about["known_until"] < leave - 0.01


@pytest.mark.parametrize("integrator", ["DOPRI5", "DOP853", "RADAU5", "GALPHA"])
def test_a_users_friction_that_is_steep_but_smooth_is_known(integrator, tmp_path):
    steep = OVER_SPEED.replace(
        "    mu = par[0]\n    if v < par[1]:\n        mu = par[2]\n",
        "    s = 200.0 * (v - par[1])\n    s = s / (1.0 + s * s) ** 0.5\n"
        "    mu = par[2] + 0.5 * (par[0] - par[2]) * (1.0 + s)\n",
    )
    file = rubbed_ball(tmp_path, steep, "0.3,1.3,0.2", "0.1074")
    holds(file, "Force_Contact[301].cff_param_string[2]", 1.3, integrator)


CLOCK = """
def CFFSUB(id, time, par, npar, loci, locj, x, xdot, nforce, dflag, iflag):
    v = (xdot[0] ** 2 + xdot[1] ** 2 + 1e-4) ** 0.5
    mu = par[0]
    if time > par[1]:
        mu = par[2]
    return [-mu * nforce * xdot[0] / v, -mu * nforce * xdot[1] / v, 0.0]
"""


@pytest.mark.parametrize("integrator", ["DOPRI5", "DOP853", "RADAU5", "GALPHA"])
def test_a_time_that_a_users_law_keeps_to_itself(integrator, tmp_path):
    file = rubbed_ball(tmp_path, CLOCK, "0.1,0.2987,0.05", "0.107")
    moved, other = (f"Force_Contact[301].cff_param_string[{k}]" for k in (2, 3))
    run = mbsim.simulate(file, integrator=integrator, tol=1e-8, sensitivity=[moved, other])
    # which of its times the force jumps at nothing tells but the force itself
    assert "jump" in run.parameters[moved]["why"]
    assert np.isnan(run.sensitivity(SIGNAL, moved)[run["time"] > 0.3]).all()
    # one that moves no jump is known
    assert run.parameters[other]["known_until"] == math.inf
    assert (run.sensitivity("bodies/2/velocity/x", other)[run["time"] > 0.31] < -1e-3).all()
