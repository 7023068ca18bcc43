"""Model -> arrays: `build` makes the `Scene` and the first ODE vector.

Only what takes part is made: graphics that are in no contact get no row, a contact
without friction no friction law, a law that does not look at X no X.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsim.arrays import codes
from mbsim.arrays.codes import WHOLE
from mbsim.arrays.hooks import Hook
from mbsim.arrays.model import Bodies, Programs, Residuals, Scales, World
from mbsim.arrays.scene import Scene
from mbsim.arrays.scratch import Rows
from mbsim.compile_model.acting import Acting, acting
from mbsim.compile_model.audit import audit
from mbsim.compile_model.contacts import ContactTables, contact_tables, kinds_table
from mbsim.compile_model.graph import make_graph
from mbsim.compile_model.gravity import Pull
from mbsim.compile_model.groups import Groups, find_groups, natural_speed, speeds_of
from mbsim.compile_model.markers import MarkerTable, body_rows
from mbsim.compile_model.pairing import Plans, plan_pairs
from mbsim.compile_model.rigid_slots import rigid_slots
from mbsim.compile_model.scratch import (
    Sizes,
    awake,
    empty_log,
    empty_rows,
    scratch,
    start_state,
    sweep,
)
from mbsim.compile_model.switching import has_modes, sticking
from mbsim.compile_model.user_code import UserCode, load_user_code, no_residuals, users_table
from mbsim.core.collection import no_collection
from mbsim.core.layout import AT_Q, AT_V, AT_W, BODY_SIZE
from mbsim.expressions.elementary import TIME
from mbsim.model.elements import Gravity, Model
from mbsim.model.names import element_name
from mbsim.model.placement import Placement, place

if TYPE_CHECKING:
    from mbsim.compile_model.subroutines import StateReader
    from mbsim.plugins import UserFriction
    from mbsim.plugins.contact_post import ContactPost
    from mbsim.plugins.subroutine import UserSubroutine
    from mbsim.plugins.types import UserNormal, UserResidual

#: XML statements of connections.
_STATEMENTS = {
    "JOINT": "Constraint_Joint",
    "JPRIM": "Constraint_Jprim",
    "COUPLER": "Constraint_Coupler",
    "MOTION": "Motion_Joint",
    "GCON": "Constraint_General",
    "PTCV": "Constraint_PTCV",
    "CVCV": "Constraint_CVCV",
    "PTSF": "Constraint_PTSF",
}


@dataclass
class System:
    """A model as arrays, with what Python still needs to know of it."""

    model: Model
    placement: Placement
    scene: Scene
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
    speeds: list[float] = field(default_factory=list)  # V of each group: `speeds_of`
    residuals: dict[int, UserResidual] = field(default_factory=dict)  # by Force_Element
    nothing: int = -1  # program that is 0, where elements are switched off

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
        placed = self.placement.bodies
        rows = {k: placed[id].given for k, id in enumerate(self.body_ids)}
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


def _bodies(placement: Placement) -> Bodies:
    """Return the moving bodies' constants."""
    bodies = list(placement.bodies.values())
    inertia = np.array([body.inertia for body in bodies], dtype=np.float64).reshape(-1, 3, 3)
    return Bodies(
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
    y = np.zeros(BODY_SIZE * len(bodies) + others)
    for k, body in enumerate(bodies):
        row = y[BODY_SIZE * k : BODY_SIZE * (k + 1)]
        row[0:3] = body.p
        row[AT_Q:AT_V] = body.q
        row[AT_V:AT_W] = body.v
        row[AT_W:] = body.R.T @ body.w
    return y


@dataclass(frozen=True)
class _Judged:
    """By what errors, speeds and forces are judged."""

    groups: Groups
    length: float
    speed: float
    load: float  # a usual force


def _judged(model: Model, placement: Placement) -> _Judged:
    """Return by what a model's errors, speeds and forces are judged."""
    groups = find_groups(model, placement)
    length, speed = max(groups.length), _speed_scale(model, groups)
    return _Judged(groups, length, speed, _usual_load(placement, length, speed))


def _varies(pulls: Sequence[Pull]) -> bool:
    """Return whether a gravity is given by expressions."""
    return any((pull.program >= 0).any() for pull in pulls)


def _drives(model: Model, acts: Acting) -> bool:
    """Return whether a motion, or a constraint whose expression follows TIME, may do work."""
    equations = acts.mechanism.equations
    programs = (acts.programs.programs[k] for k in equations.program[equations.general == WHOLE])
    return bool(model.motions) or any(code.op == TIME for code in chain.from_iterable(programs))


def _start(
    model: Model, placement: Placement, contacts: ContactTables, acts: Acting, judged: _Judged
) -> tuple[np.ndarray[Any, Any], np.ndarray[Any, Any], np.ndarray[Any, Any], Residuals]:
    """Return y at the start, where in it accumulators and friction's work stand, the residuals.

    Behind the bodies are the numbers carried by laws of contacts, the states, the accumulators.
    """
    carried, has_friction = contacts.carried, contacts.laws.friction_law != 0
    states, first_state = acts.states, BODY_SIZE * len(placement.bodies) + carried
    nz, damps = len(states.program), len(acts.applied_ids) > 0 or _varies(acts.pulls)
    accumulators = _accumulators(_drives(model, acts), damps, first_state + nz)
    kept = int(np.count_nonzero(accumulators >= 0))
    friction_at = np.where(has_friction, first_state + nz + kept + np.cumsum(has_friction) - 1, -1)
    kept += int(has_friction.sum()) + max(1, len(model.contacts))
    y0 = _initial_y(placement, carried + nz + kept)
    y0[states.offset[: len(model.differentials)]] = [s.ic for s in model.differentials.values()]
    residuals = acts.residuals
    if residuals is None:
        return y0, accumulators, friction_at, no_residuals()
    from mbsim.compile_model.force_elements import fill_scales

    fill_scales(residuals, states, judged.load, judged.length)
    y0[residuals.offset[residuals.offset >= 0]] = residuals.initial[residuals.offset >= 0]
    return y0, accumulators, friction_at, residuals


def _sizes(
    model: Model,
    plans: Plans,
    contacts: ContactTables,
    acts: Acting,
    y: int,
    bodies: int,
    groups: int,
) -> Sizes:
    """Return the sizes of what is empty when a run begins; `y`: numbers of the ODE vector."""
    pairs, looked = contacts.pairs, y if has_modes(model) else 0
    return Sizes(
        y=y,
        bodies=bodies,
        pairs=len(pairs.slot),
        slots=len(contacts.slots.pair),
        contacts=len(contacts.listed),
        connections=len(acts.mechanism.elements),
        forces=len(acts.applied_ids),
        by_reactions=len(acts.applied.by_reactions),
        sensors=len(acts.sensors.id),
        sliders=int(acts.applied.keeps.sum()),
        switching=len(acts.switching.program),
        values=len(acts.values),
        memory=contacts.memory,
        looked=looked,
        ahead=y if looked and contacts.laws.carried.any() else 0,
        points=int((pairs.last - pairs.slot).max(initial=0)) if contacts.laws.rigid.any() else 0,
        groups=groups,
        region=codes.INC_REGION if any(kind.has_area for kind in plans.kinds) else 0,
    )


def _world(acts: Acting, judged: _Judged, accumulators: np.ndarray[Any, Any]) -> World:
    """Return what holds for the whole model."""
    pulls = acts.pulls
    return World(
        pulls[0].constant.copy(),
        np.array([pulls[0].program, *(pull.program for pull in pulls)]),
        _scales(judged.groups, judged.length, judged.speed),
        np.zeros(len(Hook), dtype=np.int64),
        np.zeros(1, dtype=np.int64),
        np.zeros(1, dtype=np.int64),
        accumulators,
    )


def _group_scales(groups: Groups) -> Scales:
    """Return by what errors of each group of connected bodies are judged."""
    return Scales(
        np.array(groups.of_body, dtype=np.int64),
        np.array(groups.length),
        np.array(groups.speed),
        np.array(groups.mass),
        np.array(groups.of_contact, dtype=np.int64),
        np.array(groups.gyration, dtype=np.float64),
    )


def _loadable(acts: Acting, body: np.ndarray[Any, Any], bodies: int) -> np.ndarray[Any, Any]:
    """Return the moving bodies on which applied forces may act, weight over time included."""
    if np.any(np.asarray(acts.pulls[0].program) >= 0):
        return np.arange(bodies)
    ends = np.concatenate([acts.applied.i, acts.applied.j]).astype(np.int64)
    found = np.unique(body[ends[ends >= 0]])
    return found[found < bodies].astype(np.int64)


def _programs(model: Model, acts: Acting, contact_ids: list[int]) -> Programs:
    """Return the programs of all expressions."""
    made = acts.programs.arrays(acts.mechanism.elements, acts.applied_ids, contact_ids)
    if any(s.analysis_type == "STATIC" for s in model.simulations):
        # the last number is TIME where it stands still
        made = made._replace(number=np.append(made.number, 0.0))
    return made


def _rows(n: Sizes, one_at_a_time: bool) -> Rows:
    """Return the tables of output rows.

    One row at a time: CONTACTPOST sees which graphics a slot serves at that time.
    """
    rows = empty_rows(n)
    return rows._replace(time=np.zeros(1)) if one_at_a_time else rows


def _scene(
    model: Model,
    placement: Placement,
    plans: Plans,
    code: UserCode,
    contacts: ContactTables,
    judged: _Judged,
    table: MarkerTable,
    acts: Acting,
) -> tuple[Scene, np.ndarray[Any, Any]]:
    """Return all arrays of a model, and y at the start."""
    y0, accumulators, friction_at, residuals = _start(model, placement, contacts, acts, judged)
    markers, angles = table.arrays()
    mechanism, contact_ids = acts.mechanism, list(contacts.contact_row)
    n = _sizes(
        model,
        plans,
        contacts,
        acts,
        len(y0),
        len(placement.bodies),
        len(judged.groups.length),
    )
    scene = Scene(
        bodies=_bodies(placement),
        graphics=contacts.graphics,
        kinds=kinds_table(plans.kinds, contacts.contact_row, sticking(model)),
        pairs=contacts.pairs,
        broadphase=contacts.broadphase,
        contacts=contacts.laws,
        slots=contacts.slots,
        markers=markers,
        angles=angles,
        curves=mechanism.curves,
        surfaces=mechanism.surfaces,
        programs=_programs(model, acts, contact_ids),
        states=acts.states,
        sensors=acts.sensors,
        switching=acts.switching,
        users=users_table(code, model, n.y),
        residuals=residuals,
        applied=acts.applied,
        tree=mechanism.tree,
        equations=mechanism.equations,
        connections=mechanism.connections,
        graph=make_graph(mechanism.tree, mechanism.equations, mechanism.connections, markers),
        world=_world(acts, judged, accumulators),
        scales=_group_scales(judged.groups),
        state=start_state(n, contacts.graphics, table.start_angles(), mechanism.along, residuals),
        awake=awake(n, contacts.graphics, _loadable(acts, markers.body, n.bodies)),
        log=empty_log(n.contacts),
        audit=audit(
            contacts.listed,
            set(code.friction),
            np.array(judged.groups.of_body, dtype=np.int64),
            (mechanism.connections, mechanism.equations, acts.applied, markers),
            _varies(acts.pulls),
            contacts.laws,
            friction_at,
        ),
        work=scratch(n, contacts.graphics),
        sweep=sweep(mechanism),
        rows=_rows(n, one_at_a_time=bool(code.posts)),
    )
    return scene, y0


@no_collection()
def build(
    model: Model,
    plugins: Sequence[Path] = (),
    interpret: bool = False,
    detector: str = "auto",
    log: Callable[[str], None] | None = None,
    rigid: bool = False,
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
    rigid : bool
        Whether the method that runs it has rigid contact.

    Raises
    ------
    ModelError
        If a user subroutine cannot be found or loaded, or a pair of shapes is impossible.
    """
    placement = place(model)
    plans = plan_pairs(model, detector, rigid)
    code = load_user_code(model, plugins, interpret, log)
    rows = body_rows(model, placement)
    contacts = contact_tables(model, placement, plans, rows, code.friction, code.normal)
    judged = _judged(model, placement)
    table = MarkerTable(placement, rows, judged.length)
    sticking = rigid_slots(model, plans, contacts.pairs, contacts.graphics, table)
    acts = acting(
        model,
        table,
        BODY_SIZE * len(placement.bodies) + contacts.carried,
        code.subroutines,
        code.looks,
        residuals=code.residuals,
        rigid_slots=sticking,
        surfaces=code.surfaces,
    )
    scene, y0 = _scene(model, placement, plans, code, contacts, judged, table, acts)
    if acts.reader is not None:
        acts.reader.open(scene)
    return System(
        model,
        placement,
        scene,
        y0,
        list(placement.bodies),
        list(contacts.graphic_row),
        list(contacts.contact_row),
        plans,
        code.friction,
        any(not kind.closed_form for kind in plans.kinds),
        acts.mechanism.elements,
        acts.applied_ids,
        table.rows,
        acts.values,
        acts.mechanism.names,
        code.subroutines,
        acts.pulls,
        acts.reader,
        code.normal,
        code.posts,
        load=judged.load,
        speeds=speeds_of(model, judged.groups),
        residuals=code.residuals,
        nothing=acts.nothing,
    )
