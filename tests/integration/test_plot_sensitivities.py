"""Derivatives of a run as signals of its results: names, units, pictures and how long they go."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
from click.testing import CliRunner

import mbsim
from mbsim.cli.main import main
from mbsim.errors import ModelError, UnknownSignal
from mbsim.results.curves import Choice, collect
from mbsim.results.names import compact
from mbsim.results.quantities import quantity_of
from mbsim.results.units import Quantity, UnitSystem

pytest.importorskip("matplotlib", reason="pictures need matplotlib")

from mbsim.results.drawing import draw

# a force that pushes away from the line along which the body moves: what is across grows e^30 times
DECK = """<Deck><Model>
<Body_Rigid id="1" isground="TRUE"/>
<Body_Rigid id="2" label="ball" cg_id="20" mass="2" inertia_xx="0.01" inertia_yy="0.02"
 inertia_zz="0.03" v_ic_x="0.3" v_ic_x_flag="TRUE" v_ic_y="0" v_ic_y_flag="TRUE"/>
<Reference_Marker id="10" body_id="1"/>
<Reference_Marker id="20" body_id="2" pos_x="1.2"/>
<Force_SpringDamper id="4" type="TRANSLATIONAL" i_marker_id="20" j_marker_id="10" stiffness="8"
 length="1"/>
<Force_Vector_TwoBody id="5" type="ForceOnly" i_marker_id="20" j_floating_marker_id="10"
 ref_marker_id="10" fx_expression="0" fy_expression="400*DY(20,10)" fz_expression="0"/>
<Post_Request id="7" type="MARKER_DISPLACEMENT" i_marker_id="20"/>
</Model><Command>
<Simulate analysis_type="Transient" end_time="3" print_interval="0.05"/>
</Command></Deck>"""
MASS, SPEED, STIFFNESS = (
    "Body_Rigid[2].mass",
    "Body_Rigid[2].v_ic_y",
    "Force_SpringDamper[4].stiffness",
)


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    """A run of which one derivative is not known to the end."""
    folder = tmp_path_factory.mktemp("run")
    deck = folder / "line.xml"
    deck.write_text(DECK)
    how = {"integrator": "DOPRI5", "tol": 1e-8, "sensitivity": [MASS, SPEED, STIFFNESS]}
    mbsim.simulate(deck, output=folder, **how).close()
    return folder / "line.h5"


@pytest.fixture
def run(file):
    with mbsim.open_results(file) as results:
        yield results


def test_each_signal_of_the_motion_has_a_name_with_the_parameter(run):
    names = run.signals()
    for parameter in (MASS, SPEED, STIFFNESS):
        assert names[f"sensitivity/{parameter}/bodies/2/position"] == 3
        assert names[f"sensitivity/{parameter}/requests/7"] == 8
        assert names[f"sensitivity/{parameter}/energy/kinetic"] == 1
    assert set(names) <= set(run.keys())
    slope = run[f"sensitivity/{MASS}/requests/7/F2"]
    assert (slope == run.sensitivity("requests/7/F2", MASS)).all()
    assert f"sensitivity/{MASS}/bodies/9/position" not in run
    assert f"sensitivity/{MASS}" not in run
    with pytest.raises(UnknownSignal, match="is a group"):
        run[f"sensitivity/{MASS}"]
    with pytest.raises(UnknownSignal, match="did you mean"):
        run[f"sensitivity/{MASS}/bodies/2/positon"]


def test_brackets_of_an_id_are_no_wildcards(run):
    x = [f"sensitivity/{MASS}/bodies/2/{what}/x" for what in ("position", "velocity")]
    assert run.find(x[0]) == x[:1]
    assert set(x) <= set(run.find(f"sensitivity/{MASS}/bodies/*/*/x"))
    every = run.find("sensitivity/*/bodies/2/position/x")
    assert [name.split("/")[1] for name in every] == sorted((MASS, SPEED, STIFFNESS))
    assert f"sensitivity/{MASS}/bodies/2/position" in compact(run.signals())


def test_units_are_those_of_the_signal_over_the_parameters():
    units = UnitSystem("NEWTON", "MILLIMETER", "SECOND", "TONNE")
    position = Quantity("Position", length=1)
    of = {
        MASS: "mm/t",
        SPEED: "s",
        STIFFNESS: "mm/stiffness",  # of a spring that turns it is another one
        "Body_Rigid[2].inertia_xx": "1/(mm·t)",
        "Force_Contact[3].damping": "mm²/(N·s)",
        "Force_Contact[3].stiffness": "mm/stiffness",
        "Force_Contact[3].mu_static": "mm",
        "Reference_Variable[6].expr": "mm/expr",
    }
    from mbsim.results.quantities import by_parameter

    found = {name: units.text(by_parameter(position, name)) for name in of}
    assert found == of
    known = by_parameter(position, MASS)
    assert units.factor_to(UnitSystem(), known) == pytest.approx(1e-6)
    with pytest.raises(ModelError, match="unit of stiffness is not known"):
        units.factor_to(UnitSystem(), by_parameter(position, STIFFNESS))


def test_a_picture_says_until_when_they_are_known(run):
    until = run.parameters[SPEED]["known_until"]
    assert until < 3.0
    names = [f"sensitivity/{p}/bodies/2/position/{c}" for p, c in ((MASS, "x"), (SPEED, "y"))]
    picture = collect([run], Choice((*names, "bodies/2/position/x")))
    of_mass, of_speed, plain = picture.panels
    assert of_mass.axis == "Position by mass [m/kg]"
    assert of_mass.curves[0].label == f"body 2 (ball), x by {MASS}"
    assert (of_mass.until, plain.until) == ({}, {})
    ((text, when),) = of_speed.until.items()
    assert when == until
    assert text == f"{SPEED} known until {until:.6g} s"
    assert any(f"derivatives by {SPEED} are not known from" in note for note in picture.notes)
    assert np.isnan(of_speed.curves[0].y[run["time"] > until]).all()
    axes = draw(picture).axes
    marks = [
        segment
        for lines in axes[1].collections
        for segment in lines.get_segments()
        if np.allclose(segment[:, 0], until)
    ]
    assert len(marks) == 1
    assert not axes[0].collections
    assert text in [entry.get_text() for entry in axes[1].get_legend().get_texts()]


def test_over_another_signal_only_a_note_says_it(run):
    name = f"sensitivity/{SPEED}/bodies/2/position/y"
    picture = collect([run], Choice((name,), over="bodies/2/position/x"))
    assert picture.panels[0].until == {}
    assert any("are not known from" in note for note in picture.notes)


def test_command_draws_them(file, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    name = f"sensitivity/{SPEED}/bodies/2/position/y"
    done = CliRunner().invoke(main, ["plot", str(file), name, "-o", "slope.svg", "--json"])
    assert done.exit_code == 0, done.output
    (panel,) = json.loads(done.stdout)["panels"]
    assert (panel["quantity"], panel["unit"]) == ("Position by v_ic_y", "s")
    assert len(panel["known_until"]) == 1
    assert "known until" in (tmp_path / "slope.svg").read_text()
    done = CliRunner().invoke(main, ["plot", str(file), f"sensitivity/{MASS}/bodies/2/x"])
    assert done.exit_code == 2
    done = CliRunner().invoke(main, ["info", str(file)])
    assert f"sensitivity/{MASS}/bodies/2/position" in done.output
    assert "m/kg" in done.output


def test_tables_have_them_with_units(run):
    pytest.importorskip("pandas", reason="tables are of pandas")
    name = f"sensitivity/{MASS}/bodies/2/velocity"
    frame = run.to_pandas(name, f"{name}/mag")
    assert frame.attrs["units"][f"{name}/x"] == "m/(s·kg)"
    assert (frame[f"{name}/mag"] == run[f"{name}/mag"]).all()


def test_results_in_memory_have_them_too():
    run = mbsim.simulate(DECK, integrator="DOPRI5", tol=1e-8, end_time=0.2, sensitivity=[MASS])
    name = f"sensitivity/{MASS}/bodies/2/position"
    assert run.signals()[name] == 3
    assert quantity_of(run, name) == Quantity("Position by mass", length=1, mass=-1)
    assert math.isinf(run.parameters[MASS]["known_until"])
