"""`open_results`: signals of a result file by name."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsim.errors import NoSuchResults, ResultsError, UnknownSignal
from mbsim.results.audit import Audit, from_attributes
from mbsim.results.damage import DAMAGE, reads, said_of
from mbsim.results.error_reading import Errors
from mbsim.results.form import (
    FACTS,
    check_members,
    facts_of,
    is_dataset,
    is_group,
    last_row,
    plain,
    text_of,
    texts_of,
    values_of,
)
from mbsim.results.linear import WithLinear
from mbsim.results.mapping import SignalMapping
from mbsim.results.names import (
    PARTS,
    SENSITIVITY,
    by_label,
    compact,
    is_pattern,
    matching,
    nearest,
    order,
    parts_of,
)
from mbsim.results.opening import opened_file
from mbsim.results.sensitivities import WithSensitivities
from mbsim.results.signal_index import Location, SignalIndex

if TYPE_CHECKING:
    import h5py


#: A column of a run's .csv, and how names for `mbsim request` begin.
_CSV_COLUMN, _OF_REQUEST = re.compile(r"(\d+)\.(F[1-8])"), re.compile(r"Force_Contact\[\d+\]\.")
#: Attributes that have a text for each column.
_LISTS = ("columns", "measures")


class Results(SignalMapping, WithSensitivities, WithLinear):
    """What a run recorded; `results["bodies/2/position"]` is an array over output times.

    A name may end in ``/x``, ``/y``, ``/z`` or ``/mag`` (a quaternion also in ``/w``, a request
    in ``/F1`` to ``/F8``), and begin with ``sensitivity/<parameter>/``. Scalars come as numbers.
    Use it as a context manager or call `close` to let go of the file, which is h5py's or, in
    memory, a `MemoryFile`.
    """

    def __init__(self, file: h5py.File, path: Path | None) -> None:
        self.path = path
        self._read_from(file)

    def _read_from(self, file: h5py.File) -> None:
        """Look at this file from here on."""
        self._file = file
        self._looked_up = SignalIndex(file)

    def _itself(self) -> Results:
        return self

    def __enter__(self) -> Results:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def __repr__(self) -> str:
        if not self._file:
            return f"<Results {self.path or 'in memory'}, closed>"
        rows = len(self._file["time"]) if "time" in self._file else 0
        return f"<Results {self.path or 'in memory'}, {self.status}, {rows} rows>"

    def close(self) -> None:
        """Let go of the file; results in memory are gone then."""
        self._file.close()

    @property
    def closed(self) -> bool:
        """Whether the file was let go of."""
        return not self._file

    def refresh(self) -> int:
        """Look at what a run that goes on has published since; return how many rows are new.

        Results in memory stay as they are.
        """
        before = len(self["time"]) if "time" in self else 0
        if self.path is None:
            return 0
        found = open_results(self.path)
        self._file.close()
        self._read_from(found._file)
        return (len(self["time"]) if "time" in self else 0) - before

    @reads
    def __reduce__(self) -> tuple[Any, ...]:
        """Let a copy in another process open the file anew; results in memory take it along."""
        if self.path is not None:
            return open_results, (str(self.path.absolute()),)
        return Results, (self._open(), None)

    def _open(self) -> h5py.File:
        if not self._file:
            raise ResultsError(f"{self.path or 'results in memory'}: the results are closed")
        return self._file

    @property
    def _index(self) -> SignalIndex:
        self._open()
        return self._looked_up

    @property
    @reads
    def attributes(self) -> dict[str, Any]:
        """Attributes of the file: version, model, units, settings, status."""
        return facts_of(self._open())

    @property
    def checked(self) -> bool:
        """Whether the file ends with checksums, to which all that is read of it is compared."""
        return bool(self._open().driver == "fileobj")

    @property
    def status(self) -> str:
        """``running`` (killed before its end), ``finished``, ``interrupted`` or ``failed``."""
        return str(self.attributes.get("status", "unknown"))

    @property
    @reads
    def stats(self) -> dict[str, Any]:
        """Counters and times of the run; empty if it was killed."""
        if "stats" not in self._open():
            return {}
        return facts_of(self._open()["stats"])

    @property
    @reads
    def audit(self) -> Audit | None:
        """What the run found out about itself; None if it was killed, or never took a step."""
        file = self._open()
        if "audit" not in file:
            return None
        found = {"audit": facts_of(file["audit"])}

        def note(name: str, item: Any) -> None:
            if len(item.attrs):
                found[f"audit/{name}"] = facts_of(item)

        file["audit"].visititems(note)
        return from_attributes(found)

    @reads
    def keys(self) -> list[str]:
        """Names of all signals and tables, sorted as numbers where they are.

        Without the checkpoint, and without what only pictures need.
        """
        return self._index.keys()

    @reads
    def signals(self) -> dict[str, int]:
        """Return what has a value at every output time: names, sorted -> numbers of columns."""
        return self._index.signals()

    @property
    def errors(self) -> Errors:
        """Error bars of a run with ``verify``; names as those of signals."""
        return Errors(self)

    def find(self, name: str) -> list[str]:
        """Return the names of signals that a name stands for; a plain one stands for itself.

        Parameters
        ----------
        name : str
            May have wildcards between its slashes: ``bodies/*/velocity/mag``.

        Raises
        ------
        UnknownSignal
            If there is none, or what is there is no signal over output times.
        """
        signals = self.signals()
        if is_pattern(name):
            found = matching(name, signals)
        else:
            # written once, whatever the slashes around it
            found = [name.strip("/")] if name in self else []
        if not found:
            raise UnknownSignal(self._missing(name, signals))
        whole = found[0] if found[0] in signals else found[0].rpartition("/")[0]
        if whole not in signals:
            raise UnknownSignal(f"{self.place}: {name} is no signal over time{self._there()}")
        return found

    def label(self, name: str) -> str:
        """Return what the deck calls a body, contact or request: ``bodies/2``; else nothing."""
        return str(self.attribute(name, "label") or "")

    @reads
    def attribute(self, name: str, attribute: str) -> Any:
        """Return an attribute of a dataset or group, or a fact of an element; None if it has none.

        Parameters
        ----------
        name : str
            ``requests/7``, ``joints/3``.
        attribute : str
            ``columns``; of an element ``label`` or ``type``.
        """
        file = self._open()
        group, _, id = name.strip("/").partition("/")
        ids = self._index.columns().get(group)
        if ids is not None and id.isdecimal() and int(id) in ids:
            if attribute not in FACTS or attribute not in file[group]:
                return None
            return text_of(file[group], attribute, file[group][attribute][ids.index(int(id))])
        item = file.get(name)
        value: Any = item.attrs.get(attribute) if item is not None else None
        if value is None:
            return None
        if attribute in _LISTS:
            return texts_of(item, attribute, value)
        return text_of(item, attribute, value) if attribute in FACTS else plain(value)

    @property
    @reads
    def has_checkpoint(self) -> bool:
        """Whether a run can go on from here."""
        return "checkpoint" in self._open()

    @reads
    def tables(self, group: str) -> dict[str, Any]:
        """Return all datasets under a group as arrays, by their names in it."""
        found: dict[str, Any] = {}

        def note(name: str, item: Any) -> None:
            if is_dataset(item):
                found[name] = np.asarray(values_of(item))

        self._open()[group].visititems(note)
        return found

    @reads
    def ids(self, group: str) -> list[int]:
        """Ids of ``bodies``, ``contacts``, ``joints`` or ``requests``, ascending."""
        there = self._index.columns().get(group, ())
        stored = (int(id) for id in self._open().get(group, ()) if id.isdecimal())
        return sorted({*there, *stored})

    def __contains__(self, name: object) -> bool:
        return isinstance(name, str) and self._find(name) is not None

    def __getitem__(self, name: str) -> Any:
        """Return a signal, shape (n, ...), in model units.

        Raises
        ------
        UnknownSignal
            If there is none of this name; the message says what is near and what there is.
        """
        found = self._find(name := str(name))
        if found is None:
            raise UnknownSignal(self._missing(name, self.keys()))
        return self._values(*found)

    @reads
    def _values(self, location: Location, part: str | None) -> Any:
        """Return a signal or a part of it."""
        dataset = self._open()[location.stored]
        index: list[Any] = [slice(None)] * dataset.ndim
        if location.column is not None:
            index[0 if dataset.ndim == 1 else 1] = location.column
        if part not in (None, "mag"):
            index[-1] = PARTS[dataset.shape[-1]][part]
        values = plain(values_of(dataset, tuple(index)))
        if part != "mag":
            return values
        if location.stored.startswith(SENSITIVITY):
            return self._slope_of_size(location, values)
        return np.linalg.norm(values, axis=1)

    @reads
    def _find(self, name: str) -> tuple[Location, str | None] | None:
        """Return where a name is stored and the part of it asked for."""
        return self._index.find(name)

    @reads
    def located(self, name: str) -> tuple[h5py.File, Location | None, str | None]:
        """Return the file, and where in it a name is stored and its part: None where nowhere."""
        return self._open(), *(self._find(name) or (None, None))

    @reads
    def last(self, group: str, signal: str) -> dict[int, Any]:
        """Return the last row of a signal of all elements of a group, by id."""
        ids = self._index.columns().get(group)
        if ids is None:
            names = {id: f"{group}/{id}/{signal}" for id in self.ids(group)}
            return {id: last_row(self[name]) for id, name in names.items() if name in self}
        if f"{group}/{signal}" not in self._open():
            return {}
        table = self._open()[f"{group}/{signal}"]
        return dict(zip(ids, last_row(table), strict=True)) if len(table) else {}

    @property
    def place(self) -> str:
        """Where the results are, in words."""
        return str(self.path or "results in memory")

    def _missing(self, name: str, known: Iterable[str]) -> str:
        """Return what to say of a name that is not there: nearest first, then what there is.

        `known` are names that may be offered.
        """
        asked = name.strip("/")
        depth = len(asked) + 1 if asked else 0
        inside = {
            key[depth:].partition("/")[0] for key in self.keys() if key[:depth] == f"{asked}/"
        }
        if depth and (inside or is_group(self._open().get(asked))):
            there = ", ".join(sorted(inside, key=order)[:12]) or "nothing"
            return f"{self.place}: {name} is a group, not a signal; it has {there}"
        signals = self.signals()
        whole, _, part = asked.rpartition("/")
        if whole in signals and not is_pattern(part):
            parts = ", ".join(parts_of(signals[whole])) or "no parts"
            return f"{self.place}: no signal {name!r}; {whole} has {parts}"
        column = _CSV_COLUMN.fullmatch(asked)
        written = f"requests/{column[1]}/{column[2]}" if column else ""
        group = asked.partition("/")[0]
        labels = {self.label(f"{group}/{id}"): id for id in self.ids(group)}
        written = written or by_label(asked, labels) or ""
        near = [written] if written and written in self else nearest(asked, known)
        hint = f"; did you mean {' or '.join(near)}?" if near else ""
        if _OF_REQUEST.match(asked):
            hint = "; names with Force_Contact[ID]. are for mbsim request"
        return f"{self.place}: no signal {name!r}{hint}{self._there()}"

    def _there(self) -> str:
        """Return all signals, with ids taken together, as the end of a message."""
        return f"; there is {', '.join(compact(self.signals())) or 'nothing'}"


def open_results(path: str | Path) -> Results:
    """Open a result file.

    Parameters
    ----------
    path : path-like
        ``<model>.h5``, of a finished run or not: what a run that still goes on or was
        killed has published is complete in itself.

    Raises
    ------
    ResultsError
        If the file is not there or is no result file of mbsim.
    """
    file = Path(path)
    if not file.is_file():
        what = "is a folder" if file.is_dir() else "no such file"
        raise NoSuchResults(f"{file}: {what}; a result file is named <model>.h5")
    try:
        opened = opened_file(file)
    except OSError as error:
        reason = getattr(error, "strerror", None) or "not an HDF5 file, or a damaged one"
        if file.suffix.lower() in (".xml", ".adm"):
            reason = f"a deck; its result file is {file.stem}/{file.stem}.h5 after mbsim run {file}"
        raise ResultsError(f"{file}: cannot be read: {reason}") from None
    try:
        ours = "mbsim_version" in opened.attrs
        if ours:
            check_members(opened)
            facts_of(opened)
    except DAMAGE as error:
        opened.close()
        raise ResultsError(f"{file}: {said_of(error)}") from None
    if not ours:
        problem = any(str(name).startswith("fclib_") for name in opened)
        opened.close()
        hint = "; mbsim fclib info shows such a contact problem" if problem else ""
        raise ResultsError(f"{file}: is HDF5, but not a result file of mbsim{hint}")
    return Results(opened, file)


def end_state(results: Results) -> dict[str, dict[str, list[float]]]:
    """Return every body's pose and velocity in the last row, by id; empty without rows."""
    if not len(results["time"]):
        return {}
    found: dict[str, dict[str, list[float]]] = {str(id): {} for id in results.ids("bodies")}
    for name in ("position", "quaternion", "velocity", "angular_velocity"):
        for id, values in results.last("bodies", name).items():
            found[str(id)][name] = np.atleast_1d(values).tolist()
    return found
