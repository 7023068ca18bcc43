"""Derivatives along a stretch of a step, in parts as long as their errors allow.

Where a law goes over into another formula, as where damping has brought a contact's force to zero,
f bends: f_y jumps, and no formula of higher order sees how far off it is. Such a bend is looked
for by bisection of D', at one slope a halving. Parts end on both sides of it.
"""

from __future__ import annotations

import math

from mbsim.arrays.scene import Scene
from mbsim.core.codes import Code
from mbsim.core.jitable import jitable
from mbsim.sensitivity.along import (
    EVEN,
    FIRST,
    NEAREST,
    SECOND,
    STAGE,
    Span,
    clear_slope,
    keep_part,
    pace,
    try_part,
    warp,
)
from mbsim.sensitivity.arrays import (
    ALONG,
    APART,
    ASKED,
    BEHIND_BEND,
    BEND,
    ERROR_TO_WALL,
    MOST,
    PART_TO_WALL,
    REMEMBERED,
    WALL,
    Variations,
)
from mbsim.sensitivity.tableaus import LAST, OF_FIFTH, OF_THIRD, ORDER
from mbsim.sensitivity.twin import change_of, half_with_jump

#: After so many tries that led no farther than this part of a stretch less is asked for; the
#: shortest part of a step.
MANY_PARTS, PROGRESS, SHORTEST = 60, 0.01, 1e-9
#: What is no longer taken for rounding.
ROUGHEST = 1e-5
#: A part is no more than so many times as long as the one before, and no less than this part of it;
#: what is left of a stretch is taken in one where it is no more than so much longer.
LONGEST, LEAST, EASY = 1000.0, 0.1, 1.1
#: The same of GALPHA, where the order is chosen by how long parts last, and where friction
#: remembers, where errors of short parts are rounding.
MOST_LASTING = 4.0
#: A step of GALPHA that takes so many parts of order 3 would take fewer of order 5; one that is one
#: part of order 5, which might be so many times as long, is one of order 3.
MANY, LONGER = 3, 2.5
#: A part whose error is this part of what that of a longer one tells, or where that of the shorter
#: one is hardly less, has a bend behind it, or in it.
FAR_LESS, HARDLY = 1e-2, 2.0
#: What the error of the part across a bend is to be, over what it may be.
ACROSS = 0.1
#: Where neither half has more a bend is that the stretch has become so much shorter.
NARROW = 0.3
#: Rows of `Variations.work`: D' at the begin, the middle and the end of what is searched.
AT_BEGIN, AT_MIDDLE, AT_END = SECOND, SECOND + 1, SECOND + 2


@jitable
def is_too_much(V: Variations) -> bool:
    """Return whether derivatives have taken all the evaluations that they are worth."""
    return V.words[MOST] > 0 and V.words[ASKED] > V.words[MOST]


@jitable
def first_part(V: Variations, k: int, way: int, width: float, begun: bool) -> float:
    """Return what part of a stretch is tried first; let a known first slope be one over q."""
    if begun:
        for i in range(V.next.shape[1]):
            V.work[FIRST, i] *= pace(way, 0.0) * width
    V.line[APART] = NEAREST
    V.line[WALL] = V.line[BEND] = V.line[BEHIND_BEND] = math.inf
    return min(1.0, V.lasted[k] / width) if way == EVEN and V.lasted[k] > 0.0 else 1.0


@jitable
def choose_order(V: Variations, k: int, taken: int, width: float) -> None:
    """Choose the order of parts of the next step of GALPHA from how many were taken in this one."""
    if V.fifth[k] == 0 and taken >= MANY:
        V.fifth[k], V.lasted[k] = 1, 0.0
    elif V.fifth[k] == 1 and taken == 1 and V.lasted[k] > LONGER * width:
        V.fifth[k], V.lasted[k] = 0, 0.0


@jitable
def end_of_part(V: Variations, q: float, part: float) -> float:
    """Return where the next part of a stretch ends, at a bend if it comes before."""
    stop = V.line[BEND] if q < V.line[BEND] else V.line[BEHIND_BEND]
    stop = stop if q < stop < 1.0 else 1.0
    return stop if q + EASY * part >= stop else q + part


@jitable
def seems_bent(V: Variations, q: float, part: float, error: float, order: float) -> bool:
    """Return whether the error of a part does not go with that of the longer one before it.

    Of one that is too long, what it tells is kept.
    """
    wall, longer = V.line[WALL], V.line[PART_TO_WALL]
    bent = False
    if q < wall < math.inf:
        shorter = part / longer
        told = V.line[ERROR_TO_WALL] * shorter**order
        bent = error > 1.0 and error > HARDLY * told
        bent = bent or (error <= 1.0 and q + part < wall and error < FAR_LESS * told)
    if error > 1.0 and not bent:
        V.line[WALL], V.line[PART_TO_WALL], V.line[ERROR_TO_WALL] = q + part, part, error
    return bent


@jitable
def ask_ahead(
    V: Variations,
    scene: Scene,
    t: float,
    h: float,
    k: int,
    span: Span,
    at: tuple[float, float],
    e: float,
    row: int,
) -> int:
    """Write D' a part of a stretch ahead, along the straight line, into a row; return a code."""
    (begin, end, way), (q, ahead), w = span, at, V.work
    for i in range(len(V.scale)):
        w[STAGE, i] = V.next[k, i] + ahead * w[FIRST, i]
    s = begin + warp(way, q + ahead) * (end - begin)
    return clear_slope(V, scene, t, h, k, begin, end, s, row, e)


@jitable
def find_bend(
    V: Variations, scene: Scene, t: float, h: float, k: int, span: Span, q: float, e: float
) -> int:
    """Find where D' jumps between q and where a part was too long; return a code.

    Where it does so nowhere parts go on as they were. Sides of the difference reach the bend at
    different times: between these D' is neither.
    """
    w, low, far = V.work, 0.0, V.line[WALL] - q
    high = far
    least = max(ACROSS / V.line[ERROR_TO_WALL] * V.line[PART_TO_WALL], SHORTEST * far)
    V.line[WALL] = math.inf
    code = ask_ahead(V, scene, t, h, k, span, (q, low), e, AT_BEGIN)
    code = code or ask_ahead(V, scene, t, h, k, span, (q, far), e, AT_END)
    whole = change_of(V, w[AT_BEGIN], w[AT_END])
    while code == 0 and high - low > least:
        middle = 0.5 * (low + high)
        code = ask_ahead(V, scene, t, h, k, span, (q, middle), e, AT_MIDDLE)
        half = half_with_jump(V, w, (AT_BEGIN, AT_MIDDLE, AT_END), whole)
        if half < 0:
            if high - low > NARROW * far:
                return code
            break
        low, high = (low, middle) if half == 0 else (middle, high)
        whole = change_of(V, w[AT_BEGIN], w[AT_END])
    V.line[BEND], V.line[BEHIND_BEND] = q + low, q + high
    return code


@jitable
def go_on_with(V: Variations, k: int, last: int) -> None:
    """Let the derivative and its slope be those at the end of the part that was tried."""
    w, d = V.work, V.next[k]
    for i in range(len(d)):
        d[i], w[FIRST, i] = w[STAGE, i], w[FIRST + last, i]


@jitable
def integrate(
    V: Variations,
    scene: Scene,
    t: float,
    h: float,
    k: int,
    span: Span,
    e: float,
    begun: bool,
    later: float,
) -> int:
    """Carry the derivative in `next` through a stretch of the step; return a code.

    By an explicit method, as exactly as `enough` asks. Its first slope is left in `work`, of the
    end, as it may be there where the step has begun. `later` is kept with the polynomials of its
    parts.
    """
    begin, end, way = span
    w, q, most = V.work, 0.0, V.enough[0]
    width = (end - begin) * h
    if width <= 0.0:
        return 0
    tries, taken, before = 0, 0, 0.0
    row = OF_THIRD if V.words[ALONG] == 1 and V.fifth[k] == 0 else OF_FIFTH
    often = V.words[ALONG] == 1 or V.words[REMEMBERED] > 0
    most_longer = MOST_LASTING if often else LONGEST
    part = first_part(V, k, way, width, begun)
    while q < 1.0:
        tries += 1
        if is_too_much(V):
            return Code.NOT_CONVERGED
        if tries % MANY_PARTS == 0:
            if q - before < PROGRESS:
                # what is left is rounding of forces
                most *= 10.0
                if most > ROUGHEST:
                    return Code.NOT_CONVERGED
            before = q
        until = end_of_part(V, q, part)
        part = until - q
        code, error = try_part(V, scene, t, h, k, span, (q, part), e, row, begun)
        if code != 0:
            return code
        begun, error = True, error / most
        bent, across = seems_bent(V, q, part, error, ORDER[row]), until == V.line[BEHIND_BEND]
        longer = min(most_longer, max(LEAST, 0.9 * max(error, 1e-300) ** (-1.0 / ORDER[row])))
        if error <= 1.0 or part * width <= max(SHORTEST * h, 1e-15 * abs(t)):
            keep_part(V, k, span, q, part, later, row)
            taken += 1
            go_on_with(V, k, LAST[row])
            q = until
            if way == EVEN:
                V.lasted[k] = part * width * longer
        elif until == V.line[BEND] or across:
            V.line[BEND] = V.line[BEHIND_BEND] = math.inf
        part = 1.0 if across and q == until else part * longer
        if bent:
            code = find_bend(V, scene, t, h, k, span, q, e)
            if code != 0:
                return code
    if V.words[ALONG] == 1 and way == EVEN:
        choose_order(V, k, taken, width)
    faster = pace(way, 1.0) * width
    for i in range(w.shape[1]):
        w[FIRST, i] = w[FIRST, i] / faster if faster > 0.0 else 0.0
    return 0
