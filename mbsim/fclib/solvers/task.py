"""What every solver gets and fills: problem, goal, best iterate, history."""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsim.core import jit
from mbsim.fclib.blocks import product
from mbsim.fclib.cone import relative_errors

if TYPE_CHECKING:
    from mbsim.fclib.problem import Vector
    from mbsim.fclib.reduction import Blocks

#: Share of |F|/|q| that is a gain which deserves more work.
GAINED = 0.7
#: Growth of |r| that a smaller |F|/|q| is worth.
GROWTH = 2.0
#: A method that has reached its goal goes on to this share of it while that costs little: its last
#: iterations gain most for their work, and what is only just good enough serves nobody well.
POLISHED = 0.1
#: Rows of a history that one call of a kernel may add.
ROWS = 400


def clock() -> float:
    """Return seconds, those spent compiling left out: a machine compiles a solver once."""
    return time.perf_counter() - jit.compile_seconds


@dataclass(eq=False)
class Task:
    """One problem on its way to a solution.

    Parameters
    ----------
    blocks
        u = W r + q in blocks.
    r
        (m,) the start; then the best iterate so far.
    tol, tol_q
        Wanted: |F| / max(|q|, |r|, |u|) <= tol and |F| / |q| <= tol_q.
    strict
        Whether the second must be reached; else it gets more work while it gains, at most twenty
        times as much, or 50 ms and a third, at a time.
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
    #: Work up to which |F|/|q| may still take, when the first goal was reached, and |F|/|q| then.
    grace: float = np.inf
    reached: float = np.inf
    graced_at: float = np.inf
    iterations: int = 0
    #: (method, rows of iteration, error, |F|/|q|) in the order in which the methods ran.
    history: list[tuple[str, Any]] = field(default_factory=list)
    #: Size of r where |F|/|q| was looked at, to see impulses that grow without bound.
    sizes: list[tuple[float, float]] = field(default_factory=list)

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
        """Whether the time is over; compiling does not count."""
        return clock() > self.deadline

    @property
    def over(self) -> bool:
        """Whether to stop: done, or out of time."""
        return self.done or self.late

    def tighten(self, factor: float, factor_q: float) -> None:
        """Want smaller errors, by these factors."""
        self.tol *= factor
        self.tol_q *= factor_q
        self.grace = self.graced_at = np.inf

    def look(self, r: Vector) -> tuple[float, float]:
        """Return the errors of an iterate."""
        b = self.blocks
        u = np.empty_like(r)
        jit.function(product)(b.tangent, b.rolling, b.ptr, b.col, b.val, b.q, r, u)
        errors: tuple[float, float] = jit.function(relative_errors)(
            b.tangent, b.rolling, b.mu, b.mu_r, b.q, u, r, np.empty_like(r)
        )
        return errors

    def offer(self, r: Vector, error: float, error_q: float) -> bool:
        """Take an iterate if it is better, and return whether it was.

        Within the tolerance |F|/|q| decides, and impulses must not grow for it: in a wedge the
        error falls as they run away.
        """
        better = error < self.error
        if error <= self.tol and self.error <= self.tol:
            small = np.linalg.norm(r) <= GROWTH * np.linalg.norm(self.r)
            better = error_q < self.error_q and bool(small)
        if better:
            self.r, self.error, self.error_q = r, float(error), float(error_q)
        if self.error <= self.tol:
            if self.grace == np.inf:
                self.reached = self.work
            if self.error_q < GAINED * self.graced_at:
                self.graced_at = self.error_q
                more = min(20.0 * self.reached + 2e-5, 0.05 + 0.3 * self.reached)
                self.grace = self.work + more
        return better

    def note(self, name: str, rows: Any) -> None:
        """Add rows to the history."""
        if len(rows):
            self.history.append((name, rows.copy()))
        self.sizes.append((self.error_q, float(np.linalg.norm(self.r))))
