"""STICTION of contacts without give: what sticks is held by two equations of velocities a slot.

As `dynamics.rigid_friction`, which takes equations into use and out of it, and keeps what it does
for contacts here, behind one door. The equations are those of `equations.touching_term`; how the
contact point and its normal move is found by differences of the closed form along the velocities
of both bodies. Where equations follow from others (four points of a block) multipliers are not
known point by point: those are taken whose sum of f^2/(mu_s N)^2 over all points is least, so that
a block that is pushed begins to slip at all points together.

What a slot keeps is in `State.memory`, see `laws.friction.stiction.rigid`.
"""

from __future__ import annotations

import math

from mbsim.core.address import call_float, call_int
from mbsim.core.jitable import jitable
from mbsim.core.rotation import add, cross, dot, norm, scale, sub, vector
from mbsim.dynamics.choice import sticks
from mbsim.dynamics.contact import FORCE, NORMAL, contact_of, sides, tangent, velocity_at
from mbsim.dynamics.dry_friction import AT_REST, ROUNDING
from mbsim.dynamics.equations import (
    GAMMA,
    active_count,
    add_wrench,
    along,
    along_motion,
    fill_equation,
    is_active,
    solve_matrix,
)
from mbsim.dynamics.incidents import record_event
from mbsim.dynamics.kinematics import place_body, place_graphic
from mbsim.dynamics.tree import respond
from mbsim.laws.catalog import BEGUN, SLIP, STICK
from mbsim.laws.friction.stiction import KEPT_MODE, KEPT_SPEED, KEPT_X, KEPT_Y
from mbsim.system.arrays import (
    AIM_HELD,
    ASK_HELD,
    BEGIN_HELD,
    BODY_SIZE,
    CHANGED_HELD,
    EVALUATE_DOOR,
    HOT,
    LOAD_HELD,
    PLACE_HELD,
    RECORD_HELD,
    RELEASE_HELD,
    SHARE_HELD,
)
from mbsim.system.arrays import SLIP as SLIP_EVENT
from mbsim.system.arrays import STICK as STICK_EVENT

#: Half of the time over which rates of a contact's place are found, over that in which the model's
#: speed goes its length: truncation and rounding are about as large.
MOMENT = 1e-5
#: What of a second difference, over the model's length, is no jump of the point from one place to
#: another.
SMOOTH = 1e-8
#: Directions of slip that begins are good to so much, or are not sought any longer: the first step
#: finds the rest.
AIMED, MOST_TURNS = 1e-4, 50


@jitable
def move_on(scene, y, b, time):
    """Let body b go on for a time as it moves."""
    if b == len(scene.bodies.mass):
        return
    at, half = BODY_SIZE * b, 0.5 * time
    w, x, yy, z = y[at + 3], y[at + 4], y[at + 5], y[at + 6]
    a, c, d = y[at + 10], y[at + 11], y[at + 12]
    for k in range(3):
        y[at + k] += time * y[at + 7 + k]
    y[at + 3] += half * (-x * a - yy * c - z * d)
    y[at + 4] += half * (w * a + yy * d - z * c)
    y[at + 5] += half * (w * c + z * a - x * d)
    y[at + 6] += half * (w * d + x * c - yy * a)
    place_body(scene, y, b)


@jitable
def pose(scene, y, b):
    """Return position and quaternion of body b; anything for ground."""
    at = BODY_SIZE * b if b < len(scene.bodies.mass) else 0
    return (y[at], y[at + 1], y[at + 2], y[at + 3], y[at + 4], y[at + 5], y[at + 6])


@jitable
def put_pose(scene, y, b, kept):
    """Put body b back to a pose."""
    if b == len(scene.bodies.mass):
        return
    for k in range(7):
        y[BODY_SIZE * b + k] = kept[k]
    place_body(scene, y, b)


@jitable
def look(scene, y, pair, row):
    """Fill a row of `Work.look` with the candidates of a pair."""
    pairs, kinds, graphics, work = scene.pairs, scene.kinds, scene.graphics, scene.work
    kind, i, j = pairs.kind[pair], pairs.graphic_i[pair], pairs.graphic_j[pair]
    for g in (i, j):
        if graphics.body[g] < len(scene.bodies.mass):
            place_graphic(scene, y, g)
    points = work.look[row]
    frames, size = work.frames, graphics.size
    call_int(kinds.kernel[kind], (frames[i], size[i], frames[j], size[j], points))
    if kinds.swapped[kind] == 1:
        for s in range(kinds.slots[kind]):
            for k in range(4, 7):
                points[s, k] = -points[s, k]


@jitable
def look_around(scene, y, pair, moment):
    """Fill all rows of `Work.look`: now, a moment later, a moment before."""
    graphics, pairs = scene.graphics, scene.pairs
    bi = graphics.body[pairs.graphic_i[pair]]
    bj = graphics.body[pairs.graphic_j[pair]]
    kept_i, kept_j = pose(scene, y, bi), pose(scene, y, bj)
    for row in range(3):
        # the last as it is
        time = moment if row == 0 else -moment
        if row < 2:
            move_on(scene, y, bi, time)
            move_on(scene, y, bj, time)
        look(scene, y, pair, (row + 1) % 3)
        put_pose(scene, y, bi, kept_i)
        put_pose(scene, y, bj, kept_j)


@jitable
def fill_hold(scene, y, s, moment):
    """Fill the row of `Work.hold` of slot s, whose pair has been looked at."""
    points, row = scene.work.look, scene.work.hold[s]
    k = s - scene.pairs.slot[scene.slots.pair[s]]
    now, later, before = points[0, k], points[1, k], points[2, k]
    ahead = sub(vector(later[1:4]), vector(now[1:4]))
    back = sub(vector(now[1:4]), vector(before[1:4]))
    jump, way = norm(sub(ahead, back)), norm(add(ahead, back))
    first, last, time = 2, 1, 2.0 * moment
    if jump > 0.1 * way + SMOOTH * scene.world.scale[0]:
        # the shapes touch at another corner: the side on which they do not
        if norm(ahead) < norm(back):
            first, time = 0, moment
        else:
            last, time = 0, moment
    n = vector(now[4:7])
    gi, gj = sides(scene, s)
    bi, bj = scene.graphics.body[gi], scene.graphics.body[gj]
    t = tangent(scene, y, s, contact_of(scene, s), gi, bi, bj, n)
    for i in range(3):
        row[i], row[3 + i], row[6 + i] = now[1 + i], n[i], t[i]
        row[9 + i] = (points[last, k, 1 + i] - points[first, k, 1 + i]) / time
        row[12 + i] = (points[last, k, 4 + i] - points[first, k, 4 + i]) / time


@jitable
def place_held(scene, y):
    """Find where the slots that stick are at y, and how that changes; bodies have been placed."""
    slot, last = scene.equations.slot, -1
    moment = MOMENT * scene.world.scale[0] / scene.world.scale[1]
    for e in range(first_of_slots(scene), len(slot), 2):
        if not sticks(scene, e):
            continue
        pair = scene.slots.pair[slot[e]]
        if pair != last:
            look_around(scene, y, pair, moment)
            last = pair
        fill_hold(scene, y, slot[e], moment)


@jitable
def first_of_slots(scene):
    """Return the first equation of slots: they are the last."""
    return len(scene.equations.slot) - len(scene.sweep.share)


@jitable
def self_stress(scene, t, y, e, row):
    """Fill a row of `Sweep.share`: a unit multiplier of equation e and what that asks of others.

    Multipliers and p are lost.
    """
    sweep, active, first = scene.sweep, scene.equations.active, first_of_slots(scene)
    nt, n = len(scene.tree.body), active_count(scene)
    fill_equation(scene, t, y, e)
    for k in range(nt):
        for i in range(6):
            sweep.p[k, i] = 0.0
    add_wrench(scene, e, 1.0)
    respond(scene, 0, nt, 0, sweep.answer)
    for r in range(n):
        sweep.rhs[r] = -along(scene, active[r], sweep.answer, -1)
    solve_matrix(scene)
    for k in range(len(row)):
        row[k] = 0.0
    row[e - first] = 1.0
    for r in range(n):
        if active[r] >= first:
            row[active[r] - first] = sweep.multiplier[r]


@jitable
def capacity(scene, s):
    """Return what slot s holds at most."""
    held = scene.contacts.friction_par[contact_of(scene, s), 0]
    return held * max(0.0, scene.work.slot[s, NORMAL]) if scene.work.touching[s] == 1 else 0.0


@jitable
def weight(scene, k, most):
    """Return how dear a force of the k-th equation of slots is: 1/(mu_s N)^2."""
    s = scene.equations.slot[first_of_slots(scene) + k]
    return (most / max(capacity(scene, s), 1e-9 * most)) ** 2


@jitable
def fill_mix(scene, count, most):
    """Fill the normal equations of how `count` self-stresses make the forces least."""
    share, mix, held, first = scene.sweep.share, scene.sweep.mix, scene.work.held, 0
    first = first_of_slots(scene)
    for a in range(count):
        for b in range(count + 1):
            total = 0.0
            for k in range(len(share)):
                if share[a, k] == 0.0:
                    continue
                other = share[b, k] if b < count else -held[scene.equations.slot[first + k], k % 2]
                total += share[a, k] * weight(scene, k, most) * other
            mix[a, b if b < count else len(share)] = total


@jitable
def solve_mix(scene, count):
    """Replace the last column of `Sweep.mix` by the solution; the matrix is positive."""
    mix, last = scene.sweep.mix, len(scene.sweep.share)
    for a in range(count):
        for b in range(a + 1, count):
            part = mix[b, a] / mix[a, a]
            for k in range(a, count):
                mix[b, k] -= part * mix[a, k]
            mix[b, last] -= part * mix[a, last]
    for a in range(count - 1, -1, -1):
        for b in range(a + 1, count):
            mix[a, last] -= mix[a, b] * mix[b, last]
        mix[a, last] /= mix[a, a]


@jitable
def spread(scene, t, y):
    """Share multipliers in `Work.held` out over all slots that stick."""
    sweep, held, first = scene.sweep, scene.work.held, first_of_slots(scene)
    slot, count, most = scene.equations.slot, 0, 0.0
    for e in range(first, len(slot), 2):
        if sticks(scene, e):
            most = max(most, capacity(scene, slot[e]))
    if most == 0.0:
        return
    for k in range(len(sweep.p)):
        for i in range(6):
            sweep.kept_p[k, i] = sweep.p[k, i]
    for r in range(active_count(scene)):
        sweep.kept[r] = sweep.multiplier[r]
    for e in range(first, len(slot)):
        if sticks(scene, e) and not is_active(scene, e):
            self_stress(scene, t, y, e, sweep.share[count])
            count += 1
    if count > 0:
        fill_mix(scene, count, most)
        solve_mix(scene, count)
    for a in range(count):
        part = sweep.mix[a, len(sweep.share)]
        for k in range(len(sweep.share)):
            held[slot[first + k], k % 2] += part * sweep.share[a, k]
    for k in range(len(sweep.p)):
        for i in range(6):
            sweep.p[k, i] = sweep.kept_p[k, i]
    for r in range(active_count(scene)):
        sweep.multiplier[r] = sweep.kept[r]


@jitable
def share_held(scene, t, y):
    """Fill what holds each slot that sticks at the point evaluated last, and what it shows."""
    held, active, first = scene.work.held, scene.equations.active, first_of_slots(scene)
    slot, count = scene.equations.slot, 0
    for e in range(first, len(slot), 2):
        held[slot[e], 0] = held[slot[e], 1] = 0.0
        count += 2 if sticks(scene, e) else 0
    if count == 0:
        return
    for r in range(active_count(scene)):
        if active[r] >= first:
            held[slot[active[r]], (active[r] - first) % 2] = scene.sweep.multiplier[r]
            count -= 1
    if count > 0:
        spread(scene, t, y)
    for e in range(first, len(slot), 2):
        if sticks(scene, e) and scene.work.touching[slot[e]] == 1:
            show_held(scene, slot[e])


@jitable
def show_held(scene, s):
    """Write the force on slot s with what holds it."""
    row, held = scene.work.slot[s], scene.work.held[s]
    point = scene.work.points[s]
    n, tx = (point[4], point[5], point[6]), vector(scene.work.t[s])
    rubs = add(scale(held[0], tx), scale(held[1], cross(n, tx)))
    force = add(scale(row[NORMAL], n), rubs)
    for k in range(3):
        row[FORCE + k] = force[k]


@jitable
def slip_of(scene, y, s):
    """Return slip along x and y of slot s at the point evaluated last."""
    gi, gj = sides(scene, s)
    point = scene.work.points[s]
    p, n = (point[1], point[2], point[3]), (point[4], point[5], point[6])
    v = sub(
        velocity_at(scene, y, scene.graphics.body[gi], p),
        velocity_at(scene, y, scene.graphics.body[gj], p),
    )
    tx = vector(scene.work.t[s])
    return dot(v, tx), dot(v, cross(n, tx))


@jitable
def passes(scene, s):
    """Return whether slot s, which sticks, would have to hold more than it can."""
    held = scene.work.held[s]
    return math.hypot(held[0], held[1]) > capacity(scene, s)


@jitable
def onward(scene, s, v):
    """Return the part of slip along the direction in which slot s began to slip."""
    kept = scene.state.memory[s]
    size = math.hypot(kept[KEPT_X], kept[KEPT_Y])
    return (v[0] * kept[KEPT_X] + v[1] * kept[KEPT_Y]) / size


@jitable
def rest(scene):
    """Return what is no slip but rounding."""
    return ROUNDING * scene.world.scale[1]


@jitable
def ask_held(scene, y):
    """Return 1 if a slot asks for another mode than it has, at the point evaluated last, else 0."""
    slot = scene.equations.slot
    for e in range(first_of_slots(scene), len(slot), 2):
        s = slot[e]
        mode = scene.state.memory[s, KEPT_MODE]
        if scene.work.touching[s] == 0 or mode == BEGUN:
            continue
        if mode == STICK:
            if passes(scene, s):
                return 1
        elif onward(scene, s, slip_of(scene, y, s)) < -rest(scene):
            return 1
    return 0


@jitable
def load_held(scene):
    """Return the largest force that holds a slot, in millionths of what holds at most."""
    slot, most = scene.equations.slot, 0.0
    for e in range(first_of_slots(scene), len(slot), 2):
        s = slot[e]
        able = capacity(scene, s)
        if able > 0.0 and sticks(scene, e):
            held = scene.work.held[s]
            most = max(most, math.hypot(held[0], held[1]) / able)
    return int(1e6 * min(most, 1e6))


@jitable
def let_slip(scene, s, x, y, speed):
    """Let slot s slip along (x, y) from here on, at a speed."""
    kept, size = scene.state.memory[s], rest(scene) / math.hypot(x, y)
    kept[KEPT_MODE], kept[KEPT_X], kept[KEPT_Y] = SLIP, size * x, size * y
    kept[KEPT_SPEED] = speed


@jitable
def let_stick(scene, s):
    """Let slot s stick from here on."""
    scene.state.memory[s, KEPT_MODE] = STICK
    scene.state.memory[s, KEPT_SPEED] = 0.0


@jitable
def begin_slot(scene, y, s):
    """Set the mode of slot s that the point evaluated last asks for; return 1 where it turns."""
    kept, v = scene.state.memory[s], slip_of(scene, y, s)
    speed = math.hypot(v[0], v[1])
    if kept[KEPT_MODE] == STICK:
        if passes(scene, s):
            let_slip(scene, s, -scene.work.held[s, 0], -scene.work.held[s, 1], 0.0)
        return 0
    turns, rests = 0, speed <= AT_REST * rest(scene)
    if kept[KEPT_MODE] == SLIP:
        along = onward(scene, s, v)
        turns = 1 if along < -rest(scene) else 0
        # where such points are not located, it came to rest within the step
        rests = rests or (scene.state.heat[0] > HOT and -along > 0.7 * speed)
    if not rests:
        let_slip(scene, s, v[0], v[1], speed)
    elif kept[KEPT_MODE] == BEGUN or turns == 1:
        let_stick(scene, s)
    return turns


@jitable
def begin_held(scene, y):
    """Set the modes that the point evaluated last asks for; return whether equations change.

    What comes to rest is first taken to stick, then whatever else rests as well.
    """
    state, slot, first = scene.state, scene.equations.slot, first_of_slots(scene)
    changed = 0
    for e in range(first, len(slot), 2):
        if state.touching[slot[e]] == 1:
            changed = max(changed, begin_slot(scene, y, slot[e]))
        if (state.memory[slot[e], KEPT_MODE] == STICK) != was_held(scene, slot[e]):
            changed = 1
    if changed == 0:
        return 0
    for e in range(first, len(slot), 2):
        s = slot[e]
        slips = state.memory[s, KEPT_MODE] == SLIP and state.before[s, KEPT_MODE] == SLIP
        if slips and state.touching[s] == 1:
            v = slip_of(scene, y, s)
            if math.hypot(v[0], v[1]) <= AT_REST * rest(scene):
                let_stick(scene, s)
    return 1


@jitable
def was_held(scene, s):
    """Return whether slot s has been held so far."""
    return scene.state.before[s, KEPT_MODE] == STICK


@jitable
def release_held(scene, t, y):
    """Let slip what sticks and would have to hold more than it can; return how many do."""
    share_held(scene, t, y)
    slot, count = scene.equations.slot, 0
    for e in range(first_of_slots(scene), len(slot), 2):
        s = slot[e]
        if scene.state.memory[s, KEPT_MODE] == STICK and passes(scene, s):
            let_slip(scene, s, -scene.work.held[s, 0], -scene.work.held[s, 1], 0.0)
            count += 1
    return count


@jitable
def begins_to_slip(scene, y, s):
    """Return whether slot s slips from here on, from rest."""
    if scene.state.touching[s] == 0 or scene.state.memory[s, KEPT_MODE] != SLIP:
        return False
    v = slip_of(scene, y, s)
    return math.hypot(v[0], v[1]) <= AT_REST * rest(scene)


@jitable
def turn_aim(scene, t, y):
    """Turn all that begins to slip towards where it is accelerated; return by how much at most.

    By a part of the acceleration, over how fast accelerations turn with directions: with less than
    that they would run away from what is sought.
    """
    slot, first, aim = scene.equations.slot, first_of_slots(scene), scene.work.aim
    steepest, fastest, most = 0.0, 0.0, 0.0
    for e in range(first, len(slot), 2):
        row = aim[slot[e]]
        if row[0] == 0.0:
            continue
        x = along_motion(scene, e) + scene.sweep.rate[e, GAMMA]
        z = along_motion(scene, e + 1) + scene.sweep.rate[e + 1, GAMMA]
        way = math.hypot(row[1] - row[3], row[2] - row[4])
        if way > 0.0:
            steepest = max(steepest, math.hypot(x - row[5], z - row[6]) / way)
        fastest = max(fastest, math.hypot(x, z))
        row[5], row[6] = x, z
    for e in range(first, len(slot), 2):
        row = aim[slot[e]]
        if row[0] == 0.0 or fastest == 0.0:
            continue
        part = 1.0 / (steepest + fastest)
        x, z = row[1] + part * row[5], row[2] + part * row[6]
        size = math.hypot(x, z)
        row[3], row[4] = row[1], row[2]
        if size > 0.0:
            row[1], row[2] = x / size, z / size
            let_slip(scene, slot[e], x, z, 0.0)
        most = max(most, math.hypot(row[1] - row[3], row[2] - row[4]))
    return most


@jitable
def aim_held(scene, t, y):
    """Let what begins to slip do so where friction lets it go, not against what held it.

    The two differ where a force at a point does not accelerate it along itself. Directions are
    sought for which friction against them leaves accelerations along them.
    """
    slot, first, aim, count = scene.equations.slot, first_of_slots(scene), scene.work.aim, 0
    moment = MOMENT * scene.world.scale[0] / scene.world.scale[1]
    for e in range(first, len(slot), 2):
        s = slot[e]
        row, kept = aim[s], scene.state.memory[s]
        row[0] = 1.0 if begins_to_slip(scene, y, s) else 0.0
        if row[0] == 0.0:
            continue
        count += 1
        look_around(scene, y, scene.slots.pair[s], moment)
        fill_hold(scene, y, s, moment)
        fill_equation(scene, t, y, e)
        fill_equation(scene, t, y, e + 1)
        size = math.hypot(kept[KEPT_X], kept[KEPT_Y])
        row[1] = row[3] = kept[KEPT_X] / size
        row[2] = row[4] = kept[KEPT_Y] / size
        row[5] = row[6] = 0.0
    for _ in range(MOST_TURNS if count > 0 else 0):
        turned = turn_aim(scene, t, y)
        door = scene.world.doors[EVALUATE_DOOR]
        if call_float(door, (scene, t, 0.0, y, scene.work.idle)) != 0.0 or turned < AIMED:
            break
    if count > 0:
        share_held(scene, t, y)


@jitable
def record_held(scene, t):
    """Append events of the slots that go on otherwise than before."""
    state, slot = scene.state, scene.equations.slot
    for e in range(first_of_slots(scene), len(slot), 2):
        s = slot[e]
        kept, before = state.memory[s], state.before[s]
        if state.touching[s] == 0:
            before[KEPT_MODE] = BEGUN
            continue
        if before[KEPT_MODE] == BEGUN:
            # rows of the step in which it began show what holds from there on
            for k in range(len(before)):
                before[k] = kept[k]
        turned = kept[KEPT_X] * before[KEPT_X] + kept[KEPT_Y] * before[KEPT_Y] < 0.0
        if kept[KEPT_MODE] == STICK and before[KEPT_MODE] == SLIP:
            record_event(scene, t, STICK_EVENT, s)
        elif kept[KEPT_MODE] == SLIP and (before[KEPT_MODE] == STICK or turned):
            record_event(scene, t, SLIP_EVENT, s)
        state.mode[s] = kept[KEPT_MODE]


@jitable
def changed_held(scene):
    """Return 1 if other slots stick than in the last step, else 0."""
    state, slot = scene.state, scene.equations.slot
    for e in range(first_of_slots(scene), len(slot), 2):
        s = slot[e]
        within = was_held(scene, s) and state.touching[s] == 1
        if within != (state.memory[s, KEPT_MODE] == STICK):
            return 1
    return 0


@jitable
def serve_held(scene, what, t, y):
    """Do what is asked for at the door of rigid contacts; return an answer or 0."""
    if what == PLACE_HELD:
        place_held(scene, y)
    elif what == SHARE_HELD:
        share_held(scene, t, y)
    elif what == ASK_HELD:
        share_held(scene, t, y)
        return ask_held(scene, y)
    elif what == BEGIN_HELD:
        return begin_held(scene, y)
    elif what == RELEASE_HELD:
        return release_held(scene, t, y)
    elif what == AIM_HELD:
        aim_held(scene, t, y)
    elif what == RECORD_HELD:
        record_held(scene, t)
    elif what == CHANGED_HELD:
        return changed_held(scene)
    elif what == LOAD_HELD:
        share_held(scene, t, y)
        return load_held(scene)
    return 0
