"""What a run records, by name: of every kind of element one dataset a signal, ids in columns."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from mbsim.arrays.codes import (
    CONTACT_AREA,
    CONTACT_COLUMNS,
    CONTACT_DEPTH,
    CONTACT_FORCE,
    CONTACT_INCIDENTS,
    CONTACT_SLIP,
    CONTACT_TORQUE,
    INC_POINT,
    PEAK_DEPTH,
    PEAK_FORCE,
    PEAK_SLIP,
    POINT_AREA,
    POINT_CONTACT,
    POINT_FORCE,
    POINT_SLIP,
)
from mbsim.results.blocks import Block, Table, events_table, nothing
from mbsim.results.elements import GROUPS, acting, facts, with_own_tables
from mbsim.results.forces import Forces
from mbsim.results.graphics import about_graphics, graphics_later
from mbsim.results.motion import Motion, motion
from mbsim.results.requests import (
    RELATIVE,
    columns_of,
    evaluate,
    expressions,
    force_table,
    measures_of,
)
from mbsim.results.signal_filter import SignalFilter
from mbsim.results.watch import energies

if TYPE_CHECKING:
    from mbsim.compile_model.build import System


_PEAKS = {"force": PEAK_FORCE, "penetration": PEAK_DEPTH, "slip_speed": PEAK_SLIP}
#: What makes the rows of a dataset.
Make = Callable[[], Table]
#: The group of points of contact, see `_points`.
POINTS = "contact_points"


def groups(system: System) -> dict[str, list[int]]:
    """Return the ids of everything whose signals stand side by side, by group."""
    found = {
        "bodies": list(system.body_ids),
        "contacts": list(system.contact_ids),
        "diffs": list(system.model.differentials),
    }
    for statement, id in acting(system):
        found.setdefault(GROUPS[statement].path, []).append(id)
    return {group: ids for group, ids in found.items() if ids}


def facts_of(system: System, asked: SignalFilter) -> dict[str, Table]:
    """Return ids, labels and types of all elements with columns, by dataset."""
    model = system.model
    tables: dict[str, Any] = {
        "bodies": model.bodies,
        "contacts": model.contacts,
        "diffs": model.differentials,
    }
    about = dict(facts(model))
    found: dict[str, Table] = {}
    for group, ids in groups(system).items():
        kept = [ids[k] for k in asked.elements(group, ids)]
        if not kept:
            continue
        found[f"{group}/id"] = np.array(kept, dtype=np.int64)
        labelled = (
            {f"{group}/{id}": {"label": tables[group][id].label} for id in kept}
            if (group in tables)
            else about
        )
        for name in ("label", "type"):
            texts = [labelled.get(f"{group}/{id}", {}).get(name, "") for id in kept]
            if any(texts):
                found[f"{group}/{name}"] = np.array(texts, dtype=object)
    return found


def without_rows(system: System) -> dict[str, dict[str, str]]:
    """Return label and type of elements that have no row, by group: they hold nothing."""
    there = groups(system)
    return {
        name: found
        for name, found in facts(system.model)
        for group, _, id in [name.partition("/")]
        if int(id) not in there.get(group, ())
    }


class Before(NamedTuple):
    """What a file says before its first row: arguments of `Store.update`."""

    values: dict[str, Table]
    constants: dict[str, Callable[[], Table]]
    attributes: dict[str, dict[str, Any]]


def before_rows(system: System, asked: SignalFilter, pictures: bool = True) -> Before:
    """Return what a new file says of its elements, for `pictures` their shapes and markers too."""
    if not pictures:
        return Before(facts_of(system, asked), {}, {**without_rows(system)})
    about = about_graphics(system.model, system.placement)
    return Before(
        facts_of(system, asked),
        graphics_later(with_own_tables(system.model), system.placement),
        {**without_rows(system), "graphics": dict(about)},
    )


def length_of(written: Sequence[int], name: str) -> int:
    """Return how long a dataset is of which so many rows, incidents and events are written."""
    rows, incidents, events = written
    others = {"events": events, "state/incidents": incidents, "state/incident_offsets": rows + 1}
    if name.startswith(f"{POINTS}/"):
        return rows + 1 if name == f"{POINTS}/offsets" else incidents
    return others.get(name, rows)


def names_of(system: System) -> list[str]:
    """Return the names of all signals that this model has."""
    stacked = groups(system)
    return [
        name
        for stored, _ in signals_later(system, nothing(system), SignalFilter())
        if not stored.startswith(f"{POINTS}/")
        for group, _, signal in [stored.partition("/")]
        for name in (
            [f"{group}/{id}/{signal}" for id in stacked[group]]
            if group in stacked and "/" not in signal
            else [stored]
        )
    ]


def request_columns(system: System) -> dict[str, dict[str, Any]]:
    """Return what the columns of the requests are, by dataset."""
    about: dict[str, dict[str, Any]] = {}
    for request in system.model.requests.values():
        about[f"requests/{request.id}"] = {
            "columns": columns_of(request),
            "type": request.type,
            "label": request.label or request.comment,
        }
        if request.type == "EXPRESSION":
            about[f"requests/{request.id}"]["measures"] = measures_of(request)
    return about


def signals(
    system: System, block: Block, asked: SignalFilter, incidents: int = 0, first: bool = True
) -> Iterator[tuple[str, Table]]:
    """Yield the rows of every dataset that was asked for."""
    found = signals_later(system, block, asked, incidents, first)
    return ((name, make()) for name, make in found)


def signals_later(
    system: System, block: Block, asked: SignalFilter, incidents: int = 0, first: bool = True
) -> Iterator[tuple[str, Make]]:
    """Yield what makes the rows of every dataset that was asked for; it keeps of all the block."""
    yield "time", lambda: block.time
    bodies = motion(system.body_ids, block.y, block.accel)
    yield from asked.stacked(
        "bodies",
        system.body_ids,
        {
            "position": lambda: bodies.p,
            "quaternion": lambda: bodies.q,
            "velocity": lambda: bodies.v,
            "angular_velocity": lambda: bodies.w,
            "acceleration": lambda: bodies.a,
        },
    )
    yield from _contacts(system, block, asked)
    yield from _elements(system, block, asked)
    states = list(system.model.differentials)
    places = np.array(system.scene.states.offset[: len(states)], dtype=np.int64)
    yield from asked.stacked("diffs", states, {"value": lambda: block.y[:, places]})
    for name, column in system.unknowns():
        if asked(name):
            yield name, partial(_column, block.value, column)
    yield from _requests(system, block, bodies)
    for k, name in enumerate(energies(system)):
        if asked(f"energy/{name}"):
            yield f"energy/{name}", partial(_column, block.energy, k)
    if asked("state/y"):
        yield "state/y", lambda: block.y
        yield "state/incident_offsets", partial(_offsets, block.incident_count, incidents, first)
        yield "state/incidents", lambda: block.incidents
    if len(system.scene.rows.points):
        yield from _points(system, block, incidents, first)
    yield "events", partial(events_table, block.events)


def _column(table: Table, column: int) -> Table:
    found: Table = table[:, column]
    return found


def _offsets(counts: Table, before: int, first: bool) -> Table:
    """Return where the incidents of rows end; row k has [offsets[k] : offsets[k + 1]]."""
    ends = before + np.cumsum(counts, dtype=np.int64)
    return np.append(0, ends) if first else ends


def _requests(system: System, block: Block, bodies: Motion) -> Iterator[tuple[str, Make]]:
    """Yield what makes the rows of requests; forces are found at once, for they need the system."""
    requests = system.model.requests.values()
    if not requests:
        return
    forces = Forces(system, bodies, block.joint, block.applied, block.contact)
    markers, values, numbers = system.placement.markers, system.values, block.value
    for request in requests:
        make: Make
        if request.type == "EXPRESSION":
            make = partial(expressions, request, values, numbers)
        elif request.type in RELATIVE:
            make = partial(evaluate, request, markers, bodies)
        else:
            make = partial(np.asarray, force_table(request, markers, forces))
        yield f"requests/{request.id}", make


def peaks(system: System, asked: SignalFilter, log: Table) -> dict[str, Table]:
    """Return the largest force, depth and slip of contacts, of `Log.contacts`, by dataset."""
    kept = asked.elements("contacts", system.contact_ids)
    if not kept:
        return {}
    return {f"contacts/peak_{name}": log[kept, column] for name, column in _PEAKS.items()}


def _points(
    system: System, block: Block, incidents: int, first: bool
) -> Iterator[tuple[str, Make]]:
    """Yield where bodies touch and the forces there; row k has offsets[k] to offsets[k + 1]."""
    yield f"{POINTS}/offsets", partial(_offsets, block.incident_count, incidents, first)
    points, ids = block.points, np.array([*system.contact_ids, 0], dtype=np.int64)
    yield f"{POINTS}/contact", lambda: ids[points[:, POINT_CONTACT].astype(np.int64)]
    yield f"{POINTS}/position", lambda: block.incidents[:, INC_POINT : INC_POINT + 3]
    yield f"{POINTS}/force", lambda: points[:, POINT_FORCE : POINT_FORCE + 3]
    yield f"{POINTS}/slip_speed", partial(_column, points, POINT_SLIP)
    yield f"{POINTS}/area", partial(_column, points, POINT_AREA)


def _contacts(system: System, block: Block, asked: SignalFilter) -> Iterator[tuple[str, Make]]:
    """Yield what makes the rows of contacts."""
    ids = system.contact_ids
    rows = block.contact.reshape(len(block.time), len(ids), CONTACT_COLUMNS)
    yield from asked.stacked(
        "contacts",
        ids,
        {
            "force": lambda: rows[..., CONTACT_FORCE : CONTACT_FORCE + 3],
            "torque": lambda: rows[..., CONTACT_TORQUE : CONTACT_TORQUE + 3],
            "penetration": lambda: rows[..., CONTACT_DEPTH],
            "slip_speed": lambda: rows[..., CONTACT_SLIP],
            "incidents": lambda: rows[..., CONTACT_INCIDENTS].astype(np.int64),
            "area": lambda: rows[..., CONTACT_AREA],
        },
    )


def _elements(system: System, block: Block, asked: SignalFilter) -> Iterator[tuple[str, Make]]:
    """Yield what makes the rows of all between markers, by element in its group's order."""
    elements = acting(system)
    if not elements:
        return
    wrenches = block.wrenches.reshape(len(block.time), len(elements), 6)
    columns: dict[str, dict[int, int]] = {}
    for k, (statement, id) in enumerate(elements):
        columns.setdefault(GROUPS[statement].path, {})[id] = k
    for group, of in columns.items():
        places = list(of.values())
        part = {"force": slice(0, 3), "torque": slice(3, 6)}
        tables = {name: partial(_columns_of, wrenches, places, part[name]) for name in part}
        yield from asked.stacked(group, list(of), tables)


def _columns_of(wrenches: Table, places: list[int], part: slice) -> Table:
    """Return forces or torques of some elements, (rows, elements, 3)."""
    first, end = places[0], places[-1] + 1
    if places == list(range(first, end)):
        return wrenches[:, first:end, part]  # as they lie, without a copy
    return wrenches[:, places, part]
