"""A lower bound of the distance of two meshes."""

from __future__ import annotations

import math

import numpy as np

from mbsim.core.arrays import F1, V3
from mbsim.core.jitable import jitable, uncounted
from mbsim.core.rotation import cross, dot, norm, sub, vector
from mbsim.geometry.mesh.oriented import box_distance, extent, node_at, place
from mbsim.geometry.mesh.tree import WAITING, leaf_range
from mbsim.model.surface import AT_TRIANGLES, LEVELS, TRIANGLE

#: A direction shorter than this part of its factors' product has none.
SHORT = 1e-9


@jitable
def gap_along(n: V3, p: tuple[V3, V3, V3], q: tuple[V3, V3, V3]) -> float:
    """Return how far apart two triangles are along a direction of any length; 0 if it is none."""
    a, b, c = dot(n, p[0]), dot(n, p[1]), dot(n, p[2])
    d, e, f = dot(n, q[0]), dot(n, q[1]), dot(n, q[2])
    gap = max(min(d, e, f) - max(a, b, c), min(a, b, c) - max(d, e, f))
    return gap / norm(n) if gap > 0.0 else 0.0


@jitable
def triangle_distance(p: tuple[V3, V3, V3], q: tuple[V3, V3, V3]) -> float:
    """Return a lower bound of the distance of two triangles, above 0 where they are apart.

    One of the directions parts them: normals, edges across edges, edges in their own planes.
    """
    edges_p = (sub(p[1], p[0]), sub(p[2], p[1]), sub(p[0], p[2]))
    edges_q = (sub(q[1], q[0]), sub(q[2], q[1]), sub(q[0], q[2]))
    n, m = cross(edges_p[0], edges_p[1]), cross(edges_q[0], edges_q[1])
    gap = max(gap_along(n, p, q), gap_along(m, p, q))
    for i in range(3):
        gap = max(gap, gap_along(cross(edges_p[i], n), p, q))
        gap = max(gap, gap_along(cross(edges_q[i], m), p, q))
        for j in range(3):
            across = cross(edges_p[i], edges_q[j])
            if norm(across) > SHORT * norm(edges_p[i]) * norm(edges_q[j]):
                gap = max(gap, gap_along(across, p, q))
    return gap


@jitable
def triangle_of(mesh: F1, t: int) -> tuple[V3, V3, V3]:
    """Return the corners of a triangle in the mesh's axes."""
    at = int(mesh[AT_TRIANGLES]) + TRIANGLE * t
    return (vector(mesh, at), vector(mesh, at + 3), vector(mesh, at + 6))


@uncounted
def leaf_distance(mesh_i: F1, i: int, mesh_j: F1, j: int, pose: F1, best: float) -> float:
    """Return the least distance of the triangles of two leaves, or `best` if that is less."""
    first_i, last_i = leaf_range(mesh_i, i)
    first_j, last_j = leaf_range(mesh_j, j)
    for a in range(first_i, last_i):
        p = triangle_of(mesh_i, a)
        p = (place(pose, p[0]), place(pose, p[1]), place(pose, p[2]))
        for b in range(first_j, last_j):
            best = min(best, triangle_distance(p, triangle_of(mesh_j, b)))
    return best


@jitable
def least_gap(mesh_i: F1, mesh_j: F1, pose: F1, part: float) -> float:
    """Return a lower bound of the distance of two meshes, above 0 where no triangles meet.

    It is at least `part` of the distance, 1 at most: the less is asked for, the sooner it is found.
    """
    waiting, far = np.empty((4 * WAITING, 2), np.int64), np.empty(4 * WAITING)
    waiting[0, 0], waiting[0, 1], far[0], many = 1, 1, 0.0, 1
    leaves_i, leaves_j = 1 << int(mesh_i[LEVELS]), 1 << int(mesh_j[LEVELS])
    best = math.inf
    while many > 0 and best > 0.0:
        many -= 1
        i, j = waiting[many, 0], waiting[many, 1]
        if far[many] >= part * best:
            continue
        if i >= leaves_i and j >= leaves_j:
            best = leaf_distance(mesh_i, i, mesh_j, j, pose, best)
            continue
        of_i = i < leaves_i and (
            j >= leaves_j or extent(mesh_i, node_at(mesh_i, i)) > extent(mesh_j, node_at(mesh_j, j))
        )
        for k in range(2):
            a, b = (2 * i + k, j) if of_i else (i, 2 * j + k)
            waiting[many + k, 0], waiting[many + k, 1] = a, b
            far[many + k] = box_distance(
                mesh_i, node_at(mesh_i, a), mesh_j, node_at(mesh_j, b), pose
            )
        if far[many] < far[many + 1]:
            # the nearer one is looked at first, so it is put on last
            for c in range(2):
                waiting[many, c], waiting[many + 1, c] = waiting[many + 1, c], waiting[many, c]
            far[many], far[many + 1] = far[many + 1], far[many]
        many += 2
    return part * best
