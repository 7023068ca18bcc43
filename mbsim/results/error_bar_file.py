"""Error bars in a result file: what they are made of, and `/errors/<dataset>`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsim.results.form import FACTS, values_of
from mbsim.results.reading import Results, open_results
from mbsim.results.store import Store

if TYPE_CHECKING:
    from mbsim.results.error_bars import Bars

#: What is not held against reruns: times themselves, and the solver's own.
_ASIDES = ("time", "state/", "errors/", "checkpoint/", "linear/")


def over_time(results: Results) -> dict[str, Any]:
    """Return the datasets of signals over time, whole, by their names in the file; `time` too."""
    file, *_ = results.located("time")
    names: list[str] = []
    file.visit(names.append)
    found = {"time": np.asarray(values_of(file["time"]))}
    for name in names:
        item, last = file[name], name.rpartition("/")[2]
        if name.startswith(_ASIDES) or last in FACTS or last.startswith("peak_"):
            continue
        if hasattr(item, "dtype") and item.dtype.kind in "iuf":
            if item.shape[:1] == found["time"].shape:
                found[name] = np.asarray(values_of(item))
    return found


def kept(results: Results, bars: Bars) -> Results:
    """Write error bars into the file of results; return it as it is then."""
    until = {"reproducible_until": bars.reproducible_until}
    return with_tables(results, bars.tables, dict.fromkeys(bars.tables, until))


def with_tables(
    results: Results, tables: Mapping[str, Any], about: Mapping[str, Mapping[str, Any]]
) -> Results:
    """Write datasets, and attributes of datasets and groups, into the file of results.

    Returns
    -------
    Results
        As the file is then.
    """
    if results.path is None:
        file, *_ = results.located("time")
        for name, table in tables.items():
            file.create_dataset(name, data=table)
        for name, facts in about.items():
            file[name].attrs.update(facts)
        return Results(file, None)  # who has looked names up already knows none of these
    path = results.path
    results.close()
    store = Store(path, resume=True)
    store.update(values=tables, attributes=about)
    store.finish()
    return open_results(path)
