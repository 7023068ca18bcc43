"""Splines as pieces of cubic polynomials, made once; compiled code only evaluates them.

A curve of n points has n + 1 pieces: before the first point, between neighbours, behind the last
one. The method says what is between: AKISPL Akima's local cubics (J. ACM 17 (1970) 589), CUBSPL the
natural cubic spline (second derivative 0 at both ends), LINSPL lines. Outside goes on the parabola
through the three outermost points, or, where the spline says so and of LINSPL always, the line
through two.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from mbsim.arrays.codes import PIECE_BEGIN
from mbsim.model.elements import Spline

Array = npt.NDArray[np.float64]


def _between(method: str, x: Array, y: Array) -> Array:
    """Return the factors (n - 1, 4) of 1, s, s^2, s^3 between the points, s from the left one."""
    if method == "LINSPL":
        slope = np.diff(y) / np.diff(x)
        return np.column_stack((y[:-1], slope, np.zeros((len(slope), 2))))
    # only decks with splines import it
    from scipy.interpolate import Akima1DInterpolator, CubicSpline

    cubic = (
        Akima1DInterpolator(x, y) if method == "AKISPL" else CubicSpline(x, y, bc_type="natural")
    )
    return np.ascontiguousarray(cubic.c[::-1].T)


def _outside(x: Array, y: Array, linear: bool) -> tuple[float, float]:
    """Return slope and half the second derivative at the first point, of what goes on before it."""
    first = (y[1] - y[0]) / (x[1] - x[0])
    if linear:
        return first, 0.0
    # Newton's divided differences of the three points
    second = ((y[2] - y[1]) / (x[2] - x[1]) - first) / (x[2] - x[0])
    return first - second * (x[1] - x[0]), second


def pieces(method: str, x: Array, y: Array, linear: bool) -> Array:
    """Return where each piece begins and its factors, shape (n + 1, 5).

    Parameters
    ----------
    method : {"AKISPL", "CUBSPL", "LINSPL"}
    x, y : ndarray, shape (n,)
        The points, x ascending.
    linear : bool
        Go on outside along a line.
    """
    linear = linear or method == "LINSPL"
    made = np.zeros((len(x) + 1, 5))
    made[1:, PIECE_BEGIN], made[0, PIECE_BEGIN] = x, x[0]
    made[1:-1, 1:] = _between(method, x, y)
    made[0, 1], made[-1, 1] = y[0], y[-1]
    made[0, 2:4] = _outside(x, y, linear)
    made[-1, 2:4] = _outside(x[::-1], y[::-1], linear)
    return made


@dataclass
class SplineTable:
    """The curves that programs use, each spline once a method."""

    first: dict[tuple[int, str], int] = field(default_factory=dict)
    levels: list[float] = field(default_factory=list)
    made: list[Array] = field(default_factory=list)

    def rows(self, spline: Spline, method: str) -> tuple[int, int]:
        """Return the first curve of a spline by a method, and their number."""
        key = (spline.id, method)
        if key not in self.first:
            self.first[key] = len(self.made)
            self.levels.extend(spline.z or (0.0,))
            x = np.array(spline.x)
            for y in spline.y:
                self.made.append(pieces(method, x, np.array(y), spline.linear_extrapolate))
        return self.first[key], len(spline.y)

    def arrays(self) -> tuple[Array, npt.NDArray[Any], Array]:
        """Return `level`, `curve` and `piece` of `Programs`."""
        starts = np.concatenate([[0], np.cumsum([len(curve) for curve in self.made])])
        piece = np.concatenate([np.zeros((0, 5)), *self.made])
        return np.array(self.levels), starts.astype(np.int64), np.ascontiguousarray(piece)
