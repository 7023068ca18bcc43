"""An ellipsoid on a plane, a sphere, an ellipsoid, a box, a cylinder, a frustum: one point."""

from __future__ import annotations

from mbsim.core.arrays import F1, F2, V3
from mbsim.core.jitable import jitable
from mbsim.core.rotation import add, dot, norm, scale, sub, vector
from mbsim.geometry.catalog import axis, pair, put_point
from mbsim.geometry.convex import (
    BOX,
    ELLIPSOID,
    ROTOR,
    Shape,
    along_circle,
    between_round,
    far,
    flat,
    line_of_centres,
    overlap,
    placed,
    shallow,
    slant,
)
from mbsim.geometry.pairs.revolution import cylinder_size


@pair("ELLIPSOID", "PLANE", slots=1)
def ellipsoid_plane(frame_i: F1, size_i: F1, frame_j: F1, size_j: F1, points: F2) -> int:
    """The lowest point of the ellipsoid, where its normal is that of the plane."""
    n = axis(frame_j, 2)
    low = far(placed(ELLIPSOID, frame_i, vector(size_i)), scale(-1.0, n))
    depth = -dot(sub(low, vector(frame_j)), n)
    put_point(points[0], depth, add(low, scale(0.5 * depth, n)), n)
    return 1


@jitable
def put_under(i: Shape, f: float, n: V3, points: F2) -> int:
    """Write the one point below ellipsoid I, whose lowest point against n is unique."""
    low = far(i, scale(-1.0, n))
    put_point(points[0], f, add(low, scale(0.5 * f, n)), n)
    return 1


@jitable
def first_normal(i: Shape, j: Shape) -> V3:
    """Return the direction of (A_I^2 + A_J^2)^-1 c, the normal of the ellipsoid of that sum at c.

    c runs between the centres. It is exact for two spheres, and for two alike and alike turned.
    """
    apart = sub(i[1], j[1])
    if norm(apart) == 0.0:
        return (0.0, 0.0, 1.0)
    m00, m01, m02, m11, m12, m22 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for side in range(2):
        shape = i if side == 0 else j
        for k in range(3):
            a = shape[2] if k == 0 else (shape[3] if k == 1 else shape[4])
            w = shape[5][k] * shape[5][k]
            m00 += w * a[0] * a[0]
            m01 += w * a[0] * a[1]
            m02 += w * a[0] * a[2]
            m11 += w * a[1] * a[1]
            m12 += w * a[1] * a[2]
            m22 += w * a[2] * a[2]
    # the adjugate is the inverse up to a positive factor
    n = (
        (m11 * m22 - m12 * m12) * apart[0]
        + (m02 * m12 - m01 * m22) * apart[1]
        + (m01 * m12 - m02 * m11) * apart[2],
        (m02 * m12 - m01 * m22) * apart[0]
        + (m00 * m22 - m02 * m02) * apart[1]
        + (m01 * m02 - m00 * m12) * apart[2],
        (m01 * m12 - m02 * m11) * apart[0]
        + (m01 * m02 - m00 * m12) * apart[1]
        + (m00 * m11 - m01 * m01) * apart[2],
    )
    return scale(1.0 / norm(n), n)


@jitable
def smallest(size: V3) -> float:
    """Return the least of three lengths."""
    return min(size[0], min(size[1], size[2]))


@jitable
def round_on_round(i: Shape, j: Shape, points: F2) -> int:
    """Write the point of least overlap of two ellipsoids."""
    # beyond a tenth of the shape a bound of the distance is enough
    f, n = between_round(i, j, first_normal(i, j), 0.1 * smallest(i[5]))
    if f > 0.0:
        # deep, Newton may stand in a side valley: the way out along the thin axes
        for k in range(6):
            shape = i if k < 3 else j
            a = shape[2] if k % 3 == 0 else (shape[3] if k % 3 == 1 else shape[4])
            a = scale(1.0 if dot(a, n) >= 0.0 else -1.0, a)
            g, _ = overlap(i, j, a)
            if g < f:
                f, n = between_round(i, j, a, 0.0)
    return put_under(i, f, n, points)


@pair("ELLIPSOID", "ELLIPSOID", slots=1)
def ellipsoid_ellipsoid(frame_i: F1, size_i: F1, frame_j: F1, size_j: F1, points: F2) -> int:
    """The direction of least overlap by Newton, from a start that is exact for spheres."""
    i = placed(ELLIPSOID, frame_i, vector(size_i))
    return round_on_round(i, placed(ELLIPSOID, frame_j, vector(size_j)), points)


@pair("ELLIPSOID", "SPHERE", slots=1)
def ellipsoid_sphere(frame_i: F1, size_i: F1, frame_j: F1, size_j: F1, points: F2) -> int:
    """As two ellipsoids: a sphere has three equal semi-axes."""
    r = size_j[0]
    i = placed(ELLIPSOID, frame_i, vector(size_i))
    return round_on_round(i, placed(ELLIPSOID, frame_j, (r, r, r)), points)


@jitable
def over_face(i: Shape, j: Shape) -> tuple[float, V3, bool]:
    """Return (f, n, found): whether the lowest point of I lies over a face of box J."""
    f, n = flat(i, j, j, 1.0, 1e300, (0.0, 0.0, 1.0))
    d = sub(far(i, scale(-1.0, n)), j[1])
    inside = 0
    for k in range(3):
        a = j[2] if k == 0 else (j[3] if k == 1 else j[4])
        if abs(dot(a, n)) > 0.5 or abs(dot(d, a)) <= j[5][k] - max(f, 0.0):
            inside += 1
    return f, n, inside == 3 and f < shallow(i, j)


@pair("ELLIPSOID", "BOX", slots=1)
def ellipsoid_box(frame_i: F1, size_i: F1, frame_j: F1, size_j: F1, points: F2) -> int:
    """Over a face the face's normal; else the least over edges and corners."""
    i = placed(ELLIPSOID, frame_i, vector(size_i))
    j = placed(BOX, frame_j, vector(size_j))
    f, n, found = over_face(i, j)
    if found or f < -0.1 * smallest(i[5]):
        return put_under(i, f, n, points)
    start = n
    for k in range(3):
        edge = j[2] if k == 0 else (j[3] if k == 1 else j[4])
        f, n = along_circle(i, j, edge, 0.0, f, n)
    # against a corner; from the best edge and from the line of centres
    g, m = between_round(i, j, n, 0.1 * smallest(i[5]))
    if g < f:
        f, n = g, m
    g, m = between_round(i, j, line_of_centres(i, j), 0.1 * smallest(i[5]))
    if g < f:
        f, n = g, m
    g, m = between_round(i, j, start, 0.1 * smallest(i[5]))
    if g < f:
        f, n = g, m
    return put_under(i, f, n, points)


@jitable
def ellipsoid_on_solid(i: Shape, j: Shape, points: F2) -> int:
    """Write the point of an ellipsoid on a solid of revolution: ends, straight side, rims."""
    f, n = flat(i, j, j, 1.0, 1e300, (0.0, 0.0, 1.0))
    limit = 0.1 * smallest(i[5])
    if f < -limit:
        return put_under(i, f, n, points)
    start = n
    centres = line_of_centres(i, j)
    if 0.0 < f < shallow(i, j):
        side, m = along_circle(i, j, j[4], slant(j[5]), f, n)
    else:
        side, m = along_circle(i, j, j[4], slant(j[5]), 1e300, n)
    # the normals of a rim lie between those of the end and of the side
    between = add(start, m)
    if side < f:
        f, n = side, m
    between = scale(1.0 / max(norm(between), 1e-9), between)
    for k in range(3):
        g, m = between_round(i, j, n if k == 0 else (centres if k == 1 else between), limit)
        if g < f:
            f, n = g, m
    return put_under(i, f, n, points)


@pair("ELLIPSOID", "CYLINDER", slots=1)
def ellipsoid_cylinder(frame_i: F1, size_i: F1, frame_j: F1, size_j: F1, points: F2) -> int:
    """The least overlap with ends, side and rims of the cylinder."""
    i = placed(ELLIPSOID, frame_i, vector(size_i))
    return ellipsoid_on_solid(i, placed(ROTOR, frame_j, cylinder_size(size_j)), points)


@pair("ELLIPSOID", "FRUSTUM", slots=1)
def ellipsoid_frustum(frame_i: F1, size_i: F1, frame_j: F1, size_j: F1, points: F2) -> int:
    """The least overlap with ends, side and rims of the frustum."""
    i = placed(ELLIPSOID, frame_i, vector(size_i))
    return ellipsoid_on_solid(i, placed(ROTOR, frame_j, vector(size_j)), points)
