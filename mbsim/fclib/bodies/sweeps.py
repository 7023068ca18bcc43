"""Block Gauss-Seidel in the bodies' velocities: contact by contact, each solved exactly.

A contact's velocity is read from its two bodies and its new impulse is given to them at once, so
that a sweep costs the same however many contacts a body has.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from mbsim.core.jitable import jitable
from mbsim.fclib.bodies.system import SIX, body_errors
from mbsim.fclib.clock import late
from mbsim.fclib.cone import is_better
from mbsim.fclib.one_contact import contact_2d, contact_3d, contact_rolling
from mbsim.fclib.solvers.task import Goal, record

if TYPE_CHECKING:
    from mbsim.fclib.bodies.system import BodySystem
    from mbsim.fclib.problem import Vector


@jitable
def _feel(h: Vector, a: int, side: int, motion: Vector, d: int, out: Vector) -> None:
    """Add what a contact feels of a body's velocity to its own."""
    for k in range(d):
        for i in range(SIX):
            out[k] += h[a, side, k, i] * motion[i]


@jitable
def _push(pull: Vector, a: int, side: int, change: Vector, d: int, motion: Vector) -> None:
    """Add the change of a body's velocity by the change of an impulse."""
    for i in range(SIX):
        total = 0.0
        for k in range(d):
            total += pull[a, side, i, k] * change[k]
        motion[i] += total


@jitable
def _one_contact(system: BodySystem, a: int, b: Vector, r: Vector, work: Vector) -> None:
    """Solve contact a, whose velocity is own r + b, in place."""
    tangent, rolling, own, mu = system.tangent, system.rolling, system.own, system.mu[a]
    first = (1 + len(tangent) + len(rolling)) * a
    if len(rolling) > 0:
        contact_rolling(tangent, rolling, own, a, b, mu, system.mu_r[a], r, first, work)
    elif len(tangent) == 1:
        r[first], r[first + 1] = contact_2d(own, a, b[0], b[1], mu, r[first], r[first + 1])
    else:
        r[first], r[first + 1], r[first + 2] = contact_3d(
            own, a, b[0], b[1], b[2], mu, r[first], r[first + 1], r[first + 2]
        )


@jitable
def sweep_bodies(system: BodySystem, r: Vector, v: Vector, work: Vector) -> float:
    """Solve every contact once; v (bodies, 6) goes with r, in and out.

    `work` has room for 5 d numbers. Returns the change of r over |r|.
    """
    d = 1 + len(system.tangent) + len(system.rolling)
    b, step = work[:d], work[d : 2 * d]
    change, size = 0.0, 0.0
    for a in range(len(system.mu)):
        first = d * a
        one, two = system.bodies[a, 0], system.bodies[a, 1]
        for k in range(d):
            b[k] = system.w[first + k]
            for j in range(d):
                b[k] -= system.own[a, k, j] * r[first + j]
        if one >= 0:
            _feel(system.h, a, 0, v[one], d, b)
        if two >= 0:
            _feel(system.h, a, 1, v[two], d, b)
        for k in range(d):
            step[k] = -r[first + k]
        _one_contact(system, a, b, r, work[2 * d :])
        moved = 0.0
        for k in range(d):
            step[k] += r[first + k]
            moved += step[k] ** 2
            size += r[first + k] ** 2
        change += moved
        if moved > 0.0:
            if one >= 0:
                _push(system.pull, a, 0, step, d, v[one])
            if two >= 0:
                _push(system.pull, a, 1, step, d, v[two])
    return math.sqrt(change / size) if size > 0.0 else math.sqrt(change)


@jitable
def sweep_system(
    system: BodySystem, count: int, r: Vector, goal: Goal, sweeps: int, every: int, history: Vector
) -> tuple[int, float, float, int]:
    """Sweep at most `sweeps` times, until the errors are small enough (`Goal`) or it is late.

    r (m,) is the start, and then the best iterate that was looked at. The errors are looked at
    after every `every` sweeps, which costs as much as two of them. Returns the sweeps done, the two
    figures of r, and the rows added to `history`.
    """
    d, m = 1 + len(system.tangent) + len(system.rolling), len(system.w)
    x, v, u, room = r.copy(), np.empty((count, SIX)), np.empty(m), np.empty(m)
    work = np.empty(5 * d)
    error, error_q = body_errors(system, r, v, u, room)
    done, rows = 0, 0
    over = error <= goal.tol and error_q <= goal.tol_q
    while done < sweeps and not over:
        change = 0.0
        for _ in range(min(every, sweeps - done)):
            change = sweep_bodies(system, x, v, work)
            done += 1
            if late(goal.until):
                break
        over = change == 0.0 or late(goal.until)
        now, now_q = body_errors(system, x, v, u, room)
        rows = record(history, rows, done, now, now_q)
        if is_better(goal.tol, now, now_q, x, error, error_q, r):
            error, error_q = now, now_q
            r[:] = x
        if now <= goal.tol and now_q <= goal.tol_q:
            break
    return done, error, error_q, rows
