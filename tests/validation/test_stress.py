"""Decks at the ends of what may be asked for: how they end, and that faults would be seen."""

from __future__ import annotations

import multiprocessing

import numpy as np
import pytest
from click.testing import CliRunner

from mbsim.bench.stress import Asked, chosen, contacts, judge, table, workers
from mbsim.bench.stress.case import Case
from mbsim.cli.main import main
from mbsim.errors import ModelError

FAMILIES = tuple(dict.fromkeys(case.deck.family for case in chosen(Asked())))


def case_of(family, name, integrator="DOPRI5", tol=1e-5):
    """Return a case by its names."""
    asked = Asked((family,), (integrator,), (tol,))
    return next(case for case in chosen(asked) if case.deck.name == name)


def test_there_are_cases_of_every_kind():
    cases = chosen(Asked())
    assert len(cases) >= 500
    assert len({case.name for case in cases}) == len(cases)
    assert {case.integrator for case in cases} == {
        *("AUTO", "DOPRI5", "DOP853", "RADAU5", "GALPHA", "MOREAU")
    }
    assert all(len({case.tol for case in chosen(Asked((family,)))}) >= 3 for family in FAMILIES)
    with pytest.raises(ModelError, match="not known; there are stiffness, damping"):
        chosen(Asked(("strength",)))


@pytest.mark.slow
@pytest.mark.parametrize("family", FAMILIES)
def test_no_case_ends_wrong_without_a_word(family):
    asked = Asked((family,))
    found = list(workers.verdicts(chosen(asked), asked, 2, 60.0))
    assert [table.line(entry) for entry in found if entry.ended in judge.FAULTS] == []


@pytest.mark.parametrize(
    ("family", "name"),
    [
        ("stiffness", "k=1e+15"),
        ("Painleve", "mu=1.5 angle=1"),
        ("thin and fast", "ball on a sheet, 100 m/s"),
        ("wedged", "half angle 0.02 mu=0"),
        ("at once", "row e=1 gap=0"),
    ],
)
def test_hard_cases_end_right(tmp_path, family, name):
    found = judge.judge(case_of(family, name), tmp_path, 60.0)
    assert found.ended == judge.RIGHT, found.reason
    assert found.steps > 5


def test_a_wrong_number_without_a_word_is_a_fault(tmp_path):
    """A ball that is said to fall through other air than it does."""
    case = case_of("stiffness", "k=1e+07")
    other = contacts.rebound(0.1, 0.05)
    wrong = case.deck._replace(check=lambda motion, tol: other(shifted(motion), tol))
    found = judge.judge(case._replace(deck=wrong), tmp_path, 60.0)
    assert found.ended == judge.SILENT
    assert found.reason.startswith("rebound ")


def shifted(motion):
    """Return rows whose energy grows by a hundredth."""
    return motion._replace(kinetic=motion.kinetic * np.linspace(1.0, 1.01, len(motion.time)))


def test_energy_that_comes_from_nowhere_is_a_fault(tmp_path):
    case = case_of("overlap", "ball 0.05 m")
    found = judge.judge(case, tmp_path, 60.0)
    assert found.ended == judge.RIGHT
    forgotten = case._replace(deck=case.deck._replace(stored=0.5 * case.deck.stored))
    assert judge.judge(forgotten, tmp_path, 60.0).ended == judge.SILENT


def test_what_a_method_does_not_take_is_refused_and_what_takes_too_long_said(tmp_path):
    joints = case_of("folding", "crank 0.5 at 1 rad/s")
    refused = judge.judge(Case(joints.deck, "VERLET", 1e-5), tmp_path, 60.0)
    assert refused.ended == judge.REFUSED
    assert "VERLET" in refused.reason
    late = judge.judge(case_of("stiffness", "k=10000"), tmp_path, -1.0)
    assert late.ended == judge.HANG


def test_a_process_that_dies_costs_its_case_alone():
    asked = Asked(("stiffness",), ("DOPRI5",), (1e-5,))
    cases = chosen(asked)
    coming = workers.verdicts(cases, asked, 1, 60.0)
    first = next(coming)
    for child in multiprocessing.active_children():
        child.kill()
    found = [first, *coming]
    assert len(found) == len(cases)
    assert [entry.ended for entry in found].count(judge.TRACEBACK) == 1
    assert all(entry.ended in (judge.RIGHT, judge.TRACEBACK) for entry in found)


def test_the_command_writes_a_table_and_its_exit_code_tells_of_faults(tmp_path, monkeypatch):
    def made(cases, asked, count, limit):
        assert asked == Asked(("spin",), ["DOP853"], [1e-5])
        yield from (judge.verdict(case, judge.RIGHT, worst=0.5) for case in cases[1:])
        yield judge.verdict(cases[0], ends.pop(), "place 2 of 1 allowed")

    monkeypatch.setattr(workers, "verdicts", made)
    words = ["bench", "--stress", "spin", "--tol", "1e-5", "--integrator", "dop853"]
    ends = [judge.SILENT, judge.TOLD]
    for code in (0, 1):
        done = CliRunner().invoke(main, [*words, "-o", str(tmp_path)])
        assert done.exit_code == code, done.output
        assert "place 2 of 1 allowed" in (tmp_path / "stress.md").read_text()
        rows = (tmp_path / "stress.csv").read_text().splitlines()
        assert len(rows) == 1 + len(chosen(Asked(("spin",), ("DOP853",), (1e-5,))))


@pytest.mark.parametrize("option", [["--no-peers"], ["--repeats", "3"]])
def test_options_that_stress_does_not_have_are_refused(option, tmp_path):
    done = CliRunner().invoke(main, ["bench", "--stress", "spin", *option, "-o", str(tmp_path)])
    assert done.exit_code == 2
    assert f"leave out {option[0]}" in done.output
    assert list(tmp_path.iterdir()) == []
