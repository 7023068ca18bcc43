"""Where within a step an event happens: the problem's hook `happens` says by when it has.

What the driver asks of events stands behind an address, `serve`: problems that locate none compile
nothing of it.
"""

from __future__ import annotations

from mbsim.core.address import call_int, vector_at
from mbsim.core.arrays import F1, Pointer
from mbsim.core.jitable import jitable
from mbsim.core.problem import Problem
from mbsim.core.signature import FLOAT, INT, POINTER
from mbsim.integrators.scheme import NEXT_OUTPUT, Method, answer_of, in_workspace, interpolate

#: A step is looked into for events at so many points, and at one more for each row within it,
#: up to so many.
LOOKS, MOST_LOOKS = 4, 64
#: Of `serve`: context, what is asked, time and step, the output times and their number.
ASKED = FLOAT(INT, INT, FLOAT, FLOAT, POINTER, INT)
#: The length up to the first event; to be evaluated at the trial point again.
FIRST, AT_END = range(2)


@jitable
def looks_within(m: Method, times: F1, t: float) -> int:
    """Return at how many points a step to time t is looked into for events."""
    looks, row = LOOKS, m.counts[NEXT_OUTPUT]
    while looks < MOST_LOOKS and row < len(times) and times[row] < t:
        looks += 1
        row += 1
    return looks


@jitable
def happens_at(p: Problem, m: Method, t: float, h: float, s: float) -> bool:
    """Return whether an event has happened by the part s of the step, its end being m.trial."""
    if s == 1.0:
        return answer_of(m, call_int(p.happens, (p.context, t + h, 0.0, m.trial, m.error))) == 1
    interpolate(m, s, m.error)
    return answer_of(m, call_int(p.happens, (p.context, t + s * h, 0.0, m.error, m.error))) == 1


@jitable
def first_event(p: Problem, m: Method, t: float, h: float, times: F1) -> float:
    """Return the length of the fitted step up to just behind its first event, 2 h for none.

    Bisection on whether it has happened, to the last digit of the time. The problem is left
    evaluated at another point.
    """
    looks, low, high = looks_within(m, times, t + h), 0.0, 2.0
    for k in range(1, looks + 1):
        s = k / looks if k < looks else 1.0
        if happens_at(p, m, t, h, s):
            high = s
            break
        low = s
    if high > 1.0:
        return 2.0 * h
    for _ in range(100):
        middle = 0.5 * (low + high)
        if t + middle * h <= t + low * h or t + middle * h >= t + high * h:
            break
        if happens_at(p, m, t, h, middle):
            high = middle
        else:
            low = middle
    return high * h


def serve(context: int, what: int, t: float, h: float, times: Pointer, count: int) -> float:
    """What the driver asks of events; return the length that FIRST asks for."""
    p, m = in_workspace(context)
    if what == FIRST:
        return first_event(p, m, t, h, vector_at(times, count))
    happens_at(p, m, t, h, 1.0)
    return 0.0
