"""A sphere on a plane, on a sphere, on a box."""

from __future__ import annotations

import math

from mbsim.core.arrays import F1, F2
from mbsim.core.jitable import jitable
from mbsim.core.rotation import add, dot, norm, scale, sub, vector
from mbsim.geometry.catalog import axis, pair, put_point


@pair("SPHERE", "PLANE", slots=1)
def sphere_plane(frame_i: F1, size_i: F1, frame_j: F1, size_j: F1, points: F2) -> int:
    """Depth r - z, normal the plane's; the deepest point of the sphere is below its centre."""
    n = axis(frame_j, 2)
    centre = vector(frame_i)
    depth = size_i[0] - dot(sub(centre, vector(frame_j)), n)
    put_point(points[0], depth, sub(centre, scale(size_i[0] - 0.5 * depth, n)), n)
    return 1


@pair("SPHERE", "SPHERE", slots=1)
def sphere_sphere(frame_i: F1, size_i: F1, frame_j: F1, size_j: F1, points: F2) -> int:
    """Depth r_i + r_j - distance, normal along the line of centres."""
    apart = sub(vector(frame_i), vector(frame_j))
    distance = norm(apart)
    # concentric spheres have no normal; any will do
    n = scale(1.0 / distance, apart) if distance > 0.0 else (0.0, 0.0, 1.0)
    depth = size_i[0] + size_j[0] - distance
    put_point(points[0], depth, add(vector(frame_j), scale(size_j[0] - 0.5 * depth, n)), n)
    return 1


@jitable
def _clamp(value: float, half: float) -> float:
    """Return `value` limited to [-half, half]."""
    return max(-half, min(half, value))


@pair("SPHERE", "BOX", slots=1)
def sphere_box(frame_i: F1, size_i: F1, frame_j: F1, size_j: F1, points: F2) -> int:
    """The nearest point of the box to the centre; inside, the way out through the nearest face."""
    centre = vector(frame_i)
    apart = sub(centre, vector(frame_j))
    x, y, z = axis(frame_j, 0), axis(frame_j, 1), axis(frame_j, 2)
    a, b, c = dot(apart, x), dot(apart, y), dot(apart, z)
    qa, qb, qc = _clamp(a, size_j[0]), _clamp(b, size_j[1]), _clamp(c, size_j[2])
    da, db, dc = a - qa, b - qb, c - qc
    distance = math.sqrt(da * da + db * db + dc * dc)
    if distance > 0.0:
        n = scale(1.0 / distance, add(scale(da, x), add(scale(db, y), scale(dc, z))))
    else:
        # centre inside: leave through the face with the least way to go
        ga, gb, gc = size_j[0] - abs(a), size_j[1] - abs(b), size_j[2] - abs(c)
        if ga <= gb and ga <= gc:
            n, distance = scale(1.0 if a >= 0.0 else -1.0, x), -ga
        elif gb <= gc:
            n, distance = scale(1.0 if b >= 0.0 else -1.0, y), -gb
        else:
            n, distance = scale(1.0 if c >= 0.0 else -1.0, z), -gc
    depth = size_i[0] - distance
    put_point(points[0], depth, sub(centre, scale(size_i[0] - 0.5 * depth, n)), n)
    return 1
