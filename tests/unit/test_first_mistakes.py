"""What a new user gets wrong, and what is said of it: wrong files, names, kinds and options."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from click.testing import CliRunner

import mbsim
from helpers.snippets import ROOT
from mbsim.cli.main import main
from mbsim.errors import MbsimError
from mbsim.plugins.compile.compiled import compile_friction
from mbsim.plugins.source.diagnose import diagnose

BOWLING = ROOT / "models/bowling_ball.xml"
BOUNCING = ROOT / "models/bouncing_sphere.xml"
FCLIB = ROOT / "tests/data/fclib/FC3D_Example1_SBM.hdf5"


def said(*arguments: object) -> str:
    """Return what `mbsim` prints where it ends with an error."""
    result = CliRunner().invoke(main, [str(argument) for argument in arguments])
    assert isinstance(result.exception, SystemExit), result.exception
    assert result.exit_code != 0
    return result.output


@pytest.fixture(scope="module")
def result_file(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("results")
    mbsim.simulate(BOUNCING, end_time=0.01, output=folder).close()
    return folder / "bouncing_sphere.h5"


@pytest.mark.parametrize("suffix", [".h5", ".xml", ".adm"])
def test_a_result_file_is_no_deck_whatever_its_name(suffix, result_file, tmp_path):
    deck = shutil.copy(result_file, tmp_path / f"ball{suffix}")
    for command in ("run", "check"):
        assert "an HDF5 file, not a deck; mbsim info shows" in said(command, deck)


def test_a_contact_problem_is_shown_by_its_own_command():
    for command in (["info", FCLIB], ["plot", FCLIB, "x"], ["view", FCLIB]):
        assert "mbsim fclib info shows such a contact problem" in said(*command)


@pytest.mark.parametrize(
    ("command", "option", "name", "ending"),
    [
        ("view", "-o", "ball.png", ".html"),
        ("report", "-o", "ball.pdf", ".html"),
        ("view", "--gltf", "ball.gltf", ".glb"),
        ("view", "--gif", "ball.mp4", ".gif"),
    ],
)
def test_a_file_is_named_after_its_kind(command, option, name, ending, result_file, tmp_path):
    assert f"must end in {ending}" in said(command, result_file, option, tmp_path / name)
    assert not (tmp_path / name).exists()


def test_a_plugin_that_is_not_there_is_told_by_every_command(tmp_path):
    for command in (["run", BOWLING], ["info", BOWLING], ["plot-law", "TANH"]):
        assert "no_such.py: no such file" in said(*command, "--plugin", tmp_path / "no_such.py")


def test_a_plugin_that_nobody_calls_is_told(tmp_path):
    own = tmp_path / "own.py"
    own.write_text("def CFFSUB(*arguments):\n    return [0.0, 0.0, 0.0]\n")
    lines: list[str] = []
    for deck in (BOWLING, BOUNCING):  # one names a script of its own, the other no function
        mbsim.simulate(deck, end_time=0.01, plugins=[own], notify=lines.append)
    assert lines.count(f"--plugin {own}: no element calls a function of it") == 2
    lines.clear()
    asks = {"Force_Contact[301].cff_type": "USERCFF"}
    deck = mbsim.read_model(BOUNCING, asks)
    mbsim.simulate(deck, end_time=0.01, plugins=[own], notify=lines.append)
    assert not [line for line in lines if "no element" in line]


def test_names_near_those_that_are_not_there():
    assert "Did you mean run?" in said("runn", BOWLING)
    asked = said("run", BOUNCING, "--sensitivity", "Force_Contact[301].stifness")
    assert "sensitivity: Force_Contact[301].stifness" in asked
    assert "did you mean stiffness?" in asked
    assert "sensitivity: mu: must be Element[id].attribute" in said(
        "run", BOUNCING, "--sensitivity", "mu"
    )
    assert "there is bodies/2/acceleration" in said("run", BOUNCING, "--signals", "zzz")


@pytest.mark.parametrize("name", ["tol", "end_time", "print_interval"])
@pytest.mark.parametrize("value", ["1e-3", [0.1], 1j])
def test_a_setting_that_is_no_number_is_refused_by_name(name, value):
    with pytest.raises(MbsimError, match=f"{name}=.* is not allowed: a number"):
        mbsim.simulate(BOUNCING, **{name: value})


def test_inputs_of_a_model_without_any():
    with mbsim.open(BOUNCING) as sim, pytest.raises(MbsimError, match="there is none"):
        sim.inputs["torque"] = 1.0


def test_a_strange_character_is_shown_as_it_is_written():
    deck = '<MotionSolve><Model><Reference_Variable id="1" expr="1\\2"/></Model></MotionSolve>'
    with pytest.raises(MbsimError) as caught:
        mbsim.read_model(deck)
    assert r"'\' means nothing here" in str(caught.value)


HEAD = "def CFFSUB(id, time, par, npar, loci, locj, x, xdot, nforce, dflag, iflag):\n"


@pytest.mark.parametrize(
    ("body", "words"),
    [
        (
            "return [par[5], 0.0, 0.0]",
            "an index is beyond the last number in return [float(par[5])",
        ),
        ("v = -xdot\n    return [v[0], v[1], 0.0]", "arithmetic with a whole list"),
        ("v = xdot*2\n    return [v[0], v[1], 0.0]", "not with its numbers in v = xdot * 2"),
        (
            "v = xdot[0:2]\n    return [v, 0.0, 0.0]",
            "No implementation of function float in return",
        ),
    ],
)
def test_why_a_function_is_not_compiled_can_be_read(body, words):
    address, reason = compile_friction(f"{HEAD}    {body}\n", {}, "CFFSUB", 2)
    assert address == 0
    assert words in reason
    assert "0x" not in reason
    assert "Function(" not in reason


def test_a_bracket_that_is_left_open_is_told_once(tmp_path):
    text = f"{HEAD}    return [-par[0]*\n"
    lines = diagnose(text, tmp_path / "open.py").splitlines()
    assert [line for line in lines if ":2:" in line] == lines[1:]
    assert len(lines) == 2


def advice(tmp_path: Path, shapes: str, plane: str = "") -> str:
    """Return what `mbsim check` says of a body on a plane that is inclined by 20 degrees."""
    deck = tmp_path / "slope.xml"
    deck.write_text(
        f"""<MotionSolve><Model>
  <Body_Rigid id="1" isground="TRUE"/>
  <Body_Rigid id="2" cg_id="20" mass="1" inertia_xx="0.01" inertia_yy="0.01" inertia_zz="0.01"/>
  <Reference_Marker id="10" body_id="1"/>
  <Reference_Marker id="11" body_id="1" pos_x="0.1" psi="1.5707963" theta="-1.5707963"/>
  <Reference_Marker id="20" body_id="2" pos_z="0.1"/>
  <Reference_Marker id="21" body_id="2" pos_z="0" theta="1.5707963"/>
  <Reference_Marker id="22" body_id="2" pos_x="-0.05" pos_z="0.1"/>
  <Post_Graphic id="100" type="Plane" rm_id="10"/>
  {shapes} {plane}
  <Force_Contact id="1" i_graphics_id="{"200 201" if "201" in shapes else "200"}"
    j_graphics_id="{"100 101" if plane else "100"}" cnf_type="IMPACT" stiffness="1e7"
    exponent="1" cff_type="COULOMB_ON" mu_static="0.5" mu_dynamic="0.4"/>
  <Force_Gravity grav_x="3.3552" grav_z="-9.2184"/>
</Model><Command><Simulate analysis_type="Transient" end_time="1" print_interval="0.1"/></Command>
</MotionSolve>"""
    )
    result = CliRunner().invoke(main, ["check", str(deck)])
    assert result.exit_code == 0, result.output
    return result.output


BOX = (
    '<Post_Graphic id="200" type="BoxDefinedFromCenter" center_marker_id="20" length_x="0.2" '
    'length_y="0.2" length_z="0.2"/>'
)
BALL = '<Post_Graphic id="200" type="Sphere" center_marker_id="20" radius="0.1"/>'
FOOT = '<Post_Graphic id="201" type="Sphere" center_marker_id="22" radius="0.1"/>'
PIN = '<Post_Graphic id="200" type="Cylinder" center_marker_id="{}" radius="0.1" length="0.2"/>'
WALL = '<Post_Graphic id="101" type="Plane" rm_id="11"/>'


@pytest.mark.parametrize(
    ("shapes", "plane", "creeps"),
    [
        (BOX, "", True),
        (PIN.format(20), "", True),
        (BALL + FOOT, "", True),  # on two balls it cannot roll both ways
        (BALL, "", False),
        (PIN.format(21), "", False),  # it lies and rolls
        (BOX, WALL, False),  # it rests against a stop
    ],
)
def test_what_rolls_or_rests_on_something_else_is_not_said_to_creep(
    shapes, plane, creeps, tmp_path
):
    assert ("down its incline of 20 degrees" in advice(tmp_path, shapes, plane)) is creeps


def test_a_study_speaks_of_signals_as_they_were_asked_for(tmp_path):
    study = tmp_path / "study.toml"
    study.write_text(
        f"""[study]
model = "{BOUNCING}"
design = "grid"
[parameters]
m = {{ path = "Body_Rigid[2].mass", values = [1.0, 2.0] }}
[outputs]
deep = {{ signal = "contacts/301/peak_penetratio" }}
"""
    )
    words = said("sweep", study, "-o", tmp_path / "out")
    assert "contacts/301/peak_penetratio: this model has no such signal" in words
    assert "did you mean contacts/301/peak_penetration" in words


def test_the_manual_is_not_written_over_a_deck(tmp_path):
    deck = tmp_path / "ball.html"
    deck.write_text("<MotionSolve/>")
    assert "is there and is no page" in said("manual", "--html", deck)
    assert deck.read_text() == "<MotionSolve/>"


def test_the_first_problem_of_a_process_takes_no_longer_than_the_next():
    """Code that is loaded, and Numba's look at arguments of a new kind, are not solving."""
    text = f"""
from pathlib import Path
from mbsim.fclib import hdf5
from mbsim.fclib.solve import solve
problem = hdf5.read(Path({str(FCLIB)!r})).problem
print(*(solve(problem).solve_s for _ in range(20)))
"""
    done = subprocess.run([sys.executable, "-c", text], capture_output=True, text=True, check=True)
    first, *others = map(float, done.stdout.split())
    assert first < 20.0 * max(others), done.stdout
