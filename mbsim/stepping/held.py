"""What impulses at contact points do to bodies that joints hold or implicit forces couple.

An impulse moves all bodies of a group then. What it does to them takes a solution of the group's
linear system, for each of its three components; or, where a body has many points, for each of the
six components of a wrench on the body, of which the impulses of all its points are made. Where the
tree of joints is all that holds them, the impulses of five points are answered at once.
"""

from __future__ import annotations

from mbsim.arrays.hooks import Hook, Joints, note_failure
from mbsim.arrays.scene import Scene
from mbsim.core.address import call_int
from mbsim.core.jitable import jitable
from mbsim.core.rotation import scale, vector
from mbsim.dynamics.constraints.impulses import (
    add_impulse,
    answer_columns,
    clear_columns,
    write_column,
)
from mbsim.dynamics.constraints.in_use import active_count
from mbsim.stepping.arrays import ALL_ANSWERS, AXES, POINTS, TURN, Stepping
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
                P.moves[row, a, c] += part * answer[c, e]


@jitable
def comes_in_columns(scene: Scene, S: Stepping) -> bool:
    """Return whether what impulses do is found for several points at once: no equations hold."""
    return active_count(scene) == 0 and not is_implicit(S)


@jitable
def root_of(scene: Scene, b: int) -> int:
    """Return the root of a body's tree, -1 if no joint holds it."""
    at = scene.tree.of_body[b]
    return scene.tree.root[at] if at >= 0 else -1


@jitable
def list_by_trees(scene: Scene, S: Stepping) -> None:
    """Fill which points each tree has: `Motion.listed` by roots, then `Points.listed`.

    Entries are 2 k + side, 0 is none: they are counted from 2 on.
    """
    P, listed = S.points, S.motion.listed
    for at in range(len(scene.tree.body)):
        listed[at] = 0
    for k in range(S.tally.count[POINTS] - 1, -1, -1):
        if P.wide[k] < 0:
            continue
        i, j = root_of(scene, P.body[k, 0]), root_of(scene, P.body[k, 1])
        for side, root in ((0, i), (1, j if j != i else -1)):
            if root >= 0:
                P.listed[k, side] = listed[root]
                listed[root] = 2 * k + side + 2


@jitable
def load_point(scene: Scene, S: Stepping, root: int, k: int, column: int) -> None:
    """Fill three columns of forces on the tree at `root` by unit impulses at point k."""
    P, M, tree = S.points, S.motion, scene.tree
    for side in range(2):
        at = tree.of_body[P.body[k, side]]
        if at < 0 or tree.root[at] != root:
            continue
        if M.loaded[at] == 0:
            M.loaded[at] = 1
            clear_columns(M.columns[at])
        row, sign = P.given[k], 1.0 - 2.0 * side
        for a in range(3):
            push = scale(sign, vector(row, AXES + 3 * a))
            turn = scale(sign, vector(row, TURN + 9 * side + 3 * a))
            add_impulse(scene, at, M.columns[at], column + a, push, turn)


@jitable
def keep_answers(scene: Scene, S: Stepping, root: int, k: int, column: int) -> None:
    """Fill what impulses at point k do to the bodies of the tree at `root`.

    With the first tree that the point has, to bodies that it moves alone or not at all, too.
    """
    P, tree = S.points, scene.tree
    i, j = P.body[k, 0], P.body[k, 1]
    roots = root_of(scene, i), root_of(scene, j)
    first = root == (roots[0] if roots[0] >= 0 else roots[1])
    for row in range(P.wide[k], P.wide[k] + P.many[k]):
        b, moves = P.moved[row], P.moves[row]
        at, its = tree.of_body[b], root_of(scene, b)
        if its == root:
            for a in range(3):
                write_column(scene, at, S.motion.columns[at], column + a, moves[a])
        elif first and (its < 0 or its not in roots):
            side = 0 if b == i else 1
            for a in range(3):
                for c in range(6):
                    moves[a, c] = alone(P, k, side, a, c) if at < 0 else 0.0


@jitable
def answer_tree_points(scene: Scene, S: Stepping, root: int) -> None:
    """Fill what impulses at the points of a tree do, for `AT_ONCE` columns in turn."""
    P, M, batch = S.points, S.motion, S.motion.batch
    entry, count = M.listed[root], 0
    while entry > 0:
        k, side = (entry - 2) // 2, (entry - 2) % 2
        load_point(scene, S, root, k, 3 * count)
        batch[count] = k
        count += 1
        entry = P.listed[k, side]
        if entry > 0 and count < len(batch):
            continue
        answer_columns(scene, root, M.columns, M.shares, M.loaded)
        S.tally.count[ALL_ANSWERS] += 3 * count
        for place in range(count):
            keep_answers(scene, S, root, batch[place], 3 * place)
        count = 0


@jitable
def answer_listed(scene: Scene, S: Stepping) -> None:
    """Fill what impulses do at all points of held bodies that `widen` has listed alone."""
    if not comes_in_columns(scene, S):
        return
    list_by_trees(scene, S)
    for at in range(len(scene.tree.body)):
        if S.motion.listed[at] > 0:
            answer_tree_points(scene, S, at)


@jitable
def widen(scene: Scene, S: Stepping, k: int, begin: int) -> bool:
    """Fill what impulses at point k do where joints or forces hold its bodies: rows from `begin`.

    Where that comes in columns it is left to `answer_listed`. Return False if there is no room.
    """
    P, plan, impulse = S.points, S.plan, S.motion.impulse
    P.wide[k] = -1
    if plan.group[P.body[k, 0]] < 0 and plan.group[P.body[k, 1]] < 0:
        return True
    P.wide[k] = begin
    if not list_moved(S, k):
        return False
    if comes_in_columns(scene, S):
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
                    P.moves[row, a, c] = alone(P, k, side, a, c)
                else:
                    found = unknown[0] or unknown[1]
                    P.moves[row, a, c] = impulse[6 * b + c] if found else 0.0
        for side in range(2):
            if known[side]:
                add_answer(S, k, side, a)
    return True
