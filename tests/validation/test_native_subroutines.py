"""SFOSUB and others in C and Fortran: the motion of the same expressions, and clear errors."""

from __future__ import annotations

import subprocess

import numpy as np
import pytest
from click.testing import CliRunner

import mbsim
from helpers.folders import USERFUNCS
from helpers.libraries import need
from mbsim.cli.main import main
from mbsim.errors import DeckError, ModelError, PluginError
from mbsim.plugins.source.find import usersub_folder

IN_C = """
#include "mbsim_usersub.h"
#include <math.h>
#define CALLED int *id, double *time, double *par, int *npar
MBSIM_EXPORT void SFOSUB(CALLED, int *dflag, int *iflag, double *result)
{
    int markers[2] = {(int)par[0], (int)par[1]}, errflg;
    double d, v;
    c_sysfnc("DM", markers, 2, &d, &errflg);
    c_errmes(errflg, "DM is not known", *id, "STOP");
    c_sysfnc("VR", markers, 2, &v, &errflg);
    *result = -100.0 * (d - 0.5) - 2.0 * v;
}
MBSIM_EXPORT void GFOSUB(CALLED, int *dflag, int *iflag, double *result)
{
    int markers[3] = {(int)par[0], (int)par[1], (int)par[1]}, n, errflg;
    double v[6];
    c_sysary("VEL", markers, 3, v, &n, &errflg);
    for (int k = 0; k < 6; k++) result[k] = n == 6 ? -0.3 * v[k] : NAN;
}
MBSIM_EXPORT void VARSUB(CALLED, int *dflag, int *iflag, double *result) { *result = sin(*time); }
MBSIM_EXPORT void DIFSUB(CALLED, int *dflag, int *iflag, double *result)
{
    int state = *id, errflg;
    double z;
    c_sysfnc("DIF", &state, 1, &z, &errflg);
    *result = par[0] * z;
}
MBSIM_EXPORT void MOTSUB(CALLED, int *iord, int *iflag, double *result)
{
    double w = par[0], t = *time;
    *result = *iord == 0 ? sin(w * t) : *iord == 1 ? w * cos(w * t) : -w * w * sin(w * t);
}
MBSIM_EXPORT void SENSUB(CALLED, int *iflag, double *result) { *result = *time; }
MBSIM_EXPORT void REQSUB(CALLED, int *iflag, double *result)
{
    int markers[3] = {(int)par[0], 0, 0}, errflg;
    for (int k = 0; k < 8; k++) result[k] = k;
    c_sysfnc("ACCX", markers, 1, &result[1], &errflg);
}
MBSIM_EXPORT void VFOSUB(CALLED, int *dflag, int *iflag, double *result)
{
    int markers[3] = {(int)par[0], (int)par[1], (int)par[1]}, n, errflg;
    c_sysary("TVEL", markers, 3, result, &n, &errflg);
    for (int k = 0; k < 3; k++) result[k] *= -0.3;
}
MBSIM_EXPORT void VTOSUB(CALLED, int *dflag, int *iflag, double *result)
{
    int markers[3] = {(int)par[0], (int)par[1], (int)par[1]}, n, errflg;
    c_sysary("RVEL", markers, 3, result, &n, &errflg);
    for (int k = 0; k < 3; k++) result[k] *= -0.3;
}
MBSIM_EXPORT void SEVSUB(CALLED, int *iflag, double *result) { *result = par[0] * *time; }
MBSIM_EXPORT void GSESUB(CALLED, int *dflag, int *iflag, int *nstate, double *states, int *ninput,
                         double *input, int *noutput, double *stated, double *output)
{
    stated[0] = states[1];
    stated[1] = input[0] - par[0] * states[0];
    for (int k = 0; k < *noutput; k++) output[k] = (k + 1) * states[0];
}
MBSIM_EXPORT void FAILS(CALLED, int *dflag, int *iflag, double *result)
{
    *result = 0.0;
    if (!*iflag) c_errmes(1, "no more", *id, "STOP");
}
"""
IN_FORTRAN = """
subroutine sfosub(id, time, par, npar, dflag, iflag, result)
    implicit none
    integer, intent(in) :: id, npar
    double precision, intent(in) :: time, par(npar)
    logical, intent(in) :: dflag, iflag
    double precision, intent(out) :: result
    double precision :: d, v
    logical :: errflg
    call sysfnc('DM', int(par(1:2)), 2, d, errflg)
    call errmes(errflg, 'DM is not known', id, 'STOP')
    call sysfnc('VR', int(par(1:2)), 2, v, errflg)
    result = -100d0 * (d - 0.5d0) - 2d0 * v
end subroutine sfosub
subroutine gfosub(id, time, par, npar, dflag, iflag, result)
    implicit none
    integer, intent(in) :: id, npar
    double precision, intent(in) :: time, par(npar)
    logical, intent(in) :: dflag, iflag
    double precision, intent(out) :: result(6)
    double precision :: v(6)
    integer :: n
    logical :: errflg
    call sysary('VEL', int((/par(1), par(2), par(2)/)), 3, v, n, errflg)
    result = -0.3d0 * v
end subroutine gfosub
subroutine vfosub(id, time, par, npar, dflag, iflag, result)
    implicit none
    integer, intent(in) :: id, npar
    double precision, intent(in) :: time, par(npar)
    logical, intent(in) :: dflag, iflag
    double precision, intent(out) :: result(3)
    integer :: n
    logical :: errflg
    call sysary('TVEL', int((/par(1), par(2), par(2)/)), 3, result, n, errflg)
    result = -0.3d0 * result
end subroutine vfosub
subroutine vtosub(id, time, par, npar, dflag, iflag, result)
    implicit none
    integer, intent(in) :: id, npar
    double precision, intent(in) :: time, par(npar)
    logical, intent(in) :: dflag, iflag
    double precision, intent(out) :: result(3)
    integer :: n
    logical :: errflg
    call sysary('RVEL', int((/par(1), par(2), par(2)/)), 3, result, n, errflg)
    result = -0.3d0 * result
end subroutine vtosub
subroutine difsub(id, time, par, npar, dflag, iflag, result)
    implicit none
    integer, intent(in) :: id, npar
    double precision, intent(in) :: time, par(npar)
    logical, intent(in) :: dflag, iflag
    double precision, intent(out) :: result
    logical :: errflg
    call sysfnc('DIF', (/id/), 1, result, errflg)
    result = par(1) * result
end subroutine difsub
subroutine motsub(id, time, par, npar, iord, iflag, result)
    implicit none
    integer, intent(in) :: id, npar, iord
    double precision, intent(in) :: time, par(npar)
    logical, intent(in) :: iflag
    double precision, intent(out) :: result
    select case (iord)
    case (0)
        result = sin(par(1) * time)
    case (1)
        result = par(1) * cos(par(1) * time)
    case default
        result = -par(1)**2 * sin(par(1) * time)
    end select
end subroutine motsub
subroutine varsub(id, time, par, npar, dflag, iflag, result)
    implicit none
    integer, intent(in) :: id, npar
    double precision, intent(in) :: time, par(npar)
    logical, intent(in) :: dflag, iflag
    double precision, intent(out) :: result
    result = sin(time)
end subroutine varsub
subroutine sensub(id, time, par, npar, iflag, result)
    implicit none
    integer, intent(in) :: id, npar
    double precision, intent(in) :: time, par(npar)
    logical, intent(in) :: iflag
    double precision, intent(out) :: result
    result = time
end subroutine sensub
subroutine sevsub(id, time, par, npar, iflag, result)
    implicit none
    integer, intent(in) :: id, npar
    double precision, intent(in) :: time, par(npar)
    logical, intent(in) :: iflag
    double precision, intent(out) :: result
    result = par(1) * time
end subroutine sevsub
subroutine reqsub(id, time, par, npar, iflag, result)
    implicit none
    integer, intent(in) :: id, npar
    double precision, intent(in) :: time, par(npar)
    logical, intent(in) :: iflag
    double precision, intent(out) :: result(8)
    integer :: k
    logical :: errflg
    result = (/(dble(k - 1), k = 1, 8)/)
    call sysfnc('ACCX', int(par(1:1)), 1, result(2), errflg)
end subroutine reqsub
subroutine gsesub(id, time, par, npar, dflag, iflag, nstate, states, ninput, input, noutpt, &
                  stated, output)
    implicit none
    integer, intent(in) :: id, npar, nstate, ninput, noutpt
    double precision, intent(in) :: time, par(npar), states(nstate), input(ninput)
    logical, intent(in) :: dflag, iflag
    double precision, intent(out) :: stated(nstate), output(noutpt)
    integer :: k
    stated(1) = states(2)
    stated(2) = input(1) - par(1) * states(1)
    output = (/(k * states(1), k = 1, noutpt)/)
end subroutine gsesub
"""
BODIES = """
  <Body_Rigid id="1" isground="TRUE"/>
  <Body_Rigid id="2" cg_id="20" mass="1" inertia_xx="0.1" inertia_yy="0.1" inertia_zz="0.1"
    v_ic_y="0.4" v_ic_y_flag="TRUE" w_ic_z="1" w_ic_z_flag="TRUE"/>
  <Reference_Marker id="10" body_id="1"/>
  <Reference_Marker id="20" body_id="2" pos_x="0.6"/>"""
FORCES = """
  <Force_Scalar_TwoBody id="1" type="Force" i_marker_id="20" j_marker_id="10"
    usrsub_param_string="USER(20, 10)" {file}/>
  <Force_Vector_OneBody id="2" type="ForceAndTorque" i_marker_id="20" ref_marker_id="10"
    usrsub_param_string="USER(20, 10)" {file}/>"""
EXPRESSED = """
  <Force_Scalar_TwoBody id="1" type="Force" i_marker_id="20" j_marker_id="10"
    expr="-100*(DM(20,10)-0.5)-2*VR(20,10)"/>
  <Force_Vector_OneBody id="2" type="ForceAndTorque" i_marker_id="20" ref_marker_id="10"
    fx_expression="-0.3*VX(20,10,10)" fy_expression="-0.3*VY(20,10,10)"
    fz_expression="-0.3*VZ(20,10,10)" tx_expression="-0.3*WX(20,10,10)"
    ty_expression="-0.3*WY(20,10,10)" tz_expression="-0.3*WZ(20,10,10)"/>"""


@pytest.fixture(scope="module")
def libraries(tmp_path_factory):
    need("gcc")
    need("gfortran")
    folder = tmp_path_factory.mktemp("libraries")
    (folder / "user.c").write_text(IN_C)
    (folder / "user.f90").write_text(IN_FORTRAN)
    shared, here = ("-O2", "-shared", "-fPIC"), USERFUNCS
    for command in (
        ["gcc", *shared, "-Wall", "-Werror", "-I", here, "-o", "c.so", "user.c", "-lm"],
        ["gfortran", *shared, "-o", "f.so", here / "mbsim_usersub.f90", "user.f90"],
    ):
        subprocess.run(command, check=True, capture_output=True, cwd=folder)
    return folder


def run(folder, model, command='end_time="1" print_interval="0.1"', **how):
    deck = folder / "deck.xml"
    deck.write_text(
        f"<MotionSolve><Model>{BODIES}{model}</Model><Command><Simulate "
        f'analysis_type="Transient" {command}/></Command></MotionSolve>'
    )
    return mbsim.simulate(mbsim.read_model(deck), tol=1e-9, **how)


def test_the_header_is_where_it_is_said_to_be():
    assert (usersub_folder() / "mbsim_usersub.h").is_file()


@pytest.mark.parametrize("file", ["c", "f"])
def test_forces_in_c_and_fortran_move_as_their_expressions(libraries, file):
    told = []
    dll = f'usrsub_dll_name="{file}"'
    found = run(libraries, FORCES.format(file=dll), notify=told.append)
    expected = run(libraries, EXPRESSED)
    name = "bodies/2/position"
    np.testing.assert_allclose(found[name], expected[name], atol=1e-8)
    language = {"c": "C", "f": "Fortran"}[file]
    assert f"Force_Scalar_TwoBody[1]: SFOSUB of {file}.so, {language}" in told


def test_a_routine_of_an_adams_deck_is_in_c(libraries):
    deck = libraries / "falls.adm"
    deck.write_text(
        "falls\nUNITS/FORCE=NEWTON, MASS=KILOGRAM, LENGTH=METER, TIME=SECOND\n"
        "PART/1, GROUND\nMARKER/10, PART=1\nPART/2, MASS=1, CM=20, IP=1,1,1\n"
        "MARKER/20, PART=2, QP=0.6,0,0\n"
        "SFORCE/1, TRANSLATIONAL, I=20, J=10, FUNCTION=USER(20, 10)\\ROUTINE=c.so::SFOSUB\n"
        "REQUEST/1, F1=DM(20,10)\nEND\n"
    )
    found = mbsim.simulate(mbsim.read_model(deck), end_time=1.0, print_interval=0.5)
    # x'' = -100 (x - 0.5) - 2 x'
    w = np.sqrt(99.0)
    t = found["time"]
    x = 0.5 + 0.1 * np.exp(-t) * (np.cos(w * t) + np.sin(w * t) / w)
    np.testing.assert_allclose(found["requests/1/F1"], x, atol=1e-7)


@pytest.mark.parametrize("file", ["c", "f"])
def test_force_and_torque_apart(file, libraries):
    model = "".join(
        f'<Force_Vector_OneBody id="{id}" type="{type}" i_marker_id="20" ref_marker_id="10" '
        f'usrsub_param_string="USER(20, 10)" usrsub_dll_name="{file}"/>'
        for id, type in ((2, "ForceOnly"), (3, "TorqueOnly"))
    )
    expressed = "<Force_Vector" + EXPRESSED.partition("<Force_Vector")[2]
    found, expected = run(libraries, model), run(libraries, expressed)
    for name in ("bodies/2/position", "bodies/2/angular_velocity"):
        np.testing.assert_allclose(found[name], expected[name], atol=1e-8)


@pytest.mark.parametrize("file", ["c", "f"])
def test_a_system_of_states_and_what_a_sensor_evaluates(file, libraries):
    dll = f'usrsub_dll_name="{file}"'
    model = f"""
  <Reference_Variable id="1" expr="1"/>
  <Reference_Array id="1" type="U" variable_id="1"/>
  <Reference_Array id="2" type="X" num_element="2"/>
  <Reference_Array id="3" type="Y" num_element="2"/>
  <Control_StateEqn id="4" type="USERSUB" x_array_id="2" y_array_id="3" u_array_id="1" num_state="2"
    num_output="2" usrsub_param_string="USER(4)" {dll}/>
  <Sensor_Evaluate id="6" usrsub_param_string="USER(3)" {dll}/>
  <Sensor_Event id="5" evaluate_id="6" compare="GE" value="0.25" expr="TIME"/>
  <Post_Request id="1" type="EXPRESSION" expr1="ARYVAL(3,2)" expr2="SENVAL(6)"
    expr3="ARYVAL(2,2)"/>"""
    found = run(libraries, model)
    time = found["time"]
    np.testing.assert_allclose(found["requests/1/F1"], (1 - np.cos(2 * time)) / 2, atol=1e-7)
    np.testing.assert_allclose(found["requests/1/F3"], np.sin(2 * time) / 2, atol=1e-7)
    np.testing.assert_allclose(found["requests/1/F2"][-1], 0.75, atol=0.1)


@pytest.mark.parametrize("file", ["c", "f"])
def test_the_others(file, libraries):
    dll = f'usrsub_dll_name="{file}"'
    model = f"""
  <Constraint_Joint id="1" type="TRANSLATIONAL" i_marker_id="22" j_marker_id="12"/>
  <Reference_Marker id="12" body_id="1" a00="0" a20="-1" a02="1" a22="0"/>
  <Reference_Marker id="22" body_id="2" a00="0" a20="-1" a02="1" a22="0"/>
  <Motion_Joint id="1" joint_id="1" val_type="D" usrsub_param_string="USER(2)" {dll}/>
  <Reference_Variable id="3" usrsub_param_string="USER()" {dll}/>
  <Control_Diff id="4" ic="1" usrsub_param_string="USER(-2)" {dll}/>
  <Sensor_Event id="5" compare="GE" value="0.75" return="TRUE" usrsub_param_string="USER()" {dll}/>
  <Post_Request id="1" type="USERSUB" usrsub_param_string="USER(20)" {dll}/>
  <Post_Request id="2" type="EXPRESSION" expr1="DZ(22,12,12)" expr2="VARVAL(3)"
    expr3="DIF(4)"/>"""
    found = run(libraries, model)
    time = found["time"]
    assert 0.75 <= time[-1] < 0.8
    np.testing.assert_allclose(found["requests/2/F1"], np.sin(2 * time), atol=1e-7)
    np.testing.assert_allclose(found["requests/2/F2"], np.sin(time), atol=1e-12)
    np.testing.assert_allclose(found["requests/2/F3"], np.exp(-2 * time), atol=1e-7)
    np.testing.assert_allclose(found["requests/1/F2"], -4 * np.sin(2 * time), atol=1e-6)
    np.testing.assert_allclose(found["requests/1/F8"], 7.0)


def test_a_contactpost_in_c_looks_at_points(tmp_path):
    need("gcc")
    (tmp_path / "post.c").write_text(
        """
#include "mbsim_usersub.h"
#include <stdio.h>
void CONTACTPOST(int *id, int *i, int *j, double *time, double *par, int *npar, int *iflag,
                 int *endflg)
{
    int n, count, errflg;
    double values[11];
    char text[99];
    if (*iflag || *endflg) return;
    c_get_ncontacts(*id, *i, *j, &n, &errflg);
    if (n < 1) return;
    c_get_contact_post(*id, *i, *j, 1, values, &count, &errflg);
    snprintf(text, 99, "%d points, depth %.6g at z %.3g", n, values[0], values[3]);
    c_usrmes(1, text, *id, "INFO");
}
"""
    )
    command = ["gcc", "-shared", "-fPIC", "-I", USERFUNCS, "-o", "post.so", "post.c"]
    subprocess.run(command, check=True, capture_output=True, cwd=tmp_path)
    model = """
  <Reference_Marker id="30" body_id="2" pos_x="0.6"/>
  <Post_Graphic id="100" type="Plane" rm_id="11"/>
  <Reference_Marker id="11" body_id="1" pos_z="-0.099"/>
  <Post_Graphic id="200" type="Sphere" center_marker_id="30" radius="0.1"/>
  <Force_Contact id="7" i_graphics_id="200" j_graphics_id="100" cnf_type="IMPACT" stiffness="1e4"
    exponent="1" damping="0" dmax="1e-3" cpost_dll_name="post"/>"""
    run(tmp_path, model, 'end_time="0.001" print_interval="0.001"', output=tmp_path / "out")
    log = (tmp_path / "out" / "deck.log").read_text()
    assert "USRMES:USER [7] INFO: 1 points, depth 0.001" in log


def test_what_a_library_does_not_have_or_stops(libraries):
    deck = libraries / "wrong.xml"
    deck.write_text(
        f"<MotionSolve><Model>{BODIES}{FORCES}</Model></MotionSolve>".replace(
            "{file}", 'usrsub_fnc_name="SFO" usrsub_dll_name="c"'
        )
    )
    checked = CliRunner().invoke(main, ["check", str(deck)])
    assert checked.exit_code == 2
    assert checked.output.count('does not define usrsub_fnc_name="SFO"') == 2
    with pytest.raises(ModelError, match=r"does not define usrsub_fnc_name=\"SFO\""):
        run(libraries, FORCES.format(file='usrsub_fnc_name="SFO" usrsub_dll_name="c"'))
    one = FORCES.partition("<Force_Vector")[0]
    with pytest.raises(PluginError, match="no more"):
        run(libraries, one.format(file='usrsub_fnc_name="FAILS" usrsub_dll_name="c"'))
    with pytest.raises(DeckError, match="no such file"):
        run(libraries, one.format(file='usrsub_dll_name="none"'))
