"""Meshes that are not convex, as rigid contact has them: points that hold a body.

A compliant patch has one force at its centre of pressure (`geometry.pairs.surface`). Rigid contact
needs all points that hold a body. On a plane these are corners of the mesh; between meshes they are
corners on faces and edges on edges (`geometry.mesh.features`). Of many points those count that
would touch first if the body was tilted by a little, or by more: the support points of tilted
directions. Of a flat side these are its corners, of one with more than `FINE` as many spread ones.
"""

from __future__ import annotations

import math

import numpy as np

from mbsim.core.arrays import F1, F2, V3
from mbsim.core.jitable import jitable
from mbsim.core.rotation import add, cross, dot, norm, scale, sub, vector
from mbsim.geometry.catalog import (
    AT_DEPTH,
    AT_NORMAL,
    AT_POINT,
    AT_WEIGHT,
    axis,
    plane_axes,
    put_point,
    rigid_pair,
)
from mbsim.geometry.mesh.features import (
    FEATURE_NORMAL,
    FEATURE_POINT,
    deepest_feature,
    features_of,
)
from mbsim.geometry.mesh.overlap import box_gap, common_middle, nodes_of
from mbsim.geometry.mesh.plane import lowest_corner
from mbsim.geometry.mesh.record import BEYOND, MOMENT, PEAK, PRESSURE, PUSH
from mbsim.geometry.pairs.surface import (
    AT_END,
    all_in,
    far_apart,
    pose_of,
    surface_of,
    swallowed,
    without_pieces,
)
from mbsim.geometry.polyhedron import to_global
from mbsim.model.surface import AT_BOXES, NODE

#: Directions of tilts, and their tangents: of a flat side's corners, and of what is round.
FINE, COARSE = 12, 6
FINE_TILT, COARSE_TILT = 1e-3, 0.05
#: Rows: the deepest point, and one for each tilt.
EACH = 1 + FINE + COARSE
#: Points whose normals are within arccos of this are one cluster; clusters at most: the last one
#: has all that is left. A row behind them is for what has no features that look at each other.
ALIKE, CLUSTERS = 0.966, 6
SURFACE_ROWS = CLUSTERS * EACH + 1
#: Part of the distance that is known of what is apart.
KNOWN = 0.5
#: Points nearer than this part of what they lie on are one.
SAME = 1e-6


@jitable
def tilt_of(k: int, x: V3, y: V3) -> V3:
    """Return tilt k of a side whose plane has the axes x, y: its direction times its tangent."""
    fine = k < FINE
    angle = 2.0 * math.pi * (k / FINE if fine else (k - FINE + 0.5) / COARSE)
    size = FINE_TILT if fine else COARSE_TILT
    return add(scale(size * math.cos(angle), x), scale(size * math.sin(angle), y))


@rigid_pair("SURFACE", "PLANE", slots=EACH)
def rigid_surface_plane(frame_i: F1, size_i: F1, frame_j: F1, size_j: F1, points: F2) -> int:
    """The lowest corner, and the lowest ones of the tilted mesh, which may be apart."""
    mesh, up = surface_of(size_i), axis(frame_j, 2)
    n = (dot(axis(frame_i, 0), up), dot(axis(frame_i, 1), up), dot(axis(frame_i, 2), up))
    height = dot(sub(vector(frame_j), vector(frame_i)), up)
    x, y = plane_axes(up)
    x = (dot(axis(frame_i, 0), x), dot(axis(frame_i, 1), x), dot(axis(frame_i, 2), x))
    y = cross(n, x)
    corners = np.empty((EACH, 3))
    for k in range(EACH):
        _, corner = lowest_corner(mesh, n if k == 0 else sub(n, tilt_of(k - 1, x, y)))
        depth, weight = height - dot(corner, n), 1.0
        for c in range(3):
            corners[k, c] = corner[c]
        for before in range(k):
            q = vector(corners[before])
            if q[0] == corner[0] and q[1] == corner[1] and q[2] == corner[2]:
                weight = 0.0
        at = add(vector(frame_i), to_global(frame_i, corner))
        put_point(points[k], depth, add(at, scale(0.5 * depth, up)), up, weight)
    return EACH


@jitable
def part_of(found: F2, k: int, at: int) -> V3:
    """Return place or normal of point k."""
    return (found[k, at], found[k, at + 1], found[k, at + 2])


@jitable
def fill_clusters(found: F2, count: int, cluster: F1) -> int:
    """Fill the cluster of each point, by its normal; return how many there are."""
    for k in range(count):
        cluster[k] = -1.0
    for c in range(CLUSTERS):
        seed = deepest_feature(found, count, cluster, -1)
        if seed < 0:
            return c
        n = part_of(found, seed, FEATURE_NORMAL)
        for k in range(count):
            near = c == CLUSTERS - 1 or dot(n, part_of(found, k, FEATURE_NORMAL)) > ALIKE
            if cluster[k] < 0.0 and near:
                cluster[k] = c
    return CLUSTERS


@jitable
def put_cluster(found: F2, count: int, cluster: F1, which: int, points: F2) -> None:
    """Write the points of a cluster that hold a body, into `EACH` rows."""
    first = deepest_feature(found, count, cluster, which)
    n, origin = part_of(found, first, FEATURE_NORMAL), part_of(found, first, FEATURE_POINT)
    x, y = plane_axes(n)
    size = 0.0
    for k in range(count):
        if cluster[k] == which:
            size = max(size, norm(sub(part_of(found, k, FEATURE_POINT), origin)))
    for row in range(EACH):
        best, most, way = first, -math.inf, (0.0, 0.0, 0.0)
        if row > 0:
            way = tilt_of(row - 1, x, y)
        for k in range(count):
            value = found[k, 0] + dot(way, sub(part_of(found, k, FEATURE_POINT), origin))
            if cluster[k] == which and value > most:
                best, most = k, value
        p, m, weight = (
            part_of(found, best, FEATURE_POINT),
            part_of(found, best, FEATURE_NORMAL),
            1.0,
        )
        for before in range(row):
            apart = norm(sub(vector(points[before], AT_POINT), p))
            if points[before, AT_WEIGHT] > 0.0 and apart <= SAME * size:
                weight = 0.0
        put_point(points[row], found[best, 0], p, m, weight)


@jitable
def put_middle(nodes: F2, points: F1) -> None:
    """Write one point for all that overlaps: its largest depth, at its centre of pressure."""
    depth, pressure = 0.0, 0.0
    p, push = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    for k in range(len(nodes)):
        depth = max(depth, nodes[k, PEAK])
        pressure += nodes[k, PRESSURE]
        p = add(p, vector(nodes[k, MOMENT:]))
        push = add(push, vector(nodes[k, PUSH:]))
    size = norm(push)
    if size > 0.0 and pressure > 0.0:
        put_point(points, depth, scale(1.0 / pressure, p), scale(1.0 / size, push))


@rigid_pair("SURFACE", "SURFACE", slots=SURFACE_ROWS)
def rigid_surfaces(frame_i: F1, size_i: F1, frame_j: F1, size_j: F1, points: F2) -> int:
    """Corners on faces and edges on edges, of those that hold a body."""
    mesh_i, mesh_j = surface_of(size_i), surface_of(size_j)
    pose = pose_of(frame_i, frame_j)
    root_i, root_j = int(mesh_i[AT_BOXES]) + NODE, int(mesh_j[AT_BOXES]) + NODE
    gap = box_gap(mesh_i[root_i:], mesh_j[root_j:], pose)
    if gap > 0.0:
        return far_apart(gap, frame_j, points)
    # the middle of what both roots have in common is near the patches
    origin = common_middle(mesh_i[root_i:], mesh_j[root_j:], pose)
    count, nodes, _, pairs = nodes_of(mesh_i, mesh_j, pose, origin, points)
    if count == 0:
        return without_pieces(mesh_i, mesh_j, pose, frame_j, points, KNOWN)
    nodes, pairs = nodes[:count], pairs[:count]
    inside = all_in(mesh_i, mesh_j, nodes) or swallowed(mesh_i, mesh_j, pairs, pose)
    for k in range(count):
        if nodes[k, BEYOND] > AT_END * nodes[k, PEAK]:
            inside = True
    far_apart(-0.0, frame_j, points)
    for k in range(len(points)):
        points[k, AT_WEIGHT] = 0.0
    many, found = features_of(mesh_i, mesh_j, pose, origin, pairs)
    cluster = np.empty(many)
    for c in range(fill_clusters(found, many, cluster)):
        put_cluster(found, many, cluster, c, points[EACH * c :])
    if many == 0:
        put_middle(nodes, points[SURFACE_ROWS - 1])
    for k in range(len(points)):
        row = points[k]
        if row[AT_WEIGHT] > 0.0:
            p = to_global(frame_j, add(origin, vector(row, AT_POINT)))
            n = to_global(frame_j, vector(row, AT_NORMAL))
            put_point(row, row[AT_DEPTH], add(vector(frame_j), p), n, row[AT_WEIGHT])
    return -len(points) if inside else len(points)
