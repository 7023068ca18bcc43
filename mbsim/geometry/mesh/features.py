"""Where features of two meshes that overlap touch: corners on faces, and edges on edges.

A corner of one mesh in the prism under a face of the other one touches that face, an edge that
leaves the prism through the side under an edge touches that edge. Each is a contact point with a
depth and a normal of its own, if the two features look at each other: with the normal n from J into
I, all that is beside the corner or edge of I lies above it along n, and of J below it. So a tilted
box has its lowest corners on a floor, and nothing of the floor is pushed out through its bottom.
"""

from __future__ import annotations

import math

import numpy as np

from mbsim.core.arrays import F1, F2, V3
from mbsim.core.jitable import jitable
from mbsim.core.rotation import add, cross, dot, norm, scale, sub, vector
from mbsim.geometry.mesh.oriented import place_back, turn
from mbsim.geometry.mesh.overlap import PRISM, corners_of, grown, place_triangle
from mbsim.geometry.mesh.polygon import CORNER as POLYGON_CORNER
from mbsim.geometry.mesh.polygon import CORNERS
from mbsim.geometry.mesh.prism import END, SIDE, apart, tetrahedron, within_tetrahedron
from mbsim.model.surface import (
    AT_TRIANGLES,
    BESIDE,
    CORNER,
    CORNER_NORMAL,
    INNER,
    TRIANGLE,
    UNIT,
)

#: Numbers of a point where features touch: depth, place half way between both (3), normal (3).
FEATURE = 7
FEATURE_POINT, FEATURE_NORMAL = 1, 4
#: Sine of the angle by which what is beside a feature may look the other way.
LEVEL = 1e-3
#: Sine of the angle of two edges below which they do not cross.
PARALLEL = 1e-3
#: Triangles around a corner at most.
AROUND = 1000


@jitable
def beside_corner(mesh: F1, t: int, k: int, d: V3) -> bool:
    """Return whether the mesh at corner k of triangle t lies above it along d, a unit vector.

    All its edges rise along d, or nearly, and what is solid is there. `d` is in the mesh's axes.
    """
    here, corner, first = t, k, int(mesh[AT_TRIANGLES])
    if dot(vector(mesh, first + TRIANGLE * t + CORNER_NORMAL + 3 * k), d) >= 0.0:
        return False
    for _ in range(AROUND):
        at = first + TRIANGLE * here
        p = vector(mesh, at + 3 * corner)
        way = sub(vector(mesh, at + 3 * (corner + 1 if corner < 2 else 0)), p)
        if dot(way, d) < -LEVEL * norm(way):
            return False
        # on to the triangle beyond the edge that ends in the corner, where it begins there
        edge = corner - 1 if corner > 0 else 2
        beyond = int(mesh[at + BESIDE + edge])
        corner = 0
        for e in range(3):
            if int(mesh[first + TRIANGLE * beyond + BESIDE + e]) == here:
                q = vector(mesh, first + TRIANGLE * beyond + 3 * e)
                if q[0] == p[0] and q[1] == p[1] and q[2] == p[2]:
                    corner = e
        here = beyond
        if here == t:
            break
    return True


@jitable
def out_of_edge(mesh: F1, t: int, k: int) -> V3:
    """Return the sum of the unit normals of both triangles at edge k of triangle t."""
    at = int(mesh[AT_TRIANGLES]) + TRIANGLE * t
    far = int(mesh[AT_TRIANGLES]) + TRIANGLE * int(mesh[at + BESIDE + k])
    return add(vector(mesh, at + UNIT), vector(mesh, far + UNIT))


@jitable
def beside_edge(mesh: F1, t: int, k: int, d: V3) -> bool:
    """Return whether the mesh at edge k of triangle t lies above it along d, a unit vector.

    Both triangles rise from it along d, or nearly, and what is solid is there.
    """
    first = int(mesh[AT_TRIANGLES])
    at = first + TRIANGLE * t
    p = vector(mesh, at + 3 * k)
    way = sub(vector(mesh, at + 3 * (k - 1 if k > 0 else 2)), p)
    if dot(out_of_edge(mesh, t, k), d) >= -LEVEL or dot(way, d) < -LEVEL * norm(way):
        return False
    beyond = int(mesh[at + BESIDE + k])
    far = first + TRIANGLE * beyond
    for e in range(3):
        if int(mesh[far + BESIDE + e]) == t:
            way = sub(vector(mesh, far + 3 * (e - 1 if e > 0 else 2)), p)
            if dot(way, d) < -LEVEL * norm(way):
                return False
    return True


@jitable
def put_feature(found: F2, count: int, depth: float, p: V3, n: V3) -> int:
    """Write a point into the row behind those that there are; return their number."""
    row = found[count]
    row[0] = depth
    for c in range(3):
        row[FEATURE_POINT + c], row[FEATURE_NORMAL + c] = p[c], n[c]
    return count + 1


@jitable
def as_seen_by(pose: F1, of_i: bool, d: V3) -> V3:
    """Return a direction of J's axes in those of I, or of J."""
    return place_back(pose, add(vector(pose), d)) if of_i else d


@jitable
def corner_on_face(
    mesh: F1, pose: F1, own: tuple[int, int, float], x: V3, face: tuple[V3, V3], found: F2,
    count: int,
) -> int:  # fmt: skip
    """Add corner x of a triangle, if it touches a face; return how many points there are.

    `own` is the triangle, the number of its corner and its side: 1 of I, -1 of J. `face` is a point
    of the face and its unit normal.
    """
    t, k, side = own
    m = face[1]
    depth = dot(m, sub(face[0], x))
    if depth <= 0.0 or not beside_corner(mesh, t, k, as_seen_by(pose, side > 0.0, m)):
        return count
    return put_feature(found, count, depth, add(x, scale(0.5 * depth, m)), scale(side, m))


@jitable
def edge_on_edge(
    mesh: F1, other: F1, pose: F1, own: tuple[int, int, float], edge: tuple[V3, V3],
    beyond: tuple[int, int], across: tuple[V3, V3], found: F2, count: int,
) -> int:  # fmt: skip
    """Add where an edge of a triangle crosses one of the other mesh, if they touch.

    `own` is the triangle, the number of its edge and its side, `beyond` the triangle of the other
    mesh and the number of its edge; both edges have two ends. Returns how many points there are.
    """
    t, k, side = own
    e, f = sub(edge[1], edge[0]), sub(across[1], across[0])
    n = cross(e, f)
    length = norm(n)
    if length <= PARALLEL * norm(e) * norm(f):
        return count
    n = scale(1.0 / length, n)
    # out of the other mesh: what is beside its edge is below
    m = out_of_edge(other, beyond[0], beyond[1])
    if side < 0.0:
        m = turn(pose, m)
    if dot(n, m) < 0.0:
        n = scale(-1.0, n)
    depth = dot(n, sub(across[0], edge[0]))
    if depth <= 0.0:
        return count
    d = as_seen_by(pose, side > 0.0, n)
    if not beside_edge(mesh, t, k, d):
        return count
    if not beside_edge(other, beyond[0], beyond[1], scale(-1.0, as_seen_by(pose, side < 0.0, n))):
        return count
    # where they cross, seen along n
    between = sub(across[0], edge[0])
    square = dot(cross(e, f), cross(e, f))
    part = dot(cross(between, f), cross(e, f)) / square
    p = add(edge[0], scale(part, e))
    return put_feature(found, count, depth, add(p, scale(0.5 * depth, n)), scale(side, n))


@jitable
def corner_at(u: float, v: float) -> int:
    """Return which corner of its triangle a point (u, v) is, -1 for none."""
    if v == 0.0:
        if u == 0.0:
            return 0
        return 1 if u == 1.0 else -1
    return 2 if u == 0.0 and v == 1.0 else -1


@jitable
def features_in_prism(
    mesh: F1, other: F1, pose: F1, numbers: tuple[int, int, float], placed: tuple[F1, F1],
    work: F2, found: F2, count: int,
) -> int:  # fmt: skip
    """Add where features of a triangle touch a prism of the other mesh; return how many there are.

    `numbers` are the triangle, the other mesh's one and the side: 1 where the first is of I, -1 of
    J; `placed` are both in J's axes (`mesh.overlap.place_triangle`).
    """
    t, below, side = numbers
    tri, outer = corners_of(placed[0], CORNER), corners_of(placed[1], CORNER)
    if apart(outer, corners_of(placed[1], INNER), tri):
        return count
    m = cross(sub(outer[1], outer[0]), sub(outer[2], outer[0]))
    m = scale(1.0 / norm(m), m)
    for part in range(3):
        corners, depths, tags = tetrahedron(placed[1], part)
        at, many, _ = within_tetrahedron(corners, depths, tags, tri, work)
        if many < 3:
            continue
        before = int(work[at + many - 1, 2])
        for c in range(at, at + many):
            tag = int(work[c, 2])
            k = corner_at(work[c, 0], work[c, 1])
            if k >= 0:
                own = (t, k, side)
                count = corner_on_face(mesh, pose, own, tri[k], (outer[0], m), found, count)
            own_edge, way = min(tag, before), max(tag, before)
            if own_edge < SIDE and SIDE <= way < END:
                f = way - SIDE
                ends = (tri[own_edge], tri[own_edge + 1 if own_edge < 2 else 0])
                across = (outer[f], outer[f + 1 if f < 2 else 0])
                count = edge_on_edge(
                    mesh, other, pose, (t, own_edge, side), ends, (below, f), across, found, count
                )
            before = tag
    return count


@jitable
def features_of(
    mesh_i: F1, mesh_j: F1, pose: F1, origin: V3, pairs: F2
) -> tuple[int, F2]:  # fmt: skip
    """Return how many points there are where features of two meshes touch, and the points.

    They are in J's axes from `origin`. `pairs` are those of triangles that have pieces in each
    other's layers (`mesh.overlap.nodes_of`).
    """
    # of each corner of a piece one point at most: 2 ways, 3 tetrahedra, and as many for edges
    most = 4 * 3 * CORNERS
    count, found = 0, np.empty((most, FEATURE))
    a, b = np.empty(PRISM), np.empty(PRISM)
    work = np.empty((2 * CORNERS, POLYGON_CORNER))
    for k in range(len(pairs)):
        while count + most > len(found):
            found = grown(found, count)
        i, j = int(pairs[k, 0]), int(pairs[k, 1])
        place_triangle(mesh_i, i, pose, True, origin, a)
        place_triangle(mesh_j, j, pose, False, origin, b)
        count = features_in_prism(
            mesh_i, mesh_j, pose, (i, j, 1.0), (a, b), work, found, count
        )  # fmt: skip
        count = features_in_prism(
            mesh_j, mesh_i, pose, (j, i, -1.0), (b, a), work, found, count
        )  # fmt: skip
    return count, found


@jitable
def deepest_feature(found: F2, count: int, cluster: F1, which: int) -> int:
    """Return the deepest point of a cluster, -1 for none."""
    best, most = -1, -math.inf
    for k in range(count):
        if cluster[k] == which and found[k, 0] > most:
            best, most = k, found[k, 0]
    return best
