"""Friction that looks at X or integrates memory, in the linear systems of implicit methods.

What the integrator carries for a slot, zeta = (X, memory), follows from u = (slip, spin) and N, and
the force of friction from all three:

    d zeta' = A zeta + B (du, dN)          dF = C d zeta + (what `contact_slopes` adds of du and dN)

The methods ask for c3 d zeta - d zeta' = r, so that with Z = (c3 - A)^-1

    d zeta = Z (B (du, dN) + r)            dF = C Z B (du, dN) + C Z r

is added to the equations of the two bodies, and d zeta is found when their displacements are.
Behind hooks of the scene, so that only scenes with such friction compile it.
"""

from __future__ import annotations

from mbsim.arrays.codes import C1, C3, PRESS_BY_DEPTH, PRESS_BY_RATE, SCALE_LENGTH, SCALE_SPEED
from mbsim.arrays.hooks import Hook, Memory
from mbsim.arrays.scene import Scene
from mbsim.compile_model.tangent import Keeps, Linear, Pair, Real, Tangent
from mbsim.core.address import vector_at, view
from mbsim.core.arrays import F1, F2, N1, N2, V3, Pointer
from mbsim.core.jitable import jitable
from mbsim.core.rotation import add, scale, sub, vector
from mbsim.dynamics.contact.forces import contact_of, in_marker, sides
from mbsim.dynamics.linearization.border import times_rate
from mbsim.dynamics.linearization.contact_slopes import ask_friction
from mbsim.geometry.catalog import AT_DEPTH, AT_NORMAL, AT_POINT
from mbsim.laws.abi import MEMORY_OUT, SIZE_OUT, STEP_IN, TIME_IN

#: Differences of X, as a part of the model's length, and of memory, as a part of its size.
_PUSH_X, _PUSH = 1e-10, 1e-6
#: Places of slip x, slip y and spin about the normal among the arguments of friction.
_OF_X = (0, 1, 4)
#: Arguments of friction: slip (2), spin (3), normal force.
_GIVEN = 6


@jitable
def offset_of(scene: Scene, s: int, j: int) -> int:
    """Return where the j-th number that slot s carries stands in y."""
    x = scene.slots.x[s]
    if x < 0:
        return scene.slots.z[s] + j
    return x + j if j < 3 else scene.slots.z[s] + j - 3


@jitable
def carried(scene: Scene, s: int) -> int:
    """Return how many numbers slot s carries in y."""
    count = 3 if scene.slots.x[s] >= 0 else 0
    return count + scene.contacts.carried[contact_of(scene, s)]


@jitable
def ask_at(scene: Scene, y: F1, s: int, around: tuple[V3, V3], given: F1, out: F1) -> int:
    """Copy forces and rates of memory for these arguments into `out`; return a code."""
    law_in, law_out, c = scene.work.law_in, scene.work.law_out, contact_of(scene, s)
    code = ask_friction(scene, law_in[TIME_IN], law_in[STEP_IN], y, s, c, around, given)
    for k in range(5):
        out[k] = law_out[k]
    at = 5
    if scene.slots.x[s] >= 0:
        out[5], out[6], out[7] = given[0], given[1], given[4]
        at = 8
    if scene.slots.z[s] >= 0:
        n = scene.contacts.memory[c]
        for k in range(scene.contacts.carried[c]):
            out[at + k] = law_out[MEMORY_OUT + n + k]
    return code


@jitable
def push_of(scene: Scene, y: F1, s: int, given: F1, column: int) -> float:
    """Return by how much an argument of friction is changed for a difference."""
    if column >= _GIVEN:
        j = column - _GIVEN
        if scene.slots.x[s] >= 0 and j < 3:
            length = scene.world.scale[SCALE_LENGTH] if j < 2 else 1.0
            return _PUSH_X * (length + abs(y[offset_of(scene, s, j)]))
        size = scene.work.law_out[SIZE_OUT]
        return _PUSH * (size if size > 0.0 else 1.0)
    if column < 2:
        return 1e-6 * abs(given[column]) + 1e-8 * scene.world.scale[SCALE_SPEED]
    if column < 5:
        return (
            1e-6 * abs(given[column])
            + 1e-8 * scene.world.scale[SCALE_SPEED] / scene.world.scale[SCALE_LENGTH]
        )
    return 1e-6 * given[column] if given[column] > 0.0 else 1e-6


@jitable
def take_known(L: Linear, table: F2) -> int:
    """Take what is known where X alone is carried, whose rates are slip; return the next column."""
    for column in range(_GIVEN):
        for row in range(5):
            table[row, column] = L.law[row, column]
        for j in range(3):
            table[5 + j, column] = 1.0 if column == _OF_X[j] else 0.0
    return _GIVEN


@jitable
def fill(scene: Scene, T: Tangent, y: F1) -> int:
    """Keep how friction in the slot named last in `held` depends on what it carries."""
    K, L = T.keeps, T.linear
    count = K.held[len(K.held) - 1]
    s = K.held[count]
    table, given, n = K.table[count], L.rise, carried(scene, s)
    gi, gj = sides(scene, s)
    point, around = scene.work.points[s], ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    if scene.contacts.framed[contact_of(scene, s)] == 1:
        p, half = (
            vector(point[AT_POINT:]),
            scale(0.5 * point[AT_DEPTH], vector(point[AT_NORMAL:])),
        )
        around = (in_marker(scene, y, gi, sub(p, half)), in_marker(scene, y, gj, add(p, half)))
    first = 0 if scene.slots.z[s] >= 0 else take_known(L, table)
    upper, lower = K.scratch[0], K.scratch[1]
    for column in range(first, _GIVEN + n):
        size, code = push_of(scene, y, s, given, column), 0
        for side in range(2):
            change = size if side == 0 else -size
            out = upper if side == 0 else lower
            if column < _GIVEN:
                kept = given[column]
                given[column] = kept + change
                code = ask_at(scene, y, s, around, given, out)
                given[column] = kept
            else:
                offset = offset_of(scene, s, column - _GIVEN)
                kept = y[offset]
                y[offset] = kept + change
                code = ask_at(scene, y, s, around, given, out)
                y[offset] = kept
            if code != 0:
                return code
        for row in range(5 + n):
            table[row, column] = (upper[row] - lower[row]) / (2.0 * size)
    for i in range(K.carries.shape[1]):
        K.carries[count, i] = offset_of(scene, s, i) if i < n else -1
    for side in range(2):
        K.body[count, side] = scene.graphics.body[gi if side == 0 else gj]
        for direction in range(6):
            for i in range(6):
                K.lever[count, side, direction, i] = L.basis[side, direction, i]
    K.held[len(K.held) - 1] = count + 1
    return 0


@jitable
def invert(A: N2, Z: N2, n: int) -> None:
    """Write the inverse of the leading n x n part of A, which is destroyed, into Z."""
    for i in range(n):
        for j in range(n):
            Z[i, j] = 1.0 if i == j else 0.0
    for k in range(n):
        best = k
        for i in range(k + 1, n):
            if abs(A[i, k]) > abs(A[best, k]):
                best = i
        for j in range(n):
            A[k, j], A[best, j] = A[best, j], A[k, j]
            Z[k, j], Z[best, j] = Z[best, j], Z[k, j]
        pivot = A[k, k]
        for j in range(n):
            A[k, j] /= pivot
            Z[k, j] /= pivot
        for i in range(n):
            part = A[i, k]
            if i != k and part != 0.0:
                for j in range(n):
                    A[i, j] -= part * A[k, j]
                    Z[i, j] -= part * Z[k, j]


@jitable
def count_of(K: Keeps, k: int) -> int:
    """Return how many numbers the k-th slot held carries."""
    n = 0
    while n < K.carries.shape[1] and K.carries[k, n] >= 0:
        n += 1
    return n


@jitable
def follow(K: Keeps, k: int, n: int, Z: N2, row: int, through: N1, part: N1) -> bool:
    """Write a row of C Z B into `part`, the force `row` by each argument; return whether any."""
    some = False
    for j in range(n):
        through[j] = 0.0
        for i in range(n):
            through[j] += K.table[k, row, _GIVEN + i] * Z[i, j]
    for column in range(_GIVEN):
        part[column] = 0.0
        for j in range(n):
            part[column] += through[j] * K.table[k, 5 + j, column]
        some = some or part[column] != 0.0
    return some


@jitable
def add_to_matrix(scene: Scene, T: Tangent, M: Real | Pair) -> None:  # noqa: C901
    """Form Z of every slot, and add C Z B to the matrix.

    Many branches because the sums of one triple product stand in one another, in its scratch.
    """
    K, P, nb = T.keeps, T.pattern, len(scene.bodies.mass)
    for k in range(K.held[len(K.held) - 1]):
        n, Z, A = count_of(K, k), M.keep[k], M.keep[len(M.keep) - 1]
        for i in range(n):
            for j in range(n):
                A[i, j] = -K.table[k, 5 + i, _GIVEN + j]
            A[i, i] += M.c[0, C3]
        invert(A, Z, n)
        pair = K.body[k]
        for by in range(2):
            b = pair[by]
            if b >= nb:
                continue
            E, turned = M.work[2], M.work[3]
            times_rate(T.linear, M, b, E)
            # rows of `turned`: what slip, spin and N follow of xi
            for direction in range(6):
                lever = K.lever[k, by, (direction + 1) % 6]
                for q in range(6):
                    rate = 0.0 * E[0, 0]
                    for i in range(6):
                        rate += lever[i] * E[i, q]
                    if direction == 5:
                        rate = (
                            -K.press[k, PRESS_BY_DEPTH] * lever[q]
                            - K.press[k, PRESS_BY_RATE] * rate
                        )
                    turned[direction, q] = rate
            # E is free from here on
            part, by_move = E[0], E[1]
            for row in range(5):
                if not follow(K, k, n, Z, row, A[0], part):
                    continue
                for j in range(6):
                    by_move[j] = 0.0
                    for column in range(_GIVEN):
                        by_move[j] += part[column] * turned[column, j]
                for of in range(2):
                    a = pair[of]
                    if a >= nb:
                        continue
                    sign = 1.0 if of == by else -1.0
                    block, lever = M.A[P.block[a, b]], K.lever[k, of, 1 + row]
                    for i in range(6):
                        for j in range(6):
                            block[i, j] -= sign * lever[i] * by_move[j]


@jitable
def drive(scene: Scene, T: Tangent, M: Real | Pair, r: F1, k: int, e: N1, with_moves: bool) -> None:
    """Fill e with B (du, dN) + r of slot k; `with_moves`: by displacements too, else by rates."""
    K, nb, pair = T.keeps, len(scene.bodies.mass), T.keeps.body[k]
    n = count_of(K, k)
    for i in range(n):
        e[i] = r[K.carries[k, i]]
    for by in range(2):
        b = pair[by]
        if b >= nb:
            continue
        E, rates, sign = M.work[2], M.work[3, 0], 1.0 if by == 0 else -1.0
        for i in range(6):
            rates[i] = M.rate[b, i]
        if with_moves:
            times_rate(T.linear, M, b, E)
            for i in range(6):
                for q in range(6):
                    rates[i] += E[i, q] * M.g[b, q]
        for direction in range(6):
            lever = K.lever[k, by, (direction + 1) % 6]
            move, rate = 0.0 * M.c[0, C1], 0.0 * M.c[0, C1]
            for i in range(6):
                rate += lever[i] * rates[i]
                if with_moves:
                    move += lever[i] * M.g[b, i]
            if direction == 5:
                rate = -K.press[k, PRESS_BY_DEPTH] * move - K.press[k, PRESS_BY_RATE] * rate
            for i in range(n):
                e[i] += sign * K.table[k, 5 + i, direction] * rate


@jitable
def add_to_right_side(scene: Scene, T: Tangent, M: Real | Pair, r: F1) -> None:
    """Add what residuals ask of friction: C Z (B (du, dN) + r), du and dN by rates alone."""
    K, nb = T.keeps, len(scene.bodies.mass)
    for k in range(K.held[len(K.held) - 1]):
        Z, e = M.keep[k], M.keep[len(M.keep) - 1, 0]
        n, pair = count_of(K, k), K.body[k]
        drive(scene, T, M, r, k, e, False)
        for row in range(5):
            force = 0.0 * M.c[0, C1]
            for i in range(n):
                for j in range(n):
                    force += K.table[k, row, _GIVEN + i] * Z[i, j] * e[j]
            for of in range(2):
                if pair[of] < nb:
                    sign = 1.0 if of == 0 else -1.0
                    for i in range(6):
                        M.g[pair[of], i] += sign * K.lever[k, of, 1 + row, i] * force


@jitable
def recover(scene: Scene, T: Tangent, M: Real | Pair, r: F1, d: F1) -> None:
    """Write how what slots carry changes; M.g holds the displacements."""
    K = T.keeps
    for k in range(K.held[len(K.held) - 1]):
        Z, e, n = M.keep[k], M.keep[len(M.keep) - 1, 0], count_of(K, k)
        drive(scene, T, M, r, k, e, True)
        for i in range(n):
            total = 0.0 * M.c[0, C1]
            for j in range(n):
                total += Z[i, j] * e[j]
            d[K.carries[k, i]] = total


def serve_memory(context: int, what: int, r: Pointer, d: Pointer) -> int:
    """What friction with memory does in real systems (`Memory`)."""
    scene = view(context, Scene)
    T = view(scene.world.hooks[Hook.TANGENT], Tangent)
    n = scene.rows.y.shape[1]
    a, b = vector_at(r, n), vector_at(d, n)
    if what == Memory.FACTOR:
        add_to_matrix(scene, T, T.real)
    elif what == Memory.RIGHT:
        add_to_right_side(scene, T, T.real, a)
    elif what == Memory.RECOVER:
        recover(scene, T, T.real, a, b)
    else:
        return fill(scene, T, a)
    return 0


def serve_memory_pair(context: int, what: int, r: Pointer, d: Pointer) -> int:
    """The same of complex ones."""
    scene = view(context, Scene)
    T = view(scene.world.hooks[Hook.TANGENT], Tangent)
    n = scene.rows.y.shape[1]
    a, b = vector_at(r, n), vector_at(d, n)
    if what == Memory.FACTOR:
        add_to_matrix(scene, T, T.pair)
    elif what == Memory.RIGHT:
        add_to_right_side(scene, T, T.pair, a)
    else:
        recover(scene, T, T.pair, a, b)
    return 0
