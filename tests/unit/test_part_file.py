"""A published result file is whole at every instant, and publishing costs what is new."""

from __future__ import annotations

import os
from pathlib import Path

import h5py
import numpy as np
import pytest

from helpers.dying import Killed, dying
from mbsim.errors import ResultsError
from mbsim.results import part_file
from mbsim.results.files import RunLock, locked
from mbsim.results.part_file import PartFile
from mbsim.results.reading import open_results


def grow(target: Path, flushes: int, rows: int = 50) -> tuple[PartFile, h5py.File]:
    """Publish so many states of a file, each with `rows` rows more."""
    part = PartFile(target)
    file = h5py.File(part, "w")
    file.attrs["mbsim_version"] = "test"
    file.create_dataset("x", (0, 3), "f8", maxshape=(None, 3), chunks=(16, 3), fletcher32=True)
    for _ in range(flushes):
        add(file, rows)
        part.publish()
    return part, file


def add(file: h5py.File, rows: int) -> None:
    """Append rows that are as long as their number."""
    count = len(file["x"])
    file["x"].resize(count + rows, axis=0)
    file["x"][count:] = np.arange(count, count + rows)[:, None] + [0.0, 0.25, 0.5]
    file.flush()


def rows_of(target: Path) -> int:
    """Return how many rows a published file has, all of which are right."""
    with open_results(target) as results:
        x = results["x"]
    # as readers do that know nothing of the checksums
    with h5py.File(target, "r") as file:
        np.testing.assert_array_equal(x, file["x"][()])
    np.testing.assert_array_equal(x, np.arange(len(x))[:, None] + [0.0, 0.25, 0.5])
    return len(x)


def test_every_published_state_is_whole(tmp_path: Path) -> None:
    target = tmp_path / "a.h5"
    part, file = grow(target, 0)
    for k in range(1, 12):
        add(file, 7 * k)
        before = rows_of(target) if k > 1 else 0
        part.publish()
        assert rows_of(target) == before + 7 * k
    file.close()
    part.publish(last=True)
    assert rows_of(target) == 7 * sum(range(1, 12))
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.h5"]


def test_two_files_take_turns(tmp_path: Path) -> None:
    part, file = grow(tmp_path / "a.h5", 2)
    inodes = []
    for _ in range(4):
        inodes.append(os.stat(tmp_path / "a.h5").st_ino)
        add(file, 5)
        part.publish()
    assert inodes[0] == inodes[2] != inodes[1] == inodes[3]


def test_publishing_copies_what_is_new(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    part, file = grow(tmp_path / "a.h5", 2, rows=40_000)
    copied: list[int] = []
    plain = part_file._copy

    def counted(source: int, target: int, first: int, end: int) -> None:
        copied.append(end - first)
        plain(source, target, first, end)

    monkeypatch.setattr(part_file, "_copy", counted)
    add(file, 10)
    part.publish()
    whole = (tmp_path / "a.h5").stat().st_size
    # a chunk, its place in the index, the size of the dataset
    assert 240 <= sum(copied) < 0.02 * whole


def test_a_reader_keeps_the_state_it_opened(tmp_path: Path) -> None:
    part, file = grow(tmp_path / "a.h5", 2)
    with open_results(tmp_path / "a.h5") as results:
        for _ in range(5):
            add(file, 50)
            part.publish()
        x = results["x"]
    np.testing.assert_array_equal(x, np.arange(100)[:, None] + [0.0, 0.25, 0.5])
    assert rows_of(tmp_path / "a.h5") == 350


@pytest.mark.parametrize(
    "name", ["fsync", "link", "replace", "open", "pwrite", "ftruncate", "close"]
)
def test_a_kill_at_any_call_leaves_an_old_or_a_new_state(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    call, ended = 0, False
    while not ended:
        call += 1
        target = tmp_path / f"{call}.h5"
        part, file = grow(target, 3)
        add(file, 50)
        with monkeypatch.context() as patch:
            patch.setattr(os, name, dying(getattr(os, name), call))
            try:
                part.publish()
                ended = True
            except Killed:
                pass
        assert rows_of(target) in (150, 200)
        # what the killed writer left does not keep the next one out
        later = PartFile(target, resume=True)
        again = h5py.File(later, "r+")
        add(again, 1)
        again.close()
        later.publish(last=True)
        assert rows_of(target) in (151, 201)
    assert call > 1


def test_a_disk_that_fails_leaves_what_was_published(tmp_path: Path) -> None:
    part, file = grow(tmp_path / "a.h5", 2)
    part.failure = OSError(28, "No space left on device")
    add(file, 1000)
    with pytest.raises(OSError, match="No space"):
        part.publish()
    part.close()
    file.close()
    assert rows_of(tmp_path / "a.h5") == 100
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.h5"]


def test_nothing_is_written_through_links(tmp_path: Path) -> None:
    other = tmp_path / "other"
    other.write_text("mine")
    (tmp_path / ".a.h5.part").symlink_to(other)
    part, file = grow(tmp_path / "a.h5", 1)
    file.close()
    part.publish(last=True)
    assert other.read_text() == "mine"
    (tmp_path / ".b.h5.lock").symlink_to(other)
    with pytest.raises(OSError, match="symbolic links"):
        RunLock(tmp_path / "b.h5")
    assert other.read_text() == "mine"


def test_one_run_at_a_time(tmp_path: Path) -> None:
    first = RunLock(tmp_path / "a.h5")
    with pytest.raises(ResultsError, match="another run is writing there"):
        RunLock(tmp_path / "a.h5")
    # one that opened the lock file before it was taken away, and locks it after
    late = os.open(first.path, os.O_RDWR)
    first.release()
    assert locked(late)
    second = RunLock(tmp_path / "a.h5")
    with pytest.raises(ResultsError):
        RunLock(tmp_path / "a.h5")
    second.release()
    os.close(late)
    assert not list(tmp_path.iterdir())
