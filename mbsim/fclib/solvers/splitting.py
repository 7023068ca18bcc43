"""ADMM: a linear solve with fixed factors and a projection on the cones, in turns.

With D the mean diagonal of each contact's block and s = mu |u_T| e_N of the last iterate:

    (W + rho D) x = rho D (z - y) - q - s,   z = P_K(x + y),   y += x - z,

u = W x + q comes from the first equation for nothing. rho follows the balance of |x - z| and the
change of z, at intervals that widen (each change costs a factorisation). Acceleration is Nesterov's
on (z, y), given up (restart) whenever the residual rises: Goldstein, O'Donoghue, Setzer and
Baraniuk, Fast alternating direction optimization methods, SIAM J. Imaging Sci. 7, 2014.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from mbsim.core.jitable import jitable
from mbsim.fclib.blocks import mean_diagonals, product
from mbsim.fclib.clock import compiled, late
from mbsim.fclib.cone import DECIDING, cone_height, is_better, relative_errors
from mbsim.fclib.factor import (
    Factors,
    factor_work,
    factorise,
    room_for_factors,
    solve,
    transposed_places,
)
from mbsim.fclib.ordering import Analysis, analyse, elimination_flops
from mbsim.fclib.solvers.task import POLISHED, ROWS, Task, record

if TYPE_CHECKING:
    from mbsim.fclib.problem import Indices, Vector

# places in `state`, what a later call needs to go on
(
    PENALTY, ITERATIONS, NEXT, INTERVAL, BEST, BEST_Q, MOMENTUM, RESIDUAL, WORK, FACTORED,
) = range(10)  # fmt: skip
STATE = 10
#: First penalty, the iteration of its first change, and the range in which it moves.
PENALTY_0, FIRST_CHANGE, LEAST, MOST = 0.1, 10, 0.03, 30.0
#: A penalty with which bodies that all stick need a handful of iterations.
RESTING = 1e-3


class Iterates(NamedTuple):
    """z and y (m,), what they were before they were accelerated, and s of each contact (nc,)."""

    z: Vector
    y: Vector
    last_z: Vector
    last_y: Vector
    shift: Vector


class Regularised(NamedTuple):
    """W + rho D on the pattern of W, its fronts and factors; `back` by `transposed_places`."""

    analysis: Analysis
    back: Indices
    val: Vector
    factors: Factors


@jitable
def _project(system, x, y, z):
    """Write z = P_K(x + y)."""
    tangent, rolling, mu, mu_r = system.tangent, system.rolling, system.mu, system.mu_r
    nt, nr = len(tangent), len(rolling)
    d = 1 + nt + nr
    for a in range(len(mu)):
        first = d * a
        slide = 0.0
        roll = 0.0
        for k in range(nt):
            slide += (x[first + 1 + k] + y[first + 1 + k]) ** 2
        for k in range(nr):
            roll += (x[first + 1 + nt + k] + y[first + 1 + nt + k]) ** 2
        slide = math.sqrt(slide)
        roll = math.sqrt(roll)
        height = cone_height(x[first] + y[first], slide, roll, mu[a], mu_r[a])
        z[first] = height
        turn = min(1.0, mu[a] * height / slide) if slide > 0.0 else 1.0
        for k in range(nt):
            at = first + 1 + k
            z[at] = turn * (x[at] + y[at])
        turn = min(1.0, mu_r[a] * height / roll) if roll > 0.0 else 1.0
        for k in range(nr):
            at = first + 1 + nt + k
            z[at] = turn * (x[at] + y[at])


@jitable
def regularised(d, ptr, col, val):
    """Return room for W + rho D and its factors."""
    nc = len(ptr) - 1
    analysis = analyse(nc, ptr, col, d)
    back = transposed_places(nc, ptr, col)
    return Regularised(analysis, back, val.copy(), room_for_factors(analysis, d * nc))


@jitable
def _factorised(system, weight, penalty, matrix, until):
    """Write the factors of W + penalty D; return whether there were any, and time for them."""
    d = 1 + len(system.tangent) + len(system.rolling)
    for a in range(len(weight)):
        k = system.diagonal[a]
        for s in range(d):
            matrix.val[k, s, s] = system.val[k, s, s] + penalty * weight[a]
    return factorise(
        d, system.ptr, system.col, matrix.back, matrix.val, matrix.analysis, matrix.factors, until
    )


@jitable
def _solve_for_x(system, run, weight, penalty, matrix, x):
    """Write x, and s of the velocity that goes with it."""
    z, y, shift, q = run.z, run.y, run.shift, system.q
    nt = len(system.tangent)
    d = 1 + nt + len(system.rolling)
    for a in range(len(weight)):
        rho = penalty * weight[a]
        for s in range(d):
            at = d * a + s
            x[at] = rho * (z[at] - y[at]) - q[at]
        x[d * a] -= shift[a]
    solve(d, matrix.analysis, matrix.factors, x)
    for a in range(len(weight)):
        rho = penalty * weight[a]
        speed = 0.0
        spin = 0.0
        for s in range(1, 1 + nt):
            at = d * a + s
            speed += (rho * (z[at] - y[at] - x[at])) ** 2
        for s in range(1 + nt, d):
            at = d * a + s
            spin += (rho * (z[at] - y[at] - x[at])) ** 2
        shift[a] = system.mu[a] * math.sqrt(speed) + system.mu_r[a] * math.sqrt(spin)


@jitable
def _update_dual(system, run, weight, x, old_z):
    """Write y; return squares of |x - z|, the change of z, z or x, y, and q, weighed by D."""
    z, y, q = run.z, run.y, system.q
    d = 1 + len(system.tangent) + len(system.rolling)
    apart, moved, size, dual, given = 0.0, 0.0, 0.0, 0.0, 0.0
    for a in range(len(weight)):
        for s in range(d):
            at = d * a + s
            y[at] += x[at] - z[at]
            apart += weight[a] * (x[at] - z[at]) ** 2
            moved += weight[a] * (z[at] - old_z[at]) ** 2
            size += weight[a] * max(z[at] ** 2, x[at] ** 2)
            dual += weight[a] * y[at] ** 2
            given += q[at] ** 2 / weight[a]
    return apart, moved, size, dual, given


@jitable
def _accelerate(run, state, residual):
    """Extrapolate z and y (Nesterov), or restart where the residual has risen."""
    z, y, last_z, last_y = run.z, run.y, run.last_z, run.last_y
    if residual < 0.999 * state[RESIDUAL] and state[RESIDUAL] > 0.0:
        momentum = 0.5 * (1.0 + math.sqrt(1.0 + 4.0 * state[MOMENTUM] ** 2))
        factor = (state[MOMENTUM] - 1.0) / momentum
        state[MOMENTUM] = momentum
    else:
        factor = 0.0
        state[MOMENTUM] = 1.0
    state[RESIDUAL] = residual
    for k in range(len(z)):
        new_z, new_y = z[k], y[k]
        z[k] += factor * (new_z - last_z[k])
        y[k] += factor * (new_y - last_y[k])
        last_z[k] = new_z
        last_y[k] = new_y


@jitable
def _balance(run, state, apart, moved, size, dual):
    """Change the penalty where primal and dual residuals, relative ones, are far apart."""
    if not (size > 0.0 and dual > 0.0 and moved > 0.0 and apart > 0.0):
        return
    ratio = math.sqrt((apart / size) / (moved / dual))
    if ratio > 3.0 or ratio < 1.0 / 3.0:
        penalty = state[PENALTY]
        change = min(max(math.sqrt(ratio), 0.1), 10.0)
        state[PENALTY] = min(max(penalty * change, LEAST), MOST)
        scale = penalty / state[PENALTY]
        for k in range(len(run.y)):
            run.y[k] *= scale
            run.last_y[k] *= scale
        state[MOMENTUM] = 1.0
        state[RESIDUAL] = 0.0


@jitable
def admm(system, r, run, matrix, state, accelerate, goal, limit, every, history):
    """Iterate until the error is small enough, `limit` iterations are done or it is late.

    With the goal reached, a tenth of the iterations more may bring a tenth of it (POLISHED).
    `r` holds the best iterate, in and out. `run` (`Iterates`), `matrix` (`Regularised`, with the
    factors of state[FACTORED], a penalty) and `state` are what a later call goes on from; a first
    call has state[PENALTY], state[NEXT] and state[BEST] set, z and last_z at the start. The error
    is looked at after `every` iterations. Returns the number of rows in `history` (iterations so
    far, error, |F|/|q|).
    """
    tol, tol_q, z = goal.tol, goal.tol_q, run.z
    nc, m = len(system.mu), len(system.q)
    rows = 0
    weight, mean = mean_diagonals(system)
    if not mean > 0.0:
        return rows
    for a in range(nc):
        # a contact whose block is zero needs some weight too
        weight[a] = weight[a] if weight[a] > 1e-8 * mean else mean
    x, u, old_z, work = np.empty(m), np.empty(m), np.empty(m), np.empty(m)
    flops = elimination_flops(matrix.analysis, matrix.val.shape[1])
    last = np.inf
    for _ in range(limit):
        if late(goal.until):
            return rows
        penalty = state[PENALTY]
        if penalty != state[FACTORED]:
            state[WORK] += factor_work(flops, len(system.col))
            if not _factorised(system, weight, penalty, matrix, goal.until):
                return rows
            state[FACTORED] = penalty
        old_z[:] = z
        _solve_for_x(system, run, weight, penalty, matrix, x)
        _project(system, x, run.y, z)
        apart, moved, size, dual, given = _update_dual(system, run, weight, x, old_z)
        state[ITERATIONS] += 1.0
        state[WORK] += (
            1e-9 * len(matrix.factors.values) + 1e-7 * nc + 1e-8 / every * len(system.col)
        )
        if state[ITERATIONS] % every == 0.0:
            product(system, system.q, z, u)
            error, error_q = relative_errors(system, u, z, DECIDING, work)
            rows = record(history, rows, state[ITERATIONS], error, error_q)
            if is_better(tol, error, error_q, z, state[BEST], state[BEST_Q], r):
                state[BEST] = error
                state[BEST_Q] = error_q
                r[:] = z
            if error <= tol and error_q <= tol_q and last == np.inf:
                last = 1.1 * state[ITERATIONS]
            polished = state[BEST] <= tol and state[BEST_Q] <= POLISHED * tol_q
            if polished or state[ITERATIONS] >= last or not math.isfinite(error):
                return rows
        if accelerate:
            _accelerate(run, state, apart + moved)
        if state[ITERATIONS] >= state[NEXT]:
            state[INTERVAL] *= 1.5
            state[NEXT] = state[ITERATIONS] + state[INTERVAL]
            # the dual scale is that of q where bodies rest, for there u is nothing
            _balance(run, state, apart, moved, size, max(dual, given / penalty**2))
    return rows


class Splitting:
    """An ADMM run that can be continued."""

    def __init__(self, task: Task, *, accelerate: bool = True, warm: bool = True) -> None:
        self.task = task
        m = len(task.r)
        self.accelerate = accelerate
        z = task.r.copy() if warm else np.zeros(m)
        self.iterates = Iterates(
            z, np.zeros(m), z.copy(), np.zeros(m), np.zeros(task.blocks.contacts)
        )
        self.state: Any = np.zeros(STATE)
        self.state[PENALTY] = PENALTY_0
        self.state[NEXT] = self.state[INTERVAL] = FIRST_CHANGE
        self.state[BEST] = self.state[BEST_Q] = np.inf
        self.state[MOMENTUM] = 1.0
        b = task.blocks
        d = 1 + len(b.tangent) + len(b.rolling)
        self.matrix = compiled(regularised)(d, b.ptr, b.col, b.val)

    def penalise(self, penalty: float) -> None:
        """Go on with another penalty."""
        for y in (self.iterates.y, self.iterates.last_y):
            y *= self.state[PENALTY] / penalty
        self.state[PENALTY] = penalty
        self.state[NEXT] = self.state[ITERATIONS] + FIRST_CHANGE
        self.state[INTERVAL] = FIRST_CHANGE
        self.state[MOMENTUM], self.state[RESIDUAL] = 1.0, 0.0

    @property
    def error(self) -> float:
        """Best error of this run."""
        return float(self.state[BEST])

    def advance(self, limit: int, every: float = 2.0) -> bool:
        """Iterate at most `limit` times; return whether anything was done."""
        task, state = self.task, self.state
        r = task.r.copy()
        history = np.empty((min(ROWS, limit), 3))
        work, before = state[WORK], state[ITERATIONS]
        rows = compiled(admm)(
            task.blocks.system, r, self.iterates, self.matrix, state, self.accelerate, task.goal,
            limit, every, history,
        )  # fmt: skip
        history[:rows, 0] += task.iterations - before
        task.work += float(state[WORK] - work)
        task.iterations += int(state[ITERATIONS] - before)
        if np.isfinite(state[BEST]):
            task.offer(r, state[BEST], state[BEST_Q])
        task.note("ADMM", history[:rows])
        return bool(state[ITERATIONS] > before)


def run(task: Task) -> None:
    """Iterate until the goal is reached or the time is over (ADMM)."""
    splitting = Splitting(task, warm=bool(task.r.any()))
    best, since = np.inf, 0
    while not task.done and not task.late and splitting.advance(500):
        since = 0 if splitting.error < 0.99 * best else since + 1
        best = min(best, splitting.error)
        if since > 100:
            return  # at rounding, or it does not converge
