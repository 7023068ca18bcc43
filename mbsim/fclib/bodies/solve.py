"""The solver that a time-stepping integrator calls: plain arrays in, impulses out, no Python."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsim.core.jitable import jitable
from mbsim.fclib.bodies.factors import BodyMatrix, body_matrix
from mbsim.fclib.bodies.proximal import proximal_bodies
from mbsim.fclib.bodies.sweeps import sweep_system
from mbsim.fclib.bodies.system import SIX, body_errors, body_figures, body_system
from mbsim.fclib.clock import unlimited
from mbsim.fclib.solvers.proximal import ALPHA, BEST, BEST_Q, ERROR, NEWTONS, REACH, SHARP, STATE
from mbsim.fclib.solvers.task import Goal

if TYPE_CHECKING:
    from mbsim.fclib.bodies.system import BodySystem
    from mbsim.fclib.problem import Indices, Vector

#: Sweeps between looks at the error, which costs as much as two of them.
EVERY = 8
#: alpha, rho and reach of the proximal method (`solvers.proximal`).
BEGIN = (1e-3, 10.0, 1.6)


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
    system = body_system((0, 0), (), inverse, bodies, h, w.reshape(-1), mu, np.zeros(len(mu)))
    best = r.reshape(-1)
    goal = Goal(tol, tol, unlimited())
    done, iterations = solve_system(system, len(inverse), best, goal, sweeps, newtons)
    m = len(best)
    u, v, room = np.empty(m), np.empty((len(inverse), SIX)), np.empty(m)
    body_errors(system, best, v, u, room)
    published, own, free, speeds, _ = body_figures(system, u, best, len(inverse), room)
    return max(published, own), free, speeds, done, iterations


@jitable
def empty_matrix(system: BodySystem, count: int) -> BodyMatrix:
    """Return the matrix over no contacts of `count` bodies."""
    return body_matrix(system, count, np.zeros(len(system.mu), np.bool_))


@jitable
def solve_system(
    system: BodySystem, count: int, r: Vector, goal: Goal, sweeps: int, newtons: int
) -> tuple[int, int]:
    """Solve a system of `count` bodies: at most so many sweeps, then so many Newton iterations.

    r (m,) is the start and then the best impulses. Returns the sweeps and iterations done.
    """
    history = np.empty((0, 3))
    done, error, error_q, _ = sweep_system(system, count, r, goal, sweeps, EVERY, history)
    if newtons == 0 or (error <= goal.tol and error_q <= goal.tol_q):
        return done, 0
    state = np.zeros(STATE)
    state[ALPHA], state[SHARP], state[REACH] = BEGIN
    state[BEST] = state[ERROR] = error
    state[BEST_Q] = error_q
    matrix = empty_matrix(system, count)
    proximal_bodies(system, matrix, r, r.copy(), state, goal, newtons, history)
    return done, int(state[NEWTONS])
