"""An HDF5 file that grows in place and is published whole: readable after any crash.

The file grows as ``.<name>.h5.part``. `publish` puts a complete copy in the place of
``<name>.h5``, atomically, so that a reader, or whoever looks after a kill, finds the last
one published. HDF5 itself promises nothing of a file whose writer was killed.
"""

from __future__ import annotations

import contextlib
import errno
import os
import shutil
import time
import uuid
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsim.errors import ResultsError
from mbsim.results.files import problem, sync

if TYPE_CHECKING:
    import h5py

Table = np.ndarray[Any, Any]
Value = str | float | int
#: Bytes of a chunk: small enough for many signals, large enough for long runs.
_CHUNK = 4096


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
        self._lock = -1
        self._growing = False
        if target is None:
            name = f"mbsim-{uuid.uuid4().hex}"
            self.file: h5py.File = h5py.File(
                name, "w", driver="core", backing_store=False, block_size=1 << 20
            )
            return
        self.part = target.with_name(f".{target.name}.part")
        self.file = None
        with self._writing():
            self._take_lock()
            if resume:
                shutil.copyfile(target, self.part)
                self._growing = True
            # our own lock instead of HDF5's, which comes only after it has emptied the file
            self.file = h5py.File(self.part, "r+" if resume else "w", locking=False)

    def _take_lock(self) -> None:
        """Keep a second run out of the same files (where the system has flock)."""
        self._lock = os.open(self.part, os.O_RDWR | os.O_CREAT, 0o666)
        try:
            import fcntl
        except ImportError:
            return
        try:
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            os.close(self._lock)
            self._lock = -1
            self.broken = True  # and the part file, being another's, is left alone
            raise ResultsError(
                f"{self.target}: another run is writing there; choose another folder with -o"
            ) from None

    @contextlib.contextmanager
    def _writing(self) -> Iterator[None]:
        """Turn failures to write into one `ResultsError` that names the file."""
        try:
            yield
        except (OSError, RuntimeError) as error:
            self.abandon()
            self.failure = problem(self.target or Path("memory"), error)
            raise self.failure from None

    def abandon(self) -> None:
        """Drop the part file; what was published stays."""
        if self.broken:
            return
        self.broken = True
        if self.file is not None:
            # a file that cannot be written cannot be closed cleanly either
            with contextlib.suppress(OSError, RuntimeError):
                self.file.close()
        if self.target is not None:
            for path in (self.part, self._copy):
                with contextlib.suppress(OSError):
                    path.unlink()
        self._unlock()

    def _unlock(self) -> None:
        if self._lock >= 0:
            os.close(self._lock)
            self._lock = -1

    @property
    def _copy(self) -> Path:
        assert self.target is not None
        return self.target.with_name(f".{self.target.name}.tmp")

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
            No more rows will follow: a file written at once needs no chunks.
        """
        if self.broken:
            return
        rows, attributes = rows or {}, attributes or {}
        arrays = {name: np.asarray(value) for name, value in (values or {}).items()}
        items = [*rows.values(), *arrays.values()]
        with self._writing():
            self._reserve(sum(int(array.nbytes) for array in items), len(items) + len(attributes))
            for name in remove:
                if name in self.file:
                    del self.file[name]
            growing = self._growing or not last
            for name, array in rows.items():
                self._append(name, array, growing)
            self._growing = self._growing or bool(rows)
            for name, array in arrays.items():
                self._put(name, array)
            for name, facts in attributes.items():
                if name != "/" and name not in self.file:
                    self.file.create_group(name)
                self.file[name].attrs.update(facts)
            self._settle()

    def _reserve(self, size: int, items: int) -> None:
        """Raise OSError unless the disk has room for `size` bytes in `items` places.

        HDF5 cannot be left when it meets a full disk: it prints, and may crash at the
        close. So the room is taken before it writes.
        """
        if self.target is None:
            return
        # chunks are allocated whole, and each dataset has an index and a header
        room = size + size // 8 + items * 4 * _CHUNK + (1 << 18)
        end = os.fstat(self._lock).st_size
        if hasattr(os, "posix_fallocate"):
            try:
                os.posix_fallocate(self._lock, end, room)
                return
            except OSError as error:
                if error.errno not in (errno.EINVAL, errno.EOPNOTSUPP, errno.ENOSYS):
                    raise
        if shutil.disk_usage(self.part.parent).free < room:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    def _settle(self) -> None:
        """Bring everything to the file, and give back the room that was not used."""
        self.file.flush()
        if self.target is not None:
            os.ftruncate(self._lock, self.file.id.get_filesize())

    def _append(self, name: str, rows: Table, growing: bool) -> None:
        """Add rows to one dataset."""
        if self._growing and name in self.file:
            if len(rows):
                dataset = self.file[name]
                count = dataset.shape[0]
                dataset.resize(count + len(rows), axis=0)
                dataset[count:] = rows
        elif growing:
            width = max(1, rows.itemsize * int(np.prod(rows.shape[1:])))
            columns = (max(1, size) for size in rows.shape[1:])
            chunk = (max(1, min(1024, _CHUNK // width)), *columns)
            limits = (None, *rows.shape[1:])
            self.file.create_dataset(name, data=rows, maxshape=limits, chunks=chunk)
        else:
            self.file.create_dataset(name, data=rows)

    def _put(self, name: str, array: Table) -> None:
        """Write one dataset whole."""
        before = self.file.get(name)
        if before is not None and (before.shape, before.dtype) == (array.shape, array.dtype):
            before[...] = array
            return
        if before is not None:
            del self.file[name]
        self.file.create_dataset(name, data=array)

    def publish(self) -> None:
        """Put a complete copy in the target's place; does nothing in memory."""
        if self.broken or self.target is None:
            return
        began = time.perf_counter()
        with self._writing():
            shutil.copyfile(self.part, self._copy)
            sync(self._copy)
            os.replace(self._copy, self.target)
        self.publish_seconds = time.perf_counter() - began

    def finish(self) -> h5py.File | None:
        """Make the part file the target; return the file where it is kept in memory."""
        if self.broken:
            return None
        if self.target is None:
            return self.file
        with self._writing():
            self.file.close()
            sync(self.part)
            os.replace(self.part, self.target)
        self.broken = True  # there is nothing left to write to
        self._unlock()
        return None
