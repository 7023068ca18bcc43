"""A method bound to a problem: its functions and what they ask, behind addresses."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from mbsim.core import jit
from mbsim.core.address import pack, vector_at
from mbsim.core.arrays import F1, Pointer
from mbsim.core.problem import HOOK, Problem
from mbsim.core.signature import FLOAT, INT, POINTER
from mbsim.integrators import branches, changing, driver, events, rates
from mbsim.integrators.scheme import WATCH, Method, Scheme, Steps, Workspace


def bind(
    scheme: Scheme, problem: Problem, method: Method, probe: Scheme | None = None
) -> tuple[Steps, Any]:
    """Return the method bound to a problem, and what must live as long as it is used."""
    if scheme.implicit and problem.linearise == 0:
        raise ValueError("this problem has no linearisation, which an implicit method needs")
    workspace = Workspace(np.array(problem, dtype=np.int64), method)
    table = pack(workspace)
    attempt, fit_dense = (jit.address(f, HOOK) for f in (scheme.attempt, scheme.fit_dense))
    context = int(table.ctypes.data)
    numbers = (scheme.last, scheme.order, scheme.memory, scheme.implicit, scheme.resumes)
    looks = jit.address(branches.serve, branches.ASKED) if problem.switching != 0 else 0
    locates = jit.address(events.serve, events.ASKED) if problem.happens != 0 else 0
    probes = jit.address(probe.attempt, HOOK) if probe is not None else 0
    calm = jit.address(changing.serve, changing.ASKED) if probe is not None else 0
    changes = method.memory[WATCH] == 1.0 and not scheme.implicit
    rate = jit.address(rates.serve, rates.ASKED) if changes else 0
    steps = Steps(context, attempt, fit_dense, *numbers, looks, locates, probes, calm, rate)
    return steps, (table, workspace)


def advance(
    context: int,
    attempt: int,
    fit_dense: int,
    last: int,
    order: float,
    memory: float,
    implicit: int,
    resumes: float,
    branches: int,
    events: int,
    probe: int,
    calm: int,
    rate: int,
    t_end: float,
    tol: float,
    h_max: float,
    h_min: float,
    times: Pointer,
    count: int,
    budget: int,
) -> int:
    """Advance as `driver.advance` does.

    Many arguments because a C function takes the fields of `Steps` one by one.
    """
    steps = Steps(
        *(context, attempt, fit_dense, last, order, memory, implicit != 0, resumes),
        *(branches, events, probe, calm, rate),
    )
    return driver.advance(steps, t_end, tol, h_max, h_min, vector_at(times, count), budget)


_ADVANCE = INT(
    *(INT, INT, INT, INT, FLOAT, FLOAT, INT, FLOAT, INT, INT, INT, INT, INT),
    *(FLOAT, FLOAT, FLOAT, FLOAT, POINTER, INT, INT),
)


def advancing() -> Callable[..., int]:
    """Return `driver.advance` compiled, with its arguments; it runs without Python's lock."""
    compiled = _ADVANCE.at(jit.address(advance, _ADVANCE))

    def advance_to(
        steps: Steps, t_end: float, tol: float, h_max: float, h_min: float, times: F1, budget: int
    ) -> int:
        given = (t_end, tol, h_max, h_min, times.ctypes.data, len(times), budget)
        return int(compiled(*steps, *given))

    return advance_to
