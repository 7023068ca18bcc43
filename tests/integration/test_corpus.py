"""Decks of practice, each with a reference of its own: it runs to that, or is refused by name.

A deck of tests/corpus/ says in its comments what it is held against, a closed form or a number of
an independent integration:

    check: REQUEST.COLUMN at TIME = VALUE within TOLERANCE
    run: end_time=T print_interval=DT      of a deck that says neither
    refused: LINE: WORDS                   of a deck that cannot be run
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import mbsim
from helpers.folders import CORPUS
from mbsim.errors import DeckError

_CHECK = re.compile(r"check: (\d+)\.F(\d) at (\S+) = (\S+) within (\S+)")
_RUN = re.compile(r"run: (.*)")
_REFUSED = re.compile(r"refused: (\d+): (.*)")
#: Decks that a command file runs.
_PARTS = ("adams_activity.adm", "adams_held_state.adm", "adams_spring.adm")


def decks(pattern: re.Pattern[str]) -> list[Any]:
    """Return the decks whose comments have something, as parameters."""
    files = sorted(p for p in CORPUS.iterdir() if p.suffix in (".xml", ".adm", ".acf"))
    return [
        pytest.param(path, id=path.name)
        for path in files
        if pattern.search(path.read_text("utf-8"))
    ]


@pytest.mark.parametrize("path", decks(_CHECK))
def test_a_deck_runs_to_its_reference(path: Path) -> None:
    text = path.read_text("utf-8")
    given = _RUN.search(text)
    settings = dict(pair.split("=") for pair in given.group(1).split()) if given else {}
    model = mbsim.read_model(path)
    results = mbsim.simulate(model, **{name: float(value) for name, value in settings.items()})
    times = results["time"]
    for request, column, time, value, tolerance in _CHECK.findall(text):
        row = int(np.abs(times - float(time)).argmin())
        assert times[row] == pytest.approx(float(time), abs=1e-9)
        found = results[f"requests/{request}"][row, int(column) - 1]
        assert found == pytest.approx(float(value), abs=float(tolerance)), (request, column, time)


@pytest.mark.parametrize("path", decks(_REFUSED))
def test_a_deck_is_refused_by_name_and_line(path: Path) -> None:
    with pytest.raises(DeckError) as caught:
        mbsim.read_model(path)
    said = str(caught.value).splitlines()
    for line, words in _REFUSED.findall(path.read_text("utf-8")):
        assert any(f"{path.name}:{line}: " in each and words in each for each in said), words


def test_every_deck_has_a_reference() -> None:
    checked = {each.values[0].name for each in (*decks(_CHECK), *decks(_REFUSED))}
    files = {p.name for p in CORPUS.iterdir() if p.suffix in (".xml", ".adm", ".acf")}
    assert files - checked == set(_PARTS)
