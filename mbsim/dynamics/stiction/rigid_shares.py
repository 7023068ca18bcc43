"""How the forces of rigid stiction share the load of contacts that hold together."""

from __future__ import annotations

import math

from mbsim.arrays.codes import CONE_ROWS
from mbsim.arrays.scene import Scene
from mbsim.core.arrays import F1
from mbsim.core.jitable import jitable
from mbsim.core.rotation import add, cross, scale, vector
from mbsim.dynamics.constraints.equations import add_wrench, along, fill_equation
from mbsim.dynamics.constraints.in_use import active_count
from mbsim.dynamics.constraints.selection import sticks
from mbsim.dynamics.constraints.tree import respond
from mbsim.dynamics.contact.forces import FORCE, HELD_AT_LEAST, NORMAL, contact_of
from mbsim.dynamics.contact.memory import least_limit
from mbsim.dynamics.stiction.cones import CAPACITY, LOAD, SHARED, part_at_most, solve_cones
from mbsim.dynamics.stiction.cones import FORCE as HELD_BY
from mbsim.geometry.catalog import AT_NORMAL
from mbsim.laws.friction.stiction import MU_STATIC

# last rows of `Sweep.cone`, by slots that stick: what they hold and rub with, and their equation
STATIC, SLIDING, WHICH = range(CONE_ROWS - 3, CONE_ROWS)


@jitable
def first_of_slots(scene: Scene) -> int:
    """Return the first equation of slots: they are the last."""
    return len(scene.equations.slot) - len(scene.sweep.share)


@jitable
def fill_slip(scene: Scene, t: float, y: F1, e: int, first: int, row: F1) -> float:
    """Fill row e of S of `stiction.cones`, from the equation in use `first` on.

    Of A = L L' of the equations in use and b how they act on e, it is the end of L^-1 b. Returns
    what is left of e, of a slip that they do not imply. p is lost.
    """
    sweep, active = scene.sweep, scene.equations.active
    nt, n, z = len(scene.tree.body), active_count(scene), scene.sweep.rhs
    fill_equation(scene, t, y, e)
    for k in range(nt):
        for i in range(6):
            sweep.p[k, i] = 0.0
    add_wrench(scene, e, 1.0)
    respond(scene, 0, nt, 0, sweep.answer)
    left = along(scene, e, sweep.answer, -1)
    for i in range(n):
        total = along(scene, active[i], sweep.answer, -1)
        for k in range(sweep.skyline[i], i):
            total -= sweep.A[i, k] * z[k]
        z[i] = total / sweep.A[i, i]
        left -= z[i] * z[i]
    for k in range(first, n):
        row[k - first] = z[k]
    return left


@jitable
def fill_load(scene: Scene, first: int, m: F1) -> None:
    """Fill what is held of m of `stiction.cones`: L' times the multipliers."""
    sweep, n = scene.sweep, active_count(scene)
    for k in range(first, n):
        m[k - first] = 0.0
        for j in range(k, n):
            # a multiplier of a pivot that is infinite is none
            if sweep.skyline[j] <= k and sweep.multiplier[j] != 0.0:
                m[k - first] += sweep.A[j, k] * sweep.multiplier[j]


@jitable
def capacity(scene: Scene, s: int) -> float:
    """Return what slot s holds at most."""
    mu = scene.contacts.friction_par[contact_of(scene, s), MU_STATIC]
    return mu * max(0.0, scene.work.slot[s, NORMAL]) if scene.work.touching[s] == 1 else 0.0


@jitable
def most_capacity(scene: Scene) -> float:
    """Return what the slot that sticks best holds at most."""
    slot, most = scene.equations.slot, 0.0
    for e in range(first_of_slots(scene), len(slot), 2):
        if sticks(scene, e):
            most = max(most, capacity(scene, slot[e]))
    return most


@jitable
def fill_least_limits(scene: Scene) -> None:
    """Write what every touching slot of rigid friction is taken to hold at least."""
    hit, most = scene.work.hit, 0.0
    for k in range(hit[len(hit) - 1]):
        if scene.contacts.rigid[contact_of(scene, hit[k])] == 1:
            most = max(most, capacity(scene, hit[k]))
    for k in range(hit[len(hit) - 1]):
        s = hit[k]
        if scene.contacts.rigid[contact_of(scene, s)] == 1:
            scene.work.slot[s, HELD_AT_LEAST] = least_limit(scene, s, most)


@jitable
def fill_cones(scene: Scene, t: float, y: F1, most: float) -> tuple[int, int]:
    """Fill limits, slips and load of all slots that stick; return rows and equations in use.

    p and multipliers stay.
    """
    sweep, slot, active = scene.sweep, scene.equations.slot, scene.equations.active
    first, begin, count, n = first_of_slots(scene), 0, 0, active_count(scene)
    while begin < n and active[begin] < first:
        begin += 1
    fill_load(scene, begin, sweep.cone[LOAD])
    for k in range(len(sweep.p)):
        for i in range(6):
            sweep.kept_p[k, i] = sweep.p[k, i]
    for e in range(first, len(slot), 2):
        if sticks(scene, e):
            s = slot[e]
            sweep.cone[WHICH, count // 2] = e
            sweep.cone[CAPACITY, count // 2] = max(capacity(scene, s), least_limit(scene, s, most))
            fill_slip(scene, t, y, e, begin, sweep.share[count])
            fill_slip(scene, t, y, e + 1, begin, sweep.share[count + 1])
            count += 2
    for k in range(len(sweep.p)):
        for i in range(6):
            sweep.p[k, i] = sweep.kept_p[k, i]
    return count, n - begin


@jitable
def is_loaded(scene: Scene, r: int) -> bool:
    """Return whether anything is to be held."""
    for k in range(r):
        if scene.sweep.cone[LOAD, k] != 0.0:
            return True
    return False


@jitable
def spread(scene: Scene, t: float, y: F1, most: float) -> None:
    """Share what is held out over all slots that stick, in `Work.sticking_force`."""
    sweep, slot = scene.sweep, scene.equations.slot
    count, r = fill_cones(scene, t, y, most)
    if not is_loaded(scene, r):
        return
    level, _ = solve_cones(sweep.share, count, r, sweep.cone, sweep.mix, SHARED)
    for k in range(count):
        s = slot[int(sweep.cone[WHICH, k // 2])]
        scene.work.sticking_force[s, k % 2] = sweep.cone[HELD_BY, k] / level


@jitable
def sticking_part(scene: Scene) -> float:
    """Return the largest force that holds a slot over what holds at most: above 1 some must slip.

    What presses next to nothing has no limit of its own.
    """
    slot, part, most = scene.equations.slot, 0.0, most_capacity(scene)
    for e in range(first_of_slots(scene), len(slot), 2):
        if not sticks(scene, e):
            continue
        along = scene.work.sticking_force[slot[e]]
        able = max(capacity(scene, slot[e]), least_limit(scene, slot[e], most))
        force = math.hypot(along[0], along[1])
        if able > 0.0:
            part = max(part, force / able)
        elif force > 0.0:
            return math.inf
    return part


@jitable
def take_multipliers(scene: Scene) -> int:
    """Fill what holds each slot by the equations in use alone; return how many others stick."""
    force, active, first = scene.work.sticking_force, scene.equations.active, first_of_slots(scene)
    slot, count = scene.equations.slot, 0
    for e in range(first, len(slot), 2):
        force[slot[e], 0] = force[slot[e], 1] = 0.0
        count += 2 if sticks(scene, e) else 0
    if count == 0:
        return 0
    for r in range(active_count(scene)):
        if active[r] >= first:
            force[slot[active[r]], (active[r] - first) % 2] = scene.sweep.multiplier[r]
            count -= 1
    return count


@jitable
def part_at_most_of(scene: Scene, t: float, y: F1) -> float:
    """Return what `sticking_part` is at most, at less cost; what holds each slot is lost."""
    sweep, count, most = scene.sweep, take_multipliers(scene), most_capacity(scene)
    if count == 0 or most == 0.0:
        return sticking_part(scene)
    count, r = fill_cones(scene, t, y, most)
    if not is_loaded(scene, r):
        return sticking_part(scene)
    return part_at_most(sweep.share, count, r, sweep.cone, sweep.mix)


@jitable
def share_sticking(scene: Scene, t: float, y: F1) -> None:
    """Fill what holds each slot that sticks at the point evaluated last, and what it shows."""
    first, slot = first_of_slots(scene), scene.equations.slot
    count, most = take_multipliers(scene), most_capacity(scene)
    if count > 0 and most > 0.0:
        spread(scene, t, y, most)
    for e in range(first, len(slot), 2):
        if sticks(scene, e) and scene.work.touching[slot[e]] == 1:
            show_sticking(scene, slot[e])


@jitable
def show_sticking(scene: Scene, s: int) -> None:
    """Write the force on slot s with what holds it."""
    row, sticking = scene.work.slot[s], scene.work.sticking_force[s]
    point = scene.work.points[s]
    n, tx = vector(point[AT_NORMAL:]), vector(scene.work.t[s])
    tangential = add(scale(sticking[0], tx), scale(sticking[1], cross(n, tx)))
    force = add(scale(row[NORMAL], n), tangential)
    for k in range(3):
        row[FORCE + k] = force[k]
