"""Checksums of a published result file, block by block, behind what HDF5 reads of it.

HDF5's library believes what it reads: one changed byte of an index may crash it or let it search
for ever. So a file ends with the CRC-32 of each of its blocks, and `CheckedFile` hands HDF5 no
block that is another than the one that was written. Other readers of HDF5 do not look there.

The end of a file: the blocks' CRC-32 (4 bytes each), then the length of what they are of (8 bytes),
the CRC-32 of both (4 bytes) and `MAGIC`; numbers are little-endian.
"""

from __future__ import annotations

import contextlib
import os
import stat
import struct
import zlib
from array import array
from pathlib import Path
from typing import Any

#: Bytes of a block: what a disk loses at once.
BLOCK = 4096
MAGIC = b"mbsimCRC"
_END = struct.Struct("<QI8s")
#: Bytes looked at in one go.
_PIECE = 256 * BLOCK


class DamagedError(OSError):
    """Bytes that are not those that were written; `strerror` says so."""

    def __init__(self, what: str) -> None:
        super().__init__(0, f"the file is damaged: {what}")


def sums_of(data: Any) -> array[int]:
    """Return the checksums of blocks that lie behind each other."""
    view = memoryview(data)
    crc = zlib.crc32
    return array("I", [crc(view[at : at + BLOCK]) for at in range(0, len(view), BLOCK)])


def end_of(sums: array[int], size: int) -> bytearray:
    """Return what follows a file's `size` bytes, whose blocks have those checksums."""
    made = bytearray(_little(sums))
    made += struct.pack("<Q", size)
    made += struct.pack("<I8s", zlib.crc32(made), MAGIC)
    return made


def sums_at_end(handle: int) -> tuple[array[int], int] | None:
    """Return the checksums that an open file ends with, and how many bytes they are of.

    None where it has none: files of earlier versions.

    Raises
    ------
    DamagedError
        If these checksums are not those that were written.
    """
    length = os.fstat(handle).st_size
    end = _pread(handle, _END.size, max(0, length - _END.size))
    if len(end) < _END.size or not end.endswith(MAGIC):
        return None
    size, check, _ = _END.unpack(end)
    if length != size + 4 * -(-size // BLOCK) + _END.size:
        raise DamagedError("it is longer or shorter than it was")
    table = _pread(handle, length - size - 12, size)
    if zlib.crc32(table) != check:
        raise DamagedError("its checksums are not those that were written")
    sums = array("I")
    sums.frombytes(table[:-8])
    return _little(sums), size


def _little(sums: array[int]) -> array[int]:
    """Return numbers between this machine's order of bytes and little-endian."""
    import sys

    if sys.byteorder == "big":
        sums = sums[:]
        sums.byteswap()
    return sums


def _pread(handle: int, size: int, at: int) -> bytes:
    """Return so many bytes of an open file, fewer at its end."""
    if hasattr(os, "pread"):
        return os.pread(handle, size, at)
    os.lseek(handle, at, os.SEEK_SET)
    return os.read(handle, size)


def renew(handle: int, sums: array[int], ranges: list[list[int]], size: int) -> None:
    """Make checksums those of an open file of which those ranges were written since."""
    count = -(-size // BLOCK)
    del sums[count:]
    sums.extend(bytes(count - len(sums)))
    for first, end in ranges:
        for at in range(first // BLOCK * BLOCK, min(end, size), _PIECE):
            until = min(at + _PIECE, -(-min(end, size) // BLOCK) * BLOCK, size)
            part = sums_of(_pread(handle, until - at, at))
            sums[at // BLOCK : at // BLOCK + len(part)] = part


class CheckedFile:
    """A published file as h5py's driver for Python files reads it: damaged blocks are refused.

    Parameters
    ----------
    path : Path
    lock : bool
        Lock it against being written on.

    Raises
    ------
    OSError
        If it cannot be opened; `DamagedError` where its checksums are damaged.
    BlockingIOError
        If its writer holds it just now.
    """

    def __init__(self, path: Path, lock: bool = True) -> None:
        self._handle = -1
        # opening a FIFO waits for whoever writes into it
        flags = getattr(os, "O_BINARY", 0) | getattr(os, "O_NONBLOCK", 0)
        self._handle = os.open(path, os.O_RDONLY | flags)
        if not stat.S_ISREG(os.fstat(self._handle).st_mode):
            raise OSError(0, "is no regular file")
        if lock:
            _shared(self._handle)
        found = sums_at_end(self._handle)
        #: Whether the file has checksums.
        self.checked = found is not None
        self._sums, self._size = found or (array("I"), 0)
        self._right = bytearray(len(self._sums))
        self._at = 0

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        """Set where the next bytes are read, from the start or the end."""
        self._at = offset if whence == os.SEEK_SET else self._size + offset
        return self._at

    def tell(self) -> int:
        """Return where the next bytes are read."""
        return self._at

    def read(self, size: int = -1) -> bytes:
        """Return up to so many bytes that are right."""
        left = max(0, self._size - self._at)
        found = bytearray(left if size < 0 else min(size, left))
        self.readinto(found)
        return bytes(found)

    def readinto(self, buffer: Any) -> int:
        """Fill a buffer with bytes that are right; zeros behind the end."""
        first, wanted = self._at, len(buffer)
        end = min(first + wanted, self._size)
        low, high = first // BLOCK, -(-end // BLOCK)
        if self._right.find(0, low, high) < 0:
            data = _pread(self._handle, max(0, end - first), first)
        else:
            start = low * BLOCK
            whole = _pread(self._handle, min(high * BLOCK, self._size) - start, start)
            self._check(low, sums_of(whole))
            data = whole[first - start : end - start]
        buffer[: len(data)] = data
        if len(data) < wanted:
            buffer[len(data) :] = bytes(wanted - len(data))
        return wanted

    def _check(self, first: int, sums: array[int]) -> None:
        """Remember which blocks are right; raise where one is not."""
        if sums != self._sums[first : first + len(sums)]:
            pairs = zip(sums, self._sums[first:], strict=False)
            k = first + next(k for k, (is_, was) in enumerate(pairs) if is_ != was)
            raise DamagedError(
                f"bytes {k * BLOCK} to {min((k + 1) * BLOCK, self._size)} "
                "are not those that were written"
            )
        self._right[first : first + len(sums)] = b"\1" * len(sums)

    def flush(self) -> None:
        """Nothing is written."""

    def close(self) -> None:
        """Let go of the file; a second call does nothing."""
        if self._handle >= 0:
            os.close(self._handle)
            self._handle = -1

    def __del__(self) -> None:
        self.close()


def _shared(handle: int) -> None:
    """Lock an open file against being written on, where the disk has locks."""
    with contextlib.suppress(ImportError):
        import fcntl

        try:
            fcntl.flock(handle, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except BlockingIOError:
            raise
        except OSError:
            return
