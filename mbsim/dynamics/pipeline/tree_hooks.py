"""What joints are asked for where the tree holds all of them: no equations to compile."""

from __future__ import annotations

import math

from mbsim.arrays.hooks import Joints
from mbsim.core.codes import Code
from mbsim.core.jitable import jitable
from mbsim.dynamics.bodies.kinematics import place_bodies
from mbsim.dynamics.constraints.tree import load, prepare, respond, write_accelerations
from mbsim.dynamics.constraints.tree_projection import carry_all, project_tree
from mbsim.dynamics.constraints.tree_reactions import add_tree_reactions


@jitable
def serve_tree_joints(scene, what, t, y, dy):
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
