"""Force_SpringDamper, Force_Scalar_TwoBody and Reference_Variable."""

from __future__ import annotations

from mbsim.model import elements as el
from mbsim.reader.keywords import SCALAR_TYPES, SPRING_TYPES
from mbsim.reader.kinds import EXPRESSION, FLAG, ID, NOT_NEGATIVE, REAL, TEXT, keyword
from mbsim.reader.statement import Entry, Spec, Statement
from mbsim.reader.subroutine import BY_EITHER, USERSUB, by_user, result, subroutine


def _build_spring(entry: Entry) -> None:
    """Add a spring-damper."""
    if entry.get("type") is None:
        return
    if entry.get("stiffness", 0.0) == entry.get("damping", 0.0) == entry.get("preload", 0.0) == 0.0:
        entry.warn("stiffness, damping and preload are 0: the spring does nothing")
    if entry.get("type") == "TRANSLATIONAL" and entry.get("length", 0.0) < 0.0:
        entry.fault("must be a number >= 0: it is a distance", "length")
    spring = el.SpringDamper(
        id=entry.get("id", 0),
        type=entry.get("type"),
        label=entry.get("label", ""),
        i_marker_id=entry.get("i_marker_id", 0),
        j_marker_id=entry.get("j_marker_id", 0),
        stiffness=entry.get("stiffness", 0.0),
        damping=entry.get("damping", 0.0),
        length=entry.get("length", 0.0),
        preload=entry.get("preload", 0.0),
        source=entry.source,
    )
    entry.register(entry.draft.spring_dampers, spring)


def _build_scalar(entry: Entry) -> None:
    """Add a scalar force by an expression or a user subroutine."""
    user = subroutine(entry, "usrsub", "SFOSUB") if by_user(entry) else None
    expr = entry.get("expr") if user is None else result(entry, "SFORCE", user)
    if entry.get("type") is None or expr is None:
        return
    force = el.ScalarForce(
        id=entry.get("id", 0),
        type=entry.get("type"),
        expr=expr,
        label=entry.get("label", ""),
        i_marker_id=entry.get("i_marker_id", 0),
        j_marker_id=entry.get("j_marker_id", 0),
        action_only=entry.get("action_only", False),
        user=user,
        source=entry.source,
    )
    entry.register(entry.draft.scalar_forces, force)


def _build_variable(entry: Entry) -> None:
    """Add a variable."""
    user = None
    if by_user(entry, type=entry.get("type", "")):
        user = subroutine(entry, "usrsub", "VARSUB")
    expr = entry.get("expr") if user is None else result(entry, "VARIABLE", user)
    if expr is None:
        return
    variable = el.Variable(
        id=entry.get("id", 0),
        expr=expr,
        label=entry.get("label", ""),
        user=user,
        source=entry.source,
    )
    entry.register(entry.draft.variables, variable)


_MARKERS = {"i_marker_id": Spec(ID, required=True), "j_marker_id": Spec(ID, required=True)}
_NAMED = {"id": Spec(ID, required=True), "label": Spec(TEXT), "full_label": Spec(TEXT)}

FORCE_SPRINGDAMPER = Statement(
    "Force_SpringDamper",
    {
        **_NAMED,
        "type": Spec(keyword(SPRING_TYPES), required=True),
        **_MARKERS,
        "stiffness": Spec(NOT_NEGATIVE),
        "damping": Spec(NOT_NEGATIVE),
        "length": Spec(REAL),
        "preload": Spec(REAL),
    },
    _build_spring,
)
FORCE_SCALAR_TWOBODY = Statement(
    "Force_Scalar_TwoBody",
    {
        **_NAMED,
        "type": Spec(keyword(SCALAR_TYPES), required=True),
        **_MARKERS,
        "expr": Spec(EXPRESSION),
        **USERSUB,
        "action_only": Spec(FLAG),  # ours; Adams' ACTIONONLY
    },
    _build_scalar,
)
REFERENCE_VARIABLE = Statement(
    "Reference_Variable",
    {
        **_NAMED,
        "type": Spec(BY_EITHER),
        "expr": Spec(EXPRESSION),
        **USERSUB,
    },
    _build_variable,
)
