"""CURVE, PTCV and CVCV of an Adams deck: curves in space, and what stays on them."""

from __future__ import annotations

from mbsim.model.curves import CurveOnCurve, PointOnCurve
from mbsim.reader.adm.declare import ANY, AdmStatement, numbers
from mbsim.reader.adm.translate import read_as
from mbsim.reader.curves import REFERENCE_PARAM_CURVE
from mbsim.reader.kinds import FLAG, ID, INTEGER, REAL
from mbsim.reader.statement import Entry, Spec

_SUBROUTINE = "CURSUB is documented but not built yet; give MATRIX"
_VELOCITY = "velocities at the start are those of the parts"
_REPORTED = "says where Adams reports the force; mbsim reports it by markers"
#: INTERPOLATION_ORDER is one more than the degree.
_ORDERS = {4: "FALSE", 6: "TRUE"}


def build_curve(entry: Entry) -> None:
    """Add a curve."""
    order = entry.get("INTERPOLATION_ORDER", 4)
    if order not in _ORDERS:
        entry.fault("must be 4 or 6 (cubic or quintic)", "INTERPOLATION_ORDER")
        return
    fixed = {"is_curve_points": "TRUE" if entry.get("CURVE_POINTS", False) else "FALSE"}
    fixed["quintic"] = _ORDERS[order]
    read_as(entry, REFERENCE_PARAM_CURVE, {"MATRIX": "matrix_id", "CLOSED": "is_u_closed"}, fixed)


def _has_place(entry: Entry, marker: str, place: str) -> bool:
    """Return whether a marker in whose axes a place is given has one; else fault it."""
    if entry.given(marker) and not entry.given(place):
        entry.fault(f"is of {place}, which is not given", marker)
        return False
    return True


def build_point_on_curve(entry: Entry) -> None:
    """Add a point on a curve."""
    if not _has_place(entry, "ICM", "DISP"):
        return
    given = entry.get("DISP")
    point = PointOnCurve(
        id=entry.get("id", 0),
        i_marker_id=entry.get("I", 0),
        j_marker_id=entry.get("RM", 0),
        curve_id=entry.get("CURVE", 0),
        start=given,
        start_marker_id=entry.get("ICM", entry.get("RM")) if given is not None else None,
        source=entry.source,
    )
    entry.register("points_on_curves", point)


def build_curve_on_curve(entry: Entry) -> None:
    """Add a curve that touches a curve."""
    if not (_has_place(entry, "IICM", "IDISP") and _has_place(entry, "JICM", "JDISP")):
        return
    pair = CurveOnCurve(
        id=entry.get("id", 0),
        i_marker_id=entry.get("IRM", 0),
        j_marker_id=entry.get("JRM", 0),
        i_curve_id=entry.get("ICURVE", 0),
        j_curve_id=entry.get("JCURVE", 0),
        i_start=entry.get("IDISP"),
        i_start_marker_id=entry.get("IICM", entry.get("IRM")),
        j_start=entry.get("JDISP"),
        j_start_marker_id=entry.get("JICM", entry.get("JRM")),
        source=entry.source,
    )
    entry.register("curves_on_curves", pair)


CURVE = AdmStatement(
    "CURVE",
    {
        "id": Spec(ID, required=True),
        "CLOSED": Spec(FLAG),
        "CURVE_POINTS": Spec(FLAG),
        "MATRIX": Spec(ID, required=True),
        "INTERPOLATION_ORDER": Spec(INTEGER),
        **{name: Spec(ANY, refused=_SUBROUTINE) for name in ("FUNCTION", "MINPAR", "MAXPAR")},
    },
    build_curve,
    words={"CLOSED": ("CLOSED", "TRUE"), "CURVE_POINTS": ("CURVE_POINTS", "TRUE")},
    xml="Reference_ParamCurve",
)
PTCV = AdmStatement(
    "PTCV",
    {
        "id": Spec(ID, required=True),
        "I": Spec(ID, required=True),
        "JFLOAT": Spec(ID, note=_REPORTED),
        "CURVE": Spec(ID, required=True),
        "RM": Spec(ID, required=True),
        "DISP": Spec(numbers(3)),
        "ICM": Spec(ID),
        **{name: Spec(REAL, note=_VELOCITY) for name in ("VEL", "VMAG")},
    },
    build_point_on_curve,
    xml="Constraint_PTCV",
)
CVCV = AdmStatement(
    "CVCV",
    {
        "id": Spec(ID, required=True),
        **{name: Spec(ID, required=True) for name in ("ICURVE", "IRM", "JCURVE", "JRM")},
        **{name: Spec(ID, note=_REPORTED) for name in ("IFLOAT", "JFLOAT")},
        **{name: Spec(numbers(3)) for name in ("IDISP", "JDISP")},
        **{name: Spec(ID) for name in ("IICM", "JICM")},
        **{name: Spec(ANY, note=_VELOCITY) for name in ("IVEL", "JVEL", "IVMAG", "JVMAG")},
    },
    build_curve_on_curve,
    xml="Constraint_CVCV",
)
