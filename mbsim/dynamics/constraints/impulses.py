"""What impulses do to bodies that joints, equations and motions hold.

As `equations` has it for accelerations: the tree answers the impulses, and multipliers of the
equations take away what that would change of them, G dV = 0. All is as `hold` left it at y.
"""

from __future__ import annotations

from mbsim.arrays.scene import Scene
from mbsim.core.arrays import F1, F2, F3, V3, V6
from mbsim.core.jitable import jitable
from mbsim.core.rotation import add, cross, vector
from mbsim.dynamics.constraints.equations import (
    add_wrench,
    along,
    factor_equations,
    solve_equations,
)
from mbsim.dynamics.constraints.in_use import active_count
from mbsim.dynamics.constraints.projection import prepare_equations
from mbsim.dynamics.constraints.tree import plus, respond, six

NONE = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@jitable
def load_impulses(scene: Scene, wrench: F1) -> None:
    """Fill the forces p of the tree by impulses: of body b force and torque at 6 b, about its cg.

    Global axes.
    """
    sweep, tree = scene.sweep, scene.tree
    for k in range(len(tree.body)):
        at = 6 * tree.body[k]
        force, torque = vector(wrench[at:]), vector(wrench[at + 3 :])
        torque = add(torque, cross(vector(sweep.arm[k]), force))
        for c in range(3):
            sweep.p[k, c], sweep.p[k, 3 + c] = -torque[c], -force[c]


@jitable
def write_changes(scene: Scene, change: F1) -> None:
    """Write what `answer` changes of velocity and angular velocity of body b at 6 b."""
    sweep, tree = scene.sweep, scene.tree
    for k in range(len(tree.body)):
        D, at = sweep.answer[k], 6 * tree.body[k]
        spin = (D[0], D[1], D[2])
        velocity = add((D[3], D[4], D[5]), cross(spin, vector(sweep.arm[k])))
        for c in range(3):
            change[at + c], change[at + 3 + c] = velocity[c], spin[c]


@jitable
def answer_tree(scene: Scene, wrench: F1) -> None:
    """Replace impulses by the changes of velocities, where the tree holds all joints."""
    load_impulses(scene, wrench)
    respond(scene, 0, len(scene.tree.body), 0, scene.sweep.answer)
    write_changes(scene, wrench)


@jitable
def keep_six(row: F1, a: V6) -> None:
    """Write six numbers into a row."""
    row[0], row[1], row[2], row[3], row[4], row[5] = a


@jitable
def clear_six(wrench: F2) -> None:
    """Let six impulses on a body be none."""
    for c in range(6):
        keep_six(wrench[c], NONE)


@jitable
def is_none(wrench: F2) -> bool:
    """Return whether six impulses on a body are none."""
    total = 0.0
    for c in range(6):
        row = wrench[c]
        total += abs(row[0]) + abs(row[1]) + abs(row[2]) + abs(row[3]) + abs(row[4]) + abs(row[5])
    return total == 0.0


@jitable
def cross_row(r: V3, i: int, x: F2, at: int) -> V6:
    """Return component i of r x v for six v, whose components are the rows of x from `at` on."""
    a, b = (i + 1) % 3, (i + 2) % 3
    return plus(plus(NONE, r[a], six(x[at + b])), -r[b], six(x[at + a]))


@jitable
def load_six(scene: Scene, k: int, wrench: F3) -> None:
    """Replace six impulses on the body at tree index k, about its cg, by forces p about O."""
    w, r = wrench[scene.tree.body[k]], vector(scene.sweep.arm[k])
    x, y, z = cross_row(r, 0, w, 0), cross_row(r, 1, w, 0), cross_row(r, 2, w, 0)
    x, y, z = plus(x, 1.0, six(w[3])), plus(y, 1.0, six(w[4])), plus(z, 1.0, six(w[5]))
    f, g, h = six(w[0]), six(w[1]), six(w[2])
    keep_six(w[0], plus(NONE, -1.0, x))
    keep_six(w[1], plus(NONE, -1.0, y))
    keep_six(w[2], plus(NONE, -1.0, z))
    keep_six(w[3], plus(NONE, -1.0, f))
    keep_six(w[4], plus(NONE, -1.0, g))
    keep_six(w[5], plus(NONE, -1.0, h))


@jitable
def pass_six_up(scene: Scene, k: int, wrench: F3, z: F3) -> None:
    """Do what `pass_up` does for six forces at once."""
    sweep, tree = scene.sweep, scene.tree
    S, W, L, b = sweep.S[k], sweep.W[k], sweep.L[k], tree.body[k]
    p, share, parent = wrench[b], z[b], tree.parent[k]
    if is_none(p):
        for q in range(tree.free[k]):
            keep_six(share[q], NONE)
        return
    for q in range(tree.free[k]):
        total = NONE
        for i in range(6):
            total = plus(total, -S[q, i], six(p[i]))
        for j in range(q):
            total = plus(total, -L[q, j], six(share[j]))
        keep_six(share[q], plus(NONE, 1.0 / L[q, q], total))
    if parent >= 0:
        above = wrench[tree.body[parent]]
        for i in range(6):
            up = plus(six(above[i]), 1.0, six(p[i]))
            for q in range(tree.free[k]):
                up = plus(up, W[q, i], six(share[q]))
            keep_six(above[i], up)


@jitable
def pass_six_down(scene: Scene, k: int, wrench: F3, z: F3) -> None:
    """Do what `pass_down` does for six forces at once, in the place of these."""
    sweep, tree = scene.sweep, scene.tree
    S, W, L, b, free = sweep.S[k], sweep.W[k], sweep.L[k], tree.body[k], tree.free[k]
    a, share, parent = wrench[b], z[b], tree.parent[k]
    for i in range(6):
        keep_six(a[i], six(wrench[tree.body[parent], i]) if parent >= 0 else NONE)
    for q in range(free):
        left = six(share[q])
        for i in range(6):
            left = plus(left, -W[q, i], six(a[i]))
        keep_six(share[q], left)
    for q in range(free - 1, -1, -1):
        left = six(share[q])
        for j in range(q + 1, free):
            left = plus(left, -L[j, q], six(share[j]))
        keep_six(share[q], plus(NONE, 1.0 / L[q, q], left))
    for i in range(6):
        moved = six(a[i])
        for q in range(free):
            moved = plus(moved, S[q, i], six(share[q]))
        keep_six(a[i], moved)


@jitable
def unload_six(scene: Scene, k: int, wrench: F3) -> None:
    """Replace six spatial velocities at tree index k by those of the body's cg, and of its spin."""
    D, r = wrench[scene.tree.body[k]], vector(scene.sweep.arm[k])
    # v = v_O + w x r
    x, y, z = cross_row(r, 0, D, 0), cross_row(r, 1, D, 0), cross_row(r, 2, D, 0)
    x, y, z = plus(six(D[3]), -1.0, x), plus(six(D[4]), -1.0, y), plus(six(D[5]), -1.0, z)
    keep_six(D[3], six(D[0]))
    keep_six(D[4], six(D[1]))
    keep_six(D[5], six(D[2]))
    keep_six(D[0], x)
    keep_six(D[1], y)
    keep_six(D[2], z)


@jitable
def answer_six(scene: Scene, roots: tuple[int, int, int, int], wrench: F3, z: F3) -> None:
    """Replace six impulses at once by the changes of velocities, in the trees with these roots.

    `wrench` (nb, 6, 6) has components by impulses, force first, then velocity first; `z` is as
    large and scratch. What is at other trees stays. No equations hold the bodies.
    """
    tree, n = scene.tree, len(scene.tree.body)
    for k in range(n):
        if tree.root[k] in roots:
            load_six(scene, k, wrench)
    for k in range(n - 1, -1, -1):
        if tree.root[k] in roots:
            pass_six_up(scene, k, wrench, z)
    for k in range(n):
        if tree.root[k] in roots:
            pass_six_down(scene, k, wrench, z)
    for k in range(n):
        if tree.root[k] in roots:
            unload_six(scene, k, wrench)


@jitable
def answer_impulses(scene: Scene, wrench: F1) -> None:
    """Replace impulses by the changes of velocities that tree and equations leave."""
    sweep, active, n = scene.sweep, scene.equations.active, active_count(scene)
    load_impulses(scene, wrench)
    respond(scene, 0, len(scene.tree.body), 0, sweep.answer)
    if n > 0:
        for r in range(n):
            sweep.rhs[r] = -along(scene, active[r], sweep.answer, -1)
        solve_equations(scene)
        load_impulses(scene, wrench)
        for r in range(n):
            add_wrench(scene, active[r], sweep.multiplier[r])
        respond(scene, 0, len(scene.tree.body), 0, sweep.answer)
    write_changes(scene, wrench)


@jitable
def make_ready(scene: Scene, t: float, y: F1) -> None:
    """Fill all that impulses at y need."""
    prepare_equations(scene, t, y)
    if active_count(scene) > 0:
        factor_equations(scene, t)
