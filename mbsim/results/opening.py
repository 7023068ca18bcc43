"""How a result file is opened for reading: checked where it has checksums, else as it is."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from mbsim.core.stored import apart
from mbsim.errors import ResultsError
from mbsim.results.checksums import CheckedFile
from mbsim.results.damage import said_of

if TYPE_CHECKING:
    import h5py

#: How often a file that is just being published is asked for, and how long between [s].
_TRIES, _PAUSE = 50, 0.002
#: What is raised where numbers and tables are not of the form that they should have.
_FORM = (LookupError, ValueError, TypeError, AttributeError, ArithmeticError)
_Made = TypeVar("_Made")


def opened_file(path: Path) -> h5py.File:
    """Open a file for reading, locked against being written on.

    The writer holds its lock on a published file for microseconds, see `part_file`.
    """
    import h5py

    for left in reversed(range(_TRIES)):
        try:
            found = CheckedFile(path, lock=left > 0)
            if found.checked:
                return h5py.File(found, "r")
            found.close()
            return h5py.File(path, "r", locking="best-effort" if left else False)
        except BlockingIOError:
            time.sleep(_PAUSE)
    raise AssertionError("without a lock nobody is waited for")


def read_apart(do: Callable[[], _Made], *paths: Path) -> _Made:
    """Return what `do` reads of result files; apart, see `apart`, where one has no checksums.

    Such a file may hold anything: what no reader foresees in it is damage, not a mistake of ours.

    Raises
    ------
    ResultsError
        If a file without checksums cannot be read.
    """
    for path in paths:
        try:
            file = CheckedFile(path, lock=False)
        except OSError:
            continue  # it is refused in any process
        file.close()
        if not file.checked:
            try:
                return apart(do, *paths)
            except _FORM as error:
                names = ", ".join(map(str, paths))
                raise ResultsError(f"{names}: {said_of(error)}") from None
    return do()
