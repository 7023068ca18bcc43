"""What the driver asks of an explicit method, and what a method keeps.

A method is one file with two functions on arrays. Both are C functions behind addresses, as the
problem's hooks are, so the driver is compiled once for all methods and a run compiles the one it
uses. With p the problem, m the `Method` and k the stages, k[0] = f at the committed point m.y:

* `attempt(p, m, t, h)` goes from (t, y) to t + h: fills the stages, `trial`, projected before
  f is taken there into k[last], and memory[LAST_ERROR] = local error over memory[TOL]. A method
  that knows before the last stage that the step fails may leave that stage out. It counts
  its evaluations and returns 0 or the code of the hook that failed.
* `fit_dense(p, m, t, h)` fills `dense` for a step that is about to be accepted, only where an
  output or a peak lies in it. It may take more stages, if it leaves the problem evaluated at
  the trial point. The polynomial in s = 0..1, r = 1 - s, is
  d0 + s (d1 + r (d2 + s (d3 + r (d4 + ...)))).

`order` is the power of h that the error of a step has; 0 stands for a method without an error
estimate: the step is what the problem's hook `stable` says, at most h_max, and holds for
STABLE_EVERY steps; the guards of single impacts are left out.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from mbsim.core.address import pack, view
from mbsim.core.arrays import F1, F2, I1
from mbsim.core.jitable import jitable
from mbsim.core.problem import HOOK, Problem

# memory
TIME, STEP, ERROR_BEFORE, HAVE_F, H_SMALLEST, LAST_ERROR, H_LARGEST = range(7)
LAST_TIME, LAST_STEP, FIRST_MAX, TOL, AFTER_REJECTION, STALE, EVENT_DUE = range(7, 14)
# counts
STEPS, REJECTED, EVALUATIONS, NEXT_OUTPUT, LAST_REASON, CODE, OUTPUTS, FAILURES = range(8)


class Scheme(NamedTuple):
    """A method: its two functions as hooks, and its numbers."""

    attempt: Callable[..., float]
    fit_dense: Callable[..., float]
    stages: int  # rows of k
    last: int  # row of k with f at the trial point
    dense: int  # coefficients of the dense output
    order: float  # power of h in the error of a step; 0: no estimate, fixed steps
    memory: float = 0.0  # how much the last error counts in step control (`control.next_factor`)


class Method(NamedTuple):
    """What a method keeps; `memory` is saved with the state, the rest is scratch."""

    y: F1  # (n,) the committed point
    k: F2  # (stages, n); row 0 is f at the committed point
    trial: F1  # (n,)
    error: F1  # (n,)
    dense: F2  # (coefficients, n) polynomial of the last step that something lay in
    memory: F1  # (14,) see the names above
    counts: I1  # (8,) see the names above
    bodies: I1  # (1,) how many bodies begin y, for methods that know positions from velocities


class Bench(NamedTuple):
    """What stands behind the context of a method's two functions."""

    problem: I1  # (15,) the fields of `Problem`
    method: Method


class Steps(NamedTuple):
    """A method bound to a problem, as compiled code takes it."""

    context: int
    attempt: int
    fit_dense: int
    last: int
    order: float
    memory: float


def make(scheme: Scheme, y0: Any, t0: float, bodies: int = 0) -> Method:
    """Return the method at rest at (t0, y0), whose first numbers are those of `bodies` bodies."""
    n = len(y0)
    memory = np.zeros(14)
    memory[TIME] = t0
    memory[ERROR_BEFORE] = 1.0
    memory[H_SMALLEST] = math.inf
    return Method(
        np.array(y0, dtype=np.float64),
        np.zeros((scheme.stages, n)),
        np.zeros(n),
        np.zeros(n),
        np.zeros((scheme.dense, n)),
        memory,
        np.zeros(8, dtype=np.int64),
        np.array([bodies], dtype=np.int64),
    )


def bind(scheme: Scheme, problem: Problem, method: Method) -> tuple[Steps, Any]:
    """Return the method bound to a problem, and what must live as long as it is used."""
    from mbsim.core import jit

    bench = Bench(np.array(problem, dtype=np.int64), method)
    table = pack(bench)
    attempt, fit_dense = (jit.address(f, HOOK) for f in (scheme.attempt, scheme.fit_dense))
    context = int(table.ctypes.data)
    steps = Steps(context, attempt, fit_dense, scheme.last, scheme.order, scheme.memory)
    return steps, (table, bench)


@jitable
def on_bench(context):
    """Return the problem and the method that stand behind `context`."""
    bench = view(context, Bench)
    w = bench.problem
    first = (w[0], w[1], w[2], w[3], w[4], w[5], w[6])
    problem = Problem(*first, w[7], w[8], w[9], w[10], w[11], w[12], w[13], w[14])
    return problem, bench.method


@jitable
def combine(k, weights, count, out):
    """Write the sum of weights[j] k[j], j < count, into `out`."""
    for i in range(len(out)):
        out[i] = 0.0
    for j in range(count):
        weight = weights[j]
        if weight != 0.0:
            for i in range(len(out)):
                out[i] += weight * k[j, i]
