"""Where two shapes touch along a given normal: the points of a patch or of a line.

What carries is spread by the exterior angle of the patch's border: an arc has its own angle,
a corner the angle by which the border turns there. Their sum is 2 pi for every convex patch,
so nothing jumps where a face's edge begins to cut a disc. A whole disc has 3 weights, a
polygon of 4 corners 4. A line has 2 weights, fading to 1 as it shrinks to a point.
What is tilted until no more than one place of it touches is no patch: there one point carries, at
the depth of the least overlap, whose slope its force is. `share_with_one` leads over to that.
"""

from __future__ import annotations

import math

from mbsim.core.arrays import F1, F2, V3
from mbsim.core.jitable import jitable
from mbsim.core.rotation import add, cross, dot, norm, scale, sub, vector
from mbsim.geometry.catalog import AT_DEPTH, AT_POINT, AT_WEIGHT, put_point

#: Centre, u, v, radius, depth at the centre, rise of the depth along u.
Disc = tuple[V3, V3, V3, float, float, float]

TURN = 2.0 * math.pi
#: Shares below this are no incident.
SMALL = 1e-6
#: Rows that the arcs of one disc take.
ARC_ROWS = 6
#: Chords that sum up to less than this part of the radius do not say where a cut rim's middle is.
NO_MIDDLE = 1e-3
#: Difference of depths across a whole rim, over the largest, from which on it is tilted.
LEVEL = 0.2


@jitable
def put_apart(points: F2, first: int, last: int, depth: float, p: V3, n: V3) -> None:
    """Write rows that do not touch."""
    for row in range(first, last):
        put_point(points[row], depth, p, n)


@jitable
def put_weighted(row: F1, depth: float, p: V3, n: V3, weight: float) -> None:
    """Write one candidate, unless it carries nothing."""
    if weight > SMALL:
        put_point(row, depth, p, n, weight)


@jitable
def fade(x: float) -> float:
    """Return the smooth step 3 x^2 - 2 x^3 from 0 to 1, constant outside."""
    x = min(1.0, max(0.0, x))
    return x * x * (3.0 - 2.0 * x)


@jitable
def own_middle(sum_x: float, sum_y: float, way_x: float, way_y: float, r: float) -> float:
    """Return the angle of the middle of what chords leave of a rim of radius r.

    The normals of the chords add up to (sum_x, sum_y). A rim that is whole, or cut alike on both
    sides, has no middle: then it is the unit vector (way_x, way_y), an edge's direction.
    """
    least = NO_MIDDLE * r
    part = least * (1.0 - fade(math.hypot(sum_x, sum_y) / least))
    return math.atan2(sum_y + part * way_y, sum_x + part * way_x)


@jitable
def next_arc(arcs: F2, count: int, begin: float, sign: float, last: float) -> tuple[float, float]:
    """Return (first, length) of the arc that begins next after the angle `last` from `begin` on.

    `sign` 1 looks to the left, -1 to the right; first is a whole turn where there is none.
    """
    found, long = TURN, 0.0
    for m in range(count):
        start, length = arcs[m, 0], arcs[m, 1]
        if length > 0.0:
            first = (start - begin) % TURN if sign > 0.0 else (begin - start - length) % TURN
            if last < first < found:
                found, long = first, length
    return found, long


@jitable
def half_sector(arcs: F2, count: int, begin: float, sign: float) -> V3:
    """Return (angle, c, s) of what arcs leave of the 60 degrees from `begin` on.

    `sign` 1 looks to the left, -1 to the right; c, s are cosine and sine of the place that stands
    for it, times the angle. An arc is placed where it comes nearest to `begin`. What lies behind
    a gap is placed where what is before it is, the more the narrower the gap is against that: an
    edge that only touches the rim parts nothing.
    """
    width = TURN / 6.0
    before = 0.0
    for m in range(count):
        # an arc that `begin` lies on
        start, length = arcs[m, 0], arcs[m, 1]
        first = (start - begin) % TURN if sign > 0.0 else (begin - start - length) % TURN
        before = max(before, min(first + length - TURN, width))
    x, y = math.cos(begin), math.sin(begin)
    c, s, end, last = before * x, before * y, before, -1.0
    for _ in range(count):
        first, length = next_arc(arcs, count, begin, sign, last)
        if first >= width:
            break
        gap, last = max(0.0, first - end), first
        own_x, own_y = math.cos(begin + sign * first), math.sin(begin + sign * first)
        part = (gap / (gap + before)) ** 2 if gap > 0.0 else 0.0
        x, y = x + part * (own_x - x), y + part * (own_y - y)
        angle = min(length, width - first)
        before, end = before + angle, first + angle
        c, s = c + angle * x, s + angle * y
    return before, c, s


@jitable
def put_arcs(
    points: F2,
    first: int,
    arcs: F2,
    count: int,
    disc: Disc,
    n: V3,
    side: float,
    reference: float,
    weight: float,
) -> None:
    """Write three points for what is left of a rim.

    The rim is cut into three sectors around `reference` and +-120 degrees. A sector's
    point is the rim's point in its middle as long as that is left, else the mean of the points
    next to it on both sides, each with its angle.

    Parameters
    ----------
    arcs : ndarray, shape (>= count, >= 2)
        Start and length of each arc [rad].
    disc : tuple
        Centre, u, v, radius, depth at the centre, rise of the depth along u.
    side : float
        1 where the disc is I's (its points go along n to the other surface), -1 where J's.
    weight : float
        Shares of a full turn.
    """
    centre, u, v, r, depth0, rise = disc
    for k in range(3):
        middle = reference + k * TURN / 3.0
        left, x, y = half_sector(arcs, count, middle, 1.0)
        right, c, s = half_sector(arcs, count, middle, -1.0)
        angle = left + right
        if angle <= 0.0:
            continue
        x, y = r * (x + c) / angle, r * (y + s) / angle
        depth = depth0 + rise * x
        p = add(centre, add(scale(x, u), scale(y, v)))
        arc = weight * angle / TURN
        put_weighted(points[first + k], depth, add(p, scale(0.5 * side * depth, n)), n, arc)


@jitable
def put_rim(
    points: F2,
    first: int,
    arcs: F2,
    count: int,
    disc: Disc,
    n: V3,
    side: float,
    total: float,
    own: float,
    weight: float,
    deepest: float,
) -> None:
    """Write up to six points for what is left of a rim, `total` [rad] in all.

    Tilted, the sectors are set around the deepest point (u), so that it carries wherever the
    tilt turns. Flat, the tilt has no direction: the rim is divided around its own middle `own`,
    so that the centre of pressure does not turn with a tilt of 1e-9. Three points of a whole rim
    carry the same around any place while all touch: it goes over to the deepest one long before.
    Many arguments because compiled code is given numbers, not records.
    """
    _, _, _, r, _, rise = disc
    tilt = 2.0 * r * abs(rise) / max(deepest, 1e-300)
    tilted, whole = fade(tilt - 0.5), fade(1.0 - (TURN - total) / 0.5)
    tilted += whole * (fade(tilt / LEVEL) - tilted)
    if tilted > 0.0:
        put_arcs(points, first, arcs, count, disc, n, side, 0.0, weight * tilted)
    if tilted < 1.0:
        put_arcs(points, first + 3, arcs, count, disc, n, side, own, weight * (1.0 - tilted))


@jitable
def turn_of(ax: float, ay: float, bx: float, by: float) -> float:
    """Return the angle from a to b where it is to the left, else 0."""
    return max(0.0, math.atan2(ax * by - ay * bx, ax * bx + ay * by))


@jitable
def line_weight(length: float, radius: float) -> float:
    """Return the weight of each end of a line contact: 1, fading to 1/2 as it becomes a point."""
    return 0.5 + 0.5 * fade(5.0 * length / radius)


@jitable
def disc_lies(width: float, tilt: float, f: float) -> float:
    """Return the part that a patch carries: 1, and 0 where it is tilted to one place.

    `width` is how far it reaches along the tilt from its middle, `tilt` a tangent, f the depth.
    Of a rim the points at +-120 degrees touch up to 1.5 width tilt = f.
    """
    return fade(3.0 - 1.5 * width * tilt / f)


@jitable
def line_lies(depth_a: float, depth_b: float, f: float) -> float:
    """Return the part that a line carries: 1, and 0 where one end is far above what touches."""
    return fade(2.0 - abs(depth_a - depth_b) / f)


@jitable
def side_faces(n: V3, out: V3) -> float:
    """Return the part that a side of normal `out` carries along n: none where its rim presses."""
    return fade(1.0 - 10.0 * norm(add(n, out)))


@jitable
def deepest_place(points: F2, count: int, p: V3, least: float) -> V3:
    """Return the place of the deepest of the first `count` rows; p if all are less deep."""
    for row in range(count):
        if points[row, AT_DEPTH] > least:
            least = points[row, AT_DEPTH]
            p = vector(points[row, AT_POINT:])
    return p


@jitable
def shared(points: F2, first: int, last: int, part: float, crossed: bool, f: float) -> float:
    """Give rows their part of the force; return what they carry of it.

    No row is deeper than f, the least overlap. Rows that carry less than one point leave the rest
    to it, unless they have a point where lines cross (`crossed`).
    """
    carried = 0.0
    for row in range(first, last):
        points[row, AT_DEPTH] = min(points[row, AT_DEPTH], f)
        carried += points[row, AT_WEIGHT] * max(0.0, points[row, AT_DEPTH]) / f
    part = max(0.0, part) if crossed else max(0.0, part) * fade(2.0 * carried - 1.0)
    for row in range(first, last):
        points[row, AT_WEIGHT] *= part
        if points[row, AT_WEIGHT] <= SMALL:
            points[row, AT_DEPTH], points[row, AT_WEIGHT] = min(points[row, AT_DEPTH], -f), 1.0
    return part


@jitable
def share_with_one(
    points: F2, count: int, part: float, crossed: bool, f: float, p: V3, n: V3
) -> None:
    """Leave a part of the force to the first `count` rows (see `shared`), the rest to one point p.

    That is the next row.
    """
    part = shared(points, 0, count, part, crossed, f)
    put_weighted(points[count], f, p, n, 1.0 - part)


@jitable
def segment_on_disc(
    points: F2,
    first: int,
    a: V3,
    b: V3,
    disc: tuple[V3, float],
    o: V3,
    n: V3,
    side: float,
    f: float,
) -> float:
    """Write the ends of the part of segment a-b that lies over an end disc.

    Returns the part of the force that they carry, -1 where nothing lies over it.
    `disc` is (centre, radius), `o` its outward normal, `side` 1 where the disc is I's and the
    segment J's, else -1. Depth is measured along n; f is the least overlap.
    """
    centre, r = disc
    no = dot(n, o)
    depth_a = side * dot(sub(a, centre), o) / no
    depth_b = side * dot(sub(b, centre), o) / no
    # seen along n on the plane of the disc
    qa = sub(sub(a, scale(side * depth_a, n)), centre)
    way = sub(sub(b, scale(side * depth_b, n)), add(qa, centre))
    # |qa + s way| = r
    ww, qw = dot(way, way), dot(qa, way)
    root = qw * qw - ww * (dot(qa, qa) - r * r)
    if ww == 0.0 or root <= 0.0:
        return -1.0
    root = math.sqrt(root)
    low, high = max(0.0, (-qw - root) / ww), min(1.0, (root - qw) / ww)
    if low >= high:
        return -1.0
    weight = line_weight((high - low) * math.sqrt(ww), r)
    for k in range(2):
        s = low if k == 0 else high
        depth = depth_a + s * (depth_b - depth_a)
        x = add(a, scale(s, sub(b, a)))
        put_point(points[first + k], depth, sub(x, scale(0.5 * side * depth, n)), n, weight)
    return line_lies(low * (depth_b - depth_a), high * (depth_b - depth_a), f)


@jitable
def crossing_of(a: V3, b: V3, p: V3, q: V3, n: V3) -> float:
    """Return the place 0..1 on p-q where it crosses the line a-b, seen along n; 1/2 if parallel."""
    across = cross(sub(b, a), n)
    along = dot(sub(q, p), across)
    if abs(along) < 1e-9 * norm(across) * norm(sub(q, p)):
        return 0.5
    return min(1.0, max(0.0, dot(sub(a, p), across) / along))
