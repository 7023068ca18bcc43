"""Coulomb's cone of one contact: projection and natural map, with rolling friction as well.

K = {|r_T| <= mu r_N, |r_R| <= mu_r r_N}. `tangent` and `rolling` are tuples whose *lengths* are the
numbers of tangential and rolling directions, so that compiled loops over them are unrolled.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from mbsim.core.jitable import jitable
from mbsim.fclib.blocks import product

if TYPE_CHECKING:
    from mbsim.fclib.blocks import DelassusSystem
    from mbsim.fclib.problem import Indices, Vector

#: Rounding errors of u over the sum of its terms: at most, of which there are a few, and between
#: two orders of summation. Shares that matter to no tolerance.
NOISE, ROUNDED = 8.0 * 2.0**-53, 2.0 * 2.0**-53
NEGLIGIBLE = 1e-12
#: Share of the largest |q| of a contact that rounding is at most taken for.
EXCUSED = 1e-8
#: A scale-free residual where there is no scale.
LARGEST = 1e10
#: Times the tolerance that the scale-free residual and the velocity error may be: 10, less what
#: rho is uncertain by.
FREE = 9.9
#: How much is looked at: the published error alone (`relative_errors`); of the contacts' shares
#: none, most, or all (`own_errors`).
PUBLISHED, NO_SHARES, DECIDING, EVERY_SHARE = range(4)
#: Growth of |r| that every gain is worth.
GROWTH = 2.0


@jitable
def cone_height(normal: float, slide: float, roll: float, mu: float, mu_r: float) -> float:
    """Return the normal part of the projection of a point on the cone.

    `slide` and `roll` are the lengths of its tangential and rolling parts. The projection is
    (t, min(1, mu t / slide) x_T, min(1, mu_r t / roll) x_R), with t >= 0 the minimum of

        (t - normal)^2 + max(0, slide - mu t)^2 + max(0, roll - mu_r t)^2.
    """
    t = normal
    if t >= 0.0 and slide <= mu * t and roll <= mu_r * t:
        return t
    t = (normal + mu * slide) / (1.0 + mu * mu)
    if slide > mu * t and roll <= mu_r * t and t > 0.0:
        return t
    t = (normal + mu_r * roll) / (1.0 + mu_r * mu_r)
    if slide <= mu * t and roll > mu_r * t and t > 0.0:
        return t
    t = (normal + mu * slide + mu_r * roll) / (1.0 + mu * mu + mu_r * mu_r)
    return max(t, 0.0)


@jitable
def natural_map(
    tangent: tuple[int, ...],
    rolling: tuple[int, ...],
    mu: float,
    mu_r: float,
    u: Vector,
    r: Vector,
    first: int,
    rho: float,
    out: Vector,
) -> float:
    """Write F = r - P_K(r - rho (u + (mu |u_T| + mu_r |u_R|) e_N)) of one contact, return |F|^2.

    The contact's numbers begin at `first` in u, r and `out`.
    """
    nt, nr = len(tangent), len(rolling)
    if r[first] == 0.0 and u[first] >= 0.0:
        size = 0.0
        for k in range(1, 1 + nt + nr):
            size += abs(r[first + k])
        if size == 0.0:
            # open: x is in the polar cone
            for k in range(1 + nt + nr):
                out[first + k] = 0.0
            return 0.0
    speed = 0.0
    spin = 0.0
    for k in range(nt):
        speed += u[first + 1 + k] ** 2
    for k in range(nr):
        spin += u[first + 1 + nt + k] ** 2
    shift = mu * math.sqrt(speed)
    if nr > 0:
        shift += mu_r * math.sqrt(spin)
    normal = r[first] - rho * (u[first] + shift)
    slide = 0.0
    roll = 0.0
    for k in range(nt):
        slide += (r[first + 1 + k] - rho * u[first + 1 + k]) ** 2
    for k in range(nr):
        roll += (r[first + 1 + nt + k] - rho * u[first + 1 + nt + k]) ** 2
    slide = math.sqrt(slide)
    roll = math.sqrt(roll)
    height = cone_height(normal, slide, roll, mu, mu_r)
    turn = min(1.0, mu * height / slide) if slide > 0.0 else 1.0
    out[first] = r[first] - height
    squares: float = out[first] ** 2
    for k in range(nt):
        at = first + 1 + k
        out[at] = r[at] - turn * (r[at] - rho * u[at])
        squares += out[at] ** 2
    if nr > 0:
        turn = min(1.0, mu_r * height / roll) if roll > 0.0 else 1.0
        for k in range(nr):
            at = first + 1 + nt + k
            out[at] = r[at] - turn * (r[at] - rho * u[at])
            squares += out[at] ** 2
    return squares


@jitable
def bring_into_cones(
    tangent: tuple[int, ...],
    rolling: tuple[int, ...],
    mu: Vector,
    mu_r: Vector,
    r: Vector,
    out: Vector,
) -> None:
    """Write r with pulls made 0, friction cut to mu r_N and rolling friction to mu_r r_N.

    A method that keeps neither to the last bit leaves weak contacts outside by more than their own
    size allows.
    """
    nt, nr = len(tangent), len(rolling)
    d = 1 + nt + nr
    for a in range(len(mu)):
        first = d * a
        normal = max(r[first], 0.0)
        out[first] = normal
        _cut(nt, mu[a] * normal, r, first + 1, out)
        if nr > 0:
            _cut(nr, mu_r[a] * normal, r, first + 1 + nt, out)


@jitable
def _cut(many: int, bound: float, r: Vector, first: int, out: Vector) -> None:
    """Write `many` numbers of r, shortened to a length of `bound`."""
    square = 0.0
    for k in range(first, first + many):
        square += r[k] ** 2
    keep = bound / math.sqrt(square) if square > bound**2 else 1.0
    for k in range(first, first + many):
        out[k] = keep * r[k]


@jitable
def residual(
    tangent: tuple[int, ...],
    rolling: tuple[int, ...],
    mu: Vector,
    mu_r: Vector,
    u: Vector,
    r: Vector,
    out: Vector,
) -> float:
    """Write the natural map (rho = 1) of every contact and return its Euclidean norm."""
    d = 1 + len(tangent) + len(rolling)
    total = 0.0
    for a in range(len(mu)):
        total += natural_map(tangent, rolling, mu[a], mu_r[a], u, r, d * a, 1.0, out)
    return math.sqrt(total)


@jitable
def norm(vector: Vector) -> float:
    """Return the Euclidean norm."""
    total = 0.0
    for k in range(len(vector)):
        total += vector[k] * vector[k]
    return math.sqrt(total)


@jitable
def own_share(
    system: DelassusSystem, u: Vector, r: Vector, a: int, square: float, most: float, reach: float
) -> tuple[float, float]:
    """Return two shares of a contact, whose natural map F_a with its own `rho` has this square.

    The first is |F_a| / max(|r_a|, rho_a |q_a|), at most LARGEST, with what rounding may hide
    added to |F_a|: ROUNDED of the sum of rho_a |W_aj| |r_j|. It is 0 where |F_a|, |r_a| and
    rho_a |q_a| all are below NOISE of that sum (and `most` as a velocity). The second is what can
    be made smaller, 0 where |F_a| alone is below NOISE. `most`, `reach`: see `rounding`.
    """
    ptr, col, val = system.ptr, system.col, system.val
    d = 1 + len(system.tangent) + len(system.rolling)
    own = system.rho[a]
    size, push = 0.0, 0.0
    for k in range(d * a, d * a + d):
        size += r[k] ** 2
        push += system.q[k] ** 2
    held, missing = math.sqrt(size), math.sqrt(square)
    size = max(held, own * math.sqrt(push))
    if size > 0.0 and ROUNDED * math.sqrt(own) * reach <= NEGLIGIBLE * size:
        return missing / size, missing / size
    terms = 0.0
    for j in range(ptr[a], ptr[a + 1]):
        for row in range(d):
            for k in range(d):
                terms += abs(val[j, row, k] * r[d * col[j] + k])
    terms *= own
    rounded = ROUNDED * terms
    if held == 0.0 and missing == 0.0 and own * u[d * a] > rounded:
        return 0.0, 0.0  # open beyond doubt
    share = (missing + rounded) / size if missing + rounded < LARGEST * size else LARGEST
    if missing > NOISE * terms:
        return share, missing / size if missing < LARGEST * size else LARGEST
    return share if size > min(NOISE * terms, most * own) else 0.0, 0.0


@jitable
def rounding(system: DelassusSystem, r: Vector) -> tuple[float, float]:
    """Return the velocity that rounding is at most taken for, and `reach`.

    The first is EXCUSED of the largest |q_a|. W being positive, the sum of |W_aj| |r_j| is at most
    `reach` / sqrt(rho_a).
    """
    rho, q = system.rho, system.q
    d = 1 + len(system.tangent) + len(system.rolling)
    fastest, reach = 0.0, 0.0
    for a in range(len(rho)):
        push, size = 0.0, 0.0
        for k in range(d * a, d * a + d):
            push += q[k] ** 2
            size += r[k] ** 2
        fastest = max(fastest, push)
        reach += math.sqrt(size / rho[a])
    return EXCUSED * math.sqrt(fastest), d * reach


@jitable
def own_errors(
    system: DelassusSystem, u: Vector, r: Vector, shares: int, work: Vector
) -> tuple[float, float, float, float]:
    """Return four figures of the natural maps F_i with each contact's own `rho`, free of units.

    rho_i = 1 / lambda_max(W_ii) turns a contact's velocity into the impulse that it is worth.

    * The error |F| / max(|rho q|, |r|, |rho u|).
    * The scale-free residual, the largest share of a contact (`own_share`).
    * The velocity error |F / rho| / |q|: the other two fall while impulses grow, and this does not.
    * What of the scale-free residual can be made smaller: the largest second share.

    `shares`: EVERY_SHARE; DECIDING, for which the second figure is 0, and sums over a row of W, of
    which rounding is a part, are made only of contacts that the fourth depends on; NO_SHARES, and
    both are 0.
    """
    tangent, rolling, mu, mu_r = system.tangent, system.rolling, system.mu, system.mu_r
    rho, q = system.rho, system.q
    d = 1 + len(tangent) + len(rolling)
    missing, speeds, given, bound, moved, impulse = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    most, reach = rounding(system, r) if shares == EVERY_SHARE else (-1.0, 0.0)
    free, attainable = 0.0, 0.0
    for a in range(len(mu)):
        own = rho[a]
        push, held = 0.0, 0.0
        for k in range(d * a, d * a + d):
            held += r[k] ** 2
            push += q[k] ** 2
            moved += (own * u[k]) ** 2
        impulse += held
        bound += push
        given += own**2 * push
        square = natural_map(tangent, rolling, mu[a], mu_r[a], u, r, d * a, own, work)
        missing += square
        speeds += square / own**2
        if shares == EVERY_SHARE or (
            shares == DECIDING and square > attainable**2 * max(held, own**2 * push)
        ):
            if most < 0.0:
                most, reach = rounding(system, r)
            share, second = own_share(system, u, r, a, square, most, reach)
            attainable = max(attainable, second)
            if shares == EVERY_SHARE:
                free = max(free, share)
    missing = math.sqrt(missing)
    scale = math.sqrt(max(given, impulse, moved))
    speeds = math.sqrt(speeds)
    return (
        missing / scale if scale > 0.0 else missing,
        free,
        speeds / math.sqrt(bound) if bound > 0.0 else speeds,
        attainable,
    )


@jitable
def relative_errors(
    system: DelassusSystem, u: Vector, r: Vector, shares: int, work: Vector
) -> tuple[float, float]:
    """Return how far an iterate is from the first goal and from the second one.

    The first is the larger of |F| / max(|q|, |r|, |u|), with rho = 1, and of the same with every
    contact's own rho: in some units the one is small long before the other. The second is the
    largest of |F| / |q|, MERIT_1 and, over FREE, the velocity error and what is attainable of the
    scale-free residual (`own_errors`). A scale of 0 does not divide. `shares`: DECIDING; or
    PUBLISHED, for what is lower than both and does for an iterate not within the first goal.
    """
    missing = residual(system.tangent, system.rolling, system.mu, system.mu_r, u, r, work)
    bound = norm(system.q)
    scale = max(bound, norm(r), norm(u))
    error = missing / scale if scale > 0.0 else missing
    second = max(missing / bound if bound > 0.0 else missing, missing / (1.0 + math.sqrt(bound)))
    if shares == PUBLISHED:
        return error, second
    own, _, speeds, free = own_errors(system, u, r, shares, work)
    return max(error, own), max(second, free / FREE, speeds / FREE)


@jitable
def errors_at(
    system: DelassusSystem, r: Vector, u: Vector, shares: int, work: Vector
) -> tuple[float, float]:
    """Write u = W r + q and return `relative_errors`."""
    product(system, system.q, r, u)
    return relative_errors(system, u, r, shares, work)


@jitable
def improves(second: float, size: float, before: float, size_before: float) -> bool:
    """Return whether an iterate within the first goal is better than the one before.

    Its second figure decides. Impulses that grow beyond GROWTH must bring as much as they grow: in
    a wedge the figures fall a little as they run away.
    """
    return second * max(1.0, size / (GROWTH * size_before) if size_before > 0.0 else 1.0) < before


@jitable
def is_better(
    tol: float,
    error: float,
    error_q: float,
    candidate: Vector,
    best: float,
    best_q: float,
    r: Vector,
) -> bool:
    """Return whether an iterate is better than the best one, r; within `tol` `improves` decides."""
    if error <= tol and best <= tol:
        return improves(error_q, norm(candidate), best_q, norm(r))
    return error < best


@jitable
def count_changes(tangent: tuple[int, ...], mu: Vector, r: Vector, states: Indices) -> int:
    """Write whether contacts are open (0), stick (1) or slip (2); return how many were not before.

    Solvers that project on the cone leave impulses of slipping contacts on its edge.
    """
    d = 1 + len(tangent)
    changed = 0
    for a in range(len(mu)):
        first = d * a
        square = 0.0
        for k in range(len(tangent)):
            square += r[first + 1 + k] ** 2
        state = 0
        if r[first] > 0.0:
            state = 1 if math.sqrt(square) < (1.0 - 1e-6) * mu[a] * r[first] else 2
        if states[a] != state:
            changed += 1
        states[a] = state
    return changed
