"""Which graphics may touch, and what detects each pair: a closed form or FCL."""

from __future__ import annotations

import math
from dataclasses import dataclass

from mbsim.errors import DeckError, Fault
from mbsim.geometry.catalog import PAIRS
from mbsim.model.elements import Contact, Graphic, Model

#: Shapes with flat sides: FCL gives several points for two of them, one for all others.
_FLAT = {"BOX", "PLANE"}
FCL_SLOTS = 8


@dataclass(frozen=True)
class PairPlan:
    """One pair of graphics of a contact, in the order that its detector wants."""

    contact: int
    graphic_i: int  # ids
    graphic_j: int
    swapped: bool
    closed_form: str  # name in PAIRS, or empty where FCL does it
    slots: int

    @property
    def may_need_fcl(self) -> bool:
        """Whether the closed form holds only far from edges."""
        return self.closed_form == "BOX-BOX"

    @property
    def regroups(self) -> bool:
        """Whether a contact that goes on may begin another slot, which is then no impact."""
        if not self.closed_form or self.may_need_fcl:
            return True
        return PAIRS[self.closed_form].regroups

    @property
    def detector(self) -> str:
        """How `mbsim check` names it."""
        if not self.closed_form:
            return "FCL"
        near_edges = ", FCL near edges" if self.may_need_fcl else ""
        return f"closed form {self.closed_form}{near_edges}"


def _plan(contact: Contact, i: Graphic, j: Graphic, detector: str) -> PairPlan:
    """Return the plan of one pair."""
    flat = i.shape in _FLAT and j.shape in _FLAT
    fcl_slots = FCL_SLOTS if flat else 1
    for a, b, swapped in ((i, j, False), (j, i, True)):
        name = f"{a.shape}-{b.shape}"
        if name in PAIRS and detector != "fcl":
            # a box over a box may have to fall back on FCL, whose points need places too
            slots = max(PAIRS[name].slots, fcl_slots)
            return PairPlan(contact.id, a.id, b.id, swapped, name, slots)
    return PairPlan(contact.id, i.id, j.id, False, "", fcl_slots)


def plan_pairs(model: Model, detector: str = "auto") -> list[PairPlan]:
    """Return every I graphic with every J graphic of every contact.

    Parameters
    ----------
    model : Model
    detector : {"auto", "fcl"}
        "fcl" sends all pairs through FCL.

    Raises
    ------
    DeckError
        If two shapes cannot be tested against each other (two planes).
    """
    plans, faults = [], []
    for contact in model.contacts.values():
        for i in contact.i_graphics_id:
            for j in contact.j_graphics_id:
                a, b = model.graphics[i], model.graphics[j]
                if a.shape == b.shape == "PLANE":
                    faults.append(
                        Fault(
                            model.file,
                            contact.source.line,
                            f"Force_Contact[{contact.id}]",
                            f"Post_Graphic[{i}] and Post_Graphic[{j}] are both planes; "
                            "give one of them a body of finite size",
                        )
                    )
                else:
                    plans.append(_plan(contact, a, b, detector))
    if faults:
        raise DeckError(faults)
    return plans


def half_extent(graphic: Graphic) -> tuple[float, float, float]:
    """Return the half edges of the box, in the shape's axes, that holds the shape."""
    size = graphic.size
    if graphic.shape == "SPHERE":
        return (size[0], size[0], size[0])
    if graphic.shape == "ELLIPSOID":
        return (size[0], size[1], size[2])
    if graphic.shape == "BOX":
        return (0.5 * size[0], 0.5 * size[1], 0.5 * size[2])
    if graphic.shape == "CYLINDER":
        return (size[0], size[0], 0.5 * size[1])
    if graphic.shape == "FRUSTUM":
        widest = max(size[0], size[1])
        return (widest, widest, 0.5 * size[2])
    if graphic.shape == "PLANE":
        return (math.inf, math.inf, math.inf)
    assert graphic.vertices is not None
    x, y, z = abs(graphic.vertices).max(axis=0)
    return (float(x), float(y), float(z))


def reach(graphic: Graphic) -> float:
    """Return the radius of the ball around the shape's centre that holds it."""
    if graphic.shape == "SPHERE":
        return graphic.size[0]
    if graphic.shape == "ELLIPSOID":
        return max(graphic.size)
    if graphic.shape == "CYLINDER":
        return math.hypot(graphic.size[0], 0.5 * graphic.size[1])
    if graphic.shape == "FRUSTUM":
        return math.hypot(max(graphic.size[:2]), 0.5 * graphic.size[2])
    if graphic.shape == "MESH":
        assert graphic.vertices is not None
        return float((graphic.vertices**2).sum(axis=1).max() ** 0.5)
    return math.sqrt(sum(half * half for half in half_extent(graphic)))


def kernel_size(graphic: Graphic) -> tuple[float, float, float]:
    """Return the three numbers that the closed forms take (see `geometry.catalog`)."""
    if graphic.shape == "CYLINDER":
        return (graphic.size[0], 0.5 * graphic.size[1], 0.0)
    if graphic.shape == "FRUSTUM":
        return (graphic.size[0], graphic.size[1], 0.5 * graphic.size[2])
    if graphic.shape == "SPHERE":
        return (graphic.size[0], 0.0, 0.0)
    if graphic.shape in ("PLANE", "MESH"):
        return (0.0, 0.0, 0.0)
    return half_extent(graphic)
