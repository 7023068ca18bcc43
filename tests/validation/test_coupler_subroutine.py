"""Couplers by COUSUB: independent integrations, the same relation as an expression, and errors."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import mbsim
from helpers.libraries import compiled
from helpers.shafts import TWO_SHAFTS
from mbsim.errors import DeckError, ModelError, PluginError

#: Of q2 = A sin q1, shafts of inertia 1 and 4, a torque of 3 on the first.
A, TORQUE = 0.7, 3.0
SCRIPT = """
from math import cos, sin

def COUSUB(id, time, par, npar, disp, ndisp, iflag):
    return disp[1] - par[0] * sin(disp[0])

def COUXX(id, time, par, npar, disp, ndisp, iflag):
    return [-par[0] * cos(disp[0]), 1.0]

def COUXX2(id, time, par, npar, disp, ndisp, iflag):
    return [[par[0] * sin(disp[0]), 0.0], [0.0, 0.0]]

def ALONE(id, time, par, npar, disp, ndisp, iflag):
    return disp[1] - par[0] * sin(disp[0])

HALF, HALFXX = COUSUB, COUXX
WRONG = TWISTED = SHORT = COUSUB

def WRONGXX(id, time, par, npar, disp, ndisp, iflag):
    return [par[0] * cos(disp[0]), 1.0]

def TWISTEDXX2(id, time, par, npar, disp, ndisp, iflag):
    return [0.0, 1.0, 1.0, 0.0]

def SHORTXX(id, time, par, npar, disp, ndisp, iflag):
    return [1.0]

def LATE(id, time, par, npar, disp, ndisp, iflag):
    return disp[1] - par[0] * sin(disp[0]) - (0.1 if time > 0.3 else 0.0)

def LOOKS(id, time, par, npar, disp, ndisp, iflag):
    value, errflg = py_sysfnc("AZ", [20, 10])
    assert errflg
    return disp[1] - par[0] * sin(disp[0])

def FEW(id, time, par, npar, disp):
    return 0.0

def PLANET(id, time, par, npar, disp, ndisp, iflag):
    return disp[1] - par[0] * sin(disp[0]) + 0.5 * disp[0] * disp[2]
"""
MODEL = (
    TWO_SHAFTS
    + """
  <Post_Request id="1" type="EXPRESSION" expr1="AZ(20,10)" expr2="AZ(30,11)" expr3="WZ(20)"/>"""
)
COUPLER = """<Constraint_Coupler id="1" joint1_id="1" freedom_1="R" joint2_id="2" freedom_2="R"
    usrsub_param_string="USER(0.7)" {file}/>"""
SCRIPTED = COUPLER.format(file='script_name="cou.py" usrsub_fnc_name="{}"')
EXPRESSED = '<Constraint_General id="1" expr="AZ(30,11)-0.7*SIN(AZ(20,10))"/>'
RUN = '<Simulate end_time="2" num_steps="4"/>'


def read(folder, held, command=RUN):
    (folder / "cou.py").write_text(SCRIPT)
    deck = folder / "deck.xml"
    model = MODEL.format(held=held)
    deck.write_text(
        f"<MotionSolve><Model>{model}</Model><Command>{command}</Command></MotionSolve>"
    )
    return mbsim.read_model(deck)


def reference(times):
    def slopes(t, y):
        q, w = y
        bent = 4.0 * A * A * np.cos(q)
        return [w, (TORQUE + bent * np.sin(q) * w * w) / (1.0 + bent * np.cos(q))]

    found = solve_ivp(
        slopes, (0.0, times[-1]), [0.0, 0.0], "DOP853", t_eval=times, rtol=1e-12, atol=1e-13
    )
    return found.y


def check(found, tolerance):
    q, w = reference(found["time"])
    np.testing.assert_allclose(found["requests/1/F1"], q, atol=tolerance)
    np.testing.assert_allclose(found["requests/1/F2"], A * np.sin(q), atol=tolerance)
    np.testing.assert_allclose(found["requests/1/F3"], w, atol=5.0 * tolerance)


@pytest.mark.parametrize(
    ("method", "name", "tolerance"),
    [
        ("DOPRI5", "COUSUB", 1e-9),
        ("DOPRI5", "ALONE", 1e-9),
        ("RADAU5", "HALF", 1e-9),
        ("GALPHA", "COUSUB", 1e-6),
        ("DOP853", "HALF", 1e-9),
        ("AUTO", "ALONE", 1e-9),
    ],
)
def test_shafts_turn_as_integrated_apart(method, name, tolerance, tmp_path):
    model = read(tmp_path, SCRIPTED.format(name))
    check(mbsim.simulate(model, integrator=method, tol=1e-9), tolerance)


def test_steps_of_fixed_length_come_nearer_with_them(tmp_path):
    errors = []
    for h in (4e-3, 1e-3):
        command = f'<Param_Transient h_max="{h}"/>' + RUN
        model = read(tmp_path, SCRIPTED.format("COUSUB"), command)
        found = mbsim.simulate(model, integrator="MOREAU", tol=1e-8)
        errors.append(np.abs(found["requests/1/F1"] - reference(found["time"])[0]).max())
    assert errors[0] < 2e-2
    assert errors[1] < 0.35 * errors[0]


def test_it_is_the_same_as_an_expression(tmp_path):
    """Of the linear model after a second too: the multiplier is not 0 there."""
    command = (
        '<Simulate end_time="1" num_steps="2"/><Simulate analysis_type="Linear" end_time="1"/>'
    )
    matrices, reactions = [], []
    for k, held in enumerate((SCRIPTED.format("COUSUB"), EXPRESSED)):
        folder = tmp_path / str(k)
        mbsim.simulate(read(tmp_path, held, command), output=folder, tol=1e-9)
        with mbsim.open_results(next(folder.glob("*.h5"))) as results:
            matrices.append(np.linalg.eigvals(results.linear[0].A))
            reactions.append(results["joints/1/force"][-1])
    np.testing.assert_allclose(
        np.sort_complex(matrices[0]), np.sort_complex(matrices[1]), atol=1e-5
    )
    np.testing.assert_allclose(reactions[0], reactions[1], atol=1e-7)


def test_three_joints_of_bodies_in_common(tmp_path):
    """Bodies that two terms share count once where the relation is linearised."""
    third = """<Body_Rigid id="4" cg_id="40" mass="1" inertia_xx="2" inertia_yy="2" inertia_zz="2"/>
  <Reference_Marker id="40" body_id="4"/>
  <Constraint_Joint id="3" type="REVOLUTE" i_marker_id="40" j_marker_id="20"/>
  <Force_Scalar_TwoBody id="2" type="Torque" i_marker_id="40" j_marker_id="10" expr="1"
    action_only="TRUE"/>"""
    user = SCRIPTED.format("PLANET").replace(
        "usrsub_param", 'joint3_id="3" freedom_3="R" usrsub_param'
    )
    general = EXPRESSED.replace('"/>', '+0.5*AZ(20,10)*AZ(40,20)"/>')
    found, expected = (
        mbsim.simulate(read(tmp_path, third + held), integrator="RADAU5", tol=1e-9)
        for held in (user, general)
    )
    np.testing.assert_allclose(found["requests/1"], expected["requests/1"], atol=1e-7)
    assert np.abs(found["requests/1/F1"]).max() > 0.1
    counts = [run.stats["factorizations"] for run in (found, expected)]
    assert counts[0] <= 1.1 * counts[1]


def test_a_routine_of_an_adams_deck_names_all_three(tmp_path):
    (tmp_path / "cou.py").write_text(SCRIPT.replace("COUXX2", "BENDS").replace("COUXX", "SLOPES"))
    deck = tmp_path / "deck.adm"
    text = (
        "two shafts\nUNITS/SYSTEM=MKS\nPART/1, GROUND\nMARKER/10, PART=1\n"
        "MARKER/11, PART=1, QP=1,0,0\nPART/2, MASS=1, CM=20, IP=1,1,1\nMARKER/20, PART=2\n"
        "PART/3, MASS=1, CM=30, IP=4,4,4, QG=1,0,0\nMARKER/30, PART=3\n"
        "JOINT/1, REVOLUTE, I=20, J=10\nJOINT/2, REVOLUTE, I=30, J=11\n"
        "COUPLER/1, JOINTS=1,2, FUNCTION=USER(0.7)\\\n"
        ", ROUTINE=cou.py::COUSUB, cou.py::SLOPES, cou.py::BENDS\n"
        "SFORCE/1, ROTATIONAL, ACTIONONLY, I=20, J=10, FUNCTION=3\n"
        "REQUEST/1, F1=AZ(20,10)\\F2=AZ(30,11)\\F3=WZ(20)\nEND\n"
    )
    deck.write_text(text)
    times = {"end_time": 1.0, "print_interval": 0.5}
    check(mbsim.simulate(mbsim.read_model(deck), tol=1e-9, **times), 1e-8)
    deck.write_text(text.replace("cou.py::BENDS", "other.py::BENDS"))
    with pytest.raises(
        DeckError, match=r"deck\.adm:13: COUPLER\[1\]: ROUTINE=.*must be in one file"
    ):
        mbsim.read_model(deck)
    deck.write_text(text.replace("BENDS", "NONE"))
    with pytest.raises(ModelError, match='does not define ROUTINE="NONE"'):
        mbsim.simulate(mbsim.read_model(deck), **times)
    deck.write_text(text.replace("FUNCTION=USER(0.7)", "SCALES=1,1, FUNCTION=USER(0.7)"))
    with pytest.raises(DeckError, match="SCALES or FUNCTION"):
        mbsim.read_model(deck)


IN_C = """
#include <math.h>
#define CALLED int *id, double *time, double *par, int *npar, double *disp, int *ndisp, int *iflag
void COUSUB(CALLED, double *phi) { *phi = disp[1] - par[0] * sin(disp[0]); }
void COUXX(CALLED, double *dfda) { dfda[0] = -par[0] * cos(disp[0]); dfda[1] = 1; }
void COUXX2(CALLED, double *d2fda2)
{
    d2fda2[0] = par[0] * sin(disp[0]);
    for (int k = 1; k < *ndisp * *ndisp; k++) d2fda2[k] = 0;
}
"""
IN_FORTRAN = """
subroutine cousub(id, time, par, npar, disp, ndisp, iflag, phi)
    implicit none
    integer, intent(in) :: id, npar, ndisp
    double precision, intent(in) :: time, par(npar), disp(ndisp)
    logical, intent(in) :: iflag
    double precision, intent(out) :: phi
    phi = disp(2) - par(1) * sin(disp(1))
end subroutine cousub
subroutine couxx(id, time, par, npar, disp, ndisp, iflag, dfda)
    implicit none
    integer, intent(in) :: id, npar, ndisp
    double precision, intent(in) :: time, par(npar), disp(ndisp)
    logical, intent(in) :: iflag
    double precision, intent(out) :: dfda(ndisp)
    dfda = (/-par(1) * cos(disp(1)), 1d0/)
end subroutine couxx
subroutine couxx2(id, time, par, npar, disp, ndisp, iflag, d2fda2)
    implicit none
    integer, intent(in) :: id, npar, ndisp
    double precision, intent(in) :: time, par(npar), disp(ndisp)
    logical, intent(in) :: iflag
    double precision, intent(out) :: d2fda2(ndisp, ndisp)
    d2fda2 = 0d0
    d2fda2(1, 1) = par(1) * sin(disp(1))
end subroutine couxx2
"""


@pytest.mark.parametrize(("suffix", "text"), [("c", IN_C), ("f90", IN_FORTRAN)])
def test_it_may_be_in_c_and_fortran(suffix, text, tmp_path):
    compiled(tmp_path, text, suffix)
    held = COUPLER.format(file='usrsub_dll_name="user"')
    check(mbsim.simulate(read(tmp_path, held), integrator="DOPRI5", tol=1e-9), 1e-9)


def test_it_may_not_look_at_the_state(tmp_path):
    found = mbsim.simulate(read(tmp_path, SCRIPTED.format("LOOKS")), integrator="DOPRI5", tol=1e-9)
    check(found, 1e-9)


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("WRONG", r"Constraint_Coupler\[1\]: WRONG .*WRONGXX gives \[0\.7, 1\], but what WRONG "),
        ("TWISTED", r"TWISTEDXX2 gives \[0, 1, 1, 0\], but what TWISTED gives changes by"),
        ("SHORT", r"returned 1 values, \[1\.0\], not 2 finite numbers"),
        ("LATE", r"LATE .*may not depend on the time.*Constraint_General"),
        ("FEW", r"FEW.* cannot be called with the 7 arguments"),
    ],
)
def test_what_a_function_gives_must_fit(name, said, tmp_path):
    with pytest.raises((PluginError, ModelError), match=said):
        mbsim.simulate(read(tmp_path, SCRIPTED.format(name)), integrator="DOPRI5")


@pytest.mark.parametrize(
    ("right", "wrong", "said"),
    [
        ('usrsub_param_string="USER(0.7)"', "", "usrsub_param_string: missing"),
        ("usrsub_param", 'coefficients="1 2" usrsub_param', "given by a user subroutine"),
        ("cou.py", "none.py", "no such file"),
        ('freedom_2="R"', "", "freedom_2: missing"),
        ("0.7", "0.7; 1", "usrsub_param_string"),
    ],
)
def test_what_is_wrong_is_said_with_its_line(right, wrong, said, tmp_path):
    held = SCRIPTED.format("COUSUB").replace(right, wrong)
    with pytest.raises(DeckError, match=rf"deck\.xml:1\d: Constraint_Coupler\[1\]: .*{said}"):
        read(tmp_path, held)
