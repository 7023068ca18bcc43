"""How friction is shared out over the contact points that stick: two convex problems of cones.

Slot i can hold c_i; S_i, of two rows, is its slip as the sticking equations in use move by y, in
coordinates in which these have unit inertia, and m is what has to be held in them. Forces f_i hold
where

    sum S_i' f_i = m,  |f_i| <= rho c_i.

SHARED: the least such rho, the part of the limit that is needed. No more can be held where it is
above 1. Its dual, which a slip y tells, is to make sum c_i |S_i y| least with m . y = 1.
SLIPPING: y is against the acceleration where friction has rho = 1, by Gauss's principle that with
|y|^2/2 - m . y + sum c_i |S_i y| least; points with S_i y = 0 go on sticking.

|u| is smoothed to e = sqrt(|u|^2 + eps^2), and f with e f = c u goes along as an unknown of its own
in Newton's method, which so converges with eps, whatever points do not move.
Source: K. D. Andersen, E. Christiansen, A. R. Conn, M. L. Overton, SIAM J. Sci. Comput. 22 (2000)
243-262.
"""

from __future__ import annotations

import math

from mbsim.core.arrays import F1, F2, V2
from mbsim.core.jitable import jitable

SHARED, SLIPPING = 0.0, 1.0

# rows of the scratch: limits by slots; forces, slips and their steps by two of a slot; then by
# equations in use: load m, motion y, its step, gradient; the direction of m in SHARED
CAPACITY, FORCE, SLIDE, SLIDE_STEP, LOAD, MOTION, STEP, GRADIENT, ALONG = range(9)

#: Where the objective misses the least by no more than this part, it is found.
_GAP = 1e-10
#: By what eps falls, and the least it falls to, as a part of the fastest slip at the begin.
_FALL, LEAST = 0.03, 1e-10
_MOST = 60
#: What may be left of m, as a part of it, that forces do not hold.
HELD = 1e-9
#: A point is taken to slip where it moves so many times eps: it has its whole limit then.
MOVES = 100.0


@jitable
def slides(S: F2, count: int, r: int, y: F1, out: F1) -> None:
    """Write S y into out for so many rows."""
    for k in range(count):
        total = 0.0
        for a in range(r):
            total += S[k, a] * y[a]
        out[k] = total


@jitable
def fill_newton(S: F2, count: int, r: int, V: F2, K: F2, eps: float, inertia: float) -> None:
    """Fill the lower part of Newton's matrix K and the gradient at V[MOTION].

    Forces beyond their limits are brought back to them: K is positive so.
    """
    g, total = V[GRADIENT], 0.0
    for a in range(r):
        g[a] = inertia * V[MOTION, a]
        for b in range(a + 1):
            K[a, b] = inertia if a == b else 0.0
    for k in range(0, count, 2):
        c, ux, uy = V[CAPACITY, k // 2], V[SLIDE, k], V[SLIDE, k + 1]
        over = max(1.0, math.hypot(V[FORCE, k], V[FORCE, k + 1]) / c)
        V[FORCE, k] /= over
        V[FORCE, k + 1] /= over
        fx, fy, e = V[FORCE, k], V[FORCE, k + 1], math.sqrt(ux * ux + uy * uy + eps * eps)
        xx, yy = (c - fx * ux / e) / e, (c - fy * uy / e) / e
        xy = -0.5 * (fx * uy + fy * ux) / (e * e)
        for a in range(r):
            p, q = S[k, a], S[k + 1, a]
            if p == 0.0 and q == 0.0:
                continue
            g[a] += c * (ux * p + uy * q) / e
            sx, sy = xx * p + xy * q, xy * p + yy * q
            for b in range(a + 1):
                K[a, b] += sx * S[k, b] + sy * S[k + 1, b]
    if inertia > 0.0:
        return
    # along m nothing is to move, and there K may be singular
    square = 0.0
    for a in range(r):
        total += K[a, a]
        square += V[LOAD, a] * V[LOAD, a]
    for a in range(r):
        for b in range(a + 1):
            K[a, b] += total / square * V[LOAD, a] * V[LOAD, b]


@jitable
def factor_cholesky(K: F2, r: int) -> None:
    """Replace the lower part of K by its Cholesky factor; a pivot that rounding took is 1e-15."""
    for a in range(r):
        for b in range(a + 1):
            total = K[a, b]
            for k in range(b):
                total -= K[a, k] * K[b, k]
            if b < a:
                K[a, b] = total / K[b, b]
            else:
                K[a, a] = math.sqrt(max(total, 1e-15 * K[a, a]))


@jitable
def solve_cholesky(K: F2, r: int, x: F1) -> None:
    """Replace x by the solution with a factored K."""
    for a in range(r):
        for k in range(a):
            x[a] -= K[a, k] * x[k]
        x[a] /= K[a, a]
    for a in range(r - 1, -1, -1):
        x[a] /= K[a, a]
        for k in range(a):
            x[k] -= K[a, k] * x[a]


@jitable
def objective(count: int, r: int, V: F2, part: float, eps: float, inertia: float) -> float:
    """Return what is to be least at V[MOTION] and a part of the step from there."""
    total = 0.0
    for k in range(0, count, 2):
        ux = V[SLIDE, k] + part * V[SLIDE_STEP, k]
        uy = V[SLIDE, k + 1] + part * V[SLIDE_STEP, k + 1]
        total += V[CAPACITY, k // 2] * math.sqrt(ux * ux + uy * uy + eps * eps)
    if inertia > 0.0:
        for a in range(r):
            y = V[MOTION, a] + part * V[STEP, a]
            total += (0.5 * y - V[LOAD, a]) * y
    return total


@jitable
def begin_motion(S: F2, count: int, r: int, V: F2, K: F2, inertia: float) -> None:
    """Write the first motion: of forces least by sum f^2/c, or as if nothing rubbed."""
    y, m = V[MOTION], V[LOAD]
    for a in range(r):
        y[a] = m[a]
    if inertia > 0.0:
        return
    for k in range(count):
        V[SLIDE, k] = V[FORCE, k] = 0.0
    fill_newton(S, count, r, V, K, 1.0, inertia)
    factor_cholesky(K, r)
    solve_cholesky(K, r, y)
    along = 0.0
    for a in range(r):
        along += m[a] * y[a]
    for a in range(r):
        y[a] /= along


@jitable
def part_at_most(S: F2, count: int, r: int, V: F2, K: F2) -> float:
    """Return the part of the limit that is needed by the forces that hold m with least sum f^2/c.

    It is no less than rho of SHARED; arguments as of `solve_cones`. FORCE and SLIDE are lost.
    """
    y, m, u = V[MOTION], V[LOAD], V[SLIDE]
    begin_motion(S, count, r, V, K, SHARED)
    slides(S, count, r, y, u)
    # y is along the motion wanted, which goes on m by what goes on m itself
    for a in range(r):
        V[GRADIENT, a] = 0.0
    for k in range(0, count, 2):
        for a in range(r):
            V[GRADIENT, a] += V[CAPACITY, k // 2] * (u[k] * S[k, a] + u[k + 1] * S[k + 1, a])
    held, square, left, part = 0.0, 0.0, 0.0, 0.0
    for a in range(r):
        held += m[a] * V[GRADIENT, a]
        square += m[a] * m[a]
    held /= square
    for a in range(r):
        left = max(left, abs(V[GRADIENT, a] - held * m[a]))
    if not (held > 0.0 and left <= HELD * held * math.sqrt(square)):
        return math.inf
    for k in range(0, count, 2):
        part = max(part, math.hypot(u[k], u[k + 1]) / held)
    return part


@jitable
def take_forces(count: int, V: F2, eps: float) -> float:
    """Let forces follow Newton's step; return the largest over its limit."""
    worst = 0.0
    for k in range(0, count, 2):
        c, ux, uy = V[CAPACITY, k // 2], V[SLIDE, k], V[SLIDE, k + 1]
        dx, dy, fx, fy = V[SLIDE_STEP, k], V[SLIDE_STEP, k + 1], V[FORCE, k], V[FORCE, k + 1]
        e = math.sqrt(ux * ux + uy * uy + eps * eps)
        # half of each of f u' and u f': as the matrix has it
        to, across = 0.5 * (ux * dx + uy * dy) / e, 0.5 * (fx * dx + fy * dy) / e
        fx, fy = (
            (c * (ux + dx) - fx * to - ux * across) / e,
            (c * (uy + dy) - fy * to - uy * across) / e,
        )
        V[FORCE, k], V[FORCE, k + 1] = fx, fy
        worst = max(worst, math.hypot(fx, fy) / c)
    return worst


@jitable
def solve_cones(S: F2, count: int, r: int, V: F2, K: F2, inertia: float) -> V2:
    """Solve one of the two problems.

    Parameters
    ----------
    S : array, (>= count, >= r)
        Slip of `count` / 2 slots, two rows each.
    count, r : int
    V : array, (9, >= max(count, r))
        CAPACITY, all above 0, and LOAD, not all 0, are given; FORCE, SLIDE and MOTION are found.
    K : array, (>= r, >= r)
        Scratch.
    inertia : float
        SHARED or SLIPPING.

    Returns
    -------
    float, float
        In SHARED the part of V[FORCE] that is 1/rho; and eps.
    """
    y, u, m, d, along = V[MOTION], V[SLIDE], V[LOAD], V[STEP], V[ALONG]
    begin_motion(S, count, r, V, K, inertia)
    slides(S, count, r, y, u)
    eps, level = 0.0, 1.0
    for k in range(0, count, 2):
        eps = max(eps, math.hypot(u[k], u[k + 1]))
    least = LEAST * eps
    for k in range(count):
        c, i = V[CAPACITY, k // 2], k - k % 2
        V[FORCE, k] = c * u[k] / math.sqrt(u[i] ** 2 + u[i + 1] ** 2 + eps * eps)
    for _ in range(_MOST):
        fill_newton(S, count, r, V, K, eps, inertia)
        factor_cholesky(K, r)
        for a in range(r):
            d[a], along[a] = -V[GRADIENT, a], m[a]
        solve_cholesky(K, r, d)
        solve_cholesky(K, r, along)
        by_gradient, by_load, slope = 0.0, 0.0, 0.0
        for a in range(r):
            by_gradient -= m[a] * d[a]
            by_load += m[a] * along[a]
        level = by_gradient / by_load if inertia == 0.0 else 1.0
        for a in range(r):
            d[a] += level * along[a]
            slope += (V[GRADIENT, a] - inertia * m[a]) * d[a]
        slides(S, count, r, d, V[SLIDE_STEP])
        now, part = objective(count, r, V, 0.0, eps, inertia), 1.0
        while part > 1e-4:
            then = objective(count, r, V, part, eps, inertia)
            if then <= now + 1e-4 * part * slope + 1e-15 * abs(now):
                break
            part *= 0.5
        worst = take_forces(count, V, eps)
        moved, size, bound = 0.0, 0.0, 0.0
        for a in range(r):
            y[a] += part * d[a]
            moved, size = max(moved, abs(d[a])), max(size, abs(y[a]))
        slides(S, count, r, y, u)
        for k in range(0, count, 2):
            bound += V[CAPACITY, k // 2] * math.hypot(u[k], u[k + 1])
        if worst <= 1.0 + 1e-9:
            # forces that hold bound rho from below, motions from above
            if inertia == 0.0 and bound * max(1.0, worst) - level <= _GAP * bound:
                break
            if eps == least and part == 1.0 and moved <= 1e-9 * size:
                break
        if part == 1.0:
            eps = max(least, _FALL * eps)
    return level, eps
