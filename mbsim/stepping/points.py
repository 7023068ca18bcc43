"""Contact points of a step: rows of measured pairs, and what impulses at them do."""

from __future__ import annotations

import math

from mbsim.arrays.scene import Scene
from mbsim.core.arrays import F1, V3
from mbsim.core.jitable import jitable
from mbsim.core.rotation import add, any_tangent, cross, dot, norm, scale, vector
from mbsim.dynamics.bodies.awake import graphic_awake, graphics_awake
from mbsim.dynamics.bodies.kinematics import position
from mbsim.dynamics.contact.forces import IGNORE_DEEPER, sides
from mbsim.geometry.catalog import AT_DEPTH, AT_NORMAL, AT_POINT, AT_WEIGHT
from mbsim.stepping.arrays import (
    AXES,
    KEPT_STICKS,
    LEFT,
    LENGTH,
    LIGHT,
    NOT_KEPT,
    POINTS,
    SLOP,
    SPIN,
    TURN,
    W_NN,
    W_NX,
    W_NZ,
    W_XX,
    W_XZ,
    W_ZZ,
    Stepping,
)
from mbsim.stepping.held import answer_listed, widen
from mbsim.stepping.one_point import answer_of, fill_inverse, row_of, velocity_of

#: Part of a step's motion by which pairs are looked for beyond it: others may hit what moves.
AHEAD = 0.5
#: Weights below this are no point.
LEAST = 1e-6


@jitable
def way_at(scene: Scene, S: Stepping, g: int, h: float, radius: float) -> float:
    """Bound how far what is at a radius from a graphic's marker may come in a step."""
    b, far, turns = scene.graphics.body[g], 0.0, 0.0
    for v in (S.motion.before[b], S.motion.free[b]):
        far = max(far, norm((v[0], v[1], v[2])))
        turns = max(turns, norm((v[3], v[4], v[5])))
    if turns > 0.0:
        far += turns * (radius + norm(vector(scene.graphics.p[g])))
    return (1.0 + AHEAD) * h * far


@jitable
def fill_reach(scene: Scene, S: Stepping, h: float) -> None:
    """Bound how far any point of a graphic may come in a step, by its body's velocities.

    No less than what the solver may leave of a way: what rests a little above a surface is held by
    it in very short steps too.
    """
    for k in range(graphics_awake(scene)):
        g = graphic_awake(scene, k)
        b = scene.graphics.body[g]
        least = S.plan.scale[S.plan.connected[b], LEFT] if b < len(S.rest.body) else 0.0
        S.motion.reach[g] = max(way_at(scene, S, g, h, scene.graphics.radius[g]), least)


@jitable
def bodies_of(scene: Scene, pair: int) -> tuple[int, int]:
    """Return the bodies of a pair's two graphics."""
    body, pairs = scene.graphics.body, scene.pairs
    return body[pairs.graphic_i[pair]], body[pairs.graphic_j[pair]]


@jitable
def deepest_of(scene: Scene, S: Stepping, pair: int) -> float:
    """Return the largest depth of a measured pair."""
    deepest, first = -math.inf, scene.pairs.slot[pair]
    for s in range(first, first + S.plan.rows[scene.pairs.kind[pair]]):
        deepest = max(deepest, scene.work.points[s, AT_DEPTH])
    return deepest


@jitable
def is_point(scene: Scene, pair: int, s: int) -> bool:
    """Return whether row s of a pair may carry a force."""
    point, c = scene.work.points[s], scene.kinds.contact[scene.pairs.kind[pair]]
    return (
        point[AT_WEIGHT] > LEAST and not point[AT_DEPTH] > scene.contacts.numbers[c, IGNORE_DEEPER]
    )


@jitable
def slop_of(scene: Scene, S: Stepping, gi: int, gj: int) -> float:
    """Return how deep two graphics may be in each other at a step's end.

    It is to the smaller one's diameter what `SLOP` is to the length of their group, so that a small
    body in a large one is no deeper than in a small one; but more than what the solver may leave
    of velocities moves bodies by.
    """
    i, j = scene.graphics.body[gi], scene.graphics.body[gj]
    scale = S.plan.scale[S.plan.connected[i if i != len(scene.bodies.mass) else j]]
    size = 2.0 * min(scene.graphics.radius[gi], scene.graphics.radius[gj])
    return max(min(size / scale[LENGTH], 1.0) * scale[SLOP], 2.0 * scale[LEFT])


@jitable
def put_place(scene: Scene, S: Stepping, pair: int, s: int, gi: int, gj: int) -> int:
    """Make row s of a pair a contact point, but for gap and arms; return which, -1 for no room."""
    P, point = S.points, scene.work.points[s]
    k = S.tally.count[POINTS]
    if k == len(P.slot):
        return -1
    S.tally.count[POINTS] = k + 1
    P.slot[k], P.contact[k] = s, scene.kinds.contact[scene.pairs.kind[pair]]
    P.body[k, 0], P.body[k, 1] = scene.graphics.body[gi], scene.graphics.body[gj]
    same = scene.pairs.graphic_i[pair] * len(scene.graphics.body) + scene.pairs.graphic_j[pair]
    P.key[k], P.row[k] = same, s - scene.pairs.slot[pair]
    P.slop[k] = slop_of(scene, S, gi, gj)
    n = vector(point[AT_NORMAL:])
    x = any_tangent(n)
    for j in range(3):
        P.normal[k, j], P.tangent[k, j] = n[j], x[j]
    return k


@jitable
def add_row(
    scene: Scene, S: Stepping, y: F1, pair: int, s: int, within: tuple[float, float]
) -> bool:
    """Take row s of a pair as a contact point if its gap is within (beyond, up to) these.

    Return False if there is no room.
    """
    P, point = S.points, scene.work.points[s]
    gap = -point[AT_DEPTH]
    if not within[0] < gap <= within[1] or not is_point(scene, pair, s):
        return True
    gi, gj = sides(scene, s)
    k = put_place(scene, S, pair, s, gi, gj)
    if k < 0:
        return False
    c = P.contact[k]
    S.tally.deepest[c] = max(S.tally.deepest[c], -gap)
    P.gap[k] = gap
    for side in range(2):
        x = position(scene, y, P.body[k, side])
        for j in range(3):
            P.point[k, j] = point[AT_POINT + j]
            P.arm[k, side, j] = point[AT_POINT + j] - x[j]
    return True


@jitable
def take_rows(scene: Scene, S: Stepping, y: F1, pair: int, within: tuple[float, float]) -> bool:
    """Take what a measured pair has that may close; return False if there is no room."""
    first = scene.pairs.slot[pair]
    for s in range(first, first + S.plan.rows[scene.pairs.kind[pair]]):
        if not add_row(scene, S, y, pair, s, within):
            return False
    return True


@jitable
def put_three(row: F1, at: int, a: V3, b: V3, c: V3) -> None:
    """Write three vectors from a place in a row on."""
    row[at], row[at + 1], row[at + 2] = a[0], a[1], a[2]
    row[at + 3], row[at + 4], row[at + 5] = b[0], b[1], b[2]
    row[at + 6], row[at + 7], row[at + 8] = c[0], c[1], c[2]


@jitable
def common_spin(S: Stepping, k: int) -> V3:
    """Return the spin of what bears at point k: that of both bodies, or of the one that turns less.

    What sticks is solved as that sees it: on a turntable as on a table that stands.
    """
    P, v, was = S.points, S.motion.before, S.points.was[k]
    if was == NOT_KEPT or (was >= 0 and S.kept.table[was, KEPT_STICKS] == 0.0):
        return 0.0, 0.0, 0.0
    a, b = vector(v[P.body[k, 0]], 3), vector(v[P.body[k, 1]], 3)
    of_a, of_b = dot(a, a), dot(b, b)
    if of_a == 0.0 or of_b == 0.0:
        return 0.0, 0.0, 0.0
    part = of_b / (of_a + of_b)
    return add(scale(part, a), scale(1.0 - part, b))


@jitable
def put_side(
    S: Stepping, k: int, side: int, axes: tuple[V3, V3, V3], turn: V3
) -> tuple[float, float, float, float, float, float]:
    """Fill what point k does to one of its bodies, and how that turns it; return its part of W.

    That is of (nn, nx, nz, xx, xz, zz); none of ground. Friction acts on the arm as it is at the
    step's end, turned by a small turn: there it is that what sticks has no slip.
    """
    P, b, row = S.points, S.points.body[k, side], S.points.given[k]
    at, to = TURN + 9 * side, SPIN + 9 * side
    if b == len(S.motion.inverse):
        for c in range(9):
            row[at + c] = row[to + c] = 0.0
        row[LIGHT + side] = 0.0
        return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    inverse, arm = S.motion.inverse[b], vector(P.arm[k, side])
    light = inverse[0, 0]
    row[LIGHT + side] = light
    end = add(arm, cross(turn, arm))
    n, x, z = cross(arm, axes[0]), cross(end, axes[1]), cross(end, axes[2])
    put_three(row, at, n, x, z)
    i, j, m = vector(inverse[3], 3), vector(inverse[4], 3), vector(inverse[5], 3)
    by_n = (dot(i, n), dot(j, n), dot(m, n))
    by_x = (dot(i, x), dot(j, x), dot(m, x))
    by_z = (dot(i, z), dot(j, z), dot(m, z))
    put_three(row, to, by_n, by_x, by_z)
    return (
        light + dot(n, by_n),
        dot(n, by_x),
        dot(n, by_z),
        light + dot(x, by_x),
        dot(x, by_z),
        light + dot(z, by_z),
    )


@jitable
def fill_point(scene: Scene, S: Stepping, k: int, begin: int, h: float) -> bool:
    """Fill the axes of point k, what it does to its bodies and its closing speed; False if no room.

    `begin` is the first of the wide rows that are not in use. What held bodies answer is found
    behind this.
    """
    P, row = S.points, S.points.given[k]
    n, x = vector(P.normal[k]), vector(P.tangent[k])
    axes = (n, x, cross(n, x))
    put_three(row, AXES, axes[0], axes[1], axes[2])
    turn = scale(h, common_spin(S, k))
    i, j = put_side(S, k, 0, axes, turn), put_side(S, k, 1, axes, turn)
    for c in range(6):
        row[W_NN + c] = i[c] + j[c]
    P.closing[k] = velocity_of(P, k, 0, S.motion.before)
    return widen(scene, S, k, begin)


@jitable
def fill_answers(scene: Scene, S: Stepping) -> None:
    """Fill W of all points, and its inverse."""
    P = S.points
    answer_listed(scene, S)
    for k in range(S.tally.count[POINTS]):
        row, free = P.given[k], (0.0, 0.0)
        if P.wide[k] >= 0:
            free = row[W_NN], max(row[W_XX], row[W_ZZ])
            rows = row_of(P, k, 0), row_of(P, k, 1)
            row[W_NN], row[W_NX] = answer_of(P, k, 0, 0, rows), answer_of(P, k, 0, 1, rows)
            row[W_NZ], row[W_XX] = answer_of(P, k, 0, 2, rows), answer_of(P, k, 1, 1, rows)
            row[W_XZ], row[W_ZZ] = answer_of(P, k, 1, 2, rows), answer_of(P, k, 2, 2, rows)
        fill_inverse(row, free)
