"""A solid of revolution whose flat ends and straight side bulge a little, as seen by a mesh.

Flat on flat has no one lowest point: with a tilt of nothing it jumps from rim to rim, and a force
that is moved gently between them is no slope of an energy. So the solid is taken as one that is
crowned, as rollers are: of its points y the one counts in a direction d that is farthest of

    d . (y - c) + (s - |y - c|^2) / 2 R

with c the point of the axis from which both rims are as far, s the square of that distance, and R
the size over `CROWN`. That is the point which is nearest to c + R d. In a plane through the axis
each line has become an arc of radius R: rims are where they were, the middle of an end of radius r
is out by r^2 / 2 R. A turn by `CROWN` moves the point by about the size of the solid.
"""

from __future__ import annotations

import math

from mbsim.core.arrays import V2, V3
from mbsim.core.jitable import jitable
from mbsim.core.rotation import add, any_tangent, dot, norm, scale, sub
from mbsim.geometry.convex import Shape

#: The solid's size over the radius of what bulges.
CROWN = 1e-4
#: Rounds that find the point of an arc which a corner is nearest to: each gains a factor depth / R.
ROUNDS = 3

#: A straight part of the profile: a point of it, its direction, its length, its outward normal; in
#: coordinates away from the axis and along it, from c.
Line = tuple[V2, V2, float, V2]


@jitable
def arcs(size: V3) -> V3:
    """Return how far along the axis c is, the radius R of what bulges, and s [L, L, L^2]."""
    bottom, top, half = size
    at = (top - bottom) * (top + bottom) / (4.0 * half)
    # a frustum that is flat has c far away
    radius = max(max(half, abs(at)), max(bottom, top)) / CROWN
    return at, radius, bottom * bottom + (half + at) ** 2


@jitable
def nearest_of_profile(size: V3, x: float, z: float) -> V2:
    """Return the point of the profile that is nearest to a point (x, z) far outside, x >= 0."""
    bottom, top, half = size
    if z > half and x < top:
        return x, half
    if z < -half and x < bottom:
        return x, -half
    dx, dz = top - bottom, 2.0 * half
    part = ((x - bottom) * dx + (z + half) * dz) / (dx * dx + dz * dz)
    part = min(1.0, max(0.0, part))
    return bottom + part * dx, part * dz - half


@jitable
def far_crowned(solid: Shape, d: V3) -> V3:
    """Return the point of the solid that is farthest in the unit direction d, as it is crowned."""
    _, centre, x, y, z, size = solid
    a, b = dot(d, x), dot(d, y)
    t, (at, R, _) = math.sqrt(a * a + b * b), arcs(size)
    r, h = nearest_of_profile(size, R * t, at + R * dot(d, z))
    r = r / t if t > 1e-300 else 0.0
    return add(centre, add(scale(r * a, x), add(scale(r * b, y), scale(h, z))))


@jitable
def bulge(solid: Shape, p: V3) -> float:
    """Return how far the crowned surface is outside of a point p of the solid's own."""
    at, radius, square = arcs(solid[5])
    d = sub(p, add(solid[1], scale(at, solid[4])))
    return (square - dot(d, d)) / (2.0 * radius)


@jitable
def line_of(size: V3, k: int) -> Line:
    """Return a part of the profile, from c: 0 the bottom end, 1 the top end, else the side."""
    bottom, top, half = size
    at = arcs(size)[0]
    if k == 0:
        return (0.0, -half - at), (1.0, 0.0), bottom, (0.0, -1.0)
    if k == 1:
        return (0.0, half - at), (1.0, 0.0), top, (0.0, 1.0)
    dx, dz = top - bottom, 2.0 * half
    length = math.sqrt(dx * dx + dz * dz)
    dx, dz = dx / length, dz / length
    return (bottom, -half - at), (dx, dz), length, (dz, -dx)


@jitable
def in_profile(solid: Shape, p: V3) -> tuple[float, float, V3]:
    """Return a point's distance from the axis, how far along it it is from c, the way outward."""
    d = sub(p, add(solid[1], scale(arcs(solid[5])[0], solid[4])))
    z = dot(d, solid[4])
    across = sub(d, scale(z, solid[4]))
    x = norm(across)
    return x, z, scale(1.0 / x, across) if x > 1e-300 else any_tangent(solid[4])


@jitable
def outside(solid: Shape, p: V3) -> float:
    """Return how far p is outside of the solid with its bulge; <= 0 where it may be inside."""
    x, z, _ = in_profile(solid, p)
    height = -math.inf
    for k in range(3):
        (x0, z0), _, _, (nx, nz) = line_of(solid[5], k)
        height = max(height, (x - x0) * nx + (z - z0) * nz)
    _, radius, square = arcs(solid[5])
    return height - square / (2.0 * radius)


@jitable
def ways_out(solid: Shape, p: V3, k: int) -> tuple[bool, float, V3]:
    """Return (found, depth, unit way inward) of point p under a part of the solid (`line_of`).

    With a, b the point along a line and outward from it, both from c, the arc's normal over y has
    the slope y / R; so y follows from the depth t, and t from y.
    """
    x, z, out = in_profile(solid, p)
    (x0, z0), (dx, dz), length, (nx, nz) = line_of(solid[5], k)
    _, R, square = arcs(solid[5])
    start, height = x0 * dx + z0 * dz, x0 * nx + z0 * nz
    a, b, t, y, slope = x * dx + z * dz, x * nx + z * nz, 0.0, 0.0, 0.0
    for _ in range(ROUNDS):
        y = a / (1.0 - t / R)
        slope = y / R
        # from p along the normal to the line, and on to the arc
        t = (height - b) / math.sqrt(1.0 - slope * slope)
    t += (square - y * y - height * height) / (2.0 * R)
    found = start <= y <= start + length
    up = math.sqrt(1.0 - slope * slope)
    wx, wz = slope * dx + up * nx, slope * dz + up * nz
    return found, t, scale(-1.0, add(scale(wx, out), scale(wz, solid[4])))
