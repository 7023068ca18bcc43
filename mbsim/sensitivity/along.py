"""Derivatives along the motion within one step, where a contact begins or ends in it.

A step that just reaches into a contact is right to tol, for the force is small there; the
derivative of what it computes is not: it would have the contact's stiffness over a part of the
whole step. So D' = f_y D + f_p is integrated along the step's polynomial up to where the contact
changes and from there on (`changes`).
"""

from __future__ import annotations

from mbsim.arrays.scene import Scene
from mbsim.core.address import call_int, view
from mbsim.core.arrays import F1
from mbsim.core.codes import Code
from mbsim.core.jitable import jitable
from mbsim.integrators.scheme import Method, in_workspace
from mbsim.sensitivity.arrays import (
    ALIKE,
    ALONG,
    APART,
    ASKED,
    BEFORE,
    F_BEFORE,
    MOST,
    ODD,
    REMEMBERED,
    STRAIGHT,
    TWIN,
    UP,
    Variations,
)
from mbsim.sensitivity.tableaus import LAST, OF_FIFTH, OF_THIRD, ORDER, A, C, E
from mbsim.sensitivity.twin import (
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
#: What the error of such a part may be, over that of a step.
BENT_ENOUGH = 0.1
#: What is no longer taken for rounding.
ROUGHEST = 1e-5
#: Of a part of the step: begin and end of the stretch it is in, its length in the step's, its time.
Span = tuple[float, float, float, float]
#: Parts of a stretch by which its ends are left, until both sides of a difference touch alike.
NEAREST, FARTHER = 1e-12, 4.0
#: A difference is no smaller than this part of the usual one.
LEAST = 1e-4


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
    if V.words[ALONG] == 0 and V.words[REMEMBERED] == 0:
        # forces of impacts bend there: what is left of places becomes speeds
        most *= BENT_ENOUGH
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
