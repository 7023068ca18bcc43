"""An HDF5 file that grows in place and is published whole: readable after any crash.

The file grows hidden, see `part_file`; `publish` puts it in the place of ``<name>.h5``,
atomically, so that a reader, or whoever looks after a kill, finds the last one published.
"""

from __future__ import annotations

import contextlib
import time
import uuid
import zlib
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsim.errors import ResultsError
from mbsim.results.files import RunLock, problem
from mbsim.results.part_file import PartFile

if TYPE_CHECKING:
    import h5py

Table = np.ndarray[Any, Any]
Value = str | float | int
#: Most bytes of a chunk: small enough for many signals, large enough for long runs.
_CHUNK = 1 << 16
#: Rows of a chunk where nobody knows how many there will be: events, points of contact.
_FEW = 256
#: Groups whose datasets do not have a row an output time.
_UNKNOWN = ("events", "state")
#: Most elements in a chunk, so that one of thousands is read without all the others.
_ELEMENTS = 64
#: A signal is compressed where its first rows, up to so many bytes of them, shrink to this share:
#: zlib is fast on constants and zeros, and slow on noise, of which it makes little.
_SAMPLE, _SHARE = 1 << 16, 0.25
#: Room that stays free beside rows for tables, the log and HDF5's own.
_SPARE = 1 << 18


class Store:
    """One HDF5 file being written; `target` None keeps it in memory.

    With `resume` it begins as a copy of what `target` holds. The first failure to write
    raises `ResultsError` and drops the part file; what was published stays. After that
    every call does nothing, so that the caller may still clean up.
    """

    def __init__(self, target: Path | None, resume: bool = False) -> None:
        import h5py

        self.target = target
        self.broken = False
        self.failure: ResultsError | None = None
        self.publish_seconds = 0.0
        #: How many rows signals will have; chunks are not longer.
        self.rows = _FEW
        self._growing = resume
        self._part: PartFile | None = None
        self._lock: RunLock | None = None
        self.file: h5py.File | None = None
        if target is None:
            name = f"mbsim-{uuid.uuid4().hex}"
            self.file = h5py.File(name, "w", driver="core", backing_store=False, block_size=1 << 20)
            return
        try:
            self._lock = RunLock(target)
        except ResultsError:
            self.broken = True  # what is there is another's
            raise
        except OSError as error:
            self.broken = True
            raise problem(target, error) from None
        with self._writing():
            self._part = PartFile(target, resume)
            self.file = h5py.File(self._part, "r+" if resume else "w")

    @contextlib.contextmanager
    def _writing(self) -> Iterator[h5py.File]:
        """Turn failures to write into one `ResultsError` that names the file."""
        try:
            yield self.file
            if self._part is not None:
                self._part.check()
        except (OSError, RuntimeError, ValueError, KeyError) as error:
            first = self._part.failure if self._part is not None else None
            if first is None and isinstance(error, (ValueError, KeyError)):
                raise
            self.abandon()
            self.failure = problem(self.target or Path("memory"), first or error)
            raise self.failure from None

    def abandon(self) -> None:
        """Drop the part file; what was published stays."""
        if self.broken:
            return
        self.broken = True
        if self._part is not None:
            self._part.close()
        if self.file is not None:
            # what HDF5 still has to write goes nowhere
            with contextlib.suppress(OSError, RuntimeError, ValueError):
                self.file.close()
        self._unlock()

    def stop(self, reason: str) -> None:
        """Publish what is there as the last, and raise why nothing more can be written."""
        assert self.target is not None
        self.finish()
        if self.failure is None:
            self.failure = ResultsError(f"{self.target}: results cannot be written: {reason}")
        raise self.failure

    def _unlock(self) -> None:
        if self._lock is not None:
            self._lock.release()

    def room(self) -> int | None:
        """Return how many bytes of rows the disk takes yet; None in memory."""
        if self._part is None or self.broken:
            return None
        # chunks are allocated whole, and each dataset has an index and a header
        return int((self._part.room() - _SPARE) / 1.125)

    def update(
        self,
        rows: Mapping[str, Table] | None = None,
        values: Mapping[str, Any] | None = None,
        attributes: Mapping[str, Mapping[str, Any]] | None = None,
        remove: Iterable[str] = (),
        last: bool = False,
    ) -> None:
        """Change the file in one go.

        Parameters
        ----------
        rows : mapping
            Rows to add to the datasets of these names, made at their first rows.
        values : mapping
            Datasets to write whole, in the place of those of their names.
        attributes : mapping of mapping
            Attributes of datasets and of groups, which are made if they are not there.
        remove : iterable of str
            Datasets and groups to take out, if they are there.
        last : bool
            No more rows will follow: chunks are as long as the rows.
        """
        if self.broken:
            return
        rows, attributes = rows or {}, attributes or {}
        with self._writing() as file:
            for name in remove:
                if name in file:
                    del file[name]
            growing = self._growing or not last
            for name, array in rows.items():
                self._append(file, name, array, growing)
            self._growing = self._growing or bool(rows)
            for name, value in (values or {}).items():
                self._put(file, name, np.asarray(value))
            for name, facts in attributes.items():
                if name != "/" and name not in file:
                    file.create_group(name)
                file[name].attrs.update({key: _text(value) for key, value in facts.items()})
            file.flush()

    def _append(self, file: h5py.File, name: str, rows: Table, growing: bool) -> None:
        """Add rows to one dataset."""
        if self._growing and name in file:
            if len(rows):
                dataset = file[name]
                if dataset.maxshape[0] is not None:
                    raise OSError(f"/{name} takes no more rows")
                count = dataset.shape[0]
                dataset.resize(count + len(rows), axis=0)
                dataset[count:] = rows
            return
        if not growing and (self.target is None or not rows.size):
            file.create_dataset(name, data=rows)
            return
        elements = tuple(max(1, size) for size in rows.shape[1:])
        if len(elements) > 1:
            elements = (min(elements[0], _ELEMENTS), *elements[1:])
        width = rows.itemsize * int(np.prod(elements))
        likely = self.rows if name.partition("/")[0] not in _UNKNOWN else max(_FEW, len(rows))
        count = max(1, min(likely, _CHUNK // max(1, width)))
        file.create_dataset(
            name,
            data=rows,
            maxshape=(None, *rows.shape[1:]) if growing else None,
            chunks=(count if growing else max(1, min(count, len(rows))), *elements),
            fletcher32=True,
            **_compression(rows),
        )

    def _put(self, file: h5py.File, name: str, array: Table) -> None:
        """Write one dataset whole."""
        before = file.get(name)
        if before is not None and (before.shape, before.dtype) == (array.shape, array.dtype):
            before[...] = array
            return
        if before is not None:
            del file[name]
        file.create_dataset(name, data=array)

    def publish(self) -> None:
        """Put what is written in the target's place; does nothing in memory."""
        if self.broken or self._part is None:
            return
        began = time.perf_counter()
        with self._writing():
            self._part.publish()
        self.publish_seconds = time.perf_counter() - began

    def finish(self) -> h5py.File | None:
        """Make the part file the target; return the file where it is kept in memory."""
        if self.broken:
            return None
        if self._part is None:
            return self.file
        with self._writing() as file:
            file.close()
            self._part.publish(last=True)
        self.broken = True  # there is nothing left to write to
        self._unlock()
        return None


def _text(value: Any) -> Any:
    """Return a text as HDF5 takes it: bytes of file names that are no text as escapes."""
    if isinstance(value, str):
        return value.encode("utf-8", "backslashreplace").decode("utf-8")
    return value


def _compression(rows: Table) -> dict[str, Any]:
    """Return how a signal that begins with these rows is compressed, if at all."""
    wanted = max(1, _SAMPLE // max(1, rows[:1].nbytes))
    sample = np.ascontiguousarray(rows[:: max(1, len(rows) // wanted)][:wanted])
    if sample.nbytes < 4096:
        return {}
    # as HDF5's filter does: first bytes of all numbers, then second ones
    shuffled = sample.view(np.uint8).reshape(-1, sample.itemsize).T.tobytes()
    if len(zlib.compress(shuffled, 1)) > _SHARE * len(shuffled):
        return {}
    return {"compression": "gzip", "compression_opts": 1, "shuffle": True}
