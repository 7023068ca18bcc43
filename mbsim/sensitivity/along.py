"""Derivatives along the motion within one step, where a contact begins or ends in it.

A step that just reaches into a contact is right to tol, for the force is small there; the
derivative of what it computes is not: it would have the contact's stiffness over a part of the
whole step. So D' = f_y D + f_p is integrated along the step's polynomial up to where the contact
changes and from there on. Where the force jumps by df as a contact begins or ends, the derivative
does by -df dt*/dp (transfer condition; M. A. Aizerman, F. R. Gantmakher, Quart. J. Mech. Appl.
Math. 11 (1958) 385).
"""

from __future__ import annotations

import math

from mbsim.arrays.scene import Scene
from mbsim.core.address import call_int, view
from mbsim.core.arrays import F1
from mbsim.core.codes import Code
from mbsim.core.jitable import jitable
from mbsim.core.problem import ASK
from mbsim.dynamics.contact.forces import BRANCH, FOUND_AT
from mbsim.integrators.scheme import Method, in_workspace
from mbsim.laws.catalog import UNDECIDED
from mbsim.sensitivity.arrays import (
    ALIKE,
    ALONG,
    APART,
    ASKED,
    BEFORE,
    CHANGES,
    F_BEFORE,
    MOST,
    MOST_CHANGES,
    ODD,
    REMEMBERED,
    STRAIGHT,
    TWIN,
    UP,
    Variations,
)
from mbsim.sensitivity.tableaus import LAST, OF_FIFTH, OF_THIRD, ORDER, A, C, E
from mbsim.sensitivity.twin import (
    half_step,
    keep_change,
    keep_depths,
    keep_side,
    set_parameter,
)

#: Rows of `Variations.work`: a point, f on either side, D at a stage, its slopes.
POINT, UPPER, LOWER, STAGE, FIRST = range(5)
SECOND, THIRD, WORK = FIRST + 1, FIRST + 2, FIRST + 7
#: After so many tries that led no farther than this part of a stretch less is asked for; the
#: shortest part of a step.
MANY_PARTS, PROGRESS, SHORTEST = 60, 0.01, 1e-9
#: What is no longer taken for rounding.
ROUGHEST = 1e-5
#: Of a part of the step: begin and end of the stretch it is in, its length in the step's, its time.
Span = tuple[float, float, float, float]
#: Parts of a stretch by which its ends are left, until both sides of a difference touch alike.
NEAREST, FARTHER = 1e-12, 4.0
#: A difference is no smaller than this part of the usual one.
LEAST = 1e-4
#: A change is looked for within so many lengths of a step of where the run has it.
FARTHEST = 100.0
#: Stands for a change of whatever branch where a slot is taken; those of single slots are below.
ANY_BRANCH = -1
#: A jump of f counts if what it does to y over the step is more than this part of the usual size.
JUMPS = 1e-13


@jitable
def point_at(V: Variations, s: float, out: F1) -> None:
    """Write the state at the part s of the step, or of a straight line to its end."""
    path, r = V.path, 1.0 - s
    if V.words[STRAIGHT] == 1:
        for i in range(len(out)):
            out[i] = V.jump[BEFORE, i] + (s - 1.0) * V.line[0] * V.jump[F_BEFORE, i]
        return
    last = len(path) - 1
    for i in range(len(out)):
        value = path[last, i]
        for j in range(last - 1, -1, -1):
            value = path[j, i] + (s if j % 2 == 0 else r) * value
        out[i] = value


@jitable
def slope_at(
    V: Variations, scene: Scene, t: float, h: float, k: int, s: float, d: F1, e: float, out: F1
) -> int:
    """Write D' at the part s of the step for a derivative d; return a code."""
    twin, w = view(V.words[TWIN], Scene), V.work
    p = in_workspace(V.words[UP])[0]
    for side in range(2):
        sign = 1.0 if side == 0 else -1.0
        set_parameter(V, twin, scene, k, sign * e)
        point_at(V, s, w[POINT])
        for i in range(len(out)):
            w[POINT, i] += sign * e * d[i]
        f = w[UPPER] if side == 0 else w[LOWER]
        code = call_int(p.rhs, (p.context, t + s * h, s * h, w[POINT], f))
        if code != 0:
            return code
        count, sum = twin.work.hit[len(twin.work.hit) - 1], 0
        for j in range(count):
            sum += 1 + twin.work.hit[j]
        V.words[ALIKE + side] = sum
    for i in range(len(out)):
        out[i] = 0.5 / e * (w[UPPER, i] - w[LOWER, i])
    return 0


@jitable
def clear_slope(
    V: Variations,
    scene: Scene,
    t: float,
    h: float,
    k: int,
    begin: float,
    end: float,
    asked: float,
    row: int,
    e: float,
) -> int:
    """Write D' at a part of the step, within begin and end, into a row of `work`; return a code."""
    w, off, width, step = V.work, V.line[APART], end - begin, e
    while True:
        s = min(max(asked, begin + off * width), end - off * width)
        code = slope_at(V, scene, t, h, k, s, w[STAGE], step, w[row])
        if code != 0 or V.words[ALIKE] == V.words[ALIKE + 1]:
            V.line[APART] = off
            return code
        if off >= 0.5:
            # a stretch so short that a smaller difference, which is less exact, matters little
            step *= 0.1
            if step < LEAST * e:
                return 0
        off = min(0.5, FARTHER * off)


@jitable
def try_part(
    V: Variations,
    scene: Scene,
    t: float,
    h: float,
    k: int,
    span: Span,
    s: float,
    e: float,
    row: int,
    begun: bool,
) -> tuple[int, float]:
    """Try a part of the step from s on; return a code, and the error over the derivative's size.

    By the method in a row of the tableaus. What it leads to is left in `work`; where the part has
    begun its first slope is there already.
    """
    w, d = V.work, V.next[k]
    part, error, whole = span[3], 0.0, 1.0 / V.size[k]
    last = LAST[row]
    for stage in range(1 if begun else 0, last + 1):
        for i in range(len(d)):
            rise = 0.0
            for j in range(stage):
                rise += A[row, stage, j] * w[FIRST + j, i]
            w[STAGE, i] = d[i] + part * rise
        at = s + C[row, stage] * span[2]
        code = clear_slope(V, scene, t, h, k, span[0], span[1], at, FIRST + stage, e)
        if code != 0:
            return code, 0.0
    for i in range(len(d)):
        off = 0.0
        for j in range(last + 1):
            off += E[row, j] * w[FIRST + j, i]
        error = max(error, abs(part * off) / V.scale[i])
        whole = max(whole, abs(w[STAGE, i]) / V.scale[i], abs(d[i]) / V.scale[i])
    return 0, error / whole


@jitable
def is_too_much(V: Variations) -> bool:
    """Return whether derivatives have taken all the evaluations that they are worth."""
    return V.words[MOST] > 0 and V.words[ASKED] > V.words[MOST]


@jitable
def integrate(
    V: Variations,
    scene: Scene,
    t: float,
    h: float,
    k: int,
    span: tuple[float, float],
    e: float,
    begun: bool,
) -> int:
    """Carry the derivative in `next` from one part of the step to another; return a code.

    By an explicit method, as exactly as `enough` asks. Where forces bend the steps get short. Its
    first slope is left in `work`, of the end, as it may be there where the step has begun.
    """
    begin, end = span
    w, d, s, part, most = V.work, V.next[k], begin, end - begin, V.enough[0]
    tries, before, row = 0, begin, OF_THIRD if V.words[ALONG] == 1 else OF_FIFTH
    V.line[APART] = NEAREST
    while s < end:
        tries += 1
        if is_too_much(V):
            return Code.NOT_CONVERGED
        if tries % MANY_PARTS == 0:
            if s - before < PROGRESS * (end - begin):
                # what is left is rounding of forces
                most *= 10.0
                if most > ROUGHEST:
                    return Code.NOT_CONVERGED
            before = s
        last = s + 1.0001 * part >= end
        part = end - s if last else part
        code, error = try_part(V, scene, t, h, k, (begin, end, part, part * h), s, e, row, begun)
        if code != 0:
            return code
        begun = True
        shortest = part <= SHORTEST or part * h <= 1e-15 * abs(t)
        if error <= most or shortest:
            for i in range(len(d)):
                d[i], w[FIRST, i] = w[STAGE, i], w[FIRST + LAST[row], i]
            s = end if last else s + part
        part *= min(4.0, max(0.1, 0.9 * (most / max(error, 1e-12)) ** (1.0 / ORDER[row])))
    return 0


@jitable
def branch_of(s: int) -> int:
    """Return what stands for the branch of slot s in place of a slot, and back."""
    return ANY_BRANCH - 1 - s


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
        answer = call_int(p.switching, (p.context, t + s * h, ASK, w[POINT], w[UPPER]))
        if slot == ANY_BRANCH or answer < 0:
            return min(answer, 1)
        asked = branch_of(slot)
        if twin.work.touching[asked] == 0:
            return 0
        branch = twin.work.slot[asked, BRANCH]
        return 1 if branch != UNDECIDED and branch != scene.state.mode[asked] else 0
    code = call_int(p.rhs, (p.context, t + s * h, s * h, w[POINT], w[UPPER]))
    return -code if code != 0 else twin.work.touching[slot]


@jitable
def crossing(
    V: Variations, scene: Scene, t: float, h: float, k: int, e: float, slot: int, around: float
) -> float:
    """Return at which part of the step a slot begins or ends to touch; NaN where it does not.

    Looked for in all of it, or no farther than `around` from where it does with e = 0.
    """
    set_parameter(V, view(V.words[TWIN], Scene), scene, k, e)
    before = 1 - scene.work.touching[slot] if slot >= 0 else 0
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
    while True:
        middle = 0.5 * (low + high)
        if middle <= low or middle >= high or high - low < 1e-16:
            return high
        found = touches(V, scene, t, h, k, middle, e, slot)
        if found < 0:
            return math.nan
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
            if scene.work.touching[s] == scene.state.touching[s]:
                continue
            if count == MOST_CHANGES:
                return False
            V.change[count, 0] = float(s)
            count += 1
    V.words[CHANGES] = count
    return True


@jitable
def order_changes(V: Variations, scene: Scene, t: float, h: float) -> bool:
    """Find when each listed contact changes, and order them; return whether all were found."""
    for j in range(V.words[CHANGES]):
        when = crossing(V, scene, t, h, 0, 0.0, int(V.change[j, 0]), 0.0)
        if not when >= 0.0:
            return False
        slot, place = V.change[j, 0], j
        while place > 0 and V.change[place - 1, 1] > when:
            V.change[place, 0], V.change[place, 1] = V.change[place - 1, 0], V.change[place - 1, 1]
            place -= 1
        V.change[place, 0], V.change[place, 1] = slot, when
    return True


@jitable
def jump_at(V: Variations, scene: Scene, t: float, h: float, s: float) -> float:
    """Leave by how much f falls at the part s in a row; return how much it moves in the step."""
    twin, w, largest = view(V.words[TWIN], Scene), V.work, 0.0
    p = in_workspace(V.words[UP])[0]
    set_parameter(V, twin, scene, 0, 0.0)
    near = max(1e-13, 4e-16 * abs(t) / h)
    for side in range(2):
        at = max(s - near, 0.0) if side == 0 else min(s + near, 1.0)
        point_at(V, at, w[POINT])
        call_int(p.rhs, (p.context, t + at * h, at * h, w[POINT], w[FIRST + side]))
    for i in range(V.next.shape[1]):
        w[THIRD, i] = w[FIRST, i] - w[SECOND, i]
        largest = max(largest, abs(w[THIRD, i]) * h / V.scale[i])
    return largest


@jitable
def transfer(V: Variations, scene: Scene, t: float, h: float, k: int, j: int, e: float) -> int:
    """Let the derivative jump where listed contact j changes; return a code."""
    slot, s, w = int(V.change[j, 0]), V.change[j, 1], V.work
    if jump_at(V, scene, t, h, s) <= JUMPS:
        return 0
    up = crossing(V, scene, t, h, k, e, slot, s)
    down = crossing(V, scene, t, h, k, -e, slot, s)
    if not math.isfinite(up - down):
        return Code.NOT_CONVERGED
    # the rows were used meanwhile
    jump_at(V, scene, t, h, s)
    shift = 0.5 / e * (up - down) * h
    for i in range(V.next.shape[1]):
        V.next[k, i] += w[THIRD, i] * shift
    return 0


@jitable
def project_end(V: Variations, scene: Scene, m: Method, t: float, k: int, e: float) -> int:
    """Put the derivative at the end of the step along what holds; return a code."""
    twin, w = view(V.words[TWIN], Scene), V.work
    p = in_workspace(V.words[UP])[0]
    for side in range(2):
        sign = 1.0 if side == 0 else -1.0
        set_parameter(V, twin, scene, k, sign * e)
        out = w[UPPER] if side == 0 else w[LOWER]
        for i in range(len(out)):
            out[i] = m.trial[i] + sign * e * V.next[k, i]
        code = call_int(p.project, (p.context, t, 0.0, out, out))
        if code != 0:
            return code
    for i in range(V.next.shape[1]):
        V.next[k, i] = 0.5 / e * (w[UPPER, i] - w[LOWER, i])
    return 0


@jitable
def remember_end(
    V: Variations, scene: Scene, m: Method, t: float, h: float, k: int, e: float
) -> int:
    """Find how what friction keeps at the end of the step moves with parameter k; return a code."""
    twin, x = view(V.words[TWIN], Scene), V.work[POINT]
    p = in_workspace(V.words[UP])[0]
    V.words[ODD] = 0
    for side in range(2):
        sign = 1.0 if side == 0 else -1.0
        set_parameter(V, twin, scene, k, sign * e)
        for i in range(len(x)):
            x[i] = m.trial[i] + sign * e * V.next[k, i]
        code = call_int(p.rhs, (p.context, t + h, h, x, V.work[UPPER]))
        if code != 0:
            return code
        keep_depths(V, twin, side)
        keep_side(V, twin, scene, side)
    keep_change(V, k, e)
    return 0


@jitable
def is_bent(V: Variations, scene: Scene) -> bool:
    """Return whether a slot touched in some of the points of a step, and not in all."""
    last = len(V.seen) - 1
    for s in range(last):
        if 0 < V.seen[s] < V.seen[last]:
            return True
    return False


@jitable
def step_along(
    V: Variations,
    scene: Scene,
    m: Method,
    t: float,
    h: float,
    k: int,
    until: float,
    goes_on: bool,
) -> int:
    """Carry the derivative in `next` over a part of the step, contact by contact; return a code.

    Where it goes on from the step before `slope` is that step's last one, and the one of this step
    is left there.
    """
    e, begin = half_step(V, k), 0.0
    begun = goes_on and V.words[ALONG] == 1 and V.smooth[k] == 1
    if begun:
        for i in range(V.next.shape[1]):
            V.work[FIRST, i] = V.slope[k, i]
    for j in range(V.words[CHANGES]):
        end = V.change[j, 1]
        if end > until:
            break
        code = integrate(V, scene, t, h, k, (begin, end), e, begun)
        if code == 0:
            code = transfer(V, scene, t, h, k, j, e)
        if code != 0:
            return code
        begin, begun = max(begin, end), False
    code = integrate(V, scene, t, h, k, (begin, until), e, begun)
    if goes_on:
        # what friction keeps is another number behind the step
        V.smooth[k] = 1 if begin < until and V.words[REMEMBERED] == 0 else 0
        for i in range(V.next.shape[1]):
            V.slope[k, i] = V.work[FIRST, i]
    return code
