"""Points that stay on curves: their two equations."""

from __future__ import annotations

from mbsim.arrays.scene import Scene
from mbsim.core.arrays import F1, V3
from mbsim.core.jitable import jitable
from mbsim.core.rotation import cross, dot, sub, vector
from mbsim.dynamics.bodies.markers import marker_point, marker_velocity
from mbsim.dynamics.constraints.terms import along_term
from mbsim.dynamics.higher_pairs.curves import across, curve_point, seen_from, turned


@jitable
def point_on_curve_term(scene: Scene, y: F1, c: int, which: int, G: F1) -> V3:
    """Return value, rate and second rate of how far I is off a curve, and fill its gradient.

    With d the point as seen from J, x(u) the nearest one of the curve, n at right angles to x':

        n . (d - x), and where that is 0: n . d', n . d'' - u'^2 n . x'',  u' = x' . d'/(x' . x').
    """
    i, j = scene.curves.i[c], scene.curves.j[c]
    d = seen_from(scene, y, i, j)
    x, dx, ddx, _ = curve_point(scene, c, scene.sweep.located[c])
    n = across(scene, c, dx, which)
    _, flow, second = along_term(scene, y, i, j, turned(scene, j, n), G)
    v = sub(marker_velocity(scene, i), marker_velocity(scene, j))
    w = vector(scene.work.w[scene.markers.body[j]])
    arm = sub(marker_point(scene, y, i), marker_point(scene, y, j))
    rate = dot(turned(scene, j, dx), sub(v, cross(w, arm))) / dot(dx, dx)
    return dot(n, sub(d, x)), flow, second - rate * rate * dot(n, ddx)
