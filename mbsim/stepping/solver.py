"""Contacts of one step: Coulomb's law at every point, in the space of the bodies' velocities.

With v the velocities of the bodies, u = H v at a contact point and r its impulse,

    v = v_free + sum of answer r,   answer = M^-1 H',   W = H answer

    0 <= r_n  _|_  u_n + ahead >= 0,    |r_t| <= mu r_n, against u_t where that slips

block Gauss-Seidel goes through the points and solves each one exactly
(`fclib.one_contact`), the others' impulses being as they are; v follows at once, so nothing is
assembled. Source: V. Acary, B. Brogliato, Numerical Methods for Nonsmooth Dynamical Systems (2008),
section 13.7. What sweeps leave, `finish` is where a Newton method on the same arrays goes on.
"""

from __future__ import annotations

import math

from mbsim.core.arrays import F1, F2, F4
from mbsim.core.jitable import jitable
from mbsim.fclib.one_contact import contact_3d
from mbsim.stepping.arrays import Points

#: Sweeps of a step at most, and how many go by before the residual is looked at first.
MOST_SWEEPS = 400


@jitable
def velocity_of(H: F4, k: int, a: int, v: F2, i: int, j: int) -> float:
    """Return component a of u at point k."""
    u = 0.0
    for c in range(6):
        u += H[k, 0, a, c] * v[i, c] + H[k, 1, a, c] * v[j, c]
    return u


@jitable
def apply(answer: F4, k: int, v: F2, i: int, j: int, r: tuple[float, float, float]) -> None:
    """Add what an impulse at point k does to the velocities of its bodies."""
    for c in range(6):
        v[i, c] += (
            answer[k, 0, c, 0] * r[0] + answer[k, 0, c, 1] * r[1] + answer[k, 0, c, 2] * r[2]
        )
        v[j, c] += (
            answer[k, 1, c, 0] * r[0] + answer[k, 1, c, 1] * r[1] + answer[k, 1, c, 2] * r[2]
        )


@jitable
def solve_point(p: Points, v: F2, k: int) -> float:
    """Let point k obey its law; return by how much that changes its velocity."""
    H, W, r = p.H, p.W, p.r
    i, j = p.body[k, 0], p.body[k, 1]
    un = velocity_of(H, k, 0, v, i, j) + p.ahead[k]
    rn, rx, ry = r[k, 0], r[k, 1], r[k, 2]
    if un >= 0.0 and rn == 0.0 and rx == 0.0 and ry == 0.0:
        return 0.0
    ux, uy = velocity_of(H, k, 1, v, i, j), velocity_of(H, k, 2, v, i, j)
    bn = un - (W[k, 0, 0] * rn + W[k, 0, 1] * rx + W[k, 0, 2] * ry)
    bx = ux - (W[k, 1, 0] * rn + W[k, 1, 1] * rx + W[k, 1, 2] * ry)
    by = uy - (W[k, 2, 0] * rn + W[k, 2, 1] * rx + W[k, 2, 2] * ry)
    sn, sx, sy = contact_3d(W, k, bn, bx, by, p.mu[k], rn, rx, ry)
    dn, dx, dy = sn - rn, sx - rx, sy - ry
    if dn == 0.0 and dx == 0.0 and dy == 0.0:
        return 0.0
    r[k, 0], r[k, 1], r[k, 2] = sn, sx, sy
    apply(p.answer, k, v, i, j, (dn, dx, dy))
    return max(W[k, 0, 0] * abs(dn), max(W[k, 1, 1] * abs(dx), W[k, 2, 2] * abs(dy)))


@jitable
def sweep(p: Points, v: F2, count: int, backward: bool) -> float:
    """Go once through the points; return the largest change of a velocity."""
    largest = 0.0
    for step in range(count):
        k = count - 1 - step if backward else step
        change = solve_point(p, v, k)
        if not change <= largest:
            largest = change
    return largest


@jitable
def gradient(p: Points, count: int) -> float:
    """Return the square of what the last sweep changed of the impulses, in the norm of W."""
    square = 0.0
    for k in range(count):
        for a in range(3):
            square += p.W[k, a, a] * (p.r[k, a] - p.old[k, a]) ** 2
    return square


@jitable
def go_on(p: Points, v: F2, count: int, part: float) -> None:
    """Go on along the way of the sweeps before: a part of it, and let the way be that of all."""
    for k in range(count):
        if part > 0.0:
            d = (part * p.way[k, 0], part * p.way[k, 1], part * p.way[k, 2])
            for a in range(3):
                p.way[k, a] = d[a] + p.r[k, a] - p.old[k, a]
                p.r[k, a] += d[a]
            apply(p.answer, k, v, p.body[k, 0], p.body[k, 1], d)
        else:
            for a in range(3):
                p.way[k, a] = p.r[k, a] - p.old[k, a] if part == 0.0 else 0.0
        for a in range(3):
            p.old[k, a] = p.r[k, a]


@jitable
def solve_contacts(p: Points, v: F2, count: int, allowed: float) -> tuple[float, int]:
    """Fill r and v of `count` points; return what a sweep still changes of a velocity, and sweeps.

    Both are as a guess says: r of the last step, v with that. Sweeps end where a velocity changes
    by less than `allowed`. Between them impulses go on along the way of the sweeps before, as
    conjugate gradients do, which is dropped where a sweep changes more than the last one.
    Source: M. Silcowitz, S. Niebe, K. Erleben, A nonsmooth nonlinear conjugate gradient method for
    interactive contact force problems, The Visual Computer 26 (2010) 893.
    """
    left, before, sweeps = 0.0, 0.0, 0
    for k in range(count):
        for a in range(3):
            p.old[k, a] = p.r[k, a]
    while sweeps < MOST_SWEEPS:
        left = sweep(p, v, count, False)
        sweeps += 1
        if left <= allowed or sweeps == MOST_SWEEPS or not math.isfinite(left):
            break
        square = gradient(p, count)
        part = -1.0
        if sweeps == 1:
            part = 0.0
        elif square <= before:
            part = square / before
        go_on(p, v, count, part)
        before = square
    return left, sweeps


@jitable
def project_positions(p: Points, shift: F2, count: int, h: float, slop: float) -> int:
    """Change displacements over h so that no point ends deeper than `slop`; return the sweeps.

    The least change in the norm of the mass: gap + h H_n shift >= 0 without friction, pushes start
    at 0. Where nothing ends so deep nothing changes.
    """
    for k in range(count):
        p.push[k] = 0.0
    sweeps, worst = 0, math.inf
    while sweeps < MOST_SWEEPS and worst > slop:
        worst = 0.0
        for step in range(count):
            k = count - 1 - step if sweeps % 2 == 1 else step
            i, j = p.body[k, 0], p.body[k, 1]
            gap = p.gap[k] + h * velocity_of(p.H, k, 0, shift, i, j)
            if gap >= -0.5 * slop and p.push[k] == 0.0:
                continue
            wanted = p.push[k] - gap / (h * p.W[k, 0, 0]) if p.W[k, 0, 0] > 0.0 else 0.0
            change = max(wanted, 0.0) - p.push[k]
            p.push[k] += change
            apply(p.answer, k, shift, i, j, (change, 0.0, 0.0))
            worst = max(worst, abs(change) * p.W[k, 0, 0] * h)
        sweeps += 1
    return sweeps
