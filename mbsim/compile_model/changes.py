"""What a statement of <Command> changes of a `System` between simulations: numbers, no layout."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from mbsim.arrays.model import Applied, Contacts, Programs
from mbsim.arrays.scene import Scene
from mbsim.compile_model.acting import acting
from mbsim.compile_model.build import System
from mbsim.compile_model.contacts import contacts_table
from mbsim.compile_model.markers import MarkerTable
from mbsim.errors import DeckError, Fault
from mbsim.model.contact_radius import with_radii
from mbsim.model.elements import Change

Array = np.ndarray[Any, Any]
_OF_CONTACTS = ("normal_par", "friction_par", "numbers", "dmax")
_OF_APPLIED = ("par", "bound", "law_par")


@dataclass(frozen=True)
class Parameters:
    """All that changes may change, for one simulation."""

    contacts: Contacts
    applied: Applied
    programs: Programs


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
    bodies = {body.id: len(system.body_ids) for body in model.bodies.values()}
    bodies.update({id: k for k, id in enumerate(system.body_ids)})
    table = MarkerTable(system.placement, bodies)
    offsets = scene.states.offset
    first_state = int(offsets[0]) if len(offsets) else 0
    looks = system.reader is not None
    rows = acting(model, table, first_state, system.subroutines, looks, residuals=system.residuals)
    applied = rows.applied
    markers, angles = table.arrays()
    listed = [with_radii(contact, model.graphics) for contact in model.contacts.values()]
    kinds = scene.kinds
    with_rims = {int(scene.contacts.id[c]) for c in kinds.contact[kinds.rims == 1]}
    contacts, _ = contacts_table(listed, system.user_friction, system.user_normal, with_rims)
    same = all(
        np.array_equal(x, y)
        for x, y in ((markers.body, scene.markers.body), (markers.p, scene.markers.p))
    )
    if not same or not all(map(np.array_equal, angles, scene.angles)):
        raise _refused(system, changes, "looks at other markers than before: not built yet")
    if not _same(scene.contacts, contacts, _OF_CONTACTS) or not _same(
        scene.applied, applied, _OF_APPLIED
    ):
        raise _refused(system, changes, "asks for another law than before: not built yet")
    if rows.applied_ids != system.applied or not all(
        np.array_equal(getattr(applied, n), getattr(scene.applied, n))
        for n in ("form", "by_reactions")
    ):
        raise _refused(system, changes, "follows from other forces than before: not built yet")
    programs = rows.programs.arrays(rows.mechanism.elements, rows.applied_ids, system.contact_ids)
    return Parameters(contacts, applied, programs)


def make_room(scene: Scene, stages: list[Parameters]) -> Scene:
    """Return the scene with programs long enough for those of every simulation."""
    every = [scene.programs, *(stage.programs for stage in stages)]
    made = []
    for name, own in zip(Programs._fields, scene.programs, strict=True):
        size = max(len(getattr(programs, name)) for programs in every)
        # one number more than any program has, for TIME where it stands still
        wide = np.zeros((size + (name == "number"), *own.shape[1:]), dtype=own.dtype)
        wide[: len(own)] = own
        made.append(wide)
    return scene._replace(programs=Programs(*made))


def apply(scene: Scene, stage: Parameters) -> None:
    """Let the parameters of one simulation hold."""
    for to, from_ in _pairs(scene, stage):
        to[...] = from_
    for whole, used in zip(scene.programs, stage.programs, strict=True):
        whole[: len(used)] = used


def _pairs(scene: Scene, stage: Parameters) -> Iterator[tuple[Array, Array]]:
    """Yield arrays of the scene with what they shall be."""
    for name in _OF_CONTACTS:
        yield getattr(scene.contacts, name), getattr(stage.contacts, name)
    for name in _OF_APPLIED:
        yield getattr(scene.applied, name), getattr(stage.applied, name)
