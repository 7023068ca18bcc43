"""Meshes whose contact force follows from the field of depth under their surfaces.

The pairs of `contact_depth="FIELD"`: one contact point for each patch (`geometry.mesh.field`).
"""

from __future__ import annotations

import numpy as np

from mbsim.core.arrays import F1, F2
from mbsim.core.rotation import add, dot, scale, sub, vector
from mbsim.geometry.catalog import AT_DEPTH, AT_POINT, REGION_ROWS, axis, motion_bound, pair
from mbsim.geometry.mesh.field import write_patches
from mbsim.geometry.mesh.overlap import (
    box_gap,
    common_middle,
    nodes_of,
    partners_of,
)
from mbsim.geometry.mesh.plane import lowest_corner, pieces_below, triangles_below
from mbsim.geometry.mesh.record import BEYOND
from mbsim.geometry.pairs.surface import (
    PATCH_SLOTS,
    all_in,
    far_apart,
    pose_of,
    surface_bound,
    surface_of,
    swallowed,
    without_pieces,
)
from mbsim.geometry.polyhedron import to_global
from mbsim.model.surface import AT_BOXES, NODE, TRIANGLES


@pair("FIELD", "PLANE", slots=PATCH_SLOTS, regroups=True, patches=True)
def field_plane(frame_i: F1, size_i: F1, frame_j: F1, size_j: F1, points: F2) -> int:
    """The patches below the plane."""
    mesh, up = surface_of(size_i), axis(frame_j, 2)
    n = (dot(axis(frame_i, 0), up), dot(axis(frame_i, 1), up), dot(axis(frame_i, 2), up))
    height = dot(sub(vector(frame_j), vector(frame_i)), up)
    low, corner = lowest_corner(mesh, n)
    if low >= height:
        return far_apart(low - height, frame_j, points)
    at = add(vector(frame_i), to_global(frame_i, corner))
    found = np.empty(int(mesh[TRIANGLES]), np.int64)
    count = triangles_below(mesh, n, height, found)
    nodes, _, partners = pieces_below(mesh, found[:count], n, height, corner)
    count = write_patches(nodes, partners, frame_i, at, points)
    for k in range(0, REGION_ROWS * count, REGION_ROWS):
        # half way between the surface of the mesh and the plane
        p = vector(points[k, AT_POINT:])
        p = add(p, scale(-0.5 * points[k, AT_DEPTH] - dot(sub(p, vector(frame_j)), up), up))
        points[k, AT_POINT], points[k, AT_POINT + 1], points[k, AT_POINT + 2] = p[0], p[1], p[2]
    return len(points)


@pair("FIELD", "FIELD", slots=PATCH_SLOTS, regroups=True, patches=True)
def field_field(frame_i: F1, size_i: F1, frame_j: F1, size_j: F1, points: F2) -> int:
    """The patches in which two meshes overlap."""
    mesh_i, mesh_j = surface_of(size_i), surface_of(size_j)
    pose = pose_of(frame_i, frame_j)
    root_i, root_j = int(mesh_i[AT_BOXES]) + NODE, int(mesh_j[AT_BOXES]) + NODE
    gap = box_gap(mesh_i[root_i:], mesh_j[root_j:], pose)
    if gap > 0.0:
        return far_apart(gap, frame_j, points)
    origin = common_middle(mesh_i[root_i:], mesh_j[root_j:], pose)
    count, nodes, values, pairs = nodes_of(mesh_i, mesh_j, pose, origin, points)
    if count == 0:
        return without_pieces(mesh_i, mesh_j, pose, frame_j, points, 1.0)
    partners = partners_of(mesh_i, mesh_j, count, values, pairs)
    at = add(vector(frame_j), to_global(frame_j, origin))
    inside = all_in(mesh_i, mesh_j, nodes[:count])
    known = -1 if inside or swallowed(mesh_i, mesh_j, pairs[:count], pose) else 1
    for k in range(count):
        # what is below the layer does not press: forces keep their potential, and are too small
        if nodes[k, BEYOND] > 0.0:
            known = -1
    write_patches(nodes[:count], partners, frame_j, at, points)
    return known * len(points)


motion_bound("FIELD", "FIELD")(surface_bound)
