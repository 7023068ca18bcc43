"""Forces of elements over output rows, and the requests that ask for them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from mbsim.arrays.codes import CONTACT_COLUMNS
from mbsim.errors import DeckError, Fault
from mbsim.forces.catalog import Components, of_form
from mbsim.model.elements import Array, Contact, Model, Request
from mbsim.model.names import element_name
from mbsim.results.elements import APPLIED, GROUPS, elements_of
from mbsim.results.motion import Motion, rotate

if TYPE_CHECKING:
    from mbsim.compile_model.build import System

#: Forces whose J marker is wherever I is.
_FLOATING = {kind.name for kind in of_form(Components)}


@dataclass(frozen=True)
class Wrench:
    """Force, and torque about the point where it acts; (n, 3) each, global axes."""

    force: Array
    torque: Array

    def __add__(self, other: Wrench) -> Wrench:
        return Wrench(self.force + other.force, self.torque + other.torque)

    def reaction(self, arm: Array) -> Wrench:
        """Return what acts on the other body; `arm` (n, 3) leads from its point to ours."""
        return Wrench(-self.force, -self.torque - np.cross(arm, self.force))


@dataclass(frozen=True)
class Acting:
    """An element between two markers: rows of `arrays.Markers`, and its columns in the rows."""

    statement: str
    id: int
    i: int
    j: int
    row: int  # of `Rows.joint` or, for `APPLIED`, of `Rows.applied`
    one_sided: bool  # nothing acts on J


def actings(system: System) -> dict[tuple[str, int], Acting]:
    """Return all elements between markers by statement and id."""
    found = {}
    for ids, ends in (
        (system.connections, system.scene.connections),
        (system.applied, system.scene.applied),
    ):
        for row, (statement, id) in enumerate(ids):
            element = elements_of(system.model, statement)[id]
            one_sided = bool(getattr(element, "action_only", False))
            i, j = int(ends.i[row]), int(ends.j[row])
            found[statement, id] = Acting(statement, id, i, j, row, one_sided)
    return found


def between(acting: Acting, i: int, j: int | None) -> int:
    """Return 1 where an element acts on marker row i as its I, -1 as its J, 0 where it does not.

    With `j` only elements between both markers count; one that acts on I alone is not between.
    """
    if acting.one_sided:
        return int(acting.i == i and j is None)
    if acting.i == i and j in (None, acting.j):
        return 1
    return -1 if acting.j == i and j in (None, acting.i) else 0


def marker_actings(
    system: System, elements: Mapping[tuple[str, int], Acting], request: Request
) -> list[tuple[Acting, int]]:
    """Return the elements that a MARKER_FORCE adds up, each with its sign as `between` has it."""
    rows = system.marker_rows
    i = rows.get(request.i_marker_id)
    if i is None:
        return []  # a marker without a row is in no element
    j = rows.get(request.j_marker_id, -1) if request.j_marker_id else None
    signs = [(acting, between(acting, i, j)) for acting in elements.values()]
    return [(acting, sign) for acting, sign in signs if sign]


@dataclass(frozen=True)
class Forces:
    """Forces of all elements over n rows, with the bodies that they act on."""

    system: System
    bodies: Motion
    joint: Array  # (n, 6 nj) as `Rows.joint`
    applied: Array  # (n, 6 nf)
    contact: Array  # (n, CONTACT_COLUMNS nc)

    @cached_property
    def elements(self) -> dict[tuple[str, int], Acting]:
        """All elements between markers by statement and id."""
        return actings(self.system)

    def origin(self, marker: int) -> Array:
        """Return where a row of `arrays.Markers` is, (n, 3), or (1, 3) where it stands still."""
        markers = self.system.scene.markers
        body = int(markers.body[marker])
        if body == len(self.bodies.body_ids):
            place: Array = markers.p[marker][None, :]
            return place
        moved: Array = self.bodies.p[:, body] + rotate(self.bodies.q[:, body], markers.p[marker])
        return moved

    def on(self, acting: Acting, sign: int) -> Wrench:
        """Return what an element exerts on I about I's origin; for sign -1 on J about J's."""
        table = self.applied if acting.statement in APPLIED else self.joint
        values = table[:, 6 * acting.row : 6 * acting.row + 6]
        on_i = Wrench(values[:, :3], values[:, 3:])
        if sign > 0:
            return on_i
        if acting.one_sided:
            return self.nothing()
        if acting.statement in _FLOATING:
            # its J floats with I
            return on_i.reaction(np.zeros((1, 3)))
        return on_i.reaction(self.origin(acting.i) - self.origin(acting.j))

    def nothing(self) -> Wrench:
        """Return no force."""
        zero = np.zeros((self.bodies.rows, 3))
        return Wrench(zero, zero)

    def on_marker(self, request: Request) -> Wrench:
        """Return the sum of what acts on marker I, by elements between it and J if it is given."""
        parts = marker_actings(self.system, self.elements, request)
        return sum((self.on(acting, sign) for acting, sign in parts), self.nothing())

    def of_element(self, request: Request) -> Wrench:
        """Return what one element exerts: on I, with `jflag` on J."""
        sign = -1 if request.jflag else 1
        if request.elem_type == "CONTACT":
            return self._of_contact(request.elem_id, sign)
        acting = self.elements.get((request.elem_type, request.elem_id))
        # a joint that holds nothing need not have a row
        return self.nothing() if acting is None else self.on(acting, sign)

    def _of_contact(self, id: int, sign: int) -> Wrench:
        """Return the net force of a contact, the torque being about the cg of its body."""
        at = CONTACT_COLUMNS * self.system.contact_ids.index(id)
        on_i = Wrench(self.contact[:, at : at + 3], self.contact[:, at + 3 : at + 6])
        if sign > 0:
            return on_i
        (i,), (j,) = contact_bodies(self.system.model, self.system.model.contacts[id])
        return on_i.reaction(self._cg(i) - self._cg(j))

    def _cg(self, body_id: int) -> Array:
        """Return the cg of a body over rows; that of ground is the global origin."""
        if body_id not in self.bodies.body_ids:
            return np.zeros((1, 3))
        return self.bodies.p[:, list(self.bodies.body_ids).index(body_id)]


def contact_bodies(model: Model, contact: Contact) -> tuple[set[int], set[int]]:
    """Return the bodies of a contact's I graphics and of its J graphics."""

    def bodies(ids: tuple[int, ...]) -> set[int]:
        return {model.markers[model.graphics[id].marker_id].body_id for id in ids}

    return bodies(contact.i_graphics_id), bodies(contact.j_graphics_id)


def check_requests(model: Model) -> None:
    """Raise `DeckError` if a request asks for an element that is not there, or for no force.

    `read_model` looks at the ids too; this is for models made by hand, and for what needs more
    than one element to be seen.
    """
    faults = [
        Fault(
            model.file,
            request.source.line,
            element_name(model.file, "Post_Request", request.id),
            text,
        )
        for request in model.requests.values()
        if request.type == "ELEMENTAL_FORCE"
        for text in _faults(model, request)
    ]
    if faults:
        raise DeckError(faults)


def _faults(model: Model, request: Request) -> Iterator[str]:
    """Yield what is wrong with an ELEMENTAL_FORCE."""
    if request.elem_type not in GROUPS:
        yield f'elem_type="{request.elem_type}": must be one of {", ".join(GROUPS)}'
        return
    there = elements_of(model, request.elem_type)
    if request.elem_id not in there:
        ids = ", ".join(map(str, sorted(there)[:12])) or "none"
        what = GROUPS[request.elem_type].title
        yield f'elem_id="{request.elem_id}": no {what} has this id; there are {ids}'
    elif request.elem_type == "CONTACT" and request.jflag:
        bodies_i, bodies_j = contact_bodies(model, there[request.elem_id])
        if len(bodies_i) != 1 or len(bodies_j) != 1:
            yield (
                f'jflag="TRUE": Force_Contact[{request.elem_id}] is between several bodies, '
                "so that there is no one cg for the torque on J; must be FALSE"
            )
