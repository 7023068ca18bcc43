"""What happens to incidents when a step is tried, accepted, and watched.

`first_depth` guards the beginning of an impact, `commit` writes the incident table after an
accepted step, `reversal` says where in a step a contact force may have peaked.
"""

from __future__ import annotations

import math

from mbsim.core.address import call_int
from mbsim.core.jitable import jitable
from mbsim.core.rotation import cross, dot, norm, rotate, sub, unrotate, vector
from mbsim.dynamics.contact import (
    DEPTH,
    FORCE,
    NORMAL,
    RATE,
    SLIP,
    STORED,
    contact_of,
    sides,
    velocity_at,
)
from mbsim.dynamics.crowd import follow
from mbsim.dynamics.detection import measure_pair
from mbsim.dynamics.kinematics import place_body, place_graphic, position
from mbsim.geometry.catalog import axis
from mbsim.system.arrays import (
    APPROACH,
    BODY_SIZE,
    ENERGY_LOST,
    FIRST_TOUCH,
    LEAVE,
    LIVE,
    PEAK_DEPTH,
    PEAK_FORCE,
    PEAK_FORCE_TIME,
    PEAK_SLIP,
    REBOUND,
    TOUCH,
    TOUCHES,
)

#: Halvings of the way out in which a force is looked for, and of where it ends.
SHALLOWEST = 12


@jitable
def effective_mass(scene, y, s):
    """Return the mass that meets in slot s along its normal: 1 / (n J M^-1 J' n)."""
    point = scene.work.points[s]
    p, n = (point[1], point[2], point[3]), (point[4], point[5], point[6])
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
def deepest_of_impact(scene, c, energy):
    """Return the depth at which contact c has stored `energy`: how deep an impact goes, to 1 %.

    Newton for log E over log d, whose slope is F d / E: exact at once for a power law.
    """
    contacts, out = scene.contacts, scene.work.law_out
    depth = 1e-4 * scene.world.scale[0]
    for _ in range(50):
        call_int(contacts.normal_law[c], (depth, 0.0, contacts.normal_par[c], out))
        if out[2] <= 0.0 or not out[1] > 0.0:
            depth *= 16.0
            continue
        ratio = energy / out[2]
        if 0.99 < ratio < 1.01:
            break
        change = ratio ** (out[2] / (out[1] * depth))
        depth *= min(1e4, max(1e-4, change))
    return depth


@jitable
def first_depth(scene, t, h, y):
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
        energy = 0.5 * effective_mass(scene, y, s) * speed * speed / work.points[s, 7]
        deepest = deepest_of_impact(scene, c, energy)
        allowed = max(3.0 * deepest / 70.0, 1e-3 * contacts.dmax[c])
        if depth > allowed:
            # at this speed it was half as deep as allowed so much earlier
            earlier = (depth - 0.5 * allowed) / (speed * h)
            wanted = 1.0 - earlier if earlier < 0.98 else 0.5
            if wanted < part:
                part = wanted
                work.trouble[1] = c
    return part


@jitable
def record_event(scene, t, kind, s):
    """Append an event; the driver empties the table before it can overflow."""
    rows = scene.rows
    k = rows.used[2]
    if k < len(rows.events):
        rows.events[k, 0] = t
        rows.events[k, 1] = kind
        rows.events[k, 2] = scene.contacts.id[contact_of(scene, s)]
        rows.events[k, 3] = s
        rows.used[2] = k + 1


@jitable
def crossing(depth0, rate0, depth1, rate1, h):
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
def log_touch(scene, t, h, y, s):
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
def log_leave(scene, t, h, y, s):
    """Note that slot s ceased to touch within the step that ends at t."""
    state, log = scene.state, scene.log.contacts[contact_of(scene, s)]
    depth, rate = state.depth[s], state.rate[s]
    after = scene.work.points[s, 0]
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
        log[REBOUND] = max(dot(v, vector(state.n[s])), 0.0) / log[APPROACH]
    record_event(scene, t - (1.0 - part) * h, LEAVE, s)


@jitable
def watch_peaks(scene, t):
    """Keep the largest force, depth and slip of every contact at the point just evaluated."""
    work, net, hit = scene.work, scene.work.net, scene.work.hit
    if hit[len(hit) - 1] == 0:
        return
    for c in range(len(net)):
        net[c, 0] = net[c, 1] = net[c, 2] = 0.0
    for k in range(hit[len(hit) - 1]):
        row, c = work.slot[hit[k]], contact_of(scene, hit[k])
        log = scene.log.contacts[c]
        for j in range(3):
            net[c, j] += row[FORCE + j]
        log[PEAK_DEPTH] = max(log[PEAK_DEPTH], row[DEPTH])
        if row[NORMAL] > 0.0:
            log[PEAK_SLIP] = max(log[PEAK_SLIP], row[SLIP])
    for c in range(len(net)):
        force = norm(vector(net[c]))
        if force > scene.log.contacts[c, PEAK_FORCE]:
            scene.log.contacts[c, PEAK_FORCE] = force
            scene.log.contacts[c, PEAK_FORCE_TIME] = t


@jitable
def reversal(scene, h):
    """Return where in the step (0..1) a contact was deepest, or -1: closing before, opening after.

    Called before `commit`: the committed table holds the begin of the step, `work` its end.
    """
    work, state, hit = scene.work, scene.state, scene.state.hit
    for k in range(hit[len(hit) - 1]):
        s = hit[k]
        if work.touching[s] == 1:
            before, after = state.rate[s], work.slot[s, RATE]
            if before > 0.0 and after <= 0.0:
                return before / (before - after)
    return -1.0


@jitable
def bounding_gap(scene, pair):
    """Return a lower bound of two shapes' distance: ball of one to box or plane of the other."""
    pairs, graphics, work = scene.pairs, scene.graphics, scene.work
    best = -math.inf
    for side in range(2):
        g = pairs.graphic_i[pair] if side == 0 else pairs.graphic_j[pair]
        other = pairs.graphic_j[pair] if side == 0 else pairs.graphic_i[pair]
        frame, half = work.frames[other], graphics.half[other]
        d = sub(vector(work.frames[g]), vector(frame))
        if math.isinf(half[2]):
            best = max(best, dot(d, axis(frame, 2)) - graphics.reach[g])
            continue
        square = 0.0
        for k in range(3):
            out = max(0.0, abs(dot(d, axis(frame, k))) - half[k])
            square += out * out
        best = max(best, math.sqrt(square) - graphics.reach[g])
    return best


@jitable
def measure_gap(scene, pair):
    """Store how far apart the pair is at the accepted point."""
    pairs, work = scene.pairs, scene.work
    if measure_pair(scene, pair):
        first, deepest = pairs.slot[pair], -math.inf
        for s in range(first, first + scene.kinds.slots[pairs.kind[pair]]):
            deepest = max(deepest, work.points[s, 0])
        gap = -deepest
    else:
        gap = bounding_gap(scene, pair)
    pairs.gap[pair] = pairs.left[pair] = gap


@jitable
def another_point(scene, y, h, s):
    """Return whether the point that FCL gives for slot s is too far to be the one before."""
    point, before = scene.work.points[s], scene.state.p[s]
    p = (point[1], point[2], point[3])
    gi, gj = sides(scene, s)
    graphics = scene.graphics
    speed = norm(velocity_at(scene, y, graphics.body[gi], p))
    speed += norm(velocity_at(scene, y, graphics.body[gj], p))
    size = min(graphics.reach[gi], graphics.reach[gj])
    # the point of touch may run ahead of both surfaces; a hundredth of the shape is near
    return norm(sub(p, vector(before))) > 2.0 * h * speed + 0.01 * size


@jitable
def commit_slot(scene, t, h, y, s):
    """Write the incident of slot s for the accepted point; return 1 if y changed under contact."""
    state, work = scene.state, scene.work
    now, before = work.touching[s], state.touching[s]
    changed = 0
    fresh = now != before
    kind = scene.pairs.kind[scene.slots.pair[s]]
    if now == 1 and before == 1 and scene.kinds.kernel[kind] == 0:
        fresh = another_point(scene, y, h, s)
        changed = 1 if fresh else 0
    if now == 1 and before == 0:
        log_touch(scene, t, h, y, s)
    elif now == 0 and before == 1:
        log_leave(scene, t, h, y, s)
    # X of an incident that ended, or that is another than before, begins again at 0; at
    # touch X has gathered since the touch within the step and stays
    at = scene.slots.x[s]
    if at >= 0 and fresh and not (now == 1 and before == 0):
        for k in range(3):
            y[at + k] = 0.0
    else:
        changed = 0
    state.touching[s] = now
    if now == 1:
        state.depth[s] = work.slot[s, DEPTH]
        state.rate[s] = work.slot[s, RATE]
        state.normal[s] = work.slot[s, NORMAL]
        for k in range(3):
            state.p[s, k] = work.points[s, 1 + k]
            state.n[s, k] = work.points[s, 4 + k]
            state.t[s, k] = work.t[s, k]
    return changed


@jitable
def commit_incidents(scene, t, h, y):
    """Write the incident table for the accepted point; return 1 if y changed under contact."""
    state, work, pairs = scene.state, scene.work, scene.pairs
    old, new, last = state.hit, work.hit, len(work.hit) - 1
    changed = 0
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
    return changed


@jitable
def commit_gaps(scene):
    """Take what the shapes moved from the distance of every pair; measure where half is gone."""
    pairs, work = scene.pairs, scene.work
    for k in range(pairs.count[LIVE]):
        pair = pairs.live[k]
        if pairs.touches[pair] > 0:
            pairs.gap[pair] = pairs.left[pair] = 0.0
            continue
        way = work.way[pairs.graphic_i[pair]] + work.way[pairs.graphic_j[pair]]
        if way > 0.0 or pairs.gap[pair] <= 0.0:
            pairs.left[pair] -= way
            if pairs.left[pair] <= 0.5 * pairs.gap[pair]:
                measure_gap(scene, pair)


@jitable
def commit(scene, t, h, y):
    """Take the point evaluated last as accepted; return 1 if y changed so that f did."""
    state, graphics, ground = scene.state, scene.graphics, len(scene.bodies.mass)
    changed = commit_incidents(scene, t, h, y)
    watch_peaks(scene, t)
    contacts = len(scene.contacts.id)
    for c in range(contacts):
        scene.log.contacts[c, ENERGY_LOST] = y[len(y) - contacts + c]
    commit_gaps(scene)
    for b in range(ground):
        for k in range(4):
            state.q[b, k] = y[BODY_SIZE * b + 3 + k]
    for g in range(len(graphics.body)):
        if graphics.body[g] < ground:
            for k in range(3):
                state.centre[g, k] = scene.work.frames[g, k]
    if len(scene.crowds.contact) > 0:
        follow(scene, y)
    return changed


@jitable
def pushes_at(scene, c, t, depth, rate, bend):
    """Return whether contact c would push after a time t in which depth goes on as it does."""
    out = scene.work.law_out
    d = depth + t * (rate + 0.5 * t * bend)
    par = scene.contacts.normal_par[c]
    call_int(scene.contacts.normal_law[c], (d, rate + t * bend, par, out))
    return out[0] > 0.0


@jitable
def step_to_leave(scene, f, s, h):
    """Return the step that ends where the force of the parting slot s ends or comes back.

    A step across such a place is one whose error estimate may vanish by chance, and those
    that do are the ones that are taken. d + d' t + d'' t^2 / 2 = 0 when it leaves; the force
    falls on the way, so this is too soon at first and exact at last. The damper of a fast
    separation can outweigh the spring: then the force is 0 sooner, and as the damper fades with
    depth it comes back just before the shapes part.
    """
    state, n, c = scene.state, vector(scene.state.n[s]), contact_of(scene, s)
    gi, gj = sides(scene, s)
    bi, bj = scene.graphics.body[gi], scene.graphics.body[gj]
    depth, rate = state.depth[s], state.rate[s]
    bend = -dot(sub(thrust(scene, f, bi), thrust(scene, f, bj)), n)
    square = rate * rate - 2.0 * bend * depth
    if square < 0.0:
        return math.inf
    leave = 2.0 * depth / (math.sqrt(square) - rate)
    pushes = state.normal[s] > 0.0
    if leave > h and pushes_at(scene, c, h, depth, rate, bend) == pushes:
        return math.inf
    before, part = 0.0, 1.0
    for _ in range(SHALLOWEST):
        part *= 0.5
        after = min(h, leave * (1.0 - part))
        if pushes_at(scene, c, after, depth, rate, bend) != pushes:
            for _ in range(SHALLOWEST):
                middle = 0.5 * (before + after)
                if pushes_at(scene, c, middle, depth, rate, bend) != pushes:
                    after = middle
                else:
                    before = middle
            leave = after
            break
        before = after
    # a little more, so that it is over then
    return 1.0001 * leave


@jitable
def longest_parting(scene, f, h):
    """Return how much of a step h may be tried so that it does not leap over the end of a force."""
    state, longest = scene.state, h
    for k in range(state.hit[len(state.hit) - 1]):
        if state.rate[state.hit[k]] < 0.0:
            longest = min(longest, step_to_leave(scene, f, state.hit[k], longest))
    return longest


@jitable
def time_for(way, speed, push):
    """Return the time in which a shape can come `way` far: way = speed h + push h^2 / 2."""
    if speed == 0.0 and push == 0.0:
        return math.inf
    return 2.0 * way / (speed + math.sqrt(speed * speed + 2.0 * push * way))


@jitable
def place_side(scene, y, g):
    """Place graphic g and its body at y."""
    if scene.graphics.body[g] < len(scene.bodies.mass):
        place_body(scene, y, scene.graphics.body[g])
        place_graphic(scene, y, g)


@jitable
def thrust(scene, f, b):
    """Return the acceleration of body b's cg."""
    if b == len(scene.bodies.mass):
        return (0.0, 0.0, 0.0)
    at = BODY_SIZE * b + 7
    return (f[at], f[at + 1], f[at + 2])


@jitable
def step_to_touch(scene, y, f, pair, h):
    """Return the step that ends where a pair is about to touch, or begins its contact; else inf.

    A step much longer than the contact would meet it with a force out of all proportion, and
    be cut down by error control again and again. With the gap g, closing speed v and its rate
    a at the committed point the pair touches after t, g = v t + a t^2 / 2. From
    there the first step is a part of the contact time that the guard of `first_depth` allows.
    """
    pairs, graphics, work = scene.pairs, scene.graphics, scene.work
    gi, gj = pairs.graphic_i[pair], pairs.graphic_j[pair]
    place_side(scene, y, gi)
    place_side(scene, y, gj)
    if not measure_pair(scene, pair):
        return math.inf
    s = pairs.slot[pair]
    for k in range(s + 1, s + scene.kinds.slots[pairs.kind[pair]]):
        if work.points[k, 0] > work.points[s, 0]:
            s = k
    gap, bi, bj = -work.points[s, 0], graphics.body[gi], graphics.body[gj]
    if gap < 0.0:
        return math.inf
    p, n = vector(work.points[s, 1:4]), vector(work.points[s, 4:7])
    if scene.kinds.swapped[pairs.kind[pair]] == 1:
        bi, bj = bj, bi
    v = dot(sub(velocity_at(scene, y, bj, p), velocity_at(scene, y, bi, p)), n)
    a = dot(sub(thrust(scene, f, bj), thrust(scene, f, bi)), n)
    square = v * v + 2.0 * a * gap
    if square <= 0.0 or v + math.sqrt(square) <= 0.0:
        return math.inf
    speed = math.sqrt(square)
    t = 2.0 * gap / (v + speed)
    mass = effective_mass(scene, y, s)
    contact_time = 3.0 * deepest_of_impact(scene, contact_of(scene, s), 0.5 * mass * square) / speed
    if t > h or h < 0.1 * contact_time:
        return math.inf
    # the damper comes in over dmax
    ramp = 0.33 * scene.contacts.dmax[contact_of(scene, s)] / speed
    first = contact_time / 80.0
    if ramp > 0.01 * first:
        first = min(first, ramp)
    return t + first if t < first else (1.0 - 1e-6) * t


@jitable
def longest_way(scene, y, f, h):
    """Return a step that no pair can use to pass through: gap plus thickness at closing speed.

    Nor may a shape of a crowd leave where the list of near pairs holds. A step of length h, the
    one intended, ends where a pair begins to touch.
    """
    pairs, graphics, work = scene.pairs, scene.graphics, scene.work
    longest = math.inf
    for g in range(len(graphics.body)):
        b = graphics.body[g]
        if b < len(scene.bodies.mass):
            reach = graphics.reach[g] + norm(vector(graphics.p[g]))
            at = BODY_SIZE * b
            turning = norm((y[at + 10], y[at + 11], y[at + 12]))
            speed = norm((y[at + 7], y[at + 8], y[at + 9]))
            # a plane, which has no reach, is never passed through
            speed += turning * reach if reach < math.inf else 0.0
            push = norm((f[at + 7], f[at + 8], f[at + 9]))
            work.speed[g, 0], work.speed[g, 1] = speed, push
            room = scene.crowds.room[g]
            if room < math.inf:
                longest = min(longest, time_for(0.9 * room, speed, push))
    for k in range(pairs.count[LIVE]):
        pair = pairs.live[k]
        i, j = pairs.graphic_i[pair], pairs.graphic_j[pair]
        # in touch the stages feel the force, and sliding along is no approach
        if pairs.touches[pair] > 0:
            continue
        left = max(pairs.left[pair], 0.0)
        speed = work.speed[i, 0] + work.speed[j, 0]
        push = work.speed[i, 1] + work.speed[j, 1]
        # half of the thinner shape: a step may bury it no deeper before it is seen; what a
        # half-space has swallowed it still pushes out, so nothing passes through a plane
        thin = 0.5 * min(graphics.thin[i], graphics.thin[j])
        if not (math.isinf(graphics.thin[i]) or math.isinf(graphics.thin[j])):
            longest = min(longest, time_for(left + thin, speed, push))
        if time_for(left, speed, push) < min(h, longest):
            longest = min(longest, step_to_touch(scene, y, f, pair, min(h, longest)))
    return longest


@jitable
def longest_step(scene, y, f, h):
    """Return how much of h may be tried: nothing passes through, no parting is leapt over."""
    return min(longest_parting(scene, f, h), longest_way(scene, y, f, h))
