"""Force_Element: forces that a user's residual r(x, x', f, f', t) = 0 gives, one element at a time.

x is the displacement of I against J along (or about) axes of J, f the unknowns, the first of them
forces against x on I, as the seed has it (P. Maincon's DryFriction of Muscade): -f n on I, the
opposite on J at the same point. What r = 0 is solved for is, of an unknown that is

| kind         | known                        | sought       |                                   |
|--------------|------------------------------|--------------|-----------------------------------|
| DIFFERENTIAL | f, a state in y              | f'           | any order of the integrator       |
| ALGEBRAIC    | f' = 0, r does not look at it| f            | any order                         |
| SWITCHING    | f = f_n + h f'               | f', the mean | f_n: kept at the committed state  |

h is the time since that state, and where an unknown is SWITCHING x' is the mean (x - x_n)/h too. So
f is what a path in x makes of it, whatever h is: the return mapping of a rate-independent
law (J. C. Simo, T. J. R. Hughes, Computational Inelasticity, 1998, ch. 1), which no formula of
the integrator differentiates. Of a law that looks at time itself it is backward Euler.

How r = 0 is solved: `residual_solver`.
"""

from __future__ import annotations

import math

from mbsim.arrays.codes import AT_TIME
from mbsim.arrays.hooks import Dry
from mbsim.arrays.scene import Scene
from mbsim.core.arrays import F1
from mbsim.core.jitable import jitable
from mbsim.core.rotation import dot, sub, vector
from mbsim.dynamics.bodies.angles import followed_angle
from mbsim.dynamics.bodies.markers import marker_axis, marker_point
from mbsim.dynamics.forces.residual_solver import (
    PART,
    ask_at,
    axes_of,
    difference,
    own_time,
    scale_of,
    solve,
    unknowns_of,
)
from mbsim.dynamics.forces.wrenches import velocity_at
from mbsim.laws.residual import ALGEBRAIC, DIFFERENTIAL, SWITCHING

# entries of `State.residual`
NOW, BEFORE = range(2)
#: Times of the model's own, L/V: shorter steps take x' for the mean; the shortest there is.
SHORT, SHORTEST = 1e-8, 1e-14


@jitable
def remembered(scene: Scene) -> int:
    """Return where elements remember time, x, f, f' for the point being evaluated."""
    return BEFORE if scene.world.past[0] == 1 else NOW


@jitable
def switches(scene: Scene, e: int) -> bool:
    """Return whether an unknown of element e is SWITCHING."""
    R = scene.residuals
    for u in range(R.begin[e], R.begin[e + 1]):
        if R.kind[u] == SWITCHING:
            return True
    return False


@jitable
def fill_motion(scene: Scene, t: float, y: F1, e: int) -> None:
    """Write time, x and x' of element e into `given`; the bodies have been placed."""
    R, na = scene.residuals, axes_of(scene, e)
    R.given[0] = t
    i, j = R.i[e], R.j[e]
    bi, bj = scene.markers.body[i], scene.markers.body[j]
    p = marker_point(scene, y, i)
    r = sub(p, marker_point(scene, y, j))
    v = sub(velocity_at(scene, y, bi, p), velocity_at(scene, y, bj, p))
    w = sub(vector(scene.work.w[bi]), vector(scene.work.w[bj]))
    for k in range(na):
        at = R.first[e] + k
        n = marker_axis(scene, R.axis[at], 2)
        turns = R.angle[at] >= 0
        R.given[1 + k] = followed_angle(scene, R.angle[at]) if turns else dot(n, r)
        R.given[1 + na + k] = dot(n, w if turns else v)


@jitable
def step_of(scene: Scene, t: float, memory: F1) -> float:
    """Return the time since the state that is remembered."""
    h = t - memory[AT_TIME]
    return h if h > 0.0 else 0.0


@jitable
def mean_rates(scene: Scene, e: int, h: float, memory: F1) -> None:
    """Write the mean rates of x since the state that is remembered into `given`."""
    na = axes_of(scene, e)
    if not h > SHORT * own_time(scene):
        return
    for k in range(na):
        scene.residuals.given[1 + na + k] = (scene.residuals.given[1 + k] - memory[1 + k]) / h


@jitable
def find_unknowns(scene: Scene, t: float, y: F1, e: int) -> int:
    """Find the unknowns of element e at a point and leave them in `given`; return a code."""
    R, na, nu = scene.residuals, axes_of(scene, e), unknowns_of(scene, e)
    memory = scene.state.residual[e, remembered(scene)]
    known = math.isfinite(memory[AT_TIME])
    h = step_of(scene, t, memory)
    fill_motion(scene, t, y, e)
    if known and switches(scene, e):
        mean_rates(scene, e, h, memory)
    for k in range(nu):
        u = R.begin[e] + k
        f = memory[1 + na + k] if known else R.initial[u]
        R.base[k] = y[R.offset[u]] if R.kind[u] == DIFFERENTIAL else f
        if R.kind[u] == ALGEBRAIC:
            R.start[k] = f
        else:
            # what switches begins without a rate: at a limit it stays there
            R.start[k] = memory[1 + na + nu + k] if R.kind[u] == DIFFERENTIAL and known else 0.0
    return solve(scene, e, max(h, SHORTEST * own_time(scene)))


@jitable
def mode_now(scene: Scene, t: float, y: F1, e: int) -> float:
    """Return the mode at the point whose unknowns are in `given`: rows of r that look at f'.

    With f as it is, and x' as it is and no mean, r = 0 is solved for f'; -1 where it is not.
    """
    R, na, nu = scene.residuals, axes_of(scene, e), unknowns_of(scene, e)
    for k in range(nu):
        kind = R.kind[R.begin[e] + k]
        f = R.given[1 + 2 * na + k]
        if kind != DIFFERENTIAL:
            R.base[k] = f
        R.start[k] = f if kind == ALGEBRAIC else 0.0
    fill_motion(scene, t, y, e)
    h = SHORTEST * own_time(scene)
    if solve(scene, e, h) != 0 or ask_at(scene, e, h) != 0:
        return -1.0
    for k in range(nu):
        R.rows[k] = R.out[k]
        R.step[k] = 0.0
    for k in range(nu):
        if R.kind[R.begin[e] + k] != SWITCHING:
            continue
        at = 1 + 2 * na + nu + k
        size = PART * (abs(R.given[at]) + scale_of(scene, e, k, h))
        for side in range(2):
            # either way: what has just come to stick is at the very end of its branch
            code = difference(scene, e, at, size if side == 0 else -size, R.rise)
            if code != 0:
                return -1.0
            for i in range(nu):
                if R.rise[i] != 0.0:
                    R.step[i] = 1.0
    mode = 0.0
    for i in range(nu):
        mode += R.step[i] * 2.0**i
    return mode


@jitable
def serve_residual(scene: Scene, t: float, y: F1, e: int, component: int) -> int:
    """Fill what element e gives into `Users.result`, the mode if asked for; return a code."""
    R, na, nu = scene.residuals, axes_of(scene, e), unknowns_of(scene, e)
    result = scene.users.result[R.user[e]]
    code = find_unknowns(scene, t, y, e)
    if code != 0:
        return code
    first, at = 1 + 2 * na, na
    for k in range(na):
        result[k] = -R.given[first + k]
    for k in range(nu):
        if R.kind[R.begin[e] + k] == DIFFERENTIAL:
            result[at] = R.given[first + nu + k]
            at += 1
    for k in range(nu):
        result[at + k] = R.given[first + k]
    if component == at + nu:
        result[component] = mode_now(scene, t, y, e)
    return 0


@jitable
def keep_residuals(scene: Scene, what: int, t: float, y: F1) -> int:
    """Keep what all elements make of the point evaluated last; return 0."""
    if what != Dry.KEEP:
        return 0
    R = scene.residuals
    for e in range(len(R.id)):
        na, nu = axes_of(scene, e), unknowns_of(scene, e)
        kept = scene.state.residual[e]
        good = find_unknowns(scene, t, y, e) == 0
        for k in range(kept.shape[1]):
            kept[BEFORE, k] = kept[NOW, k]
        if not good:
            # it has just been solved there
            continue
        kept[NOW, AT_TIME] = t
        for k in range(na):
            kept[NOW, 1 + k] = R.given[1 + k]
        for k in range(2 * nu):
            kept[NOW, 1 + na + k] = R.given[1 + 2 * na + k]
    return 0
