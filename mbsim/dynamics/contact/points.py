"""What happens to incidents when a step is tried, accepted, and watched.

`first_depth` guards the beginning of an impact, `commit_incidents` writes the incident table after
an accepted step, `keep_slots` says which incident is which where rows are no parts of a shape.
"""

from __future__ import annotations

import math

from mbsim.arrays.codes import (
    ACTIVE,
    APPROACH,
    AT_FAULT,
    BEYOND_I,
    BEYOND_J,
    BEYOND_TIME,
    ENERGY_LOST,
    EVENT_ELEMENT,
    EVENT_KIND,
    EVENT_SLOT,
    EVENT_TIME,
    FIRST_TOUCH,
    HELD_AT_PLACES,
    LEAVE,
    NO_ROWS,
    ON_PLANE,
    REBOUND,
    SCALE_LENGTH,
    TOO_DEEP,
    TOUCH,
    TOUCHES,
    USED_EVENTS,
)
from mbsim.arrays.hooks import FclPoints, Hook, Recall, answer_of
from mbsim.arrays.scene import Scene
from mbsim.core.address import call_float, call_int
from mbsim.core.arrays import F1, F2
from mbsim.core.counting import number_of_parts
from mbsim.core.jitable import jitable
from mbsim.core.rotation import cross, dot, norm, rotate, sub, unrotate, vector
from mbsim.dynamics.bodies.kinematics import position
from mbsim.dynamics.contact.detection import measure_pair
from mbsim.dynamics.contact.forces import (
    DEPTH,
    NORMAL,
    RATE,
    STORED,
    contact_of,
    gain_of,
    sides,
    velocity_at,
)
from mbsim.geometry.catalog import AT_DEPTH, AT_NORMAL, AT_POINT, AT_WEIGHT
from mbsim.laws.abi import ELASTIC, ENERGY

#: Incidents nearer to each other than this part of half of the least width of two shapes are at the
#: same corner.
SAME_PLACE = 0.1
#: Part of the way from touch to where their middles meet at which shapes are too deep.
MIDDLE = 0.8


@jitable
def effective_mass(scene: Scene, y: F1, s: int) -> float:
    """Return the mass that meets in slot s along its normal: 1 / (n J M^-1 J' n)."""
    point = scene.work.points[s]
    p, n = vector(point[AT_POINT:]), vector(point[AT_NORMAL:])
    inverse = 0.0
    gi, gj = sides(scene, s)
    for g in (gi, gj):
        b = scene.graphics.body[g]
        if b < len(scene.bodies.mass):
            arm = unrotate(scene.work.R[b], cross(sub(p, position(scene, y, b)), n))
            inverse += 1.0 / scene.bodies.mass[b]
            inverse += dot(arm, rotate(scene.bodies.inverse[b], arm))
    return 1.0 / inverse if inverse > 0.0 else 0.0


@jitable
def deepest_of_impact(scene: Scene, c: int, energy: float) -> float:
    """Return the depth at which contact c has stored `energy`: how deep an impact goes, to 1 %.

    Newton for log E over log d, whose slope is F d / E: exact at once for a power law.
    """
    contacts, out = scene.contacts, scene.work.law_out
    if energy <= 0.0:
        return 0.0
    depth = 1e-4 * scene.world.scale[SCALE_LENGTH]
    for _ in range(50):
        call_int(contacts.normal_law[c], (depth, 0.0, contacts.normal_par[c], out))
        if out[ENERGY] <= 0.0 or not out[ELASTIC] > 0.0:
            depth *= 16.0
            continue
        ratio = energy / out[ENERGY]
        if 0.99 < ratio < 1.01:
            break
        slope = out[ENERGY] / (out[ELASTIC] * depth)
        # a linear law goes without pow, which costs more than all the rest
        change = math.sqrt(ratio) if slope == 0.5 else ratio**slope
        depth *= min(1e4, max(1e-4, change))
    return depth


@jitable
def first_depth(scene: Scene, t: float, h: float, y: F1) -> float:
    """Return 1, or the part of the step to take so that a new incident begins shallow.

    The first depth of an impact is at most max(v Tc/70, 1e-3 dmax), with v the closing speed
    and Tc the contact time: about 3 times the deepest depth over v (pi for a linear
    spring, 2.943 for Hertz).
    """
    work, state, contacts = scene.work, scene.state, scene.contacts
    part = 1.0
    hit = work.hit
    for k in range(hit[len(hit) - 1]):
        s = hit[k]
        if state.touching[s] == 1 or work.slot[s, RATE] <= 0.0:
            continue
        pair = scene.slots.pair[s]
        kind = scene.pairs.kind[pair]
        if scene.kinds.regroups[kind] == 1 and scene.pairs.touches[pair] > 0:
            # not an impact: the points of a contact that goes on were chosen anew
            continue
        c = scene.kinds.contact[kind]
        depth, speed = work.slot[s, DEPTH], work.slot[s, RATE]
        # depth and its rate are the gain times how near, and how fast, bodies get
        mass = effective_mass(scene, y, s) / (gain_of(scene, s) ** 2 * work.points[s, AT_WEIGHT])
        energy = 0.5 * mass * speed * speed
        deepest = deepest_of_impact(scene, c, energy)
        allowed = max(3.0 * deepest / 70.0, 1e-3 * contacts.dmax[c])
        if depth > allowed:
            # at this speed it was half as deep as allowed so much earlier
            earlier = (depth - 0.5 * allowed) / (speed * h)
            wanted = 1.0 - earlier if earlier < 0.98 else 0.5
            if wanted < part:
                part = wanted
                work.diagnostics[AT_FAULT] = c
    return part


@jitable
def record_event(scene: Scene, t: float, kind: int, s: int) -> None:
    """Append an event; the driver empties the table before it can overflow."""
    rows = scene.rows
    k = rows.used[USED_EVENTS]
    if k < len(rows.events):
        rows.events[k, EVENT_TIME] = t
        rows.events[k, EVENT_KIND] = kind
        rows.events[k, EVENT_ELEMENT] = scene.contacts.id[contact_of(scene, s)]
        rows.events[k, EVENT_SLOT] = s
        rows.used[USED_EVENTS] = k + 1


@jitable
def crossing(depth0: float, rate0: float, depth1: float, rate1: float, h: float) -> float:
    """Return the part of the step at which the depth crosses zero, by its Hermite cubic."""
    low, high = 0.0, 1.0
    rising = depth1 > depth0
    for _ in range(40):
        s = 0.5 * (low + high)
        h00 = (1.0 + 2.0 * s) * (1.0 - s) * (1.0 - s)
        h10 = s * (1.0 - s) * (1.0 - s)
        h01 = s * s * (3.0 - 2.0 * s)
        h11 = s * s * (s - 1.0)
        depth = h00 * depth0 + h10 * h * rate0 + h01 * depth1 + h11 * h * rate1
        if (depth > 0.0) == rising:
            high = s
        else:
            low = s
    return 0.5 * (low + high)


@jitable
def log_touch(scene: Scene, t: float, h: float, y: F1, s: int) -> None:
    """Note that slot s began to touch within the step that ends at t."""
    row, log = scene.work.slot[s], scene.log.contacts[contact_of(scene, s)]
    speed = max(row[RATE], 0.0)
    # the depth is small by the guard: the way back at closing speed, within the step
    back = min(row[DEPTH] / speed, h) if speed > 0.0 else 0.0
    if math.isnan(log[FIRST_TOUCH]):
        log[FIRST_TOUCH] = t - back
    log[TOUCHES] += 1.0
    # spring and damper have already taken some of the speed at the touch
    mass, c = effective_mass(scene, y, s), contact_of(scene, s)
    lost = y[len(y) - len(scene.contacts.id) + c] - log[ENERGY_LOST]
    taken = 2.0 * (row[STORED] + max(0.0, lost)) / mass if mass > 0.0 else 0.0
    log[APPROACH] = math.sqrt(speed * speed + taken) if h > 0.0 else 0.0
    record_event(scene, t - back, TOUCH, s)


@jitable
def log_leave(scene: Scene, t: float, h: float, y: F1, s: int) -> None:
    """Note that slot s ceased to touch within the step that ends at t."""
    state, log = scene.state, scene.log.contacts[contact_of(scene, s)]
    depth, rate = state.depth[s], state.rate[s]
    after = scene.work.points[s, AT_DEPTH]
    if after < 0.0 and after > -1e3 * depth:
        part = crossing(depth, rate, after, min(rate, (after - depth) / h), h)
    else:
        part = min(1.0, -depth / (rate * h)) if rate < 0.0 else 0.5
    if math.isnan(log[REBOUND]) and log[APPROACH] > 0.0:
        # how fast the points of the last touch part, now that nothing acts on them
        gi, gj = sides(scene, s)
        p, graphics = vector(state.p[s]), scene.graphics
        v = sub(
            velocity_at(scene, y, graphics.body[gi], p), velocity_at(scene, y, graphics.body[gj], p)
        )
        apart = dot(v, vector(state.n[s]))
        if apart < -rate:
            # the force was over before, and something slows them: as fast as where they parted
            apart = -rate + part * (apart + rate)
        log[REBOUND] = max(apart, 0.0) / log[APPROACH]
    record_event(scene, t - (1.0 - part) * h, LEAVE, s)


@jitable
def measure_gap(scene: Scene, y: F1, pair: int, measured: bool) -> None:
    """Store how far apart the pair is at the accepted point, where it may be `measured` already."""
    pairs, work = scene.pairs, scene.work
    closed_form = scene.kinds.kernel[pairs.kind[pair]] != 0
    if (measured and closed_form) or measure_pair(scene, pair):
        first, deepest = pairs.slot[pair], -math.inf
        for s in range(first, first + scene.kinds.slots[pairs.kind[pair]]):
            deepest = max(deepest, work.points[s, AT_DEPTH])
        gap = -deepest
    else:
        points = scene.world.hooks[Hook.FCL_POINTS]
        gap = call_float(points, (scene, FclPoints.GAP, pair, 0.0, y))
    pairs.gap[pair] = pairs.left[pair] = gap


@jitable
def commit_slot(scene: Scene, t: float, h: float, y: F1, s: int) -> int:
    """Write the incident of slot s for the accepted point; return what `commit` does."""
    state, work = scene.state, scene.work
    now, before = work.touching[s], state.touching[s]
    changed = 0
    fresh = now != before
    kind = scene.pairs.kind[scene.slots.pair[s]]
    if now == 1 and before == 1 and scene.kinds.kernel[kind] == 0:
        points = scene.world.hooks[Hook.FCL_POINTS]
        fresh = call_float(points, (scene, FclPoints.MOVED, s, h, y)) != 0.0
        changed = 1 if fresh else 0
    if now == 1 and before == 0:
        log_touch(scene, t, h, y, s)
    elif now == 0 and before == 1:
        log_leave(scene, t, h, y, s)
        for k in range(4):
            # what it was linearised at tells nothing of another touch
            work.friction_slope[s, k] = 0.0
    # X and memory of an incident that ended, or that is another than before, begin again at 0;
    # at touch they have gathered since the touch within the step and stay
    x, z, begins = scene.slots.x[s], scene.slots.z[s], now == 1 and before == 0
    if fresh and not begins and (x >= 0 or z >= 0):
        for k in range(3):
            if x >= 0:
                y[x + k] = 0.0
        for k in range(scene.contacts.carried[contact_of(scene, s)]):
            y[z + k] = 0.0
    else:
        changed = 0
    if scene.contacts.memory[contact_of(scene, s)] > 0:
        anew = 1 if fresh and not begins else 0
        given = (scene, Recall.COMMIT, s, t, y, anew)
        changed = max(changed, answer_of(scene, call_int(scene.world.hooks[Hook.RECALL], given)))
    state.touching[s] = now
    if now == 1:
        state.depth[s] = work.slot[s, DEPTH]
        state.rate[s] = work.slot[s, RATE]
        state.normal[s] = work.slot[s, NORMAL]
        placed = scene.kinds.moves[kind] > ON_PLANE
        framed = scene.contacts.framed[contact_of(scene, s)] == 1
        if scene.world.fixed_step[0] == 0 or framed or placed:
            for k in range(3):
                state.p[s, k] = work.points[s, AT_POINT + k]
                state.n[s, k] = work.points[s, AT_NORMAL + k]
                state.t[s, k] = work.t[s, k]
    return changed


@jitable
def forget_apart(scene: Scene, y: F1) -> None:
    """Let what slots that do not touch carry be 0.

    The last stages of a step that ends just before a touch may be in it, and what they gathered
    would be there when it begins.
    """
    slots, pairs, touching = scene.slots, scene.pairs, scene.work.touching
    for j in range(pairs.count[ACTIVE]):
        first, last = pairs.slot[pairs.active[j]], pairs.last[pairs.active[j]]
        # what one slot of a contact carries, all do
        if slots.x[first] < 0 and slots.z[first] < 0:
            continue
        carried = scene.contacts.carried[contact_of(scene, first)]
        for s in range(first, last):
            if touching[s] == 1:
                continue
            if slots.x[s] >= 0:
                for k in range(3):
                    y[slots.x[s] + k] = 0.0
            if slots.z[s] >= 0:
                for k in range(carried):
                    y[slots.z[s] + k] = 0.0


@jitable
def log_deep(scene: Scene, t: float) -> None:
    """Note the contacts that are too deep at the accepted point for their force to be trusted.

    A pair knows of meshes that they are deeper than their layer, or than the wall that a sphere
    presses. Shapes of other pairs push each other out on the other side when they have passed each
    other's middles: `MIDDLE` of the way is too deep.
    """
    graphics, hit, work = scene.graphics, scene.work.hit, scene.work
    for k in range(hit[len(hit) - 1]):
        gi, gj = sides(scene, hit[k])
        c = contact_of(scene, hit[k])
        way = graphics.width[gi] + graphics.width[gj]
        kind = scene.pairs.kind[scene.slots.pair[hit[k]]]
        told = scene.kinds.moves[kind] == NO_ROWS and scene.kinds.kernel[kind] != 0
        known = told or work.points[hit[k], AT_DEPTH] <= MIDDLE * way
        if not known and work.beyond[c] == 0:
            work.beyond[c] = 1 + scene.slots.pair[hit[k]]
    for c in range(len(work.beyond)):
        if work.beyond[c] == 0:
            continue
        scene.log.counters[TOO_DEEP] += 1
        row, pair = scene.log.contacts[c], work.beyond[c] - 1
        if math.isnan(row[BEYOND_TIME]):
            row[BEYOND_TIME] = t
            row[BEYOND_I], row[BEYOND_J] = scene.pairs.graphic_i[pair], scene.pairs.graphic_j[pair]


@jitable
def commit_incidents(scene: Scene, t: float, h: float, y: F1) -> int:
    """Write the incident table for the accepted point; return what `commit` does."""
    state, work, pairs = scene.state, scene.work, scene.pairs
    old, new, last = state.hit, work.hit, len(work.hit) - 1
    changed = 0
    log_deep(scene, t)
    for k in range(old[last]):
        pairs.touches[scene.slots.pair[old[k]]] = 0
        if work.touching[old[k]] == 0:
            changed = max(changed, commit_slot(scene, t, h, y, old[k]))
    for k in range(new[last]):
        changed = max(changed, commit_slot(scene, t, h, y, new[k]))
        old[k] = new[k]
    for k in range(new[last]):
        pairs.touches[scene.slots.pair[new[k]]] += 1
    old[last] = new[last]
    forget_apart(scene, y)
    return changed


@jitable
def commit_gaps(scene: Scene, y: F1) -> None:
    """Take what the shapes moved from the distance of every pair; measure where half is gone."""
    pairs, work = scene.pairs, scene.work
    for k in range(pairs.count[ACTIVE]):
        pair = pairs.active[k]
        if pairs.touches[pair] > 0:
            pairs.gap[pair] = pairs.left[pair] = 0.0
            continue
        travel = work.travel[pairs.graphic_i[pair]] + work.travel[pairs.graphic_j[pair]]
        if not travel < pairs.left[pair]:
            measure_gap(scene, y, pair, True)
        elif travel > 0.0:
            pairs.left[pair] -= travel
            if pairs.left[pair] <= 0.5 * pairs.gap[pair]:
                measure_gap(scene, y, pair, False)


@jitable
def exchange(points: F2, a: int, b: int, step: int) -> None:
    """Exchange the rows of two incidents."""
    for r in range(step):
        for c in range(points.shape[1]):
            points[a + r, c], points[b + r, c] = points[b + r, c], points[a + r, c]


@jitable
def same_place(scene: Scene, pair: int) -> float:
    """Return how near to each other incidents of a pair are at the same corner of a shape."""
    width = scene.graphics.width
    return SAME_PLACE * min(width[scene.pairs.graphic_i[pair]], width[scene.pairs.graphic_j[pair]])


@jitable
def pass_on(scene: Scene, pair: int, points: F2, at: int) -> None:
    """Give incidents of a pair, whose rows of points begin `at` one, the slots that were there.

    What a corner becomes behind an edge has another row, and what came from elsewhere may have the
    one that it had: those nearest to each other come first. What is not at a place that was touched
    keeps to its row.
    """
    first, state, left = scene.pairs.slot[pair], scene.state, scene.pairs.touches[pair]
    count, near = scene.kinds.slots[scene.pairs.kind[pair]], same_place(scene, pair)
    settled = 0  # bits of slots that have their incident
    while left > 0:
        slot, incident, least = -1, -1, near
        for s in range(count):
            if state.touching[first + s] == 0 or settled >> s & 1:
                continue
            for k in range(count):
                # a row that has no place has no depth either; one that has just left has one
                if points[at + k, AT_DEPTH] == 0.0 or settled >> k & 1:
                    continue
                way = norm(sub(vector(points[at + k, AT_POINT:]), vector(state.p[first + s])))
                if way < least:
                    slot, incident, least = s, k, way
        if slot < 0:
            return
        if slot != incident:
            exchange(points, at + slot, at + incident, 1)
        settled |= 1 << slot
        left -= 1


@jitable
def keep_slots(scene: Scene, pair: int) -> None:
    """Give incidents the slots of the committed ones that are nearest to them, nearest pair first.

    It follows from the trial point and the committed state alone. An incident without a committed
    one gets a slot that has none.
    """
    pairs, state, work = scene.pairs, scene.state, scene.work
    if pairs.touches[pair] == 0:
        return
    if scene.kinds.moves[pairs.kind[pair]] == HELD_AT_PLACES:
        pass_on(scene, pair, work.points, pairs.slot[pair])
        return
    kind, first = pairs.kind[pair], pairs.slot[pair]
    step = scene.kinds.step[kind]
    many, left = number_of_parts(scene.kinds.slots[kind], step), pairs.touches[pair]
    settled = 0  # bits of slots that have their incident
    while left > 0:
        slot, incident, least = -1, -1, math.inf
        for i in range(many):
            s = first + i * step
            if state.touching[s] == 0 or settled >> i & 1:
                continue
            for j in range(many):
                k = first + j * step
                if work.points[k, AT_DEPTH] <= 0.0 or settled >> j & 1:
                    continue
                way = sub(vector(work.points[k, AT_POINT:]), vector(state.p[s]))
                if dot(way, way) < least:
                    slot, incident, least = s, k, dot(way, way)
        if slot < 0:
            return
        if slot != incident:
            exchange(work.points, slot, incident, step)
        settled |= 1 << ((slot - first) // step)
        left -= 1
