"""Which contact points a step looks at: those that touch, and those that may within the step.

Detection is that of compliant contact (`contact.detection`): the same pairs, kernels and slots.
A pair is measured where it may close within the step: by the distance that it had when measured
last, less what its shapes have moved since and may move in the step.
"""

from __future__ import annotations

import math

from mbsim.arrays.codes import ACTIVE, FCL_CALLS, NARROWPHASE, SKIPPED, WANTED
from mbsim.arrays.hooks import Hook
from mbsim.arrays.scene import Scene
from mbsim.core.address import call_int
from mbsim.core.arrays import F1, V3
from mbsim.core.codes import Code
from mbsim.core.jitable import jitable
from mbsim.core.rotation import any_tangent, cross, norm, sub, vector
from mbsim.dynamics.bodies.kinematics import place_graphics, position
from mbsim.dynamics.contact.detection import keep_places, measure_pair
from mbsim.dynamics.contact.forces import IGNORE_DEEPER, sides
from mbsim.geometry.catalog import AT_DEPTH, AT_NORMAL, AT_POINT, AT_WEIGHT
from mbsim.stepping.arrays import POINTS, Stepping

#: Part of a step's motion by which pairs are looked for beyond it: others may hit what moves.
AHEAD = 0.5
#: Weights below this are no point.
LEAST = 1e-6


@jitable
def fill_reach(scene: Scene, S: Stepping, h: float) -> None:
    """Bound how far any point of a graphic may come in a step, by its body's velocities."""
    graphics, M = scene.graphics, S.motion
    for g in range(len(graphics.body)):
        b = graphics.body[g]
        far, turns = 0.0, 0.0
        for v in (M.before[b], M.free[b]):
            far = max(far, norm((v[0], v[1], v[2])))
            turns = max(turns, norm((v[3], v[4], v[5])))
        if turns > 0.0 and not math.isinf(graphics.radius[g]):
            far += turns * (graphics.radius[g] + norm(vector(graphics.p[g])))
        elif turns > 0.0:
            far = math.inf
        M.reach[g] = (1.0 + AHEAD) * h * far


@jitable
def add_row(scene: Scene, S: Stepping, pair: int, s: int, reach: float) -> bool:
    """Take row s of a pair as a contact point if it may close; return False if there is no room."""
    P, point = S.points, scene.work.points[s]
    depth, kind = point[AT_DEPTH], scene.pairs.kind[pair]
    if point[AT_WEIGHT] <= LEAST or -depth > reach:
        return True
    if depth <= 0.0 and S.plan.near[kind] == 0:
        return True
    c = scene.kinds.contact[kind]
    if depth > scene.contacts.numbers[c, IGNORE_DEEPER]:
        return True
    k = S.tally.count[POINTS]
    if k == len(P.slot):
        return False
    S.tally.count[POINTS] = k + 1
    S.tally.deepest[c] = max(S.tally.deepest[c], depth)
    gi, gj = sides(scene, s)
    P.slot[k], P.contact[k], P.gap[k] = s, c, -depth
    P.body[k, 0], P.body[k, 1] = scene.graphics.body[gi], scene.graphics.body[gj]
    same = scene.pairs.graphic_i[pair] * len(scene.graphics.body) + scene.pairs.graphic_j[pair]
    P.key[k], P.row[k] = same, s - scene.pairs.slot[pair]
    n = vector(point[AT_NORMAL:])
    x = any_tangent(n)
    for j in range(3):
        P.point[k, j], P.normal[k, j], P.tangent[k, j] = point[AT_POINT + j], n[j], x[j]
    return True


@jitable
def take_rows(scene: Scene, S: Stepping, pair: int, reach: float, committed: bool) -> bool:
    """Take what a measured pair has; return False if there is no room."""
    pairs, kind = scene.pairs, scene.pairs.kind[pair]
    deepest = -math.inf
    for s in range(pairs.slot[pair], pairs.slot[pair] + S.plan.rows[kind]):
        deepest = max(deepest, scene.work.points[s, AT_DEPTH])
        if not add_row(scene, S, pair, s, reach):
            return False
    if committed:
        pairs.gap[pair] = pairs.left[pair] = -deepest
    return True


@jitable
def find_points(scene: Scene, S: Stepping, y: F1, h: float, committed: bool) -> int:
    """Fill the list of points that a step h from y looks at; return 0 or a code.

    At a committed state what is found of distances is kept.
    """
    pairs, work, log = scene.pairs, scene.work, scene.log
    S.tally.count[POINTS] = 0
    if not place_graphics(scene, y):
        return Code.TOO_FAR
    if pairs.count[WANTED] > 0:
        return Code.CROWDED
    fill_reach(scene, S, h)
    waiting, measured = 0, 0
    for c in range(len(work.beyond)):
        work.beyond[c] = 0
    for k in range(pairs.count[ACTIVE]):
        pair = pairs.active[k]
        gi, gj = pairs.graphic_i[pair], pairs.graphic_j[pair]
        reach = S.motion.reach[gi] + S.motion.reach[gj]
        if pairs.left[pair] - work.travel[gi] - work.travel[gj] > reach:
            continue
        measured += 1
        if not measure_pair(scene, pair):
            work.fcl[waiting] = pair
            waiting += 1
        elif not take_rows(scene, S, pair, reach, committed):
            return Code.NO_ROOM
    log.counters[NARROWPHASE] += measured
    log.counters[SKIPPED] += pairs.count[ACTIVE] - measured
    if waiting == 0:
        return 0
    log.counters[FCL_CALLS] += waiting
    code = call_int(scene.world.hooks[Hook.FCL], (waiting,))
    if code != 0:
        return code
    for k in range(waiting):
        pair = work.fcl[k]
        keep_places(scene, pair)
        reach = S.motion.reach[pairs.graphic_i[pair]] + S.motion.reach[pairs.graphic_j[pair]]
        if not take_rows(scene, S, pair, reach, False):
            return Code.NO_ROOM
    return 0


@jitable
def commit_distances(scene: Scene) -> None:
    """Take what shapes have moved from the distance of every pair."""
    pairs, travel = scene.pairs, scene.work.travel
    for k in range(pairs.count[ACTIVE]):
        pair = pairs.active[k]
        pairs.left[pair] -= travel[pairs.graphic_i[pair]] + travel[pairs.graphic_j[pair]]


@jitable
def put_side(scene: Scene, S: Stepping, y: F1, k: int, side: int, axes: tuple[V3, V3, V3]) -> None:
    """Fill H, and what impulses do, of one body of point k; `axes` are n, x, y or less them."""
    P, b = S.points, S.points.body[k, side]
    H, answer = P.H[k, side], P.answer[k, side]
    if b == len(scene.bodies.mass):
        for a in range(3):
            for c in range(6):
                H[a, c] = answer[c, a] = 0.0
        return
    arm = sub(vector(P.point[k]), position(scene, y, b))
    for a in range(3):
        turn = cross(arm, axes[a])
        for c in range(3):
            H[a, c], H[a, 3 + c] = axes[a][c], turn[c]
    inverse = S.motion.inverse[b]
    for a in range(3):
        for c in range(6):
            total = 0.0
            for d in range(6):
                total += inverse[c, d] * H[a, d]
            answer[c, a] = total


@jitable
def fill_point(scene: Scene, S: Stepping, y: F1, k: int) -> None:
    """Fill H, the answers to impulses, W and the closing speed of point k."""
    P, M = S.points, S.motion
    n, x = vector(P.normal[k]), vector(P.tangent[k])
    z = cross(n, x)
    put_side(scene, S, y, k, 0, (n, x, z))
    put_side(
        scene,
        S,
        y,
        k,
        1,
        ((-n[0], -n[1], -n[2]), (-x[0], -x[1], -x[2]), (-z[0], -z[1], -z[2])),
    )
    i, j = P.body[k, 0], P.body[k, 1]
    for a in range(3):
        for c in range(3):
            total = 0.0
            for d in range(6):
                total += P.H[k, 0, a, d] * P.answer[k, 0, d, c]
                total += P.H[k, 1, a, d] * P.answer[k, 1, d, c]
            P.W[k, a, c] = total
    u = 0.0
    for d in range(6):
        u += P.H[k, 0, 0, d] * M.before[i, d] + P.H[k, 1, 0, d] * M.before[j, d]
    P.closing[k] = u
