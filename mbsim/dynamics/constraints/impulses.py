"""What impulses do to bodies that joints, equations and motions hold.

As `equations` has it for accelerations: the tree answers the impulses, and multipliers of the
equations take away what that would change of them, G dV = 0. All is as `hold` left it at y.
"""

from __future__ import annotations

from mbsim.arrays.scene import Scene
from mbsim.core.arrays import F1
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
