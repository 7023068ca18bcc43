"""Unknown curves: ordinates of a spline of the deck, fitted beside the parameters.

A force, or whatever an expression looks up in the spline, is estimated over the whole record. That
has many solutions, of which the smooth one is wanted: second derivatives are as if they had been
measured as 0, with a standard deviation that the study states (A. N. Tikhonov, Soviet Math. Dokl.
4 (1963) 1035; second differences: E. T. Whittaker, Proc. Edinburgh Math. Soc. 41 (1923) 63).
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsim.studies.distributions import Numbers

if TYPE_CHECKING:
    from mbsim.studies.problem import Unknown

_KEYS = ("spline", "from", "to", "count", "low", "high", "start", "curvature_sd")
_NUMBERS = ("from", "to", "low", "high", "curvature_sd")
_SPLINE = re.compile(r"(\w+)\[(\d+)\]")
#: Why no bound is infinite.
BETWEEN = ": the fit moves it between both bounds; give one that it does not reach"
#: CUBSPL needs four points; more than these are more runs than a fit can be of.
FEWEST, MOST = 4, 1000


@dataclass(frozen=True)
class UnknownCurve:
    """A curve that is fitted.

    Attributes
    ----------
    name : str
    first : int
        Which unknown is its first ordinate; the others follow.
    at : array, (points,)
        Abscissae, evenly spread.
    curvature_sd : float
        Standard deviation of its second derivative, in its unit over that of the abscissae squared.
    """

    name: str
    first: int
    at: Numbers
    curvature_sd: float

    @property
    def unknowns(self) -> slice:
        """Which unknowns are its ordinates."""
        return slice(self.first, self.first + len(self.at))

    def bends(self, count: int) -> Numbers:
        """Return what makes second derivatives over `curvature_sd` of unknowns.

        An array (points - 2, count), count being how many unknowns there are.
        """
        found = np.zeros((len(self.at) - 2, count))
        part = 1.0 / ((self.at[1] - self.at[0]) ** 2 * self.curvature_sd)
        for row in range(len(found)):
            found[row, self.first + row : self.first + row + 3] = part, -2.0 * part, part
        return found


def read_curves(
    tables: Mapping[str, Any], before: int, faults: list[str]
) -> tuple[tuple[UnknownCurve, ...], dict[str, dict[str, Any]], dict[str, str]]:
    """Return curves, their ordinates as [parameters] has them, and what they are in [set].

    `before` is how many unknowns there are before theirs; what is wrong is added to `faults`.
    """
    curves: list[UnknownCurve] = []
    parameters: dict[str, dict[str, Any]] = {}
    given: dict[str, str] = {}
    for name, table in tables.items():
        said = _faults_of(table)
        faults += [f"curves.{name}: {one}" for one in said]
        if said:
            continue
        count = table["count"]
        at = np.linspace(float(table["from"]), float(table["to"]), count)
        curves.append(UnknownCurve(name, before, at, float(table["curvature_sd"])))
        before += count
        names = [f"{name}_{k + 1}" for k in range(count)]
        kept = {key: table[key] for key in ("low", "high", "start") if key in table}
        parameters |= {each: dict(kept) for each in names}
        given[f"{table['spline']}.x"] = " ".join(repr(float(each)) for each in at)
        given[f"{table['spline']}.y"] = " ".join(f"{{{each}}}" for each in names)
    return tuple(curves), parameters, given


def _faults_of(table: Any) -> list[str]:
    """Return what is wrong with a table of [curves]."""
    if not isinstance(table, dict):
        return ["must be a table"]
    said = []
    if extra := sorted(table.keys() - set(_KEYS)):
        said.append(f"unknown {', '.join(extra)}; known: {', '.join(_KEYS)}")
    if missing := [key for key in _KEYS if key not in table and key != "start"]:
        said.append(f"needs {', '.join(missing)}")
    for key in _NUMBERS:
        value = table.get(key, 1.0)
        if type(value) not in (int, float) or not math.isfinite(value):
            why = BETWEEN if value in (math.inf, -math.inf) and key in ("low", "high") else ""
            said.append(f"{key} = {value!r}: must be a finite number{why}")
    spline, count = table.get("spline"), table.get("count", FEWEST)
    found = _SPLINE.fullmatch(spline) if isinstance(spline, str) else None
    if "spline" in table and (found is None or found[1].lower() != "reference_spline"):
        said.append(f"spline = {spline!r}: must be one of the deck, as Reference_Spline[9]")
    if type(count) is not int or not FEWEST <= count <= MOST:
        said.append(f"count = {count!r}: must be a whole number from {FEWEST} to {MOST}")
    if not said and not table["from"] < table["to"]:
        said.append("from must be below to")
    if not said and not table["curvature_sd"] > 0.0:
        said.append(f"curvature_sd = {table['curvature_sd']!r}: must be above 0")
    return said


def bends_of(curves: tuple[UnknownCurve, ...], unknowns: tuple[Unknown, ...]) -> Numbers:
    """Return what makes all curves' second derivatives over `curvature_sd` of unknowns."""
    count = len(unknowns)
    return np.concatenate([np.zeros((0, count)), *(curve.bends(count) for curve in curves)])
