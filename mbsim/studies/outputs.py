"""What a study keeps of each run: a signal reduced to a number, the time of an event, a formula."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsim.errors import ModelError

if TYPE_CHECKING:
    from mbsim.results.reading import Results

Numbers = np.ndarray[Any, np.dtype[np.float64]]

#: Kinds of events, as result files have them.
EVENTS = ("touch", "leave", "stick", "slip", "sensor")


def _mean(t: Numbers, x: Numbers) -> float:
    """Return the mean over time, by the trapezoidal rule."""
    if not t[-1] > t[0]:
        return float(x[-1])
    return float(np.sum(0.5 * (x[1:] + x[:-1]) * np.diff(t)) / (t[-1] - t[0]))


def _rms(t: Numbers, x: Numbers) -> float:
    """Return the root of the mean square over time."""
    return math.sqrt(_mean(t, x * x))


#: Numbers that rows of a signal are reduced to: functions of times (n,) and values (n,).
REDUCTIONS: dict[str, Callable[[Numbers, Numbers], float]] = {
    "last": lambda t, x: float(x[-1]),
    "first": lambda t, x: float(x[0]),
    "max": lambda t, x: float(np.max(x)),
    "min": lambda t, x: float(np.min(x)),
    "absmax": lambda t, x: float(np.max(np.abs(x))),
    "range": lambda t, x: float(np.max(x) - np.min(x)),
    "mean": _mean,
    "rms": _rms,
    "time_of_max": lambda t, x: float(t[np.argmax(x)]),
    "time_of_min": lambda t, x: float(t[np.argmin(x)]),
}
#: Those of which a peak has no other value than its own.
OF_A_PEAK = ("last", "max", "absmax")
#: How far a row may be from the time that `at` names, as a part of the run.
_AT = 1e-9


def is_peak(signal: str) -> bool:
    """Return whether a signal is a contact's largest value over all steps: one number a run."""
    return "/peak_" in signal


def no_curve(signal: str) -> str:
    """Return what is said of a peak where a signal over time is asked for."""
    rows = signal.replace("/peak_", "/")
    rows += "/mag" if rows.endswith("/force") else ""
    return f"{signal} is one number a run, the largest of all steps; over time it is {rows}"


@dataclass(frozen=True)
class Output:
    """One column of a study's table.

    Either `signal` with `reduce` (a name of `REDUCTIONS`, "at" a time, or "curve"), or `event`
    (which of an `element`'s, from 1 on), or `formula` over parameters and outputs above it.
    """

    name: str
    signal: str = ""
    reduce: str = "last"
    at: float = 0.0
    event: str = ""
    element: int | None = None
    which: int = 1
    formula: str = ""

    @property
    def is_curve(self) -> bool:
        """Whether it is all rows of a signal."""
        return bool(self.signal) and self.reduce == "curve"

    def of(self, results: Results, values: Mapping[str, float]) -> Any:
        """Return its value for a run: a number, or a list of a curve.

        Raises
        ------
        Absent
            If the run has none; the message says why.
        UnknownSignal
            If no run of the model has such a signal.
        """
        if self.formula:
            from mbsim.studies.formulas import Formula

            try:
                return Formula(self.formula, values)(values)
            except (ArithmeticError, ValueError) as error:
                raise Absent(f"outputs.{self.name}: {error}") from None
        if self.event:
            return self._event_time(results["events"])
        rows = results[self.signal]
        if np.ndim(rows) == 0:
            return float(rows)
        if np.ndim(rows) != 1:
            raise ModelError(f"outputs.{self.name}: {self.signal} is a vector: name one component")
        x, t = np.asarray(rows, dtype=np.float64), results["time"]
        if self.reduce == "curve":
            return x.tolist()
        if self.reduce == "at":
            return self._row_at(t, x)
        return REDUCTIONS[self.reduce](t, x)

    def _row_at(self, t: Numbers, x: Numbers) -> float:
        """Return the value at an output time."""
        k = int(np.argmin(np.abs(t - self.at)))
        if abs(t[k] - self.at) > _AT * max(abs(self.at), float(t[-1] - t[0])):
            raise Absent(f"outputs.{self.name}: no output row at time {self.at:.9g}")
        return float(x[k])

    def _event_time(self, table: Any) -> float:
        """Return when an event happened."""
        kinds = np.array([_text(kind) for kind in table["kind"]], dtype=object)
        found = table["time"][
            (kinds == self.event)
            & ((table["element"] == self.element) if self.element is not None else True)
        ]
        place = self.which - 1 if self.which > 0 else len(found) + self.which
        if not 0 <= place < len(found):
            what = f"{self.event} of {self.element}" if self.element is not None else self.event
            raise Absent(
                f"outputs.{self.name}: no number {self.which} of the events {what}: "
                f"there are {len(found)}"
            )
        return float(found[place])


class Absent(Exception):
    """A run has no such value."""


def _text(value: Any) -> str:
    return value.decode() if isinstance(value, bytes) else str(value)


def read_output(name: str, table: Mapping[str, Any]) -> Output:
    """Return an output as a study file says it; `ModelError` where it says nothing of use."""
    known = {
        "signal": {"signal", "reduce", "at"},
        "event": {"event", "element", "which"},
        "formula": {"formula"},
    }
    kinds = [kind for kind in known if kind in table]
    if len(kinds) != 1:
        raise ModelError("needs one of signal, event, formula")
    allowed = known[kinds[0]]
    if extra := sorted(table.keys() - allowed):
        raise ModelError(f"unknown {', '.join(extra)}; known: {', '.join(sorted(allowed))}")
    _check_kinds(table)
    reduce = table.get("reduce", "at" if "at" in table else "last")
    if reduce not in (*REDUCTIONS, "at", "curve"):
        raise ModelError(f"reduce = {reduce!r}: must be one of {', '.join(REDUCTIONS)}, at, curve")
    if (reduce == "at") != ("at" in table):
        raise ModelError('reduce = "at" goes with at = TIME')
    if "event" in table and table["event"] not in EVENTS:
        raise ModelError(f"event = {table['event']!r}: must be one of {', '.join(EVENTS)}")
    if table.get("which", 1) == 0:
        raise ModelError("which = 0: the first is 1, the last -1")
    return Output(name, **{**table, **({"reduce": reduce} if "signal" in table else {})})


def _check_kinds(table: Mapping[str, Any]) -> None:
    """Raise `ModelError` where a value is of the wrong type."""
    kinds: dict[str, tuple[type, ...]] = {"at": (int, float), "element": (int,), "which": (int,)}
    for key, value in table.items():
        if type(value) not in kinds.get(key, (str,)):
            what = "a number" if key in kinds else "a text"
            raise ModelError(f"{key} = {value!r}: must be {what}")
