"""What values a parameter of a study takes: a list, a range, a distribution."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from mbsim.errors import ModelError

Numbers = np.ndarray[Any, np.dtype[np.float64]]

#: Most runs of a study: more is a mistyped number.
MOST_RUNS = 10_000_000
#: Keys that each kind of parameter needs, and those that it may have.
_KINDS: dict[str, tuple[frozenset[str], frozenset[str]]] = {
    "values": (frozenset({"values"}), frozenset()),
    "uniform": (frozenset({"low", "high"}), frozenset({"count", "scale"})),
    "normal": (frozenset({"mean", "sd"}), frozenset({"low", "high"})),
    "lognormal": (frozenset({"median", "factor"}), frozenset()),
    "triangular": (frozenset({"low", "mode", "high"}), frozenset()),
}

#: A normal distribution may be cut to this part of it; values of less are rounding.
_LEAST_PART = 1e-9


@dataclass(frozen=True)
class Spread:
    """The values of one parameter: its kind, and the numbers that the kind needs."""

    kind: str
    numbers: dict[str, float]
    values: tuple[float, ...] = ()
    log: bool = False
    count: int = 0

    def at(self, u: Numbers) -> Numbers:
        """Return the values below which a part `u` of all lies, 0 < u < 1."""
        n = self.numbers
        if self.kind == "values":
            places = np.minimum((u * len(self.values)).astype(int), len(self.values) - 1)
            return np.asarray(np.array(self.values)[places])
        if self.kind == "uniform" and self.log:
            return np.asarray(n["low"] * np.exp(u * math.log(n["high"] / n["low"])))
        if self.kind == "uniform":
            return np.asarray(n["low"] + u * (n["high"] - n["low"]))
        if self.kind == "triangular":
            return _triangular(u, n["low"], n["mode"], n["high"])
        from scipy.special import ndtri

        if self.kind == "lognormal":
            return np.asarray(n["median"] * np.exp(math.log(n["factor"]) * ndtri(u)))
        first, last = _parts_below(n)
        return np.asarray(n["mean"] + n["sd"] * ndtri(first + u * (last - first)))

    def levels(self) -> Numbers:
        """Return its values on a grid.

        Raises
        ------
        ModelError
            If it has none: neither `values` nor a range with `count`.
        """
        if self.kind == "values":
            return np.array(self.values)
        if self.kind != "uniform" or self.count < 1:
            raise ModelError("a grid needs `values`, or `low`, `high` and `count`")
        n = self.numbers
        make = np.geomspace if self.log else np.linspace
        return np.asarray(make(n["low"], n["high"], self.count))


def _parts_below(n: dict[str, float]) -> tuple[float, float]:
    """Return which parts of a normal distribution lie below where it is cut."""
    from scipy.special import ndtr

    first, last = (
        float(ndtr((n[name] - n["mean"]) / n["sd"])) if name in n else end
        for name, end in (("low", 0.0), ("high", 1.0))
    )
    return first, last


def _triangular(u: Numbers, low: float, mode: float, high: float) -> Numbers:
    """Return the inverse of the triangular distribution function."""
    part = (mode - low) / (high - low)
    left = low + np.sqrt(u * (high - low) * (mode - low))
    right = high - np.sqrt((1.0 - u) * (high - low) * (high - mode))
    return np.where(u < part, left, right)


def read_spread(table: dict[str, Any], needed_here: bool = True) -> Spread:
    """Return what a parameter's table says of its values; `ModelError` where that is nothing.

    Where they are not `needed_here`, as its values are those of a CSV, it may say nothing.
    """
    given = {key: value for key, value in table.items() if key != "path"}
    if not given and not needed_here:
        return Spread("values", {})
    kind = str(given.pop("distribution", "values" if "values" in given else "uniform"))
    if kind not in _KINDS:
        raise ModelError(f"distribution = {kind!r}: must be one of {', '.join(_KINDS)}")
    needed, allowed = _KINDS[kind]
    if missing := sorted(needed - given.keys()):
        raise ModelError(f"{kind}: needs {', '.join(missing)}")
    if extra := sorted(given.keys() - needed - allowed):
        raise ModelError(f"{kind}: unknown {', '.join(extra)}; known: {_known(kind)}")
    if kind == "values":
        return Spread(kind, {}, _numbers(given["values"]))
    scale = given.pop("scale", "linear")
    if scale not in ("linear", "log"):
        raise ModelError(f'scale = {scale!r}: must be "linear" or "log"')
    count = given.pop("count", 0)
    if type(count) is not int or not 0 <= count <= MOST_RUNS:
        raise ModelError(f"count = {count!r}: must be a whole number from 1 to {MOST_RUNS}")
    numbers = dict(zip(given, _numbers(list(given.values())), strict=True))
    _check_numbers(kind, numbers, scale == "log")
    return Spread(kind, numbers, (), scale == "log", count)


def _known(kind: str) -> str:
    needed, allowed = _KINDS[kind]
    return ", ".join(["path", *sorted(needed | allowed)])


def _numbers(values: Any) -> tuple[float, ...]:
    """Return numbers of a study file as floats."""
    if not isinstance(values, list) or not values:
        raise ModelError("values: must be a list of numbers, one at least")
    for value in values:
        if type(value) not in (int, float) or not math.isfinite(value):
            raise ModelError(f"{value!r}: must be a finite number")
    return tuple(map(float, values))


def _check_numbers(kind: str, n: dict[str, float], log: bool) -> None:
    """Raise `ModelError` where a distribution's numbers make none."""
    if "low" in n and "high" in n and not n["low"] < n["high"]:
        raise ModelError(f"low = {n['low']:g}, high = {n['high']:g}: low must be below high")
    if log and not n["low"] > 0.0:
        raise ModelError('scale = "log" needs low above 0')
    if kind == "normal" and not n["sd"] > 0.0:
        raise ModelError(f"sd = {n['sd']:g}: must be above 0")
    if kind == "normal":
        first, last = _parts_below(n)
        if last - first < _LEAST_PART:
            raise ModelError(f"nothing of it is left between low and high: {last - first:.1g}")
    if kind == "lognormal" and not (n["median"] > 0.0 and n["factor"] > 1.0):
        raise ModelError("lognormal needs median above 0 and factor above 1")
    if kind == "triangular" and not n["low"] <= n["mode"] <= n["high"]:
        raise ModelError(f"mode = {n['mode']:g}: must be from low to high")
