"""The proximal point method around Newton's (`newton`), in the bodies' velocities, compiled.

Each step solves the problem with W + s_i I and w - s_i c, s_i = alpha / rho_i; its solution moves
the centre c (`solvers.proximal`, the same in the contacts' impulses). The errors are always those
of the problem itself.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from mbsim.core.jitable import jitable
from mbsim.fclib.bodies.factors import BodyMatrix, closed_matrix, newton_work, work_of
from mbsim.fclib.bodies.newton import direction_of_bodies, function_of_bodies, linearise
from mbsim.fclib.bodies.system import (
    SIX,
    body_errors,
    body_figures,
    contact_velocities,
    velocities_by,
)
from mbsim.fclib.clock import late
from mbsim.fclib.cone import bring_into_cones
from mbsim.fclib.solvers.proximal import (
    ALPHA,
    BEST,
    BEST_Q,
    EARLY,
    ERROR,
    FINAL,
    GAIN,
    HOPELESS,
    MEMORY,
    MOST,
    NEWTONS,
    PATIENCE,
    PHASE,
    SHARP,
    STEPS,
    WELL,
    WORK,
    keep_best,
    move_centre,
)
from mbsim.fclib.solvers.semismooth import HALVINGS
from mbsim.fclib.solvers.task import POLISHED, Goal, record

if TYPE_CHECKING:
    from mbsim.fclib.bodies.system import BodySystem
    from mbsim.fclib.problem import Vector

#: Smallest alpha: rounding leaves about 1e-16 / alpha of an impulse.
SMALLEST = 1e-6


class Workspace(NamedTuple):
    """Room of a run: (m,) vectors, (nc, 2) states, (bodies, 6) velocities, (nc, d, d) D."""

    x: Vector
    u: Vector
    trial: Vector
    trial_u: Vector
    step: Vector
    rate: Vector
    function: Vector
    b: Vector
    room: Vector
    recent: Vector
    slip: Vector
    rho: Vector
    v: Vector
    derivative: Vector


@jitable
def workspace(system: BodySystem, count: int) -> Workspace:
    """Return room for a run on `count` bodies."""
    nc, m = len(system.mu), len(system.w)
    d = 1 + len(system.tangent) + len(system.rolling)
    return Workspace(
        np.empty(m), np.empty(m), np.empty(m), np.empty(m), np.empty(m), np.empty(m), np.empty(m),
        np.empty(m), np.empty(m), np.empty(MEMORY), np.empty((nc, 2)), np.empty(nc),
        np.empty((count, SIX)), np.empty((nc, d, d)),
    )  # fmt: skip


@jitable
def _line_search(system: BodySystem, work: Workspace) -> float:
    """Go along the step to where |F| <= (1 - 1e-4 t) of the largest of late, or to the best.

    Returns |F| there; `rate` is the velocity change of the step, the proximal part included.
    """
    highest = work.recent.max()
    t, best_t, best = 1.0, 0.0, np.inf
    for k in range(HALVINGS + 2):
        if k == HALVINGS + 1:
            if best_t == 0.0 or best_t == t:
                break
            t = best_t
        for i in range(len(work.x)):
            work.trial[i] = work.x[i] + t * work.step[i]
            work.trial_u[i] = work.u[i] + t * work.rate[i]
        size = function_of_bodies(
            system, work.rho, work.trial, work.trial_u, work.slip, work.function
        )
        if size < best:
            best_t, best = t, size
        if size <= (1.0 - 1e-4 * t) * highest:
            break
        if k < HALVINGS:
            t *= 0.5
    if best < np.inf:
        work.x[:] = work.trial
        work.u[:] = work.trial_u
    return best


@jitable
def newton_on_bodies(
    system: BodySystem,
    matrix: BodyMatrix,
    work: Workspace,
    centre: Vector,
    alpha: float,
    aim: float,
    most: int,
    state: Vector,
    goal: Goal,
) -> tuple[int, bool, BodyMatrix]:
    """Solve a proximal problem from work.x on until its error is at most `aim`.

    Returns the iterations, whether it was reached, and the matrix of the contacts closed at last.
    """
    d = 1 + len(system.tangent) + len(system.rolling)
    velocities_by(system, work.x, work.v)
    contact_velocities(system, work.v, work.u)
    for a in range(len(system.mu)):
        work.rho[a] = state[SHARP] * system.rho[a] / (1.0 + alpha)
        for k in range(d * a, d * a + d):
            work.u[k] += alpha / system.rho[a] * (work.x[k] - centre[k])
    size = function_of_bodies(system, work.rho, work.x, work.u, work.slip, work.function)
    work.recent[:] = size
    begin, reached, misses = size, state[BEST], 0.0
    for done in range(1, most + 1):
        if late(goal.until):
            return done - 1, False, matrix
        matrix = closed_matrix(system, work.slip, matrix)
        linearise(
            system, work.rho, alpha, work.x, work.u, work.slip, work.function, work.derivative,
            work.b,
        )  # fmt: skip
        sound = direction_of_bodies(
            system, matrix, work.derivative, work.b, work.v, work.step, work.rate, goal.until
        )
        state[WORK] += body_work(matrix)
        if not sound:
            return done, False, matrix
        for a in range(len(system.mu)):
            for k in range(d * a, d * a + d):
                work.rate[k] += alpha / system.rho[a] * work.step[k]
        size = _line_search(system, work)
        if not math.isfinite(size):
            return done, False, matrix
        for k in range(MEMORY - 1):
            work.recent[k] = work.recent[k + 1]
        work.recent[MEMORY - 1] = size
        _, near, _, _, _ = body_figures(system, work.u, work.x, len(work.v), work.room)
        if near <= aim:
            return done, True, matrix
        if state[PHASE] > 0.0:
            misses = misses + 1.0 if near > GAIN * reached else 0.0
            if misses > state[PATIENCE]:
                return done, False, matrix
            reached = min(near, reached)
        if done >= EARLY and size > HOPELESS * begin:
            return done, False, matrix
    return most, False, matrix


@jitable
def body_work(matrix: BodyMatrix) -> float:
    """Return the estimated seconds of a Newton iteration with this matrix."""
    return work_of(matrix.analysis, len(matrix.col), len(matrix.held))


@jitable
def all_contacts_work(system: BodySystem, matrix: BodyMatrix) -> float:
    """Return `newton_work` of a system; `matrix` says how many bodies there are."""
    return newton_work(system.bodies, len(matrix.number))


@jitable
def proximal_bodies(
    system: BodySystem,
    matrix: BodyMatrix,
    r: Vector,
    centre: Vector,
    state: Vector,
    goal: Goal,
    limit: int,
    history: Vector,
) -> tuple[int, BodyMatrix]:
    """Take proximal steps until the errors are small enough or `limit` Newton iterations are spent.

    All arguments but the first two are those of `solvers.proximal.proximal_newton`. Returns the
    rows in `history`, and the matrix for a next call.
    """
    tol, tol_q = goal.tol, goal.tol_q
    work = workspace(system, len(matrix.number))
    rows, spent = 0, 0
    finishing = False
    while (spent < limit or finishing) and not late(goal.until):
        alpha = max(state[ALPHA], SMALLEST)
        final = tol
        if state[BEST] > 0.0:
            final = min(tol, tol_q * state[BEST] / state[BEST_Q])
        aim, most = max(0.1 * min(state[ERROR], state[BEST]), 0.2 * final), MOST
        if finishing:
            alpha = max(alpha * POLISHED, SMALLEST)
            aim *= 0.5 * POLISHED
            most = FINAL
        if state[PHASE] > 0.0:
            aim, most = WELL * final, int(state[PHASE])
        work.x[:] = centre
        newtons, good, matrix = newton_on_bodies(
            system, matrix, work, centre, alpha, aim, most, state, goal
        )
        spent += newtons
        state[NEWTONS] += newtons
        state[STEPS] += 1
        # the error of the problem itself
        bring_into_cones(system.tangent, system.rolling, system.mu, system.mu_r, work.x, work.trial)
        error, error_q = body_errors(system, work.trial, work.v, work.trial_u, work.room)
        rows = record(history, rows, state[NEWTONS], error, error_q)
        keep_best(state, goal, error, error_q, work.trial, r)
        if finishing or state[PHASE] > 0.0 or newtons == 0:
            break
        if error <= tol and error_q <= tol_q:
            if error_q <= POLISHED * tol_q:
                break
            finishing = True
            centre[:] = work.x
        elif not move_centre(state, centre, work.x, good, newtons, error):
            break
    return rows, matrix
