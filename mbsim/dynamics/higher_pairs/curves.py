"""Points of curves that are fixed to bodies: position and slopes by the parameter, the nearest one.

The nearest point is looked for from that of the committed state on, downhill, so that a point
that is held goes along a curve which meets itself, and a closed one counts its rounds.
"""

from __future__ import annotations

import math

from mbsim.arrays.scene import Scene
from mbsim.core.arrays import F1, V3
from mbsim.core.jitable import jitable
from mbsim.core.rotation import add, cross, dot, scale, sub
from mbsim.dynamics.bodies.markers import marker_axis, marker_point

#: Most corrections of a parameter.
MOST = 100
#: The last one is less than this part of a piece.
_ENOUGH = 1e-14
#: Rounding changes it by less than this part.
_SMALL = 1e-9
#: A second slope of the distance below this part of that of a straight line is none.
LEAST = 0.1


@jitable
def span_at(
    begins: F1, lengths: F1, low: int, high: int, closed: int, u: float
) -> tuple[int, float]:
    """Return which span from `low` to `high` u is in, and how far behind its begin."""
    begin, end = begins[low], begins[high] + lengths[high]
    if closed == 1:
        u -= math.floor((u - begin) / (end - begin)) * (end - begin)
    while low < high:
        middle = (low + high + 1) // 2
        if u >= begins[middle]:
            low = middle
        else:
            high = middle - 1
    return low, u - begins[low]


@jitable
def piece_at(scene: Scene, c: int, u: float) -> tuple[int, float]:
    """Return the piece of curve c at parameter u, and how far u is behind its begin.

    Beyond an end of an open curve its last piece goes on.
    """
    curves = scene.curves
    low, high = curves.first[c], curves.first[c + 1] - 1
    return span_at(curves.begin, curves.length, low, high, curves.closed[c], u)


@jitable
def curve_point(scene: Scene, c: int, u: float) -> tuple[V3, V3, V3, V3]:
    """Return the point of curve c at parameter u, and its first three slopes, in its own axes."""
    k, s = piece_at(scene, c, u)
    p = scene.curves.coefficient[k]
    x, dx = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    ddx, dddx = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    for n in range(5, -1, -1):
        dddx = (s * dddx[0] + 3.0 * ddx[0], s * dddx[1] + 3.0 * ddx[1], s * dddx[2] + 3.0 * ddx[2])
        ddx = (s * ddx[0] + 2.0 * dx[0], s * ddx[1] + 2.0 * dx[1], s * ddx[2] + 2.0 * dx[2])
        dx = (s * dx[0] + x[0], s * dx[1] + x[1], s * dx[2] + x[2])
        x = (s * x[0] + p[n, 0], s * x[1] + p[n, 1], s * x[2] + p[n, 2])
    return x, dx, ddx, dddx


@jitable
def longest_change(scene: Scene, c: int, u: float) -> float:
    """Return by how much the parameter of curve c is changed at once at most: by a piece."""
    return scene.curves.length[piece_at(scene, c, u)[0]]


@jitable
def settled(change: float, before: float) -> bool:
    """Return whether a change, in parts of a piece, is the last; `before` is the one before it.

    Rounding ends it too: changes that are small and get no smaller are that.
    """
    return change <= _ENOUGH or (change <= _SMALL and change >= 0.5 * before)


@jitable
def nearest_parameter(scene: Scene, c: int, d: V3) -> float:
    """Return at which parameter curve c is nearest to d, from the committed one on downhill.

    With r = d - x(u): r . x' = 0, by Newton's method, no further than a piece at once.
    """
    u, before = scene.state.along[c], math.inf
    for _ in range(MOST):
        x, dx, ddx, _ = curve_point(scene, c, u)
        r = sub(d, x)
        straight = dot(dx, dx)
        bent = straight - dot(r, ddx)
        longest = longest_change(scene, c, u)
        part = dot(r, dx) / (bent if bent > LEAST * straight else straight) / longest
        part = min(1.0, max(-1.0, part))
        u += part * longest
        if settled(abs(part), before):
            break
        before = abs(part)
    return u


@jitable
def turned(scene: Scene, m: int, a: V3) -> V3:
    """Return a vector in the axes of marker m as a global one."""
    found = scale(a[0], marker_axis(scene, m, 0))
    found = add(found, scale(a[1], marker_axis(scene, m, 1)))
    return add(found, scale(a[2], marker_axis(scene, m, 2)))


@jitable
def seen_from(scene: Scene, y: F1, i: int, j: int) -> V3:
    """Return where the origin of marker i is, in the axes of marker j."""
    d = sub(marker_point(scene, y, i), marker_point(scene, y, j))
    return (
        dot(d, marker_axis(scene, j, 0)),
        dot(d, marker_axis(scene, j, 1)),
        dot(d, marker_axis(scene, j, 2)),
    )


@jitable
def across(scene: Scene, c: int, tangent: V3, which: int) -> V3:
    """Return one of two unit vectors at right angles to a tangent of curve c, in J's axes.

    They follow the axis of J which the curve is least along at the committed state, so that they
    are smooth within a step.
    """
    _, t, _, _ = curve_point(scene, c, scene.state.along[c])
    least = 0
    for k in range(1, 3):
        if abs(t[k]) < abs(t[least]):
            least = k
    t = scale(1.0 / math.sqrt(dot(tangent, tangent)), tangent)
    axis = (
        1.0 if least == 0 else 0.0,
        1.0 if least == 1 else 0.0,
        1.0 if least == 2 else 0.0,
    )
    n = cross(axis, t)
    n = scale(1.0 / math.sqrt(dot(n, n)), n)
    return n if which == 0 else cross(t, n)


@jitable
def beyond_end(scene: Scene, c: int, u: float) -> bool:
    """Return whether u is beyond an end of curve c, open, while its element takes part."""
    curves = scene.curves
    first, last = curves.first[c], curves.first[c + 1] - 1
    end = curves.begin[last] + curves.length[last]
    holds = curves.closed[c] == 0 and scene.equations.off[curves.equation[c]] == 0
    return holds and not curves.begin[first] <= u <= end
