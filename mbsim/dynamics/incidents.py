"""What happens to incidents when a step is tried, accepted, and watched.

`first_depth` guards the beginning of an impact, `commit` writes the incident table after an
accepted step, `reversal` says where in a step a contact force may have peaked.
"""

from __future__ import annotations

import math

from mbsim.core.address import call_int
from mbsim.core.jitable import jitable
from mbsim.core.rotation import cross, dot, norm, rotate, sub, unrotate, vector
from mbsim.dynamics.contact import DEPTH, FORCE, NORMAL, RATE, SLIP, STORED, sides, velocity_at
from mbsim.dynamics.detection import measure_pair, moved
from mbsim.dynamics.kinematics import position
from mbsim.geometry.catalog import axis
from mbsim.system.arrays import (
    APPROACH,
    BODY_SIZE,
    ENERGY_LOST,
    FIRST_TOUCH,
    LEAVE,
    PEAK_DEPTH,
    PEAK_FORCE,
    PEAK_FORCE_TIME,
    PEAK_SLIP,
    REBOUND,
    TOUCH,
    TOUCHES,
)


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
    """Return the depth at which contact c has stored `energy`: how deep an impact goes."""
    contacts, out = scene.contacts, scene.work.law_out
    depth = 1e-12 * scene.world.scale[0]
    # doubling up to there is within a factor 2; then bisection to 1 %
    for _ in range(200):
        call_int(contacts.normal_law[c], (depth, 0.0, contacts.normal_par[c], out))
        if out[2] >= energy:
            break
        depth *= 2.0
    low, high = 0.5 * depth, depth
    for _ in range(6):
        middle = 0.5 * (low + high)
        call_int(contacts.normal_law[c], (middle, 0.0, contacts.normal_par[c], out))
        if out[2] < energy:
            low = middle
        else:
            high = middle
    return high


@jitable
def touched(scene, pair):
    """Return whether a pair touched at the committed state."""
    for s in range(scene.pairs.slot[pair], scene.pairs.slot[pair + 1]):
        if scene.state.touching[s] == 1:
            return True
    return False


@jitable
def first_depth(scene, t, h, y):
    """Return 1, or the part of the step to take so that a new incident begins shallow.

    The first depth of an impact is at most max(v Tc/70, 1e-3 dmax), with v the closing speed
    and Tc the contact time: about 3 times the deepest depth over v (pi for a linear
    spring, 2.943 for Hertz).
    """
    work, state, contacts = scene.work, scene.state, scene.contacts
    part = 1.0
    for s in range(len(scene.slots.pair)):
        if work.touching[s] == 0 or state.touching[s] == 1 or work.slot[s, RATE] <= 0.0:
            continue
        pair = scene.slots.pair[s]
        if scene.pairs.regroups[pair] == 1 and touched(scene, pair):
            # not an impact: the points of a contact that goes on were chosen anew
            continue
        c = scene.slots.contact[s]
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
        rows.events[k, 2] = scene.contacts.id[scene.slots.contact[s]]
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
    row, log = scene.work.slot[s], scene.log.contacts[scene.slots.contact[s]]
    speed = max(row[RATE], 0.0)
    # the depth is small by the guard: the way back at closing speed, within the step
    back = min(row[DEPTH] / speed, h) if speed > 0.0 else 0.0
    if math.isnan(log[FIRST_TOUCH]):
        log[FIRST_TOUCH] = t - back
    log[TOUCHES] += 1.0
    # the spring has already taken some of the speed at the touch
    mass = effective_mass(scene, y, s)
    taken = 2.0 * row[STORED] / mass if mass > 0.0 else 0.0
    log[APPROACH] = math.sqrt(speed * speed + taken) if h > 0.0 else 0.0
    record_event(scene, t - back, TOUCH, s)


@jitable
def log_leave(scene, t, h, y, s):
    """Note that slot s ceased to touch within the step that ends at t."""
    state, log = scene.state, scene.log.contacts[scene.slots.contact[s]]
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
    work = scene.work
    for c in range(len(scene.contacts.id)):
        fx, fy, fz = 0.0, 0.0, 0.0
        log = scene.log.contacts[c]
        pairs = scene.pairs
        any_touch = False
        first = pairs.slot[scene.contacts.first_pair[c]]
        last = pairs.slot[scene.contacts.first_pair[c + 1]]
        for s in range(first, last):
            if work.touching[s] == 1:
                any_touch = True
                row = work.slot[s]
                fx += row[FORCE]
                fy += row[FORCE + 1]
                fz += row[FORCE + 2]
                log[PEAK_DEPTH] = max(log[PEAK_DEPTH], row[DEPTH])
                if row[NORMAL] > 0.0:
                    log[PEAK_SLIP] = max(log[PEAK_SLIP], row[SLIP])
        force = math.sqrt(fx * fx + fy * fy + fz * fz)
        if any_touch and force > log[PEAK_FORCE]:
            log[PEAK_FORCE] = force
            log[PEAK_FORCE_TIME] = t


@jitable
def reversal(scene, h):
    """Return where in the step (0..1) a contact was deepest, or -1: closing before, opening after.

    Called before `commit`: the committed table holds the begin of the step, `work` its end.
    """
    work, state = scene.work, scene.state
    for s in range(len(scene.slots.pair)):
        if work.touching[s] == 1 and state.touching[s] == 1:
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
def measure_gap(scene, y, pair):
    """Store how far apart the pair is at the accepted point, and where its shapes are."""
    pairs, graphics, state, work = scene.pairs, scene.graphics, scene.state, scene.work
    if measure_pair(scene, pair):
        deepest = -math.inf
        for s in range(pairs.slot[pair], pairs.slot[pair + 1]):
            deepest = max(deepest, work.points[s, 0])
        state.gap[pair] = -deepest
    else:
        state.gap[pair] = bounding_gap(scene, pair)
    for side in range(2):
        g = pairs.graphic_i[pair] if side == 0 else pairs.graphic_j[pair]
        b = graphics.body[g]
        for k in range(3):
            state.centre[pair, 3 * side + k] = work.frames[g, k]
        if b < len(scene.bodies.mass):
            at = BODY_SIZE * b + 3
            for k in range(4):
                state.turn[pair, 4 * side + k] = y[at + k]


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
    if now == 1 and before == 1 and scene.pairs.kernel[scene.slots.pair[s]] == 0:
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
def commit(scene, t, h, y):
    """Take the point evaluated last as accepted; return 1 if y changed so that f did."""
    state, pairs = scene.state, scene.pairs
    changed = 0
    for s in range(len(scene.slots.pair)):
        changed = max(changed, commit_slot(scene, t, h, y, s))
    for b in range(len(scene.bodies.mass)):
        for k in range(4):
            state.q[b, k] = y[BODY_SIZE * b + 3 + k]
    watch_peaks(scene, t)
    contacts = len(scene.contacts.id)
    for c in range(contacts):
        scene.log.contacts[c, ENERGY_LOST] = y[len(y) - contacts + c]

    for pair in range(len(pairs.contact)):
        if pairs.watched[pair] == 0:
            continue
        gap = state.gap[pair]
        if touched(scene, pair):
            state.gap[pair] = state.left[pair] = 0.0
            continue
        way = moved(scene, y, pair, 0) + moved(scene, y, pair, 1)
        state.left[pair] = gap - way
        if gap <= 0.0 or way > 0.5 * gap:
            # half of the gap is used up: measure where the shapes are now
            measure_gap(scene, y, pair)
            state.left[pair] = state.gap[pair]
    return changed


@jitable
def longest_parting(scene):
    """Return a step that does not leap over what is left of an incident without force.

    The damper of a fast separation can outweigh the spring (the force is 0) and yet fade
    sooner: the force comes back just before the shapes part. A step that sees no force at
    any stage would miss that with an error estimate of 0, so it may use up half of the depth.
    """
    state, longest = scene.state, math.inf
    for s in range(len(scene.slots.pair)):
        if state.touching[s] == 1 and state.normal[s] == 0.0 and state.rate[s] < 0.0:
            depth, speed = state.depth[s], -state.rate[s]
            # what is left is nothing beside the depths of an impact at this speed
            c = scene.slots.contact[s]
            mass = lightest(scene, s)
            deepest = deepest_of_impact(scene, c, 0.5 * mass * speed * speed)
            if depth > 1e-5 * deepest:
                longest = min(longest, 0.5 * depth / speed)
    return longest


@jitable
def lightest(scene, s):
    """Return the mass of the lighter moving body of slot s."""
    gi, gj = sides(scene, s)
    least = math.inf
    for g in (gi, gj):
        b = scene.graphics.body[g]
        if b < len(scene.bodies.mass):
            least = min(least, scene.bodies.mass[b])
    return least


@jitable
def longest_step(scene, y, f):
    """Return a step that no pair can use to pass through: gap plus thickness at closing speed."""
    pairs, graphics = scene.pairs, scene.graphics
    longest = longest_parting(scene)
    for pair in range(len(pairs.contact)):
        thick = pairs.thickness[pair]
        # in touch the stages feel the force, and sliding along is no approach
        if math.isinf(thick) or touched(scene, pair):
            continue
        speed, push = 0.0, 0.0
        for side in range(2):
            g = pairs.graphic_i[pair] if side == 0 else pairs.graphic_j[pair]
            b = graphics.body[g]
            if b < len(scene.bodies.mass):
                reach = graphics.reach[g] + norm(vector(graphics.p[g]))
                at = BODY_SIZE * b
                speed += norm((y[at + 7], y[at + 8], y[at + 9]))
                speed += norm((y[at + 10], y[at + 11], y[at + 12])) * reach
                push += norm((f[at + 7], f[at + 8], f[at + 9]))
        way = max(scene.state.left[pair], 0.0) + thick
        # way = speed h + push h^2 / 2
        if speed > 0.0 or push > 0.0:
            longest = min(
                longest, 2.0 * way / (speed + math.sqrt(speed * speed + 2.0 * push * way))
            )
    return longest
