"""Contacts between rigid bodies: what of each body's motion a contact feels, and the products.

u = w + H' v, v = M^-1 H r: v (bodies, 6) is the change of the bodies' velocities by the impulses r,
w the contacts' velocities without them. Each contact has a block of H for each of its two bodies.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from mbsim.core.jitable import jitable
from mbsim.fclib.blocks import own_units
from mbsim.fclib.cone import FREE, LARGEST, NOISE, natural_map

if TYPE_CHECKING:
    from mbsim.fclib.problem import Indices, Vector

#: Unknowns of a body.
SIX = 6


class BodySystem(NamedTuple):
    """Contacts between bodies, as compiled code takes them.

    Parameters
    ----------
    tangent, rolling
        Tuples whose *lengths* are the numbers of tangential and rolling directions
        (`blocks.DelassusSystem`); a contact has d = 1 + their sum of unknowns.
    bodies
        (nc, 2) the bodies of a contact; -1: none, or one that impulses do not move.
    h
        (nc, 2, d, 6) u = w + sum of h v over the two bodies.
    pull
        (nc, 2, 6, d) M^-1 h': the change of a body's velocity by an impulse.
    own
        (nc, d, d) W_ii = sum of h M^-1 h'.
    w
        (nc * d,) velocities without impulses.
    mu, mu_r, rho
        (nc,) coefficients of friction and rolling friction, and 1 / lambda_max(W_ii).
    """

    tangent: tuple[int, ...]
    rolling: tuple[int, ...]
    bodies: Indices
    h: Vector
    pull: Vector
    own: Vector
    w: Vector
    mu: Vector
    mu_r: Vector
    rho: Vector


@jitable
def body_system(
    tangent: tuple[int, ...],
    rolling: tuple[int, ...],
    inverse: Vector,
    bodies: Indices,
    h: Vector,
    w: Vector,
    mu: Vector,
    mu_r: Vector,
) -> BodySystem:
    """Return a system; `inverse` (bodies, 6, 6) is M^-1, the other arrays as in `BodySystem`.

    A body of which it is zero is not moved by impulses.
    """
    nc, d = len(mu), 1 + len(tangent) + len(rolling)
    pull = np.zeros((nc, 2, SIX, d))
    own = np.zeros((nc, d, d))
    moved = np.full((nc, 2), np.int32(-1))
    for a in range(nc):
        for side in range(2):
            b = bodies[a, side]
            if b < 0:
                continue
            size = 0.0
            for i in range(SIX):
                for k in range(d):
                    total = 0.0
                    for j in range(SIX):
                        total += inverse[b, i, j] * h[a, side, k, j]
                    pull[a, side, i, k] = total
                    size += abs(total)
            if size > 0.0:
                moved[a, side] = b
        for side in range(2):
            for other in range(2):
                if moved[a, side] < 0 or moved[a, side] != moved[a, other]:
                    continue
                for s in range(d):
                    for t in range(d):
                        for i in range(SIX):
                            own[a, s, t] += h[a, side, s, i] * pull[a, other, i, t]
    rho = own_units(own, np.arange(nc))
    return BodySystem(tangent, rolling, moved, h, pull, own, w, mu, mu_r, rho)


@jitable
def velocities_by(system: BodySystem, r: Vector, v: Vector) -> None:
    """Write v = M^-1 H r (bodies, 6)."""
    v[:] = 0.0
    d = 1 + len(system.tangent) + len(system.rolling)
    for a in range(len(system.mu)):
        for side in range(2):
            b = system.bodies[a, side]
            if b >= 0:
                for i in range(SIX):
                    total = 0.0
                    for k in range(d):
                        total += system.pull[a, side, i, k] * r[d * a + k]
                    v[b, i] += total


@jitable
def contact_velocities(system: BodySystem, v: Vector, u: Vector) -> None:
    """Write u = w + H' v."""
    d = 1 + len(system.tangent) + len(system.rolling)
    for a in range(len(system.mu)):
        for k in range(d):
            u[d * a + k] = system.w[d * a + k]
        for side in range(2):
            b = system.bodies[a, side]
            if b >= 0:
                for k in range(d):
                    total = 0.0
                    for i in range(SIX):
                        total += system.h[a, side, k, i] * v[b, i]
                    u[d * a + k] += total


@jitable
def _rounded(system: BodySystem, r: Vector, count: int) -> Vector:
    """Return (nc,) the sum of the terms of which each contact's velocity consists, W's of r.

    Rounding may hide a few parts in 1e16 of it (`cone.own_share`).
    """
    d = 1 + len(system.tangent) + len(system.rolling)
    sizes, terms = np.zeros((count, SIX)), np.zeros(len(system.mu))
    for a in range(len(terms)):
        for side in range(2):
            b = system.bodies[a, side]
            if b >= 0:
                for i in range(SIX):
                    for k in range(d):
                        sizes[b, i] += abs(system.pull[a, side, i, k] * r[d * a + k])
    for a in range(len(terms)):
        for side in range(2):
            b = system.bodies[a, side]
            if b >= 0:
                for k in range(d):
                    for i in range(SIX):
                        terms[a] += abs(system.h[a, side, k, i]) * sizes[b, i]
    return terms


@jitable
def body_figures(
    system: BodySystem, u: Vector, r: Vector, count: int, work: Vector
) -> tuple[float, float, float, float, float]:
    """Return what `cone.own_errors` and `cone.relative_errors` say, from the bodies alone.

    These are |F| / max(|w|, |r|, |u|) with rho = 1, the same with each contact's own rho, the
    scale-free residual max_i |F_i| / max(|r_i|, rho_i |w_i|) of contacts where it is no rounding,
    the velocity error |F / rho| / |w|, and |F| / min(|w|, 1 + sqrt(|w|)). `work` (m,) is room.
    """
    tangent, rolling = system.tangent, system.rolling
    d = 1 + len(tangent) + len(rolling)
    given, impulse, moved, own_given, own_moved = 0.0, 0.0, 0.0, 0.0, 0.0
    plain, missing, speeds, free = 0.0, 0.0, 0.0, 0.0
    terms = np.empty(0)
    for a in range(len(system.mu)):
        rho, first = system.rho[a], d * a
        held, push, fast = 0.0, 0.0, 0.0
        for k in range(first, first + d):
            held += r[k] ** 2
            push += system.w[k] ** 2
            fast += u[k] ** 2
        given, impulse, moved = given + push, impulse + held, moved + fast
        own_given, own_moved = own_given + rho**2 * push, own_moved + rho**2 * fast
        mu, mu_r = system.mu[a], system.mu_r[a]
        plain += natural_map(tangent, rolling, mu, mu_r, u, r, first, 1.0, work)
        square = natural_map(tangent, rolling, mu, mu_r, u, r, first, rho, work)
        missing += square
        speeds += square / rho**2
        size = max(held, rho**2 * push)
        if square > free**2 * size:
            if len(terms) == 0:
                terms = _rounded(system, r, count)
            if math.sqrt(square) > NOISE * rho * terms[a]:
                free = min(math.sqrt(square / size), LARGEST) if size > 0.0 else LARGEST
    scale = math.sqrt(max(given, impulse, moved))
    own_scale = math.sqrt(max(own_given, impulse, own_moved))
    given, plain, missing = math.sqrt(given), math.sqrt(plain), math.sqrt(missing)
    speeds = math.sqrt(speeds)
    return (
        plain / scale if scale > 0.0 else plain,
        missing / own_scale if own_scale > 0.0 else missing,
        free,
        speeds / given if given > 0.0 else speeds,
        max(plain / given if given > 0.0 else plain, plain / (1.0 + math.sqrt(given))),
    )


@jitable
def body_errors(
    system: BodySystem, r: Vector, v: Vector, u: Vector, work: Vector
) -> tuple[float, float]:
    """Write v and u that go with r, and return the two figures of `cone.relative_errors`."""
    velocities_by(system, r, v)
    contact_velocities(system, v, u)
    error, own, free, speeds, second = body_figures(system, u, r, len(v), work)
    return max(error, own), max(second, free / FREE, speeds / FREE)
