"""What a result folder holds whatever happens: one run, checked numbers, what fitted."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from helpers.dying import Killed, dying
from helpers.fake_run import SETTINGS, add_rows, checkpoint, fake_system
from mbsim.errors import ModelError, ResultsError
from mbsim.results.blocks import Gathered, first_rows
from mbsim.results.checksums import end_of, sums_of
from mbsim.results.chunks import LONG
from mbsim.results.part_file import PartFile
from mbsim.results.reading import end_state, open_results
from mbsim.results.recorder import Recorder
from mbsim.results.resume import completed
from mbsim.results.store import Store


def recording(folder: Path, rows: int = 10, **options: Any) -> Recorder:
    """Return a recorder that has taken rows of a fake run."""
    system = fake_system(folder / "deck")
    recorder = Recorder(system, SETTINGS, folder, **options)
    add_rows(system, 0, rows)
    recorder.take()
    return recorder


def close(recorder: Recorder, **options: Any) -> None:
    """End a run."""
    log = recorder.system.scene.log.contacts
    recorder.close("finished", {"steps": 1}, log, **options).close()


def test_one_changed_number_in_a_checkpoint_is_refused(tmp_path: Path) -> None:
    recorder = recording(tmp_path)
    recorder.flush(checkpoint(10))
    recorder.abandon()
    whole = (tmp_path / "deck.h5").read_bytes()
    with h5py.File(tmp_path / "deck.h5", "r") as file:
        names: list[str] = []
        group = file["checkpoint"]
        group.visit(lambda n: names.append(n) if hasattr(group[n], "size") else None)
        names = [name for name in names if group[name].size]
    assert len(names) > 3
    for name in names:
        (tmp_path / "deck.h5").write_bytes(whole)
        with h5py.File(tmp_path / "deck.h5", "r+") as file:
            table = file[f"checkpoint/{name}"]
            raw = bytearray(np.asarray(table[()]).tobytes())
            raw[0] ^= 1
            table[...] = np.frombuffer(bytes(raw), dtype=table.dtype).reshape(table.shape)
        # HDF5 has cut the checksums off
        changed = (tmp_path / "deck.h5").read_bytes()
        with pytest.raises(ModelError, match="has no checksums"):
            Recorder(fake_system(tmp_path / "deck"), SETTINGS, tmp_path, resume=True)
        (tmp_path / "deck.h5").write_bytes(changed + end_of(sums_of(changed), len(changed)))
        with pytest.raises(ModelError, match="checkpoint is damaged"):
            Recorder(fake_system(tmp_path / "deck"), SETTINGS, tmp_path, resume=True)


def test_a_damaged_signal_is_told(tmp_path: Path) -> None:
    system = fake_system(tmp_path / "deck")
    recorder = Recorder(system, SETTINGS, tmp_path)
    recorder.check_room(600)
    for k in range(10):
        add_rows(system, 60 * k, 60)
        recorder.take()
    close(recorder)
    with h5py.File(tmp_path / "deck.h5", "r") as file:
        chunk = file["contacts/force"].id.get_chunk_info(0)
    assert chunk.size > 3 * 4096
    with (tmp_path / "deck.h5").open("r+b") as raw:
        raw.seek(chunk.byte_offset + chunk.size // 2)
        raw.write(b"\x42")
    with open_results(tmp_path / "deck.h5") as results:
        assert len(results["bodies/2/velocity"]) == 600
        with pytest.raises(ResultsError, match="damaged"):
            results["contacts/301/force"]


def test_a_rerun_leaves_nothing_of_the_old_one(tmp_path: Path) -> None:
    for name in ("deck.csv", "deck.log"):
        (tmp_path / name).write_text("old")
    close(recording(tmp_path))
    recorder = recording(tmp_path)
    (tmp_path / "deck.log").write_text("old")
    # until there is a first row to see, the old run is whole
    assert (tmp_path / "deck.log").exists()
    recorder.flush(checkpoint(10))
    assert not (tmp_path / "deck.log").exists()
    assert not (tmp_path / "deck.csv").exists()
    with open_results(tmp_path / "deck.h5") as results:
        assert results.status == "running"


def test_finished_is_written_last(tmp_path: Path) -> None:
    seen = []

    def write_log() -> None:
        assert (tmp_path / "deck.csv").is_file()
        with open_results(tmp_path / "deck.h5") as results:
            seen.append(results.status)

    recorder = recording(tmp_path)
    recorder.flush(checkpoint(10))
    close(recorder, write_log=write_log)
    assert seen == ["running"]
    with open_results(tmp_path / "deck.h5") as results:
        assert results.status == "finished"
        assert not results.has_checkpoint


def test_a_run_whose_log_fails_can_go_on(tmp_path: Path) -> None:
    def write_log() -> None:
        raise ResultsError("deck.log: no space left on device")

    recorder = recording(tmp_path)
    with pytest.raises(ResultsError, match=r"deck\.log"):
        close(recorder, checkpoint=lambda: checkpoint(10), write_log=write_log)
    with open_results(tmp_path / "deck.h5") as results:
        assert (results.status, len(results["time"])) == ("interrupted", 10)
    close(Recorder(fake_system(tmp_path / "deck"), SETTINGS, tmp_path, resume=True))
    with open_results(tmp_path / "deck.h5") as results:
        assert (results.status, len(results["time"])) == ("finished", 10)


def test_a_missing_csv_is_written_again(tmp_path: Path) -> None:
    recorder = recording(tmp_path)
    close(recorder)
    text = (tmp_path / "deck.csv").read_text()
    model = recorder.system.model
    assert completed(model, tmp_path, print) is None
    (tmp_path / "deck.csv").unlink()
    # of another model's results nothing is made
    assert completed(model, tmp_path, print) is None
    with h5py.File(tmp_path / "deck.h5", "r+") as file:
        file.attrs["model_sha256"] = model.sha256
    results = completed(model, tmp_path, lambda line: None)
    assert results is not None
    results.close()
    assert (tmp_path / "deck.csv").read_text() == text


@pytest.mark.parametrize("flushed", [0, 5])
def test_what_fits_on_a_full_disk_is_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, flushed: int
) -> None:
    system = fake_system(tmp_path / "deck")
    recorder = Recorder(system, SETTINGS, tmp_path)
    if flushed:
        add_rows(system, 0, flushed)
        recorder.take()
        recorder.flush(checkpoint(flushed))
    add_rows(system, flushed, 60 - flushed)
    recorder.take()
    size = sum(table.nbytes for _, table in recorder._signals(recorder._gathered.block))
    monkeypatch.setattr(PartFile, "room", lambda part: (1 << 18) + int(0.7 * size))
    with pytest.raises(ResultsError, match=r"no space left on device; rows up to time \d"):
        close(recorder)
    with open_results(tmp_path / "deck.h5") as results:
        n = len(results["time"])
        assert flushed + 20 < n < 50
        np.testing.assert_array_equal(results["bodies/2/position/x"], np.arange(n))
        assert len(results["state/incident_offsets"]) == n + 1
        assert len(results["state/incidents"]) == results["state/incident_offsets"][-1]
        assert results.status == "failed"
    assert not list(tmp_path.glob(".deck*"))


def test_only_what_was_asked_is_recorded(tmp_path: Path) -> None:
    close(recording(tmp_path, asked=["bodies/*/position", "/contacts/301/force/x", "energy"]))
    with open_results(tmp_path / "deck.h5") as results:
        assert set(results.signals()) == {
            *("time", "bodies/2/position", "contacts/301/force", "requests/7"),
            *("energy/kinetic", "energy/potential", "energy/dissipated"),
        }
        assert "state/y" not in results
        assert end_state(results) == {"2": {"position": [9.0, 0.0, 0.108]}}


def test_what_cannot_be_recorded_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ModelError, match=r"--signals bodies/3/position: .* bodies/2/position"):
        recording(tmp_path, asked=["bodies/3/position", "time"])
    assert not (tmp_path / "deck.h5").exists()


def bytes_of(
    folder: Path, monkeypatch: pytest.MonkeyPatch, flushes: set[int], rows: int, at_once: int
) -> bytes:
    """Return the file of a run whose rows come in pieces, published after some of them."""
    with monkeypatch.context() as patch:
        patch.setattr("mbsim.results.recorder.BUFFER_BYTES", 8000)
        patch.setattr("mbsim.results.recorder.FEWEST_ROWS", at_once)
        system = fake_system(folder / "deck")
        recorder = Recorder(system, SETTINGS, folder)
        recorder.check_room(20 * rows + 1)
    for k in range(20 * rows // 3):
        add_rows(system, 3 * k, 3)
        recorder.take()
        if k in flushes:
            recorder.flush(checkpoint(3 * k + 3))
            assert numbers(folder) == list(range(3 * k + 3))
    close(recorder)
    return (folder / "deck.h5").read_bytes()


# two rows at once; as many as chunks of one column have, which are written from where rows lie
@pytest.mark.parametrize(("rows", "at_once"), [(3, 2), (300, LONG)])
def test_when_a_run_was_published_changes_no_byte(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, rows: int, at_once: int
) -> None:
    straight = bytes_of(tmp_path / "straight", monkeypatch, set(), rows, at_once)
    assert numbers(tmp_path / "straight") == list(range(20 * rows))
    last = 20 * rows // 3
    every = set(range(0, last, rows // 3))
    for name, flushes in {"first": {0}, "some": {1, 2, last - 11}, "all": every}.items():
        found = bytes_of(tmp_path / name, monkeypatch, flushes, rows, at_once)
        assert (len(found), found) == (len(straight), straight)


def test_rows_that_could_not_be_written_beside_the_loop_are_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By the next thing that is asked of the recorder; what was published stays."""
    monkeypatch.setattr("mbsim.results.recorder.BUFFER_BYTES", 8000)
    recorder = recording(tmp_path, 10)
    recorder.flush(checkpoint(10))
    monkeypatch.setattr(PartFile, "room", lambda part: (1 << 18) + 100)
    add_rows(recorder.system, 10, 40)

    def go_on() -> None:
        for k in range(50, 400, 10):
            recorder.take()
            add_rows(recorder.system, k, 10)

    with pytest.raises(ResultsError, match="no space left on device"):
        go_on()
    recorder.abandon()
    assert numbers(tmp_path) == list(range(10))


def test_rows_come_as_they_were_given_however_many_at_once(tmp_path: Path) -> None:
    """What is gathered, let go, gathered again in tables that are used in turn."""
    for order in (False, True):
        system = fake_system(tmp_path / "deck")
        gathered, seen, free = Gathered(system, 50, order), [], {}
        for k in range(60):
            add_rows(system, 7 * k, 7)
            gathered.take(*map(int, system.scene.rows.used))
            system.scene.rows.used[:] = 0
            while gathered.rows >= 50:
                gathered.take_back(free)
                block = first_rows(gathered.block, 50)
                free = gathered.hand_over(block)
                seen.append(block.y[:, 0].copy())
        seen.append(gathered.block.y[:, 0])
        np.testing.assert_array_equal(np.concatenate(seen), np.arange(420.0))


def test_a_resumed_run_that_is_published_before_a_chunk_is_whole(tmp_path: Path) -> None:
    first = Recorder(fake_system(tmp_path / "deck"), SETTINGS, tmp_path)
    first.check_room(200)
    add_rows(first.system, 0, 3)
    first.take()
    first.flush(checkpoint(3))
    first.abandon()
    again = Recorder(fake_system(tmp_path / "deck"), SETTINGS, tmp_path, resume=True)
    again.check_room(200)
    for k in range(3, 51, 3):
        add_rows(again.system, k, 3)
        again.take()
        if k % 2:
            again._write()
        again.flush(checkpoint(k + 3))
        assert numbers(tmp_path) == list(range(k + 3))
    close(again)
    assert numbers(tmp_path) == list(range(51))


def test_a_full_disk_keeps_no_fewer_rows_than_the_checkpoint_knows(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    recorder = recording(tmp_path, 50)
    recorder.flush(checkpoint(50))
    with monkeypatch.context() as patch:
        patch.setattr(PartFile, "room", lambda part: (1 << 18) + 4000)
        with pytest.raises(ResultsError, match=r"no space left on device.*--resume goes on"):
            close(recorder)
    assert numbers(tmp_path) == list(range(50))
    again = Recorder(fake_system(tmp_path / "deck"), SETTINGS, tmp_path, resume=True)
    assert again.checkpoint["stage"] == 50
    again.abandon()


def test_files_with_a_dataset_a_body_stay_readable(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "old.h5", "w") as file:
        file.attrs.update(mbsim_version="0.1.0", status="finished")
        file["time"] = np.arange(3.0)
        for id in (2, 10):
            for name, width in (("position", 3), ("quaternion", 4)):
                file[f"bodies/{id}/{name}"] = np.full((3, width), float(id))
            for name in ("velocity", "angular_velocity"):
                file[f"bodies/{id}/{name}"] = np.zeros((3, 3))
            file[f"bodies/{id}"].attrs["label"] = f"ball {id}"
        file["joints/5/force"] = np.ones((3, 3))
        file["joints/5"].attrs["type"] = "REVOLUTE"
        file["contacts/301/peak_force"] = 7.0
    with open_results(tmp_path / "old.h5") as results:
        assert results.ids("bodies") == [2, 10]
        assert results.label("bodies/10") == "ball 10"
        assert results.attribute("joints/5", "type") == "REVOLUTE"
        assert results["contacts/301/peak_force"] == 7.0
        np.testing.assert_array_equal(results["bodies/10/position/z"], [10, 10, 10])
        assert results.find("bodies/*/position/x") == [
            "bodies/2/position/x",
            "bodies/10/position/x",
        ]
        assert end_state(results)["2"]["quaternion"] == [2.0] * 4


def test_paths_by_id_and_whole_tables(tmp_path: Path) -> None:
    close(recording(tmp_path))
    with open_results(tmp_path / "deck.h5") as results:
        assert results["bodies/position"].shape == (10, 1, 3)
        np.testing.assert_array_equal(
            results["bodies/position"][:, 0], results["bodies/2/position"]
        )
        np.testing.assert_array_equal(results["bodies/id"], [2])
        assert results["contacts/penetration"].shape == (10, 1)
        np.testing.assert_array_equal(
            results["contacts/301/penetration"], results["contacts/penetration"][:, 0]
        )
        assert "bodies/id" not in results.keys()
        assert "bodies/3/position" not in results


def numbers(folder: Path) -> list[float]:
    """Return what says which rows a result has, after looking at what belongs to them."""
    with open_results(folder / "deck.h5") as results:
        n, offsets = len(results["time"]), results["state/incident_offsets"]
        assert len(offsets) == n + 1
        assert len(results["state/incidents"]) == offsets[-1]
        np.testing.assert_array_equal(results["requests/7"][:, 1], results["bodies/2/position/x"])
        found: list[float] = results["bodies/2/position/x"].tolist()
        return found


def test_a_run_goes_on_after_a_full_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    recorder = recording(tmp_path, 5)
    system = recorder.system
    recorder.flush(checkpoint(5))
    add_rows(system, 5, 40)
    recorder.take()
    size = sum(table.nbytes for _, table in recorder._signals(recorder._gathered.block))
    with monkeypatch.context() as patch:
        patch.setattr(PartFile, "room", lambda part: (1 << 18) + int(0.7 * size))
        with pytest.raises(ResultsError, match=r"rows up to time \d.*--resume goes on"):
            close(recorder)
    assert 20 < len(numbers(tmp_path)) < 45
    system = fake_system(tmp_path / "deck")
    again = Recorder(system, SETTINGS, tmp_path, resume=True)
    assert again.checkpoint["stage"] == 5
    add_rows(system, 5, 55)
    again.take()
    close(again)
    assert numbers(tmp_path) == list(range(60))
    with open_results(tmp_path / "deck.h5") as results:
        assert results.status == "finished"
        assert len(results["events"]) == 4


def test_a_run_that_goes_on_needs_room_for_the_rest(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    recorder = recording(tmp_path, 50)
    size = sum(table[0].nbytes for _, table in recorder._signals(recorder._gathered.block))
    recorder.flush(checkpoint(50))
    recorder.abandon()
    again = Recorder(fake_system(tmp_path / "deck"), SETTINGS, tmp_path, resume=True)
    monkeypatch.setattr(PartFile, "room", lambda part: (1 << 18) + int(1.125 * 12 * size))
    again.check_room(60.0)
    with pytest.raises(ModelError, match="15 output rows"):
        again.check_room(65.0)
    again.abandon()


def test_one_that_goes_on_while_another_does(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Which finishes after the other has read the checkpoint, before it has the lock."""
    recorder = recording(tmp_path, 10)
    recorder.flush(checkpoint(10))
    recorder.abandon()

    def goes_on() -> None:
        system = fake_system(tmp_path / "deck")
        found = Recorder(system, SETTINGS, tmp_path, resume=True)
        add_rows(system, 10, 10)
        found.take()
        close(found)
        assert numbers(tmp_path) == list(range(20))

    def late(target: Path, resume: bool) -> Store:
        monkeypatch.undo()
        goes_on()
        return Store(target, resume)

    monkeypatch.setattr("mbsim.results.recorder.Store", late)
    goes_on()


def test_a_disk_without_room_leaves_the_earlier_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    log = tmp_path / "deck.log"
    close(recording(tmp_path), write_log=lambda: log.write_text("old") and None)
    before = {path.name: path.read_bytes() for path in tmp_path.glob("deck.*")}
    assert len(before) == 3
    recorder = recording(tmp_path, 20)
    monkeypatch.setattr(PartFile, "room", lambda part: 0)
    with pytest.raises(ResultsError, match=r"no space left on device$"):
        recorder.flush(checkpoint(20))
    with pytest.raises(ResultsError, match=r"no space left on device$"):
        close(recorder, write_log=lambda: log.write_text("new") and None)
    assert {path.name: path.read_bytes() for path in tmp_path.glob("deck.*")} == before


@pytest.mark.parametrize("flushes", [0, 1])
@pytest.mark.parametrize("name", ["fsync", "replace", "unlink", "open"])
def test_a_killed_rerun_never_mixes_two_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, flushes: int
) -> None:
    call, ended = 0, False
    while not ended:
        call += 1
        folder = tmp_path / f"{call}"
        log = folder / "deck.log"
        close(recording(folder), write_log=lambda log=log: log.write_text("10") and None)
        recorder = recording(folder, 20)
        with monkeypatch.context() as patch:
            patch.setattr(os, name, dying(getattr(os, name), call))
            try:
                for _ in range(flushes):
                    recorder.flush(checkpoint(20))
                close(
                    recorder,
                    checkpoint=lambda: checkpoint(20),
                    write_log=lambda log=log: log.write_text("20") and None,
                )
                ended = True
            except Killed:
                pass
        rows = len(numbers(folder))
        beside = [path for path in (log, folder / "deck.csv") if path.exists()]
        assert rows in (10, 20)
        if log in beside:
            assert log.read_text() == str(rows)
        if log.with_suffix(".csv") in beside:
            assert len(log.with_suffix(".csv").read_text().splitlines()) == rows + 1
        with open_results(folder / "deck.h5") as results:
            whole = results.status == "finished" and rows == 20
            assert results.has_checkpoint == (rows == 20 and not whole)
        assert len(beside) == 2 or not whole
        recorder.abandon()
    assert call > 1
