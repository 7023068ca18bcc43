"""The derivative of a step of an explicit method: of what it computes, with its step held.

That is the same method's step for the variational equations D' = f_y D + f_p.
Source: H. G. Bock, in Modelling of Chemical Reaction Systems, Springer (1981) 102 (internal
numerical differentiation).
"""

from __future__ import annotations

from mbsim.arrays.scene import Scene
from mbsim.core.address import call_int, view
from mbsim.core.jitable import jitable
from mbsim.integrators.dop853 import combined_error
from mbsim.integrators.scheme import SHOWN, Method, in_workspace
from mbsim.sensitivity.arrays import (
    ATTEMPT,
    DOWN,
    FIT_DENSE,
    REMEMBERED,
    TWIN,
    UP,
    Variations,
)
from mbsim.sensitivity.twin import (
    beside,
    half_step,
    keep_change,
    keep_depths,
    keep_side,
    set_parameter,
)

#: What an estimate of an order that is far lower than the method's counts for.
LOW_ORDER = 0.01


@jitable
def step_beside(
    V: Variations, scene: Scene, m: Method, t: float, h: float, k: int, e: float, side: int
) -> int:
    """Take the run's step from the point moved by e along derivative k; return a code."""
    twin, workspace = view(V.words[TWIN], Scene), V.words[UP + side]
    p, own = in_workspace(workspace)
    set_parameter(V, twin, scene, k, e)
    beside(V, m.y, k, e, own.y)
    own.memory[SHOWN] = 0.0
    code = 0
    if V.smooth[k] == 1:
        # the last stage of the step before is at its end
        for i in range(len(m.y)):
            own.k[0, i] = m.k[0, i] + e * V.slope[k, i]
    else:
        code = call_int(p.rhs, (p.context, t, 0.0, own.y, own.k[0]))
    if code == 0:
        code = call_int(V.words[ATTEMPT], (workspace, t, h, own.y, own.trial))
    keep_depths(V, twin, side)
    if code == 0 and V.words[REMEMBERED] > 0:
        keep_side(V, twin, scene, side)
    return code


@jitable
def error_of(V: Variations, up: Method, down: Method, part: float) -> float:
    """Return the method's own estimate of the error of what lies between both sides, times part.

    Two estimates are joined as DOP853 does: the larger one overrates the error by orders. It still
    counts a little, where forces bend.
    """
    first = second = 0.0
    rows, stages = V.estimates.shape
    for i in range(len(V.scale)):
        off = other = 0.0
        for j in range(stages):
            change = up.k[j, i] - down.k[j, i]
            off += V.estimates[0, j] * change
            other += V.estimates[rows - 1, j] * change
        first = max(first, part * abs(off) / V.scale[i])
        second = max(second, part * abs(other) / V.scale[i])
    if rows == 1:
        return first
    return max(combined_error(first, second), LOW_ORDER * first)


@jitable
def explicit_step(V: Variations, scene: Scene, m: Method, t: float, h: float, k: int) -> int:
    """Fill derivative k at the end of the step that is taken, and its error; return a code."""
    e = half_step(V, k)
    for side in range(2):
        code = step_beside(V, scene, m, t, h, k, e if side == 0 else -e, side)
        if code != 0:
            return code
    up, down = in_workspace(V.words[UP])[1], in_workspace(V.words[DOWN])[1]
    part, whole, last = 0.5 / e, 1.0 / V.size[k], V.estimates.shape[1] - 1
    for i in range(len(m.y)):
        V.slope[k, i] = part * (up.k[last, i] - down.k[last, i])
        if len(V.weights) > 0:
            # what is rounded is the change alone
            rise = 0.0
            for j in range(len(V.weights)):
                rise += V.weights[j] * (up.k[j, i] - down.k[j, i])
            V.next[k, i] = V.d[k, i] + h * part * rise
        else:
            V.next[k, i] = part * (up.trial[i] - down.trial[i])
        whole = max(whole, abs(V.next[k, i]) / V.scale[i], abs(V.d[k, i]) / V.scale[i])
    V.error[k] = error_of(V, up, down, abs(h) * part / whole)
    if V.words[REMEMBERED] > 0:
        # what friction keeps is another number behind the step
        keep_change(V, k, e)
    else:
        V.smooth[k] = 1
    return 0


@jitable
def fit_beside(V: Variations, scene: Scene, m: Method, t: float, h: float, k: int, e: float) -> int:
    """Fill the polynomials of the run's step, and of its derivative k; return a code.

    `e` is by how much the parameter was changed in the step on either side, which was just taken.
    """
    twin = view(V.words[TWIN], Scene)
    for side in range(2):
        set_parameter(V, twin, scene, k, e if side == 0 else -e)
        own = in_workspace(V.words[UP + side])[1]
        code = call_int(V.words[FIT_DENSE], (V.words[UP + side], t, h, own.y, own.trial))
        if code != 0:
            return code
    up, down = in_workspace(V.words[UP])[1], in_workspace(V.words[DOWN])[1]
    for j in range(V.dense.shape[1]):
        for i in range(len(m.y)):
            V.dense[k, j, i] = 0.5 / e * (up.dense[j, i] - down.dense[j, i])
            V.path[j, i] = 0.5 * (up.dense[j, i] + down.dense[j, i])
    return 0
