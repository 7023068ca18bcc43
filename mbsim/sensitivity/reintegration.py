"""The last part of a stick before it slips, gone over again.

What sticks moves far slower than the tolerance of a run: speeds of a spring that is stretched by
1e-5 in 5 s are rounding to its error control, and shake. But when it slips by how fast it is
stretched and by how fast that changes with a parameter: dt*/dp = -(g_y D + g_p)/(g_y f). So y and D
are integrated again before that, as exactly as such speeds ask for, from so long before that what
shook has died away.

D is half of the difference of motions on both sides, taken with the same steps (internal numerical
differentiation, H. G. Bock, 1981). Friction keeps to its branch, and laws to what they remembered
at the begin, so that it is one step to them.
"""

from __future__ import annotations

import math

from mbsim.arrays.codes import SCALE_SPEED
from mbsim.arrays.scene import Scene
from mbsim.core.address import call_int, view
from mbsim.core.arrays import F1
from mbsim.core.jitable import jitable
from mbsim.dynamics.contact.forces import UNIT, contact_of
from mbsim.integrators.scheme import TOL, Method, in_workspace
from mbsim.laws.catalog import BRANCHES, LASTS, STICK
from mbsim.sensitivity.arrays import (
    AGAIN,
    BEFORE,
    COUNT,
    F_BEFORE,
    GONE_OVER,
    LINE_F,
    LINE_Y,
    LIST,
    STRAIGHT,
    SURE,
    TWIN,
    UP,
    Variations,
)
from mbsim.sensitivity.branches import branch_of
from mbsim.sensitivity.changes import crossing
from mbsim.sensitivity.tableaus import OF_FIFTH, A, C, E
from mbsim.sensitivity.twin import half_step, set_parameter

#: That is done where the tolerance is more than this part of how fast a spring is stretched, or
#: than the root of it.
SLOW = 1e-4
#: What the error of one step may be, over that speed: of the run, beside derivatives and alone, of
#: a derivative, over it; no less than these, which are rounding.
OF_RUN, ALONE, OF_DERIVATIVE = 5e-7, 5e-9, 5e-5
ROUNDING, ROUNDING_OF_DERIVATIVE = 4e-15, 1e-11
#: It begins so many radians of what swings on the spring back: with a fifth of the critical damping
#: e^-10 is left of that. No more than so many steps are tried, none shorter than this part.
RADIANS, MOST_TRIES, SHORTEST = 50.0, 2000, 1e-9
#: Parameters are changed until the slip is earlier and later by this part of a radian, or by so
#: many times as much as elsewhere: depths are rounded to 1e-12 of themselves, which moves slips by
#: 1e-4 of what the least changes do, and far off motions are no straight lines over a parameter.
SHIFTED, WIDEST = 3e-3, 30.0
#: In so few since it has stuck nothing has died away.
FEW = 10.0
#: What is shaken long before the end has died away there: an error may be e times as large so many
#: radians earlier, up to so many times.
FADES, MUCH = 8.0, 30.0
#: It is not the run's motion where it ends farther from it than so many tolerances.
ALIKE = 1e4
#: Rows of a motion in `Variations.again`: where it is, f there; of a step that is tried its end, f
#: there, its error, and BENT of it.
Y, F, END, F_END, OFF, OFF_BENT = range(6)
#: Where friction reaches its limit in a step the estimate of the error may vanish by chance: so
#: much of the third difference of slopes at 0, 3/10, 4/5 and 1 of it counts as an error as well.
BENT = 1e-3
STAGES = 7
#: Motions: the run, and with a parameter changed to either side.
RUN, MORE, LESS = range(3)
MOTIONS = 3


@jitable
def next_row(V: Variations, t: float, anew: bool) -> int:
    """Return the row for a point at time t, which is the last one from here on.

    Where there is none left it is that of a point that is missed the least: ages get longer and
    longer by about the same part.
    """
    rows, list = len(V.held_time), V.held[LIST:]
    count = 0 if anew else V.held[COUNT]
    if anew:
        V.held[SURE] = V.words[GONE_OVER]
    row = list[count] if count < rows else 0
    if count == rows:
        missed, at = math.inf, 1
        for i in range(1, rows - 1):
            before, behind = V.held_time[list[i - 1]], V.held_time[list[i + 1]]
            if (behind - before) / (t - before) < missed:
                missed, at = (behind - before) / (t - before), i
        row, count = list[at], rows - 1
        for i in range(at, rows - 1):
            list[i] = list[i + 1]
        list[count] = row
    V.held[COUNT] = count + 1
    return row


@jitable
def hold(V: Variations, scene: Scene, t: float, y: F1, anew: bool) -> None:
    """Keep the committed point, the only one if `anew`: motions go on from there.

    Behind a stretch that was gone over again the point is that of it, but for what begins anew.
    """
    if len(V.held_time) == 0:
        return
    row, count = next_row(V, t, anew), len(V.size)
    V.held_time[row] = t
    for i in range(len(y)):
        V.held_y[row, i] = y[i]
        if V.words[GONE_OVER] == 1 and y[i] == V.jump[BEFORE, i]:
            V.held_y[row, i] = V.jump[LINE_Y, i]
        for k in range(count):
            V.held_d[row, k, i] = V.d[k, i]
    for s in range(V.memory.shape[1]):
        for j in range(V.memory.shape[2]):
            V.held_memory[row, s, j] = scene.state.memory[s, j]
            for k in range(count):
                V.held_moves[row * count + k, s, j] = V.memory[k, s, j]


@jitable
def slowest(V: Variations, scene: Scene) -> float:
    """Return how fast a spring of friction that slips at the end of the step is stretched.

    In usual speeds, that of the slowest; infinite where none slips.
    """
    least = math.inf
    for j in range(V.asks[len(V.asks) - 1]):
        s, rate = V.asks[j], 0.0
        springs = scene.contacts.carried[contact_of(scene, s)]
        for i in range(springs):
            rate = max(rate, abs(V.jump[F_BEFORE, scene.slots.z[s] + i]))
        if V.mode[s] % BRANCHES == STICK and springs > 0:
            least = min(least, rate / scene.world.scale[SCALE_SPEED])
    return least


@jitable
def side_of(V: Variations, k: int, j: int) -> float:
    """Return by how much parameter k is changed in motion j: the run, and one to either side."""
    return 0.0 if j == RUN else V.wide[k] if j == MORE else -V.wide[k]


@jitable
def slope_of(V: Variations, scene: Scene, t: float, k: int, j: int, y: F1, f: F1) -> int:
    """Fill f at a point of motion j for parameter k; return a code."""
    set_parameter(V, view(V.words[TWIN], Scene), scene, max(k, 0), side_of(V, k, j))
    p, begin = in_workspace(V.words[UP])[0], V.held_time[V.words[AGAIN] - 1]
    return call_int(p.rhs, (p.context, t, t - begin, y, f))


@jitable
def start(V: Variations, scene: Scene, row: int, k: int) -> int:
    """Put both sides at a kept point, or the run with k < 0; return a code."""
    V.words[AGAIN], code = row + 1, 0
    for j in range(RUN if k < 0 else MORE, MORE if k < 0 else MOTIONS):
        y, e = V.again[j, Y], side_of(V, k, j)
        for i in range(len(y)):
            y[i] = V.held_y[row, i] + (e * V.held_d[row, k, i] if j != RUN else 0.0)
        code = code or slope_of(V, scene, V.held_time[row], k, j, y, V.again[j, F])
    return code


@jitable
def try_step(V: Variations, scene: Scene, t: float, h: float, k: int, j: int) -> float:
    """Try a step of motion j; return its error in usual sizes, infinite where it cannot be."""
    w, m = V.slopes, V.again[j]
    for i in range(m.shape[1]):
        w[0, i] = m[F, i]
    for stage in range(1, STAGES):
        for i in range(m.shape[1]):
            rise = 0.0
            for before in range(stage):
                rise += A[OF_FIFTH, stage, before] * w[before, i]
            m[END, i] = m[Y, i] + h * rise
        at = t + C[OF_FIFTH, stage] * h
        if slope_of(V, scene, at, k, j, m[END], w[stage]) != 0:
            return math.inf
    error = 0.0
    for i in range(m.shape[1]):
        m[F_END, i], m[OFF, i] = w[STAGES - 1, i], 0.0
        for stage in range(STAGES):
            m[OFF, i] += h * E[OF_FIFTH, stage] * w[stage, i]
        bend = 200.0 * w[2, i] - 262.5 * w[3, i] + 150.0 * w[6, i] - 87.5 * w[0, i]
        m[OFF_BENT, i] = BENT * h / 21.0 * bend
        error = max(error, abs(m[OFF, i]) / V.scale[i], abs(m[OFF_BENT, i]) / V.scale[i])
        if not math.isfinite(m[END, i]):
            return math.inf
    return error


@jitable
def error_of(V: Variations, k: int) -> float:
    """Return the error of the step of derivative k that was tried, over it."""
    up, down, error, whole = V.again[MORE], V.again[LESS], 0.0, 1.0 / V.size[k]
    part = 0.5 / V.wide[k]
    for i in range(up.shape[1]):
        off = max(abs(up[OFF, i] - down[OFF, i]), abs(up[OFF_BENT, i] - down[OFF_BENT, i]))
        error = max(error, part * off / V.scale[i])
        whole = max(whole, part * abs(up[END, i] - down[END, i]) / V.scale[i])
    return error / whole


@jitable
def try_all(
    V: Variations, scene: Scene, t: float, h: float, k: int, most: float, exact: float
) -> float:
    """Try a step of both sides, or the run with k < 0; return its error over what it may be.

    That is `most` for motions and `exact` for the derivative; the other side is not tried where the
    first one has failed.
    """
    error = try_step(V, scene, t, h, k, RUN if k < 0 else MORE) / most
    if k < 0 or error > 1.0:
        return error
    if not try_step(V, scene, t, h, k, LESS) < math.inf:
        return math.inf
    return max(error, error_of(V, k) / exact)


@jitable
def take(V: Variations, k: int) -> None:
    """Let both sides, or the run with k < 0, be at the end of the step that was tried."""
    for j in range(RUN if k < 0 else MORE, MORE if k < 0 else MOTIONS):
        for i in range(V.again.shape[2]):
            V.again[j, Y, i], V.again[j, F, i] = V.again[j, END, i], V.again[j, F_END, i]


@jitable
def part_of(error: float) -> float:
    """Return how long the next step is over one with such an error."""
    return min(3.0, max(0.02, 0.9 * max(error, 1e-300) ** -0.2))


@jitable
def begin_at(V: Variations, scene: Scene, t: float) -> tuple[int, float]:
    """Return from which kept point on it is gone over again, -1: none; and the first step.

    That is how long a radian takes what swings on the softest spring that slips.
    """
    slowest = math.inf
    for j in range(V.asks[len(V.asks) - 1]):
        slowest = min(slowest, scene.work.slot[V.asks[j], UNIT] / LASTS)
    row, long, count = -1, 0.0, V.held[COUNT]
    for back in range(1, count + 1):
        row = V.held[LIST + count - back]
        long = t - V.held_time[row]
        if long * slowest >= RADIANS:
            break
    if not 0.0 < slowest < math.inf:
        return -1, 0.0
    least = 0.0 if V.held[SURE] == 1 else FEW / slowest
    return row if long > least else -1, 1.0 / slowest


@jitable
def reintegrate(
    V: Variations,
    scene: Scene,
    t: float,
    most: float,
    exact: float,
    row: int,
    first: float,
    k: int,
) -> bool:
    """Integrate both sides of parameter k, or the run with k < 0, from a kept point to time t."""
    now, h, least = V.held_time[row], first, SHORTEST * (t - V.held_time[row])
    if start(V, scene, row, k) != 0:
        return False
    for _ in range(MOST_TRIES):
        if now >= t:
            break
        last = now + 1.0001 * h >= t
        h = t - now if last else h
        faded = min(MUCH, math.exp(min((t - now) / (FADES * first), 50.0)))
        error = try_all(V, scene, now, h, k, faded * most, faded * exact)
        if error <= 1.0:
            take(V, k)
            now = t if last else now + h
        h *= part_of(error)
        if not h > least:
            return False
    return now >= t


@jitable
def go_on(V: Variations, scene: Scene, t: float, late: float, k: int) -> None:
    """Let both sides, or the run with k < 0, go on for a little while, or back."""
    if late != 0.0 and try_all(V, scene, t, late, k, math.inf, math.inf) < math.inf:
        take(V, k)


@jitable
def slips_later(V: Variations, scene: Scene, t: float, k: int, e: float) -> float:
    """Return how much later than at t it slips with parameter k changed by e, NaN if unknown.

    Along the straight line through what was gone over.
    """
    H, again = V.line[0], V.words[AGAIN]
    V.words[AGAIN], V.words[STRAIGHT] = 0, 1
    late = H * (crossing(V, scene, t - H, H, k, e, branch_of(V.asks[0]), 1.0) - 1.0)
    V.words[AGAIN], V.words[STRAIGHT] = again, 0
    return late


@jitable
def wide_step(V: Variations, scene: Scene, t: float, radian: float, k: int) -> float:
    """Return by how much parameter k is changed in motions that are gone over."""
    e = half_step(V, k)
    apart = abs(slips_later(V, scene, t, k, e) - slips_later(V, scene, t, k, -e))
    if not apart < math.inf:
        return e
    return e * min(max(1.0, 2.0 * SHIFTED * radian / max(apart, 1e-300)), WIDEST)


@jitable
def keep_run(V: Variations) -> None:
    """Leave where and how fast the run is."""
    for i in range(V.again.shape[2]):
        V.jump[LINE_Y, i], V.jump[LINE_F, i] = V.again[RUN, Y, i], V.again[RUN, F, i]


@jitable
def is_alike(V: Variations, m: Method) -> bool:
    """Return whether what was gone over again is the run's motion."""
    off = 0.0
    for i in range(len(m.y)):
        off = max(off, abs(V.again[RUN, Y, i] - V.jump[BEFORE, i]) / V.scale[i])
    return off <= ALIKE * m.memory[TOL]


@jitable
def go_over(V: Variations, scene: Scene, m: Method, t: float, rate: float) -> None:
    """Improve derivatives at the end of the step, and fill where and how fast the run is there.

    That is where what was gone over slips, which is a little earlier or later than the run has it.
    `rate` is that of `slowest`. The run is gone over alone first: no parameter depends on another.
    """
    most, alone = max(OF_RUN * rate, ROUNDING), max(ALONE * rate, ROUNDING)
    exact = max(OF_DERIVATIVE * rate, ROUNDING_OF_DERIVATIVE)
    row, h = begin_at(V, scene, t)
    if row >= 0 and reintegrate(V, scene, t, alone, 1.0, row, h, -1) and is_alike(V, m):
        keep_run(V)
        V.words[GONE_OVER], late = 1, slips_later(V, scene, t, 0, 0.0)
        late = late if abs(late) < math.inf else 0.0
        go_on(V, scene, t, late, -1)
        keep_run(V)
        for k in range(len(V.size)):
            V.wide[k] = wide_step(V, scene, t + late, h, k)
            if V.lost[k] == math.inf and reintegrate(V, scene, t, most, exact, row, h, k):
                go_on(V, scene, t, late, k)
                for i in range(len(m.y)):
                    change = V.again[MORE, Y, i] - V.again[LESS, Y, i]
                    V.next[k, i] = 0.5 / V.wide[k] * change
    V.words[AGAIN] = 0


@jitable
def make_sure(V: Variations, scene: Scene, m: Method, t: float, switched: bool) -> None:
    """Go over the end of a stick again where a speed is not known with the run's tolerance."""
    V.words[GONE_OVER], tol = 0, m.memory[TOL]
    rate = slowest(V, scene) if switched else math.inf
    if rate * min(SLOW, math.sqrt(tol)) < tol:
        go_over(V, scene, m, t, rate)
