"""What impulses at contact points do to bodies that joints hold or implicit forces couple.

An impulse moves all bodies of a group then. What it does to them takes a solution of the group's
linear system, for each of its three components; or, where a body has many points, for each of the
six components of a wrench on the body, of which the impulses of all its points are made. Where the
tree of joints is all that holds them, the impulses of two points are answered at once.
"""

from __future__ import annotations

from mbsim.arrays.hooks import Hook, Joints, note_failure
from mbsim.arrays.scene import Scene
from mbsim.core.address import call_int
from mbsim.core.jitable import jitable
from mbsim.dynamics.constraints.impulses import answer_six, clear_six
from mbsim.dynamics.constraints.in_use import active_count
from mbsim.stepping.arrays import ALL_ANSWERS, POINTS, Stepping
from mbsim.stepping.implicit import is_implicit, yield_to_forces
from mbsim.stepping.one_point import alone, direction

#: Points of a body from which on six solutions for the body are less than three for each point.
MANY_POINTS = 3


@jitable
def begin_impulse(S: Stepping) -> None:
    """Let `Motion.impulse` be none."""
    for k in range(6 * len(S.motion.inverse)):
        S.motion.impulse[k] = 0.0


@jitable
def turn_into_velocities(scene: Scene, S: Stepping) -> None:
    """Replace `Motion.impulse` by what it changes of velocities.

    Bodies that no joint holds have their velocities by themselves there already.
    """
    joints, impulse = scene.world.hooks[Hook.JOINTS], S.motion.impulse
    S.tally.count[ALL_ANSWERS] += 1
    if joints != 0:
        note_failure(scene, call_int(joints, (scene, Joints.IMPULSE, 0.0, impulse, impulse)))
    if is_implicit(S):
        note_failure(scene, yield_to_forces(scene, S, impulse))


@jitable
def begin_answers(S: Stepping) -> None:
    """Forget what is known of held bodies, and count how many of the points each of them has."""
    P, plan = S.points, S.plan
    P.answered[0] = 0
    for row in range(plan.first[len(plan.first) - 1]):
        P.answer[plan.members[row]] = -1
        P.touches[plan.members[row]] = 0
    for k in range(S.tally.count[POINTS]):
        for side in range(2):
            if plan.group[P.body[k, side]] >= 0:
                P.touches[P.body[k, side]] += 1


@jitable
def answer_body(scene: Scene, S: Stepping, b: int) -> bool:
    """Return whether what wrenches on held body b do is in `Points.answers`; fill it if it pays."""
    P, plan, impulse = S.points, S.plan, S.motion.impulse
    if P.answer[b] >= 0:
        return True
    g = plan.group[b]
    begin, size = P.answered[0], plan.first[g + 1] - plan.first[g]
    if P.touches[b] < MANY_POINTS or begin + size > len(P.answers):
        return False
    P.answer[b], P.answered[0] = begin, begin + size
    for e in range(6):
        begin_impulse(S)
        if scene.tree.of_body[b] < 0:
            for c in range(6):
                impulse[6 * b + c] = S.motion.inverse[b, c, e]
        else:
            impulse[6 * b + e] = 1.0
        turn_into_velocities(scene, S)
        for row in range(size):
            m = plan.members[plan.first[g] + row]
            for c in range(6):
                P.answers[begin + row, c, e] = impulse[6 * m + c]
    return True


@jitable
def add_moved(S: Stepping, k: int, b: int) -> bool:
    """Let body b be one that point k moves; False if there is no room."""
    P = S.points
    row = P.wide[k] + P.many[k]
    if row >= len(P.moved):
        return False
    P.moved[row] = b
    P.many[k] += 1
    return True


@jitable
def list_group(S: Stepping, k: int, b: int, near: bool) -> bool:
    """Let all bodies of b's group that have points, or that have none, be moved by point k.

    Of b alone if nothing holds it. Return False if there is no room.
    """
    P, plan = S.points, S.plan
    g = plan.group[b]
    if g < 0:
        return not near or b == len(S.motion.inverse) or add_moved(S, k, b)
    for m in range(plan.first[g], plan.first[g + 1]):
        if (P.touches[plan.members[m]] > 0) == near and not add_moved(S, k, plan.members[m]):
            return False
    return True


@jitable
def list_moved(S: Stepping, k: int) -> bool:
    """Fill which bodies point k moves, behind those of the points before; False if no room.

    Those with points come first: the solver asks no others.
    """
    P, plan = S.points, S.plan
    P.many[k] = 0
    i, j = P.body[k, 0], P.body[k, 1]
    both = plan.group[j] < 0 or plan.group[j] != plan.group[i]
    for part in range(2):
        if not list_group(S, k, i, part == 0) or (both and not list_group(S, k, j, part == 0)):
            return False
        if part == 0:
            P.near[k] = P.many[k]
    return True


@jitable
def add_answer(S: Stepping, k: int, side: int, a: int) -> None:
    """Add what r_a of point k does by its wrench on a held body whose answer is known."""
    P, plan, b = S.points, S.plan, S.points.body[k, side]
    g = plan.group[b]
    for row in range(P.wide[k], P.wide[k] + P.many[k]):
        m = P.moved[row]
        if plan.group[m] != g:
            continue
        answer = P.answers[P.answer[b] + plan.place[m]]
        for e in range(6):
            part = direction(P, k, side, a, e)
            for c in range(6):
                P.moves[row, c, a] += part * answer[c, e]


@jitable
def comes_in_six(scene: Scene, S: Stepping) -> bool:
    """Return whether what impulses do is found for six at once: the tree of joints is all."""
    return active_count(scene) == 0 and not is_implicit(S)


@jitable
def root_of(scene: Scene, S: Stepping, b: int) -> int:
    """Return the root of a body's tree, -1 if no joint holds it."""
    return scene.tree.root[scene.tree.of_body[b]] if S.plan.group[b] >= 0 else -1


@jitable
def answer_points(scene: Scene, S: Stepping, first: int, second: int) -> None:
    """Fill what impulses at two points do, whose bodies are listed; `second` may be `first`."""
    P, plan, six = S.points, S.plan, S.motion.six
    i, j, m, n = P.body[first, 0], P.body[first, 1], P.body[second, 0], P.body[second, 1]
    roots = root_of(scene, S, i), root_of(scene, S, j), root_of(scene, S, m), root_of(scene, S, n)
    for k in (first, second):
        for row in range(P.wide[k], P.wide[k] + P.many[k]):
            clear_six(six[P.moved[row]])
    for part in range(2):
        k = first if part == 0 else second
        for side in range(2):
            b = P.body[k, side]
            if plan.group[b] >= 0:
                for a in range(3):
                    for c in range(6):
                        six[b, c, 3 * part + a] += direction(P, k, side, a, c)
    answer_six(scene, roots, six, S.motion.shares)
    S.tally.count[ALL_ANSWERS] += 6 if second != first else 3
    for part in range(2):
        k = first if part == 0 else second
        for row in range(P.wide[k], P.wide[k] + P.many[k]):
            b, moves = P.moved[row], P.moves[row]
            if plan.group[b] >= 0:
                found, e = six[b], 3 * part
                for c in range(6):
                    moves[c, 0], moves[c, 1] = found[c, e], found[c, e + 1]
                    moves[c, 2] = found[c, e + 2]
                continue
            side = 0 if b == P.body[k, 0] else 1
            for c in range(6):
                for a in range(3):
                    moves[c, a] = alone(P, k, side, a, c)


@jitable
def answer_listed(scene: Scene, S: Stepping) -> None:
    """Fill what impulses do at all points of held bodies that `widen` has listed alone."""
    P, before = S.points, -1
    if not comes_in_six(scene, S):
        return
    for k in range(S.tally.count[POINTS]):
        if P.wide[k] >= 0:
            if before >= 0:
                answer_points(scene, S, before, k)
                before = -1
            else:
                before = k
    if before >= 0:
        answer_points(scene, S, before, before)


@jitable
def widen(scene: Scene, S: Stepping, k: int, begin: int) -> bool:
    """Fill what impulses at point k do where joints or forces hold its bodies: rows from `begin`.

    Where that comes in six it is left to `answer_listed`. Return False if there is no room.
    """
    P, plan, impulse = S.points, S.plan, S.motion.impulse
    P.wide[k] = -1
    if plan.group[P.body[k, 0]] < 0 and plan.group[P.body[k, 1]] < 0:
        return True
    P.wide[k] = begin
    if not list_moved(S, k):
        return False
    if comes_in_six(scene, S):
        return True
    known = (
        plan.group[P.body[k, 0]] >= 0 and answer_body(scene, S, P.body[k, 0]),
        plan.group[P.body[k, 1]] >= 0 and answer_body(scene, S, P.body[k, 1]),
    )
    unknown = (
        plan.group[P.body[k, 0]] >= 0 and not known[0],
        plan.group[P.body[k, 1]] >= 0 and not known[1],
    )
    for a in range(3):
        if unknown[0] or unknown[1]:
            begin_impulse(S)
            for side in range(2):
                b = P.body[k, side]
                if unknown[side]:
                    answers_alone = scene.tree.of_body[b] < 0
                    for c in range(6):
                        e = direction(P, k, side, a, c)
                        impulse[6 * b + c] += alone(P, k, side, a, c) if answers_alone else e
            turn_into_velocities(scene, S)
        for row in range(begin, begin + P.many[k]):
            b = P.moved[row]
            side = 0 if b == P.body[k, 0] else 1
            for c in range(6):
                if plan.group[b] < 0:
                    P.moves[row, c, a] = alone(P, k, side, a, c)
                else:
                    found = unknown[0] or unknown[1]
                    P.moves[row, c, a] = impulse[6 * b + c] if found else 0.0
        for side in range(2):
            if known[side]:
                add_answer(S, k, side, a)
    return True
