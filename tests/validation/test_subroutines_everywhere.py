"""Subroutines of states, sensors, motions and requests, against the same laws as expressions."""

from __future__ import annotations

import numpy as np
import pytest

import mbsim
from helpers.decks import GRAVITY, GROUND
from mbsim.errors import DeckError, ModelError, PluginError

SCRIPT = """
import numpy as np

def MOTSUB(id, time, par, npar, iord, iflag):
    if iflag:
        return -1.0  # what this call gives does not count
    a, b = par
    return (a * time**b, a * b * time ** (b - 1), a * b * (b - 1) * time ** (b - 2))[iord]

def DIFSUB(id, time, par, npar, dflag, iflag):
    height, wrong = py_sysfnc("DZ", [par[0]])
    state, wrong_too = py_sysfnc("DIF", [id])
    other, _ = py_sysfnc("DIF1", [8])
    py_errmes(wrong or wrong_too, "DZ and DIF are known", id, "STOP")
    py_errmes(py_sysfnc("FZ", [par[0]])[1] == 0, "forces are not known yet", id, "STOP")
    return 3.0 * (height - state) + 0.1 * other

def SENSUB(id, time, par, npar, iflag):
    return py_sysfnc("AZ", par)[0]

def SEVSUB(id, time, par, npar, iflag):
    return id * py_sysfnc("WZ", par)[0]

def REQSUB(id, time, par, npar, iflag):
    i, j = par
    asked = [
        py_sysfnc("AZ", [21, 10]), py_sysfnc("JOINT", [1, 0, 2, 0]), py_sysfnc("MOTION", [1, 0, 8]),
        py_sysfnc("SENVAL", [6]), py_sysfnc("DIF", [7]), py_sysfnc("VARVAL", [9]),
    ]
    force, wrong = py_sysary("TFORCE", [i, j, j])
    swing, wrong_too = py_sysary("RACC", [21])
    unknown = [py_sysfnc("JOINT", [4, 0, 2])[1], py_sysfnc("JOINT", [1, 0, 9])[1]]
    if not iflag:
        py_errmes(wrong or wrong_too or not all(unknown), "forces", id, "STOP")
        py_errmes(sum(flag for _, flag in asked), "measures", id, "STOP")
    return np.array([value for value, _ in asked] + [force[2], swing[2]])
"""
BODIES = f"""{GROUND}{GRAVITY}
  <Body_Rigid id="2" cg_id="20" mass="2" inertia_xx="0.1" inertia_yy="0.1" inertia_zz="0.1"/>
  <Body_Rigid id="3" cg_id="30" mass="1" inertia_xx="0.1" inertia_yy="0.1" inertia_zz="0.1"/>
  <Reference_Marker id="20" body_id="2" pos_x="0.5"/>
  <Reference_Marker id="21" body_id="2"/>
  <Reference_Marker id="11" body_id="1" pos_z="1"/>
  <Reference_Marker id="30" body_id="3" pos_z="1"/>
  <Constraint_Joint id="1" type="REVOLUTE" i_marker_id="21" j_marker_id="10"/>
  <Constraint_Joint id="2" type="TRANSLATIONAL" i_marker_id="30" j_marker_id="11"/>
  <Control_Diff id="8" expr="-DIF(8)" ic="1"/>
  <Reference_Variable id="9" expr="SFORCE(1, 0, 4)+1"/>
  <Force_Scalar_TwoBody id="1" type="Force" i_marker_id="30" j_marker_id="11"
    expr="-40*DZ(30,11)-20*DIF(7)" action_only="TRUE"/>
"""


def by(name, par):
    return (
        f'type="USERSUB" usrsub_param_string="USER({par})" usrsub_dll_name="NULL" '
        f'usrsub_fnc_name="{name}" script_name="sub.py" interpreter="PYTHON"'
    )


MOTION = 'id="1" joint_id="1" motion_type="R"'
SENSOR = 'id="5" evaluate_id="6" compare="GE" value="2" zero_crossing="TRUE" print="TRUE"'
USERS = f"""
  <Motion_Joint {MOTION} val_type="D" joint_type="R" {by("MOTSUB", "5,2")}/>
  <Control_Diff id="7" ic="0.1" is_implicit="FALSE" {by("DIFSUB", "30")}/>
  <Sensor_Event {SENSOR} {by("SENSUB", "21,10")}/>
  <Sensor_Evaluate id="6" {by("SEVSUB", "21,10")}/>
  <Post_Request id="1" comment="all" {by("REQSUB", "30,11")}/>
"""
EXPRESSIONS = f"""
  <Motion_Joint {MOTION} val_type="D" expr="5*TIME**2"/>
  <Control_Diff id="7" ic="0.1" expr="3*(DZ(30)-DIF(7))-0.1*DIF(8)"/>
  <Sensor_Event {SENSOR} expr="AZ(21,10)"/>
  <Sensor_Evaluate id="6" expr="6*WZ(21,10)"/>
  <Post_Request id="1" type="EXPRESSION" expr1="AZ(21,10)" expr2="JOINT(1,0,2,0)"
    expr3="MOTION(1,0,8)" expr4="SENVAL(6)" expr5="DIF(7)" expr6="VARVAL(9)"
    expr7="FZ(30,11,11)" expr8="WDTZ(21)"/>
"""
H_MAX = '<Param_Transient h_max="0.01"/>'
RUN = '<Simulate analysis_type="Transient" end_time="1" print_interval="0.25"/>'


def run(folder, elements, script=SCRIPT, command=RUN, **options):
    (folder / "sub.py").write_text(script)
    deck = folder / "deck.xml"
    deck.write_text(f"<M><Model>{BODIES}{elements}{H_MAX}</Model><Command>{command}</Command></M>")
    return mbsim.simulate(mbsim.read_model(deck), **options)


@pytest.mark.parametrize("integrator", ["DOPRI5", "RADAU5"])
def test_they_do_what_the_same_expressions_do(tmp_path, integrator):
    user, twin = (
        run(tmp_path, elements, integrator=integrator, tol=1e-8)
        for elements in (USERS, EXPRESSIONS)
    )
    assert user["time"] == pytest.approx(twin["time"], abs=1e-11)
    assert len(user["time"]) == 6  # a row of the sensor
    assert user["requests/1"] == pytest.approx(twin["requests/1"], rel=1e-7, abs=1e-7)
    assert user["bodies/3/position"] == pytest.approx(twin["bodies/3/position"], abs=1e-8)
    if integrator == "DOPRI5":
        assert user.stats["steps"] == twin.stats["steps"]
    assert user.stats["python_calls"] > 2 * user.stats["steps"]


@pytest.mark.parametrize(("val_type", "orders"), [("V", (1, 2)), ("A", (2,))])
def test_a_motion_by_its_rates_is_asked_for_these_alone(tmp_path, val_type, orders):
    script = SCRIPT.replace("a, b = par", f"a, b = par\n    assert iord in {orders}")
    motion = f'<Motion_Joint {MOTION} val_type="{val_type}" {by("MOTSUB", "5,2")}/>'
    request = '<Post_Request id="1" type="EXPRESSION" expr1="AZ(21,10)" expr2="WZ(21,10)"/>'
    state = '<Control_Diff id="7" expr="0"/>'
    turned = run(tmp_path, motion + state + request, script, tol=1e-9)["requests/1"][-1]
    assert turned[:2] == pytest.approx([5.0, 10.0], abs=1e-7)


def test_an_equilibrium_holds_what_a_motion_gives_at_its_time(tmp_path):
    static = '<Simulate analysis_type="Static" end_time="0.5" num_steps="1"/>'
    script = SCRIPT.replace("par\n    return (", "par\n    time += 0.2\n    return (")
    rest = run(tmp_path, USERS, script, static)["requests/1"]
    assert rest[:, 0] == pytest.approx([5 * 0.2**2, 5 * 0.7**2], abs=1e-9)
    assert rest[:, 5] - 1 == pytest.approx(np.full(2, 9.81), abs=1e-9)  # holds the weight


ADM = """the same as EXPRESSIONS
UNITS/FORCE=NEWTON, MASS=KILOGRAM, LENGTH=METER, TIME=SECOND
PART/1, GROUND
PART/2, MASS=2, CM=20, IP=0.1, 0.1, 0.1
PART/3, MASS=1, CM=30, IP=0.1, 0.1, 0.1
MARKER/10, PART=1
MARKER/11, PART=1, QP=0,0,1
MARKER/20, PART=2, QP=0.5,0,0
MARKER/21, PART=2
MARKER/30, PART=3, QP=0,0,1
JOINT/1, REVOLUTE, I=21, J=10
JOINT/2, TRANSLATIONAL, I=30, J=11
ACCGRAV/KGRAV=-9.81
DIFF/8, FUNCTION=-DIF(8), IC=1
VARIABLE/9, FUNCTION=SFORCE(1, 0, 4)+1
SFORCE/1, TRANSLATIONAL, ACTIONONLY, I=30, J=11, FUNCTION=-40*DZ(30,11)-20*DIF(7)
INTEGRATOR/HMAX=0.01
MOTION/1, JOINT=1, FUNCTION=USER(5,2)\\ROUTINE=sub.py::MOTSUB
DIFF/7, IC=0.1, FUNCTION=USER(30)\\ROUTINE=sub.py::DIFSUB
SENSOR/6, GE, VALUE=2, ERROR=0, BISECTION, PRINT, EVALUATE=6*WZ(21,10)
, FUNCTION=USER(21,10)\\ROUTINE=sub.py::SENSUB
REQUEST/1, FUNCTION=USER(30,11)\\ROUTINE=sub.py::REQSUB
END
"""


def test_an_adams_deck_has_them_too(tmp_path):
    (tmp_path / "sub.py").write_text(SCRIPT)
    (tmp_path / "deck.adm").write_text(ADM)
    settings = {"end_time": 1.0, "print_interval": 0.25, "integrator": "DOPRI5", "tol": 1e-8}
    adams = mbsim.simulate(mbsim.read_model(tmp_path / "deck.adm"), **settings)
    twin = run(tmp_path, EXPRESSIONS, integrator="DOPRI5", tol=1e-8)
    assert adams["requests/1"] == pytest.approx(twin["requests/1"], rel=1e-7, abs=1e-7)


FAULTS = {
    "MOTSUB": ("    a, b = par", r"Motion_Joint\[1\]"),
    "DIFSUB": ('    height, wrong = py_sysfnc("DZ", [par[0]])', r"Control_Diff\[7\]"),
    "SENSUB": ('    return py_sysfnc("AZ", par)[0]', r"Sensor_Event\[5\]"),
    "SEVSUB": ('    return id * py_sysfnc("WZ", par)[0]', r"Sensor_Evaluate\[6\]"),
    "REQSUB": ("    i, j = par", r"Post_Request\[1\]"),
}


@pytest.mark.parametrize("when", [0.0, 0.6])
@pytest.mark.parametrize("name", FAULTS)
def test_what_they_raise_ends_the_run_with_element_time_and_line(tmp_path, name, when):
    line, element = FAULTS[name]
    script = SCRIPT.replace(line, f"    1 / (time < {when})\n{line}")
    number = script[: script.index("1 / (time")].count("\n") + 1
    # a sensor evaluates when it acts
    time = "0" if when == 0.0 and name != "SEVSUB" else r"0\.[67]\d*"
    said = rf"{element}: {name} failed at time {time}: ZeroDivisionError(.*\n)*.*sub.py:{number}"
    with pytest.raises(PluginError, match=said):
        run(tmp_path, USERS, script)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("+ [force[2], swing[2]]", "", r"Post_Request\[1\]: .*returned 6 values"),
        ("[iord]", "[0]", r"Motion_Joint\[1\]: .*iord 1 at time 0.1, .*iord 0 changes by 1 a unit"),
        ("[iord]", "[min(iord, 1)]", r"Motion_Joint\[1\]: .*iord 2 at time .*iord 1 changes by 10"),
        ("dflag, iflag", "iflag", r"Control_Diff\[7\].*DIFSUB.*cannot be called with the 6"),
    ],
)
def test_results_of_the_wrong_kind_are_said(tmp_path, old, new, said):
    changed = SCRIPT.replace(old, new)
    assert changed != SCRIPT
    with pytest.raises((ModelError, PluginError), match=said):
        run(tmp_path, USERS, changed)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('val_type="D" joint', 'val_type="D" expr="1" joint', r"Motion_Joint\[1\].*expr=.*a user"),
        ('usrsub_param_string="USER(30)"', "", r"Control_Diff\[7\].*usrsub_param_string: missing"),
        ('usrsub_param_string="USER(30,11)"', "", r"Post_Request\[1\].*usrsub_param_string: miss"),
        ('comment="all"', 'expr1="1"', r"Post_Request\[1\].*another type of request than USERSUB"),
        ('evaluate_id="6"', 'evaluate_id="7"', r'Sensor_Event\[5\]: evaluate_id="7": no Sensor_Ev'),
        ('evaluate_id="6"', 'evaluate="1"', r"Sensor_Event\[5\]: evaluate: .* give evaluate_id"),
        ('evaluate_id="6"', 'evaluate_id="6" evaluate="1"', r"Sensor_Event\[5\]: .*one of both"),
        (
            "<Sensor_Evaluate",
            '<Sensor_Event id="8" expr="1" evaluate_id="6"/><Sensor_Evaluate',
            r"Sensor_Event\[8\]: .*Sensor_Event 5 sets it already",
        ),
        (
            'dll_name="NULL" usrsub_fnc_name="SENSUB"',
            'dll_name="s.so"',
            r"Sensor_Event.*no such file",
        ),
    ],
)
def test_a_deck_gives_them_in_one_way(tmp_path, old, new, said):
    changed = USERS.replace(old, new)
    assert changed != USERS
    with pytest.raises(DeckError, match=said):
        run(tmp_path, changed)
