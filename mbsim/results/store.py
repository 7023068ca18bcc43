"""An HDF5 file that grows in place and is published whole: readable after any crash.

The file grows as ``.<name>.h5.part``. `publish` puts a complete copy in the place of
``<name>.h5``, atomically, so that a reader, or whoever looks after a kill, finds the last
one published. HDF5 itself promises nothing of a file whose writer was killed.
"""

from __future__ import annotations

import contextlib
import os
import shutil
import time
import uuid
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsim.errors import ResultsError
from mbsim.results.files import problem, sync

if TYPE_CHECKING:
    import h5py

Value = str | float | int
#: Bytes of a chunk: small enough for many signals, large enough for long runs.
_CHUNK = 8192


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
            raise problem(self.target or Path("memory"), error) from None

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

    def append(self, rows: Mapping[str, np.ndarray[Any, Any]], last: bool = False) -> None:
        """Add rows to the datasets of these names, made at their first rows.

        `last` says that no more will follow: a file written at once needs no chunks.
        """
        if self.broken:
            return
        growing = self._growing or not last
        with self._writing():
            for name, values in rows.items():
                if self._growing and name in self.file:
                    dataset = self.file[name]
                    count = dataset.shape[0]
                    dataset.resize(count + len(values), axis=0)
                    dataset[count:] = values
                elif growing:
                    width = max(1, values.itemsize * int(np.prod(values.shape[1:])))
                    chunk = (max(1, min(1024, _CHUNK // width)), *values.shape[1:])
                    if 0 in chunk:
                        chunk = tuple(max(1, size) for size in chunk)
                    limits = (None, *values.shape[1:])
                    self.file.create_dataset(name, data=values, maxshape=limits, chunks=chunk)
                else:
                    self.file.create_dataset(name, data=values)
            self._growing = True

    def put(self, name: str, value: Any) -> None:
        """Write a dataset whole, in the place of one of its name."""
        if self.broken:
            return
        with self._writing():
            before = self.file.get(name)
            array = np.asarray(value)
            if before is not None and before.shape == array.shape and before.dtype == array.dtype:
                before[...] = array
                return
            if before is not None:
                del self.file[name]
            self.file[name] = array

    def remove(self, name: str) -> None:
        """Remove a dataset or group if it is there."""
        if self.broken:
            return
        with self._writing():
            if name in self.file:
                del self.file[name]

    def describe(self, name: str, attributes: Mapping[str, Any]) -> None:
        """Set attributes of a dataset or group, which is made if it is not there."""
        if self.broken:
            return
        with self._writing():
            if name != "/" and name not in self.file:
                self.file.create_group(name)
            for key, value in attributes.items():
                self.file[name].attrs[key] = value

    def publish(self) -> None:
        """Put a complete copy in the target's place; does nothing in memory."""
        if self.broken or self.target is None:
            return
        began = time.perf_counter()
        with self._writing():
            self.file.flush()
            shutil.copyfile(self.part, self._copy)
            sync(self._copy)
            os.replace(self._copy, self.target)
        self.publish_seconds = time.perf_counter() - began

    def finish(self) -> h5py.File | None:
        """Make the part file the target; return the file where it is kept in memory."""
        if self.broken:
            return None
        if self.target is None:
            self.file.flush()
            return self.file
        with self._writing():
            self.file.close()
            sync(self.part)
            os.replace(self.part, self.target)
        self.broken = True  # there is nothing left to write to
        self._unlock()
        return None
