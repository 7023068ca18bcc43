"""Model -> arrays: `build` makes the `Scene` and the first ODE vector.

Only what takes part is made: graphics that are in no contact get no row, a contact
without friction no friction law, a law that does not look at X no X.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsim.core import jit
from mbsim.geometry.catalog import PAIRS, POINT, Pair
from mbsim.geometry.fcl_detector import states_noise
from mbsim.laws import abi
from mbsim.laws.catalog import FRICTION_LAWS, NORMAL_LAWS
from mbsim.model.contact_radius import with_radii
from mbsim.model.elements import Contact, Model
from mbsim.model.names import element_name
from mbsim.model.placement import Placement, place
from mbsim.system import arrays as a
from mbsim.system.applied import applied_forces
from mbsim.system.markers import MarkerTable
from mbsim.system.mechanism import constrain, sweep
from mbsim.system.pairing import (
    Kind,
    Plans,
    half_extent,
    kernel_size,
    plan_pairs,
    reach,
    shape_class,
    thinnest,
)
from mbsim.system.programs import ProgramTable

if TYPE_CHECKING:
    from mbsim.plugins import UserFriction

ROWS = 256
EVENTS = 1024
INCIDENTS = 100_000
#: Places for near pairs of a crowd, for each of its graphics.
NEAR_EACH = 24
#: Most cells of the grid that finds them, for each graphic.
CELLS_EACH = 4
#: Boxes nearer than this many radii are listed as near.
SKIN = 0.45


#: XML statements of connections.
_STATEMENTS = {
    "JOINT": "Constraint_Joint",
    "JPRIM": "Constraint_Jprim",
    "COUPLER": "Constraint_Coupler",
    "MOTION": "Motion_Joint",
    "GCON": "Constraint_General",
}


@dataclass
class System:
    """A model as arrays, with what Python still needs to know of it."""

    model: Model
    placement: Placement
    scene: a.Scene
    y0: np.ndarray[Any, Any]
    body_ids: list[int]  # moving bodies, row by row
    graphic_ids: list[int]
    contact_ids: list[int]
    plans: Plans
    user_friction: dict[int, UserFriction]  # by contact id
    needs_fcl: bool
    connections: list[tuple[str, int]]  # statement and id of each row of `Connections`
    applied: list[tuple[str, int]]  # of each row of `Applied`
    marker_rows: dict[int, int]  # of `Markers` by id, of those that joints, forces, ... look at
    values: list[tuple[int, int]]  # request id and F number 1..8 of each column of `Rows.value`
    equation_names: list[str]  # of each row of `Equations`, for messages

    def given_velocities(self) -> dict[int, np.ndarray[Any, Any]]:
        """Return the velocities that the deck gives, by body row: see `placement.BodyPlace`."""
        places = self.placement.bodies
        rows = {k: places[id].given for k, id in enumerate(self.body_ids)}
        return {k: given for k, given in rows.items() if len(given)}

    def connection_name(self, row: int) -> str:
        """Return the element of a row of `Connections` as its deck has it."""
        statement, id = self.connections[row]
        return element_name(self.model.file, _STATEMENTS[statement], id)

    def body_name(self, row: int) -> str:
        """Return the moving body of a row of `Bodies` as its deck has it."""
        return element_name(self.model.file, "Body_Rigid", self.body_ids[row])


def _adapt_pair(points: Callable[..., int], slots: int) -> Any:
    """Return a pair function as a C function of plain pointers."""
    from numba import carray

    def entry(frame_i, size_i, frame_j, size_j, out):
        return points(
            carray(frame_i, (12,)),
            carray(size_i, (3,)),
            carray(frame_j, (12,)),
            carray(size_j, (3,)),
            carray(out, (slots, POINT)),
        )

    return entry


@functools.cache
def pair_address(pair: Pair) -> int:
    """Return the address of a closed-form pair."""
    from numba import types

    pointer = types.CPointer(types.float64)
    signature = types.int64(pointer, pointer, pointer, pointer, pointer)
    return jit.address(_adapt_pair(pair.points, pair.slots), signature)


def _bodies(placement: Placement) -> a.Bodies:
    """Return the moving bodies' constants."""
    bodies = list(placement.bodies.values())
    inertia = np.array([body.inertia for body in bodies], dtype=np.float64).reshape(-1, 3, 3)
    return a.Bodies(
        np.array([body.mass for body in bodies], dtype=np.float64),
        np.ascontiguousarray(inertia),
        np.ascontiguousarray(np.linalg.inv(inertia)) if bodies else np.zeros((0, 3, 3)),
    )


def _graphics(
    model: Model, placement: Placement, ids: list[int], row: dict[int, int], shapes: list[str]
) -> a.Graphics:
    """Return the shapes in their bodies' cg axes; `row` is the body row by body id."""
    n = len(ids)
    made = a.Graphics(
        body=np.zeros(n, dtype=np.int64),
        p=np.zeros((n, 3)),
        R=np.zeros((n, 3, 3)),
        size=np.zeros((n, 3)),
        reach=np.zeros(n),
        half=np.zeros((n, 3)),
        turns=np.ones(n, dtype=np.int64),
        thin=np.zeros(n),
        shape=np.zeros(n, dtype=np.int64),
        marker_p=np.zeros((n, 3)),
        marker_R=np.zeros((n, 3, 3)),
    )
    for g, graphic_id in enumerate(ids):
        graphic = model.graphics[graphic_id]
        marker = placement.markers[graphic.marker_id]
        made.body[g] = row[marker.body_id]
        made.p[g] = marker.p_B + marker.R_B @ np.array(graphic.offset)
        made.R[g] = marker.R_B
        made.size[g] = kernel_size(graphic)
        made.reach[g] = reach(graphic)
        made.half[g] = half_extent(graphic)
        made.turns[g] = 0 if graphic.shape == "SPHERE" else 1
        made.thin[g] = thinnest(graphic)
        made.shape[g] = shapes.index(shape_class(graphic))
        made.marker_p[g] = marker.p_B
        made.marker_R[g] = marker.R_B
    return made


def _kinds(kinds: list[Kind], contacts: dict[int, int]) -> a.Kinds:
    """Return how pairs are tested; `contacts` is the contact row by id."""
    known = {k.closed_form: pair_address(PAIRS[k.closed_form]) for k in kinds if k.closed_form}
    return a.Kinds(
        contact=np.array([contacts[k.contact] for k in kinds], dtype=np.int64),
        kernel=np.array([known.get(k.closed_form, 0) for k in kinds], dtype=np.int64),
        slots=np.array([k.slots for k in kinds], dtype=np.int64),
        swapped=np.array([k.swapped for k in kinds], dtype=np.int64),
        regroups=np.array([k.regroups for k in kinds], dtype=np.int64),
        noise=np.array(
            [0.0 if k.closed_form else states_noise(k.shape_i, k.shape_j) for k in kinds]
        ),
    )


def _crowd_places(plans: Plans) -> tuple[int, int]:
    """Return how many pairs of crowds can be near at once, and the slots of one such place."""
    if not plans.crowds:
        return 0, 0
    places = sum(min(c.pairs, NEAR_EACH * len({*c.i, *c.j}) + 4096) for c in plans.crowds)
    return places, max(kind.slots for crowd in plans.crowds for kind in crowd.kinds.values())


def _pairs(plans: Plans, kinds: list[Kind], rows: dict[int, int]) -> tuple[a.Pairs, int]:
    """Return the places for pairs and the number of their slots; `rows`: graphic row by id.

    Listed pairs come first and stay; the places of crowds have slots for any of their kinds.
    """
    fixed = len(plans.pairs)
    places, wide = _crowd_places(plans)
    n = fixed + places
    row_of = {kind: k for k, kind in enumerate(kinds)}
    listed = np.array([plan.kind.slots for plan in plans.pairs], dtype=np.int64)
    ends = np.concatenate([np.zeros(1, dtype=np.int64), np.cumsum(listed)])
    crowd_slots = ends[-1] + wide * np.arange(places + 1)
    made = a.Pairs(
        kind=np.zeros(n, dtype=np.int64),
        graphic_i=np.zeros(n, dtype=np.int64),
        graphic_j=np.zeros(n, dtype=np.int64),
        slot=np.concatenate([ends[:-1], crowd_slots[:-1]]),
        last=np.concatenate([ends[1:], crowd_slots[1:]]),
        touches=np.zeros(n, dtype=np.int64),
        gap=np.zeros(n),
        left=np.zeros(n),
        live=np.arange(n),
        free=np.arange(n)[::-1].copy(),
        count=np.array([fixed, places, fixed, 0], dtype=np.int64),
    )
    for k, plan in enumerate(plans.pairs):
        made.kind[k] = row_of[plan.kind]
        made.graphic_i[k], made.graphic_j[k] = rows[plan.graphic_i], rows[plan.graphic_j]
    return made, int(crowd_slots[-1])


def _crowds(
    plans: Plans,
    kinds: list[Kind],
    rows: dict[int, int],
    graphics: a.Graphics,
    shapes: list[str],
    contacts: dict[int, int],
    places: int,
    slots: int,
) -> a.Crowds:
    """Return the contacts whose near pairs are found as they move."""
    n, ng = len(plans.crowds), len(graphics.body)
    row_of = {kind: k for k, kind in enumerate(kinds)}
    made = a.Crowds(
        contact=np.array([contacts[crowd.contact] for crowd in plans.crowds], dtype=np.int64),
        same=np.array([crowd.same for crowd in plans.crowds], dtype=np.int64),
        first=np.zeros((n, 4), dtype=np.int64),
        member=np.array([rows[g] for c in plans.crowds for g in (*c.i, *c.j)], dtype=np.int64),
        kind=np.full((n, len(shapes) ** 2), -1, dtype=np.int64),
        swap=np.zeros((n, len(shapes) ** 2), dtype=np.int64),
        size=np.zeros(2),
        reference=np.zeros((ng if n else 0, 7)),
        room=np.full(ng, math.inf),
        box=np.zeros((ng if n else 0, 6)),
        cell=np.zeros(ng if n else 0, dtype=np.int64),
        order=np.zeros(ng if n else 0, dtype=np.int64),
        start=np.zeros(CELLS_EACH * ng + 64 if n else 0, dtype=np.int64),
        head=np.zeros(ng if n else 0, dtype=np.int64),
        next=np.zeros(places if n else 0, dtype=np.int64),
        moved=np.zeros((places if n else 0, 5), dtype=np.int64),
        spare=np.zeros((slots if n else 0, a.SPARE)),
    )
    at = 0
    for k, crowd in enumerate(plans.crowds):
        middle, end = at + len(crowd.i), at + len(crowd.i) + len(crowd.j)
        made.first[k] = at, middle, middle, end
        at = end
        for (shape_i, shape_j), kind in crowd.kinds.items():
            i, j = shapes.index(shape_i), shapes.index(shape_j)
            both = [(i, j, 0), (j, i, 1)] if crowd.same and i != j else [(i, j, 0)]
            for p, q, other in both:
                made.kind[k, p * len(shapes) + q] = row_of[kind]
                made.swap[k, p * len(shapes) + q] = int(kind.swapped) ^ other
    if n:
        sizes = graphics.reach[made.member]
        usual = float(np.median(sizes[np.isfinite(sizes)]))
        made.size[:] = SKIN * usual, usual
    return made


def _or(value: float | None, default: float) -> float:
    """Return `value`, or the default where the deck says nothing."""
    return default if value is None else value


def _full_damping_depth(contact: Contact) -> float:
    """Return dmax [L] where the normal law reads it, else 0."""
    read = "dmax" in NORMAL_LAWS[contact.cnf_type].parameters
    return _or(contact.dmax, 0.0) if read else 0.0


def _contacts(
    contacts: list[Contact], user: dict[int, UserFriction]
) -> tuple[a.Contacts, np.ndarray[Any, Any]]:
    """Return the contacts, and for each whether X has to be carried."""
    n = len(contacts)
    normal, friction, addresses, uses_x = [], [], [], np.zeros(n, dtype=bool)
    for k, contact in enumerate(contacts):
        law = NORMAL_LAWS[contact.cnf_type]
        normal.append((abi.normal_address(law), abi.normal_constants(law, contact)))
        if contact.id in user:
            friction.append(user[contact.id].par)
            addresses.append(user[contact.id].address)
            uses_x[k] = user[contact.id].uses_x
        elif contact.cff_type == "COULOMB_OFF":
            friction.append(np.zeros(0))
            addresses.append(0)
        else:
            friction_law = FRICTION_LAWS[contact.cff_type]
            friction.append(abi.friction_parameters(friction_law, contact))
            addresses.append(abi.friction_address(friction_law))

    def table(rows: Sequence[np.ndarray[Any, Any]]) -> np.ndarray[Any, Any]:
        wide = np.zeros((n, max([1, *map(len, rows)])))
        for k, values in enumerate(rows):
            wide[k, : len(values)] = values
        return wide

    made = a.Contacts(
        id=np.array([contact.id for contact in contacts], dtype=np.int64),
        normal_law=np.array([address for address, _ in normal], dtype=np.int64),
        normal_par=table([values for _, values in normal]),
        friction_law=np.array(addresses, dtype=np.int64),
        friction_par=table(friction),
        interpreted=np.array(
            [c.id in user and not user[c.id].compiled for c in contacts], dtype=np.int64
        ),
        framed=np.array([contact.id in user for contact in contacts], dtype=np.int64),
        ignore_deeper=np.array(
            [_or(c.ignore_penetration_larger_than, math.inf) for c in contacts], dtype=np.float64
        ),
        dmax=np.array([_full_damping_depth(c) for c in contacts], dtype=np.float64),
    )
    return made, uses_x


def _speed_scale(model: Model, placement: Placement, end_time: float) -> float:
    """Return V = max(fastest point of a body at the start, sqrt(g L), L / T_end)."""
    fastest = 0.0
    for body in placement.bodies.values():
        gyration = math.sqrt(float(np.trace(body.inertia)) / (2.0 * body.mass))
        fastest = max(fastest, float(np.linalg.norm(body.v) + np.linalg.norm(body.w) * gyration))
    g = float(np.linalg.norm(model.gravity.g))
    length = placement.L
    return max(fastest, math.sqrt(g * length), length / end_time if end_time > 0.0 else 0.0)


def _scales(placement: Placement, speed: float) -> np.ndarray[Any, Any]:
    """Return length, speed and energy of the error norm, all above 0."""
    V = speed if speed > 0.0 else placement.L
    heaviest = max((body.mass for body in placement.bodies.values()), default=1.0)
    return np.array([placement.L, V, heaviest * V * V])


def _ledger(works: bool, damps: bool, at: int) -> np.ndarray[Any, Any]:
    """Return where in y, from `at` on, the work of motions and the damped energy stand."""
    return np.array([at if works else -1, at + int(works) if damps else -1], dtype=np.int64)


def _initial_y(placement: Placement, others: int) -> np.ndarray[Any, Any]:
    """Return the ODE vector at the start: X, work and dissipated energy are 0."""
    bodies = list(placement.bodies.values())
    y = np.zeros(a.BODY_SIZE * len(bodies) + others)
    for k, body in enumerate(bodies):
        row = y[a.BODY_SIZE * k : a.BODY_SIZE * (k + 1)]
        row[0:3] = body.p
        row[3:7] = body.q
        row[7:10] = body.v
        row[10:13] = body.R.T @ body.w
    return y


def _values(model: Model, programs: ProgramTable) -> list[tuple[int, int]]:
    """Make the programs of requests, the last of all; return request and F number of each."""
    made = []
    for request in model.requests.values():
        for k, expression in enumerate(request.exprs):
            if expression is not None:
                programs.add(expression, request, forces=True)
                made.append((request.id, k + 1))
    return made


def _state(nb: int, ng: int, ns: int, angle: np.ndarray[Any, Any]) -> a.State:
    """Return the incident table before anything touched."""
    q = np.zeros((nb + 1, 4))
    q[:, 0] = 1.0
    return a.State(
        q=q,
        centre=np.zeros((ng, 3)),
        angle=angle,
        touching=np.zeros(ns, dtype=np.int64),
        p=np.zeros((ns, 3)),
        n=np.zeros((ns, 3)),
        t=np.zeros((ns, 3)),
        depth=np.zeros(ns),
        rate=np.zeros(ns),
        normal=np.zeros(ns),
        hit=np.zeros(ns + 1, dtype=np.int64),
    )


def _log(nc: int) -> a.Log:
    """Return empty counters and peaks."""
    contacts = np.zeros((nc, a.LOG_COLUMNS))
    contacts[:, a.FIRST_TOUCH] = np.nan
    contacts[:, a.REBOUND] = np.nan
    contacts[:, a.PEAK_FORCE_TIME] = np.nan
    return a.Log(
        contacts,
        np.zeros(a.COUNTERS, dtype=np.int64),
        np.zeros((nc + 1, 3), dtype=np.int64),
    )


def _work(nb: int, graphics: a.Graphics, np_: int, ns: int, nc: int, nf: int, nj: int) -> a.Work:
    """Return scratch, with the ground's rows as they stay."""
    ng = len(graphics.body)
    fixed = graphics.body == nb
    frames = np.full((ng, 12), np.nan)
    frames[fixed] = np.hstack([graphics.p, graphics.R.reshape(-1, 9)])[fixed]
    # nobody turns a sphere
    frames[graphics.turns == 0, 3:] = np.eye(3).ravel()
    R = np.full((nb + 1, 3, 3), np.nan)
    R[nb] = np.eye(3)
    v, w = np.full((nb + 1, 3), np.nan), np.full((nb + 1, 3), np.nan)
    v[nb] = w[nb] = 0.0
    return a.Work(
        R=R,
        v=v,
        w=w,
        force=np.full((nb + 1, 3), np.nan),
        torque=np.full((nb + 1, 3), np.nan),
        noise=np.zeros((nb + 1, 2)),
        frames=frames,
        way=np.where(fixed, 0.0, np.nan),
        speed=np.where(fixed[:, None], 0.0, np.full((ng, 2), np.nan)),
        points=np.zeros((ns, POINT)),
        touching=np.zeros(ns, dtype=np.int64),
        hit=np.zeros(ns + 1, dtype=np.int64),
        t=np.zeros((ns, 3)),
        slot=np.zeros((ns, a.SLOT_COLUMNS)),
        fcl=np.zeros(max(1, np_), dtype=np.int64),
        net=np.zeros((nc, 3)),
        block=np.zeros((nb, 20)),
        bound=np.zeros(2),
        best=np.zeros(4),
        law_in=np.zeros(abi.FRICTION_INPUTS),
        law_out=np.zeros(5),
        applied=np.zeros((nf, 8)),
        rub=np.zeros((nf, 9)),
        reaction=np.zeros(6 * nj),
        trouble=np.full(2, -1, dtype=np.int64),
    )


def _rows(n: int, nb: int, nc: int, ns: int, nj: int, nf: int, values: int) -> a.Rows:
    """Return the tables in which compiled code leaves its output rows."""
    return a.Rows(
        time=np.zeros(ROWS),
        y=np.zeros((ROWS, n)),
        accel=np.zeros((ROWS, 6 * nb)),
        contact=np.zeros((ROWS, a.CONTACT_COLUMNS * nc)),
        energy=np.zeros((ROWS, 4)),
        joint=np.zeros((ROWS, 6 * nj)),
        applied=np.zeros((ROWS, 6 * nf)),
        value=np.zeros((ROWS, values)),
        incident_count=np.zeros(ROWS, dtype=np.int64),
        incidents=np.zeros((min(ROWS * ns, 2 * ns + INCIDENTS), 14)),
        events=np.zeros((min(max(EVENTS, 8 * ns), 2 * ns + INCIDENTS), 4)),
        used=np.zeros(3, dtype=np.int64),
    )


def _load_user_friction(
    model: Model, plugins: Sequence[Path], interpret: bool, log: Callable[[str], None] | None
) -> dict[int, UserFriction]:
    """Load the users' CFFSUBs; scenes without one do not import what that needs."""
    wanted = [c for c in model.contacts.values() if c.cff_type == "USERCFF"]
    if not wanted:
        return {}
    from mbsim.plugins import failure, host, load_friction
    from mbsim.plugins.loader import Script

    failure.clear()
    if log is not None:
        host.log = log
    scripts: dict[Path, Script] = {}
    return {c.id: load_friction(c, plugins, interpret, scripts, log) for c in wanted}


def build(
    model: Model,
    end_time: float,
    plugins: Sequence[Path] = (),
    interpret: bool = False,
    detector: str = "auto",
    log: Callable[[str], None] | None = None,
) -> System:
    """Return the model as arrays, ready to be integrated.

    Parameters
    ----------
    model : Model
    end_time : float
        Of the whole run [T]; it sets the speed scale of a model that stands still.
    plugins : sequence of Path
        Files given with --plugin.
    interpret : bool
        Do not compile user subroutines.
    detector : {"auto", "fcl"}
    log : callable, optional
        Takes lines for the run's log: what users' scripts print or say.

    Raises
    ------
    ModelError
        If a user subroutine cannot be found or loaded, or a pair of shapes is impossible.
    """
    placement = place(model)
    plans = plan_pairs(model, detector)
    kinds = plans.kinds
    user = _load_user_friction(model, plugins, interpret, log)
    body_ids = list(placement.bodies)
    nb = len(body_ids)
    row = {body.id: nb for body in model.bodies.values()}
    row.update({body_id: k for k, body_id in enumerate(body_ids)})
    listed = [g for plan in plans.pairs for g in (plan.graphic_i, plan.graphic_j)]
    crowded = [g for crowd in plans.crowds for g in (*crowd.i, *crowd.j)]
    graphic_ids = list(dict.fromkeys([*listed, *crowded]))
    shapes = sorted({shape_class(model.graphics[g]) for g in graphic_ids})
    contact_list = [with_radii(contact, model.graphics) for contact in model.contacts.values()]
    contact_ids = [contact.id for contact in contact_list]
    contact_row = {contact_id: k for k, contact_id in enumerate(contact_ids)}

    graphics = _graphics(model, placement, graphic_ids, row, shapes)
    graphic_row = {graphic_id: k for k, graphic_id in enumerate(graphic_ids)}
    pairs, ns = _pairs(plans, kinds, graphic_row)
    contacts, uses_x = _contacts(contact_list, user)

    # X goes behind the bodies in y, slot by slot, for the laws that look at it
    slot_pair = np.repeat(np.arange(len(pairs.slot)), pairs.last - pairs.slot)
    wanted = np.zeros(ns, dtype=bool)
    for k, plan in enumerate(plans.pairs):
        wanted[pairs.slot[k] : pairs.last[k]] = uses_x[contact_row[plan.kind.contact]]
    if any(uses_x[contact_row[crowd.contact]] for crowd in plans.crowds):
        wanted[pairs.slot[len(plans.pairs)] :] = True
    x = np.full(ns, -1, dtype=np.int64)
    carried = np.flatnonzero(wanted)
    x[carried] = a.BODY_SIZE * nb + 3 * np.arange(len(carried))

    table = MarkerTable(placement, row)
    programs = ProgramTable(table, model.variables)
    applied, applied_ids = applied_forces(model, table, programs)
    mechanism = constrain(model, table, programs)
    nj, nf = len(mechanism.elements), len(applied_ids)
    values = _values(model, programs)
    ledger = _ledger(bool(model.motions), nf > 0, a.BODY_SIZE * nb + 3 * len(carried))
    kept = int(np.count_nonzero(ledger >= 0)) + max(1, len(contact_ids))
    y0 = _initial_y(placement, 3 * len(carried) + kept)
    markers, angles = table.arrays()

    speed = _speed_scale(model, placement, end_time)
    scene = a.Scene(
        bodies=_bodies(placement),
        graphics=graphics,
        kinds=_kinds(kinds, contact_row),
        pairs=pairs,
        crowds=_crowds(
            plans, kinds, graphic_row, graphics, shapes, contact_row, len(pairs.slot), ns
        ),
        contacts=contacts,
        slots=a.Slots(slot_pair, x),
        markers=markers,
        angles=angles,
        programs=programs.arrays(mechanism.elements, applied_ids),
        applied=applied,
        tree=mechanism.tree,
        equations=mechanism.equations,
        connections=mechanism.connections,
        world=a.World(
            np.array(model.gravity.g, dtype=np.float64),
            _scales(placement, speed),
            np.zeros(a.DOORS, dtype=np.int64),
            np.zeros(1, dtype=np.int64),
            ledger,
        ),
        state=_state(nb, len(graphic_ids), ns, table.start_angles()),
        log=_log(len(contact_ids)),
        work=_work(nb, graphics, len(pairs.slot), ns, len(contact_ids), nf, nj),
        sweep=sweep(mechanism),
        rows=_rows(len(y0), nb, len(contact_ids), ns, nj, nf, len(values)),
    )
    needs_fcl = any(not kind.closed_form for kind in kinds)
    return System(
        model,
        placement,
        scene,
        y0,
        body_ids,
        graphic_ids,
        contact_ids,
        plans,
        user,
        needs_fcl,
        mechanism.elements,
        applied_ids,
        table.rows,
        values,
        mechanism.names,
    )
