"""The radius that a side of a contact has where it touches, for HERTZ by materials."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

from mbsim.model.elements import Contact, Graphic

_FLAT = ("PLANE", "BOX")


def by_materials(contact: Contact) -> bool:
    """Return whether the contact's stiffness follows from elastic moduli and radii."""
    moduli = (contact.i_elastic_modulus, contact.j_elastic_modulus)
    return contact.cnf_type == "HERTZ" and moduli != (None, None)


def side_radius(contact: Contact, side: str, graphics: Mapping[int, Graphic]) -> float | None:
    """Return the radius [L] of side "i" or "j": as given, else of its graphics; inf is flat.

    A sphere has one, a plane and a box's face are flat. None where graphics of the side differ
    or have another shape: then the deck has to say it.
    """
    given: float | None = getattr(contact, f"{side}_radius")
    if given is not None:
        return given
    found = {_radius(graphics[id]) for id in getattr(contact, f"{side}_graphics_id")}
    return found.pop() if len(found) == 1 else None


def _radius(graphic: Graphic) -> float | None:
    if graphic.shape == "SPHERE":
        return graphic.size[0]
    return math.inf if graphic.shape in _FLAT else None


def with_radii(contact: Contact, graphics: Mapping[int, Graphic]) -> Contact:
    """Return the contact with the radii of its graphics filled in where its law needs them."""
    if not by_materials(contact):
        return contact
    return replace(
        contact,
        i_radius=side_radius(contact, "i", graphics),
        j_radius=side_radius(contact, "j", graphics),
    )
