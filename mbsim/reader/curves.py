"""Reference_ParamCurve, Constraint_PTCV, Constraint_CVCV: curves, and what stays on them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from mbsim.errors import Fault
from mbsim.model.curves import CurveOnCurve, ParamCurve, PointOnCurve
from mbsim.reader.draft import Draft
from mbsim.reader.kinds import COUNT, FLAG, ID, REAL, REALS, TEXT
from mbsim.reader.statement import NAMED, Entry, Spec, Statement
from mbsim.reader.subroutine import USERSUB

START = ("disp_x0", "disp_y0", "disp_z0")
_START_I = ("i_disp_x0", "i_disp_y0", "i_disp_z0")
_START_J = ("j_disp_x0", "j_disp_y0", "j_disp_z0")
#: Points that lie nearer to each other than this part of the curve's extent are one.
_APART = 1e-9


def _build_curve(entry: Entry) -> None:
    """Add a curve; of one that a matrix gives the points come when all has been read."""
    by = entry.one_of(("matrix_id", "points"))
    if len(by) != 1:
        entry.fault('needs its points once: as text, or by matrix_id="..."')
        return
    numbers, count = entry.get("points", ()), entry.get("nrow")
    if by == ["points"] and entry.get("points") is None:
        return
    if len(numbers) % 3 or (count is not None and len(numbers) != 3 * count):
        wanted = "rows of x, y and z" if count is None else f"{count} rows of x, y and z"
        entry.fault(f"must be {wanted}; there are {len(numbers)} numbers", by[0])
        return
    curve = ParamCurve(
        id=entry.get("id", 0),
        points=tuple(zip(numbers[::3], numbers[1::3], numbers[2::3], strict=True)),
        is_closed=entry.get("is_u_closed", False),
        through_points=entry.get("is_curve_points", True),
        degree=5 if entry.get("quintic", False) else 3,
        label=entry.get("label", ""),
        source=entry.source,
    )
    said = fault_of_points(curve) if by == ["points"] else ""
    if said:
        entry.fault(said, "points")
        return
    entry.register("curves", curve)
    if by == ["matrix_id"] and entry.get("matrix_id") is not None:
        entry.draft.curve_matrices[curve.id] = entry.get("matrix_id")


def fault_of_points(curve: ParamCurve) -> str:
    """Return why points make no curve, or an empty string."""
    points = np.array(curve.points).reshape(-1, 3)
    least = curve.degree + 1
    if len(points) < least:
        return f"must be {least} points or more; there are {len(points)}"
    extent = float(np.linalg.norm(np.ptp(points, axis=0)))
    gaps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    if extent == 0.0 or (curve.through_points and gaps.min() <= _APART * extent):
        k = int(np.argmin(gaps))
        return f"points {k + 1} and {k + 2} are one; a curve goes on from each to the next"
    if curve.is_closed and np.linalg.norm(points[-1] - points[0]) > _APART * extent:
        return "the last point of a closed curve must be the first"
    return ""


def complete_curves(draft: Draft) -> Iterator[Fault]:
    """Give curves the points of matrices; yield what does not fit."""
    for id, matrix_id in draft.curve_matrices.items():
        curve, matrix = draft.curves[id], draft.control.matrices.get(matrix_id)
        if matrix is None:
            said = "there is no Reference_Matrix of this id"
        elif matrix.values.shape[1] != 3:
            said = f"has {matrix.values.shape[1]} columns; must be 3, of x, y and z"
        else:
            rows: Sequence[tuple[float, float, float]] = [tuple(r) for r in matrix.values.tolist()]
            draft.curves[id] = curve = replace(curve, points=tuple(rows))
            said = fault_of_points(curve)
        if said:
            name = f"Reference_ParamCurve[{id}]"
            yield Fault(
                curve.source.file, curve.source.line, name, f'matrix_id="{matrix_id}": {said}'
            )


def start_of(entry: Entry, names: tuple[str, str, str]) -> tuple[float, float, float] | None:
    """Return near where on a curve a pair begins, None where it is not given."""
    given, (x, y, z) = entry.those(names), names
    if given and len(given) < 3:
        entry.fault(f"must be given with {x}, {y} and {z}, or not at all", given[0])
        return None
    return (entry.get(x, 0.0), entry.get(y, 0.0), entry.get(z, 0.0)) if given else None


def _build_point(entry: Entry) -> None:
    """Add a point on a curve."""
    point = PointOnCurve(
        id=entry.get("id", 0),
        i_marker_id=entry.get("i_marker_id", 0),
        j_marker_id=entry.get("j_marker_id", 0),
        curve_id=entry.get("curve_id", 0),
        start=start_of(entry, START),
        label=entry.get("label", ""),
        source=entry.source,
    )
    entry.register("points_on_curves", point)


def _build_touching(entry: Entry) -> None:
    """Add a curve that touches a curve."""
    if entry.get("is_no_slip", False):
        entry.fault(
            "curves that roll without slip are not built; FALSE lets them slide", "is_no_slip"
        )
        return
    i, j = entry.get("i_marker_id", 0), entry.get("j_marker_id", 0)
    pair = CurveOnCurve(
        id=entry.get("id", 0),
        i_marker_id=i,
        j_marker_id=j,
        i_curve_id=entry.get("i_curve_id", 0),
        j_curve_id=entry.get("j_curve_id", 0),
        i_start=start_of(entry, _START_I),
        i_start_marker_id=i,
        j_start=start_of(entry, _START_J),
        j_start_marker_id=j,
        label=entry.get("label", ""),
        source=entry.source,
    )
    entry.register("curves_on_curves", pair)


_SUBROUTINE = "CURSUB is documented but not built yet; give points or matrix_id"
REFERENCE_PARAM_CURVE = Statement(
    "Reference_ParamCurve",
    {
        **NAMED,
        "is_u_closed": Spec(FLAG, "it ends where it begins", "", "FALSE"),
        "is_curve_points": Spec(
            FLAG, "it goes through the points, else they are those of a B-spline", "", "TRUE"
        ),
        "quintic": Spec(FLAG, "pieces of degree 5, else of degree 3", "", "FALSE"),
        "matrix_id": Spec(ID, "a Reference_Matrix of three columns has the points"),
        "nrow": Spec(COUNT, "number of points", "", "as many as are given"),
        "points": Spec(REALS, "x y z of each point; text of the element too", "L"),
        **{name: Spec(TEXT, refused=_SUBROUTINE) for name in ("u_start", "u_end", *USERSUB)},
    },
    _build_curve,
    text="points",
    about="a curve in space",
)
CONSTRAINT_PTCV = Statement(
    "Constraint_PTCV",
    {
        **NAMED,
        "i_marker_id": Spec(ID, "marker whose origin stays on the curve", required=True),
        "j_marker_id": Spec(ID, "marker in whose axes the curve is given", required=True),
        "curve_id": Spec(ID, "the Reference_ParamCurve", required=True),
        **{
            name: Spec(REAL, "near where on the curve it begins, global", "L", "where I is")
            for name in START
        },
        "vel_0": Spec(REAL, note="velocities at the start are those of the bodies"),
    },
    _build_point,
    about="a point that stays on a curve",
)
_NO_VELOCITY = "velocities at the start are those of the bodies"
CONSTRAINT_CVCV = Statement(
    "Constraint_CVCV",
    {
        **NAMED,
        "i_marker_id": Spec(ID, "marker in whose axes the first curve is given", required=True),
        "i_curve_id": Spec(ID, "the first Reference_ParamCurve, in a plane", required=True),
        **{
            name: Spec(REAL, "near where on it the curves touch, in the axes of I", "L", "found")
            for name in _START_I
        },
        "i_vel0": Spec(REAL, note=_NO_VELOCITY),
        "j_marker_id": Spec(ID, "marker in whose axes the second curve is given", required=True),
        "j_curve_id": Spec(ID, "the second, in a plane", required=True),
        **{
            name: Spec(REAL, "near where on it the curves touch, in the axes of J", "L", "found")
            for name in _START_J
        },
        "j_vel0": Spec(REAL, note=_NO_VELOCITY),
        "is_no_slip": Spec(FLAG, "must be FALSE: the curves slide on each other", "", "FALSE"),
    },
    _build_touching,
    about="a curve that touches a curve",
)
