"""Measured curves: columns of a CSV, in the model's units, and a run's curve at their times."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from mbsim.errors import ModelError
from mbsim.studies.csv_file import Columns
from mbsim.studies.distributions import Numbers

#: Keys of a record, and the types of their values.
_KEYS: dict[str, tuple[type, ...]] = {
    "file": (str,),
    "signal": (str,),
    "column": (str,),
    "time": (str,),
    "unit": (str,),
    "time_unit": (str,),
    "sd": (int, float, str),
    "weight": (int, float),
    "time_offset": (int, float, str),
    "from": (int, float),
    "to": (int, float),
}
_NEEDED = ("file", "signal", "column")
#: The column of times, beside those of the records: no record can be called so.
TIME = "run time"
#: The largest value of a record: squares of a million of them are added up.
_LARGEST = 1e150
#: Rows of a record: fewer say nothing, more are a mistake.
_LEAST_ROWS, _MOST_ROWS = 3, 1_000_000


@dataclass(frozen=True, eq=False)
class Record:
    """A measured curve.

    Attributes
    ----------
    time, value : array, (n,)
        In the model's units; times are the file's.
    sd : array, (n,), optional
        Standard deviation of the noise of each row, in the model's units.
    offset : float or str
        What is added to the file's times to be times of the run [T], or the parameter that is.
    """

    name: str
    file: Path
    signal: str
    column: str
    time: Numbers
    value: Numbers
    sd: Numbers | None
    weight: float
    offset: float | str
    unit: str
    missing: int

    def shift(self, values: Mapping[str, float]) -> float:
        """Return what is added to the file's times, for values of the parameters."""
        return values[self.offset] if isinstance(self.offset, str) else self.offset

    def of(self, t: Numbers, x: Numbers, values: Mapping[str, float]) -> Numbers | None:
        """Return a run's curve at the measured times; None where the run does not reach them.

        Parameters
        ----------
        t, x : array, (rows,)
            The curve at output times.
        values : mapping
            Of the parameters.
        """
        if len(t) == 0:
            return None
        wanted = self.time + self.shift(values)
        room = 1e-9 * max(abs(float(t[-1])), float(t[-1] - t[0]))
        if wanted[0] < t[0] - room or wanted[-1] > t[-1] + room:
            return None
        return between(t, x, np.clip(wanted, t[0], t[-1]))

    def between_rows(self, t: Numbers, x: Numbers, values: Mapping[str, float]) -> float:
        """Return about how far `of` is off between rows: 0 where the measured times are rows."""
        wanted = self.time + self.shift(values)
        near = t[np.clip(np.searchsorted(t, wanted - 0.5 * np.diff(t).max()), 0, len(t) - 1)]
        if not isinstance(self.offset, str) and np.all(np.abs(near - wanted) <= 1e-9 * t[-1]):
            return 0.0
        within = (t[1::2] >= wanted[0]) & (t[1::2] <= wanted[-1])
        within[-1:] = False
        # with every second row it is off by about four times as much
        off = np.abs(between(t[::2], x[::2], t[1::2]) - x[1::2])[within]
        return 0.25 * float(np.max(off)) if len(off) else 0.0


def between(t: Numbers, x: Numbers, wanted: Numbers) -> Numbers:
    """Return a curve between its rows, by cubics that a jump does not make swing.

    Akima, J. ACM 17 (1970) 589-602.
    """
    from scipy.interpolate import Akima1DInterpolator

    kept = np.concatenate([[True], np.diff(t) > 0.0])  # two simulations share a row
    if kept.sum() < 5:
        return np.asarray(np.interp(wanted, t, x))
    return np.asarray(Akima1DInterpolator(t[kept], x[kept])(wanted), dtype=np.float64)


@dataclass(frozen=True)
class Asked:
    """A record as the study file has it: its name, and its table."""

    name: str
    file: Path
    table: Mapping[str, Any]

    @property
    def signal(self) -> str:
        """The signal that was measured."""
        return str(self.table["signal"]).strip("/")

    @property
    def offset(self) -> float | str:
        """As `Record.offset`."""
        given = self.table.get("time_offset", 0.0)
        return given if isinstance(given, str) else float(given)


def read_asked(
    tables: Mapping[str, Any], folder: Path, parameters: Mapping[str, Any], faults: list[str]
) -> list[Asked]:
    """Return what [records] says; what is wrong is added to `faults`."""
    found: list[Asked] = []
    if not tables:
        faults.append("records: there are none: one [records.NAME] a measured curve")
    for name, table in tables.items():
        where = f"records.{name}"
        if not isinstance(table, dict):
            faults.append(f"{where}: must be a table")
            continue
        before = len(faults)
        if not name.isidentifier():
            faults.append(f"{where}: must be another name: letters, digits, _")
        if extra := sorted(table.keys() - _KEYS.keys()):
            faults.append(f"{where}: unknown {', '.join(extra)}; known: {', '.join(_KEYS)}")
        if missing := [key for key in _NEEDED if key not in table]:
            faults.append(f"{where}: needs {', '.join(missing)}")
        for key, value in table.items():
            if key in _KEYS and type(value) not in _KEYS[key]:
                what = " or ".join("a text" if t is str else "a number" for t in _KEYS[key][-1:])
                faults.append(f"{where}.{key} = {value!r}: must be {what}")
            elif isinstance(value, float) and not math.isfinite(value):
                faults.append(f"{where}.{key} = {value!r}: must be finite")
        for key in ("sd", "weight"):
            value = table.get(key, 1.0)
            if type(value) in (int, float) and not value > 0.0:
                faults.append(f"{where}.{key} = {value:g}: must be above 0")
        offset = table.get("time_offset", 0.0)
        if isinstance(offset, str) and offset not in parameters:
            known = ", ".join(parameters)
            faults.append(
                f"{where}.time_offset = {offset!r}: must be a number or a parameter: {known}"
            )
        if len(faults) == before:
            found.append(Asked(name, folder / table["file"], table))
    stated = [asked for asked in found if "sd" in asked.table]
    if len(found) > 1 and len(stated) < len(found):
        names = ", ".join(f"records.{asked.name}" for asked in found if asked not in stated)
        faults.append(f"{names}: sd: several records need it, to be weighed against each other")
    return found


def _back_in_time(t: Numbers, lines: Numbers, name: str, per_time: float) -> list[str]:
    """Return where times do not grow from row to row, by the first line of the file that is so."""
    back = np.flatnonzero(np.diff(t) <= 0.0)
    if not len(back):
        return []
    k, before = int(back[0]) + 1, t[back[0]] / per_time
    return [
        f"line {int(lines[k])}: {name} = {t[k] / per_time:.9g} follows {before:.9g}: "
        "times must grow from row to row"
    ]


def _too_large(asked: Asked, x: Numbers, sd: Numbers | None) -> list[str]:
    """Return that squares of values, over their noise, would overflow, where they would."""
    root = math.sqrt(float(asked.table.get("weight", 1.0)))
    column, largest = asked.table["column"], float(np.max(np.abs(x), initial=0.0))
    least = 1.0 if sd is None else float(np.min(sd, initial=math.inf))
    if not largest <= _LARGEST:
        said = f"column {column!r} has values up to {largest:.3g} in the model's units"
    elif not max(1.0, largest) * root <= _LARGEST * least:
        said = f"values of column {column!r} are too large beside sd and weight"
    else:
        return []
    return [f"{said}: squares above {_LARGEST:g} squared are no numbers; is the unit right?"]


def read_record(asked: Asked, columns: Columns, factor: float, per_time: float) -> Record:
    """Return a record of a file that was read.

    Parameters
    ----------
    asked : Asked
    columns : Columns
    factor, per_time : float
        What values and times of the file are multiplied with to be in the model's units.

    Raises
    ------
    ModelError
        All that is wrong with it, a line each, without the study file's name.
    """
    table, faults, found = asked.table, [], {}
    wanted = {"time": table.get("time", "time"), "column": table["column"]}
    if isinstance(table.get("sd"), str):
        wanted["sd"] = table["sd"]
    for key, name in wanted.items():
        try:
            found[key] = columns[name]
        except KeyError as error:
            faults.append(f"records.{asked.name}.{key}: {error.args[0]}")
    if faults:
        raise ModelError("\n".join(faults))
    t, x = found["time"] * per_time, found["column"] * factor
    within = (t >= table.get("from", -math.inf)) & (t <= table.get("to", math.inf))
    there = np.all([np.isfinite(column) for column in found.values()], axis=0)
    kept = within & there
    sd = found["sd"] * factor if "sd" in found else None
    if sd is None and "sd" in table:
        sd = np.full(len(t), float(table["sd"]) * factor)
    count = int(kept.sum())
    if not _LEAST_ROWS <= count <= _MOST_ROWS:
        faults.append(f"{count} rows of {len(t)} are of use; from {_LEAST_ROWS} to {_MOST_ROWS}")
    else:
        faults += _back_in_time(t[kept], columns.lines[kept], wanted["time"], per_time)
    if sd is not None and not np.all(sd[kept] > 0.0):
        faults.append(f"sd: {table['sd']}: must be above 0 in every row")
    else:
        faults += _too_large(asked, x[kept], None if sd is None else sd[kept])
    if faults:
        raise ModelError("\n".join(f"records.{asked.name}: {asked.file}: {f}" for f in faults))
    return Record(
        name=asked.name,
        file=asked.file,
        signal=asked.signal,
        column=str(table["column"]),
        time=t[kept],
        value=x[kept],
        sd=None if sd is None else sd[kept],
        weight=float(table.get("weight", 1.0)),
        offset=asked.offset,
        unit="",
        missing=int(within.sum()) - count,
    )
