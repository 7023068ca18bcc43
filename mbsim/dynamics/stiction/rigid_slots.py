"""Where the slots of rigid stiction are: contact points and normals, and how they move."""

from __future__ import annotations

from mbsim.arrays.codes import (
    HELD_AT_PLACES,
    HELD_AXIS,
    HELD_NORMAL,
    HELD_POINT,
    NORMAL_RATE,
    POINT_RATE,
    SCALE_LENGTH,
    SCALE_SPEED,
)
from mbsim.arrays.scene import Scene
from mbsim.core.address import call_int
from mbsim.core.arrays import F1
from mbsim.core.jitable import jitable
from mbsim.core.layout import BODY_SIZE
from mbsim.core.rotation import add, cross, dot, norm, scale, sub, vector
from mbsim.dynamics.bodies.kinematics import place_body, place_graphic
from mbsim.dynamics.constraints.selection import sticks
from mbsim.dynamics.contact.forces import contact_of, sides, velocity_at
from mbsim.dynamics.contact.frames import tangent
from mbsim.dynamics.contact.points import pass_on
from mbsim.dynamics.stiction.faces import Face, face_of, has_face, onto
from mbsim.dynamics.stiction.rigid_shares import first_of_slots
from mbsim.geometry.catalog import AT_DEPTH, AT_NORMAL, AT_POINT

#: Half of the time over which rates of a contact's place are found, over that in which the model's
#: speed goes its length: truncation and rounding are about as large.
MOMENT = 1e-5
#: What of a second difference, over the model's length, is no jump of the point from one place to
#: another.
SMOOTH = 1e-8
#: Row of `Work.look` that shows a pair as it is.
LOOKED_NOW = 0


@jitable
def move_on(scene: Scene, y: F1, b: int, time: float) -> None:
    """Let body b go on for a time as it moves."""
    if b == len(scene.bodies.mass):
        return
    at, half = BODY_SIZE * b, 0.5 * time
    w, x, yy, z = y[at + 3], y[at + 4], y[at + 5], y[at + 6]
    a, c, d = y[at + 10], y[at + 11], y[at + 12]
    for k in range(3):
        y[at + k] += time * y[at + 7 + k]
    y[at + 3] += half * (-x * a - yy * c - z * d)
    y[at + 4] += half * (w * a + yy * d - z * c)
    y[at + 5] += half * (w * c + z * a - x * d)
    y[at + 6] += half * (w * d + x * c - yy * a)
    place_body(scene, y, b)


@jitable
def pose(scene: Scene, y: F1, b: int) -> tuple[float, ...]:
    """Return position and quaternion of body b; anything for ground."""
    at = BODY_SIZE * b if b < len(scene.bodies.mass) else 0
    return (y[at], y[at + 1], y[at + 2], y[at + 3], y[at + 4], y[at + 5], y[at + 6])


@jitable
def put_pose(scene: Scene, y: F1, b: int, kept: tuple[float, ...]) -> None:
    """Put body b back to a pose."""
    if b == len(scene.bodies.mass):
        return
    for k in range(7):
        y[BODY_SIZE * b + k] = kept[k]
    place_body(scene, y, b)


@jitable
def look(scene: Scene, y: F1, pair: int, row: int) -> None:
    """Fill a row of `Work.look` with the candidates of a pair."""
    pairs, kinds, graphics, work = scene.pairs, scene.kinds, scene.graphics, scene.work
    kind, i, j = pairs.kind[pair], pairs.graphic_i[pair], pairs.graphic_j[pair]
    for g in (i, j):
        if graphics.body[g] < len(scene.bodies.mass):
            place_graphic(scene, y, g)
    points = work.look[row]
    frames, size = work.frames, graphics.size
    call_int(kinds.kernel[kind], (frames[i], size[i], frames[j], size[j], points))
    if kinds.swapped[kind] == 1:
        for s in range(kinds.slots[kind]):
            for k in range(4, 7):
                points[s, k] = -points[s, k]
    if kinds.moves[kind] == HELD_AT_PLACES:
        pass_on(scene, pair, points, 0)


@jitable
def look_around(scene: Scene, y: F1, pair: int, moment: float) -> None:
    """Fill all rows of `Work.look`: now, a moment later, a moment before."""
    graphics, pairs = scene.graphics, scene.pairs
    bi = graphics.body[pairs.graphic_i[pair]]
    bj = graphics.body[pairs.graphic_j[pair]]
    kept_i, kept_j = pose(scene, y, bi), pose(scene, y, bj)
    for row in range(3):
        # the last as it is
        time = moment if row == 0 else -moment
        if row < 2:
            move_on(scene, y, bi, time)
            move_on(scene, y, bj, time)
        look(scene, y, pair, (row + 1) % 3)
        put_pose(scene, y, bi, kept_i)
        put_pose(scene, y, bj, kept_j)


@jitable
def fill_in_face(scene: Scene, t: float, y: F1, s: int, face: Face) -> None:
    """Bring the row of `Work.sticking_point` of slot s into the face that its pair is held along.

    One that has no place any more keeps the one that it had.
    """
    row, pair, points = scene.work.sticking_point[s], scene.slots.pair[s], scene.work.look
    g, n, _ = face
    b, turns = scene.graphics.body[g], (0.0, 0.0, 0.0)
    p, rate = vector(row[HELD_POINT:]), vector(row[POINT_RATE:])
    if points[LOOKED_NOW, s - scene.pairs.slot[pair], AT_DEPTH] == 0.0:
        p = vector(scene.state.p[s])
        rate = velocity_at(scene, y, b, p)
    if b < len(scene.bodies.mass):
        turns = vector(scene.work.w[b])
    q = onto(face, p)
    # it stays in the face, which moves
    rate = sub(rate, scale(dot(sub(p, q), n), cross(turns, n)))
    rate = sub(rate, scale(dot(sub(rate, velocity_at(scene, y, b, q)), n), n))
    dn, gi, other = cross(turns, n), sides(scene, s)[0], sides(scene, s)[1]
    bi, bj = scene.graphics.body[gi], scene.graphics.body[other]
    x = tangent(scene, t, y, s, contact_of(scene, s), gi, bi, bj, n)
    for i in range(3):
        row[HELD_POINT + i], row[HELD_NORMAL + i], row[HELD_AXIS + i] = q[i], n[i], x[i]
        row[POINT_RATE + i], row[NORMAL_RATE + i] = rate[i], dn[i]


@jitable
def fill_hold(scene: Scene, t: float, y: F1, s: int, moment: float) -> None:
    """Fill the row of `Work.sticking_point` of slot s, whose pair has been looked at."""
    points, row = scene.work.look, scene.work.sticking_point[s]
    k = s - scene.pairs.slot[scene.slots.pair[s]]
    now, later, before = points[0, k], points[1, k], points[2, k]
    ahead = sub(vector(later[AT_POINT:]), vector(now[AT_POINT:]))
    back = sub(vector(now[AT_POINT:]), vector(before[AT_POINT:]))
    jump, path = norm(sub(ahead, back)), norm(add(ahead, back))
    first, last, time = 2, 1, 2.0 * moment
    if jump > 0.1 * path + SMOOTH * scene.world.scale[SCALE_LENGTH]:
        # the shapes touch at another corner: the side on which they do not
        if norm(ahead) < norm(back):
            first, time = 0, moment
        else:
            last, time = 0, moment
    for i in range(3):
        row[HELD_POINT + i], row[HELD_NORMAL + i] = now[AT_POINT + i], now[AT_NORMAL + i]
        row[POINT_RATE + i] = (
            points[last, k, AT_POINT + i] - points[first, k, AT_POINT + i]
        ) / time
        row[NORMAL_RATE + i] = (
            points[last, k, AT_NORMAL + i] - points[first, k, AT_NORMAL + i]
        ) / time
    if has_face(scene, scene.slots.pair[s]):
        face = face_of(scene, scene.slots.pair[s], points[LOOKED_NOW], 0)
        if face[0] >= 0:
            fill_in_face(scene, t, y, s, face)
            return
    gi, gj = sides(scene, s)
    bi, bj = scene.graphics.body[gi], scene.graphics.body[gj]
    x = tangent(scene, t, y, s, contact_of(scene, s), gi, bi, bj, vector(now[AT_NORMAL:]))
    for i in range(3):
        row[HELD_AXIS + i] = x[i]


@jitable
def locate_sticking(scene: Scene, t: float, y: F1) -> None:
    """Find where the slots that stick are at y, and how that changes; bodies have been placed."""
    slot, last = scene.equations.slot, -1
    moment = MOMENT * scene.world.scale[SCALE_LENGTH] / scene.world.scale[SCALE_SPEED]
    for e in range(first_of_slots(scene), len(slot), 2):
        if not sticks(scene, e):
            continue
        pair = scene.slots.pair[slot[e]]
        if pair != last:
            look_around(scene, y, pair, moment)
            last = pair
        fill_hold(scene, t, y, slot[e], moment)
