"""A changed byte of a published file is told before HDF5's library believes it."""

from __future__ import annotations

import os
import random
import sys
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from helpers.fake_run import SETTINGS, add_rows, checkpoint, fake_system
from mbsim.errors import ModelError, ResultsError
from mbsim.results import checksums
from mbsim.results.checksums import BLOCK, MAGIC, CheckedFile, end_of, sums_at_end, sums_of
from mbsim.results.reading import open_results
from mbsim.results.recorder import Recorder


def published(folder: Path) -> Path:
    """Return the file of a run that goes on, published three times."""
    system = fake_system(folder / "deck")
    recorder = Recorder(system, SETTINGS, folder)
    for first in (0, 40, 80):
        add_rows(system, first, 40)
        recorder.take()
        recorder.flush(checkpoint(first + 40))
    recorder.abandon()
    return folder / "deck.h5"


def contents(path: Path) -> dict[str, Any]:
    """Return all that is in a file."""
    with open_results(path) as results:
        found = {name: np.asarray(results[name]).tobytes() for name in results.keys()}
        tables = results.tables("checkpoint")
        return found | results.attributes | {name: tables[name].tobytes() for name in tables}


def test_every_changed_byte_is_told_or_changes_nothing(tmp_path: Path) -> None:
    path = published(tmp_path)
    whole, before = path.read_bytes(), contents(path)
    chance = random.Random(7)
    told = 0
    for _ in range(150):
        at = chance.randrange(len(whole))
        data = bytearray(whole)
        data[at] ^= 1 << chance.randrange(8)
        path.write_bytes(data)
        try:
            assert contents(path) == before
        except ResultsError as error:
            told += 1
            assert "damaged" in str(error) or "not those that were written" in str(error)
    # what nobody reads may be anything: room that HDF5 has kept or given back
    assert told > 60


@pytest.mark.parametrize("at", [0, 9, 44, 100, 800, 2000, 5000])
def test_a_damaged_file_is_not_gone_on_with(tmp_path: Path, at: int) -> None:
    path = published(tmp_path)
    data = bytearray(path.read_bytes())
    data[at] ^= 0x10
    path.write_bytes(data)
    with pytest.raises((ModelError, ResultsError), match=r"damaged|cannot be read"):
        Recorder(fake_system(tmp_path / "deck"), SETTINGS, tmp_path, resume=True)
    assert path.read_bytes() == data


def test_a_damaged_chunk_that_nobody_reads_is_not_gone_on_with(tmp_path: Path) -> None:
    path = published(tmp_path)
    with h5py.File(path, "r") as file:
        place = file["bodies/position"].id.get_chunk_info(0).byte_offset
    data = bytearray(path.read_bytes())
    data[place + 3] ^= 1
    path.write_bytes(data)
    with pytest.raises((ModelError, ResultsError), match="damaged"):
        Recorder(fake_system(tmp_path / "deck"), SETTINGS, tmp_path, resume=True)
    assert sorted(p.name for p in tmp_path.glob(".*")) == []


@pytest.mark.parametrize("size", [0, 1, BLOCK - 1, BLOCK, BLOCK + 1, 3 * BLOCK + 17])
def test_the_end_says_what_is_before_it(tmp_path: Path, size: int) -> None:
    data = random.Random(size).randbytes(size)
    path = tmp_path / "a"
    path.write_bytes(data + end_of(sums_of(data), size))
    file = CheckedFile(path)
    assert file.checked
    assert file.read() == data
    file.seek(size // 2)
    buffer = bytearray(b"x" * (size + 9))
    assert file.readinto(buffer) == len(buffer)
    assert buffer.rstrip(b"\0") == data[size // 2 :].rstrip(b"\0")
    file.close()


@pytest.mark.parametrize("kept", [3, 8, 19, 21, 40])
def test_a_file_that_lost_its_beginning_or_its_middle_is_refused(tmp_path: Path, kept: int) -> None:
    data = bytes(3 * BLOCK)
    whole = data + end_of(sums_of(data), len(data))
    path = tmp_path / "a"
    path.write_bytes(whole[-kept:])
    if kept < len(MAGIC) + 12:
        assert not CheckedFile(path).checked
        return
    with pytest.raises(checksums.DamagedError, match="longer or shorter"):
        CheckedFile(path)


@pytest.mark.skipif(sys.platform == "win32", reason="has no FIFOs")
def test_what_is_no_file_is_refused_at_once(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "a")
    for place in (tmp_path / "a", tmp_path):
        with pytest.raises(OSError, match=r"no regular file|directory"):
            CheckedFile(place)


def test_files_without_checksums_stay_readable(tmp_path: Path) -> None:
    path = published(tmp_path)
    before = contents(path)
    with path.open("r+b") as file:
        found = sums_at_end(file.fileno())
        assert found is not None
        file.truncate(found[1])
    assert contents(path) == before
    # what HDF5 would change there it would believe first
    with pytest.raises(ModelError, match="has no checksums"):
        Recorder(fake_system(tmp_path / "deck"), SETTINGS, tmp_path, resume=True)


@pytest.mark.parametrize("shape", [(20_000, 2, 3), (20_000,), (20_000, 2)])
def test_zeros_take_no_room_and_are_read_without_checksums_too(
    tmp_path: Path, shape: tuple[int, ...]
) -> None:
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        file.attrs["mbsim_version"] = "0.1.0"
        file["time"] = np.arange(20_000.0)
        file["bodies/id"] = [2, 3]
        file.create_dataset("bodies/position", shape, "f8", chunks=True)
        file.create_dataset("bodies/velocity", (20_000, 2**30), "f8", chunks=True)
    with open_results(path) as results:
        values = results["bodies/position" if len(shape) == 1 else "bodies/2/position"]
        assert len(values) == 20_000
        assert not values.any()
        with pytest.raises(ResultsError, match="larger than what"):
            results["bodies/velocity"]
