"""The forces of an Adams deck."""

from __future__ import annotations

from mbsim.forces.catalog import FORCES
from mbsim.model import elements as el
from mbsim.reader.adm.draft import require
from mbsim.reader.adm.subroutine import function_or_user, routine
from mbsim.reader.forces import add_force
from mbsim.reader.statement import Entry
from mbsim.reader.subroutine import result

COMPONENTS = ("FX", "FY", "FZ", "TX", "TY", "TZ")

_SPRING = ("stiffness", "damping", "length", "preload")
_OF_SPRINGS = {
    "TRANSLATIONAL": ("K", "C", "LENGTH", "FORCE"),
    "ROTATIONAL": ("KT", "CT", "ANGLE", "TORQUE"),
}


def _type_of(entry: Entry) -> str:
    """Return TRANSLATIONAL or ROTATIONAL, with a fault where the deck says neither."""
    type: str | None = entry.get("TYPE")
    if type is None:
        require(entry, "TYPE")
        return "TRANSLATIONAL"
    return type


def build_spring(entry: Entry) -> None:
    """Add a spring-damper."""
    type = _type_of(entry)
    names = _OF_SPRINGS[type]
    for name in entry.statement.attributes:
        if entry.given(name) and name in {
            *_OF_SPRINGS["TRANSLATIONAL"],
            *_OF_SPRINGS["ROTATIONAL"],
        }:
            if name not in names:
                entry.fault(f"belongs to the other type; {type} has {', '.join(names)}", name)
    stiffness, damping, length, preload = (entry.get(name, 0.0) for name in names)
    values = {
        "type": type,
        "stiffness": stiffness,
        "damping": damping,
        "length": length,
        "preload": preload,
    }
    words = dict(zip(_SPRING, names, strict=True))
    kind = FORCES["SPRINGDAMPER"]
    add_force(entry, kind, values, entry.get("I", 0), entry.get("J", 0), words)


def build_scalar(entry: Entry) -> None:
    """Add a scalar force."""
    type = _type_of(entry)
    expr, user = function_or_user(entry, "SFORCE", "SFOSUB")
    if expr is None:
        return
    force = el.ScalarForce(
        id=entry.get("id", 0),
        type=type,
        expr=expr,
        user=user,
        i_marker_id=entry.get("I", 0),
        j_marker_id=entry.get("J", 0),
        action_only=entry.get("ACTIONONLY", False),
        source=entry.source,
    )
    entry.register("scalar_forces", force)


_VECTORS = {"VFORCE": "FORCEONLY", "VTORQUE": "TORQUEONLY", "GFORCE": "FORCEANDTORQUE"}
_VECTOR_SUBROUTINES = {"VFORCE": "VFOSUB", "VTORQUE": "VTOSUB", "GFORCE": "GFOSUB"}


def build_vector(entry: Entry) -> None:
    """Add a vector force, torque or both."""
    names = [name for name in COMPONENTS if name in entry.statement.attributes]
    given = [name for name in names if entry.given(name)]
    exprs = tuple(entry.get(name) for name in COMPONENTS)
    user = routine(entry, _VECTOR_SUBROUTINES[entry.statement.name])
    for name in given if entry.given("FUNCTION") else ():
        entry.fault("give FUNCTION or components, not both", name)
    if user is not None:
        exprs = tuple(
            result(entry, "VECTORFORCE", user, names.index(name)) if name in names else None
            for name in COMPONENTS
        )
    elif not given and not entry.given("FUNCTION"):
        entry.fault(f"{names[0]} ... {names[-1]}: missing; at least one must be given")
    force = el.VectorForce(
        id=entry.get("id", 0),
        type=_VECTORS[entry.statement.name],
        exprs=exprs,
        user=user,
        i_marker_id=entry.get("I", 0),
        j_floating_marker_id=entry.get("JFLOAT", 0),
        ref_marker_id=entry.get("RM"),
        source=entry.source,
    )
    other = entry.draft.vector_forces.get(force.id)
    if other is not None and other.type != force.type:
        first = next(name for name, type in _VECTORS.items() if type == other.type)
        where = f"the {first} on line {other.source.line}"
        entry.fault(f"id already used by {where}; {', '.join(_VECTORS)} share their ids here", "id")
        return
    entry.register("vector_forces", force)
