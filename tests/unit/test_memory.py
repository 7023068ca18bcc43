"""Results in memory read as those of a file do, under the same names."""

from __future__ import annotations

import pickle
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import mbsim
from helpers.fake_run import SETTINGS, add_rows, fake_system
from helpers.folders import MODELS
from mbsim.errors import ResultsError
from mbsim.results.memory import MemoryStore
from mbsim.results.reading import Results
from mbsim.results.recorder import Recorder


def of_run(tmp_path: Path, folder: Path | None) -> Results:
    system = fake_system(tmp_path / "deck")
    recorder = Recorder(system, SETTINGS, folder)
    for first in range(3):
        add_rows(system, first * 4, 4)
        recorder.take()
    return recorder.close("finished", {"steps": 12}, system.scene.log.contacts)


def test_memory_and_file_hold_the_same(tmp_path: Path) -> None:
    with of_run(tmp_path, None) as held, of_run(tmp_path, tmp_path / "out") as stored:
        assert held.keys() == stored.keys()
        assert held.signals() == stored.signals()
        for name in stored:
            np.testing.assert_array_equal(held[name], stored[name], strict=True)
        assert held.attributes == stored.attributes
        for group in ("graphics", "bodies"):
            tables = held.tables(group), stored.tables(group)
            assert tables[0].keys() == tables[1].keys()
            for name, table in tables[0].items():
                np.testing.assert_array_equal(table, tables[1][name])
        assert held.stats == stored.stats
        for group in ("bodies", "contacts", "requests"):
            assert held.ids(group) == stored.ids(group)


def test_rows_are_copies_of_what_was_given_and_copies_are_read() -> None:
    store = MemoryStore()
    rows = np.arange(6.0).reshape(3, 2)
    store.update(rows={"a/x": rows})
    store.update(rows={"a/x": rows[:1]})
    rows[:] = -1.0
    file = store.finish()
    assert file is not None
    read_once = file["a/x"][:]
    read_once[:] = -2.0
    assert file["a/x"][:, 0].tolist() == [0.0, 2.0, 4.0, 0.0]
    assert file["a/x"].name == "/a/x"


def test_what_fails_in_the_middle_leaves_nothing_that_looks_whole() -> None:
    store = MemoryStore()
    with pytest.raises(ZeroDivisionError), store.writing():
        raise ZeroDivisionError
    assert store.finish() is None
    store = MemoryStore()
    with pytest.raises(ResultsError, match="not enough memory"), store.writing():
        raise MemoryError
    assert store.failure is not None


def test_pickled_results_are_whole_and_closed_ones_say_so(tmp_path: Path) -> None:
    held = of_run(tmp_path, None)
    again = pickle.loads(pickle.dumps(held))
    held.close()
    assert held.closed
    with pytest.raises(ResultsError, match="closed"):
        held["time"]
    assert len(again["time"]) == 12
    assert isinstance(again, Results)


def test_what_a_run_was_made_of_is_what_it_was_made_of(tmp_path: Path) -> None:
    """Digests and tables are made where they are looked at, and files and models may change."""
    script = tmp_path / "law.py"
    deck = tmp_path / "ball.xml"
    text = (MODELS / "bowling_ball.xml").read_text()
    named = text.split('script_name="')[1].split('"')[0]
    shutil.copy(MODELS / named, script)
    deck.write_text(text.replace(named, "law.py"))
    kinds = ("system_sha256", "subroutines_sha256", "settings_sha256", "checkpoint_sha256")
    model = mbsim.read_model(deck)
    with mbsim.simulate(model, end_time=0.05) as first:
        expected = {kind: first.attributes[kind] for kind in kinds}
        markers = first.tables("graphics")
    with mbsim.simulate(model, end_time=0.05) as later:
        model.bodies[2] = replace(model.bodies[2], mass=50.0)
        del model.markers[20]
        script.write_text(script.read_text() + "\n# another\n")
        assert {kind: later.attributes[kind] for kind in kinds} == expected
        assert later.tables("graphics").keys() == markers.keys()
        np.testing.assert_array_equal(later.tables("graphics")["shapes"], markers["shapes"])


def test_signals_that_are_made_later_are_those_of_a_file(tmp_path: Path) -> None:
    model = mbsim.read_model(MODELS / "bowling_ball.xml")
    with (
        mbsim.simulate(model, end_time=0.1) as held,
        mbsim.simulate(model, end_time=0.2),
        mbsim.simulate(model, end_time=0.1, output=tmp_path) as stored,
    ):
        assert held.keys() == stored.keys()
        for name in stored:
            np.testing.assert_array_equal(held[name], stored[name], strict=True)
        taken = held["bodies/2/position"]
        taken[:] = 0.0  # a copy, and no part of the state from which others are made
        np.testing.assert_array_equal(held["state/y"], stored["state/y"])
        copy = pickle.loads(pickle.dumps(held))
        np.testing.assert_array_equal(copy["contacts/301/force"], stored["contacts/301/force"])
        assert copy.attributes == held.attributes
