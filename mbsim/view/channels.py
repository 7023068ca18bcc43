"""Signals of a run for the curves of a view: as many as fit, in three digits and more."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from mbsim.results.names import SENSITIVITY, parts_of
from mbsim.results.quantities import quantity_of
from mbsim.results.units import UnitSystem
from mbsim.view.scene import Scene

Table = np.ndarray[Any, Any]
#: Values of a curve at most: the largest and the smallest of each of half as many spans of rows.
MOST_VALUES = 4000
#: Bits of the mantissa of a float32 that are kept: 2^-13 of a value is lost at most.
_KEPT_BITS = 12
#: Bytes that a value takes, deflated and in base64, about.
_BYTES = 3.2
#: What poses have already.
_FROM_POSES = ("position", "quaternion")
#: What is taken first; others follow, bodies and derivatives last.
_FIRST = ("energy", "requests", "contacts")


class Channels(NamedTuple):
    """Curves: what they are, their arrays, and how many signals were left out."""

    about: list[dict[str, Any]]
    arrays: dict[str, Table]
    left_out: int


def shortened(values: Table) -> Table:
    """Return values as float32 whose last bits are zero, rounded; what is not finite stays."""
    bits = np.ascontiguousarray(values, dtype="<f4").view("<u4")
    drop = 23 - _KEPT_BITS
    rounded = (bits + np.uint32(1 << (drop - 1))) & np.uint32(0xFFFFFFFF ^ ((1 << drop) - 1))
    return np.where(np.isfinite(values), rounded, bits).astype("<u4").view("<f4")


def bytes_apart(values: Table) -> Table:
    """Return float32 as uint8: first bytes of all values, then second ones, ..."""
    parts = np.ascontiguousarray(values, dtype="<f4").view("u1").reshape(-1, 4)
    return np.ascontiguousarray(parts.T).reshape(-1)


def extreme_rows(values: Table) -> Table:
    """Return rows that show the curve of many values (n,): extremes of spans, first and last."""
    n = len(values)
    span = -(-n // (MOST_VALUES // 2))
    kept = {0, n - 1}
    numbers = np.where(np.isfinite(values), values, 0.0)
    for first in range(0, n, span):
        part = numbers[first : first + span]
        kept |= {first + int(part.argmin()), first + int(part.argmax())}
    return np.array(sorted(kept), dtype=np.uint32)


def _whole(scene: Scene, name: str) -> str:
    """Return the signal of a name that may have a part behind it."""
    return name if name in scene.results.signals() else name.rpartition("/")[0]


def _ordered(scene: Scene, asked: Sequence[str]) -> list[str]:
    """Return the names of signals, what was asked for first, then bodies and derivatives last."""
    signals = [
        name
        for name in scene.results.signals()
        if name != "time" and not (name.startswith("bodies/") and name.endswith(_FROM_POSES))
    ]

    def rank(name: str) -> int:
        group = name.partition("/")[0]
        if group in _FIRST:
            return _FIRST.index(group)
        return len(_FIRST) + (group == "bodies") + 2 * name.startswith(SENSITIVITY)

    # names that poses have are known as well
    wanted = [_whole(scene, each) for name in asked for each in scene.results.find(name)]
    return list(dict.fromkeys([*(w for w in wanted if w in signals), *sorted(signals, key=rank)]))


def channels(
    scene: Scene, room: int, asked: Sequence[str] = (), shown: UnitSystem | None = None
) -> Channels:
    """Return curves that take about so many bytes of a page at most.

    `asked` are names or patterns of signals that come first; values are in the units `shown`,
    which are the run's own where none are given.
    """
    results, widths = scene.results, scene.results.signals()
    shown = shown or scene.units
    about: list[dict[str, Any]] = []
    values: list[Table] = []
    rows: list[Table] = []
    n = len(results["time"])
    left_out = 0
    for name in _ordered(scene, asked):
        width = widths[name]
        if min(n, MOST_VALUES) * width * _BYTES > room:
            left_out += 1
            continue
        table = np.asarray(results[name], dtype=np.float64).reshape(n, width)
        slopes = name.startswith(SENSITIVITY)
        for part, column in _parts(name, width, slopes or n > MOST_VALUES):
            quantity = quantity_of(results, name, min(column, width - 1))
            if column < width:
                chosen = table[:, column]
            else:
                chosen = results[f"{name}/mag"] if slopes else np.linalg.norm(table, axis=1)
            found = shortened(chosen * scene.units.factor_to(shown, quantity))
            kept = extreme_rows(found) if n > MOST_VALUES else None
            about.append(
                {
                    "name": f"{name}/{part}" if part else name,
                    "quantity": quantity.name,
                    "unit": shown.text(quantity),
                    "rows": n if kept is None else len(kept),
                    "all": kept is None,
                }
            )
            values.append(found if kept is None else found[kept])
            if kept is not None:
                rows.append(kept)
            room -= int(len(values[-1]) * _BYTES)
    arrays = {
        "channels": bytes_apart(np.concatenate(values) if values else np.zeros(0, "<f4")),
        "channel_rows": np.concatenate(rows) if rows else np.zeros(0, np.uint32),
        "channel_time": np.asarray(results["time"], dtype="<f4").reshape(-1),
    }
    return Channels(about, arrays, left_out)


def _parts(name: str, width: int, magnitudes: bool) -> Iterator[tuple[str, int]]:
    """Yield the parts of a signal and their columns, that of a magnitude behind the last.

    The page finds magnitudes by itself where it has all rows: others are extremes of each part. Nor
    is the derivative of one the size of a derivative.
    """
    if width == 1:
        yield "", 0
        return
    parts = [part for part in parts_of(width) if part != "mag" or magnitudes]
    yield from ((part, column) for column, part in enumerate(parts))
