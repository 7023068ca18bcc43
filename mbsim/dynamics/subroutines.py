"""Results of user subroutines as numbers in expressions.

A subroutine stands behind (scene, t, y, results) -> code, 0 being good. What it
asks of the trial state comes back through the door of expressions, see
`system.subroutines`.
"""

from __future__ import annotations

import math

from mbsim.core.address import call_int
from mbsim.core.jitable import jitable
from mbsim.system.arrays import PYTHON_CALLS


@jitable
def user_result(scene, t, y, row, component):
    """Return result `component` of subroutine `row`: 0 calls it, the others are of that call."""
    users = scene.users
    if component == 0:
        scene.log.counters[PYTHON_CALLS] += 1
        code = call_int(users.address[row], (scene, t, y, users.result[row]))
        if code != 0:
            if users.failed[0] == 0:
                users.failed[0] = code
            for k in range(users.result.shape[1]):
                users.result[row, k] = math.nan
    return users.result[row, component]


@jitable
def failure_or(scene, code):
    """Return the code of a subroutine that failed, else `code`."""
    return scene.users.failed[0] if scene.users.failed[0] != 0 else code
