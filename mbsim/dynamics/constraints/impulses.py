"""What impulses do to bodies that joints, equations and motions hold.

As `equations` has it for accelerations: the tree answers the impulses, and multipliers of the
equations take away what that would change of them, G dV = 0. All is as `hold` left it at y.
"""

from __future__ import annotations

from mbsim.arrays.scene import Scene
from mbsim.core.arrays import F1, F3
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
from mbsim.dynamics.constraints.tree import respond


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
def load_six(scene: Scene, k: int, wrench: F3) -> None:
    """Replace six impulses on the body at tree index k, about its cg, by forces p about O."""
    w, r = wrench[scene.tree.body[k]], vector(scene.sweep.arm[k])
    for e in range(6):
        x, y, z = w[0, e], w[1, e], w[2, e]
        w[0, e], w[1, e], w[2, e] = (
            -(w[3, e] + r[1] * z - r[2] * y),
            -(w[4, e] + r[2] * x - r[0] * z),
            -(w[5, e] + r[0] * y - r[1] * x),
        )
        w[3, e], w[4, e], w[5, e] = -x, -y, -z


@jitable
def pass_six_up(scene: Scene, k: int, wrench: F3, z: F3) -> None:
    """Do what `pass_up` does for six forces at once."""
    sweep, tree = scene.sweep, scene.tree
    S, W, L, b = sweep.S[k], sweep.W[k], sweep.L[k], tree.body[k]
    p, share, parent = wrench[b], z[b], tree.parent[k]
    for q in range(tree.free[k]):
        for e in range(6):
            total = 0.0
            for i in range(6):
                total -= S[q, i] * p[i, e]
            share[q, e] = total
        for j in range(q):
            for e in range(6):
                share[q, e] -= L[q, j] * share[j, e]
        for e in range(6):
            share[q, e] /= L[q, q]
    if parent < 0:
        return
    above = wrench[tree.body[parent]]
    for i in range(6):
        for e in range(6):
            above[i, e] += p[i, e]
        for q in range(tree.free[k]):
            for e in range(6):
                above[i, e] += W[q, i] * share[q, e]


@jitable
def pass_six_down(scene: Scene, k: int, wrench: F3, z: F3) -> None:
    """Do what `pass_down` does for six forces at once, in the place of these."""
    sweep, tree = scene.sweep, scene.tree
    S, W, L, b, free = sweep.S[k], sweep.W[k], sweep.L[k], tree.body[k], tree.free[k]
    a, share, parent = wrench[b], z[b], tree.parent[k]
    for i in range(6):
        for e in range(6):
            a[i, e] = wrench[tree.body[parent], i, e] if parent >= 0 else 0.0
    for q in range(free):
        for i in range(6):
            for e in range(6):
                share[q, e] -= W[q, i] * a[i, e]
    for q in range(free - 1, -1, -1):
        for j in range(q + 1, free):
            for e in range(6):
                share[q, e] -= L[j, q] * share[j, e]
        for e in range(6):
            share[q, e] /= L[q, q]
    for q in range(free):
        for i in range(6):
            for e in range(6):
                a[i, e] += S[q, i] * share[q, e]


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
            D, r = wrench[tree.body[k]], vector(scene.sweep.arm[k])
            for e in range(6):
                x, y, w = D[0, e], D[1, e], D[2, e]
                D[0, e] = D[3, e] + y * r[2] - w * r[1]
                D[1, e] = D[4, e] + w * r[0] - x * r[2]
                D[2, e] = D[5, e] + x * r[1] - y * r[0]
                D[3, e], D[4, e], D[5, e] = x, y, w


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
