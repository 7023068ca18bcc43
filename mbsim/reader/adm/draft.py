"""What is known of an Adams deck while it is read, and frames as its statements give them."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from mbsim.model.frames import Frame, rotation_313
from mbsim.reader.draft import Draft
from mbsim.reader.statement import Entry


@dataclass
class AdmDraft(Draft):
    """A draft that also knows where the parts' frames are.

    `puzzling` holds statements with words that nobody knows: what they lack may be just that.
    """

    parts: dict[int, Frame] = field(default_factory=dict)
    puzzling: set[str] = field(default_factory=set)


def frame_of(entry: Entry, origin: str, z: str, x: str, z_first: bool = True) -> Frame:
    """Return a frame from its origin and its 3-1-3 angles, or a point on its z-axis and one on x.

    With points, the one on the first axis is on it, the other in the xz-plane.
    """
    p = np.array(entry.get(origin, (0.0, 0.0, 0.0)))
    points = [name for name in (z, x) if entry.given(name)]
    if entry.given("REULER") and points:
        entry.fault(f"give REULER or {z} and {x}, not both")
    if not points:
        return Frame(p, rotation_313(*entry.get("REULER", (0.0, 0.0, 0.0))))
    if len(points) == 1:
        entry.fault(f"{x if points == [z] else z}: missing; {z} and {x} must be given together")
    if entry.get(z) is None or entry.get(x) is None:
        return Frame(p, np.eye(3))
    to_z, to_x = np.array(entry.get(z)) - p, np.array(entry.get(x)) - p
    y = np.cross(to_z, to_x)
    if not np.linalg.norm(y) > 1e-9 * np.linalg.norm(to_z) * np.linalg.norm(to_x):
        entry.fault(f"{z} and {x} are in one line with the origin and give no axes")
        return Frame(p, np.eye(3))
    y = y / np.linalg.norm(y)
    if z_first:
        e_z = to_z / np.linalg.norm(to_z)
        return Frame(p, np.column_stack((np.cross(y, e_z), y, e_z)))
    e_x = to_x / np.linalg.norm(to_x)
    return Frame(p, np.column_stack((e_x, y, np.cross(e_x, y))))


def draft_of(entry: Entry) -> AdmDraft:
    """Return the draft of an entry, which is one of an Adams deck."""
    assert isinstance(entry.draft, AdmDraft)
    return entry.draft


def require(entry: Entry, name: str, more: str = "") -> None:
    """Add the fault that a word is missing, where it is not one that nobody knows."""
    if not entry.given(name) and entry.label not in draft_of(entry).puzzling:
        allowed = entry.statement.attributes[name].kind.allowed
        entry.fault(f"{name.lower()}: missing; must be {allowed}{more}")
