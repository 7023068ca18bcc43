"""The proximal point method around Newton's (`newton`), in the bodies' velocities.

Each step solves the problem with W + s_i I and w - s_i c, s_i = alpha / rho_i; its solution moves
the centre c. The errors are always those of the problem itself.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from mbsim.core.jitable import jitable
from mbsim.fclib.bodies.factors import BodyMatrix, body_matrix
from mbsim.fclib.bodies.newton import direction_of_bodies, function_of_bodies, linearise
from mbsim.fclib.bodies.system import SIX, contact_velocities, figures_at, velocities_by
from mbsim.fclib.clock import late
from mbsim.fclib.cone import FREE, bring_into_cones

if TYPE_CHECKING:
    from mbsim.fclib.bodies.system import BodySystem
    from mbsim.fclib.problem import Vector

#: rho of Newton's function over that of the contact.
SHARP = 10.0
#: First alpha, and the smallest one: below, factors of I + M^-1 H D H' lose what it would gain.
ALPHA, SMALLEST = 1e-3, 1e-9
#: Newton iterations of a proximal step, and when a hopeless one is given up.
MOST, EARLY, HOPELESS = 15, 8, 0.3
#: Halvings of the line search, and earlier norms that it compares with.
HALVINGS, MEMORY = 8, 5
#: The centre goes so far towards the new point.
REACH = 1.6


class Workspace(NamedTuple):
    """Room of a run: (m,) vectors, (nc, 2) states, (bodies, 6) velocities, (nc, d, d) D."""

    x: Vector
    u: Vector
    trial: Vector
    trial_u: Vector
    step: Vector
    rate: Vector
    function: Vector
    b: Vector
    room: Vector
    slip: Vector
    rho: Vector
    v: Vector
    derivative: Vector


@jitable
def workspace(system: BodySystem, count: int) -> Workspace:
    """Return room for a run on `count` bodies."""
    nc, m = len(system.mu), len(system.w)
    d = 1 + len(system.tangent) + len(system.rolling)
    return Workspace(
        np.empty(m), np.empty(m), np.empty(m), np.empty(m), np.empty(m), np.empty(m), np.empty(m),
        np.empty(m), np.empty(m), np.empty((nc, 2)), np.empty(nc), np.empty((count, SIX)),
        np.empty((nc, d, d)),
    )  # fmt: skip


@jitable
def _line_search(
    system: BodySystem, work: Workspace, alpha: float, highest: float
) -> float:
    """Go along the step to where |F| <= (1 - 1e-4 t) `highest`, or to the best; return |F|.

    `rate` is the velocity change of the step, the proximal part included.
    """
    t, best_t, best = 1.0, 0.0, np.inf
    for k in range(HALVINGS + 2):
        if k == HALVINGS + 1:
            if best_t == 0.0 or best_t == t:
                break
            t = best_t
        for i in range(len(work.x)):
            work.trial[i] = work.x[i] + t * work.step[i]
            work.trial_u[i] = work.u[i] + t * work.rate[i]
        size = function_of_bodies(
            system, work.rho, work.trial, work.trial_u, work.slip, work.function
        )
        if size < best:
            best_t, best = t, size
        if size <= (1.0 - 1e-4 * t) * highest:
            break
        if k < HALVINGS:
            t *= 0.5
    if best < np.inf:
        work.x[:] = work.trial
        work.u[:] = work.trial_u
    return best


@jitable
def newton_on_bodies(
    system: BodySystem,
    matrix: BodyMatrix,
    work: Workspace,
    centre: Vector,
    alpha: float,
    aim: float,
    most: int,
    until: Vector,
) -> tuple[int, bool]:
    """Solve a proximal problem from work.x on until |F| is `aim` times what it was.

    Returns the iterations and whether it was reached.
    """
    d = 1 + len(system.tangent) + len(system.rolling)
    velocities_by(system, work.x, work.v)
    contact_velocities(system, work.v, work.u)
    for a in range(len(system.mu)):
        shift = alpha / system.rho[a]
        work.rho[a] = SHARP * system.rho[a] / (1.0 + alpha)
        for k in range(d * a, d * a + d):
            work.u[k] += shift * (work.x[k] - centre[k])
    size = function_of_bodies(system, work.rho, work.x, work.u, work.slip, work.function)
    recent = np.full(MEMORY, size)
    begin = size
    aim = aim * size
    for done in range(most):
        if size <= aim:
            return done, True
        if done >= EARLY and size > HOPELESS * begin:
            return done, False
        if late(until):
            return done, False
        linearise(
            system, work.rho, alpha, work.x, work.u, work.slip, work.function, work.derivative,
            work.b,
        )  # fmt: skip
        if not direction_of_bodies(
            system, matrix, work.derivative, work.b, work.v, work.step, work.rate, until
        ):
            return done, False
        for a in range(len(system.mu)):
            for k in range(d * a, d * a + d):
                work.rate[k] += alpha / system.rho[a] * work.step[k]
        size = _line_search(system, work, alpha, recent.max())
        if not math.isfinite(size):
            return done, False
        for k in range(MEMORY - 1):
            recent[k] = recent[k + 1]
        recent[MEMORY - 1] = size
    return most, size <= aim
