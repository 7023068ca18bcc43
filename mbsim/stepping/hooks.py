"""The hooks of a mechanism that steps with contacts of its own, given one packed `Scene`."""

from __future__ import annotations

import math

from mbsim.arrays.codes import AIMED_AT, AT_FAULT, AUDIT_TOL, LEFT_OPEN, LISTINGS, OPEN_AT
from mbsim.arrays.hooks import Contacts, Hook, Joints, failure_or
from mbsim.arrays.scene import Scene
from mbsim.core.address import call_int, vector_at, view
from mbsim.core.arrays import F1, Pointer
from mbsim.core.codes import Code
from mbsim.core.jitable import jitable
from mbsim.core.problem import YIELDS, Taken
from mbsim.dynamics.bodies.kinematics import place_bodies, place_graphics
from mbsim.dynamics.bodies.scales import take_speeds
from mbsim.dynamics.contact.detection import find_contacts
from mbsim.dynamics.pipeline.hooks import accept, normalise_quaternions
from mbsim.dynamics.pipeline.output import no_room, scaled_error
from mbsim.stepping.arrays import ALL_STEPS, FIXED, HIT, Stepping
from mbsim.stepping.audit import examine_step, mark_grounded
from mbsim.stepping.awake import list_awake, settle
from mbsim.stepping.displacements import place_within
from mbsim.stepping.forces import bring_onto_joints, bring_to_end
from mbsim.stepping.friction import keep_yield, part_to_yield
from mbsim.stepping.halves import take_fixed_step
from mbsim.stepping.pairs import commit_distances
from mbsim.stepping.rows import (
    add_lost,
    fill_contacts,
    fill_incidents,
    hardest,
    keep_step,
    push_as_kept,
    watch_peaks,
)
from mbsim.stepping.sleep import let_sleep, wake_all
from mbsim.stepping.step import take_step, want_room

#: How often a step of the deck's length is taken anew, each time with near pairs farther off.
MOST_TRIES = 4
#: How often joints are closed again, each time by some rounds of Newton's method, and how far they
#: may be open then, over tol: the audit warns from there on.
MOST_CLOSES, OPEN = 16, 10.0


@jitable
def push(scene: Scene, S: Stepping, h: float, y: F1) -> int:
    """Add what contacts did in the last step; before the first one find what overlaps.

    Return 0 or a code.
    """
    push_as_kept(scene, S, y)
    if h > 0.0 or S.tally.count[ALL_STEPS] > 0:
        return 0
    code = find_contacts(scene, y)
    hit = scene.work.hit
    hit[len(hit) - 1] = 0
    return code


def serve_contacts(context: int, what: int, t: float, h: float, a: Pointer, b: Pointer) -> int:
    """What contacts are asked for; `a` is y, `b` is y' of PUSH, a row of energies of ENERGY."""
    scene = view(context, Scene)
    S = view(scene.world.hooks[Hook.STEPPING], Stepping)
    y = vector_at(a, scene.rows.y.shape[1])
    if what == Contacts.PUSH:
        return -push(scene, S, h, y)
    if what == Contacts.KEEP:
        keep_step(scene, S, t, h)
        place_bodies(scene, y)
        place_graphics(scene, y)
    elif what == Contacts.INCIDENTS:
        return fill_incidents(scene, S)
    elif what == Contacts.HARDEST:
        return hardest(scene, S)
    elif what == Contacts.WATCH:
        watch_peaks(scene, S, t)
    elif what == Contacts.GAPS:
        commit_distances(scene, S)
    elif what == Contacts.TOUCHED:
        mark_grounded(scene, S)
    elif what == Contacts.ENERGY:
        add_lost(scene, y, vector_at(b, scene.rows.energy.shape[1]))
    elif what == Contacts.ROW:
        fill_contacts(scene, S, y, scene.rows.contact[scene.rows.used[0]])
    return 0


def step(context: int, t: float, h: float, a: Pointer, b: Pointer) -> int:
    """The state a step later; t is the step's begin, h < 0 where it is not the committed one.

    Less than 0 where velocities jump in it. With h = 0 the state at the part t of the last one.
    """
    scene = view(context, Scene)
    S = view(scene.world.hooks[Hook.STEPPING], Stepping)
    n = scene.rows.y.shape[1]
    length, committed = abs(h), h > 0.0
    y, new = vector_at(a, n), vector_at(b, n)
    if h == 0.0:
        place_within(scene, S, y, t, new)
        return 0
    if committed:
        list_awake(scene, S, y)
    if S.plan.number[FIXED] == 1.0:
        code, tries = take_fixed_step(scene, S, t, length, y, new), 0
        while code == Code.TOO_FAR and tries < MOST_TRIES:
            # no shorter step will be tried: what impulses threw is looked for farther off
            want_room(scene)
            code, tries = take_fixed_step(scene, S, t, length, y, new), tries + 1
    else:
        code = take_step(scene, S, t, length, y, new, committed)
    code = failure_or(scene, code)
    if code == Code.TOO_FAR:
        want_room(scene)
    return -1 if code == 0 and S.tally.number[HIT] == 1.0 else code


def norm(context: int, t: float, h: float, a: Pointer, b: Pointer) -> float:
    """The scaled error of positions; none where steps are as long as the deck says.

    With h = YIELDS the part of the step t at which friction yields.
    """
    scene = view(context, Scene)
    S = view(scene.world.hooks[Hook.STEPPING], Stepping)
    if S.plan.number[FIXED] == 1.0:
        return 0.0
    if h == YIELDS:
        # what an impact does to friction is no growing load
        return part_to_yield(S, t) if S.tally.number[HIT] == 0.0 else 1.0
    n = scene.rows.y.shape[1]
    return scaled_error(scene, math.inf if h > 0.0 else h, vector_at(a, n), vector_at(b, n))


def commit(context: int, t: float, h: float, a: Pointer, b: Pointer) -> int:
    """What a step that is taken leaves: contact points, events, peaks, what it is judged by."""
    scene = view(context, Scene)
    S = view(scene.world.hooks[Hook.STEPPING], Stepping)
    listings = scene.log.counters[LISTINGS]
    if scene.world.hooks[Hook.JOINTS] != 0:
        code = call_int(scene.world.hooks[Hook.JOINTS], (scene, Joints.RENEW, t, a, a))
        if code != 0:
            return -failure_or(scene, code)
    y = vector_at(a, scene.rows.y.shape[1])
    take_speeds(scene, y, scene.state.fastest)
    scene.sweep.aimed[AIMED_AT] = math.nan
    accept(scene, t, h, y)
    if h > 0.0 and S.plan.number[FIXED] == 0.0:
        keep_yield(S, h)
    if h > 0.0:
        let_sleep(scene, S, t, h, y)
    else:
        wake_all(scene, S)
    examine_step(scene, S, t, h, y)
    settle(scene, S)
    word = 0
    if no_room(scene):
        word += Taken.ROWS_FULL
    if scene.log.counters[LISTINGS] > listings:
        word += Taken.STABLE_IS_STALE
    code = failure_or(scene, 0)
    return word if code == 0 else -code


@jitable
def close_or_end(scene: Scene, t: float, y: F1) -> int:
    """Bring y onto joints until they are closed; return 0, or what ends the run where none can.

    Where the deck fixes the step no shorter one is tried, and a motion beyond what a mechanism can
    reach leaves its joints open by any length.
    """
    quality, allowed = scene.sweep.quality, OPEN * scene.audit.plan[AUDIT_TOL]
    for _ in range(MOST_CLOSES):
        if quality[LEFT_OPEN] <= allowed:
            return 0
        code = bring_to_end(scene, t, y)
        if code != 0:
            return code
    if quality[LEFT_OPEN] <= allowed:
        return 0
    scene.work.diagnostics[AT_FAULT] = quality[OPEN_AT]
    return Code.CONTRADICTION


def project(context: int, t: float, h: float, a: Pointer, b: Pointer) -> int:
    """Quaternions back to unit length, and bodies onto their constraints by the least change.

    With h = 0, at a row within a step, motions do no work by that.
    """
    scene = view(context, Scene)
    y = vector_at(a, scene.rows.y.shape[1])
    normalise_quaternions(scene, y)
    if scene.world.hooks[Hook.JOINTS] == 0:
        return 0
    code = bring_to_end(scene, t, y) if h > 0.0 else bring_onto_joints(scene, t, y)
    S = view(scene.world.hooks[Hook.STEPPING], Stepping)
    if code == 0 and h > 0.0 and S.plan.number[FIXED] == 1.0:
        code = close_or_end(scene, t, y)
    return failure_or(scene, code)


#: By their names in `Problem`, in place of those of compliant contact.
HOOKS = {"step": step, "norm": norm, "commit": commit, "project": project}
