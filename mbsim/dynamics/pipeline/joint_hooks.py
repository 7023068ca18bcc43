"""The hook of joints."""

from __future__ import annotations

from mbsim.arrays.scene import Scene
from mbsim.core.address import vector_at, view
from mbsim.dynamics.pipeline.constraint_hooks import serve
from mbsim.dynamics.pipeline.tree_hooks import serve_tree_joints


def serve_joints(context, what, t, y, dy):
    """All that joints are asked for."""
    scene = view(context, Scene)
    n = scene.rows.y.shape[1]
    return serve(scene, what, t, vector_at(y, n), vector_at(dy, n))


def serve_tree(context, what, t, y, dy):
    """The same where the tree holds all joints."""
    scene = view(context, Scene)
    n = scene.rows.y.shape[1]
    return serve_tree_joints(scene, what, t, vector_at(y, n), vector_at(dy, n))
