"""The hooks of contacts: a scene that has none compiles nothing of them."""

from __future__ import annotations

from mbsim.arrays.codes import AT_FAULT, USED_ROWS
from mbsim.arrays.hooks import (
    Contacts,
    Effects,
    FclPoints,
    Gauges,
    Recall,
    Stability,
    failure_or,
    note_failure,
)
from mbsim.arrays.scene import Scene
from mbsim.core.address import vector_at, view
from mbsim.core.arrays import F1, Pointer
from mbsim.core.jitable import jitable
from mbsim.dynamics.contact.detection import another_point, bounding_gap, find_contacts
from mbsim.dynamics.contact.fixed_step import hold_back
from mbsim.dynamics.contact.forces import add_contact, contact_of
from mbsim.dynamics.contact.memory import commit_memory, keep, remember
from mbsim.dynamics.contact.peaks import watch_end, watch_inside
from mbsim.dynamics.contact.points import commit_gaps, commit_incidents, keep_slots
from mbsim.dynamics.contact.rims import ask_on_rim
from mbsim.dynamics.contact.spreading import ask_over_patch
from mbsim.dynamics.contact.tilting import damp_tilting
from mbsim.dynamics.events.contact_stability import add_all_meeting, add_all_touching
from mbsim.dynamics.events.effects import friction_left, impact_left, pressure_left
from mbsim.dynamics.events.passing import passing_time
from mbsim.dynamics.events.step_limits import longest_step
from mbsim.dynamics.pipeline.audit import (
    examine_friction,
    examine_work,
    hardest,
    mark_touched,
)
from mbsim.dynamics.pipeline.output import (
    add_stored,
    carried_square,
    fill_contacts,
    fill_incidents,
    find_fault,
)


@jitable
def push(scene: Scene, t: float, h: float, y: F1, dy: F1) -> int:
    """Find who touches whom, and add the forces of every touching slot; return 0 or a code."""
    code = find_contacts(scene, y)
    if code != 0:
        return code
    hit = scene.work.hit
    for k in range(hit[len(hit) - 1]):
        code = add_contact(scene, t, h, y, dy, hit[k])
        if code != 0:
            scene.work.diagnostics[AT_FAULT] = contact_of(scene, hit[k])
            return code
    return 0


def serve_contacts(context: int, what: int, t: float, h: float, a: Pointer, b: Pointer) -> int:
    """What contacts are asked for; `a` is y, `b` is y' of PUSH, a row of energies of ENERGY."""
    scene = view(context, Scene)
    n = scene.rows.y.shape[1]
    y = vector_at(a, n)
    if what == Contacts.PUSH:
        return -push(scene, t, h, y, vector_at(b, n))
    if what == Contacts.KEEP:
        return commit_incidents(scene, t, h, y)
    if what == Contacts.INCIDENTS:
        return fill_incidents(scene, h, y)
    if what == Contacts.HARDEST:
        return hardest(scene)
    if what == Contacts.AT_FAULT:
        return find_fault(scene) + 1
    if what == Contacts.WATCH:
        watch_end(scene, t)
    elif what == Contacts.LOOK:
        watch_inside(scene, t)
    elif what == Contacts.GAPS:
        commit_gaps(scene, y)
    elif what == Contacts.ENERGY:
        add_stored(scene, y, vector_at(b, scene.rows.energy.shape[1]))
    elif what == Contacts.ROW:
        fill_contacts(scene, y, scene.rows.contact[scene.rows.used[USED_ROWS]])
    elif what == Contacts.TOUCHED:
        mark_touched(scene)
    else:
        examine_friction(scene, t, y)
        examine_work(scene, t, y)
    return 0


def keep_slots_of(context: int, pair: int) -> int:
    """Put the incidents of a pair into the slots that they had at the committed state."""
    keep_slots(view(context, Scene), pair)
    return 0


def damp_contact(context: int, s: int, t: float, normal: float, a: Pointer) -> int:
    """What dampers of slot s do against tilting."""
    scene = view(context, Scene)
    return damp_tilting(scene, t, vector_at(a, scene.rows.y.shape[1]), s, normal)


def friction_of_patch(context: int, s: int, c: int) -> int:
    """What the friction law of contact c does all over the patch in slot s."""
    return ask_over_patch(view(context, Scene), s, c)


def friction_of_rim(context: int, s: int, c: int) -> int:
    """What the friction law of contact c does in slot s, whose pair may stand on a rim."""
    return ask_on_rim(view(context, Scene), s, c)


def recall_friction(context: int, what: int, s: int, t: float, a: Pointer, anew: int) -> int:
    """What friction with memory in slot s is asked for; `a` is y, of TAKE y'."""
    scene = view(context, Scene)
    y = vector_at(a, scene.rows.y.shape[1])
    if what == Recall.COMMIT:
        return commit_memory(scene, t, y, s, anew == 1)
    if what == Recall.GIVE:
        remember(scene, y, s)
    else:
        keep(scene, y, s)
    return 0


def hold_friction_back(context: int, s: int, h: float, u: float, v: float, a: Pointer) -> int:
    """Friction of slot s in a step of fixed length; (u, v) is its slip."""
    scene = view(context, Scene)
    hold_back(scene, vector_at(a, scene.rows.y.shape[1]), s, h, (u, v))
    return 0


def serve_fcl_points(context: int, what: int, index: int, h: float, a: Pointer) -> float:
    """What follows from points of FCL; `index` is a slot, of GAP a pair."""
    scene = view(context, Scene)
    if what == FclPoints.GAP:
        return bounding_gap(scene, index)
    moved = another_point(scene, vector_at(a, scene.rows.y.shape[1]), h, index)
    return 1.0 if moved else 0.0


def bound_passing(context: int, pair: int, asked: float, a: Pointer, b: Pointer) -> float:
    """How long a pair that touches passes no wall; `a` and `b` are y and y'."""
    scene = view(context, Scene)
    n = scene.rows.y.shape[1]
    return passing_time(scene, vector_at(a, n), vector_at(b, n), pair, asked)


def gauge_steps(context: int, what: int, t: float, h: float, a: Pointer, b: Pointer) -> float:
    """What is measured of contacts that carry nothing; `a` and `b` are y and y'."""
    scene = view(context, Scene)
    n = scene.rows.y.shape[1]
    if what != Gauges.STEP:
        return 0.0
    longest = longest_step(scene, vector_at(a, n), vector_at(b, n), h)
    failure_or(scene, 0)  # laws are explored, not asked
    return longest


def gauge_contacts(context: int, what: int, t: float, h: float, a: Pointer, b: Pointer) -> float:
    """What is measured of contacts; `a` is an error and `b` is y, of STEP they are y and y'."""
    scene = view(context, Scene)
    n = scene.rows.y.shape[1]
    if what == Gauges.ERROR:
        return carried_square(scene, vector_at(a, n))
    longest = longest_step(scene, vector_at(a, n), vector_at(b, n), h)
    failure_or(scene, 0)  # laws are explored, not asked
    return longest


def measure_effects(context: int, what: int, t: float, h: float, a: Pointer, b: Pointer) -> float:
    """What the error `a` does to contacts at y, `b`."""
    scene = view(context, Scene)
    n = scene.rows.y.shape[1]
    e, y = vector_at(a, n), vector_at(b, n)
    if what == Effects.IMPACT:
        return impact_left(scene, t, e, y)
    if what == Effects.PRESSURE:
        # laws are explored, not asked: what failed before stays
        failed = failure_or(scene, 0)
        largest = pressure_left(scene, e, y)
        failure_or(scene, 0)
        note_failure(scene, failed)
        return largest
    return friction_left(scene, e, y, what == Effects.REVERSAL)


def bound_contacts(context: int, what: int, a: Pointer, b: Pointer) -> float:
    """What contacts bound steps of fixed length by; `a` and `b` are y and y'."""
    scene = view(context, Scene)
    n = scene.rows.y.shape[1]
    longest, noted = 0.0, scene.users.failed[0]
    if what == Stability.TOUCHING:
        longest = add_all_touching(scene, vector_at(a, n), vector_at(b, n))
    else:
        add_all_meeting(scene)
    scene.users.failed[0] = noted  # laws are explored, not asked
    return longest
