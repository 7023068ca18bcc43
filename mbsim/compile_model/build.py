"""Model -> arrays: `build` makes the `Scene` and the first ODE vector.

Only what takes part is made: graphics that are in no contact get no row, a contact
without friction no friction law, a law that does not look at X no X.
"""

from __future__ import annotations

import math
import typing
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsim.arrays import scene as a
from mbsim.arrays.hooks import Hook
from mbsim.compile_model.acting import acting
from mbsim.compile_model.audit import audit
from mbsim.compile_model.contacts import (
    broadphase_table,
    contacts_table,
    graphics_table,
    kinds_table,
    pairs_table,
)
from mbsim.compile_model.gravity import Pull
from mbsim.compile_model.groups import Groups, find_groups, natural_speed
from mbsim.compile_model.markers import MarkerTable
from mbsim.compile_model.mechanism import sweep
from mbsim.compile_model.pairing import Plans, plan_pairs, shape_class
from mbsim.compile_model.rigid_slots import rigid_slots
from mbsim.compile_model.scratch import empty_log, empty_rows, scratch, start_state
from mbsim.compile_model.switching import has_modes
from mbsim.core.layout import AT_Q, AT_V, AT_W
from mbsim.model.contact_radius import with_radii
from mbsim.model.elements import Gravity, Model
from mbsim.model.names import element_name
from mbsim.model.placement import Placement, place

if TYPE_CHECKING:
    from mbsim.compile_model.subroutines import StateReader
    from mbsim.plugins import UserFriction
    from mbsim.plugins.contact_post import ContactPost
    from mbsim.plugins.source.script import Script
    from mbsim.plugins.subroutine import UserSubroutine
    from mbsim.plugins.types import UserNormal, UserResidual

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
    subroutines: dict[tuple[str, int], UserSubroutine]  # of forces and variables, row by row
    pulls: list[Pull] = field(default_factory=list)  # every gravity, that of the start first
    reader: StateReader | None = None  # what py_sysfnc looks at
    user_normal: dict[int, UserNormal] = field(default_factory=dict)  # by contact id
    posts: list[ContactPost] = field(default_factory=list)  # the users' CONTACTPOSTs
    load: float = 0.0  # a usual force, by which friction is judged
    residuals: dict[int, UserResidual] = field(default_factory=dict)  # by Force_Element

    def unknowns(self) -> Iterator[tuple[str, int]]:
        """Yield the place in a result file of every unknown of elements, and its column."""
        column = 0
        for id, user in self.residuals.items():
            for unknown in user.unknowns:
                yield f"force_elements/{id}/{unknown.name}", column
                column += 1

    @property
    def user_laws(self) -> list[tuple[int, UserFriction | UserNormal]]:
        """Users' friction laws, then their normal laws, with the contact's id."""
        return [*self.user_friction.items(), *self.user_normal.items()]

    def given_velocities(self) -> dict[int, np.ndarray[Any, Any]]:
        """Return the velocities that the deck gives, by body row: see `placement.BodyPlace`."""
        places = self.placement.bodies
        rows = {k: places[id].given for k, id in enumerate(self.body_ids)}
        return {k: given for k, given in rows.items() if len(given)}

    def pull(self, gravity: Gravity) -> Pull:
        """Return a gravity of the model as arrays."""
        return next(pull for pull in self.pulls if pull.gravity is gravity)

    def connection_name(self, row: int) -> str:
        """Return the element of a row of `Connections` as its deck has it."""
        statement, id = self.connections[row]
        xml = _STATEMENTS[statement]
        if statement == "MOTION":
            xml = self.model.motions[id].statement
        return element_name(self.model.file, xml, id)

    def body_name(self, row: int) -> str:
        """Return the moving body of a row of `Bodies` as its deck has it."""
        return element_name(self.model.file, "Body_Rigid", self.body_ids[row])


def _bodies(placement: Placement) -> a.Bodies:
    """Return the moving bodies' constants."""
    bodies = list(placement.bodies.values())
    inertia = np.array([body.inertia for body in bodies], dtype=np.float64).reshape(-1, 3, 3)
    return a.Bodies(
        np.array([body.mass for body in bodies], dtype=np.float64),
        np.ascontiguousarray(inertia),
        np.ascontiguousarray(np.linalg.inv(inertia)) if bodies else np.zeros((0, 3, 3)),
    )


def _speed_scale(model: Model, groups: Groups) -> float:
    """Return the largest V of the model's groups; that of standard gravity where nothing moves."""
    g = float(np.linalg.norm(model.gravity.g))
    largest = max(
        max(v, math.sqrt(g * length)) for v, length in zip(groups.start, groups.length, strict=True)
    )
    return largest if largest > 0.0 else natural_speed(model.units, max(groups.length))


def _usual_load(placement: Placement, length: float, speed: float) -> float:
    """Return a force by which forces are judged: m V^2/L of the lightest body, so often m g."""
    lightest = min((body.mass for body in placement.bodies.values()), default=1.0)
    return lightest * speed * speed / length


def _scales(groups: Groups, length: float, speed: float) -> np.ndarray[Any, Any]:
    """Return length, speed and energy of the whole model, all above 0, and a tolerance to set."""
    return np.array([length, speed, max(groups.mass) * speed * speed, 0.0])


def _accumulators(works: bool, damps: bool, at: int) -> np.ndarray[Any, Any]:
    """Return where in y, from `at` on, the work of motions and the damped energy stand."""
    return np.array([at if works else -1, at + int(works) if damps else -1], dtype=np.int64)


def _initial_y(placement: Placement, others: int) -> np.ndarray[Any, Any]:
    """Return the ODE vector at the start: X, work and dissipated energy are 0."""
    bodies = list(placement.bodies.values())
    y = np.zeros(a.BODY_SIZE * len(bodies) + others)
    for k, body in enumerate(bodies):
        row = y[a.BODY_SIZE * k : a.BODY_SIZE * (k + 1)]
        row[0:3] = body.p
        row[AT_Q:AT_V] = body.q
        row[AT_V:AT_W] = body.v
        row[AT_W:] = body.R.T @ body.w
    return y


def _load_user_friction(
    model: Model,
    plugins: Sequence[Path],
    interpret: bool,
    log: Callable[[str], None] | None,
    scripts: dict[Path, Script],
) -> dict[int, UserFriction]:
    """Load the users' CFFSUBs; scenes without one do not import what that needs."""
    wanted = [c for c in model.contacts.values() if c.asks_user]
    if not wanted:
        return {}
    from mbsim.plugins import failure, host, load_friction
    from mbsim.plugins.subroutine import end_run

    end_run()  # an earlier one that failed while it was built
    failure.clear()
    host.forget()
    if log is not None:
        host.log = log
    return {c.id: load_friction(c, plugins, interpret, scripts, log) for c in wanted}


def _load_user_normal(
    model: Model,
    plugins: Sequence[Path],
    interpret: bool,
    log: Callable[[str], None] | None,
    scripts: dict[Path, Script],
) -> dict[int, UserNormal]:
    """Load the users' CNFSUBs."""
    wanted = [c for c in model.contacts.values() if c.cnf_type == "USERCNF"]
    if not wanted:
        return {}
    from mbsim.plugins.normal import load_normal
    from mbsim.plugins.subroutine import begin_run, end_run

    if all(c.cff_type != "USERCFF" for c in model.contacts.values()):
        end_run()
    begin_run(log)
    return {c.id: load_normal(c, plugins, interpret, scripts, log) for c in wanted}


def _load_posts(
    model: Model,
    plugins: Sequence[Path],
    log: Callable[[str], None] | None,
    scripts: dict[Path, Script],
) -> list[ContactPost]:
    """Load the users' CONTACTPOSTs."""
    wanted = [c for c in model.contacts.values() if c.cpost is not None]
    if not wanted:
        return []
    from mbsim.plugins.contact_post import load_post
    from mbsim.plugins.subroutine import begin_run

    begin_run(log)
    return [load_post(c, plugins, scripts) for c in wanted]


def _load_subroutines(
    model: Model,
    plugins: Sequence[Path],
    log: Callable[[str], None] | None,
    scripts: dict[Path, Script],
) -> dict[tuple[str, int], UserSubroutine]:
    """Load the users' subroutines of forces and variables."""
    elements = (
        *model.scalar_forces.values(),
        *model.variables.values(),
        *model.vector_forces.values(),
        *model.body_forces.values(),
    )
    if all(element.user is None for element in elements):
        return {}
    from mbsim.compile_model.subroutines import load
    from mbsim.plugins.subroutine import begin_run

    begin_run(log)
    return load(model, plugins, scripts)


def _no_residuals() -> a.Residuals:
    """Return the rows of a model without elements of users' residuals."""
    kinds = typing.get_type_hints(a.Residuals, include_extras=True).values()
    return a.Residuals(*(np.zeros((0,) * k.__metadata__[1], k.__metadata__[0]) for k in kinds))


def _load_residuals(
    model: Model,
    plugins: Sequence[Path],
    interpret: bool,
    log: Callable[[str], None] | None,
    scripts: dict[Path, Script],
) -> dict[int, UserResidual]:
    """Load the users' residuals."""
    if not model.force_elements:
        return {}
    from mbsim.plugins.residual import load_residual
    from mbsim.plugins.subroutine import begin_run

    begin_run(log)
    return {
        id: load_residual(element, plugins, interpret, scripts, log)
        for id, element in model.force_elements.items()
    }


def _users(
    users: dict[tuple[str, int], UserSubroutine], seen: int, model: Model, made: Any
) -> a.Users:
    """Return the rows of user subroutines and of residuals behind them.

    `seen`: how much of y friction subroutines look at; `made`: the residuals by id.
    """
    counts = [user.count for user in users.values()]
    if made:
        from mbsim.compile_model.force_elements import results_of

        counts += [results_of(model.force_elements[id], user) for id, user in made.items()]
    addresses = [user.address for user in users.values()]
    return a.Users(
        np.array([*addresses, *(0 for _ in made)], dtype=np.int64),
        np.array([*(-1 for _ in users), *range(len(made))], dtype=np.int64),
        np.zeros((len(counts), max(counts, default=1))),
        np.zeros(1, dtype=np.int64),
        np.zeros(seen),
    )


def build(
    model: Model,
    plugins: Sequence[Path] = (),
    interpret: bool = False,
    detector: str = "auto",
    log: Callable[[str], None] | None = None,
) -> System:
    """Return the model as arrays, ready to be integrated.

    Parameters
    ----------
    model : Model
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
    scripts: dict[Path, Script] = {}
    user = _load_user_friction(model, plugins, interpret, log, scripts)
    normal = _load_user_normal(model, plugins, interpret, log, scripts)
    posts = _load_posts(model, plugins, log, scripts)
    subroutines = _load_subroutines(model, plugins, log, scripts)
    residuals = _load_residuals(model, plugins, interpret, log, scripts)
    body_ids = list(placement.bodies)
    nb = len(body_ids)
    row = {body.id: nb for body in model.bodies.values()}
    row.update({body_id: k for k, body_id in enumerate(body_ids)})
    listed = [g for plan in plans.pairs for g in (plan.graphic_i, plan.graphic_j)]
    crowded = [g for contact_set in plans.broadphase for g in (*contact_set.i, *contact_set.j)]
    graphic_ids = list(dict.fromkeys([*listed, *crowded]))
    shapes = sorted({shape_class(model.graphics[g]) for g in graphic_ids})
    contact_list = [with_radii(contact, model.graphics) for contact in model.contacts.values()]
    contact_ids = [contact.id for contact in contact_list]
    contact_row = {contact_id: k for k, contact_id in enumerate(contact_ids)}

    graphics = graphics_table(model, placement, graphic_ids, row, shapes)
    graphic_row = {graphic_id: k for k, graphic_id in enumerate(graphic_ids)}
    pairs, ns = pairs_table(plans, kinds, graphic_row)
    groups = find_groups(model, placement)
    length, speed = max(groups.length), _speed_scale(model, groups)
    load = _usual_load(placement, length, speed)
    contacts, uses_x = contacts_table(contact_list, user, normal)
    most = int(contacts.memory.max(initial=0))

    # X and integrated memory go behind the bodies in y, slot by slot, for the laws that need them
    slot_pair = np.repeat(np.arange(len(pairs.slot)), pairs.last - pairs.slot)
    wide = np.zeros((ns, 2), dtype=np.int64)
    each = np.column_stack([3 * uses_x, contacts.carried])
    for k, plan in enumerate(plans.pairs):
        # of one region the first row alone is an incident
        end = pairs.slot[k] + 1 if plan.kind.region else pairs.last[k]
        wide[pairs.slot[k] : end] = each[contact_row[plan.kind.contact]]
    for contact_set in plans.broadphase:
        places = wide[pairs.slot[len(plans.pairs)] :]
        places[...] = np.maximum(places, each[contact_row[contact_set.contact]])
    begins = a.BODY_SIZE * nb + np.concatenate([[0], np.cumsum(wide.ravel())])
    carried = int(begins[-1]) - a.BODY_SIZE * nb
    x, z = np.where(wide > 0, begins[:-1].reshape(ns, 2), -1).T.copy()

    table = MarkerTable(placement, row, length)
    first_state = a.BODY_SIZE * nb + carried
    rubs = any(law.looks for law in (*user.values(), *normal.values()))
    looks = rubs or any(subroutine.looks for subroutine in subroutines.values())
    held = rigid_slots(model, plans, pairs, graphics, table)
    rows = acting(
        model, table, first_state, subroutines, looks, residuals=residuals, rigid_slots=held
    )
    mechanism, states, pulled = rows.mechanism, rows.states, rows.pulls
    nj, nf, nz = len(mechanism.elements), len(rows.applied_ids), len(states.program)
    nu = len(rows.applied.late)
    damps = nf > 0 or any((pull.program >= 0).any() for pull in pulled)
    accumulators = _accumulators(bool(model.motions), damps, first_state + nz)
    kept = int(np.count_nonzero(accumulators >= 0)) + max(1, len(contact_ids))
    y0 = _initial_y(placement, carried + nz + kept)
    y0[states.place[: len(model.differentials)]] = [s.ic for s in model.differentials.values()]
    held = rows.residuals or _no_residuals()
    if residuals:
        from mbsim.compile_model.force_elements import fill_scales

        fill_scales(held, states, load, length)
        y0[held.place[held.place >= 0]] = held.initial[held.place >= 0]
    markers, angles = table.arrays()
    instructions = rows.programs.arrays(mechanism.elements, rows.applied_ids, contact_ids)
    if any(s.analysis_type == "STATIC" for s in model.simulations):
        # the last number is TIME where it stands still
        instructions = instructions._replace(number=np.append(instructions.number, 0.0))

    looked = len(y0) if has_modes(model) else 0
    scene = a.Scene(
        bodies=_bodies(placement),
        graphics=graphics,
        kinds=kinds_table(kinds, contact_row),
        pairs=pairs,
        broadphase=broadphase_table(
            plans, kinds, graphic_row, graphics, shapes, contact_row, len(pairs.slot), ns, most
        ),
        contacts=contacts,
        slots=a.Slots(slot_pair, x, z),
        markers=markers,
        angles=angles,
        programs=instructions,
        states=states,
        sensors=rows.sensors,
        switching=rows.switching,
        users=_users(subroutines, len(y0) if rubs else 0, model, residuals),
        residuals=held,
        applied=rows.applied,
        tree=mechanism.tree,
        equations=mechanism.equations,
        connections=mechanism.connections,
        world=a.World(
            pulled[0].constant.copy(),
            np.array([pulled[0].program, *(pull.program for pull in pulled)]),
            _scales(groups, length, speed),
            np.zeros(len(Hook), dtype=np.int64),
            np.zeros(1, dtype=np.int64),
            np.zeros(1, dtype=np.int64),
            accumulators,
        ),
        scales=a.Scales(
            np.array(groups.of_body, dtype=np.int64),
            np.array(groups.length),
            np.array(groups.speed),
            np.array(groups.mass),
            np.array(groups.of_contact, dtype=np.int64),
            np.array(groups.gyration, dtype=np.float64),
        ),
        state=start_state(
            nb,
            len(graphic_ids),
            ns,
            table.start_angles(),
            len(rows.sensors.id),
            len(rows.switching.program),
            most,
            nf,
            (len(held.id), 2, len(held.given)),
            len(groups.length),
        ),
        log=empty_log(len(contact_ids)),
        audit=audit(
            contact_list,
            set(user),
            np.array(groups.of_body, dtype=np.int64),
            (mechanism.connections, mechanism.equations, rows.applied, markers),
            any((pull.program >= 0).any() for pull in pulled),
        ),
        work=scratch(
            nb,
            graphics,
            len(pairs.slot),
            ns,
            len(contact_ids),
            nf,
            nj,
            nu,
            most,
            looked,
            len(y0) if looked and contacts.carried.any() else 0,
            int((pairs.last - pairs.slot).max(initial=0)) if held else 0,
            len(groups.length),
        ),
        sweep=sweep(mechanism),
        rows=empty_rows(
            len(y0),
            nb,
            len(contact_ids),
            ns,
            nj,
            nf,
            len(rows.values),
            len(rows.sensors.id) + len(model.dry_frictions),
            most,
            region=a.INC_REGION if any(kind.region for kind in kinds) else 0,
        ),
    )
    if posts:
        # one row at a time: CONTACTPOST sees which graphics a slot serves at that time
        scene = scene._replace(rows=scene.rows._replace(time=np.zeros(1)))
    if rows.reader is not None:
        rows.reader.open(scene)
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
        rows.applied_ids,
        table.rows,
        rows.values,
        mechanism.names,
        subroutines,
        pulled,
        rows.reader,
        normal,
        posts,
        load=load,
        residuals=residuals,
    )
