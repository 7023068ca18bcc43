"""Convex meshes on a plane, on a box and on each other; a sphere on a convex mesh.

`size` of a mesh is address and length of its packed polyhedron (`model.hull`).
"""

from __future__ import annotations

import math

from mbsim.core.arrays import F1, F2, V3
from mbsim.core.blend import step, step_derivative
from mbsim.core.jitable import jitable
from mbsim.core.memory import floats_at
from mbsim.core.rotation import add, any_tangent, cross, dot, scale, sub, vector
from mbsim.geometry.catalog import (
    AT_DEPTH,
    AT_NORMAL,
    AT_WEIGHT,
    COUPLE,
    axis,
    pair,
    put_couple,
    put_point,
    region,
)
from mbsim.geometry.crossing import LEAST_WEIGHT
from mbsim.geometry.polyhedron import (
    CUBE,
    HULL_SLOTS,
    hull_slots,
    moved,
    overlapping,
    to_global,
    way_out,
)
from mbsim.model.flat_sides import LEANS, LIES
from mbsim.model.hull import (
    AT_CORNERS,
    AT_DATA,
    AT_LOOPS,
    AT_PLANES,
    AT_SIDES,
    AT_STARTS,
    AT_WEIGHTS,
    CORNERS,
    FACES,
    MOST_ROWS,
    ROWS,
)


@jitable
def _weights_of_patches(hull: F1, local: V3, points: F2) -> None:
    """Fill the weights of the patches of a fine mesh over a plane of normal `local`.

    The corners of a side that lies share 4 among them, as those of a box do; as far as none
    lies, the deepest corner has a weight of 1, in the last row. Facets of a round surface are no
    sides. The normals are the mean of a row's corners of such sides. The couples are those of
    energy in the mesh's axes.
    """
    rows, deepest, flat, total = int(hull[ROWS]), 0, 0.0, 0.0
    flatter, more, last_row = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), int(hull[ROWS]) - 1
    planes, starts = int(hull[AT_PLANES]), int(hull[AT_STARTS])
    loops, data, corners = int(hull[AT_LOOPS]), int(hull[AT_DATA]), int(hull[AT_CORNERS])
    for row in range(rows):
        points[row, AT_WEIGHT] = 0.0
        for c in range(3):
            points[row, AT_NORMAL + c] = points[row, COUPLE + c] = 0.0
        if points[row, AT_DEPTH] > points[deepest, AT_DEPTH]:
            deepest = row
    for f in range(int(hull[FACES])):
        side, as_side = vector(hull, planes + 4 * f), hull[int(hull[AT_SIDES]) + f]
        lies = as_side * step(-dot(side, local), LEANS, 0.0, LIES, 1.0)
        if lies > 0.0:
            slope = as_side * step_derivative(-dot(side, local), LEANS, 0.0, LIES, 1.0, 1)
            turns = scale(slope, cross(local, side))
            if lies > flat:
                flat, flatter = lies, turns
            total, more = total + lies, add(more, turns)
            first, last = int(hull[starts + f]), int(hull[starts + f + 1])
            for at in range(first, last):
                corner, weight = int(hull[loops + 2 * at]), 4.0 * lies / (last - first)
                row = int(hull[data + 3 * corner + 2])
                points[row, AT_WEIGHT] += weight
                for c in range(3):
                    points[row, AT_NORMAL + c] += weight * hull[corners + 3 * corner + c]
                    points[row, COUPLE + c] -= 4.0 / (last - first) * turns[c]
    for row in range(rows):
        weight = points[row, AT_WEIGHT]
        if weight > 0.0:
            for c in range(3):
                points[row, AT_NORMAL + c] /= weight
                change = (flatter[c] - flat / total * more[c]) * weight / total
                points[row, COUPLE + c] = flat / total * points[row, COUPLE + c] - change
            points[row, AT_WEIGHT] *= flat / total
    points[last_row, AT_DEPTH], points[last_row, 1] = points[deepest, AT_DEPTH], points[deepest, 1]
    points[last_row, AT_WEIGHT] = 1.0 - flat
    for c in range(3):
        points[last_row, COUPLE + c] = flatter[c]


@pair("MESH", "PLANE", slots=MOST_ROWS)
def mesh_plane(frame_i: F1, size_i: F1, frame_j: F1, size_j: F1, points: F2) -> int:
    """Every corner below the plane is a point; of a patch of corners its deepest one.

    A mesh with more corners than rows stands for a curved surface: its deepest corner alone has
    the whole force, unless a face lies flat (see `_weights_of_patches`). Of that a patch has the
    mean of its corners: all are as deep, and which one is the deepest is rounding.
    """
    hull = floats_at(size_i[0], size_i[1])
    n = axis(frame_j, 2)
    height = dot(sub(vector(frame_i), vector(frame_j)), n)
    local = (dot(axis(frame_i, 0), n), dot(axis(frame_i, 1), n), dot(axis(frame_i, 2), n))
    rows = int(hull[ROWS])
    corners, data = int(hull[AT_CORNERS]), int(hull[AT_DATA])
    weights = int(hull[AT_WEIGHTS])
    for row in range(rows):
        points[row, AT_DEPTH] = -math.inf
    for k in range(int(hull[CORNERS])):
        row = int(hull[data + 3 * k + 2])
        depth = -height - dot(vector(hull, corners + 3 * k), local)
        if depth > points[row, AT_DEPTH]:
            # remember which corner; its place follows once
            points[row, AT_DEPTH], points[row, 1] = depth, k
    fine = int(hull[CORNERS]) > rows
    if fine:
        _weights_of_patches(hull, local, points)
    else:
        for row in range(rows):
            points[row, AT_WEIGHT] = hull[weights + row]
    for row in range(rows):
        depth, p = points[row, AT_DEPTH], vector(hull, corners + 3 * int(points[row, 1]))
        couple, weight = (0.0, 0.0, 0.0), points[row, AT_WEIGHT]
        if fine:
            couple = to_global(frame_i, vector(points[row, COUPLE:]))
            if row < rows - 1 and weight > 0.0:
                p = vector(points[row, AT_NORMAL:])
                depth = -height - dot(p, local)
        p = add(vector(frame_i), to_global(frame_i, p))
        put_point(points[row], depth, add(p, scale(0.5 * depth, n)), n, weight)
        put_couple(points[row], couple)
        if points[row, AT_WEIGHT] <= LEAST_WEIGHT:
            # a point without force is none
            points[row, AT_DEPTH] = min(depth, 0.0)
    return rows


@jitable
def _two_hulls(frame_i: F1, hull_i: F1, frame_j: F1, hull_j: F1, points: F2) -> int:
    """Write the points of two polyhedra; rows without a point hold the gap, 0 in overlap."""
    rows = hull_slots(hull_i, hull_j)
    for row in range(rows):
        put_point(points[row], 0.0, vector(frame_j), axis(frame_j, 2))
    gap = overlapping(moved(hull_i, frame_i, frame_j), hull_j, frame_j, points)
    if gap > 0.0:
        for row in range(rows):
            points[row, AT_DEPTH] = -gap
    return rows


@pair("MESH", "MESH", slots=HULL_SLOTS, regroups=True)
def mesh_mesh(frame_i: F1, size_i: F1, frame_j: F1, size_j: F1, points: F2) -> int:
    """The common polygon of the two faces that look at each other."""
    hull_i, hull_j = floats_at(size_i[0], size_i[1]), floats_at(size_j[0], size_j[1])
    return _two_hulls(frame_i, hull_i, frame_j, hull_j, points)


@pair("MESH", "BOX", slots=HULL_SLOTS, regroups=True)
def mesh_box(frame_i: F1, size_i: F1, frame_j: F1, size_j: F1, points: F2) -> int:
    """A box is a polyhedron too."""
    box = CUBE.copy()
    corners, planes = int(box[AT_CORNERS]), int(box[AT_PLANES])
    for k in range(int(box[CORNERS])):
        for c in range(3):
            box[corners + 3 * k + c] *= size_j[c]
    for f in range(int(box[FACES])):
        reach = 0.0
        for c in range(3):
            reach += abs(box[planes + 4 * f + c]) * size_j[c]
        box[planes + 4 * f + 3] = reach
    return _two_hulls(frame_i, floats_at(size_i[0], size_i[1]), frame_j, box, points)


@pair("SPHERE", "MESH", slots=1)
def sphere_mesh(frame_i: F1, size_i: F1, frame_j: F1, size_j: F1, points: F2) -> int:
    """The nearest point of the mesh to the centre; inside, the way out through the nearest face."""
    hull = floats_at(size_j[0], size_j[1])
    apart = sub(vector(frame_i), vector(frame_j))
    c = (dot(apart, axis(frame_j, 0)), dot(apart, axis(frame_j, 1)), dot(apart, axis(frame_j, 2)))
    distance, n = way_out(hull, c)
    n = to_global(frame_j, n)
    depth = size_i[0] - distance
    put_point(points[0], depth, sub(vector(frame_i), scale(size_i[0] - 0.5 * depth, n)), n)
    return 1


@jitable
def hull_cut(hull: F1, height: float, n: V3) -> float:
    """Return the area of the cut of a polyhedron with a plane of normal n in its axes.

    `height` is that of its origin. As of a box every face that is crossed has one side of it.
    """
    u = any_tangent(n)
    v = cross(n, u)
    corners, starts, loops = int(hull[AT_CORNERS]), int(hull[AT_STARTS]), int(hull[AT_LOOPS])
    total = 0.0
    for f in range(int(hull[FACES])):
        up_x, up_y, down_x, down_y = 0.0, 0.0, 0.0, 0.0
        first, last = int(hull[starts + f]), int(hull[starts + f + 1])
        for at in range(first, last):
            after = at + 1 if at + 1 < last else first
            here = vector(hull, corners + 3 * int(hull[loops + 2 * at]))
            there = vector(hull, corners + 3 * int(hull[loops + 2 * after]))
            low, high = height + dot(here, n), height + dot(there, n)
            if (low < 0.0) == (high < 0.0):
                continue
            q = add(here, scale(low / (low - high), sub(there, here)))
            if low < 0.0:
                up_x, up_y = dot(q, u), dot(q, v)
            else:
                down_x, down_y = dot(q, u), dot(q, v)
        total += 0.5 * (up_x * down_y - up_y * down_x)
    return abs(total)


@region("MESH", "PLANE", whole=4.0)
def mesh_plane_region(
    frame_i: F1, size_i: F1, frame_j: F1, size_j: F1, points: F2
) -> tuple[int, float]:
    """The corners below the plane, and the cut of the mesh with the plane."""
    count = mesh_plane(frame_i, size_i, frame_j, size_j, points)
    hull, n = floats_at(size_i[0], size_i[1]), axis(frame_j, 2)
    height = dot(sub(vector(frame_i), vector(frame_j)), n)
    local = (dot(axis(frame_i, 0), n), dot(axis(frame_i, 1), n), dot(axis(frame_i, 2), n))
    return count, hull_cut(hull, height, local)
