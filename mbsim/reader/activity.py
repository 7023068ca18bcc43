"""Activate and Deactivate: which elements take part in the simulations that follow."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from mbsim.errors import Fault
from mbsim.forces.catalog import FORCES, MultiPoint
from mbsim.reader.draft import Draft
from mbsim.reader.keywords import spellings
from mbsim.reader.kinds import ID, keyword
from mbsim.reader.statement import Entry, Spec, Statement

_ALL_FORCES = ("SFORCE", "VECTORFORCE", "BODYFORCE")
#: Keyword -> tables of the elements that it may mean, as `Model.table` and `Model` name them.
_TABLES: Mapping[str, tuple[str, ...]] = {
    "BEAM": ("BEAM",),
    "BUSH": ("BUSHING",),
    "CONTACT": ("contacts",),
    "COUPLER": ("couplers",),
    "FIELD": ("LINEAR_FIELD",),
    "FORCE": _ALL_FORCES,
    "FRICTION": ("JOINTFRICTION",),
    "GCON": ("general_constraints",),
    "PTCV": ("points_on_curves",),
    "CVCV": ("curves_on_curves",),
    "PTSF": ("points_on_surfaces",),
    "GFORCE": ("VECTORFORCE", "BODYFORCE"),
    "JOINT": ("joints",),
    "JPRIM": ("primitives",),
    "MOTION": ("motions",),
    "NFORCE": ("NFORCE",),
    "SENSOR": ("sensors",),
    "SFORCE": ("SFORCE",),
    "SPDP": ("SPRINGDAMPER",),
    "VFORCE": ("VECTORFORCE", "BODYFORCE"),
    "VTORQUE": ("VECTORFORCE", "BODYFORCE"),
}
#: What of a vector force a keyword means.
_PARTS = {"GFORCE": "FORCEANDTORQUE", "VFORCE": "FORCEONLY", "VTORQUE": "TORQUEONLY"}
_STATEMENTS = {
    "contacts": "Force_Contact",
    "couplers": "Constraint_Coupler",
    "general_constraints": "Constraint_General",
    "points_on_curves": "Constraint_PTCV",
    "curves_on_curves": "Constraint_CVCV",
    "points_on_surfaces": "Constraint_PTSF",
    "joints": "Constraint_Joint",
    "primitives": "Constraint_Jprim",
    "motions": "Motion_Joint",
    "sensors": "Sensor_Event",
}
TYPES = spellings(**dict.fromkeys(_TABLES, ""))
TYPES_NOT_BUILT = spellings(
    **dict.fromkeys(
        "CVSF DIFF GEAR GSE LSE MATE MFORCE PFORCE PTDCV PTDSF PTDSFF SFSF "
        "TFSISO UCON YFORCE".split(),
        "",
    )
)


def statement_of(table: str, element: Any = None) -> str:
    """Return the XML statement of an element of a table."""
    if table in FORCES:
        return FORCES[table].statement
    if table == "motions" and element is not None:
        return str(element.statement)
    return _STATEMENTS[table]


def _elements(draft: Draft, table: str) -> Mapping[int, Any]:
    """Return the elements of a table, by id."""
    kind = FORCES[table] if table in FORCES else None
    if kind is not None and isinstance(kind.form, MultiPoint):
        return draft.multi_points
    if kind is not None and not kind.table:
        return draft.marker_forces.get(table, {})
    found: Mapping[int, Any] = getattr(draft, kind.table if kind is not None else table)
    return found


def _found(draft: Draft, kind: str, id: int) -> Iterator[tuple[str, Any]]:
    """Yield tables and elements that a keyword and an id mean."""
    for table in _TABLES[kind]:
        element = _elements(draft, table).get(id)
        part = _PARTS.get(kind)
        if element is not None and (part is None or element.type == part):
            yield table, element


def ids_of(draft: Draft, kind: str) -> list[int]:
    """Return the ids of the elements that a keyword may mean, in order."""
    every = {id for table in _TABLES[kind] for id in _elements(draft, table)}
    return sorted(id for id in every if any(_found(draft, kind, id)))


def switch(entry: Entry, active: bool) -> None:
    """Let an element take part from the next simulation on, or no longer."""
    draft, kind, id = entry.draft, entry.get("element_type"), entry.get("element_id")
    if kind is None or id is None:
        return
    found = list(_found(draft, kind, id))
    names = sorted({statement_of(table) for table in _TABLES[kind]})
    if not found:
        if not any((name, id) in draft.broken for name in names):
            part = f" of type {_PARTS[kind]}" if kind in _PARTS else ""
            entry.fault(f"there is no {' or '.join(names)} {id}{part}", "element_id")
        return
    if len(found) > 1:
        several = ", ".join(f"{statement_of(*one)}[{id}]" for one in found)
        entry.fault(f"means {several}; say SFORCE, VFORCE, VTORQUE or GFORCE", "element_type")
        return
    key = found[0][0], id
    if active:
        draft.inactive.pop(key, None)
    else:
        draft.inactive.setdefault(key, (entry.source, entry.label))


def _needing(draft: Draft, joint: int) -> Iterator[tuple[str, Any]]:
    """Yield table and element of all that acts by the displacement or the reaction of a joint."""
    for table in ("motions", "couplers", "JOINTFRICTION", "JOINTLIMIT"):
        for element in _elements(draft, table).values():
            joints = getattr(element, "joint_ids", (getattr(element, "joint_id", None),))
            if joint in joints:
                yield table, element


def check_joints(draft: Draft) -> None:
    """Refuse a simulation in which something needs a joint that takes no part, once for each."""
    for (table, id), (source, label) in draft.inactive.items():
        for other, element in _needing(draft, id) if table == "joints" else ():
            if (other, element.id) in draft.inactive or (id, element.id) in draft.joints_missed:
                continue
            draft.joints_missed.add((id, element.id))
            name = f"{statement_of(other, element)}[{element.id}]"
            what = "mbsim has no keyword to deactivate it" if other == "JOINTLIMIT" else ""
            what = what or "deactivate it too, before the next Simulate"
            message = f"{name} acts by Constraint_Joint[{id}], which is inactive: {what}"
            draft.faults.append(Fault(source.file, source.line, label, message))


_ATTRIBUTES = {
    "element_type": Spec(keyword(TYPES, TYPES_NOT_BUILT), "which kind of element", required=True),
    "element_id": Spec(ID, "id of the element", required=True),
}
ACTIVATE = Statement(
    "Activate",
    _ATTRIBUTES,
    lambda entry: switch(entry, active=True),
    in_model=False,
    in_command=True,
    about="lets an element take part that did not",
)
DEACTIVATE = Statement(
    "Deactivate",
    _ATTRIBUTES,
    lambda entry: switch(entry, active=False),
    in_model=False,
    in_command=True,
    about="takes an element out of the simulations that follow",
)
