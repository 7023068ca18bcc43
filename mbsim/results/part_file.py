"""`PartFile`: a file that grows hidden and is published whole, at the cost of what is new.

HDF5 promises nothing of a file whose writer was killed, so the growing file is never the one
that others see. Two files take turns: the part file grows, `publish` renames it over the
published one, whose last state, kept by a second name, is brought up to date with the bytes
written since and becomes the next part file. A kill at any instant leaves the published file
as it was or as it is now. Nothing is copied whole, unless somebody is reading the older file.

A published file ends with checksums, see `checksums`; a growing one does not.
"""

from __future__ import annotations

import contextlib
import os
import shutil
from array import array
from pathlib import Path
from typing import Any

from mbsim.results.checksums import DamagedError, end_of, renew, sums_at_end
from mbsim.results.files import create, locked, unlocked
from mbsim.results.ranges import Ranges

#: Bytes copied at a time.
_PIECE = 1 << 20


class PartFile:
    """Bytes of an HDF5 file as h5py's driver for Python files writes them.

    A failure to write is kept in `failure`, and later writes do nothing: HDF5 cannot be left
    where one of its own writes fails.

    Parameters
    ----------
    target : Path
        The published file; the part file is ``.<name>.part`` beside it.
    resume : bool
        Begin with what `target` holds.
    """

    def __init__(self, target: Path, resume: bool = False) -> None:
        self.target = target
        self.path = target.with_name(f".{target.name}.part")
        self._older = target.with_name(f".{target.name}.older")
        self.failure: OSError | None = None
        self._at = 0
        #: Where bytes were written since both files held the same.
        self._new = Ranges()
        self._summed = 0  # the size of what was published last, without its checksums
        #: Checksums of the blocks up to an end, and where was written since they were made.
        self._sums, self._sums_end = array("I"), 0
        self._unsummed = Ranges()
        self._published: tuple[int, int] | None = None  # device and inode of the other file
        #: Since the mark: the size there, bytes that were written over, and where was written.
        self._marked: int | None = None
        self._undo: list[tuple[int, bytes]] = []
        self._passing = Ranges()
        self._fd = create(self.path)
        locked(self._fd)
        if resume:
            try:
                self._copy_from(target)
            except OSError:
                self.failure = OSError("the file is closed")
                self.close()
                raise

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        """Set where the next bytes are read or written, from the start or the end."""
        self._at = offset if whence == os.SEEK_SET else self._size() + offset
        return self._at

    def tell(self) -> int:
        """Return where the next bytes are read or written."""
        return self._at

    def _size(self) -> int:
        return os.fstat(self._fd).st_size

    def read(self, size: int = -1) -> bytes:
        """Return up to so many bytes."""
        return os.pread(self._fd, self._size() if size < 0 else size, self._at)

    def readinto(self, buffer: Any) -> int:
        """Fill a buffer; what was never written is zero."""
        found = os.preadv(self._fd, [buffer], self._at)
        if found < len(buffer):
            buffer[found:] = bytes(len(buffer) - found)
        return len(buffer)

    def write(self, data: Any) -> int:
        """Write all bytes, or keep why they could not be."""
        first, size = self._at, len(data)
        view = memoryview(data)
        try:
            self._remember(first, first + size)
            while self.failure is None and len(view):
                done = os.pwrite(self._fd, view, self._at)
                view = view[done:]
                self._at += done
        except OSError as error:
            self.failure = error
        self._new.add(first, first + size)
        self._unsummed.add(first, first + size)
        return size

    def mark(self) -> None:
        """Let what is written from here on be in the next publication alone."""
        self._marked, self._undo, self._passing = self._size(), [], Ranges()

    def _remember(self, first: int, end: int) -> None:
        """Keep bytes before the mark that are about to be written over."""
        if self._marked is not None and first < self._marked:
            end = min(end, self._marked)
            self._undo.append((first, os.pread(self._fd, end - first, first)))
            self._passing.add(first, end)

    def truncate(self, size: int) -> None:
        """Set the file's size."""
        if self.failure is None:
            try:
                self._remember(size, self._size())
                os.ftruncate(self._fd, size)
            except OSError as error:
                self.failure = error

    def flush(self) -> None:
        """Nothing is held back."""

    def room(self) -> int:
        """Return how many bytes are free on the disk."""
        if not hasattr(os, "fstatvfs"):
            return shutil.disk_usage(self.path.parent).free
        found = os.fstatvfs(self._fd)
        return found.f_bavail * found.f_frsize

    def check(self) -> None:
        """Raise the failure to write, if there was one."""
        if self.failure is not None:
            raise self.failure

    def publish(self, last: bool = False) -> None:
        """Put what is written in the place of `target`, and go on in another file.

        Parameters
        ----------
        last : bool
            No more bytes will follow: there is no other file.

        Raises
        ------
        OSError
            Where the disk fails; what was published stays.
        """
        self.check()
        older = self._summed
        self._sum()
        os.fsync(self._fd)
        self.discard(self._older)
        kept = not last and self._keep()
        # readers that ask HDF5 for a lock get one as soon as the file has its name
        unlocked(self._fd)
        os.replace(self.path, self.target)
        done, self._fd = self._fd, -1
        try:
            found = os.fstat(done)
            self._published = found.st_dev, found.st_ino
            if not last:
                self._follow(done, kept, older)
        finally:
            os.close(done)

    def _sum(self) -> None:
        """Write the checksums behind all that is there."""
        self._sum_up()
        self._summed = self._sums_end
        _write(self._fd, end_of(self._sums, self._summed), self._summed)

    def sum_ahead(self) -> None:
        """Make the checksums of all that is there, which publishing would have to make."""
        try:
            self._sum_up()
        except OSError as error:
            self.failure = self.failure or error

    def _sum_up(self) -> None:
        """Make the checksums of what was written since they were made last."""
        size, end = self._size(), self._sums_end
        if size != end:
            # what lies behind an end that has moved is new too, written or not
            self._unsummed.add(min(size, end), size)
        renew(self._fd, self._sums, self._unsummed.merged(), size)
        self._sums_end, self._unsummed = size, Ranges()

    def _keep(self) -> bool:
        """Give the published file a second name; return whether it is there and ours."""
        if self._published is None:
            return False
        try:
            os.link(self.target, self._older, follow_symlinks=False)
            found = os.stat(self._older, follow_symlinks=False)
        except (OSError, NotImplementedError):  # a disk, or a system, without second names
            return False
        return (found.st_dev, found.st_ino) == self._published

    def _follow(self, done: int, kept: bool, older: int) -> None:
        """Make the next part file: the older one with what is new in `done`, else a whole copy.

        `older` is the size of the older one without its checksums.
        """
        size = self._summed if self._marked is None else self._marked
        if kept:
            self._fd = os.open(self._older, os.O_RDWR)
            # somebody who reads it has it locked; where no lock can be had nobody knows
            if locked(self._fd):
                os.ftruncate(self._fd, older)
                for first, end in self._new.merged():
                    _copy(done, self._fd, first, min(end, size))
                os.ftruncate(self._fd, size)
                os.replace(self._older, self.path)
                self._new = Ranges()
                self._go_back()
                return
            os.close(self._fd)
            self._fd = -1
        self.discard(self._older)
        self._fd = create(self.path)
        locked(self._fd)
        self._copy_from(self.target)
        self._go_back()

    def _go_back(self) -> None:
        """Let the part file be as it was at the mark, if there is one."""
        if self._marked is None:
            return
        os.ftruncate(self._fd, self._marked)
        for first, data in reversed(self._undo):
            _write(self._fd, data, first)
        # of these the published file and the checksums have others
        self._new, self._summed = self._passing, self._marked
        self._unsummed, self._sums_end = self._passing.copied(), self._marked
        self._marked, self._undo, self._passing = None, [], Ranges()

    def _copy_from(self, path: Path) -> None:
        """Fill the part file with another's bytes; `DamagedError` where they are not right."""
        with path.open("rb") as source:
            handle = source.fileno()
            found = sums_at_end(handle)
            sums, size = found or (array("I"), os.fstat(handle).st_size)
            _copy(handle, self._fd, 0, size)
        whole = array("I")
        renew(self._fd, whole, [[0, size]], size)
        if found is not None and sums != whole:
            raise DamagedError("its bytes are not those that were written")
        self._sums, self._summed, self._new = whole, size, Ranges()
        self._sums_end, self._unsummed = size, Ranges()

    @staticmethod
    def discard(path: Path) -> None:
        """Remove a file if it is there."""
        with contextlib.suppress(OSError):
            path.unlink()

    def close(self) -> None:
        """Let go of the part file and remove it; what was published stays."""
        if self.failure is None:
            self.failure = OSError("the file is closed")
        if self._fd >= 0:
            os.close(self._fd)
            self._fd = -1
        self.discard(self.path)
        self.discard(self._older)


def _copy(source: int, target: int, first: int, end: int) -> None:
    """Copy bytes of one open file to the same place of another; ends where the source does."""
    while first < end:
        piece = os.pread(source, min(_PIECE, end - first), first)
        if not piece:
            return
        _write(target, piece, first)
        first += len(piece)


def _write(target: int, data: bytes | bytearray, first: int) -> None:
    """Write all bytes to a place of an open file."""
    view = memoryview(data)
    while len(view):
        done = os.pwrite(target, view, first)
        view = view[done:]
        first += done
