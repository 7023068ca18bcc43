"""Lists of what a step goes through where bodies sleep, so that what sleeps costs nothing.

`Scene.awake` lists the bodies that do not sleep, their graphics and their numbers of y, `Rest.pair`
the pairs of which one of them is part. All arrays are as ever: what is not listed is as it was.
That must be so in all of them, so the lists are used from the second step on in which the same
bodies sleep: the first one goes through everything, and leaves each array whole (`PLACED`). So does
the first step after compiled code was left (`integrators.driver.advance`).

Sums over bodies begin with what those that sleep give to them.
"""

from __future__ import annotations

from mbsim.arrays.codes import (
    ACTIVE,
    AWAKE_BODIES,
    AWAKE_GRAPHICS,
    FIXED,
    REST_CENTRE,
    REST_MASS,
    REST_SPREAD,
)
from mbsim.arrays.scene import Scene
from mbsim.core.arrays import F1
from mbsim.core.jitable import jitable
from mbsim.core.layout import BODY_SIZE
from mbsim.core.problem import GOES, LISTED, PART_BEGINS, PART_ENDS, PARTS, PLACED, WHOLE
from mbsim.core.rotation import norm, sub, vector
from mbsim.stepping.arrays import (
    ASIDE,
    ASLEEP,
    CHANGED,
    GRID,
    LISTED_FIXED,
    LISTED_PAIRS,
    SLEEPERS,
    Stepping,
)
from mbsim.stepping.sleep import both_sleep


@jitable
def pairs_awake(scene: Scene, S: Stepping) -> int:
    """Return how many near pairs there are to go through."""
    if scene.awake.whole[GOES] == LISTED:
        return S.rest.count[LISTED_PAIRS]
    return scene.pairs.count[ACTIVE]


@jitable
def pair_awake(scene: Scene, S: Stepping, k: int) -> int:
    """Return the k-th of them."""
    return S.rest.pair[k] if scene.awake.whole[GOES] == LISTED else scene.pairs.active[k]


@jitable
def sleeps(scene: Scene, S: Stepping, pair: int) -> bool:
    """Return whether both sides of a pair sleep, or one does and the other one is ground."""
    pairs, body = scene.pairs, scene.graphics.body
    return both_sleep(S, body[pairs.graphic_i[pair]], body[pairs.graphic_j[pair]])


@jitable
def put_pairs_aside(scene: Scene, S: Stepping) -> None:
    """Put the near pairs of large contacts that sleep before the others; both keep their order."""
    pairs, at, spare = scene.pairs, scene.pairs.count[FIXED], S.rest.pair
    for k in range(at, pairs.count[ACTIVE]):
        spare[k] = pairs.active[k]
    for turn in range(2):
        for k in range(pairs.count[FIXED], pairs.count[ACTIVE]):
            if sleeps(scene, S, spare[k]) == (turn == 0):
                pairs.active[at] = spare[k]
                at += 1
        if turn == 0:
            S.rest.count[ASIDE] = at


@jitable
def settle(scene: Scene, S: Stepping) -> None:
    """Note, where a step is taken, whether the next one may go through what is awake alone."""
    count, whole = S.rest.count, scene.awake.whole
    if count[CHANGED] == 1:
        count[CHANGED] = count[ASIDE] = 0
        whole[GOES] = WHOLE
        return
    if count[SLEEPERS] == 0 or whole[GOES] != WHOLE:
        return
    if count[ASIDE] == 0:
        put_pairs_aside(scene, S)
    whole[GOES] = PLACED


@jitable
def list_awake(scene: Scene, S: Stepping, y: F1) -> None:
    """Fill all lists where that may be, at the begin of a step."""
    awake, rest = scene.awake, S.rest
    if awake.whole[GOES] != PLACED:
        return
    list_bodies(scene, S, len(y))
    sum_asleep(scene, S, y)
    for row in range(len(rest.body)):
        if rest.body[row, ASLEEP] == 1:
            for c in range(BODY_SIZE * row, BODY_SIZE * (row + 1)):
                S.motion.middle[c] = S.motion.half[0, c] = S.motion.half[1, c] = y[c]
                S.motion.midst[c] = y[c]
    rest.count[LISTED_FIXED] = rest.count[GRID] = 0
    for k in range(scene.pairs.count[FIXED]):
        pair = scene.pairs.active[k]
        if not sleeps(scene, S, pair):
            rest.pair[rest.count[LISTED_FIXED]] = pair
            rest.count[LISTED_FIXED] += 1
    list_near_pairs(scene, S)
    awake.whole[GOES] = LISTED


@jitable
def list_bodies(scene: Scene, S: Stepping, numbers: int) -> None:
    """List bodies that do not sleep, their graphics, and the numbers of y that are not asleep."""
    awake, ground, parts = scene.awake, len(S.rest.body), 0
    awake.count[AWAKE_BODIES] = awake.count[AWAKE_GRAPHICS] = 0
    for b in range(ground):
        if S.rest.body[b, ASLEEP] == 1:
            continue
        awake.body[awake.count[AWAKE_BODIES]] = b
        awake.count[AWAKE_BODIES] += 1
        if parts == 0 or awake.part[parts - 1, PART_ENDS] != BODY_SIZE * b:
            awake.part[parts, PART_BEGINS] = BODY_SIZE * b
            parts += 1
        awake.part[parts - 1, PART_ENDS] = BODY_SIZE * (b + 1)
    if parts == 0 or awake.part[parts - 1, PART_ENDS] != BODY_SIZE * ground:
        awake.part[parts, PART_BEGINS] = BODY_SIZE * ground
        parts += 1
    awake.part[parts - 1, PART_ENDS] = numbers
    awake.whole[PARTS] = parts
    for g in range(len(scene.graphics.body)):
        b = scene.graphics.body[g]
        if b < ground and S.rest.body[b, ASLEEP] == 0:
            awake.graphic[awake.count[AWAKE_GRAPHICS]] = g
            awake.count[AWAKE_GRAPHICS] += 1


@jitable
def list_near_pairs(scene: Scene, S: Stepping) -> None:
    """List the near pairs of large contacts that do not sleep, behind those for good."""
    at = S.rest.count[LISTED_FIXED]
    for k in range(S.rest.count[ASIDE], scene.pairs.count[ACTIVE]):
        S.rest.pair[at] = scene.pairs.active[k]
        at += 1
    S.rest.count[LISTED_PAIRS] = at


@jitable
def sum_asleep(scene: Scene, S: Stepping, y: F1) -> None:
    """Sum up what sleeps, for sums of energy and momentum."""
    awake, mass, group = scene.awake, scene.bodies.mass, scene.scales.group
    awake.potential[0] = 0.0
    for g in range(len(awake.rest)):
        for c in range(awake.rest.shape[1]):
            awake.rest[g, c] = 0.0
    for b in range(len(mass)):
        if S.rest.body[b, ASLEEP] == 1:
            row, pull = awake.rest[group[b]], scene.world.gravity
            row[REST_MASS] += mass[b]
            for c in range(3):
                row[REST_CENTRE + c] += mass[b] * y[BODY_SIZE * b + c]
                awake.potential[0] -= mass[b] * pull[c] * y[BODY_SIZE * b + c]
    for k in range(len(awake.rest)):
        if awake.rest[k, REST_MASS] > 0.0:
            for c in range(3):
                awake.rest[k, REST_CENTRE + c] /= awake.rest[k, REST_MASS]
    for b in range(len(mass)):
        if S.rest.body[b, ASLEEP] == 1:
            row = awake.rest[group[b]]
            d = sub(vector(y, BODY_SIZE * b), vector(row[REST_CENTRE:]))
            row[REST_SPREAD] += mass[b] * norm(d)
