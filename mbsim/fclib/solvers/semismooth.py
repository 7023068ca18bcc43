"""Newton steps on Alart and Curnier's function of W + s I, with a line search.

    F_N = r_N - max(0, x_N),  F_T = r_T - P(x_T; |.| <= mu max(0, x_N)),  x = r - rho u.

The linear system holds only closed contacts (x_N > 0).
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from mbsim.core.jitable import jitable
from mbsim.fclib.blocks import product
from mbsim.fclib.factor import Factors, factorise, room_for_factors, solve, transposed_places
from mbsim.fclib.ordering import Analysis, analyse, elimination_flops

if TYPE_CHECKING:
    from mbsim.fclib.blocks import DelassusSystem
    from mbsim.fclib.problem import Flags, Indices, Vector

#: rho = RHO / (mean diagonal of the contact's block); 10 to 30 is good, and 100 or 1 is not: too
#: many contacts change their state at once, or too few.
RHO = 10.0
#: Trial steps of the line search.
HALVINGS = 8
#: Contacts in the matrix over closed ones: with some that have opened it is not analysed anew.
SPARE = 1.1


class Point(NamedTuple):
    """r and u (m,), and the contacts' states (nc,): 0 open, -1 stick, mu x_N / |x_T| < 1 slip."""

    r: Vector
    u: Vector
    slip: Vector


class Jacobian(NamedTuple):
    """Newton's matrix over some contacts, all closed ones among them, and room for its factors.

    Parameters
    ----------
    held, number, nodes
        (nc,) whether a contact is one of them, its number there (-1: none), and who they are.
    ptr, col, back, val
        The matrix in blocks; `back` by `factor.transposed_places`. `val` may have more room.
    analysis, flops, factors
        Its fronts, the operations of a factorisation, and the factors.
    """

    held: Flags
    number: Indices
    nodes: Indices
    ptr: Indices
    col: Indices
    back: Indices
    val: Vector
    analysis: Analysis
    flops: float
    factors: Factors


@jitable
def no_jacobian(d: int, nc: int) -> Jacobian:
    """Return the matrix over no contacts, with the exchanges' room for all."""
    ptr, col = np.zeros(1, np.int32), np.zeros(0, np.int32)
    analysis = analyse(0, ptr, col, d)
    factors = room_for_factors(analysis, d * nc)
    number, nodes = np.empty(nc, np.int32), np.empty(nc, np.int32)
    held = np.zeros(nc, np.bool_)
    val = np.empty((0, d, d))
    return Jacobian(held, number, nodes, ptr, col, col, val, analysis, 0.0, factors)


@jitable
def evaluate(system: DelassusSystem, rho: Vector, point: Point, function: Vector) -> float:
    """Write the states of the contacts and F; return |F|."""
    mu, r, u, slip = system.mu, point.r, point.u, point.slip
    nt = len(system.tangent)
    d = 1 + nt
    total = 0.0
    for a in range(len(mu)):
        first = d * a
        normal = r[first] - rho[a] * u[first]
        slip[a] = 0.0
        if normal <= 0.0:
            for k in range(d):
                function[first + k] = r[first + k]
        else:
            length = 0.0
            for k in range(nt):
                length += (r[first + 1 + k] - rho[a] * u[first + 1 + k]) ** 2
            length = math.sqrt(length)
            radius = mu[a] * normal
            function[first] = rho[a] * u[first]
            if length <= radius:
                slip[a] = -1.0
                for k in range(nt):
                    function[first + 1 + k] = rho[a] * u[first + 1 + k]
            else:
                g = radius / length
                slip[a] = max(g, 1e-300)
                for k in range(nt):
                    at = first + 1 + k
                    function[at] = r[at] - g * (r[at] - rho[a] * u[at])
        for k in range(d):
            total += function[first + k] ** 2
    return math.sqrt(total)


@jitable
def _pattern(
    ptr: Indices, col: Indices, held: Flags, number: Indices, nodes: Indices
) -> tuple[Indices, Indices]:
    """Return the pattern among contacts `held`; `number` and `nodes` say who they are."""
    size = 0
    for a in range(len(held)):
        number[a] = -1
        if held[a]:
            number[a] = size
            nodes[size] = a
            size += 1
    rptr = np.zeros(size + 1, np.int32)
    total = 0
    for k in range(size):
        a = nodes[k]
        for j in range(ptr[a], ptr[a + 1]):
            if number[col[j]] >= 0:
                total += 1
        rptr[k + 1] = total
    rcol = np.empty(total, np.int32)
    at = 0
    for k in range(size):
        a = nodes[k]
        for j in range(ptr[a], ptr[a + 1]):
            b = number[col[j]]
            if b >= 0:
                rcol[at] = b
                at += 1
    return rptr, rcol


@jitable
def selected(
    system: DelassusSystem, slip: Vector, jacobian: Jacobian, same: bool
) -> tuple[Jacobian, float]:
    """Return the matrix, analysed for the contacts that are closed now, and the work for it.

    It stays as it is if `same`, no other contact is closed, and few have opened (SPARE).
    """
    held, d = jacobian.held, 1 + len(system.tangent)
    closed, either = 0, 0
    for a in range(len(held)):
        if slip[a] != 0.0:
            closed += 1
            same = same and held[a]
        if held[a] or slip[a] != 0.0:
            either += 1
    few = either <= SPARE * closed
    if same and few:
        return jacobian, 0.0
    for a in range(len(held)):
        held[a] = slip[a] != 0.0 or (held[a] and few)
    ptr, col = _pattern(system.ptr, system.col, held, jacobian.number, jacobian.nodes)
    back = transposed_places(len(ptr) - 1, ptr, col)
    analysis = analyse(len(ptr) - 1, ptr, col, d)
    flops = elimination_flops(analysis, d)
    values, exchange, front, stack, part = jacobian.factors
    val = jacobian.val
    entries = analysis.factor_ptr[-1]
    if entries > len(values):
        values = np.empty(entries + entries // 4)
    if analysis.widest**2 > len(front):
        front = np.empty(analysis.widest**2)
        part = np.empty(analysis.widest)
    if analysis.stacked > len(stack):
        stack = np.empty(analysis.stacked)
    if len(col) > len(val):
        val = np.empty((len(col), d, d))
    factors = Factors(values, exchange, front, stack, part)
    made = Jacobian(
        held, jacobian.number, jacobian.nodes, ptr, col, back, val, analysis, flops, factors
    )
    return made, 5e-8 * len(col)


@jitable
def _right_sides(
    system: DelassusSystem, rho: Vector, point: Point, jacobian: Jacobian, x: Vector
) -> tuple[Vector, Vector]:
    """Write the right sides of `_linear_system`; return c and, of contacts that slip, e."""
    ptr, col, val, mu = system.ptr, system.col, system.val, system.mu
    number, nodes = jacobian.number, jacobian.nodes
    r, u, slip = point.r, point.u, point.slip
    nt = len(system.tangent)
    d = 1 + nt
    size = len(jacobian.ptr) - 1
    c, e = np.ones(size), np.empty((size, nt))
    for k in range(size):
        a = nodes[k]
        first, g = d * a, slip[a]
        if g == 0.0:
            for s in range(d):
                x[d * k + s] = -r[first + s]
            continue
        for s in range(d):
            x[d * k + s] = 0.0
        # velocity change by the contacts that open
        for j in range(ptr[a], ptr[a + 1]):
            b = col[j]
            if number[b] < 0:
                for s in range(d):
                    for t in range(d):
                        x[d * k + s] -= val[j, s, t] * r[d * b + t]
        x[d * k] = -u[first] - x[d * k]
        if g < 0.0:
            for s in range(nt):
                x[d * k + 1 + s] = -u[first + 1 + s] - x[d * k + 1 + s]
            continue
        length = 0.0
        for s in range(nt):
            e[k, s] = r[first + 1 + s] - rho[a] * u[first + 1 + s]
            length += e[k, s] ** 2
        length = math.sqrt(length)
        c[k] = 1.0 / (rho[a] * max(g, 1.0 / RHO))
        weight = c[k] * g * rho[a]
        along = 0.0
        for s in range(nt):
            e[k, s] /= length
            along += e[k, s] * x[d * k + 1 + s]
        for s in range(nt):
            opened = x[d * k + 1 + s] - e[k, s] * along
            x[d * k + 1 + s] = -c[k] * (r[first + 1 + s] - mu[a] * r[first] * e[k, s])
            x[d * k + 1 + s] -= weight * opened
    return c, e


@jitable
def _linear_system(  # noqa: C901
    system: DelassusSystem, rho: Vector, shift: float, point: Point, jacobian: Jacobian, x: Vector
) -> None:
    """Write Newton's matrix and right side of the contacts of `jacobian`.

    Rows are divided by rho (and g, where a contact slips), so that they have the size of W's.
    With x = r - rho u, e = x_T / |x_T|, P = I - e e' and c = 1 / (rho max(g, 1 / RHO)):

        W_N dr = -u_N;   stick: W_T dr = -u_T;
        slip: c ((I - g P) dr_T - mu e dr_N) + c g rho P W_T dr = -c (r_T - mu r_N e).

    Open contacts have dr = -r; of those that are not in the matrix that is on the right side.
    Many branches because a block is formed whole while it is at hand, row and column.
    """
    ptr, col, val = system.ptr, system.col, system.val
    number, nodes, jac = jacobian.number, jacobian.nodes, jacobian.val
    nt = len(system.tangent)
    d = 1 + nt
    at = 0
    block = np.empty((d, d))
    c, e = _right_sides(system, rho, point, jacobian, x)
    for k in range(len(jacobian.ptr) - 1):
        a = nodes[k]
        g = point.slip[a]
        weight = c[k] * g * rho[a]
        diagonal = 1.0 if g == 0.0 else shift
        for j in range(ptr[a], ptr[a + 1]):
            b = number[col[j]]
            if b < 0:
                continue
            for s in range(d):
                for t in range(d):
                    block[s, t] = val[j, s, t] if g != 0.0 else 0.0
            if b == k:
                for s in range(d):
                    block[s, s] += diagonal
            if g > 0.0:
                for t in range(d):
                    along = 0.0
                    for s in range(nt):
                        along += e[k, s] * block[1 + s, t]
                    for s in range(nt):
                        block[1 + s, t] = weight * (block[1 + s, t] - e[k, s] * along)
                if b == k:
                    for s in range(nt):
                        block[1 + s, 0] -= c[k] * system.mu[a] * e[k, s]
                        block[1 + s, 1 + s] += c[k] * (1.0 - g)
                        for t in range(nt):
                            block[1 + s, 1 + t] += c[k] * g * e[k, s] * e[k, t]
            for s in range(d):
                for t in range(d):
                    jac[at, s, t] = block[s, t]
            at += 1


@jitable
def direction(
    system: DelassusSystem,
    rho: Vector,
    shift: float,
    point: Point,
    jacobian: Jacobian,
    x: Vector,
    step: Vector,
    rate: Vector,
    until: Vector,
) -> bool:
    """Write Newton's step and its velocity change; return whether the matrix was regular.

    `x` is room (m,).
    """
    d = 1 + len(system.tangent)
    size = len(jacobian.ptr) - 1
    if size > 0:
        _linear_system(system, rho, shift, point, jacobian, x)
        if not factorise(
            d, jacobian.ptr, jacobian.col, jacobian.back, jacobian.val, jacobian.analysis,
            jacobian.factors, until,
        ):  # fmt: skip
            return False
        solve(d, jacobian.analysis, jacobian.factors, x)
    for k in range(len(step)):
        step[k] = -point.r[k]
    for k in range(size):
        for s in range(d):
            step[d * jacobian.nodes[k] + s] = x[d * k + s]
    # in place of q, for the change of the velocity
    for k in range(len(step)):
        x[k] = shift * step[k]
    product(system, x, step, rate)
    return True


@jitable
def _advance(
    system: DelassusSystem,
    rho: Vector,
    point: Point,
    t: float,
    step: Vector,
    rate: Vector,
    trial: Point,
    function: Vector,
) -> float:
    """Write the point a share t of the step ahead; return |F| there."""
    for k in range(len(step)):
        trial.r[k] = point.r[k] + t * step[k]
        trial.u[k] = point.u[k] + t * rate[k]
    return evaluate(system, rho, trial, function)


@jitable
def line_search(
    system: DelassusSystem,
    rho: Vector,
    point: Point,
    step: Vector,
    rate: Vector,
    highest: float,
    trial: Point,
    function: Vector,
) -> float:
    """Write the point that |F| <= (1 - 1e-4 t) `highest` accepts, or the best; return |F| there.

    Without any in which F is a number it is infinite.
    """
    t = 1.0
    best_t, best = 0.0, np.inf
    for _ in range(HALVINGS + 1):
        size = _advance(system, rho, point, t, step, rate, trial, function)
        if size < best:
            best_t, best = t, size
        if size <= (1.0 - 1e-4 * t) * highest:
            break
        t *= 0.5
    if best_t > 0.0 and best_t != t:
        best = _advance(system, rho, point, best_t, step, rate, trial, function)
    return best
