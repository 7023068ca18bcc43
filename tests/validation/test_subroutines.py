"""User subroutines of forces and variables, against the same laws as expressions."""

from __future__ import annotations

import numpy as np

import mbsim

SCRIPT = """
calls = []

def SFOSUB(id, time, par, npar, dflag, iflag):
    calls.append(iflag)
    i, j, stiffness, damping = par
    distance, wrong = py_sysfnc("DM", [i, j])
    rate, wrong_too = py_sysfnc("VR", [int(i), int(j)])
    py_errmes(wrong or wrong_too, "DM and VR are known", id, "STOP")
    return -stiffness * (distance - 1.0) - damping * rate

def VARSUB(id, time, par, npar, dflag, iflag):
    height, wrong = py_sysfnc("DZ", [par[0]])
    return 2.0 * height + time

def GFOSUB(id, time, par, npar, dflag, iflag):
    i, j = par
    place, no_place = py_sysary("TDISP", [i, j, j])
    motion, no_motion = py_sysary("VEL", [i, j, j, j])
    height, no_height = py_sysfnc("VARVAL", [7])
    angle, no_angle = py_sysfnc("AZ", [i, j])
    py_errmes(no_place or no_motion or no_height or no_angle, "asked", id, "STOP")
    force = [-3.0 * x - 0.2 * v for x, v in zip(place, motion[:3])]
    return force + [-0.1 * w for w in motion[3:5]] + [-0.5 * angle + 0.01 * height]

def VFOSUB(id, time, par, npar, dflag, iflag):
    velocity, _ = py_sysary("TVEL", [par[0]])
    return [-0.3 * v for v in velocity]

def VTOSUB(id, time, par, npar, dflag, iflag):
    angles, _ = py_sysary("RDISP", [par[0]])
    return (angles[0], 0.0, time)
"""

BODIES = """<MotionSolve><Model>
  <Body_Rigid id="1" isground="TRUE"/>
  <Body_Rigid id="2" cg_id="20" mass="1.5" inertia_xx="1" inertia_yy="0.7" inertia_zz="0.4"
    v_ic_x="0.3" w_ic_z="9"/>
  <Body_Rigid id="3" cg_id="30" mass="0.8" inertia_xx="0.2" inertia_yy="0.3" inertia_zz="0.4"/>
  <Reference_Marker id="10" body_id="1"/>
  <Reference_Marker id="20" body_id="2" pos_z="-1.2"/>
  <Reference_Marker id="21" body_id="2" pos_z="-1.2" pos_x="0.1"/>
  <Reference_Marker id="30" body_id="3" pos_x="0.5" pos_y="0.2"/>
  <Reference_Marker id="31" body_id="3" pos_x="0.4"/>
  <Force_Gravity grav_z="-9.81"/>
"""
END = """</Model><Simulate analysis_type="Transient" end_time="1.5" print_interval="0.1"/>
</MotionSolve>"""
BY = 'usrsub_param_string="USER({par})" usrsub_fnc_name="{name}" script_name="sub.py"'


def by(name, *par):
    return BY.format(name=name, par=",".join(map(str, par)))


USERS = f"""
  <Force_Scalar_TwoBody id="1" type="Force" i_marker_id="20" j_marker_id="10"
    {by("SFOSUB", 20, 10, 100, 2)} interpreter="PYTHON"/>
  <Reference_Variable id="7" type="USERSUB" {by("VARSUB", 20)}/>
  <Force_Scalar_TwoBody id="2" type="TORQUE" i_marker_id="21" j_marker_id="10"
    expr="0.1*VARVAL(7)"/>
  <Force_Vector_TwoBody id="3" type="ForceAndTorque" i_marker_id="21" j_floating_marker_id="31"
    ref_marker_id="31" {by("GFOSUB", 21, 31)}/>
  <Force_Vector_OneBody id="4" type="ForceOnly" i_marker_id="31" {by("VFOSUB", 31)}/>
  <Force_Vector_OneBody id="5" type="TorqueOnly" i_marker_id="30" {by("VTOSUB", 30)}/>
  <Post_Request id="1" type="EXPRESSION" expr2="VARVAL(7)" expr3="2*DZ(20)+TIME"/>
"""
EXPRESSIONS = """
  <Force_Scalar_TwoBody id="1" type="Force" i_marker_id="20" j_marker_id="10"
    expr="-100*(DM(20,10)-1)-2*VR(20,10)"/>
  <Reference_Variable id="7" expr="2*DZ(20)+TIME"/>
  <Force_Scalar_TwoBody id="2" type="TORQUE" i_marker_id="21" j_marker_id="10"
    expr="0.1*VARVAL(7)"/>
  <Force_Vector_TwoBody id="3" type="ForceAndTorque" i_marker_id="21" j_floating_marker_id="31"
    ref_marker_id="31"
    fx_expression="-3*DX(21,31,31)-0.2*VX(21,31,31,31)"
    fy_expression="-3*DY(21,31,31)-0.2*VY(21,31,31,31)"
    fz_expression="-3*DZ(21,31,31)-0.2*VZ(21,31,31,31)"
    tx_expression="-0.1*WX(21,31,31)" ty_expression="-0.1*WY(21,31,31)"
    tz_expression="-0.5*AZ(21,31)+0.01*VARVAL(7)"/>
  <Force_Vector_OneBody id="4" type="ForceOnly" i_marker_id="31"
    fx_expression="-0.3*VX(31)" fy_expression="-0.3*VY(31)" fz_expression="-0.3*VZ(31)"/>
  <Force_Vector_OneBody id="5" type="TorqueOnly" i_marker_id="30"
    tx_expression="PSI(30)" tz_expression="TIME"/>
  <Post_Request id="1" type="EXPRESSION" expr2="VARVAL(7)" expr3="2*DZ(20)+TIME"/>
"""


def run(folder, elements, script=SCRIPT, **options):
    (folder / "sub.py").write_text(script)
    deck = folder / "deck.xml"
    deck.write_text(BODIES + elements + END)
    return mbsim.simulate(mbsim.read_model(deck), **options)


def table(results, group):
    found = results.tables(group) if callable(results.tables) else results.tables[group]
    return found


def test_subroutines_do_what_the_same_expressions_do(tmp_path):
    user, twin = run(tmp_path, USERS), run(tmp_path, EXPRESSIONS)
    assert user.stats["steps"] == twin.stats["steps"]
    assert user.stats["python_calls"] > user.stats["rhs_evaluations"]
    assert twin.stats["python_calls"] == 0
    compared = 0
    for signal in twin.signals():
        np.testing.assert_allclose(
            user.find(signal), twin.find(signal), rtol=1e-11, atol=1e-12, err_msg=str(signal)
        )
        compared += 1
    assert compared > 20
