"""Cylinders and frusta (solids of revolution) against a sphere and against a plane."""

from __future__ import annotations

import math

from mbsim.core.arrays import F1, F2, V3
from mbsim.core.jitable import jitable
from mbsim.core.rotation import add, cross, dot, scale, sub, vector
from mbsim.geometry.catalog import axis, pair, put_point, region
from mbsim.geometry.convex import point_in_solid
from mbsim.geometry.region import cylinder_cut, frustum_ends

RIM_SLOTS = 6


@jitable
def cylinder_size(size: F1) -> V3:
    """Return bottom radius, top radius, half length of a cylinder."""
    return (size[0], size[0], size[1])


@jitable
def sphere_on_solid(frame_i: F1, radius: float, frame_j: F1, size: V3, points: F2) -> int:
    """Write the one point of a ball against a solid of revolution: a plane problem."""
    centre = vector(frame_i)
    distance, n, _, _ = point_in_solid(vector(frame_j), axis(frame_j, 2), size, centre)
    depth = radius - distance
    put_point(points[0], depth, sub(centre, scale(radius - 0.5 * depth, n)), n)
    return 1


@pair("SPHERE", "CYLINDER", slots=1)
def sphere_cylinder(frame_i: F1, size_i: F1, frame_j: F1, size_j: F1, points: F2) -> int:
    """The nearest point of the cylinder to the sphere's centre; inside, the nearest way out."""
    return sphere_on_solid(frame_i, size_i[0], frame_j, cylinder_size(size_j), points)


@pair("SPHERE", "FRUSTUM", slots=1)
def sphere_frustum(frame_i: F1, size_i: F1, frame_j: F1, size_j: F1, points: F2) -> int:
    """The nearest point of the frustum to the sphere's centre; inside, the nearest way out."""
    return sphere_on_solid(frame_i, size_i[0], frame_j, vector(size_j), points)


@jitable
def solid_on_plane(frame_i: F1, size: V3, origin: V3, n: V3, points: F2) -> int:
    """On each rim its lowest point and those 120 degrees to both sides: row = rim, point.

    Lying, the two lowest points carry; standing, the three of one rim. Three points at equal
    angles have the same stiffness against tilting in every direction, so nothing jumps
    where an upright solid has no lowest point. Depths depend on height and tilt only,
    and so does the torque: the elastic force has a potential.
    """
    centre, a, x, y = vector(frame_i), axis(frame_i, 2), axis(frame_i, 0), axis(frame_i, 1)
    # along the solid's own axes, so that it is square to a however small the tilt
    along_x, along_y = -dot(n, x), -dot(n, y)
    tilt = math.hypot(along_x, along_y)
    down = x
    if tilt > 0.0:
        down = add(scale(along_x / tilt, x), scale(along_y / tilt, y))
    side = cross(a, down)
    for rim in range(2):
        end = add(centre, scale((1.0 if rim else -1.0) * size[2], a))
        for k in range(3):
            # 0 and +-120 degrees
            c = 1.0 if k == 0 else -0.5
            s = 0.0 if k == 0 else (math.sqrt(0.75) if k == 1 else -math.sqrt(0.75))
            p = add(end, scale(size[rim], add(scale(c, down), scale(s, side))))
            depth = -dot(sub(p, origin), n)
            put_point(points[3 * rim + k], depth, add(p, scale(0.5 * depth, n)), n)
    return RIM_SLOTS


@pair("CYLINDER", "PLANE", slots=RIM_SLOTS, rims=True)
def cylinder_plane(frame_i: F1, size_i: F1, frame_j: F1, size_j: F1, points: F2) -> int:
    """Three points of each rim against the plane."""
    n, origin = axis(frame_j, 2), vector(frame_j)
    return solid_on_plane(frame_i, cylinder_size(size_i), origin, n, points)


@pair("FRUSTUM", "PLANE", slots=RIM_SLOTS, rims=True)
def frustum_plane(frame_i: F1, size_i: F1, frame_j: F1, size_j: F1, points: F2) -> int:
    """Three points of each rim against the plane; the side lies on its two lowest points."""
    return solid_on_plane(frame_i, vector(size_i), vector(frame_j), axis(frame_j, 2), points)


@region("CYLINDER", "PLANE", whole=3.0)
def cylinder_plane_region(
    frame_i: F1, size_i: F1, frame_j: F1, size_j: F1, points: F2
) -> tuple[int, float]:
    """Three points of each rim, and the cut of the cylinder with the plane."""
    n, origin = axis(frame_j, 2), vector(frame_j)
    count = solid_on_plane(frame_i, cylinder_size(size_i), origin, n, points)
    return count, cylinder_cut(frame_i, size_i[0], size_i[1], origin, n)


@region("FRUSTUM", "PLANE", whole=3.0)
def frustum_plane_region(
    frame_i: F1, size_i: F1, frame_j: F1, size_j: F1, points: F2
) -> tuple[int, float]:
    """Three points of each rim, and the area of the ends below the plane."""
    n, origin = axis(frame_j, 2), vector(frame_j)
    count = solid_on_plane(frame_i, vector(size_i), origin, n, points)
    return count, frustum_ends(frame_i, size_i, origin, n)
