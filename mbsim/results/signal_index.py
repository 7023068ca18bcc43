"""`SignalIndex`: where the signals of a result file are stored, by their names."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, NamedTuple

from mbsim.results.form import (
    FACTS,
    NO_ELEMENTS,
    NO_KEYS,
    NO_SIGNALS,
    is_dataset,
    is_group,
    is_signal,
    values_of,
)
from mbsim.results.names import SENSITIVITY, of_slope, order, parts_of

if TYPE_CHECKING:
    import h5py


class Location(NamedTuple):
    """Where a signal is stored: its dataset, and its column among elements side by side."""

    stored: str
    column: int | None


class SignalIndex:
    """Names of signals and tables of a file, each looked up once.

    Parameters
    ----------
    file : h5py.File or MemoryFile
    """

    def __init__(self, file: h5py.File) -> None:
        self._file = file
        # once they were looked up
        self._signals: dict[str, int] | None = None
        self._ids: dict[str, list[int]] | None = None
        self._table: dict[str, Location] | None = None

    def datasets(self) -> dict[str, h5py.Dataset]:
        """Return the datasets that hold one signal or table, by name."""
        found: dict[str, h5py.Dataset] = {}

        def note(name: str, item: h5py.HLObject) -> None:
            group, _, last = name.rpartition("/")
            if name.startswith((*NO_KEYS, SENSITIVITY)) or not is_dataset(item):
                return
            # of a group whose elements stand side by side `columnwise` gives the names
            if "/" in group or not last or f"{group}/id" not in self._file:
                found[name] = item

        self._file.visititems(note)
        return found

    def columnwise(self) -> dict[str, Location]:
        """Return the signals whose elements stand side by side, by names with ids."""
        if self._table is None:
            self._table = {}
            for group, ids in self.columns().items():
                for last, item in self._file[group].items():
                    if last in FACTS or not hasattr(item, "shape"):
                        continue
                    for k, id in enumerate(ids):
                        self._table[f"{group}/{id}/{last}"] = Location(f"{group}/{last}", k)
        return self._table

    def columns(self) -> dict[str, list[int]]:
        """Return the ids in order of their columns, by group."""
        if self._ids is None:
            self._ids = {
                group: values_of(item["id"]).tolist()
                for group, item in self._file.items()
                if group not in NO_ELEMENTS and hasattr(item, "keys") and "id" in item
            }
        return self._ids

    def keys(self) -> list[str]:
        """Return the names of all signals and tables, sorted as numbers where they are."""
        names = (*self.datasets(), *self.columnwise(), *(name for name, _ in self._slopes()))
        return sorted(names, key=order)

    def parameters(self) -> dict[str, h5py.Group]:
        """Return the groups of derivatives by parameter."""
        group = self._file.get(SENSITIVITY.rstrip("/"))
        if not is_group(group):
            return {}
        return {name: item for name, item in group.items() if is_group(item)}

    def _slopes(self) -> Iterator[tuple[str, Location]]:
        """Yield the names of derivatives, ``sensitivity/<parameter>/<signal>``, and where each is.

        They are stored as signals are, each parameter's in a group of its own.
        """
        parameters = self.parameters()
        if not parameters:
            return
        plain = {name: Location(name, None) for name in self.datasets()}
        for parameter, group in parameters.items():
            there: dict[str, bool] = {}
            for name, (stored, column) in (plain | self.columnwise()).items():
                if stored not in there:
                    there[stored] = is_dataset(group.get(stored))
                if there[stored]:
                    before = f"{SENSITIVITY}{parameter}/"
                    yield before + name, Location(before + stored, column)

    def signals(self) -> dict[str, int]:
        """Return what has a value at every output time: names, sorted -> numbers of columns."""
        if self._signals is not None:
            return self._signals
        file, found = self._file, {}
        rows = len(file["time"]) if "time" in file else 0
        for name, item in self.datasets().items():
            # /state is the solver's own, in its own layout; points are not one a row
            if not name.startswith(NO_SIGNALS) and is_signal(item, item.shape, rows):
                found[name] = 1 if item.ndim == 1 else item.shape[1]
        located = self.columnwise() | dict(self._slopes())
        shapes = {stored: file[stored] for stored in {s.stored for s in located.values()}}
        for name, (stored, column) in located.items():
            item = shapes[stored]
            if column is not None and item.ndim == 1:
                continue  # one value for each element
            shape = item.shape if column is None else (item.shape[0], *item.shape[2:])
            if is_signal(item, shape, rows):
                found[name] = 1 if len(shape) == 1 else shape[1]
        self._signals = {name: found[name] for name in sorted(found, key=order)}
        return self._signals

    def find(self, name: str) -> tuple[Location, str | None] | None:
        """Return where a name is stored and the part of it asked for, None where nowhere."""
        whole = name.strip("/")
        if not whole:
            return None
        location = self._location(whole)
        if location is not None:
            return location, None
        whole, _, part = whole.rpartition("/")
        location = self._location(whole) if whole else None
        if location is None:
            return None
        dataset = self._file[location.stored]
        columns = dataset.ndim - (location.column is not None)
        if columns != 2:
            return None
        return (location, part) if part in parts_of(dataset.shape[-1]) else None

    def _location(self, name: str) -> Location | None:
        """Return where a signal or table is stored."""
        if name.startswith(SENSITIVITY):
            return self._location_of_slope(name)
        if is_dataset(self._file.get(name)):
            return Location(name, None)
        group, _, rest = name.partition("/")
        id, _, last = rest.partition("/")
        ids = self.columns().get(group)
        if ids is None or last in FACTS or not id.isdecimal() or int(id) not in ids:
            return None
        if not is_dataset(self._file.get(f"{group}/{last}")):
            return None
        return Location(f"{group}/{last}", ids.index(int(id)))

    def _location_of_slope(self, name: str) -> Location | None:
        """Return where a derivative is stored."""
        parameter, signal = of_slope(name)
        location = self._location(signal) if parameter and signal else None
        if location is None:
            return None
        stored = f"{SENSITIVITY}{parameter}/{location.stored}"
        return Location(stored, location.column) if is_dataset(self._file.get(stored)) else None
