"""How a run starts: bodies put where constraints hold, and the incidents that exist already."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsim.errors import ModelError
from mbsim.geometry.catalog import AT_DEPTH
from mbsim.model.names import is_adams

if TYPE_CHECKING:
    from mbsim.compile_model.build import System
    from mbsim.dynamics.initial.assembly import Assembly
    from mbsim.integrators.scheme import Method
    from mbsim.model.simulation import Simulation
    from mbsim.run.hook_calls import HookCalls
    from mbsim.run.settings import Settings

Tell = Callable[[str], None]

#: Of the smaller shape's size: shapes that touch overlap by so much from rounding.
_ROUNDING = 1e-12
#: Whether a force jumps behind the start is asked so far ahead, in parts of the model's own time.
_AHEAD = (1e-4, 1e-5)
#: It does where so much of the change is left from the one to the other, and is so much of itself.
_STAYS, _COUNTS = 0.5, 1e-3
#: The first step there, in the same parts.
_FIRST = 1e-9


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


def assemble_again(system: System, hooks: HookCalls, t: float, y: Any) -> Assembly | None:
    """Bring bodies and their velocities onto what holds from here on; None without joints."""
    serve = hooks.joints_at(t)
    if serve is None:
        return None
    from mbsim.dynamics.initial.assembly import ContradictionError, assemble, contradiction

    try:
        return assemble(system.scene, y, serve, {})
    except ContradictionError as error:
        raise ModelError(contradiction(system, error)) from None


def check_kinematic(system: System, simulation: Simulation) -> None:
    """Raise `ModelError` where a kinematic analysis is asked of what forces would move."""
    from mbsim.results.log import freedom

    count = freedom(system)
    if count is None:
        count = 6 * len(system.body_ids)
    if count > 0:
        model, adams = system.model, is_adams(system.model.file)
        statement = "SIMULATE/KINEMATICS" if adams else "Simulate: analysis_type KINEMATIC"
        dynamic = "DYNAMICS" if adams else "TRANSIENT"
        raise ModelError(
            f"{simulation.source.file or model.file}:{simulation.source.line}: {statement}: "
            f"degrees of freedom: {count}, where a kinematic analysis takes 0; "
            f"drive them by motions, or let {dynamic} find how forces move them"
        )


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
    from mbsim.dynamics.contact.forces import IGNORE_DEEPER

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
        if scene.contacts.numbers[k, IGNORE_DEEPER] < 0.0:
            continue  # it takes no part
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


def jumping_forces(system: System, hooks: HookCalls, t: float, y: Any, own: float) -> list[str]:
    """Return what to say of each expression's or subroutine's force that jumps behind the start.

    As of an angle that has no value where the bodies stand: the motion's first instant decides
    which it gets. Such a place is left along another way from another first step, so that no
    tolerance tells how far off it is.

    Parameters
    ----------
    system : System
    hooks : HookCalls
    t : float
        Time of the start [T].
    y : ndarray (n,)
        State there.
    own : float
        The model's own time [T].

    Returns
    -------
    list of str
        A line for each element.
    """
    from mbsim.model.names import element_name
    from mbsim.results.elements import GROUPS

    applied, work = system.scene.applied, system.scene.work
    rows = np.flatnonzero((applied.program >= 0) | (applied.components >= 0).any(axis=1))
    if not len(rows):
        return []
    rhs, slope, there = hooks.problem.rhs, np.zeros(len(y)), np.zeros(len(y))

    def forces_at(point: Any, into: Any) -> Any:
        hooks.must(rhs, t, point, into)
        return work.applied[rows, :6].copy()

    begin, changes = forces_at(y, slope), []
    for part in _AHEAD:
        # two stages: bodies that rest leave along their acceleration
        forces_at(y + part * own * slope, there)
        changes.append(forces_at(y + 0.5 * part * own * (slope + there), there) - begin)
    forces_at(y, slope)
    far, near = changes
    size = np.abs(begin) + np.abs(near)
    # forces and torques have units of their own
    size = np.maximum.reduceat(size, [0, 3], axis=1).repeat(3, axis=1)
    jumps = (np.abs(near) > _STAYS * np.abs(far)) & (np.abs(near) > _COUNTS * size)
    lines = []
    for k in np.flatnonzero(jumps.any(axis=1)):
        statement, id = system.applied[rows[k]]
        name = element_name(system.model.file, GROUPS[statement].title, id)
        c = int(np.argmax(np.abs(near[k]) * jumps[k]))
        lines.append(
            f"{name}: its {'force' if c < 3 else 'torque'} along global {'xyz'[c % 3]} "
            f"jumps just behind the start, time {t:.6g}, from {begin[k, c]:.4g} to "
            f"{begin[k, c] + near[k, c]:.4g}: what it looks at has no one value there; the run "
            "begins with a tiny step, but where it goes may depend on what tol does not bound"
        )
    return lines


def limit_first(system: System, hooks: HookCalls, t: float, method: Method, say: Tell) -> None:
    """Bound the first step of the method's arrays where a force jumps, and tell `say` of it."""
    from mbsim.integrators.scheme import FIRST_MAX, OWN_TIME

    memory = method.memory
    lines = jumping_forces(system, hooks, t, method.y, float(memory[OWN_TIME]))
    for line in lines:
        say(f"warning: {line}")
    if lines:
        memory[FIRST_MAX] = min(memory[FIRST_MAX] or np.inf, _FIRST * memory[OWN_TIME])
