"""What a store keeps of rows, block after block, and what it does without."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from mbsim.results.store import Store

ROWS = 40_000
NOISE = np.random.default_rng(3).normal(size=(ROWS, 3))
NOTHING = np.zeros((ROWS, 3))
LATE = np.vstack([np.zeros((777, 3)), NOISE[777:]])
SINGLE = NOTHING.copy()
SINGLE[4_321, 1] = 5e-324
NEGATIVE = -NOTHING


def written(target: Path, blocks: list[np.ndarray[Any, Any]], resume: bool) -> Any:
    """Return a dataset, as it reads and as it is stored, that got those blocks."""
    store = Store(target)
    store.rows = ROWS * len(blocks)
    for k, block in enumerate(blocks):
        if resume and k == len(blocks) // 2:
            store.publish()
            store.abandon()
            store = Store(target, resume=True)
        store.update(rows={"x": block})
    file = store.finish()
    if file is None:
        file = h5py.File(target, "r")
    with file:
        return file["x"][()], file["x"].id.get_storage_size()


@pytest.mark.parametrize("kind", ["file", "resumed"])
@pytest.mark.parametrize(
    "blocks",
    [
        [NOISE, NOTHING, NOISE],
        [NOTHING, NOTHING, LATE, NOTHING],
        [NOTHING[:1], LATE, NEGATIVE],
        [NOTHING, SINGLE],
        [NOISE[:5], NOTHING[:3_000], NOISE[:7]],
        [NOTHING[:0], np.ones((9, 3)), NOTHING[:0], NOTHING],
    ],
)
def test_rows_read_as_they_were_to_the_sign_of_zero(
    tmp_path: Path, kind: str, blocks: list[np.ndarray[Any, Any]]
) -> None:
    found, _ = written(tmp_path / "a.h5", blocks, kind == "resumed")
    assert found.tobytes() == np.vstack(blocks).tobytes()


def test_what_is_zero_takes_no_room_and_no_number_is_compressed_for_it(tmp_path: Path) -> None:
    assert written(tmp_path / "a.h5", [NOTHING] * 3, False)[1] == 0
    # chunks of 64 kB, of which the first and the last hold what is not zero
    _, size = written(tmp_path / "b.h5", [NOTHING, NOISE, NOTHING], False)
    assert NOISE.nbytes < size < NOISE.nbytes + 3 * (1 << 16)


def test_a_row_an_output_time_is_stored_in_long_chunks(tmp_path: Path) -> None:
    store = Store(tmp_path / "a.h5")
    store.rows = 10**6
    whole = np.arange(10, dtype=np.int64)
    store.update(rows={"state/incident_offsets": whole, "state/y": NOISE[:10]})
    store.finish()
    with h5py.File(tmp_path / "a.h5", "r") as file:
        for name in ("state/incident_offsets", "state/y"):
            rows = file[name].chunks[0]
            assert rows * file[name][:1].nbytes > 60_000
