"""The journal of a study: every row under its key, on the disk as it comes, to be gone on from."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import IO, Any

from mbsim.errors import ResultsError
from mbsim.studies.worker import Row

#: So many rows may be lost when the machine stops; when only the process is killed, none is.
_SYNCED_EVERY = 100


class Journal:
    """Appends rows to a file, one JSON object a line.

    Parameters
    ----------
    path : Path
    resume : bool
        Keep what is there.
    """

    def __init__(self, path: Path, resume: bool) -> None:
        self.path = path
        try:
            self._stream = path.open("ab", buffering=0)
            _claim(self._stream, path)
            if not resume:
                self._stream.truncate(0)
            if resume and path.stat().st_size and not _ends_whole(path):
                self._stream.write(b"\n")  # the last line was cut off
        except OSError as error:
            raise ResultsError(f"{path}: cannot be written: {error.strerror}") from None
        self._since = 0

    def close(self) -> None:
        """Close the file."""
        self._stream.close()

    def add(self, key: str, row: Row) -> None:
        """Write a row; ResultsError where that fails."""
        line = json.dumps({"key": key, **row._asdict()}) + "\n"
        try:
            self._stream.write(line.encode())
            self._since += 1
            if self._since >= _SYNCED_EVERY:
                os.fsync(self._stream.fileno())
                self._since = 0
        except OSError as error:
            raise ResultsError(f"{self.path}: cannot be written: {error.strerror}") from None


def _claim(stream: IO[bytes], path: Path) -> None:
    """Lock a journal for this process; ResultsError where another one has it.

    Where files cannot be locked, as on some network's, nothing is.
    """
    if sys.platform == "win32":
        return
    import fcntl

    try:
        fcntl.flock(stream.fileno(), fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        stream.close()
        raise ResultsError(f"{path}: another sweep writes it; name another folder by -o") from None
    except OSError:
        return


def _ends_whole(path: Path) -> bool:
    """Return whether a file ends with an end of line."""
    with path.open("rb") as stream:
        stream.seek(-1, os.SEEK_END)
        return stream.read(1) == b"\n"


def rows_kept(path: Path, runs_of: Mapping[str, int]) -> dict[int, Row]:
    """Return the rows of a journal that belong to these runs.

    Parameters
    ----------
    path : Path
    runs_of : mapping
        Number of each run by its key: a row of another key belongs to another study.

    Returns
    -------
    dict of int to Row
        Without those of runs whose workers were lost, which are tried anew.
    """
    found: dict[int, Row] = {}
    if not path.is_file():
        return found
    for item in _lines(path):
        run = runs_of.get(str(item.pop("key", "")))
        if run is not None and not item.get("lost"):
            found[run] = Row(**item)._replace(run=run)
    return found


def _lines(path: Path) -> Iterator[dict[str, Any]]:
    """Yield the objects of a journal; a line that was cut off is none."""
    with path.open("rb") as stream:
        for line in stream:
            try:
                item = json.loads(line)
            except ValueError:
                continue
            if isinstance(item, dict):
                yield item
