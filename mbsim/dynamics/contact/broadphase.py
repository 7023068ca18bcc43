"""Near pairs of contacts that have too many to look at: a grid, asked again when things moved.

Every member has a box around it, aligned with the global axes and grown by half the skin. Pairs
whose boxes meet are listed. While no point of a member has moved by more than half the skin
since, no other pair can touch; that much is its room. What a plane that moves has come is measured
at the distance of a usual member, see `plane_travel`. Members of usual size are sorted into the
cells of a grid as wide as the largest of them, so boxes that meet are in neighbouring
cells; planes and giants are few and are held against everybody. A pair keeps its row, and
with it its incidents, as long as it is near.
"""

from __future__ import annotations

import math

from mbsim.arrays.codes import (
    ACTIVE,
    FIRST_I,
    FIRST_J,
    FIXED,
    FREE,
    LAST_I,
    LAST_J,
    LISTINGS,
    MOVED_I,
    MOVED_J,
    MOVED_KIND,
    MOVED_TO,
    MOVED_TOUCHES,
    SPARE_GAP,
    SPARE_LEFT,
    WANTED,
)
from mbsim.arrays.scene import Scene
from mbsim.core.arrays import F1, V3
from mbsim.core.jitable import jitable
from mbsim.core.layout import BODY_SIZE
from mbsim.core.rotation import norm, sub, vector
from mbsim.dynamics.bodies.awake import graphic_awake, graphics_awake
from mbsim.dynamics.bodies.kinematics import half_skin, plane_travel, turn_travel
from mbsim.dynamics.contact.detection import measure_pair
from mbsim.dynamics.contact.memory import put_aside

#: Members wider than so many usual ones are held against everybody.
GIANT = 4.0
#: The skin is halved at most so often to make all near pairs fit.
MOST_HALVINGS = 20
#: Each time what a fast member may go by itself becomes this part of it.
LESS = 0.8
#: How far planes that move are from others is measured at so many members, or some more.
SAMPLE = 64
#: Pairs are listed anew where a member that went through this part of its room would go out of it
#: by so many steps as the last one.
GONE, AHEAD = 0.5, 2.0


@jitable
def fill_box(scene: Scene, g: int, skin: float) -> None:
    """Write the box of graphic g, grown by its half of the skin."""
    graphics, frame, box = scene.graphics, scene.work.frames[g], scene.broadphase.box[g]
    for r in range(3):
        half = graphics.radius[g]
        if graphics.turns[g] == 1 and half < math.inf:
            half = 0.0
            for k in range(3):
                half += abs(frame[3 + 3 * r + k]) * graphics.half[g, k]
        half += half_skin(scene, g, skin)
        box[r] = frame[r] - half
        box[3 + r] = frame[r] + half


@jitable
def boxes_meet(scene: Scene, i: int, j: int) -> bool:
    """Return whether the boxes of two graphics overlap."""
    a, b = scene.broadphase.box[i], scene.broadphase.box[j]
    for k in range(3):
        if a[k] > b[3 + k] or b[k] > a[3 + k]:
            return False
    return True


@jitable
def balls_meet(scene: Scene, i: int, j: int, skin: float) -> bool:
    """Return whether the balls around two graphics are nearer than the skin."""
    a, b = scene.work.frames[i], scene.work.frames[j]
    dx, dy, dz = a[0] - b[0], a[1] - b[1], a[2] - b[2]
    together = scene.graphics.radius[i] + scene.graphics.radius[j]
    together += half_skin(scene, i, skin) + half_skin(scene, j, skin)
    return dx * dx + dy * dy + dz * dz < together * together


@jitable
def above_plane(scene: Scene, plane: int, g: int, skin: float) -> bool:
    """Return whether a shape is farther than the skin above a plane."""
    frame = scene.work.frames[plane]
    d = sub(vector(scene.work.frames[g]), vector(frame))
    height = d[0] * frame[5] + d[1] * frame[8] + d[2] * frame[11]
    return height > scene.graphics.radius[g] + skin


@jitable
def near(scene: Scene, i: int, j: int, skin: float) -> bool:
    """Return whether two graphics are to be listed."""
    radius, ground = scene.graphics.radius, len(scene.bodies.mass)
    for plane, other in ((i, j), (j, i)):
        if math.isinf(radius[plane]):
            comes = half_skin(scene, plane, skin)
            room = comes + half_skin(scene, other, skin)
            if scene.graphics.body[plane] != ground:
                # a plane that turns comes by more farther away
                x, p = vector(scene.work.frames[other]), vector(scene.work.frames[plane])
                farther = (norm(sub(x, p)) + room) / scene.broadphase.lever[plane]
                room += comes * (max(1.0, farther) - 1.0)
            return not above_plane(scene, plane, other, room)
    return boxes_meet(scene, i, j) and balls_meet(scene, i, j, skin)


@jitable
def listed_row(scene: Scene, kind: int, i: int, j: int) -> int:
    """Return the row of a listed pair, -1 if there is none."""
    pairs, at = scene.pairs, scene.broadphase.head[i]
    while at >= 0:
        if pairs.graphic_j[at] == j and pairs.kind[at] == kind:
            return at
        at = scene.broadphase.next[at]
    return at


@jitable
def hold(scene: Scene, pair: int) -> None:
    """Keep a row in the list."""
    pairs, broadphase = scene.pairs, scene.broadphase
    pairs.active[pairs.count[ACTIVE]] = pair
    pairs.count[ACTIVE] += 1
    i = pairs.graphic_i[pair]
    broadphase.next[pair] = broadphase.head[i]
    broadphase.head[i] = pair


@jitable
def kind_of(scene: Scene, contact_set: int, i: int, j: int) -> tuple[int, int, int]:
    """Return the kind of a pair of a large contact, -1 for none, and its graphics in its order."""
    graphics, broadphase = scene.graphics, scene.broadphase
    if graphics.body[i] == graphics.body[j]:
        return -1, i, j
    shapes = round(math.sqrt(broadphase.kind.shape[1]))
    match = graphics.shape[i] * shapes + graphics.shape[j]
    kind = broadphase.kind[contact_set, match]
    if broadphase.swap[contact_set, match] == 1:
        return kind, j, i
    return kind, i, j


@jitable
def take_row(scene: Scene, kind: int, i: int, j: int) -> int:
    """Return a row for a pair that is not listed, -1 where there is none left."""
    pairs = scene.pairs
    if pairs.count[FREE] == 0:
        pairs.count[WANTED] += 1
        return -1
    pairs.count[FREE] -= 1
    pair = pairs.free[pairs.count[FREE]]
    pairs.kind[pair], pairs.graphic_i[pair], pairs.graphic_j[pair] = kind, i, j
    pairs.touches[pair] = 0
    # nothing is known of the distance: it is measured at once
    pairs.gap[pair] = pairs.left[pair] = 0.0
    return pair


@jitable
def add_pair(scene: Scene, contact_set: int, i: int, j: int) -> None:
    """List the I graphic i with the J graphic j of a large contact unless they are listed."""
    kind, i, j = kind_of(scene, contact_set, i, j)
    if kind < 0 or listed_row(scene, kind, i, j) >= 0:
        return
    pair = take_row(scene, kind, i, j)
    if pair >= 0:
        hold(scene, pair)


@jitable
def against_all(scene: Scene, contact_set: int, i: int, others: int, skin: float) -> None:
    """List graphic i with those of the contact's other side that are near; 0: it is their J."""
    broadphase = scene.broadphase
    side = broadphase.first[contact_set]
    first, last = side[2 * others], side[2 * others + 1]
    for k in range(first, last):
        j = broadphase.member[k]
        if j == i or (broadphase.same[contact_set] == 1 and j > i and not usual_size(scene, j)):
            # a set's pairs of giants come twice
            continue
        if near(scene, i, j, skin):
            if others == 1:
                add_pair(scene, contact_set, i, j)
            else:
                add_pair(scene, contact_set, j, i)


@jitable
def usual_size(scene: Scene, g: int) -> bool:
    """Return whether a graphic, with how far it may go by itself, belongs into the grid."""
    broadphase = scene.broadphase
    return scene.graphics.radius[g] + broadphase.own[g] <= GIANT * broadphase.size[1]


@jitable
def cell_range(scene: Scene, contact_set: int) -> tuple[V3, float, int, int, int]:
    """Return lowest corner, width and numbers of the cells that hold the J members' centres."""
    broadphase, frames = scene.broadphase, scene.work.frames
    low = (math.inf, math.inf, math.inf)
    high = (-math.inf, -math.inf, -math.inf)
    width = 0.0
    for side in range(2):
        for k in range(
            broadphase.first[contact_set, 2 * side], broadphase.first[contact_set, 2 * side + 1]
        ):
            g = broadphase.member[k]
            if not usual_size(scene, g):
                continue
            for r in range(3):
                width = max(width, broadphase.box[g, 3 + r] - broadphase.box[g, r])
            if side == 1:
                x, y, z = frames[g, 0], frames[g, 1], frames[g, 2]
                low = (min(low[0], x), min(low[1], y), min(low[2], z))
                high = (max(high[0], x), max(high[1], y), max(high[2], z))
    if not low[0] <= high[0]:
        return (0.0, 0.0, 0.0), 1.0, 0, 0, 0
    most = len(broadphase.start) - 1
    while True:
        nx = math.floor((high[0] - low[0]) / width) + 1.0
        ny = math.floor((high[1] - low[1]) / width) + 1.0
        nz = math.floor((high[2] - low[2]) / width) + 1.0
        if nx * ny * nz <= most:
            return low, width, int(nx), int(ny), int(nz)
        width *= 1.26


@jitable
def cell_at(scene: Scene, g: int, low: V3, width: float, r: int, n: int) -> int:
    """Return the number, -2 to n + 1, of the cell along axis r where graphic g's centre is."""
    number = math.floor((scene.work.frames[g, r] - low[r]) / width)
    return int(max(-2.0, min(number, n + 1.0)))


@jitable
def fill_cells(
    scene: Scene, contact_set: int, grid: tuple[V3, float, int, int, int], skin: float
) -> int:
    """List members of J cell by cell; return how many. Planes and giants are taken against every I.

    start[c + 1] is then where cell c begins; the next cell's begin is its end.
    """
    broadphase = scene.broadphase
    first_j, last_j = broadphase.first[contact_set, FIRST_J], broadphase.first[contact_set, LAST_J]
    low, width, nx, ny, nz = grid
    start, order, cells = broadphase.start, broadphase.order, nx * ny * nz
    for cell in range(cells + 1):
        start[cell] = 0
    for k in range(first_j, last_j):
        j = broadphase.member[k]
        if not usual_size(scene, j):
            against_all(scene, contact_set, j, 0, skin)
            continue
        x = cell_at(scene, j, low, width, 0, nx)
        y = cell_at(scene, j, low, width, 1, ny)
        z = cell_at(scene, j, low, width, 2, nz)
        broadphase.cell[j] = (z * ny + y) * nx + x
        start[broadphase.cell[j] + 1] += 1
    for cell in range(cells):
        start[cell + 1] += start[cell]
    for k in range(last_j - 1, first_j - 1, -1):
        j = broadphase.member[k]
        if usual_size(scene, j):
            # the end of a cell's range moves down to its begin
            start[broadphase.cell[j] + 1] -= 1
            order[start[broadphase.cell[j] + 1]] = j
    usual = 0
    for k in range(first_j, last_j):
        usual += 1 if usual_size(scene, broadphase.member[k]) else 0
    return usual


@jitable
def search(scene: Scene, contact_set: int, skin: float) -> None:
    """List all near pairs of a large contact."""
    broadphase = scene.broadphase
    first_i, last_i = broadphase.first[contact_set, FIRST_I], broadphase.first[contact_set, LAST_I]
    grid = cell_range(scene, contact_set)
    usual = fill_cells(scene, contact_set, grid, skin)
    low, width, nx, ny, nz = grid
    start, order, cells = broadphase.start, broadphase.order, nx * ny * nz
    for k in range(first_i, last_i):
        i = broadphase.member[k]
        if not usual_size(scene, i):
            if broadphase.same[contact_set] == 0:
                against_all(scene, contact_set, i, 1, skin)
            continue
        x = cell_at(scene, i, low, width, 0, nx)
        y = cell_at(scene, i, low, width, 1, ny)
        z = cell_at(scene, i, low, width, 2, nz)
        for cz in range(max(0, z - 1), min(nz, z + 2)):
            for cy in range(max(0, y - 1), min(ny, y + 2)):
                row = (cz * ny + cy) * nx
                left, right = max(0, x - 1), min(nx, x + 2) - 1
                if right < left:
                    continue
                begin = start[row + left + 1]
                end = start[row + right + 2] if row + right + 1 < cells else usual
                for m in range(begin, end):
                    j = order[m]
                    if broadphase.same[contact_set] == 1 and j <= i:
                        continue
                    if boxes_meet(scene, i, j) and balls_meet(scene, i, j, skin):
                        add_pair(scene, contact_set, i, j)


@jitable
def keep_near(scene: Scene, skin: float) -> None:
    """Begin the list with the pairs that still are near or touch; free the others."""
    pairs, broadphase = scene.pairs, scene.broadphase
    for g in range(len(broadphase.head)):
        broadphase.head[g] = -1
    listed = pairs.count[ACTIVE]
    pairs.count[ACTIVE] = pairs.count[FIXED]
    for k in range(pairs.count[FIXED], listed):
        pair = pairs.active[k]
        i, j = pairs.graphic_i[pair], pairs.graphic_j[pair]
        if pairs.touches[pair] > 0 or near(scene, i, j, skin):
            hold(scene, pair)
        else:
            pairs.free[pairs.count[FREE]] = pair
            pairs.count[FREE] += 1


@jitable
def order_by_graphic(scene: Scene) -> None:
    """Put pairs into the order of their I graphics, near each other in memory."""
    pairs, broadphase = scene.pairs, scene.broadphase
    at = pairs.count[FIXED]
    for g in range(len(broadphase.head)):
        pair = broadphase.head[g]
        while pair >= 0:
            pairs.active[at] = pair
            at += 1
            pair = broadphase.next[pair]


@jitable
def close_ranks(scene: Scene) -> None:
    """Move pairs to rows in the order of the list, with their slots that touch.

    An evaluation then walks through memory from front to back; pairs that come and go would
    scatter them. Where a law carries X or integrates memory its offsets in y stay, so nothing is
    moved.
    """
    pairs, broadphase, state, work = scene.pairs, scene.broadphase, scene.state, scene.work
    fixed, active, last = pairs.count[FIXED], pairs.count[ACTIVE], len(state.hit) - 1
    if scene.slots.x[pairs.slot[fixed]] >= 0 or scene.slots.z[pairs.slot[fixed]] >= 0:
        return
    for k in range(fixed, active):
        pair, row = pairs.active[k], broadphase.moved[k]
        broadphase.moved[pair, MOVED_TO] = k
        row[MOVED_KIND], row[MOVED_TOUCHES] = pairs.kind[pair], pairs.touches[pair]
        row[MOVED_I], row[MOVED_J] = pairs.graphic_i[pair], pairs.graphic_j[pair]
        broadphase.spare[k, SPARE_GAP] = pairs.gap[pair]
        broadphase.spare[k, SPARE_LEFT] = pairs.left[pair]
    for k in range(fixed, active):
        row = broadphase.moved[k]
        pairs.kind[k], pairs.touches[k] = row[MOVED_KIND], row[MOVED_TOUCHES]
        pairs.graphic_i[k], pairs.graphic_j[k] = row[MOVED_I], row[MOVED_J]
        pairs.gap[k] = broadphase.spare[k, SPARE_GAP]
        pairs.left[k] = broadphase.spare[k, SPARE_LEFT]
        pairs.active[k] = k
    capacity = len(pairs.active)
    pairs.count[FREE] = capacity - active
    for k in range(capacity - active):
        pairs.free[k] = capacity - 1 - k

    for h in range(state.hit[last]):
        s = state.hit[h]
        put_aside(scene, 0, s, broadphase.spare[h])
        state.touching[s] = work.touching[s] = 0
    for h in range(state.hit[last]):
        s = state.hit[h]
        pair = scene.slots.pair[s]
        if pair >= fixed:
            s += pairs.slot[broadphase.moved[pair, MOVED_TO]] - pairs.slot[pair]
        put_aside(scene, 1, s, broadphase.spare[h])
        state.touching[s] = work.touching[s] = 1
        state.hit[h] = work.hit[h] = s
    for h in range(state.hit[last]):
        pair = scene.slots.pair[state.hit[h]]
        if pair >= fixed and scene.kinds.whole[pairs.kind[pair]] > 0.0:
            # the points that one incident stands for
            measure_pair(scene, pair)


@jitable
def fill_levers(scene: Scene) -> None:
    """Measure how far planes that move are from a usual member: the harmonic mean.

    What has flown away does not count in it. Of many members some are taken, spread over all.
    """
    broadphase, graphics, frames = scene.broadphase, scene.graphics, scene.work.frames
    usual, apart = broadphase.size[1], max(1, len(broadphase.member) // SAMPLE)
    for at in range(len(broadphase.member)):
        g = broadphase.member[at]
        if graphics.body[g] == len(scene.bodies.mass) or graphics.radius[g] < math.inf:
            continue
        count, total = 0, 0.0
        for k in range(0, len(broadphase.member), apart):
            other = broadphase.member[k]
            if graphics.radius[other] < math.inf and graphics.body[other] != graphics.body[g]:
                way = norm(sub(vector(frames[other]), vector(frames[g])))
                count, total = count + 1, total + 1.0 / (way + usual)
        broadphase.lever[g] = count / total if count > 0 else usual


@jitable
def refer(scene: Scene, y: F1, g: int, skin: float) -> None:
    """Keep where a member is that moves when its pairs are listed, and how far it may go."""
    broadphase = scene.broadphase
    frame, reference = scene.work.frames[g], broadphase.reference[g]
    broadphase.room[g] = half_skin(scene, g, skin)
    for j in range(3):
        reference[j] = frame[j]
    if math.isinf(scene.graphics.radius[g]):
        for j in range(3):
            reference[3 + j] = frame[5 + 3 * j]
    else:
        for j in range(4):
            reference[3 + j] = y[BODY_SIZE * scene.graphics.body[g] + 3 + j]


@jitable
def list_pairs(scene: Scene, y: F1) -> None:
    """List the near pairs of all large contacts at the committed state, and how long that holds."""
    broadphase, pairs = scene.broadphase, scene.pairs
    ground = len(scene.bodies.mass)
    scene.log.counters[LISTINGS] += 1
    skin = broadphase.size[0]
    fill_levers(scene)
    for _ in range(MOST_HALVINGS):
        for k in range(len(broadphase.member)):
            fill_box(scene, broadphase.member[k], skin)
        pairs.count[WANTED] = 0
        keep_near(scene, skin)
        for contact_set in range(len(broadphase.contact)):
            search(scene, contact_set, skin)
        if pairs.count[WANTED] == 0:
            break
        # more than there are places for: look less far
        skin *= 0.5
        broadphase.size[0] = skin
        for g in range(len(broadphase.own)):
            broadphase.own[g] *= LESS
    order_by_graphic(scene)
    close_ranks(scene)
    for k in range(len(broadphase.member)):
        g = broadphase.member[k]
        if scene.graphics.body[g] != ground:
            refer(scene, y, g, skin)


@jitable
def is_used_up(scene: Scene, y: F1) -> bool:
    """Find out how far each member may still move; return whether pairs are to be listed anew."""
    broadphase, graphics = scene.broadphase, scene.graphics
    anew = False
    for row in range(graphics_awake(scene)):
        g = graphic_awake(scene, row)
        b = graphics.body[g]
        if b == len(scene.bodies.mass):
            continue
        if math.isinf(broadphase.room[g]):
            # nobody's member, or never listed
            anew = anew or scene.log.counters[LISTINGS] == 0
            continue
        reference = broadphase.reference[g]
        travel = norm(sub(vector(scene.work.frames[g]), vector(reference)))
        if math.isinf(graphics.radius[g]):
            travel = plane_travel(scene, g)
        elif graphics.turns[g] == 1:
            travel += turn_travel(y, b, reference[3:], graphics.radius[g])
        half = half_skin(scene, g, broadphase.size[0])
        way = max(broadphase.room[g] - (half - travel), 0.0)
        broadphase.room[g] = half - travel
        anew = anew or (travel > GONE * half and travel + AHEAD * way > half)
    return anew


@jitable
def follow(scene: Scene, y: F1) -> None:
    """List the pairs anew where a member may move half as far as it could."""
    if is_used_up(scene, y):
        list_pairs(scene, y)
