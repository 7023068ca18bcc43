"""Points beside the run: the twin with a parameter a little changed.

Derivatives along a direction are central differences of the equations, not of runs: both sides
have the run's step, its committed contacts and its branches, so that they differ smoothly.
"""

from __future__ import annotations

import math

from mbsim.arrays.codes import SCALE_SPEED
from mbsim.arrays.scene import Scene
from mbsim.core.arrays import F1, F2
from mbsim.core.jitable import jitable
from mbsim.core.layout import BODY_SIZE
from mbsim.core.memory import floats_at
from mbsim.dynamics.contact.forces import BRANCH, DEPTH, NORMAL, UNIT, contact_of
from mbsim.integrators.scheme import STEPS, Method
from mbsim.laws.catalog import LASTS, UNDECIDED
from mbsim.sensitivity.arrays import AGAIN, CORNERS, ODD, REMEMBERED, SET, UP_SIDE, Variations

#: Half of the step of differences, in usual sizes of the parameter and of y.
STEP = 1e-6
#: The same of places where it is not known how depths of contacts move: these are far smaller than
#: the model. Where it is known no depth changes by more than a part of itself.
STEP_OF_CONTACTS, PART_OF_DEPTH = 1e-9, 1e-6
#: A half of a stretch in which something jumps has more than this part of what it changes by.
UNEVEN = 0.6


@jitable
def half_step(V: Variations, k: int) -> float:
    """Return by how much parameter k is changed to either side."""
    return V.shrink[k] * part_of_step(V, k, 1.0, 1.0, 1.0)


@jitable
def step_along_motion(V: Variations, k: int) -> float:
    """Return by how much parameter k is changed to either side along a step."""
    # where slip turns round both sides do so at different times, between which D' is neither
    part = V.one_sided[3] if V.words[CORNERS] == 0 else 1.0
    return V.shrink[k] * part_of_step(V, k, part, 1.0, 1.0)


@jitable
def widest_step(V: Variations, k: int) -> float:
    """Return what of changes of parameter k counts near a jump: a third of those to one side."""
    part = max(1.0, V.one_sided[3], V.one_sided[0] / 3.0)
    return V.shrink[k] * part_of_step(V, k, part, 1.0, 1.0)


@jitable
def part_of_step(V: Variations, k: int, part: float, least: float, deep: float) -> float:
    """Return by how much parameter k is changed, with such parts of the usual steps."""
    largest = surely = 1.0 / (STEP * V.size[k])
    for i in range(len(V.room)):
        largest = max(largest, abs(V.d[k, i]) / (STEP * V.scale[i]))
        surely = max(surely, abs(V.d[k, i]) / V.room[i])
    return max(least / surely, min(part / largest, deep * V.reach[k]))


@jitable
def one_side(V: Variations, m: Method, k: int) -> float:
    """Return by how much parameter k is changed for differences from the run itself.

    To one side, and to the other in the next step: what one side is off by, e f_yy D D / 2, cancels
    from step to step but for what it changes in one.
    """
    e = part_of_step(V, k, V.one_sided[0], V.one_sided[1], V.one_sided[2])
    return e if m.counts[STEPS] % 2 == 0 else -e


@jitable
def is_deep(V: Variations, k: int) -> bool:
    """Return whether depths of contacts bound the step of a difference, as in an impact.

    There forces bend far more than elsewhere, and differences to one side are not good enough.
    """
    return V.words[REMEMBERED] == 0 and half_step(V, k) >= V.reach[k] > 0.0


@jitable
def keep_depths(V: Variations, twin: Scene, side: int) -> None:
    """Keep how deep all slots are on one side, 0 where they do not touch."""
    for s in range(V.depth.shape[1]):
        V.depth[side, s] = twin.work.slot[s, DEPTH] if twin.work.touching[s] == 1 else 0.0


@jitable
def reach_of(V: Variations, width: float, other: int) -> float:
    """Return by how much a parameter may be changed, by depths of a side `width` from another."""
    reach = math.inf
    for s in range(V.depth.shape[1]):
        up, down = V.depth[UP_SIDE, s], V.depth[other, s]
        if up != down:
            reach = min(reach, abs(width) * PART_OF_DEPTH * min(up, down) / abs(up - down))
    return reach


@jitable
def change_of(V: Variations, one: F1, other: F1) -> float:
    """Return by how much two derivatives in time differ at most, in usual sizes."""
    largest = 0.0
    for i in range(len(V.scale)):
        largest = max(largest, abs(one[i] - other[i]) / V.scale[i])
    return largest


@jitable
def half_with_jump(V: Variations, rows: F2, at: tuple[int, int, int], whole: float) -> int:
    """Return which half of a stretch has what a derivative in time jumps by there, -1 for neither.

    `at` are the rows of its begin, middle and end, and `whole` is what it changes by in all. The
    row of the middle is copied to the end that is left.
    """
    begin, middle, end = at
    first, last = change_of(V, rows[begin], rows[middle]), change_of(V, rows[middle], rows[end])
    if not max(first, last) > UNEVEN * whole:
        return -1
    half, row = (0, end) if first > last else (1, begin)
    for i in range(rows.shape[1]):
        rows[row, i] = rows[middle, i]
    return half


@jitable
def acts(V: Variations, scene: Scene, s: int) -> int:
    """Return 1 if slot s touches where a scene was evaluated last, 0 if not.

    Where its friction jumps as nothing presses any more it does no longer count as touching then,
    as where damping has brought the normal force to zero while it is still deep.
    """
    if scene.work.touching[s] == 0:
        return 0
    breaks = V.breaks[contact_of(scene, s)] == 1
    return 1 if not breaks or scene.work.slot[s, NORMAL] > 0.0 else 0


@jitable
def has_acted(V: Variations, scene: Scene, s: int) -> int:
    """Return the same of the committed state."""
    if scene.state.touching[s] == 0:
        return 0
    return 1 if V.breaks[contact_of(scene, s)] == 0 or scene.state.normal[s] > 0.0 else 0


@jitable
def feel(V: Variations, scene: Scene) -> None:
    """Let errors of what friction carries count as the velocities of the same energy.

    Forces of stiff springs make these of it, in steps to come. Not of friction that tells stick
    from slip: steps end where that changes, and it bends nowhere within one.
    """
    hit, V.words[CORNERS] = scene.work.hit, 0
    for j in range(hit[len(hit) - 1]):
        s = hit[j]
        unit = scene.work.slot[s, UNIT] / LASTS if scene.state.mode[s] == 0.0 else 0.0
        if unit > 0.0:
            V.words[CORNERS] = 1
        for i in range(scene.contacts.carried[contact_of(scene, s)]):
            at = scene.slots.z[s] + i
            V.felt[at] = scene.world.scale[SCALE_SPEED] / unit if unit > 0.0 else math.inf


@jitable
def set_parameter(V: Variations, twin: Scene, scene: Scene, k: int, e: float) -> None:
    """Let parameter k of the twin, and no other, be changed by e, and laws' memories with it."""
    last = V.words[SET]
    if last != k:
        for j in range(V.first[last], V.first[last + 1]):
            floats_at(V.place[j], 1)[0] = V.base[j]
        V.words[SET] = k
    for j in range(V.first[k], V.first[k + 1]):
        floats_at(V.place[j], 1)[0] = V.base[j] + e * V.rise[j]
    if V.words[REMEMBERED] > 0:
        state, own, again = scene.state, twin.state, V.words[AGAIN] - 1
        for s in range(state.memory.shape[0]):
            for j in range(state.memory.shape[1]):
                if again >= 0:
                    moves = V.held_moves[again * len(V.size) + k, s, j]
                    own.memory[s, j] = V.held_memory[again, s, j] + e * moves
                    continue
                own.memory[s, j] = state.memory[s, j] + e * V.memory[k, s, j]
                own.before[s, j] = state.before[s, j] + e * V.before[k, s, j]


@jitable
def keep_unit(d: F1, y: F1, bodies: int) -> None:
    """Let the derivatives of quaternions be those of unit length, as `project` leaves y.

    A linearised mechanism knows turns alone: of what changes lengths nothing is solved for.
    """
    for b in range(bodies):
        at = BODY_SIZE * b + 3
        along = size = 0.0
        for i in range(at, at + 4):
            along += y[i] * d[i]
            size += y[i] * y[i]
        for i in range(at, at + 4):
            d[i] -= along / size * y[i]


@jitable
def is_asked(V: Variations, s: int) -> bool:
    """Return whether slot s is one of those that change their branch at the end of the step."""
    for j in range(V.asks[len(V.asks) - 1]):
        if V.asks[j] == s:
            return True
    return False


@jitable
def keep_memory(V: Variations, scene: Scene, side: int) -> None:
    """Keep what laws make of their memories, of the twin's side or of the run itself."""
    for s in range(V.far.shape[1]):
        for j in range(V.far.shape[2]):
            V.far[side, s, j] = scene.work.memory[s, j] if scene.work.touching[s] == 1 else 0.0


@jitable
def keep_side(V: Variations, twin: Scene, scene: Scene, side: int) -> None:
    """Keep what laws make of their memories on one side, and whether one is on another branch."""
    keep_memory(V, twin, side)
    for s in range(V.far.shape[1]):
        touches = twin.work.touching[s] == 1
        asked, goes_on = twin.work.slot[s, BRANCH], scene.state.touching[s] == 1 and touches
        odd = goes_on and asked != UNDECIDED and asked != scene.state.mode[s] and not is_asked(V, s)
        V.odd[side, s] = 1 if odd else 0
        if odd:
            V.words[ODD] = 1


@jitable
def keep_change(V: Variations, k: int, width: float, other: int) -> None:
    """Keep how what laws remember at the end of the step moves, of a side and one `width` off."""
    for s in range(V.far.shape[1]):
        for j in range(V.far.shape[2]):
            V.end[k, s, j] = (V.far[UP_SIDE, s, j] - V.far[other, s, j]) / width


@jitable
def beside(V: Variations, y: F1, k: int, e: float, out: F1) -> None:
    """Write y, moved by e along the derivative for parameter k, into `out`."""
    for i in range(len(out)):
        out[i] = y[i] + e * V.d[k, i]
