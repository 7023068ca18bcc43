"""What impulses do to bodies that joints, equations and motions hold.

As `equations` has it for accelerations: the tree answers the impulses, and multipliers of the
equations take away what that would change of them, G dV = 0. All is as `hold` left it at y.

Where a tree is all that holds bodies it answers many impulses at once, side by side as columns: a
joint is read once for all of them. Loops over columns go by `len`, for a number of rounds that the
compiler knows is unrolled, and no vector instructions are found for that.
"""

from __future__ import annotations

from mbsim.arrays.scene import Scene
from mbsim.core.arrays import F1, F2, F3, I1, V3, V6
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
def add_impulse(scene: Scene, k: int, p: F2, column: int, push: V3, turn: V3) -> None:
    """Add an impulse on the body at tree index k, about its cg, to a column of its forces p."""
    turn = add(turn, cross(vector(scene.sweep.arm[k]), push))
    for c in range(3):
        p[c, column] -= turn[c]
        p[3 + c, column] -= push[c]


@jitable
def take_along(left: F1, s: V6, x: F2) -> None:
    """Take from numbers the products of a spatial vector with columns of x."""
    for e in range(len(left)):
        first = s[0] * x[0, e] + s[2] * x[2, e] + s[4] * x[4, e]
        second = s[1] * x[1, e] + s[3] * x[3, e] + s[5] * x[5, e]
        left[e] -= first + second


@jitable
def add_along(x: F2, s: V6, part: F1) -> None:
    """Add so many times a spatial vector to columns of x."""
    for e in range(len(part)):
        x[0, e] += s[0] * part[e]
        x[1, e] += s[1] * part[e]
        x[2, e] += s[2] * part[e]
        x[3, e] += s[3] * part[e]
        x[4, e] += s[4] * part[e]
        x[5, e] += s[5] * part[e]


@jitable
def fill_columns(x: F2, others: F2) -> None:
    """Let columns be others."""
    for i in range(6):
        row, other = x[i], others[i]
        for e in range(len(row)):
            row[e] = other[e]


@jitable
def add_columns(x: F2, others: F2) -> None:
    """Add others to columns."""
    for i in range(6):
        row, other = x[i], others[i]
        for e in range(len(row)):
            row[e] += other[e]


@jitable
def clear(row: F1) -> None:
    """Let numbers be 0."""
    for e in range(len(row)):
        row[e] = 0.0


@jitable
def take_scaled(left: F1, factor: float, other: F1) -> None:
    """Take so many times other numbers from numbers."""
    for e in range(len(left)):
        left[e] -= factor * other[e]


@jitable
def multiply(row: F1, by: float) -> None:
    """Multiply numbers."""
    for e in range(len(row)):
        row[e] *= by


@jitable
def scaled(factor: float, row: F1) -> V6:
    """Return so many times a spatial vector."""
    return plus((0.0, 0.0, 0.0, 0.0, 0.0, 0.0), factor, six(row))


@jitable
def pass_columns_up(scene: Scene, k: int, forces: F3, shares: F3, loaded: I1) -> None:
    """Do what `pass_up` does, for all columns of forces."""
    sweep, tree = scene.sweep, scene.tree
    S, W, L, parent = sweep.S[k], sweep.W[k], sweep.L[k], tree.parent[k]
    p, share = forces[k], shares[k]
    for q in range(tree.free[k]):
        z = share[q]
        clear(z)
        take_along(z, six(S[q]), p)
        for j in range(q):
            take_scaled(z, L[q, j], share[j])
    if parent < 0:
        return
    above = forces[parent]
    if loaded[parent] == 0:
        loaded[parent] = 1
        fill_columns(above, p)
    else:
        add_columns(above, p)
    for q in range(tree.free[k]):
        add_along(above, scaled(L[q, q], W[q]), share[q])


@jitable
def pass_columns_down(scene: Scene, k: int, forces: F3, shares: F3, loaded: I1) -> None:
    """Do what `pass_down` does, for all columns, in the place of the forces."""
    sweep, tree = scene.sweep, scene.tree
    S, W, L, parent, free = sweep.S[k], sweep.W[k], sweep.L[k], tree.parent[k], tree.free[k]
    a, share = forces[k], shares[k]
    for q in range(free):
        if loaded[k] == 0:
            clear(share[q])
        if parent >= 0:
            take_along(share[q], six(W[q]), forces[parent])
    loaded[k] = 0
    for q in range(free - 1, -1, -1):
        multiply(share[q], L[q, q])
        for j in range(q + 1, free):
            take_scaled(share[q], L[j, q], share[j])
    if parent >= 0:
        fill_columns(a, forces[parent])
    else:
        clear_columns(a)
    for q in range(free):
        add_along(a, six(S[q]), share[q])


@jitable
def answer_columns(scene: Scene, root: int, forces: F3, shares: F3, loaded: I1) -> None:
    """Replace columns of forces p by the changes of spatial velocities, in the tree at `root`.

    `forces` (nt, 6, AT_ONCE) are those of `add_impulse` where `loaded` (nt,) is 1, which is 0 again
    behind this; `shares` is as large and scratch. No equations hold the bodies.
    """
    end = scene.tree.end[root]
    for k in range(end - 1, root - 1, -1):
        if loaded[k] == 1:
            pass_columns_up(scene, k, forces, shares, loaded)
    for k in range(root, end):
        pass_columns_down(scene, k, forces, shares, loaded)


@jitable
def clear_columns(p: F2) -> None:
    """Let a body have no forces."""
    for i in range(6):
        clear(p[i])


@jitable
def write_column(scene: Scene, k: int, found: F2, column: int, change: F1) -> None:
    """Write a column of `answer_columns` as the velocity of the body's cg, and its spin."""
    r, spin = vector(scene.sweep.arm[k]), (found[0, column], found[1, column], found[2, column])
    velocity = add((found[3, column], found[4, column], found[5, column]), cross(spin, r))
    for c in range(3):
        change[c], change[3 + c] = velocity[c], spin[c]


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
