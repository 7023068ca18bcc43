"""Explicit Runge-Kutta of order 5 with an error of order 4 and dense output of order 4.

Source: J. R. Dormand, P. J. Prince, J. Comput. Appl. Math. 6 (1980) 19; dense output after
E. Hairer, S. P. Norsett, G. Wanner, Solving ODEs I (1993), section II.5-6.
The seventh stage is the first of the next step; it is taken at the projected point, so
that stays true with constraints.
"""

from __future__ import annotations

from mbsim.core.address import call_float, call_int
from mbsim.core.arrays import Pointer
from mbsim.core.jitable import jitable
from mbsim.core.problem import RATES, STATE, Problem
from mbsim.integrators.positions import has_positions
from mbsim.integrators.scheme import (
    EVALUATIONS,
    KEEPS_TO_BOUND,
    LAST_ERROR,
    STIFFNESS,
    WATCH,
    Method,
    Scheme,
    in_workspace,
    project,
)
from mbsim.integrators.stability import (
    DIFFERENCES,
    allowed,
    clear_differences,
    note_difference,
    rate_between,
)

C2, C3, C4, C5 = 1 / 5, 3 / 10, 4 / 5, 8 / 9
A21 = 1 / 5
A31, A32 = 3 / 40, 9 / 40
A41, A42, A43 = 44 / 45, -56 / 15, 32 / 9
A51, A52, A53, A54 = 19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729
A61, A62, A63, A64, A65 = 9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656
B1, B3, B4, B5, B6 = 35 / 384, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84
# fifth minus fourth order weights
E1, E3, E4, E5, E6, E7 = (
    71 / 57600,
    -71 / 16695,
    71 / 1920,
    -17253 / 339200,
    22 / 525,
    -1 / 40,
)
D1, D3, D4 = -12715105075 / 11282082432, 87487479700 / 32700410799, -10690763975 / 1880347072
D5, D6, D7 = 701980252875 / 199316789632, -1453857185 / 822651844, 69997945 / 29380423


@jitable
def attempt(p: Problem, m: Method, t: float, h: float) -> int:
    """Fill stages 2..7, trial point and error; return a code.

    The trial point is projected before stage 7, which makes it the next step's stage 1.
    """
    y, k, w = m.y, m.k, m.trial
    n = len(y)
    m.counts[EVALUATIONS] += 6
    for i in range(n):
        w[i] = y[i] + h * (A21 * k[0, i])
    code = call_int(p.rhs, (p.context, t + C2 * h, C2 * h, w, k[1]))
    if code != 0:
        return code
    for i in range(n):
        w[i] = y[i] + h * (A31 * k[0, i] + A32 * k[1, i])
    code = call_int(p.rhs, (p.context, t + C3 * h, C3 * h, w, k[2]))
    if code != 0:
        return code
    for i in range(n):
        w[i] = y[i] + h * (A41 * k[0, i] + A42 * k[1, i] + A43 * k[2, i])
    code = call_int(p.rhs, (p.context, t + C4 * h, C4 * h, w, k[3]))
    if code != 0:
        return code
    for i in range(n):
        w[i] = y[i] + h * (A51 * k[0, i] + A52 * k[1, i] + A53 * k[2, i] + A54 * k[3, i])
    code = call_int(p.rhs, (p.context, t + C5 * h, C5 * h, w, k[4]))
    if code != 0:
        return code
    for i in range(n):
        w[i] = y[i] + h * (
            A61 * k[0, i] + A62 * k[1, i] + A63 * k[2, i] + A64 * k[3, i] + A65 * k[4, i]
        )
    code = call_int(p.rhs, (p.context, t + h, h, w, k[5]))
    if code != 0:
        return code
    for i in range(n):
        w[i] = y[i] + h * (B1 * k[0, i] + B3 * k[2, i] + B4 * k[3, i] + B5 * k[4, i] + B6 * k[5, i])
    project(p, m, t + h, h, w)
    code = call_int(p.rhs, (p.context, t + h, h, w, k[6]))
    if code != 0:
        return code
    for i in range(n):
        m.error[i] = h * (
            E1 * k[0, i] + E3 * k[2, i] + E4 * k[3, i] + E5 * k[4, i] + E6 * k[5, i] + E7 * k[6, i]
        )
    m.memory[LAST_ERROR] = call_float(p.norm, (p.context, t, h, m.error, w)) / allowed(m)
    if m.memory[WATCH] == 1.0 or m.memory[KEEPS_TO_BOUND] == 1.0:
        m.memory[STIFFNESS] = stiffness(p, m, t, h)
    return 0


@jitable
def fill_differences(m: Method, h: float) -> None:
    """Write what `stiffness` is told by behind the stages.

    Shifts, changes of velocity and of f of two pairs of stages, and the change of f over the step.
    """
    k, d, n = m.k, m.k[DIFFERENCES:], len(m.y)
    first = not has_positions(m)
    clear_differences(m, d)
    for i in range(n):
        if m.kinds[i] == STATE and not first:
            continue
        shift = (B1 - A61) * k[0, i] + (B3 - A63) * k[2, i] + (B4 - A64) * k[3, i]
        shift += (B5 - A65) * k[4, i] + B6 * k[5, i] - A62 * k[1, i]
        come = (A61 - A51) * k[0, i] + (A62 - A52) * k[1, i] + (A63 - A53) * k[2, i]
        come += (A64 - A54) * k[3, i] + A65 * k[4, i]
        note_difference(m, d, i, h * shift, h * come, 6)


@jitable
def stiffness(p: Problem, m: Method, t: float, h: float) -> float:
    """Return the step times the rate of f between its last stages, inf where that is hidden.

    Of bodies alone, where there are some: what is summed up beside them has other units. The
    larger one of two pairs of stages: a vibration that goes through its middle between the one does
    not between the other. So 0.6 to 1 of the rate of a vibration or a damper is found: at the bound
    of stability, at 3.3 of a damper, some 2.

    The last two stages are at the same time. Where f between them differs by HIDES times what it
    changes over the step, the stages fly about a motion that does not need such short steps. A
    force that is bounded, as friction, does so at its bounds, where the rate between the stages
    says nothing of the rate at the motion. For f = -r y the two are as much apart at h r = 2,
    near the bound of stability at 3.3. An error that is far below what is allowed bounds no step.
    """
    fill_differences(m, h)
    return rate_between(p, m, t, h, m.k[DIFFERENCES:])


@jitable
def fit_dense(m: Method, h: float) -> None:
    """Fill the polynomial of the step from y to trial; all stages are there."""
    k, d = m.k, m.dense
    for i in range(len(m.y)):
        rise = m.trial[i] - m.y[i]
        bend = h * k[0, i] - rise
        d[0, i] = m.y[i]
        d[1, i] = rise
        d[2, i] = bend
        d[3, i] = rise - h * k[6, i] - bend
        d[4, i] = h * (
            D1 * k[0, i] + D3 * k[2, i] + D4 * k[3, i] + D5 * k[4, i] + D6 * k[5, i] + D7 * k[6, i]
        )


def _attempt(context: int, t: float, h: float, a: Pointer, b: Pointer) -> int:
    """One step, tried."""
    problem, method = in_workspace(context)
    return attempt(problem, method, t, h)


def _fit_dense(context: int, t: float, h: float, a: Pointer, b: Pointer) -> int:
    """Dense output of the step tried last."""
    _, method = in_workspace(context)
    fit_dense(method, h)
    return 0


SCHEME = Scheme(
    _attempt,
    _fit_dense,
    stages=7,
    last=6,
    dense=5,
    order=5.0,
    memory=0.4,
    watched=DIFFERENCES + RATES,
)
