"""Shapes, pairs and contacts of a model -> arrays; only what takes part gets a row."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsim.arrays import codes
from mbsim.arrays.codes import (
    AROUND_RIM,
    AT_PLACES,
    AT_POINTS,
    AT_ROWS,
    AXIS_SIDES,
    HELD_AT_PLACES,
    HULL_SIDES,
    NO_ROWS,
    ON_PLANE,
    STRETCH,
)
from mbsim.arrays.model import Contacts, Graphics, Kinds, Slots
from mbsim.arrays.state import Broadphase, Pairs
from mbsim.compile_model.pairing import (
    Kind,
    Plans,
    half_extent,
    half_width,
    kernel_size,
    radius,
    shape_class,
)
from mbsim.compile_model.surfaces import Need, needed_as_triangles, packed_surfaces, thickness
from mbsim.core import jit
from mbsim.core.layout import BODY_SIZE
from mbsim.geometry.catalog import MOTION_BOUNDS, NEARS, PAIRS, REGION_ROWS, REGIONS, SIZE, Pair
from mbsim.laws import abi
from mbsim.laws.catalog import NORMAL_LAWS, FrictionLaw, friction_law_of
from mbsim.laws.constants import friction_parameters, normal_constants
from mbsim.model.contact_radius import with_radii
from mbsim.model.elements import Contact, Model
from mbsim.model.placement import Placement

if TYPE_CHECKING:
    from mbsim.plugins import UserFriction
    from mbsim.plugins.types import UserNormal

#: Places for near pairs of a large contact, for each of its graphics.
NEAR_EACH = 24
#: Most cells of the grid that finds them, for each graphic.
CELLS_EACH = 4
#: Boxes nearer than this many radii are listed as near.
SKIN = 0.45


def region_address(name: str) -> int:
    """Return the address of a closed-form pair that is one incident."""
    from mbsim.compile_model import pair_adapter

    made, slots = REGIONS[name], PAIRS[name].slots + REGION_ROWS
    adapted = pair_adapter.adapt_region(made.points, made.whole, slots)
    return jit.address(adapted, pair_adapter.SIGNATURE, allocates=True)


def kernel_address(kind: Kind) -> int:
    """Return the address of a kind's closed form, 0 where it has none."""
    if not kind.closed_form:
        return 0
    if kind.region:
        return region_address(kind.closed_form)
    assert kind.form is not None
    return pair_address(kind.form)


def pair_address(pair: Pair) -> int:
    """Return the address of a closed-form pair."""
    from mbsim.compile_model import pair_adapter

    adapted = pair_adapter.adapt_pair(pair.points, pair.slots)
    return jit.address(adapted, pair_adapter.SIGNATURE, allocates=True)


def near_address(name: str, rows: int) -> int:
    """Return the address of what gives the points of a pair that is apart too, in `rows` rows."""
    from mbsim.compile_model import pair_adapter

    adapted = pair_adapter.adapt_pair(NEARS[name], rows)
    return jit.address(adapted, pair_adapter.SIGNATURE, allocates=True)


def motion_bound_address(name: str) -> int:
    """Return the address of the motion bound of a closed form, 0 where it has none."""
    if name not in MOTION_BOUNDS:
        return 0
    from mbsim.compile_model import pair_adapter

    adapted = pair_adapter.adapt_motion_bound(MOTION_BOUNDS[name])
    return jit.address(adapted, pair_adapter.SIGNATURE, allocates=True)


def graphics_table(
    model: Model,
    placement: Placement,
    ids: list[int],
    row: dict[int, int],
    shapes: list[str],
    meshed: Mapping[int, Need],
) -> Graphics:
    """Return the shapes in their bodies' cg axes.

    `row` is the body row by body id; `meshed` has the graphics that are needed as triangles, and
    what of them.
    """
    n = len(ids)
    surfaces, begins = packed_surfaces(model.graphics, meshed)
    made = Graphics(
        body=np.zeros(n, dtype=np.int64),
        p=np.zeros((n, 3)),
        R=np.zeros((n, 3, 3)),
        size=np.zeros((n, SIZE)),
        radius=np.zeros(n),
        half=np.zeros((n, 3)),
        turns=np.ones(n, dtype=np.int64),
        thin=np.zeros(n),
        width=np.zeros(n),
        shape=np.zeros(n, dtype=np.int64),
        flat=np.full(n, AXIS_SIDES, dtype=np.int64),
        marker_p=np.zeros((n, 3)),
        marker_R=np.zeros((n, 3, 3)),
        surfaces=surfaces,
    )
    for g, graphic_id in enumerate(ids):
        graphic = model.graphics[graphic_id]
        marker = placement.markers[graphic.marker_id]
        made.body[g] = row[marker.body_id]
        made.p[g] = marker.p_B + marker.R_B @ np.array(graphic.offset)
        made.R[g] = marker.R_B
        made.size[g, :3] = kernel_size(graphic)
        made.thin[g] = made.width[g] = half_width(graphic)
        if graphic_id in begins:
            made.size[g, 3] = surfaces.ctypes.data + surfaces.itemsize * begins[graphic_id]
            made.thin[g] = min(
                made.width[g], thickness(surfaces[begins[graphic_id] :], meshed[graphic_id])
            )
        made.radius[g] = radius(graphic)
        made.half[g] = half_extent(graphic)
        made.turns[g] = 0 if graphic.shape == "SPHERE" else 1
        made.shape[g] = shapes.index(shape_class(graphic))
        if graphic.hull is not None:
            made.flat[g] = HULL_SIDES
        made.marker_p[g] = marker.p_B
        made.marker_R[g] = marker.R_B
    return made


#: Pairs whose points lie in a face: corners of a flat shape on a plane, and those whose corner has
#: another row behind an edge of the other shape.
HELD_ALONG = {
    "BOX-PLANE": ON_PLANE,
    "MESH-PLANE": ON_PLANE,
    "BOX-BOX": HELD_AT_PLACES,
    "MESH-BOX": HELD_AT_PLACES,
    "MESH-MESH": HELD_AT_PLACES,
}


def _face_weight(kind: Kind) -> float:
    """Return the shares of a flat face where incidents of a kind have an area, else 0."""
    if kind.region:
        return REGIONS[kind.closed_form].whole
    return 1.0 if kind.has_area else 0.0


def _noise(kind: Kind) -> float:
    """Return the scatter of the normals that FCL gives for a kind."""
    from mbsim.geometry.fcl_detector import states_noise

    return states_noise(kind.shape_i, kind.shape_j)


def _moves(kind: Kind, sticks: bool) -> int:
    """Return whether incidents of a kind keep their slots by place, as in `Kinds`."""
    if kind.moves:
        return NO_ROWS
    return HELD_ALONG.get(kind.closed_form, AT_ROWS) if sticks else AT_ROWS


def kinds_table(kinds: list[Kind], contacts: dict[int, int], sticks: Set[int]) -> Kinds:
    """Return how pairs are tested; `contacts` is the contact row by id.

    `sticks` are the ids of those whose friction sticks.
    """
    return Kinds(
        contact=np.array([contacts[k.contact] for k in kinds], dtype=np.int64),
        kernel=np.array([kernel_address(k) for k in kinds], dtype=np.int64),
        slots=np.array([k.slots for k in kinds], dtype=np.int64),
        swapped=np.array([k.swapped for k in kinds], dtype=np.int64),
        regroups=np.array([k.regroups for k in kinds], dtype=np.int64),
        whole=np.array([_face_weight(k) for k in kinds]),
        rims=np.array([k.rims for k in kinds], dtype=np.int64),
        step=np.array([k.step for k in kinds], dtype=np.int64),
        moves=np.array([_moves(k, k.contact in sticks) for k in kinds], dtype=np.int64),
        noise=np.array([0.0 if k.closed_form else _noise(k) for k in kinds]),
        bound=np.array([motion_bound_address(k.closed_form) for k in kinds], dtype=np.int64),
        pressure=np.array(["FIELD" in k.closed_form.split("-") for k in kinds], dtype=np.int64),
    )


def _broadphase_rows(plans: Plans) -> tuple[int, int]:
    """Return how many pairs of large contacts can be near at once, and the slots of one."""
    if not plans.broadphase:
        return 0, 0
    capacity = sum(min(c.pairs, NEAR_EACH * len({*c.i, *c.j}) + 4096) for c in plans.broadphase)
    return capacity, max(
        kind.slots for contact_set in plans.broadphase for kind in contact_set.kinds.values()
    )


def pairs_table(plans: Plans, kinds: list[Kind], rows: dict[int, int]) -> tuple[Pairs, int]:
    """Return the rows for pairs and the number of their slots; `rows`: graphic row by id.

    Listed pairs come first and stay; the rows of large contacts have slots for any of their
    kinds.
    """
    fixed = len(plans.pairs)
    capacity, wide = _broadphase_rows(plans)
    n = fixed + capacity
    row_of = {kind: k for k, kind in enumerate(kinds)}
    listed = np.array([plan.kind.slots for plan in plans.pairs], dtype=np.int64)
    ends = np.concatenate([np.zeros(1, dtype=np.int64), np.cumsum(listed)])
    broadphase_slots = ends[-1] + wide * np.arange(capacity + 1)
    made = Pairs(
        kind=np.zeros(n, dtype=np.int64),
        graphic_i=np.zeros(n, dtype=np.int64),
        graphic_j=np.zeros(n, dtype=np.int64),
        slot=np.concatenate([ends[:-1], broadphase_slots[:-1]]),
        last=np.concatenate([ends[1:], broadphase_slots[1:]]),
        touches=np.zeros(n, dtype=np.int64),
        gap=np.zeros(n),
        left=np.zeros(n),
        active=np.arange(n),
        free=np.arange(n)[::-1].copy(),
        count=np.array([fixed, capacity, fixed, 0], dtype=np.int64),
    )
    for k, plan in enumerate(plans.pairs):
        made.kind[k] = row_of[plan.kind]
        made.graphic_i[k], made.graphic_j[k] = rows[plan.graphic_i], rows[plan.graphic_j]
    return made, int(broadphase_slots[-1])


def broadphase_table(
    plans: Plans,
    kinds: list[Kind],
    rows: dict[int, int],
    graphics: Graphics,
    shapes: list[str],
    contacts: dict[int, int],
    capacity: int,
    slots: int,
    memory: int,
) -> Broadphase:
    """Return the contacts whose near pairs are found as they move."""
    n, ng = len(plans.broadphase), len(graphics.body)
    row_of = {kind: k for k, kind in enumerate(kinds)}
    made = Broadphase(
        contact=np.array(
            [contacts[contact_set.contact] for contact_set in plans.broadphase], dtype=np.int64
        ),
        same=np.array([contact_set.same for contact_set in plans.broadphase], dtype=np.int64),
        first=np.zeros((n, 4), dtype=np.int64),
        member=np.array([rows[g] for c in plans.broadphase for g in (*c.i, *c.j)], dtype=np.int64),
        kind=np.full((n, len(shapes) ** 2), -1, dtype=np.int64),
        swap=np.zeros((n, len(shapes) ** 2), dtype=np.int64),
        size=np.zeros(2),
        reference=np.zeros((ng if n else 0, 7)),
        lever=np.zeros(ng if n else 0),
        room=np.full(ng, math.inf),
        own=np.zeros(ng),
        box=np.zeros((ng if n else 0, 6)),
        cell=np.zeros(ng if n else 0, dtype=np.int64),
        order=np.zeros(ng if n else 0, dtype=np.int64),
        start=np.zeros(CELLS_EACH * ng + 64 if n else 0, dtype=np.int64),
        head=np.zeros(ng if n else 0, dtype=np.int64),
        next=np.zeros(capacity if n else 0, dtype=np.int64),
        moved=np.zeros((capacity if n else 0, 5), dtype=np.int64),
        spare=np.zeros((slots if n else 0, codes.SPARE + 2 * memory)),
    )
    at = 0
    for k, contact_set in enumerate(plans.broadphase):
        middle, end = at + len(contact_set.i), at + len(contact_set.i) + len(contact_set.j)
        made.first[k] = at, middle, middle, end
        at = end
        for (shape_i, shape_j), kind in contact_set.kinds.items():
            i, j = shapes.index(shape_i), shapes.index(shape_j)
            both = [(i, j, 0), (j, i, 1)] if contact_set.same and i != j else [(i, j, 0)]
            for p, q, other in both:
                made.kind[k, p * len(shapes) + q] = row_of[kind]
                made.swap[k, p * len(shapes) + q] = int(kind.swapped) ^ other
    if n:
        sizes = graphics.radius[made.member]
        usual = float(np.median(sizes[np.isfinite(sizes)]))
        made.size[:] = SKIN * usual, usual
    return made


def _or(value: float | None, default: float) -> float:
    """Return `value`, or the default where the deck says nothing."""
    return default if value is None else value


def _full_damping_depth(contact: Contact) -> float:
    """Return dmax [L] where the normal law has a damper that comes in over it, else 0."""
    if contact.cnf_type == "USERCNF":
        return 0.0
    read = "dmax" in NORMAL_LAWS[contact.cnf_type].parameters
    return _or(contact.dmax, 0.0) if read and contact.damping else 0.0


def on_rims(law: FrictionLaw, with_function: bool) -> int:
    """Return how a law is asked on a rim; `with_function`: a user's gives its sliding friction."""
    if law.modes:
        return AT_PLACES if law.carried == STRETCH and not with_function else AT_POINTS
    around = not law.uses_x and law.memory == law.carried in (0, STRETCH)
    return AROUND_RIM if around else AT_POINTS


def contacts_table(
    contacts: list[Contact],
    user: dict[int, UserFriction],
    user_normal: Mapping[int, UserNormal],
    with_rims: Set[int],
) -> tuple[Contacts, np.ndarray[Any, Any]]:
    """Return the contacts, and for each whether X has to be carried.

    `with_rims` has the ids of those that may touch with a rim.
    """
    n = len(contacts)
    normal, friction, addresses, uses_x = [], [], [], np.zeros(n, dtype=bool)
    memory, carried, left, spreads, rims = (np.zeros(n, dtype=np.int64) for _ in range(5))
    for k, contact in enumerate(contacts):
        if contact.id in user_normal:
            own = user_normal[contact.id]
            normal.append((own.address, own.row))
        else:
            law = NORMAL_LAWS[contact.cnf_type]
            normal.append((abi.normal_address(law), normal_constants(law, contact)))
        if contact.cff_type == "USERCFF":
            friction.append(user[contact.id].row)
            addresses.append(user[contact.id].address)
            uses_x[k], memory[k] = user[contact.id].uses_x, user[contact.id].states
        elif contact.cff_type == "COULOMB_OFF":
            friction.append(np.zeros(0))
            addresses.append(0)
        else:
            friction_law = friction_law_of(contact)
            friction.append(friction_parameters(friction_law, contact))
            addresses.append(abi.friction_address(friction_law))
            uses_x[k], memory[k] = friction_law.uses_x, friction_law.memory
            carried[k], left[k] = friction_law.carried, friction_law.left
            spreads[k] = not (memory[k] or uses_x[k] or friction_law.of_area)
            if contact.id in with_rims:
                rims[k] = on_rims(friction_law, contact.id in user)
            if rims[k] and memory[k]:
                memory[k] += 1
                carried[k] += rims[k] == AROUND_RIM

    def table(rows: Sequence[np.ndarray[Any, Any]]) -> np.ndarray[Any, Any]:
        wide = np.zeros((n, max([1, *map(len, rows)])))
        for k, values in enumerate(rows):
            wide[k, : len(values)] = values
        return wide

    sliding = [
        (user[c.id].address, user[c.id].row)
        if c.id in user and c.cff_type != "USERCFF"
        else (0, np.zeros(0))
        for c in contacts
    ]
    made = Contacts(
        id=np.array([contact.id for contact in contacts], dtype=np.int64),
        normal_law=np.array([address for address, _ in normal], dtype=np.int64),
        normal_par=table([values for _, values in normal]),
        friction_law=np.array(addresses, dtype=np.int64),
        friction_par=table(friction),
        sliding_law=np.array([at for at, _ in sliding], dtype=np.int64),
        sliding_par=table([par for _, par in sliding]),
        interpreted=np.array(
            [c.id in user and not user[c.id].compiled for c in contacts], dtype=np.int64
        ),
        framed=np.array(
            [c.id in user or memory[k] > 0 for k, c in enumerate(contacts)], dtype=np.int64
        ),
        memory=memory,
        carried=carried,
        left=left,
        spreads=spreads,
        rims=rims,
        numbers=table([np.array(c.numbers) for c in contacts]),
        dmax=np.array([_full_damping_depth(c) for c in contacts], dtype=np.float64),
        reads_x=np.array(
            [c.cff_type != "USERCFF" or user[c.id].reads_x for c in contacts], dtype=np.int64
        ),
        user_normal=np.array(
            [user_normal[c.id].inputs.ctypes.data if c.id in user_normal else 0 for c in contacts],
            dtype=np.int64,
        ),
        rigid=np.array([c.rigid for c in contacts], dtype=np.int64),
    )
    return made, uses_x


def slots_table(
    plans: Plans,
    pairs: Pairs,
    laws: Contacts,
    uses_x: np.ndarray[Any, Any],
    rows: dict[int, int],
    first: int,
) -> tuple[Slots, int]:
    """Return the slots, and how many numbers of y their laws carry, from `first` on.

    X and integrated memory go behind the bodies in y, slot by slot, for the laws that need them;
    `rows` is the contact row by id.
    """
    ns = int(pairs.last[-1]) if len(pairs.last) else 0
    wide = np.zeros((ns, 2), dtype=np.int64)
    each = np.column_stack([3 * uses_x, laws.carried])
    for k, plan in enumerate(plans.pairs):
        # of one region the first row alone is an incident
        end = pairs.slot[k] + 1 if plan.kind.region else pairs.last[k]
        wide[pairs.slot[k] : end] = each[rows[plan.kind.contact]]
    for contact_set in plans.broadphase:
        room = wide[pairs.slot[len(plans.pairs)] :]
        room[...] = np.maximum(room, each[rows[contact_set.contact]])
    begins = first + np.concatenate([[0], np.cumsum(wide.ravel())])
    x, z = np.where(wide > 0, begins[:-1].reshape(ns, 2), -1).T.copy()
    slot_pair = np.repeat(np.arange(len(pairs.slot)), pairs.last - pairs.slot)
    return Slots(slot_pair, x, z), int(begins[-1]) - first


@dataclass(frozen=True)
class ContactTables:
    """Contacts as tables, but for how pairs are tested, which is compiled."""

    listed: list[Contact]  # with their radii
    graphic_row: dict[int, int]  # by id, of those that are in a contact
    contact_row: dict[int, int]  # by id
    graphics: Graphics
    pairs: Pairs
    broadphase: Broadphase
    laws: Contacts
    slots: Slots
    carried: int  # numbers of y that laws carry, behind the bodies

    @property
    def memory(self) -> int:
        """Most numbers that a law remembers."""
        return int(self.laws.memory.max(initial=0))


def contact_tables(
    model: Model,
    placement: Placement,
    plans: Plans,
    body_row: dict[int, int],
    user: dict[int, UserFriction],
    user_normal: Mapping[int, UserNormal],
) -> ContactTables:
    """Return contacts, their graphics and pairs as tables."""
    listed = [g for plan in plans.pairs for g in (plan.graphic_i, plan.graphic_j)]
    crowded = [g for contact_set in plans.broadphase for g in (*contact_set.i, *contact_set.j)]
    graphic_row = {id: k for k, id in enumerate(dict.fromkeys([*listed, *crowded]))}
    shapes = sorted({shape_class(model.graphics[g]) for g in graphic_row})
    contacts = [with_radii(contact, model.graphics) for contact in model.contacts.values()]
    contact_row = {contact.id: k for k, contact in enumerate(contacts)}
    graphics = graphics_table(
        model, placement, list(graphic_row), body_row, shapes, needed_as_triangles(model, plans)
    )
    pairs, ns = pairs_table(plans, plans.kinds, graphic_row)
    with_rims = {kind.contact for kind in plans.kinds if kind.rims}
    laws, uses_x = contacts_table(contacts, user, user_normal, with_rims)
    first = BODY_SIZE * len(placement.bodies)
    slots, carried = slots_table(plans, pairs, laws, uses_x, contact_row, first)
    broadphase = broadphase_table(
        plans,
        plans.kinds,
        graphic_row,
        graphics,
        shapes,
        contact_row,
        len(pairs.slot),
        ns,
        int(laws.memory.max(initial=0)),
    )
    return ContactTables(
        contacts, graphic_row, contact_row, graphics, pairs, broadphase, laws, slots, carried
    )
