"""The form of a result file: what a damaged one may hold instead is refused by `ValueError`."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsim.core.stored import claims_too_much
from mbsim.results.names import PARTS

if TYPE_CHECKING:
    import h5py

#: Groups of a result file that have members or attributes of a known form.
_GROUPS = (
    *("audit", "stats", "checkpoint", "requests", "bodies", "contacts", "energy", "state"),
    *("graphics", "contact_points", "errors", "linear"),
)
_EVENT = ("time", "kind")
#: What a group says of its elements, beside their signals.
FACTS = ("id", "label", "type")
#: Groups of other things than elements.
NO_ELEMENTS = tuple(
    "checkpoint stats audit state energy requests graphics linear sensitivity".split()
)
#: Datasets that are no signals, whatever their shapes.
NO_SIGNALS = ("state/", "contact_points/", "errors/", "linear/")
#: What is no key: what a run goes on from, and what pictures are made of.
NO_KEYS = ("checkpoint/", "graphics/", "markers", "connections")


def is_dataset(item: Any) -> bool:
    """Return whether something is a dataset, of a file or in memory."""
    return hasattr(item, "dtype") and hasattr(item, "shape")  # a named type has no shape


def is_group(item: Any) -> bool:
    """Return whether something is a group, of a file or in memory."""
    return hasattr(item, "visititems")


def facts_of(item: Any) -> dict[str, Any]:
    """Return the attributes of a group, each a number or a text."""
    found = {name: plain(value) for name, value in item.attrs.items()}
    for name, value in found.items():
        if not isinstance(value, (bool, int, float, str)):
            raise ValueError(f"attribute {name} of {item.name} is no number and no text")
    return found


def check_members(file: h5py.File) -> None:
    """Look at the form of what the file holds at its root.

    Raises
    ------
    ValueError
        If something is there that is no member of a result file.
    """
    import h5py

    found = {name: file[name] for name in file}
    for name, item in found.items():
        if name in _GROUPS and not isinstance(item, h5py.Group):
            raise ValueError(f"{item.name} is no group")
    time, events = found.get("time"), found.get("events")
    if time is not None and not (_is_table(time, 1) and time.dtype.kind in "iuf"):
        raise ValueError("/time is no list of numbers")
    if events is not None and not (
        _is_table(events, 1) and set(_EVENT) <= set(events.dtype.names or ())
    ):
        raise ValueError("/events is no list of events")
    for name, item in found.items():
        ids = item.get("id") if isinstance(item, h5py.Group) else None
        if ids is not None and not (_is_table(ids, 1) and ids.dtype.kind in "iu"):
            raise ValueError(f"/{name}/id is no list of whole numbers")
        if ids is not None:
            _check_columns(item, len(ids))


def _check_columns(group: h5py.Group, count: int) -> None:
    """Look whether what a group says of its elements has a value for each of them.

    Raises
    ------
    ValueError
        If it has not.
    """
    for name, item in group.items():
        peak = name.startswith("peak_")
        if not (peak or name in FACTS) or not hasattr(item, "dtype"):
            continue
        if not _is_table(item, 1) or len(item) != count:
            raise ValueError(f"{item.name} has not one value for each id")
        if peak and item.dtype.kind not in "iuf":
            raise ValueError(f"{item.name} is no list of numbers")


def _is_table(item: Any, axes: int) -> bool:
    """Return whether something is a dataset with so many axes."""
    return getattr(item, "shape", None) is not None and len(item.shape) == axes


def values_of(dataset: h5py.Dataset, index: Any = ()) -> Any:
    """Return values of a dataset, if they can be there."""
    # in memory and where there are checksums it is as it was made
    known = dataset.file.driver in ("fileobj", "memory")
    if not known and claims_too_much(dataset) and not _may_be_zeros(dataset):
        raise ValueError(f"{dataset.name} is said to be larger than what is stored")
    return dataset[index]


def _may_be_zeros(dataset: h5py.Dataset) -> bool:
    """Return whether a dataset is a signal of all rows, of which zeros take no room."""
    time, ids = dataset.file.get("time"), dataset.parent.get("id")
    if time is None or claims_too_much(time) or dataset.shape[:1] != time.shape:
        return False
    widths = dataset.shape[1:]
    if ids is not None and widths[:1] == ids.shape and not claims_too_much(ids):
        widths = widths[1:]
    # a request has the most
    return len(widths) <= 1 and all(width <= 8 for width in widths)


def plain(value: Any) -> Any:
    """Return numbers and text as Python has them; arrays and tables as numpy has them."""
    if isinstance(value, bytes):
        return value.decode("utf-8", "replace")
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, np.ndarray) and value.dtype.names:
        # fixed-length bytes as text, so that events["kind"] == "touch" works
        found = {name: value[name] for name in value.dtype.names}
        for name, column in found.items():
            if column.dtype.kind == "S":
                found[name] = np.char.decode(column, "utf-8", "replace")
        types = [(name, each.dtype, each.shape[value.ndim :]) for name, each in found.items()]
        table = np.empty(value.shape, dtype=types)
        for name, column in found.items():
            table[name] = column
        return table
    return value


def text_of(item: Any, name: str, value: Any) -> str:
    """Return a fact of an element that is a text."""
    found = plain(value)
    if not isinstance(found, str):
        raise ValueError(f"{name} of {item.name} is no text")
    return found


def last_row(table: Any) -> Any:
    """Return the last row of a signal, which has numbers."""
    found = np.asarray(table[-1])
    if found.dtype.kind not in "iuf":
        raise ValueError("a signal is no numbers")
    return found


def texts_of(item: Any, name: str, value: Any) -> list[str]:
    """Return an attribute that has a text for each column of a dataset."""
    found = value.tolist() if isinstance(value, np.ndarray) else value
    texts = isinstance(found, list) and all(isinstance(each, str) for each in found)
    if not texts or len(found) != item.shape[-1]:
        raise ValueError(f"{name} of {item.name} is no text for each column")
    return list(found)


def finite(value: Any) -> Any:
    """Return a value for JSON, which has no infinity and no NaN: null in their place."""
    if isinstance(value, float) and not math.isfinite(value):
        return None
    if isinstance(value, dict):
        return {str(key): finite(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [finite(item) for item in value]
    return finite(value.tolist()) if isinstance(value, (np.ndarray, np.generic)) else value


def is_signal(item: Any, shape: tuple[int, ...], rows: int) -> bool:
    """Return whether a dataset whose element has that shape is numbers over output times."""
    if shape[:1] != (rows,) or item.dtype.kind not in "iuf" or len(shape) > 2:
        return False
    return (1 if len(shape) == 1 else shape[1]) in (1, *PARTS)
