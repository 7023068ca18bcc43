"""Arguments of `simulate` that a user gets wrong, or gives in another way than tests do."""

from __future__ import annotations

import io
from pathlib import Path

import pytest

import mbsim
from helpers.folders import MODELS

DECK = MODELS / "bouncing_sphere.xml"
STIFFNESS = "Force_Contact[301].stiffness"


@pytest.mark.parametrize("name", ["signals", "plugins", "sensitivity"])
def test_one_text_is_no_list_of_its_letters(name):
    with pytest.raises(
        mbsim.errors.ModelError, match=rf"{name}='abc': must be a list, as \['abc'\]"
    ):
        mbsim.simulate(DECK, **{name: "abc"})


def test_a_path_is_no_list_of_plugins():
    with pytest.raises(mbsim.errors.ModelError, match="plugins='a\\.py': must be a list"):
        mbsim.simulate(DECK, plugins=Path("a.py"))


@pytest.mark.parametrize("how", ["r", "rb"])
def test_sensitivities_of_an_open_file(how):
    asked = {"sensitivity": [STIFFNESS], "end_time": 0.01}
    with DECK.open(how) as file:
        results = mbsim.simulate(file, **asked)
    known = mbsim.simulate(DECK, **asked)
    found = [r.sensitivity("bodies/2/position", STIFFNESS) for r in (results, known)]
    assert (found[0] == found[1]).all()


def test_sensitivities_of_a_text_in_memory():
    text = io.StringIO(DECK.read_text("utf-8"))
    results = mbsim.simulate(text, sensitivity=[STIFFNESS], end_time=0.01)
    assert results.sensitivity("bodies/2/position", STIFFNESS).shape == (len(results["time"]), 3)


def test_sensitivities_of_a_model_that_cannot_be_read_again():
    model = mbsim.read_model(DECK.read_text("utf-8"))
    with pytest.raises(mbsim.errors.ModelError, match="give simulate its path, or its text"):
        mbsim.simulate(model, sensitivity=[STIFFNESS], end_time=0.01)
