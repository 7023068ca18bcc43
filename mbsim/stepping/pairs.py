"""Which contact points a step looks at: those that touch, and those that may within the step.

Detection is that of compliant contact (`contact.detection`): the same pairs, kernels and slots.
A pair is measured where it may close within the step: by the distance that it had when measured
last, less what its shapes have moved since and may move in the step. What impulses threw at
something farther off is found behind the contact problem, which is then solved with it.
"""

from __future__ import annotations

import math

from mbsim.arrays.codes import LISTINGS, NARROWPHASE, SKIPPED, WANTED
from mbsim.arrays.scene import Scene
from mbsim.core.arrays import F1
from mbsim.core.codes import Code
from mbsim.core.jitable import jitable
from mbsim.dynamics.bodies.kinematics import place_graphics
from mbsim.dynamics.contact.detection import measure_pair
from mbsim.stepping.ahead import look_ahead_of, note_pressed, take_where_it_meets
from mbsim.stepping.arrays import ASLEEP, POINTS, Stepping
from mbsim.stepping.awake import pair_awake, pairs_awake
from mbsim.stepping.points import bodies_of, deepest_of, fill_reach, take_rows
from mbsim.stepping.sleep import both_sleep, one_sleeps, wake


@jitable
def lies_still(scene: Scene, S: Stepping, pair: int) -> bool:
    """Return whether a pair's shapes did not move since its rows were measured, in this list."""
    pairs, travel = scene.pairs, scene.work.travel
    if S.motion.measured[pair] != 1 + scene.log.counters[LISTINGS]:
        return False
    since = pairs.gap[pair] - pairs.left[pair]
    since += travel[pairs.graphic_i[pair]] + travel[pairs.graphic_j[pair]]
    return since == 0.0


@jitable
def meets_sleeper(scene: Scene, S: Stepping, pair: int, reach: float, committed: bool) -> bool:
    """Return whether a pair of which one body sleeps may close as far as `reach`."""
    measure_pair(scene, pair)
    depth = deepest_of(scene, S, pair)
    S.motion.measured[pair] = 0
    if committed:
        scene.pairs.gap[pair] = scene.pairs.left[pair] = -depth
    return -depth <= reach


@jitable
def take_near(scene: Scene, S: Stepping, y: F1, pair: int, h: float, reach: float) -> bool:
    """Take the points of a pair that has some while it is apart; False if there is no room."""
    first = S.tally.count[POINTS]
    room = take_rows(scene, S, y, pair, (-math.inf, reach))
    return room and take_where_it_meets(scene, S, y, pair, h, first, reach)


@jitable
def find_points(scene: Scene, S: Stepping, y: F1, h: float, committed: bool) -> int:
    """Fill the list of points that a step h from y looks at; return 0 or a code.

    At a committed state what is found of distances is kept.
    """
    pairs, work, log, M = scene.pairs, scene.work, scene.log, S.motion
    S.tally.count[POINTS] = 0
    M.taken[len(M.taken) - 1] += 1
    if not place_graphics(scene, y):
        return Code.TOO_FAR
    if pairs.count[WANTED] > 0:
        return Code.CROWDED
    fill_reach(scene, S, h)
    note_pressed(S)
    measured = 0
    for c in range(len(work.beyond)):
        work.beyond[c] = 0
    for k in range(pairs_awake(scene, S)):
        pair = pair_awake(scene, S, k)
        gi, gj = pairs.graphic_i[pair], pairs.graphic_j[pair]
        i, j = bodies_of(scene, pair)
        if both_sleep(S, i, j):
            continue
        reach = S.motion.reach[gi] + S.motion.reach[gj]
        if pairs.left[pair] - work.travel[gi] - work.travel[gj] > reach:
            continue
        if one_sleeps(S, i, j):
            measured += 1
            if meets_sleeper(scene, S, pair, reach, committed):
                wake(scene, S, i if S.rest.body[i, ASLEEP] == 1 else j)
            continue
        near = S.plan.near[pairs.kind[pair]] == 1
        if near and lies_still(scene, S, pair):
            room = take_near(scene, S, y, pair, h, reach)
        else:
            measured += 1
            measure_pair(scene, pair)
            depth = deepest_of(scene, S, pair)
            M.measured[pair] = 0
            if committed:
                pairs.gap[pair] = pairs.left[pair] = -depth
                if near and work.beyond[scene.kinds.contact[pairs.kind[pair]]] == 0:
                    M.measured[pair] = 1 + log.counters[LISTINGS]
            if near:
                room = take_near(scene, S, y, pair, h, reach)
            else:
                room = look_ahead_of(scene, S, y, pair, h, depth)
        if not room:
            return Code.MANY_POINTS
    log.counters[NARROWPHASE] += measured
    log.counters[SKIPPED] += pairs_awake(scene, S) - measured
    return 0


@jitable
def commit_distances(scene: Scene, S: Stepping) -> None:
    """Take what shapes have moved from the distance of every pair."""
    pairs, travel = scene.pairs, scene.work.travel
    for k in range(pairs_awake(scene, S)):
        pair = pair_awake(scene, S, k)
        pairs.left[pair] -= travel[pairs.graphic_i[pair]] + travel[pairs.graphic_j[pair]]
