"""Values, jets and gradients of the programs of expressions; `place_bodies` has been called.

In compiled code the interpreter stands behind a hook, so that what asks for a value does
not compile it anew; plain Python runs it directly.
"""

from __future__ import annotations

from typing import Any

from mbsim.arrays.codes import JET_CURVATURE, JET_SLOPE, JET_VALUE, USED_ROWS
from mbsim.arrays.hooks import Hook, note_failure
from mbsim.arrays.scene import Scene
from mbsim.core.address import call_float, call_int
from mbsim.core.arrays import F1, V3
from mbsim.core.jitable import compiled_form, jitable
from mbsim.dynamics.expressions.interpreter import interpret
from mbsim.dynamics.expressions.measures import AS_THEY_ARE
from mbsim.dynamics.expressions.values import evaluate_program


def run(scene: Scene, t: float, y: F1, program: int, body: int, direction: int) -> int:
    """Leave the jet of a program in the first row of the stack."""
    return interpret(scene, t, y, program, body, direction)


@compiled_form(run)
def _run(scene: Any, t: Any, y: Any, program: Any, body: Any, direction: Any) -> Any:
    """Give compiled code its form of `run`: a call of the hook."""

    def compiled(scene: Any, t: Any, y: Any, program: Any, body: Any, direction: Any) -> Any:
        code = call_int(scene.world.hooks[Hook.JET], (scene, t, y, program, body, direction))
        note_failure(scene, code)
        return code

    return compiled


def value(scene: Scene, t: float, y: F1, program: int) -> float:
    """Return the value of a program at time t and state y."""
    return evaluate_program(scene, t, y, program)


@compiled_form(value)
def _value(scene: Any, t: Any, y: Any, program: Any) -> Any:
    """Give compiled code its form of `value`: a call of the hook."""

    def compiled(scene: Any, t: Any, y: Any, program: Any) -> Any:
        return call_float(scene.world.hooks[Hook.VALUE], (scene, t, y, program))

    return compiled


@jitable
def jet(scene: Scene, t: float, y: F1, program: int) -> V3:
    """Return value, rate and second rate of a program of displacements and TIME.

    In the second rate the bodies' own accelerations (of cg and angular velocity) are zero: what
    they add is the gradient times them.
    """
    run(scene, t, y, program, AS_THEY_ARE, 0)
    stack = scene.programs.stack
    return stack[0, JET_VALUE], stack[0, JET_SLOPE], stack[0, JET_CURVATURE]


@jitable
def gradient(scene: Scene, t: float, y: F1, program: int, body: int, out: F1) -> None:
    """Write how the rate follows from the velocity of a body's cg and its angular velocity.

    `out` (6,): d rate / d (v, w), both in global axes.
    """
    for direction in range(6):
        run(scene, t, y, program, body, direction)
        out[direction] = scene.programs.stack[0, JET_SLOPE]


@jitable
def fill_values(scene: Scene, t: float, y: F1) -> int:
    """Write the expressions of requests, which are the last programs, to the row; return 0."""
    row = scene.rows.value[scene.rows.used[USED_ROWS]]
    first = len(scene.programs.start) - 1 - len(row)
    for k in range(len(row)):
        row[k] = value(scene, t, y, first + k)
    return 0
