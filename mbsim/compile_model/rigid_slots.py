"""Slots of contacts whose friction is rigid: what their equations act on, and which are refused."""

from __future__ import annotations

import numpy as np

from mbsim.arrays.model import Graphics
from mbsim.arrays.state import Pairs
from mbsim.compile_model.markers import MarkerTable
from mbsim.compile_model.mechanism import RigidSlot
from mbsim.compile_model.pairing import MOST_LISTED, Plans
from mbsim.errors import DeckError, Fault
from mbsim.model.elements import Contact, Model
from mbsim.model.names import element_name

#: Places for incidents at most whose friction is rigid: each has two equations, and what these ask
#: of each other is a full matrix.
MOST_SLOTS = 500

_ALLOWED = "give tangential_stiffness a number"


def _refuse(model: Model, contact: Contact, why: str) -> DeckError:
    """Return what is wrong with a contact whose friction cannot be rigid."""
    name = element_name(model.file, "Force_Contact", contact.id)
    message = f"tangential_stiffness=INFINITE: {why}; {_ALLOWED}"
    return DeckError([Fault(contact.source.file, contact.source.line, name, message)])


def rigid_slots(
    model: Model, plans: Plans, pairs: Pairs, graphics: Graphics, table: MarkerTable
) -> list[RigidSlot]:
    """Return the slots of rigid contacts, each with markers on its bodies.

    Raises
    ------
    DeckError
        Where pairs come and go, points are not found in closed form, or there are too many.
    """
    for contact_set in plans.broadphase:
        contact = model.contacts[contact_set.contact]
        if contact.rigid:
            why = f"{contact_set.pairs} pairs of graphics, more than {MOST_LISTED}"
            raise _refuse(model, contact, why)
    markers: dict[int, int] = {}
    found = []
    for k, plan in enumerate(plans.pairs):
        contact = model.contacts[plan.kind.contact]
        if not contact.rigid:
            continue
        if not plan.kind.closed_form:
            both = f"Post_Graphic[{plan.graphic_i}] and Post_Graphic[{plan.graphic_j}]"
            raise _refuse(model, contact, f"points of {both} are found by FCL, not in closed form")
        sides = [int(pairs.graphic_i[k]), int(pairs.graphic_j[k])]
        for g in sides:
            if g not in markers:
                markers[g] = table.add(int(graphics.body[g]), np.zeros(3), np.eye(3))
        i, j = reversed(sides) if plan.kind.swapped else sides
        slots = range(int(pairs.slot[k]), int(pairs.last[k]))
        found += [RigidSlot(contact.id, slot, markers[i], markers[j]) for slot in slots]
        if len(found) > MOST_SLOTS:
            why = f"its shapes may touch at more than {MOST_SLOTS} points"
            raise _refuse(model, contact, why)
    return found
