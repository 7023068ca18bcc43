"""The derivative of a step of generalised-alpha: its equations linearised, by its own factors.

A derivative D has an algorithmic acceleration of its own, and with it obeys the step's formulas
(`integrators.galpha`), which are linear but for turns; v1' = f(t1, y1) becomes f_y D1 + f_p at the
step's end, where f of the run is known (staggered direct method). So one evaluation a correction is
enough, and mostly one correction.

These formulas are of order 2. What they are off by, h^3 times a third derivative of D, is known at
the step's end and taken away: so D is of order 3 along the run's points. A vibration with steps of
a radian would grow by that. So it is done where that derivative is about the one of the step
before, which in such a vibration it is not: what grows is soon too large for that.

Behind an event, or where the error is too large, D is integrated along the step (`along`), and what
the next step needs of the one before follows from that.
Source: T. Maly, L. R. Petzold, Appl. Numer. Math. 20 (1996) 57; `integrators.galpha` of the method.
"""

from __future__ import annotations

import math

from mbsim.arrays.codes import SCALE_LENGTH, SCALE_SPEED
from mbsim.arrays.scene import Scene
from mbsim.core.address import call_int, view
from mbsim.core.codes import Code
from mbsim.core.jitable import jitable
from mbsim.core.layout import BODY_SIZE
from mbsim.core.problem import POSITION, VELOCITY, Problem
from mbsim.integrators.galpha_iteration import (
    AF,
    ALGORITHMIC,
    AM,
    BETA,
    DOT,
    GAMMA,
    LAST,
    SHIFT,
    SLOPE,
    mean_velocity,
    step_before,
)
from mbsim.integrators.positions import as_positions, bracket, is_rate, retract
from mbsim.integrators.scheme import FACTORED_STEP, Method, in_workspace
from mbsim.sensitivity.arrays import (
    CHANGES,
    JOINTS,
    LEFT,
    OWN,
    REMEMBERED,
    TWIN,
    UP,
    UP_SIDE,
    Variations,
)
from mbsim.sensitivity.implicit import FORGET, LEAST_RATE, ROUNDING, SLOW
from mbsim.sensitivity.twin import (
    half_step,
    keep_change,
    keep_depths,
    keep_memory,
    keep_side,
    one_side,
    set_parameter,
)

#: Rows of `Variations.stage`: a of the derivative at begin and end, D at the end, a point and one
#: on its other side, D' at the end, a residual and the correction for it.
BEGIN, END, NEW, POINT, OTHER, RATE, REST, CORRECTION = range(8)
#: Corrections at most; how fast they get smaller is known after two, and taken for so much before.
MOST, USUAL = 12, 0.1
#: A step of turns is differentiated by so large differences: no force is in it.
TURN = 1e-5
#: So many steps along the motion tell what the next one needs: D' at both ends of the last.
READY = 2
#: Row of `Variations.carried`: third derivative of D in time, over the last two steps. Where it
#: changes by more than this part of itself D vibrates.
BEND, ALIKE = 3, 0.5


@jitable
def extrapolate_beside(V: Variations, m: Method, h: float, k: int) -> None:
    """Write a of the derivative at the begin of the step, and at its end if D''' stays as it is."""
    before, kept = step_before(m), V.carried[k]
    for i in range(len(m.y)):
        slope, dot = kept[SLOPE, i], kept[DOT, i]
        a = kept[ALGORITHMIC, i] + SHIFT * (h - before) * slope
        V.stage[BEGIN, i] = a
        V.stage[END, i] = ((1.0 - AF) * (dot + h * slope) + AF * dot - AM * a) / (1.0 - AM)


@jitable
def rate_beside(V: Variations, k: int, i: int) -> float:
    """Return D' at the end of the step as a has it."""
    a0, a1 = V.stage[BEGIN, i], V.stage[END, i]
    return ((1.0 - AM) * a1 + AM * a0 - AF * V.carried[k, DOT, i]) / (1.0 - AF)


@jitable
def lead_turns(V: Variations, p: Problem, m: Method, h: float, k: int, e: float) -> None:
    """Write how positions at the end of the step move into row NEW, whose velocities are mean ones.

    As differences by e of how turns lead there.
    """
    n, up, down, x = len(m.y), V.stage[POINT], V.stage[OTHER], V.stage[REST]
    for side in range(2):
        sign, w = (1.0, up) if side == 0 else (-1.0, down)
        for i in range(n):
            x[i] = m.y[i] + sign * e * V.d[k, i]
            w[i] = mean_velocity(m, h, i) + sign * e * V.stage[NEW, i]
        retract(p, h, x, w)
    for i in range(n):
        if m.kinds[i] == POSITION:
            part = i % BODY_SIZE
            # of a place that is a sum, and has no rounding of a difference
            V.stage[NEW, i] = (
                V.d[k, i] + h * V.stage[NEW, i + 7] if part < 3 else 0.5 / e * (up[i] - down[i])
            )


@jitable
def lead(V: Variations, p: Problem, m: Method, h: float, k: int) -> None:
    """Write the derivative to which its a leads at the end of the step into row NEW."""
    largest, s, n = 1.0 / V.size[k], V.stage, len(m.y)
    for i in range(n):
        s[NEW, i] = V.d[k, i] + h * ((0.5 - BETA) * s[BEGIN, i] + BETA * s[END, i])
        largest = max(largest, abs(V.d[k, i]) / V.scale[i], abs(s[NEW, i]) / V.scale[i])
    if p.retract != 0:
        lead_turns(V, p, m, h, k, TURN / largest)
    for i in range(n):
        if is_rate(m, i):
            s[NEW, i] = V.d[k, i] + h * ((1.0 - GAMMA) * s[BEGIN, i] + GAMMA * s[END, i])


@jitable
def hold_joints(V: Variations, scene: Scene, m: Method, t: float, h: float, k: int) -> int:
    """Put the derivative in row NEW where joints hold, and let its a follow; return a code."""
    twin, e, w = view(V.words[TWIN], Scene), half_step(V, k), V.stage[NEW]
    p = in_workspace(V.words[UP])[0]
    for side in range(2):
        sign, x = (1.0, V.stage[POINT]) if side == 0 else (-1.0, V.stage[OTHER])
        set_parameter(V, twin, scene, k, sign * e)
        for i in range(len(x)):
            x[i] = m.trial[i] + sign * e * w[i]
        code = call_int(p.project, (p.context, t + h, h, x, x))
        if code != 0:
            return code
    for i in range(len(w)):
        held = 0.5 / e * (V.stage[POINT, i] - V.stage[OTHER, i])
        if m.kinds[i] == VELOCITY:
            V.stage[END, i] += (held - w[i]) / (GAMMA * h)
        w[i] = held
    return 0


@jitable
def settle_beside(V: Variations, scene: Scene, m: Method, t: float, h: float, k: int) -> int:
    """Write the derivative to which its a leads where joints allow it; return a code."""
    lead(V, in_workspace(V.words[UP])[0], m, h, k)
    return hold_joints(V, scene, m, t, h, k) if V.words[JOINTS] == 1 else 0


@jitable
def evaluate_beside(
    V: Variations, scene: Scene, m: Method, t: float, h: float, k: int, e: float
) -> int:
    """Fill D' at the end of the step, a difference by e from the run itself; return a code."""
    twin, x, f = view(V.words[TWIN], Scene), V.stage[POINT], V.stage[RATE]
    p = in_workspace(V.words[UP])[0]
    set_parameter(V, twin, scene, k, e)
    for i in range(len(x)):
        x[i] = m.trial[i] + e * V.stage[NEW, i]
    code = call_int(p.rhs, (p.context, t + h, h, x, f))
    for i in range(len(x)):
        f[i] = (f[i] - m.k[LAST, i]) / e
    keep_depths(V, twin, UP_SIDE)
    if V.words[REMEMBERED] > 0:
        keep_side(V, twin, scene, UP_SIDE)
    return code


@jitable
def correct_beside(V: Variations, m: Method, t: float, h: float, k: int) -> tuple[int, float]:
    """Correct a of the derivative once; return a code, and by how much D moves over its size."""
    p, r, d = in_workspace(V.words[UP])[0], V.stage[REST], V.stage[CORRECTION]
    for i in range(len(r)):
        r[i] = V.stage[RATE, i] - rate_beside(V, k, i) if is_rate(m, i) else 0.0
    code = call_int(p.solve, (p.context, t, h, r, d))
    if code != 0:
        return code, math.inf
    size, whole, step = 0.0, 1.0 / V.size[k], 1.0 / (GAMMA * h)
    for i in range(len(r)):
        if is_rate(m, i):
            V.stage[END, i] += step * d[i]
        size = max(size, abs(d[i]) / V.scale[i])
        whole = max(whole, abs(V.stage[NEW, i]) / V.scale[i])
    if p.difference != 0:
        half = 0.5 * BETA * h / GAMMA * step
        bracket(p, m.trial, d, r)
        for i in range(len(r)):
            if m.kinds[i] == VELOCITY:
                V.stage[END, i] += half * r[i]
    return 0, size / whole


@jitable
def rounding_of(V: Variations, m: Method, k: int, e: float) -> float:
    """Return what of a correction may be rounding, over the derivative."""
    largest, whole = 1.0, 1.0 / V.size[k]
    for i in range(len(m.y)):
        largest = max(largest, abs(m.y[i]) / V.scale[i])
        whole = max(whole, abs(V.d[k, i]) / V.scale[i])
    return ROUNDING / abs(e) * largest / whole


@jitable
def solve_beside(
    V: Variations, scene: Scene, m: Method, t: float, h: float, k: int, e: float
) -> int:
    """Solve for the derivative at the end of the step; return a code."""
    before, rate, rounding = math.inf, V.rate[k], rounding_of(V, m, k, e)
    for _ in range(MOST):
        code = settle_beside(V, scene, m, t, h, k)
        code = code or evaluate_beside(V, scene, m, t, h, k, e)
        if code != 0:
            return code
        code, size = correct_beside(V, m, t, h, k)
        if code != 0:
            return code
        if not size < math.inf:
            break
        if before < math.inf and before > 0.0:
            rate = min(size / before, 0.99)
        rounded = size > SLOW * before and size <= rounding
        if rate / (1.0 - rate) * size <= V.enough[LEFT] or rounded:
            V.rate[k] = max(rate, LEAST_RATE)
            if before == math.inf:
                # trusted less from step to step while one is all there is
                V.rate[k] = min(V.rate[k] ** FORGET, USUAL)
            return settle_beside(V, scene, m, t, h, k)
        before = size
    return Code.NOT_CONVERGED


@jitable
def sharpen(V: Variations, scene: Scene, m: Method, h: float, k: int) -> None:
    """Take away what formulas are off by from the derivative at the end of the step.

    That is up to order 3, from how D'' has changed since the last step; but for what vibrates.
    The error that is left is left over the derivative.
    """
    p, kept, before, w = in_workspace(V.words[UP])[0], V.carried[k], step_before(m), V.stage[REST]
    own = scene.world.scale[SCALE_LENGTH] / scene.world.scale[SCALE_SPEED]
    whole, most, step = 1.0 / V.size[k], 0.0, h * h
    for i in range(len(m.y)):
        w[i] = 0.0
        whole = max(whole, abs(V.stage[NEW, i]) / V.felt[i], abs(V.d[k, i]) / V.felt[i])
        if is_rate(m, i):
            a0, a1 = V.stage[BEGIN, i], V.stage[END, i]
            first, last = kept[DOT, i], rate_beside(V, k, i)
            bend = 2.0 / (h + before) * ((last - first) / h - kept[SLOPE, i])
            change, kept[BEND, i] = abs(bend - kept[BEND, i]), bend
            mean = 0.5 * (first + last) - step / 12.0 * bend
            off = h * (mean - (1.0 - GAMMA) * a0 - GAMMA * a1)
            mean = (2.0 * first + last) / 6.0 - step / 24.0 * bend
            away = step * (mean - (0.5 - BETA) * a0 - BETA * a1)
            if change <= ALIKE * abs(bend):
                V.stage[NEW, i] += off
                w[i] = away if m.kinds[i] == VELOCITY else 0.0
                off, away = step / 12.0 * h * change, step / 24.0 * step * change
            most = max(most, abs(off) / V.felt[i])
            if m.kinds[i] == VELOCITY:
                most = max(most, abs(away) / (own * V.felt[i]))
    V.error[k] = most / whole
    as_positions(p, m.trial, w)
    for i in range(len(m.y)):
        if m.kinds[i] == POSITION:
            V.stage[NEW, i] += w[i]


@jitable
def fit_step(V: Variations, m: Method, h: float, k: int) -> None:
    """Leave the end of the step, its cubic polynomial, and what the next one needs of it."""
    kept = V.carried[k]
    for i in range(len(m.y)):
        first, last, rise = V.slope[k, i], V.stage[RATE, i], V.stage[NEW, i] - V.d[k, i]
        if is_rate(m, i):
            first, last = kept[DOT, i], rate_beside(V, k, i)
            kept[ALGORITHMIC, i] = V.stage[END, i]
            kept[SLOPE, i], kept[DOT, i] = (last - first) / h, last
        V.next[k, i], V.slope[k, i] = V.stage[NEW, i], last
        V.dense[k, 0, i], V.dense[k, 1, i] = V.d[k, i], rise
        V.dense[k, 2, i], V.dense[k, 3, i] = h * first - rise, 2.0 * rise - h * (first + last)


@jitable
def fit_hermite(V: Variations, m: Method, h: float) -> None:
    """Fill the cubic polynomial of a step of generalised-alpha, as its `fit_dense` has it."""
    for i in range(len(m.y)):
        rate = is_rate(m, i)
        first = m.kept[DOT, i] if rate else m.k[0, i]
        last = m.ahead[DOT, i] if rate else m.k[LAST, i]
        rise = m.trial[i] - m.y[i]
        V.path[0, i], V.path[1, i] = m.y[i], rise
        V.path[2, i], V.path[3, i] = h * first - rise, 2.0 * rise - h * (first + last)


@jitable
def generalised_step(V: Variations, scene: Scene, m: Method, t: float, h: float, k: int) -> int:
    """Fill derivative k at the end of the step that is taken; return a code."""
    V.error[k] = math.inf
    if V.ready[k] < READY or V.words[CHANGES] > 0 or m.memory[FACTORED_STEP] != h:
        return 0
    e = one_side(V, m, k)
    extrapolate_beside(V, m, h, k)
    code = solve_beside(V, scene, m, t, h, k, e)
    if code != 0:
        return code
    keep_depths(V, scene, OWN)
    if V.words[REMEMBERED] > 0:
        keep_memory(V, scene, OWN)
        keep_change(V, k, e, OWN)
    sharpen(V, scene, m, h, k)
    if V.error[k] <= V.enough[0]:
        fit_step(V, m, h, k)
        V.smooth[k] = 1 if V.words[REMEMBERED] == 0 else 0
    return 0


@jitable
def note_along(V: Variations, h: float, k: int) -> None:
    """Keep what the next step needs of one along which D was integrated."""
    kept = V.carried[k]
    for i in range(kept.shape[1]):
        last = V.slope[k, i]
        kept[SLOPE, i] = (last - kept[DOT, i]) / h
        kept[DOT, i], kept[ALGORITHMIC, i] = last, last + SHIFT * h * kept[SLOPE, i]
        kept[BEND, i] = math.nan
    V.ready[k] = min(V.ready[k] + 1, READY)
