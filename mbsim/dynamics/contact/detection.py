"""Who touches whom: the motion bound, the closed-form kernels, the hook to FCL and its points.

Points that FCL found come without the shapes' motion between them: what follows from them is last.

A pair that has `left` between it at the committed state cannot touch while its shapes have
moved by less since. That is a pure function of the trial point and the committed state, so
skipping a pair never changes a result; it only saves the kernel.
"""

from __future__ import annotations

import math

from mbsim.arrays.codes import ACTIVE, FCL_CALLS, NARROWPHASE, ON_PLANE, SKIPPED, WANTED
from mbsim.arrays.hooks import Hook, note_failure
from mbsim.arrays.scene import Scene
from mbsim.core.address import call_int
from mbsim.core.arrays import F1
from mbsim.core.codes import Code
from mbsim.core.counting import number_of_parts
from mbsim.core.jitable import jitable
from mbsim.core.rotation import dot, norm, sub, vector
from mbsim.dynamics.bodies.kinematics import place_graphics
from mbsim.dynamics.contact.forces import IGNORE_DEEPER, sides, velocity_at
from mbsim.geometry.catalog import (
    AT_DEPTH,
    AT_NORMAL,
    AT_POINT,
    COUPLE,
    COUPLE_OF_FORCE,
    LEAN_X,
    LEAN_Y,
    REGION_ROWS,
    axis,
)


@jitable
def keep_places(scene: Scene, pair: int) -> None:
    """Let incidents that are no parts of a shape keep their slots."""
    if scene.kinds.moves[scene.pairs.kind[pair]] > ON_PLANE:
        note_failure(scene, call_int(scene.world.hooks[Hook.SLOTS], (scene, pair)))


@jitable
def measure_pair(scene: Scene, pair: int) -> bool:
    """Run a pair's closed form into its rows of `points`; False where FCL has to do it."""
    pairs, kinds, work = scene.pairs, scene.kinds, scene.work
    kind = pairs.kind[pair]
    if kinds.kernel[kind] == 0:
        return False
    i, j, first = pairs.graphic_i[pair], pairs.graphic_j[pair], pairs.slot[pair]
    count = call_int(
        kinds.kernel[kind],
        (
            work.frames[i],
            scene.graphics.size[i],
            work.frames[j],
            scene.graphics.size[j],
            work.points[first:],
        ),
    )
    c = kinds.contact[kind]
    acts = scene.contacts.numbers[c, IGNORE_DEEPER] >= 0.0
    if count < 0 and acts and work.beyond[c] == 0:
        work.beyond[c] = 1 + pair
    if kinds.swapped[kind] == 1:
        patches = kinds.step[kind] == REGION_ROWS
        for s in range(first, first + kinds.slots[kind]):
            if patches and (s - first) % REGION_ROWS == 1:
                # numbers in place of a point: I tilts the other way, all else is as it was
                work.points[s, LEAN_X] = -work.points[s, LEAN_X]
                work.points[s, LEAN_Y] = -work.points[s, LEAN_Y]
                continue
            for k in range(3):
                work.points[s, AT_NORMAL + k] = -work.points[s, AT_NORMAL + k]
                work.points[s, COUPLE + k] = -work.points[s, COUPLE + k]
                work.points[s, COUPLE_OF_FORCE + k] = -work.points[s, COUPLE_OF_FORCE + k]
    keep_places(scene, pair)
    return True


@jitable
def gather(scene: Scene, pair: int) -> None:
    """Append the slots of a pair that touch to the list of hits."""
    work, hit = scene.work, scene.work.hit
    kind, first = scene.pairs.kind[pair], scene.pairs.slot[pair]
    last = len(hit) - 1
    # what is behind the first row of an incident with an area is in that
    for k in range(number_of_parts(scene.kinds.slots[kind], scene.kinds.step[kind])):
        s = first + k * scene.kinds.step[kind]
        depth = work.points[s, AT_DEPTH]
        if (
            depth > 0.0
            and depth <= scene.contacts.numbers[scene.kinds.contact[kind], IGNORE_DEEPER]
        ):
            work.touching[s] = 1
            hit[hit[last]] = s
            hit[last] += 1


@jitable
def find_contacts(scene: Scene, y: F1) -> int:
    """Fill the list of slots that touch, with their points; return 0, or a code."""
    pairs, work, log = scene.pairs, scene.work, scene.log
    hit, last = work.hit, len(work.hit) - 1
    for k in range(hit[last]):
        work.touching[hit[k]] = 0
    hit[last] = 0
    for c in range(len(work.beyond)):
        work.beyond[c] = 0
    if not place_graphics(scene, y):
        return Code.TOO_FAR
    if pairs.count[WANTED] > 0:
        return Code.CROWDED

    waiting, measured = 0, 0
    for k in range(pairs.count[ACTIVE]):
        pair = pairs.active[k]
        if (
            work.travel[pairs.graphic_i[pair]] + work.travel[pairs.graphic_j[pair]]
            < pairs.left[pair]
        ):
            continue
        measured += 1
        if measure_pair(scene, pair):
            gather(scene, pair)
        else:
            work.fcl[waiting] = pair
            waiting += 1

    log.counters[NARROWPHASE] += measured
    log.counters[SKIPPED] += pairs.count[ACTIVE] - measured

    # one visit to Python for all pairs that need it
    if waiting > 0:
        log.counters[FCL_CALLS] += waiting
        code = call_int(scene.world.hooks[Hook.FCL], (waiting,))
        if code != 0:
            return code
        for k in range(waiting):
            keep_places(scene, work.fcl[k])
            gather(scene, work.fcl[k])
    return 0


@jitable
def bounding_gap(scene: Scene, pair: int) -> float:
    """Return a lower bound of two shapes' distance: ball of one to box or plane of the other."""
    pairs, graphics, work = scene.pairs, scene.graphics, scene.work
    best = -math.inf
    for side in range(2):
        g = pairs.graphic_i[pair] if side == 0 else pairs.graphic_j[pair]
        other = pairs.graphic_j[pair] if side == 0 else pairs.graphic_i[pair]
        frame, half = work.frames[other], graphics.half[other]
        d = sub(vector(work.frames[g]), vector(frame))
        if math.isinf(half[2]):
            best = max(best, dot(d, axis(frame, 2)) - graphics.radius[g])
            continue
        square = 0.0
        for k in range(3):
            out = max(0.0, abs(dot(d, axis(frame, k))) - half[k])
            square += out * out
        best = max(best, math.sqrt(square) - graphics.radius[g])
    return best


@jitable
def another_point(scene: Scene, y: F1, h: float, s: int) -> bool:
    """Return whether the point that FCL gives for slot s is too far to be the one before."""
    point, before = scene.work.points[s], scene.state.p[s]
    p = vector(point[AT_POINT:])
    gi, gj = sides(scene, s)
    graphics = scene.graphics
    speed = norm(velocity_at(scene, y, graphics.body[gi], p))
    speed += norm(velocity_at(scene, y, graphics.body[gj], p))
    size = min(graphics.radius[gi], graphics.radius[gj])
    # the point of touch may run ahead of both surfaces; a hundredth of the shape is near
    return norm(sub(p, vector(before))) > 2.0 * h * speed + 0.01 * size
