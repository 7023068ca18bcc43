"""Files that are whole or not there: atomic replacement, and whether a folder can be written."""

from __future__ import annotations

import contextlib
import os
from pathlib import Path

from mbsim.errors import ResultsError

SUFFIXES = (".h5", ".csv", ".log")
_LOCK_FLAGS = os.O_RDWR | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_CLOEXEC", 0)


def problem(path: Path, error: BaseException, what: str = "results") -> ResultsError:
    """Return what went wrong with a result file, in one line."""
    reason = getattr(error, "strerror", None) or " ".join(str(error).split())
    if isinstance(error, MemoryError):
        reason = "there is not enough memory"
    return ResultsError(f"{path}: {what} cannot be written: {reason or type(error).__name__}")


def create(path: Path) -> int:
    """Open a new empty file, in the place of what has its name; nothing is written through links.

    Raises
    ------
    OSError
        Where a folder has the name, or the disk does not let it.
    """
    with contextlib.suppress(FileNotFoundError):
        path.unlink()
    flags = os.O_RDWR | os.O_CREAT | os.O_EXCL | getattr(os, "O_NOFOLLOW", 0)
    return os.open(path, flags | getattr(os, "O_CLOEXEC", 0) | getattr(os, "O_BINARY", 0), 0o666)


def locked(handle: int) -> bool:
    """Lock an open file for one writer; False where others have it, or the disk has no locks."""
    try:
        import fcntl

        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except (ImportError, OSError):
        return False
    return True


def unlocked(handle: int) -> None:
    """Take back what `locked` did."""
    with contextlib.suppress(ImportError, OSError):
        import fcntl

        fcntl.flock(handle, fcntl.LOCK_UN)


class RunLock:
    """Keeps a second run out of the same result files, where the system has locks.

    Raises
    ------
    ResultsError
        If another run is writing there.
    OSError
        If the lock file cannot be made.
    """

    def __init__(self, target: Path) -> None:
        self.path = target.with_name(f".{target.name}.lock")
        while True:
            self._handle = os.open(self.path, _LOCK_FLAGS, 0o666)
            if not self._take():
                os.close(self._handle)
                self._handle = -1
                raise ResultsError(
                    f"{target}: another run is writing there; choose another folder with -o"
                )
            # one that has just ended took its file away
            with contextlib.suppress(FileNotFoundError):
                if os.path.samestat(os.fstat(self._handle), os.lstat(self.path)):
                    return
            os.close(self._handle)

    def _take(self) -> bool:
        """Return whether nobody else has the lock."""
        try:
            import fcntl

            fcntl.flock(self._handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return False
        except (ImportError, OSError):
            return True  # a disk without locks
        return True

    def release(self) -> None:
        """Let others write; a second call does nothing."""
        if self._handle >= 0:
            # removed while it is held: whoever waits for it finds that out
            with contextlib.suppress(OSError):
                self.path.unlink()
            os.close(self._handle)
            self._handle = -1


def prepare_directory(directory: Path, model_name: str) -> None:
    """Make the folder and see that result files can be written there.

    Raises
    ------
    ResultsError
        If it is a file, cannot be made or written, or a folder has the name of a result.
    """
    probe = directory / f".{model_name}.probe"
    try:
        directory.mkdir(parents=True, exist_ok=True)
        os.close(create(probe))
    except FileExistsError:
        raise ResultsError(f"{directory}: is a file; results need a folder (-o DIR)") from None
    except (OSError, ValueError) as error:
        raise problem(directory, error) from None
    finally:
        with contextlib.suppress(OSError, ValueError):
            probe.unlink()
    for suffix in SUFFIXES:
        if (target := directory / f"{model_name}{suffix}").is_dir():
            raise ResultsError(f"{target}: is a folder; a result file has this name")


def sync(path: Path) -> None:
    """Wait until a file's contents are on the disk."""
    # a disk that fails tells so here, before an earlier file is given up
    handle = os.open(path, os.O_RDWR)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def replace_text(path: Path, text: str) -> None:
    """Write a text file such that `path` holds the old or the new text, never a part.

    Raises
    ------
    ResultsError
        If the disk is full, or the folder is gone or protected.
    """
    replace_bytes(path, text.encode("utf-8", "backslashreplace"))


def replace_bytes(path: Path, data: bytes, what: str = "results") -> None:
    """Write a file such that `path` holds the old or the new bytes, never a part.

    Raises
    ------
    ResultsError
        If the disk is full, or the folder is gone or protected; `what` is in its message.
    """
    temporary = path.with_name(f".{path.name}.tmp")
    try:
        with os.fdopen(create(temporary), "wb") as file:
            file.write(data)
        sync(temporary)
        os.replace(temporary, path)
    except OSError as error:
        with contextlib.suppress(OSError):
            temporary.unlink()
        raise problem(path, error, what) from None
