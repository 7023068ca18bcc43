"""Files that are whole or not there: atomic replacement, and whether a folder can be written."""

from __future__ import annotations

import contextlib
import os
from pathlib import Path

from mbsim.errors import ResultsError

SUFFIXES = (".h5", ".csv", ".log")


def problem(path: Path, error: BaseException) -> ResultsError:
    """Return what went wrong with a result file, in one line."""
    reason = getattr(error, "strerror", None) or " ".join(str(error).split())
    return ResultsError(f"{path}: results cannot be written: {reason or type(error).__name__}")


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
        probe.write_bytes(b"\0")
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
    temporary = path.with_name(f".{path.name}.tmp")
    try:
        temporary.write_text(text, encoding="utf-8", newline="\n")
        sync(temporary)
        os.replace(temporary, path)
    except OSError as error:
        with contextlib.suppress(OSError):
            temporary.unlink()
        raise problem(path, error) from None
