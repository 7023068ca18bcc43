"""Derivatives across the end of a step at which friction or a force goes to another branch.

With y+ = R(t, y-) at the time t* of the change, and f- and f+ on its sides,

    D+ = R_y D- + R_p + (dR/dt - f+) dt*/dp,

R being y itself but for what friction carries, which begins as another number (transfer condition;
S. Galan, W. F. Feehery, P. I. Barton, Appl. Numer. Math. 31 (1999) 17). dt*/dp is found as
the time was: where both sides of the difference, carried on along f-, ask for the other branch.
"""

from __future__ import annotations

import math

from mbsim.arrays.scene import Scene
from mbsim.core.address import call_int, view
from mbsim.core.arrays import F1
from mbsim.core.jitable import jitable
from mbsim.core.problem import ASK
from mbsim.integrators.scheme import in_workspace
from mbsim.sensitivity.along import crossing
from mbsim.sensitivity.arrays import (
    BEFORE,
    F_BEFORE,
    F_BEHIND,
    LOST_GRAZING,
    LOST_JUMP,
    REMEMBERED,
    TWIN,
    UP,
    Variations,
)
from mbsim.sensitivity.twin import half_step, set_parameter

#: Stands for a change of branch where `crossing` takes a slot.
BRANCH = -1
#: Times of changes are looked for along a straight line as long as this part of the problem's own
#: time; how far behind them what friction keeps is asked for, over that.
SPAN, BEHIND = 1e-4, 1e-5
#: Changes of several points of a body follow each other: the difference is so much shorter then.
SHORTER = 0.01
#: By how much, over that, what is kept may differ between the run and both sides.
ALIKE = 0.03
#: So often a shorter difference is tried for the time of a change.
TRIES = 4
#: A jump of f below this part of its size is none.
NONE = 1e-9


@jitable
def note_shift(V: Variations, scene: Scene, t: float, H: float, k: int) -> None:
    """Find how fast the time t, at which a branch changes, moves with parameter k."""
    twin, e = view(V.words[TWIN], Scene), SHORTER * half_step(V, k)
    for j in range(len(twin.state.chattering)):
        twin.state.chattering[j] = scene.state.chattering[j]
    V.shift[k] = math.nan
    for _ in range(TRIES):
        up = crossing(V, scene, t - H, H, k, e, BRANCH, 1.0)
        down = crossing(V, scene, t - H, H, k, -e, BRANCH, 1.0)
        if abs(up - down) < math.inf:
            V.shift[k] = 0.5 / e * (up - down) * H
            return
        e *= 0.1


@jitable
def memory_beside(
    V: Variations, scene: Scene, t: float, k: int, x: float, late: float, side: int
) -> None:
    """Leave what laws keep at a time `late` after t, with parameter k changed by x."""
    twin, w = view(V.words[TWIN], Scene), V.work[0]
    p = in_workspace(V.words[UP])[0]
    set_parameter(V, twin, scene, k, x)
    for i in range(len(w)):
        w[i] = V.jump[BEFORE, i] + x * V.next[k, i] + late * V.jump[F_BEFORE, i]
    if late > 0.0:
        # what a law decides by rates of forces it decides where it is asked for its branch
        code = min(call_int(p.switching, (p.context, t + late, ASK, w, V.work[1])), 0)
    else:
        code = call_int(p.rhs, (p.context, t + late, 0.0, w, V.work[1]))
    if code != 0:
        V.shift[k] = math.nan
    for s in range(V.far.shape[1]):
        for j in range(V.far.shape[2]):
            V.far[side, s, j] = twin.work.memory[s, j] if twin.work.touching[s] == 1 else 0.0


@jitable
def note_memory(V: Variations, scene: Scene, t: float, H: float, k: int) -> None:
    """Find what friction keeps before and behind a change of branch.

    Of what does not change a little before it: points of one body come to rest one by one, nearer
    to each other than the difference is wide, and what a law keeps is another number then. Of what
    changes a little behind it, each side at its own time.
    """
    margin, e = BEHIND * H, half_step(V, k)
    e = min(e, 0.3 * margin / max(abs(V.shift[k]), 1e-300))
    for turn in range(2):
        for side in range(2):
            x = e if side == 0 else -e
            late = -margin if turn == 0 else margin + x * V.shift[k]
            memory_beside(V, scene, t, k, x, late, side)
        for s in range(V.far.shape[1]):
            for j in range(V.far.shape[2]):
                change = 0.5 / e * (V.far[0, s, j] - V.far[1, s, j])
                if turn == 0:
                    V.memory[k, s, j] = change
                else:
                    V.late[k, s, j] = change
                    V.middle[k, s, j] = 0.5 * (V.far[0, s, j] + V.far[1, s, j])
    for s in range(len(V.mode)):
        V.mode[s] = scene.state.mode[s]


@jitable
def note_rates(V: Variations, twin: Scene, t: float, H: float, y: F1) -> None:
    """Find how fast what friction keeps changes behind time t, where y' is known."""
    p = in_workspace(V.words[UP])[0]
    w = V.work[0]
    for side in range(2):
        late = BEHIND * H * (2.0 - side)
        for i in range(len(w)):
            w[i] = y[i] + late * V.jump[F_BEHIND, i]
        if call_int(p.rhs, (p.context, t + late, 0.0, w, V.work[1])) != 0:
            return
        for s in range(V.far.shape[1]):
            for j in range(V.far.shape[2]):
                V.far[side, s, j] = twin.work.memory[s, j] if twin.work.touching[s] == 1 else 0.0
    for s in range(V.far.shape[1]):
        for j in range(V.far.shape[2]):
            V.far[0, s, j] = (V.far[0, s, j] - V.far[1, s, j]) / (BEHIND * H)


@jitable
def carried_memory(V: Variations, scene: Scene, k: int, i: int) -> float:
    """Return the derivative of what y[i], which friction carries, begins as."""
    for s in range(len(scene.slots.z)):
        z = scene.slots.z[s]
        c = scene.kinds.contact[scene.pairs.kind[scene.slots.pair[s]]]
        if z >= 0 and z <= i < z + scene.contacts.carried[c]:
            return V.late[k, s, i - z]
    return 0.0


@jitable
def alike(V: Variations, scene: Scene, k: int, s: int) -> bool:
    """Return whether slot s keeps behind a change what both sides of the difference keep there.

    It does not where several points change in so short a time that these ask for other branches.
    """
    c = scene.kinds.contact[scene.pairs.kind[scene.slots.pair[s]]]
    off, size = 0.0, 0.0
    for j in range(scene.contacts.carried[c]):
        kept = scene.state.memory[s, j]
        off = max(off, abs(V.middle[k, s, j] - kept))
        size = max(size, abs(kept))
    return off <= ALIKE * size


@jitable
def cross(V: Variations, scene: Scene, t: float, y: F1, switched: bool, lost: F1) -> None:
    """Let all derivatives in `next` jump with what a commit has changed; y is behind it.

    `lost` gets the reason why a derivative is not known from here on, 0 where it is.
    """
    twin, n = view(V.words[TWIN], Scene), len(y)
    p = in_workspace(V.words[UP])[0]
    set_parameter(V, twin, scene, 0, 0.0)
    code = call_int(p.rhs, (p.context, t, 0.0, y, V.jump[F_BEHIND]))
    if switched and V.words[REMEMBERED] > 0 and code == 0:
        note_rates(V, twin, t, V.line[0], y)
    largest, usual = 0.0, 0.0
    for i in range(n):
        usual = max(usual, abs(V.jump[F_BEFORE, i]) / V.scale[i])
        largest = max(largest, abs(V.jump[F_BEFORE, i] - V.jump[F_BEHIND, i]) / V.scale[i])
    jumps = code != 0 or not largest <= NONE * usual
    for k in range(len(V.size)):
        shift = V.shift[k] if switched else 0.0
        if jumps and not switched:
            lost[k] = LOST_JUMP
        elif jumps and not abs(shift) < math.inf:
            lost[k] = LOST_GRAZING
        for i in range(n):
            if y[i] != V.jump[BEFORE, i] and y[i] == 0.0:
                V.next[k, i] = 0.0
            elif y[i] != V.jump[BEFORE, i] and V.words[REMEMBERED] > 0:
                begins = carried_memory(V, scene, k, i)
                V.next[k, i] = begins - (V.jump[F_BEHIND, i] * shift if jumps else 0.0)
            elif jumps:
                V.next[k, i] += (V.jump[F_BEFORE, i] - V.jump[F_BEHIND, i]) * shift
        for s in range(len(V.mode) if switched else 0):
            if scene.state.mode[s] != V.mode[s]:
                if V.words[REMEMBERED] > 0 and not alike(V, scene, k, s):
                    lost[k] = LOST_JUMP
                # what is kept is that of each side's own time; the run has one time for all
                for j in range(V.memory.shape[2]):
                    rate = V.far[0, s, j] if jumps else 0.0
                    V.memory[k, s, j] = V.late[k, s, j] - rate * shift
