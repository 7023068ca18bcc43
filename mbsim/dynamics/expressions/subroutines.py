"""Results of user subroutines as numbers in expressions.

A subroutine stands behind (scene, t, y, results) -> code, 0 being good. What it
asks of the trial state comes back through the hook of expressions, see
`compile_model.subroutines`.
"""

from __future__ import annotations

import math

from mbsim.arrays.codes import JET_CURVATURE, JET_SLOPE, PYTHON_CALLS
from mbsim.arrays.hooks import Hook, note_failure
from mbsim.arrays.scene import Scene
from mbsim.core.address import call_int
from mbsim.core.arrays import F1, V3
from mbsim.core.jitable import jitable
from mbsim.dynamics.expressions.measures import AS_THEY_ARE


@jitable
def user_result(scene: Scene, t: float, y: F1, row: int, component: int, calls: int) -> float:
    """Return result `component` of subroutine `row`: 0 calls it, and what `calls`, or reads."""
    users = scene.users
    if component == 0 or calls == 1:
        element = users.element[row]
        if element >= 0:
            hook = scene.world.hooks[Hook.ELEMENT]
            code = call_int(hook, (scene, t, y, element, component))
        else:
            scene.log.counters[PYTHON_CALLS] += 1
            code = call_int(users.address[row], (scene, t, y, users.result[row]))
        if code != 0:
            note_failure(scene, code)
            for k in range(users.result.shape[1]):
                users.result[row, k] = math.nan
    return users.result[row, component]


@jitable
def user_jet(scene: Scene, t: float, y: F1, row: int, body: int) -> V3:
    """Return value, rate and second rate that the subroutine of a motion gives."""
    value = user_result(scene, t, y, row, 0, 1)
    if body != AS_THEY_ARE:
        return value, 0.0, 0.0
    result = scene.users.result[row]
    return value, result[JET_SLOPE], result[JET_CURVATURE]
