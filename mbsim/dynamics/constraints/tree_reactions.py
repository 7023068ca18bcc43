"""Reactions of the joints of the tree."""

from __future__ import annotations

from mbsim.arrays.scene import Scene
from mbsim.core.arrays import F1, F2
from mbsim.core.jitable import jitable
from mbsim.core.rotation import cross, scale, sub
from mbsim.dynamics.bodies.markers import marker_point
from mbsim.dynamics.constraints.tree import origin


@jitable
def add_reaction(
    scene: Scene, y: F1, c: int, index: int, wrench: F1, factor: float, out: F1
) -> None:
    """Add `factor` times a wrench about O of that tree to the reaction of connection c."""
    at = sub(marker_point(scene, y, scene.connections.i[c]), origin(scene, y, index))
    force = scale(factor, (wrench[3], wrench[4], wrench[5]))
    moment = cross(at, force)
    for i in range(3):
        out[6 * c + i] += force[i]
        out[6 * c + 3 + i] += factor * wrench[i] - moment[i]


@jitable
def add_tree_reaction(scene: Scene, y: F1, c: int, motion: F2, out: F1) -> None:
    """Add what the joint of the tree carries: H A + p of all that hangs on it."""
    sweep, k = scene.sweep, scene.connections.tree[c]
    for i in range(6):
        total = sweep.p[k, i]
        for j in range(6):
            total += sweep.H[k, i, j] * motion[k, j]
        sweep.z[k, i] = total
    # on the child; marker I may be on the parent
    factor = -1.0 if scene.connections.flip[c] == 1 else 1.0
    add_reaction(scene, y, c, k, sweep.z[k], factor, out)


@jitable
def add_tree_reactions(scene: Scene, y: F1, motion: F2, out: F1) -> None:
    """Add the reactions of all joints of the tree, for forces p and accelerations."""
    for c in range(len(scene.connections.i)):
        if scene.connections.tree[c] >= 0:
            add_tree_reaction(scene, y, c, motion, out)
