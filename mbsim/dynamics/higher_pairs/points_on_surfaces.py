"""Points that stay on surfaces: the nearest point of a surface, and the equation."""

from __future__ import annotations

import math
from typing import NamedTuple

from mbsim.arrays.codes import ALONG_U, ALONG_V
from mbsim.arrays.scene import Scene
from mbsim.core.arrays import F1, V3
from mbsim.core.jitable import jitable
from mbsim.core.rotation import add, cross, dot, scale, sub, vector
from mbsim.dynamics.bodies.markers import marker_point, marker_velocity
from mbsim.dynamics.constraints.terms import along_term
from mbsim.dynamics.higher_pairs.curves import LEAST, MOST, seen_from, settled, span_at, turned


class Foot(NamedTuple):
    """A point of a surface and its slopes by both parameters, in J's axes."""

    x: V3
    u: V3
    v: V3
    uu: V3
    uv: V3
    vv: V3


@jitable
def span_of(scene: Scene, f: int, side: int, u: float) -> tuple[int, float]:
    """Return the span of surface f along u or v, and how far u is behind its begin."""
    surfaces = scene.surfaces
    low = surfaces.start[f, side]
    high = low + surfaces.spans[f, side] - 1
    return span_at(surfaces.begin, surfaces.length, low, high, surfaces.closed[f, side], u)


@jitable
def surface_point(scene: Scene, f: int, u: float, v: float) -> Foot:
    """Return the point of surface f at parameters u and v."""
    surfaces = scene.surfaces
    k, s = span_of(scene, f, ALONG_U, u)
    m, r = span_of(scene, f, ALONG_V, v)
    row = (
        (k - surfaces.start[f, ALONG_U]) * surfaces.spans[f, ALONG_V]
        + m
        - surfaces.start[f, ALONG_V]
    )
    p = surfaces.coefficient[surfaces.first[f] + row]
    zero = (0.0, 0.0, 0.0)
    x, xu, xv, xuu, xuv, xvv = zero, zero, zero, zero, zero, zero
    for n in range(5, -1, -1):
        a, da, dda = zero, zero, zero
        for c in range(5, -1, -1):
            dda = add(scale(r, dda), scale(2.0, da))
            da = add(scale(r, da), a)
            a = add(scale(r, a), vector(p[6 * n + c]))
        xuu = add(scale(s, xuu), scale(2.0, xu))
        xu = add(scale(s, xu), x)
        x = add(scale(s, x), a)
        xuv = add(scale(s, xuv), xv)
        xv = add(scale(s, xv), da)
        xvv = add(scale(s, xvv), dda)
    return Foot(x, xu, xv, xuu, xuv, xvv)


@jitable
def nearest_on_surface(scene: Scene, f: int, d: V3) -> tuple[float, float]:
    """Return at which parameters surface f is nearest to d, from the committed ones on downhill.

    With r = d - x: r . x_u = r . x_v = 0, by Newton's method, no further than a span at once; NaN
    where the surface has no normal.
    """
    at = len(scene.curves.i) + 2 * f
    u, v, before = scene.state.along[at], scene.state.along[at + 1], math.inf
    length = scene.surfaces.length
    for _ in range(MOST):
        foot = surface_point(scene, f, u, v)
        r = sub(d, foot.x)
        fu, fv = dot(r, foot.u), dot(r, foot.v)
        e, g, mixed = dot(foot.u, foot.u), dot(foot.v, foot.v), dot(foot.u, foot.v)
        plain = e * g - mixed * mixed
        if not plain > 0.0:
            break
        be, bg = e - dot(r, foot.uu), g - dot(r, foot.vv)
        bm = mixed - dot(r, foot.uv)
        if be * bg - bm * bm > LEAST * plain and be > 0.0:
            e, g, mixed = be, bg, bm
        det = e * g - mixed * mixed
        long_u = length[span_of(scene, f, ALONG_U, u)[0]]
        long_v = length[span_of(scene, f, ALONG_V, v)[0]]
        du, dv = (g * fu - mixed * fv) / det / long_u, (e * fv - mixed * fu) / det / long_v
        most = max(abs(du), abs(dv))
        part = 1.0 if most <= 1.0 else 1.0 / most
        u += part * du * long_u
        v += part * dv * long_v
        if settled(most, before):
            return u, v
        before = most
    return math.nan, math.nan


@jitable
def point_on_surface_term(scene: Scene, y: F1, f: int, G: F1) -> V3:
    """Return value, rate and second rate of how far I is off a surface, and fill its gradient.

    With d the point as seen from J, x(u, v) the nearest one of the surface, n the unit normal:

        n . (d - x), and where that is 0: n . d', n . d'' less the curvature along the way,
        n . (x_uu u'^2 + 2 x_uv u' v' + x_vv v'^2),  d' = x_u u' + x_v v'.
    """
    i, j, at = scene.surfaces.i[f], scene.surfaces.j[f], len(scene.curves.i) + 2 * f
    located = scene.sweep.located
    foot = surface_point(scene, f, located[at], located[at + 1])
    n = cross(foot.u, foot.v)
    n = scale(1.0 / math.sqrt(dot(n, n)), n)
    _, flow, second = along_term(scene, y, i, j, turned(scene, j, n), G)
    w = vector(scene.work.w[scene.markers.body[j]])
    arm = sub(marker_point(scene, y, i), marker_point(scene, y, j))
    way = sub(sub(marker_velocity(scene, i), marker_velocity(scene, j)), cross(w, arm))
    fu, fv = dot(way, turned(scene, j, foot.u)), dot(way, turned(scene, j, foot.v))
    e, g, mixed = dot(foot.u, foot.u), dot(foot.v, foot.v), dot(foot.u, foot.v)
    det = e * g - mixed * mixed
    du, dv = (g * fu - mixed * fv) / det, (e * fv - mixed * fu) / det
    bent = du * du * dot(n, foot.uu) + 2.0 * du * dv * dot(n, foot.uv) + dv * dv * dot(n, foot.vv)
    return dot(n, sub(seen_from(scene, y, i, j), foot.x)), flow, second - bent


@jitable
def beyond_edge(scene: Scene, f: int) -> bool:
    """Return whether the point has left surface f, where that is open, while it takes part."""
    surfaces, at = scene.surfaces, len(scene.curves.i) + 2 * f
    for side in range(2):
        low = surfaces.start[f, side]
        high = low + surfaces.spans[f, side] - 1
        u, end = scene.state.along[at + side], surfaces.begin[high] + surfaces.length[high]
        if surfaces.closed[f, side] == 0 and not surfaces.begin[low] <= u <= end:
            return scene.equations.off[surfaces.equation[f]] == 0
    return False
