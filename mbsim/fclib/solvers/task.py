"""What every solver gets and fills: problem, goal, best iterate, history."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from mbsim.core.jitable import jitable
from mbsim.fclib.clock import clock, compiled, until
from mbsim.fclib.cone import DECIDING, errors_at, improves
from mbsim.fclib.problem import length

if TYPE_CHECKING:
    from mbsim.fclib.problem import Vector
    from mbsim.fclib.reduction import Blocks

#: Share of the second figure that is a gain which deserves more work.
GAINED = 0.7
#: A method that has reached its goal goes on to this share of it while that costs little: its last
#: iterations gain most for their work, and what is only just good enough serves nobody well.
POLISHED = 0.1
#: Times its goal above which the second figure says that the first was met by its units alone: a
#: heavy body's impulses make it small at once.
FAR_OFF = 10.0
#: Seconds that it gets at least where Newton's steps are in body space: they settle what sweeps
#: leave of weak contacts.
PATIENCE = 1.0
#: Rows of a history that one call of a kernel may add.
ROWS = 400


class Goal(NamedTuple):
    """What a method is to reach, as compiled code takes it.

    error <= tol and error_q <= tol_q (`Task`), or the end of the time (`clock.until`).
    """

    tol: float
    tol_q: float
    until: Any


@jitable
def record(history: Vector, rows: int, iterations: float, error: float, error_q: float) -> int:
    """Add a row to the history, as long as it has room; return the number of rows."""
    if rows >= len(history):
        return rows
    history[rows, 0] = iterations
    history[rows, 1] = error
    history[rows, 2] = error_q
    return rows + 1


@dataclass(eq=False)
class Task:
    """One problem on its way to a solution.

    Two figures of an iterate (`cone.relative_errors`) are wanted small. `error` is the published
    error, in the units given and in the contacts' own. `error_q` is what a solution without scales
    needs as well.

    Parameters
    ----------
    blocks
        u = W r + q in blocks.
    r
        (m,) the start; then the best iterate so far.
    tol, tol_q
        Wanted: error <= tol and error_q <= tol_q.
    strict
        Whether the second must be reached; else it gets more work while it gains, at most twenty
        times as much, or 50 ms and a half, at a time; while it is FAR_OFF, these.
    deadline
        Value of `clock` at which to give up.
    """

    blocks: Blocks
    r: Vector
    tol: float
    tol_q: float
    strict: bool = False
    deadline: float = np.inf
    error: float = np.inf
    error_q: float = np.inf
    #: Estimated seconds, and iterations: what the methods have done so far.
    work: float = 0.0
    #: Work up to which error_q may still take, when the first goal was reached, and error_q then.
    grace: float = np.inf
    reached: float = np.inf
    graced_at: float = np.inf
    iterations: int = 0
    #: (method, rows of iteration, error, error_q) in the order in which the methods ran.
    history: list[tuple[str, Any]] = field(default_factory=list)
    #: error_q and the size of r where these were looked at: impulses may grow without bound.
    sizes: list[tuple[float, float]] = field(default_factory=list)
    #: Iterate whose weak contacts were looked at.
    mended: Vector | None = None
    #: The deadline as compiled code wants it (`clock.until`).
    until: Any = field(init=False)

    def __post_init__(self) -> None:
        self.end(self.deadline)

    def end(self, deadline: float) -> None:
        """Give up at this value of `clock`."""
        self.deadline = deadline
        self.until = until(deadline)

    @property
    def done(self) -> bool:
        """Whether the goal is reached."""
        if self.error > self.tol:
            return False
        return self.error_q <= self.tol_q or (not self.strict and self.work >= self.grace)

    @property
    def distance(self) -> float:
        """How many times as large as wanted the errors are, the larger of them."""
        return max(self.error / self.tol, self.error_q / self.tol_q)

    @property
    def late(self) -> bool:
        """Whether the time is over."""
        return clock() > self.deadline

    @property
    def over(self) -> bool:
        """Whether to stop: done, or out of time."""
        return self.done or self.late

    @property
    def goal(self) -> Goal:
        """The goal as compiled code takes it."""
        return Goal(self.tol, self.tol_q, self.until)

    def tighten(self, factor: float, factor_q: float) -> None:
        """Want smaller errors, by these factors."""
        self.tol *= factor
        self.tol_q *= factor_q
        self.grace = self.graced_at = np.inf

    def look(self, r: Vector) -> tuple[float, float]:
        """Return the errors of an iterate."""
        errors: tuple[float, float] = compiled(errors_at)(
            self.blocks.system, r, np.empty_like(r), DECIDING, np.empty_like(r)
        )
        return errors

    def offer(self, r: Vector, error: float, error_q: float) -> bool:
        """Take an iterate if it is better, and return whether it was.

        Within the first goal the second figure decides (`cone.improves`).
        """
        better = error < self.error
        if error <= self.tol and self.error <= self.tol:
            size, before = length(r), length(self.r)
            better = bool(improves(float(error_q), size, self.error_q, before))
        if better:
            self.r, self.error, self.error_q = r, float(error), float(error_q)
        if self.error <= self.tol:
            if self.grace == np.inf:
                self.reached = self.work
            if self.error_q < GAINED * self.graced_at:
                self.graced_at = self.error_q
                more = 0.05 + 0.5 * self.reached
                if self.blocks.rigid is not None:
                    more = PATIENCE + 20.0 * self.reached
                elif self.error_q <= FAR_OFF * self.tol_q:
                    more = min(20.0 * self.reached + 2e-5, more)
                self.grace = self.work + more
        return better

    def note(self, name: str, rows: Any) -> None:
        """Add rows to the history."""
        if len(rows):
            self.history.append((name, rows.copy()))
        self.sizes.append((self.error_q, length(self.r)))
