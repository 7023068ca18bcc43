"""Contact points of a step: rows of measured pairs, and what impulses at them do."""

from __future__ import annotations

import math

from mbsim.arrays.hooks import Hook, Joints, note_failure
from mbsim.arrays.scene import Scene
from mbsim.core.address import call_int
from mbsim.core.arrays import F1, F3, V3
from mbsim.core.jitable import jitable
from mbsim.core.rotation import any_tangent, cross, dot, norm, vector
from mbsim.dynamics.bodies.kinematics import position
from mbsim.dynamics.contact.forces import IGNORE_DEEPER, sides
from mbsim.geometry.catalog import AT_DEPTH, AT_NORMAL, AT_POINT, AT_WEIGHT
from mbsim.stepping.arrays import POINTS, Stepping

#: Part of a step's motion by which pairs are looked for beyond it: others may hit what moves.
AHEAD = 0.5
#: Weights below this are no point.
LEAST = 1e-6
#: A determinant is none below this part of the product of a matrix' diagonal.
SINGULAR = 1e-12


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
    """Bound how far any point of a graphic may come in a step, by its body's velocities."""
    for g in range(len(scene.graphics.body)):
        S.motion.reach[g] = way_at(scene, S, g, h, scene.graphics.radius[g])


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
def put_side(scene: Scene, S: Stepping, k: int, side: int, axes: tuple[V3, V3, V3]) -> None:
    """Fill H, and what impulses do, of one body of point k; `axes` are n, x, y or less them."""
    P, b = S.points, S.points.body[k, side]
    H, answer = P.H[k, side], P.answer[k, side]
    if b == len(scene.bodies.mass):
        for a in range(3):
            for c in range(6):
                H[a, c] = answer[a, c] = 0.0
        return
    arm = vector(P.arm[k, side])
    for a in range(3):
        turn = cross(arm, axes[a])
        for c in range(3):
            H[a, c], H[a, 3 + c] = axes[a][c], turn[c]
    inverse = S.motion.inverse[b]
    for a in range(3):
        for c in range(3):
            answer[a, c] = inverse[c, c] * H[a, c]
            total = 0.0
            for d in range(3, 6):
                total += inverse[3 + c, d] * H[a, d]
            answer[a, 3 + c] = total


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
def list_moved(S: Stepping, k: int) -> bool:
    """Fill which bodies point k moves, behind those of the points before; False if no room."""
    P, plan = S.points, S.plan
    P.many[k] = 0
    i, j = P.body[k, 0], P.body[k, 1]
    for side in range(2):
        b = i if side == 0 else j
        g = plan.group[b]
        if g < 0:
            if b < len(S.motion.inverse) and not add_moved(S, k, b):
                return False
            continue
        if side == 1 and g == plan.group[i]:
            continue
        for m in range(plan.first[g], plan.first[g + 1]):
            if not add_moved(S, k, plan.members[m]):
                return False
    return True


@jitable
def widen(scene: Scene, S: Stepping, k: int, begin: int) -> bool:
    """Fill what impulses at point k do where joints hold its bodies, as rows from `begin` on.

    Return False if there is no room.
    """
    P, plan, impulse = S.points, S.plan, S.motion.impulse
    P.wide[k] = -1
    if plan.group[P.body[k, 0]] < 0 and plan.group[P.body[k, 1]] < 0:
        return True
    P.wide[k] = begin
    if not list_moved(S, k):
        return False
    for a in range(3):
        for b in range(6 * len(S.motion.inverse)):
            impulse[b] = 0.0
        for side in range(2):
            b = P.body[k, side]
            if plan.group[b] >= 0:
                for c in range(6):
                    impulse[6 * b + c] += P.H[k, side, a, c]
        joints = scene.world.hooks[Hook.JOINTS]
        note_failure(scene, call_int(joints, (scene, Joints.IMPULSE, 0.0, impulse, impulse)))
        for row in range(begin, begin + P.many[k]):
            b = P.moved[row]
            side = 0 if b == P.body[k, 0] else 1
            for c in range(6):
                held = plan.group[b] >= 0
                P.moves[row, c, a] = impulse[6 * b + c] if held else P.answer[k, side, a, c]
    # what its own bodies do
    for row in range(begin, begin + P.many[k]):
        for side in range(2):
            if P.moved[row] == P.body[k, side]:
                for c in range(6):
                    for a in range(3):
                        P.answer[k, side, a, c] = P.moves[row, c, a]
    return True


@jitable
def invert(A: F3, out: F3, k: int) -> None:
    """Write the inverse of the 3 x 3 matrix A[k], 0 where it has none to speak of."""
    a, b, c = vector(A[k, 0]), vector(A[k, 1]), vector(A[k, 2])
    x, y, z = cross(b, c), cross(c, a), cross(a, b)
    determinant = dot(a, x)
    some = determinant > SINGULAR * A[k, 0, 0] * A[k, 1, 1] * A[k, 2, 2]
    part = 1.0 / determinant if some else 0.0
    for row in range(3):
        out[k, row, 0], out[k, row, 1], out[k, row, 2] = part * x[row], part * y[row], part * z[row]


@jitable
def fill_point(scene: Scene, S: Stepping, k: int, begin: int) -> bool:
    """Fill H, the answers to impulses, W and the closing speed of point k; False if no room.

    `begin` is the first of the wide rows that are not in use.
    """
    P, M = S.points, S.motion
    n, x = vector(P.normal[k]), vector(P.tangent[k])
    z = cross(n, x)
    put_side(scene, S, k, 0, (n, x, z))
    put_side(
        scene,
        S,
        k,
        1,
        ((-n[0], -n[1], -n[2]), (-x[0], -x[1], -x[2]), (-z[0], -z[1], -z[2])),
    )
    if not widen(scene, S, k, begin):
        return False
    i, j = P.body[k, 0], P.body[k, 1]
    for a in range(3):
        for c in range(3):
            total = 0.0
            for d in range(6):
                total += P.H[k, 0, a, d] * P.answer[k, 0, c, d]
                total += P.H[k, 1, a, d] * P.answer[k, 1, c, d]
            P.W[k, a, c] = total
    invert(P.W, P.stops, k)
    u = 0.0
    for d in range(6):
        u += P.H[k, 0, 0, d] * M.before[i, d] + P.H[k, 1, 0, d] * M.before[j, d]
    P.closing[k] = u
    return True
