"""What of a derivative is nothing but another time of a touch.

Where a parameter lets a contact begin later by s = dt*/dp, the derivative at a fixed time is
-s f within the touch, and f is large there: as bodies part a small rest is left of it, which an
error of the large part hides. So D + s f is carried through a touch in the place of D. Where f is
no function of time it obeys the same equation, for f does: f' = f_y f. What is added at the begin
and taken away at the end is the run's own f, and has no error of the derivative's steps.
"""

from __future__ import annotations

import math

from mbsim.arrays.scene import Scene
from mbsim.core.address import call_int, view
from mbsim.core.arrays import F1
from mbsim.core.jitable import jitable
from mbsim.dynamics.contact.forces import DEPTH
from mbsim.integrators.scheme import Method, in_workspace
from mbsim.sensitivity.along import LOWER, POINT, UPPER, point_at
from mbsim.sensitivity.arrays import (
    F_BEFORE,
    LAST_ON,
    LAST_UNTIL,
    REMEMBERED,
    STEADY,
    TWIN,
    UP,
    Variations,
)
from mbsim.sensitivity.twin import set_parameter

#: Whether f is a function of time within the step is not known yet.
UNKNOWN = -1
#: f of its end is compared with that of a time which is so much of the step earlier.
OTHER_TIME = 0.37
#: Depths are compared so far behind a touch, as a part of the step, or farther by so many times.
BEHIND, FARTHER = 1e-6, 8.0
#: D + s f is given up where it is no smaller than this part of D.
PAYS = 0.5


@jitable
def add(d: F1, f: F1, s: float) -> None:
    """Add s f to a derivative."""
    for i in range(len(d)):
        d[i] += s * f[i]


@jitable
def is_steady(V: Variations, scene: Scene, m: Method, t: float, h: float) -> bool:
    """Return whether f is no function of time within the step from t, nor of what laws remember."""
    if V.words[STEADY] == UNKNOWN:
        twin, w = view(V.words[TWIN], Scene), V.work
        p, steady = in_workspace(V.words[UP])[0], V.words[REMEMBERED] == 0
        for i in range(len(m.y)):
            w[POINT, i] = m.trial[i]
        set_parameter(V, twin, scene, 0, 0.0)
        if steady:
            at = t + h - OTHER_TIME * h
            steady = call_int(p.rhs, (p.context, at, h, w[POINT], w[LOWER])) == 0
            for i in range(len(m.y)):
                steady = steady and V.jump[F_BEFORE, i] == w[LOWER, i]
        V.words[STEADY] = 1 if steady else 0
    return V.words[STEADY] == 1


@jitable
def add_motion(
    V: Variations, scene: Scene, t: float, h: float, part: float, k: int, s: float
) -> int:
    """Add s f at a part of the step to the derivative in `next`; return a code."""
    if s == 0.0:
        return 0
    w, p = V.work, in_workspace(V.words[UP])[0]
    set_parameter(V, view(V.words[TWIN], Scene), scene, k, 0.0)
    point_at(V, part, w[POINT])
    code = call_int(p.rhs, (p.context, t + part * h, part * h, w[POINT], w[UPPER]))
    add(V.next[k], w[UPPER], s)
    return code


@jitable
def depth_at(
    V: Variations, scene: Scene, t: float, h: float, part: float, slot: int, k: int, e: float
) -> float:
    """Return how deep a slot is at a part of the step, moved by e; NaN where it does not touch."""
    twin, w, p = view(V.words[TWIN], Scene), V.work, in_workspace(V.words[UP])[0]
    set_parameter(V, twin, scene, k, e)
    point_at(V, part, w[POINT])
    add(w[POINT], V.next[k], e)
    code = call_int(p.rhs, (p.context, t + part * h, part * h, w[POINT], w[UPPER]))
    touches = code == 0 and twin.work.touching[slot] == 1
    return twin.work.slot[slot, DEPTH] if touches else math.nan


@jitable
def touch_later(
    V: Variations, scene: Scene, t: float, h: float, k: int, slot: int, part: float, e: float
) -> float:
    """Return how fast the touch of a slot at a part of the step moves in time, NaN if unknown.

    That is how fast its depth just behind it does, over how fast it gets deeper.
    """
    off, left = BEHIND, 1.0 - part
    while off <= 1.0:
        at = part + off * left
        up = depth_at(V, scene, t, h, at, slot, k, e)
        down = depth_at(V, scene, t, h, at, slot, k, -e)
        if math.isfinite(up - down):
            # the depth at the touch is 0
            deeper = 0.5 * (up + down) / (off * left * h)
            return -0.5 / e * (up - down) / deeper if deeper > 0.0 else math.nan
        off *= FARTHER
    return math.nan


@jitable
def pays(V: Variations, f: F1, k: int) -> bool:
    """Return whether D + s f is far smaller than D, at the end of a step where f is known."""
    s, whole, rest = V.later[k, LAST_ON], 0.0, 0.0
    for i in range(len(f)):
        whole = max(whole, abs(V.next[k, i]) / V.scale[i])
        rest = max(rest, abs(V.next[k, i] + s * f[i]) / V.scale[i])
    return rest < PAYS * whole


@jitable
def go_on(V: Variations, scene: Scene, m: Method, t: float, h: float, k: int) -> None:
    """Begin a step of derivative k as late as the one before has ended, if that is allowed."""
    if V.later[k, LAST_ON] != 0.0 and not is_steady(V, scene, m, t, h):
        give_up(V, k)
    V.later[k, LAST_UNTIL] = V.later[k, LAST_ON]


@jitable
def give_up(V: Variations, k: int) -> None:
    """Carry D itself from here on: slopes that are known are those of D + s f."""
    if V.later[k, LAST_ON] != 0.0:
        V.later[k, LAST_ON] = 0.0
        V.smooth[k] = V.ready[k] = V.told[k] = 0
