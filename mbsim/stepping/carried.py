"""What carries a body while something else hits it: contacts that press as in the last step.

A body that lies on others is accelerated against nothing, and goes on as it moves, while what flies
at it falls. What the contacts of the last step did says so: their impulses, over this step, are
added to what forces without contacts do. Of bodies that joints or forces hold together they move
all, so each such group flies, goes on and rests as one.
"""

from __future__ import annotations

from mbsim.arrays.scene import Scene
from mbsim.core.arrays import F2, V3
from mbsim.core.jitable import jitable
from mbsim.core.rotation import cross, dot, norm, scale, vector
from mbsim.dynamics.bodies.awake import bodies_awake, body_awake
from mbsim.stepping.arrays import (
    KEPT_ARMS,
    KEPT_BODY_I,
    KEPT_FORCE,
    KEPT_HIT_I,
    SLEEPING_ROWS,
    SLOP,
    Stepping,
)
from mbsim.stepping.held import begin_impulse, turn_into_velocities
from mbsim.stepping.scales import distance, group_at, speed_of

#: Two velocities of a body are not the same if they differ by more than this part of what forces
#: without contacts change of its velocity in the step.
OTHERWISE = 0.1
#: Contacts hold a body whose velocity changes by no more than this part of that.
HELD_UP = 0.9
#: What is accelerated by no more than this part of that, and lies, stays there.
NOTHING = 0.01
#: What comes from afar does so by more than so many times what counts.
APART = 10.0


@jitable
def is_carried(S: Stepping, b: int) -> bool:
    """Return whether contacts take something off what accelerates a body."""
    return norm(vector(S.motion.carried[b])) + norm(vector(S.motion.carried[b], 3)) > 0.0


@jitable
def carries(S: Stepping, k: int) -> bool:
    """Return whether point k presses as it did in the last step, as far as flights say."""
    i, j, ground = S.points.body[k, 0], S.points.body[k, 1], len(S.rest.body)
    known = (i == ground or is_carried(S, i)) and (j == ground or is_carried(S, j))
    return known and S.points.was[k] >= 0


@jitable
def comes_from_afar(S: Stepping, k: int, h: float) -> bool:
    """Return whether point k is apart at the step's begin, or comes in by a way that counts.

    What rolls on, held by joints, comes to a surface and leaves it by what a step turns it.
    """
    near = APART * S.plan.scale[group_at(S, k), SLOP]
    return S.points.gap[k] > near or h * S.points.closing[k] < -near


@jitable
def leads(S: Stepping, b: int) -> bool:
    """Return whether a body is the first one of those that joints or forces hold together."""
    plan = S.plan
    return plan.group[b] < 0 or plan.members[plan.first[plan.group[b]]] == b


@jitable
def distance_held(S: Stepping, b: int, v: F2, w: F2) -> float:
    """Return the largest `distance` of a body and of those that joints or forces hold to it."""
    plan, g, most = S.plan, S.plan.group[b], 0.0
    if g < 0:
        return distance(S, b, v, w)
    for row in range(plan.first[g], plan.first[g + 1]):
        most = max(most, distance(S, plan.members[row], v, w))
    return most


@jitable
def fly_to(S: Stepping, b: int, v: F2) -> None:
    """Let a body, and those that joints or forces hold to it, fly to velocities v."""
    M, plan, g = S.motion, S.plan, S.plan.group[b]
    if g < 0:
        M.flight[b, :] = v[b]
        return
    for row in range(plan.first[g], plan.first[g + 1]):
        M.flight[plan.members[row], :] = v[plan.members[row]]


@jitable
def rests_alone(S: Stepping, b: int, h: float) -> bool:
    """Return whether a body goes no way in the step that counts, and others hold it there.

    What turns round in the air changes its velocity by more.
    """
    M, slop = S.motion, S.plan.scale[S.plan.connected[b], SLOP]
    if h * max(speed_of(S, b, M.before), speed_of(S, b, M.v)) > slop:
        return False
    return distance(S, b, M.v, M.before) <= HELD_UP * distance(S, b, M.free, M.before)


@jitable
def rests(S: Stepping, b: int, h: float) -> bool:
    """Return whether a body rests, and those that joints or forces hold to it."""
    plan, g = S.plan, S.plan.group[b]
    if g < 0:
        return rests_alone(S, b, h)
    for row in range(plan.first[g], plan.first[g + 1]):
        if not rests_alone(S, plan.members[row], h):
            return False
    return True


@jitable
def find_what_goes_on(scene: Scene, S: Stepping, h: float) -> None:
    """Note the bodies that others hold, and that go on as if nothing hit them."""
    M, plan = S.motion, S.plan
    M.goes_on[len(S.rest.body)] = 1
    for row in range(bodies_awake(scene)):
        b = body_awake(scene, row)
        if leads(S, b):
            off, alone = distance_held(S, b, M.v, M.flight), distance_held(S, b, M.free, M.before)
            little = off <= OTHERWISE * alone and h * off <= plan.scale[plan.connected[b], SLOP]
            M.goes_on[b] = 1 if (little and is_carried(S, b)) or rests(S, b, h) else 0
    for row in range(plan.first[len(plan.first) - 1]):
        b = plan.members[row]
        M.goes_on[b] = M.goes_on[plan.members[plan.first[plan.group[b]]]]


@jitable
def fill_flight(scene: Scene, S: Stepping) -> None:
    """Fill what bodies do in the step until they meet.

    What others carry is accelerated against nothing: what flies at it is, by its own forces.
    """
    M, ground = S.motion, len(S.rest.body)
    for c in range(6):
        M.flight[ground, c] = M.free[ground, c]
    for row in range(bodies_awake(scene)):
        b = body_awake(scene, row)
        for c in range(6):
            M.flight[b, c] = M.free[b, c] + M.carried[b, c]


@jitable
def lies(S: Stepping, b: int, h: float) -> bool:
    """Return whether a body goes no way that counts as it moves at the step's begin."""
    return h * speed_of(S, b, S.motion.before) <= S.plan.scale[S.plan.connected[b], SLOP]


@jitable
def impulse_of(S: Stepping, row: int, side: int, h: float) -> tuple[int, V3, V3]:
    """Return the body on a side of a kept contact point, -1 if it was hit, and its wrench by h.

    Of ground it is -1 too.
    """
    values = S.kept.table[row]
    b = int(values[KEPT_BODY_I + side])
    f = scale(h if side == 0 else -h, vector(values[KEPT_FORCE:]))
    if values[KEPT_HIT_I + side] == 1.0 or b == len(S.rest.body):
        b = -1
    return b, f, cross(vector(values, KEPT_ARMS + 3 * side), f)


@jitable
def changes(S: Stepping, b: int, c: int, f: V3, T: V3) -> float:
    """Return component c of what an impulse changes of the velocity of a body alone."""
    inverse = S.motion.inverse[b, c]
    return dot(vector(inverse), f) + dot(vector(inverse, 3), T)


@jitable
def settle_flight(S: Stepping, b: int, h: float) -> None:
    """Let a body, and what joints or forces hold to it, fly with what carries it.

    That is none where it is more than forces without contacts do.
    """
    M, plan, g = S.motion, S.plan, S.plan.group[b]
    alone = distance_held(S, b, M.free, M.before)
    if distance_held(S, b, M.flight, M.free) > (1.0 + OTHERWISE) * alone:
        fly_to(S, b, M.free)
    elif distance_held(S, b, M.flight, M.before) <= NOTHING * alone and lies(S, b, h):
        fly_to(S, b, M.before)
    first, last = (plan.first[g], plan.first[g + 1]) if g >= 0 else (0, 1)
    for row in range(first, last):
        m = plan.members[row] if g >= 0 else b
        for c in range(6):
            M.carried[m, c] = M.flight[m, c] - M.free[m, c]


@jitable
def find_carried(scene: Scene, S: Stepping, h: float) -> None:
    """Fill what contacts take off what accelerates free bodies, and how these fly.

    They press on as in the last step. Impacts are over with their step, also where they have done
    more to a body elsewhere. Of a body that went on all is taken: what held it has them too. Of
    bodies that joints or forces hold that is asked for where something hits, see `carry_held`.
    """
    M, kept = S.motion, S.kept
    M.known[0] = 1
    for row in range(bodies_awake(scene)):
        M.carried[body_awake(scene, row), :] = 0.0
    for row in range(kept.count[SLEEPING_ROWS], kept.count[0]):
        for side in range(2):
            b, f, T = impulse_of(S, row, side, h)
            if b >= 0 and S.plan.group[b] >= 0:
                M.known[0] = 0
            elif b >= 0:
                for c in range(6):
                    M.carried[b, c] += changes(S, b, c, f, T)
    fill_flight(scene, S)
    for row in range(bodies_awake(scene)):
        b = body_awake(scene, row)
        if S.plan.group[b] < 0 and is_carried(S, b):
            settle_flight(S, b, h)


@jitable
def carry_held(scene: Scene, S: Stepping, h: float) -> bool:
    """Fill as `find_carried` what contacts do to bodies that joints or forces hold.

    That takes a solution of their linear system. Return False if it is known, or is nothing.
    """
    M, kept, plan = S.motion, S.kept, S.plan
    if M.known[0] == 1:
        return False
    M.known[0] = 1
    begin_impulse(S)
    for row in range(kept.count[SLEEPING_ROWS], kept.count[0]):
        for side in range(2):
            b, f, T = impulse_of(S, row, side, h)
            if b >= 0 and plan.group[b] >= 0:
                in_tree = scene.tree.of_body[b] >= 0
                for c in range(6):
                    push = f[c] if c < 3 else T[c - 3]
                    M.impulse[6 * b + c] += push if in_tree else changes(S, b, c, f, T)
    turn_into_velocities(scene, S)
    for row in range(plan.first[len(plan.first) - 1]):
        b = plan.members[row]
        for c in range(6):
            M.flight[b, c] = M.free[b, c] + M.impulse[6 * b + c]
    for g in range(len(plan.first) - 1):
        settle_flight(S, plan.members[plan.first[g]], h)
    return True
