"""The door of joints, opened where a scene has some."""

from __future__ import annotations

from numba import types

from mbsim.arrays.scene import JOINTS_DOOR, Scene
from mbsim.core import jit
from mbsim.core.address import vector_at, view
from mbsim.dynamics.pipeline.constraint_hooks import serve
from mbsim.dynamics.pipeline.tree_hooks import serve_limbs

_POINTER = types.CPointer(types.float64)
_JOINTS = types.int64(types.int64, types.int64, types.float64, _POINTER, _POINTER)


def _joints(context, what, t, y, dy):
    """All that joints are asked for."""
    scene = view(context, Scene)
    n = scene.rows.y.shape[1]
    return serve(scene, what, t, vector_at(y, n), vector_at(dy, n))


def _limbs(context, what, t, y, dy):
    """The same where the tree holds all joints."""
    scene = view(context, Scene)
    n = scene.rows.y.shape[1]
    return serve_limbs(scene, what, t, vector_at(y, n), vector_at(dy, n))


def open_joints(scene: Scene) -> None:
    """Put what joints are asked for behind their door; a tree alone compiles no equations."""
    settles = bool(scene.applied.with_reactions.any())
    served = _joints if len(scene.equations.program) > 0 or settles else _limbs
    scene.world.doors[JOINTS_DOOR] = jit.address(served, _JOINTS)
