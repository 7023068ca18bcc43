"""How a run starts: bodies put where constraints hold, and the incidents that exist already."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from mbsim.errors import ModelError
from mbsim.geometry.catalog import AT_DEPTH

if TYPE_CHECKING:
    from mbsim.compile_model.build import System
    from mbsim.dynamics.initial.assembly import Assembly
    from mbsim.run.hook_calls import HookCalls
    from mbsim.run.settings import Settings

Tell = Callable[[str], None]

#: Of the smaller shape's size: shapes that touch overlap by so much from rounding.
_ROUNDING = 1e-12


def assemble_model(
    system: System, hooks: HookCalls, t: float, y: Any, log: Tell, tell: Tell
) -> Assembly | None:
    """Put the bodies of `y` where all constraints hold, and report what had to move.

    Returns
    -------
    Assembly or None
        What was found on the way; None where there are no joints.

    Raises
    ------
    ModelError
        Where constraints contradict each other.
    """
    from mbsim.dynamics.initial.assembly import (
        ContradictionError,
        assemble,
        contradiction,
        describe,
    )

    serve = hooks.joints_at(t)
    if serve is None:
        return None
    try:
        found = assemble(system.scene, y, serve, system.given_velocities())
    except ContradictionError as error:
        raise ModelError(contradiction(system, error)) from None
    lines, warnings = describe(system, found)
    for line in (*lines, *warnings):
        log(line)
    for line in warnings:
        tell(line)
    return found


def assemble_again(system: System, hooks: HookCalls, t: float, y: Any) -> None:
    """Give the bodies the velocities that motions ask for, after a stage that had none."""
    serve = hooks.joints_at(t)
    if serve is None:
        return
    from mbsim.dynamics.initial.assembly import ContradictionError, assemble, contradiction

    try:
        assemble(system.scene, y, serve, {})
    except ContradictionError as error:
        raise ModelError(contradiction(system, error)) from None


def settle_contacts(
    system: System,
    hooks: HookCalls,
    settings: Settings,
    y: Any,
    f: Any,
    allow_overlap: bool,
    log: Tell,
    tell: Tell,
) -> None:
    """Begin with the incidents that exist at the start; refuse those that are too deep."""
    from mbsim.arrays.codes import TOLERANCE

    scene, problem = system.scene, hooks.problem
    t = settings.stages[0].simulation.start_time
    # what begins to stick or slip is told by it
    scene.world.scale[TOLERANCE] = settings.stages[0].tol
    hooks.must(problem.rhs, t, y, f)
    if system.plans.broadphase:
        # nothing is listed yet: list what is near, then look again
        hooks.must(problem.commit, t, y, f)
        hooks.must(problem.rhs, t, y, f)
    faults = overlaps(system, log, tell)
    if faults and not allow_overlap:
        raise ModelError("\n".join(dict.fromkeys(faults)))
    hooks.must(problem.commit, t, y, f)


def unknown_overlaps(system: System) -> list[str]:
    """Return a line for each contact with an overlap at the start whose depth is not known.

    Only the first such pair of a contact is named.
    """
    scene, model, pairs = system.scene, system.model, system.scene.pairs
    faults = []
    for c, beyond in enumerate(scene.work.beyond.tolist()):
        if beyond == 0:
            continue
        pair, contact = beyond - 1, model.contacts[system.contact_ids[c]]
        ids = (system.graphic_ids[row[pair]] for row in (pairs.graphic_i, pairs.graphic_j))
        one, other = (
            f"Post_Graphic[{id}] of Body_Rigid"
            f"[{model.markers[model.graphics[id].marker_id].body_id}]"
            for id in ids
        )
        where = f"{model.file}:{contact.source.line}: Force_Contact[{contact.id}]"
        depth = scene.work.points[pairs.slot[pair] : pairs.last[pair], AT_DEPTH].max()
        what = (
            "overlap deeper than the layer under a mesh's surface, or than its wall,"
            if depth > 0.0
            else "lie one wholly inside the other"
        )
        faults.append(
            f"{where}: {one} and {other} {what} at the start: how deep, and which way out, is not "
            "known; move them apart or give --allow-overlap"
        )
    return faults


def overlaps(system: System, log: Tell, tell: Tell) -> list[str]:
    """Report shapes that overlap at the start; return a line for each that is too deep."""
    from mbsim.arrays.codes import ACTIVE

    scene, model = system.scene, system.model
    faults = unknown_overlaps(system)
    pairs = scene.pairs
    active = pairs.active[: pairs.count[ACTIVE]]
    slots = [s for pair in active for s in range(pairs.slot[pair], pairs.last[pair])]
    for s in slots:
        # those that are ignored for their depth overlap too
        depth = float(scene.work.points[s, AT_DEPTH])
        if not depth > 0.0:
            continue
        pair = int(scene.slots.pair[s])
        if (s - pairs.slot[pair]) % scene.kinds.step[pairs.kind[pair]] != 0:
            continue
        rows = (int(pairs.graphic_i[pair]), int(pairs.graphic_j[pair]))
        graphic_i, graphic_j = (system.graphic_ids[row] for row in rows)
        k = int(scene.kinds.contact[pairs.kind[pair]])
        sides = [scene.graphics.half[row] for row in rows]
        if depth < _ROUNDING * min(float(side.max()) for side in sides):
            continue
        contact = model.contacts[system.contact_ids[k]]
        name = f"Force_Contact[{contact.id}]"
        between = f"Post_Graphic[{graphic_i}] and Post_Graphic[{graphic_j}]"
        log(f"{name}: {between} overlap by {depth:.6g} at the start, slot {s}")
        # half of the smaller shape, across its thinnest side
        half = min(float(scene.graphics.width[row]) for row in rows)
        ignored = contact.ignore_penetration_larger_than
        limit = half if ignored is None else min(half, ignored)
        if depth > 0.1 * limit and s == pairs.slot[pair]:
            tell(f"{name}: {between} overlap by {depth:.6g} at the start")
        if depth > limit:
            faults.append(
                f"{model.file}:{contact.source.line}: {name}: {between} overlap by {depth:.6g} "
                f"at the start, more than {limit:.6g}; move them apart or give --allow-overlap"
            )
    return faults
