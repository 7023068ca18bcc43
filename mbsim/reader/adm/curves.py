"""CURVE and PTCV of an Adams deck: curves in space, and points that stay on them."""

from __future__ import annotations

from mbsim.model import elements as el
from mbsim.reader.adm.declare import ANY, AdmStatement, numbers
from mbsim.reader.adm.translate import read_as
from mbsim.reader.curves import REFERENCE_PARAM_CURVE
from mbsim.reader.kinds import FLAG, ID, INTEGER, REAL
from mbsim.reader.statement import Entry, Spec

_SUBROUTINE = "CURSUB is documented but not built yet; give MATRIX"
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


def build_point_on_curve(entry: Entry) -> None:
    """Add a point on a curve."""
    if entry.given("ICM") and not entry.given("DISP"):
        entry.fault("is of DISP, which is not given", "ICM")
        return
    given = entry.get("DISP")
    point = el.PointOnCurve(
        id=entry.get("id", 0),
        i_marker_id=entry.get("I", 0),
        j_marker_id=entry.get("RM", 0),
        curve_id=entry.get("CURVE", 0),
        start=given,
        start_marker_id=entry.get("ICM", entry.get("RM")) if given is not None else None,
        source=entry.source,
    )
    entry.register(entry.draft.points_on_curves, point)


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
        "VEL": Spec(REAL, note="velocities at the start are those of the parts"),
        "VMAG": Spec(REAL, note="velocities at the start are those of the parts"),
    },
    build_point_on_curve,
    xml="Constraint_PTCV",
)
