"""What a deck gives and what would do nothing is said: in a warning, a note or a refusal."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
import pytest

from mbsim.errors import DeckError, ModelError
from mbsim.model.elements import Model
from mbsim.model.placement import place
from mbsim.reader.keywords import nearest
from mbsim.reader.statements import STATEMENTS
from mbsim.reader.xml import read_model
from mbsim.run.settings import settle

INERTIA = 'inertia_xx="1" inertia_yy="1" inertia_zz="1"'
TIMELESS = ("ASSEMBLY", "STATIC", "LINEAR")
#: Values of the attributes that say how long a Simulate lasts and what it writes.
TIMES = {"end_time": "1", "duration": "1", "num_steps": "5", "print_interval": "0.1"}


def read(folder: Path, body: str, commands: str = "") -> Model:
    """Return the model of a deck with one moving body, 2, and commands."""
    deck = folder / "deck.xml"
    deck.write_text(
        f'<MotionSolve><Model><Body_Rigid id="1" isground="TRUE"/>{body}'
        '<Reference_Marker id="20" body_id="2"/>'
        f"</Model><Command>{commands}</Command></MotionSolve>"
    )
    return read_model(deck)


@pytest.mark.parametrize("given", ['v_ic_x="1"', 'v_ic_z="-2" v_ic_z_flag="FALSE"'])
@pytest.mark.parametrize("statement", ["Body_Rigid", "Body_Point"])
def test_a_velocity_without_its_flag_is_warned_of(tmp_path, statement, given):
    inertia = INERTIA if statement == "Body_Rigid" else ""
    model = read(tmp_path, f'<{statement} id="2" cg_id="20" mass="1" {inertia} {given}/>')
    assert [f"{given.split('=')[0]}_flag is not TRUE" in str(w) for w in model.warnings] == [True]
    assert model.bodies[2].v_ic == (0.0, 0.0, 0.0)


@pytest.mark.parametrize("statement", ["Body_Rigid", "Body_Point"])
def test_a_flag_without_its_velocity_holds_the_default(tmp_path, statement):
    inertia = INERTIA if statement == "Body_Rigid" else ""
    flags = 'v_ic_y_flag="TRUE" v_ic_x="3" v_ic_x_flag="TRUE"'
    model = read(tmp_path, f'<{statement} id="2" cg_id="20" mass="1" {inertia} {flags}/>')
    given = place(model).bodies[2].given
    assert np.array_equal(given[:, [0, 1, 2, 6]], [[1, 0, 0, 3], [0, 1, 0, 0]])


@pytest.mark.parametrize(
    ("kind", "name"),
    [
        (kind, name)
        for kind, name in itertools.product(TIMELESS, TIMES)
        # a Static over a span is quasi-static, and takes these two
        if not (kind == "STATIC" and name in ("end_time", "duration"))
    ],
)
def test_times_of_an_analysis_that_takes_none_are_noted(tmp_path, kind, name):
    body = f'<Body_Rigid id="2" cg_id="20" mass="1" {INERTIA}/>'
    simulate = f'<Simulate analysis_type="{kind}" {name}="{TIMES[name]}"/>'
    notes = read(tmp_path, body, simulate).notes
    assert any(f"{name}: has no effect with analysis_type {kind}" in str(note) for note in notes)


def test_sleep_is_noted_with_methods_that_know_none(tmp_path):
    body = f'<Body_Rigid id="2" cg_id="20" mass="1" {INERTIA}/>'
    simulate = '<Simulate end_time="1" print_interval="1"/>'
    model = read(tmp_path, body, '<Param_Transient sleep="FALSE"/>' + simulate)
    assert any("sleep: is for MOREAU" in note for note in settle(model).notes)
    for other in (settle(model, integrator="MOREAU"), settle(read(tmp_path, body, simulate))):
        assert not any("sleep" in note for note in other.notes)


def test_a_longer_label_may_stand_wherever_a_label_may():
    for statement in STATEMENTS:
        if {"id", "label"} <= set(statement.attributes):
            assert "full_label" in statement.attributes, statement.name


@pytest.mark.parametrize(
    ("name", "known", "meant"),
    [
        ("x", ("id", "grav_x", "grav_y"), "grav_x"),
        ("expression", ("id", "expr", "label"), "expr"),
        ("cm_id", ("cg_id", "wm_id"), "cg_id"),
        ("z", ("grav_z", "pos_z"), ""),  # of two
        ("zzz", ("expr", "grav_z"), ""),
    ],
)
def test_the_name_that_is_meant_is_told(name, known, meant):
    assert nearest(name, known) == (f"; did you mean {meant}?" if meant else "")


def test_a_word_of_an_adams_deck_is_told_too(tmp_path):
    deck = tmp_path / "deck.adm"
    deck.write_text("title\nPART/1, GROUND\nMOTION/1, ROTATIONAL, JOINT=1, FUNCTION=TIME\nEND\n")
    with pytest.raises(DeckError, match="ROTATIONAL: unknown word; did you mean ROTATION"):
        read_model(deck)


@pytest.mark.parametrize(
    ("sensor", "transient", "noted"),
    [
        ("", "", True),
        ('zero_crossing="FALSE"', "", True),
        ('zero_crossing="TRUE"', "", False),
        ("", '<Param_Transient h_max="0.01"/>', False),
    ],
)
def test_a_sensor_that_may_act_late_is_noted(tmp_path, sensor, transient, noted):
    body = f'<Body_Rigid id="2" cg_id="20" mass="1" {INERTIA}/>'
    body += f'<Sensor_Event id="7" expr="DZ(20)" compare="LE" value="-1" halt="TRUE" {sensor}/>'
    model = read(tmp_path, body, transient + '<Simulate end_time="1" print_interval="1"/>')
    said = "Sensor_Event[7]: acts at the end of the step that finds it true"
    assert any(note.startswith(said) for note in settle(model).notes) == noted


def test_a_method_that_is_no_name_is_refused(tmp_path):
    body = f'<Body_Rigid id="2" cg_id="20" mass="1" {INERTIA}/>'
    model = read(tmp_path, body, '<Simulate end_time="1" print_interval="1"/>')
    with pytest.raises(ModelError, match="integrator=5 is not allowed: the name of a method"):
        settle(model, integrator=5)
