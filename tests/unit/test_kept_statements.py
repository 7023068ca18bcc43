"""What of a deck stays with its tree: a deck that is read again is what its text and files say."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

from helpers.folders import MODELS
from mbsim.errors import DeckError
from mbsim.model.elements import Model
from mbsim.reader import parse
from mbsim.reader.xml import read_model
from mbsim.results.identity import of_elements

DECKS = sorted(MODELS.rglob("*.xml"))
BALL = MODELS / "bowling_ball.xml"


def said(deck: Path, overrides=()) -> list[object]:
    """Return all that reading a deck gives: facts, notes and warnings, or its faults."""
    try:
        model = read_model(deck, overrides)
    except DeckError as error:
        return list(map(str, error.faults))
    return [of_elements(model, model.file), model.notes, model.warnings, sources(model)]


def sources(model: Model) -> list[object]:
    tables = [value for value in vars(model).values() if isinstance(value, dict)]
    return [getattr(element, "source", None) for table in tables for element in table.values()]


@pytest.mark.parametrize("deck", DECKS, ids=lambda deck: str(deck.relative_to(MODELS)))
def test_a_deck_that_is_read_again_is_the_same(deck):
    parse._parsed.cache_clear()
    first = said(deck)
    assert said(deck) == first == said(deck)


@pytest.mark.parametrize(
    "overrides",
    [
        ("Body_Rigid[2].mass=7",),
        ("Reference_Marker[20].pos_z=0.2", "Body_Rigid[2].mass=7"),
        ("Body_Rigid[2].id=1",),  # twice
        ("Post_Graphic[200].radius=-1",),  # a fault of its own
        ("Param_Unit.length_unit=MILLIMETER",),  # others look at it
        ("Reference_Marker[20].psi=9",),  # a warning
        ("Simulate.end_time=0.5",),
    ],
)
def test_what_is_set_is_set_in_one_reading(overrides):
    parse._parsed.cache_clear()
    alone = said(BALL, overrides)
    parse._parsed.cache_clear()
    plain = said(BALL)
    for _ in range(2):
        assert said(BALL, overrides) == alone
        assert said(BALL) == plain
    assert alone != plain


def test_an_attribute_may_be_set_twice_and_in_two_elements_of_one_name():
    model = read_model(BALL, ("Body_Rigid[2].mass=7", "Body_Rigid[2].mass=8"))
    assert model.bodies[2].mass == 8.0
    assert read_model(BALL).bodies[2].mass == 5.0


def test_files_are_looked_at_each_time(tmp_path):
    deck, script = tmp_path / "ball.xml", tmp_path / "law.py"
    text = BALL.read_text()
    named = text.split('script_name="')[1].split('"')[0]
    shutil.copy(MODELS / named, script)
    for name in ("law.py", str(script)):  # relative to the deck, and absolute
        deck.write_text(text.replace(named, name))
        read_model(deck)
        script.rename(tmp_path / "away.py")
        with pytest.raises(DeckError, match="no such file"):
            read_model(deck)
        (tmp_path / "away.py").rename(script)
        read_model(deck)


def test_a_deck_with_other_bytes_is_read_anew(tmp_path):
    deck = tmp_path / "drop.xml"
    text = (MODELS / "drop_m.xml").read_text()
    deck.write_text(text)
    before = read_model(deck)
    deck.write_text(text.replace("9.81", "1.62"))
    assert read_model(deck).gravity.g != before.gravity.g


def test_arrays_of_elements_that_are_kept_stay_as_they_are():
    marker = read_model(BALL).markers[20]
    with pytest.raises(ValueError, match="read-only"):
        marker.R[0, 0] = 2.0
    np.testing.assert_array_equal(read_model(BALL).markers[20].R, np.eye(3))
