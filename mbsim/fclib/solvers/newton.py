"""Semismooth Newton on Alart and Curnier's function, inside a proximal point method.

The outer method solves problems with W + alpha w I and q - alpha w c (w the mean diagonal of W, c
the centre), whose solution is the next centre; alpha is only a path to the solution: the error is
always that of the problem itself. The inner one is Newton on

    F_N = r_N - max(0, x_N),  F_T = r_T - P(x_T; |.| <= mu max(0, x_N)),  x = r - rho u,

whose system holds only closed contacts (x_N > 0). The rules (rho, damping, how alpha moves, the
over-relaxed centre) come from a study on many problems; the trajectory is chaotic, so a rule is
judged on many problems only.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsim.core.jitable import jitable
from mbsim.fclib.blocks import product
from mbsim.fclib.clock import compiled, late
from mbsim.fclib.cone import (
    DECIDING,
    NO_SHARES,
    PUBLISHED,
    bring_into_cones,
    improves,
    norm,
    own_errors,
    relative_errors,
)
from mbsim.fclib.factor import factor_work, factorise, solve, transposed_places
from mbsim.fclib.ordering import analyse, elimination_flops
from mbsim.fclib.solvers.task import POLISHED, ROWS, Task

if TYPE_CHECKING:
    from mbsim.fclib.problem import Vector

#: rho = RHO / (mean diagonal of the contact's block); 10 to 30 is good, and 100 or 1 is not: too
#: many contacts change their state at once, or too few (state[SHARP]).
RHO = 10.0
#: Newton iterations of one proximal step, and when a hopeless one is given up.
MOST, EARLY, HOPELESS = 15, 8, 0.3
#: Newton iterations of the step that makes a solution found a better one.
FINAL = 4
#: A dash ends at this share of the goal.
WELL = 0.01
#: Iterations and alpha of a dash, which ends where one leaves more than a share of the error.
MOST_DASH, DASH_ALPHA, GAIN = 6, 1e-11, 0.3
#: Trial steps of the line search, and how many earlier norms it compares with.
HALVINGS, MEMORY = 8, 5
#: The proximal centre goes this far towards the new point (state[REACH]).
OVER = 1.6
SMALLEST_ALPHA = 1e-12

#: Contacts in the matrix over closed ones: with some that have opened it is not analysed anew.
SPARE = 1.1

# places in `state`, what a later call needs to go on
(
    ALPHA, FAILED_AT, SINCE, BEST, BEST_Q, STEPS, NEWTONS, ERROR, STALLED, WORK, SHARP, REACH, DASH,
    PATIENCE,
) = range(14)  # fmt: skip
STATE = 14


@jitable
def states(tangent, mu, rho, u, r, slip, function):
    """Classify contacts and write F; return |F|.

    `slip` gets 0 for open, -1 for stick, and g = mu x_N / |x_T| < 1 for slip.
    """
    nt = len(tangent)
    d = 1 + nt
    total = 0.0
    for a in range(len(mu)):
        first = d * a
        normal = r[first] - rho[a] * u[first]
        slip[a] = 0.0
        if normal <= 0.0:
            for k in range(d):
                function[first + k] = r[first + k]
        else:
            length = 0.0
            for k in range(nt):
                length += (r[first + 1 + k] - rho[a] * u[first + 1 + k]) ** 2
            length = math.sqrt(length)
            radius = mu[a] * normal
            function[first] = rho[a] * u[first]
            if length <= radius:
                slip[a] = -1.0
                for k in range(nt):
                    function[first + 1 + k] = rho[a] * u[first + 1 + k]
            else:
                g = radius / length
                slip[a] = max(g, 1e-300)
                for k in range(nt):
                    at = first + 1 + k
                    function[at] = r[at] - g * (r[at] - rho[a] * u[at])
        for k in range(d):
            total += function[first + k] ** 2
    return math.sqrt(total)


@jitable
def _pattern(ptr, col, held, number, nodes):
    """Return the pattern among contacts `held`; `number` and `nodes` say who they are."""
    size = 0
    for a in range(len(held)):
        number[a] = -1
        if held[a]:
            number[a] = size
            nodes[size] = a
            size += 1
    rptr = np.zeros(size + 1, np.int32)
    total = 0
    for k in range(size):
        a = nodes[k]
        for j in range(ptr[a], ptr[a + 1]):
            if number[col[j]] >= 0:
                total += 1
        rptr[k + 1] = total
    rcol = np.empty(total, np.int32)
    at = 0
    for k in range(size):
        a = nodes[k]
        for j in range(ptr[a], ptr[a + 1]):
            b = number[col[j]]
            if b >= 0:
                rcol[at] = b
                at += 1
    return rptr, rcol


@jitable
def _linear_system(tangent, ptr, col, val, mu, rho, shift, u, r, slip, number, nodes, size, jac, x):
    """Write Newton's matrix and right side of contacts `nodes`, all closed ones among them.

    Rows are divided by rho (and g, where a contact slips), so that they have the size of W's.
    With x = r - rho u, e = x_T / |x_T|, P = I - e e' and c = 1 / (rho max(g, 1 / RHO)):

        W_N dr = -u_N;   stick: W_T dr = -u_T;
        slip: c ((I - g P) dr_T - mu e dr_N) + c g rho P W_T dr = -c (r_T - mu r_N e).

    Open contacts have dr = -r; of those that are not among `nodes` that is on the right side.
    """
    nt = len(tangent)
    d = 1 + nt
    at = 0
    e = np.empty(nt)
    mixed = np.empty((d, d))
    for k in range(size):
        a = nodes[k]
        first = d * a
        if slip[a] == 0.0:
            for s in range(d):
                x[d * k + s] = -r[first + s]
            for j in range(ptr[a], ptr[a + 1]):
                b = number[col[j]]
                if b < 0:
                    continue
                for s in range(d):
                    for t in range(d):
                        jac[at, s, t] = 1.0 if b == k and s == t else 0.0
                at += 1
            continue
        for s in range(d):
            x[d * k + s] = 0.0
        # velocity change by the contacts that open
        for j in range(ptr[a], ptr[a + 1]):
            b = col[j]
            if number[b] < 0:
                for s in range(d):
                    for t in range(d):
                        x[d * k + s] -= val[j, s, t] * r[d * b + t]
        g = slip[a]
        x[d * k] = -u[first] - x[d * k]
        length = 0.0
        for s in range(nt):
            e[s] = r[first + 1 + s] - rho[a] * u[first + 1 + s]
            length += e[s] ** 2
        length = math.sqrt(length)
        c = 1.0 / (rho[a] * max(g, 1.0 / RHO)) if g > 0.0 else 1.0
        weight = c * g * rho[a]
        if g < 0.0:
            for s in range(nt):
                x[d * k + 1 + s] = -u[first + 1 + s] - x[d * k + 1 + s]
        else:
            along = 0.0
            for s in range(nt):
                e[s] /= length
                along += e[s] * x[d * k + 1 + s]
            for s in range(nt):
                opened = x[d * k + 1 + s] - e[s] * along
                x[d * k + 1 + s] = -c * (r[first + 1 + s] - mu[a] * r[first] * e[s])
                x[d * k + 1 + s] -= weight * opened
        for j in range(ptr[a], ptr[a + 1]):
            b = number[col[j]]
            if b < 0:
                continue
            for s in range(d):
                for t in range(d):
                    mixed[s, t] = val[j, s, t]
            if b == k:
                for s in range(d):
                    mixed[s, s] += shift
            if g > 0.0:
                for t in range(d):
                    along = 0.0
                    for s in range(nt):
                        along += e[s] * mixed[1 + s, t]
                    for s in range(nt):
                        mixed[1 + s, t] = weight * (mixed[1 + s, t] - e[s] * along)
                if b == k:
                    for s in range(nt):
                        mixed[1 + s, 0] -= c * mu[a] * e[s]
                        mixed[1 + s, 1 + s] += c * (1.0 - g)
                        for t in range(nt):
                            mixed[1 + s, 1 + t] += c * g * e[s] * e[t]
            for s in range(d):
                for t in range(d):
                    jac[at, s, t] = mixed[s, t]
            at += 1


@jitable
def proximal_newton(
    tangent, ptr, col, val, diagonal, q, mu, own, r, centre, state, tol, tol_q, limit, until,
    history, rows,
):  # fmt: skip
    """Take proximal steps until the error is small enough or `limit` Newton iterations are spent.

    It ends with the iteration in which it gets late (`clock.until`).

    `r` holds the best iterate, in and out; `centre` and `state` what a later call goes on from (a
    first call has state[ALPHA] > 0, state[BEST] the error of r, and the centre at r).
    With the goal reached, one more step, of at most FINAL iterations, is taken to a tenth of it.
    With state[DASH] it is one step of so many iterations at most, which ends when more than
    state[PATIENCE] of them in a row leave more than GAIN of the error, or at WELL times the goal.
    Returns the number of rows in `history` (Newton iterations so far, error, |F|/|q|).
    """
    nt = len(tangent)
    d = 1 + nt
    nc = len(mu)
    m = d * nc
    mean = 0.0
    rho = np.empty(nc)
    trace = np.empty(nc)
    for a in range(nc):
        trace[a] = 0.0
        for s in range(d):
            trace[a] += val[diagonal[a], s, s] / d
        mean += trace[a] / nc
    if not mean > 0.0:
        return rows
    mu_r = np.zeros(nc)
    x = centre.copy()
    u = np.empty(m)
    plain = np.empty(m)
    work = np.empty(m)
    step = np.empty(m)
    rate = np.empty(m)
    trial = np.empty(m)
    trial_u = np.empty(m)
    slip = np.empty(nc)
    trial_slip = np.empty(nc)
    number = np.empty(nc, np.int32)
    nodes = np.empty(nc, np.int32)
    held = np.zeros(nc, np.bool_)
    rptr, rcol = np.zeros(1, np.int32), np.zeros(0, np.int32)
    back = np.zeros(0, np.int32)
    symbolic = analyse(0, rptr, rcol, d)
    factors = np.empty(0)
    front = np.empty(0)
    stack = np.empty(0)
    exchange = np.empty(m, np.int32)
    jac = np.empty((0, d, d))
    part = np.empty(0)
    rhs = np.empty(m)
    recent = np.empty(MEMORY)
    spent = 0
    flops = 0.0
    finishing = False
    while (spent < limit or finishing) and not late(until):
        alpha = state[ALPHA]
        shift = alpha * mean
        for a in range(nc):
            rho[a] = state[SHARP] / (trace[a] + shift)
        for k in range(m):
            x[k] = centre[k]
        product(tangent, (), ptr, col, val, q, x, plain)
        for k in range(m):
            u[k] = plain[k]
        size_f = states(tangent, mu, rho, u, x, slip, work)
        begin = size_f
        final = tol
        if state[BEST] > 0.0:
            final = min(tol, tol_q * state[BEST] / state[BEST_Q])
        aim = max(0.1 * min(state[ERROR], state[BEST]), 0.2 * final)
        most = MOST
        if finishing:
            # proximal terms hold back as much as they help, this near
            shift *= POLISHED
            aim *= 0.5 * POLISHED
            most = FINAL
        if state[DASH] > 0.0:
            aim = WELL * final
            most = int(state[DASH])
        recent[:] = size_f
        newtons = 0
        good = False
        reached, misses = state[BEST], 0.0
        while newtons < most and not late(until):
            # Newton's direction
            same = newtons + spent > 0
            closed, either = 0, 0
            for a in range(nc):
                if slip[a] != 0.0:
                    closed += 1
                    same = same and held[a]
                if held[a] or slip[a] != 0.0:
                    either += 1
            few = either <= SPARE * closed
            if not (same and few):
                for a in range(nc):
                    held[a] = slip[a] != 0.0 or (held[a] and few)
                rptr, rcol = _pattern(ptr, col, held, number, nodes)
                back = transposed_places(len(rptr) - 1, rptr, rcol)
                symbolic = analyse(len(rptr) - 1, rptr, rcol, d)
                flops = elimination_flops(symbolic, d)
                state[WORK] += 5e-8 * len(rcol)
                if symbolic[5][-1] > len(factors):
                    factors = np.empty(symbolic[5][-1] + symbolic[5][-1] // 4)
                if symbolic[6][0] ** 2 > len(front):
                    front = np.empty(symbolic[6][0] ** 2)
                    part = np.empty(symbolic[6][0])
                if symbolic[6][1] > len(stack):
                    stack = np.empty(symbolic[6][1])
                if len(rcol) > len(jac):
                    jac = np.empty((len(rcol), d, d))
            size = len(rptr) - 1
            sound = True
            if size > 0:
                _linear_system(
                    tangent, ptr, col, val, mu, rho, shift, u, x, slip, number, nodes, size, jac,
                    rhs,
                )  # fmt: skip
                sound = factorise(
                    d, rptr, rcol, back, jac, symbolic, factors, exchange, front, stack, until
                )
                if sound:
                    solve(d, symbolic, factors, exchange, rhs, part)
            newtons += 1
            state[WORK] += factor_work(flops, len(col)) + 1e-9 * symbolic[5][-1] + 1e-7 * nc
            if not sound:
                break
            for k in range(m):
                step[k] = -x[k]
            for k in range(size):
                for s in range(d):
                    step[d * nodes[k] + s] = rhs[d * k + s]
            # zero in place of q: the change of the velocity
            for k in range(m):
                trial[k] = shift * step[k]
            product(tangent, (), ptr, col, val, trial, step, rate)
            if not math.isfinite(norm(rate)):
                break
            # line search on |F|, which may rise above the last one but not above the last five
            highest = 0.0
            for k in range(MEMORY):
                highest = max(highest, recent[k])
            t = 1.0
            best_t, best_size = 0.0, np.inf
            for _ in range(HALVINGS + 1):
                for k in range(m):
                    trial[k] = x[k] + t * step[k]
                    trial_u[k] = u[k] + t * rate[k]
                size_t = states(tangent, mu, rho, trial_u, trial, trial_slip, work)
                if size_t < best_size:
                    best_t, best_size = t, size_t
                if size_t <= (1.0 - 1e-4 * t) * highest:
                    break
                t *= 0.5
            if best_t == 0.0:
                break
            if best_t != t:
                t = best_t
                for k in range(m):
                    trial[k] = x[k] + t * step[k]
                    trial_u[k] = u[k] + t * rate[k]
                best_size = states(tangent, mu, rho, trial_u, trial, trial_slip, work)
            size_f = best_size
            for k in range(m):
                x[k] = trial[k]
                u[k] = trial_u[k]
            for a in range(nc):
                slip[a] = trial_slip[a]
            for k in range(MEMORY - 1):
                recent[k] = recent[k + 1]
            recent[MEMORY - 1] = size_f
            # natural map of the proximal problem
            near = own_errors(tangent, (), ptr, col, val, mu, mu_r, own, q, u, x, NO_SHARES, work)[
                0
            ]
            if near <= aim:
                good = True
                break
            if state[DASH] > 0.0:
                misses = misses + 1.0 if near > GAIN * reached else 0.0
                if misses > state[PATIENCE]:
                    break
                reached = min(near, reached)
            if newtons >= EARLY and size_f > HOPELESS * begin:
                break
        spent += newtons
        state[NEWTONS] += newtons
        state[STEPS] += 1
        # the error of the problem itself
        bring_into_cones(tangent, mu, x, trial)
        product(tangent, (), ptr, col, val, q, trial, plain)
        error, error_q = relative_errors(
            tangent, (), ptr, col, val, mu, mu_r, own, q, plain, trial, DECIDING, work
        )
        if rows < len(history):
            history[rows, 0] = state[NEWTONS]
            history[rows, 1] = error
            history[rows, 2] = error_q
            rows += 1
        before = state[ERROR]
        better = error < state[BEST]
        done = error <= tol and error_q <= tol_q
        if error <= tol and state[BEST] <= tol:
            better = improves(error_q, norm(trial), state[BEST_Q], norm(r))
        if better:
            state[STALLED] = 0.0 if error < 0.9 * state[BEST] else state[STALLED] + 1.0
            state[BEST] = error
            state[BEST_Q] = error_q
            for k in range(m):
                r[k] = trial[k]
        else:
            state[STALLED] += 1.0
        if finishing or state[DASH] > 0.0:
            break
        if done:
            # a weak contact that is good enough is no reason for more
            _, second = relative_errors(
                tangent, (), ptr, col, val, mu, mu_r, own, q, plain, trial, PUBLISHED, work
            )
            if second <= POLISHED * tol_q:
                break
            finishing = True
            for k in range(m):
                centre[k] = x[k]
            continue
        if good:
            state[ERROR] = error
            state[SINCE] += 1
            for k in range(m):
                centre[k] += state[REACH] * (x[k] - centre[k])
            lower = state[ALPHA] * (0.3 if newtons <= 6 else 0.6)
            if state[SINCE] <= 3.0:
                lower = max(lower, 1.5 * state[FAILED_AT])
            if alpha > 0.0:
                state[ALPHA] = max(min(lower, alpha), SMALLEST_ALPHA)
        else:
            if alpha == 0.0 and state[STALLED] > MEMORY:
                break  # Newton's method alone, and it fails
            state[FAILED_AT] = alpha
            state[SINCE] = 0.0
            state[ALPHA] = min(4.0 * alpha, 1e6)
            if error < before or alpha == 0.0:
                state[ERROR] = min(error, before)
                for k in range(m):
                    centre[k] = x[k]
    return rows


class Proximal:
    """A proximal Newton run that can be continued; `alpha` = 0 is Newton's method alone.

    It starts from `start`, by default the best iterate, and keeps a best one of its own and the
    mean of its centres.
    """

    def __init__(
        self,
        task: Task,
        alpha: float = 1e-3,
        rho: float = RHO,
        start: Vector | None = None,
        reach: float = OVER,
    ) -> None:
        self.task = task
        self.r = (task.r if start is None else start).copy()
        self.centre = self.r.copy()
        self.total, self.samples = np.zeros(len(self.r)), 0
        self.state: Any = np.zeros(STATE)
        self.state[ALPHA], self.state[SHARP], self.state[REACH] = alpha, rho, reach
        error, error_q = task.look(self.r)
        self.state[BEST] = self.state[ERROR] = error
        self.state[BEST_Q] = error_q
        task.offer(self.r, error, error_q)

    @property
    def error(self) -> float:
        """Best error of this run."""
        return float(self.state[BEST])

    @property
    def stalled(self) -> float:
        """Proximal steps since the error fell by a tenth."""
        return float(self.state[STALLED])

    @property
    def mean(self) -> Vector:
        """Mean of the centres since `forget`: the middle, if the run goes round in a circle."""
        found: Vector = self.total / max(self.samples, 1)
        return found

    def forget(self) -> None:
        """Begin a new mean."""
        self.total[:] = 0.0
        self.samples = 0

    def advance(self, limit: int) -> bool:
        """Spend about `limit` Newton iterations; return whether anything was done."""
        task, state = self.task, self.state
        work, newtons = state[WORK], state[NEWTONS]
        rows = self._step(limit)
        rows[:, 0] += task.iterations - newtons
        self.total += self.centre
        self.samples += 1
        task.work += float(state[WORK] - work)
        task.iterations += int(state[NEWTONS] - newtons)
        task.offer(self.r, state[BEST], state[BEST_Q])
        task.note("NSN" if state[ALPHA] == 0.0 else "PROX", rows)
        return bool(state[NEWTONS] > newtons)

    def dash(self, most: int = MOST_DASH, patience: int = 0) -> None:
        """Take Newton steps while each of them gains; offer and count them if they led anywhere.

        With every contact in its final state two or three end at rounding, else one shows it.
        `most`: of them; `patience`: steps on end that need not gain.
        """
        task, state = self.task, self.state
        state[DASH], state[PATIENCE] = most, patience
        rows = self._step(1)
        within = state[BEST] <= task.tol and task.error <= task.tol
        gained = state[BEST_Q] <= GAIN * task.error_q if within else False
        if (gained or state[BEST] <= GAIN * task.error) and task.offer(
            self.r, state[BEST], state[BEST_Q]
        ):
            task.work += float(state[WORK])
            task.iterations += int(state[NEWTONS])
            rows[:, 0] = task.iterations
            task.note("NSN", rows)

    def _step(self, limit: int) -> Any:
        """Spend about `limit` Newton iterations and return rows for the history."""
        b, task = self.task.blocks, self.task
        r = self.r.copy()
        history = np.empty((ROWS, 3))
        rows = compiled(proximal_newton)(
            b.tangent, b.ptr, b.col, b.val, b.diagonal, b.q, b.mu, b.rho, r, self.centre,
            self.state, task.tol, task.tol_q, limit, task.until, history, 0,
        )  # fmt: skip
        self.r = r
        return history[:rows]


def run(task: Task) -> None:
    """Take proximal Newton steps until the goal is reached or the time is over (PROX)."""
    _until(task, Proximal(task))


def run_newton(task: Task) -> None:
    """Newton's method alone, without proximal terms (NSN)."""
    _until(task, Proximal(task, 0.0))


def _until(task: Task, proximal: Proximal) -> None:
    """Go on until the goal is reached, the time is over or nothing moves any more."""
    chunk = 50
    while not task.done and not task.late:
        if not proximal.advance(chunk) or proximal.stalled > 100:
            return
        if proximal.state[ALPHA] == 0.0 and proximal.stalled > MEMORY:
            return
