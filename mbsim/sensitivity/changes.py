"""Where within a step contacts begin or end, and what derivatives do there.

Where the force jumps by df as a contact begins or ends, the derivative does by -df dt*/dp (transfer
condition; M. A. Aizerman, F. R. Gantmakher, Quart. J. Mech. Appl. Math. 11 (1958) 385).
"""

from __future__ import annotations

import math

from mbsim.arrays.scene import Scene
from mbsim.core.address import call_int, view
from mbsim.core.codes import Code
from mbsim.core.jitable import jitable
from mbsim.core.problem import ASK
from mbsim.dynamics.contact.forces import BRANCH, DEPTH, FOUND_AT, NORMAL, contact_of
from mbsim.integrators.scheme import in_workspace
from mbsim.laws.catalog import UNDECIDED
from mbsim.sensitivity.along import (
    EVEN,
    FIRST,
    POINT,
    SECOND,
    SOFT_BEGIN,
    SOFT_END,
    THIRD,
    UPPER,
    point_at,
)
from mbsim.sensitivity.arrays import (
    ALONG,
    ASKED,
    AT_PART,
    ATTEMPT,
    CHANGES,
    LOST_JUMP,
    MOST_CHANGES,
    MOVES,
    REMEMBERED,
    SLOT,
    STEADY,
    TWIN,
    UP,
    UP_PART,
    Variations,
)
from mbsim.sensitivity.branches import ANY_BRANCH, branch_of, find_change, tells
from mbsim.sensitivity.later import add, add_motion, touch_later
from mbsim.sensitivity.stretches import integrate
from mbsim.sensitivity.twin import acts, has_acted, set_parameter, step_along_motion

#: A change is looked for within so many lengths of a step of where the run has it.
FARTHEST = 100.0
#: By how much farther than where its depth is 0 as a straight line a touch is looked for.
NUDGE = 1e-3
#: What is left is halved at every so manieth try at least.
EVERY = 4
#: A jump of f counts if what it does to y over the step is more than this part of the usual size.
JUMPS = 1e-13
#: Contacts change at once where they do within this part of the step, as corners of a flat side.
#: In a short step rounding of depths sets them apart, by this part of the straight line's length.
AT_ONCE, ROUNDING = 1e-10, 1e-9
#: Where a normal force is zero is known to this part of the step.
ROUNDING_OF_FORCE = 1e-9
#: A jump of a derivative counts from this part of usual sizes on.
COUNTS = 1e-8
#: So often a smaller difference is tried for the time of a change.
TRIES = 6
#: Row of `Variations.work`: sum of jumps.
SUM = THIRD + 1


@jitable
def touches(
    V: Variations, scene: Scene, t: float, h: float, k: int, s: float, e: float, slot: int
) -> int:
    """Return 1 if a slot touches at the part s of the step, moved by e; 0 if not, less a code.

    With a slot below 0: if a force is on another branch, ANY_BRANCH, or that of one slot.
    """
    twin, w = view(V.words[TWIN], Scene), V.work
    p = in_workspace(V.words[UP])[0]
    point_at(V, s, w[POINT])
    if e != 0.0:
        for i in range(V.next.shape[1]):
            w[POINT, i] += e * V.next[k, i]
    if slot < 0:
        # rates of forces were those of another point
        twin.work.slot[:, FOUND_AT] = math.nan
        V.words[ASKED] += 1
        answer = call_int(p.switching, (p.context, t + s * h, ASK, w[POINT], w[UPPER]))
        if slot == ANY_BRANCH or answer < 0:
            return min(answer, 1)
        asked = branch_of(slot)
        if twin.work.touching[asked] == 0:
            return 0
        branch = twin.work.slot[asked, BRANCH]
        return 1 if branch != UNDECIDED and branch != scene.state.mode[asked] else 0
    code = call_int(p.rhs, (p.context, t + s * h, s * h, w[POINT], w[UPPER]))
    return -code if code != 0 else acts(V, twin, slot)


@jitable
def crossing(
    V: Variations, scene: Scene, t: float, h: float, k: int, e: float, slot: int, around: float
) -> float:
    """Return at which part of the step a slot begins or ends to touch; NaN where it does not.

    Looked for in all of it, or no farther than `around` from where it does with e = 0.
    """
    set_parameter(V, view(V.words[TWIN], Scene), scene, k, e)
    if slot < ANY_BRANCH and tells(scene, branch_of(slot)):
        found = find_change(V, scene, t, h, k, e, branch_of(slot), around)
        if not math.isnan(found):
            return found
    before = 1 - acts(V, scene, slot) if slot >= 0 else 0
    low, high = 0.0, 1.0
    if around > 0.0:
        low, high = around, around
        reach = 1e-9
        while reach < FARTHEST:
            low, high = around - reach, around + reach
            if touches(V, scene, t, h, k, low, e, slot) == before:
                if touches(V, scene, t, h, k, high, e, slot) == 1 - before:
                    break
            reach *= 8.0
        if reach >= FARTHEST:
            return math.nan
    twin, tries, last, guess = view(V.words[TWIN], Scene), 0, math.nan, math.nan
    depth, off = last, 0.0
    while True:
        tries += 1
        middle = 0.5 * (low + high)
        if middle <= low or middle >= high or high - low < 1e-16:
            return high
        if tries % EVERY != 0 and low < guess + off < high:
            middle = guess + off
        found = touches(V, scene, t, h, k, middle, e, slot)
        if found < 0:
            return math.nan
        if found == 1 and slot >= 0:
            breaks = V.breaks[contact_of(scene, slot)] == 1
            now = twin.work.slot[slot, NORMAL if breaks else DEPTH]
            guess = middle - now * (middle - last) / (now - depth) if now != depth else math.nan
            # a little farther, so that the other end of what is left comes near as well
            off = NUDGE * (guess - middle)
            last, depth = middle, now
        elif middle == guess + off:
            off = -off
        if found == before:
            low = middle
        else:
            high = middle


@jitable
def list_changes(V: Variations, scene: Scene, t: float, h: float) -> bool:
    """List the contacts that begin or end in the step in order of time; return whether all are."""
    count, now, then = 0, scene.work.hit, scene.state.hit
    for side in range(2):
        hit = now if side == 0 else then
        for j in range(hit[len(hit) - 1]):
            s = hit[j]
            if acts(V, scene, s) == has_acted(V, scene, s):
                continue
            if side == 1 and scene.work.touching[s] == 1:
                # it is in the other list too
                continue
            if count == MOST_CHANGES:
                return False
            V.change[count, SLOT] = float(s)
            count += 1
    V.words[CHANGES] = count
    return True


@jitable
def order_changes(V: Variations, scene: Scene, t: float, h: float) -> bool:
    """Find when each listed contact changes, and order them; return whether all were found."""
    for j in range(V.words[CHANGES]):
        when = crossing(V, scene, t, h, 0, 0.0, int(V.change[j, SLOT]), 0.0)
        if not when >= 0.0:
            return False
        slot, place = V.change[j, SLOT], j
        while place > 0 and V.change[place - 1, AT_PART] > when:
            V.change[place, SLOT] = V.change[place - 1, SLOT]
            V.change[place, AT_PART] = V.change[place - 1, AT_PART]
            place -= 1
        V.change[place, SLOT], V.change[place, AT_PART] = slot, when
    return True


@jitable
def nearest(t: float, h: float) -> float:
    """Return how near to a jump f is asked for on either side, as a part of the step."""
    return max(1e-13, 4e-16 * abs(t) / h)


@jitable
def jump_at(
    V: Variations, scene: Scene, t: float, h: float, k: int, s: float, e: float, near: float
) -> float:
    """Leave by how much f falls at the part s in a row; return how much it moves in the step.

    With parameter k changed by e, from `near` before s to as much behind it.
    """
    twin, w, largest = view(V.words[TWIN], Scene), V.work, 0.0
    p = in_workspace(V.words[UP])[0]
    set_parameter(V, twin, scene, k, e)
    for side in range(2):
        at = s - near if side == 0 else s + near
        if e == 0.0:
            at = min(max(at, 0.0), 1.0)
        point_at(V, at, w[POINT])
        if e != 0.0:
            add(w[POINT], V.next[k], e)
        call_int(p.rhs, (p.context, t + at * h, at * h, w[POINT], w[FIRST + side]))
    for i in range(V.next.shape[1]):
        w[THIRD, i] = w[FIRST, i] - w[SECOND, i]
        largest = max(largest, abs(w[THIRD, i]) * h / V.jumping[i])
    return largest


@jitable
def at_once(V: Variations, t: float, h: float) -> float:
    """Return within which part of the step contacts change at once, or within rounding of it."""
    return max(AT_ONCE, nearest(t, h), ROUNDING * V.line[0] / h)


@jitable
def is_first(V: Variations, t: float, h: float, j: int) -> bool:
    """Return whether listed contact j changes later than the one before it."""
    return j == 0 or V.change[j, AT_PART] - V.change[j - 1, AT_PART] > at_once(V, t, h)


@jitable
def find_moves(
    V: Variations, scene: Scene, t: float, h: float, k: int, span: tuple[int, int], e: float
) -> float:
    """Find when listed contacts, from the first to the last of a span, change beside the run.

    Return by how much parameter k was changed for that, 0 where it is not known: less than e where
    they change too far from a short step.
    """
    for _ in range(TRIES):
        found = True
        for j in range(span[0], span[1] + 1):
            slot, s = int(V.change[j, SLOT]), V.change[j, AT_PART]
            up = crossing(V, scene, t, h, k, e, slot, s)
            down = crossing(V, scene, t, h, k, -e, slot, s) if math.isfinite(up) else up
            V.change[j, UP_PART], V.change[j, MOVES] = up, 0.5 / e * (up - down) * h
            if not math.isfinite(up - down):
                found = False
                break
        if found:
            return e
        e *= 0.1
    return 0.0


@jitable
def counts(V: Variations, k: int) -> bool:
    """Return whether the sum of jumps counts: more than `COUNTS` of usual sizes.

    For a change of the parameter by its own size.
    """
    for i in range(len(V.jumping)):
        if abs(V.work[SUM, i]) * V.size[k] > COUNTS * V.jumping[i]:
            return True
    return False


@jitable
def last_with(V: Variations, t: float, h: float, j: int) -> int:
    """Return the last of the listed contacts that change at once with j, the first of them."""
    last = j
    while last + 1 < V.words[CHANGES] and not is_first(V, t, h, last + 1):
        last += 1
    return last


@jitable
def transfer(
    V: Variations, scene: Scene, t: float, h: float, k: int, span: tuple[int, int], e: float
) -> int:
    """Let the derivative jump where listed contacts change at once, from the first to the last.

    Return a code. Each of these has a jump and a time of its own. With the parameter changed by e
    they change one after the other, or they move alike and what they jump by is shared.
    """
    (j, last), total = span, V.work[SUM]
    breaks = V.breaks[contact_of(scene, int(V.change[j, SLOT]))] == 1
    near = max(nearest(t, h), ROUNDING_OF_FORCE) if breaks else nearest(t, h)
    first, wide = V.change[j, AT_PART], V.change[last, AT_PART] - V.change[j, AT_PART]
    if jump_at(V, scene, t, h, k, first, 0.0, near + wide) <= JUMPS:
        return 0
    e = find_moves(V, scene, t, h, k, (j, last), e)
    if e == 0.0:
        return Code.NOT_CONVERGED
    total[:] = 0.0
    for one in range(j, last + 1):
        share = 0
        for other in range(j, last + 1):
            apart = abs(V.change[other, UP_PART] - V.change[one, UP_PART])
            share += 1 if apart <= at_once(V, t, h) else 0
        if last > j:
            jump_at(V, scene, t, h, k, V.change[one, UP_PART], e, at_once(V, t, h))
        else:
            # the rows were used meanwhile
            jump_at(V, scene, t, h, k, first, 0.0, near)
        add(total, V.work[THIRD], V.change[one, MOVES] / share)
    add(V.next[k], total, 1.0)
    # the polynomial of an implicit step, or of one in which friction begins to stretch, does not
    # tell well enough what is behind such a jump; nor is one of several at once known well enough
    if (V.words[REMEMBERED] > 0 or V.words[ATTEMPT] == 0 or last > j) and counts(V, k):
        V.reason[k] = LOST_JUMP
    return 0


@jitable
def is_bent(V: Variations, scene: Scene) -> bool:
    """Return whether a slot touched in some point of a step beside the run and not in the run.

    Or the other way round.
    """
    last = len(V.seen) - 1
    for s in range(last):
        if V.seen[s] != acts(V, scene, s) * V.seen[last]:
            return True
    return False


@jitable
def pass_change(
    V: Variations, scene: Scene, t: float, h: float, k: int, j: int, later: float, e: float
) -> tuple[int, float]:
    """Carry the derivative in `next` across listed contact j, and those at once with it.

    Return a code, and how much later.
    What is carried is D + s f, with the s that is given up to there and the one that is returned
    from there on.
    """
    last = last_with(V, t, h, j)
    slot, code = int(V.change[last, SLOT]), transfer(V, scene, t, h, k, (j, last), e)
    if code != 0 or V.words[STEADY] != 1 or acts(V, scene, slot) == 0:
        return code, later
    at = V.change[last, AT_PART]
    s = touch_later(V, scene, t, h, k, slot, at, e)
    if not abs(s) < math.inf:
        return 0, later
    if last > j:
        # where all of them touch
        at = min(at + at_once(V, t, h), 1.0)
    return add_motion(V, scene, t, h, at, k, s - later), s


@jitable
def through(
    V: Variations,
    scene: Scene,
    t: float,
    h: float,
    k: int,
    stretch: tuple[float, float, bool, bool],
    e: float,
    begun: bool,
    later: float,
) -> int:
    """Carry the derivative in `next` through a stretch of the step; return a code.

    Of a stretch its begin and end, and whether a contact begins at the one and ends at the other.
    """
    begin, end, touched, leaves = stretch
    if touched and leaves:
        middle = 0.5 * (begin + end)
        code = integrate(V, scene, t, h, k, (begin, middle, SOFT_BEGIN), e, begun, later)
        return code or integrate(V, scene, t, h, k, (middle, end, SOFT_END), e, True, later)
    way = SOFT_BEGIN if touched else SOFT_END if leaves else EVEN
    return integrate(V, scene, t, h, k, (begin, end, way), e, begun, later)


@jitable
def step_along(
    V: Variations,
    scene: Scene,
    t: float,
    h: float,
    k: int,
    span: tuple[float, float],
    goes_on: bool,
    later: float,
) -> tuple[int, float]:
    """Carry the derivative in `next` over a part of the step, contact by contact.

    Return a code, and how much later what is behind it happens, which `later` is at its begin.
    Where it goes on from the step before `slope` is that step's last one, and the one of this step
    is left there.
    """
    begin, until = span
    e, touched = step_along_motion(V, k), False
    begun = goes_on and V.words[ALONG] == 1 and V.smooth[k] == 1
    code = add_motion(V, scene, t, h, begin, k, later)
    if begun:
        for i in range(V.next.shape[1]):
            V.work[FIRST, i] = V.slope[k, i]
    for j in range(V.words[CHANGES]):
        end, begins = V.change[j, AT_PART], acts(V, scene, int(V.change[j, SLOT])) == 1
        if end > until:
            break
        if not is_first(V, t, h, j):
            continue
        if end <= span[0] and span[0] > 0.0:
            continue
        stretch = (begin, end, touched, not begins)
        code = code or through(V, scene, t, h, k, stretch, e, begun, later)
        if code == 0:
            code, later = pass_change(V, scene, t, h, k, j, later, e)
        if code != 0:
            return code, later
        begin, begun, touched = max(begin, end), False, begins
    code = code or through(V, scene, t, h, k, (begin, until, touched, False), e, begun, later)
    if goes_on:
        # what friction keeps is another number behind the step
        V.smooth[k] = 1 if begin < until and V.words[REMEMBERED] == 0 else 0
        for i in range(V.next.shape[1]):
            V.slope[k, i] = V.work[FIRST, i]
    return code or add_motion(V, scene, t, h, until, k, -later), later
