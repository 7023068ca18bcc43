"""Derivatives across the end of a step at which friction or a force goes to another branch.

With y+ = R(t, y-) at the time t* of the change, and f- and f+ on its sides,

    D+ = R_y D- + R_p + (dR/dt - f+) dt*/dp,

R being y itself but for what friction carries, which begins as another number (transfer condition;
S. Galan, W. F. Feehery, P. I. Barton, Appl. Numer. Math. 31 (1999) 17). dt*/dp is found as
the time was: where both sides of the difference, carried on along f-, ask for the other branch.

Points of a body stick and slip nearly at once, nearer to each other than both sides of any
difference. But each has a time of its own: within a step friction keeps to its committed branch,
so that forces are smooth on both sides of every point's time, whatever others ask for. Forces of
points add up, and so do what they jump by,

    D+ = R_y D- + R_p + sum over points i of (f without i's change - f with it) dt_i*/dp,

to the first order in whatever order the changes are.
"""

from __future__ import annotations

import math

from mbsim.arrays.codes import SLIDES
from mbsim.arrays.scene import Scene
from mbsim.core.address import call_int, view
from mbsim.core.arrays import F1
from mbsim.core.jitable import jitable
from mbsim.core.problem import ASK
from mbsim.dynamics.contact.forces import BRANCH as ASKED_BRANCH
from mbsim.dynamics.contact.forces import FOUND_AT, contact_of
from mbsim.integrators.scheme import in_workspace
from mbsim.laws.catalog import BRANCHES, UNDECIDED
from mbsim.sensitivity.arrays import (
    ASKED,
    BEFORE,
    BY,
    DOWN_SIDE,
    DOWN_TO,
    F_BEFORE,
    F_BEHIND,
    GONE_OVER,
    JUMPS,
    LINE_F,
    LINE_Y,
    LOST_GRAZING,
    LOST_JUMP,
    ODD,
    REMEMBERED,
    TWIN,
    UP,
    UP_TO,
    Variations,
)
from mbsim.sensitivity.branches import ANY_BRANCH, branch_of
from mbsim.sensitivity.changes import crossing, jump_at, nearest
from mbsim.sensitivity.twin import half_step, is_asked, keep_change, keep_side, set_parameter

#: Times of changes are looked for along a straight line as long as this part of the problem's own
#: time; how far behind them what friction keeps is asked for, over that.
SPAN, BEHIND = 1e-4, 1e-5
#: A difference of times is good where the run is so near to their middle, over their distance.
SURE = 0.01
#: By how much, over that, what is kept may differ between the run and both sides.
ALIKE = 0.03
#: Times are rounded as forces are: the parameter is changed by so much more for them at first.
WIDER = 10.0
#: So often a smaller difference is tried for the time of a change; so often farther behind it.
TRIES, TRIES_BEHIND = 6, 10
#: A jump of f below this part of its size is none; where it is found beside the run itself.
NONE, JUMP = 1e-9, 1e-6
#: Rows of `Variations.work`: a point, f there, f with one change less.
POINT, WITH, WITHOUT = range(3)


@jitable
def asks(scene: Scene, s: int) -> bool:
    """Return whether friction in slot s will be on another branch than it is committed to."""
    branch, state = scene.work.slot[s, ASKED_BRANCH], scene.state
    goes_on = state.touching[s] == 1 and scene.work.touching[s] == 1
    return goes_on and branch != UNDECIDED and branch != state.mode[s]


@jitable
def list_asking(V: Variations, scene: Scene, switched: bool) -> None:
    """List the slots that change their branch at the end of the step."""
    hit, count, last = scene.work.hit, 0, len(V.asks) - 1
    for j in range(hit[len(hit) - 1] if switched and V.words[REMEMBERED] > 0 else 0):
        if asks(scene, hit[j]):
            V.asks[count] = hit[j]
            count += 1
    V.asks[last] = count
    for s in range(len(V.mode)):
        V.mode[s] = scene.state.mode[s]


@jitable
def find_times(V: Variations, scene: Scene, t: float, H: float, k: int, what: int, at: int) -> None:
    """Find when either side has the change that the run has at t; NaN where one has not.

    With a smaller difference where the run is not in their middle: there times are no straight line
    over the parameter. The one is kept that is the nearest to it, as rounding grows the other way.
    """
    e, best, found, own = WIDER * half_step(V, k), math.inf, V.times[k, at], 1.0
    if V.words[GONE_OVER] == 1:
        e = V.wide[k]
        own = crossing(V, scene, t - H, H, k, 0.0, what, 1.0)
    found[:] = math.nan
    for _ in range(TRIES):
        up = crossing(V, scene, t - H, H, k, e, what, 1.0)
        down = crossing(V, scene, t - H, H, k, -e, what, 1.0)
        if abs(up - down) < math.inf:
            bow = abs(up + down - 2.0 * own) / max(abs(up - down), 1e-300)
            if bow < best:
                best, found[UP_TO], found[DOWN_TO], found[BY] = bow, up * H - H, down * H - H, e
            if bow <= SURE:
                return
            if bow > best:
                return
        e *= 0.1


@jitable
def shift_of(V: Variations, k: int, at: int) -> float:
    """Return how fast the time of a change moves with parameter k, NaN where that is unknown."""
    found = V.times[k, at]
    return 0.5 / found[BY] * (found[UP_TO] - found[DOWN_TO])


@jitable
def note_shifts(V: Variations, scene: Scene, t: float, H: float, k: int) -> None:
    """Find how fast the times of all changes at time t move with parameter k."""
    twin, last = view(V.words[TWIN], Scene), len(V.asks) - 1
    for j in range(len(twin.state.chattering)):
        twin.state.chattering[j] = scene.state.chattering[j]
    for j in range(V.asks[last]):
        s = V.asks[j]
        find_times(V, scene, t, H, k, branch_of(s), s)
        V.shift[k, s] = shift_of(V, k, s)
    if V.asks[last] == 0:
        find_times(V, scene, t, H, k, ANY_BRANCH, last)
        V.shift[k, last] = shift_of(V, k, last)


@jitable
def note_jump(V: Variations, scene: Scene, t: float, H: float) -> None:
    """Find whether f jumps where an expression goes to another branch at time t.

    At the end of the step it is that behind the jump, and so are sides of differences in its last
    stages, some of them: what derivatives do there is not known.
    """
    V.words[JUMPS] = 0
    if V.asks[len(V.asks) - 1] > 0:
        return
    s, usual = crossing(V, scene, t - H, H, 0, 0.0, ANY_BRANCH, 1.0), 0.0
    if abs(s) < math.inf:
        for i in range(len(V.scale)):
            usual = max(usual, abs(V.jump[F_BEFORE, i]) / V.scale[i])
        jump = jump_at(V, scene, t - H, H, 0, s, 0.0, nearest(t - H, H))
        V.words[JUMPS] = 1 if jump > JUMP * usual * H else 0


@jitable
def ask_beside(V: Variations, scene: Scene, t: float, k: int, x: float, late: float) -> int:
    """Let laws decide at a time `late` after t, with parameter k changed by x; return a code."""
    twin, w = view(V.words[TWIN], Scene), V.work[POINT]
    p = in_workspace(V.words[UP])[0]
    set_parameter(V, twin, scene, k, x)
    for i in range(len(w)):
        w[i] = V.jump[LINE_Y, i] + x * V.next[k, i] + late * V.jump[LINE_F, i]
    # rates of forces were those of another point
    twin.work.slot[:, FOUND_AT] = math.nan
    V.words[ASKED] += 1
    return min(call_int(p.switching, (p.context, t + late, ASK, w, V.work[WITH])), 0)


@jitable
def note_kept(V: Variations, scene: Scene, t: float, H: float, k: int) -> bool:
    """Find how what friction keeps where it is on another branch beside the run moves.

    A little before the end of the step, and nearer to the run: on another branch what a law keeps
    is another number. Else on that side of the run where it is on the run's branch. Return
    whether there is one.
    """
    e, back, twin = half_step(V, k), BEHIND * H, view(V.words[TWIN], Scene)
    for _ in range(2 * TRIES):
        V.words[ODD] = 0
        for side in range(2):
            if ask_beside(V, scene, t, k, e if side == 0 else -e, -back) != 0:
                return False
            keep_side(V, twin, scene, side)
        if V.words[ODD] == 0:
            keep_change(V, k, 2.0 * e, DOWN_SIDE)
            return True
        e, back = 0.3 * e, 3.0 * back
    return keep_one_side(V, scene, t, k)


@jitable
def keep_one_side(V: Variations, scene: Scene, t: float, k: int) -> bool:
    """Find how what friction keeps moves to one side of the run; return whether that is known."""
    e, twin = half_step(V, k), view(V.words[TWIN], Scene)
    code = ask_beside(V, scene, t, k, 0.0, 0.0)
    for s in range(V.far.shape[1]):
        for j in range(V.far.shape[2]):
            V.middle[k, s, j] = twin.work.memory[s, j] if twin.work.touching[s] == 1 else 0.0
    for side in range(2):
        code = code or ask_beside(V, scene, t, k, e if side == 0 else -e, 0.0)
        keep_side(V, twin, scene, side)
    keep_change(V, k, 2.0 * e, DOWN_SIDE)
    for s in range(V.far.shape[1]):
        # where both sides are on the other branch they differ as smoothly as on the run's
        if V.odd[0, s] == V.odd[1, s]:
            continue
        side = 1 if V.odd[0, s] == 1 else 0
        for j in range(V.far.shape[2]):
            change = V.far[side, s, j] - V.middle[k, s, j]
            V.end[k, s, j] = change / (e if side == 0 else -e)
    return code == 0


@jitable
def note_changed(V: Variations, scene: Scene, t: float, H: float, k: int) -> None:
    """Find how what friction keeps behind its change of branch moves with parameter k.

    A little behind it, each side and each point at its own time; farther where there one side is
    not on the run's branch: next to the change rounding of rates decides.
    """
    twin = view(V.words[TWIN], Scene)
    for a in range(V.asks[len(V.asks) - 1]):
        s, late = V.asks[a], BEHIND * H
        if not abs(V.shift[k, s]) < math.inf:
            continue
        e = V.times[k, s, BY]
        for _ in range(TRIES_BEHIND):
            changed = 0
            for side in range(2):
                x = e if side == 0 else -e
                if ask_beside(V, scene, t, k, x, late + V.times[k, s, UP_TO + side]) != 0:
                    V.shift[k, s] = math.nan
                keep_side(V, twin, scene, side)
                if twin.work.slot[s, ASKED_BRANCH] == scene.work.slot[s, ASKED_BRANCH]:
                    changed += 1
            if changed == 2:
                break
            late *= 3.0
        for j in range(V.far.shape[2]):
            V.end[k, s, j] = 0.5 / e * (V.far[0, s, j] - V.far[1, s, j])
            V.middle[k, s, j] = 0.5 * (V.far[0, s, j] + V.far[1, s, j])


@jitable
def note_rates(V: Variations, twin: Scene, t: float, H: float, y: F1) -> None:
    """Find how fast what friction keeps changes behind time t, where y' is known."""
    p = in_workspace(V.words[UP])[0]
    w = V.work[POINT]
    for side in range(2):
        late = BEHIND * H * (2.0 - side)
        for i in range(len(w)):
            w[i] = y[i] + late * V.jump[F_BEHIND, i]
        if call_int(p.rhs, (p.context, t + late, 0.0, w, V.work[WITH])) != 0:
            return
        for s in range(V.far.shape[1]):
            for j in range(V.far.shape[2]):
                V.far[side, s, j] = twin.work.memory[s, j] if twin.work.touching[s] == 1 else 0.0
    for s in range(V.far.shape[1]):
        for j in range(V.far.shape[2]):
            V.far[0, s, j] = (V.far[0, s, j] - V.far[1, s, j]) / (BEHIND * H)


@jitable
def alike(V: Variations, scene: Scene, k: int, s: int) -> bool:
    """Return whether slot s keeps behind a change what both sides of the difference keep there."""
    off, size = 0.0, 0.0
    for j in range(scene.contacts.carried[contact_of(scene, s)]):
        kept = scene.state.memory[s, j]
        off = max(off, abs(V.middle[k, s, j] - kept))
        size = max(size, abs(kept))
    return off <= ALIKE * size


@jitable
def size_of(V: Variations, f: F1, g: F1) -> float:
    """Return the largest difference of two f, in usual sizes."""
    largest = 0.0
    for i in range(len(f)):
        largest = max(largest, abs(f[i] - g[i]) / V.scale[i])
    return largest


@jitable
def jump_by(V: Variations, before: F1, behind: F1, usual: float, at: int, why: int) -> None:
    """Let all derivatives jump where f does, at the times in column `at` of `shift`."""
    if size_of(V, before, behind) <= NONE * usual:
        return
    for k in range(len(V.size)):
        shift = V.shift[k, at]
        if not abs(shift) < math.inf:
            V.reason[k] = why
        for i in range(len(before)):
            V.next[k, i] += (before[i] - behind[i]) * shift


@jitable
def unmake(V: Variations, twin: Scene, scene: Scene, s: int, undo: bool, w: F1) -> None:
    """Let slot s of the twin be as it was before its change of branch, or as it is behind it."""
    kept = scene.state.before if undo else scene.state.memory
    for j in range(kept.shape[1]):
        twin.state.memory[s, j] = kept[s, j]
    z, then = scene.slots.z[s], scene.state.mode[s] % BRANCHES
    if then != V.mode[s] % BRANCHES:
        for j in range(scene.contacts.carried[contact_of(scene, s)]):
            w[z + j] = V.jump[BEFORE, z + j] if undo else scene.state.memory[s, j]


@jitable
def jump_one_by_one(V: Variations, scene: Scene, t: float, y: F1, usual: float) -> int:
    """Let all derivatives jump as one point after the other changes its branch; return a code."""
    twin, w = view(V.words[TWIN], Scene), V.work[POINT]
    p, last = in_workspace(V.words[UP])[0], len(V.asks) - 1
    for i in range(len(y)):
        w[i] = y[i]
    for a in range(V.asks[last]):
        unmake(V, twin, scene, V.asks[a], True, w)
    code = call_int(p.rhs, (p.context, t, 0.0, w, V.work[WITHOUT]))
    # what is not of these points
    jump_by(V, V.jump[F_BEFORE], V.work[WITHOUT], usual, last, LOST_JUMP)
    for a in range(V.asks[last]):
        s = V.asks[a]
        unmake(V, twin, scene, s, False, w)
        code = code or call_int(p.rhs, (p.context, t, 0.0, w, V.work[WITH]))
        jump_by(V, V.work[WITHOUT], V.work[WITH], usual, s, LOST_GRAZING)
        for i in range(len(y)):
            V.work[WITHOUT, i] = V.work[WITH, i]
    return code


@jitable
def begin_changed(V: Variations, scene: Scene, k: int, s: int) -> None:
    """Let derivative k of what slot s keeps and carries begin anew behind its change of branch."""
    z, shift = scene.slots.z[s], V.shift[k, s]
    if scene.state.mode[s] % BRANCHES != V.mode[s] % BRANCHES:
        for j in range(scene.contacts.carried[contact_of(scene, s)]):
            V.next[k, z + j] = V.end[k, s, j] - V.jump[F_BEHIND, z + j] * shift
        if not abs(shift) < math.inf:
            V.reason[k] = LOST_GRAZING
        elif not alike(V, scene, k, s):
            V.reason[k] = LOST_JUMP
    # what is kept is that of each side's own time; the run has one time for all
    for j in range(V.end.shape[2]):
        V.end[k, s, j] -= V.far[0, s, j] * shift


@jitable
def changes_unasked(V: Variations, scene: Scene) -> bool:
    """Return whether a slot has changed its branch that was not seen to."""
    state = scene.state
    for s in range(len(V.mode)):
        changed = state.touching[s] == 1 and V.mode[s] > 0.0 and state.mode[s] != V.mode[s]
        if changed and not is_asked(V, s):
            return True
    return False


@jitable
def sticks(scene: Scene) -> bool:
    """Return whether dry friction of an element sticks, by a spring from where its slider is."""
    for f in range(len(scene.applied.keeps)):
        held = scene.applied.equation[f] >= 0
        if scene.applied.keeps[f] == 1 and not held and scene.state.dry[f, SLIDES] == 0.0:
            return True
    return False


@jitable
def cross(V: Variations, scene: Scene, t: float, y: F1, switched: bool) -> None:
    """Let all derivatives in `next` jump with what a commit has changed; y is behind it.

    `reason` gets why a derivative is not known from here on, 0 where it is.
    """
    twin, n, last = view(V.words[TWIN], Scene), len(y), len(V.asks) - 1
    p = in_workspace(V.words[UP])[0]
    set_parameter(V, twin, scene, 0, 0.0)
    code = call_int(p.rhs, (p.context, t, 0.0, y, V.jump[F_BEHIND]))
    usual = 0.0
    for i in range(n):
        usual = max(usual, abs(V.jump[F_BEFORE, i]) / V.scale[i])
    if switched and V.asks[last] > 0 and code == 0:
        note_rates(V, twin, t, V.line[0], y)
        code = jump_one_by_one(V, scene, t, y, usual)
    elif code == 0:
        why = LOST_GRAZING if switched else LOST_JUMP
        jump_by(V, V.jump[F_BEFORE], V.jump[F_BEHIND], usual, last, why)
        for k in range(len(V.size) if switched and V.words[JUMPS] == 1 else 0):
            if V.shift[k, last] != 0.0:
                V.reason[k] = LOST_JUMP
    unseen = V.words[REMEMBERED] > 0 and switched and changes_unasked(V, scene)
    # where sliders of elements stand moves with a parameter, and is no number of y
    if switched and V.asks[last] == 0 and sticks(scene):
        V.reason[:] = LOST_JUMP
    for k in range(len(V.size)):
        for i in range(n):
            if y[i] != V.jump[BEFORE, i] and y[i] == 0.0:
                V.next[k, i] = 0.0
        for a in range(V.asks[last] if switched else 0):
            begin_changed(V, scene, k, V.asks[a])
        if code != 0 or unseen:
            V.reason[k] = LOST_JUMP
