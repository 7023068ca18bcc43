"""User subroutines of forces and variables, against the same laws as expressions."""

from __future__ import annotations

import numpy as np
import pytest
from click.testing import CliRunner

import mbsim
from mbsim.cli.main import main
from mbsim.errors import DeckError, ModelError, PluginError

SCRIPT = """

def SFOSUB(id, time, par, npar, dflag, iflag):
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
    return (angles[1], 0.0, time)
"""

BODIES = """<MotionSolve><Model>
  <Body_Rigid id="1" isground="TRUE"/>
  <Body_Rigid id="2" cg_id="20" mass="1.5" inertia_xx="1" inertia_yy="0.7" inertia_zz="0.4"
    v_ic_x="0.3" v_ic_x_flag="TRUE" w_ic_z="9" w_ic_z_flag="TRUE"/>
  <Body_Rigid id="3" cg_id="30" mass="0.8" inertia_xx="0.2" inertia_yy="0.3" inertia_zz="0.4"/>
  <Reference_Marker id="10" body_id="1"/>
  <Reference_Marker id="20" body_id="2" pos_z="-1.2"/>
  <Reference_Marker id="21" body_id="2" pos_z="-1.2" pos_x="0.1"/>
  <Reference_Marker id="30" body_id="3" pos_x="0.5" pos_y="0.2"/>
  <Reference_Marker id="31" body_id="3" pos_x="0.4"/>
  <Force_Gravity grav_z="-9.81"/>
"""
END = """</Model><Command><Simulate analysis_type="Transient" end_time="1.5" print_interval="0.1"/>
</Command></MotionSolve>"""
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
    tx_expression="THETA(30)" tz_expression="TIME"/>
  <Post_Request id="1" type="EXPRESSION" expr2="VARVAL(7)" expr3="2*DZ(20)+TIME"/>
"""


def run(folder, elements, script=SCRIPT, h_max="", **options):
    (folder / "sub.py").write_text(script)
    deck = folder / "deck.xml"
    deck.write_text(BODIES + elements + h_max + END)
    return mbsim.simulate(mbsim.read_model(deck), **options)


def test_subroutines_do_what_the_same_expressions_do(tmp_path):
    # what a subroutine may do with the time bounds steps: expressions get the same bound
    h_max = '<Param_Transient h_max="0.01"/>'
    # and a method that does not linearise them, by differences or exactly
    user, twin = (
        run(tmp_path, elements, h_max=h_max, integrator="DOPRI5")
        for elements in (USERS, EXPRESSIONS)
    )
    assert user.stats["steps"] == twin.stats["steps"]
    assert user.stats["python_calls"] > user.stats["rhs_evaluations"]
    assert twin.stats["python_calls"] == 0
    names = [
        name for name in twin.keys() if np.issubdtype(np.asarray(twin[name]).dtype, np.float64)
    ]
    assert len(names) > 20
    for name in names:
        if "stats" not in name:
            np.testing.assert_allclose(user[name], twin[name], rtol=1e-11, atol=1e-11, err_msg=name)


ADM = """the same as EXPRESSIONS; forces on one body have ground on the other side
UNITS/FORCE=NEWTON, MASS=KILOGRAM, LENGTH=METER, TIME=SECOND
PART/1, GROUND
PART/2, MASS=1.5, CM=20, IP=1, 0.7, 0.4, VX=0.3, WZ=9
PART/3, MASS=0.8, CM=30, IP=0.2, 0.3, 0.4
MARKER/10, PART=1
MARKER/11, PART=1, FLOATING
MARKER/20, PART=2, QP=0, 0, -1.2
MARKER/21, PART=2, QP=0.1, 0, -1.2
MARKER/30, PART=3, QP=0.5, 0.2, 0
MARKER/31, PART=3, QP=0.4, 0, 0
MARKER/32, PART=3, FLOATING
ACCGRAV/KGRAV=-9.81
SFORCE/2, ROTATIONAL, I=21, J=10, FUNCTION=0.1*VARVAL(7)
REQUEST/1, F2=VARVAL(7)\\F3=2*DZ(20)+TIME
INTEGRATOR/HMAX=0.01
{elements}
END
"""
ADM_USERS = """SFORCE/1, TRANSLATIONAL, I=20, J=10, FUNCTION=USER(20, 10,
, 100, 2)\\ROUTINE=sub.py::SFOSUB
VARIABLE/7, FUNCTION=USER(20)\\ROUTINE=sub.py::VARSUB
GFORCE/3, I=21, JFLOAT=32, RM=31, FUNCTION=USER(21, 31)\\ROUTINE=sub.py::GFOSUB
VFORCE/4, I=31, JFLOAT=11, RM=10, FUNCTION=USER(31)\\ROUTINE=sub.py::VFOSUB
VTORQUE/5, I=30, JFLOAT=11, RM=10, FUNCTION=USER(30)\\ROUTINE=sub.py::VTOSUB"""
ADM_EXPRESSIONS = """SFORCE/1, TRANSLATIONAL, I=20, J=10, FUNCTION=-100*(DM(20,10)-1)-2*VR(20,10)
VARIABLE/7, FUNCTION=2*DZ(20)+TIME
GFORCE/3, I=21, JFLOAT=32, RM=31
, FX=-3*DX(21,31,31)-0.2*VX(21,31,31,31)
, FY=-3*DY(21,31,31)-0.2*VY(21,31,31,31)
, FZ=-3*DZ(21,31,31)-0.2*VZ(21,31,31,31)
, TX=-0.1*WX(21,31,31), TY=-0.1*WY(21,31,31)
, TZ=-0.5*AZ(21,31)+0.01*VARVAL(7)
VFORCE/4, I=31, JFLOAT=11, RM=10, FX=-0.3*VX(31), FY=-0.3*VY(31), FZ=-0.3*VZ(31)
VTORQUE/5, I=30, JFLOAT=11, RM=10, TX=THETA(30), TZ=TIME"""


def run_adm(folder, elements, script=SCRIPT, **options):
    (folder / "sub.py").write_text(script)
    deck = folder / "deck.adm"
    deck.write_text(ADM.format(elements=elements))
    options = {"end_time": 1.5, "print_interval": 0.1} | options
    return mbsim.simulate(mbsim.read_model(deck), **options)


def test_subroutines_of_an_adams_deck_do_what_the_same_expressions_do(tmp_path):
    user, twin = (
        run_adm(tmp_path, elements, integrator="DOPRI5")
        for elements in (ADM_USERS, ADM_EXPRESSIONS)
    )
    assert user.stats["steps"] == twin.stats["steps"]
    assert user.stats["python_calls"] > 4 * user.stats["rhs_evaluations"]
    for name in ("bodies/2/position", "bodies/3/quaternion", "vector_forces/3/torque"):
        np.testing.assert_allclose(user[name], twin[name], rtol=1e-11, atol=1e-11, err_msg=name)
    adm = run_adm(tmp_path, ADM_USERS, tol=1e-8, integrator="DOPRI5")
    h_max = '<Param_Transient h_max="0.01"/>'
    xml = run(tmp_path, EXPRESSIONS, h_max=h_max, tol=1e-8, integrator="DOPRI5")
    assert adm.stats["steps"] == xml.stats["steps"]
    np.testing.assert_allclose(adm["bodies/3/position"], xml["bodies/3/position"], rtol=1e-9)


def test_messages_about_subroutines_of_an_adams_deck_have_its_words(tmp_path):
    script = "def SFOSUB(id, time, par, npar, dflag, iflag):\n    return par[7]\n"
    elements = "VARIABLE/7, FUNCTION=0\nSFORCE/1, TRANSLATIONAL, I=20, J=10, FUNCTION=USER()"
    with pytest.raises(ModelError, match=r'SFORCE/1: ROUTINE="SFOSUB" names no file.*--plugin'):
        run_adm(tmp_path, elements, script)
    plugins = [tmp_path / "sub.py"]
    with pytest.raises(PluginError, match=r"SFORCE/1: SFOSUB failed at time 0: IndexError"):
        run_adm(tmp_path, elements, script, plugins=plugins)
    named = elements + "\\ROUTINE=sub.py::MISSING"
    with pytest.raises(ModelError, match=r'SFORCE/1: .* does not define ROUTINE="MISSING"'):
        run_adm(tmp_path, named, script)


def scalar(body, name="SFOSUB", par="20"):
    """Return a script of one subroutine, and an element that calls it."""
    script = f"def {name}(id, time, par, npar, dflag, iflag):\n" + body
    return script, (
        f'<Force_Scalar_TwoBody id="1" type="Force" i_marker_id="20" j_marker_id="10" '
        f"{by(name, par)}/>"
    )


def test_iflag_is_set_once_and_first(tmp_path):
    script, element = scalar("    seen.append((id, npar, par, dflag, iflag))\n    return 0.0\n")
    seen_at = tmp_path / "seen.txt"
    script = f"""
from pathlib import Path
seen_at, seen = Path({str(seen_at)!r}), []
{script}"""
    script = script.replace(
        "    return", "    seen_at.write_text(chr(10).join(map(repr, seen)))\n    return"
    )
    results = run(tmp_path, element, script, end_time=0.01, print_interval=0.01)
    lines = seen_at.read_text().splitlines()
    assert lines[0] == "(1, 1, [20.0], 0, 1)"
    assert set(lines[1:]) == {"(1, 1, [20.0], 0, 0)"}
    assert len(lines) == 1 + results.stats["python_calls"]


def test_what_a_subroutine_raises_ends_the_run_with_its_line(tmp_path):
    script, element = scalar("    return 1.0 / (time < 0.5 or 0)\n")
    with pytest.raises(PluginError) as caught:
        run(tmp_path, element, script, output=tmp_path / "out")
    text = str(caught.value)
    assert text.startswith("Force_Scalar_TwoBody[1]: SFOSUB failed at time 0.5")
    assert "ZeroDivisionError" in text
    assert f"{tmp_path / 'sub.py'}:2" in text
    with mbsim.open_results(next((tmp_path / "out").glob("*.h5"))) as kept:
        assert kept.status == "failed"
        assert len(kept["time"]) >= 5


def test_a_failure_that_an_expression_would_hide_ends_the_run(tmp_path):
    script, _ = scalar("    raise ValueError('no such height')\n", "VARSUB")
    elements = f"""<Reference_Variable id="7" type="USERSUB" {by("VARSUB")}/>
      <Force_Scalar_TwoBody id="1" type="Force" i_marker_id="20" j_marker_id="10"
       expr="IF(0*VARVAL(7): 1, 1, 1)"/>"""
    with pytest.raises(PluginError, match=r"Reference_Variable\[7\]: VARSUB.*no such height"):
        run(tmp_path, elements, script)


def test_a_failure_in_a_request_alone_ends_the_run(tmp_path):
    script, _ = scalar("    return 0.0 if time < 1 else None\n", "VARSUB")
    elements = f"""<Reference_Variable id="7" type="USERSUB" {by("VARSUB")}/>
      <Post_Request id="1" type="EXPRESSION" expr2="VARVAL(7)"/>"""
    with pytest.raises(PluginError, match=r"VARSUB failed at time 1.*no return statement"):
        run(tmp_path, elements, script)


@pytest.mark.parametrize(
    ("result", "said"),
    [
        ("None", "returned None .no return statement.., not one finite number"),
        ("float('nan')", "returned nan, not one finite number"),
        ("'3'", "returned '3', not one finite number"),
        ("[1.0, 2.0]", "not one finite number"),
    ],
)
def test_what_is_no_number_is_refused(tmp_path, result, said):
    script, element = scalar(f"    return {result}\n")
    with pytest.raises(PluginError, match=said):
        run(tmp_path, element, script)


def test_six_numbers_are_wanted(tmp_path):
    script, _ = scalar("    return [1, 2, 3]\n", "GFOSUB")
    element = (
        f'<Force_Vector_OneBody id="4" type="ForceAndTorque" i_marker_id="20" {by("GFOSUB")}/>'
    )
    with pytest.raises(PluginError, match=r"OneBody\[4\].*returned 3 values.*not 6 finite"):
        run(tmp_path, element, script)


@pytest.mark.parametrize(
    "asked",
    [
        '"DX", [99]', '"DX", [20.5]', '"DX", []', '"NONE", [20]', '"FX", [20]', '"ACCX", [20]',
        '"SFORCE", [1, 0, 1, 0]', '"VARVAL", [3]', '"SIN", [1]',
    ],
)  # fmt: skip
def test_what_is_not_known_sets_errflg(tmp_path, asked):
    body = f"    value, wrong = py_sysfnc({asked})\n    return 0.0 if wrong == 1 else None\n"
    script, element = scalar(body)
    results = run(tmp_path, element, script, end_time=0.01, print_interval=0.01)
    assert results.status == "finished"


def test_variables_that_ask_for_each_other_end_the_run(tmp_path):
    script, _ = scalar("    return py_sysfnc('VARVAL', [7])[0]\n", "VARSUB")
    elements = f"""<Reference_Variable id="7" type="USERSUB" {by("VARSUB")}/>
      <Post_Request id="1" type="EXPRESSION" expr2="VARVAL(7)"/>"""
    with pytest.raises(PluginError, match=r"VARSUB failed.*need each other by py_sysfnc"):
        run(tmp_path, elements, script)


def test_a_script_may_come_with_plugin(tmp_path):
    script, element = scalar("    return 1.0\n")
    element = element.replace('script_name="sub.py"', 'usrsub_dll_name="NULL"')
    with pytest.raises(ModelError, match=r'usrsub_fnc_name="SFOSUB" names no file.*--plugin'):
        run(tmp_path, element, script)
    results = run(
        tmp_path, element, script, plugins=[tmp_path / "sub.py"], end_time=0.01, print_interval=0.01
    )
    assert results.status == "finished"


@pytest.mark.parametrize(
    ("attributes", "said"),
    [
        ('expr="1" usrsub_param_string="USER()"', 'expr="1": this element is given by a user'),
        ("", "expr: missing; must be an expression, or usrsub_param_string"),
        ('usrsub_fnc_name="F" script_name="sub.py"', "usrsub_param_string: missing"),
        ('usrsub_param_string="USER(1)" script_name="no.py"', "no such file"),
        (
            'usrsub_param_string="USER(1)" usrsub_dll_name="a.dll"',
            "no such file",
        ),
    ],
)
def test_faults_of_the_deck(tmp_path, attributes, said):
    force = '<Force_Scalar_TwoBody id="1" type="Force" i_marker_id="20" j_marker_id="10"'
    with pytest.raises(DeckError, match=r"deck.xml:\d+: Force_Scalar_TwoBody\[1\]: ") as caught:
        run(tmp_path, f"{force} {attributes}/>")
    assert said in str(caught.value)


def test_a_constraint_takes_no_subroutine(tmp_path):
    script, _ = scalar("    return 0.0\n", "VARSUB")
    elements = f"""<Reference_Variable id="7" type="USERSUB" {by("VARSUB")}/>
      <Constraint_General id="1" expr="DX(20)-VARVAL(7)"/>"""
    with pytest.raises(DeckError, match="what a user subroutine returns cannot be used here"):
        run(tmp_path, elements, script)


def test_too_many_arguments_and_missing_functions(tmp_path):
    _, element = scalar("    return 0.0\n")
    with pytest.raises(ModelError, match="cannot be called with the 6 arguments"):
        run(tmp_path, element, "def SFOSUB(id, time):\n    return 0.0\n")
    with pytest.raises(ModelError, match='does not define usrsub_fnc_name="SFOSUB"'):
        run(tmp_path, element, "def OTHER(id, time):\n    return 0.0\n")


def test_exit_code_and_message(tmp_path):
    script, element = scalar("    return par[7]\n")
    (tmp_path / "sub.py").write_text(script)
    (tmp_path / "deck.xml").write_text(BODIES + element + END)
    outcome = CliRunner().invoke(main, ["run", str(tmp_path / "deck.xml"), "-o", str(tmp_path)])
    assert outcome.exit_code == 4
    assert "IndexError" in outcome.output


def test_a_resumed_run_goes_on_as_if_it_had_not_stopped(tmp_path):
    flag = tmp_path / "flag"
    check = f"    if time > 1.0 and not Path({str(flag)!r}).exists():\n        raise ValueError\n"
    script = "from pathlib import Path\n" + SCRIPT.replace(
        "    i, j = par\n", f"    i, j = par\n{check}"
    )
    with pytest.raises(PluginError, match="ValueError"):
        run(tmp_path, USERS, script, output=tmp_path / "out")
    flag.touch()
    resumed = run(tmp_path, USERS, script, output=tmp_path / "out", resume=True)
    whole = run(tmp_path, USERS, script)
    assert resumed.status == "finished"
    # shorter steps led up to the failure; a turn lost by AZ would tell by far more
    for name in ("time", "energy/kinetic"):
        np.testing.assert_allclose(resumed[name], whole[name], rtol=1e-6)


SLIDER = """<Post_Graphic id="100" type="Plane" rm_id="10"/>
  <Post_Graphic id="200" type="Sphere" center_marker_id="40" radius="0.5"/>
  <Body_Rigid id="4" cg_id="40" mass="1" inertia_xx="0.1" inertia_yy="0.1" inertia_zz="0.1"
    v_ic_x="2" v_ic_x_flag="TRUE"/>
  <Reference_Marker id="40" body_id="4" pos_z="0.5" pos_x="0.3"/>
  <Reference_Variable id="8" expr="3*DX(40)+TIME"/>
  <Force_Contact id="301" num_i_graphics="1" i_graphics_id="200" num_j_graphics="1"
   j_graphics_id="100" cnf_type="IMPACT" stiffness="1e5" exponent="1.5" damping="200"
   dmax="1e-3" cff_type="USERCFF" cff_fnc_name="CFFSUB" script_name="sub.py"
   cff_param_string="USER(40)"/>"""
CFFSUB = "def CFFSUB(id, time, par, npar, loci, locj, x, xdot, nforce, dflag, iflag):\n"


def test_a_friction_subroutine_looks_at_the_state_of_its_call(tmp_path):
    # a sphere on a plane: the point on the plane is below the centre, half the depth under
    # the point at which the slip is taken
    script = (
        CFFSUB
        + """    p, no_p = py_sysary("TDISP", par)
    v, no_v = py_sysary("VEL", par)
    of_variable, no_variable = py_sysfnc("VARVAL", [8])
    py_errmes(no_p or no_v or no_variable, "asked", id, "STOP")
    slip = v[0] + v[4] * (0.5 * (p[2] - 0.5) - p[2])
    known = [(p[0], locj[0]), (abs(slip), hypot(xdot[0], xdot[1])), (of_variable, 3*p[0] + time)]
    for seen, given in known:
        if abs(seen - given) > 1e-12:
            raise ValueError((time, known))
    return [-0.1 * nforce * tanh(20.0 * xdot[0]), -0.1 * nforce * tanh(20.0 * xdot[1]), 0.0]
"""
    )
    results = run(tmp_path, SLIDER, script, end_time=0.5)
    assert results.stats["python_calls"] > 100
    position = results["bodies/4/position"]
    assert 0.5 < position[-1, 0] - position[0, 0] < 0.99  # friction has slowed it down


def test_what_a_variable_raises_for_a_friction_subroutine_ends_the_run(tmp_path):
    script = (
        CFFSUB
        + "    return [py_sysfnc('VARVAL', [7])[0], 0.0, 0.0]\n"
        + "def VARSUB(id, time, par, npar, dflag, iflag):\n"
        + "    return 0.0 if time < 0.2 else [][3]\n"
    )
    variable = f'<Reference_Variable id="7" type="USERSUB" {by("VARSUB")}/>'
    with pytest.raises(PluginError, match=r"Reference_Variable\[7\]: VARSUB failed at time 0.2.*"):
        run(tmp_path, SLIDER + variable, script)


def test_a_subroutine_is_told_once_that_forces_are_not_known(tmp_path):
    script = CFFSUB + (
        "    wrong = [py_sysfnc(name, [40])[1] for name in ('FX', 'ACCX', 'NONE')]\n"
        "    return [0.0, 0.0, 0.0] if wrong == [1, 1, 1] else None\n"
    )
    run(tmp_path, SLIDER, script, output=tmp_path / "out", end_time=0.1, print_interval=0.1)
    log = next((tmp_path / "out").glob("*.log")).read_text()
    assert log.count("py_sysfnc FX: forces follow from what subroutines give") == 1
    assert log.count("py_sysfnc ACCX: accelerations follow") == 1


def test_a_call_while_the_script_is_loaded_is_told_that_there_is_no_state(tmp_path):
    script, element = scalar("    return 0.0\n")
    script = 'asked = py_sysfnc("DX", [20])\nassert asked == [0.0, 1]\n' + script
    run(tmp_path, element, script, output=tmp_path / "out", end_time=0.1, print_interval=0.1)
    log = next((tmp_path / "out").glob("*.log")).read_text()
    assert log.count("py_sysfnc is called where there is no state to look at") == 1


def test_implicit_methods_see_every_result_of_a_subroutine(tmp_path):
    script = tmp_path / "stiff.py"
    script.write_text(
        "def VFOSUB(id, time, par, npar, dflag, iflag):\n"
        '    y, _ = py_sysfnc("DY", [20, 10])\n    v, _ = py_sysfnc("VY", [20, 10])\n'
        "    return [0.0, -1e6 * y - 1e4 * v, 0.0]\n",
        encoding="utf-8",
    )
    force = (
        f'usrsub_param_string="USER(1)" usrsub_fnc_name="VFOSUB" script_name="{script}"',
        'fy_expression="-1e6*DY(20,10)-1e4*VY(20,10)"',
    )
    steps = []
    for given in force:
        deck = tmp_path / "deck.xml"
        deck.write_text(
            """<Deck><Model><Body_Rigid id="1" isground="TRUE"/>
<Reference_Marker id="10" body_id="1"/>
<Body_Rigid id="2" cg_id="20" mass="1" inertia_xx="1" inertia_yy="1" inertia_zz="1"
  v_ic_y="1" v_ic_y_flag="TRUE"/><Reference_Marker id="20" body_id="2"/>
<Force_Vector_TwoBody id="1" type="ForceOnly" i_marker_id="20" j_floating_marker_id="10"
  ref_marker_id="10" """
            + given
            + """/><Param_Transient h_max="0.008"/></Model><Command>
<Simulate analysis_type="Transient" end_time="1" print_interval="0.1"/></Command></Deck>""",
            encoding="utf-8",
        )
        steps.append(mbsim.simulate(mbsim.read_model(deck), integrator="RADAU5").stats["steps"])
    # stability would ask for 3000
    assert steps[0] == pytest.approx(steps[1], abs=3)
    assert steps[1] < 200
