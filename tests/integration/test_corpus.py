"""Decks of practice, each with a reference of its own: it runs to that, or is refused by name.

A deck of tests/corpus/ says in its comments what it is held against, a closed form or a number of
an independent integration:

    check: REQUEST.COLUMN at TIME = VALUE within TOLERANCE
    linear: ANALYSIS MATRIX = NUMBERS within TOLERANCE      of a linear analysis, row by row
    linear: ANALYSIS states N inputs N outputs N
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
from mbsim.reader.adm.statements import STATEMENTS as ADAMS_STATEMENTS
from mbsim.reader.statements import STATEMENTS

_CHECK = re.compile(r"check: (\d+)\.F(\d) at (\S+) = (\S+) within (\S+)")
_LINEAR = re.compile(r"linear: (\d+) (\w+) = (.+) within (\S+)")
_SIZES = re.compile(r"linear: (\d+) states (\d+) inputs (\d+) outputs (\d+)")
_RUN = re.compile(r"run: (.*)")
_REFUSED = re.compile(r"refused: (\d+): (.*)")
#: Decks that a command file runs.
_PARTS = tuple(
    f"adams_{name}.adm" for name in ("activity", "held_state", "linear", "nforce", "spring")
)


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


@pytest.mark.parametrize("path", decks(_SIZES))
def test_a_deck_is_linearised_as_its_reference(path: Path, tmp_path: Path) -> None:
    text = path.read_text("utf-8")
    mbsim.simulate(mbsim.read_model(path), output=tmp_path)
    with mbsim.open_results(next(tmp_path.glob("*.h5"))) as results:
        models = results.linear
        kept = {k: results[f"linear/{k}/frequencies"] for k in range(1, len(models) + 1)}
    for k, *sizes in _SIZES.findall(text):
        model = models[int(k) - 1]
        found = [len(each) for each in (model.states, model.inputs, model.outputs)]
        assert found == [int(size) for size in sizes]
        assert np.array_equal(kept[int(k)], [mode.frequency for mode in model.modes])
    for k, what, values, tolerance in _LINEAR.findall(text):
        found = linear_numbers(models[int(k) - 1], what)
        expected = np.array(values.split(), dtype=float)
        np.testing.assert_allclose(found, expected, rtol=0.0, atol=float(tolerance), err_msg=what)


def linear_numbers(model: Any, what: str) -> Any:
    """Return numbers of a linearised model by their name in a deck's comments."""
    if what == "frequencies":
        return np.array([mode.frequency for mode in model.modes])
    if what == "damping_ratios":
        return np.array([mode.damping_ratio for mode in model.modes])
    if what == "gain":
        return (model.D - model.C @ np.linalg.solve(model.A, model.B)).ravel()
    return np.ravel(getattr(model, what))


@pytest.mark.parametrize("path", decks(_REFUSED))
def test_a_deck_is_refused_by_name_and_line(path: Path) -> None:
    with pytest.raises(DeckError) as caught:
        mbsim.read_model(path)
    said = str(caught.value).splitlines()
    for line, words in _REFUSED.findall(path.read_text("utf-8")):
        assert any(f"{path.name}:{line}: " in each and words in each for each in said), words


@pytest.mark.parametrize(
    ("statements", "suffixes", "form"),
    [
        (STATEMENTS, (".xml",), r"<{}\b"),
        (ADAMS_STATEMENTS, (".adm", ".acf"), r"(?im)^\s*{}\b"),
    ],
    ids=["MotionSolve", "Adams"],
)
def test_every_statement_is_in_a_deck_that_runs(
    statements: Any, suffixes: tuple[str, ...], form: str
) -> None:
    texts = [p.read_text("utf-8") for p in CORPUS.iterdir() if p.suffix in suffixes]
    texts = [text for text in texts if not _REFUSED.search(text)]
    names = [each.name for each in statements]
    assert [name for name in names if not any(re.search(form.format(name), t) for t in texts)] == []


def test_every_deck_has_a_reference() -> None:
    checked = {each.values[0].name for each in (*decks(_CHECK), *decks(_SIZES), *decks(_REFUSED))}
    files = {p.name for p in CORPUS.iterdir() if p.suffix in (".xml", ".adm", ".acf")}
    assert files - checked == set(_PARTS)
