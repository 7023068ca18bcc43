"""Curves of a deck as pieces of polynomials."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from mbsim.arrays.model import Curves
from mbsim.core.arrays import F1
from mbsim.model.curves import ParamCurve

#: Powers of a piece: of degree 5 at most.
_POWERS = 6
#: So many points of a piece are looked at for the one where a point begins.
_SAMPLES = 32
#: The parameter of a curve goes from the first to the second.
_BEGIN, _END = -1.0, 1.0

#: A plane's curve is off it by less than this part of its extent.
_FLAT = 1e-6

Array = np.ndarray
#: Parameters at which pieces begin, and the end; coefficients of their powers, see `pieces_of`.
Pieces = tuple[Array, Array]


def pieces_of(curve: ParamCurve) -> Pieces:
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


def samples(pieces: Pieces) -> tuple[Array, Array, Array]:
    """Return parameters (n,) spread over a curve, its points there and its slopes, (n, 3)."""
    begin, coefficient = pieces
    s = np.diff(begin)[:, None] * np.linspace(0.0, 1.0, _SAMPLES, endpoint=False)
    powers = s[..., None] ** np.arange(_POWERS)
    places = np.einsum("ksn,knx->ksx", powers, coefficient)
    rising = coefficient[:, 1:] * np.arange(1, _POWERS)[:, None]
    slopes = np.einsum("ksn,knx->ksx", powers[..., :-1], rising)
    return (begin[:-1, None] + s).ravel(), places.reshape(-1, 3), slopes.reshape(-1, 3)


def nearest_start(pieces: Pieces, point: Array) -> float:
    """Return the parameter of a curve's point next to another, (3,), as good as samples are."""
    u, places, _ = samples(pieces)
    return float(u[np.argmin(np.linalg.norm(places - point, axis=-1))])


class Plane(NamedTuple):
    """The plane of a curve: `normal` (3,) where it has one; a straight line has none."""

    flat: bool  # whether the curve is in a plane
    normal: Array | None


def plane_of(pieces: Pieces) -> Plane:
    """Return the plane that a curve is in."""
    _, places, _ = samples(pieces)
    _, extents, axes = np.linalg.svd(places - places.mean(axis=0), full_matrices=False)
    if extents[1] <= _FLAT * extents[0]:
        return Plane(True, None)
    return Plane(bool(extents[2] <= _FLAT * extents[0]), axes[2])


@dataclass
class CurveTable:
    """Curves of a model's higher pairs while they are gathered."""

    pieces: list[Pieces] = field(default_factory=list)
    closed: list[bool] = field(default_factory=list)
    markers: list[tuple[int, int]] = field(default_factory=list)
    equation: list[int] = field(default_factory=list)
    touching: list[int] = field(default_factory=list)
    normal: list[Array] = field(default_factory=list)
    along: list[float] = field(default_factory=list)

    def add(
        self, curve: ParamCurve, pieces: Pieces, markers: tuple[int, int], equation: int
    ) -> int:
        """Return the row of a curve of the pair of marker rows (i, j): one that holds a point."""
        self.pieces.append(pieces)
        self.closed.append(curve.is_closed)
        self.markers.append(markers)
        self.equation.append(equation)
        self.touching.append(0)
        self.normal.append(np.zeros(3))
        self.along.append(0.0)
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
            touching=np.array(self.touching, dtype=np.int64),
            normal=np.array(self.normal, dtype=np.float64).reshape(-1, 3),
        )
        return curves, np.array(self.along, dtype=np.float64)
