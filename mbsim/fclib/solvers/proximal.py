"""The proximal point method around Newton's (`semismooth`), compiled.

It solves problems with W + alpha w I and q - alpha w c (w the mean diagonal of W, c the centre),
whose solution is the next centre; alpha is only a path to the solution: the error is always that of
the problem itself.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from mbsim.core.jitable import jitable
from mbsim.fclib.blocks import mean_diagonals, product
from mbsim.fclib.clock import late
from mbsim.fclib.cone import (
    DECIDING,
    NO_SHARES,
    PUBLISHED,
    bring_into_cones,
    errors_at,
    is_better,
    norm,
    own_errors,
    relative_errors,
)
from mbsim.fclib.factor import factor_work
from mbsim.fclib.solvers.semismooth import (
    Jacobian,
    Point,
    direction,
    evaluate,
    line_search,
    no_jacobian,
    selected,
)
from mbsim.fclib.solvers.task import POLISHED, Goal, record

if TYPE_CHECKING:
    from mbsim.fclib.blocks import DelassusSystem
    from mbsim.fclib.problem import Vector

#: Newton iterations of one proximal step, and when a hopeless one is given up.
MOST, EARLY, HOPELESS = 15, 8, 0.3
#: Newton iterations of the step that makes a solution found a better one.
FINAL = 4
#: A Newton phase ends at this share of the goal, or where an iteration leaves more than a share of
#: the error.
WELL, GAIN = 0.01, 0.3
#: How many earlier norms the line search compares with.
MEMORY = 5
SMALLEST_ALPHA = 1e-12

# places in `state`, what a later call needs to go on
(
    ALPHA, FAILED_AT, SINCE, BEST, BEST_Q, STEPS, NEWTONS, ERROR, STALLED, WORK, SHARP, REACH,
    PHASE, PATIENCE,
) = range(14)  # fmt: skip
STATE = 14


class Workspace(NamedTuple):
    """Where Newton's method is and goes next, and room (m,) for what it needs on the way.

    `rho` (nc,); `recent` (MEMORY,): |F| of the last iterations.
    """

    point: Point
    trial: Point
    step: Vector
    rate: Vector
    room: Vector
    right: Vector
    rho: Vector
    recent: Vector


@jitable
def _newton_iterations(
    system: DelassusSystem,
    work: Workspace,
    jacobian: Jacobian,
    shift: float,
    aim: float,
    most: int,
    state: Vector,
    goal: Goal,
    fresh: bool,
) -> tuple[int, bool, Jacobian]:
    """Iterate at most `most` times from work.point until the error is at most `aim`.

    That error is of the proximal problem. `fresh`: there is no matrix yet. Returns the iterations,
    whether it was reached, and the matrix.
    """
    point, trial, step, rate, room, right, rho, recent = work
    size = evaluate(system, rho, point, room)
    begin = size
    recent[:] = size
    newtons = 0
    reached, misses = state[BEST], 0.0
    while newtons < most and not late(goal.until):
        jacobian, effort = selected(system, point.slip, jacobian, newtons > 0 or not fresh)
        state[WORK] += effort
        sound = direction(system, rho, shift, point, jacobian, right, step, rate, goal.until)
        newtons += 1
        state[WORK] += (
            factor_work(jacobian.flops, len(system.col))
            + 1e-9 * jacobian.analysis.factor_ptr[-1]
            + 1e-7 * len(rho)
        )
        if not sound:
            break
        if not math.isfinite(norm(rate)):
            break
        # |F| may rise above the last one but not above the last five
        highest = 0.0
        for k in range(MEMORY):
            highest = max(highest, recent[k])
        size = line_search(system, rho, point, step, rate, highest, trial, room)
        if size == np.inf:
            break
        point.r[:] = trial.r
        point.u[:] = trial.u
        point.slip[:] = trial.slip
        for k in range(MEMORY - 1):
            recent[k] = recent[k + 1]
        recent[MEMORY - 1] = size
        near = own_errors(system, point.u, point.r, NO_SHARES, room)[0]
        if near <= aim:
            return newtons, True, jacobian
        if state[PHASE] > 0.0:
            misses = misses + 1.0 if near > GAIN * reached else 0.0
            if misses > state[PATIENCE]:
                break
            reached = min(near, reached)
        if newtons >= EARLY and size > HOPELESS * begin:
            break
    return newtons, False, jacobian


@jitable
def keep_best(
    state: Vector, goal: Goal, error: float, error_q: float, trial: Vector, r: Vector
) -> None:
    """Take the trial impulses as the best iterate if they are, and count steps without gain."""
    if is_better(goal.tol, error, error_q, trial, state[BEST], state[BEST_Q], r):
        state[STALLED] = 0.0 if error < 0.9 * state[BEST] else state[STALLED] + 1.0
        state[BEST] = error
        state[BEST_Q] = error_q
        r[:] = trial
    else:
        state[STALLED] += 1.0


@jitable
def move_centre(
    state: Vector, centre: Vector, x: Vector, good: bool, newtons: int, error: float
) -> bool:
    """Move the centre to or beyond x, and change alpha; return whether to go on.

    `good`: the proximal problem was solved.
    """
    alpha, before = state[ALPHA], state[ERROR]
    if good:
        state[ERROR] = error
        state[SINCE] += 1
        for k in range(len(x)):
            centre[k] += state[REACH] * (x[k] - centre[k])
        lower = alpha * (0.3 if newtons <= 6 else 0.6)
        if state[SINCE] <= 3.0:
            lower = max(lower, 1.5 * state[FAILED_AT])
        if alpha > 0.0:
            state[ALPHA] = max(min(lower, alpha), SMALLEST_ALPHA)
        return True
    if alpha == 0.0 and state[STALLED] > MEMORY:
        return False  # Newton's method alone, and it fails
    state[FAILED_AT] = alpha
    state[SINCE] = 0.0
    state[ALPHA] = min(4.0 * alpha, 1e6)
    if error < before or alpha == 0.0:
        state[ERROR] = min(error, before)
        centre[:] = x
    return True


@jitable
def proximal_newton(
    system: DelassusSystem,
    r: Vector,
    centre: Vector,
    state: Vector,
    goal: Goal,
    limit: int,
    history: Vector,
) -> int:
    """Take proximal steps until the error is small enough or `limit` Newton iterations are spent.

    It ends with the iteration in which it gets late (`clock.until`).

    `r` holds the best iterate, in and out; `centre` and `state` what a later call goes on from (a
    first call has state[ALPHA] > 0, state[BEST] the error of r, and the centre at r).
    With the goal reached, one more step, of at most FINAL iterations, is taken to a tenth of it.
    With state[PHASE] it is one step of so many iterations at most, which ends when more than
    state[PATIENCE] of them in a row leave more than GAIN of the error, or at WELL times the goal.
    Returns the number of rows in `history` (Newton iterations so far, error, |F|/|q|).
    """
    tol, tol_q = goal.tol, goal.tol_q
    nc, m = len(system.mu), len(system.q)
    trace, mean = mean_diagonals(system)
    rows = 0
    if not mean > 0.0:
        return rows
    work = Workspace(
        Point(np.empty(m), np.empty(m), np.empty(nc)),
        Point(np.empty(m), np.empty(m), np.empty(nc)),
        np.empty(m), np.empty(m), np.empty(m), np.empty(m), np.empty(nc), np.empty(MEMORY),
    )  # fmt: skip
    x, trial, rho = work.point.r, work.trial.r, work.rho
    plain = np.empty(m)
    jacobian = no_jacobian(1 + len(system.tangent), nc)
    spent = 0
    finishing = False
    while (spent < limit or finishing) and not late(goal.until):
        shift = state[ALPHA] * mean
        for a in range(nc):
            rho[a] = state[SHARP] / (trace[a] + shift)
        x[:] = centre
        product(system, system.q, x, work.point.u)
        final = tol
        if state[BEST] > 0.0:
            final = min(tol, tol_q * state[BEST] / state[BEST_Q])
        aim, most = max(0.1 * min(state[ERROR], state[BEST]), 0.2 * final), MOST
        if finishing:
            # proximal terms hold back as much as they help, this near
            shift *= POLISHED
            aim *= 0.5 * POLISHED
            most = FINAL
        if state[PHASE] > 0.0:
            aim, most = WELL * final, int(state[PHASE])
        newtons, good, jacobian = _newton_iterations(
            system, work, jacobian, shift, aim, most, state, goal, spent == 0
        )
        spent += newtons
        state[NEWTONS] += newtons
        state[STEPS] += 1
        # the error of the problem itself
        bring_into_cones(system.tangent, system.rolling, system.mu, system.mu_r, x, trial)
        error, error_q = errors_at(system, trial, plain, DECIDING, work.room)
        rows = record(history, rows, state[NEWTONS], error, error_q)
        keep_best(state, goal, error, error_q, trial, r)
        if finishing or state[PHASE] > 0.0:
            break
        if error <= tol and error_q <= tol_q:
            # a weak contact that is good enough is no reason for more
            _, second = relative_errors(system, plain, trial, PUBLISHED, work.room)
            if second <= POLISHED * tol_q:
                break
            finishing = True
            centre[:] = x
        elif not move_centre(state, centre, x, good, newtons, error):
            break
    return rows
