"""The linear systems of implicit methods, for a step's coefficients c1, c2, c3.

Sought is d = (dx, dq, dv, dw, dz) with, for residuals r,

    dv = c1 dx - r_x,   dw = B theta - rho,   c3 dz - d(z') = r_z,
    da = c2 dx - r_a,   d(alpha) = c2/c1 B theta - r_alpha,

da and d(alpha) the accelerations that the linearised mechanism gives; theta is the turn in body
axes, dq = q (0, theta/2), r_q = q (., rho/2). A first-order method (form 0) linearises q' = q (0,
w)/2, so that B = c1 + [w]x/2, r_a = c1 r_x + r_v and r_alpha = c1 rho + r_w. A second-order method
(form 1) turns by the exponential, B = c1 (1 + h [w]x/2), and gives r_a and r_alpha itself.

Displacements xi keep to joints and equations: what a residual asks for across them (M-orthogonal)
is left to the projection of the states, which takes the part of the multipliers of a stabilised
formulation of index 2. With K and D of forces and eta = E xi - e the change of velocities,

    (M(c2) - K - D E) xi = M r_a - D e + what joints and equations exert.

An equation that holds velocities, C v = g(t), asks for P xi + C (E xi - e) = 0, P being how C v
changes with poses; one of accelerations, C a + s(q, v) = g(t), for
P xi + V (E xi - e) + C da = 0 with the above da and d(alpha), V how s changes with velocities.
Both are taken over c1 or c2, so that rows of the border have one size.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from mbsim.arrays.codes import BLOCK_COLUMN, BLOCK_ROW, C1, C2, C3, FORM
from mbsim.arrays.hooks import Memory, note_failure
from mbsim.arrays.scene import Scene
from mbsim.core.address import call_int
from mbsim.core.arrays import N1, N2, V3
from mbsim.core.codes import Code
from mbsim.core.jitable import jitable
from mbsim.core.layout import BODY_SIZE
from mbsim.core.rotation import cross, rotate, unrotate, vector
from mbsim.dynamics.linearization.blocks import BLOCKS, COUPLINGS, eliminate, solve_bodies
from mbsim.dynamics.linearization.border import (
    ask_nodes,
    asked_of,
    dense_count,
    factor_rest,
    fill_nodes,
    list_border,
    solve_border_part,
    times_rate,
    turn_residual,
)

if TYPE_CHECKING:
    from mbsim.compile_model.tangent import Linear, Pair, Real, Tangent


@jitable
def fill_turns(T: Tangent, M: Real | Pair, h: float) -> None:
    """Fill B of every body."""
    L, c1, form = T.linear, M.c[0, C1], M.c[0, FORM].real
    for b in range(len(L.w)):
        w, B = L.w[b], M.B[b]
        for i in range(3):
            for j in range(3):
                B[i, j] = c1 if i == j else 0.0
        half = 0.5 if form == 0.0 else 0.5 * h * c1
        B[0, 1] -= half * w[2]
        B[0, 2] += half * w[1]
        B[1, 0] += half * w[2]
        B[1, 2] -= half * w[0]
        B[2, 0] -= half * w[1]
        B[2, 1] += half * w[0]


@jitable
def gyration(scene: Scene, L: Linear, b: int, u: tuple[complex, complex, complex]) -> V3:
    """Return how J alpha + w x J w changes with a change u of w, in body axes."""
    J, w = scene.bodies.inertia[b], vector(L.w[b])
    first = cross(u, rotate(J, w))
    second = cross(w, rotate(J, u))
    return (first[0] + second[0], first[1] + second[1], first[2] + second[2])


@jitable
def add_inertia(scene: Scene, L: Linear, M: Real | Pair, b: int, A: N2) -> None:
    """Add inertia and the wrench that joints and equations exert on body b, by xi, to A."""
    m, c1, c2 = scene.bodies.mass[b], M.c[0, C1], M.c[0, C2]
    R, B, J = L.R[b], M.B[b], scene.bodies.inertia[b]
    r, f, N = vector(L.r[b]), vector(L.force[b]), vector(L.torque[b])
    for j in range(B.shape[0]):
        e = (1.0 if j == 0 else 0.0, 1.0 if j == 1 else 0.0, 1.0 if j == 2 else 0.0)
        # a turn about O
        own = (R[j, 0], R[j, 1], R[j, 2])
        u = (
            B[0, 0] * own[0] + B[0, 1] * own[1] + B[0, 2] * own[2],
            B[1, 0] * own[0] + B[1, 1] * own[1] + B[1, 2] * own[2],
            B[2, 0] * own[0] + B[2, 1] * own[1] + B[2, 2] * own[2],
        )
        spun, gyro = rotate(J, u), gyration(scene, L, b, u)
        ratio = c2 / c1
        local = (
            ratio * spun[0] + gyro[0],
            ratio * spun[1] + gyro[1],
            ratio * spun[2] + gyro[2],
        )
        torque, turned, arm = rotate(R, local), cross(e, N), cross(e, r)
        force = (m * c2 * arm[0], m * c2 * arm[1], m * c2 * arm[2])
        moment, bend = cross(r, force), cross(arm, f)
        for i in range(3):
            A[i, j] += torque[i] + turned[i] + moment[i] + bend[i]
            A[3 + i, j] += force[i]
        # a displacement
        push = (m * c2 * e[0], m * c2 * e[1], m * c2 * e[2])
        moment, bend = cross(r, push), cross(e, f)
        for i in range(3):
            A[i, 3 + j] += moment[i] + bend[i]
            A[3 + i, 3 + j] += push[i]


@jitable
def fill_matrix(scene: Scene, T: Tangent, M: Real | Pair) -> None:
    """Fill A."""
    P, L = T.pattern, T.linear
    for k in range(P.count[COUPLINGS], P.count[BLOCKS]):
        for i in range(M.A.shape[1]):
            for j in range(M.A.shape[2]):
                M.A[k, i, j] = 0.0
    E, last = M.work[2], -1
    for k in range(P.count[COUPLINGS]):
        b, K, D, A = P.pair[k, BLOCK_COLUMN], L.K[k], L.D[k], M.A[k]
        if b != last:
            times_rate(L, M, b, E)
            last = b
        for i in range(A.shape[0]):
            for j in range(A.shape[1]):
                A[i, j] = -K[i, j]
            for q in range(A.shape[1]):
                part = D[i, q]
                if part != 0.0:
                    for j in range(A.shape[1]):
                        A[i, j] -= part * E[q, j]
    for b in range(len(L.w)):
        add_inertia(scene, L, M, b, M.A[P.block[b, b]])
    fill_nodes(scene, T, M)


@jitable
def ask_memory(scene: Scene, M: Real | Pair, what: int, r: N1, d: N1) -> None:
    """Let friction that carries numbers in y add its part, see `memory_slopes`."""
    hook = scene.world.hooks[M.hook[0]]
    if hook != 0:
        note_failure(scene, call_int(hook, (scene, what, r, d)))


@jitable
def factor(scene: Scene, T: Tangent, M: Real | Pair, h: float) -> int:
    """Factor the matrix for the coefficients in M.c; return 0 or a code."""
    P, L, free = T.pattern, T.linear, scene.tree.free
    fill_turns(T, M, h)
    fill_matrix(scene, T, M)
    ask_memory(scene, M, Memory.FACTOR, M.r[0], M.r[1])
    if not eliminate(P, M, L, free):
        return Code.SINGULAR
    list_border(scene, P, M)
    return factor_rest(scene, T, M)


@jitable
def ask_body(scene: Scene, L: Linear, M: Real | Pair, b: int, r: N1) -> None:
    """Fill g of body b with what its residuals ask of inertia, and its rate with -e."""
    at, m, R, arm = BODY_SIZE * b, scene.bodies.mass[b], L.R[b], vector(L.r[b])
    rho = turn_residual(L, b, r)
    shift, ask = asked_of(L, M, b, r)
    spun, gyro = rotate(scene.bodies.inertia[b], ask), gyration(scene, L, b, rho)
    torque = rotate(R, (spun[0] + gyro[0], spun[1] + gyro[1], spun[2] + gyro[2]))
    force = (m * shift[0], m * shift[1], m * shift[2])
    moment, slower = cross(arm, force), rotate(R, rho)
    carried = cross(slower, arm)
    for i in range(3):
        M.g[b, i] = torque[i] + moment[i]
        M.g[b, 3 + i] = force[i]
        M.rate[b, i] = -slower[i]
        M.rate[b, 3 + i] = carried[i] - r[at + i]


@jitable
def fill_right_side(scene: Scene, T: Tangent, M: Real | Pair, r: N1) -> None:
    """Fill g: what residuals ask of inertia and of forces by velocities."""
    P, L = T.pattern, T.linear
    for b in range(len(L.w)):
        ask_body(scene, L, M, b, r)
    for k in range(P.count[COUPLINGS]):
        a, b, D = P.pair[k, BLOCK_ROW], P.pair[k, BLOCK_COLUMN], L.D[k]
        for i in range(D.shape[0]):
            for j in range(D.shape[1]):
                M.g[a, i] += D[i, j] * M.rate[b, j]


@jitable
def write_answer(scene: Scene, T: Tangent, M: Real | Pair, r: N1, d: N1) -> None:
    """Write the displacements of bodies in the layout of y."""
    L, c1 = T.linear, M.c[0, C1]
    for b in range(len(L.w)):
        at, B, q = BODY_SIZE * b, M.B[b], L.q[b]
        theta = (M.g[b, 0], M.g[b, 1], M.g[b, 2])
        swing, rho = cross(theta, vector(L.r[b])), turn_residual(L, b, r)
        turn = unrotate(L.R[b], theta)
        for i in range(3):
            d[at + i] = M.g[b, 3 + i] + swing[i]
            d[at + 7 + i] = c1 * d[at + i] - r[at + i]
            d[at + 10 + i] = B[i, 0] * turn[0] + B[i, 1] * turn[1] + B[i, 2] * turn[2] - rho[i]
        e = (0.5 * turn[0], 0.5 * turn[1], 0.5 * turn[2])
        d[at + 3] = -q[1] * e[0] - q[2] * e[1] - q[3] * e[2]
        d[at + 4] = q[0] * e[0] + q[2] * e[2] - q[3] * e[1]
        d[at + 5] = q[0] * e[1] + q[3] * e[0] - q[1] * e[2]
        d[at + 6] = q[0] * e[2] + q[1] * e[1] - q[2] * e[0]


@jitable
def solve(scene: Scene, T: Tangent, M: Real | Pair, r: N1, d: N1) -> int:
    """Solve for the residual r; r and d (n,) in the layout of y."""
    fill_right_side(scene, T, M, r)
    ask_memory(scene, M, Memory.RIGHT, r, d)
    ask_nodes(scene, T, M, r)
    solve_bodies(T.pattern, M, T.linear, scene.tree.free, M.g)
    solve_border_part(scene, T, M, r)
    for k in range(BODY_SIZE * len(scene.bodies.mass), len(d)):
        # work and losses are sums of what bodies do
        d[k] = r[k] / M.c[0, C3]
    ask_memory(scene, M, Memory.RECOVER, r, d)
    write_answer(scene, T, M, r, d)
    dense = dense_count(M)
    for z in range(len(scene.states.program)):
        d[scene.states.offset[z]] = M.extra[1, dense + z]
    return 0
