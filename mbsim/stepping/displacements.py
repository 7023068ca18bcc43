"""Where bodies go in a step, by their velocities before and behind what they hit in it.

    q' = q moved on for h by c v + (1 - c) v' + 1/2 (c^2 - (1 - c)^2) d,   d = v_flight - v

c is the part of the step before an impact with restitution, d what accelerates a body before and
behind it: forces, and contacts that carry it as they did in the last step. c is 1/2 for bodies on
which no contact closes in the step, without d, and 0 for those that a contact stops. Bodies that
press on each other have one c, the smallest, and d only where nothing but impacts, and what carries
them, presses on them, or on any that they are pressed together with for longer than an impact.
"""

from __future__ import annotations

import math

from mbsim.arrays.scene import Scene
from mbsim.core.arrays import F1
from mbsim.core.jitable import jitable
from mbsim.core.layout import AT_Q, AT_V, AT_W, BODY_SIZE
from mbsim.core.rotation import matrix_from_quaternion, norm, unrotate, vector
from mbsim.dynamics.bodies.awake import bodies_awake, body_awake
from mbsim.dynamics.bodies.configuration import turn
from mbsim.dynamics.bodies.kinematics import place_bodies
from mbsim.stepping.arrays import (
    ASLEEP,
    LEFT_SPEED,
    POINTS,
    SLOP,
    STEP_LENGTH,
    W_NN,
    Stepping,
)
from mbsim.stepping.carried import carries, find_what_goes_on
from mbsim.stepping.one_point import velocity_of
from mbsim.stepping.scales import group_at

#: Of `Points.part` and `Motion.part`: no impact with restitution.
NO_IMPACT = 2.0
#: Entries of `Motion.flies`: something presses on a body beside impacts; it flies up to an impact
#: and rests behind it; it flies behind it too.
PRESSED, LANDS, FLIES = 0.0, 1.0, 2.0
#: A velocity that changes by more than so many times what forces without contacts change has
#: jumped.
JUMPS = 10.0


@jitable
def meets_at(gap: float, h: float, before: float, free: float) -> float:
    """Return the part of a step h at which a gap is closed first, by velocities at its ends.

    They grow evenly: gap/h + before p + (free - before)/2 p^2 = 0. At most 1.
    """
    a, c = 0.5 * (free - before), max(gap, 0.0) / h
    root = math.sqrt(max(before * before - 4.0 * a * c, 0.0))
    if before < 0.0:
        return min(2.0 * c / (root - before), 1.0)
    return min((before + root) / (-2.0 * a), 1.0) if a < 0.0 else 1.0


@jitable
def start_parts(scene: Scene, S: Stepping, count: int, h: float) -> None:
    """Fill what each point that presses makes of the way of its two bodies."""
    P, M, ground = S.points, S.motion, len(S.rest.body)
    M.part[ground] = M.touch[ground] = NO_IMPACT
    M.flies[ground] = FLIES
    for row in range(bodies_awake(scene)):
        b = body_awake(scene, row)
        M.part[b] = M.touch[b] = NO_IMPACT
        M.flies[b] = FLIES
    for k in range(count):
        if P.r[k, 0] == 0.0:
            continue
        i, j = P.body[k, 0], P.body[k, 1]
        part, touch, flies = P.part[k], P.part[k], FLIES if P.ahead[k] < 0.0 else LANDS
        if part == NO_IMPACT:
            flies = FLIES if carries(S, k) else PRESSED
            after = velocity_of(P, k, 0, M.v)
            if 0.5 * h * abs(after - P.closing[k]) > S.plan.scale[group_at(S, k), SLOP]:
                free = velocity_of(P, k, 0, M.flight)
                flies = PRESSED
                part, touch = 0.0, meets_at(P.gap[k], h, P.closing[k], free)
        for b in (i, j):
            M.part[b], M.touch[b] = min(M.part[b], part), min(M.touch[b], touch)
            M.flies[b] = min(M.flies[b], flies)


@jitable
def take_least(S: Stepping, i: int, j: int, lasts: bool) -> bool:
    """Let two bodies go their ways as one; return whether that changes something.

    Before an impact, and behind it where it throws them apart, each of them flies or does not.
    """
    M = S.motion
    same = M.part[i] == M.part[j] and M.touch[i] == M.touch[j]
    M.part[i] = M.part[j] = min(M.part[i], M.part[j])
    M.touch[i] = M.touch[j] = min(M.touch[i], M.touch[j])
    if lasts and M.flies[i] != M.flies[j]:
        M.flies[i] = M.flies[j] = min(M.flies[i], M.flies[j])
        return True
    return not same


@jitable
def spread_parts(scene: Scene, S: Stepping, count: int, h: float) -> None:
    """Find the bodies that a contact stops in the step, all that press on them, and joints hold.

    Between two bodies of different parts a contact that stays closed would open or go deeper. What
    goes on as if nothing hit it has no part of an impact: what meets it flies there, and on, as if
    it was ground.
    """
    P, plan, goes_on = S.points, S.plan, S.motion.goes_on
    start_parts(scene, S, count, h)
    find_what_goes_on(scene, S, h)
    changed = True
    while changed:
        changed = False
        for k in range(count):
            i, j = P.body[k, 0], P.body[k, 1]
            if P.r[k, 0] != 0.0 and goes_on[i] == 0 and goes_on[j] == 0:
                changed = take_least(S, i, j, P.part[k] == NO_IMPACT) or changed
        for g in range(len(plan.first) - 1):
            first = plan.members[plan.first[g]]
            for m in range(plan.first[g] + 1, plan.first[g + 1]):
                changed = take_least(S, first, plan.members[m], True) or changed
    for row in range(bodies_awake(scene)):
        b = body_awake(scene, row)
        if S.motion.part[b] == NO_IMPACT:
            S.motion.part[b] = 0.5
    if S.motion.part[len(S.rest.body)] == NO_IMPACT:
        S.motion.part[len(S.rest.body)] = 0.5


@jitable
def is_hit(S: Stepping, b: int) -> bool:
    """Return whether an impact divides the way of a body that nothing else presses on."""
    return S.motion.touch[b] != NO_IMPACT and S.motion.flies[b] != PRESSED


@jitable
def shift_of(S: Stepping, b: int, c: int) -> float:
    """Return component c of a body's displacement over the step's length."""
    M, part, bent = S.motion, S.motion.part[b], 0.0
    if is_hit(S, b):
        bent = 0.5 * part * part
        if M.flies[b] == FLIES:
            bent -= 0.5 * (1.0 - part) * (1.0 - part)
    shift = part * M.before[b, c] + (1.0 - part) * M.v[b, c]
    if bent != 0.0:
        shift += bent * (M.flight[b, c] - M.before[b, c])
    return shift


@jitable
def fill_shift(scene: Scene, S: Stepping) -> None:
    """Fill displacements over the step's length."""
    for k in range(bodies_awake(scene)):
        b = body_awake(scene, k)
        for c in range(6):
            S.motion.shift[b, c] = shift_of(S, b, c)


@jitable
def comes_at(S: Stepping, k: int) -> float:
    """Return how fast point k closes: at the step's begin, or before an impact in it.

    What rises at its begin may come down within it. Of what other points hold, and would come
    there alone, the solver may leave an impulse of a few times what it may leave.
    """
    P, left = S.points, JUMPS * S.plan.scale[group_at(S, k), LEFT_SPEED]
    speed = P.closing[k]
    if P.part[k] != NO_IMPACT and P.given[k, W_NN] * P.r[k, 0] > left:
        met = speed + P.part[k] * (velocity_of(P, k, 0, S.motion.flight) - speed)
        speed = min(speed, met)
    return -speed


@jitable
def velocities_jump(scene: Scene, S: Stepping) -> bool:
    """Return whether some body met another one in the step: velocities jump within it."""
    P, M, judged = S.points, S.motion, S.plan.scale
    for k in range(S.tally.count[POINTS]):
        if P.r[k, 0] > 0.0 and comes_at(S, k) > judged[group_at(S, k), LEFT_SPEED]:
            return True
    if S.tally.count[POINTS] == 0:
        return False
    for k in range(bodies_awake(scene)):
        b = body_awake(scene, k)
        v, free, before = M.v[b], M.free[b], M.before[b]
        jump = norm((v[0] - before[0], v[1] - before[1], v[2] - before[2]))
        usual = norm((free[0] - before[0], free[1] - before[1], free[2] - before[2]))
        if jump > judged[S.plan.connected[b], LEFT_SPEED] + JUMPS * usual:
            return True
    return False


@jitable
def move_bodies(scene: Scene, S: Stepping, y: F1, h: float, new: F1) -> None:
    """Write positions and velocities after the step."""
    M = S.motion
    for k in range(bodies_awake(scene)):
        b = body_awake(scene, k)
        at, R = BODY_SIZE * b, scene.work.R[b]
        if S.rest.body[b, ASLEEP] == 1:
            for c in range(at, at + BODY_SIZE):
                new[c] = y[c]
            continue
        for c in range(3):
            new[at + c] = y[at + c] + h * M.shift[b, c]
            new[at + AT_V + c] = M.v[b, c]
        w = unrotate(R, (M.shift[b, 3], M.shift[b, 4], M.shift[b, 5]))
        turn(y, at, h, w[0], w[1], w[2], new)
        length = math.sqrt(
            new[at + 3] ** 2 + new[at + 4] ** 2 + new[at + 5] ** 2 + new[at + 6] ** 2
        )
        for c in range(4):
            new[at + AT_Q + c] /= length
        matrix_from_quaternion(new[at + AT_Q : at + AT_V], R)
        w = unrotate(R, vector(M.v[b, 3:]))
        for c in range(3):
            new[at + AT_W + c] = w[c]


@jitable
def way_within(S: Stepping, b: int, c: int, s: float) -> float:
    """Return component c of what a body has gone at the part s of the step, over its length."""
    M = S.motion
    before, after, touch = M.before[b, c], M.v[b, c], M.touch[b]
    if touch == NO_IMPACT:
        return s * (before + 0.5 * s * (after - before))
    d = M.flight[b, c] - before if M.flies[b] != PRESSED else 0.0
    if s < touch:
        return s * (before + 0.5 * s * d)
    left = 1.0 - s
    if M.flies[b] == FLIES:
        return M.shift[b, c] - left * (after - 0.5 * left * d)
    met = touch * (before + 0.5 * touch * d)
    return M.shift[b, c] - left / (1.0 - touch) * (M.shift[b, c] - met) if left > 0.0 else 0.0


@jitable
def place_within(scene: Scene, S: Stepping, y: F1, s: float, out: F1) -> None:
    """Write where bodies are at a part s < 1 of the step that was tried last, which began at y.

    Up to where a body meets something it flies; behind that it goes where the step ends. Its
    displacements are lost by that; velocities are those of the step's end.
    """
    M, h = S.motion, S.tally.number[STEP_LENGTH]
    place_bodies(scene, y)
    for k in range(BODY_SIZE * len(scene.bodies.mass), len(y)):
        out[k] = y[k]
    for k in range(bodies_awake(scene)):
        b = body_awake(scene, k)
        for c in range(BODY_SIZE * b, BODY_SIZE * (b + 1)):
            out[c] = y[c]
        for c in range(6):
            M.shift[b, c] = way_within(S, b, c, s)
    move_bodies(scene, S, y, h, out)
