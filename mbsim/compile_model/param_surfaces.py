"""Surfaces of users' functions as patches of polynomials."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from mbsim.arrays.model import Surfaces
from mbsim.model.curves import ParamSurface

Array = np.ndarray
#: Gives the point of a surface at parameters u and v.
Function = Callable[[float, float], Sequence[float]]

_DEGREE = 5
#: So many spans of each parameter are tried, until between samples nothing is off by more than
#: this part of the extent.
_SPANS = (8, 16, 32, 64, 128)
_ENOUGH = 1e-9


class UnfitSurfaceError(Exception):
    """Why a function makes no surface."""


class Patches(NamedTuple):
    """A surface: where spans along u and v begin, with the end, and `terms` of each patch.

    (spans along u, spans along v, 36, 3), row 6 n + m of powers n and m of u and v less where
    their spans begin.
    """

    begin_u: Array
    begin_v: Array
    terms: Array


#: Of a surface whose function is not called.
UNKNOWN = Patches(np.array([0.0, 1.0]), np.array([0.0, 1.0]), np.zeros((1, 1, 36, 3)))


def patches_of(surface: ParamSurface, function: Function) -> Patches:
    """Return a surface as patches of degree 5 in both parameters.

    It is the tensor-product spline through equally spaced points of the function: along a closed
    parameter periodic, along an open one with two knots less at each end (not-a-knot). As many
    points are taken as make it exact to 1e-9 of the surface's extent half-way between them.

    Raises
    ------
    UnfitSurfaceError
        If 128 spans do not do it, or a closed surface does not close.

    Notes
    -----
    Source: C. de Boor, A Practical Guide to Splines, Springer (2001).
    """
    off = math.inf
    for spans in _SPANS:
        u, v = (np.linspace(begin, end, spans + 1) for begin, end in (surface.u, surface.v))
        points = np.array([[function(a, b) for b in v] for a in u], dtype=np.float64)
        extent = float(np.linalg.norm(np.ptp(points.reshape(-1, 3), axis=0)))
        _close(surface, points, extent)
        patches = _spline(surface, (u, v), points)
        between_u, between_v = ((each[:-1] + each[1:]) / 2.0 for each in (u, v))
        off = 0.0
        for k in range(4 * spans):
            a, b = between_u[k % spans], between_v[(3 * k + k // spans) % spans]
            off = max(off, float(np.linalg.norm(_at(patches, a, b) - np.array(function(a, b)))))
        if off <= _ENOUGH * extent:
            return patches
    raise UnfitSurfaceError(
        f"is not smooth enough: {_SPANS[-1]} spans of degree {_DEGREE} are off by {off:.3g}; its "
        "derivatives by u and v must be continuous"
    )


def _close(surface: ParamSurface, points: Array, extent: float) -> None:
    """Make ends of a closed surface the same bits: a periodic spline asks for it."""
    for axis, closed in enumerate((surface.is_u_closed, surface.is_v_closed)):
        ends = np.moveaxis(points, axis, 0)
        if closed and np.abs(ends[-1] - ends[0]).max() > _ENOUGH * extent:
            name = "uv"[axis]
            said = f"does not close: is_{name}_closed, and at {name}_end it is elsewhere"
            raise UnfitSurfaceError(said)
        if closed:
            ends[-1] = ends[0]


def _spline(surface: ParamSurface, knots: tuple[Array, Array], points: Array) -> Patches:
    """Return the spline through points (n, m, 3): along u its Taylor terms, and these along v."""
    begin_u, terms = _terms(knots[0], points, surface.is_u_closed)
    begin_v, terms = _terms(knots[1], np.moveaxis(terms, 2, 0), surface.is_v_closed)
    # (m, spans of v, n, spans of u, 3), with which powers of v came first
    coefficient = terms.transpose(3, 1, 2, 0, 4)
    pieces_u, pieces_v = coefficient.shape[:2]
    return Patches(begin_u, begin_v, coefficient.reshape(pieces_u, pieces_v, 36, 3))


def _terms(knots: Array, values: Array, closed: bool) -> tuple[Array, Array]:
    """Return where spans begin, with the end, and Taylor terms (6, spans, ...) of values there."""
    from scipy.interpolate import make_interp_spline

    spline = make_interp_spline(knots, values, _DEGREE, bc_type="periodic" if closed else None)
    begin = np.unique(spline.t[_DEGREE : len(spline.c) + 1])
    orders = range(_DEGREE + 1)
    return begin, np.array([spline(begin[:-1], nu=n) / math.factorial(n) for n in orders])


def _at(patches: Patches, u: float, v: float) -> Array:
    """Return the point (3,) of a surface."""
    k, m = (
        int(np.clip(np.searchsorted(begin, w, side="right") - 1, 0, len(begin) - 2))
        for begin, w in zip((patches.begin_u, patches.begin_v), (u, v), strict=True)
    )
    powers = np.arange(_DEGREE + 1)
    a, b = (u - patches.begin_u[k]) ** powers, (v - patches.begin_v[m]) ** powers
    found: Array = np.outer(a, b).ravel() @ patches.terms[k, m]
    return found


def nearest_corner(patches: Patches, point: Array) -> tuple[float, float]:
    """Return the parameters of the corner of a patch that is next to a point, (3,)."""
    corners = np.take(patches.terms, 0, axis=2)
    off = np.linalg.norm(corners - point, axis=-1)
    k, m = np.unravel_index(np.argmin(off), off.shape)
    return float(patches.begin_u[k]), float(patches.begin_v[m])


@dataclass
class SurfaceTable:
    """Surfaces of a model's higher pairs while they are gathered."""

    patches: list[Patches] = field(default_factory=list)
    closed: list[tuple[bool, bool]] = field(default_factory=list)
    markers: list[tuple[int, int]] = field(default_factory=list)
    equation: list[int] = field(default_factory=list)
    along: list[float] = field(default_factory=list)

    def arrays(self) -> Surfaces:
        """Return the table."""
        begins = [begin for each in self.patches for begin in (each.begin_u, each.begin_v)]
        counts = np.array([len(begin) - 1 for begin in begins], dtype=np.int64).reshape(-1, 2)
        i, j = np.array(self.markers, dtype=np.int64).reshape(-1, 2).T
        ends = np.cumsum(counts.ravel()).reshape(-1, 2)
        return Surfaces(
            first=np.cumsum([0, *counts.prod(axis=1)], dtype=np.int64),
            start=np.ascontiguousarray(ends - counts),
            spans=counts,
            begin=np.concatenate([np.zeros(0), *(begin[:-1] for begin in begins)]),
            length=np.concatenate([np.zeros(0), *(np.diff(begin) for begin in begins)]),
            coefficient=np.concatenate(
                [np.zeros((0, 36, 3)), *(p.terms.reshape(-1, 36, 3) for p in self.patches)]
            ),
            closed=np.array(self.closed, dtype=np.int64).reshape(-1, 2),
            i=i.copy(),
            j=j.copy(),
            equation=np.array(self.equation, dtype=np.int64),
        )
