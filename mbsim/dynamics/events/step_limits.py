"""How long a step may be before it is tried, and where it should end.

Nothing may pass through anything, and a step ends where a contact is about to begin and where its
force ends or comes back.
"""

from __future__ import annotations

import math

from mbsim.arrays.codes import ACTIVE, AUDIT_TOL, CENTRE_ACCELERATION, FASTEST_POINT, SCALE_LENGTH
from mbsim.arrays.hooks import Hook
from mbsim.arrays.scene import Scene
from mbsim.core.address import call_float, call_int
from mbsim.core.arrays import F1, V3
from mbsim.core.jitable import jitable
from mbsim.core.layout import AT_V, AT_W, BODY_SIZE
from mbsim.core.problem import STABLE_EVERY
from mbsim.core.rotation import cross, dot, norm, sub, vector
from mbsim.dynamics.contact.detection import measure_pair
from mbsim.dynamics.contact.forces import contact_of, sides, velocity_at
from mbsim.dynamics.contact.points import deepest_of_impact, effective_mass
from mbsim.dynamics.events.passing import deeper_at_once, place_side
from mbsim.geometry.catalog import AT_DEPTH, AT_NORMAL, AT_POINT
from mbsim.geometry.motion import time_for
from mbsim.laws.abi import ELASTIC, ENERGY, LOAD

#: Halvings of the way out in which a force is looked for, and of where it ends.
SHALLOWEST = 12
#: How long before a touch a step ends, over the next one, which meets it, and the same over tol: a
#: switch in the midst of a step makes wrong what its error hardly shows.
BEFORE, BEFORE_OVER_TOL = 1e-4, 100.0
#: A step that begins or ends where a force d^e does is wrong by this part of force times step, at
#: most, where e is no whole number: what the weights and nodes of DOPRI5 and RADAU5 make of t^e,
#: those of DOP853 a third of it. Their error estimates see a hundredth to a half of that.
BLIND = 5e-4
#: What such a step may make wrong of a velocity, over tol: too little for it to add up.
BLIND_SHARE = 0.1
#: The same part where a force jumps: the weight of DOPRI5's first stage, which does not see it. Its
#: error estimate sees a 74th of that. A force jumps that has come at this part of the first depth.
BLIND_JUMP, AT_ONCE = 0.1, 1e-4
#: The longest step towards the end of a force, over the time until then, whose error is seen.
SEEN = 0.6
#: The end of a damper's ramp that is met within this part of a step is as good as at its begin.
AT_BEGIN = 0.02
#: Part of the scene's length below which a depth is rounding.
ROUNDING = 1e-13


@jitable
def seen_part(scene: Scene, c: int, depth: float, per_mass: float) -> float:
    """Return the part of the way out from a depth, or in to it, that may be one step; 1 for all.

    The spring of contact c is F ~ d^e there, e + 1 = F d/E, so that a step over the part x of this
    way, next to the surface, makes wrong x^(e + 1) of BLIND F h/m. `per_mass` is h/m of the whole.
    """
    out, tol = scene.work.law_out, scene.audit.plan[AUDIT_TOL]
    call_int(scene.contacts.normal_law[c], (depth, 0.0, scene.contacts.normal_par[c], out))
    if not out[ENERGY] > 0.0:
        return 1.0
    e = out[ELASTIC] * depth / out[ENERGY] - 1.0
    wrong = (
        min(1.0, abs((e - 1.0) * (e - 2.0) * (e - 3.0) * (e - 4.0)))
        * BLIND
        * out[ELASTIC]
        * per_mass
    )
    allowed = BLIND_SHARE * tol * math.sqrt(scene.work.squares[scene.scales.of_contact[c]])
    return (allowed / wrong) ** (1.0 / (e + 1.0)) if wrong > allowed > 0.0 else 1.0


@jitable
def is_over(scene: Scene, c: int, depth: float, normal: float, per_mass: float) -> bool:
    """Return whether all that contact c may still do before it leaves is too little to matter.

    `per_mass` is h/m of a step over it, whose first stage takes it to last. Where points of a patch
    move with it their depth goes on otherwise than their rate has it, and steps that end where they
    would leave get shorter and shorter but never there.
    """
    out, tol = scene.work.law_out, scene.audit.plan[AUDIT_TOL]
    call_int(scene.contacts.normal_law[c], (depth, 0.0, scene.contacts.normal_par[c], out))
    allowed = BLIND_SHARE * tol * math.sqrt(scene.work.squares[scene.scales.of_contact[c]])
    return BLIND_JUMP * max(normal, out[ELASTIC]) * per_mass <= allowed


@jitable
def longest_at_jump(scene: Scene, c: int, depth: float, speed: float, mass: float) -> float:
    """Return the longest step that may begin just before a touch at which the force jumps.

    It does where a damper comes in over nothing; inf where what is there at AT_ONCE of `depth`,
    how deep a step would lead otherwise, is nothing.
    """
    out, tol = scene.work.law_out, scene.audit.plan[AUDIT_TOL]
    call_int(
        scene.contacts.normal_law[c], (AT_ONCE * depth, speed, scene.contacts.normal_par[c], out)
    )
    allowed = BLIND_SHARE * tol * math.sqrt(scene.work.squares[scene.scales.of_contact[c]])
    return allowed * mass / (BLIND_JUMP * out[LOAD]) if out[LOAD] > 0.0 else math.inf


@jitable
def pushes_at(scene: Scene, c: int, t: float, depth: float, rate: float, bend: float) -> bool:
    """Return whether contact c would push after a time t in which depth goes on as it does."""
    out = scene.work.law_out
    d = depth + t * (rate + 0.5 * t * bend)
    par = scene.contacts.normal_par[c]
    call_int(scene.contacts.normal_law[c], (d, rate + t * bend, par, out))
    return out[LOAD] > 0.0


@jitable
def thrust(scene: Scene, f: F1, b: int) -> V3:
    """Return the acceleration of body b's cg."""
    if b == len(scene.bodies.mass):
        return (0.0, 0.0, 0.0)
    at = BODY_SIZE * b + 7
    return (f[at], f[at + 1], f[at + 2])


@jitable
def depth_bend(scene: Scene, f: F1, s: int) -> float:
    """Return the second rate of the depth of slot s that accelerations make, d'' of d."""
    gi, gj = sides(scene, s)
    i, j = thrust(scene, f, scene.graphics.body[gi]), thrust(scene, f, scene.graphics.body[gj])
    return -dot(sub(i, j), vector(scene.state.n[s]))


@jitable
def step_to_leave(scene: Scene, f: F1, s: int, h: float) -> float:
    """Return the step that ends where the force of the parting slot s ends or comes back.

    A step across such a place is one whose error estimate may vanish by chance, and those
    that do are the ones that are taken; one that ends there may be too long to see its error, and
    ends sooner then, as `seen_part` has it. d + d' t + d'' t^2 / 2 = 0 when it leaves; the force
    falls on the way, so this is too soon at first and exact at last. The damper of a fast
    separation can outweigh the spring: then the force is 0 sooner, and as the damper fades with
    depth it comes back just before the shapes part.
    """
    state, c, m = scene.state, contact_of(scene, s), scene.bodies.mass
    gi, gj = sides(scene, s)
    bi, bj = scene.graphics.body[gi], scene.graphics.body[gj]
    depth, rate, bend = state.depth[s], state.rate[s], depth_bend(scene, f, s)
    square = rate * rate - 2.0 * bend * depth
    if square < 0.0:
        return math.inf
    leave = 2.0 * depth / (math.sqrt(square) - rate)
    pushes = state.normal[s] > 0.0
    inverse = (1.0 / m[bi] if bi < len(m) else 0.0) + (1.0 / m[bj] if bj < len(m) else 0.0)
    # what friction keeps ends with the contact, which is to be seen
    keeps = scene.contacts.memory[c] > 0
    if not keeps and leave < h and is_over(scene, c, depth, state.normal[s], h * inverse):
        return h
    if pushes and leave < 2.0 * h:
        last = seen_part(scene, c, depth, leave * inverse)
        if last < 0.9:
            least = ROUNDING * scene.world.scale[SCALE_LENGTH] / -rate
            h = min(h, max(min(SEEN, 1.0 - last) * leave, least))
    if leave > h and pushes_at(scene, c, h, depth, rate, bend) == pushes:
        return h
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
    # a little more, so that it is over then; a way that rounding swallows would never be gone
    return max(1.0001 * leave, ROUNDING * scene.world.scale[SCALE_LENGTH] / -rate)


@jitable
def step_to_ramp(scene: Scene, f: F1, s: int, h: float) -> float:
    """Return the step that ends where the depth of slot s passes dmax; h where it does not in h.

    There the damper's curvature jumps, so that a step across it is taken where its error estimate
    vanishes by chance. dmax = d + d' t + d'' t^2 / 2, the first such t.
    """
    state, dmax = scene.state, scene.contacts.dmax[contact_of(scene, s)]
    if dmax == 0.0:
        return h
    travel, rate, bend = dmax - state.depth[s], state.rate[s], depth_bend(scene, f, s)
    square = rate * rate + 2.0 * bend * travel
    if not travel * rate > 0.0 or square < 0.0:
        return h
    t = 2.0 * travel / (rate + math.copysign(math.sqrt(square), rate))
    return t if AT_BEGIN * h < t < h else h


@jitable
def longest_touching(scene: Scene, f: F1, h: float) -> float:
    """Return how much of a step h may be tried so that no force bends sharply or ends within it.

    What goes deeper does not leap through: ends of steps see that it is about to pass.
    """
    state, longest = scene.state, h
    for k in range(state.hit[len(state.hit) - 1]):
        s = state.hit[k]
        if state.rate[s] < 0.0:
            longest = min(longest, step_to_leave(scene, f, s, longest))
        else:
            deeper, bend = deeper_at_once(scene, scene.slots.pair[s]), depth_bend(scene, f, s)
            longest = min(longest, time_for(deeper, state.rate[s], max(0.0, bend)))
        longest = step_to_ramp(scene, f, s, longest)
    return longest


@jitable
def step_to_touch(scene: Scene, y: F1, f: F1, pair: int, h: float) -> float:
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
        if work.points[k, AT_DEPTH] > work.points[s, AT_DEPTH]:
            s = k
    gap, bi, bj = -work.points[s, AT_DEPTH], graphics.body[gi], graphics.body[gj]
    if gap < 0.0:
        return math.inf
    p, n = vector(work.points[s, AT_POINT:]), vector(work.points[s, AT_NORMAL:])
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
    if scene.kinds.kernel[pairs.kind[pair]] == 0:
        # found by iterations, which leave more than rounding
        return t + first if t < first else (1.0 - 1e-6) * t
    shortest = ROUNDING * scene.world.scale[SCALE_LENGTH] / speed
    c = contact_of(scene, s)
    first *= seen_part(scene, c, first * speed, first / mass)
    first = min(first, max(longest_at_jump(scene, c, first * speed, speed, mass), shortest))
    part = min(BEFORE, BEFORE_OVER_TOL * scene.audit.plan[AUDIT_TOL])
    before = max(part * first, shortest)
    return t + first if t < 10.0 * before else t - before


@jitable
def plane_speed(scene: Scene, y: F1, g: int) -> float:
    """Return how fast plane g comes towards points at its lever's distance, see `plane_travel`."""
    frame, b = scene.work.frames[g], scene.graphics.body[g]
    n = (frame[5], frame[8], frame[11])
    # both along global axes: the spin in the state is along the body's own
    turning = cross(vector(scene.work.w[b]), n)
    v = velocity_at(scene, y, b, vector(frame))
    return abs(dot(n, v)) + norm(turning) * scene.broadphase.lever[g]


@jitable
def longest_stay(scene: Scene, y: F1, f: F1) -> float:
    """Return a step in which no shape of a large contact leaves where the list of near pairs holds.

    Speed and acceleration of all shapes are left in `work.speed`.
    """
    graphics, work = scene.graphics, scene.work
    longest = math.inf
    for g in range(len(graphics.body)):
        b = graphics.body[g]
        if b < len(scene.bodies.mass):
            radius = graphics.radius[g] + norm(vector(graphics.p[g]))
            at = BODY_SIZE * b
            turning = norm((y[at + AT_W], y[at + AT_W + 1], y[at + AT_W + 2]))
            speed = norm((y[at + AT_V], y[at + AT_V + 1], y[at + AT_V + 2]))
            # a plane, which has no reach, is never passed through
            speed += turning * radius if radius < math.inf else 0.0
            push = norm((f[at + AT_V], f[at + AT_V + 1], f[at + AT_V + 2]))
            work.speed[g, FASTEST_POINT], work.speed[g, CENTRE_ACCELERATION] = speed, push
            room = scene.broadphase.room[g]
            if room < math.inf:
                if radius == math.inf:
                    speed = plane_speed(scene, y, g)
                longest = min(longest, time_for(0.9 * room, speed, push))
    return longest


@jitable
def longest_in_touch(scene: Scene, y: F1, f: F1, pair: int, h: float, longest: float) -> float:
    """Return a step that no mesh in touch can use to pass through another place of the pair."""
    asked = min(h, longest) if h > 0.0 else longest
    passing = scene.world.hooks[Hook.PASSING]
    return call_float(passing, (scene, pair, asked, y, f))


@jitable
def longest_travel(scene: Scene, y: F1, f: F1, h: float) -> float:
    """Return a step that no pair can use to pass through: gap plus thickness at closing speed.

    A step of length h, the one intended, ends where a pair begins to touch; h is 0 for steps of
    methods without error estimate.
    """
    pairs, graphics, work = scene.pairs, scene.graphics, scene.work
    longest = longest_stay(scene, y, f)
    for k in range(pairs.count[ACTIVE]):
        pair = pairs.active[k]
        i, j = pairs.graphic_i[pair], pairs.graphic_j[pair]
        if pairs.touches[pair] > 0:
            # in touch the stages feel the force, and sliding along is no approach
            if scene.kinds.bound[pairs.kind[pair]] != 0:
                longest = min(longest, longest_in_touch(scene, y, f, pair, h, longest))
            continue
        left = max(pairs.left[pair], 0.0)
        speed = work.speed[i, FASTEST_POINT] + work.speed[j, FASTEST_POINT]
        push = work.speed[i, CENTRE_ACCELERATION] + work.speed[j, CENTRE_ACCELERATION]
        # half of the thinner shape: a step may bury it no deeper before it is seen; what a
        # half-space has swallowed it still pushes out, so nothing passes through a plane
        thin = 0.5 * min(graphics.thin[i], graphics.thin[j])
        if not (math.isinf(graphics.thin[i]) or math.isinf(graphics.thin[j])):
            seen = time_for(left + thin, speed, push)
            if h == 0.0:
                # as many steps as are taken until they are found anew, or each of them
                seen = max(seen / STABLE_EVERY, time_for(thin, speed, push))
            longest = min(longest, seen)
        if time_for(left, speed, push) < min(h, longest):
            longest = min(longest, step_to_touch(scene, y, f, pair, min(h, longest)))
    return longest


@jitable
def longest_step(scene: Scene, y: F1, f: F1, h: float) -> float:
    """Return how much of h may be tried: nothing passes through, no parting is leapt over.

    Less than 0 where a force in touch bends or ends there: what is behind is no faster than before.
    """
    touching, travel = longest_touching(scene, f, h), longest_travel(scene, y, f, h)
    return -touching if touching < min(h, travel) else min(touching, travel)
