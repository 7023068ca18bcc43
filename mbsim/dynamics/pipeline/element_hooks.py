"""The hooks of Force_Element: nothing else is compiled with it."""

from __future__ import annotations

from mbsim.arrays.hooks import Hook, note_failure
from mbsim.arrays.scene import Scene
from mbsim.compile_model.tangent import Tangent
from mbsim.core.address import vector_at, view
from mbsim.core.arrays import Pointer
from mbsim.dynamics.forces.applied import serve_kept
from mbsim.dynamics.forces.force_element import keep_residuals, serve_residual
from mbsim.dynamics.linearization.applied_slopes import add_applied_slopes
from mbsim.dynamics.linearization.connection_slopes import add_joint_frictions_slopes
from mbsim.dynamics.linearization.element_slopes import add_all_residual_slopes
from mbsim.dynamics.linearization.expression_slopes import fill_state_slopes
from mbsim.dynamics.linearization.marker_force_slopes import add_marker_forces_slopes
from mbsim.dynamics.stiction.rigid_friction import serve_rigid


def serve_element(context: int, t: float, y: Pointer, element: int, component: int) -> int:
    """What an element gives."""
    scene = view(context, Scene)
    return serve_residual(scene, t, vector_at(y, scene.rows.y.shape[1]), element, component)


def keep_elements(context: int, what: int, t: float, y: Pointer) -> int:
    """What elements keep of an accepted step."""
    scene = view(context, Scene)
    return keep_residuals(scene, what, t, vector_at(y, scene.rows.y.shape[1]))


def keep_with_dry(context: int, what: int, t: float, y: Pointer) -> int:
    """The same, and what dry friction keeps."""
    scene = view(context, Scene)
    a = vector_at(y, scene.rows.y.shape[1])
    note_failure(scene, keep_residuals(scene, what, t, a))
    return serve_kept(scene, what, t, a)


def keep_with_rigid(context: int, what: int, t: float, y: Pointer) -> int:
    """The same where some is rigid."""
    scene = view(context, Scene)
    a = vector_at(y, scene.rows.y.shape[1])
    note_failure(scene, keep_residuals(scene, what, t, a))
    return serve_rigid(scene, what, t, a)


def residual_slopes(context: int, t: float, y: Pointer) -> int:
    """The derivatives of all forces between markers, elements among them, and of states' slopes."""
    scene = view(context, Scene)
    T = view(scene.world.hooks[Hook.TANGENT], Tangent)
    a = vector_at(y, scene.rows.y.shape[1])
    code = add_applied_slopes(scene, T, t, a)
    add_marker_forces_slopes(scene, T, a)
    add_joint_frictions_slopes(scene, T, t, a)
    fill_state_slopes(scene, T, t, a)
    add_all_residual_slopes(scene, T, t, a)
    return code
