"""A cylinder or a frustum that lies on a convex mesh, as rigid contact has it.

A compliant force is the slope of one energy, for which one point of a crowned solid stands
(`geometry.pairs.round_mesh`). Rigid contact needs all points that hold a body: of an end that
lies on a face its rim and the corners of what both have in common, of a side that lies on a face
both ends of the line, and the same on an edge. As on a box (`geometry.pairs.revolution_box`), what
is tilted until it touches at no more than one place has one point.

All is in the mesh's axes.
"""

from __future__ import annotations

import math

import numpy as np

from mbsim.core.arrays import F1, F2, V3
from mbsim.core.jitable import jitable
from mbsim.core.memory import floats_at
from mbsim.core.rotation import add, cross, dot, norm, scale, sub, vector
from mbsim.geometry.catalog import (
    AT_DEPTH,
    AT_NORMAL,
    AT_POINT,
    AT_WEIGHT,
    axis,
    put_point,
    rigid_pair,
)
from mbsim.geometry.convex import BOX, ROTOR, Shape, far
from mbsim.geometry.face_edges import (
    CUT,
    TURNS,
    chord_normals,
    corner_turn,
    cut_edge,
    end_at_corners,
    fill_arcs,
)
from mbsim.geometry.manifold import (
    ARC_ROWS,
    TURN,
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
    shared,
    side_faces,
)
from mbsim.geometry.mesh.merging import to_local
from mbsim.geometry.pairs.revolution import cylinder_size
from mbsim.geometry.pairs.revolution_box import SINGLE, side_on_edge
from mbsim.geometry.pairs.round_mesh import (
    high_corner,
    highest_row,
    least_overlap,
)
from mbsim.geometry.polyhedron import corner, plane, to_global
from mbsim.geometry.rotor import (
    NEARLY,
    ROUNDING,
    end_disc,
    end_facing,
    lies_in,
    pointed,
    side_line,
    widest,
)
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

#: Edges of a face that have rows of their own; of one with more its edges share them in turn.
EDGE_ROWS = 12
#: Rows: of an end on a face 6 for the rim, then 2 for each edge; of an edge under an end or a side
#: two ends and a crossing; one point.
AT_EDGE = ARC_ROWS + 2 * EDGE_ROWS
AT_ONE = AT_EDGE + 3
RIGID_ROWS = AT_ONE + 1
#: A face or an end seen nearer to edge-on than this cosine has nothing in common with another.
EDGE_ON = 1e-3


@jitable
def facing(hull: F1, n: V3) -> int:
    """Return the face whose normal is nearest to n."""
    return highest_row(hull, int(hull[AT_PLANES]), 4, int(hull[FACES]), n)


@jitable
def edge_facing(hull: F1, n: V3) -> Shape:
    """Return the edge at the highest corner that is most square to n, as a box without width.

    The third axis of the box is along the edge.
    """
    k = highest_row(hull, int(hull[AT_CORNERS]), 3, int(hull[CORNERS]), n)
    at, best = int(hull[AT_EDGES]), math.inf
    p, q = corner(hull, hull[at]), corner(hull, hull[at + 1])
    for edge in range(int(hull[EDGES])):
        row = at + 4 * edge
        if int(hull[row]) != k and int(hull[row + 1]) != k:
            continue
        a, b = corner(hull, hull[row]), corner(hull, hull[row + 1])
        along = abs(dot(sub(b, a), n)) / norm(sub(b, a))
        if along < best:
            best, p, q = along, a, b
    way = sub(q, p)
    half = 0.5 * norm(way)
    e = scale(0.5 / half, way)
    across = cross(e, n)
    # no length to speak of where the edge is along n: then nothing lies on it
    across = scale(1.0 / max(norm(across), 1e-300), across)
    return (BOX, scale(0.5, add(p, q)), cross(across, e), across, e, (0.0, 0.0, half))


@jitable
def is_in(hull: F1, p: V3, room: float) -> bool:
    """Return whether p lies in a polyhedron, or no farther outside than `room`."""
    at = int(hull[AT_PLANES])
    for face in range(int(hull[FACES])):
        if dot(vector(hull, at + 4 * face), p) - hull[at + 4 * face + 3] > room:
            return False
    return True


@jitable
def put_shared(points: F2, work: F2, count: int, disc: tuple[V3, V3, V3, float, float, float],
               n: V3, weight: float) -> None:  # fmt: skip
    """Write where the edges of a face enter and leave the disc; edges may share rows.

    What shares a row is there with its mean, for all of it is in one plane.
    """
    centre, u, v, _, depth0, rise = disc
    sums = np.zeros((2 * EDGE_ROWS, 3))
    for e in range(count):
        row = work[2 * e]
        if row[CUT] == 0.0:
            continue
        before = work[2 * ((e + count - 1) % count) + 1, TURNS]
        at = 2 * (e if count <= EDGE_ROWS else e * EDGE_ROWS // count)
        for side in range(2):
            angle, x, y = corner_turn(row, work[2 * e + 1, TURNS], before, side)
            sums[at + side, 0] += angle
            sums[at + side, 1] += angle * x
            sums[at + side, 2] += angle * y
    for k in range(2 * EDGE_ROWS):
        angle = sums[k, 0]
        if angle <= 0.0:
            continue
        x, y = sums[k, 1] / angle, sums[k, 2] / angle
        depth = depth0 + rise * x
        p = add(centre, add(scale(x, u), scale(y, v)))
        p = add(p, scale(0.5 * depth, n))
        put_weighted(points[ARC_ROWS + k], depth, p, n, weight * angle / TURN)


@jitable
def end_on_face(hull: F1, face: int, i: Shape, end: int, n: V3, f: float, points: F2) -> float:
    """Write the patch of an end of the solid on a face of the mesh.

    Returns the part of the force that it carries, -1 where there is none. All is drawn in the
    plane of the end, where it is a circle and the face, seen along n, a convex polygon. u points
    to where the end is deepest.
    """
    centre, o, r = end_disc(i, end)
    m = plane(hull, face)
    nf, no = dot(n, m), dot(n, o)
    if nf <= EDGE_ON or no >= -EDGE_ON or r <= 0.0:
        return -1.0
    u = sub(scale(dot(m, o), o), m)
    tilt = norm(u)
    u = scale(1.0 / tilt, u) if tilt > 1e-12 else i[2]
    v = cross(o, u)
    offset = hull[int(hull[AT_PLANES]) + 4 * face + 3]
    depth0, rise = (offset - dot(m, centre)) / nf, tilt / nf
    disc = (centre, u, v, r, depth0, rise)
    starts, loops = int(hull[AT_STARTS]), int(hull[AT_LOOPS])
    first, last = int(hull[starts + face]), int(hull[starts + face + 1])
    count = last - first
    work = np.zeros((2 * count, 8))

    # backwards the corners go round to the left, seen against o
    cuts, beyond, inside = 0, False, True
    low, high = math.inf, -math.inf
    for e in range(count):
        a = corner(hull, hull[loops + 2 * (last - 1 - e)])
        b = corner(hull, hull[loops + 2 * (last - 2 - e if e + 1 < count else last - 1)])
        # along n onto the plane of the end
        a = sub(sub(a, scale(dot(sub(a, centre), o) / no, n)), centre)
        b = sub(sub(b, scale(dot(sub(b, centre), o) / no, n)), centre)
        ax, ay, bx, by = dot(a, u), dot(a, v), dot(b, u), dot(b, v)
        low, high = min(low, ax), max(high, ax)
        if ax * by - ay * bx <= 0.0:
            inside = False
        code = cut_edge(work, e, ax, ay, bx, by, r)
        if code == 1:
            cuts += 1
        elif code == -1:
            beyond = True
    if cuts == 0 and (beyond or not inside):
        return -1.0
    end_at_corners(work, count)
    total = fill_arcs(work, count, cuts)
    weight = 4.0 - total / TURN
    way = work[1, TURNS]
    x, y = chord_normals(work, count)
    own = own_middle(x, y, math.cos(way), math.sin(way), r)
    put_rim(points, 0, work[1::2], count, disc, n, 1.0, total, own, weight, f)
    put_shared(points, work, count, disc, n, weight)
    return disc_lies(min(r, 0.5 * (high - low)), rise, f)


@jitable
def side_on_face(hull: F1, face: int, i: Shape, n: V3, f: float, points: F2) -> float:
    """Write the ends of the part of the solid's side line that lies over a face of the mesh.

    Returns the part of the force that they carry, -1 where nothing lies over it.
    """
    low, high, out = side_line(i, scale(-1.0, n))
    m = plane(hull, face)
    nf = dot(n, m)
    if nf <= EDGE_ON:
        return -1.0
    offset = hull[int(hull[AT_PLANES]) + 4 * face + 3]
    depth_low, depth_high = (offset - dot(m, low)) / nf, (offset - dot(m, high)) / nf
    way = sub(high, low)
    # on the face, seen along n
    start, stop = add(low, scale(depth_low, n)), add(high, scale(depth_high, n))
    starts, loops = int(hull[AT_STARTS]), int(hull[AT_LOOPS])
    begin, end = int(hull[starts + face]), int(hull[starts + face + 1])
    first, last = 0.0, 1.0
    a = corner(hull, hull[loops + 2 * (end - 1)])
    for at in range(begin, end):
        b = corner(hull, hull[loops + 2 * at])
        inward = cross(m, sub(b, a))
        y0, y1 = dot(inward, sub(start, a)), dot(inward, sub(stop, a))
        a = b
        if y0 < 0.0 and y1 < 0.0:
            return -1.0
        if y0 < 0.0:
            first = max(first, y0 / (y0 - y1))
        elif y1 < 0.0:
            last = min(last, y0 / (y0 - y1))
    # a rim on an edge: which side of it rounding leaves a line on tells nothing
    if last - first <= 1e-9:
        return -1.0
    weight = line_weight((last - first) * norm(way), widest(i[5]))
    rise = depth_high - depth_low
    for row in range(2):
        s = first if row == 0 else last
        depth = depth_low + s * rise
        p = add(add(low, scale(s, way)), scale(0.5 * depth, n))
        put_point(points[row], depth, p, n, weight)
    return line_lies(first * rise, last * rise, f) * side_faces(n, out)


@jitable
def place_of_one(hull: F1, i: Shape, edge: Shape, n: V3, f: float) -> V3:
    """Return the place of one point: at a rim, a corner, or where side and edge cross."""
    down = scale(-1.0, n)
    if pointed(i, down) > SINGLE:
        return add(far(i, down), scale(0.5 * f, n))
    high = high_corner(hull, n)
    if abs(dot(edge[4], n)) < 1e-6 and end_facing(i, down) == 0:
        # all of an edge is farthest
        low, up, _ = side_line(i, down)
        e = scale(edge[5][2], edge[4])
        first = sub(edge[1], e)
        high = add(first, scale(crossing_of(low, up, first, add(edge[1], e), n), scale(2.0, e)))
    return sub(high, scale(0.5 * f, n))


@jitable
def rows_on_hull(hull: F1, i: Shape, points: F2) -> None:
    """Write the rows of a solid on a convex mesh, all in the mesh's axes."""
    f, n = least_overlap(hull, i)
    down = scale(-1.0, n)
    if f <= 0.0:
        middle = scale(0.5, add(far(i, down), high_corner(hull, n)))
        put_apart(points, 0, RIGID_ROWS, f, middle, n)
        return
    put_apart(points, 0, RIGID_ROWS, -(widest(i[5]) + i[5][2]), i[1], n)
    face, end, edge = facing(hull, n), end_facing(i, down), edge_facing(hull, n)
    e = scale(edge[5][2], edge[4])
    if end != 0:
        part = end_on_face(hull, face, i, end, n, f, points)
        centre, o, r = end_disc(i, end)
        ends = (sub(edge[1], e), add(edge[1], e))
        other = segment_on_disc(points, AT_EDGE, ends[0], ends[1], (centre, r), o, n, 1.0, f)
    else:
        part = side_on_face(hull, face, i, n, f, points)
        other = -1.0
        if part < 0.0:
            # it leaves the face where it crosses an edge
            other = side_on_edge(i, edge, (0, 1, 2), n, f, points[AT_EDGE:])
    part = shared(points, 0, AT_EDGE, part, False, f)
    # what lies on a face is on none of its edges
    other = shared(points, AT_EDGE, AT_ONE, (1.0 - part) * max(0.0, other), end == 0, f)
    p = place_of_one(hull, i, edge, n, f)
    # all of a face, a side or an end is farthest, but for rounding: not there if none is over it
    room = f + ROUNDING * widest(i[5])
    if not (lies_in(i, p, room) and is_in(hull, p, room)):
        p = deepest_place(points, AT_ONE, p, -NEARLY * widest(i[5]))
    put_weighted(points[AT_ONE], f, p, n, 1.0 - part - other)


@jitable
def rotor_on_hull(frame_i: F1, size: V3, frame_j: F1, size_j: F1, points: F2) -> int:
    """Write the rows of a solid I on a convex mesh J."""
    x, y, z = axis(frame_i, 0), axis(frame_i, 1), axis(frame_i, 2)
    centre = to_local(frame_j, sub(vector(frame_i), vector(frame_j)))
    i = (ROTOR, centre, to_local(frame_j, x), to_local(frame_j, y), to_local(frame_j, z), size)
    rows_on_hull(floats_at(size_j[0], size_j[1]), i, points)
    for k in range(RIGID_ROWS):
        row = points[k]
        p = add(vector(frame_j), to_global(frame_j, vector(row[AT_POINT:])))
        n = to_global(frame_j, vector(row[AT_NORMAL:]))
        put_point(row, row[AT_DEPTH], p, n, row[AT_WEIGHT])
    return RIGID_ROWS


@rigid_pair("CYLINDER", "MESH", slots=RIGID_ROWS)
def rigid_cylinder_mesh(frame_i: F1, size_i: F1, frame_j: F1, size_j: F1, points: F2) -> int:
    """Standing, lying, leaning or rolling over an edge of a convex mesh."""
    return rotor_on_hull(frame_i, cylinder_size(size_i), frame_j, size_j, points)


@rigid_pair("FRUSTUM", "MESH", slots=RIGID_ROWS)
def rigid_frustum_mesh(frame_i: F1, size_i: F1, frame_j: F1, size_j: F1, points: F2) -> int:
    """Standing, lying, leaning or rolling over an edge of a convex mesh."""
    return rotor_on_hull(frame_i, vector(size_i), frame_j, size_j, points)
