"""Semismooth Newton on Alart and Curnier's function (`semismooth`), with proximal steps or alone.

The rules (rho, damping, how alpha moves, the over-relaxed centre) come from a study on many
problems; the trajectory is chaotic, so a rule is judged on many problems only.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from mbsim.fclib.bodies.proximal import proximal_bodies
from mbsim.fclib.clock import compiled
from mbsim.fclib.solvers.proximal import (
    ALPHA,
    BEST,
    BEST_Q,
    ERROR,
    GAIN,
    MEMORY,
    NEWTONS,
    PATIENCE,
    PHASE,
    REACH,
    SHARP,
    STALLED,
    STATE,
    WORK,
    proximal_newton,
)
from mbsim.fclib.solvers.semismooth import RHO
from mbsim.fclib.solvers.task import ROWS, Task

if TYPE_CHECKING:
    from mbsim.fclib.problem import Vector

#: Iterations and alpha of a phase of Newton's method alone.
MOST_PHASE, PHASE_ALPHA = 6, 1e-11
#: The proximal centre goes this far towards the new point (state[REACH]).
OVER = 1.6


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

    def newton_phase(self, most: int = MOST_PHASE, patience: int = 0) -> None:
        """Take Newton steps while each of them gains; offer and count them if they led anywhere.

        With every contact in its final state two or three end at rounding, else one shows it.
        `most`: of them; `patience`: steps on end that need not gain.
        """
        task, state = self.task, self.state
        state[PHASE], state[PATIENCE] = most, patience
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
        task = self.task
        r = self.r.copy()
        history = np.empty((ROWS, 3))
        b = task.blocks
        if b.rigid is None:
            rows = compiled(proximal_newton)(
                b.system, r, self.centre, self.state, task.goal, limit, history
            )
        else:
            rows, matrix = compiled(proximal_bodies)(
                *b.rigid, r, self.centre, self.state, task.goal, limit, history
            )
            b.rigid = (b.rigid[0], matrix)
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
