"""The hook of joints; where the tree holds all of them there are no equations to compile."""

from __future__ import annotations

import math

from mbsim.arrays.hooks import Joints
from mbsim.arrays.scene import Scene
from mbsim.core.address import vector_at, view
from mbsim.core.arrays import F1, Pointer
from mbsim.core.codes import Code
from mbsim.core.jitable import jitable
from mbsim.dynamics.bodies.kinematics import place_bodies
from mbsim.dynamics.constraints.tree import load, prepare, respond, write_accelerations
from mbsim.dynamics.constraints.tree_projection import carry_all, project_tree
from mbsim.dynamics.constraints.tree_reactions import add_tree_reactions
from mbsim.dynamics.pipeline.constraint_hooks import serve


@jitable
def serve_tree_joints(scene: Scene, what: int, t: float, y: F1, dy: F1) -> int:
    """Do what `constraints.serve` does, for a scene without equations."""
    if what == Joints.ACCELERATE:
        prepare(scene, y)
        load(scene)
        respond(scene, 0, len(scene.tree.body), 1, scene.sweep.a)
        return 0 if math.isfinite(write_accelerations(scene, dy)) else Code.NOT_FINITE
    if what == Joints.REACT:
        reaction = scene.work.reaction
        for i in range(len(reaction)):
            reaction[i] = 0.0
        add_tree_reactions(scene, y, scene.sweep.a, reaction)
    elif what == Joints.MATRIX:
        place_bodies(scene, y)
        prepare(scene, y)
    elif what == Joints.PROJECT or what == Joints.ALONG:
        place_bodies(scene, y)
        project_tree(scene, y)
        carry_all(scene, y)
    return 0


def serve_joints(context: int, what: int, t: float, y: Pointer, dy: Pointer) -> int:
    """All that joints are asked for."""
    scene = view(context, Scene)
    n = scene.rows.y.shape[1]
    return serve(scene, what, t, vector_at(y, n), vector_at(dy, n))


def serve_tree(context: int, what: int, t: float, y: Pointer, dy: Pointer) -> int:
    """The same where the tree holds all joints."""
    scene = view(context, Scene)
    n = scene.rows.y.shape[1]
    return serve_tree_joints(scene, what, t, vector_at(y, n), vector_at(dy, n))
