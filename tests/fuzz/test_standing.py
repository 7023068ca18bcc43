"""The standing fuzz judges a few decks; `python -m helpers.standing` in tests judges thousands."""

from __future__ import annotations

import numpy as np
import pytest
from lxml import etree

import mbsim
from helpers import fuzz_scenes, random_decks, standing
from helpers.invariances import CHANGES
from mbsim.errors import SolverError

#: One of each scene, with different methods.
QUICK = (0, 1, 4, 7, 10, 15)


def test_a_deck_follows_from_its_seed():
    assert fuzz_scenes.deck_of(3) == fuzz_scenes.deck_of(3)
    assert fuzz_scenes.deck_of(3)[0] != fuzz_scenes.deck_of(4)[0]
    # in other units it is another text of the same bodies
    text, said, units, _ = fuzz_scenes.deck_of(3)
    other = fuzz_scenes.deck_of(3, (units + 1) % len(random_decks.UNITS))
    assert other[0] != text
    assert other[1] == said


@pytest.mark.parametrize("name", CHANGES)
def test_a_change_says_where_bodies_begin(name, tmp_path):
    """The first row is known without a run: a wrong change would blame the program for it."""
    for seed in (1, 4, 7):
        case = standing.Case(seed, tmp_path, tol=1e-3)
        root = etree.fromstring(case.text.encode())
        turned = CHANGES[name](np.random.default_rng(seed), root, case.scale)
        text = etree.tostring(root, encoding="unicode")
        assert name == "longer" or text != case.text
        found = case.run(name, text, case.method, 1e-3)
        long = {b: (p * case.scale, R) for b, (p, R) in case.poses.items()}
        there = {b: (p / case.scale, R) for b, (p, R) in turned(long).items()}
        seen = standing.poses_of(found, standing.ids_of(text))
        assert standing.apart(there, seen)[0] < 1e-9


@pytest.mark.parametrize("seed", QUICK)
def test_a_deck_stands_its_checks(seed, tmp_path):
    verdict = standing.judge(seed, tmp_path)
    assert all(kind == "told" for kind, _ in verdict["offences"]), verdict
    assert verdict["runs"] == 5


@pytest.mark.slow
def test_a_contact_whose_direction_jumps_is_named(tmp_path):
    """Steps of 1e-10 behind a jump of the force's direction end the run, at that contact."""
    case = standing.Case(122, tmp_path, tol=1e-7)
    with pytest.raises(SolverError, match=r"no progress at time 0\.1.*Force_Contact\[1\]"):
        mbsim.simulate(case.text, integrator="RADAU5", tol=1e-7)


def test_a_run_goes_on_with_its_journal(tmp_path, monkeypatch, capsys):
    journal = tmp_path / "fuzz.jsonl"
    judged = []
    monkeypatch.setattr(
        standing,
        "judge",
        lambda seed, *_: judged.append(seed) or {"seed": seed, "deck": "", "offences": []},
    )
    for stop in (2, 4):
        given = ["standing.py", "--stop", str(stop), "--journal", str(journal)]
        monkeypatch.setattr("sys.argv", given)
        standing.main()
    assert judged == [0, 1, 2, 3]
    assert capsys.readouterr().out == ""
