"""`mbsim request`: the forces of a run once more, to the last bit, and what lies behind them."""

from __future__ import annotations

import csv
import io
import json
import shutil

import h5py
import numpy as np
import pytest
from click.shell_completion import ShellComplete
from click.testing import CliRunner

import mbsim
from helpers.folders import MODELS, USERFUNCS
from mbsim.cli.main import main
from mbsim.errors import ModelError, ResultsError
from mbsim.run.between_rows import rerun
from mbsim.run.replay import Replay, request

SLIP = 'stiction_trans_vel="0.01" friction_trans_vel="0.02"'
USER = 'cff_type="USERCFF" cff_fnc_name="CFFSUB" script_name="law.py"'
FRICTIONS = {
    "none": "",
    "COULOMB_ON": f'cff_type="COULOMB_ON" mu_static="0.4" mu_dynamic="0.3" {SLIP}',
    "STICTION": 'cff_type="STICTION" mu_static="0.4" mu_dynamic="0.3"',
    "LUGRE": 'cff_type="LUGRE" mu_static="0.4" mu_dynamic="0.3" stribeck_vel="0.01" '
    'bristle_stiffness="2e4" bristle_damping="30"',
    "plugin": f'{USER} cff_param_string="USER(0.4,2e4,30)"',
}
DECK = """<Deck><Model>
<Body_Rigid id="1" isground="TRUE"/>
<Body_Rigid id="2" cg_id="20" mass="1" inertia_xx="0.0042" inertia_yy="0.0042"
 inertia_zz="0.0067" v_ic_x="{vx}" v_ic_x_flag="TRUE"/>
<Body_Rigid id="3" cg_id="30" mass="1" inertia_xx="0.01" inertia_yy="0.01" inertia_zz="0.01"
 w_ic_y="{spin}" w_ic_y_flag="TRUE"/>
<Reference_Marker id="10" body_id="1"/>
<Reference_Marker id="20" body_id="2" pos_z="{block}"/>
<Reference_Marker id="30" body_id="3" pos_x="1" pos_z="{ball}"/>
<Post_Graphic id="100" type="Plane" rm_id="10"/>
<Post_Graphic id="200" type="BoxDefinedFromCenter" center_marker_id="20"
 length_x="0.2" length_y="0.2" length_z="0.1"/>
<Post_Graphic id="300" type="Sphere" center_marker_id="30" radius="0.1"/>
<Force_Contact id="301" num_i_graphics="2" i_graphics_id="200 300" num_j_graphics="1"
 j_graphics_id="100" cnf_type="IMPACT" stiffness="1e5" exponent="1" damping="300" dmax="1e-5"
 {friction}/>
{force}
<Force_Gravity grav_z="-9.81"/>
</Model>
<Command><Simulate analysis_type="Transient" end_time="{end}" print_interval="0.01"/></Command>
</Deck>
"""
FORCE = """<Force_Vector_OneBody id="5" type="ForceOnly" i_marker_id="20"
 fx_expression="6*sin(6*time)" fy_expression="2*sin(4*time)" fz_expression="0"/>"""
USUAL = {"vx": 0, "spin": -20, "block": 0.05001, "ball": 0.15, "force": FORCE, "end": 0.4}
SLIDER = """<Deck><Model>
<Body_Rigid id="1" isground="TRUE"/>
<Body_Rigid id="2" cg_id="20" mass="1" inertia_xx="1" inertia_yy="1" inertia_zz="1"/>
<Reference_Marker id="10" body_id="1"/><Reference_Marker id="20" body_id="2" pos_x="0.00045"/>
<Force_Vector_OneBody id="5" type="ForceOnly" i_marker_id="20" fx_expression="-1e4*DX(20,10,10)"
 fy_expression="0" fz_expression="0"/>
<Force_DryFriction id="7" type="TX" i_marker_id="20" j_marker_id="10" friction="1" dx="1e-6"/>
</Model><Command><Simulate analysis_type="Transient" end_time="0.12" print_interval="0.002"/>
</Command></Deck>
"""
SPIED = """
def CFFSUB(id, time, par, npar, loci, locj, x, xdot, nforce, dflag, iflag):
    v = hypot(xdot[0], xdot[1])
    ratio = 0.3 / max(v, 0.01)
    mode = "slow" if v < 0.01 else "fast"
    espy(mu=ratio * v, mode_of_mine="slow" if v < 0.01 else "fast")
    return [-ratio * nforce * xdot[0], -ratio * nforce * xdot[1], 0.0]
"""


def run(folder, friction, script=None, deck=None, **settings):
    """Run the deck in a folder and return its open results."""
    source = USERFUNCS / "stiction_with_state.py"
    text = source.read_text() if script is None else script
    (folder / "law.py").write_text(text)
    file = folder / "deck.xml"
    file.write_text(DECK.format(friction=friction, **(USUAL | (deck or {}))))
    return mbsim.simulate(mbsim.read_model(file), output=folder / "out", **settings)


def same(results):
    """Compare forces evaluated again with those of the run, bit for bit; return the rows."""
    rows = list(Replay(results).rows())
    assert len(rows) == len(results["time"]) > 10
    for name in ("force", "torque", "penetration", "slip_speed", "incidents"):
        again = [row.contacts[301][name] for row in rows]
        np.testing.assert_array_equal(np.array(again), results[f"contacts/301/{name}"])
    return rows


@pytest.mark.parametrize(
    ("friction", "method"),
    [
        *((friction, "DOPRI5") for friction in FRICTIONS),
        ("COULOMB_ON", "VERLET"),
        ("plugin", "VERLET"),
        ("STICTION", "GALPHA"),
        ("LUGRE", "RADAU5"),
    ],
)
def test_forces_are_those_of_the_run_to_the_last_bit(tmp_path, friction, method):
    deck: dict[str, object] = {}
    if method == "VERLET":
        deck = {"vx": 1, "force": ""}
    with run(tmp_path, FRICTIONS[friction], deck=deck, integrator=method) as results:
        rows = same(results)
    # block and sphere both touch, and the forces are no zeros
    assert max(len(row.incidents[301]) for row in rows) == 5
    pulls = [abs(row.contacts[301]["force"][0]) for row in rows]
    assert (max(pulls) > 1.0) == (friction != "none")


def test_so_are_those_of_an_interpreted_function(tmp_path):
    friction = FRICTIONS["plugin"]
    with run(tmp_path, friction, interpret_plugins=True) as results:
        assert results.stats["python_calls"] > 0
        same(results)


def test_and_those_of_a_law_that_asks_for_a_users_sliding(tmp_path):
    friction = f'{FRICTIONS["STICTION"]} cff_fnc_name="CFFSUB" script_name="law.py"'
    with run(tmp_path, friction, script=SPIED) as results:
        rows = same(results)
    assert {row.incidents[301][0]["mode"] for row in rows if row.incidents[301]} == {
        "stick",
        "slip",
    }


@pytest.mark.parametrize("name", ["bowling_ball", "belt_stick_slip", "mesh_on_plane"])
def test_and_those_of_decks_in_models(tmp_path, name):
    model = mbsim.read_model(MODELS / f"{name}.xml")
    contact = next(iter(model.contacts))
    with mbsim.simulate(model, output=tmp_path, end_time=0.6, print_interval=0.02) as results:
        rows = list(Replay(results).rows())
        again = np.array([row.contacts[contact]["force"] for row in rows])
        np.testing.assert_array_equal(again, results[f"contacts/{contact}/force"])
        assert np.abs(again).max() > 0.0


def test_what_set_changed_is_changed_again(tmp_path):
    (tmp_path / "deck.xml").write_text(DECK.format(friction=FRICTIONS["COULOMB_ON"], **USUAL))
    model = mbsim.read_model(tmp_path / "deck.xml", ["Force_Contact[301].mu_dynamic=0.1"])
    with mbsim.simulate(model, output=tmp_path / "out") as results:
        assert results.attributes["overrides"] == "Force_Contact[301].mu_dynamic=0.1"
        same(results)


def ask(*arguments):
    return CliRunner().invoke(main, ["request", *map(str, arguments)])


@pytest.fixture(scope="module")
def held(tmp_path_factory):
    """Return a result file of STICTION, and a copy of its numbers."""
    folder = tmp_path_factory.mktemp("held")
    with run(folder, FRICTIONS["STICTION"]) as results:
        force = np.array(results["contacts/301/force"])
    return folder / "out" / "deck.h5", force


def test_csv_and_json_have_the_same_numbers(held, tmp_path):
    file, force = held
    names = ["Force_Contact[301].force", "Force_Contact[301].incident[4].mu"]
    names += ["Force_Contact[301].incident[0].mode", "Force_Contact[301].incident[0].force/mag"]
    shown = ask(file, *names)
    assert shown.exit_code == 0, shown.output
    table = list(csv.DictReader(io.StringIO(shown.stdout)))
    for k, axis in enumerate("xyz"):
        read = [float(row[f"Force_Contact[301].force/{axis}"]) for row in table]
        np.testing.assert_array_equal(read, force[:, k])
    said = json.loads(ask(file, *names, "--json").stdout)
    assert list(said["signals"]) == list(table[0])[1:]
    # the sphere falls first: there is no fifth incident then
    mu = said["signals"][names[1]]
    assert mu[0] is None
    assert table[0][names[1]] == ""
    assert max(value for value in mu if value is not None) == pytest.approx(0.3, rel=1e-9)
    assert set(said["signals"][names[2]]) == {"", "stick", "slip"}
    target = tmp_path / "asked.csv"
    assert "5 columns" not in ask(file, *names, "-o", target).stdout
    assert target.read_text() == shown.stdout


def test_signals_belong_together(held):
    file, _ = held
    signals = ("force", "nforce", "friction", "mu", "slip", "xdot", "depth", "normal")
    names = [f"Force_Contact[301].incident[0].{each}" for each in signals]
    with mbsim.open_results(file) as results:
        time, columns = request(results, names)
    got = {
        name.partition("].incident[0].")[2]: np.array(column) for name, column in columns.items()
    }
    there = np.isfinite(got["depth"])
    assert there.sum() > 0.9 * len(time)
    part = {name: column[there] for name, column in got.items()}
    np.testing.assert_allclose(part["normal/z"], 1.0)
    np.testing.assert_allclose(part["force/z"], part["nforce"], rtol=1e-12)
    size = np.hypot(part["friction/x"], part["friction/y"])
    np.testing.assert_allclose(size, np.hypot(part["force/x"], part["force/y"]), atol=1e-9)
    np.testing.assert_allclose(part["mu"] * part["nforce"], size, atol=1e-12)
    np.testing.assert_allclose(part["slip"], np.hypot(part["xdot/x"], part["xdot/y"]), atol=1e-15)


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("Force_Contact[301].incident[0].muu", "no such signal; there are mu, force, torque, mode"),
        (
            "Force_Contact[301].mu",
            "there are force, torque, penetration, slip_speed, incidents, area, inc",
        ),
        ("Force_Contact[7].force", "no such contact; there are Force_Contact[301]"),
        ("Force_Contact[301].incident[99].mu", "no such incident; the rows have at most "),
        ("Force_Contact[301].force/w", "no such part; there are /x, /y, /z, /mag"),
        ("Force_Contact[301].incident[0].mu/x", "no such part; mu is one number"),
        (
            "contacts/301/force",
            "one for mbsim plot; such are Force_Contact[301].force and",
        ),
    ],
)
def test_unknown_names_list_what_exists(held, name, said):
    done = ask(held[0], name)
    assert done.exit_code == 2
    assert f"{name}: " in done.output
    assert said in done.output
    assert done.output.splitlines()[1:] == ["mbsim: see: mbsim manual reference/commands/request"]


def test_a_deck_or_a_script_that_changed_is_refused(tmp_path):
    run(tmp_path, FRICTIONS["plugin"], deck={"end": 0.1}).close()
    file, deck, law = tmp_path / "out" / "deck.h5", tmp_path / "deck.xml", tmp_path / "law.py"
    name = "Force_Contact[301].force"
    text, script = deck.read_text(), law.read_text()
    law.write_text(script + "# another\n")
    assert "a user subroutine has changed since the run" in ask(file, name).output
    law.write_text(script)
    deck.write_text(text.replace("9.81", "9.80"))
    assert "deck.xml has changed since the run" in ask(file, name).output
    deck.unlink()
    assert "deck.xml cannot be read: No such file" in ask(file, name).output
    deck.write_text(text)
    assert ask(file, name).exit_code == 0
    shutil.copy(file, tmp_path / "copy.txt")
    with pytest.raises(ResultsError, match="no such file"):
        mbsim.open_results(tmp_path / "none.h5")


@pytest.mark.parametrize("given", ["", "from mbsim import espy\n", "from mbsim import espy as e\n"])
def test_signals_of_the_users_own(tmp_path, given):
    script = given + (SPIED.replace("espy(", "e(") if " as e" in given else SPIED)
    script = script.replace('    mode = "slow" if v < 0.01 else "fast"\n', "")
    with run(tmp_path, USER, script=script) as results:
        # it is compiled without the call
        assert results.stats["python_calls"] == 0
        same(results)
        at = "Force_Contact[301].incident[0]."
        _, columns = request(results, [f"{at}mu", f"{at}slip", f"{at}mode_of_mine"])
        slip = np.array(columns[f"{at}slip"])
        there = np.isfinite(slip)
        np.testing.assert_allclose(
            np.array(columns[f"{at}mu"])[there], 0.3 * np.minimum(1.0, slip[there] / 0.01)
        )
        words = np.array(columns[f"{at}mode_of_mine"])
        np.testing.assert_array_equal(words[there], np.where(slip[there] < 0.01, "slow", "fast"))
        with pytest.raises(ModelError, match=r"no such signal; there are .*mode_of_mine"):
            request(results, [f"{at}mode_of_yours"])


def test_espy_cannot_take_the_name_of_a_vector(tmp_path):
    script = SPIED.replace("espy(mu=ratio * v", "espy(normal=ratio * v")
    with (
        run(tmp_path, FRICTIONS["plugin"], script) as results,
        pytest.raises(ModelError, match=r"law.py: espy\(normal=...\): normal is a vector"),
    ):
        request(results, ["Force_Contact[301].incident[0].normal"])


def test_espy_with_what_may_fail_keeps_a_function_interpreted(tmp_path):
    # a name of its own that it may not have set yet, which Python would not forgive
    script = SPIED.replace("espy(mu=ratio * v", "espy(mu=1.0 / later if v < 0.0 else v")
    script = script.replace("    return [", "    later = 2.0\n    return [")
    with run(tmp_path, USER, script=script, deck={"end": 0.02}) as results:
        assert results.stats["python_calls"] > 0


def test_rows_after_a_command_have_the_changed_parameters(tmp_path):
    text = DECK.format(friction=FRICTIONS["COULOMB_ON"], **USUAL)
    change = '<Force_Contact id="301" mu_dynamic="0.1" stiffness="5e4"/>'
    later = '<Simulate analysis_type="Transient" end_time="0.8" print_interval="0.01"/>'
    text = text.replace("</Command>", f"{change}{later}</Command>")
    (tmp_path / "deck.xml").write_text(text)
    with mbsim.simulate(mbsim.read_model(tmp_path / "deck.xml"), output=tmp_path / "o") as results:
        rows = same(results)
    mu = {round(row.incidents[301][0]["mu"], 3) for row in rows if row.incidents[301]}
    assert {0.1, 0.3} <= mu


def test_a_shell_completes_what_can_be_asked_of_a_result(held):
    file, _ = held
    shell = ShellComplete(main, {}, "mbsim", "_MBSIM_COMPLETE")

    def completed(word):
        return [item.value for item in shell.get_completions(["request", str(file)], word)]

    assert completed("Force") == ["Force_Contact[301]."]
    for part in ("force", "force/", "area", "incident[0]."):
        assert f"Force_Contact[301].{part}" in completed("Force_Contact[301].")
    assert completed("Force_Contact[301].incident[0].mu") == ["Force_Contact[301].incident[0].mu"]
    asked = [
        *completed("Force_Contact[301].force/"),
        *completed("Force_Contact[301].incident[0].n"),
    ]
    assert len(asked) > 5
    assert ask(file, *(name for name in asked if not name.endswith("/"))).exit_code == 0


def test_signals_of_other_elements_and_what_their_subroutines_name(tmp_path):
    (tmp_path / "force.py").write_text(
        "def SFOSUB(id, time, par, npar, dflag, iflag):\n"
        "    d, errflg = py_sysfnc('DM', [20, 10])\n"
        "    espy(stretch=d - 0.5, side='long' if d > 0.5 else 'short')\n"
        "    return -100 * (d - 0.5)\n"
    )
    deck = tmp_path / "deck.xml"
    deck.write_text("""<Deck><Model>
<Body_Rigid id="1" isground="TRUE"/>
<Body_Rigid id="2" cg_id="20" mass="1" inertia_xx="0.1" inertia_yy="0.1" inertia_zz="0.1"/>
<Reference_Marker id="10" body_id="1" a00="0" a20="-1" a02="1" a22="0"/>
<Reference_Marker id="20" body_id="2" pos_x="0.6" a00="0" a20="-1" a02="1" a22="0"/>
<Constraint_Joint id="3" type="TRANSLATIONAL" i_marker_id="20" j_marker_id="10"/>
<Force_Scalar_TwoBody id="7" type="Force" i_marker_id="20" j_marker_id="10"
 usrsub_param_string="USER()" script_name="force.py"/>
<Force_SpringDamper id="8" type="TRANSLATIONAL" i_marker_id="20" j_marker_id="10" stiffness="10"
 length="0.5"/>
<Force_Gravity grav_z="-9.81"/>
<Post_Request id="1" type="EXPRESSION" expr1="DM(20,10)"/>
</Model><Command><Simulate analysis_type="Transient" end_time="0.4" print_interval="0.1"/></Command>
</Deck>""")
    mbsim.simulate(mbsim.read_model(deck), output=tmp_path)
    with mbsim.open_results(tmp_path / "deck.h5") as results:
        stretch = results["requests/1/F1"] - 0.5
        names = ["Force_Scalar_TwoBody[7].stretch", "force_scalar_twobody[7].side"]
        names += ["Constraint_Joint[3].force/z", "Force_SpringDamper[8].force"]
        time, columns = request(results, names)
        np.testing.assert_array_equal(time, results["time"])
        np.testing.assert_allclose(columns[names[0]], stretch, atol=1e-15)
        assert columns[names[1]] == ["long" if d > 0 else "short" for d in stretch]
        np.testing.assert_allclose(columns[names[2]], 9.81)
        np.testing.assert_allclose(columns["Force_SpringDamper[8].force/x"], -10 * stretch)
        for name, said in (
            ("Constraint_Joint[3].length", "there are force, torque"),
            ("Force_SpringDamper[9].force", "no such element"),
            ("Force_Scalar_TwoBody[7].strain", "there are force, torque, stretch, side"),
            ("Force_SpringDamper[8].force/w", "there are /x, /y, /z, /mag"),
        ):
            with pytest.raises(ModelError, match=said):
                request(results, [name])


@pytest.mark.parametrize(
    ("friction", "method"), [("STICTION", "AUTO"), ("LUGRE", "RADAU5"), ("plugin", "DOPRI5")]
)
def test_between_rows_are_the_states_of_the_run(tmp_path, friction, method):
    """Every third row of another run of its own is one of the first, to the last bit."""
    names = ["Force_Contact[301].force", "Force_Contact[301].incident[0].slip"]
    with run(tmp_path, FRICTIONS[friction], integrator=method) as results:
        times, columns = request(results, names)
        with rerun(results, 0.01 / 3.0) as rows:
            nearer, more = request(rows, names)
    np.testing.assert_allclose(nearer[::3], times, atol=1e-12)
    for name in columns:
        assert len(more[name]) == 3 * len(times) - 2
        np.testing.assert_allclose(more[name][::3], columns[name], atol=1e-9)
    assert more[f"{names[0]}/x"][-1] == columns[f"{names[0]}/x"][-1]


def test_between_rows_nothing_is_known_of_a_run_that_ends_elsewhere_again(tmp_path):
    """As one of a user's code that asks for chance."""
    run(tmp_path, FRICTIONS["none"]).close()
    file = tmp_path / "out" / "deck.h5"
    with h5py.File(file, "r+") as stored:
        stored["state/y"][-1, 0] += 1e-9
    with mbsim.open_results(file) as results:
        with pytest.raises(ModelError, match=r"not at time 0\.4 where it was"):
            with rerun(results, 0.005):
                pass
        with pytest.raises(ModelError, match="--every 0: must be a time above 0"):
            with rerun(results, 0.0):
                pass


def test_between_rows_of_a_run_that_was_interrupted(tmp_path):
    """Its last row need be none of those that are asked for."""
    run(tmp_path, FRICTIONS["none"]).close()
    file = tmp_path / "out" / "deck.h5"
    with mbsim.open_results(file) as results:
        rows = len(results["time"])
    with h5py.File(file, "r+") as stored:
        for name in ("time", "state/y"):
            kept = stored[name][: rows - 3]
            del stored[name]
            stored[name] = kept
    with mbsim.open_results(file) as results, rerun(results, 0.004) as more:
        assert more["time"][-1] == pytest.approx(0.4)
        assert 0.37 not in more["time"]


def test_of_dop853_it_is_said_that_what_is_between_rows_is_another_run(tmp_path):
    run(tmp_path, FRICTIONS["none"], integrator="DOP853").close()
    file = str(tmp_path / "out" / "deck.h5")
    said = CliRunner().invoke(
        main, ["request", file, "Force_Contact[301].force", "--every", "0.005"]
    )
    assert said.exit_code == 0
    assert "steps of DOP853 depend on rows: this is another run within tol" in said.stderr


def test_dry_friction_says_whether_it_sticks(tmp_path):
    """A slider on a spring of 1e4 N/m with F = 1 N slips for two half periods, then holds."""
    (tmp_path / "deck.xml").write_text(SLIDER)
    with mbsim.simulate(tmp_path / "deck.xml", output=tmp_path / "out") as results:
        _, columns = request(results, ["Force_DryFriction[7].mode"])
        forces = np.abs(results["dry_frictions/7/force"][:, 0])
        moving = np.abs(results["bodies/2/velocity"][:, 0]) > 5e-3
    modes = np.array(columns["Force_DryFriction[7].mode"])
    assert set(modes) == {"stick", "slip"}
    assert (modes[moving] == "slip").all()
    assert modes[-1] == "stick"
    assert (forces[modes == "stick"] < 1.0).all()
