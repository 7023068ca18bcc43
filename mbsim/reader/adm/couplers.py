"""COUPLER and GEAR of an Adams deck: linear relations between displacements of joints."""

from __future__ import annotations

import numpy as np

from mbsim.joints.catalog import JOINTS
from mbsim.model import elements as el
from mbsim.reader.adm.declare import (
    EXPRESSION_OR_USER,
    IDS_BY_COMMAS,
    NUMBERS,
    ROUTINE,
    AdmStatement,
)
from mbsim.reader.adm.translate import written
from mbsim.reader.constraints import CONSTRAINT_COUPLER
from mbsim.reader.kinds import ID, BadValueError, Kind
from mbsim.reader.parse import Attribute, Node
from mbsim.reader.statement import Entry, Spec

_NOT_BUILT = "is documented but not built yet"


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
    if ids is None or scales is None:
        return
    if len(scales) == len(ids) - 1:
        scales = (1.0, *scales)  # the first is 1 where it is left out
    types = entry.get("TYPE") or _moves(entry, ids)
    if types is None:
        return
    entry.note("the sum is held at what the parts give as placed, as Adams' is where they fit")
    node = Node("Constraint_Coupler", entry.node.line)
    values = {"joint_ids": ids, "motion_types": types, "scales": scales}
    node.attributes = [a for a in entry.node.attributes if a.name == "id"]
    node.attributes += [Attribute(n, written(v), entry.node.line) for n, v in values.items()]
    CONSTRAINT_COUPLER.read(node, entry.draft)


COUPLER = AdmStatement(
    "COUPLER",
    {
        "id": Spec(ID, required=True),
        "JOINTS": Spec(IDS_BY_COMMAS, required=True),
        "TYPE": Spec(_TYPES),
        "SCALES": Spec(NUMBERS, required=True),
        "FUNCTION": Spec(EXPRESSION_OR_USER, refused=f"{_NOT_BUILT}; give SCALES"),
        "ROUTINE": Spec(ROUTINE, refused=f"{_NOT_BUILT}; give SCALES"),
    },
    build_coupler,
    xml="Constraint_Coupler",
)


def build_gear(entry: Entry) -> None:
    """Add a gear: both parts move alike along z of the CV marker at its origin.

    The joints carry the parts on one third part, on which the CV marker is. A part that turns by
    q about a joint's axis e through p moves by q (e x (c - p)) . z at the CV marker's origin c,
    and one that slides by q e . z. So a gear is a coupler, with those factors as its scales.
    """
    draft = entry.draft
    ids, cv = entry.get("JOINTS"), draft.markers.get(entry.get("CV", 0))
    if ids is None or len(ids) != 2:
        if ids is not None:
            entry.fault(f"names {len(ids)} joints; a gear has 2", "JOINTS")
        return
    joints = [draft.joints.get(id) for id in ids]
    if cv is None or None in joints:
        what, name = ("JOINT", "JOINTS") if None in joints else ("MARKER", "CV")
        entry.fault(f"there is no such {what} in the deck", name)
        return
    found = [_factor(entry, joint, cv) for joint in joints if joint is not None]
    if None in found:
        return
    (first, type_of_first), (second, type_of_second) = (each for each in found if each is not None)
    coupler = el.Coupler(
        id=entry.get("id", 0),
        label="GEAR",
        joint_ids=ids,
        motion_types=(type_of_first, type_of_second),
        scales=(first, -second),
        source=entry.source,
    )
    entry.register(draft.couplers, coupler)


def _factor(entry: Entry, joint: el.Joint, cv: el.Marker) -> tuple[float, str] | None:
    """Return how a part moves at the CV marker by a displacement of its joint, R or T of which."""
    markers = entry.draft.markers
    i, j = markers.get(joint.i_marker_id), markers.get(joint.j_marker_id)
    if i is None or j is None:
        return None
    if cv.body_id not in (i.body_id, j.body_id):
        entry.fault(f"is not on a part of joint {joint.id}; must be on the part of both", "CV")
        return None
    sign = 1.0 if cv.body_id == j.body_id else -1.0
    axis, along = j.R[:, 2], cv.R[:, 2]
    moves = JOINTS[joint.type].moves
    turning = float(np.cross(axis, np.subtract(cv.pos, j.pos)) @ along) if "R" in moves else 0.0
    sliding = float(axis @ along) if "T" in moves else 0.0
    arm = max(float(np.linalg.norm(np.subtract(cv.pos, j.pos))), 1e-300)
    given = [
        (sign * factor, type)
        for factor, type, least in ((turning, "R", 1e-9 * arm), (sliding, "T", 1e-9))
        if abs(factor) > least
    ]
    if len(given) == 1:
        return given[0]
    if given:
        entry.fault(f"joint {joint.id} moves it by turning and by sliding: {_NOT_BUILT[3:]}", "CV")
    else:
        entry.fault(f"joint {joint.id} does not move its part along z of it at its origin", "CV")
    return None


GEAR = AdmStatement(
    "GEAR",
    {
        "id": Spec(ID, required=True),
        "JOINTS": Spec(IDS_BY_COMMAS, required=True),
        "CV": Spec(ID, required=True),
    },
    build_gear,
)
