"""What an integrator calls of a mechanism (`core.problem`): all are given one packed `Scene`."""

from __future__ import annotations

import math

from mbsim.arrays.codes import (
    AT_FAULT,
    CONSTRAINTS_CHANGED,
    ENERGY_LOST,
    ERROR_NOW,
    FOLD_HALT,
    FOLDS,
    LISTINGS,
)
from mbsim.arrays.hooks import (
    Contacts,
    Dry,
    Effects,
    Gauges,
    Hook,
    Joints,
    Sticking,
    answer_of,
    failure_or,
    note_failure,
)
from mbsim.arrays.scene import Scene
from mbsim.core.address import call_float, call_int, vector_at, view
from mbsim.core.arrays import F1, Pointer
from mbsim.core.jitable import jitable
from mbsim.core.layout import BODY_SIZE
from mbsim.core.problem import (
    ALONG,
    BY_CHECK,
    EACH,
    FRICTION_ALONE,
    FULL,
    GOES,
    IMPACTS_ALONE,
    RATES,
    WHOLE,
    Taken,
)
from mbsim.dynamics.bodies.awake import bodies_awake, body_awake, graphic_awake, graphics_awake
from mbsim.dynamics.bodies.configuration import differ, move_on
from mbsim.dynamics.bodies.scales import take_speeds
from mbsim.dynamics.contact.broadphase import follow
from mbsim.dynamics.contact.peaks import first_look, next_look
from mbsim.dynamics.contact.points import first_depth
from mbsim.dynamics.events.stability import stable_step
from mbsim.dynamics.pipeline.audit import examine
from mbsim.dynamics.pipeline.evaluate import evaluate, evaluate_past
from mbsim.dynamics.pipeline.output import (
    fill_sizes,
    gauged,
    no_room,
    scaled_error,
    write_row,
)


@jitable
def accept(scene: Scene, t: float, h: float, y: F1) -> int:
    """Take the point evaluated last as accepted.

    Returns 1 if y changed so that f did, CONSTRAINTS_CHANGED if the motion goes on otherwise.
    """
    state, graphics, ground = scene.state, scene.graphics, len(scene.bodies.mass)
    contacts, changed = scene.world.hooks[Hook.CONTACTS], 0
    if contacts != 0:
        changed = answer_of(scene, call_int(contacts, (scene, Contacts.KEEP, t, h, y, y)))
    if scene.world.hooks[Hook.DRY] != 0:
        answer = call_int(scene.world.hooks[Hook.DRY], (scene, Dry.KEEP, t, y))
        changed = max(changed, answer_of(scene, answer))
    if contacts != 0:
        answer_of(scene, call_int(contacts, (scene, Contacts.WATCH, t, h, y, y)))
        count = len(scene.contacts.id)
        for c in range(count):
            scene.log.contacts[c, ENERGY_LOST] = y[len(y) - count + c]
        answer_of(scene, call_int(contacts, (scene, Contacts.GAPS, t, h, y, y)))
    for row in range(bodies_awake(scene)):
        b = body_awake(scene, row)
        for k in range(4):
            state.q[b, k] = y[BODY_SIZE * b + 3 + k]
        for k in range(3):
            state.w[b, k] = scene.work.w[b, k]
    state.since[0] = t
    for row in range(graphics_awake(scene)):
        g = graphic_awake(scene, row)
        if graphics.body[g] < ground:
            for k in range(3):
                state.centre[g, k] = scene.work.frames[g, k]
    if scene.world.hooks[Hook.ANGLES] != 0:
        note_failure(scene, call_int(scene.world.hooks[Hook.ANGLES], (scene, y)))
    if len(scene.broadphase.contact) > 0:
        note_failure(scene, call_int(scene.world.hooks[Hook.NEAR], (scene, y)))
    return changed


def rhs(context: int, t: float, h: float, a: Pointer, b: Pointer) -> int:
    """f(t, y)."""
    scene = view(context, Scene)
    n = scene.rows.y.shape[1]
    return failure_or(scene, evaluate(scene, t, h, vector_at(a, n), vector_at(b, n)))


@jitable
def normalise_quaternions(scene: Scene, y: F1) -> None:
    """Bring the quaternions of bodies awake back to unit length."""
    for row in range(bodies_awake(scene)):
        at = BODY_SIZE * body_awake(scene, row) + 3
        length = math.sqrt(y[at] ** 2 + y[at + 1] ** 2 + y[at + 2] ** 2 + y[at + 3] ** 2)
        for k in range(4):
            y[at + k] /= length


def _project(context: int, t: float, h: float, a: Pointer, b: Pointer) -> int:
    """Quaternions back to unit length, and bodies onto their constraints."""
    scene = view(context, Scene)
    y = vector_at(a, scene.rows.y.shape[1])
    normalise_quaternions(scene, y)
    if scene.world.hooks[Hook.JOINTS] != 0:
        what = Joints.ALONG if h == ALONG else Joints.PROJECT
        code = call_int(scene.world.hooks[Hook.JOINTS], (scene, what, t, y, y))
        return failure_or(scene, code)
    return 0


def _norm(context: int, t: float, h: float, a: Pointer, b: Pointer) -> float:
    """The scaled local error."""
    scene = view(context, Scene)
    n = scene.rows.y.shape[1]
    if h == IMPACTS_ALONE:
        return gauged(scene, Hook.EFFECTS, Effects.IMPACT, t, t, vector_at(a, n), vector_at(b, n))
    if h == FRICTION_ALONE:
        return gauged(scene, Hook.EFFECTS, Effects.FRICTION, t, t, vector_at(a, n), vector_at(b, n))
    if h == EACH:
        fill_sizes(scene, vector_at(a, RATES * n), vector_at(b, n))
        return 0.0
    error = scaled_error(scene, h, vector_at(a, n), vector_at(b, n))
    if h > 0.0:
        scene.audit.tally[ERROR_NOW] = error
    return error


def _check(context: int, t: float, h: float, a: Pointer, b: Pointer) -> float:
    """The guard of first penetration."""
    scene = view(context, Scene)
    part = first_depth(scene, t, h, vector_at(a, scene.rows.y.shape[1]))
    failure_or(scene, 0)  # laws are explored, not asked
    return part


def _commit(context: int, t: float, h: float, a: Pointer, b: Pointer) -> int:
    """The incident table, events and peaks."""
    scene = view(context, Scene)
    listings, passed = scene.log.counters[LISTINGS], scene.sweep.quality[FOLDS] == 1.0
    if scene.world.hooks[Hook.STICKING] != 0:
        # before equations may be chosen anew
        answer_of(scene, call_int(scene.world.hooks[Hook.STICKING], (scene, Sticking.SHARE, t, a)))
    if scene.world.hooks[Hook.JOINTS] != 0:
        code = call_int(scene.world.hooks[Hook.JOINTS], (scene, Joints.KEEP, t, a, a))
        if code != 0:
            return -failure_or(scene, code)
    y = vector_at(a, scene.rows.y.shape[1])
    take_speeds(scene, y, scene.state.fastest)
    changed = accept(scene, t, h, y)
    examine(scene, t, h, y)
    passes = scene.sweep.quality[FOLDS] == 1.0
    left = passed and not passes
    word = 0
    if changed > 0 or left:
        word += Taken.Y_CHANGED
    if no_room(scene):
        word += Taken.ROWS_FULL
    if scene.log.counters[LISTINGS] > listings:
        # pairs that were not near, and so not counted, are now
        word += Taken.STABLE_IS_STALE
    if changed == CONSTRAINTS_CHANGED or passed != passes:
        word += Taken.BEGIN_ANEW
    code = failure_or(scene, 0)
    return word if code == 0 else -code


def _look(context: int, t: float, h: float, a: Pointer, b: Pointer) -> int:
    """Peaks at an inner point of a step."""
    scene = view(context, Scene)
    n = scene.rows.y.shape[1]
    code = evaluate_past(scene, t, h, vector_at(a, n), vector_at(b, n))
    if code == 0 and scene.world.hooks[Hook.CONTACTS] != 0:
        contacts = scene.world.hooks[Hook.CONTACTS]
        answer_of(scene, call_int(contacts, (scene, Contacts.LOOK, t, h, a, a)))
    if scene.world.hooks[Hook.DRY] != 0:
        answer_of(scene, call_int(scene.world.hooks[Hook.DRY], (scene, Dry.RESTICK, t, a)))
    return failure_or(scene, code)


def _inner(context: int, t: float, h: float, a: Pointer, b: Pointer) -> float:
    """Where in the step a contact may do most."""
    scene, tol = view(context, Scene), vector_at(b, 1)[0]
    return first_look(scene, h, tol) if h > 0.0 else next_look(scene, tol)


def _limit(context: int, t: float, h: float, a: Pointer, b: Pointer) -> float:
    """The step that lets nothing pass through anything."""
    scene = view(context, Scene)
    if scene.world.hooks[Hook.GAUGES] != 0:
        longest = call_float(scene.world.hooks[Hook.GAUGES], (scene, Gauges.STEP, t, h, a, b))
    else:
        longest = h
    halt = scene.sweep.quality[FOLD_HALT]
    return halt - t if 0.0 < halt - t < abs(longest) else longest


def _output(context: int, t: float, h: float, a: Pointer, b: Pointer) -> int:
    """A row of results at an interpolated, projected state."""
    scene = view(context, Scene)
    n = scene.rows.y.shape[1]
    f = vector_at(b, n)
    # a row has what sleeps too
    whole = scene.awake.whole[GOES]
    scene.awake.whole[GOES] = WHOLE
    code = evaluate_past(scene, t, h, vector_at(a, n), f)
    full = write_row(scene, t, h, vector_at(a, n), f) if code == 0 else False
    scene.awake.whole[GOES] = whole
    if code != 0:
        return -failure_or(scene, code)
    if scene.world.hooks[Hook.DRY] != 0:
        answer_of(scene, call_int(scene.world.hooks[Hook.DRY], (scene, Dry.RESTICK, t, a)))
    code = failure_or(scene, 0)
    if code != 0:
        return -code
    return FULL if full else 0


def _reject(context: int, t: float, h: float, a: Pointer, b: Pointer) -> int:
    """Count a rejected step by reason and contact."""
    scene = view(context, Scene)
    reason = int(h)
    contact = scene.work.diagnostics[AT_FAULT] if reason == BY_CHECK else -1
    if reason != BY_CHECK and scene.world.hooks[Hook.CONTACTS] != 0:
        contacts = scene.world.hooks[Hook.CONTACTS]
        contact = answer_of(scene, call_int(contacts, (scene, Contacts.AT_FAULT, t, h, a, a))) - 1
    row = contact if contact >= 0 else len(scene.contacts.id)
    scene.work.diagnostics[AT_FAULT] = contact
    scene.log.rejections[row, reason] += 1
    return failure_or(scene, 0)


def stable(context: int, t: float, h: float, a: Pointer, b: Pointer) -> float:
    """The step for a method without error estimate, h being the tolerance."""
    scene = view(context, Scene)
    n = scene.rows.y.shape[1]
    return stable_step(scene, h, vector_at(a, n), vector_at(b, n))


def retract(context: int, t: float, h: float, a: Pointer, b: Pointer) -> int:
    """Positions moved on by velocities."""
    scene = view(context, Scene)
    n = scene.rows.y.shape[1]
    move_on(vector_at(a, n), h, len(scene.bodies.mass), vector_at(b, n))
    return 0


def difference(context: int, t: float, h: float, a: Pointer, b: Pointer) -> int:
    """Changes of positions as velocities, and what turns add to them."""
    scene = view(context, Scene)
    n = scene.rows.y.shape[1]
    return differ(vector_at(a, n), t, len(scene.bodies.mass), h, vector_at(b, n))


def list_near(context: int, y: Pointer) -> int:
    """The lists of near pairs; behind an address so that small scenes need not compile it."""
    scene = view(context, Scene)
    follow(scene, vector_at(y, scene.rows.y.shape[1]))
    return 0


#: By their names in `Problem`.
HOOKS = {
    "rhs": rhs,
    "project": _project,
    "norm": _norm,
    "commit": _commit,
    "limit": _limit,
    "output": _output,
    "reject": _reject,
}
#: Of a scene with contacts.
CONTACT_HOOKS = {"check": _check, "inner": _inner, "look": _look}
#: Of a method without error estimate.
FIXED_STEP_HOOKS = {"stable": stable, "retract": retract}
