"""One call for every solver: from arrays in memory to a solution that has been checked.

"Solved" is said only of errors recomputed from the problem as it was given, by the definitions in
`merit`; what a solver believes does not count.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsim.errors import ModelError
from mbsim.fclib.clock import clock, compiled, loading, until
from mbsim.fclib.cone import FREE
from mbsim.fclib.infeasible import is_infeasible, proof_work
from mbsim.fclib.merit import FAR, Errors, Figures, completed, errors, judge
from mbsim.fclib.problem import Global, Local, Solution
from mbsim.fclib.reduction import Blocks, reduce
from mbsim.fclib.solvers.auto import first_sweeps
from mbsim.fclib.solvers.catalog import solver as named
from mbsim.fclib.solvers.sweeps import LONG, local_sweeps, mended, sweep_work
from mbsim.fclib.solvers.task import Task

if TYPE_CHECKING:
    from mbsim.fclib.problem import Vector

#: Rounds in which a solver's goal is tightened where the error of the given problem is larger.
ROUNDS = 4
#: Coefficients, over those of a problem that stagnates, by way of which it is solved: rolling
#: friction's where there is some, else friction's. The error of what is found is the problem's own.
PATHS = ((0.8,), (0.5,), (2.0,), (0.5, 0.8), (1.5, 1.2))
#: Share of the time allowed that looking for a proof may take.
PROOF = 0.05
#: What a solver leaves when it is late, in looks at an iterate: its last sweep and look, velocities
#: by the matrices as given, the figures that decide, and weak contacts.
CHECK = 8.0


@dataclass(eq=False)
class Result:
    """What `solve` found.

    Parameters
    ----------
    problem, solver, tol, strict
        What was asked.
    r, u
        (m,) impulses and velocities: the solution, or the best iterate.
    error, error_q
        Of `r`, recomputed from the problem as given (`merit`).
    solve_s, condense_s
        Seconds from arrays in memory to the checked solution, and how many of them went into
        condensation and elimination; compiling, once a machine, is left out.
    iterations
        Of all methods together.
    history
        (method, rows of iteration and the two figures of `cone.relative_errors`) in order.
    status
        `solved`, `solved_relative` or `not_solved` (`merit.Errors.status`).
    reason
        Empty if solved; else why not, or what is left over.
    """

    problem: Local | Global
    solver: str
    tol: float
    strict: bool
    r: Vector
    u: Vector
    error: float
    error_q: float
    solve_s: float = 0.0
    condense_s: float = 0.0
    iterations: int = 0
    history: list[tuple[str, Any]] | tuple[()] = ()
    status: str = "solved"
    reason: str = ""
    blocks: Blocks | None = None

    @cached_property
    def solution(self) -> Solution:
        """u, r and, where the problem has them, v and l."""
        return completed(self.problem, self.r, self.blocks)

    @cached_property
    def figures(self) -> Figures:
        """All figures of the solution."""
        return judge(self.problem, self.solution, self.blocks)


def solve(
    problem: Local | Global,
    tol: float = 1e-8,
    solver: str = "AUTO",
    *,
    guess: Solution | None = None,
    strict: bool = False,
    max_seconds: float = 20.0,
) -> Result:
    """Solve a problem of any kind.

    Parameters
    ----------
    problem
        Local or global, with or without equality constraints or rolling friction.
    tol
        Largest `merit` error of a solution.
    solver
        A name of `solvers.catalog.SOLVERS`.
    guess
        Where to start; its r is enough. Default: r = 0.
    strict
        |F| / |q| must be at most `tol`, too, and so hard is it tried to meet what is free of units.
    max_seconds
        Give up after this long; compiling and loading do not count.
    """
    began = clock()
    result = _solve_once(problem, tol, solver, guess, strict, max_seconds)
    if result.reason == "stagnates" and result.solver == "AUTO":
        result = _by_continuation(result, began + max_seconds)
        result.solve_s = clock() - began
    return result


def _solve_once(
    problem: Local | Global,
    tol: float,
    solver: str,
    guess: Solution | None,
    strict: bool,
    max_seconds: float,
) -> Result:
    """Solve a problem from one start."""
    began = clock()
    if not tol > 0.0:
        raise ModelError(f"tol {tol}: a number above 0 is allowed")
    m = problem.spacedim * len(problem.mu)
    if guess is not None and guess.r.shape != (m,):
        raise ModelError(f"the guess has {len(guess.r)} impulses, the problem {m}")
    r = np.zeros(m) if guess is None else np.array(guess.r, dtype=np.float64)
    plain = isinstance(problem, Local) and problem.V is None and problem.mu_r is None
    small = 0 < len(problem.mu) <= LONG
    if isinstance(problem, Local) and plain and small and solver == "AUTO":
        return _solve_plain(problem, tol, r, strict, began, max_seconds)
    blocks = reduce(problem)
    with loading():
        method = named(solver, rolling=problem.mu_r is not None and blocks.rigid is None)
    condensed = clock()
    task = Task(blocks, r, tol, tol, strict, began + max_seconds)
    error, error_q = task.look(r)
    # by what a look took: a busy machine or a slow one needs as many times as long for the rest
    task.end(task.deadline - min(0.5 * max_seconds, CHECK * (clock() - condensed)))
    if guess is not None or error == 0.0:
        # that r = 0 happens to be near enough makes it no solution
        task.offer(r, error, error_q)
    result = _rounds(problem, solver, method, task, PROOF * max_seconds)
    result.solve_s = clock() - began
    result.condense_s = condensed - began if not plain else 0.0
    return result


def _by_continuation(stuck: Result, end: float) -> Result:
    """Solve a problem by way of others that differ in a coefficient alone; else return `stuck`.

    From where a method goes round in a circle another problem's solution is a way out. `end`: by
    the clock. Source: the homotopy in E. L. Allgower, K. Georg, Numerical Continuation Methods
    (1990).
    """
    problem = stuck.problem
    name = "mu" if problem.mu_r is None else "mu_r"
    for path in PATHS:
        found = stuck
        for part in (*path, 1.0):
            left = end - clock()
            if left <= 0.0:
                return stuck
            other = replace(problem, **{name: part * getattr(problem, name)})
            guess = Solution(found.u, found.r)
            found = _solve_once(other, stuck.tol, stuck.solver, guess, stuck.strict, left)
        if found.status == "solved":
            found.problem, found.history = problem, [*stuck.history, *found.history]
            found.iterations += stuck.iterations
            return found
    return stuck


def _solve_plain(
    problem: Local, tol: float, r: Vector, strict: bool, began: float, max_seconds: float
) -> Result:
    """Solve a small local problem without more to it; one compiled call is often all."""
    w, mu = problem.W, problem.mu
    nc = len(mu)
    sweeps, every = first_sweeps(nc)
    tangent = (0,) if problem.spacedim == 2 else (0, 0)
    history = np.empty((100, 3))
    check, u = np.empty(6), np.empty(len(r))
    end = began + max_seconds - min(0.5 * max_seconds, 3e-7 * nc + 5e-8 * len(w.x))
    done, error, error_q, rows, made = compiled(local_sweeps)(
        tangent, (w.m, w.nz, w.p, w.i, w.x), problem.q, mu, r, (tol, tol, until(end)), sweeps,
        every, history, check, u,
    )  # fmt: skip
    if made is None:
        found = Errors(*check.tolist())
        if found.status(tol) == "solved":
            return Result(
                problem, "AUTO", tol, strict, r, u, found.error, found.error_q, clock() - began,
                0.0, done, [("NSGS", history[:rows])],
            )  # fmt: skip
    if made is None:
        blocks = reduce(problem)
    else:
        ptr, col, val, diagonal, rho = made
        blocks = Blocks(tangent, (), ptr, col, val, diagonal, problem.q, mu, np.zeros(nc), rho)
    task = Task(blocks, r, tol, tol, strict, end)
    task.work, task.iterations = done * sweep_work(blocks), done
    task.offer(r, error, error_q)
    task.note("NSGS", history[:rows])
    result = _rounds(problem, "AUTO", named("AUTO"), task, PROOF * max_seconds)
    result.solve_s = clock() - began
    return result


def _rounds(problem: Local | Global, solver: str, method: Any, task: Task, proof: float) -> Result:
    """Run a solver until the errors of the problem as given are small enough."""
    tol = task.tol
    for _ in range(ROUNDS):
        if not task.over:
            method(task)
        found = completed(problem, task.r, task.blocks)
        left = errors(problem, found, task.blocks)
        status = _status(left, task, tol)
        r = mended(task) if status == "solved_relative" else None
        if r is not None:
            other = completed(problem, r, task.blocks)
            after = errors(problem, other, task.blocks)
            if _status(after, task, tol) == "solved":
                task.r, found, left, status = r, other, after, "solved"
        if status == "solved" or task.late or not task.done or task.tol < 1e-3 * tol:
            break
        error = max(left.error, left.own_error)
        second = max(left.error_q, left.attainable / FREE, left.velocity_error / FREE)
        if error <= tol and (task.error_q > task.tol_q or second <= tol):
            break
        task.tighten(
            0.5 * tol / error if error > tol else 1.0, 0.5 * tol / second if second > tol else 1.0
        )
    result = Result(
        problem, solver.upper(), tol, task.strict, task.r, found.u, left.error, left.error_q,
        iterations=task.iterations, history=task.history, status=status, blocks=task.blocks,
    )  # fmt: skip
    result.__dict__["solution"] = found
    result.reason = _reason(status, left, task, tol, proof)
    return result


def _status(left: Errors, task: Task, tol: float) -> str:
    """Return what may be said of an iterate."""
    if task.strict and left.error_q > tol:
        return "not_solved"
    return left.status(tol)


def _reason(status: str, left: Errors, task: Task, tol: float, proof: float) -> str:
    """Return why a problem counts as not solved, or what is left over, or nothing.

    `proof`: seconds that looking for one may take.
    """
    if status == "solved":
        return ""
    if status == "solved_relative":
        return (
            f"only the relative error is met: scale-free residual {left.scale_free:.1e}, "
            f"velocity error {left.velocity_error:.1e}"
        )
    met = max(left.error, left.own_error) <= tol
    if left.velocity_error > FAR * tol and (met or _looks_jammed(task)):
        if proof_work(task.blocks.contacts) <= proof and is_infeasible(task.blocks):
            return "jammed, and infeasible: no impulses at all keep every contact from closing"
        return "jammed: nothing bounded was found, the error is small only against large impulses"
    if left.error < 1e-13 or task.error < 1e-13:
        return "stagnates at rounding"
    return "out of time" if task.late else "stagnates"


def _looks_jammed(task: Task) -> bool:
    """Return whether |r| grew tenfold while the second figure did not fall to a third."""
    if not task.sizes:
        return False
    last_q, last_r = task.sizes[-1]
    return any(size < 0.1 * last_r and last_q > 0.33 * error_q for error_q, size in task.sizes[:-1])
