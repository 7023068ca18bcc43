"""The derivative of a step of RADAU5: the stages' equations linearised, by the step's own factors.

The stages D + z_j of a derivative obey z = h A F, F_j = f_y (D + z_j) + f_p at stage j (staggered
direct method). F is a difference of the equations; the iteration with the linearisation of the
step, which need not be exact, ends where it changes nothing any more.
Source: T. Maly, L. R. Petzold, Appl. Numer. Math. 20 (1996) 57; E. Hairer, G. Wanner, Solving ODEs
II (1996), section IV.8.
"""

from __future__ import annotations

import math

from mbsim.arrays.scene import Scene
from mbsim.core.address import call_int, view
from mbsim.core.codes import Code
from mbsim.core.jitable import jitable
from mbsim.core.problem import Problem
from mbsim.integrators.positions import put_along
from mbsim.integrators.radau5 import G0, G_IM, G_RE, TI, C, T
from mbsim.integrators.radau5 import E as ERROR
from mbsim.integrators.radau5 import Z as STAGES_AT
from mbsim.integrators.scheme import LAST_STEP, Method, in_workspace
from mbsim.sensitivity.arrays import (
    COLLIDES,
    CORNERS,
    DOWN_SIDE,
    JOINTS,
    LEFT,
    LINEARISED,
    OWN,
    PLAIN,
    REMEMBERED,
    TWIN,
    UP,
    UP_SIDE,
    Variations,
)
from mbsim.sensitivity.linearised import begin_step, linearise, take_systems
from mbsim.sensitivity.predictor import goes_on, note_bend, predict
from mbsim.sensitivity.twin import (
    half_step,
    keep_change,
    keep_depths,
    keep_memory,
    keep_side,
    keep_unit,
    one_side,
    set_parameter,
)

#: Rows of `Variations.stage`: stages less D, F, the right-hand sides and solutions of both systems,
#: a point and f there, stages before a correction.
Z, F, REAL, REAL_D, PAIR, PAIR_D, POINT, SLOPE = 0, 3, 6, 7, 8, 10, 12, 13
KEPT = 14
STAGES = 17
#: The stage at which the twin is linearised.
MIDDLE = 1
#: By how much the error of order 3 overrates that of the step.
OVERRATED, ORDER = 100.0, 4.0
#: What an iteration may leave is less by this while bodies collide: forces turn what is left of
#: places into speeds. That is while a depth changes by more than such a part of it.
IN_IMPACT, COLLIDING = 0.02, 1e-6
#: Where a correction is more than POOR of that before, the twin is linearised in the step itself.
#: The iteration fails after so many, and where a correction is more than SLOW of that before even
#: then: the linearisation is that of other forces.
POOR, MOST, SLOW = 0.03, 12, 0.5
#: How fast corrections get smaller is trusted less from step to step while one is all there is
#: (Hairer and Wanner, section IV.8), the less where friction remembers, whose forces bend, and far
#: less where the first one is so many times that of the step before; what it is with another
#: linearisation is not known.
FORGET, FORGET_OF_MEMORY, LEAST_RATE, UNKNOWN = 0.9, 0.8, 1e-6, 0.1
FORGET_AT_ONCE, SURPRISING = 0.5, 10.0
#: Corrections that get no smaller are rounding where they are less than so much of y in sides of a
#: difference.
ROUNDING = 4e-15


@jitable
def point_beside(V: Variations, m: Method, k: int, j: int, e: float) -> None:
    """Write stage j moved by e along its derivative."""
    x, z = V.stage[POINT], V.stage[Z + j]
    for i in range(len(m.y)):
        x[i] = m.y[i] + m.k[STAGES_AT + j, i] + e * (V.d[k, i] + z[i])


@jitable
def depths_change(V: Variations) -> bool:
    """Return whether contacts get deeper or less deep from stage to stage, whose depths are kept.

    At the deepest point of an impact two of them may be alike.
    """
    for s in range(V.depth.shape[1]):
        first, middle, last = V.depth[DOWN_SIDE, s], V.depth[UP_SIDE, s], V.depth[OWN, s]
        most = max(first, middle, last)
        if most - min(first, middle, last) > COLLIDING * most:
            return True
    return False


@jitable
def evaluate_plain(V: Variations, scene: Scene, m: Method, t: float, h: float) -> int:
    """Fill f of the run itself at all stages, once for all parameters; return a code.

    There the twin is linearised where the run's linearisation was too old in the last step for a
    parameter.
    """
    twin, x = view(V.words[TWIN], Scene), V.stage[POINT]
    p = in_workspace(V.words[UP])[0]
    own = begin_step(V, m, t)
    set_parameter(V, twin, scene, 0, 0.0)
    for j in range(3):
        for i in range(len(m.y)):
            x[i] = m.y[i] + m.k[STAGES_AT + j, i]
        code = call_int(p.rhs, (p.context, t + C[j] * h, C[j] * h, x, V.plain[j]))
        if code == 0 and j == MIDDLE and own:
            code = linearise(V, t, h, C[j] * h, x, V.plain[j], V.stage[REAL])
        if code != 0:
            return code
        keep_depths(V, twin, DOWN_SIDE if j == 0 else UP_SIDE if j == 1 else OWN)
    V.words[COLLIDES] = 1 if depths_change(V) else 0
    keep_memory(V, twin, OWN)
    V.words[PLAIN] = 1
    return 0


@jitable
def linearise_anew(V: Variations, scene: Scene, m: Method, t: float, h: float) -> int:
    """Linearise the twin at the stage in the middle; return a code."""
    x, late = V.stage[POINT], C[MIDDLE] * h
    p = in_workspace(V.words[UP])[0]
    set_parameter(V, view(V.words[TWIN], Scene), scene, 0, 0.0)
    for i in range(len(m.y)):
        x[i] = m.y[i] + m.k[STAGES_AT + MIDDLE, i]
    code = call_int(p.rhs, (p.context, t + late, late, x, V.stage[SLOPE]))
    return code or linearise(V, t, h, late, x, V.stage[SLOPE], V.stage[REAL])


@jitable
def evaluate_stages(
    V: Variations, scene: Scene, m: Method, t: float, h: float, k: int, e: float
) -> int:
    """Fill F at all stages, as differences by e from the run itself; return a code."""
    twin = view(V.words[TWIN], Scene)
    p = in_workspace(V.words[UP])[0]
    set_parameter(V, twin, scene, k, e)
    for j in range(3):
        point_beside(V, m, k, j, e)
        f = V.stage[SLOPE]
        code = call_int(p.rhs, (p.context, t + C[j] * h, C[j] * h, V.stage[POINT], f))
        if code != 0:
            return code
        for i in range(len(m.y)):
            V.stage[F + j, i] = (f[i] - V.plain[j, i]) / e
    keep_depths(V, twin, UP_SIDE)
    if V.words[REMEMBERED] > 0:
        keep_side(V, twin, scene, UP_SIDE)
    return 0


@jitable
def correct(V: Variations, p: Problem, m: Method, t: float, h: float, k: int) -> int:
    """Correct the stages once, and keep what they were; return a code."""
    n, z, f = len(m.y), V.stage[Z : Z + 3], V.stage[F : F + 3]
    g, re, im = G0 / h, G_RE / h, G_IM / h
    real, pair = V.stage[REAL], V.stage[PAIR : PAIR + 2]
    d, dd = V.stage[REAL_D], V.stage[PAIR_D : PAIR_D + 2]
    for i in range(n):
        f0, f1, f2 = f[0, i], f[1, i], f[2, i]
        w0 = TI[0, 0] * z[0, i] + TI[0, 1] * z[1, i] + TI[0, 2] * z[2, i]
        w1 = TI[1, 0] * z[0, i] + TI[1, 1] * z[1, i] + TI[1, 2] * z[2, i]
        w2 = TI[2, 0] * z[0, i] + TI[2, 1] * z[1, i] + TI[2, 2] * z[2, i]
        real[i] = TI[0, 0] * f0 + TI[0, 1] * f1 + TI[0, 2] * f2 - g * w0
        pair[0, i] = TI[1, 0] * f0 + TI[1, 1] * f1 + TI[1, 2] * f2 - (re * w1 - im * w2)
        pair[1, i] = TI[2, 0] * f0 + TI[2, 1] * f1 + TI[2, 2] * f2 - (re * w2 + im * w1)
    if V.words[JOINTS] == 1:
        for r in (real, pair[0], pair[1]):
            put_along(p, m, t, m.y, r, V.stage[POINT])
    code = call_int(p.solve, (p.context, t, h, real, d))
    if code == 0:
        code = call_int(p.solve_pair, (p.context, t, h, pair, dd))
    for j in range(3):
        for i in range(n):
            V.stage[KEPT + j, i] = z[j, i]
            z[j, i] += T[j, 0] * d[i] + T[j, 1] * dd[0, i] + T[j, 2] * dd[1, i]
    return code


@jitable
def moved(V: Variations, k: int) -> tuple[float, float]:
    """Return by how much a correction has moved the stages, and the size of what they lead to."""
    size, whole = 0.0, 1.0 / V.size[k]
    for j in range(3):
        for i in range(len(V.scale)):
            z = V.stage[Z + j, i]
            size = max(size, abs(z - V.stage[KEPT + j, i]) / V.scale[i])
            whole = max(whole, abs(V.d[k, i] + z) / V.scale[i])
    return size, whole


@jitable
def project_stages(V: Variations, scene: Scene, m: Method, t: float, h: float, k: int) -> int:
    """Put the derivatives of all stages along what holds; return a code."""
    twin, n, e = view(V.words[TWIN], Scene), len(m.y), half_step(V, k)
    p = in_workspace(V.words[UP])[0]
    part, x = 0.5 / e, V.stage[POINT]
    for side in range(2):
        sign = 1.0 if side == 0 else -1.0
        set_parameter(V, twin, scene, k, sign * e)
        for j in range(3):
            point_beside(V, m, k, j, sign * e)
            code = call_int(p.project, (p.context, t + C[j] * h, C[j] * h, x, x))
            if code != 0:
                return code
            way = V.stage[F + j]
            for i in range(n):
                way[i] = part * x[i] if side == 0 else way[i] - part * x[i]
    for j in range(3):
        for i in range(n):
            V.stage[Z + j, i] = V.stage[F + j, i] - V.d[k, i]
    return 0


@jitable
def stay_unit(V: Variations, m: Method, k: int, bodies: int) -> None:
    """Let all stages lead to derivatives of quaternions of unit length, as the run's stages are."""
    x, d, n = V.stage[POINT], V.stage[SLOPE], len(m.y)
    for j in range(3):
        for i in range(n):
            x[i], d[i] = m.y[i] + m.k[STAGES_AT + j, i], V.d[k, i] + V.stage[Z + j, i]
        keep_unit(d, x, bodies)
        for i in range(n):
            V.stage[Z + j, i] = d[i] - V.d[k, i]


@jitable
def correct_once(
    V: Variations, scene: Scene, m: Method, t: float, h: float, k: int, e: float
) -> int:
    """Evaluate and correct the stages once, along what holds; return a code."""
    code = evaluate_stages(V, scene, m, t, h, k, e)
    code = code or correct(V, in_workspace(V.words[UP])[0], m, t, h, k)
    if code == 0 and V.words[JOINTS] == 1:
        code = project_stages(V, scene, m, t, h, k)
    elif code == 0:
        stay_unit(V, m, k, len(scene.bodies.mass))
    return code


@jitable
def solve_stages(
    V: Variations, scene: Scene, m: Method, t: float, h: float, k: int, e: float
) -> int:
    """Solve for the stages of derivative k; return a code."""
    before, largest = math.inf, 1.0
    for i in range(len(m.y)):
        largest = max(largest, abs(m.y[i]) / V.scale[i])
    rate = V.rate[k] ** (FORGET if V.words[REMEMBERED] == 0 else FORGET_OF_MEMORY)
    rounding, left = ROUNDING / abs(e) * largest, V.enough[LEFT]
    if V.words[COLLIDES] == 1 and V.words[REMEMBERED] == 0:
        left *= IN_IMPACT
    for _ in range(MOST):
        code = correct_once(V, scene, m, t, h, k, e)
        if code != 0:
            return code
        size, whole = moved(V, k)
        if not size < math.inf:
            break
        if before == math.inf:
            if size > SURPRISING * V.moved[k] * whole:
                rate = rate**FORGET_AT_ONCE
            V.moved[k] = size / whole
        else:
            now = min(size / before, 0.99) if before > 0.0 else 0.0
            # of what is rounded no rate is known but that it is no larger
            rate = now if size > rounding else min(now, rate)
        slow = size > SLOW * before
        if rate / (1.0 - rate) * size <= left * whole or (slow and size <= rounding):
            V.rate[k] = max(rate, LEAST_RATE)
            return 0
        if size > POOR * before and V.stale[k] == 0:
            V.stale[k] = 1
            code = 0 if V.words[LINEARISED] == 1 else linearise_anew(V, scene, m, t, h)
            if code != 0:
                return code
            take_systems(V, k)
            before, rate = math.inf, UNKNOWN
            continue
        if slow:
            break
        before = size
    return Code.NOT_CONVERGED


@jitable
def implicit_step(V: Variations, scene: Scene, m: Method, t: float, h: float, k: int) -> int:
    """Fill derivative k at the end of the step that is taken; return a code."""
    e = one_side(V, m, k)
    code = 0 if V.words[PLAIN] == 1 else evaluate_plain(V, scene, m, t, h)
    if code != 0:
        return code
    take_systems(V, k)
    predict(V, m, h, k, V.stage[Z : Z + 3])
    code = solve_stages(V, scene, m, t, h, k, e)
    if code != 0:
        return code
    code = estimate_error(V, scene, m, t, h, k, e)
    note_bend(V, m, h, k, V.stage[Z + 2])
    keep_polynomial(V, m, k)
    V.smooth[k], V.told[k] = 1, 0
    if code == 0 and V.words[REMEMBERED] > 0:
        keep_change(V, k, e, OWN)
    return code


@jitable
def overrated(V: Variations, m: Method, h: float, k: int, error: float) -> float:
    """Return how many times the estimate of an error of order 3 is that of the step.

    None where it has grown by far more than the step: there f bends, and the step is off by as
    much.
    """
    before, V.shown_error[k] = V.shown_error[k], error
    if V.words[CORNERS] == 0 or V.smooth[k] == 0 or before == 0.0 or not goes_on(m, h):
        return OVERRATED
    told = before * max(1.0, h / m.memory[LAST_STEP]) ** ORDER
    return OVERRATED if error <= SURPRISING * told else 1.0


@jitable
def estimate_error(
    V: Variations, scene: Scene, m: Method, t: float, h: float, k: int, e: float
) -> int:
    """Leave the filtered error of the step of a derivative, over that; return a code.

    It is the method's own, of order 3: far larger than what the step is off by.
    """
    p, twin = in_workspace(V.words[UP])[0], view(V.words[TWIN], Scene)
    r, x, f, apart = V.stage[REAL], V.stage[POINT], V.stage[SLOPE], 0.0
    for i in range(len(m.y)):
        r[i] = 0.0
        for j in range(3):
            r[i] += ERROR[j] * V.stage[Z + j, i] / h
    if goes_on(m, h) and V.smooth[k] == 1:
        # the last stage is the end of the step before
        for i in range(len(m.y)):
            r[i] += (V.dense[k, 1, i] - V.dense[k, 2, i] - V.dense[k, 3, i]) / m.memory[LAST_STEP]
    else:
        set_parameter(V, twin, scene, k, e)
        for i in range(len(m.y)):
            x[i] = m.y[i] + e * V.d[k, i]
        code = call_int(p.rhs, (p.context, t, 0.0, x, f))
        if code != 0:
            return code
        for i in range(len(m.y)):
            first = (f[i] - m.k[0, i]) / e
            r[i] += first
            if V.told[k] == 1:
                # f may bend between both sides of a difference
                apart = max(apart, abs(first - V.slope[k, i]) / V.felt[i])
    if V.words[JOINTS] == 1:
        put_along(p, m, t, m.y, r, x)
    code = call_int(p.solve, (p.context, t, h, r, V.stage[REAL_D]))
    error, whole = 0.0, 1.0 / V.size[k]
    for i in range(len(m.y)):
        end = V.d[k, i] + V.stage[Z + 2, i]
        error = max(error, abs(V.stage[REAL_D, i]) / V.felt[i])
        whole = max(whole, abs(end) / V.felt[i], abs(V.d[k, i]) / V.felt[i])
    V.error[k] = max(error / overrated(V, m, h, k, error / whole), h * apart) / whole
    return code


@jitable
def keep_polynomial(V: Variations, m: Method, k: int) -> None:
    """Leave the end of the step, and the polynomial through its stages."""
    c0, c1, z = C[0], C[1], V.stage
    for i in range(len(m.y)):
        rise = z[Z + 2, i]
        first = (z[Z, i] / c0 - rise) / (1.0 - c0)
        second = (z[Z + 1, i] / c1 - rise) / (1.0 - c1)
        bend = (second - first) / (c1 - c0)
        V.dense[k, 0, i] = V.d[k, i]
        V.dense[k, 1, i] = rise
        V.dense[k, 2, i] = first - c0 * bend
        V.dense[k, 3, i] = bend
        V.next[k, i] = V.d[k, i] + rise
