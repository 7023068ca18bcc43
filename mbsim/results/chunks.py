"""Rows in chunks of HDF5 datasets, each made once, outside HDF5, which is told where they belong.

How a chunk is stored follows from its numbers alone: not from the rows that came before it, nor
from when they were written. Where no more than a quarter of its numbers differ from those of the
row before, it is shuffled and deflated, as HDF5's filters do; else it is stored as it is: zlib
makes little of numbers that all change, and takes longer for it than a disk for all of them.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    import h5py

Table = np.ndarray[Any, Any]

#: Most bytes of a chunk: small enough for many signals, large enough for long runs.
CHUNK_BYTES = 1 << 16
#: Most rows of a chunk: so many numbers of 8 bytes.
CHUNK_ROWS = CHUNK_BYTES // 8
#: Most elements in a chunk, so that one of thousands is read without all the others.
_ELEMENTS = 64
#: A smaller chunk is stored as it is: its place in the index takes as much.
_SMALL = 512
#: Of the filters that a dataset has, none.
_AS_IT_IS = 0b11
#: It is deflated where one of so many numbers differs from that of the row before.
_CHANGED = 4
#: So long a chunk has one column.
LONG = 2048
#: How many deflated chunks of one number, or row of numbers, are remembered.
_REMEMBERED = 256


def chunk_shape(shape: tuple[int, ...], itemsize: int, rows: int) -> tuple[int, ...]:
    """Return the shape of the chunks of a dataset (n, ...), of so many rows at most.

    Columns are as many as there is room for: of long chunks each has one, so that a column that
    does not change takes no room beside others that do.
    """
    rows = max(1, min(rows, CHUNK_ROWS, CHUNK_BYTES // itemsize))
    room = CHUNK_BYTES // (rows * itemsize) if rows < LONG else 1
    columns: list[int] = []
    for size in reversed(shape[1:]):
        # the last axis has the components of a vector, which are read together
        most = min(room, _ELEMENTS) if columns else room
        columns.append(max(1, min(size, most)))
        room = room // columns[-1] if columns[-1] == size else 1
    return (rows, *reversed(columns))


class ChunkWriter:
    """Adds rows to one dataset that has chunks, shuffled and deflated where that pays.

    No chunk is written twice while the file is open: HDF5 1.14 and 2.0 then look for the second one
    where the first one was. So rows that make no whole chunk wait in `rest`.

    Parameters
    ----------
    file : h5py.File
    name : str
        Of the dataset.
    rest : ndarray, optional
        Rows that belong behind those in the file, which has whole chunks; by default those of its
        last chunk, if that is not whole.
    """

    def __init__(self, file: h5py.File, name: str, rest: Table | None = None) -> None:
        dataset = file[name]
        self._chunk = dataset.chunks
        self._type = dataset.dtype
        self._filtered = dataset.compression == "gzip" and dataset.shuffle
        self._length = len(dataset)
        if self._chunk is not None:
            # rows of a last chunk that is not whole are in the rest too
            self._length -= self._length % self._chunk[0]
        if rest is None and self._chunk is not None:
            rest = dataset[self._length :]
            # another handle knows nothing of what this one has read
            del dataset
        self.rest = rest
        self._id = file[name].id
        #: Deflated chunks whose rows are all alike, by the row.
        self._alike: dict[bytes, bytes] = {}

    def add(self, rows: Table) -> None:
        """Add rows, (n, ...) as the dataset has them."""
        if self.rest is not None and len(self.rest):
            rows = np.concatenate([self.rest, rows])
        whole = len(rows) - len(rows) % self._chunk[0]
        self._put(rows[:whole])
        # what is given is another's, who fills it anew
        self.rest = rows[whole:].copy()

    def complete(self) -> None:
        """Write rows that make no whole chunk: no others follow while the file is open."""
        if self.rest is not None and len(self.rest):
            self._put(self.rest)
            self.rest = self.rest[:0]

    def _put(self, rows: Table) -> None:
        """Write rows behind those that are in the file."""
        if not len(rows):
            return
        first = self._length
        self._length += len(rows)
        self._id.set_extent((self._length, *rows.shape[1:]))
        # HDF5 reads zeros where nothing was written
        if _holds(rows):
            for at, part in self._parts(rows):
                self._write((first + at[0], *at[1:]), part)

    def _parts(self, rows: Table) -> Iterator[tuple[tuple[int, ...], Table]]:
        """Yield the chunks of rows, and where they begin."""
        starts = [range(0, n, step) for n, step in zip(rows.shape, self._chunk, strict=True)]
        for at in product(*starts[1:], starts[0]):
            at = (at[-1], *at[:-1])
            yield at, rows[tuple(slice(k, k + n) for k, n in zip(at, self._chunk, strict=True))]

    def _write(self, at: tuple[int, ...], part: Table) -> None:
        """Write one chunk; what it has more than `part` is zero."""
        if part.shape == self._chunk:
            whole = np.ascontiguousarray(part, self._type)
        else:
            whole = np.zeros(self._chunk, self._type)
            whole[tuple(map(slice, part.shape))] = part
        packed = self._packed(whole) if self._filtered and whole.nbytes >= _SMALL else None
        if packed is None:
            self._id.write_direct_chunk(at, whole, _AS_IT_IS if self._filtered else 0)
        else:
            self._id.write_direct_chunk(at, packed, 0)

    def _packed(self, whole: Table) -> bytes | None:
        """Return a chunk as HDF5's filters make it, None where that does not pay."""
        bits = whole.reshape(-1).view("u8" if whole.itemsize % 8 == 0 else "u1")
        width = bits.size // len(whole)
        changed = np.count_nonzero(bits[width:] != bits[:-width])
        if not changed:
            row = bits[:width].tobytes()
            if row not in self._alike:
                if len(self._alike) == _REMEMBERED:
                    self._alike.clear()
                self._alike[row] = _deflated(whole)
            return self._alike[row]
        if _CHANGED * changed > bits.size:
            return None
        made = _deflated(whole)
        return made if 2 * len(made) <= whole.nbytes else None


def _deflated(whole: Table) -> bytes:
    """Return a chunk shuffled: first bytes of all numbers, then second ones; and deflated."""
    numbers = whole.reshape(-1).view("u1").reshape(-1, whole.itemsize)
    return zlib.compress(numbers.T.tobytes(), 1)


def _holds(rows: Table) -> bool:
    """Return whether anything is not the zero that HDF5 reads where nothing was written."""
    if not rows.size or rows.dtype.kind not in "fiu":
        return bool(rows.size)
    # by its bits: a negative zero is one that must be written
    bits = rows.view(f"u{rows.itemsize}")
    return bool(bits.flat[-1]) or bool(bits.any())
