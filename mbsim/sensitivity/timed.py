"""Jumps of forces at times that a parameter moves, as by IF or SIGN of TIME.

A run ends a step just before such a jump and goes on just behind it (`compile_model.timetable`). A
jump of f by df at t* leaves

    D+ = D- - df dt*/dp

(transfer condition; M. A. Aizerman, F. R. Gantmakher, Quart. J. Mech. Appl. Math. 11 (1958) 385),
the sum of it where several things jump. dt*/dp is a difference of times at which f of both sides
jumps, at the same y. So near to t* that one side has jumped and the other one has not, f of both is
that of a time a little farther off.
"""

from __future__ import annotations

import math

from mbsim.arrays.scene import Scene
from mbsim.core.address import call_int, view
from mbsim.core.arrays import F1, F2
from mbsim.core.jitable import jitable
from mbsim.core.problem import TIMETABLE_ENDS, TIMETABLE_HORIZON
from mbsim.integrators.scheme import OWN_TIME, ROW, TIME, Method
from mbsim.sensitivity.arrays import (
    FIRST,
    LAST,
    RHS,
    SET,
    TWIN,
    UNTIL,
    Variations,
)
from mbsim.sensitivity.twin import change_of, set_parameter, widest_step

#: Rows of `Variations.sides`: f before and behind a jump, and between; at either end of what is
#: searched; by how much the run's f changes there; by how much it does without a jump.
BEFORE, BEHIND, MIDDLE, BEGIN, END, CHANGES, DRIFT = range(7)
SIDES = 7
#: By how much a parameter is changed, in its usual size; by how much less where other jumps are too
#: near; how often.
CHANGE, LESS, TRIES = 1e-5, 0.01, 3
#: Jumps are looked for within so many times as far as those at multiples of the parameter move; so
#: many times as far again where they are not, so often.
NEAR, FARTHER, OFTEN = 4.0, 16.0, 4
#: What f changes by is the same on both sides of the run, in the mean, up to this part of it, or of
#: f itself; what is rounding of f.
ALIKE, SMOOTH, ROUNDED = 1e-4, 1e-8, 1e-13
#: Behind the begin of a run jumps are looked for within this part of the problem's own time.
BEHIND_BEGIN = 1e-3
#: A time is found to this part of what is searched; so many jumps may be in it. It is searched in
#: so many pieces: jumps that cancel are seen from between them alone.
FOUND, MOST_JUMPS, PIECES = 1e-10, 16, 7
#: Where they cancel in the run there are so many pieces, the shorter the nearer to it, each end of
#: one so many times as far from it as that before.
MANY_PIECES, RATIO = 81, 1.1
#: What changes evenly bends by less than this part of what it changes; f changes by no more than
#: so many times that without a jump.
EVENLY, MORE = 0.3, 3.0
#: Roundings of a time, over it, in which a step ends before a jump or begins behind it; so many
#: times that is how far a run hops at most. A jump is soon to come in this part of the time.
ROUNDINGS, MOST_ROUNDINGS, SOON = 3.3e-16, 8.0, 1e-4
#: How much farther off f is asked for than the farthest jump of a side, and how long a step is at
#: least over that.
OFF, ROOM = 1.5, 4.0


@jitable
def evaluate_at(V: Variations, scene: Scene, t: float, y: F1, k: int, e: float, row: int) -> int:
    """Write f with parameter k changed by e, at y, into a row of `sides`; return a code."""
    set_parameter(V, view(V.words[TWIN], Scene), scene, k, e)
    return call_int(V.words[RHS], (V.words[TWIN], t, 0.0, y, V.sides[row]))


@jitable
def copy_row(V: Variations, row: int, other: int) -> None:
    """Copy a row of `sides` to another one."""
    for i in range(V.sides.shape[1]):
        V.sides[other, i] = V.sides[row, i]


@jitable
def noise(V: Variations, i: int, size: float, most: float) -> float:
    """Return how much of number i of f is rounding, f being up to `most` in usual sizes."""
    return ROUNDED * (size + most * V.scale[i]) if V.scale[i] < math.inf else math.inf


@jitable
def largest_of(V: Variations, row: int) -> float:
    """Return the largest number of a row of `sides`, in usual sizes."""
    largest = 0.0
    for i in range(len(V.scale)):
        largest = max(largest, abs(V.sides[row, i]) / V.scale[i])
    return largest


@jitable
def is_alike(
    V: Variations, scene: Scene, begin: float, end: float, y: F1, k: int, e: float
) -> bool:
    """Return whether f changes on both sides of parameter k as in the run, between two times.

    So it does where all of its jumps there are between them: what it is a smooth function of
    cancels. f of the run is left in `sides`.
    """
    sides, code = V.sides, 0
    for side in range(2):
        x = e if side == 0 else -e
        code = code or evaluate_at(V, scene, begin, y, k, x, BEFORE)
        code = code or evaluate_at(V, scene, end, y, k, x, BEHIND)
        for i in range(len(y)):
            change = sides[BEHIND, i] - sides[BEFORE, i]
            sides[CHANGES, i] = change if side == 0 else sides[CHANGES, i] + change
    code = code or evaluate_at(V, scene, begin, y, k, 0.0, BEGIN)
    code = code or evaluate_at(V, scene, end, y, k, 0.0, END)
    most = max(largest_of(V, BEHIND), largest_of(V, BEGIN), largest_of(V, END))
    for i in range(len(y)):
        a, b = sides[BEGIN, i], sides[END, i]
        even = ALIKE * abs(b - a) + SMOOTH * max(abs(a), abs(b))
        if not abs(sides[CHANGES, i] - 2.0 * (b - a)) <= even + noise(
            V, i, abs(sides[BEHIND, i]), most
        ):
            return False
    return code == 0


@jitable
def bend_at(V: Variations, scene: Scene, t: float, y: F1, k: int, e: float, row: int) -> int:
    """Write f on both sides of parameter k less twice that of the run, which is left in MIDDLE."""
    sides, code = V.sides, 0
    sides[row, :] = 0.0
    for side in range(3):
        x, weight = (e, 1.0) if side == 0 else (-e, 1.0) if side == 1 else (0.0, -2.0)
        code = code or evaluate_at(V, scene, t, y, k, x, MIDDLE)
        for i in range(len(y)):
            sides[row, i] += weight * sides[MIDDLE, i]
    return code


@jitable
def is_beside(
    V: Variations, scene: Scene, near: float, far: float, y: F1, k: int, e: float
) -> bool:
    """Return whether both sides of parameter k lie about the run at two times alike.

    They do not where jumps that cancel in the run are at different times on a side.
    """
    code = bend_at(V, scene, far, y, k, e, END) or bend_at(V, scene, near, y, k, e, BEGIN)
    most = largest_of(V, MIDDLE)
    for i in range(len(y)):
        size = abs(V.sides[MIDDLE, i])
        off = abs(V.sides[BEGIN, i] - V.sides[END, i])
        if not off <= SMOOTH * size + 4.0 * noise(V, i, size, most):
            return False
    return code == 0


@jitable
def add_drift(V: Variations, scene: Scene, far: float, near: float, y: F1, row: int) -> bool:
    """Add to DRIFT by how much f of the run changes between two times; return if it does evenly.

    f at the one that is far off is in a row of `sides`.
    """
    sides = V.sides
    code = evaluate_at(V, scene, near, y, 0, 0.0, BEFORE)
    code = code or evaluate_at(V, scene, 0.5 * (far + near), y, 0, 0.0, MIDDLE)
    most = largest_of(V, row)
    for i in range(len(y)):
        a, b = sides[row, i], sides[BEFORE, i]
        rounded = noise(V, i, max(abs(a), abs(b)), most)
        if not abs(0.5 * (a + b) - sides[MIDDLE, i]) <= EVENLY * abs(a - b) + rounded:
            return False
        sides[DRIFT, i] += MORE * (abs(a - b) + rounded)
    return code == 0


@jitable
def differs(V: Variations, row: int, other: int) -> bool:
    """Return whether f jumps between two rows of `sides`."""
    for i in range(V.sides.shape[1]):
        a, b = V.sides[row, i], V.sides[other, i]
        if not abs(a - b) <= V.sides[DRIFT, i] + ROUNDED * max(abs(a), abs(b)):
            return True
    return False


@jitable
def find_jump(
    V: Variations, scene: Scene, left: float, end: float, least: float, y: F1, k: int, e: float
) -> tuple[float, float]:
    """Return between which times f of a side jumps first; it is in BEFORE, and left in BEHIND."""
    right = end
    copy_row(V, END, BEHIND)
    while right - left > least:
        middle = 0.5 * (left + right)
        if middle <= left or middle >= right:
            break
        if evaluate_at(V, scene, middle, y, k, e, MIDDLE) != 0:
            return math.nan, math.nan
        if differs(V, BEFORE, MIDDLE):
            right = middle
            copy_row(V, MIDDLE, BEHIND)
        else:
            left = middle
            copy_row(V, MIDDLE, BEFORE)
    return left, right


@jitable
def end_of(piece: int, pieces: int, begin: float, end: float) -> float:
    """Return where a piece of what is searched ends, the first one being 1."""
    if pieces == PIECES:
        return begin + piece / pieces * (end - begin)
    half, about = (pieces - 1) // 2, 0.5 * (begin + end)
    if piece == pieces:
        return end
    away = piece if piece <= half else pieces - piece
    return about + (0.5 if piece > half else -0.5) * (end - begin) * RATIO ** (-float(away))


@jitable
def add_jumps(
    V: Variations, scene: Scene, begin: float, end: float, pieces: int, y: F1, k: int, e: float
) -> float:
    """Add what the jumps of a side make of derivative k, by how much later than midway they are.

    Return the largest such time, NaN where they are not found.
    """
    sides, left, farthest, found = V.sides, begin, 0.0, 0
    about = 0.5 * (begin + end)
    code = evaluate_at(V, scene, begin, y, k, e, BEFORE)
    for piece in range(1, pieces + 1):
        until = end_of(piece, pieces, begin, end)
        code = code or evaluate_at(V, scene, until, y, k, e, END)
        while code == 0 and differs(V, BEFORE, END):
            left, right = find_jump(V, scene, left, until, FOUND * (end - begin), y, k, e)
            found += 1
            if not right > left or found > MOST_JUMPS:
                return math.nan
            later = 0.5 * (left - about) + 0.5 * (right - about)
            farthest, left = max(farthest, abs(later)), right
            for i in range(len(y)):
                V.fall[k, i] -= 0.5 / e * later * (sides[BEHIND, i] - sides[BEFORE, i])
                sides[BEFORE, i] = sides[BEHIND, i]
        left = until
    return farthest if code == 0 else math.nan


@jitable
def find_fall(
    V: Variations, scene: Scene, y: F1, k: int, before: float, behind: float
) -> tuple[bool, float]:
    """Find how derivative k jumps where f of the run does, between two times.

    Return whether that is known, and how far the times of jumps move, over the parameter.
    """
    about, gap, e = 0.5 * (before + behind), behind - before, CHANGE * V.size[k]
    wide = max(NEAR * e * abs(about) / V.size[k], 4.0 * gap)
    alike = is_alike(V, scene, before - gap, behind + gap, y, k, e)
    cancels = alike and change_of(V, V.sides[BEGIN], V.sides[END]) <= SMOOTH * largest_of(V, END)
    alike = alike and is_beside(V, scene, before - gap, before - wide, y, k, e)
    alike = alike and is_beside(V, scene, behind + gap, behind + wide, y, k, e)
    if alike and not cancels:
        return True, 0.0
    pieces = MANY_PIECES if cancels else PIECES
    for _ in range(TRIES):
        wide = max(NEAR * e * abs(about) / V.size[k], 4.0 * gap)
        known = is_alike(V, scene, before - wide, behind + wide, y, k, e)
        for _ in range(OFTEN):
            if not known:
                wide *= FARTHER
                known = is_alike(V, scene, before - wide, behind + wide, y, k, e)
        begin, end = before - wide, behind + wide
        V.sides[DRIFT, :] = 0.0
        if known and add_drift(V, scene, begin, before, y, BEGIN):
            if add_drift(V, scene, end, behind, y, END):
                up = add_jumps(V, scene, begin, end, pieces, y, k, e)
                down = add_jumps(V, scene, begin, end, pieces, y, k, -e)
                return math.isfinite(up + down), max(up, down) / e
        e *= LESS
    return alike, 0.0


@jitable
def jumps_beside(V: Variations, scene: Scene, m: Method, t: float, k: int) -> bool:
    """Return whether f jumps just behind time t, at which a run begins, on a side of parameter k.

    For the run itself it has jumped before: it has a derivative to one side alone.
    """
    e = CHANGE * V.size[k]
    wide = NEAR * e * max(1.0, abs(t) / V.size[k])
    return not is_alike(V, scene, t, t + min(wide, BEHIND_BEGIN * m.memory[OWN_TIME]), m.y, k, e)


@jitable
def find_falls(V: Variations, scene: Scene, y: F1, before: float, behind: float, at: int) -> None:
    """Find how all derivatives jump between two times at the begin or end of a step.

    NaN for those of which that is not known.
    """
    V.gap[at] = 0.5 * (before + behind)
    for k in range(len(V.size)):
        V.moves[k, at], V.fall[k, :] = 0.0, 0.0
        if V.lost[k] == math.inf:
            known, V.moves[k, at] = find_fall(V, scene, y, k, before, behind)
            if not known:
                V.moves[k, at], V.fall[k, :] = 0.0, math.nan
    set_parameter(V, view(V.words[TWIN], Scene), scene, 0, 0.0)


@jitable
def is_switch(table: F2, row: int) -> bool:
    """Return whether a row of the timetable is one from which no step goes; there may be several.

    What is not filled is not.
    """
    ends, horizon = table[row, TIMETABLE_ENDS], table[row, TIMETABLE_HORIZON]
    return horizon < table[row - 1, TIMETABLE_ENDS] < ends


@jitable
def next_switch(m: Method, t: float) -> tuple[float, float]:
    """Return between which times the run will hop next, from t on; NaN where that is not soon."""
    table, least = m.timetable, ROUNDINGS * abs(t)
    for row in range(max(m.counts[ROW], 1), len(table)):
        before = table[row - 1, TIMETABLE_ENDS]
        if before > t + SOON * abs(t):
            break
        if before >= t - least and is_switch(table, row):
            last = row
            while last + 1 < len(table) and is_switch(table, last + 1):
                last += 1
            # the last row is of all that comes
            return before, min(table[last, TIMETABLE_ENDS], before + MOST_ROUNDINGS * least)
    return math.nan, math.nan


@jitable
def begin_unseen(V: Variations, scene: Scene, m: Method, t: float) -> bool:
    """Begin a step to t; return whether something has jumped at its begin that was not seen then.

    Of what jumped before all sides of differences are soon behind it.
    """
    begin, until, starts = m.memory[TIME], V.gap[UNTIL], V.gap[LAST] == -math.inf
    V.gap[UNTIL] = t
    if V.gap[LAST] < begin:
        V.gap[FIRST], V.gap[LAST] = V.gap[LAST], math.nan
        for k in range(len(V.size)):
            V.moves[k, FIRST], V.moves[k, LAST] = V.moves[k, LAST], 0.0
    hops = begin - until > ROUNDINGS * abs(begin) and not V.gap[FIRST] >= until
    if hops:
        find_falls(V, scene, m.y, until, begin, FIRST)
    elif starts:
        for k in range(len(V.size)):
            V.fall[k, 0] = math.nan if jumps_beside(V, scene, m, begin, k) else 0.0
        set_parameter(V, view(V.words[TWIN], Scene), scene, 0, 0.0)
    return hops or starts


@jitable
def look_behind(V: Variations, scene: Scene, m: Method, t: float) -> bool:
    """Find what jumps where a step ends at t; return whether the run hops over something there.

    Where it soon will only how far parameters move that counts.
    """
    before, behind = next_switch(m, t)
    if not behind > before:
        return False
    hops = before <= t + ROUNDINGS * abs(t)
    if hops or not V.gap[LAST] == 0.5 * (before + behind):
        find_falls(V, scene, m.trial, before, behind, LAST)
    return hops


@jitable
def make_room(V: Variations, k: int, t: float, h: float) -> None:
    """Let a parameter be changed by less in a step h from t that is short beside how jumps move.

    `close` is 1 where some evaluation in the step would be next to one.
    """
    V.shrink[k], V.close[k] = 1.0, 0
    e = OFF * widest_step(V, k)
    begins, ends = e * V.moves[k, FIRST], e * V.moves[k, LAST]
    if begins > 0.0 and t < V.gap[FIRST] + ROOM * begins:
        V.close[k] = 1
    if ends > 0.0 and t + h > V.gap[LAST] - ROOM * ends:
        V.close[k] = 1
    far = ROOM * max(begins, ends)
    if V.close[k] == 1 and far > h:
        V.shrink[k] = h / far


@jitable
def clear_time(V: Variations, t: float) -> float:
    """Return the time nearest to t, in the step that is taken, by which all sides have jumped.

    Or none has. Of the parameter by which the twin is changed.
    """
    k = V.words[SET]
    if V.close[k] == 1:
        e = OFF * widest_step(V, k)
        if V.moves[k, LAST] > 0.0:
            t = min(t, V.gap[LAST] - e * V.moves[k, LAST])
        if V.moves[k, FIRST] > 0.0:
            t = max(t, V.gap[FIRST] + e * V.moves[k, FIRST])
    return t
