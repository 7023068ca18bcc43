"""Who touches whom: the motion bound, the closed-form kernels, the door to FCL.

A pair that was `gap` apart when last measured cannot touch while its shapes have moved
by less than `gap` since. That is a pure function of the trial point, so skipping a pair
never changes a result; it only saves the kernel.
"""

from __future__ import annotations

import math

from mbsim.core.address import call_int
from mbsim.core.jitable import jitable
from mbsim.dynamics.kinematics import place_graphic
from mbsim.system.arrays import BODY_SIZE, FCL_CALLS, NARROWPHASE, SKIPPED


@jitable
def moved(scene, y, pair, side):
    """Return how far any point of one shape of a pair can be from where it was measured."""
    graphics = scene.graphics
    g = scene.pairs.graphic_i[pair] if side == 0 else scene.pairs.graphic_j[pair]
    b = graphics.body[g]
    if b == len(scene.bodies.mass):
        return 0.0
    frame, centre = scene.work.frames[g], scene.state.centre[pair]
    dx = frame[0] - centre[3 * side]
    dy = frame[1] - centre[3 * side + 1]
    dz = frame[2] - centre[3 * side + 2]
    way = math.sqrt(dx * dx + dy * dy + dz * dz)
    if graphics.turns[g] == 1:
        # a turn by angle a moves points at radius r by at most 2 r sin(a/2), cos(a/2) = |q.q0|
        at, turn = BODY_SIZE * b + 3, scene.state.turn[pair]
        d, qq = 0.0, 0.0
        for k in range(4):
            d += y[at + k] * turn[4 * side + k]
            qq += y[at + k] * y[at + k]
        way += 2.0 * graphics.reach[g] * math.sqrt(max(0.0, 1.0 - d * d / qq))
    return way


@jitable
def out_of_reach(scene, y, pair):
    """Return whether the motion bound proves that the pair is apart."""
    if scene.pairs.watched[pair] == 0:
        return False
    gap = scene.state.gap[pair]
    if gap <= 0.0:
        return False
    return moved(scene, y, pair, 0) + moved(scene, y, pair, 1) < gap


@jitable
def measure_pair(scene, pair):
    """Run a pair's closed form into its rows of `points`; False where FCL has to do it."""
    pairs, work = scene.pairs, scene.work
    if pairs.kernel[pair] == 0:
        return False
    i, j, first = pairs.graphic_i[pair], pairs.graphic_j[pair], pairs.slot[pair]
    count = call_int(
        pairs.kernel[pair],
        (
            work.frames[i],
            scene.graphics.size[i],
            work.frames[j],
            scene.graphics.size[j],
            work.points[first:],
        ),
    )
    if count < 0:
        return False
    if pairs.swapped[pair] == 1:
        for s in range(first, pairs.slot[pair + 1]):
            for k in range(4, 7):
                work.points[s, k] = -work.points[s, k]
    return True


@jitable
def find_contacts(scene, y):
    """Fill `points` and `touching` of every slot; return 0, or the FCL door's code."""
    pairs, slots, work, log = scene.pairs, scene.slots, scene.work, scene.log
    for g in range(len(scene.graphics.body)):
        place_graphic(scene, y, g)

    waiting = 0
    for pair in range(len(pairs.contact)):
        if out_of_reach(scene, y, pair):
            log.counters[SKIPPED] += 1
            for s in range(pairs.slot[pair], pairs.slot[pair + 1]):
                work.points[s, 0] = -scene.state.gap[pair]
            continue
        log.counters[NARROWPHASE] += 1
        if not measure_pair(scene, pair):
            work.fcl[waiting] = pair
            waiting += 1

    # one visit to Python for all pairs that need it
    if waiting > 0:
        log.counters[FCL_CALLS] += waiting
        code = call_int(scene.world.doors[0], (waiting,))
        if code != 0:
            return code

    for s in range(len(slots.pair)):
        depth = work.points[s, 0]
        deep = depth > scene.contacts.ignore_deeper[slots.contact[s]]
        work.touching[s] = 1 if depth > 0.0 and not deep else 0
    return 0
