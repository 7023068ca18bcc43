"""What friction of a contact keeps: what its law is given of it, and what a step makes of it."""

from __future__ import annotations

import math

from mbsim.arrays.codes import (
    CHANGED,
    CONSTRAINTS_CHANGED,
    NOW,
    SCALE_LENGTH,
    SCALE_SPEED,
    STICK,
)
from mbsim.arrays.codes import SLIP as SLIP_EVENT
from mbsim.arrays.scene import Scene
from mbsim.core.arrays import F1
from mbsim.core.jitable import jitable
from mbsim.dynamics.contact.forces import (
    ALONG_X,
    ALONG_Y,
    BRANCH,
    FOUND_AT,
    FRICTION_STORED,
    LIMIT_SLOPE,
    MODE,
    NORMAL_SLOPE,
    STIFFENS,
    STIFFNESS,
    STIFFNESS_SLOPE,
    UNIT,
    contact_of,
    sides,
)
from mbsim.dynamics.contact.points import record_event
from mbsim.laws import catalog
from mbsim.laws.abi import (
    BRANCH_OUT,
    FORCE_X_OUT,
    FORCE_Y_OUT,
    FRICTION_INPUTS,
    FROZEN,
    GROWTH,
    LIMIT_RATE,
    MEMORY_OUT,
    MODE_OUT,
    NORMAL_RATE,
    NORMAL_STIFFNESS,
    SLIDING_LIMIT,
    SLIPPING_MASS,
    STIFFNESS_RATE,
    STORED_OUT,
    TIME_IN,
    UNIT_OUT,
)
from mbsim.laws.friction.stiction import MU_STATIC

#: What presses less than this part of what presses most, or of what the model's own acceleration
#: V^2/L makes of the mass that slips, counts as that: no limit is 0. Less is nothing to the motion,
#: and where shapes have just touched it is rounding: depths have no digits for it.
LEAST_PART = 1e-9


@jitable
def slipping_mass(scene: Scene, s: int) -> float:
    """Return the mass of both bodies of slot s as one slips on the other, a part for each point."""
    inverse = 0.0
    for g in sides(scene, s):
        b = scene.graphics.body[g]
        if b < len(scene.bodies.mass):
            inverse += 1.0 / scene.bodies.mass[b]
    points = max(1, scene.pairs.touches[scene.slots.pair[s]])
    return 1.0 / (points * inverse) if inverse > 0.0 else 0.0


@jitable
def least_limit(scene: Scene, s: int, most: float) -> float:
    """Return what friction without give in slot s is taken to hold at least [F].

    `most` is what such friction holds at most in any slot.
    """
    mu, size = scene.contacts.friction_par[contact_of(scene, s), MU_STATIC], scene.world.scale
    push = slipping_mass(scene, s) * size[SCALE_SPEED] ** 2 / size[SCALE_LENGTH]
    return LEAST_PART * max(most, mu * push)


@jitable
def remember(scene: Scene, y: F1, s: int) -> None:
    """Give a friction law what it kept, and what only laws with memory look at."""
    state, at, z, row = scene.state, FRICTION_INPUTS, scene.slots.z[s], scene.work.slot[s]
    c, given = contact_of(scene, s), scene.work.law_in
    carried = scene.contacts.carried[c]
    given[FROZEN] = 1.0 if state.frozen[0] == 1 and state.touching[s] == 1 else 0.0
    given[NORMAL_STIFFNESS], given[GROWTH] = row[STIFFNESS], row[STIFFENS]
    given[SLIPPING_MASS] = slipping_mass(scene, s)
    given[SLIDING_LIMIT] = math.nan
    known = row[FOUND_AT] == given[TIME_IN]
    given[NORMAL_RATE] = row[NORMAL_SLOPE] if known else math.nan
    given[LIMIT_RATE] = row[LIMIT_SLOPE] if known else math.nan
    given[STIFFNESS_RATE] = row[STIFFNESS_SLOPE] if known else math.nan
    for k in range(scene.contacts.memory[c]):
        if k < carried:
            given[at + k] = y[z + k]
        elif scene.world.past[0] != NOW:
            given[at + k] = state.before[s, k]
        else:
            given[at + k] = state.memory[s, k]


@jitable
def keep(scene: Scene, dy: F1, s: int) -> None:
    """Keep what a friction law with memory made of it."""
    c, out = contact_of(scene, s), scene.work.law_out
    row, z, n = scene.work.slot[s], scene.slots.z[s], scene.contacts.memory[c]
    row[FRICTION_STORED], row[MODE], row[BRANCH] = out[STORED_OUT], out[MODE_OUT], out[BRANCH_OUT]
    row[UNIT], row[ALONG_X], row[ALONG_Y] = out[UNIT_OUT], out[FORCE_X_OUT], out[FORCE_Y_OUT]
    for k in range(n):
        scene.work.memory[s, k] = out[MEMORY_OUT + k]
    for k in range(scene.contacts.carried[c]):
        dy[z + k] = out[MEMORY_OUT + n + k]


@jitable
def commit_memory(scene: Scene, t: float, y: F1, s: int, fresh: bool) -> int:
    """Keep what friction in slot s makes of the step, anew if `fresh`.

    Returns 1 if f changed, CONSTRAINTS_CHANGED if what is carried became something else.
    """
    state, work, z = scene.state, scene.work, scene.slots.z[s]
    for k in range(state.memory.shape[1]):
        state.before[s, k] = state.memory[s, k]
        state.memory[s, k] = 0.0 if fresh else work.memory[s, k]
    branch = 0.0 if fresh else work.slot[s, BRANCH]
    if branch == catalog.UNDECIDED or branch == state.mode[s]:
        return 0
    mode, before = branch % catalog.BRANCHES, state.mode[s] % catalog.BRANCHES
    if mode != before and mode > 0.0 and before > 0.0:
        record_event(scene, t, STICK if mode == catalog.STICK else SLIP_EVENT, s)
    if before > 0.0 and not fresh:
        state.chattering[CHANGED] += 1.0
    if mode != before:
        # which decides what the carried numbers are
        for k in range(scene.contacts.carried[contact_of(scene, s)]):
            y[z + k] = state.memory[s, k]
    state.mode[s] = branch
    return CONSTRAINTS_CHANGED if mode != before else 1


@jitable
def put_aside(scene: Scene, k: int, s: int, row: F1) -> None:
    """Copy all that belongs to the touching slot s into `row`, or with k = 1 back from it."""
    state, work = scene.state, scene.work
    at = 0
    for group in (state.p, state.n, state.t, work.t):
        for j in range(3):
            if k == 0:
                row[at] = group[s, j]
            else:
                group[s, j] = row[at]
            at += 1
    for group in (state.memory, state.before):
        for j in range(group.shape[1]):
            if k == 0:
                row[at] = group[s, j]
            else:
                group[s, j] = row[at]
            at += 1
    for values in (state.depth, state.rate, state.normal, state.mode):
        if k == 0:
            row[at] = values[s]
        else:
            values[s] = row[at]
        at += 1
    for j in range(work.points.shape[1]):
        if k == 0:
            row[at] = work.points[s, j]
        else:
            work.points[s, j] = row[at]
        at += 1
    for j in range(work.slot.shape[1]):
        if k == 0:
            row[at] = work.slot[s, j]
        else:
            work.slot[s, j] = row[at]
        at += 1
