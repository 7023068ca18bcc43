"""Whether oriented boxes of two meshes have room in common (`model.surface_tree`)."""

from __future__ import annotations

import math

from mbsim.core.arrays import F1, V3
from mbsim.core.jitable import jitable, uncounted
from mbsim.core.rotation import add, dot, sub, vector
from mbsim.model.surface import AT_ORIENTED
from mbsim.model.surface_tree import DEEP, ORIENTED, THIN

Axes = tuple[V3, V3, V3]

#: Which surface may be in which layer: I's in J's, J's in I's.
I_IN_J, J_IN_I = 1, 2
#: Boxes have nothing in common where they do so by less than this part of their half edges: flush
#: sides have no depth in each other, whatever rounding tells.
FLUSH = 1e-13


@jitable
def place(pose: F1, p: V3) -> V3:
    """Return a point of I's axes in J's; `pose` is I in J's axes: origin, rotation by rows."""
    return add(vector(pose), turn(pose, p))


@jitable
def place_back(pose: F1, p: V3) -> V3:
    """Return a point of J's axes in I's."""
    d = sub(p, vector(pose))
    return (
        pose[3] * d[0] + pose[6] * d[1] + pose[9] * d[2],
        pose[4] * d[0] + pose[7] * d[1] + pose[10] * d[2],
        pose[5] * d[0] + pose[8] * d[1] + pose[11] * d[2],
    )


@jitable
def turn(pose: F1, d: V3) -> V3:
    """Return a vector of I's axes in J's."""
    return (dot(vector(pose, 3), d), dot(vector(pose, 6), d), dot(vector(pose, 9), d))


@jitable
def node_at(mesh: F1, k: int) -> int:
    """Return where the numbers of a node's oriented boxes begin."""
    return int(mesh[AT_ORIENTED]) + ORIENTED * k


@jitable
def extent(mesh: F1, node: int) -> float:
    """Return half the sum of the edges of the box around a node's triangles."""
    return mesh[node + THIN + 3] + mesh[node + THIN + 4] + mesh[node + THIN + 5]


@jitable
def axes_of(mesh: F1, node: int) -> Axes:
    """Return the axes of a node in those of its mesh."""
    return (vector(mesh, node), vector(mesh, node + 3), vector(mesh, node + 6))


@jitable
def turned_axes(mesh: F1, node: int, pose: F1) -> Axes:
    """Return the axes of a node of I in J's axes."""
    x, y, z = axes_of(mesh, node)
    return (turn(pose, x), turn(pose, y), turn(pose, z))


@jitable
def cosines(u: V3, axes: Axes) -> V3:
    """Return the absolute cosines between a direction and three axes."""
    return (abs(dot(u, axes[0])), abs(dot(u, axes[1])), abs(dot(u, axes[2])))


@jitable
def offset(mesh_i: F1, box_i: int, mesh_j: F1, box_j: int, pose: F1) -> V3:
    """Return the way from the centre of a box of J to one of I, in J's axes."""
    return sub(place(pose, vector(mesh_i, box_i)), vector(mesh_j, box_j))


@uncounted
def box_distance(mesh_i: F1, i: int, mesh_j: F1, j: int, pose: F1) -> float:
    """Return a lower bound of the distance of the triangles' boxes of nodes at i and j.

    Along an axis of one; 0 if none parts them.
    """
    axes_i, (u, v, w) = turned_axes(mesh_i, i, pose), axes_of(mesh_j, j)
    off = offset(mesh_i, i + THIN, mesh_j, j + THIN, pose)
    half_i, half_j = vector(mesh_i, i + THIN + 3), vector(mesh_j, j + THIN + 3)
    a, b, c = cosines(u, axes_i), cosines(v, axes_i), cosines(w, axes_i)
    gap, square = 0.0, 0.0
    for k in range(3):
        reach = half_i[k] + half_j[0] * a[k] + half_j[1] * b[k] + half_j[2] * c[k]
        gap = max(gap, abs(dot(axes_i[k], off)) - reach)
    x = max(0.0, abs(dot(u, off)) - dot(a, half_i) - half_j[0])
    y = max(0.0, abs(dot(v, off)) - dot(b, half_i) - half_j[1])
    z = max(0.0, abs(dot(w, off)) - dot(c, half_i) - half_j[2])
    square = x * x + y * y + z * z
    return max(gap, math.sqrt(square))


@jitable
def boxes_meet(
    off: V3,
    axes_i: Axes,
    axes_j: Axes,
    half_i: V3,
    half_j: V3,
    turns: tuple[V3, V3, V3],
    reach: float,
) -> bool:
    """Return whether two boxes are nearer than `reach`, seen along all their axes.

    `off` is the way from J's centre to I's, `turns` are the cosines of J's axes with those of I.
    """
    x, y, z = axes_i
    u, v, w = axes_j
    a, b, c = turns
    flush = FLUSH * (half_i[0] + half_i[1] + half_i[2] + half_j[0] + half_j[1] + half_j[2])
    # all are found before any is asked: which of them parts two boxes is not to be foreseen
    gap = max(
        abs(dot(u, off)) - (dot(a, half_i) + half_j[0]),
        abs(dot(v, off)) - (dot(b, half_i) + half_j[1]),
        abs(dot(w, off)) - (dot(c, half_i) + half_j[2]),
        abs(dot(x, off)) - (half_i[0] + (half_j[0] * a[0] + half_j[1] * b[0] + half_j[2] * c[0])),
        abs(dot(y, off)) - (half_i[1] + (half_j[0] * a[1] + half_j[1] * b[1] + half_j[2] * c[1])),
        abs(dot(z, off)) - (half_i[2] + (half_j[0] * a[2] + half_j[1] * b[2] + half_j[2] * c[2])),
    )
    return gap < reach - flush


@uncounted
def ways_between(mesh_i: F1, i: int, mesh_j: F1, j: int, ways: int, pose: F1, reach: float) -> int:
    """Return for which of `ways` the nodes at i (of I) and j (of J) are nearer than `reach`.

    `I_IN_J` is for I's triangles in J's layer, `J_IN_I` for J's triangles in I's layer.
    """
    axes_i, axes_j = turned_axes(mesh_i, i, pose), axes_of(mesh_j, j)
    turns = (
        cosines(axes_j[0], axes_i),
        cosines(axes_j[1], axes_i),
        cosines(axes_j[2], axes_i),
    )
    found = 0
    if ways & I_IN_J:
        off = offset(mesh_i, i + THIN, mesh_j, j + DEEP, pose)
        thin, deep = vector(mesh_i, i + THIN + 3), vector(mesh_j, j + DEEP + 3)
        if boxes_meet(off, axes_i, axes_j, thin, deep, turns, reach):
            found += I_IN_J
    if ways & J_IN_I:
        off = offset(mesh_i, i + DEEP, mesh_j, j + THIN, pose)
        deep, thin = vector(mesh_i, i + DEEP + 3), vector(mesh_j, j + THIN + 3)
        if boxes_meet(off, axes_i, axes_j, deep, thin, turns, reach):
            found += J_IN_I
    return found
