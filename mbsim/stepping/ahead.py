"""Pairs that meet within a step: where they will.

Impulses act there, with the arms and the normal of then. A sphere that comes down 5 mm within a
step would else be turned as if its radius were 2.5 mm more, and lose or gain spin by that.

Planes, spheres and boxes give points while they are apart, which say when they meet. Cylinders on
boxes and on each other, polyhedra, ellipsoids on what is not flat: apart, their closed forms give a
lower bound of the distance. Such a pair is moved ahead by no more than that bound lets it, again
and again, until it overlaps or the step is over (conservative advancement: B. Mirtich,
Impulse-based Dynamic Simulation of Rigid Body Systems, Berkeley 1996, section 2.3). Where it
overlaps its rows are contact points as of any other pair; their gaps are what the same motion
leaves of them at the step's begin. So nothing passes through anything, however thin. Lines and
faces that touch are pushed into each other by a little first: all their rows hold the bodies then,
not only the one that a rounding lets touch.
"""

from __future__ import annotations

import math

from mbsim.arrays.scene import Scene
from mbsim.core.arrays import F1, F2, V3
from mbsim.core.jitable import jitable
from mbsim.core.rotation import add, cross, dot, norm, scale, sub, vector
from mbsim.dynamics.bodies.kinematics import position
from mbsim.dynamics.contact.detection import measure_pair
from mbsim.dynamics.contact.forces import sides
from mbsim.geometry.catalog import AT_DEPTH, AT_NORMAL, AT_POINT, AT_WEIGHT
from mbsim.stepping.arrays import (
    KEPT_BODY_I,
    KEPT_BODY_J,
    POINTS,
    SLEEPING_ROWS,
    SLOP,
    SLOWEST,
    Motion,
    Stepping,
)
from mbsim.stepping.carried import carry_held, is_carried
from mbsim.stepping.displacements import meets_at
from mbsim.stepping.points import bodies_of, deepest_of, is_point, put_place, slop_of, take_rows
from mbsim.stepping.scales import group_at, noise_of

#: A pair goes ahead by this part of its whole motion at least, and so beyond where it touches.
LEAST_PART = 0.01
#: From where it touches it goes on by so much of the smaller shape, within the step: corners that
#: come down a little later in it are points too.
FURTHER = 0.02
#: Where it touches, rows count that are so much of its thinnest side apart, or what a step may
#: leave, but no more of that side than this: behind it another way out may be nearer.
TOUCHES, THIN = 1e-3, 0.05
#: Beside the row that carries most, one that carries less than this part is no point: where two
#: lines cross by a rounding their ends hold them.
LIGHT_PART = 0.01
#: How often the time is halved in which a pair comes to overlap.
HALVES = 10
#: A gap up to so many times the length that does not count is one of a body that lies on, or slides
#: along: where it meets is where it is.
NEAR_ENOUGH = 10.0
#: How often a pair that gives points while it is apart is measured where it is taken to meet at
#: most, as the normal of what passes by obliquely is another one there; and by what part of the
#: step that time changes no more.
MEETINGS, SETTLED = 4, 1e-9
#: Motions that are looked at before impulses are known: of both bodies with what carries them, and
#: without, and of either one alone, as what lies on something that is held, or is held by
#: something.
CARRIED, BOTH, ONLY_I, ONLY_J = range(4)


@jitable
def turned(w: V3, t: float, a: V3) -> V3:
    """Return vector a turned by angular velocity w for a time t."""
    size = norm(w)
    if size == 0.0:
        return a
    e, angle = scale(1.0 / size, w), size * t
    c, s = math.cos(angle), math.sin(angle)
    along = scale((1.0 - c) * dot(e, a), e)
    return add(add(scale(c, a), scale(s, cross(e, a))), along)


@jitable
def place_ahead(scene: Scene, y: F1, g: int, begin: F1, way: F1, t: float) -> None:
    """Write the frame of graphic g after a time t of the motion `way`; `begin` is that of now."""
    frame, x = scene.work.frames[g], position(scene, y, scene.graphics.body[g])
    w = (way[3], way[4], way[5])
    centre = add(add(x, scale(t, vector(way))), turned(w, t, sub(vector(begin), x)))
    for k in range(3):
        frame[k] = centre[k]
        axis = turned(w, t, (begin[3 + k], begin[6 + k], begin[9 + k]))
        for c in range(3):
            frame[3 + 3 * c + k] = axis[c]


@jitable
def fastest_point(scene: Scene, g: int, way: F1) -> float:
    """Bound how fast turning moves any point of graphic g."""
    spin = norm((way[3], way[4], way[5]))
    if spin == 0.0:
        return 0.0
    return spin * (scene.graphics.radius[g] + norm(vector(scene.graphics.p[g])))


@jitable
def measure_ahead(scene: Scene, S: Stepping, y: F1, pair: int, t: float) -> float:
    """Measure a pair after a time t of `M.way`, pushed on by `M.push`; return its largest depth."""
    M = S.motion
    gi, gj = scene.pairs.graphic_i[pair], scene.pairs.graphic_j[pair]
    place_ahead(scene, y, gi, M.frames[0], M.way[0], t)
    place_ahead(scene, y, gj, M.frames[1], M.way[1], t)
    for c in range(3):
        scene.work.frames[gi, c] -= M.push[c]
    measure_pair(scene, pair)
    return deepest_of(scene, S, pair)


@jitable
def push_on(scene: Scene, S: Stepping, pair: int, way: float) -> None:
    """Fill `M.push` of a measured pair: by how much less its first graphic is out of the other.

    That is along the normal where it is deepest. The pair's order may be another one than that of
    its rows.
    """
    first, deepest = scene.pairs.slot[pair], 0
    for row in range(1, S.plan.rows[scene.pairs.kind[pair]]):
        depth = scene.work.points[first + row, AT_DEPTH]
        deepest = row if depth > scene.work.points[first + deepest, AT_DEPTH] else deepest
    n = vector(scene.work.points[first + deepest, AT_NORMAL:])
    gi, _ = sides(scene, first + deepest)
    along = scale(way if gi == scene.pairs.graphic_i[pair] else -way, n)
    for c in range(3):
        S.motion.push[c] = along[c]


@jitable
def touching(scene: Scene, S: Stepping, gi: int, gj: int) -> float:
    """Return how far apart rows of a pair may be where it touches."""
    thin = 2.0 * min(scene.graphics.thin[gi], scene.graphics.thin[gj])
    return min(max(slop_of(scene, S, gi, gj), TOUCHES * thin), THIN * thin)


@jitable
def touch_by_bounds(
    scene: Scene, S: Stepping, y: F1, pair: int, h: float, depth: float, speed: float
) -> tuple[float, float]:
    """Return the time at which a pair overlaps first in a step h by `M.way`, and its depth then.

    It goes on by what the bound of their distance, -`depth` now, lets it. A depth of 0 or less is
    that of a pair that does not overlap.
    """
    t = 0.0
    while depth <= 0.0:
        if speed * (h - t) < -depth:
            break
        t += max(-depth / speed, LEAST_PART * h)
        if t > h:
            break
        depth = measure_ahead(scene, S, y, pair, t)
    return t, depth


@jitable
def touch_by_halves(
    scene: Scene, S: Stepping, y: F1, pair: int, h: float, most: float
) -> tuple[float, float]:
    """Return the time at which a pair overlaps first in a step h by `M.way`, and its depth then.

    Within the step nothing moves so far that it could pass through the other one: it is looked
    for between the begin, where it is apart, and the end, until it is no deeper than `most`.
    """
    low, t = 0.0, h
    depth = measure_ahead(scene, S, y, pair, h)
    for _ in range(HALVES):
        if depth <= most:
            break
        middle = 0.5 * (low + t)
        other = measure_ahead(scene, S, y, pair, middle)
        if other > 0.0:
            t, depth = middle, other
        else:
            low = middle
    if low > 0.0:
        # the last one that was measured may be apart
        depth = measure_ahead(scene, S, y, pair, t)
    return t, depth


@jitable
def find_touch(scene: Scene, S: Stepping, y: F1, pair: int, h: float, depth: float) -> float:
    """Return the time at which a pair overlaps first in a step h by `M.way`, -1 for never.

    `depth` is its largest one now. Its rows are those of that time, or a little later. Where it is
    no deeper then than `touching`, they are those of the pair pushed on by so much: an end of a
    line, or a corner of a face, that a rounding keeps from touching holds bodies as the others do.
    """
    gi, gj = scene.pairs.graphic_i[pair], scene.pairs.graphic_j[pair]
    a, b = S.motion.way[0], S.motion.way[1]
    push_on(scene, S, pair, 0.0)
    speed = norm((a[0] - b[0], a[1] - b[1], a[2] - b[2]))
    speed += fastest_point(scene, gi, a) + fastest_point(scene, gj, b)
    if not speed < math.inf or (depth <= 0.0 and speed == 0.0):
        return -1.0
    most = touching(scene, S, gi, gj)
    t = 0.0
    if depth <= 0.0:
        thin = 2.0 * min(scene.graphics.thin[gi], scene.graphics.thin[gj])
        if speed * h < -depth:
            return -1.0
        if speed * h <= THIN * thin:
            t, depth = touch_by_halves(scene, S, y, pair, h, most)
        else:
            t, depth = touch_by_bounds(scene, S, y, pair, h, depth, speed)
        if depth <= 0.0:
            return -1.0
    later = t
    push_on(scene, S, pair, max(most - depth, 0.0))
    if speed > 0.0:
        size = min(scene.graphics.radius[gi], scene.graphics.radius[gj])
        later = min(h, t + FURTHER * size / speed)
    if speed * (later - t) > most:
        back = vector(S.motion.push)
        push_on(scene, S, pair, 0.0)
        depth = measure_ahead(scene, S, y, pair, later)
        if depth > most:
            return later
        if depth > 0.0:
            t = later
            push_on(scene, S, pair, most - depth)
        else:
            for c in range(3):
                S.motion.push[c] = back[c]
    measure_ahead(scene, S, y, pair, t)
    return t


@jitable
def choose_way(scene: Scene, S: Stepping, pair: int, which: int, part: float = 1.0) -> None:
    """Fill `M.way` by the mean motion of the pair's bodies without impacts, or of one of them.

    It is that up to a part of the step.
    """
    M = S.motion
    end = M.flight if which == CARRIED else M.free
    for side in range(2):
        g = scene.pairs.graphic_i[pair] if side == 0 else scene.pairs.graphic_j[pair]
        b = scene.graphics.body[g]
        moves = which <= BOTH or which - ONLY_I == side
        for c in range(6):
            mean = M.before[b, c] + 0.5 * part * (end[b, c] - M.before[b, c])
            M.way[side, c] = mean if moves else 0.0


@jitable
def heaviest(scene: Scene, S: Stepping, pair: int) -> float:
    """Return the largest weight of the rows of a pair that overlaps."""
    most, first = 0.0, scene.pairs.slot[pair]
    for s in range(first, first + S.plan.rows[scene.pairs.kind[pair]]):
        if scene.work.points[s, AT_DEPTH] > 0.0:
            most = max(most, scene.work.points[s, AT_WEIGHT])
    return most


@jitable
def add_ahead(scene: Scene, S: Stepping, y: F1, s: int, pair: int, t: float, apart: bool) -> bool:
    """Take row s, measured at time t of `M.way`, as a contact point; False if there is no room."""
    P, M, point = S.points, S.motion, scene.work.points[s]
    gi, gj = sides(scene, s)
    k = put_place(scene, S, pair, s, gi, gj)
    if k < 0:
        return False
    n, push = vector(point[AT_NORMAL:]), vector(M.push)
    # half way between both surfaces, where what is pushed is back
    p = add(vector(point[AT_POINT:]), scale(0.5, push))
    pushed = dot(n, push)
    depth = point[AT_DEPTH] - (pushed if gi == scene.pairs.graphic_i[pair] else -pushed)
    # of what was apart each surface is where the other one's will be as they meet
    beyond = 0.5 * depth if apart else 0.0
    closing = 0.0
    for side in range(2):
        g, b = (gi, P.body[k, 0]) if side == 0 else (gj, P.body[k, 1])
        # the pair's order may be another one than the contact's
        way = M.way[0] if g == scene.pairs.graphic_i[pair] else M.way[1]
        v, w = vector(way), (way[3], way[4], way[5])
        x = position(scene, y, b)
        own = add(p, scale(-beyond if side == 0 else beyond, n))
        arm = sub(own, add(x, scale(t, v)))
        speed = dot(n, add(v, cross(w, arm)))
        closing += speed if side == 0 else -speed
        for c in range(3):
            P.arm[k, side, c] = arm[c]
            P.point[k, c] = x[c] + arm[c]
    P.gap[k] = -depth - t * closing
    if apart:
        P.gap[k] = max(P.gap[k], 0.0)
    else:
        S.tally.deepest[P.contact[k]] = max(S.tally.deepest[P.contact[k]], -P.gap[k])
    return True


@jitable
def take_ahead(scene: Scene, S: Stepping, y: F1, pair: int, t: float, apart: bool) -> bool:
    """Take what a pair has at time t of `M.way`, and put it back; False if there is no room."""
    first, M, points = scene.pairs.slot[pair], S.motion, scene.work.points
    room, least = True, LIGHT_PART * heaviest(scene, S, pair)
    for s in range(first, first + S.plan.rows[scene.pairs.kind[pair]]):
        some = points[s, AT_DEPTH] > 0.0 and points[s, AT_WEIGHT] > least
        if some and is_point(scene, pair, s):
            room = room and add_ahead(scene, S, y, s, pair, t, apart)
    M.taken[pair] = M.taken[len(M.taken) - 1]
    return room


@jitable
def put_back(scene: Scene, M: Motion, pair: int) -> None:
    """Let the frames of a pair be those of now."""
    for side in range(2):
        g = scene.pairs.graphic_i[pair] if side == 0 else scene.pairs.graphic_j[pair]
        for c in range(12):
            scene.work.frames[g, c] = M.frames[side, c]


@jitable
def keep_frames(scene: Scene, M: Motion, pair: int) -> None:
    """Keep the frames of a pair as they are now."""
    for side in range(2):
        g = scene.pairs.graphic_i[pair] if side == 0 else scene.pairs.graphic_j[pair]
        for c in range(12):
            M.frames[side, c] = scene.work.frames[g, c]


@jitable
def one_is_carried(scene: Scene, S: Stepping, pair: int, h: float) -> bool:
    """Return whether others carry one body of a pair in a step h, and the other one flies."""
    (i, j), ground = bodies_of(scene, pair), len(S.rest.body)
    if i == ground or j == ground:
        return False
    carry_held(scene, S, h)
    return is_carried(S, i) != is_carried(S, j)


@jitable
def look_ahead_of(scene: Scene, S: Stepping, y: F1, pair: int, h: float, depth: float) -> bool:
    """Take the points of a measured pair that meets within the step; False if there is no room."""
    M, room = S.motion, True
    keep_frames(scene, M, pair)
    for which in range(CARRIED if one_is_carried(scene, S, pair, h) else BOTH, ONLY_J + 1):
        choose_way(scene, S, pair, which)
        t = find_touch(scene, S, y, pair, h, depth)
        if t >= 0.0:
            room = take_ahead(scene, S, y, pair, t, depth <= 0.0)
            break
    put_back(scene, M, pair)
    return room


@jitable
def closing_speed(S: Stepping, k: int, velocity: F2) -> float:
    """Return how fast the gap of point k grows by velocities of bodies."""
    P, speed = S.points, 0.0
    for side in range(2):
        v = velocity[P.body[k, side]]
        w = cross((v[3], v[4], v[5]), vector(P.arm[k, side]))
        along = dot(vector(P.normal[k]), add(vector(v), w))
        speed += along if side == 0 else -along
    return speed


@jitable
def first_meeting(S: Stepping, first: int, h: float) -> float:
    """Return when one of the points from `first` on has an impact in a step h, else h.

    What comes too slowly for one is stopped where it is at the step's begin.
    """
    P, M, t = S.points, S.motion, h
    for k in range(first, S.tally.count[POINTS]):
        before, free = closing_speed(S, k, M.before), closing_speed(S, k, M.flight)
        if P.gap[k] + 0.5 * h * (before + free) < 0.0:
            part = meets_at(P.gap[k], h, before, free)
            slowest = max(S.rules.number[P.contact[k], SLOWEST], noise_of(S, group_at(S, k), h))
            if before + part * (free - before) < -slowest:
                t = min(t, part * h)
    return t


@jitable
def touches(S: Stepping, first: int) -> bool:
    """Return whether some point from `first` on is so near that it meets where it is."""
    for k in range(first, S.tally.count[POINTS]):
        if S.points.gap[k] <= NEAR_ENOUGH * S.plan.scale[group_at(S, k), SLOP]:
            return True
    return False


@jitable
def note_pressed(S: Stepping) -> None:
    """Note which bodies pressed on others that move in the last step."""
    kept, pressed, taken = S.kept, S.motion.pressed, S.motion.taken
    ground, now = len(pressed) - 1, taken[len(taken) - 1]
    for row in range(kept.count[SLEEPING_ROWS], kept.count[0]):
        i, j = int(kept.table[row, KEPT_BODY_I]), int(kept.table[row, KEPT_BODY_J])
        if i != ground and j != ground:
            pressed[i] = pressed[j] = now


@jitable
def take_where_it_meets(
    scene: Scene, S: Stepping, y: F1, pair: int, h: float, first: int, reach: float
) -> bool:
    """Let points of a pair, from `first` on, be those of where it meets; False if there is no room.

    What touches, or does not meet within the step, stays as it is. So does what slides over a round
    surface so near to it that the gap is one of the way along: seen from where it meets it would
    be none at the step's begin. Bodies that press on others go other ways than those without
    impulses, which say where it meets: those stay as they are too.
    """
    M, t, now = S.motion, h, S.motion.taken[len(S.motion.taken) - 1]
    i, j = bodies_of(scene, pair)
    if M.pressed[i] != now and M.pressed[j] != now and not touches(S, first):
        t = first_meeting(S, first, h)
    if t == h:
        return True
    room = True
    keep_frames(scene, M, pair)
    for c in range(3):
        M.push[c] = 0.0
    for _ in range(MEETINGS):
        choose_way(scene, S, pair, CARRIED, t / h)
        measure_ahead(scene, S, y, pair, t)
        S.tally.count[POINTS] = first
        begin = scene.pairs.slot[pair]
        for s in range(begin, begin + S.plan.rows[scene.pairs.kind[pair]]):
            if -scene.work.points[s, AT_DEPTH] < reach and is_point(scene, pair, s):
                room = room and add_ahead(scene, S, y, s, pair, t, True)
        before, t = t, first_meeting(S, first, h)
        if abs(t - before) <= SETTLED * h:
            break
    put_back(scene, M, pair)
    if touches(S, first):
        S.tally.count[POINTS] = first
        measure_pair(scene, pair)
        return take_rows(scene, S, y, pair, (-math.inf, reach))
    # its rows are not those of now
    M.measured[pair] = 0
    return room
