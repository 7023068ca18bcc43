"""Accelerations of bodies on a tree of joints, by the articulated-body recursion.

Spatial vectors are (angular, linear) in global axes about O, the cg of the root of each tree at
the trial point; O stands still while derivatives are taken. Of a body with cg at r from O:

    V = (w, v - w x r),   A = dV/dt = (alpha, a - alpha x r - w x v),

and its equation of motion is H A + bias = wrench. A joint leaves V_child - V_parent = sum S q',
and its constraint force does no work on any S. Going up, what hangs below a joint is carried as
an articulated inertia and force; going down, accelerations follow (R. Featherstone, Rigid Body
Dynamics Algorithms, 2008, chapter 7). The cost grows with the number of bodies.
"""

from __future__ import annotations

import math

from mbsim.arrays.codes import CHILD_AXIS, PARENT_AXIS, TURN_AXIS, TURN_CROSS, TURN_FREE, TURN_ROOT
from mbsim.arrays.scene import Scene
from mbsim.core.arrays import F1, F2, V3, V6
from mbsim.core.jitable import jitable
from mbsim.core.layout import BODY_SIZE
from mbsim.core.rotation import add, cross, dot, rotate, scale, sub, unrotate, vector
from mbsim.dynamics.bodies.kinematics import position


@jitable
def origin(scene: Scene, y: F1, k: int) -> V3:
    """Return O of the tree that tree index k belongs to."""
    return position(scene, y, scene.tree.body[scene.tree.root[k]])


@jitable
def parent_body(scene: Scene, k: int) -> int:
    """Return the body row of the parent of tree index k."""
    parent = scene.tree.parent[k]
    return scene.tree.body[parent] if parent >= 0 else len(scene.bodies.mass)


@jitable
def parent_axis(scene: Scene, k: int, axis: int) -> V3:
    """Return an axis of the joint's marker on the parent, global."""
    M = scene.tree.parent_R[k]
    return rotate(scene.work.R[parent_body(scene, k)], (M[0, axis], M[1, axis], M[2, axis]))


@jitable
def child_axis(scene: Scene, k: int, axis: int) -> V3:
    """Return an axis of the joint's marker on the child, global."""
    M = scene.tree.child_R[k]
    return rotate(scene.work.R[scene.tree.body[k]], (M[0, axis], M[1, axis], M[2, axis]))


@jitable
def six(row: F1) -> V6:
    """Return a spatial vector as a tuple, which stores to arrays do not make be read again."""
    return (row[0], row[1], row[2], row[3], row[4], row[5])


@jitable
def inner(a: V6, b: V6) -> float:
    """Return the product of a force and a motion."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3] + a[4] * b[4] + a[5] * b[5]


@jitable
def plus(a: V6, factor: float, b: V6) -> V6:
    """Return a + factor b."""
    return (
        a[0] + factor * b[0],
        a[1] + factor * b[1],
        a[2] + factor * b[2],
        a[3] + factor * b[3],
        a[4] + factor * b[4],
        a[5] + factor * b[5],
    )


@jitable
def times(H: F2, a: V6) -> V6:
    """Return H a of a symmetric H, whose lower triangle is read."""
    return (
        inner((H[0, 0], H[1, 0], H[2, 0], H[3, 0], H[4, 0], H[5, 0]), a),
        inner((H[1, 0], H[1, 1], H[2, 1], H[3, 1], H[4, 1], H[5, 1]), a),
        inner((H[2, 0], H[2, 1], H[2, 2], H[3, 2], H[4, 2], H[5, 2]), a),
        inner((H[3, 0], H[3, 1], H[3, 2], H[3, 3], H[4, 3], H[5, 3]), a),
        inner((H[4, 0], H[4, 1], H[4, 2], H[4, 3], H[4, 4], H[5, 4]), a),
        inner((H[5, 0], H[5, 1], H[5, 2], H[5, 3], H[5, 4], H[5, 5]), a),
    )


@jitable
def put(row: F1, a: V3, b: V3) -> None:
    """Write a spatial vector into a row."""
    for i in range(3):
        row[i] = a[i]
        row[3 + i] = b[i]


@jitable
def fill_directions(scene: Scene, y: F1, k: int) -> None:
    """Fill the free directions at tree index k, and the acceleration that velocities cause in them.

    A turn about e through P, e fixed to a body with angular velocity w_e and P to the child, has
    S = (e, P x e) and dS/dt = (w_e x e, v_P x e + P x (w_e x e)); a slide along e of the parent
    (0, e) and (0, w_p x e).
    """
    tree, work, S, c = scene.tree, scene.work, scene.sweep.S[k], scene.sweep.c[k]
    turn = tree.turn[k]
    if turn == TURN_ROOT:
        for q in range(6):
            for i in range(6):
                S[q, i] = 1.0 if i == q else 0.0
            c[q] = 0.0
        return
    body, parent = tree.body[k], parent_body(scene, k)
    w_c, w_p = vector(work.w[body]), vector(work.w[parent])
    arm = rotate(work.R[body], vector(tree.child_p[k]))
    at = add(position(scene, y, body), arm)
    P = add(vector(scene.sweep.arm[k]), arm)
    v_P = add(vector(work.v[body]), cross(w_c, arm))
    relative = sub(w_c, w_p)
    turning, bend = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    free = 0
    if turn == TURN_AXIS:
        e = parent_axis(scene, k, 2)
        put(S[0], e, cross(P, e))
        turning = scale(dot(relative, e), e)
        bend = cross(w_p, turning)
        free = 1
    elif turn == TURN_CROSS:
        # a moves with the child, b with the parent; they are at right angles
        a = child_axis(scene, k, tree.axis[k, CHILD_AXIS])
        b = parent_axis(scene, k, tree.axis[k, PARENT_AXIS])
        put(S[0], a, cross(P, a))
        put(S[1], b, cross(P, b))
        about_a, about_b = scale(dot(relative, a), a), scale(dot(relative, b), b)
        turning = add(about_a, about_b)
        bend = add(cross(w_c, about_a), cross(w_p, about_b))
        free = 2
    elif turn == TURN_FREE:
        for q in range(3):
            e = (1.0 if q == 0 else 0.0, 1.0 if q == 1 else 0.0, 1.0 if q == 2 else 0.0)
            put(S[q], e, cross(P, e))
        turning = relative
        free = 3
    linear = add(cross(v_P, turning), cross(P, bend))
    if tree.free[k] > free:
        v_p = add(vector(work.v[parent]), cross(w_p, sub(at, position(scene, y, parent))))
        for axis in range(3):
            if tree.slide[k, axis] == 1:
                e = parent_axis(scene, k, axis)
                put(S[free], (0.0, 0.0, 0.0), e)
                linear = add(linear, scale(dot(sub(v_P, v_p), e), cross(w_p, e)))
                free += 1
    put(c, bend, linear)


@jitable
def fill_inertia(scene: Scene, k: int, H: F2) -> None:
    """Fill the inertia of the body at tree index k about O, its lower triangle; `arm` is known."""
    b, r = scene.tree.body[k], vector(scene.sweep.arm[k])
    R, J, m = scene.work.R[b], scene.bodies.inertia[b], scene.bodies.mass[b]
    square = dot(r, r)
    for i in range(3):
        row = (
            R[i, 0] * J[0, 0] + R[i, 1] * J[1, 0] + R[i, 2] * J[2, 0],
            R[i, 0] * J[0, 1] + R[i, 1] * J[1, 1] + R[i, 2] * J[2, 1],
            R[i, 0] * J[0, 2] + R[i, 1] * J[1, 2] + R[i, 2] * J[2, 2],
        )
        for j in range(i + 1):
            turned = row[0] * R[j, 0] + row[1] * R[j, 1] + row[2] * R[j, 2]
            H[i, j] = turned + m * ((square if i == j else 0.0) - r[i] * r[j])
            H[3 + i, 3 + j] = m if i == j else 0.0
        H[3 + i, i] = 0.0
    # m [r]x couples angular with linear
    H[3, 1], H[3, 2] = m * r[2], -m * r[1]
    H[4, 0], H[4, 2] = -m * r[2], m * r[0]
    H[5, 0], H[5, 1] = m * r[1], -m * r[0]


@jitable
def fill_body(scene: Scene, y: F1, k: int) -> None:
    """Fill inertia about O and the force that velocities call for."""
    b = scene.tree.body[k]
    bodies, work = scene.bodies, scene.work
    R, J, m = work.R[b], bodies.inertia[b], bodies.mass[b]
    r = sub(position(scene, y, b), origin(scene, y, k))
    for i in range(3):
        scene.sweep.arm[k, i] = r[i]
    fill_inertia(scene, k, scene.sweep.H[k])

    w = vector(work.w[b])
    spin = unrotate(R, w)
    momentum = rotate(R, rotate(J, spin))
    linear = scale(m, cross(w, vector(work.v[b])))
    put(scene.sweep.bias[k], add(cross(r, linear), cross(w, momentum)), linear)


@jitable
def factor_free(scene: Scene, k: int) -> None:
    """Fill L and W at tree index k: S'HS = L D L', W = L^-1 S'H; 1/D is on L's diagonal."""
    sweep, free = scene.sweep, scene.tree.free[k]
    H, S, W, L = sweep.H[k], sweep.S[k], sweep.W[k], sweep.L[k]
    for q in range(free):
        s = six(S[q])
        u = times(H, s)
        for r in range(q):
            # W[r] is done, so that D L'[r, q] = W[r] . S[q]
            w = six(W[r])
            L[q, r] = L[r, r] * inner(w, s)
            u = plus(u, -L[q, r], w)
        resists = inner(u, s)
        # what does not resist in a free direction has no acceleration
        L[q, q] = 1.0 / resists if resists > 0.0 else math.nan
        for i in range(6):
            W[q, i] = u[i]


@jitable
def hang_on(scene: Scene, k: int, above: F2) -> None:
    """Add what tree index k resists beside its free directions, H - W' D^-1 W, to an inertia above.

    Of both the lower triangle.
    """
    H, W, L = scene.sweep.H[k], scene.sweep.W[k], scene.sweep.L[k]
    for i in range(6):
        row = six(H[i])
        for q in range(scene.tree.free[k]):
            row = plus(row, -L[q, q] * W[q, i], six(W[q]))
        for j in range(i + 1):
            above[i, j] += row[j]


@jitable
def hang(scene: Scene, k: int) -> None:
    """Factor what tree index k resists in its free directions and hang the rest above."""
    factor_free(scene, k)
    parent = scene.tree.parent[k]
    if parent >= 0:
        hang_on(scene, k, scene.sweep.H[parent])


@jitable
def prepare(scene: Scene, y: F1) -> None:
    """Fill all that follows from positions and velocities: inertias, directions, biases."""
    n = len(scene.tree.body)
    for k in range(n):
        fill_body(scene, y, k)
        fill_directions(scene, y, k)
    for k in range(n - 1, -1, -1):
        hang(scene, k)


@jitable
def load(scene: Scene) -> None:
    """Start the forces p of all bodies of the tree: what velocities call for less what acts."""
    sweep, work, tree = scene.sweep, scene.work, scene.tree
    for k in range(len(tree.body)):
        b = tree.body[k]
        force = vector(work.force[b])
        torque = add(vector(work.torque[b]), cross(vector(sweep.arm[k]), force))
        for i in range(3):
            sweep.p[k, i] = sweep.bias[k, i] - torque[i]
            sweep.p[k, 3 + i] = sweep.bias[k, 3 + i] - force[i]


@jitable
def pass_up(scene: Scene, k: int, moving: int) -> None:
    """Find what p at tree index k asks of its free directions; pass the rest to its parent."""
    sweep, free, parent = scene.sweep, scene.tree.free[k], scene.tree.parent[k]
    S, W, L, z, p = sweep.S[k], sweep.W[k], sweep.L[k], sweep.z[k], six(sweep.p[k])
    for q in range(free):
        total = -inner(six(S[q]), p)
        for j in range(q):
            total -= L[q, j] * z[j]
        z[q] = total
    if parent < 0:
        return
    up, above = p, sweep.p[parent]
    if moving == 1:
        H, c = sweep.H[k], six(sweep.c[k])
        up = plus(up, 1.0, times(H, c))
    for q in range(free):
        w, share = six(W[q]), z[q]
        if moving == 1:
            share -= inner(w, six(sweep.c[k]))
        up = plus(up, L[q, q] * share, w)
    for i in range(6):
        above[i] += up[i]


@jitable
def pass_down(scene: Scene, k: int, moving: int, out: F2) -> None:
    """Find the acceleration at tree index k from that of its parent: D L' q'' = z - W a."""
    sweep, free, parent = scene.sweep, scene.tree.free[k], scene.tree.parent[k]
    S, W, L, z = sweep.S[k], sweep.W[k], sweep.L[k], sweep.z[k]
    a = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    if parent >= 0:
        a = six(out[parent])
    if moving == 1:
        c = six(sweep.c[k])
        a = plus(a, 1.0, c)
    for q in range(free):
        z[q] = L[q, q] * (z[q] - inner(six(W[q]), a))
    for q in range(free - 1, -1, -1):
        for j in range(q + 1, free):
            z[q] -= L[j, q] * z[j]
    for q in range(free):
        s, rise = six(S[q]), z[q]
        a = plus(a, rise, s)
    for i in range(6):
        out[k, i] = a[i]


@jitable
def respond(scene: Scene, first: int, end: int, moving: int, out: F2) -> None:
    """Fill the accelerations `out` at tree indices first..end that the forces p cause.

    `moving` 0 leaves out what velocities cause. On return p is the articulated force.
    """
    for k in range(end - 1, first - 1, -1):
        pass_up(scene, k, moving)
    for k in range(first, end):
        pass_down(scene, k, moving, out)


@jitable
def write_accelerations(scene: Scene, dy: F1) -> float:
    """Write accelerations of the tree's bodies into y'; return their sum, finite if all are."""
    total = 0.0
    for k in range(len(scene.tree.body)):
        b = scene.tree.body[k]
        A = scene.sweep.a[k]
        alpha = (A[0], A[1], A[2])
        r = vector(scene.sweep.arm[k])
        a = add((A[3], A[4], A[5]), cross(alpha, r))
        a = add(a, cross(vector(scene.work.w[b]), vector(scene.work.v[b])))
        turn = unrotate(scene.work.R[b], alpha)
        at = BODY_SIZE * b
        for i in range(3):
            dy[at + 7 + i] = a[i]
            dy[at + 10 + i] = turn[i]
            total += a[i] + turn[i]
    return total
