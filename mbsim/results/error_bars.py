"""Error bars by reruns: how far a run is off its reruns, signal by signal; see `run.verify`.

The rows of a run are divided into windows of time. In each a signal is off by the largest distance
between run and rerun; an error does not vanish at once, so a window is off by a part of what the
one before was at least. Bars are twice that, and no less than rounding.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

Array = np.ndarray[Any, Any]

WINDOWS = 40
#: What a window keeps of the bar of the one before.
DECAY = 0.8
#: Bars of signals are so many distances, those of events and peaks so many.
FACTOR, FACTOR_ONCE = 2.0, 3.0
#: Of the scale of a signal's kind: nothing is known better.
FLOOR = 1e-9
#: Of the range of positions: from where they are off by more, results are unsure, and not
#: reproducible.
UNSURE, LOST = 0.03, 0.10
#: Positions that range over less than so many errors of a step are those of what rests: that they
#: are off by a part of it says nothing.
RESTS = 100.0
#: Rows of two runs are at one time if they differ by less than this, relative.
_SAME_TIME = 1e-9
#: Columns of a request that are one vector each: with its magnitude.
_HALVES = (slice(0, 4), slice(4, 8))


@dataclass
class Bars:
    """Error bars of a run's datasets, by their names in the file, and what is said of them."""

    tables: dict[str, Array]
    #: Time from which results are not reproducible; inf if there is none.
    reproducible_until: float
    #: Bar of the sum of energies [F L].
    energy: float
    lines: list[str]


def distance(name: str, run: Array, rerun: Array) -> Array:
    """Return how far rows are apart: vectors by the length of the difference.

    Parameters
    ----------
    name : str
        Of the dataset.
    run, rerun : ndarray, shape (n, ...)
        Rows at the same times.

    Returns
    -------
    ndarray
        Without the axis of a vector; of requests (n, 8).
    """
    run, rerun = np.asarray(run, dtype=float), np.asarray(rerun, dtype=float)
    apart: Array = np.abs(run - rerun)
    if name.startswith("requests/"):
        if apart.ndim == 2 and apart.shape[1] == 8:
            # a vector's magnitude is off by no more than the vector
            for half in _HALVES:
                apart[:, half] = np.maximum(
                    apart[:, half], np.linalg.norm(apart[:, half][:, 1:], axis=1)[:, None]
                )
        return apart
    vector = run.ndim == 3 or (run.ndim == 2 and name.count("/") > 1)
    if not vector or run.shape[-1] == 1:
        return apart
    found: Array = np.linalg.norm(apart, axis=-1)
    if name.endswith("quaternion"):  # q and -q are one orientation
        found = np.minimum(found, np.asarray(np.linalg.norm(run + rerun, axis=-1)))
    return found


def scale_of(name: str, run: Array) -> float:
    """Return the scale of a kind of signal: the largest range of an element, else its size."""
    values = np.asarray(run, dtype=float)
    if not values.size:
        return 0.0
    spread = values.max(axis=0) - values.min(axis=0)
    if values.ndim == 3:
        spread = np.linalg.norm(spread, axis=-1)
    if name.startswith("energy/"):
        return float(np.abs(values).max())
    return float(spread.max()) or float(np.abs(values).max())


def paired(time: Array, other: Array) -> tuple[Array, Array]:
    """Return the rows of two runs that are at the same times."""
    scale = max(float(np.abs(time).max(initial=0.0)), 1e-300)
    at = np.clip(np.searchsorted(other, time - _SAME_TIME * scale), 0, max(len(other) - 1, 0))
    same = np.abs(other[at] - time) <= _SAME_TIME * scale if len(other) else np.zeros(0, bool)
    rows = np.flatnonzero(same)
    return rows, at[rows]


def windows_of(time: Array) -> Array:
    """Return the window of each row."""
    span = float(time[-1] - time[0]) if len(time) else 0.0
    if span <= 0.0:
        return np.zeros(len(time), dtype=np.int64)
    passed = (WINDOWS * (time - time[0]) / span).astype(np.int64)
    return np.asarray(np.minimum(passed, WINDOWS - 1))


def widened(apart: Array, window: Array) -> Array:
    """Return the bar of each row, before it is doubled: of its window and of those before.

    Parameters
    ----------
    apart : ndarray, shape (n, ...)
        Distances, NaN where there is no rerun.
    window : ndarray, shape (n,)
    """
    most = np.zeros((WINDOWS, *apart.shape[1:]))
    np.maximum.at(most, window, np.nan_to_num(apart, nan=0.0, posinf=np.inf))
    for k in range(1, WINDOWS):
        most[k] = np.maximum(most[k], DECAY * most[k - 1])
    found: Array = most[window]
    found[np.isnan(apart)] = math.inf
    return found


def apart_from(run: Mapping[str, Array], rerun: Mapping[str, Array]) -> dict[str, Array]:
    """Return the distances of all datasets of a run to a rerun; NaN where it has no row."""
    time = run["time"]
    mine, its = paired(time, rerun["time"])
    found = {}
    for name, table in run.items():
        other = rerun.get(name)
        if name == "time":
            continue
        shape = distance(name, table[:1], table[:1]).shape[1:]
        apart = np.full((len(time), *shape), math.nan)
        if other is not None and other.shape[1:] == table.shape[1:] and len(mine):
            apart[mine] = distance(name, table[mine], other[its])
        found[name] = apart
    return found


def events_apart(events: Any, reruns: Sequence[Any]) -> tuple[Array, list[str]]:
    """Return bars of the times of events, NaN where no rerun has one, and what differs in number.

    The n-th event of a kind and element is held against the n-th of the rerun.
    """
    bars, said = np.zeros(len(events)), []
    keys = list(
        dict.fromkeys(zip(events["kind"].tolist(), events["element"].tolist(), strict=True))
    )
    for other in reruns:
        for kind, element in keys:
            mine = np.flatnonzero((events["kind"] == kind) & (events["element"] == element))
            its = other["time"][(other["kind"] == kind) & (other["element"] == element)]
            both = min(len(mine), len(its))
            bars[mine[:both]] = np.maximum(
                bars[mine[:both]], FACTOR_ONCE * np.abs(events["time"][mine[:both]] - its[:both])
            )
            bars[mine[both:]] = math.nan
            if len(mine) != len(its):
                said.append(f"{kind} of {element}: {len(mine)} times, {len(its)} in a rerun")
    return bars, list(dict.fromkeys(said))


def horizons(time: Array, positions: Array, scale: float) -> tuple[float, float]:
    """Return the times until which results are sure, and reproducible; inf for always.

    `positions` are bars of positions, before they are doubled, shape (n, bodies).
    """

    def first(limit: float) -> float:
        off = np.flatnonzero((positions > limit * scale).any(axis=1))
        return float(time[off[0]]) if len(off) and scale > 0.0 else math.inf

    return first(UNSURE), first(LOST)


def _kind(name: str) -> str:
    """Return what has one scale: position of bodies, all energies, a request."""
    group, _, last = name.partition("/")
    return "energy" if group == "energy" else name if group == "requests" else last


def _scales(held: Mapping[str, Array]) -> dict[str, float]:
    """Return the scale of every kind of signal, and of torques no less than that of forces."""
    found: dict[str, float] = {}
    for name, table in held.items():
        if name != "time":
            kind = _kind(name)
            found[kind] = max(found.get(kind, 0.0), scale_of(name, table))
    if "torque" in found:
        # of bodies that do not turn it is rounding alone
        arm = found.get("position", 0.0)
        found["torque"] = max(found["torque"], found.get("force", 0.0) * arm)
    return found


def make(
    held: Mapping[str, Array],
    apart: Sequence[Mapping[str, Array]],
    events: Any,
    others: Sequence[Any],
    peaks: Mapping[str, Array],
    notes: Sequence[str] = (),
    step_error: float = 0.0,
) -> Bars:
    """Return the error bars of a run.

    Parameters
    ----------
    held : mapping
        Datasets of the run by name, and its times.
    apart : sequence of mapping
        Of every rerun the distances, as `apart_from` gives them.
    events, others
        Tables of events of the run, and of the reruns.
    peaks : mapping
        Bars of largest values, by dataset.
    notes : sequence of str
        What is to be said first.
    step_error : float
        What positions may be off by in a step [L].
    """
    time = held["time"]
    window, scales = windows_of(time), _scales(held)
    tables: dict[str, Array] = {f"errors/{name}": value for name, value in peaks.items()}
    sure = lost = math.inf
    lines, energy = list(notes), 0.0
    for name in apart[0]:
        # of several reruns the largest distance, where there is one
        most = np.fmax.reduce([one[name] for one in apart])
        bar, kind = widened(most, window), _kind(name)
        if name == "bodies/position":
            sure, lost = horizons(time, bar, max(scales[kind], RESTS * step_error))
            ends = np.flatnonzero(np.isinf(bar).any(axis=1))
            if len(ends):
                lines.append(f"unverified from time {time[ends[0]]:.6g} on")
        bar = np.maximum(FACTOR * bar, FLOOR * scales[kind])
        tables[f"errors/{name}"] = bar
        if kind == "energy":
            energy += float(bar.max(initial=0.0))
    lines += list(_worst(time, held, tables, scales))
    table, differing = events_apart(events, others)
    tables["errors/events"] = table
    if len(table) and np.isfinite(table).any():
        k = int(np.nanargmax(table))
        if table[k] > 0.0:
            lines.append(f"error of times of events: {table[k]:.2g}, at {events['time'][k]:.6g}")
    lines += [f"warning: events differ: {line}" for line in differing[:3]]
    if math.isfinite(sure):
        lines.append(f"warning: positions are unsure by 3 % of their range from time {sure:.6g} on")
    if math.isfinite(lost):
        lines.append(f"warning: results are not reproducible from time {lost:.6g} on")
    return Bars(tables, lost, energy, lines)


def _worst(
    time: Array, held: Mapping[str, Array], tables: Mapping[str, Array], scales: Mapping[str, float]
) -> Iterator[str]:
    """Yield of each kind of signal its largest bar, in its scale, and when."""
    worst: dict[str, tuple[float, float]] = {}
    for name in held:
        bar = tables.get(f"errors/{name}")
        if bar is None or not bar.size:
            continue
        rows = bar.reshape(len(bar), -1).max(axis=1)
        rows = np.where(np.isfinite(rows), rows, 0.0)
        k, kind = int(rows.argmax()), _kind(name)
        if float(rows[k]) >= worst.get(kind, (0.0, 0.0))[0]:
            worst[kind] = float(rows[k]), float(time[k])
    for kind, (value, when) in worst.items():
        if scales[kind] > 0.0 and value > FLOOR * scales[kind]:
            share = f"{100.0 * value / scales[kind]:.2g} %"
            what = kind.replace("_", " ")
            yield f"error of {what}: {value:.2g}, {share} of its range, at {when:.6g}"
