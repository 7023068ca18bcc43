"""Semismooth Newton on Alart and Curnier's function, in the bodies' velocities.

With x = r - rho u and Phi(x) = (max(0, x_N), P(x_T; |.| <= mu max(0, x_N))), F = r - Phi(x) is 0 at
a solution. Proximal: u is that of W + s_i I, w - s_i c, with a centre c and s_i = alpha / rho_i.
Each contact gives

    dr = b - D H' dv,  D = A^-1 rho Phi',  b = -A^-1 F,  A = I - (1 - rho s) Phi',

and dv = M^-1 H dr leaves (I + M^-1 H D H') dv = M^-1 H b (`factors`).
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from mbsim.core.jitable import jitable
from mbsim.fclib.bodies.factors import (
    BodyMatrix,
    assemble,
    factor_bodies,
    solve_bodies,
)
from mbsim.fclib.bodies.system import contact_velocities, velocities_by

if TYPE_CHECKING:
    from mbsim.fclib.bodies.system import BodySystem
    from mbsim.fclib.problem import Vector


@jitable
def _ball(
    many: int, r: Vector, u: Vector, first: int, bound: float, rho: float, out: Vector
) -> float:
    """Write r - P(r - rho u; |.| <= bound) of `many` numbers; return -1 inside, else g.

    g = bound / |r - rho u| < 1, at least 1e-300.
    """
    length = 0.0
    for k in range(first, first + many):
        length += (r[k] - rho * u[k]) ** 2
    length = math.sqrt(length)
    if length <= bound:
        for k in range(first, first + many):
            out[k] = rho * u[k]
        return -1.0
    g = max(bound / length, 1e-300)
    for k in range(first, first + many):
        out[k] = r[k] - g * (r[k] - rho * u[k])
    return g


@jitable
def function_of_bodies(
    system: BodySystem, rho: Vector, r: Vector, u: Vector, slip: Vector, out: Vector
) -> float:
    """Write F and the contacts' states; return the square root of the sum of |F_i|^2 / rho_i.

    That is an energy: a light body's contact counts as much as a heavy one's. slip (nc, 2): 0 open;
    closed: -1 stick, or g = mu x_N / |x_T| < 1; the same of rolling.
    """
    nt, nr = len(system.tangent), len(system.rolling)
    d = 1 + nt + nr
    total = 0.0
    for a in range(len(system.mu)):
        first = d * a
        normal = r[first] - rho[a] * u[first]
        slip[a, 0], slip[a, 1] = 0.0, 0.0
        if normal <= 0.0:
            for k in range(first, first + d):
                out[k] = r[k]
        else:
            out[first] = rho[a] * u[first]
            slip[a, 0] = _ball(nt, r, u, first + 1, system.mu[a] * normal, rho[a], out)
            if nr > 0:
                bound = system.mu_r[a] * normal
                slip[a, 1] = _ball(nr, r, u, first + 1 + nt, bound, rho[a], out)
        square = 0.0
        for k in range(first, first + d):
            square += out[k] ** 2
        total += square / rho[a]
    return math.sqrt(total)


@jitable
def _linearise_ball(
    many: int,
    place: int,
    mu: float,
    rho: float,
    shift: float,
    g: float,
    x: Vector,
    function: Vector,
    derivative: Vector,
    b: Vector,
) -> None:
    """Write rows `place` on of a contact's D and b; x, `function` and b begin at the contact.

    With e = x / |x|, P = I - e e', k = 1 - rho s: D_N = mu e / s, D = rho g / (1 - k g) P, and
    b = -(e . F) e - P F / (1 - k g) + k mu e b_N; inside the ball D = I / s, b = -F / (rho s).
    """
    keep = 1.0 - rho * shift
    if g < 0.0:
        for s in range(place, place + many):
            b[s] = -function[s] / (rho * shift)
            derivative[s, s] = 1.0 / shift
        return
    length, along = 0.0, 0.0
    for s in range(place, place + many):
        length += x[s] ** 2
        along += x[s] * function[s]
    length = math.sqrt(length)
    along /= length
    across = 1.0 / (1.0 - keep * g)
    for s in range(place, place + many):
        e = x[s] / length
        derivative[s, 0] = mu * e / shift
        b[s] = -across * (function[s] - along * e) - along * e + keep * mu * e * b[0]
        for t in range(place, place + many):
            unit = 1.0 if s == t else 0.0
            derivative[s, t] = rho * g * across * (unit - e * x[t] / length)


@jitable
def linearise(
    system: BodySystem,
    rho: Vector,
    alpha: float,
    r: Vector,
    u: Vector,
    slip: Vector,
    function: Vector,
    derivative: Vector,
    b: Vector,
) -> None:
    """Write D (nc, d, d) and b (m,) of every contact."""
    nt, nr = len(system.tangent), len(system.rolling)
    d = 1 + nt + nr
    x = np.empty(d)
    for a in range(len(system.mu)):
        first = d * a
        shift = alpha / system.rho[a]
        derivative[a] = 0.0
        if slip[a, 0] == 0.0:
            for k in range(first, first + d):
                b[k] = -function[k]
            continue
        for k in range(d):
            x[k] = r[first + k] - rho[a] * u[first + k]
        f, c, mine = function[first : first + d], b[first : first + d], derivative[a]
        c[0] = -f[0] / (rho[a] * shift)
        mine[0, 0] = 1.0 / shift
        _linearise_ball(nt, 1, system.mu[a], rho[a], shift, slip[a, 0], x, f, mine, c)
        if nr > 0:
            _linearise_ball(nr, 1 + nt, system.mu_r[a], rho[a], shift, slip[a, 1], x, f, mine, c)


@jitable
def direction_of_bodies(
    system: BodySystem,
    matrix: BodyMatrix,
    derivative: Vector,
    b: Vector,
    v: Vector,
    step: Vector,
    rate: Vector,
    until: Vector,
) -> bool:
    """Write Newton's step (m,) and W times it; return whether the matrix was regular."""
    d = 1 + len(system.tangent) + len(system.rolling)
    assemble(system, matrix, derivative)
    if not factor_bodies(matrix, until):
        return False
    solve_bodies(system, matrix, b, v)
    contact_velocities(system, v, rate)
    for a in range(len(system.mu)):
        for s in range(d):
            total = b[d * a + s]
            for t in range(d):
                total -= derivative[a, s, t] * (rate[d * a + t] - system.w[d * a + t])
            step[d * a + s] = total
    velocities_by(system, step, v)
    contact_velocities(system, v, rate)
    for k in range(len(rate)):
        rate[k] -= system.w[k]
    return True
