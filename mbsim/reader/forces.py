"""Force_Scalar_TwoBody, _Vector_..., and Reference_Variable."""

from __future__ import annotations

from typing import Any

from mbsim.model import elements as el
from mbsim.model.mechanism_checks import COMPONENTS
from mbsim.reader.keywords import SCALAR_TYPES, VECTOR_TYPES
from mbsim.reader.kinds import EXPRESSION, FLAG, ID, keyword
from mbsim.reader.statement import MARKERS, NAMED, Entry, Spec, Statement
from mbsim.reader.subroutine import BY_EITHER, USERSUB, by_user, result, subroutine


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


#: Which of COMPONENTS a type does not have.
_NOT_OF_TYPE = {
    "FORCEONLY": COMPONENTS[3:],
    "TORQUEONLY": COMPONENTS[:3],
    "FORCEANDTORQUE": (),
}


#: What the subroutine of a type is called where the deck does not say.
_VECTOR_SUBROUTINES = {
    "FORCEONLY": "VFOSUB",
    "TORQUEONLY": "VTOSUB",
    "FORCEANDTORQUE": "GFOSUB",
}


def _vector_parts(entry: Entry, statement: str) -> dict[str, Any]:
    """Return what vector forces on one and on two bodies have in common."""
    type = entry.get("type", "FORCEANDTORQUE")
    for name in _NOT_OF_TYPE[type]:
        if entry.given(name):
            has = ", ".join(each for each in COMPONENTS if each not in _NOT_OF_TYPE[type])
            entry.fault(f"does not belong to type {type}, which has {has}", name)
    user: el.Subroutine | None = None
    exprs = tuple(entry.get(name) for name in COMPONENTS)
    if by_user(entry, COMPONENTS):
        user = subroutine(entry, "usrsub", _VECTOR_SUBROUTINES[type])
        built = [name not in _NOT_OF_TYPE[type] for name in COMPONENTS]
        exprs = tuple(
            result(entry, statement, user, sum(built[:k])) if built[k] else None for k in range(6)
        )
    elif not any(entry.given(name) for name in COMPONENTS):
        entry.fault(f"{COMPONENTS[0]} ... {COMPONENTS[-1]}: missing; at least one must be given")
    return {
        "id": entry.get("id", 0),
        "type": type,
        "exprs": exprs,
        "user": user,
        "label": entry.get("label", ""),
        "i_marker_id": entry.get("i_marker_id", 0),
        "ref_marker_id": entry.get("ref_marker_id"),
        "source": entry.source,
    }


def _build_vector(entry: Entry) -> None:
    """Add a vector force between two bodies."""
    j = entry.get("j_floating_marker_id", 0)
    force = el.VectorForce(**_vector_parts(entry, "VECTORFORCE"), j_floating_marker_id=j)
    entry.register(entry.draft.vector_forces, force)


def _build_body_force(entry: Entry) -> None:
    """Add a vector force on one body."""
    entry.register(entry.draft.body_forces, el.BodyForce(**_vector_parts(entry, "BODYFORCE")))


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


FORCE_SCALAR_TWOBODY = Statement(
    "Force_Scalar_TwoBody",
    {
        **NAMED,
        "type": Spec(keyword(SCALAR_TYPES), "force along I-J, torque about J's z", required=True),
        **MARKERS,
        "expr": Spec(EXPRESSION, "the force, > 0 pushes apart; or the torque on I", "F or F L"),
        **USERSUB,
        "action_only": Spec(FLAG, "nothing acts on J", "", "FALSE"),  # ours; Adams' ACTIONONLY
    },
    _build_scalar,
    about="a force along a line or a torque, by an expression",
)


def _about_component(name: str) -> str:
    return f"{'force' if name[0] == 'f' else 'torque'} on I along {name[1]}"


_VECTOR: dict[str, Spec] = {
    "type": Spec(keyword(VECTOR_TYPES), "which components there are", required=True),
    "ref_marker_id": Spec(ID, "marker along whose axes they are", "", "global frame"),
    **{
        name: Spec(EXPRESSION, _about_component(name), "F" if name[0] == "f" else "F L", "0")
        for name in COMPONENTS
    },
    **USERSUB,
}
FORCE_VECTOR_TWOBODY = Statement(
    "Force_Vector_TwoBody",
    {
        **NAMED,
        "i_marker_id": MARKERS["i_marker_id"],
        "j_floating_marker_id": Spec(
            ID, "marker of the body that takes the opposite at I's origin", required=True
        ),
        **_VECTOR,
    },
    _build_vector,
    about="force and torque between two bodies by components",
)
FORCE_VECTOR_ONEBODY = Statement(
    "Force_Vector_OneBody",
    {**NAMED, "i_marker_id": MARKERS["i_marker_id"], **_VECTOR},
    _build_body_force,
    about="force and torque on one body by components",
)
REFERENCE_VARIABLE = Statement(
    "Reference_Variable",
    {
        **NAMED,
        "type": Spec(BY_EITHER, "how it is given", "", "by what is given"),
        "expr": Spec(EXPRESSION, "its value"),
        **USERSUB,
    },
    _build_variable,
    about="an expression with a name, used as VARVAL(id)",
)
