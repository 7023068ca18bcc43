"""AUTO: the method that suits, found by what each one gains for its work.

Sweeps first: they are the cheapest and often all that is needed. Where they become slow, ADMM gets
a trial (stacks need few iterations of it), then proximal Newton, which needs a good start but
finishes. Between them, once hardly a contact changes its state, a Newton phase: a few steps of
Newton's method alone, which then end at rounding. Where all that fails a few contacts in the plane
get every combination of their states. Work is counted in estimated seconds, not measured, so that a
run does the same on every machine.
"""

from __future__ import annotations

import math
from itertools import count
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from mbsim.fclib.bodies.proximal import all_contacts_work
from mbsim.fclib.clock import compiled
from mbsim.fclib.cone import count_changes
from mbsim.fclib.factor import factor_work
from mbsim.fclib.ordering import elimination_cost
from mbsim.fclib.solvers import newton, proximal, splitting, states, sweeps
from mbsim.fclib.solvers.task import Task

if TYPE_CHECKING:
    from mbsim.fclib.problem import Vector

#: Sweeps before anything is predicted: with few contacts, else.
FIRST_SMALL, FIRST = 100, 20
#: Up to so many contacts count as few.
FEW = 10
#: ADMM is tried from this number of contacts on, with so many iterations.
STACKS, TRIAL = 50, 30
#: Error after the first sweeps below which bodies do not stack: ADMM gains nothing there.
SETTLED = 3e-4
#: Seconds that beginning another method takes, whatever the size.
BEGIN = 2e-4
#: Seconds that beginning a Newton phase takes, the share of all work or of what would
#: come next that it may take, and how many of its steps in a row need not gain at the end.
BEGIN_PHASE, SHARE, SHARE_NEXT, PATIENCE = 5e-5, 0.4, 0.25, 2
#: Share of the contacts, beside one, that may have changed their state where all have settled.
CHANGES = 0.01
#: Iterations of ADMM that show whether all bodies rest.
RESTED = 5
#: Newton iterations that a proximal finish takes, roughly: at all, and within the first goal.
FINISH, FINISH_NEAR = 40, 8
#: Error from which the proximal method is started, unless sweeps do not get there.
NEAR = 1.5e-4
#: rho and reach of successive runs of the proximal method: one that fails should not be repeated.
RUNS = ((10.0, 1.6), (10.0, 1.0), (30.0, 1.0))
#: Newton iterations in which a run must halve its error, and how often its centre is looked at.
WINDOW, SAMPLE = 240, 8
#: Runs from a best point without gain after which going on with the sweeps is better.
IDLE = 3
#: Error of a mean of centres that is a good start.
MIDDLE = 1e-3
#: Seconds of a Newton iteration in the contacts' impulses up to which it is not taken to the
#: bodies' velocities: such problems are small, or chains.
LIGHT = 2e-3
#: Restarts without any gain after which there is nothing more to hope for: at all, and of rolling
#: friction, where another coefficient finds the way (`solve`).
HOPELESS, HOPELESS_ROLLING = 20, 4


def first_sweeps(contacts: int) -> tuple[int, int]:
    """Return how many sweeps to begin with, and after how many to look at the error."""
    return (FIRST_SMALL, 1) if contacts <= FEW else (FIRST, 5)


class Costs(NamedTuple):
    """Estimated seconds of a Newton iteration, an ADMM iteration and its factors."""

    newton: float
    splitting: float
    factor: float


class NewtonPhases:
    """Newton's method tried now and then from the best point, where that costs little.

    Sweeps and ADMM gain ever less near the solution, Newton's method ever more, once hardly a
    contact changes between open, stick and slip. What a phase costs in vain is not counted as work.
    `step`: seconds of a Newton iteration.
    """

    def __init__(self, task: Task, step: float) -> None:
        self.task = task
        self.step = step
        self.cost = BEGIN_PHASE + step
        self.due = 0.0
        self.states = np.zeros(task.blocks.contacts, np.int8)
        self.looked_at: Vector | None = None
        self.begun_at: Vector | None = None
        self.settled = False

    def run(self, instead: float = 0.0) -> None:
        """Begin a phase if it is time; `instead`: seconds of what would come next, which count."""
        task, b = self.task, self.task.blocks
        sweeps.mend(task)
        if task.over or task.r is self.begun_at:
            return
        if task.r is not self.looked_at:
            changed = compiled(count_changes)(b.tangent, b.mu, task.r, self.states)
            self.settled = changed <= CHANGES * b.contacts + 1.0
            self.looked_at = task.r
        spent = task.work if self.settled and task.work >= self.due else 0.0
        # what costs hardly more than to begin is worth a try at once
        at_once = 1.5 * BEGIN_PHASE if self.begun_at is None else 0.0
        if self.cost <= max(SHARE * spent, SHARE_NEXT * instead, at_once):
            self.begun_at = task.r
            newton.Proximal(task, newton.PHASE_ALPHA).newton_phase()
            if task.r is self.begun_at:
                self.due = 2.0 * task.work

    def polish(self) -> None:
        """Make a solution better, where that costs little; proximal steps have done so."""
        task = self.task
        if task.history[-1][0] == "PROX":
            return
        if task.distance > proximal.WELL and self.cost <= SHARE * task.work and not task.late:
            most = max(1, int(0.25 * SHARE * task.work / self.step))
            most = min(most, newton.MOST_PHASE)
            newton.Proximal(task, newton.PHASE_ALPHA).newton_phase(most, PATIENCE)


def run(task: Task) -> None:
    """Solve with whatever works (AUTO)."""
    if not task.history:
        sweeps.nsgs(task, *first_sweeps(task.blocks.contacts))
    if task.over:
        return
    costs = _costs(task)
    b = task.blocks
    if b.rigid is not None:
        rigid, b.rigid = b.rigid, None
        here = _costs(task)
        if here.newton > LIGHT:
            b.rigid = rigid
        else:
            costs = here
    phases = NewtonPhases(task, costs.newton)
    if task.blocks.rolling and task.blocks.rigid is None:
        _rolling(task, costs, phases)
    else:
        _solve(task, costs, phases)
    if task.distance > 1.0 and len(task.blocks.tangent) == 1 and not task.blocks.rolling:
        if task.blocks.contacts <= states.FEW:
            states.run(task)
    phases.polish()


def _solve(task: Task, costs: Costs, phases: NewtonPhases) -> None:
    """Solve with sweeps, ADMM and Newton's method."""
    _sweep(task, BEGIN, phases)
    finish = FINISH * costs.newton
    far = max(SETTLED, task.tol)
    stacks = task.blocks.contacts >= STACKS and task.blocks.rigid is None
    if not task.over and stacks and task.error > far:
        trial = BEGIN + costs.factor + 2.0 * RESTED * costs.splitting
        _sweep(task, trial, phases)
        phases.run(trial)
        if not task.over and task.error > far:
            _try_splitting(task, costs, finish, phases)
    phases.run(BEGIN)
    if task.error <= task.tol:
        finish = FINISH_NEAR * costs.newton
    _sweep(task, finish, phases, near=True)
    if not task.over:
        _finish(task)


def _costs(task: Task) -> Costs:
    """Estimate what the methods cost."""
    b = task.blocks
    if b.rigid is not None:
        return Costs(compiled(all_contacts_work)(*b.rigid), math.inf, math.inf)
    d = 1 + len(b.tangent) + len(b.rolling)
    flops, entries = compiled(elimination_cost)(b.contacts, b.ptr, b.col, d)
    factor = factor_work(flops, len(b.col))
    once = 1e-9 * entries + 1.2e-7 * b.contacts
    step = math.inf if b.rolling else factor + once
    return Costs(step, once + 5e-9 * len(b.col), factor)


def _rolling(task: Task, costs: Costs, phases: NewtonPhases) -> None:
    """Go on with sweeps; rolling friction has no Newton's method here, but ADMM."""
    trial = TRIAL * costs.splitting
    _sweep(task, costs.factor + trial, phases)
    if not task.over:
        _try_splitting(task, costs, 20.0 * trial, phases)
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


def _sweep(task: Task, work: float, phases: NewtonPhases, *, near: bool = False) -> None:
    """Sweep on while that is predicted to take less than `work`; spend no more than twice that.

    `near`: sweep as well to get near enough for the proximal method. Within the first goal it is
    near, and weak contacts, which are left, come far slower than predicted.
    """
    cost = sweeps.sweep_work(task.blocks)
    spent = task.work
    phases.run()
    while not task.over and task.work - spent < 2.0 * work:
        rows = task.history[-1][1]
        left = _remaining(rows, task)
        if near and left * cost > work and task.error > NEAR:
            left = _remaining(rows, task, NEAR)
            if task.history[-1][0] != "NSGS":
                left = 0.0  # nothing known yet
        if left * cost > (0.1 if near and task.error <= task.tol else 1.0) * work:
            return
        chunk = min(max(25, task.iterations // 4), 100)
        best = task.r
        sweeps.nsgs(task, chunk)
        if task.r is best:
            return  # the next ones would be the same
        phases.run()


def _try_splitting(task: Task, costs: Costs, finish: float, phases: NewtonPhases) -> None:
    """Give ADMM a trial, and more while it is predicted to end before another method would.

    `finish`: what another method would take.
    """
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
        phases.run()
        if task.over or left * costs.splitting > finish or task.work - spent > 2.0 * finish:
            return
        limit = 30


def _finish(task: Task) -> None:
    """Run the proximal method until the goal is reached or there is no hope.

    The problem is not convex, so a run may go round in a circle about a solution: the middle of
    the circle, which is nearer to it, is where the next run starts. Else that starts from the best
    point of one that was near, with other numbers, and at last from where the sweeps have got to
    meanwhile.
    """
    start = chain = task.r
    vain = idle = 0
    most = HOPELESS_ROLLING if task.blocks.rolling else HOPELESS
    spent = task.work
    for restart in count():
        rho, reach = RUNS[restart % len(RUNS)]
        before = task.error
        run = newton.Proximal(task, rho=rho, start=start, reach=reach)
        begin = run.error
        _proximal(task, run)
        vain = 0 if task.error < 0.9 * before else vain + 1
        if task.over or vain >= most:
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
            moved = run.advance(SAMPLE)
            sweeps.mend(task)
            if not moved or task.over:
                return
        if run.error > 0.5 * before:
            return
