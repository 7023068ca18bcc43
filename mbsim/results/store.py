"""An HDF5 file that grows in place and is published whole: readable after any crash.

The file grows hidden, see `part_file`; `publish` puts it in the place of ``<name>.h5``,
atomically, so that a reader, or whoever looks after a kill, finds the last one published.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np

from mbsim.errors import ResultsError
from mbsim.results.chunks import CHUNK_ROWS, ChunkWriter, chunk_shape
from mbsim.results.files import RunLock, problem
from mbsim.results.part_file import PartFile

if TYPE_CHECKING:
    import h5py

Table = np.ndarray[Any, Any]
Value = str | float | int
#: Rows of a chunk where nobody knows how many there will be: events, points of contact.
_FEW = 256
#: Datasets that do not have a row an output time.
_UNKNOWN = ("events", "state/incidents", "contact_points/")
#: All rows of a run that take no more than this [bytes] are stored without chunks.
_SMALL = 1 << 12
#: Most bytes, as in the file, of indices that HDF5 keeps in memory while it writes.
_INDEX_BYTES = 1 << 19
#: What a disk, HDF5 or a lack of memory raises.
_OUTSIDE = (OSError, RuntimeError, MemoryError)
#: Room that stays free beside rows for tables, the log and HDF5's own.
_SPARE = 1 << 18


class Store:
    """One HDF5 file being written.

    With `resume` it begins as a copy of what `target` holds. The first failure to write
    raises `ResultsError` and drops the part file; what was published stays. After that
    every call does nothing, so that the caller may still clean up.
    """

    def __init__(self, target: Path, resume: bool = False) -> None:
        self.target = target
        self.broken = False
        self.failure: ResultsError | None = None
        #: How many rows signals will have, and how many come at once; chunks are not longer.
        self.rows, self.rows_at_once = _FEW, CHUNK_ROWS
        self._growing = resume
        self._writers: dict[str, ChunkWriter] = {}
        #: Where a passing state is written: what is restored behind it.
        self._changed = resume  # since the file was opened
        self._before: tuple[bool, dict[str, Table | None]] | None = None
        self._part: PartFile | None = None
        self._lock: RunLock | None = None
        self.file: h5py.File | None = None
        try:
            self._lock = RunLock(target)
        except ResultsError:
            self.broken = True  # what is there is another's
            raise
        except OSError as error:
            self.broken = True
            raise problem(target, error) from None
        self._open(target, resume)

    def _open(self, target: Path, resume: bool) -> None:
        """Open a part file, empty or with what `target` holds."""
        with self.writing():
            self._part = PartFile(target, resume)
            self.file = _opened(self._part, "r+" if resume else "w")

    def begin_anew(self, resume: bool) -> None:
        """Drop all that was written since this was made; nothing was published since."""
        if self.broken:
            return
        self._writers.clear()
        self._growing = self._changed = resume
        self._before = None
        assert self.file is not None
        assert self._part is not None
        self._part.close()
        # what HDF5 still has to write goes nowhere
        with contextlib.suppress(OSError, RuntimeError, ValueError):
            self.file.close()
        self._open(self.target, resume)

    @contextlib.contextmanager
    def writing(self) -> Iterator[h5py.File]:
        """Turn failures to write into one `ResultsError` that names the file.

        Whatever is raised in it, nothing is written any more: some datasets may have rows that
        others lack, and rows that were to be written may be nowhere else.
        """
        if self.broken:
            yield self.file
            return
        try:
            yield self.file
            if self._part is not None and not self.broken:
                self._part.check()
        except Exception as error:
            if self.broken or isinstance(error, ResultsError):
                self.abandon()
                raise
            first = self._part.failure if self._part is not None else None
            self.abandon()
            self.failure = problem(self.target, first or error)
            if first is None and not isinstance(error, _OUTSIDE):
                raise
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

    def stop(self, reason: str) -> NoReturn:
        """Publish what is there as the last, and raise why nothing more can be written."""
        self.finish()
        self.fail(reason)

    def fail(self, reason: str) -> NoReturn:
        """Drop what is not published, and raise why nothing more can be written."""
        self.abandon()
        if self.failure is None:
            self.failure = ResultsError(f"{self.target}: results cannot be written: {reason}")
        raise self.failure

    def shorten(self, length: Callable[[str], int]) -> None:
        """Let the datasets that grow end after so many rows, `length` taking their names."""

        def shortened(name: str, item: Any) -> None:
            if getattr(item, "maxshape", ())[:1] == (None,) and len(item) > length(name):
                item.resize(length(name), axis=0)

        self._writers.clear()
        with self.writing() as file:
            file.visititems(shortened)

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
        constants: Mapping[str, Callable[[], Table]] | None = None,
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
        constants : mapping
            What makes datasets that are written once, compressed where they are not small.
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
        if attributes and self._changed and self._part is not None and self._before is None:
            # HDF5 puts texts where it remembers room: only while the file is open
            with self.writing():
                self._reopen({name: writer.rest for name, writer in self._writers.items()})
        self._changed = True
        with self.writing() as file:
            for name in remove:
                if name in file:
                    del file[name]
            growing = self._growing or not last
            for name, array in rows.items():
                self._append(file, name, array, growing)
            self._growing = self._growing or bool(rows)
            for name, value in (values or {}).items():
                self._put(file, name, np.asarray(value))
            for name, make in (constants or {}).items():
                table = make()
                how = {"compression": "gzip", "shuffle": True} if table.nbytes > _SMALL else {}
                file.create_dataset(name, data=table, **how)
            for name, facts in attributes.items():
                if name != "/" and name not in file:
                    file.create_group(name)
                file[name].attrs.update({key: _text(value) for key, value in facts.items()})
            file.flush()

    def sum_ahead(self) -> None:
        """Make the checksums of what is written by now."""
        if not self.broken and self._part is not None:
            with self.writing():
                self._part.sum_ahead()

    def complete(self) -> None:
        """Write all rows that are held back; none follow, but behind a publication."""
        if not self.broken:
            with self.writing() as file:
                for writer in self._writers.values():
                    writer.complete()
                file.flush()

    def _append(self, file: h5py.File, name: str, rows: Table, growing: bool) -> None:
        """Add rows to one dataset."""
        if name not in self._writers:
            found = self._growing and name in file
            if not found and not growing and rows.nbytes <= _SMALL:
                file.create_dataset(name, data=rows)
                return
            if not found:
                self._make(file, name, rows, growing)
            self._writers[name] = ChunkWriter(file, name)
        self._writers[name].add(rows)

    def _make(self, file: h5py.File, name: str, rows: Table, growing: bool) -> None:
        """Make a dataset for rows like these, without any."""
        likely = min(self.rows, self.rows_at_once) if not name.startswith(_UNKNOWN) else _FEW
        file.create_dataset(
            name,
            (0, *rows.shape[1:]),
            rows.dtype,
            maxshape=(None, *rows.shape[1:]),
            chunks=chunk_shape(
                rows.shape, rows.itemsize, likely if growing else min(likely, len(rows))
            ),
            compression="gzip",
            compression_opts=1,
            shuffle=True,
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

    def mark(self) -> None:
        """Let what is written from here to the next publication be in that one alone.

        The file goes on from here after it, byte by byte: when it was published changes nothing.
        """
        if self.broken or self._part is None:
            return
        with self.writing() as file:
            file.flush()
            self._part.mark()
        rests = {name: writer.rest for name, writer in self._writers.items()}
        self._before = self._growing, rests

    def publish(self) -> None:
        """Put what is written in the target's place; does nothing in memory."""
        if self.broken or self._part is None:
            return
        if self._before is None:
            self.mark()
        assert self._before is not None
        self.complete()
        with self.writing() as file:
            file.close()
            self._part.publish()
            # what HDF5 knew of the file is wrong now
            self._growing, rests = self._before
            self._before = None
            self._reopen(rests)

    def _reopen(self, rests: dict[str, Table | None]) -> None:
        """Open the part file anew, with rows that wait for a whole chunk."""
        assert self.file is not None
        assert self._part is not None
        self._writers.clear()
        self.file.close()
        file = self.file = _opened(self._part, "r+")
        self._writers = {name: ChunkWriter(file, name, rests[name]) for name in rests}
        self._changed = False

    def finish(self) -> h5py.File | None:
        """Make the part file the target; return the file where it is kept in memory."""
        if self.broken:
            return None
        self.complete()
        if self._part is None:
            # a dataset opened anew reads chunks as they were stored; one that stays open may not
            self._writers.clear()
            return self.file
        with self.writing() as file:
            self._writers.clear()
            file.close()
            self._part.publish(last=True)
        self.broken = True  # there is nothing left to write to
        self._unlock()
        return None


def _opened(part: PartFile, mode: str) -> h5py.File:
    """Open a part file."""
    import h5py

    file = h5py.File(part, mode)
    # HDF5 keeps nodes of its indices at many times their size in the file: 0.7 kB a chunk
    memory = file.id.get_mdc_config()
    memory.set_initial_size = True
    memory.initial_size = memory.min_size = memory.max_size = _INDEX_BYTES
    file.id.set_mdc_config(memory)
    return file


def _text(value: Any) -> Any:
    """Return a text as HDF5 takes it: bytes of file names that are no text as escapes."""
    if isinstance(value, str):
        return value.encode("utf-8", "backslashreplace").decode("utf-8")
    return value
