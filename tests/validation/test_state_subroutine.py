"""Control_StateEqn by GSESUB: closed forms, linear analysis, and what is wrong with it."""

from __future__ import annotations

import numpy as np
import pytest

import mbsim
from mbsim.errors import DeckError, ModelError, PluginError

SCRIPT = """
def GSESUB(id, time, par, npar, dflag, iflag, nstate, states, ninput, input, noutput):
    assert (id, npar, nstate, ninput, noutput) == (4, 2, 1, 2, 1)
    return [[-par[0] * states[0] + input[0]], [par[1] * states[0] + input[1]]]


def SHORT(id, time, par, npar, dflag, iflag, nstate, states, ninput, input, noutput):
    return [[0.0, 1.0], [0.0]]


def ONE(id, time, par, npar, dflag, iflag, nstate, states, ninput, input, noutput):
    return 1.0


def FEW(id, time, par, npar, dflag, iflag):
    return [[0.0], [0.0]]
"""
MODEL = """
  <Body_Rigid id="1" isground="TRUE"/>
  <Body_Rigid id="2" cg_id="20" mass="2" inertia_xx="0.1" inertia_yy="0.1" inertia_zz="0.1"/>
  <Body_Rigid id="3" cg_id="30" mass="2" inertia_xx="0.1" inertia_yy="0.1" inertia_zz="0.1"/>
  <Reference_Marker id="10" body_id="1"/>
  <Reference_Marker id="20" body_id="2" pos_z="0.1"/>
  <Reference_Marker id="30" body_id="3" pos_z="0.1"/>
  <Constraint_Joint id="1" type="TRANSLATIONAL" i_marker_id="20" j_marker_id="10"/>
  <Constraint_Joint id="2" type="TRANSLATIONAL" i_marker_id="30" j_marker_id="10"/>
  <Reference_Variable id="1" expr="1"/>
  <Reference_Variable id="2" expr="-8*DZ(30)"/>
  <Reference_Array id="1" type="U" variable_id="1 2"/>
  <Reference_Array id="2" type="X" num_element="1"/>
  <Reference_Array id="3" type="Y" num_element="1"/>
  <Control_StateEqn id="4" type="USERSUB" x_array_id="2" y_array_id="3" u_array_id="1" num_state="1"
    num_output="1" usrsub_param_string="USER(2, 4)" script_name="gse.py"/>
  <Force_Vector_OneBody id="1" type="ForceOnly" i_marker_id="20" fz_expression="ARYVAL(3,1)"/>
  <Post_Request id="1" type="EXPRESSION" expr1="ARYVAL(2,1)" expr2="ARYVAL(3,1)" expr3="DZ(20)"/>"""
RUN = '<Simulate end_time="0.5" num_steps="5"/>'


def read(folder, model=MODEL, command=RUN):
    (folder / "gse.py").write_text(SCRIPT)
    deck = folder / "deck.xml"
    deck.write_text(
        f"<MotionSolve><Model>{model}</Model><Command>{command}</Command></MotionSolve>"
    )
    return mbsim.read_model(deck)


@pytest.mark.parametrize("method", ["DOP853", "RADAU5"])
def test_slopes_and_outputs(method, tmp_path):
    found = mbsim.simulate(read(tmp_path), integrator=method, tol=1e-9)
    x = 0.5 * (1.0 - np.exp(-2.0 * found["time"]))
    np.testing.assert_allclose(found["requests/1/F1"], x, atol=1e-8)
    np.testing.assert_allclose(found["requests/1/F2"], 4.0 * x - 0.8, atol=1e-8)


def test_an_output_is_linearised_by_its_state_and_by_bodies_of_its_inputs(tmp_path):
    command = '<Simulate analysis_type="Linear"/>'
    folder = tmp_path / "out"
    mbsim.simulate(read(tmp_path, command=command), output=folder)
    with mbsim.open_results(next(folder.glob("*.h5"))) as results:
        A = results.linear[0].A
    # of z'' of the first body: 4/2 by the state, -8/2 by z of the second
    found = np.sort(np.abs(A[np.abs(A) > 1e-4]))
    np.testing.assert_allclose(found, [1.0, 1.0, 2.0, 2.0, 4.0], atol=1e-5)


def test_a_routine_of_an_adams_deck(tmp_path):
    (tmp_path / "gse.py").write_text(SCRIPT)
    deck = tmp_path / "deck.adm"
    deck.write_text(
        "a system of states\nUNITS/SYSTEM=MKS\nPART/1, GROUND\nMARKER/10, PART=1\n"
        "PART/2, MASS=1, CM=20, IP=1,1,1\nMARKER/20, PART=2\n"
        "VARIABLE/1, FUNCTION=1\nVARIABLE/2, FUNCTION=0\n"
        "ARRAY/1, U, VARIABLES=1,2\nARRAY/2, X, SIZE=1\nARRAY/3, Y, SIZE=1\n"
        "GSE/4, X=2, U=1, Y=3, NS=1, NO=1, FUNCTION=USER(2,4)\\ROUTINE=gse.py::GSESUB\n"
        "REQUEST/1, F2=ARYVAL(3,1)\nEND\n"
    )
    found = mbsim.simulate(mbsim.read_model(deck), end_time=0.5, print_interval=0.25)
    expected = 2.0 * (1.0 - np.exp(-2.0 * found["time"]))
    np.testing.assert_allclose(found["requests/1/F2"], expected, atol=1e-7)


WRONG = {
    'num_state="1"': ("", "num_state: missing"),
    'num_output="1"': ("", "num_output and y_array_id: one goes with the other"),
    'num_element="1"/>': ('num_element="3"/>', "array 2 has 3 elements; there are 1 x"),
    'type="USERSUB"': ('type="LINEAR"', "this system is linear; must not be there"),
    "x_array_id": ('a_matrix_id="1" x_array_id', "a subroutine gives this system"),
}


@pytest.mark.parametrize("right", WRONG)
def test_what_is_wrong_is_said(right, tmp_path):
    wrong, said = WRONG[right]
    with pytest.raises(DeckError) as caught:
        read(tmp_path, MODEL.replace(right, wrong, 1))
    assert said in str(caught.value)


@pytest.mark.parametrize(
    ("name", "said"),
    [("SHORT", "returned 2 values"), ("ONE", r"not \[stated, output\]"), ("FEW", "11 arguments")],
)
def test_what_a_function_gives_must_fit(name, said, tmp_path):
    model = MODEL.replace("script_name", f'usrsub_fnc_name="{name}" script_name')
    with pytest.raises((PluginError, ModelError), match=said):
        mbsim.simulate(read(tmp_path, model))
