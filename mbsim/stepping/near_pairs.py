"""Near pairs of what is awake, listed anew without those of what sleeps.

As `contact.broadphase` has it, but that members that sleep, and those of ground, stand in a table
of cells (by the hash of a cell's place) that is made once; members that are awake look for them
there, and for each other in another one. Pairs that sleep stay as they are, before all others.

The order of pairs is that of the awake graphic, then of the other one, then of the kind: it does
not depend on how the tables were made.
"""

from __future__ import annotations

import math

from mbsim.arrays.codes import ACTIVE, FREE, LISTINGS, WANTED
from mbsim.arrays.hooks import Hook
from mbsim.arrays.scene import Scene
from mbsim.core.address import vector_at, view
from mbsim.core.arrays import F1, I1, Pointer
from mbsim.core.jitable import jitable
from mbsim.core.problem import GOES, LISTED
from mbsim.dynamics.bodies.awake import graphic_awake, graphics_awake
from mbsim.dynamics.contact.broadphase import (
    balls_meet,
    boxes_meet,
    fill_box,
    is_used_up,
    kind_of,
    list_pairs,
    near,
    refer,
    take_row,
    usual_size,
)
from mbsim.stepping.arrays import ASIDE, ASLEEP, GRID, OF_I, OF_J, Stepping
from mbsim.stepping.awake import list_near_pairs, put_pairs_aside

#: Width of cells over that of boxes, when they are made.
WIDER = 2.0
#: Near pairs are looked for so many times farther than a step can come.
FARTHER = 2.0
#: Odd numbers that spread the places of cells.
SPREAD_X, SPREAD_Y, SPREAD_Z = 73856093, 19349663, 83492791


@jitable
def is_moving(scene: Scene, S: Stepping, g: int) -> bool:
    """Return whether a graphic is a member of a large contact and awake."""
    b = scene.graphics.body[g]
    if b == len(S.rest.body) or S.rest.body[b, ASLEEP] == 1:
        return False
    return not math.isinf(scene.broadphase.room[g])


@jitable
def cell_of(scene: Scene, S: Stepping, g: int, r: int) -> int:
    """Return the number of the cell along axis r where graphic g's centre is."""
    at = math.floor(scene.work.frames[g, r] / S.rest.width[0])
    return int(max(-1e9, min(at, 1e9)))


@jitable
def entry(S: Stepping, x: int, y: int, z: int) -> int:
    """Return the entry of the tables for a cell."""
    spread = (x * SPREAD_X) ^ (y * SPREAD_Y) ^ (z * SPREAD_Z)
    return spread & (S.rest.still.shape[0] - 1)


@jitable
def put_in(scene: Scene, S: Stepping, table: I1, g: int) -> None:
    """Put a graphic into a table."""
    at = entry(S, cell_of(scene, S, g, 0), cell_of(scene, S, g, 1), cell_of(scene, S, g, 2))
    S.rest.next[g] = table[at]
    table[at] = g


@jitable
def fill_still(scene: Scene, S: Stepping) -> None:
    """Put all members of usual size that do not move into their table.

    Their boxes have no skin: how far what is awake may go is in its own.
    """
    broadphase, rest = scene.broadphase, S.rest
    rest.width[0] = 0.0
    for g in range(len(rest.side)):
        if rest.side[g, 0] == 1 and not is_moving(scene, S, g):
            fill_box(scene, g, 0.0)
    for k in range(len(broadphase.member)):
        g = broadphase.member[k]
        if usual_size(scene, g):
            for r in range(3):
                width = broadphase.box[g, 3 + r] - broadphase.box[g, r]
                rest.width[0] = max(rest.width[0], width)
    # what gets faster has wider boxes
    rest.width[0] *= WIDER
    for at in range(len(rest.still)):
        rest.still[at] = rest.moving[at] = -1
    rest.giants[0] = 0
    for g in range(len(rest.side)):
        if rest.side[g, 0] == 0 or is_moving(scene, S, g):
            continue
        if usual_size(scene, g):
            put_in(scene, S, rest.still, g)
        else:
            rest.giants[0] += 1
            rest.giants[rest.giants[0]] = g
    rest.count[GRID] = 1


@jitable
def other_of(scene: Scene, pair: int, owner: int) -> int:
    """Return the other graphic of a pair."""
    i, j = scene.pairs.graphic_i[pair], scene.pairs.graphic_j[pair]
    return j if i == owner else i


@jitable
def owner_of(scene: Scene, S: Stepping, i: int, j: int) -> int:
    """Return which of two graphics a pair is listed with: the first one that is awake."""
    first, last = min(i, j), max(i, j)
    return first if is_moving(scene, S, first) else last


@jitable
def put_behind(scene: Scene, S: Stepping, kind: int, i: int, j: int, pair: int) -> int:
    """Put a pair's row into the list of its awake graphic, -1: a new one, if it is not there.

    Return the row, -1 where it is there or no row is left.
    """
    pairs, broadphase, owner = scene.pairs, scene.broadphase, owner_of(scene, S, i, j)
    other, before, at = j if owner == i else i, -1, broadphase.head[owner]
    while at >= 0:
        here = other_of(scene, at, owner)
        if here > other or (here == other and pairs.kind[at] >= kind):
            break
        before, at = at, broadphase.next[at]
    if at >= 0 and other_of(scene, at, owner) == other and pairs.kind[at] == kind:
        if pairs.graphic_i[at] == i:
            return -1
    if pair < 0:
        pair = take_row(scene, kind, i, j)
    if pair >= 0:
        broadphase.next[pair] = at
        if before < 0:
            broadphase.head[owner] = pair
        else:
            broadphase.next[before] = pair
    return pair


@jitable
def add_near(scene: Scene, S: Stepping, g: int, other: int) -> None:
    """List an awake graphic with another one, in all large contacts that have both."""
    side = S.rest.side
    for c in range(len(scene.broadphase.contact)):
        one, two = side[g, 1 + c], side[other, 1 + c]
        if scene.broadphase.same[c] == 1:
            if one != 0 and two != 0:
                kind, i, j = kind_of(scene, c, min(g, other), max(g, other))
                if kind >= 0:
                    put_behind(scene, S, kind, i, j, -1)
            continue
        if one & OF_I != 0 and two & OF_J != 0:
            kind, i, j = kind_of(scene, c, g, other)
            if kind >= 0:
                put_behind(scene, S, kind, i, j, -1)
        if two & OF_I != 0 and one & OF_J != 0:
            kind, i, j = kind_of(scene, c, other, g)
            if kind >= 0:
                put_behind(scene, S, kind, i, j, -1)


@jitable
def look_around(scene: Scene, S: Stepping, g: int, skin: float) -> None:
    """List an awake graphic with all that are near."""
    rest = S.rest
    for k in range(1, rest.giants[0] + 1):
        if near(scene, g, rest.giants[k], skin):
            add_near(scene, S, g, rest.giants[k])
    x, y, z = (
        cell_of(scene, S, g, 0),
        cell_of(scene, S, g, 1),
        cell_of(scene, S, g, 2),
    )
    for number in range(27):
        at = entry(S, x + number % 3 - 1, y + number // 3 % 3 - 1, z + number // 9 - 1)
        for table in (rest.still, rest.moving):
            other = table[at]
            while other >= 0:
                if other != g and boxes_meet(scene, g, other):
                    if balls_meet(scene, g, other, skin):
                        add_near(scene, S, g, other)
                other = rest.next[other]


@jitable
def widest(scene: Scene, S: Stepping) -> float:
    """Return the largest width of a box of what is awake, inf where something is a giant."""
    most, box = 0.0, scene.broadphase.box
    for row in range(graphics_awake(scene)):
        g = graphic_awake(scene, row)
        if is_moving(scene, S, g):
            if not usual_size(scene, g):
                return math.inf
            for r in range(3):
                most = max(most, box[g, 3 + r] - box[g, r])
    return most


@jitable
def keep_awake(scene: Scene, S: Stepping, skin: float) -> None:
    """Begin the lists with pairs that still are near; free the others."""
    pairs, broadphase = scene.pairs, scene.broadphase
    for row in range(graphics_awake(scene)):
        broadphase.head[graphic_awake(scene, row)] = -1
    for k in range(S.rest.count[ASIDE], pairs.count[ACTIVE]):
        pair = pairs.active[k]
        i, j = pairs.graphic_i[pair], pairs.graphic_j[pair]
        if near(scene, i, j, skin):
            put_behind(scene, S, pairs.kind[pair], i, j, pair)
        else:
            pairs.free[pairs.count[FREE]] = pair
            pairs.count[FREE] += 1


@jitable
def list_moving(scene: Scene, S: Stepping, y: F1) -> bool:
    """List the near pairs of what is awake; return whether they all fit."""
    pairs, broadphase, rest = scene.pairs, scene.broadphase, S.rest
    skin = broadphase.size[0]
    for row in range(graphics_awake(scene)):
        g = graphic_awake(scene, row)
        if is_moving(scene, S, g):
            fill_box(scene, g, skin)
    most = widest(scene, S)
    if most == math.inf:
        return False
    if scene.awake.whole[GOES] != LISTED or rest.count[GRID] == 0 or most > rest.width[0]:
        fill_still(scene, S)
    scene.log.counters[LISTINGS] += 1
    pairs.count[WANTED] = 0
    keep_awake(scene, S, skin)
    for row in range(graphics_awake(scene)):
        g = graphic_awake(scene, row)
        if is_moving(scene, S, g):
            put_in(scene, S, rest.moving, g)
    for row in range(graphics_awake(scene)):
        g = graphic_awake(scene, row)
        if is_moving(scene, S, g):
            look_around(scene, S, g, skin)
    at = rest.count[ASIDE]
    for row in range(graphics_awake(scene)):
        g = graphic_awake(scene, row)
        if not is_moving(scene, S, g):
            continue
        cell = (cell_of(scene, S, g, 0), cell_of(scene, S, g, 1), cell_of(scene, S, g, 2))
        rest.moving[entry(S, cell[0], cell[1], cell[2])] = -1
        refer(scene, y, g, skin)
        pair = broadphase.head[g]
        while pair >= 0:
            pairs.active[at] = pair
            at, pair = at + 1, broadphase.next[pair]
    pairs.count[ACTIVE] = at
    list_near_pairs(scene, S)
    return pairs.count[WANTED] == 0


@jitable
def list_anew(scene: Scene, S: Stepping, y: F1) -> None:
    """List near pairs anew: those of what is awake alone, where those that sleep are put aside."""
    aside = S.rest.count[ASIDE] > 0
    if aside and list_moving(scene, S, y):
        return
    list_pairs(scene, y)
    if aside:
        put_pairs_aside(scene, S)
        list_near_pairs(scene, S)


@jitable
def let_slow_down(scene: Scene, S: Stepping) -> None:
    """Forget how fast members were before the last step; planes that turn are as fast as ever."""
    own, reach = scene.broadphase.own, S.motion.reach
    for k in range(graphics_awake(scene)):
        g = graphic_awake(scene, k)
        own[g] = min(own[g], FARTHER * reach[g])


def list_near(context: int, y: Pointer) -> int:
    """The lists of near pairs where shapes have moved far enough."""
    scene = view(context, Scene)
    S, at = view(scene.world.hooks[Hook.STEPPING], Stepping), vector_at(y, scene.rows.y.shape[1])
    if is_used_up(scene, at):
        let_slow_down(scene, S)
        list_anew(scene, S, at)
    return 0
