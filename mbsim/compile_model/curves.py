"""Curves of a deck as pieces of polynomials, and where on them points begin."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from mbsim.arrays.model import Curves
from mbsim.core.arrays import F1
from mbsim.model.elements import ParamCurve

#: Powers of a piece: of degree 5 at most.
_POWERS = 6
#: So many points of a piece are looked at for the one where a point begins.
_SAMPLES = 32
#: The parameter of a curve goes from the first to the second.
_BEGIN, _END = -1.0, 1.0

Array = np.ndarray


def pieces_of(curve: ParamCurve) -> tuple[Array, Array]:
    """Return a curve as pieces.

    Through points it is the spline of least degree whose parameter grows with their distances: of
    a closed curve periodic, of an open one with pieces that are one polynomial behind either end
    (not-a-knot). Else the points are those of a uniform B-spline, which an open one ends in.

    Parameters
    ----------
    curve : ParamCurve

    Returns
    -------
    begin : ndarray, shape (pieces + 1,)
        Parameters at which pieces begin, and the end, from -1 to 1.
    coefficient : ndarray, shape (pieces, 6, 3)
        Of powers 0 to 5 of the parameter less its begin [L].

    Notes
    -----
    Source: C. de Boor, A Practical Guide to Splines, Springer (2001).
    """
    from scipy.interpolate import BSpline, make_interp_spline

    points, k = np.array(curve.points), curve.degree
    if curve.through_points:
        ways = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
        u = _BEGIN + (_END - _BEGIN) * ways / ways[-1]
        # ends of the same bits: a periodic spline asks for it
        points[-1] = points[0] if curve.is_closed else points[-1]
        spline = make_interp_spline(u, points, k, bc_type="periodic" if curve.is_closed else None)
    else:
        if curve.is_closed:
            points = np.concatenate([points[:-1], points[:k]])
            knots = np.arange(len(points) + k + 1, dtype=float) - k
        else:
            inner = np.arange(len(points) - k + 1, dtype=float)
            knots = np.concatenate([np.zeros(k), inner, np.full(k, inner[-1])])
        low, high = knots[k], knots[len(points)]
        knots = _BEGIN + (_END - _BEGIN) * (knots - low) / (high - low)
        spline = BSpline(knots, points, k)
    begin = np.unique(spline.t[k : len(spline.c) + 1])
    coefficient = np.zeros((len(begin) - 1, _POWERS, 3))
    for n in range(k + 1):
        coefficient[:, n] = spline(begin[:-1], nu=n) / math.factorial(n)
    return begin, coefficient


def nearest_start(begin: Array, coefficient: Array, point: Array) -> float:
    """Return the parameter of a curve's point next to another, (3,), as good as samples are."""
    length = np.diff(begin)
    part = np.linspace(0.0, 1.0, _SAMPLES, endpoint=False)
    s = length[:, None] * part
    powers = s[..., None] ** np.arange(_POWERS)
    places = np.einsum("ksn,knx->ksx", powers, coefficient)
    piece, sample = np.unravel_index(
        np.argmin(np.linalg.norm(places - point, axis=-1)), places.shape[:2]
    )
    return float(begin[piece] + s[piece, sample])


@dataclass
class CurveTable:
    """Curves of a model's constraints, one for each, while they are gathered."""

    pieces: list[tuple[Array, Array]] = field(default_factory=list)
    closed: list[bool] = field(default_factory=list)
    markers: list[tuple[int, int]] = field(default_factory=list)
    equation: list[int] = field(default_factory=list)
    along: list[float] = field(default_factory=list)

    def add(self, curve: ParamCurve, i: int, j: int, point: Array, equation: int) -> int:
        """Return the row of a curve in the axes of marker row j; `point` (3,) is near its start."""
        begin, coefficient = pieces_of(curve)
        self.pieces.append((begin, coefficient))
        self.closed.append(curve.is_closed)
        self.markers.append((i, j))
        self.equation.append(equation)
        self.along.append(nearest_start(begin, coefficient, point))
        return len(self.closed) - 1

    def arrays(self) -> tuple[Curves, F1]:
        """Return the table, and the parameters at the start."""
        counts = [len(coefficient) for _, coefficient in self.pieces]

        def joined(arrays: Sequence[Array], *shape: int) -> Array:
            return np.concatenate([np.zeros((0, *shape)), *arrays])

        i, j = np.array(self.markers, dtype=np.int64).reshape(-1, 2).T
        curves = Curves(
            first=np.cumsum([0, *counts], dtype=np.int64),
            begin=joined([begin[:-1] for begin, _ in self.pieces]),
            length=joined([np.diff(begin) for begin, _ in self.pieces]),
            coefficient=joined([c for _, c in self.pieces], _POWERS, 3),
            closed=np.array(self.closed, dtype=np.int64),
            i=i.copy(),
            j=j.copy(),
            equation=np.array(self.equation, dtype=np.int64),
        )
        return curves, np.array(self.along, dtype=np.float64)
