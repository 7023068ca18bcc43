"""Results in memory read as those of a file do, under the same names."""

from __future__ import annotations

import pickle
from pathlib import Path

import numpy as np
import pytest

from helpers.fake_run import SETTINGS, add_rows, fake_system
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
