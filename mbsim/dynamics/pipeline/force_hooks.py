"""Doors of applied forces, expressions and followed angles, opened where a scene has them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import types

from mbsim.arrays.scene import (
    ANGLES_DOOR,
    APPLIED_DOOR,
    DRY_DOOR,
    DRY_SLIDE,
    DRY_TURN,
    EXPRESSION_DOOR,
    FOLD_HALT,
    FRICTION_DOOR,
    MARKER_FORCE,
    RESIDUAL,
    RIGID_DOOR,
    VALUE_DOOR,
    VALUES_DOOR,
    VECTOR_FORCE,
    WRENCH_DOOR,
    Scene,
)
from mbsim.core import jit
from mbsim.core.address import vector_at, view
from mbsim.core.jitable import jitable
from mbsim.dynamics.bodies.angles import commit_angles, longest_turn
from mbsim.dynamics.events.step_limits import longest_step
from mbsim.dynamics.expressions.interpreter import interpret
from mbsim.dynamics.expressions.jets import fill_values
from mbsim.dynamics.expressions.states import add_slopes
from mbsim.dynamics.expressions.subroutines import failure_or
from mbsim.dynamics.expressions.values import evaluate_program
from mbsim.dynamics.forces.applied import add_applied
from mbsim.dynamics.forces.dry_friction import serve_dry
from mbsim.dynamics.forces.gravity import add_weight
from mbsim.dynamics.forces.joint_friction import add_friction
from mbsim.dynamics.forces.reaction_forces import add_late
from mbsim.dynamics.forces.wrenches import add_marker_force, add_vector_force, add_wrench
from mbsim.dynamics.stiction.rigid_contact import serve_held
from mbsim.dynamics.stiction.rigid_friction import serve_rigid

_POINTER = types.CPointer(types.float64)
_APPLY = types.int64(types.int64, types.float64, _POINTER, _POINTER)
_WRENCH = types.int64(types.int64, types.float64, _POINTER, types.int64)
_EXPRESS = types.int64(types.int64, types.float64, _POINTER, types.int64, types.int64, types.int64)
_VALUE = types.float64(types.int64, types.float64, _POINTER, types.int64)
_VALUES = types.int64(types.int64, types.float64, _POINTER)
_KEEP = types.int64(types.int64, types.int64, types.float64, _POINTER)
_ANGLES = types.int64(types.int64)


@jitable
def drive(scene, t, y, dy):
    """Add gravity over time and fill the slopes of states; return 0 or a code."""
    add_weight(scene, t, y, dy)
    return failure_or(scene, add_slopes(scene, t, y, dy))


def _drive(context, t, y, dy):
    """What acts where there are no forces between markers."""
    scene = view(context, Scene)
    n = scene.rows.y.shape[1]
    scene.users.failed[0] = 0
    return drive(scene, t, vector_at(y, n), vector_at(dy, n))


def _act(context, t, y, dy):
    """The forces between markers, and the same."""
    scene = view(context, Scene)
    n = scene.rows.y.shape[1]
    a, b = vector_at(y, n), vector_at(dy, n)
    scene.users.failed[0] = 0
    code = failure_or(scene, add_applied(scene, t, a, b))
    return code if code != 0 else drive(scene, t, a, b)


def _marker_force(context, t, y, f):
    """A marker force."""
    scene = view(context, Scene)
    return add_marker_force(scene, vector_at(y, scene.rows.y.shape[1]), f)


def _vector_force(context, t, y, f):
    """A vector force."""
    scene = view(context, Scene)
    return add_vector_force(scene, t, vector_at(y, scene.rows.y.shape[1]), f)


def _wrench(context, t, y, f):
    """One or the other, where a scene has both."""
    scene = view(context, Scene)
    return add_wrench(scene, t, vector_at(y, scene.rows.y.shape[1]), f)


def _rub(context, t, y, dy):
    """Friction in joints, and the accelerations with it."""
    scene = view(context, Scene)
    n = scene.rows.y.shape[1]
    return add_friction(scene, t, vector_at(y, n), vector_at(dy, n))


def _settle(context, t, y, dy):
    """Forces that need reactions, with friction in joints, and the accelerations with them."""
    scene = view(context, Scene)
    n = scene.rows.y.shape[1]
    return add_late(scene, t, vector_at(y, n), vector_at(dy, n))


def _express(context, t, y, program, body, way):
    """The jet of an expression."""
    scene = view(context, Scene)
    return interpret(scene, t, vector_at(y, scene.rows.y.shape[1]), program, body, way)


def _evaluate(context, t, y, program):
    """The value of an expression."""
    scene = view(context, Scene)
    return evaluate_program(scene, t, vector_at(y, scene.rows.y.shape[1]), program)


def _evaluate_requests(context, t, y):
    """The expressions of requests at an output row."""
    scene = view(context, Scene)
    scene.users.failed[0] = 0
    return failure_or(scene, fill_values(scene, t, vector_at(y, scene.rows.y.shape[1])))


def _commit_angles(context):
    """The angles of the committed state."""
    return commit_angles(view(context, Scene))


def _serve_dry(context, what, t, y):
    """What dry friction keeps of an accepted step, and what it holds."""
    scene = view(context, Scene)
    return serve_dry(scene, what, t, vector_at(y, scene.rows.y.shape[1]))


def _serve_rigid(context, what, t, y):
    """The same where some is rigid."""
    scene = view(context, Scene)
    return serve_rigid(scene, what, t, vector_at(y, scene.rows.y.shape[1]))


def _serve_held(context, what, t, y):
    """What contacts do whose friction is rigid."""
    scene = view(context, Scene)
    return serve_held(scene, what, t, vector_at(y, scene.rows.y.shape[1]))


def open_held(scene: Scene) -> None:
    """Open the doors of contacts whose friction is rigid."""
    doors = scene.world.doors
    doors[RIGID_DOOR] = jit.address(_serve_held, _KEEP)
    if len(scene.residuals.id) == 0:
        # elements of users have opened it for both
        doors[DRY_DOOR] = jit.address(_serve_rigid, _KEEP)


def limit_turn(context, t, h, a, b):
    """The step that lets nothing pass through anything and no angle lose count of its turns."""
    scene = view(context, Scene)
    n = scene.rows.y.shape[1]
    longest = longest_turn(scene, longest_step(scene, vector_at(a, n), vector_at(b, n), h))
    halt = scene.sweep.quality[FOLD_HALT]
    return min(longest, halt - t) if halt > t else longest


def open_jets(scene: Scene) -> None:
    """Open the door of derivatives, which equations need and forces do not."""
    scene.world.doors[EXPRESSION_DOOR] = jit.address(_express, _EXPRESS)


def _wrenches(kind: np.ndarray[Any, Any]) -> Any:
    """Return what adds the wrenches that there are, so that no other is compiled."""
    vectors = np.isin(kind, (VECTOR_FORCE, RESIDUAL)).any()
    if (kind == MARKER_FORCE).any():
        return _wrench if vectors else _marker_force
    return _vector_force


def open_expressions(scene: Scene) -> None:
    """Open the doors that the scene needs."""
    doors = scene.world.doors
    if len(scene.programs.start) > 1:
        doors[VALUE_DOOR] = jit.address(_evaluate, _VALUE)
    if (scene.equations.program >= 0).any():
        open_jets(scene)
    if len(scene.applied.kind) > 0:
        doors[APPLIED_DOOR] = jit.address(_act, _APPLY)
    elif len(scene.states.program) > 0 or (scene.world.weight >= 0).any():
        doors[APPLIED_DOOR] = jit.address(_drive, _APPLY)
    kind = scene.applied.kind
    if np.isin(kind, (VECTOR_FORCE, MARKER_FORCE, RESIDUAL)).any():
        doors[WRENCH_DOOR] = jit.address(_wrenches(kind), _WRENCH)
    if np.isin(kind, (DRY_SLIDE, DRY_TURN)).any():
        rigid = bool((scene.applied.equation >= 0).any())
        doors[DRY_DOOR] = jit.address(_serve_rigid if rigid else _serve_dry, _KEEP)
    if len(scene.residuals.id) > 0:
        from mbsim.dynamics.pipeline.element_hooks import open_residuals

        open_residuals(scene)
    if len(scene.applied.late) > 0:
        # only then: it is compiled with all that it needs
        doors[FRICTION_DOOR] = jit.address(_settle, _APPLY)
    elif (scene.applied.connection >= 0).any():
        doors[FRICTION_DOOR] = jit.address(_rub, _APPLY)
    if scene.rows.value.shape[1] > 0:
        doors[VALUES_DOOR] = jit.address(_evaluate_requests, _VALUES)
    if len(scene.angles.i) > 0:
        doors[ANGLES_DOOR] = jit.address(_commit_angles, _ANGLES)
