"""Curves in space, and points that stay on them, in the deck's own words and units."""

from __future__ import annotations

from dataclasses import dataclass

from mbsim.model.source import Source


@dataclass(frozen=True)
class ParamCurve:
    """Reference_ParamCurve, Adams' CURVE: a curve through points, or one that they draw.

    `points` (n, 3) in the axes of the marker that uses it [L]. Of a closed curve the last point is
    the first. `degree` of its pieces is 3 or 5.
    """

    id: int
    points: tuple[tuple[float, float, float], ...]
    is_closed: bool = False
    through_points: bool = True
    degree: int = 3
    label: str = ""
    source: Source = Source()


@dataclass(frozen=True)
class PointOnCurve:
    """Constraint_PTCV, Adams' PTCV: the origin of marker I stays on a curve in the axes of J.

    `start` is near where on the curve it begins, in the axes of a marker or global [L]; None: where
    I is.
    """

    id: int
    i_marker_id: int
    j_marker_id: int
    curve_id: int
    start: tuple[float, float, float] | None = None
    start_marker_id: int | None = None  # None: global
    label: str = ""
    source: Source = Source()
