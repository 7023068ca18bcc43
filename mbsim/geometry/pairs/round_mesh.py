"""A cylinder, a frustum or an ellipsoid on a convex mesh: one point, where they overlap least.

All is in the mesh's axes. With n out of the mesh, far_M(n) its farthest corner and far_S(-n) the
solid's point that is lowest along n, the overlap f(n) = n . (far_M(n) - far_S(-n)) is least

* at the normal of a face of the mesh,
* on the arc between the normals of two faces, where far_M is any point of their edge,
* or between a corner and the solid.

A solid of revolution is crowned here (`geometry.crowned`), so it has one lowest point in every
direction, as an ellipsoid has: on an arc f' changes sign smoothly, and the point moves smoothly
from rim to rim where a flat end or a straight side lies. The force there is the slope of f: the
elastic energy depends on the pose alone.
"""

from __future__ import annotations

import math

from mbsim.core.arrays import F1, F2, V3
from mbsim.core.jitable import jitable
from mbsim.core.memory import floats_at
from mbsim.core.rotation import add, cross, dot, norm, scale, sub, vector
from mbsim.geometry.catalog import axis, pair, put_point
from mbsim.geometry.convex import (
    BOX,
    CROWNED,
    ELLIPSOID,
    Shape,
    between_round,
    far,
    point_in_solid,
)
from mbsim.geometry.crowned import bulge, far_crowned, outside, ways_out
from mbsim.geometry.mesh.merging import to_local
from mbsim.geometry.pairs.revolution import cylinder_size
from mbsim.geometry.polyhedron import corner, plane, to_global
from mbsim.geometry.rotor import lies_in, side_distance
from mbsim.model.hull import (
    AT_CORNERS,
    AT_EDGES,
    AT_LOOPS,
    AT_PLANES,
    AT_STARTS,
    CORNERS,
    EDGES,
    FACES,
)

#: Parts of an arc between which f' is looked at; rounds to where it is 0.
ARC, ROUNDS = 3, 100
#: Part of the solid's size that points which meet may be beside each other, along n: no lever arm.
#: An angle's rounding moves the point of a crowned solid by 1e-12 of its size.
NO_LEVER = 2e-12
#: Faces whose normals differ less are one flat side.
FLAT = 1e-9
#: Part of the solid's least size up to which a face that it lies over is the way out.
SHALLOW = 0.05

Way = tuple[float, V3]


@jitable
def lowest(solid: Shape, n: V3) -> V3:
    """Return the point of the solid that is lowest along n."""
    down = scale(-1.0, n)
    return far_crowned(solid, down) if solid[0] == CROWNED else far(solid, down)


@jitable
def beyond(solid: Shape, p: V3) -> float:
    """Return how far the solid's surface, as it is taken here, is outside of its point p."""
    return bulge(solid, p) if solid[0] == CROWNED else 0.0


@jitable
def highest_row(hull: F1, at: int, width: int, count: int, n: V3) -> int:
    """Return which row, of `count` that begin with a vector, has the one farthest along n.

    Rows are `width` numbers long, from `at` on: corners, or faces by their normals.
    """
    best, found = -math.inf, 0
    for k in range(count):
        height = dot(vector(hull, at + width * k), n)
        if height > best:
            best, found = height, k
    return found


@jitable
def high_corner(hull: F1, n: V3) -> V3:
    """Return the corner that is highest along n."""
    at = int(hull[AT_CORNERS])
    return vector(hull, at + 3 * highest_row(hull, at, 3, int(hull[CORNERS]), n))


@jitable
def better(solid: Shape, p: V3, n: V3, best: Way) -> Way:
    """Return the better of what is known and direction n, along which p is the mesh's highest."""
    low = lowest(solid, n)
    f = dot(n, sub(p, low)) + beyond(solid, low)
    return (f, n) if f < best[0] else best


@jitable
def least_face(hull: F1, solid: Shape) -> tuple[float, V3, int]:
    """Return (f, n, face) of the least overlap along the normals of the mesh's faces."""
    least, found, at = math.inf, 0, int(hull[AT_PLANES])
    for face in range(int(hull[FACES])):
        m = vector(hull, at + 4 * face)
        low = lowest(solid, m)
        f = hull[at + 4 * face + 3] - dot(m, low) + beyond(solid, low)
        if f < least:
            least, found = f, face
    return least, plane(hull, found), found


@jitable
def lies_over(hull: F1, face: int, p: V3, margin: float) -> bool:
    """Return whether p lies over a face, by `margin` from its edges."""
    m, loops = plane(hull, face), int(hull[AT_LOOPS])
    starts = int(hull[AT_STARTS]) + face
    first, last = int(hull[starts]), int(hull[starts + 1])
    a = corner(hull, hull[loops + 2 * (last - 1)])
    for at in range(first, last):
        b = corner(hull, hull[loops + 2 * at])
        inward = cross(m, sub(b, a))
        if dot(inward, sub(p, a)) < margin * norm(inward):
            return False
        a = b
    return True


@jitable
def arc_slope(solid: Shape, p: V3, n0: V3, across: V3, x: float) -> tuple[float, V3]:
    """Return f' at the angle x from n0 to `across`, and the direction there."""
    n = add(scale(math.cos(x), n0), scale(math.sin(x), across))
    turn = sub(scale(math.cos(x), across), scale(math.sin(x), n0))
    return dot(turn, sub(p, lowest(solid, n))), n


@jitable
def along_arc(solid: Shape, p: V3, n0: V3, n1: V3, best: Way) -> Way:
    """Return the better of what is known and the least f on the arc between two faces' normals."""
    cosine = dot(n0, n1)
    across = sub(n1, scale(cosine, n0))
    sine = norm(across)
    if sine < FLAT:
        return best
    across, part = scale(1.0 / sine, across), math.atan2(sine, cosine) / ARC
    low, _ = arc_slope(solid, p, n0, across, 0.0)
    close = NO_LEVER * max(solid[5][0], max(solid[5][1], solid[5][2]))
    for k in range(ARC):
        a, fa = k * part, low
        b = a + part
        fb, n = arc_slope(solid, p, n0, across, b)
        low = fb
        if not (fa < 0.0 and fb >= 0.0):
            continue
        side, halve = 0, False
        for _ in range(ROUNDS):
            # Illinois rule: an end that stays twice has half its weight. Where that did not halve
            # the rest, as at a flat side that f' passes all at once, the middle comes next
            width = b - a
            x = 0.5 * (a + b) if halve else (a * fb - b * fa) / (fb - fa)
            slope, n = arc_slope(solid, p, n0, across, x)
            if slope < 0.0:
                a, fa, fb = x, slope, 0.5 * fb if side < 0 else fb
                side = -1
            else:
                b, fb, fa = x, slope, 0.5 * fa if side > 0 else fa
                side = 1
            if abs(slope) < close or b - a < 4e-16:
                break
            halve = b - a > 0.5 * width
        best = better(solid, p, n, best)
    return best


@jitable
def at_rotor(hull: F1, solid: Shape, best: Way) -> Way:
    """Return the better of what is known and the least overlap of a crowned solid with corners.

    Of the corners outside the nearest one alone may part the shapes.
    """
    nearest, least = -1, math.inf
    for k in range(int(hull[CORNERS])):
        p = corner(hull, k)
        height = outside(solid, p)
        if height <= 0.0:
            for way in range(3):
                found, depth, n = ways_out(solid, p, way)
                if found and depth < best[0]:
                    best = better(solid, high_corner(hull, n), n, best)
        elif height < least:
            nearest, least = k, height
    if nearest >= 0:
        p = corner(hull, nearest)
        for way in range(3):
            found, _, n = ways_out(solid, p, way)
            if found:
                best = better(solid, high_corner(hull, n), n, best)
    return best


@jitable
def at_side(hull: F1, solid: Shape, best: Way) -> Way:
    """Return the better of what is known and the least overlap of corners with a straight side.

    Of the corners outside the nearest one alone may part the shapes.
    """
    nearest, least = -1, math.inf
    for k in range(int(hull[CORNERS])):
        p = corner(hull, k)
        if lies_in(solid, p, 0.0):
            n = scale(-1.0, side_distance(solid, p)[1])
            best = better(solid, high_corner(hull, n), n, best)
            continue
        distance = point_in_solid(solid[1], solid[4], solid[5], p)[0]
        if distance < least:
            nearest, least = k, distance
    if nearest >= 0:
        p = corner(hull, nearest)
        n = scale(-1.0, point_in_solid(solid[1], solid[4], solid[5], p)[1])
        best = better(solid, high_corner(hull, n), n, best)
    return best


@jitable
def unit_ball(solid: Shape, p: V3) -> V3:
    """Return a point where the ellipsoid is the unit ball."""
    d, size = sub(p, solid[1]), solid[5]
    return (dot(d, solid[2]) / size[0], dot(d, solid[3]) / size[1], dot(d, solid[4]) / size[2])


@jitable
def at_corners(hull: F1, solid: Shape, best: Way) -> Way:
    """Return the better of what is known and the least overlap of an ellipsoid with corners.

    A corner inside is found by Newton from what is known. Where none is, the ellipsoid's normal at
    the corner that is nearest in the space where it is a ball parts the shapes, if any does.
    """
    start, nearest, least = best[1], (0.0, 0.0, 0.0), math.inf
    for k in range(int(hull[CORNERS])):
        p = corner(hull, k)
        x = unit_ball(solid, p)
        square = dot(x, x)
        if square < 1.0:
            # a corner is a box without size
            point = (BOX, p, solid[2], solid[3], solid[4], (0.0, 0.0, 0.0))
            _, n = between_round(solid, point, start, 0.0)
            best = better(solid, high_corner(hull, n), n, best)
        elif square < least:
            nearest, least = x, square
    if 1.0 <= least < math.inf:
        size = solid[5]
        n = add(
            scale(nearest[0] / size[0], solid[2]),
            add(scale(nearest[1] / size[1], solid[3]), scale(nearest[2] / size[2], solid[4])),
        )
        n = scale(-1.0 / norm(n), n)
        best = better(solid, high_corner(hull, n), n, best)
    return best


@jitable
def least_overlap(hull: F1, solid: Shape) -> Way:
    """Return (f, n) of the least overlap; n is out of the mesh. Where f < 0 they are apart."""
    f, n, face = least_face(hull, solid)
    best = (f, n)
    size = solid[5]
    # the tip of a cone has no size
    thin = min(size[0] if size[0] > 0.0 else math.inf, min(size[1] if size[1] > 0.0 else math.inf,
               size[2]))  # fmt: skip
    if f < 0.0 or (f < SHALLOW * thin and lies_over(hull, face, lowest(solid, n), f)):
        return best
    if solid[0] == ELLIPSOID:
        best = at_corners(hull, solid, best)
    else:
        for k in range(2):
            m = scale(1.0 - 2.0 * k, solid[4])
            best = better(solid, high_corner(hull, m), m, best)
        if solid[0] == CROWNED:
            best = at_rotor(hull, solid, best)
        else:
            best = at_side(hull, solid, best)
    if best[0] < 0.0:
        return best
    at = int(hull[AT_EDGES])
    for k in range(int(hull[EDGES])):
        p = corner(hull, hull[at + 4 * k])
        n0, n1 = plane(hull, hull[at + 4 * k + 2]), plane(hull, hull[at + 4 * k + 3])
        best = along_arc(solid, p, n0, n1, best)
    return best


@jitable
def round_on_hull(kind: int, frame_i: F1, size: V3, frame_j: F1, size_j: F1, points: F2) -> int:
    """Write the one point of a solid I on a convex mesh J; apart, a bound of their distance."""
    hull = floats_at(size_j[0], size_j[1])
    centre = to_local(frame_j, sub(vector(frame_i), vector(frame_j)))
    x, y, z = axis(frame_i, 0), axis(frame_i, 1), axis(frame_i, 2)
    solid = (kind, centre, to_local(frame_j, x), to_local(frame_j, y), to_local(frame_j, z), size)
    f, n = least_overlap(hull, solid)
    p = lowest(solid, n)
    if f > 0.0:
        p = add(p, scale(0.5 * f - beyond(solid, p), n))
    p = add(vector(frame_j), to_global(frame_j, p))
    put_point(points[0], f, p, to_global(frame_j, n))
    return 1


@pair("CYLINDER", "MESH", slots=1)
def cylinder_mesh(frame_i: F1, size_i: F1, frame_j: F1, size_j: F1, points: F2) -> int:
    """The direction of least overlap with a convex mesh."""
    return round_on_hull(CROWNED, frame_i, cylinder_size(size_i), frame_j, size_j, points)


@pair("FRUSTUM", "MESH", slots=1)
def frustum_mesh(frame_i: F1, size_i: F1, frame_j: F1, size_j: F1, points: F2) -> int:
    """The direction of least overlap with a convex mesh."""
    return round_on_hull(CROWNED, frame_i, vector(size_i), frame_j, size_j, points)


@pair("ELLIPSOID", "MESH", slots=1)
def ellipsoid_mesh(frame_i: F1, size_i: F1, frame_j: F1, size_j: F1, points: F2) -> int:
    """The direction of least overlap with a convex mesh."""
    return round_on_hull(ELLIPSOID, frame_i, vector(size_i), frame_j, size_j, points)
