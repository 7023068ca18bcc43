"""Requests as CSV: one row an output time, numbers that read back exactly."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from mbsim.results.files import create, problem, sync
from mbsim.results.reading import Results

#: Rows formatted at a time, so that a long run does not sit in memory as text.
_ROWS = 4096


def write_csv(path: Path, results: Results, request_ids: Sequence[int]) -> None:
    """Write ``Time, <id>.F1, ... <id>.F8, ...`` atomically; without requests no file.

    Parameters
    ----------
    path : Path
        A file of this name is replaced, and removed where the model has no requests: it
        would be of another run than the ``.h5`` beside it.
    results : Results
    request_ids : sequence of int
        In the order of the columns.

    Raises
    ------
    ResultsError
        If the file cannot be written.
    """
    temporary = path.with_name(f".{path.name}.tmp")
    try:
        if not request_ids:
            path.unlink(missing_ok=True)
            return
        names = ["Time", *(f"{id}.F{k}" for id in request_ids for k in range(1, 9))]
        time = results["time"]
        with os.fdopen(create(temporary), "w", encoding="utf-8", newline="\n") as file:
            file.write(",".join(names) + "\n")
            tables = [results[f"requests/{id}"] for id in request_ids]
            for first in range(0, len(time), _ROWS):
                part = slice(first, first + _ROWS)
                rows = np.column_stack([time[part], *(table[part] for table in tables)])
                # repr of a float is the shortest text that reads back to the same number
                file.writelines(",".join(map(repr, row)) + "\n" for row in rows.tolist())
        sync(temporary)
        temporary.replace(path)
    except OSError as error:
        with contextlib.suppress(OSError):
            temporary.unlink()
        raise problem(path, error) from None
