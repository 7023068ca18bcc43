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
from mbsim.model.elements import Contact, Model
from mbsim.model.placement import Placement, place
from mbsim.system import arrays as a
from mbsim.system.pairing import PairPlan, half_extent, kernel_size, plan_pairs, reach

if TYPE_CHECKING:
    from mbsim.plugins import UserFriction

ROWS = 256
EVENTS = 1024


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
    pair_plans: list[PairPlan]
    user_friction: dict[int, UserFriction]  # by contact id
    needs_fcl: bool


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
    model: Model, placement: Placement, ids: list[int], row: dict[int, int]
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
        made.marker_p[g] = marker.p_B
        made.marker_R[g] = marker.R_B
    return made


def _pairs(
    model: Model,
    plans: list[PairPlan],
    graphics: a.Graphics,
    rows: dict[int, int],
    contacts: list[int],
    ground: int,
) -> a.Pairs:
    """Return the pairs; `rows` is the graphic row by graphic id."""
    n = len(plans)
    made = a.Pairs(
        contact=np.array([contacts.index(plan.contact) for plan in plans], dtype=np.int64),
        graphic_i=np.array([rows[plan.graphic_i] for plan in plans], dtype=np.int64),
        graphic_j=np.array([rows[plan.graphic_j] for plan in plans], dtype=np.int64),
        swapped=np.array([plan.swapped for plan in plans], dtype=np.int64),
        slot=np.concatenate([[0], np.cumsum([plan.slots for plan in plans])]).astype(np.int64),
        kernel=np.zeros(n, dtype=np.int64),
        watched=np.ones(n, dtype=np.int64),
        regroups=np.array([plan.regroups for plan in plans], dtype=np.int64),
        thickness=np.zeros(n),
        noise=np.zeros(n),
    )
    known: dict[str, int] = {}
    for k, plan in enumerate(plans):
        if plan.closed_form:
            if plan.closed_form not in known:
                known[plan.closed_form] = pair_address(PAIRS[plan.closed_form])
            made.kernel[k] = known[plan.closed_form]
        both = [made.graphic_i[k], made.graphic_j[k]]
        if not plan.closed_form:
            shapes = [model.graphics[g].shape for g in (plan.graphic_i, plan.graphic_j)]
            made.noise[k] = states_noise(*shapes)
        moving_plane = any(
            math.isinf(graphics.reach[g]) and graphics.body[g] != ground for g in both
        )
        made.watched[k] = 0 if moving_plane else 1
        # half of the thinner shape: a step may bury it no deeper before it is seen; what a
        # half-space has swallowed it still pushes out, so nothing passes through a plane
        plane = any(math.isinf(graphics.reach[g]) for g in both)
        made.thickness[k] = math.inf if plane else 0.5 * min(graphics.half[g].min() for g in both)
    return made


def _or(value: float | None, default: float) -> float:
    """Return `value`, or the default where the deck says nothing."""
    return default if value is None else value


def _contacts(
    contacts: list[Contact], plans: list[PairPlan], user: dict[int, UserFriction]
) -> tuple[a.Contacts, np.ndarray[Any, Any]]:
    """Return the contacts, and for each whether X has to be carried."""
    n = len(contacts)
    normal, friction, addresses, uses_x = [], [], [], np.zeros(n, dtype=bool)
    for k, contact in enumerate(contacts):
        law = NORMAL_LAWS[contact.cnf_type]
        normal.append((abi.normal_address(law), abi.parameters(law, contact)))
        if contact.id in user:
            friction.append(user[contact.id].par)
            addresses.append(user[contact.id].address)
            uses_x[k] = user[contact.id].uses_x
        elif contact.cff_type == "COULOMB_OFF":
            friction.append(np.zeros(0))
            addresses.append(0)
        else:
            friction_law = FRICTION_LAWS[contact.cff_type]
            friction.append(abi.parameters(friction_law, contact))
            addresses.append(abi.friction_address(friction_law))

    def table(rows: Sequence[np.ndarray[Any, Any]]) -> np.ndarray[Any, Any]:
        wide = np.zeros((n, max([1, *map(len, rows)])))
        for k, values in enumerate(rows):
            wide[k, : len(values)] = values
        return wide

    of_contact = [plan.contact for plan in plans]
    counts = [of_contact.count(contact.id) for contact in contacts]
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
        dmax=np.array([c.dmax or 0.0 for c in contacts], dtype=np.float64),
        first_pair=np.concatenate([[0], np.cumsum(counts)]).astype(np.int64),
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


def _initial_y(placement: Placement, x_count: int, contact_count: int) -> np.ndarray[Any, Any]:
    """Return the ODE vector at the start: X and dissipated energy are 0."""
    bodies = list(placement.bodies.values())
    y = np.zeros(a.BODY_SIZE * len(bodies) + 3 * x_count + max(1, contact_count))
    for k, body in enumerate(bodies):
        row = y[a.BODY_SIZE * k : a.BODY_SIZE * (k + 1)]
        row[0:3] = body.p
        row[3:7] = body.q
        row[7:10] = body.v
        row[10:13] = body.R.T @ body.w
    return y


def _state(nb: int, np_: int, ns: int) -> a.State:
    """Return the incident table before anything touched."""
    q = np.zeros((nb + 1, 4))
    q[:, 0] = 1.0
    turn = np.zeros((np_, 8))
    turn[:, 0] = turn[:, 4] = 1.0
    return a.State(
        q=q,
        touching=np.zeros(ns, dtype=np.int64),
        p=np.zeros((ns, 3)),
        n=np.zeros((ns, 3)),
        t=np.zeros((ns, 3)),
        depth=np.zeros(ns),
        rate=np.zeros(ns),
        normal=np.zeros(ns),
        gap=np.zeros(np_),
        left=np.zeros(np_),
        centre=np.zeros((np_, 6)),
        turn=turn,
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


def _work(nb: int, ng: int, np_: int, ns: int) -> a.Work:
    """Return scratch, with the ground's rows as they stay."""
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
        accel=np.full((nb, 6), np.nan),
        noise=np.zeros((nb + 1, 2)),
        frames=np.full((ng, 12), np.nan),
        points=np.full((ns, POINT), np.nan),
        touching=np.zeros(ns, dtype=np.int64),
        t=np.full((ns, 3), np.nan),
        slot=np.full((ns, a.SLOT_COLUMNS), np.nan),
        fcl=np.zeros(max(1, np_), dtype=np.int64),
        law_in=np.zeros(abi.FRICTION_INPUTS),
        law_out=np.zeros(5),
        trouble=np.full(2, -1, dtype=np.int64),
    )


def _rows(n: int, nb: int, nc: int, ns: int) -> a.Rows:
    """Return the tables in which compiled code leaves its output rows."""
    return a.Rows(
        time=np.zeros(ROWS),
        y=np.zeros((ROWS, n)),
        accel=np.zeros((ROWS, 6 * nb)),
        contact=np.zeros((ROWS, a.CONTACT_COLUMNS * nc)),
        energy=np.zeros((ROWS, 3)),
        incident_count=np.zeros(ROWS, dtype=np.int64),
        incidents=np.zeros((ROWS * ns, 14)),
        events=np.zeros((max(EVENTS, 8 * ns), 4)),
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
    user = _load_user_friction(model, plugins, interpret, log)
    body_ids = list(placement.bodies)
    nb = len(body_ids)
    row = {body.id: nb for body in model.bodies.values()}
    row.update({body_id: k for k, body_id in enumerate(body_ids)})
    graphic_ids = list(dict.fromkeys(g for plan in plans for g in (plan.graphic_i, plan.graphic_j)))
    contact_list = list(model.contacts.values())
    contact_ids = [contact.id for contact in contact_list]

    graphics = _graphics(model, placement, graphic_ids, row)
    graphic_row = {graphic_id: k for k, graphic_id in enumerate(graphic_ids)}
    pairs = _pairs(model, plans, graphics, graphic_row, contact_ids, nb)
    contacts, uses_x = _contacts(contact_list, plans, user)

    # X goes behind the bodies in y, slot by slot, for the laws that look at it
    ns = int(pairs.slot[-1])
    slot_pair = np.repeat(np.arange(len(plans), dtype=np.int64), [plan.slots for plan in plans])
    slot_contact = pairs.contact[slot_pair]
    x = np.full(ns, -1, dtype=np.int64)
    carried = np.flatnonzero(uses_x[slot_contact]) if ns else np.zeros(0, dtype=np.int64)
    x[carried] = a.BODY_SIZE * nb + 3 * np.arange(len(carried))
    y0 = _initial_y(placement, len(carried), len(contact_ids))

    speed = _speed_scale(model, placement, end_time)
    scene = a.Scene(
        bodies=_bodies(placement),
        graphics=graphics,
        pairs=pairs,
        contacts=contacts,
        slots=a.Slots(slot_pair, slot_contact, x),
        world=a.World(
            np.array(model.gravity.g, dtype=np.float64),
            np.array([placement.L, speed if speed > 0.0 else placement.L]),
            np.zeros(1, dtype=np.int64),
        ),
        state=_state(nb, len(plans), ns),
        log=_log(len(contact_ids)),
        work=_work(nb, len(graphic_ids), len(plans), ns),
        rows=_rows(len(y0), nb, len(contact_ids), ns),
    )
    needs_fcl = any(not plan.closed_form or plan.may_need_fcl for plan in plans)
    return System(
        model, placement, scene, y0, body_ids, graphic_ids, contact_ids, plans, user, needs_fcl
    )
