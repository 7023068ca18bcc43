"""A cylinder or a frustum on a box: standing, also over edges, lying, leaning, rolling over."""

from __future__ import annotations

import math

from mbsim.core.arrays import F1, F2, V3
from mbsim.core.jitable import jitable
from mbsim.core.rotation import add, cross, dot, norm, scale, sub, vector
from mbsim.geometry.catalog import AT_DEPTH, AT_NORMAL, pair, put_point, region
from mbsim.geometry.convex import (
    BOX,
    ROTOR,
    Shape,
    along_circle,
    far,
    flat,
    meeting,
    placed,
    shallow,
    slant,
)
from mbsim.geometry.face_edges import (
    chord_normals,
    corner_turn,
    cut_edge,
    end_at_corners,
    fill_arcs,
)
from mbsim.geometry.manifold import (
    ARC_ROWS,
    TURN,
    Disc,
    crossing_of,
    deepest_place,
    disc_lies,
    line_lies,
    line_weight,
    own_middle,
    put_apart,
    put_rim,
    put_weighted,
    segment_on_disc,
    share_with_one,
    shared,
    side_faces,
)
from mbsim.geometry.pairs.revolution import cylinder_size
from mbsim.geometry.region import cylinder_on_rectangle, disc_on_rectangle
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

#: Rows: of an end disc 6 for the rim, then 2 for each edge of the face (where it enters the disc,
#: or its corner; where it leaves), then both ends of an edge that it lies on; of a line its bottom
#: and top end and a crossing; one point.
AT_EDGE = ARC_ROWS + 8
BOX_ROWS = AT_EDGE + 3
#: Farther from where all of an edge, an end or a side is farthest one point is.
SINGLE = 1e-8


@jitable
def edge_axis(box: Shape, k: int) -> V3:
    """Return axis k of a box."""
    return box[2] if k == 0 else (box[3] if k == 1 else box[4])


@jitable
def first_two(box: Shape, n: V3) -> tuple[int, int, int]:
    """Return the box's axes sorted by how much they are along n: the first two, and the third."""
    a, b, c = abs(dot(box[2], n)), abs(dot(box[3], n)), abs(dot(box[4], n))
    if a >= b and a >= c:
        return (0, 1, 2) if b >= c else (0, 2, 1)
    if b >= c:
        return (1, 0, 2) if a >= c else (1, 2, 0)
    return (2, 0, 1) if a >= b else (2, 1, 0)


@jitable
def over(i: Shape, j: Shape, n: V3, margin: float) -> bool:
    """Return whether I's lowest point lies over J's face with normal n, by `margin` from its edges.

    With a margin of the depth no way out to the side is shorter.
    """
    d = sub(far(i, scale(-1.0, n)), j[1])
    for k in range(3):
        a = edge_axis(j, k)
        if abs(dot(a, n)) < 0.5 and abs(dot(d, a)) > j[5][k] - margin:
            return False
    return True


@jitable
def least(i: Shape, j: Shape) -> tuple[float, V3]:
    """Return (f, n) of the least overlap of a solid of revolution I and a box J."""
    f, n = flat(i, j, j, 1.0, 1e300, (0.0, 0.0, 1.0))
    if f < 0.0 or (f < shallow(i, j) and over(i, j, n, f)):
        return f, n
    f, n = flat(i, j, i, -1.0, f, n)
    # n points into I: the outward normal of I is -n
    gamma = -slant(i[5])
    for k in range(3):
        f, n = meeting(i, j, edge_axis(j, k), 0.0, i[4], gamma, f, n)
    if f < 0.0:
        return f, n
    for k in range(4):
        # rims on edges, then corners on the side
        if k < 3:
            f, n = along_circle(i, j, edge_axis(j, k), 0.0, f, n)
        else:
            f, n = along_circle(i, j, i[4], gamma, f, n)
        if f < 0.0:
            break
    return f, n


@jitable
def face_corner(j: Shape, k: int, sk: float, quarter: int) -> V3:
    """Return corner 0..3 of the face of box J with outward normal sk times axis k."""
    first, second = (k + 1) % 3, (k + 2) % 3
    s1 = 1.0 if quarter == 0 or quarter == 3 else -1.0
    s2 = 1.0 if quarter < 2 else -1.0
    p = add(j[1], scale(sk * j[5][k], edge_axis(j, k)))
    p = add(p, scale(s1 * j[5][first], edge_axis(j, first)))
    return add(p, scale(s2 * j[5][second], edge_axis(j, second)))


@jitable
def put_corners(work: F2, disc: Disc, n: V3, weight: float) -> None:
    """Turn the cut edges in the rows of `work` into points where they enter and leave the disc."""
    centre, u, v, r, depth0, rise = disc
    turns = (work[1, 6], work[3, 6], work[5, 6], work[7, 6])
    for e in range(4):
        row = work[2 * e]
        cut = row[7] == 1.0
        enters = corner_turn(row, turns[e], turns[e - 1], 0)
        leaves = corner_turn(row, turns[e], turns[e - 1], 1)
        for side in range(2):
            angle, x, y = enters if side == 0 else leaves
            angle = angle if cut else 0.0
            put_point(work[2 * e + side], -r, centre, n)
            depth = depth0 + rise * x
            p = add(centre, add(scale(x, u), scale(y, v)))
            p = add(p, scale(0.5 * depth, n))
            put_weighted(work[2 * e + side], depth, p, n, weight * angle / TURN)


@jitable
def disc_on_face(i: Shape, j: Shape, end: int, k: int, n: V3, f: float, points: F2) -> float:
    """Write the patch of an end disc of I on face k of box J.

    Returns the part of the force that it carries, -1 where there is none.
    All is drawn in the plane of the disc, where it is a circle and the face, seen along
    n, a parallelogram. u points to where the disc is deepest.
    """
    centre, o, r = end_disc(i, end)
    face = edge_axis(j, k)
    sk = 1.0 if dot(face, n) >= 0.0 else -1.0
    face = scale(sk, face)
    nf, no = dot(n, face), dot(n, o)
    u = sub(scale(dot(face, o), o), face)
    tilt = norm(u)
    u = scale(1.0 / tilt, u) if tilt > 1e-12 else i[2]
    # with o = u x v a turn from u to v is a turn to the left seen against o
    v = cross(o, u)
    q = add(j[1], scale(j[5][k], face))
    depth0 = dot(sub(q, centre), face) / nf
    rise = tilt / nf
    disc = (centre, u, v, r, depth0, rise)

    # the corners go round to the left, seen against o, which is along -n; the face's axes and
    # its normal are right-handed for sk = 1
    work = points[ARC_ROWS:]
    cuts, beyond, inside = 0, False, True
    for e in range(4):
        first, second = ((4 - e) % 4, (3 - e) % 4) if sk > 0.0 else (e, (e + 1) % 4)
        a, b = face_corner(j, k, sk, first), face_corner(j, k, sk, second)
        # along n onto the plane of the disc
        a = sub(sub(a, scale(dot(sub(a, centre), o) / no, n)), centre)
        b = sub(sub(b, scale(dot(sub(b, centre), o) / no, n)), centre)
        ax, ay, bx, by = dot(a, u), dot(a, v), dot(b, u), dot(b, v)
        if ax * by - ay * bx <= 0.0:
            inside = False
        code = cut_edge(work, e, ax, ay, bx, by, r)
        if code == 1:
            cuts += 1
        elif code == -1:
            beyond = True
    if cuts == 0 and (beyond or not inside):
        return -1.0
    end_at_corners(work, 4)
    total = fill_arcs(work, 4, cuts)
    weight = 4.0 - total / TURN
    way = edge_axis(j, (k + 1) % 3)
    x, y = chord_normals(work, 4)
    own = own_middle(x, y, dot(way, u), dot(way, v), r)
    put_rim(points, 0, work[1::2], 4, disc, n, 1.0, total, own, weight, f)
    put_corners(work, disc, n, weight)
    reach = 0.0
    for m in range(3):
        if m != k:
            reach += j[5][m] * abs(dot(edge_axis(j, m), u))
    return disc_lies(min(r, reach), rise, f)


@jitable
def line_on_face(i: Shape, j: Shape, k: int, n: V3, f: float, points: F2) -> float:
    """Write the ends of the part of I's side line that lies over face k of box J.

    Returns the part of the force that they carry, -1 where nothing lies over it.
    """
    low, high, out = side_line(i, scale(-1.0, n))
    face = edge_axis(j, k)
    face = scale(1.0 if dot(face, n) >= 0.0 else -1.0, face)
    nf = dot(n, face)
    q = add(j[1], scale(j[5][k], face))
    depth_low, depth_high = dot(sub(q, low), face) / nf, dot(sub(q, high), face) / nf
    way = sub(high, low)
    # on the face, seen along n
    start = sub(add(low, scale(depth_low, n)), j[1])
    stop = sub(add(high, scale(depth_high, n)), j[1])
    first, last = 0.0, 1.0
    for step in range(1, 3):
        m = (k + step) % 3
        a, half = edge_axis(j, m), j[5][m]
        y0, y1 = dot(start, a), dot(stop, a)
        if abs(y1 - y0) < 1e-300:
            if abs(y0) > half:
                return -1.0
            continue
        s0, s1 = (-half - y0) / (y1 - y0), (half - y0) / (y1 - y0)
        first, last = max(first, min(s0, s1)), min(last, max(s0, s1))
    # a rim on an edge: which side of it rounding leaves a line on tells nothing
    if last - first <= 1e-9:
        return -1.0
    weight = line_weight((last - first) * norm(way), widest(i[5]))
    for row in range(2):
        s = first if row == 0 else last
        depth = depth_low + s * (depth_high - depth_low)
        p = add(add(low, scale(s, way)), scale(0.5 * depth, n))
        put_point(points[row], depth, p, n, weight)
    rise = depth_high - depth_low
    return line_lies(first * rise, last * rise, f) * side_faces(n, out)


@jitable
def side_on_edge(
    i: Shape, j: Shape, axes: tuple[int, int, int], n: V3, f: float, points: F2
) -> float:
    """Write the side of I on the edge of box J that faces it: both ends, or the crossing.

    Where they are parallel to within the depth the ends carry; the more they cross the more
    does the one point where they cross. Returns the part of the force that these carry, -1 where
    the side has no part in common with the edge.
    """
    k, second, m = axes
    q = j[1]
    for h in (k, second):
        a = edge_axis(j, h)
        q = add(q, scale(j[5][h] if dot(a, n) >= 0.0 else -j[5][h], a))
    e, half = edge_axis(j, m), j[5][m]
    low, high, out = side_line(i, scale(-1.0, n))
    # the part of the edge between both ends of the solid
    first, last = -half, half
    z, rise, end = dot(sub(q, i[1]), i[4]), dot(e, i[4]), i[5][2]
    if abs(rise) > 1e-12:
        s0, s1 = (-end - z) / rise, (end - z) / rise
        first, last = max(first, min(s0, s1)), min(last, max(s0, s1))
    elif abs(z) > end:
        return -1.0
    if first >= last:
        return -1.0
    weight = line_weight(last - first, widest(i[5]))
    x0, x1 = add(q, scale(first, e)), add(q, scale(last, e))
    d0, n0 = side_distance(i, x0)
    d1, n1 = side_distance(i, x1)
    both = min(1.0, max(0.0, min(-d0, -d1) / max(f, 1e-300)))
    # row 0 is towards the bottom of the solid
    flip = rise < 0.0
    put_weighted(points[1 if flip else 0], -d0, sub(x0, scale(0.5 * d0, n0)), scale(-1.0, n0),
              weight * both)  # fmt: skip
    put_weighted(points[0 if flip else 1], -d1, sub(x1, scale(0.5 * d1, n1)), scale(-1.0, n1),
              weight * both)  # fmt: skip
    if both == 0.0:
        x0, x1 = sub(q, scale(half, e)), add(q, scale(half, e))
    x = add(x0, scale(crossing_of(low, high, x0, x1, n), sub(x1, x0)))
    put_weighted(points[2], f, sub(x, scale(0.5 * f, n)), n, 1.0 - both)
    return side_faces(n, out)


@jitable
def end_on_edge(
    i: Shape, j: Shape, end: int, axes: tuple[int, int, int], n: V3, f: float, points: F2
) -> float:
    """Write the ends of the part of the box's edge that faces an end of I and lies over it.

    Returns the part of the force that they carry, -1 where nothing lies over it.
    """
    centre, o, r = end_disc(i, end)
    q = j[1]
    for h in axes[:2]:
        a = edge_axis(j, h)
        q = add(q, scale(j[5][h] if dot(a, n) >= 0.0 else -j[5][h], a))
    e = scale(j[5][axes[2]], edge_axis(j, axes[2]))
    return segment_on_disc(points, 0, sub(q, e), add(q, e), (centre, r), o, n, 1.0, f)


@jitable
def solid_on_box(i: Shape, j: Shape, points: F2) -> int:
    """Write the points of a solid of revolution I on a box J."""
    f, n = least(i, j)
    middle = scale(0.5, add(far(i, scale(-1.0, n)), far(j, n)))
    if f <= 0.0:
        put_apart(points, 0, BOX_ROWS, f, middle, n)
        return BOX_ROWS
    put_apart(points, 0, BOX_ROWS, -(widest(i[5]) + i[5][2]), middle, n)
    axes = first_two(j, n)
    k = axes[0]
    end = end_facing(i, scale(-1.0, n))
    on_face = abs(dot(edge_axis(j, k), n)) > math.sqrt(0.5)
    part, crossed, lies = -1.0, end == 0 and not on_face, 0.0
    if end != 0:
        if on_face:
            part = disc_on_face(i, j, end, k, n, f, points)
        part = shared(points, 0, AT_EDGE, part, False, f)
        # what lies on a face is on none of its edges
        lies = (1.0 - part) * max(0.0, end_on_edge(i, j, end, axes, n, f, points[AT_EDGE:]))
        lies = shared(points, AT_EDGE, BOX_ROWS - 1, lies, False, f)
    elif on_face:
        part = line_on_face(i, j, k, n, f, points)
        if part < 0.0:
            # it leaves the face where it crosses an edge
            part, crossed = side_on_edge(i, j, axes, n, f, points), True
    else:
        part = side_on_edge(i, j, axes, n, f, points)
    p = middle_of_one(i, j, axes, n, f)
    # all of a face, a side or an end is farthest, but for rounding: not there if none is over it
    room = f + ROUNDING * widest(i[5])
    if not (lies_in(i, p, room) and lies_in_box(j, p, room)):
        p = deepest_place(points, BOX_ROWS - 1, p, -NEARLY * widest(i[5]))
    if end == 0:
        share_with_one(points, BOX_ROWS - 1, part, crossed, f, p, n)
    else:
        put_weighted(points[BOX_ROWS - 1], f, p, n, 1.0 - part - lies)
    return BOX_ROWS


@jitable
def lies_in_box(j: Shape, p: V3, room: float) -> bool:
    """Return whether p lies in a box, or no farther outside than `room`."""
    d = sub(p, j[1])
    for k in range(3):
        if abs(dot(d, edge_axis(j, k))) > j[5][k] + room:
            return False
    return True


@jitable
def middle_of_one(i: Shape, j: Shape, axes: tuple[int, int, int], n: V3, f: float) -> V3:
    """Return the place of one point: at a rim, a corner, or where side and edge cross."""
    low, high = far(i, scale(-1.0, n)), far(j, n)
    # a box has one farthest point where n is along no face and across no edge
    corner = min(abs(dot(j[2], n)), min(abs(dot(j[3], n)), abs(dot(j[4], n))))
    if pointed(i, scale(-1.0, n)) > max(corner, SINGLE):
        return add(low, scale(0.5 * f, n))
    e = edge_axis(j, axes[2])
    if abs(dot(e, n)) < 1e-6 and end_facing(i, scale(-1.0, n)) == 0:
        # all of an edge is farthest
        low, up, _ = side_line(i, scale(-1.0, n))
        first = sub(high, scale(dot(sub(high, j[1]), e) + j[5][axes[2]], e))
        way = scale(2.0 * j[5][axes[2]], e)
        high = add(first, scale(crossing_of(low, up, first, add(first, way), n), way))
    return sub(high, scale(0.5 * f, n))


@pair("CYLINDER", "BOX", slots=BOX_ROWS, regroups=True)
def cylinder_box(frame_i: F1, size_i: F1, frame_j: F1, size_j: F1, points: F2) -> int:
    """Standing, lying, leaning or rolling over an edge."""
    i = placed(ROTOR, frame_i, cylinder_size(size_i))
    return solid_on_box(i, placed(BOX, frame_j, vector(size_j)), points)


@pair("FRUSTUM", "BOX", slots=BOX_ROWS, regroups=True)
def frustum_box(frame_i: F1, size_i: F1, frame_j: F1, size_j: F1, points: F2) -> int:
    """Standing, lying, leaning or rolling over an edge."""
    i = placed(ROTOR, frame_i, vector(size_i))
    return solid_on_box(i, placed(BOX, frame_j, vector(size_j)), points)


@jitable
def face_below(j: Shape, points: F2, count: int) -> tuple[bool, tuple[V3, V3, V3, V3]]:
    """Return whether some row touches, and the face of box J that looks most along its normal.

    The face is its centre, its half edges and its outward normal.
    """
    deepest = 0
    for row in range(1, count):
        if points[row, AT_DEPTH] > points[deepest, AT_DEPTH]:
            deepest = row
    n = vector(points[deepest, AT_NORMAL:])
    k = first_two(j, n)[0]
    k1, k2 = (k + 1) % 3, (k + 2) % 3
    o = edge_axis(j, k)
    o = scale(1.0 if dot(o, n) >= 0.0 else -1.0, o)
    a, b = scale(j[5][k1], edge_axis(j, k1)), scale(j[5][k2], edge_axis(j, k2))
    return points[deepest, AT_DEPTH] > 0.0, (add(j[1], scale(j[5][k], o)), a, b, o)


@region("CYLINDER", "BOX", whole=3.0)
def cylinder_box_region(
    frame_i: F1, size_i: F1, frame_j: F1, size_j: F1, points: F2
) -> tuple[int, float]:
    """The points, and the cut of the cylinder with the box's face."""
    j = placed(BOX, frame_j, vector(size_j))
    count = solid_on_box(placed(ROTOR, frame_i, cylinder_size(size_i)), j, points)
    touches, face = face_below(j, points, count)
    area = cylinder_on_rectangle(frame_i, size_i[0], size_i[1], face) if touches else 0.0
    return count, area


@region("FRUSTUM", "BOX", whole=3.0)
def frustum_box_region(
    frame_i: F1, size_i: F1, frame_j: F1, size_j: F1, points: F2
) -> tuple[int, float]:
    """The points, and the part of an end that is below the box's face."""
    i, j = placed(ROTOR, frame_i, vector(size_i)), placed(BOX, frame_j, vector(size_j))
    count = solid_on_box(i, j, points)
    touches, face = face_below(j, points, count)
    if not touches:
        return count, 0.0
    centre, o, r = end_disc(i, -1 if dot(i[4], face[3]) >= 0.0 else 1)
    return count, disc_on_rectangle(centre, o, r, face)
