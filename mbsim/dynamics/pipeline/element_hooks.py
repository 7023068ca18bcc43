"""The doors of Force_Element, opened where a scene has one: nothing else is compiled with it."""

from __future__ import annotations

import numpy as np
from numba import types

from mbsim.arrays.scene import (
    DRY_DOOR,
    DRY_SLIDE,
    DRY_TURN,
    RESIDUAL_DOOR,
    TANGENT_DOOR,
    Scene,
)
from mbsim.compile_model.tangent import Tangent
from mbsim.core import jit
from mbsim.core.address import vector_at, view
from mbsim.dynamics.forces.dry_friction import serve_dry
from mbsim.dynamics.forces.force_element import keep_residuals, serve_residual
from mbsim.dynamics.linearization.connection_slopes import add_rubs_slopes
from mbsim.dynamics.linearization.element_slopes import add_all_residual_slopes
from mbsim.dynamics.linearization.marker_force_slopes import add_marker_forces_slopes
from mbsim.dynamics.linearization.stiffness import add_applied_slopes, fill_state_slopes
from mbsim.dynamics.stiction.rigid_friction import serve_rigid

_POINTER = types.CPointer(types.float64)
_RESIDUAL = types.int64(types.int64, types.float64, _POINTER, types.int64, types.int64)
_KEEP = types.int64(types.int64, types.int64, types.float64, _POINTER)


def _serve(context, t, y, element, component):
    """What an element gives."""
    scene = view(context, Scene)
    return serve_residual(scene, t, vector_at(y, scene.rows.y.shape[1]), element, component)


def _keep(context, what, t, y):
    """What elements keep of an accepted step."""
    scene = view(context, Scene)
    return keep_residuals(scene, what, t, vector_at(y, scene.rows.y.shape[1]))


def _keep_with_dry(context, what, t, y):
    """The same, and what dry friction keeps."""
    scene = view(context, Scene)
    a = vector_at(y, scene.rows.y.shape[1])
    keep_residuals(scene, what, t, a)
    return serve_dry(scene, what, t, a)


def _keep_with_rigid(context, what, t, y):
    """The same where some is rigid."""
    scene = view(context, Scene)
    a = vector_at(y, scene.rows.y.shape[1])
    keep_residuals(scene, what, t, a)
    return serve_rigid(scene, what, t, a)


def residual_slopes(context, t, y):
    """The derivatives of all forces between markers, elements among them, and of states' slopes."""
    scene = view(context, Scene)
    T = view(scene.world.doors[TANGENT_DOOR], Tangent)
    a = vector_at(y, scene.rows.y.shape[1])
    code = add_applied_slopes(scene, T, t, a)
    add_marker_forces_slopes(scene, T, a)
    add_rubs_slopes(scene, T, t, a)
    fill_state_slopes(scene, T, t, a)
    add_all_residual_slopes(scene, T, t, a)
    return code


def open_residuals(scene: Scene) -> None:
    """Open the doors."""
    doors = scene.world.doors
    doors[RESIDUAL_DOOR] = jit.address(_serve, _RESIDUAL)
    hook = _keep
    if (scene.applied.equation >= 0).any() or scene.contacts.rigid.any():
        hook = _keep_with_rigid
    elif np.isin(scene.applied.kind, (DRY_SLIDE, DRY_TURN)).any():
        hook = _keep_with_dry
    doors[DRY_DOOR] = jit.address(hook, _KEEP)
