"""AUTO: the method that suits, found by what each one gains for its work.

Sweeps first: they are the cheapest and often all that is needed. Where they become slow, ADMM gets a
trial (stacks need few iterations of it), then proximal Newton, which needs a good start but finishes.
Work is counted in estimated seconds, not measured, so that a run does the same on every machine.
"""

from __future__ import annotations

import math
from typing import Any

from mbsim.fclib.solvers import newton, splitting, sweeps
from mbsim.fclib.solvers.task import Task

#: Sweeps before the rate is trusted, and the predicted number at which a switch pays.
FIRST, SWITCH = 100, 600
#: ADMM is tried from this number of contacts on.
STACKS = 50
#: Values of alpha that restarts of the proximal method go through.
ALPHAS = (1e-3, 1e-2, 1e-1, 1e-4)


def run(task: Task) -> None:
    """Solve with whatever works (AUTO)."""
    small = task.blocks.contacts <= 10
    if not task.history:
        sweeps.nsgs(task, FIRST, 1 if small else 5)
    if task.blocks.rolling:
        _rolling(task)
        return
    _sweep_while_fast(task)
    if task.blocks.contacts >= STACKS and not task.done and not task.late:
        _try_splitting(task)
    budget = max(6.0 * task.work, 2e-4)
    restart = 0
    while not task.done and not task.late:
        if not _proximal(task, budget, ALPHAS[restart % len(ALPHAS)]) and restart >= 12:
            return
        restart += 1
        if not task.done and not task.late:
            before = task.work
            sweeps.nsgs(task, FIRST)
            while task.work - before < 0.2 * budget and _remaining(task.history[-1][1], task) > 0:
                if task.done or task.late:
                    break
                sweeps.nsgs(task, FIRST)
            budget *= 2.0


def _rolling(task: Task) -> None:
    """Go on with sweeps; rolling friction has no Newton's method here, but ADMM."""
    _sweep_while_fast(task)
    if not task.done and not task.late:
        _try_splitting(task)
    if not task.done and not task.late:
        sweeps.run(task)


def _remaining(rows: Any, task: Task) -> float:
    """Return the predicted number of iterations, by the rate of the last 40 % of `rows`."""
    if len(rows) < 2:
        return math.inf
    last = rows[-1]
    then = rows[int(0.6 * (len(rows) - 1))]
    wanted = max(last[1] / task.tol, last[2] / task.tol_q)
    if wanted <= 1.0:
        return 0.0
    if last[0] <= then[0] or not 0.0 < last[1] < then[1]:
        return math.inf
    rate = math.log(then[1] / last[1]) / (last[0] - then[0])
    return float(math.log(wanted) / rate)


def _sweep_while_fast(task: Task) -> None:
    """Sweep on while it is predicted to end soon."""
    while not task.done and not task.late:
        if _remaining(task.history[-1][1], task) > SWITCH:
            return
        sweeps.nsgs(task, FIRST)


def _try_splitting(task: Task) -> None:
    """Give ADMM 40 iterations, and more while it is predicted to end soon."""
    run = splitting.Splitting(task, warm=False)
    limit = 40
    while run.advance(limit) and not task.done and not task.late:
        if _remaining(task.history[-1][1], task) > 4 * limit:
            return
        limit = 20


def _proximal(task: Task, budget: float, alpha: float) -> bool:
    """Take proximal Newton steps while they gain; return whether the error fell at all."""
    run = newton.Proximal(task, alpha)
    begin, start = task.error, task.work
    mark, mark_work = task.error, task.work
    while not task.done and not task.late:
        cost = run.newton_work
        limit = 10 if cost == 0.0 else max(10, min(100, int(0.25 * budget / cost)))
        if not run.advance(limit):
            break
        if task.error < mark / 3.0:
            mark, mark_work = task.error, task.work
        patience = budget if task.error > 1e-5 else 4.0 * max(budget, task.work - start)
        if task.work - mark_work > patience or run.stalled > 40:
            break
    return task.error < begin
