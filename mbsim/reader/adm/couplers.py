"""COUPLER and GEAR of an Adams deck: relations between displacements of joints."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mbsim.joints.catalog import JOINTS
from mbsim.model.frames import Frame
from mbsim.reader.adm.declare import (
    EXPRESSION_OR_USER,
    IDS_BY_COMMAS,
    NUMBERS,
    ROUTINES,
    AdmStatement,
)
from mbsim.reader.adm.subroutine import as_attributes, routine
from mbsim.reader.adm.translate import written
from mbsim.reader.constraints import CONSTRAINT_COUPLER
from mbsim.reader.draft import GearDraft
from mbsim.reader.gears import UnfitGearError, coupler
from mbsim.reader.kinds import ID, BadValueError, Kind
from mbsim.reader.parse import Attribute, Node
from mbsim.reader.statement import Entry, Spec


def _parse_types(text: str) -> tuple[str, ...]:
    """Return R or T for each of ``T:R:R``."""
    words = tuple(word.strip().upper() for word in text.split(":"))
    for word in words:
        if not word or not ("ROTATIONAL".startswith(word) or "TRANSLATIONAL".startswith(word)):
            raise BadValueError
    return tuple(word[0] for word in words)


_TYPES = Kind("T or R for each joint, separated by colons", _parse_types)


def _moves(entry: Entry, ids: tuple[int, ...]) -> tuple[str, ...] | None:
    """Return R or T of each joint that moves in one way, None with a fault where one does not."""
    found: list[str] = []
    for id in ids:
        joint = entry.draft.joints.get(id)
        moves = "".join(JOINTS[joint.type].moves) if joint else "R"
        if len(moves) != 1:
            entry.fault(f"TYPE: missing; joint {id} moves in {' and '.join(moves) or 'no way'}")
            return None
        found.append(moves)
    return tuple(found)


def build_coupler(entry: Entry) -> None:
    """Add a coupler."""
    ids, scales = entry.get("JOINTS"), entry.get("SCALES")
    user = routine(entry, "COUSUB")
    if entry.given("FUNCTION") == entry.given("SCALES"):
        entry.fault("SCALES or FUNCTION=USER(...): one of both must be there")
    if ids is None or (scales is None and user is None):
        if entry.given("FUNCTION") and user is None and entry.get("FUNCTION") is not None:
            entry.fault("must be USER(number, number, ...)", "FUNCTION")
        return
    types = entry.get("TYPE") or _moves(entry, ids)
    if types is None:
        return
    values = {"joint_ids": ids, "motion_types": types}
    if user is None:
        if len(scales) == len(ids) - 1:
            scales = (1.0, *scales)  # the first is 1 where it is left out
        entry.note("the sum is held at what the parts give as placed, as Adams' is where they fit")
        values["scales"] = scales
    node = Node("Constraint_Coupler", entry.node.line)
    node.attributes = [a for a in entry.node.attributes if a.name == "id"]
    node.attributes += [Attribute(n, written(v), entry.node.line) for n, v in values.items()]
    if user is not None:
        given = as_attributes(user, "usrsub").items()
        node.attributes += [Attribute(n, v, entry.node.line) for n, v in given]
    CONSTRAINT_COUPLER.read(node, entry.draft)
    if len(entry.get("ROUTINE", ())) > 1:
        _name_derivatives(entry)


def _name_derivatives(entry: Entry) -> None:
    """Let a coupler's derivatives be by the functions that its ROUTINE names."""
    of, *others = (text.rpartition("::") for text in entry.get("ROUTINE"))
    for file, _, _ in others:
        if file not in ("", of[0]):
            entry.fault(f"must be in one file; {file} is not that of {of[2]}", "ROUTINE")
            return
    made = entry.draft.couplers.get(entry.get("id", 0))
    if made is not None and made.user is not None:
        first, second = (name for _, _, name in others)
        user = replace(made.user, first=first, second=second, named=True)
        entry.draft.couplers[made.id] = replace(made, user=user)


COUPLER = AdmStatement(
    "COUPLER",
    {
        "id": Spec(ID, required=True),
        "JOINTS": Spec(IDS_BY_COMMAS, required=True),
        "TYPE": Spec(_TYPES),
        "SCALES": Spec(NUMBERS),
        "FUNCTION": Spec(EXPRESSION_OR_USER),
        "ROUTINE": Spec(ROUTINES),
    },
    build_coupler,
    xml="Constraint_Coupler",
)


def build_gear(entry: Entry) -> None:
    """Add a gear."""
    draft = entry.draft
    ids, cv = entry.get("JOINTS"), draft.markers.get(entry.get("CV", 0))
    if ids is None or len(ids) != 2:
        if ids is not None:
            entry.fault(f"names {len(ids)} joints; a gear has 2", "JOINTS")
        return
    joints = [draft.joints[id] for id in ids if id in draft.joints]
    if cv is None or len(joints) != len(ids):
        what, name = ("JOINT", "JOINTS") if len(joints) != len(ids) else ("MARKER", "CV")
        entry.fault(f"there is no such {what} in the deck", name)
        return
    ends = [cv.id, *(id for joint in joints for id in (joint.i_marker_id, joint.j_marker_id))]
    if any(id not in draft.markers for id in ends):
        return
    # markers of one part are in its frame
    frames = {id: Frame(np.array(draft.markers[id].pos), draft.markers[id].R) for id in ends}
    gear = GearDraft(entry.get("id", 0), ids, cv.id, "GEAR", entry.source)
    try:
        made = coupler(gear, joints, draft, frames)
    except UnfitGearError as error:
        entry.fault(str(error), "JOINTS" if error.is_joint else "CV")
        return
    entry.register_in(draft.couplers, made)


GEAR = AdmStatement(
    "GEAR",
    {
        "id": Spec(ID, required=True),
        "JOINTS": Spec(IDS_BY_COMMAS, required=True),
        "CV": Spec(ID, required=True),
    },
    build_gear,
)
