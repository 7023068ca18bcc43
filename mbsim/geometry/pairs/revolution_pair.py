"""Two solids of revolution: end on end, side by side, crossed, side on end, rim on rim."""

from __future__ import annotations

import math

from mbsim.core.arrays import F1, F2, V2, V3
from mbsim.core.jitable import jitable
from mbsim.core.rotation import add, cross, dot, norm, scale, sub, vector
from mbsim.geometry.catalog import AT_DEPTH, AT_WEIGHT, pair
from mbsim.geometry.convex import (
    ROTOR,
    Shape,
    along_circle,
    between_round,
    far,
    flat,
    line_of_centres,
    meeting,
    placed,
    shallow,
    slant,
)
from mbsim.geometry.manifold import (
    ARC_ROWS,
    TURN,
    crossing_of,
    deepest_place,
    disc_lies,
    fade,
    line_weight,
    put_apart,
    put_rim,
    put_weighted,
    segment_on_disc,
    share_with_one,
    turn_of,
)
from mbsim.geometry.pairs.revolution import cylinder_size
from mbsim.geometry.rotor import (
    NEARLY,
    ROUNDING,
    end_disc,
    end_facing,
    lies_in,
    pointed,
    side_distance,
    side_line,
    widest,
)

#: Rows: 6 for each rim, 2 where the rims cross; of a line its two ends and a crossing; one point.
PAIR_ROWS = 2 * ARC_ROWS + 3
#: Nearer to where all of an end or a side is farthest all directions are searched.
LONE = 4.5e-5
#: Rims coincide whose radii, seen along n, differ by less than this part in their squares.
COINCIDE = 1e-6


@jitable
def lies_on_end(shape: Shape, o: V3, p: V3, margin: float) -> bool:
    """Return whether p lies over the end disc with outward normal o, by `margin` from its rim."""
    d = sub(p, shape[1])
    across = sub(d, scale(dot(d, o), o))
    r = shape[5][1] if dot(o, shape[4]) > 0.0 else shape[5][0]
    return norm(across) <= r - margin


@jitable
def lines_meet(i: Shape, j: Shape, n: V3) -> bool:
    """Return whether the straight lines of both sides along n cross, seen along n.

    Parallel ones do where they have a part in common.
    """
    low_i, high_i, _ = side_line(i, scale(-1.0, n))
    low_j, high_j, _ = side_line(j, n)
    a, b = sub(high_i, low_i), sub(high_j, low_j)
    apart = sub(low_j, low_i)
    both = dot(cross(a, b), n)
    if abs(both) < 1e-9 * norm(a) * norm(b):
        square = dot(a, a)
        s, t = dot(apart, a) / square, dot(sub(high_j, low_i), a) / square
        return min(s, t) < 1.0 and max(s, t) > 0.0
    s, t = dot(cross(apart, b), n) / both, dot(cross(apart, a), n) / both
    return 0.0 < s < 1.0 and 0.0 < t < 1.0


@jitable
def rim_over_side(other: Shape, shape: Shape, d: V3, p: V3, margin: float) -> bool:
    """Return whether d is a normal of the side of `shape`, and p of `other` lies over that side.

    Then no direction nearby overlaps less.
    """
    on_side = abs(dot(d, shape[4]) - slant(shape[5])) < 1e-12
    z = dot(sub(p, shape[1]), shape[4])
    # a single point has to lie there: a rim's, not one of a line's
    return on_side and abs(z) < shape[5][2] - margin and pointed(other, scale(-1.0, d)) > LONE


@jitable
def least(i: Shape, j: Shape) -> tuple[float, V3]:
    """Return (f, n) of the least overlap of two solids of revolution."""
    f, n = flat(i, j, j, 1.0, 1e300, (0.0, 0.0, 1.0))
    if f < 0.0 or (f < shallow(i, j) and lies_on_end(j, n, far(i, scale(-1.0, n)), f)):
        return f, n
    f, n = flat(i, j, i, -1.0, f, n)
    if f < 0.0:
        return f, n
    m = scale(-1.0, n)
    if f < shallow(i, j) and abs(dot(m, i[4])) > 1.0 - 1e-12 and lies_on_end(i, m, far(j, n), f):
        return f, n
    start = n
    g = f
    f, n = meeting(i, j, i[4], -slant(i[5]), j[4], slant(j[5]), f, n)
    if f < 0.0 or (f < g and f < shallow(i, j) and lines_meet(i, j, n)):
        return f, n
    f, n = along_circle(i, j, i[4], -slant(i[5]), f, n)
    f, n = along_circle(i, j, j[4], slant(j[5]), f, n)
    if 0.0 < f < shallow(i, j) and (
        rim_over_side(j, i, scale(-1.0, n), far(j, n), f)
        or rim_over_side(i, j, n, far(i, scale(-1.0, n)), f)
    ):
        return f, n
    between = add(start, n)
    between = scale(1.0 / max(norm(between), 1e-9), between)
    for k in range(3):
        if f < 0.0:
            break
        m = n if k == 0 else (line_of_centres(i, j) if k == 1 else between)
        g, m = between_round(i, j, m, 0.0)
        if g < f:
            f, n = g, m
    return f, n


@jitable
def plane_of(shape: Shape, end: int) -> tuple[V3, float, V3, V3, V3]:
    """Return an end's disc as (centre, radius, outward normal, u, v), u and v in its plane."""
    centre, o, r = end_disc(shape, end)
    u = shape[2]
    return centre, r, o, u, cross(o, u)


@jitable
def seen_on(disc: tuple[V3, float, V3, V3, V3], p: V3, n: V3) -> V2:
    """Return the place (x, y) of point p on the plane of a disc, seen along n."""
    centre, _, o, u, v = disc
    d = sub(p, centre)
    d = sub(d, scale(dot(d, o) / dot(n, o), n))
    return dot(d, u), dot(d, v)


@jitable
def rims_cross(
    a: tuple[V3, float, V3, V3, V3], b: tuple[V3, float, V3, V3, V3], n: V3, sign: float
) -> tuple[bool, V3]:
    """Return (found, point on the plane of disc a) where both rims cross, seen along n.

    Two circles first; Newton on |x| = r_a and |seen on b| = r_b makes it exact for the ellipse
    that a tilted disc is. Rims that coincide nearly everywhere have no such place: that of
    the circles is as good as any.
    """
    ra, rb = a[1], b[1]
    cx, cy = seen_on(a, b[0], n)
    way = math.sqrt(cx * cx + cy * cy)
    if way >= ra + rb or way <= abs(ra - rb) or way == 0.0:
        return False, a[0]
    along = (way * way + ra * ra - rb * rb) / (2.0 * way)
    off = sign * math.sqrt(max(0.0, ra * ra - along * along))
    x, y = (along * cx - off * cy) / way, (along * cy + off * cx) / way
    # what a step along u, v of a is on b
    ux, uy = seen_on(b, add(b[0], a[3]), n)
    vx, vy = seen_on(b, add(b[0], a[4]), n)
    found, coincide, circles = False, False, (x, y)
    for attempt in range(8):
        p = add(a[0], add(scale(x, a[3]), scale(y, a[4])))
        bx, by = seen_on(b, p, n)
        e, g = 0.5 * (x * x + y * y - ra * ra), 0.5 * (bx * bx + by * by - rb * rb)
        if attempt == 0:
            coincide = max(abs(e), abs(g)) <= COINCIDE * ra * rb
        gx, gy = bx * ux + by * uy, bx * vx + by * vy
        det = x * gy - y * gx
        if abs(det) < 1e-9 * ra * rb:
            break
        dx, dy = (e * gy - y * g) / det, (x * g - e * gx) / det
        x, y = x - dx, y - dy
        if dx * dx + dy * dy < 1e-20 * ra * ra:
            found = True
            break
    if coincide and not found:
        found, x, y = True, circles[0], circles[1]
    return found, add(a[0], add(scale(x, a[3]), scale(y, a[4])))


@jitable
def put_disc(
    points: F2,
    first: int,
    arcs: F2,
    own: tuple[V3, float, V3, V3, V3],
    other: tuple[V3, float, V3, V3, V3],
    n: V3,
    side: float,
    start: V3,
    stop: V3,
    crossed: bool,
    f: float,
) -> None:
    """Write the points of a disc's rim over the other disc, from `start` round to `stop`.

    `arcs` is a row to work in; `side` is 1 for the disc of I, -1 for that of J. Many arguments
    because compiled code is given numbers, not records.
    """
    centre, r, o, u, _ = own
    # depth = side (q - p).oo / n.oo along n, with oo, q of the other disc; it rises along u
    oo = other[2]
    no = dot(n, oo)
    depth0 = side * dot(sub(other[0], centre), oo) / no
    gradient = scale(-side / no, sub(oo, scale(dot(oo, o), o)))
    rise = norm(gradient)
    if rise > 1e-12:
        u = scale(1.0 / rise, gradient)
    v = cross(o, u)
    begin, length = 0.0, TURN
    if crossed:
        a, b = sub(start, centre), sub(stop, centre)
        begin = math.atan2(dot(a, v), dot(a, u))
        length = (math.atan2(dot(b, v), dot(b, u)) - begin) % TURN
    arcs[0, 0], arcs[0, 1] = begin, length
    disc = (centre, u, v, r, depth0, rise)
    put_rim(points, first, arcs, 1, disc, n, side, length, begin + 0.5 * length, 3.0, f)


@jitable
def end_on_end(i: Shape, j: Shape, end_i: int, end_j: int, n: V3, f: float, points: F2) -> float:
    """Write the patch of two end discs; return the part of the force it carries, -1 for none."""
    a, b = plane_of(i, end_i), plane_of(j, end_j)
    crossed, start = rims_cross(a, b, n, -1.0)
    other, stop = rims_cross(a, b, n, 1.0)
    cx, cy = seen_on(a, b[0], n)
    # strongly tilted discs are no circles: then one point where they are deepest
    if crossed != other or (not crossed and cx * cx + cy * cy > (a[1] - b[1]) ** 2):
        return -1.0
    arcs = points[2 * ARC_ROWS :]
    out, centre = -a[1] - b[1], a[0]
    nb = dot(n, b[2])
    # the same two places on the plane of the other disc
    depth_start = dot(sub(b[0], start), b[2]) / nb
    depth_stop = dot(sub(b[0], stop), b[2]) / nb
    if crossed or a[1] <= b[1]:
        put_disc(points, 0, arcs, a, b, n, 1.0, start, stop, crossed, f)
    if crossed or b[1] < a[1]:
        on_b, off_b = add(start, scale(depth_start, n)), add(stop, scale(depth_stop, n))
        put_disc(points, ARC_ROWS, arcs, b, a, n, -1.0, on_b, off_b, crossed, f)
    put_apart(points, 2 * ARC_ROWS, PAIR_ROWS, out, centre, n)
    if crossed:
        for k in range(2):
            p = start if k == 0 else stop
            depth = depth_start if k == 0 else depth_stop
            x, y = dot(sub(p, a[0]), a[3]), dot(sub(p, a[0]), a[4])
            turn = turn_of(-y, x, cy - y, x - cx)
            if k == 0:
                turn = turn_of(cy - y, x - cx, -y, x)
            middle = add(p, scale(0.5 * depth, n))
            put_weighted(points[2 * ARC_ROWS + k], depth, middle, n, 3.0 * turn / TURN)
    return disc_lies(min(a[1], b[1]), norm(cross(a[2], b[2])), f)


@jitable
def put_ball(row: F1, i: Shape, j: Shape, x: V3, weight: float) -> float:
    """Write the contact of J's ball that touches its side from within at x, with the side of I."""
    inward, out = side_distance(j, x)
    # the ball's centre is where the normal at x meets the axis
    z = dot(sub(x, j[1]), j[4])
    c = slant(j[5])
    radius = (0.5 * (j[5][0] + j[5][1]) + 0.5 * z * (j[5][1] - j[5][0]) / j[5][2]) / math.sqrt(
        1.0 - c * c
    )
    centre = sub(x, scale(radius + inward, out))
    distance, away = side_distance(i, centre)
    n = scale(-1.0, away)
    depth = radius - distance
    put_weighted(row, depth, add(centre, scale(0.5 * (radius + distance), n)), n, weight)
    return depth


@jitable
def side_by_side(i: Shape, j: Shape, n: V3, f: float, points: F2) -> float:
    """Write two sides along each other: the ends of the common part, or where they cross.

    Returns the part of the force that these carry, -1 where the sides have no part in common.

    Where the lines are parallel to within the depth the ends carry; the more they cross the more
    does the one point where they cross.
    """
    low_i, high_i, out_i = side_line(i, scale(-1.0, n))
    low_j, high_j, out_j = side_line(j, n)
    # a rim that presses into a side is no line, however near its sides would be
    off = max(norm(add(n, out_i)), norm(sub(n, out_j)))
    way = sub(high_j, low_j)
    length = norm(way)
    t = scale(1.0 / length, way)
    s0, s1 = dot(sub(low_i, low_j), t), dot(sub(high_i, low_j), t)
    first, last = max(0.0, min(s0, s1)), min(length, max(s0, s1))
    if first >= last:
        return -1.0
    # the smaller radius tells a line from a point
    weight = line_weight(last - first, min(widest(i[5]), widest(j[5])))
    x0, x1 = add(low_j, scale(first, t)), add(low_j, scale(last, t))
    d0 = put_ball(points[0], i, j, x0, 1.0)
    d1 = put_ball(points[1], i, j, x1, 1.0)
    both = min(1.0, max(0.0, min(d0, d1) / max(f, 1e-300))) * fade(1.0 - 10.0 * off)
    for row in range(2):
        points[row, AT_DEPTH] = min(points[row, AT_DEPTH], f)
        points[row, AT_WEIGHT] = weight * both
        if weight * both < 1e-6:
            points[row, AT_DEPTH] = -length
            points[row, AT_WEIGHT] = 1.0
    x = add(low_j, scale(length * crossing_of(low_i, high_i, low_j, high_j, n), t))
    if both > 0.0:
        # between the ends, also where the lines are so parallel that they cross nowhere
        x = add(x0, scale(crossing_of(low_i, high_i, x0, x1, n), sub(x1, x0)))
    put_weighted(points[2], f, sub(x, scale(0.5 * f, n)), n, 1.0 - both)
    # where a rim presses it is the one point
    return fade(1.0 - 10.0 * off)


@jitable
def solid_on_solid(i: Shape, j: Shape, points: F2) -> int:
    """Write the points of a solid of revolution I on another J."""
    f, n = least(i, j)
    middle = scale(0.5, add(far(i, scale(-1.0, n)), far(j, n)))
    if f <= 0.0:
        put_apart(points, 0, PAIR_ROWS, f, middle, n)
        return PAIR_ROWS
    put_apart(points, 0, PAIR_ROWS, -(widest(i[5]) + i[5][2]), middle, n)
    end_i, end_j = end_facing(i, scale(-1.0, n)), end_facing(j, n)
    if end_i != 0 and end_j != 0:
        part = end_on_end(i, j, end_i, end_j, n, f, points)
    elif end_i != 0:
        centre, o, r = end_disc(i, end_i)
        low, high, _ = side_line(j, n)
        part = segment_on_disc(points, 0, low, high, (centre, r), o, n, 1.0, f)
    elif end_j != 0:
        centre, o, r = end_disc(j, end_j)
        low, high, _ = side_line(i, scale(-1.0, n))
        part = segment_on_disc(points, 0, low, high, (centre, r), o, n, -1.0, f)
    else:
        part = side_by_side(i, j, n, f, points)
    # a rim has one farthest point, an end or a side many
    rim_i = pointed(i, scale(-1.0, n)) > pointed(j, n)
    low, high = far(i, scale(-1.0, n)), far(j, n)
    p = add(low, scale(0.5 * f, n)) if rim_i else sub(high, scale(0.5 * f, n))
    room = f + ROUNDING * min(widest(i[5]), widest(j[5]))
    if not (lies_in(i, p, room) and lies_in(j, p, room)):
        p = deepest_place(points, PAIR_ROWS - 1, p, -NEARLY * widest(i[5]))
    share_with_one(points, PAIR_ROWS - 1, part, end_i == 0 and end_j == 0, f, p, n)
    return PAIR_ROWS


@pair("CYLINDER", "CYLINDER", slots=PAIR_ROWS, regroups=True)
def cylinder_cylinder(frame_i: F1, size_i: F1, frame_j: F1, size_j: F1, points: F2) -> int:
    """End on end, side by side, crossed, side on end, rim on rim."""
    i = placed(ROTOR, frame_i, cylinder_size(size_i))
    return solid_on_solid(i, placed(ROTOR, frame_j, cylinder_size(size_j)), points)


@pair("FRUSTUM", "CYLINDER", slots=PAIR_ROWS, regroups=True)
def frustum_cylinder(frame_i: F1, size_i: F1, frame_j: F1, size_j: F1, points: F2) -> int:
    """End on end, side by side, crossed, side on end, rim on rim."""
    i = placed(ROTOR, frame_i, vector(size_i))
    return solid_on_solid(i, placed(ROTOR, frame_j, cylinder_size(size_j)), points)


@pair("FRUSTUM", "FRUSTUM", slots=PAIR_ROWS, regroups=True)
def frustum_frustum(frame_i: F1, size_i: F1, frame_j: F1, size_j: F1, points: F2) -> int:
    """End on end, side by side, crossed, side on end, rim on rim."""
    i = placed(ROTOR, frame_i, vector(size_i))
    return solid_on_solid(i, placed(ROTOR, frame_j, vector(size_j)), points)
