"""`open_results`: signals of a result file by name."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, TypeVar, cast

import numpy as np

from mbsim.errors import ResultsError, UnknownSignal
from mbsim.results.audit import Audit, from_attributes
from mbsim.results.names import PARTS, compact, is_pattern, matching, nearest, order, parts_of

if TYPE_CHECKING:
    import h5py


#: What h5py raises where a file is damaged.
_DAMAGE = (OSError, RuntimeError, KeyError, ValueError, MemoryError)
_Read = TypeVar("_Read", bound=Callable[..., Any])


def _reads(method: _Read) -> _Read:
    """Turn what h5py raises of a damaged file into one `ResultsError` that names the file."""

    @functools.wraps(method)
    def reading(self: Results, *arguments: Any) -> Any:
        try:
            return method(self, *arguments)
        except _DAMAGE as error:
            raise ResultsError(f"{self._where}: {_damage(error)}") from None

    return cast(_Read, reading)


def _damage(error: BaseException) -> str:
    """Return what to say of a file that h5py cannot read."""
    text = " ".join(str(error.args[0] if error.args else error).split())
    return f"cannot be read, the file is damaged: {text or type(error).__name__}"


class Results:
    """What a run recorded; `results["bodies/2/position"]` is an array over output times.

    A name may end in ``/x``, ``/y``, ``/z`` or ``/mag`` (a quaternion also in ``/w``, a request
    in ``/F1`` to ``/F8``). Scalars come as numbers. Use it as a context manager or call
    `close` to let go of the file.
    """

    def __init__(self, file: h5py.File, path: Path | None) -> None:
        self._file = file
        self.path = path
        self._signals: dict[str, int] | None = None  # once they were looked up

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

    def _open(self) -> h5py.File:
        if not self._file:
            raise ResultsError(f"{self.path or 'results in memory'}: the results are closed")
        return self._file

    @property
    @_reads
    def attributes(self) -> dict[str, Any]:
        """Attributes of the file: version, model, units, settings, status."""
        return {name: _plain(value) for name, value in self._open().attrs.items()}

    @property
    def status(self) -> str:
        """``running`` (killed before its end), ``finished``, ``interrupted`` or ``failed``."""
        return str(self.attributes.get("status", "unknown"))

    @property
    @_reads
    def stats(self) -> dict[str, Any]:
        """Counters and times of the run; empty if it was killed."""
        if "stats" not in self._open():
            return {}
        return {name: _plain(value) for name, value in self._open()["stats"].attrs.items()}

    @property
    @_reads
    def audit(self) -> Audit | None:
        """What the run found out about itself; None if it was killed, or never took a step."""
        file = self._open()
        if "audit" not in file:
            return None
        found = {"audit": _facts(file["audit"])}

        def note(name: str, item: Any) -> None:
            if len(item.attrs):
                found[f"audit/{name}"] = _facts(item)

        file["audit"].visititems(note)
        return from_attributes(found)

    @_reads
    def keys(self) -> list[str]:
        """Names of all signals and tables, sorted as numbers where they are; no checkpoint."""
        import h5py

        names: list[str] = []

        def note(name: str, item: Any) -> None:
            if isinstance(item, h5py.Dataset) and not name.startswith("checkpoint/"):
                names.append(name)

        self._open().visititems(note)
        return sorted(names, key=order)

    @_reads
    def signals(self) -> dict[str, int]:
        """Return what has a value at every output time: names, sorted -> numbers of columns."""
        if self._signals is not None:
            return self._signals
        file, found = self._open(), {}
        rows = len(file["time"]) if "time" in file else 0
        for name in self.keys():
            item = file[name]
            # /state is the solver's own, in its own layout
            if item.shape[:1] != (rows,) or item.dtype.kind not in "iuf":
                continue
            columns = 1 if item.ndim == 1 else item.shape[1]
            if not name.startswith("state/") and item.ndim <= 2 and columns in (1, *PARTS):
                found[name] = columns
        self._signals = found
        return found

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
            raise UnknownSignal(self._missing(name))
        whole = found[0] if found[0] in signals else found[0].rpartition("/")[0]
        if whole not in signals:
            raise UnknownSignal(f"{self._where}: {name} is no signal over time{self._there()}")
        return found

    @_reads
    def label(self, name: str) -> str:
        """Return what the deck calls a body, contact or request: ``bodies/2``; else nothing."""
        item = self._open().get(name)
        return str(_plain(item.attrs.get("label", ""))) if item is not None else ""

    @_reads
    def attribute(self, name: str, attribute: str) -> Any:
        """Return an attribute of a dataset or group, None if it has none."""
        item = self._open().get(name)
        value: Any = item.attrs.get(attribute) if item is not None else None
        return value.tolist() if isinstance(value, (np.ndarray, np.generic)) else value

    @property
    @_reads
    def has_checkpoint(self) -> bool:
        """Whether a run can go on from here."""
        return "checkpoint" in self._open()

    @_reads
    def tables(self, group: str) -> dict[str, Any]:
        """Return all datasets under a group as arrays, by their names in it."""
        import h5py

        found: dict[str, Any] = {}

        def note(name: str, item: Any) -> None:
            if isinstance(item, h5py.Dataset):
                found[name] = np.asarray(item[()])

        self._open()[group].visititems(note)
        return found

    @_reads
    def ids(self, group: str) -> list[int]:
        """Ids of ``bodies``, ``contacts``, ``joints`` or ``requests``, ascending."""
        return sorted(int(id) for id in self._open().get(group, ()))

    def __contains__(self, name: object) -> bool:
        return isinstance(name, str) and self._find(name) is not None

    def __getitem__(self, name: str) -> Any:
        """Return a signal, shape (n, ...), in model units.

        Raises
        ------
        UnknownSignal
            If there is none of this name; the message says what is near and what there is.
        """
        found = self._find(name)
        if found is None:
            raise UnknownSignal(self._missing(name))
        return self._values(*found)

    @_reads
    def _values(self, dataset: h5py.Dataset, part: str | None) -> Any:
        """Return a signal or a part of it."""
        if part is None:
            return _plain(dataset[()])
        if part == "mag":
            return np.linalg.norm(dataset[()], axis=1)
        return dataset[:, PARTS[dataset.shape[1]][part]]

    @_reads
    def _find(self, name: str) -> tuple[h5py.Dataset, str | None] | None:
        """Return the dataset of a name and the part of it asked for."""
        import h5py

        file, whole = self._open(), name.strip("/")
        if not whole:
            return None
        item = file.get(whole)
        if isinstance(item, h5py.Dataset):
            return item, None
        whole, _, part = whole.rpartition("/")
        item = file.get(whole) if whole else None
        if not isinstance(item, h5py.Dataset) or item.ndim != 2:
            return None
        return (item, part) if part in parts_of(item.shape[1]) else None

    @property
    def _where(self) -> str:
        return str(self.path or "results in memory")

    def _missing(self, name: str) -> str:
        """Return what to say of a name that is not there: nearest first, then what there is."""
        import h5py

        asked = name.strip("/")
        item = self._open().get(asked) if asked else None
        if isinstance(item, h5py.Group):
            inside = ", ".join(sorted(item, key=order)[:12])
            return f"{self._where}: {name} is a group, not a signal; it has {inside or 'nothing'}"
        signals = self.signals()
        whole, _, part = asked.rpartition("/")
        if whole in signals and not is_pattern(part):
            parts = ", ".join(parts_of(signals[whole])) or "no parts"
            return f"{self._where}: no signal {name!r}; {whole} has {parts}"
        near = nearest(asked, self.keys())
        hint = f"; did you mean {' or '.join(near)}?" if near else ""
        return f"{self._where}: no signal {name!r}{hint}{self._there()}"

    def _there(self) -> str:
        """Return all signals, with ids taken together, as the end of a message."""
        return f"; there is {', '.join(compact(self.signals())) or 'nothing'}"


def _facts(item: Any) -> dict[str, Any]:
    """Return the attributes of a group."""
    return {name: _plain(value) for name, value in item.attrs.items()}


def _plain(value: Any) -> Any:
    """Return numbers and text as Python has them; arrays and tables as numpy has them."""
    if isinstance(value, bytes):
        return value.decode("utf-8", "replace")
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, np.ndarray) and value.dtype.names:
        # fixed-length bytes as text, so that events["kind"] == "touch" works
        fields = [(name, value.dtype[name].str.replace("|S", "<U")) for name in value.dtype.names]
        return value.astype(fields)
    return value


def finite(value: Any) -> Any:
    """Return a value for JSON, which has no infinity and no NaN: null in their place."""
    if isinstance(value, float) and not math.isfinite(value):
        return None
    if isinstance(value, dict):
        return {str(key): finite(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [finite(item) for item in value]
    return finite(value.tolist()) if isinstance(value, (np.ndarray, np.generic)) else value


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
    import h5py

    file = Path(path)
    if not file.is_file():
        what = "is a folder" if file.is_dir() else "no such file"
        raise ResultsError(f"{file}: {what}; a result file is named <model>.h5")
    try:
        opened = h5py.File(file, "r", locking=False)
    except OSError as error:
        reason = getattr(error, "strerror", None) or "not an HDF5 file, or a damaged one"
        raise ResultsError(f"{file}: cannot be read: {reason}") from None
    try:
        ours = "mbsim_version" in opened.attrs
    except _DAMAGE as error:
        opened.close()
        raise ResultsError(f"{file}: {_damage(error)}") from None
    if not ours:
        opened.close()
        raise ResultsError(f"{file}: is HDF5, but not a result file of mbsim")
    return Results(opened, file)


def end_state(results: Results) -> dict[str, dict[str, list[float]]]:
    """Return every body's pose and velocity in the last row, by id; empty without rows."""
    if not len(results["time"]):
        return {}
    names = ("position", "quaternion", "velocity", "angular_velocity")
    return {
        str(id): {name: results[f"bodies/{id}/{name}"][-1].tolist() for name in names}
        for id in results.ids("bodies")
    }
