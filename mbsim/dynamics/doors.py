"""Doors of applied forces, expressions and followed angles, opened where a scene has them."""

from __future__ import annotations

from numba import carray, types

from mbsim.core import jit
from mbsim.core.address import view
from mbsim.dynamics.angles import commit_angles, longest_turn
from mbsim.dynamics.applied import add_applied
from mbsim.dynamics.expressions import fill_values
from mbsim.dynamics.interpreter import interpret
from mbsim.dynamics.joint_friction import add_friction
from mbsim.dynamics.limits import longest_step
from mbsim.dynamics.weight import add_weight
from mbsim.dynamics.wrenches import add_wrench
from mbsim.system.arrays import (
    ANGLES_DOOR,
    APPLIED_DOOR,
    EXPRESSION_DOOR,
    FRICTION_DOOR,
    SLIDE_LIMIT,
    VALUES_DOOR,
    VECTOR_FORCE,
    WRENCH_DOOR,
    Scene,
)

_POINTER = types.CPointer(types.float64)
_APPLY = types.int64(types.int64, types.float64, _POINTER, _POINTER)
_WRENCH = types.int64(types.int64, types.float64, _POINTER, types.int64)
_EXPRESS = types.int64(types.int64, types.float64, _POINTER, types.int64, types.int64, types.int64)
_VALUES = types.int64(types.int64, types.float64, _POINTER)
_ANGLES = types.int64(types.int64)


def _apply(context, t, y, dy):
    """The forces of springs and expressions."""
    scene = view(context, Scene)
    n = scene.rows.y.shape[1]
    return add_applied(scene, t, carray(y, (n,)), carray(dy, (n,)))


def _weigh(context, t, y, dy):
    """The same, and gravity over time."""
    scene = view(context, Scene)
    n = scene.rows.y.shape[1]
    a, b = carray(y, (n,)), carray(dy, (n,))
    code = add_applied(scene, t, a, b)
    return code if code != 0 else add_weight(scene, t, a, b)


def _wrench(context, t, y, f):
    """A bushing or a vector force."""
    scene = view(context, Scene)
    return add_wrench(scene, t, carray(y, (scene.rows.y.shape[1],)), f)


def _rub(context, t, y, dy):
    """Friction in joints, and the accelerations with it."""
    scene = view(context, Scene)
    n = scene.rows.y.shape[1]
    return add_friction(scene, t, carray(y, (n,)), carray(dy, (n,)))


def _express(context, t, y, program, body, way):
    """The jet of an expression."""
    scene = view(context, Scene)
    return interpret(scene, t, carray(y, (scene.rows.y.shape[1],)), program, body, way)


def _evaluate_requests(context, t, y):
    """The expressions of requests at an output row."""
    scene = view(context, Scene)
    return fill_values(scene, t, carray(y, (scene.rows.y.shape[1],)))


def _commit_angles(context):
    """The angles of the committed state."""
    return commit_angles(view(context, Scene))


def limit_turn(context, t, h, a, b):
    """The step that lets nothing pass through anything and no angle lose count of its turns."""
    scene = view(context, Scene)
    n = scene.rows.y.shape[1]
    return longest_turn(scene, longest_step(scene, carray(a, (n,)), carray(b, (n,)), h))


def open_expressions(scene: Scene) -> None:
    """Open the doors that the scene needs."""
    doors = scene.world.doors
    if len(scene.programs.start) > 1:
        doors[EXPRESSION_DOOR] = jit.address(_express, _EXPRESS)
    if (scene.world.weight >= 0).any():
        doors[APPLIED_DOOR] = jit.address(_weigh, _APPLY)
    elif len(scene.applied.kind) > 0:
        doors[APPLIED_DOOR] = jit.address(_apply, _APPLY)
    kind = scene.applied.kind
    if ((kind >= VECTOR_FORCE) & (kind < SLIDE_LIMIT)).any():
        doors[WRENCH_DOOR] = jit.address(_wrench, _WRENCH)
    if (scene.applied.connection >= 0).any():
        doors[FRICTION_DOOR] = jit.address(_rub, _APPLY)
    if scene.rows.value.shape[1] > 0:
        doors[VALUES_DOOR] = jit.address(_evaluate_requests, _VALUES)
    if len(scene.angles.i) > 0:
        doors[ANGLES_DOOR] = jit.address(_commit_angles, _ANGLES)
