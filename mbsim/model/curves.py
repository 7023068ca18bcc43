"""Curves and surfaces in space, and what stays on them, in the deck's own words and units."""

from __future__ import annotations

from dataclasses import dataclass, field

from mbsim.model.source import Source, Subroutine


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


@dataclass(frozen=True)
class CurveOnCurve:
    """Constraint_CVCV, Adams' CVCV: a curve in the axes of I touches one in the axes of J.

    `i_start`, `j_start` are near where on each it begins, in the axes of a marker [L]; None: where
    the curves are next to each other.
    """

    id: int
    i_marker_id: int
    j_marker_id: int
    i_curve_id: int
    j_curve_id: int
    i_start: tuple[float, float, float] | None = None
    i_start_marker_id: int | None = None
    j_start: tuple[float, float, float] | None = None
    j_start_marker_id: int | None = None
    label: str = ""
    source: Source = Source()


@dataclass(frozen=True)
class ParamSurface:
    """Reference_ParamSurface: a surface that a user's function gives, in the axes of a marker.

    `u`, `v` are where its parameters begin and end.
    """

    id: int
    u: tuple[float, float]
    v: tuple[float, float]
    user: Subroutine
    is_u_closed: bool = False
    is_v_closed: bool = False
    label: str = ""
    source: Source = Source()


@dataclass(frozen=True)
class PointOnSurface:
    """Constraint_PTSF: the origin of marker I stays on a surface in the axes of J.

    `start` is near where on the surface it begins, in the axes of a marker [L]; None: where I is.
    """

    id: int
    i_marker_id: int
    j_marker_id: int
    surface_id: int
    start: tuple[float, float, float] | None = None
    start_marker_id: int | None = None
    label: str = ""
    source: Source = Source()


@dataclass(frozen=True, kw_only=True)
class HigherPairs:
    """Curves and surfaces of a model by id, and what stays on them."""

    points_on_curves: dict[int, PointOnCurve] = field(default_factory=dict)
    curves_on_curves: dict[int, CurveOnCurve] = field(default_factory=dict)
    curves: dict[int, ParamCurve] = field(default_factory=dict)
    points_on_surfaces: dict[int, PointOnSurface] = field(default_factory=dict)
    surfaces: dict[int, ParamSurface] = field(default_factory=dict)
