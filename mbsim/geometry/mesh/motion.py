"""How long two shapes, one of them a mesh, may move until one may have passed through a wall.

Along a unit vector n that parts two boxes or triangles by g, points of I go by

    max over them of n.(v + w x r) t + (max(n.a, 0) + m) t^2 / 2

in a time t, seen from J. Until that is more than g and how far a wall may be gone into they have
not passed each other, and of several such n the one that holds longest counts. The trees of
both meshes are walked together; what holds longer than the time asked for is not looked into. So
sliding along a thin plate is no approach, and a wall ahead of a shape that slides on the same
mesh is one (motion bounds of conservative advancement: Tang, Kim and Manocha 2009).
"""

from __future__ import annotations

import math

import numpy as np

from mbsim.core.arrays import F1, V3
from mbsim.core.jitable import jitable
from mbsim.core.rotation import add, cross, dot, norm, scale, sub, vector
from mbsim.geometry.mesh.ball import nearest_on_triangle
from mbsim.geometry.mesh.distance import SHORT, triangle_of
from mbsim.geometry.mesh.oriented import Axes, axes_of, extent, node_at, offset, place, turned_axes
from mbsim.geometry.mesh.tree import WAITING, leaf_range
from mbsim.geometry.motion import (
    ACCELERATION,
    ALLOWED,
    ASKED,
    MORE,
    OVERLAP,
    SPIN,
    VELOCITY,
    time_for,
)
from mbsim.model.surface import AT_BOXES, AT_TRIANGLES, LEVELS, NODE, TRIANGLE, UNIT
from mbsim.model.surface_tree import THIN


@jitable
def time_along(motion: F1, n: V3, speed: float, gap: float) -> float:
    """Return how long what n parts by `gap` stays so far apart that no wall is passed.

    n points from I to J; `speed` is that of I's fastest point along it.
    """
    push = max(0.0, dot(n, vector(motion, ACCELERATION))) + motion[MORE]
    return time_for(max(gap, 0.0) + motion[ALLOWED], max(speed, 0.0), push)


@jitable
def speed_at(motion: F1, arm: V3) -> V3:
    """Return the velocity of a point of I; `arm` is its way from I's centre."""
    return add(vector(motion, VELOCITY), cross(vector(motion, SPIN), arm))


@jitable
def box_time(motion: F1, mesh_i: F1, i: int, mesh_j: F1, j: int, pose: F1) -> float:
    """Return how long the triangles of two nodes do not pass each other; 0 if none of six n tells.

    `motion` is in J's axes.
    """
    axes_i, axes_j = turned_axes(mesh_i, i, pose), axes_of(mesh_j, j)
    off = offset(mesh_i, i + THIN, mesh_j, j + THIN, pose)
    half_i, half_j = vector(mesh_i, i + THIN + 3), vector(mesh_j, j + THIN + 3)
    arm = sub(place(pose, vector(mesh_i, i + THIN)), vector(pose))
    middle, w = speed_at(motion, arm), vector(motion, SPIN)
    x, y, z = cross(w, axes_i[0]), cross(w, axes_i[1]), cross(w, axes_i[2])
    found = 0.0
    for k in range(6):
        n = axes_i[k] if k < 3 else axes_j[k - 3]
        away = dot(n, off)
        gap = abs(away) - reach(n, axes_i, half_i) - reach(n, axes_j, half_j)
        if gap >= -motion[OVERLAP]:
            n = scale(-1.0, n) if away > 0.0 else n
            faster = half_i[0] * abs(dot(n, x)) + half_i[1] * abs(dot(n, y))
            faster += half_i[2] * abs(dot(n, z))
            found = max(found, time_along(motion, n, dot(n, middle) + faster, gap))
    return found


@jitable
def reach(n: V3, axes: Axes, half: V3) -> float:
    """Return how far a box reaches from its centre along n."""
    u = half[0] * abs(dot(n, axes[0])) + half[1] * abs(dot(n, axes[1]))
    return u + half[2] * abs(dot(n, axes[2]))


@jitable
def parted_time(
    motion: F1, n: V3, p: tuple[V3, V3, V3], q: tuple[V3, V3, V3], centre: V3
) -> tuple[float, float]:
    """Return by how much triangles p of I and q of J are parted along n, and how long they are so.

    n is of any length but 0; `centre` is that of I.
    """
    n = scale(1.0 / norm(n), n)
    a, b, c = dot(n, p[0]), dot(n, p[1]), dot(n, p[2])
    d, e, f = dot(n, q[0]), dot(n, q[1]), dot(n, q[2])
    below, above = min(d, e, f) - max(a, b, c), min(a, b, c) - max(d, e, f)
    if above > below:
        n = scale(-1.0, n)
    speed = max(
        dot(n, speed_at(motion, sub(p[0], centre))),
        dot(n, speed_at(motion, sub(p[1], centre))),
        dot(n, speed_at(motion, sub(p[2], centre))),
    )
    gap = max(below, above)
    return gap, time_along(motion, n, speed, gap)


@jitable
def triangle_time(
    motion: F1, p: tuple[V3, V3, V3], q: tuple[V3, V3, V3], centre: V3, enough: float
) -> float:
    """Return how long triangles p of I and q of J do not pass each other, or `enough` and more.

    Two that cross do so along the normal of which less is missing.
    """
    edges_p = (sub(p[1], p[0]), sub(p[2], p[1]), sub(p[0], p[2]))
    edges_q = (sub(q[1], q[0]), sub(q[2], q[1]), sub(q[0], q[2]))
    n, m = cross(edges_p[0], edges_p[1]), cross(edges_q[0], edges_q[1])
    found, least, crossing = 0.0, -math.inf, math.inf
    for normal in (m, n):
        if norm(normal) == 0.0:
            continue
        gap, time = parted_time(motion, normal, p, q, centre)
        if gap >= -motion[OVERLAP]:
            found = max(found, time)
        elif gap > least:
            least, crossing = gap, time
    for i in range(3):
        if found >= enough:
            return found
        for k in range(5):
            if k < 3:
                axis, size = cross(edges_p[i], edges_q[k]), norm(edges_p[i]) * norm(edges_q[k])
            elif k == 3:
                axis, size = cross(edges_p[i], n), norm(edges_p[i]) * norm(n)
            else:
                axis, size = cross(edges_q[i], m), norm(edges_q[i]) * norm(m)
            if norm(axis) > SHORT * size:
                gap, time = parted_time(motion, axis, p, q, centre)
                if gap >= -motion[OVERLAP]:
                    found = max(found, time)
    return found if found > 0.0 else crossing


@jitable
def leaf_time(motion: F1, mesh_i: F1, i: int, mesh_j: F1, j: int, pose: F1, best: float) -> float:
    """Return how long the triangles of two leaves do not pass each other, `best` at most."""
    first_i, last_i = leaf_range(mesh_i, i)
    first_j, last_j = leaf_range(mesh_j, j)
    for a in range(first_i, last_i):
        p = triangle_of(mesh_i, a)
        p = (place(pose, p[0]), place(pose, p[1]), place(pose, p[2]))
        for b in range(first_j, last_j):
            q = triangle_of(mesh_j, b)
            best = min(best, triangle_time(motion, p, q, vector(pose), best))
    return best


@jitable
def mesh_time(motion: F1, mesh_i: F1, mesh_j: F1, pose: F1) -> float:
    """Return how long of the time asked for no wall of two meshes is passed.

    Parameters
    ----------
    motion : ndarray, shape (MOTION,)
        In J's axes.
    mesh_i, mesh_j : ndarray
        Packed surfaces with layers (`model.surface`).
    pose : ndarray, shape (12,)
        I in J's axes: origin, rotation by rows.
    """
    waiting = np.empty((4 * WAITING, 2), np.int64)
    waiting[0, 0], waiting[0, 1], many = 1, 1, 1
    leaves_i, leaves_j = 1 << int(mesh_i[LEVELS]), 1 << int(mesh_j[LEVELS])
    best = motion[ASKED]
    while many > 0:
        many -= 1
        i, j = waiting[many, 0], waiting[many, 1]
        box_i, box_j = node_at(mesh_i, i), node_at(mesh_j, j)
        if box_time(motion, mesh_i, box_i, mesh_j, box_j, pose) >= best:
            continue
        if i >= leaves_i and j >= leaves_j:
            best = leaf_time(motion, mesh_i, i, mesh_j, j, pose, best)
            continue
        of_i = i < leaves_i and (j >= leaves_j or extent(mesh_i, box_i) > extent(mesh_j, box_j))
        for k in range(2):
            waiting[many, 0], waiting[many, 1] = (2 * i + k, j) if of_i else (i, 2 * j + k)
            many += 1
    return best


@jitable
def ball_box_time(motion: F1, c: V3, radius: float, mesh: F1, at: int) -> float:
    """Return how long a ball does not pass the triangles in a box, whose numbers begin at `at`."""
    found, out = 0.0, np.empty(3)
    for k in range(3):
        away = mesh[at + k] - c[k]
        gap = abs(away) - mesh[at + 3 + k]
        out[k] = math.copysign(max(gap, 0.0), away)
        gap -= radius
        if gap >= -motion[OVERLAP]:
            n = (
                math.copysign(1.0, away) if k == 0 else 0.0,
                math.copysign(1.0, away) if k == 1 else 0.0,
                math.copysign(1.0, away) if k == 2 else 0.0,
            )
            found = max(found, time_along(motion, n, motion[VELOCITY + k] * n[k], gap))
    way = vector(out)
    far = norm(way)
    if far > 0.0 and far - radius >= -motion[OVERLAP]:
        n = scale(1.0 / far, way)
        speed = dot(n, vector(motion, VELOCITY))
        found = max(found, time_along(motion, n, speed, far - radius))
    return found


@jitable
def ball_triangle_time(motion: F1, c: V3, radius: float, mesh: F1, at: int, edges: F1) -> float:
    """Return how long a ball does not pass a triangle, whose numbers begin at `at`."""
    v, found = vector(motion, VELOCITY), 0.0
    way = sub(nearest_on_triangle(mesh, at, c, edges)[0], c)
    far = norm(way)
    n = scale(1.0 / far, way) if far > 0.0 else vector(mesh, at + UNIT)
    nearest = time_along(motion, n, dot(n, v), far - radius)
    if far - radius >= -motion[OVERLAP]:
        found = nearest
    height = dot(vector(mesh, at + UNIT), sub(vector(mesh, at), c))
    if abs(height) - radius >= -motion[OVERLAP]:
        n = scale(math.copysign(1.0, height), vector(mesh, at + UNIT))
        found = max(found, time_along(motion, n, dot(n, v), abs(height) - radius))
    return found if found > 0.0 else nearest


@jitable
def ball_time(motion: F1, c: V3, radius: float, mesh: F1) -> float:
    """Return how long of the time asked for a ball passes no wall of a mesh.

    Parameters
    ----------
    motion : ndarray, shape (MOTION,)
        In the mesh's axes; that of the ball's centre, without spin.
    c : tuple of float
        The ball's centre in the mesh's axes [L].
    radius : float
        Its radius [L].
    mesh : ndarray
        Packed surface (`model.surface`).
    """
    waiting, edges = np.empty(WAITING, np.int64), np.empty(3)
    boxes, leaves = int(mesh[AT_BOXES]), 1 << int(mesh[LEVELS])
    waiting[0], many, best = 1, 1, motion[ASKED]
    while many > 0:
        many -= 1
        node = waiting[many]
        if ball_box_time(motion, c, radius, mesh, boxes + NODE * node) >= best:
            continue
        if node < leaves:
            waiting[many], waiting[many + 1] = 2 * node, 2 * node + 1
            many += 2
            continue
        first, last = leaf_range(mesh, node)
        for t in range(first, last):
            at = int(mesh[AT_TRIANGLES]) + TRIANGLE * t
            best = min(best, ball_triangle_time(motion, c, radius, mesh, at, edges))
    return best
