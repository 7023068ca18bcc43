"""Points that a step misses before impulses are known: what these throw at others, or turn.

A pair that has none yet may meet by the motion that they give, and one that has some may go in
elsewhere: where an end of a line is hit, the other one, which is apart, comes down in the step.
"""

from __future__ import annotations

from mbsim.arrays.scene import Scene
from mbsim.core.arrays import F1
from mbsim.core.codes import Code
from mbsim.core.jitable import jitable
from mbsim.core.rotation import norm, sub, vector
from mbsim.dynamics.bodies.awake import graphic_awake, graphics_awake
from mbsim.dynamics.contact.detection import measure_pair
from mbsim.geometry.catalog import AT_DEPTH, AT_WEIGHT
from mbsim.stepping.ahead import (
    LIGHT_PART,
    add_ahead,
    fastest_point,
    find_touch,
    heaviest,
    keep_frames,
    measure_ahead,
    put_back,
    take_ahead,
    touching,
)
from mbsim.stepping.arrays import ASLEEP, POINTS, SOME_AHEAD, Stepping
from mbsim.stepping.awake import pair_awake, pairs_awake
from mbsim.stepping.pairs import meets_sleeper
from mbsim.stepping.points import bodies_of, deepest_of, is_point, take_rows
from mbsim.stepping.sleep import both_sleep, one_sleeps, wake

#: A point is another one of a pair if it is as far from the others, over the smaller radius.
ELSEWHERE = 0.1


@jitable
def is_known(S: Stepping, k: int, near: float) -> bool:
    """Return whether a point before point k is of the same pair, and as near to it."""
    P = S.points
    for other in range(k):
        away = sub(vector(P.point[other]), vector(P.point[k]))
        if P.key[other] == P.key[k] and norm(away) < near:
            return True
    return False


@jitable
def fill_way(scene: Scene, S: Stepping, pair: int) -> None:
    """Fill `M.way` by the motion that impulses gave the pair's bodies, and keep its frames."""
    i, j = bodies_of(scene, pair)
    for c in range(6):
        S.motion.way[0, c], S.motion.way[1, c] = S.motion.shift[i, c], S.motion.shift[j, c]
    keep_frames(scene, S.motion, pair)


@jitable
def meets_after_all(scene: Scene, S: Stepping, y: F1, pair: int, h: float) -> bool:
    """Take the points of a pair that meets by the motion that impulses gave it, if it does.

    Return False if there is no room.
    """
    M, room = S.motion, True
    fill_way(scene, S, pair)
    measure_pair(scene, pair)
    t = find_touch(scene, S, y, pair, h, deepest_of(scene, S, pair))
    if t >= 0.0:
        room = take_ahead(scene, S, y, pair, t, True)
    put_back(scene, M, pair)
    return room


@jitable
def turns_in(scene: Scene, S: Stepping, y: F1, pair: int, h: float) -> bool:
    """Take points at which a pair that has points goes in elsewhere, as impulses turn its bodies.

    An end of a line is apart where the other one is hit, and comes down within the step. Return
    False if there is no room.
    """
    M, count, room = S.motion, S.tally.count, True
    gi, gj = scene.pairs.graphic_i[pair], scene.pairs.graphic_j[pair]
    fill_way(scene, S, pair)
    most = touching(scene, S, gi, gj)
    if h * (fastest_point(scene, gi, M.way[0]) + fastest_point(scene, gj, M.way[1])) <= most:
        return True
    for c in range(3):
        M.push[c] = 0.0
    if measure_ahead(scene, S, y, pair, h) > most:
        points, first = scene.work.points, scene.pairs.slot[pair]
        least = LIGHT_PART * heaviest(scene, S, pair)
        near = ELSEWHERE * min(scene.graphics.radius[gi], scene.graphics.radius[gj])
        for s in range(first, first + S.plan.rows[scene.pairs.kind[pair]]):
            deep = points[s, AT_DEPTH] > most and points[s, AT_WEIGHT] > least
            if room and deep and is_point(scene, pair, s):
                room = add_ahead(scene, S, y, s, pair, h, True)
                if room and is_known(S, count[POINTS] - 1, near):
                    count[POINTS] -= 1
    put_back(scene, M, pair)
    return room


@jitable
def fill_went(scene: Scene, S: Stepping, h: float) -> bool:
    """Bound how far points of graphics go by what impulses gave; True if farther than expected."""
    graphics, M, farther = scene.graphics, S.motion, False
    for k in range(graphics_awake(scene)):
        g = graphic_awake(scene, k)
        way = M.shift[graphics.body[g]]
        far, spin = norm(vector(way)), norm((way[3], way[4], way[5]))
        if spin > 0.0:
            far += spin * (graphics.radius[g] + norm(vector(graphics.p[g])))
        M.went[g] = h * far
        farther = farther or M.went[g] > M.reach[g]
    return farther


@jitable
def find_missed(scene: Scene, S: Stepping, y: F1, h: float) -> int:
    """Take points that only the motion behind impulses reaches; return how many, or less a code."""
    pairs, work, M = scene.pairs, scene.work, S.motion
    before = S.tally.count[POINTS]
    farther = fill_went(scene, S, h)
    if not farther and S.plan.number[SOME_AHEAD] == 0.0:
        return 0
    for k in range(pairs_awake(scene, S)):
        pair = pair_awake(scene, S, k)
        gi, gj = pairs.graphic_i[pair], pairs.graphic_j[pair]
        i, j = bodies_of(scene, pair)
        if both_sleep(S, i, j):
            continue
        went = M.went[gi] + M.went[gj]
        if pairs.left[pair] - work.travel[gi] - work.travel[gj] > went:
            continue
        room = True
        if one_sleeps(S, i, j):
            if meets_sleeper(scene, S, pair, went, False):
                wake(scene, S, i if S.rest.body[i, ASLEEP] == 1 else j)
        elif S.plan.near[pairs.kind[pair]] == 1:
            reach = M.reach[gi] + M.reach[gj]
            if went > reach:
                measure_pair(scene, pair)
                room = take_rows(scene, S, y, pair, (reach, went))
        elif M.taken[pair] != M.taken[len(M.taken) - 1]:
            room = meets_after_all(scene, S, y, pair, h)
        else:
            room = turns_in(scene, S, y, pair, h)
        if not room:
            return -Code.MANY_POINTS
    if farther:
        for k in range(graphics_awake(scene)):
            g = graphic_awake(scene, k)
            M.reach[g] = max(M.reach[g], M.went[g])
    return S.tally.count[POINTS] - before
