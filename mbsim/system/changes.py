"""What a statement of <Command> changes of a `System` between simulations: numbers, no layout."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from mbsim.errors import DeckError, Fault
from mbsim.model.contact_radius import with_radii
from mbsim.model.elements import Change
from mbsim.system import arrays as a
from mbsim.system.applied import applied_forces
from mbsim.system.build import System, request_programs
from mbsim.system.contacts import contacts_table
from mbsim.system.markers import MarkerTable
from mbsim.system.mechanism import constrain
from mbsim.system.programs import ProgramTable

Array = np.ndarray[Any, Any]
_OF_CONTACTS = ("normal_par", "friction_par", "ignore_deeper", "dmax")
_OF_APPLIED = ("par", "bounds", "law_par")


@dataclass(frozen=True)
class Parameters:
    """All that changes may change, for one simulation."""

    contacts: a.Contacts
    applied: a.Applied
    programs: a.Programs


def _refused(system: System, changes: tuple[Change, ...], why: str) -> DeckError:
    """Return the fault of the last change, whose layout the run cannot take."""
    change = changes[-1]
    source, (name, _, said) = change.element.source, change.text.partition(": ")
    return DeckError([Fault(source.file, source.line, name, f"{said}: {why}")])


def _same(before: Any, after: Any, names: tuple[str, ...]) -> bool:
    """Return whether arrays of two tables have equal shapes."""
    return all(getattr(before, n).shape == getattr(after, n).shape for n in names)


def parameters(system: System, changes: tuple[Change, ...]) -> Parameters:
    """Return the parameters of a system with its elements changed.

    Raises
    ------
    DeckError
        If the changed elements need other rows than there are.
    """
    model, scene = system.model.changed(changes), system.scene
    rows = {body.id: len(system.body_ids) for body in model.bodies.values()}
    rows.update({id: k for k, id in enumerate(system.body_ids)})
    table = MarkerTable(system.placement, rows)
    programs = ProgramTable(table, model.variables)
    applied, ids = applied_forces(model, table, programs)
    mechanism = constrain(model, table, programs)
    request_programs(model, programs)
    markers, angles = table.arrays()
    listed = [with_radii(contact, model.graphics) for contact in model.contacts.values()]
    contacts, _ = contacts_table(listed, system.user_friction)
    looks = all(
        np.array_equal(x, y)
        for x, y in ((markers.body, scene.markers.body), (markers.p, scene.markers.p))
    )
    if not looks or not all(map(np.array_equal, angles, scene.angles)):
        raise _refused(system, changes, "looks at other markers than before: not built yet")
    if not _same(scene.contacts, contacts, _OF_CONTACTS) or not _same(
        scene.applied, applied, _OF_APPLIED
    ):
        raise _refused(system, changes, "asks for another law than before: not built yet")
    return Parameters(contacts, applied, programs.arrays(mechanism.elements, ids))


def make_room(scene: a.Scene, stages: list[Parameters]) -> a.Scene:
    """Return the scene with programs long enough for those of every simulation."""
    own = scene.programs
    sizes = [
        (len(p.code), len(p.number), len(p.stack)) for p in (own, *(s.programs for s in stages))
    ]
    code, number, stack = (max(column) for column in zip(*sizes, strict=True))
    # one number more than any program has, for TIME where it stands still
    number += 1
    return scene._replace(
        programs=a.Programs(
            own.start,
            np.resize(own.code, (code, 6)) if len(own.code) else np.zeros((code, 6), np.int64),
            np.concatenate([own.number, np.zeros(number - len(own.number))]),
            np.zeros((stack, 3)),
        )
    )


def apply(scene: a.Scene, stage: Parameters) -> None:
    """Let the parameters of one simulation hold."""
    for to, from_ in _pairs(scene, stage):
        to[...] = from_
    programs = stage.programs
    scene.programs.start[...] = programs.start
    scene.programs.code[: len(programs.code)] = programs.code
    scene.programs.number[: len(programs.number)] = programs.number


def _pairs(scene: a.Scene, stage: Parameters) -> Iterator[tuple[Array, Array]]:
    """Yield arrays of the scene with what they shall be."""
    for name in _OF_CONTACTS:
        yield getattr(scene.contacts, name), getattr(stage.contacts, name)
    for name in _OF_APPLIED:
        yield getattr(scene.applied, name), getattr(stage.applied, name)
