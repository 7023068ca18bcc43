"""`read_csv`: tables of numbers that people hand in, as CSV, with the line of what is wrong."""

from __future__ import annotations

import csv
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mbsim.errors import ModelError
from mbsim.studies.distributions import Numbers

#: Between cells: the one that the line of names has most of.
_DELIMITERS = ",;\t"
#: Lines that are named, of those that are no numbers.
_NAMED = 5


@dataclass
class Columns:
    """A CSV that was read: its columns by name, NaN where a cell is empty.

    Attributes
    ----------
    columns : dict
        Arrays of (rows,), by name.
    lines : array, (rows,)
        The line of the file that each row stands in.
    """

    file: Path
    columns: dict[str, Numbers]
    lines: Numbers

    def __getitem__(self, name: str) -> Numbers:
        if name not in self.columns:
            raise KeyError(f"{self.file} has no column {name!r}; it has {', '.join(self.columns)}")
        return self.columns[name]


def read_csv(file: Path, whole: bool = False) -> Columns:
    """Return the columns of a CSV; empty lines, and those that begin with #, are skipped.

    Parameters
    ----------
    file : Path
    whole : bool
        Whether every cell must be a finite number; else cells may be empty, or nan.

    Raises
    ------
    ModelError
        If it cannot be read, or a cell is no number: a line for each of the first such lines.
    """
    try:
        text = file.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        why = getattr(error, "strerror", None) or error
        raise ModelError(f"{file}: cannot be read: {why}") from None
    lines = [
        (number, line)
        for number, line in enumerate(text.splitlines(), 1)
        if line.strip() and not line.lstrip().startswith("#")
    ]
    if len(lines) < 2:
        raise ModelError(f"{file}: needs a line of names and lines of numbers")
    delimiter = max(_DELIMITERS, key=lines[0][1].count)
    names = [cell.strip() for cell in _cells(lines[0][1], delimiter)]
    if twice := sorted({name for name in names if name and names.count(name) > 1}):
        raise ModelError(f"{file}: columns that are there twice: {', '.join(twice)}")
    rows: list[list[float]] = []
    faults: list[str] = []
    for number, line in lines[1:]:
        cells = _cells(line, delimiter)
        try:
            rows.append(_numbers(names, cells, whole))
        except ValueError as error:
            faults.append(f"{file}:{number}: {error}")
    if len(faults) > _NAMED:
        faults[_NAMED:] = [f"{file}: {len(faults) - _NAMED} more lines are wrong"]
    if faults:
        raise ModelError("\n".join(faults))
    table = np.array(rows, dtype=np.float64)
    places = np.array([number for number, _ in lines[1:]], dtype=np.float64)
    return Columns(file, {name: table[:, k] for k, name in enumerate(names)}, places)


def _cells(line: str, delimiter: str) -> list[str]:
    return next(csv.reader([line], delimiter=delimiter))


def _numbers(names: Sequence[str], cells: Sequence[str], whole: bool) -> list[float]:
    """Return the numbers of a line; `ValueError` says which cell is none."""
    if len(cells) != len(names):
        raise ValueError(f"has {len(cells)} cells, not {len(names)}")
    found = []
    for name, cell in zip(names, cells, strict=True):
        try:
            value = float(cell) if cell.strip() else math.nan
        except ValueError:
            value = math.nan
            wrong = True
        else:
            wrong = whole and not math.isfinite(value)
        if wrong:
            said = "a finite number" if whole else "a number"
            raise ValueError(f"{name} = {cell.strip()[:40]!r}: must be {said}")
        found.append(value)
    return found
