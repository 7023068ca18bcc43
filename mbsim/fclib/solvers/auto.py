"""AUTO: the method that suits, found by what each one gains for its work.

Sweeps first: they are the cheapest and often all that is needed. Where they become slow, ADMM gets
a trial (stacks need few iterations of it), then proximal Newton, which needs a good start but
finishes. Work is counted in estimated seconds, not measured, so that a run does the same on every
machine.
"""

from __future__ import annotations

import math
from itertools import count
from typing import Any

from mbsim.core import jit
from mbsim.fclib.ordering import analyse, elimination_flops
from mbsim.fclib.solvers import newton, splitting, sweeps
from mbsim.fclib.solvers.task import POLISHED, Task

#: Sweeps before anything is predicted: with few contacts, else.
FIRST_SMALL, FIRST = 100, 20
#: Up to so many contacts count as few.
FEW = 10
#: ADMM is tried from this number of contacts on, with so many iterations.
STACKS, TRIAL = 50, 30
#: Error after the first sweeps below which bodies do not stack: ADMM gains nothing there.
SETTLED = 3e-4
#: Seconds that beginning another method takes, whatever the size.
BEGIN = 4e-4
#: Seconds that beginning a dash of Newton's method takes, and the share of all work it may take.
BEGIN_DASH, SHARE = 5e-5, 0.5
#: Iterations of ADMM that show whether all bodies rest.
RESTED = 5
#: Newton iterations that a proximal finish takes, roughly.
FINISH = 40
#: Error from which the proximal method is started, unless sweeps do not get there.
NEAR = 1.5e-4
#: rho and reach of successive runs of the proximal method: one that fails should not be repeated.
RUNS = ((10.0, 1.6), (10.0, 1.0), (30.0, 1.0))
#: Newton iterations in which a run must halve its error, and how often its centre is looked at.
WINDOW, SAMPLE = 240, 8
#: Runs from a best point without gain after which the sweeps' way is better.
IDLE = 3
#: Error of a mean of centres that is a good start.
MIDDLE = 1e-3
#: Restarts without any gain after which there is nothing more to hope for.
HOPELESS = 20


def first_sweeps(contacts: int) -> tuple[int, int]:
    """Return how many sweeps to begin with, and after how many to look at the error."""
    return (FIRST_SMALL, 1) if contacts <= FEW else (FIRST, 5)


def run(task: Task) -> None:
    """Solve with whatever works (AUTO)."""
    if not task.history:
        sweeps.nsgs(task, *first_sweeps(task.blocks.contacts))
    if task.over:
        return
    if task.blocks.rolling:
        _rolling(task)
        return
    _solve(task)
    if not task.late:
        _dash(task)


def _solve(task: Task) -> None:
    """Solve with sweeps, ADMM and Newton's method."""
    _sweep(task, BEGIN)
    if not task.over:
        _dash(task)
    if task.over:
        return
    newton_work, splitting_work, factor_work = _costs(task)
    finish = FINISH * newton_work
    if task.blocks.contacts >= STACKS and task.error > SETTLED:
        trial = BEGIN + factor_work + 2.0 * RESTED * splitting_work
        _sweep(task, trial)
        if not task.over:
            _try_splitting(task, splitting_work, finish)
    _sweep(task, finish, near=True)
    if not task.over:
        _finish(task)


def _dash(task: Task) -> None:
    """Try Newton's method from the best point, where that takes little against the work so far.

    Sweeps and ADMM gain ever less near the solution, Newton's method ever more: it makes what is
    only just good enough good. What it takes in vain is not counted as work.
    """
    polished = task.error <= task.tol and task.error_q <= POLISHED * task.tol_q
    if polished or task.work < task.dash_at or task.blocks.contacts <= FEW:
        return
    if not task.dash_at:
        task.dash_at = (BEGIN_DASH + _costs(task)[0]) / SHARE
        if task.work < task.dash_at:
            return
    newton.Proximal(task, newton.DASH_ALPHA).dash()
    task.dash_at = 2.0 * task.work


def _costs(task: Task) -> tuple[float, float, float]:
    """Return the estimated seconds of a Newton iteration, an ADMM iteration and its factors."""
    b = task.blocks
    d = 1 + len(b.tangent) + len(b.rolling)
    symbolic = jit.function(analyse)(b.contacts, b.ptr, b.col, d)
    flops = jit.function(elimination_flops)(symbolic, d)
    entries = float(symbolic[5][-1])
    factor = 2.5e-10 * flops + 3e-8 * len(b.col)
    once = 1.2e-9 * entries + 2.5e-7 * b.contacts
    return factor + once, once + 5e-9 * len(b.col), factor


def _rolling(task: Task) -> None:
    """Go on with sweeps; rolling friction has no Newton's method here, but ADMM."""
    _, splitting_work, factor_work = _costs(task)
    _sweep(task, factor_work + TRIAL * splitting_work)
    if not task.over:
        _try_splitting(task, splitting_work, 20.0 * TRIAL * splitting_work)
    if not task.over:
        sweeps.run(task)


def _remaining(rows: Any, task: Task, aim: float = 0.0) -> float:
    """Return the predicted number of iterations, by the rate of the last 40 % of `rows`.

    `aim` is an error to reach in place of the goal.
    """
    if len(rows) < 2:
        return math.inf
    middle = int(0.6 * (len(rows) - 1))
    then, last = rows[: middle + 1, 1].min(), rows[:, 1].min()
    wanted = last / aim if aim else max(last / task.tol, rows[:, 2].min() / task.tol_q)
    if wanted <= 1.0:
        return 0.0
    steps = rows[-1, 0] - rows[middle, 0]
    if steps <= 0.0 or not 0.0 < last < then:
        return math.inf
    rate = math.log(then / last) / steps
    return float(math.log(wanted) / rate)


def _sweep(task: Task, work: float, *, near: bool = False) -> None:
    """Sweep on while that is predicted to take less than `work`; spend no more than twice that.

    `near`: sweep as well to get near enough for the proximal method.
    """
    cost = sweeps.sweep_work(task.blocks)
    spent = task.work
    while not task.over and task.work - spent < 2.0 * work:
        rows = task.history[-1][1]
        left = _remaining(rows, task)
        if near and left * cost > work and task.error > NEAR:
            left = _remaining(rows, task, NEAR)
            if task.history[-1][0] != "NSGS":
                left = 0.0  # nothing known yet
        if left * cost > work:
            return
        chunk = 25 if task.iterations < 100 else 100
        best = task.r
        sweeps.nsgs(task, chunk)
        if task.r is best:
            return  # the next ones would be the same
        _dash(task)


def _try_splitting(task: Task, cost: float, finish: float) -> None:
    """Give ADMM a trial, and more while it is predicted to end before another method would."""
    run = splitting.Splitting(task, warm=False)
    run.penalise(splitting.RESTING)
    spent = task.work
    run.advance(RESTED, 1.0)
    while not task.over and _remaining(task.history[-1][1], task) <= RESTED:
        run.advance(RESTED, 1.0)
    if task.over:
        return
    run.penalise(splitting.PENALTY_0)
    limit = TRIAL
    while run.advance(limit) and not task.over:
        left = _remaining(task.history[-1][1], task)
        _dash(task)
        if task.over or left * cost > finish or task.work - spent > 2.0 * finish:
            return
        limit = 30


def _finish(task: Task) -> None:
    """Run the proximal method until the goal is reached or there is no hope.

    The problem is not convex, so a run may go round in a circle about a solution: the middle of
    the circle, which is nearer to it, is where the next run starts. Else that starts from the best
    point of one that was near, with other numbers, and at last from where the sweeps have got to
    meanwhile, on their own way.
    """
    start = chain = task.r
    vain = idle = 0
    spent = task.work
    for restart in count():
        rho, reach = RUNS[restart % len(RUNS)]
        before = task.error
        run = newton.Proximal(task, rho=rho, start=start, reach=reach)
        begin = run.error
        _proximal(task, run)
        vain = 0 if task.error < 0.9 * before else vain + 1
        if task.over or vain >= HOPELESS:
            return
        idle = 0 if run.error < 0.5 * begin else idle + 1
        start = run.mean
        if task.look(start)[0] < MIDDLE:
            continue
        if run.error < NEAR and idle < IDLE:
            start = run.r
            continue
        spent, work = 0.2 * (task.work - spent), task.work
        while not task.over and task.work - work < spent:
            chain = sweeps.nsgs(task, FIRST_SMALL * (restart + 1), start=chain)
        if task.over:
            return
        start, spent, idle = chain, task.work, 0


def _proximal(task: Task, run: newton.Proximal) -> None:
    """Take proximal Newton steps while they gain."""
    while True:
        before = run.error
        run.forget()
        for _ in range(WINDOW // SAMPLE):
            if not run.advance(SAMPLE) or task.over:
                return
        if run.error > 0.5 * before:
            return
