"""Constraint_Gear, Adams' GEAR: both bodies move alike along z of a marker at its origin.

The joints carry the bodies on one third body, on which that marker is. A body that turns by q about
a joint's axis e through p moves by q (e x (c - p)) . z at the marker's origin c, and one that
slides by q e . z. So a gear is a coupler, with those factors as its scales.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from mbsim.errors import Fault
from mbsim.joints.catalog import JOINTS
from mbsim.model import elements as el
from mbsim.model.frames import Frame, marker_frames
from mbsim.reader.draft import Draft, GearDraft
from mbsim.reader.kinds import FLAG, ID
from mbsim.reader.statement import NAMED, Entry, Spec, Statement

#: Joints that gears may have.
TYPES = ("REVOLUTE", "TRANSLATIONAL", "CYLINDRICAL")
#: A part of the distance, and of 1, below which a body does not move along z.
_LEAST = 1e-9


class UnfitGearError(Exception):
    """Why two joints make no gear; `is_joint` where one of them is at fault, not the marker."""

    def __init__(self, message: str, is_joint: bool = False) -> None:
        super().__init__(message)
        self.is_joint = is_joint


def coupler(
    gear: GearDraft, joints: Sequence[el.Joint], draft: Draft, frames: dict[int, Frame]
) -> el.Coupler:
    """Return a gear as a coupler; `frames` are those of markers, on one body in one frame.

    Raises
    ------
    UnfitGearError
        If the joints and the marker make no gear.
    """
    (first, one), (second, other) = (_factor(joint, gear.cv, draft, frames) for joint in joints)
    return el.Coupler(
        id=gear.id,
        label=gear.label or "gear",
        joint_ids=tuple(joint.id for joint in joints),
        motion_types=(one, other),
        scales=(first, -second),
        source=gear.source,
    )


def _factor(
    joint: el.Joint, cv_id: int, draft: Draft, frames: dict[int, Frame]
) -> tuple[float, str]:
    """Return how a body moves at the marker by a displacement of its joint, R or T of which."""
    i, j, cv = (draft.markers[id] for id in (joint.i_marker_id, joint.j_marker_id, cv_id))
    if joint.type not in TYPES:
        raise UnfitGearError(f"joint {joint.id} is {joint.type}; must be {', '.join(TYPES)}", True)
    if cv.body_id not in (i.body_id, j.body_id):
        raise UnfitGearError(f"is not on a body of joint {joint.id}; must be on the body of both")
    sign = 1.0 if cv.body_id == j.body_id else -1.0
    axis, along = frames[j.id].R[:, 2], frames[cv_id].R[:, 2]
    way = frames[cv_id].p - frames[j.id].p
    moves = JOINTS[joint.type].moves
    turning = float(np.cross(axis, way) @ along) if "R" in moves else 0.0
    sliding = float(axis @ along) if "T" in moves else 0.0
    arm = max(float(np.linalg.norm(way)), 1e-300)
    given = [
        (sign * factor, type)
        for factor, type, least in ((turning, "R", _LEAST * arm), (sliding, "T", _LEAST))
        if abs(factor) > least
    ]
    if len(given) == 1:
        return given[0]
    if given:
        raise UnfitGearError(f"joint {joint.id} moves it by turning and by sliding: not built yet")
    raise UnfitGearError(f"joint {joint.id} does not move its body along z of it at its origin")


def _build_gear(entry: Entry) -> None:
    """Keep a gear until markers and joints are known."""
    names = ("joint1_id", "joint2_id", "cv_marker_id")
    first, second, cv = (entry.get(name) for name in names)
    if first is None or second is None or cv is None:
        return
    gear = GearDraft(entry.get("id", 0), (first, second), cv, entry.get("label", ""), entry.source)
    entry.register("gears", gear)


def complete_gears(draft: Draft, model: el.Model) -> Iterator[Fault]:
    """Make couplers of the gears of an XML deck; yield what does not fit."""
    if not draft.gears:
        return
    frames: dict[int, Frame] | None = None
    for gear in draft.gears.values():
        name = f"Constraint_Gear[{gear.id}]"
        said = _missing(draft, gear)
        if said is None:
            if gear.id not in draft.couplers:
                frames = frames or marker_frames(model)
                joints = [draft.joints[id] for id in gear.joint_ids]
                try:
                    draft.couplers[gear.id] = coupler(gear, joints, draft, frames)
                except KeyError:  # a marker without a place, which is told of
                    continue
                except UnfitGearError as error:
                    said = f"{'' if error.is_joint else 'cv_marker_id: '}{error}"
            else:
                said = "id already used by a Constraint_Coupler; gears share their ids"
        if said:
            yield Fault(gear.source.file or draft.file, gear.source.line, name, said)


def _missing(draft: Draft, gear: GearDraft) -> str | None:
    """Return which element of a gear is not there; nothing where that is said already."""
    for id in gear.joint_ids:
        if id not in draft.joints:
            return "" if ("Constraint_Joint", id) in draft.broken else f"there is no joint {id}"
    markers = [gear.cv]
    for id in gear.joint_ids:
        markers += [draft.joints[id].i_marker_id, draft.joints[id].j_marker_id]
    for id in markers:
        if id not in draft.markers:
            known = id != gear.cv or ("Reference_Marker", id) in draft.broken
            return "" if known else f"cv_marker_id: there is no marker {id}"
    return None


CONSTRAINT_GEAR = Statement(
    "Constraint_Gear",
    {
        **NAMED,
        "joint1_id": Spec(ID, "joint of the first body", required=True),
        "joint2_id": Spec(ID, "joint of the second body", required=True),
        "cv_marker_id": Spec(ID, "where they mesh, on the third body; along z", required=True),
        "is_virtual": Spec(FLAG, refused="virtual gears are not built", harmless="false"),
    },
    _build_gear,
    about="two bodies whose joints move as gears do",
)
