"""A cylinder, a frustum or an ellipsoid on a convex mesh: one point, where they overlap least.

All is in the mesh's axes. With n out of the mesh, far_M(n) its farthest corner and far_S(-n) the
solid's point that is lowest along n, the overlap f(n) = n . (far_M(n) - far_S(-n)) is least

* at the normal of a face of the mesh or of an end disc of the solid,
* on the arc between the normals of two faces, where far_M is any point of their edge,
* on the circle of the normals of a solid of revolution's side, against a corner,
* or between a corner and an ellipsoid.

On an arc f' changes sign there, smoothly or with a jump where an edge meets the straight side,
which has a closed form. The force at the points that meet is the slope of f: the elastic energy
depends on the pose alone.
"""

from __future__ import annotations

import math

import numpy as np

from mbsim.core.arrays import F1, F2, V3
from mbsim.core.jitable import jitable
from mbsim.core.memory import floats_at
from mbsim.core.rotation import add, any_tangent, cross, dot, norm, scale, sub, vector
from mbsim.geometry.catalog import axis, pair, put_point
from mbsim.geometry.convex import BOX, ELLIPSOID, ROTOR, Shape, between_round, far, slant
from mbsim.geometry.mesh.merging import to_local
from mbsim.geometry.pairs.revolution import cylinder_size
from mbsim.geometry.polyhedron import corner, plane, to_global
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

#: Parts of an arc, and of a circle, between which f' is looked at; rounds to where it is 0.
ARC, CIRCLE, ROUNDS = 3, 24, 20
#: Faces whose normals differ less are one flat side.
FLAT = 1e-9
#: Part of the solid's least size up to which a face that it lies over is the way out.
SHALLOW = 0.05
#: Corners are as high as each other within this part of the solid's size.
TIE = 1e-9
#: A lowest point that a tilt by this moves by more than `WIDE` of the solid's size is part of a
#: line or a disc; from a third of that on it begins to be one.
TILT, WIDE = 2e-3, 0.15

Way = tuple[float, V3]


@jitable
def lowest(solid: Shape, n: V3) -> V3:
    """Return the point of the solid that is lowest along n."""
    return far(solid, scale(-1.0, n))


@jitable
def high_corner(hull: F1, n: V3) -> V3:
    """Return the corner that is highest along n."""
    at, best, found = int(hull[AT_CORNERS]), -math.inf, (0.0, 0.0, 0.0)
    for k in range(int(hull[CORNERS])):
        p = vector(hull, at + 3 * k)
        if dot(p, n) > best:
            best, found = dot(p, n), p
    return found


@jitable
def better(solid: Shape, p: V3, n: V3, best: Way) -> Way:
    """Return the better of what is known and direction n, along which p is the mesh's highest."""
    f = dot(n, sub(p, lowest(solid, n)))
    return (f, n) if f < best[0] else best


@jitable
def least_face(hull: F1, solid: Shape) -> tuple[float, V3, int]:
    """Return (f, n, face) of the least overlap along the normals of the mesh's faces."""
    least, found, at = math.inf, 0, int(hull[AT_PLANES])
    for face in range(int(hull[FACES])):
        m = vector(hull, at + 4 * face)
        f = hull[at + 4 * face + 3] - dot(m, lowest(solid, m))
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
    across, width = scale(1.0 / sine, across), math.atan2(sine, cosine) / ARC
    low, _ = arc_slope(solid, p, n0, across, 0.0)
    for k in range(ARC):
        a, fa = k * width, low
        b = a + width
        fb, n = arc_slope(solid, p, n0, across, b)
        low = fb
        if not (fa < 0.0 and fb >= 0.0):
            continue
        side = 0
        for _ in range(ROUNDS):
            # Illinois rule: an end that stays twice has half its weight
            x = (a * fb - b * fa) / (fb - fa)
            slope, n = arc_slope(solid, p, n0, across, x)
            if slope < 0.0:
                a, fa, fb = x, slope, 0.5 * fb if side < 0 else fb
                side = -1
            else:
                b, fb, fa = x, slope, 0.5 * fa if side > 0 else fa
                side = 1
            if min(abs(slope), b - a) < 1e-16:
                break
        best = better(solid, p, n, best)
    return best


@jitable
def at_meetings(solid: Shape, p: V3, n0: V3, n1: V3, best: Way) -> Way:
    """Return the better of what is known and the normals that an edge and a straight side share.

    n = base +- w (e x a) with n.e = 0 and n.a that of the side, a the solid's axis, e the edge.
    """
    around, a, gamma = cross(n0, n1), solid[4], -slant(solid[5])
    size = norm(around)
    if size < FLAT:
        return best
    e = scale(1.0 / size, around)
    both = dot(e, a)
    square = 1.0 - both * both
    if square < 1e-12 or gamma * gamma >= square:
        return best
    base = scale(gamma / square, sub(a, scale(both, e)))
    w = scale(math.sqrt((1.0 - gamma * gamma / square) / square), cross(e, a))
    for k in range(2):
        n = add(base, w) if k == 0 else sub(base, w)
        # on the arc
        if dot(cross(n, n1), around) >= 0.0 and dot(cross(n0, n), around) >= 0.0:
            best = better(solid, p, n, best)
    return best


@jitable
def side_slope(hull: F1, solid: Shape, x: float) -> tuple[float, V3, V3]:
    """Return f' at an angle of the circle of the side's normals, the direction, the corner."""
    gamma = slant(solid[5])
    k = math.sqrt(1.0 - gamma * gamma)
    c, s = math.cos(x), math.sin(x)
    out = add(scale(c, solid[2]), scale(s, solid[3]))
    n = scale(-1.0, add(scale(gamma, solid[4]), scale(k, out)))
    turn = scale(k, sub(scale(s, solid[2]), scale(c, solid[3])))
    p = high_corner(hull, n)
    return dot(turn, sub(p, solid[1])), n, p


@jitable
def along_side(hull: F1, solid: Shape, best: Way) -> Way:
    """Return the better of what is known and the least f on the circle of the side's normals."""
    low, n, p = side_slope(hull, solid, 0.0)
    width = 2.0 * math.pi / CIRCLE
    for k in range(CIRCLE):
        a, fa = k * width, low
        b = a + width
        fb, n, p = side_slope(hull, solid, b)
        low = fb
        if not (fa < 0.0 and fb >= 0.0):
            continue
        side = 0
        for _ in range(ROUNDS):
            x = (a * fb - b * fa) / (fb - fa)
            slope, n, p = side_slope(hull, solid, x)
            if slope < 0.0:
                a, fa, fb = x, slope, 0.5 * fb if side < 0 else fb
                side = -1
            else:
                b, fb, fa = x, slope, 0.5 * fa if side > 0 else fa
                side = 1
            if min(abs(slope), b - a) < 1e-16:
                break
        best = better(solid, p, n, best)
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
    if solid[0] == ROTOR:
        for k in range(2):
            m = scale(1.0 - 2.0 * k, solid[4])
            best = better(solid, high_corner(hull, m), m, best)
    else:
        best = at_corners(hull, solid, best)
    if best[0] < 0.0:
        return best
    at = int(hull[AT_EDGES])
    for k in range(int(hull[EDGES])):
        p = corner(hull, hull[at + 4 * k])
        n0, n1 = plane(hull, hull[at + 4 * k + 2]), plane(hull, hull[at + 4 * k + 3])
        best = along_arc(solid, p, n0, n1, best)
        if solid[0] == ROTOR:
            best = at_meetings(solid, p, n0, n1, best)
    if solid[0] == ROTOR and best[0] >= 0.0:
        best = along_side(hull, solid, best)
    return best


@jitable
def tilted(n: V3, t: V3, s: V3, k: int) -> V3:
    """Return n tilted to the k-th of eight sides."""
    angle = 0.25 * math.pi * k
    n = add(n, add(scale(TILT * math.cos(angle), t), scale(TILT * math.sin(angle), s)))
    return scale(1.0 / norm(n), n)


@jitable
def crossing(solid: Shape, p: V3, q: V3, n: V3) -> tuple[bool, V3]:
    """Return (found, where the side's line that is down along n crosses edge p-q, seen along n).

    Not found where an end is down, or the two are parallel.
    """
    a, (bottom, top, half) = solid[4], solid[5]
    w = sub(scale(dot(n, a), a), n)
    length = norm(w)
    if solid[0] != ROTOR or length < 0.1:
        return False, p
    w = scale(1.0 / length, w)
    low = add(solid[1], sub(scale(bottom, w), scale(half, a)))
    way = add(scale(2.0 * half, a), scale(top - bottom, w))
    across = cross(sub(q, p), n)
    rise = dot(way, across)
    if abs(rise) < 1e-6 * norm(way) * norm(across):
        return False, p
    part = min(1.0, max(0.0, dot(sub(p, low), across) / rise))
    return True, add(low, scale(part, way))


@jitable
def common_middle(
    hull: F1, solid: Shape, f: float, n: V3, t: V3, s: V3, top: float
) -> tuple[V3, bool]:
    """Return the middle of what lies on each other along n, and whether it is where lines cross.

    `top` is the height of the mesh's highest corner, t and s are square to n. Of the solid's lowest
    points those count that lie over the mesh's side, of its corners those under the solid.
    """
    size = max(solid[5][0], max(solid[5][1], solid[5][2]))
    box = np.array([[math.inf, -math.inf], [math.inf, -math.inf]])
    ends, ties, many, heights, weights = (top, top, top), 0, 0, 0.0, 0.0
    p, q = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    for k in range(int(hull[CORNERS])):
        x = corner(hull, k)
        height = dot(x, n)
        if height >= top - TIE * size:
            ties += 1
            p, q = q, x
        weight = height - top + 0.5 * f
        if weight > 0.0:
            many, weights, heights = many + 1, weights + weight, heights + weight * height
            ends = x
            for c in range(2):
                along = dot(x, t if c == 0 else s)
                box[c, 0], box[c, 1] = min(box[c, 0], along), max(box[c, 1], along)
    if ties == 2:
        found, place = crossing(solid, p, q, n)
        if found:
            return place, True
    if many == 1:
        return ends, False
    least = math.inf
    for k in range(8):
        least = min(least, dot(lowest(solid, tilted(n, t, s, k)), n))
    low = np.array([[math.inf, -math.inf], [math.inf, -math.inf]])
    for k in range(8):
        x = lowest(solid, tilted(n, t, s, k))
        if dot(x, n) > least + 0.5 * f:
            continue
        for c in range(2):
            along = dot(x, t if c == 0 else s)
            low[c, 0], low[c, 1] = min(low[c, 0], along), max(low[c, 1], along)
    u = 0.5 * (max(box[0, 0], low[0, 0]) + min(box[0, 1], low[0, 1]))
    v = 0.5 * (max(box[1, 0], low[1, 0]) + min(box[1, 1], low[1, 1]))
    return add(scale(heights / weights, n), add(scale(u, t), scale(v, s))), False


@jitable
def touching_point(hull: F1, solid: Shape, f: float, n: V3) -> V3:
    """Return the middle of the points that meet along n.

    One of both shapes touches with a point there, but for lines and flat sides on each other: then
    the middle of what they have in common, by how deep it is.
    """
    low, t = lowest(solid, n), any_tangent(n)
    s = cross(n, t)
    wide, size = 0.0, max(solid[5][0], max(solid[5][1], solid[5][2]))
    for k in range(8):
        wide = max(wide, norm(sub(lowest(solid, tilted(n, t, s, k)), low)) / size)
    # 1 where the solid has one lowest point, 0 where a line or a disc is down
    pointed = 1.0 - min(1.0, max(0.0, (wide - WIDE / 3.0) / (WIDE - WIDE / 3.0)))
    if pointed == 1.0:
        return add(low, scale(0.5 * f, n))
    top = dot(high_corner(hull, n), n)
    common, crossed = common_middle(hull, solid, f, n, t, s, top)
    if crossed:
        return add(common, scale(0.5 * f, n))
    both = add(scale(pointed, low), scale(1.0 - pointed, common))
    return add(both, scale(dot(low, n) + 0.5 * f - dot(both, n), n))


@jitable
def round_on_hull(kind: int, frame_i: F1, size: V3, frame_j: F1, size_j: F1, points: F2) -> int:
    """Write the one point of a solid I on a convex mesh J; apart, a bound of their distance."""
    hull = floats_at(size_j[0], size_j[1])
    centre = to_local(frame_j, sub(vector(frame_i), vector(frame_j)))
    x, y, z = axis(frame_i, 0), axis(frame_i, 1), axis(frame_i, 2)
    solid = (kind, centre, to_local(frame_j, x), to_local(frame_j, y), to_local(frame_j, z), size)
    f, n = least_overlap(hull, solid)
    p = touching_point(hull, solid, f, n) if f > 0.0 else lowest(solid, n)
    p = add(vector(frame_j), to_global(frame_j, p))
    put_point(points[0], f, p, to_global(frame_j, n))
    return 1


@pair("CYLINDER", "MESH", slots=1)
def cylinder_mesh(frame_i: F1, size_i: F1, frame_j: F1, size_j: F1, points: F2) -> int:
    """The direction of least overlap with a convex mesh."""
    return round_on_hull(ROTOR, frame_i, cylinder_size(size_i), frame_j, size_j, points)


@pair("FRUSTUM", "MESH", slots=1)
def frustum_mesh(frame_i: F1, size_i: F1, frame_j: F1, size_j: F1, points: F2) -> int:
    """The direction of least overlap with a convex mesh."""
    return round_on_hull(ROTOR, frame_i, vector(size_i), frame_j, size_j, points)


@pair("ELLIPSOID", "MESH", slots=1)
def ellipsoid_mesh(frame_i: F1, size_i: F1, frame_j: F1, size_j: F1, points: F2) -> int:
    """The direction of least overlap with a convex mesh."""
    return round_on_hull(ELLIPSOID, frame_i, vector(size_i), frame_j, size_j, points)
