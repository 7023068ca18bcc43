"""Derivatives along the motion within one step, where a contact begins or ends in it.

A step that just reaches into a contact is right to tol, for the force is small there; the
derivative of what it computes is not: it would have the contact's stiffness over a part of the
whole step. So D' = f_y D + f_p is integrated along the step's polynomial up to where the contact
changes and from there on (`changes`).
"""

from __future__ import annotations

import math

from mbsim.arrays.scene import Scene
from mbsim.core.address import call_int, view
from mbsim.core.arrays import F1
from mbsim.core.jitable import jitable
from mbsim.integrators.scheme import Method, in_workspace
from mbsim.sensitivity.arrays import (
    ALIKE,
    APART,
    BEGINS,
    CORNERS,
    DOWN_SIDE,
    ENDS,
    FROM,
    IS_LATER,
    LENGTH,
    LINE_F,
    LINE_Y,
    LONG,
    MOST_PARTS,
    ODD,
    REMEMBERED,
    STRAIGHT,
    TWIN,
    UP,
    WAY,
    Variations,
)
from mbsim.sensitivity.tableaus import DENSE, LAST, A, C, E
from mbsim.sensitivity.twin import (
    acts,
    keep_change,
    keep_depths,
    keep_side,
    set_parameter,
)

#: Rows of `Variations.work`: a point, f on either side, D at a stage, its slopes.
POINT, UPPER, LOWER, STAGE, FIRST = range(5)
SECOND, THIRD, WORK = FIRST + 1, FIRST + 2, FIRST + 7
#: A stretch of the step: its begin and end, and how its parts are taken.
Span = tuple[float, float, int]
#: Evenly; or the more slowly the nearer to its begin or end, where a touch begins or ends: forces
#: are powers of depths that are no whole numbers, and bend smoothly over the root of the time.
EVEN, SOFT_BEGIN, SOFT_END = range(3)
#: Parts of a stretch by which its ends are left, until both sides of a difference touch alike; up
#: to which that is less than what a smaller difference is off by.
NEAREST, FARTHER, NEAR = 1e-12, 4.0, 1e-3
#: A step is very short below this part of the length of straight lines.
SHORT = 0.01
#: A difference is no smaller than this part of the usual one.
LEAST = 1e-4


@jitable
def point_at(V: Variations, s: float, out: F1) -> None:
    """Write the state at the part s of the step, or of a straight line to its end."""
    path, r = V.path, 1.0 - s
    if V.words[STRAIGHT] == 1:
        for i in range(len(out)):
            out[i] = V.jump[LINE_Y, i] + (s - 1.0) * V.line[0] * V.jump[LINE_F, i]
        return
    last = len(path) - 1
    if (s < 0.0 or s > 1.0) and V.line[LENGTH] < SHORT * V.line[0]:
        # beyond a very short step its polynomial is all rounding
        last = 1
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
            sum += acts(V, twin, twin.work.hit[j]) * (1 + twin.work.hit[j])
        V.words[ALIKE + side] = sum
    for i in range(len(out)):
        out[i] = 0.5 / e * (w[UPPER, i] - w[LOWER, i])
    return 0


@jitable
def jumps(V: Variations) -> bool:
    """Return whether friction of some contact jumps as it begins or ends."""
    for c in range(len(V.breaks)):
        if V.breaks[c] == 1:
            return True
    return False


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
        if off < NEAR:
            off = min(NEAR, FARTHER * off)
        elif step > LEAST * e:
            # a touch may be no deeper than both sides are apart
            step *= 0.1
        elif off < 0.5:
            off = min(0.5, FARTHER * off)
        else:
            if jumps(V):
                # the stretch is shorter than sides are apart, and what lies between no derivative
                w[row, :] = 0.0
            return 0


@jitable
def warp(way: int, q: float) -> float:
    """Return at which part of a stretch its part q is as it is integrated."""
    if way == SOFT_BEGIN:
        return q * q
    return 1.0 - (1.0 - q) * (1.0 - q) if way == SOFT_END else q


@jitable
def unwarp(way: int, part: float) -> float:
    """Return what `warp` makes a part of a stretch of."""
    if way == SOFT_BEGIN:
        return math.sqrt(max(part, 0.0))
    return 1.0 - math.sqrt(max(1.0 - part, 0.0)) if way == SOFT_END else part


@jitable
def pace(way: int, q: float) -> float:
    """Return the derivative of `warp`."""
    if way == SOFT_BEGIN:
        return 2.0 * q
    return 2.0 * (1.0 - q) if way == SOFT_END else 1.0


@jitable
def try_part(
    V: Variations,
    scene: Scene,
    t: float,
    h: float,
    k: int,
    span: Span,
    at: tuple[float, float],
    e: float,
    row: int,
    begun: bool,
) -> tuple[int, float]:
    """Try a part of a stretch; return a code, and the error over the derivative's size.

    `at` says from where on, and how long. By the method in a row of the tableaus. What it leads to
    is left in `work`; where the part has begun its first slope is there already. Slopes are those
    over q.
    """
    w, d = V.work, V.next[k]
    begin, end, way = span
    q, part = at
    error, whole = 0.0, 1.0 / V.size[k]
    last, width = LAST[row], end - begin
    for stage in range(1 if begun else 0, last + 1):
        for i in range(len(d)):
            rise = 0.0
            for j in range(stage):
                rise += A[row, stage, j] * w[FIRST + j, i]
            w[STAGE, i] = d[i] + part * rise
        x = q + C[row, stage] * part
        faster, s = pace(way, x) * width * h, begin + warp(way, x) * width
        code = 0
        if faster > 0.0:
            code = clear_slope(V, scene, t, h, k, begin, end, s, FIRST + stage, e)
        if code != 0:
            return code, 0.0
        for i in range(len(d)):
            w[FIRST + stage, i] = faster * w[FIRST + stage, i] if faster > 0.0 else 0.0
    for i in range(len(d)):
        off = 0.0
        for j in range(last + 1):
            off += E[row, j] * w[FIRST + j, i]
        error = max(error, abs(part * off) / V.felt[i])
        whole = max(whole, abs(w[STAGE, i]) / V.felt[i], abs(d[i]) / V.felt[i])
    return 0, error / whole


@jitable
def keep_part(
    V: Variations, k: int, span: Span, q: float, part: float, later: float, row: int
) -> None:
    """Keep the polynomial of a part of a stretch that is taken, while there is room for it."""
    at = V.parts[k]
    V.parts[k] += 1
    if at >= MOST_PARTS:
        return
    w, d, c, last = V.work, V.next[k], V.part[k * MOST_PARTS + at], LAST[row]
    about = V.about[k * MOST_PARTS + at]
    about[BEGINS], about[ENDS], about[WAY] = span[0], span[1], float(span[2])
    about[FROM], about[LONG], about[IS_LATER] = q, part, later
    for i in range(len(d)):
        rise = w[STAGE, i] - d[i]
        bend = part * w[FIRST, i] - rise
        c[0, i], c[1, i], c[2, i] = d[i], rise, bend
        c[3, i] = rise - part * w[FIRST + last, i] - bend
        c[4, i] = 0.0
        for j in range(last + 1):
            c[4, i] += part * DENSE[row, j] * w[FIRST + j, i]


@jitable
def value_within(V: Variations, k: int, s: float) -> float:
    """Write what is carried at the part s of the last step into `next`, of kept parts.

    Return how much later it is there; NaN where it is not kept.
    """
    if V.parts[k] == 0 or V.parts[k] > MOST_PARTS:
        return math.nan
    at = k * MOST_PARTS
    for j in range(V.parts[k]):
        about = V.about[at]
        way, width = int(about[WAY]), about[ENDS] - about[BEGINS]
        if about[BEGINS] + warp(way, about[FROM] + about[LONG]) * width >= s:
            break
        if j + 1 < V.parts[k]:
            at += 1
    about, c = V.about[at], V.part[at]
    way, width = int(about[WAY]), about[ENDS] - about[BEGINS]
    q = unwarp(way, (s - about[BEGINS]) / width) if width > 0.0 else 1.0
    x = min(max((q - about[FROM]) / about[LONG], 0.0), 1.0)
    r = 1.0 - x
    for i in range(V.next.shape[1]):
        V.next[k, i] = c[0, i] + x * (c[1, i] + r * (c[2, i] + x * (c[3, i] + r * c[4, i])))
    return about[IS_LATER]


@jitable
def tell(V: Variations, k: int) -> None:
    """Keep D' at the end of a step along the motion: the next one's is to be the same.

    Of friction that tells stick from slip it is not: what that keeps is taken anew.
    """
    V.told[k] = 1 if V.words[REMEMBERED] == 0 else V.words[CORNERS]
    for i in range(V.slope.shape[1]):
        V.slope[k, i] = V.work[FIRST, i]


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
    keep_change(V, k, 2.0 * e, DOWN_SIDE)
    return 0
