"""What may be believed of a damaged file before it is read: sizes of HDF5 datasets, kinds of files.

Reading is done apart where the reader is a library that loops over damage, see `apart`.
"""

from __future__ import annotations

import contextlib
import faulthandler
import os
import pickle
import signal
import stat
import time
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from mbsim.errors import ResultsError

if TYPE_CHECKING:
    import h5py

Made = TypeVar("Made")

#: Bytes of a dataset for each stored one, at most: deflate does not do better than 1032.
_MOST_PACKED = 1100
#: What a dataset may hold beside.
_FEW_BYTES = 2**16
#: Processor time for reading: a base, and for each byte of the files [s].
_SECONDS, _SECONDS_A_BYTE = 3.0, 2e-7


#: Files of fewer bytes are read in one.
_AT_ONCE = 1 << 20


def claims_too_much(dataset: h5py.Dataset) -> bool:
    """Return whether a dataset would be larger in memory than what is stored of it can make.

    HDF5 would fill the rest with its fill value, for minutes or until memory ends.
    """
    claimed: int = dataset.size * dataset.dtype.itemsize if dataset.shape is not None else 0
    if claimed <= _FEW_BYTES:
        return False
    return bool(claimed > _MOST_PACKED * dataset.id.get_storage_size())


def read_regular(path: Path, most: int = -1) -> bytes:
    """Return the bytes of a file, `most` of them at most; a FIFO or a device is refused at once.

    Raises
    ------
    OSError
        If it cannot be read; `strerror` says so where it is no regular file.
    """
    # opening a FIFO waits for whoever writes into it
    handle = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0))
    try:
        about = os.fstat(handle)
        if not stat.S_ISREG(about.st_mode):
            is_folder = stat.S_ISDIR(about.st_mode)
            raise OSError(0, "is a folder" if is_folder else "is no regular file")
        if 0 < about.st_size < _AT_ONCE and not 0 <= most <= about.st_size:
            # one byte more than there is: who gets it all in one does not ask again
            found = os.read(handle, about.st_size + 1)
            if len(found) == about.st_size:
                return found
            os.lseek(handle, 0, os.SEEK_SET)
        with os.fdopen(handle, "rb", closefd=False) as file:
            return file.read(most)
    finally:
        os.close(handle)


def apart(do: Callable[[], Made], *paths: Path) -> Made:
    """Return what `do` reads from files, in a process of its own where the system has `fork`.

    HDF5's library may loop over a damaged file, or crash. The other process has so much time of the
    processor: a slow disk takes none.

    Parameters
    ----------
    do : callable
        What it returns must be such that `pickle` takes it.
    paths : Path
        The files that are read; their size gives the time.

    Raises
    ------
    ResultsError
        If the process crashes, or is not done in time.
    Exception
        What `do` raises.
    """
    try:
        import resource

        size = sum(path.stat().st_size for path in paths)
    except (ImportError, OSError, ValueError):
        return do()
    seconds = _SECONDS + _SECONDS_A_BYTE * size
    reading, writing = os.pipe()
    with warnings.catch_warnings():
        # the child only reads and leaves, whatever locks other threads have
        warnings.simplefilter("ignore", DeprecationWarning)
        child = os.fork()
    if child == 0:
        code = 1
        with contextlib.suppress(BaseException):
            os.close(reading)
            # the parent tells of a crash
            faulthandler.disable()
            signal.signal(signal.SIGINT, signal.SIG_DFL)
            resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
            used, (_, most) = time.process_time(), resource.getrlimit(resource.RLIMIT_CPU)
            resource.setrlimit(resource.RLIMIT_CPU, (int(used + seconds) + 1, most))
            _answer(do, writing)
            code = 0
        os._exit(code)
    os.close(writing)
    try:
        with os.fdopen(reading, "rb") as pipe:
            packed = pipe.read()
    except BaseException:
        os.kill(child, signal.SIGKILL)
        raise
    finally:
        _, status = os.waitpid(child, 0)
    if os.WIFSIGNALED(status) or os.WEXITSTATUS(status):
        late = os.WIFSIGNALED(status) and os.WTERMSIG(status) == signal.SIGXCPU
        why = f"not done after {seconds:.3g} s" if late else "its reader crashes"
        named = ", ".join(map(str, paths))
        raise ResultsError(f"{named}: cannot be read, the file is damaged: {why}")
    made, raised = pickle.loads(packed)
    if raised is not None:
        raise raised
    found: Made = made
    return found


def _answer(do: Callable[[], object], writing: int) -> None:
    """Write what `do` returns or raises into a pipe."""
    made: object = None
    raised: BaseException | None = None
    try:
        made = do()
    except Exception as error:
        raised = error
    packed = pickle.dumps((made, raised))
    with os.fdopen(writing, "wb") as pipe:
        pipe.write(packed)
