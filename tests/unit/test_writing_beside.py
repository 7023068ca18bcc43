"""Rows that another thread writes while the loop goes on: what fails there, and how much waits."""

from __future__ import annotations

import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from helpers.fake_run import SETTINGS, add_rows, checkpoint, fake_system
from mbsim.errors import ResultsError
from mbsim.results.background import Background
from mbsim.results.chunks import ChunkWriter
from mbsim.results.reading import open_results
from mbsim.results.recorder import Recorder

#: Rows of a block, as few as there are, and of the whole run.
BLOCK, ROWS = 16, 200


@pytest.fixture(autouse=True)
def small_blocks(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let a block be some rows."""
    monkeypatch.setattr("mbsim.results.recorder.BUFFER_BYTES", 8000)


def recorder_of(folder: Path, resume: bool = False) -> Recorder:
    """Return a recorder of a fake run."""
    return Recorder(fake_system(folder / "deck"), SETTINGS, folder, resume=resume)


def go_on(recorder: Recorder, first: int, look: Callable[[], None] = lambda: None) -> None:
    """Record rows up to the last one."""
    for k in range(first, ROWS, 5):
        add_rows(recorder.system, k, 5)
        recorder.take()
        look()


def close(recorder: Recorder, status: str = "finished") -> None:
    """End a run."""
    recorder.close(status, {"steps": 1}, recorder.system.scene.log.contacts).close()


def numbers(folder: Path) -> tuple[str, list[float]]:
    """Return the status of a result and the numbers of its rows, which all signals have."""
    with open_results(folder / "deck.h5") as results:
        found: list[float] = results["bodies/2/position/x"].tolist()
        assert {len(results[name]) for name in results.signals()} == {len(found)}
        return results.status, found


def failing(plain: Any, call: int, error: Exception) -> Any:
    """Return `plain`, of which the given call in another thread than this one fails."""
    main, left = threading.current_thread(), call

    def called(*given: Any, **named: Any) -> Any:
        nonlocal left
        if threading.current_thread() is not main:
            left -= 1
            if left == 0:
                raise error
        return plain(*given, **named)

    return called


@pytest.mark.parametrize("error", [MemoryError(), RuntimeError("HDF5 fails"), TypeError("wrong")])
@pytest.mark.parametrize("call", [1, 2, 7, 30, 61])
def test_no_rows_follow_those_that_failed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, error: Exception, call: int
) -> None:
    """Whichever dataset fails: the last flush stays, and the run goes on from it."""
    recorder = recorder_of(tmp_path)
    add_rows(recorder.system, 0, 10)
    recorder.take()
    recorder.flush(checkpoint(10))
    with monkeypatch.context() as patch:
        patch.setattr(ChunkWriter, "add", failing(ChunkWriter.add, call, error))
        expected = TypeError if isinstance(error, TypeError) else ResultsError
        with pytest.raises(expected, match=r"memory|HDF5 fails|wrong"):
            go_on(recorder, 10)
    # as `simulate` does behind a failure
    recorder.take()
    recorder.flush(checkpoint(0))
    with pytest.raises(ResultsError, match=r"memory|HDF5 fails|wrong"):
        close(recorder, "failed")
    assert numbers(tmp_path) == ("running", list(range(10)))
    again = recorder_of(tmp_path, resume=True)
    assert again.checkpoint["stage"] == 10
    go_on(again, 10)
    close(again)
    assert numbers(tmp_path) == ("finished", list(range(ROWS)))


def test_rows_that_fail_before_they_are_written_are_missed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What is made of rows for the file may fail too."""
    recorder = recorder_of(tmp_path)
    made = failing(Recorder._signals, 2, MemoryError())
    monkeypatch.setattr(Recorder, "_signals", made)
    with pytest.raises(ResultsError, match="there is not enough memory"):
        go_on(recorder, 0)
    with pytest.raises(ResultsError, match="there is not enough memory"):
        close(recorder, "failed")
    assert not (tmp_path / "deck.h5").exists()


def test_a_system_without_more_threads(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Rows are written before the loop goes on, and the file is the same."""
    files = []
    for name in ("beside", "before"):
        recorder = recorder_of(tmp_path / name)
        go_on(recorder, 0)
        close(recorder)
        assert numbers(tmp_path / name) == ("finished", list(range(ROWS)))
        files.append((tmp_path / name / "deck.h5").read_bytes())

        def none_left(thread: threading.Thread) -> None:
            raise RuntimeError("can't start new thread")

        monkeypatch.setattr(threading.Thread, "start", none_left)
    assert files[0] == files[1]


def test_a_loop_faster_than_the_disk_waits(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """At most one block is on its way, however long a disk takes: until it is waited for here."""
    asked: list[threading.Event] = []
    begin, wait = Background.begin, Background.wait

    def late(background: Background, work: Callable[[], None]) -> None:
        event = threading.Event()

        def work_late() -> None:
            assert event.wait(60.0)
            work()

        begin(background, work_late)
        asked.append(event)

    def told(background: Background) -> None:
        for event in asked:
            event.set()
        wait(background)

    monkeypatch.setattr(Background, "begin", late)
    monkeypatch.setattr(Background, "wait", told)
    recorder = recorder_of(tmp_path)
    most = 0

    def look() -> None:
        nonlocal most
        most = max(most, recorder._gathered.rows)

    go_on(recorder, 0, look)
    close(recorder)
    assert len(asked) == ROWS // BLOCK
    assert most < BLOCK
    assert numbers(tmp_path) == ("finished", list(range(ROWS)))


@pytest.mark.parametrize(
    ("output", "resume"), [("memory", False), ("folder", False), ("folder", True)]
)
def test_rows_that_are_dropped_again_are_not_kept_in_memory(
    tmp_path: Path, output: str, resume: bool
) -> None:
    """They are written like others, and the file begins anew without them."""
    system = fake_system(tmp_path / "deck")
    folder = tmp_path if output == "folder" else None
    if resume:
        first = Recorder(system, SETTINGS, folder)
        add_rows(system, 0, 1)
        first.take()
        first.flush(checkpoint(0))
        first.abandon()
    recorder = Recorder(system, SETTINGS, folder, resume=resume)
    if not resume:
        add_rows(system, 0, 1)
        recorder.take()
    recorder.mark()
    before = recorder.watch.saved()
    for k in range(1000, 1000 + ROWS, 5):
        add_rows(system, k, 5)
        recorder.take()
        assert recorder._gathered.rows < BLOCK
    add_rows(system, 2000, 3)
    recorder.go_back()
    assert {name: table.tolist() for name, table in recorder.watch.saved().items()} == {
        name: table.tolist() for name, table in before.items()
    }
    for first_row in range(1, ROWS):
        add_rows(system, first_row, 1, events=False)
        recorder.take()
    results = recorder.close("finished", {}, system.scene.log.contacts)
    with results:
        assert results["bodies/2/position/x"].tolist() == list(range(ROWS))
        assert results["state/incident_offsets"].tolist()[-1] == len(results["state/incidents"])
        assert results["events"]["time"].max() < 1.0
    if folder:
        assert not [path for path in folder.iterdir() if path.name.startswith(".")]


def published(folder: Path, beside: bool) -> tuple[bytes, list[int]]:
    """Record a run that is published after every fifth row; return its file, and the flushes."""
    recorder = recorder_of(folder)
    counts = []

    def look() -> None:
        recorder.flush(checkpoint(7), beside)
        counts.append(recorder.flushes)

    go_on(recorder, 0, look)
    close(recorder)
    return (folder / "deck.h5").read_bytes(), counts


def test_flushes_beside_the_loop_change_no_byte(tmp_path: Path) -> None:
    beside, _ = published(tmp_path / "beside", True)
    before, counts = published(tmp_path / "before", False)
    assert beside == before
    assert counts == list(range(1, ROWS // 5 + 1))
    assert numbers(tmp_path / "beside") == ("finished", list(range(ROWS)))


def test_rows_go_on_while_results_are_published(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What was published holds the rows up to the flush, though others have come meanwhile."""
    recorder, go = recorder_of(tmp_path), threading.Event()
    plain = Recorder._flush

    def late(self: Recorder, *given: Any) -> None:
        assert go.wait(60.0)
        plain(self, *given)

    monkeypatch.setattr(Recorder, "_flush", late)
    add_rows(recorder.system, 0, 10)
    recorder.take()
    recorder.flush(checkpoint(10), beside=True)
    assert not recorder.due()
    assert not recorder.flushes
    add_rows(recorder.system, 10, 5)
    recorder.take()
    go.set()
    recorder._background.wait()
    assert recorder.flushes == 1
    assert numbers(tmp_path) == ("running", list(range(10)))
    go_on(recorder, 15)
    close(recorder)
    assert numbers(tmp_path) == ("finished", list(range(ROWS)))


@pytest.mark.parametrize("name", ["_put", "_save", "_show"])
def test_a_flush_that_fails_beside_is_told_when_rows_come(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    """The flush before it stays, and the run goes on from there."""
    recorder = recorder_of(tmp_path)
    add_rows(recorder.system, 0, 10)
    recorder.take()
    recorder.flush(checkpoint(10))
    with monkeypatch.context() as patch:
        patch.setattr(Recorder, name, failing(getattr(Recorder, name), 1, MemoryError()))
        add_rows(recorder.system, 10, 3)
        recorder.take()
        recorder.flush(checkpoint(13), beside=True)
        assert recorder._background._thread is not None
        recorder._background._thread.join()
        add_rows(recorder.system, 13, 3)
        with pytest.raises(ResultsError, match="memory"):
            recorder.take()
    with pytest.raises(ResultsError, match="memory"):
        close(recorder, "failed")
    assert numbers(tmp_path) == ("running", list(range(10)))
    again = recorder_of(tmp_path, resume=True)
    assert again.checkpoint["stage"] == 10
    go_on(again, 10)
    close(again)
    assert numbers(tmp_path) == ("finished", list(range(ROWS)))
