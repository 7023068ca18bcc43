"""What higher pairs are asked for: the term of an equation, and to keep where they touch."""

from __future__ import annotations

import math

from mbsim.arrays.codes import (
    AXIS_I,
    AXIS_J,
    PAIR_RATE,
    PAIR_SECOND,
    PAIR_VALUE,
    POINT_ON_CURVE,
    POINT_ON_SURFACE,
)
from mbsim.arrays.scene import Scene
from mbsim.core.arrays import F1
from mbsim.core.codes import Code
from mbsim.core.jitable import jitable
from mbsim.dynamics.higher_pairs.curves import beyond_end, nearest_parameter, seen_from
from mbsim.dynamics.higher_pairs.curves_on_curves import (
    curve_on_curve_term,
    locate_touch,
    touches,
)
from mbsim.dynamics.higher_pairs.points_on_curves import point_on_curve_term
from mbsim.dynamics.higher_pairs.points_on_surfaces import (
    beyond_edge,
    nearest_on_surface,
    point_on_surface_term,
)


@jitable
def nearest_of(scene: Scene, y: F1, c: int) -> float:
    """Return at which parameter curve c is nearest to the point that it holds."""
    return nearest_parameter(scene, c, seen_from(scene, y, scene.curves.i[c], scene.curves.j[c]))


@jitable
def nearest_foot(scene: Scene, y: F1, f: int) -> tuple[float, float]:
    """Return at which parameters surface f is nearest to the point that it holds."""
    surfaces = scene.surfaces
    return nearest_on_surface(scene, f, seen_from(scene, y, surfaces.i[f], surfaces.j[f]))


@jitable
def fill_pair(scene: Scene, k: int, anew: int, y: F1) -> None:
    """Fill gradient of term k and `Sweep.pair`; with `anew` 1 find first where the pair touches."""
    eq, located = scene.equations, scene.sweep.located
    kind, which, row = eq.axis[k, AXIS_J], eq.axis[k, AXIS_I], eq.angle[k]
    G, found = scene.sweep.G[k], (0.0, 0.0, 0.0)
    if kind == POINT_ON_CURVE:
        if anew == 1:
            located[row] = nearest_of(scene, y, row)
        found = point_on_curve_term(scene, y, row, which, G)
    elif kind == POINT_ON_SURFACE:
        if anew == 1:
            at = len(scene.curves.i) + 2 * row
            located[at], located[at + 1] = nearest_foot(scene, y, row)
        found = point_on_surface_term(scene, y, row, G)
    else:
        if anew == 1:
            located[row], located[row + 1] = locate_touch(scene, y, row)
        found = curve_on_curve_term(scene, y, row, which, G)
    pair = scene.sweep.pair
    pair[PAIR_VALUE], pair[PAIR_RATE], pair[PAIR_SECOND] = found


@jitable
def commit_pairs(scene: Scene, y: F1) -> int:
    """Take where higher pairs touch as committed; return a code.

    A point that has come to the end of an open curve has nowhere to go.
    """
    curves, along = scene.curves, scene.state.along
    for c in range(len(curves.closed)):
        if curves.touching[c] == 0:
            along[c] = nearest_of(scene, y, c)
        elif curves.touching[c] == 1:
            s, u = locate_touch(scene, y, c)
            lasts = scene.equations.off[curves.equation[c]] == 0
            if lasts and not math.isfinite(s):
                return Code.NO_ONE_TOUCH
            if math.isfinite(s):
                along[c], along[c + 1] = s, u
            if lasts and not touches(scene, y, c):
                return Code.NO_ONE_TOUCH
        if beyond_end(scene, c, along[c]):
            return Code.END_OF_CURVE
    for f in range(len(scene.surfaces.i)):
        at = len(curves.closed) + 2 * f
        s, u = nearest_foot(scene, y, f)
        if math.isfinite(s):
            along[at], along[at + 1] = s, u
        elif scene.equations.off[scene.surfaces.equation[f]] == 0:
            return Code.NO_ONE_TOUCH
        if beyond_edge(scene, f):
            return Code.END_OF_CURVE
    return 0
