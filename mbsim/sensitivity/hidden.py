"""Jumps within a step that only a user's subroutine knows of, as one over a speed or at a time.

Nothing ends a step there, so that sides of differences may be on either side of the jump: what
derivatives do is not known, unless the parameter leaves the jump where it is. A jump is looked for
along the step, by bisection: of what is smooth each half changes by about half of it.
"""

from __future__ import annotations

import math

from mbsim.arrays.scene import Scene
from mbsim.core.address import view
from mbsim.core.jitable import jitable
from mbsim.integrators.scheme import TIME, Method
from mbsim.sensitivity.arrays import ASKED, F_BEFORE, HIDES, TWIN, USUAL_CHANGE, Variations
from mbsim.sensitivity.timed import (
    BEFORE,
    BEGIN,
    BEHIND,
    CHANGES,
    END,
    MIDDLE,
    evaluate_at,
    largest_of,
)
from mbsim.sensitivity.twin import change_of, half_step, half_with_jump, set_parameter

#: What f changes by is no jump below this part of it; a side changes as the run does up to ALIKE of
#: that.
SMOOTH, ALIKE = 1e-8, 1e-2
#: f that changes no faster than so many times as fast as in the step before does not jump: a step
#: over a jump is a short one.
FASTER = 1.3
#: How short a part of a step a jump is found in, and how many roundings of a time.
FOUND, ROUNDINGS = 1e-10, 4e-15


@jitable
def same_touch(scene: Scene) -> bool:
    """Return whether the same touches at both ends of the step."""
    for s in range(len(scene.work.touching)):
        if scene.work.touching[s] != scene.state.touching[s]:
            return False
    return True


@jitable
def ask_within(
    V: Variations, scene: Scene, m: Method, h: float, s: float, k: int, e: float, row: int
) -> int:
    """Write f at the part s of the step, with parameter k changed by e, into a row; return a code.

    Along the cubic polynomial by y and f at both ends.
    """
    w, r = V.row[1], 1.0 - s
    for i in range(len(m.y)):
        rise = m.trial[i] - m.y[i]
        first, last = h * m.k[0, i] - rise, rise - h * V.jump[F_BEFORE, i]
        w[i] = m.y[i] + s * (rise + r * (first * r + last * s)) + e * V.d[k, i]
    V.words[ASKED] += 1
    return evaluate_at(V, scene, m.memory[TIME] + s * h, w, k, e, row)


@jitable
def jump_within(V: Variations, scene: Scene, m: Method, h: float) -> float:
    """Return at which part of the step f of the run jumps while the same touches, NaN: nowhere."""
    begin, end, before = 0.0, 1.0, V.line[USUAL_CHANGE]
    least = max(FOUND, ROUNDINGS * abs(m.memory[TIME]) / h)
    for i in range(len(m.y)):
        V.sides[BEGIN, i], V.sides[END, i] = m.k[0, i], V.jump[F_BEFORE, i]
    whole = change_of(V, V.sides[BEGIN], V.sides[END])
    none = SMOOTH * max(largest_of(V, BEGIN), largest_of(V, END))
    V.line[USUAL_CHANGE] = whole / h
    if not same_touch(scene) or whole <= FASTER * before * h:
        return math.nan
    while whole > none:
        if end - begin <= least:
            V.line[USUAL_CHANGE] = before
            return 0.5 * (begin + end)
        middle = 0.5 * (begin + end)
        if ask_within(V, scene, m, h, middle, 0, 0.0, MIDDLE) != 0:
            return math.nan
        half = half_with_jump(V, V.sides, (BEGIN, MIDDLE, END), whole)
        if half < 0:
            return math.nan
        begin, end = (begin, middle) if half == 0 else (middle, end)
        whole = change_of(V, V.sides[BEGIN], V.sides[END])
    return math.nan


@jitable
def stays(V: Variations, scene: Scene, m: Method, h: float, s: float, k: int) -> bool:
    """Return whether a jump at the part s of the step is there on both sides of parameter k too."""
    near, sides = 4.0 * max(FOUND, ROUNDINGS * abs(m.memory[TIME]) / h), V.sides
    first, last = max(s - near, 0.0), min(s + near, 1.0)
    code, e = 0, half_step(V, k)
    sides[CHANGES, :] = 0.0
    for side in range(3):
        x, weight = (0.0, -2.0) if side == 0 else (e if side == 1 else -e, 1.0)
        code = code or ask_within(V, scene, m, h, first, k, x, BEFORE)
        code = code or ask_within(V, scene, m, h, last, k, x, BEHIND)
        for i in range(len(m.y)):
            change = sides[BEHIND, i] - sides[BEFORE, i]
            sides[CHANGES, i] += weight * change
            if side == 0:
                sides[MIDDLE, i] = change
    off = size = 0.0
    for i in range(len(m.y)):
        off = max(off, abs(sides[CHANGES, i]) / V.scale[i])
        size = max(size, abs(sides[MIDDLE, i]) / V.scale[i])
    return code == 0 and off <= ALIKE * size


@jitable
def find_hidden(V: Variations, scene: Scene, m: Method, h: float) -> None:
    """Find which parameters move a jump in the step h that nothing tells of: `reason` says so."""
    at = jump_within(V, scene, m, h)
    for k in range(len(V.size)):
        if not math.isnan(at) and V.lost[k] == math.inf and not stays(V, scene, m, h, at, k):
            V.reason[k] = V.words[HIDES]
    set_parameter(V, view(V.words[TWIN], Scene), scene, 0, 0.0)
