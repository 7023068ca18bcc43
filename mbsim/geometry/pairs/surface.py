"""Meshes that need not be convex: contact patches on a plane and on each other.

`size` of a mesh has the address of its packed surface (`model.surface`) as its fourth number.
"""

from __future__ import annotations

import numpy as np

from mbsim.core.arrays import F1, F2, V3
from mbsim.core.jitable import jitable
from mbsim.core.memory import floats_at
from mbsim.core.rotation import add, dot, norm, scale, sub, vector
from mbsim.geometry.catalog import (
    AT_POINT,
    AT_WEIGHT,
    COUPLE,
    COUPLE_OF_FORCE,
    REGION_ROWS,
    axis,
    motion_bound,
    pair,
    put_couple,
    put_couple_of_force,
    put_point,
)
from mbsim.geometry.mesh.ball import (
    NEAR_NORMAL,
    NEAR_NUMBERS,
    NEAR_POINT,
    NEAR_WEIGHT,
    in_reach,
    measure_near,
    merge_points,
    nearest_triangle,
    strongest_points,
    through_wall,
    triangles_near,
)
from mbsim.geometry.mesh.common_sides import sides_between
from mbsim.geometry.mesh.distance import least_gap
from mbsim.geometry.mesh.merging import (
    AT_NODE,
    MOST_PEAKS,
    NORMAL,
    PEAK_NUMBERS,
    merge,
    strongest,
    write_points,
)
from mbsim.geometry.mesh.motion import ball_time, mesh_time
from mbsim.geometry.mesh.oriented import place, place_back
from mbsim.geometry.mesh.overlap import (
    box_gap,
    common_middle,
    nodes_of,
    partners_of,
)
from mbsim.geometry.mesh.plane import lowest_corner, pieces_below, triangles_below
from mbsim.geometry.mesh.record import BEYOND, PEAK, VOLUME
from mbsim.geometry.mesh.sides import join_sides, sides_below
from mbsim.geometry.mesh.tree import box_square
from mbsim.geometry.motion import ACCELERATION, ASKED, SPIN, VELOCITY
from mbsim.geometry.polyhedron import to_global
from mbsim.model.surface import (
    AT_BOXES,
    AT_KEPT,
    AT_SHELLS,
    AT_TRIANGLES,
    DEPTH,
    HEADER,
    LENGTH,
    NODE,
    SOLID,
    TRIANGLE,
    TRIANGLES,
)

PATCH_SLOTS = MOST_PEAKS * REGION_ROWS
#: A peak with this part of its depth at the inner end of a layer may be deeper.
AT_END = 0.9
#: Part of a mesh's volume in another mesh from which all of it is.
ALL = 0.999


@jitable
def surface_of(size: F1) -> F1:
    """Return the packed surface of a shape."""
    return floats_at(size[3], floats_at(size[3], float(HEADER))[LENGTH])


@pair("SURFACE", "PLANE", slots=PATCH_SLOTS, regroups=True, patches=True)
def surface_plane(frame_i: F1, size_i: F1, frame_j: F1, size_j: F1, points: F2) -> int:
    """The peaks of the patches below the plane; apart, the lowest corner."""
    mesh, up = surface_of(size_i), axis(frame_j, 2)
    n = (dot(axis(frame_i, 0), up), dot(axis(frame_i, 1), up), dot(axis(frame_i, 2), up))
    height = dot(sub(vector(frame_j), vector(frame_i)), up)
    low, corner = lowest_corner(mesh, n)
    at = add(vector(frame_i), to_global(frame_i, corner))
    if low >= height:
        for k in range(len(points)):
            put_point(points[k], height - low, add(at, scale(0.5 * (height - low), up)), up)
        return len(points)
    found = np.empty(int(mesh[TRIANGLES]), np.int64)
    count = triangles_below(mesh, n, height, found)
    nodes, links, partners = pieces_below(mesh, found[:count], n, height, corner)
    on = np.empty(count, np.int64)
    flat = sides_below(mesh, found[:count], n, height, corner, nodes, on)
    peaks = np.empty((count + len(flat), PEAK_NUMBERS))
    count = merge(nodes, links, partners, on, flat, peaks)
    for k in range(count):
        # what faces up (the inside of a cup's bottom) does not press on the plane
        if dot(vector(peaks[k, NORMAL:]), n) <= 0.0:
            peaks[k, 1] = 0.0
    count = strongest(peaks, join_sides(peaks, count, flat), MOST_PEAKS)
    write_points(peaks, count, frame_i, at, points)
    for k in range(0, REGION_ROWS * count, REGION_ROWS):
        # half way between the surface of the mesh and the plane
        p, depth = vector(points[k, AT_POINT:]), points[k, 0]
        p = add(p, scale(-0.5 * depth - dot(sub(p, vector(frame_j)), up), up))
        couple, of_force = vector(points[k, COUPLE:]), vector(points[k, COUPLE_OF_FORCE:])
        put_point(points[k], depth, p, up, points[k, AT_WEIGHT])
        put_couple(points[k], couple)
        put_couple_of_force(points[k], of_force)
    return len(points)


@jitable
def pose_of(frame_i: F1, frame_j: F1) -> F1:
    """Return I in J's axes: origin, then the rotation by rows."""
    pose, apart = np.empty(12), sub(vector(frame_i), vector(frame_j))
    for r in range(3):
        row = axis(frame_j, r)
        pose[r] = dot(apart, row)
        for c in range(3):
            pose[3 + 3 * r + c] = dot(row, axis(frame_i, c))
    return pose


@jitable
def far_apart(gap: float, frame_j: F1, points: F2) -> int:
    """Write that two meshes are at least so far apart, in no direction that would be known."""
    for k in range(len(points)):
        put_point(points[k], -gap, vector(frame_j), (0.0, 0.0, 0.0))
    return len(points)


@jitable
def in_core(mesh: F1, c: V3) -> bool:
    """Return whether a point lies below the layer of a mesh, by the depth of the nearest triangle.

    Half of that depth tells it from a point on the surface, which may be inside by rounding.
    """
    edges, row = np.empty(3), np.empty(NEAR_NUMBERS)
    _, nearest = nearest_triangle(mesh, c, edges)
    if measure_near(mesh, nearest, c, 0.0, row, edges) > 0.0:
        return False
    at = int(mesh[AT_TRIANGLES]) + TRIANGLE * nearest + DEPTH
    return row[0] > 0.5 * min(mesh[at], mesh[at + 1], mesh[at + 2])


@jitable
def shell_within(mesh: F1, side: int, pairs: F2, other: F1, pose: F1) -> bool:
    """Return whether a shell of a mesh lies in the core of another mesh, below its layer.

    All of a shell is inside or outside where no piece of it is in a layer. `pairs` are those of
    triangles that have pieces; the mesh's own are in column `side`. `pose` is that of I in J's
    axes; the mesh is I for side 0, J for side 1.
    """
    at = int(mesh[AT_SHELLS])
    count = int(mesh[AT_KEPT]) - at - int(mesh[TRIANGLES])
    for shell in range(count):
        p = vector(mesh, int(mesh[AT_TRIANGLES]) + TRIANGLE * int(mesh[at + shell]))
        p = place(pose, p) if side == 0 else place_back(pose, p)
        inside = box_square(other, int(other[AT_BOXES]) + NODE, p) == 0.0
        for k in range(len(pairs)):
            if not inside or int(mesh[at + count + int(pairs[k, side])]) == shell:
                inside = False
                break
        if inside and in_core(other, p):
            return True
    return False


@jitable
def all_in(mesh_i: F1, mesh_j: F1, nodes: F2) -> bool:
    """Return whether the overlap of two meshes has the volume of the smaller one."""
    volume = 0.0
    for k in range(len(nodes)):
        volume += nodes[k, VOLUME]
    return volume > ALL * min(mesh_i[SOLID], mesh_j[SOLID])


@jitable
def swallowed(mesh_i: F1, mesh_j: F1, pairs: F2, pose: F1) -> bool:
    """Return whether a shell of one of two meshes lies in the core of the other one."""
    return shell_within(mesh_i, 0, pairs, mesh_j, pose) or shell_within(
        mesh_j, 1, pairs, mesh_i, pose
    )


@jitable
def without_pieces(mesh_i: F1, mesh_j: F1, pose: F1, frame_j: F1, points: F2, part: float) -> int:
    """Write that no piece of two meshes' surfaces overlaps: they are apart, or one is in the other.

    Their distance is known to a `part` of it. Within each other it is 0: the pair is looked at
    again at every step.
    """
    if swallowed(mesh_i, mesh_j, np.empty((0, 2)), pose):
        return -far_apart(0.0, frame_j, points)
    return far_apart(least_gap(mesh_i, mesh_j, pose, part), frame_j, points)


@pair("SURFACE", "SURFACE", slots=PATCH_SLOTS, regroups=True, patches=True)
def surface_surface(frame_i: F1, size_i: F1, frame_j: F1, size_j: F1, points: F2) -> int:
    """The peaks of the patches in which two meshes overlap."""
    mesh_i, mesh_j = surface_of(size_i), surface_of(size_j)
    pose = pose_of(frame_i, frame_j)
    root_i, root_j = int(mesh_i[AT_BOXES]) + NODE, int(mesh_j[AT_BOXES]) + NODE
    gap = box_gap(mesh_i[root_i:], mesh_j[root_j:], pose)
    if gap > 0.0:
        return far_apart(gap, frame_j, points)
    # the middle of what both roots have in common is near the patches
    origin = common_middle(mesh_i[root_i:], mesh_j[root_j:], pose)
    count, nodes, values, pairs = nodes_of(mesh_i, mesh_j, pose, origin, points)
    if count == 0:
        return without_pieces(mesh_i, mesh_j, pose, frame_j, points, 1.0)
    pairs, inside = pairs[:count], all_in(mesh_i, mesh_j, nodes[:count])
    partners, on = partners_of(mesh_i, mesh_j, count, values, pairs), np.empty(count, np.int64)
    flat = sides_between(mesh_i, mesh_j, pose, origin, nodes[:count], pairs, on)
    peaks = np.empty((count + len(flat), PEAK_NUMBERS))
    count = merge(nodes[:count], values[:count], partners, on, flat, peaks)
    known = -1 if inside or swallowed(mesh_i, mesh_j, pairs, pose) else 1
    for k in range(count):
        patch = nodes[int(peaks[k, AT_NODE])]
        if patch[BEYOND] > AT_END * patch[PEAK]:
            known = -1
    count = strongest(peaks, join_sides(peaks, count, flat), MOST_PEAKS)
    at = add(vector(frame_j), to_global(frame_j, origin))
    write_points(peaks, count, frame_j, at, points)
    return known * len(points)


@jitable
def turned_motion(motion: F1, frame_j: F1) -> F1:
    """Return a motion in J's axes."""
    turned = motion.copy()
    for at in (VELOCITY, ACCELERATION, SPIN):
        for k in range(3):
            turned[at + k] = dot(axis(frame_j, k), vector(motion, at))
    return turned


@motion_bound("SURFACE", "SURFACE")
def surface_bound(frame_i: F1, size_i: F1, frame_j: F1, size_j: F1, motion: F1) -> int:
    """Two meshes."""
    turned, pose = turned_motion(motion, frame_j), pose_of(frame_i, frame_j)
    motion[ASKED] = mesh_time(turned, surface_of(size_i), surface_of(size_j), pose)
    return 0


@motion_bound("SPHERE", "SURFACE")
def sphere_bound(frame_i: F1, size_i: F1, frame_j: F1, size_j: F1, motion: F1) -> int:
    """A ball, which does not pass a mesh by turning."""
    apart = sub(vector(frame_i), vector(frame_j))
    c = (dot(apart, axis(frame_j, 0)), dot(apart, axis(frame_j, 1)), dot(apart, axis(frame_j, 2)))
    motion[ASKED] = ball_time(turned_motion(motion, frame_j), c, size_i[0], surface_of(size_j))
    return 0


@pair("SPHERE", "SURFACE", slots=MOST_PEAKS, regroups=True)
def sphere_surface(frame_i: F1, size_i: F1, frame_j: F1, size_j: F1, points: F2) -> int:
    """The nearest points of the mesh that stand out; inside, the nearest way out."""
    mesh, radius = surface_of(size_j), size_i[0]
    apart, edges = sub(vector(frame_i), vector(frame_j)), np.empty(3)
    c = (dot(apart, axis(frame_j, 0)), dot(apart, axis(frame_j, 1)), dot(apart, axis(frame_j, 2)))
    _, nearest = nearest_triangle(mesh, c, edges)
    row = np.empty(NEAR_NUMBERS)
    measure_near(mesh, nearest, c, radius, row, edges)
    count, least, known = 0, -0.0, 1
    rows = row.reshape(1, NEAR_NUMBERS)
    if row[0] > 0.0:
        found = np.empty(int(mesh[TRIANGLES]), np.int64)
        count = triangles_near(mesh, c, radius, found)
        rows, links, partners = in_reach(mesh, c, radius, nearest, found[:count])
        merge_points(rows, links, partners)
        count = strongest_points(rows, len(points))
        known = -1 if through_wall(mesh, row, radius) else 1
    else:
        least = row[0]
    for k in range(len(points)):
        at = rows[min(k, max(count - 1, 0))]
        n = to_global(frame_j, vector(at, NEAR_NORMAL))
        p = add(vector(frame_j), to_global(frame_j, vector(at, NEAR_POINT)))
        size = norm(n)
        depth = at[0] if k < count else least
        weight = at[NEAR_WEIGHT] if k < count else 1.0
        put_point(points[k], depth, add(p, scale(-0.5 * depth, n)), scale(1.0 / size, n), weight)
    return known * len(points)
