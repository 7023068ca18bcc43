"""The solver that a time-stepping integrator calls: plain arrays in, impulses out, no Python."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsim.core.jitable import jitable
from mbsim.fclib.bodies.factors import body_matrix
from mbsim.fclib.bodies.proximal import (
    ALPHA,
    MOST,
    REACH,
    SMALLEST,
    newton_on_bodies,
    workspace,
)
from mbsim.fclib.bodies.sweeps import sweep_bodies
from mbsim.fclib.bodies.system import body_system, figures_at
from mbsim.fclib.clock import late, unlimited
from mbsim.fclib.cone import FREE, bring_into_cones

if TYPE_CHECKING:
    from mbsim.fclib.bodies.system import BodySystem
    from mbsim.fclib.problem import Indices, Vector


@jitable
def solve_contacts(
    inverse: Vector,
    bodies: Indices,
    h: Vector,
    mu: Vector,
    w: Vector,
    r: Vector,
    tol: float,
    sweeps: int,
    newtons: int,
) -> tuple[float, float, float, int, int]:
    """Solve contacts with Coulomb friction in 3D from a warm start, first by sweeps, then Newton's.

    u = w + H' M^-1 H r; K contains r, and u + mu |u_T| e_N is in its dual and normal to r.

    Parameters
    ----------
    inverse
        (bodies, 6, 6) M^-1 of each body, in the frame in which h takes its velocity; 0: not moved.
    bodies
        (nc, 2) int32 or int64, the bodies of each contact; -1: ground.
    h
        (nc, 2, 3, 6) what the contact's velocity (normal first, then the two tangents) is of each
        body's velocity; signs included, so that u is the velocity of the first relative to the
        second (or as you like: the normal component is what must not become negative).
    mu
        (nc,) coefficients of friction.
    w
        (nc, 3) the contacts' velocities without impulses (with restitution or position terms
        added to its normal part as the scheme wants).
    r
        (nc, 3) impulses, in: the start (0 or a warm start), out: the best found.
    tol
        Largest error: 1e-3 of a few sweeps, 1e-8 for exact Coulomb (`bodies.system.body_errors`:
        the first figure is at most tol, the scale-free and velocity ones at most 9.9 tol).
    sweeps, newtons
        At most so many sweeps, then so many Newton iterations; 0: none.

    Returns
    -------
    error, scale-free residual, velocity error, sweeps done, Newton iterations done.
    """
    system = body_system(
        (0, 0), (), inverse, bodies, h, w.reshape(-1), mu, np.zeros(len(mu))
    )
    best = r.reshape(-1)
    figures, done, iterations = solve_system(
        system, len(inverse), best, tol, sweeps, newtons, unlimited()
    )
    return figures[0], figures[1], figures[2], done, iterations


@jitable
def _distance(figures: tuple[float, float, float], tol: float) -> float:
    """Return how many times as large as allowed the figures are, the largest of them."""
    return max(figures[0], max(figures[1], figures[2]) / FREE) / tol


@jitable
def solve_system(
    system: BodySystem,
    count: int,
    r: Vector,
    tol: float,
    sweeps: int,
    newtons: int,
    until: Vector,
) -> tuple[tuple[float, float, float], int, int]:
    """Solve a system of `count` bodies; r (m,) is the start and then the best impulses.

    Returns the figures (`body_errors`), sweeps and Newton iterations done.
    """
    d = 1 + len(system.tangent) + len(system.rolling)
    work = workspace(system, count)
    figures = figures_at(system, r, work.v, work.u, work.room)
    x, done, every = r.copy(), 0, 4
    small = np.empty(5 * d)
    while done < sweeps and _distance(figures, tol) > 1.0 and not late(until):
        for _ in range(every):
            sweep_bodies(system, x, work.v, small)
            done += 1
        found = figures_at(system, x, work.v, work.u, work.room)
        if _distance(found, tol) < _distance(figures, tol):
            figures = found
            r[:] = x
    iterations = 0
    if newtons == 0 or _distance(figures, tol) <= 1.0 or late(until):
        return figures, done, iterations
    matrix = body_matrix(system, count)
    x[:] = r
    centre = r.copy()
    alpha, failed, since = ALPHA, 0.0, 0
    while iterations < newtons and _distance(figures, tol) > 1.0 and not late(until):
        work.x[:] = centre
        spent, good = newton_on_bodies(
            system, matrix, work, centre, alpha, 0.05, MOST, until
        )
        iterations += max(spent, 1)
        bring_into_cones(system.tangent, system.mu, work.x, work.trial)
        found = figures_at(system, work.trial, work.v, work.trial_u, work.room)
        if _distance(found, tol) < _distance(figures, tol):
            figures = found
            r[:] = work.trial
        if good:
            since += 1
            for k in range(len(centre)):
                centre[k] += REACH * (work.x[k] - centre[k])
            alpha = max(0.3 * alpha, SMALLEST)
        else:
            alpha = min(4.0 * alpha, 1e3)
    return figures, done, iterations
