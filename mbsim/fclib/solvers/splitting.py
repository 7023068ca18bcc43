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
from typing import Any

import numpy as np

from mbsim.core.jitable import jitable
from mbsim.fclib.blocks import product
from mbsim.fclib.clock import compiled, late
from mbsim.fclib.cone import DECIDING, cone_height, improves, norm, relative_errors
from mbsim.fclib.factor import factor_work, factorise, solve, transposed_places
from mbsim.fclib.ordering import analyse, elimination_flops
from mbsim.fclib.solvers.task import POLISHED, ROWS, Task

# places in `state`, what a later call needs to go on
(
    PENALTY, ITERATIONS, NEXT, INTERVAL, BEST, BEST_Q, MOMENTUM, RESIDUAL, WORK, FACTORED,
) = range(10)  # fmt: skip
STATE = 10
#: First penalty, the iteration of its first change, and the range in which it moves.
PENALTY_0, FIRST_CHANGE, LEAST, MOST = 0.1, 10, 0.03, 30.0
#: A penalty with which bodies that all stick need a handful of iterations.
RESTING = 1e-3


@jitable
def _project(tangent, rolling, mu, mu_r, x, y, z):
    """Write z = P_K(x + y)."""
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
def room_for_factors(d, ptr, col, val):
    """Return the analysis of W + rho D, and room for the matrix and its factors."""
    nc = len(ptr) - 1
    symbolic = analyse(nc, ptr, col, d)
    wide = symbolic[6][0]
    return (
        symbolic, transposed_places(nc, ptr, col), val.copy(), np.empty(symbolic[5][-1]),
        np.empty(d * nc, np.int32), np.empty(wide**2), np.empty(symbolic[6][1]), np.empty(wide),
    )  # fmt: skip


@jitable
def admm(
    tangent, rolling, ptr, col, val, diagonal, q, mu, mu_r, own, r, z, y, last_z, last_y, lift,
    room, state, accelerate, tol, tol_q, limit, every, until, history, rows,
):  # fmt: skip
    """Iterate until the error is small enough, `limit` iterations are done or it is late.

    With the goal reached, a tenth of the iterations more may bring a tenth of it (POLISHED).
    `r` holds the best iterate, in and out. z, y, what they were before they were accelerated
    (last_z, last_y), lift (s, one a contact), `room` (with the factors of state[FACTORED], a
    penalty) and `state` are what a later call goes on from; a first call has state[PENALTY],
    state[NEXT] and state[BEST] set, z and last_z at the start. Returns the number of rows in
    `history` (iterations so far, error, |F|/|q|).
    """
    nt, nr = len(tangent), len(rolling)
    d = 1 + nt + nr
    nc = len(mu)
    m = d * nc
    weight = np.empty(nc)
    mean = 0.0
    for a in range(nc):
        weight[a] = 0.0
        for s in range(d):
            weight[a] += val[diagonal[a], s, s] / d
        mean += weight[a] / nc
    if not mean > 0.0:
        return rows
    for a in range(nc):
        # a contact whose block is zero needs some weight too
        weight[a] = weight[a] if weight[a] > 1e-8 * mean else mean
    symbolic, back, shifted, factors, exchange, front, stack, part = room
    x = np.empty(m)
    u = np.empty(m)
    old_z = np.empty(m)
    old_y = np.empty(m)
    work = np.empty(m)
    flops = elimination_flops(symbolic, d)
    last = np.inf
    for _ in range(limit):
        if late(until):
            return rows
        penalty = state[PENALTY]
        if penalty != state[FACTORED]:
            state[WORK] += factor_work(flops, len(col))
            for a in range(nc):
                k = diagonal[a]
                for s in range(d):
                    shifted[k, s, s] = val[k, s, s] + penalty * weight[a]
            if not factorise(
                d, ptr, col, back, shifted, symbolic, factors, exchange, front, stack, until
            ):
                return rows
            state[FACTORED] = penalty
        for a in range(nc):
            rho = penalty * weight[a]
            for s in range(d):
                at = d * a + s
                old_z[at] = z[at]
                old_y[at] = y[at]
                x[at] = rho * (z[at] - y[at]) - q[at]
            x[d * a] -= lift[a]
        solve(d, symbolic, factors, exchange, x, part)
        for a in range(nc):
            rho = penalty * weight[a]
            speed = 0.0
            spin = 0.0
            for s in range(1, 1 + nt):
                at = d * a + s
                speed += (rho * (z[at] - y[at] - x[at])) ** 2
            for s in range(1 + nt, d):
                at = d * a + s
                spin += (rho * (z[at] - y[at] - x[at])) ** 2
            lift[a] = mu[a] * math.sqrt(speed) + mu_r[a] * math.sqrt(spin)
        _project(tangent, rolling, mu, mu_r, x, y, z)
        apart, moved, size, dual, given = 0.0, 0.0, 0.0, 0.0, 0.0
        for a in range(nc):
            for s in range(d):
                at = d * a + s
                y[at] += x[at] - z[at]
                apart += weight[a] * (x[at] - z[at]) ** 2
                moved += weight[a] * (z[at] - old_z[at]) ** 2
                size += weight[a] * max(z[at] ** 2, x[at] ** 2)
                dual += weight[a] * y[at] ** 2
                given += q[at] ** 2 / weight[a]
        state[ITERATIONS] += 1.0
        state[WORK] += 1e-9 * len(factors) + 1e-7 * nc + 1e-8 / every * len(col)
        if state[ITERATIONS] % every == 0.0:
            product(tangent, rolling, ptr, col, val, q, z, u)
            error, error_q = relative_errors(
                tangent, rolling, ptr, col, val, mu, mu_r, own, q, u, z, DECIDING, work
            )
            if rows < len(history):
                history[rows, 0] = state[ITERATIONS]
                history[rows, 1] = error
                history[rows, 2] = error_q
                rows += 1
            better = error < state[BEST]
            if error <= tol and state[BEST] <= tol:
                better = improves(error_q, norm(z), state[BEST_Q], norm(r))
            if better:
                state[BEST] = error
                state[BEST_Q] = error_q
                for k in range(m):
                    r[k] = z[k]
            if error <= tol and error_q <= tol_q and last == np.inf:
                last = 1.1 * state[ITERATIONS]
            if not math.isfinite(error):
                return rows
            if state[BEST] <= tol and state[BEST_Q] <= POLISHED * tol_q:
                return rows
            if state[ITERATIONS] >= last:
                return rows
        if accelerate:
            residual = apart + moved
            if residual < 0.999 * state[RESIDUAL] and state[RESIDUAL] > 0.0:
                momentum = 0.5 * (1.0 + math.sqrt(1.0 + 4.0 * state[MOMENTUM] ** 2))
                factor = (state[MOMENTUM] - 1.0) / momentum
                state[MOMENTUM] = momentum
            else:
                factor = 0.0
                state[MOMENTUM] = 1.0
            state[RESIDUAL] = residual
            for k in range(m):
                new_z, new_y = z[k], y[k]
                z[k] += factor * (new_z - last_z[k])
                y[k] += factor * (new_y - last_y[k])
                last_z[k] = new_z
                last_y[k] = new_y
        if state[ITERATIONS] >= state[NEXT]:
            state[INTERVAL] *= 1.5
            state[NEXT] = state[ITERATIONS] + state[INTERVAL]
            # the dual scale is that of q where bodies rest, for there u is nothing
            dual = max(dual, given / penalty**2)
            if size > 0.0 and dual > 0.0 and moved > 0.0 and apart > 0.0:
                ratio = math.sqrt((apart / size) / (moved / dual))
                if ratio > 3.0 or ratio < 1.0 / 3.0:
                    change = min(max(math.sqrt(ratio), 0.1), 10.0)
                    state[PENALTY] = min(max(penalty * change, LEAST), MOST)
                    scale = penalty / state[PENALTY]
                    for k in range(m):
                        y[k] *= scale
                        last_y[k] *= scale
                    state[MOMENTUM] = 1.0
                    state[RESIDUAL] = 0.0
    return rows


class Splitting:
    """An ADMM run that can be continued."""

    def __init__(self, task: Task, *, accelerate: bool = True, warm: bool = True) -> None:
        self.task = task
        m = len(task.r)
        self.accelerate = accelerate
        self.z = task.r.copy() if warm else np.zeros(m)
        self.y = np.zeros(m)
        self.last_z, self.last_y = self.z.copy(), self.y.copy()
        self.lift = np.zeros(task.blocks.contacts)
        self.state: Any = np.zeros(STATE)
        self.state[PENALTY] = PENALTY_0
        self.state[NEXT] = self.state[INTERVAL] = FIRST_CHANGE
        self.state[BEST] = self.state[BEST_Q] = np.inf
        self.state[MOMENTUM] = 1.0
        b = task.blocks
        d = 1 + len(b.tangent) + len(b.rolling)
        self.room = compiled(room_for_factors)(d, b.ptr, b.col, b.val)

    def penalise(self, penalty: float) -> None:
        """Go on with another penalty."""
        self.y *= self.state[PENALTY] / penalty
        self.last_y *= self.state[PENALTY] / penalty
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
        b = task.blocks
        r = task.r.copy()
        history = np.empty((min(ROWS, limit), 3))
        work, before = state[WORK], state[ITERATIONS]
        rows = compiled(admm)(
            b.tangent, b.rolling, b.ptr, b.col, b.val, b.diagonal, b.q, b.mu, b.mu_r,
            b.rho, r, self.z, self.y, self.last_z, self.last_y, self.lift, self.room, state,
            self.accelerate, task.tol, task.tol_q, limit, every, task.until, history, 0,
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
