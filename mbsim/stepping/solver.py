"""Contacts of one step: Coulomb's law at every point, in the space of the bodies' velocities.

With v the velocities of the bodies, u = H v at a contact point and r its impulse,

    v = v_free + sum of answer r,   answer = M^-1 H',   W = H answer

    0 <= r_n  _|_  u_n + ahead >= 0,    |r_t| <= mu r_n, against u_t where that slips

block Gauss-Seidel goes through the points and solves each one exactly
(`fclib.one_contact`), the others' impulses being as they are; v follows at once, so nothing is
assembled. Source: V. Acary, B. Brogliato, Numerical Methods for Nonsmooth Dynamical Systems (2008),
section 13.7. What sweeps leave, Newton's method on the same arrays finishes (`fclib.bodies`).
"""

from __future__ import annotations

import math

import numpy as np

from mbsim.core.arrays import F2, F4, V3
from mbsim.core.jitable import jitable
from mbsim.fclib.bodies.solve import solve_contacts
from mbsim.fclib.one_contact import contact_3d
from mbsim.stepping.arrays import Motion, Points

#: Sweeps before Newton's method, and behind it, at most.
FEW_SWEEPS, MOST_SWEEPS = 40, 400
#: Sweeps between looks at how much the bodies' velocities change in the step.
LOOKS = 8
#: What impacts may leave at most, over what the solver may leave where nothing meets.
MOST_LEFT = 10.0
#: How often the points of a pair are solved in one sweep at most.
MOST_ROUNDS = 5
#: Points up to which Newton's method finishes: of large piles a step's factors cost more than
#: sweeps bring, and warm starts go on from step to step.
NEWTON_POINTS = 300
#: Newton iterations of a step at most, and the smallest error that they go for.
NEWTONS, SHARPEST = 40, 1e-13


@jitable
def velocity_of(H: F4, k: int, a: int, v: F2, i: int, j: int) -> float:
    """Return component a of u at point k."""
    # four sums that do not wait for each other
    x = H[k, 0, a, 0] * v[i, 0] + H[k, 0, a, 1] * v[i, 1] + H[k, 0, a, 2] * v[i, 2]
    y = H[k, 0, a, 3] * v[i, 3] + H[k, 0, a, 4] * v[i, 4] + H[k, 0, a, 5] * v[i, 5]
    z = H[k, 1, a, 0] * v[j, 0] + H[k, 1, a, 1] * v[j, 1] + H[k, 1, a, 2] * v[j, 2]
    w = H[k, 1, a, 3] * v[j, 3] + H[k, 1, a, 4] * v[j, 4] + H[k, 1, a, 5] * v[j, 5]
    return (x + y) + (z + w)


@jitable
def apply(p: Points, k: int, v: F2, r: V3) -> None:
    """Add what an impulse at point k does to the velocities of the bodies that it moves."""
    if p.wide[k] >= 0:
        for row in range(p.wide[k], p.wide[k] + p.many[k]):
            b, moves = p.moved[row], p.moves[row]
            for c in range(6):
                v[b, c] += moves[c, 0] * r[0] + moves[c, 1] * r[1] + moves[c, 2] * r[2]
        return
    i, j, answer = p.body[k, 0], p.body[k, 1], p.answer
    for c in range(6):
        v[i, c] += answer[k, 0, 0, c] * r[0] + answer[k, 0, 1, c] * r[1] + answer[k, 0, 2, c] * r[2]
    for c in range(6):
        v[j, c] += answer[k, 1, 0, c] * r[0] + answer[k, 1, 1, c] * r[1] + answer[k, 1, 2, c] * r[2]


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
    # what brings it to rest: r - W^-1 u
    sn = rn - (p.stops[k, 0, 0] * un + p.stops[k, 0, 1] * ux + p.stops[k, 0, 2] * uy)
    sx = rx - (p.stops[k, 1, 0] * un + p.stops[k, 1, 1] * ux + p.stops[k, 1, 2] * uy)
    sy = ry - (p.stops[k, 2, 0] * un + p.stops[k, 2, 1] * ux + p.stops[k, 2, 2] * uy)
    most = p.mu[k] * sn
    bn = un - (W[k, 0, 0] * rn + W[k, 0, 1] * rx + W[k, 0, 2] * ry)
    if bn < 0.0 and sn >= 0.0 and sx * sx + sy * sy <= most * most and p.stops[k, 0, 0] > 0.0:
        dn, dx, dy = sn - rn, sx - rx, sy - ry
        r[k, 0], r[k, 1], r[k, 2] = sn, sx, sy
        apply(p, k, v, (dn, dx, dy))
        return max(W[k, 0, 0] * abs(dn), max(W[k, 1, 1] * abs(dx), W[k, 2, 2] * abs(dy)))
    bx = ux - (W[k, 1, 0] * rn + W[k, 1, 1] * rx + W[k, 1, 2] * ry)
    by = uy - (W[k, 2, 0] * rn + W[k, 2, 1] * rx + W[k, 2, 2] * ry)
    sn, sx, sy = contact_3d(W, k, bn, bx, by, p.mu[k], rn, rx, ry)
    dn, dx, dy = sn - rn, sx - rx, sy - ry
    if dn == 0.0 and dx == 0.0 and dy == 0.0:
        return 0.0
    r[k, 0], r[k, 1], r[k, 2] = sn, sx, sy
    apply(p, k, v, (dn, dx, dy))
    return max(W[k, 0, 0] * abs(dn), max(W[k, 1, 1] * abs(dx), W[k, 2, 2] * abs(dy)))


@jitable
def solve_pair(p: Points, v: F2, begin: int, end: int) -> float:
    """Solve points of one pair in turn; return the largest change over what may be left."""
    largest = 0.0
    for k in range(begin, end):
        change = solve_point(p, v, k) * p.counts[k]
        if not change <= largest:
            largest = change
    return largest


@jitable
def sweep(p: Points, v: F2, count: int) -> float:
    """Go once through the pairs; return the largest change of a velocity over what may be left.

    Points of one pair are solved a few times in turn: they bear on each other most, as corners of
    a face do.
    """
    largest, begin = 0.0, 0
    while begin < count:
        end = begin + 1
        while end < count and p.key[end] == p.key[begin]:
            end += 1
        first = solve_pair(p, v, begin, end)
        if not first <= largest:
            largest = first
        rounds, left = 1, first
        while end > begin + 1 and 1.0 < left < math.inf and rounds < MOST_ROUNDS:
            left = solve_pair(p, v, begin, end)
            rounds += 1
        begin = end
    return largest


@jitable
def let_jumps_count(p: Points, M: Motion, count: int, allowed: float, part: float) -> None:
    """Let that part of what a step changes of a body's velocity be left at its points.

    Never less than `allowed`, nor more than MOST_LEFT times that. An impact is taken by the step,
    which is off by far more.
    """
    for k in range(count):
        i, j = p.body[k, 0], p.body[k, 1]
        most = 0.0
        for b in (i, j):
            square = 0.0
            for c in range(3):
                square += (M.v[b, c] - M.before[b, c]) ** 2
            most = max(most, square)
        p.counts[k] = 1.0 / min(max(allowed, part * math.sqrt(most)), MOST_LEFT * allowed)


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
            apply(p, k, v, d)
        else:
            for a in range(3):
                p.way[k, a] = p.r[k, a] - p.old[k, a] if part == 0.0 else 0.0
        for a in range(3):
            p.old[k, a] = p.r[k, a]


@jitable
def sweep_on(
    p: Points, M: Motion, count: int, allowed: tuple[float, float], most: int
) -> tuple[float, int]:
    """Improve r and v of `count` points; return what a sweep still changes, sweeps.

    That is of a velocity, over what may be left of it: `allowed` and a part of jumps. Sweeps end
    where it is less than 1, or with `most`. Between them
    impulses go on along the way of the sweeps before, as conjugate gradients do, which is dropped
    where a sweep changes more than the last one.
    Source: M. Silcowitz, S. Niebe, K. Erleben, A nonsmooth nonlinear conjugate gradient method for
    interactive contact force problems, The Visual Computer 26 (2010) 893.
    """
    left, before, sweeps, v = 0.0, 0.0, 0, M.v
    for k in range(count):
        p.counts[k] = 1.0 / allowed[0]
        for a in range(3):
            p.old[k, a] = p.r[k, a]
    while sweeps < most:
        left = sweep(p, v, count)
        sweeps += 1
        if sweeps % LOOKS == 1 and left > 1.0:
            let_jumps_count(p, M, count, allowed[0], allowed[1])
        if left <= 1.0 or sweeps == most or not math.isfinite(left):
            break
        square = gradient(p, count)
        part = -1.0
        if sweeps == 1:
            part = 0.0
        elif 0.0 < before and square <= before:
            part = square / before
        go_on(p, v, count, part)
        before = square
    return left, sweeps


@jitable
def finish(p: Points, M: Motion, ground: int, count: int, allowed: float) -> int:
    """Let Newton's method go on from r, and fill v by what it finds; return its iterations.

    It works on the same arrays (`fclib.bodies`), on the points that may press.
    """
    bodies, w = np.empty((count, 2), dtype=np.int64), np.empty((count, 3))
    size = 0.0
    for k in range(count):
        i, j = p.body[k, 0], p.body[k, 1]
        bodies[k, 0], bodies[k, 1] = (-1 if i == ground else i), (-1 if j == ground else j)
        for a in range(3):
            w[k, a] = velocity_of(p.H, k, a, M.free, i, j)
        w[k, 0] += p.ahead[k]
        for a in range(3):
            size += w[k, a] ** 2
    tol = min(max(0.05 * allowed / max(math.sqrt(size), 1e-300), SHARPEST), 1e-3)
    r = p.r[:count].copy()
    found = solve_contacts(M.inverse, bodies, p.H[:count], p.mu[:count], w, r, tol, 0, NEWTONS)
    for k in range(count):
        if not math.isfinite(r[k, 0] + r[k, 1] + r[k, 2]):
            return found[4]
    for k in range(count):
        d = (r[k, 0] - p.r[k, 0], r[k, 1] - p.r[k, 1], r[k, 2] - p.r[k, 2])
        apply(p, k, M.v, d)
        for a in range(3):
            p.r[k, a] = r[k, a]
    return found[4]


@jitable
def begin_anew(p: Points, M: Motion, count: int) -> None:
    """Forget all impulses: sweeps went off, as where a point's problem has no solution."""
    for b in range(len(M.v)):
        for c in range(6):
            M.v[b, c] = M.free[b, c]
    for k in range(count):
        p.r[k, 0] = p.r[k, 1] = p.r[k, 2] = 0.0


@jitable
def some_wide(p: Points, count: int) -> bool:
    """Return whether joints hold a body of any point: the bodies' masses are not all then."""
    for k in range(count):
        if p.wide[k] >= 0:
            return True
    return False


@jitable
def solve_points(
    p: Points, M: Motion, ground: int, count: int, allowed: tuple[float, float]
) -> tuple[float, int, int]:
    """Solve `count` points; return what a sweep still changes, sweeps and Newtons: `sweep_on`.

    r and v are as a guess says: r of the last step, v with that. A few sweeps do where little
    changed; Newton's method does what they leave, and sweeps what it leaves.
    """
    left, sweeps = sweep_on(p, M, count, allowed, FEW_SWEEPS)
    if left <= 1.0:
        return left, sweeps, 0
    newtons = 0
    if not math.isfinite(left):
        begin_anew(p, M, count)
    elif count <= NEWTON_POINTS and not some_wide(p, count):
        newtons = finish(p, M, ground, count, allowed[0])
    left, more = sweep_on(p, M, count, allowed, MOST_SWEEPS)
    if not math.isfinite(left):
        begin_anew(p, M, count)
        for _ in range(FEW_SWEEPS):
            left = sweep(p, M.v, count)
    return left, sweeps + more, newtons


@jitable
def project_positions(p: Points, shift: F2, count: int, h: float, slop: float, most: float) -> int:
    """Change displacements over h so that no point ends deeper than `slop`; return the sweeps.

    The least change in the norm of the mass: gap + h H_n shift >= 0 without friction, pushes start
    at 0. Where nothing ends so deep nothing changes. What begins deeper than `most`, as a deck may
    begin, comes out by no more than that: a jump in positions is no motion that a shorter step
    would find.
    """
    for k in range(count):
        p.push[k] = 0.0
    sweeps, worst = 0, math.inf
    while sweeps < MOST_SWEEPS and worst > slop:
        worst = 0.0
        for step in range(count):
            k = count - 1 - step if sweeps % 2 == 1 else step
            i, j = p.body[k, 0], p.body[k, 1]
            gap = max(p.gap[k], -most) + h * velocity_of(p.H, k, 0, shift, i, j)
            if gap >= -0.5 * slop and p.push[k] == 0.0:
                continue
            wanted = p.push[k] - gap / (h * p.W[k, 0, 0]) if p.W[k, 0, 0] > 0.0 else 0.0
            change = max(wanted, 0.0) - p.push[k]
            p.push[k] += change
            apply(p, k, shift, (change, 0.0, 0.0))
            worst = max(worst, abs(change) * p.W[k, 0, 0] * h)
        sweeps += 1
    return sweeps
