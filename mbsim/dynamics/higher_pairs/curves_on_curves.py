"""Curves that touch curves: where they do, and their three equations.

All vectors are global ones, rates those seen from J. With x(s) a point of I's curve, y(u) one of
J's, t_i = x', t_j = y' their tangents, r = x - y, b the normal of the plane of J's curve (or of
I's, where J's is straight), and n = b x t_j, which is in that plane, s and u are where

    r . t_j = 0,   n . t_i = 0:

J's point is the one beneath I's, and the tangents are parallel as seen along b. The equations are

    n . r/|n| = 0 (the gap),   b . r = 0 (the same plane),   b . t_i/|t_i| = 0 (no tilt).

I may turn about the common tangent. The gap does not change with s or u, which makes its gradient
that of a point at the place of contact; with V, A velocity and acceleration of I's point there, W
the relative angular velocity, and where all three equations hold:

    u' = (V . t_j + s' t_i . t_j)/q,   q = t_j . t_j,   m = (b x t_j') . t_i
    s' = -(n . (W x t_i) + m V . t_j/q)/D,   D = n . t_i' + m t_i . t_j/q.

D is 0 where both are equally bent: there is no one point of contact.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from mbsim.arrays.scene import Scene
from mbsim.core.arrays import F1, V3
from mbsim.core.jitable import jitable
from mbsim.core.rotation import add, cross, dot, scale, sub, vector
from mbsim.dynamics.bodies.markers import marker_point, marker_velocity
from mbsim.dynamics.constraints.terms import add_side, centripetal
from mbsim.dynamics.higher_pairs.curves import (
    MOST,
    curve_point,
    longest_change,
    settled,
    turned,
)

#: Curves are equally bent where the difference of curvatures times a piece's length is below this.
_TOUCHES = 1e-8
#: Which equation is which.
GAP, PLANE, TILT = range(3)


class Touch(NamedTuple):
    """Where two curves are, and their slopes by their parameters, global."""

    x: V3
    x1: V3
    x2: V3
    x3: V3
    y: V3
    y1: V3
    y2: V3
    y3: V3
    b: V3


@jitable
def touch_at(scene: Scene, y: F1, c: int, s: float, u: float) -> Touch:
    """Return the points of I's curve c at s and of J's, the next one, at u."""
    i, j = scene.curves.i[c], scene.curves.j[c]
    x, x1, x2, x3 = curve_point(scene, c, s)
    z, z1, z2, z3 = curve_point(scene, c + 1, u)
    return Touch(
        add(marker_point(scene, y, i), turned(scene, i, x)),
        turned(scene, i, x1),
        turned(scene, i, x2),
        turned(scene, i, x3),
        add(marker_point(scene, y, j), turned(scene, j, z)),
        turned(scene, j, z1),
        turned(scene, j, z2),
        turned(scene, j, z3),
        turned(scene, j, vector(scene.curves.normal[c + 1])),
    )


@jitable
def locate_touch(scene: Scene, y: F1, c: int) -> tuple[float, float]:
    """Return the parameters of where curves c and c + 1 touch, from the committed ones on.

    By Newton's method, no further than a piece at once; both are NaN where that ends nowhere.
    """
    s, u, before = scene.state.along[c], scene.state.along[c + 1], math.inf
    for _ in range(MOST):
        at = touch_at(scene, y, c, s, u)
        r, n = sub(at.x, at.y), cross(at.b, at.y1)
        f, g = dot(r, at.y1), dot(n, at.x1)
        fs, fu = dot(at.x1, at.y1), dot(r, at.y2) - dot(at.y1, at.y1)
        gs, gu = dot(n, at.x2), dot(cross(at.b, at.y2), at.x1)
        pieces = longest_change(scene, c, s), longest_change(scene, c + 1, u)
        det = fs * gu - fu * gs
        if det == 0.0:
            break
        ds = (fu * g - gu * f) / det / pieces[0]
        du = (gs * f - fs * g) / det / pieces[1]
        most = max(abs(ds), abs(du))
        part = 1.0 if most <= 1.0 else 1.0 / most
        s += part * ds * pieces[0]
        u += part * du * pieces[1]
        if settled(most, before):
            return s, u
        before = most
    return math.nan, math.nan


@jitable
def relative(scene: Scene, y: F1, i: int, j: int, p: V3) -> tuple[V3, V3, V3, V3]:
    """Return how I's point at p moves as seen from J where no body is accelerated.

    Velocity and acceleration of the point, angular velocity and angular acceleration.
    """
    w_i = vector(scene.work.w[scene.markers.body[i]])
    w_j = vector(scene.work.w[scene.markers.body[j]])
    on_i, on_j = sub(p, marker_point(scene, y, i)), sub(p, marker_point(scene, y, j))
    v = sub(
        add(marker_velocity(scene, i), cross(w_i, on_i)),
        add(marker_velocity(scene, j), cross(w_j, on_j)),
    )
    a_i = add(centripetal(scene, i), cross(w_i, cross(w_i, on_i)))
    a_j = add(centripetal(scene, j), cross(w_j, cross(w_j, on_j)))
    a = sub(sub(a_i, a_j), scale(2.0, cross(w_j, v)))
    w = sub(w_i, w_j)
    return v, a, w, scale(-1.0, cross(w_j, w))


@jitable
def fill_push(scene: Scene, y: F1, c: int, p: V3, force: V3, torque: V3, G: F1) -> None:
    """Fill a gradient: force at p and torque on I, the opposite on J."""
    add_side(scene, y, G[0:6], scene.curves.i[c], p, force, torque)
    back, turn = scale(-1.0, force), scale(-1.0, torque)
    add_side(scene, y, G[6:12], scene.curves.j[c], p, back, turn)


@jitable
def curve_on_curve_term(scene: Scene, y: F1, c: int, which: int, G: F1) -> V3:
    """Return value, rate and second rate of an equation of two curves; fill its gradient."""
    at = touch_at(scene, y, c, scene.sweep.located[c], scene.sweep.located[c + 1])
    v, a, w, dw = relative(scene, y, scene.curves.i[c], scene.curves.j[c], at.x)
    r, b, q = sub(at.x, at.y), at.b, dot(at.y1, at.y1)
    n, n1 = cross(b, at.y1), cross(b, at.y2)
    m, both = dot(n1, at.x1), dot(at.x1, at.y1)
    bent = dot(n, at.x2) + m * both / q
    spun = cross(w, at.x1)
    ds = -(dot(n, spun) + m * dot(v, at.y1) / q) / bent
    if which == PLANE:
        fill_push(scene, y, c, at.x, b, (0.0, 0.0, 0.0), G)
        return dot(b, r), dot(b, v), dot(b, a) + ds * dot(b, spun)
    du = (dot(v, at.y1) + ds * both) / q
    if which == GAP:
        size = math.sqrt(dot(n, n))
        e = scale(1.0 / size, n)
        fill_push(scene, y, c, at.x, e, (0.0, 0.0, 0.0), G)
        de = scale(du / size, sub(n1, scale(dot(e, n1), e)))
        second = dot(e, add(a, scale(ds, spun))) + dot(de, v)
        return dot(e, r), dot(e, v), second
    # h = (t_i/|t_i|)', which is out of J's plane where I is turned about the tangent
    size = math.sqrt(dot(at.x1, at.x1))
    e = scale(1.0 / size, at.x1)
    h = scale(1.0 / size, sub(at.x2, scale(dot(e, at.x2), e)))
    out = dot(b, h) / bent
    force = scale(-out * m / q, at.y1)
    fill_push(scene, y, c, at.x, force, sub(cross(e, b), scale(out, cross(at.x1, n))), G)
    rate = dot(b, cross(w, e)) + dot(b, h) * ds
    # s'' by the rates of both conditions, where r' = 0
    spun2 = cross(w, at.x2)
    k1 = dot(at.y1, add(a, add(scale(2.0 * ds, spun), scale(ds * ds, at.x2))))
    k1 -= du * du * dot(at.y1, at.y2)
    turn = add(cross(dw, at.x1), cross(w, spun))
    k2 = dot(n, add(turn, add(scale(2.0 * ds, spun2), scale(ds * ds, at.x3))))
    k2 += 2.0 * du * dot(n1, add(spun, scale(ds, at.x2)))
    k2 += du * du * dot(cross(b, at.y3), at.x1)
    dds = -(k2 + m * k1 / q) / bent
    along = dot(e, at.x2)
    h1 = sub(at.x3, add(scale(dot(e, at.x3) + dot(h, at.x2), e), scale(2.0 * along, h)))
    second = dot(b, turn) / size
    second += dot(b, add(scale(2.0 * ds, cross(w, h)), scale(ds * ds / size, h1)))
    return dot(b, e), rate, second + dds * dot(b, h)


@jitable
def touches(scene: Scene, y: F1, c: int) -> bool:
    """Return whether curves c and c + 1 touch at the committed parameters in one point."""
    s, u = scene.state.along[c], scene.state.along[c + 1]
    if not (math.isfinite(s) and math.isfinite(u)):
        return False
    at = touch_at(scene, y, c, s, u)
    n, q = cross(at.b, at.y1), dot(at.y1, at.y1)
    bent = dot(n, at.x2) + dot(cross(at.b, at.y2), at.x1) * dot(at.x1, at.y1) / q
    # curvature against J less I's, times the length of a piece of I's
    length = longest_change(scene, c, s) * math.sqrt(dot(at.x1, at.x1))
    size = dot(at.x1, at.x1) * math.sqrt(q)
    return abs(bent) / size * length > _TOUCHES
