"""One incident for all that a pair touches with: what its points sum up to, and the area.

The rows of such a pair (`contact_points="REGION"`) are the incident, the area, then the points
that the pair has else. With d_i the depth of a point, w_i its weight and S the weights of a face
that lies flat (`whole`),

    depth^2 = sum w_i d_i^2 / S         place = sum w_i d_i p_i / sum w_i d_i
    force   = law(depth) sum w_i d_i / depth

over points with d_i > 0. Its elastic energy is S U(depth), so force and place follow from a
potential: what a tilt moves the place by, the torque of the points does too. Where weights turn
with the shapes (`geometry.crossing`), depths do, or normals differ, a couple is left, for a unit of
the law's force. Of a linear law force and torque are those of the points in every pose; of others
they are where the depth is even. Damping has the rate of the place, which tilting hardly moves;
what the points' dampers do against tilting is a couple (`contact.forces.tilting`) with the moments
of their parts of the force about the place. From a face over an edge to a corner nothing jumps, for
the points do not.

The area is that of the cut of the shape with the plane it touches, or of the common part of two
faces, as far as they overlap: closed forms.
"""

from __future__ import annotations

import math

import numpy as np

from mbsim.core.arrays import F1, F2, V3
from mbsim.core.jitable import jitable
from mbsim.core.rotation import add, any_tangent, cross, dot, norm, scale, sub, vector
from mbsim.geometry.catalog import (
    AREA,
    AT_DEPTH,
    AT_NORMAL,
    AT_POINT,
    AT_WEIGHT,
    COUPLE,
    COUPLE_OF_FORCE,
    MOMENT_XX,
    MOMENT_XY,
    MOMENT_YY,
    POINT,
    REGION_ROWS,
    axis,
    plane_axes,
    put_couple_of_force,
    put_point,
)
from mbsim.geometry.polygon import TAG, X, Y, clip

#: A cut's width along a cylinder's radius, as a part of it, below which the cylinder lies.
_LYING = 1e-9
#: A cut that is narrow, as a part of its distance to the cylinder's side.
_NARROW = 1e-3


@jitable
def sum_points(rows: F2, whole: float, area: float) -> None:
    """Write the incident and its area before the points that it stands for.

    Parameters
    ----------
    rows : ndarray, shape (REGION_ROWS + n, POINT)
        The points are in the last n.
    whole : float
        Shares of a face that lies flat.
    area : float
        Of the contact, seen along the normal [L^2].
    """
    square, weight, deepest = 0.0, 0.0, REGION_ROWS
    p, push, couple = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    for k in range(REGION_ROWS, len(rows)):
        depth = rows[k, AT_DEPTH]
        if depth > rows[deepest, AT_DEPTH]:
            deepest = k
        if depth > 0.0:
            w = rows[k, AT_WEIGHT] * depth
            square += w * depth
            weight += w
            p = add(p, scale(w, vector(rows[k, AT_POINT:])))
            push = add(push, scale(w, vector(rows[k, AT_NORMAL:])))
            couple = add(couple, scale(0.5 * depth * depth, vector(rows[k, COUPLE:])))
            couple = add(couple, scale(depth, vector(rows[k, COUPLE_OF_FORCE:])))
    if square <= 0.0:
        for c in range(POINT):
            rows[0, c] = rows[1, c] = rows[deepest, c]
        rows[1, AREA] = 0.0
        return
    p = scale(1.0 / weight, p)
    force = norm(push)
    n = scale(1.0 / force, push)
    # where normals differ the forces may have a torque about p; a force along n has none there
    torque = (0.0, 0.0, 0.0)
    for k in range(REGION_ROWS, len(rows)):
        if rows[k, AT_DEPTH] > 0.0:
            part = scale(rows[k, AT_WEIGHT] * rows[k, AT_DEPTH], vector(rows[k, AT_NORMAL:]))
            torque = add(torque, cross(sub(vector(rows[k, AT_POINT:]), p), part))
    p = add(p, scale(1.0 / force, cross(n, torque)))
    depth = math.sqrt(square / whole)
    put_point(rows[0], depth, p, n, force / depth)
    # where weights turn with the shapes, and what the place cannot take
    couple = add(couple, scale(dot(torque, n), n))
    put_couple_of_force(rows[0], scale(1.0 / depth, couple))
    put_point(rows[1], 0.0, (0.0, 0.0, 0.0), n, 0.0)
    rows[1, AREA] = area
    x, y = plane_axes(n)
    for k in range(REGION_ROWS, len(rows)):
        if rows[k, AT_DEPTH] > 0.0:
            part, q = (
                rows[k, AT_WEIGHT] * rows[k, AT_DEPTH] / depth,
                sub(vector(rows[k, AT_POINT:]), p),
            )
            a, b = dot(q, x), dot(q, y)
            rows[1, MOMENT_XX] += part * a * a
            rows[1, MOMENT_XY] += part * a * b
            rows[1, MOMENT_YY] += part * b * b


@jitable
def _signs(k: int, sign: float, corner: int) -> V3:
    """Return the signs along x, y, z of a corner of a box's face, round to the left for sign 1.

    The face has the normal sign times axis k; its corners are (+, +), (-, +), (-, -), (+, -) of
    the two axes after k.
    """
    s1 = 1.0 if corner == 0 or corner == 3 else -1.0
    s2 = 1.0 if corner < 2 else -1.0
    if k == 0:
        return (sign, s1, s2)
    return (s2, sign, s1) if k == 1 else (s1, s2, sign)


@jitable
def box_cut(frame: F1, half: F1, origin: V3, n: V3) -> float:
    """Return the area of the cut of a box with a plane.

    Every face that the plane crosses has one side of the cut, from where its border comes up
    through the plane to where it goes down again.
    """
    x, y, z = (
        scale(half[0], axis(frame, 0)),
        scale(half[1], axis(frame, 1)),
        scale(half[2], axis(frame, 2)),
    )
    u = any_tangent(n)
    v = cross(n, u)
    height, rise = dot(sub(vector(frame), origin), n), (dot(x, n), dot(y, n), dot(z, n))
    total = 0.0
    for face in range(6):
        k, sign = face // 2, 1.0 if face % 2 == 0 else -1.0
        up_x, up_y, down_x, down_y = 0.0, 0.0, 0.0, 0.0
        for corner in range(4):
            s, t = _signs(k, sign, corner), _signs(k, sign, (corner + 1) % 4)
            low, high = height + dot(s, rise), height + dot(t, rise)
            if (low < 0.0) == (high < 0.0):
                continue
            part = low / (low - high)
            q = add(s, scale(part, sub(t, s)))
            q = add(scale(q[0], x), add(scale(q[1], y), scale(q[2], z)))
            if low < 0.0:
                up_x, up_y = dot(q, u), dot(q, v)
            else:
                down_x, down_y = dot(q, u), dot(q, v)
        total += 0.5 * sign * (up_x * down_y - up_y * down_x)
    return abs(total)


@jitable
def disc_beyond(x: float, r: float) -> float:
    """Return the area of a disc of radius r beyond the chord at distance x of its centre."""
    if x >= r:
        return 0.0
    if x <= -r:
        return math.pi * r * r
    half = math.sqrt((r - x) * (r + x))
    return r * r * math.atan2(half, x) - x * half


@jitable
def chord(x: float, r: float) -> float:
    """Return the length of the chord of a disc at distance x of its centre."""
    return 2.0 * math.sqrt(max(0.0, (r - x) * (r + x)))


@jitable
def cylinder_cut(frame: F1, r: float, half: float, origin: V3, n: V3) -> float:
    """Return the area of the cut of a cylinder with a plane: of an ellipse, between both ends.

    Along the axis it is the part of a disc between two chords.
    """
    a = axis(frame, 2)
    c = abs(dot(a, n))
    s = norm(cross(a, n))
    height = dot(sub(vector(frame), origin), n)
    if abs(height) >= half * c + r * s:
        return 0.0
    if s == 0.0:
        return math.pi * r * r
    first, middle, last = (-height - half * c) / s, -height / s, (-height + half * c) / s
    if last - first < max(_LYING * r, _NARROW * min(r - last, r + first)):
        # two areas that differ little: Simpson's rule for the chords between
        chords = chord(first, r) + 4.0 * chord(middle, r) + chord(last, r)
        return half / (3.0 * s) * chords
    return (disc_beyond(first, r) - disc_beyond(last, r)) / c


@jitable
def disc_below(centre: V3, o: V3, r: float, origin: V3, n: V3) -> float:
    """Return the area of the part of a disc with normal o below a plane, seen along n."""
    s = norm(cross(o, n))
    height = dot(sub(centre, origin), n)
    if height >= r * s:
        return 0.0
    whole = math.pi * r * r
    above = disc_beyond(-height / s, r) if height > -r * s else 0.0
    return abs(dot(o, n)) * (whole - above)


@jitable
def frustum_ends(frame: F1, size: F1, origin: V3, n: V3) -> float:
    """Return the area of those parts of a frustum's ends that face a plane from below it."""
    a, total = axis(frame, 2), 0.0
    for end in range(2):
        o = a if end == 1 else scale(-1.0, a)
        if dot(o, n) < 0.0:
            centre = add(vector(frame), scale(size[2], o))
            total += disc_below(centre, o, size[end], origin, n)
    return total


@jitable
def polygon_area(polygon: F2, count: int) -> float:
    """Return the area of a polygon, positive where it goes round to the left."""
    total = 0.0
    for k in range(count):
        after = k + 1 if k + 1 < count else 0
        total += polygon[k, X] * polygon[after, Y] - polygon[k, Y] * polygon[after, X]
    return 0.5 * total


@jitable
def _sector(ax: float, ay: float, bx: float, by: float, r: float) -> float:
    """Return the area of the sector of a disc from a round to b."""
    return 0.5 * r * r * math.atan2(ax * by - ay * bx, ax * bx + ay * by)


@jitable
def _under_edge(ax: float, ay: float, bx: float, by: float, r: float) -> float:
    """Return the area of the part of the triangle 0, a, b that lies in the disc around 0."""
    dx, dy = bx - ax, by - ay
    aa, ab = dx * dx + dy * dy, ax * dx + ay * dy
    root = ab * ab - aa * (ax * ax + ay * ay - r * r)
    if aa == 0.0 or root <= 0.0:
        return _sector(ax, ay, bx, by, r)
    root = math.sqrt(root)
    first, last = (-ab - root) / aa, (root - ab) / aa
    if first >= 1.0 or last <= 0.0:
        return _sector(ax, ay, bx, by, r)
    first, last = max(0.0, first), min(1.0, last)
    px, py, qx, qy = ax + first * dx, ay + first * dy, ax + last * dx, ay + last * dy
    inner = 0.5 * (px * qy - py * qx)
    return _sector(ax, ay, px, py, r) + inner + _sector(qx, qy, bx, by, r)


@jitable
def disc_in_polygon(polygon: F2, count: int, r: float) -> float:
    """Return the area that a convex polygon and the disc of radius r around 0 have in common."""
    total = 0.0
    for k in range(count):
        after = k + 1 if k + 1 < count else 0
        total += _under_edge(polygon[k, X], polygon[k, Y], polygon[after, X], polygon[after, Y], r)
    return abs(total)


@jitable
def put_rectangle(
    polygon: F2, face: tuple[V3, V3, V3, V3], origin: V3, u: V3, v: V3, way: V3
) -> None:
    """Write the corners of a rectangle in the axes u, v of a plane, seen along `way`.

    `face` is its centre, its half edges and its unit normal.
    """
    centre, a, b, _ = face
    o, d = cross(u, v), sub(centre, origin)
    for k in range(4):
        p = add(d, scale(1.0 if k == 0 or k == 3 else -1.0, a))
        p = add(p, scale(1.0 if k < 2 else -1.0, b))
        p = sub(p, scale(dot(p, o) / dot(way, o), way))
        polygon[k, X], polygon[k, Y], polygon[k, TAG] = dot(p, u), dot(p, v), 0.0


@jitable
def cylinder_on_rectangle(frame: F1, r: float, half: float, face: tuple[V3, V3, V3, V3]) -> float:
    """Return the area of the cut of a cylinder with a rectangle.

    `face` is the rectangle's centre, its half edges and its unit normal. Seen along the
    cylinder's axis the cut is what a disc, the rectangle and the strip between two chords have in
    common.
    """
    origin, _, _, n = face
    centre, a = vector(frame), axis(frame, 2)
    c, tilt = abs(dot(a, n)), cross(cross(a, n), a)
    s, height = norm(tilt), dot(sub(centre, origin), n)
    if abs(height) >= half * c + r * s:
        return 0.0
    scratch = np.empty((16, 3))
    polygon, other = scratch[:8], scratch[8:]
    u = scale(1.0 / s, tilt) if s > 0.0 else any_tangent(a)
    v = cross(a, u)
    if s == 0.0:
        put_rectangle(polygon, face, centre, u, v, a)
        return disc_in_polygon(polygon, 4, r)
    first, last = (-height - half * c) / s, (-height + half * c) / s
    if last - first < _LYING * r:
        # it lies: what it shares with the rectangle is one too
        x = -height / s
        wide = 0.5 * chord(x, r)
        along = cross(n, v)
        put_rectangle(polygon, face, centre, along, v, n)
        count = clip(polygon, 4, other, 1.0, 0.0, half, 0.0)
        count = clip(other, count, polygon, -1.0, 0.0, half, 0.0)
        count = clip(polygon, count, other, 0.0, 1.0, wide, 0.0)
        count = clip(other, count, polygon, 0.0, -1.0, wide, 0.0)
        return abs(polygon_area(polygon, count))
    put_rectangle(polygon, face, centre, u, v, a)
    count = clip(polygon, 4, other, 1.0, 0.0, last, 0.0)
    count = clip(other, count, polygon, -1.0, 0.0, -first, 0.0)
    return disc_in_polygon(polygon, count, r) / c


@jitable
def disc_on_rectangle(centre: V3, o: V3, r: float, face: tuple[V3, V3, V3, V3]) -> float:
    """Return the area of the part of a disc that is below a rectangle, seen along its normal."""
    origin, _, _, n = face
    c, tilt = dot(o, n), cross(cross(o, n), o)
    s, height = norm(tilt), dot(sub(centre, origin), n)
    if height >= r * s:
        return 0.0
    scratch = np.empty((16, 3))
    polygon, other = scratch[:8], scratch[8:]
    u = scale(1.0 / s, tilt) if s > 0.0 else any_tangent(o)
    put_rectangle(polygon, face, centre, u, cross(o, u), n)
    if height <= -r * s:
        return abs(c) * disc_in_polygon(polygon, 4, r)
    count = clip(polygon, 4, other, 1.0, 0.0, -height / s, 0.0)
    return abs(c) * disc_in_polygon(other, count, r)
