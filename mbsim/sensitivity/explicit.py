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
    CORNERS,
    DOWN,
    DOWN_SIDE,
    FIT_DENSE,
    OWN,
    REMEMBERED,
    TWIN,
    UP,
    UP_SIDE,
    Variations,
)
from mbsim.sensitivity.twin import (
    beside,
    half_step,
    is_deep,
    keep_change,
    keep_depths,
    keep_memory,
    keep_side,
    one_side,
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
    keep_depths(V, scene, OWN)
    if code == 0 and V.words[REMEMBERED] > 0:
        keep_side(V, twin, scene, side)
        keep_memory(V, scene, OWN)
    return code


@jitable
def error_of(V: Variations, up: Method, other: Method, part: float) -> float:
    """Return the method's own estimate of the error of what lies between both, times part.

    Two estimates are joined as DOP853 does: the larger one overrates the error by orders. It still
    counts a little, where forces bend.
    """
    first = second = 0.0
    rows, stages = V.estimates.shape
    for i in range(len(V.scale)):
        off = low = 0.0
        for j in range(stages):
            change = up.k[j, i] - other.k[j, i]
            off += V.estimates[0, j] * change
            low += V.estimates[rows - 1, j] * change
        first = max(first, part * abs(off) / V.felt[i])
        second = max(second, part * abs(low) / V.felt[i])
    if rows == 1:
        return first
    return max(combined_error(first, second), LOW_ORDER * first)


@jitable
def explicit_step(V: Variations, scene: Scene, m: Method, t: float, h: float, k: int) -> int:
    """Fill derivative k at the end of the step that is taken, and its error; return a code."""
    deep = is_deep(V, k)
    e = half_step(V, k) if deep else one_side(V, m, k)
    width = 2.0 * e if deep else e
    code = step_beside(V, scene, m, t, h, k, e, UP_SIDE)
    if deep and code == 0:
        code = step_beside(V, scene, m, t, h, k, -e, DOWN_SIDE)
    if code != 0:
        return code
    if deep:
        take_difference(V, m, in_workspace(V.words[DOWN])[1], h, k, width)
    else:
        take_difference(V, m, m, h, k, width)
    if V.words[REMEMBERED] > 0:
        # what friction keeps is another number behind the step
        keep_change(V, k, width, OWN)
        V.told[k] = V.words[CORNERS]
    else:
        V.smooth[k] = 1
    return 0


@jitable
def take_difference(
    V: Variations, m: Method, other: Method, h: float, k: int, width: float
) -> None:
    """Fill derivative k at the end of the step, and its error, from both sides of a difference."""
    up = in_workspace(V.words[UP])[1]
    whole, last, apart = 1.0 / V.size[k], V.estimates.shape[1] - 1, 0.0
    for i in range(len(m.y)):
        first = (up.k[0, i] - other.k[0, i]) / width
        apart = max(apart, abs(first - V.slope[k, i]) / V.felt[i])
        V.slope[k, i] = (up.k[last, i] - other.k[last, i]) / width
        if len(V.weights) > 0:
            # what is rounded is the change alone
            rise = 0.0
            for j in range(len(V.weights)):
                rise += V.weights[j] * (up.k[j, i] - other.k[j, i])
            V.next[k, i] = V.d[k, i] + h / width * rise
        else:
            V.next[k, i] = (up.trial[i] - other.trial[i]) / width
        whole = max(whole, abs(V.next[k, i]) / V.felt[i], abs(V.d[k, i]) / V.felt[i])
    V.error[k] = error_of(V, up, other, abs(h / width) / whole)
    if V.told[k] == 1:
        # where f bends between both sides of a difference each is smooth, and neither right
        V.error[k] = max(V.error[k], h * apart / whole)


@jitable
def fit_path(V: Variations, scene: Scene, m: Method, t: float, h: float) -> int:
    """Fill the polynomial of the run's step; return a code."""
    own = in_workspace(V.words[DOWN])[1]
    set_parameter(V, view(V.words[TWIN], Scene), scene, 0, 0.0)
    own.memory[SHOWN] = 0.0
    for i in range(len(m.y)):
        own.y[i], own.trial[i] = m.y[i], m.trial[i]
        for j in range(len(own.k)):
            own.k[j, i] = m.k[j, i]
    code = call_int(V.words[FIT_DENSE], (V.words[DOWN], t, h, own.y, own.trial))
    for j in range(V.dense.shape[1]):
        for i in range(len(m.y)):
            V.path[j, i] = own.dense[j, i]
    return code


@jitable
def fit_beside(
    V: Variations, scene: Scene, t: float, h: float, k: int, e: float, deep: bool
) -> int:
    """Fill the polynomial of derivative k of the run's step; return a code.

    `e` is by how much the parameter was changed in the step that was just taken, to both sides
    where it is `deep`; else the run's own polynomial is known.
    """
    twin, up = view(V.words[TWIN], Scene), in_workspace(V.words[UP])[1]
    set_parameter(V, twin, scene, k, e)
    code = call_int(V.words[FIT_DENSE], (V.words[UP], t, h, up.y, up.trial))
    down = in_workspace(V.words[DOWN])[1]
    if deep:
        set_parameter(V, twin, scene, k, -e)
        code = code or call_int(V.words[FIT_DENSE], (V.words[DOWN], t, h, down.y, down.trial))
    for j in range(V.dense.shape[1]):
        for i in range(V.dense.shape[2]):
            there = down.dense[j, i] if deep else V.path[j, i]
            V.dense[k, j, i] = (up.dense[j, i] - there) / (2.0 * e if deep else e)
    return code
