"""Points within a step that was taken: rows of results, and what the problem looks at."""

from __future__ import annotations

from mbsim.core.address import call_float, call_int
from mbsim.core.arrays import F1
from mbsim.core.jitable import jitable
from mbsim.core.problem import Problem
from mbsim.integrators.scheme import (
    EVENT_DUE,
    LAST_STEP,
    LAST_TIME,
    NEXT_OUTPUT,
    OUTPUTS,
    TIME,
    TOL,
    Method,
    Steps,
    failure_or,
    interpolate,
    project,
)


@jitable
def outputs(p: Problem, m: Method, steps: Steps, times: F1) -> int:
    """Write a row for every output time within the last step; return 0, FULL, or less a code."""
    t, h = m.memory[LAST_TIME], m.memory[LAST_STEP]
    t_new = m.memory[TIME]
    # forces that depend on a fixed step are shown as they acted
    within = h if steps.order == 0.0 else 0.0
    while m.counts[NEXT_OUTPUT] < len(times):
        when = times[m.counts[NEXT_OUTPUT]]
        # a row at the time of an event holds what is after it
        if when > t_new or (when == t_new and m.memory[EVENT_DUE] == 1.0):
            return 0
        interpolate(m, min(1.0, (when - t) / h), m.trial)
        project(p, m, when, 0.0, m.trial)
        m.counts[OUTPUTS] += 1
        m.counts[NEXT_OUTPUT] += 1
        full = call_int(p.output, (p.context, when, within, m.trial, m.error))
        code = failure_or(m, 0)
        if code != 0 or full != 0:
            return -code if code != 0 else full
    return 0


@jitable
def look_inside(p: Problem, m: Method, asked: float) -> int:
    """Let the problem look at inner points of the last step; return 0 or its code."""
    t, h, part = m.memory[LAST_TIME], m.memory[LAST_STEP], asked
    while part >= 0.0:
        interpolate(m, part, m.trial)
        project(p, m, t + part * h, 0.0, m.trial)
        m.counts[OUTPUTS] += 1
        code = call_int(p.look, (p.context, t + part * h, part * h, m.trial, m.error))
        if code != 0:
            return code
        m.error[0] = m.memory[TOL]
        part = call_float(p.inner, (p.context, t, 0.0, m.y, m.error))
    return 0
