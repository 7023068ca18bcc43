"""An ellipsoid on the faces of a convex mesh, in place of the search for their least overlap.

    depth = min over faces (b - n.c + h(n))      h(n) = |A n|, A the semi-axes

with the face's plane n.x = b, the centre c and the ellipsoid's reach h. It holds over the inside of
a face; beyond its rim, where the nearest point lies on an edge, depth is too large.

Template of a closed-form pair: copy it into mbsim/geometry/pairs/ and change it. `geometry.catalog`
says what `frame` and `size` hold and what a pair writes.
"""

from __future__ import annotations

import math

from mbsim.core.arrays import F1, F2, V3
from mbsim.core.jitable import jitable
from mbsim.core.memory import floats_at
from mbsim.core.rotation import add, dot, scale, sub, vector
from mbsim.geometry.catalog import axis, pair, put_point
from mbsim.geometry.polyhedron import to_global
from mbsim.model.hull import AT_PLANES, FACES


@jitable
def _lowest(frame: F1, size: F1, n: V3) -> V3:
    """Return the ellipsoid's lowest point along n from its centre: -A^2 n / h(n)."""
    low, reach = (0.0, 0.0, 0.0), 0.0
    for k in range(3):
        along = size[k] * dot(axis(frame, k), n)
        reach += along * along
        low = sub(low, scale(size[k] * along, axis(frame, k)))
    return scale(1.0 / math.sqrt(reach), low)


@pair("ELLIPSOID", "MESH", slots=1)
def ellipsoid_mesh(frame_i: F1, size_i: F1, frame_j: F1, size_j: F1, points: F2) -> int:
    """The face that it has to leave by the shortest way."""
    hull = floats_at(size_j[0], size_j[1])
    apart, depth = sub(vector(frame_i), vector(frame_j)), math.inf
    n, low = axis(frame_j, 2), (0.0, 0.0, 0.0)
    for f in range(int(hull[FACES])):
        at = int(hull[AT_PLANES]) + 4 * f
        normal = to_global(frame_j, vector(hull[at:]))
        reach = _lowest(frame_i, size_i, normal)
        deep = hull[at + 3] - dot(normal, add(apart, reach))
        if deep < depth:
            depth, n, low = deep, normal, reach
    put_point(points[0], depth, add(vector(frame_i), add(low, scale(0.5 * depth, n))), n)
    return 1
