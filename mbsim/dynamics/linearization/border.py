"""Equations and states in the linear systems of implicit methods (see `newton_matrix`).

Equations of one connection are a node of the elimination where there are many, behind the bodies
that they hold; else, and where what these bodies can do does not take an equation's force, they
are unknowns of the border, which is dense. So are states.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from mbsim.arrays.codes import C1, C2, C3, FORM
from mbsim.arrays.scene import Scene
from mbsim.core.arrays import N1, N2, V3
from mbsim.core.jitable import jitable
from mbsim.core.layout import BODY_SIZE
from mbsim.core.rotation import add, cross, dot, rotate, sub, unrotate, vector
from mbsim.dynamics.constraints.in_use import active_count
from mbsim.dynamics.linearization.blocks import factor_border, solve_bodies, solve_small

if TYPE_CHECKING:
    from mbsim.compile_model.tangent import Linear, Pair, Pattern, Real, Tangent


@jitable
def times_rate(L: Linear, M: Real | Pair, b: int, out: N2) -> None:
    """Write E of body b, 6 x 6: rates of spin and of the point at O by xi.

    spin: R B R' theta + theta x w; velocity of O's point: c1 (d + theta x r) - spin x r.
    """
    R, B, c1, w, r = L.R[b], M.B[b], M.c[0, C1], L.spin[b], L.r[b]
    for j in range(B.shape[0]):
        column = (R[j, 0], R[j, 1], R[j, 2])
        # R B R' e_j
        u0 = B[0, 0] * column[0] + B[0, 1] * column[1] + B[0, 2] * column[2]
        u1 = B[1, 0] * column[0] + B[1, 1] * column[1] + B[1, 2] * column[2]
        u2 = B[2, 0] * column[0] + B[2, 1] * column[1] + B[2, 2] * column[2]
        e = (1.0 if j == 0 else 0.0, 1.0 if j == 1 else 0.0, 1.0 if j == 2 else 0.0)
        around = cross(e, (w[0], w[1], w[2]))
        s0 = R[0, 0] * u0 + R[0, 1] * u1 + R[0, 2] * u2 + around[0]
        s1 = R[1, 0] * u0 + R[1, 1] * u1 + R[1, 2] * u2 + around[1]
        s2 = R[2, 0] * u0 + R[2, 1] * u1 + R[2, 2] * u2 + around[2]
        arm = cross(e, (r[0], r[1], r[2]))
        out[0, j], out[1, j], out[2, j] = s0, s1, s2
        out[3, j] = c1 * arm[0] - (s1 * r[2] - s2 * r[1])
        out[4, j] = c1 * arm[1] - (s2 * r[0] - s0 * r[2])
        out[5, j] = c1 * arm[2] - (s0 * r[1] - s1 * r[0])
        for i in range(3):
            out[i, 3 + j] = 0.0
            out[3 + i, 3 + j] = c1 if i == j else 0.0


@jitable
def turn_residual(L: Linear, b: int, r: N1) -> tuple[complex, complex, complex]:
    """Return rho of body b: twice the vector part of conj(q) r_q, q being of unit length."""
    q, at = L.q[b], BODY_SIZE * b + 3
    s0, s1, s2, s3 = r[at], r[at + 1], r[at + 2], r[at + 3]
    return (
        2.0 * (q[0] * s1 - q[1] * s0 - q[2] * s3 + q[3] * s2),
        2.0 * (q[0] * s2 + q[1] * s3 - q[2] * s0 - q[3] * s1),
        2.0 * (q[0] * s3 - q[1] * s2 + q[2] * s1 - q[3] * s0),
    )


@jitable
def asked_of(
    L: Linear, M: Real | Pair, b: int, r: N1
) -> tuple[tuple[complex, complex, complex], tuple[complex, complex, complex]]:
    """Return r_a and r_alpha of body b."""
    at, form = BODY_SIZE * b, M.c[0, FORM].real
    first = M.c[0, C1] if form == 0.0 else 0.0 * M.c[0, C1]
    rho = turn_residual(L, b, r)
    shift = (
        first * r[at] + r[at + 7],
        first * r[at + 1] + r[at + 8],
        first * r[at + 2] + r[at + 9],
    )
    turn = (
        first * rho[0] + r[at + 10],
        first * rho[1] + r[at + 11],
        first * rho[2] + r[at + 12],
    )
    return shift, turn


@jitable
def is_in_node(scene: Scene, P: Pattern, M: Real | Pair, row: int) -> bool:
    """Return whether an equation in use is one of a node, not of the border."""
    c = P.node[scene.equations.active[row]]
    return c >= 0 and M.rows[c] > 0


@jitable
def list_border(scene: Scene, P: Pattern, M: Real | Pair) -> None:
    """List the equations in use of the border."""
    dense = 0
    for row in range(active_count(scene)):
        if not is_in_node(scene, P, M, row):
            M.dense[dense] = row
            dense += 1
    M.dense[len(M.dense) - 1] = dense


@jitable
def dense_count(M: Real | Pair) -> int:
    """Return the number of equations of the border."""
    return M.dense[len(M.dense) - 1]


@jitable
def bordered(scene: Scene, M: Real | Pair, k: int) -> int:
    """Return the row of `Linear.column` of the k-th unknown of the border."""
    n = dense_count(M)
    return M.dense[k] if k < n else len(scene.equations.program) + k - n


@jitable
def border_count(scene: Scene, M: Real | Pair) -> int:
    """Return the number of unknowns of the border: its equations, then states."""
    return dense_count(M) + len(scene.states.program)


@jitable
def along_row(L: Linear, M: Real | Pair, row: int, slope: int, x: N2) -> complex:
    """Return a row of the border times displacements; of a state's slope with their rates."""
    total = 0.0 * x[0, 0]
    for b in range(len(L.w)):
        for i in range(x.shape[1]):
            if L.row[row, b, i] != 0.0:
                total += L.row[row, b, i] * x[b, i]
    if slope == 0:
        return total
    E = M.work[2]
    for b in range(len(L.w)):
        used = False
        for i in range(x.shape[1]):
            used = used or L.row_rate[row, b, i] != 0.0
        if used:
            times_rate(L, M, b, E)
            for i in range(x.shape[1]):
                for j in range(x.shape[1]):
                    total += L.row_rate[row, b, i] * E[i, j] * x[b, j]
    return total


@jitable
def wrench_at_cg(L: Linear, row: int, b: int) -> tuple[V3, V3]:
    """Return force and torque, in body axes, of an equation's gradient on body b about its cg."""
    C, r = L.column[row, b], vector(L.r[b])
    force = (C[3], C[4], C[5])
    torque = sub((C[0], C[1], C[2]), cross(r, force))
    return force, unrotate(L.R[b], torque)


@jitable
def accelerates(L: Linear, M: Real | Pair, row: int, b: int, x: N1) -> complex:
    """Return what a displacement of body b makes of an equation's accelerations.

    C (c2 dx, c2/c1 B theta).
    """
    c2, (force, torque) = M.c[0, C2], wrench_at_cg(L, row, b)
    theta = (x[0], x[1], x[2])
    shift = add((x[3], x[4], x[5]), cross(theta, vector(L.r[b])))
    turn = rotate(M.B[b], unrotate(L.R[b], theta))
    return c2 * dot(force, shift) + c2 / M.c[0, C1] * dot(torque, turn)


@jitable
def acceleration_row(L: Linear, M: Real | Pair, row: int, x: N2) -> complex:
    """Return what displacements make of an equation's accelerations."""
    total = 0.0 * x[0, 0]
    for b in range(len(L.w)):
        total += accelerates(L, M, row, b, x[b])
    return total


@jitable
def level_of(scene: Scene, row: int) -> int:
    """Return what an equation in use holds: 2 displacements, 1 velocities, 0 accelerations."""
    return scene.equations.level[scene.equations.active[row]]


@jitable
def held_row(scene: Scene, L: Linear, M: Real | Pair, row: int, x: N2) -> complex:
    """Return what displacements make of what an equation in use holds, as a displacement."""
    level = level_of(scene, row)
    if level == 2:
        return along_row(L, M, row, 0, x)
    total = along_row(L, M, row, 1, x)
    if level == 1:
        return total / M.c[0, C1]
    return (total + acceleration_row(L, M, row, x)) / M.c[0, C2]


@jitable
def fill_nodes(scene: Scene, T: Tangent, M: Real | Pair) -> None:
    """Fill what equations in nodes make of displacements, and their forces.

    A multiplier that is released is 0.
    """
    P, L, nb = T.pattern, T.linear, len(T.linear.w)
    for r in range(active_count(scene)):
        c, q = P.node[scene.equations.active[r]], P.at[r]
        if c < 0:
            continue
        if L.released[r] == 1:
            M.A[P.block[c, c], q, q] = 1.0
            continue
        for k in range(P.first[c - nb], P.first[c - nb + 1]):
            b = P.held[k]
            held_by(scene, L, M, r, b, M.A[P.block[c, b], q])
            force = M.A[P.block[b, c]]
            for i in range(force.shape[0]):
                force[i, q] = -L.column[r, b, i]


@jitable
def held_by(scene: Scene, L: Linear, M: Real | Pair, row: int, b: int, out: N1) -> None:
    """Write `held_row` of unit displacements of body b."""
    level = level_of(scene, row)
    E, x = M.work[2], M.work[3, 0]
    if level < 2:
        times_rate(L, M, b, E)
    for j in range(len(out)):
        total = L.row[row, b, j] + 0.0 * M.c[0, C1]
        if level < 2:
            for i in range(len(out)):
                total += L.row_rate[row, b, i] * E[i, j]
        if level == 0:
            for i in range(len(out)):
                x[i] = 1.0 if i == j else 0.0
            total += accelerates(L, M, row, b, x)
        if level == 1:
            total /= M.c[0, C1]
        elif level == 0:
            total /= M.c[0, C2]
        out[j] = total


@jitable
def held_residual(scene: Scene, L: Linear, M: Real | Pair, row: int, r: N1) -> complex:
    """Return what residuals make of the same."""
    total, level = 0.0 * M.rate[0, 0], level_of(scene, row)
    if level == 2:
        return total
    for b in range(len(L.w)):
        for i in range(M.rate.shape[1]):
            # M.rate is -e
            total -= L.row_rate[row, b, i] * M.rate[b, i]
    if level == 1:
        return total / M.c[0, C1]
    for b in range(len(L.w)):
        force, torque = wrench_at_cg(L, row, b)
        shift, turn = asked_of(L, M, b, r)
        total += dot(force, shift) + dot(torque, turn)
    return total / M.c[0, C2]


@jitable
def factor_rest(scene: Scene, T: Tangent, M: Real | Pair) -> int:
    """Factor the border: what equations and states ask of the bodies."""
    P, L = T.pattern, T.linear
    active, size = dense_count(M), border_count(scene, M)
    for k in range(size):
        row, y = bordered(scene, M, k), M.answer[k]
        for b in range(len(P.order)):
            for i in range(y.shape[1]):
                y[b, i] = L.column[row, b, i] if b < len(L.w) else 0.0
        solve_bodies(P, M, L, scene.tree.free, y)
    for k in range(size):
        row = bordered(scene, M, k)
        for other in range(size):
            if k < active:
                M.border[k, other] = held_row(scene, L, M, row, M.answer[other])
                if L.released[row] == 1:
                    # its multiplier is 0
                    M.border[k, other] = 1.0 if k == other else 0.0
                continue
            M.border[k, other] = -along_row(L, M, row, 1, M.answer[other])
            if other >= active:
                M.border[k, other] -= L.slopes[k - active, other - active]
            if other == k:
                M.border[k, other] += M.c[0, C3]
    factor_border(M.border, M.border_swap, size)
    return 0


@jitable
def ask_nodes(scene: Scene, T: Tangent, M: Real | Pair, r: N1) -> None:
    """Fill g of multipliers with what residuals make of what their equations hold."""
    P, L = T.pattern, T.linear
    for c in range(len(L.w), len(P.order)):
        for q in range(M.g.shape[1]):
            M.g[c, q] = 0.0
    for row in range(active_count(scene)):
        if is_in_node(scene, P, M, row) and L.released[row] == 0:
            M.g[P.node[scene.equations.active[row]], P.at[row]] = held_residual(scene, L, M, row, r)


@jitable
def solve_border_part(scene: Scene, T: Tangent, M: Real | Pair, r: N1) -> None:
    """Solve for multipliers and states, and add what they do to g, which holds displacements."""
    P, L = T.pattern, T.linear
    active, size = dense_count(M), border_count(scene, M)
    x = M.extra[1]
    for k in range(size):
        row = bordered(scene, M, k)
        if k < active:
            x[k] = held_residual(scene, L, M, row, r) - held_row(scene, L, M, row, M.g)
            if L.released[row] == 1:
                x[k] = 0.0 * x[k]
            continue
        at = scene.states.offset[k - active]
        x[k] = r[at] + along_row(L, M, row, 1, M.g)
        for b in range(len(L.w)):
            for i in range(M.rate.shape[1]):
                x[k] += L.row_rate[row, b, i] * M.rate[b, i]
    solve_small(M.border, M.border_swap, size, x)
    for k in range(size):
        for b in range(len(P.order)):
            for i in range(M.g.shape[1]):
                M.g[b, i] += M.answer[k, b, i] * x[k]
