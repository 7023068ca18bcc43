"""When friction of one contact goes to another branch, where its law says how far it is from that.

Such a law keeps a smooth number that is 0 where its branch changes (`laws.catalog`): the secant
method takes about three evaluations where bisection of the branch itself takes eighty.
"""

from __future__ import annotations

import math

from mbsim.arrays.hooks import failure_or
from mbsim.arrays.scene import Scene
from mbsim.core.address import view
from mbsim.core.jitable import jitable
from mbsim.dynamics.contact.forces import BRANCH, FOUND_AT, contact_of
from mbsim.dynamics.events.switching import decide, look_at
from mbsim.integrators.scheme import in_workspace
from mbsim.laws.catalog import BRANCHES, STICK, UNDECIDED
from mbsim.sensitivity.along import POINT, point_at
from mbsim.sensitivity.arrays import ASKED, TWIN, UP, Variations

#: Stands for a change of whatever branch where a slot is taken; those of single slots are below.
ANY_BRANCH = -1
#: A second time is so much later, in lengths of what it is looked for along; so many are tried.
SECOND_TIME, TRIES = 0.01, 10
#: It is found where the last try was wrong by less than this part of how far off it is, or by as
#: much as times are rounded to: errors fall faster than by each try.
FOUND, ROUNDED = 0.01, 1e-13


@jitable
def branch_of(s: int) -> int:
    """Return what stands for the branch of slot s in place of a slot, and back."""
    return ANY_BRANCH - 1 - s


@jitable
def tells(scene: Scene, s: int) -> bool:
    """Return whether friction in slot s says how far it is from a change of its branch."""
    contacts, c = scene.contacts, contact_of(scene, s)
    return contacts.left[c] > 0 and contacts.rims[c] == 0 and scene.state.mode[s] > 0.0


@jitable
def beyond(
    V: Variations, scene: Scene, t: float, h: float, k: int, s: float, e: float, slot: int
) -> float:
    """Return how far a slot is beyond its branch at the part s of the step, moved by e.

    NaN where that is not known. Of what slips it depends on how fast forces change, which is found
    there.
    """
    twin, w = view(V.words[TWIN], Scene), V.work[POINT]
    context, time, idle = in_workspace(V.words[UP])[0].context, t + s * h, twin.work.idle
    point_at(V, s, w)
    for i in range(len(w)):
        w[i] += e * V.next[k, i]
    # rates of forces were those of another point
    twin.work.slot[:, FOUND_AT] = math.nan
    look_at(twin, context, time, w, idle)
    V.words[ASKED] += 1
    if scene.state.mode[slot] % BRANCHES != STICK and len(twin.work.ahead) > 0:
        twin.work.slot[slot, BRANCH] = UNDECIDED
        decide(twin, context, time, w)
        V.words[ASKED] += 2
    known = failure_or(twin, 0) == 0 and twin.work.touching[slot] == 1
    return (
        twin.work.memory[slot, scene.contacts.left[contact_of(scene, slot)]] if known else math.nan
    )


@jitable
def find_change(
    V: Variations, scene: Scene, t: float, h: float, k: int, e: float, slot: int, around: float
) -> float:
    """Return at which part of the step, near `around`, a slot changes its branch, moved by e.

    NaN where that is not found.
    """
    before, now = around, around + SECOND_TIME
    left = beyond(V, scene, t, h, k, before, e, slot)
    for _ in range(TRIES):
        then, left = left, beyond(V, scene, t, h, k, now, e, slot)
        if not abs(left - then) > 0.0:
            return math.nan
        step = -left * (now - before) / (left - then)
        before, now = now, now + step
        if abs(step) <= max(FOUND * abs(now - around), ROUNDED):
            return now
    return math.nan
