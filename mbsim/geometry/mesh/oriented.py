"""Whether oriented boxes of two meshes have room in common (`model.surface_tree`)."""

from __future__ import annotations

import math

from mbsim.core.arrays import F1, V3
from mbsim.core.jitable import jitable
from mbsim.core.rotation import add, dot, scale, sub, vector
from mbsim.model.surface import AT_ORIENTED
from mbsim.model.surface_tree import DEEP, ORIENTED, THIN

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
    return (dot(vector(pose[3:]), d), dot(vector(pose[6:]), d), dot(vector(pose[9:]), d))


@jitable
def node_of(mesh: F1, k: int) -> F1:
    """Return the numbers of a node's oriented boxes, and what follows them."""
    return mesh[int(mesh[AT_ORIENTED]) + ORIENTED * k :]


@jitable
def extent(node: F1) -> float:
    """Return half the sum of the edges of the box around a node's triangles."""
    return node[THIN + 3] + node[THIN + 4] + node[THIN + 5]


@jitable
def sizes(d: V3) -> V3:
    """Return the absolute components of a vector."""
    return (abs(d[0]), abs(d[1]), abs(d[2]))


@jitable
def axes_between(a: F1, b: F1, pose: F1) -> tuple[V3, V3, V3]:
    """Return the axes of node a (of I) in those of node b (of J)."""
    x, y, z = turn(pose, vector(a)), turn(pose, vector(a[3:])), turn(pose, vector(a[6:]))
    u, v, w = vector(b), vector(b[3:]), vector(b[6:])
    return (
        (dot(u, x), dot(v, x), dot(w, x)),
        (dot(u, y), dot(v, y), dot(w, y)),
        (dot(u, z), dot(v, z), dot(w, z)),
    )


@jitable
def offset(a: F1, at_a: int, b: F1, at_b: int, pose: F1) -> V3:
    """Return the way from the centre of a box of node b to one of node a, in the axes of b."""
    off = sub(place(pose, vector(a[at_a:])), vector(b[at_b:]))
    return (dot(vector(b), off), dot(vector(b[3:]), off), dot(vector(b[6:]), off))


@jitable
def box_distance(a: F1, at_a: int, b: F1, at_b: int, pose: F1) -> float:
    """Return a lower bound of the distance of two boxes: along an axis of one; 0 if none parts."""
    axes, off = axes_between(a, b, pose), offset(a, at_a, b, at_b, pose)
    half_a, half_b = vector(a[at_a + 3 :]), vector(b[at_b + 3 :])
    x, y, z = sizes(axes[0]), sizes(axes[1]), sizes(axes[2])
    gap = max(0.0, abs(dot(axes[0], off)) - half_a[0] - dot(x, half_b))
    gap = max(gap, abs(dot(axes[1], off)) - half_a[1] - dot(y, half_b))
    gap = max(gap, abs(dot(axes[2], off)) - half_a[2] - dot(z, half_b))
    square = 0.0
    for k in range(3):
        reach = half_a[0] * x[k] + half_a[1] * y[k] + half_a[2] * z[k]
        out = max(0.0, abs(off[k]) - reach - half_b[k])
        square += out * out
    return max(gap, math.sqrt(square))


@jitable
def ways_between(a: F1, b: F1, ways: int, pose: F1) -> int:
    """Return which of `ways` nodes a (of I) and b (of J) have room for, seen along all their axes.

    `I_IN_J` is for a's triangles in b's layer, `J_IN_I` for b's triangles in a's layer.
    """
    x, y, z = turn(pose, vector(a)), turn(pose, vector(a[3:])), turn(pose, vector(a[6:]))
    thin, deep = (a[THIN + 3], a[THIN + 4], a[THIN + 5]), (a[DEEP + 3], a[DEEP + 4], a[DEEP + 5])
    half_thin, half_deep = vector(b[THIN + 3 :]), vector(b[DEEP + 3 :])
    flush_in = FLUSH * (thin[0] + thin[1] + thin[2] + half_deep[0] + half_deep[1] + half_deep[2])
    flush_out = FLUSH * (deep[0] + deep[1] + deep[2] + half_thin[0] + half_thin[1] + half_thin[2])
    off_in = sub(place(pose, vector(a[THIN:])), vector(b[DEEP:]))
    off_out = sub(place(pose, vector(a[DEEP:])), vector(b[THIN:]))
    # how far out of the boxes of a those of b reach, along the axes of a
    reach_in, reach_out = (-flush_in, -flush_in, -flush_in), (-flush_out, -flush_out, -flush_out)
    for k in range(3):
        u = vector(b[3 * k :])
        c = (abs(dot(u, x)), abs(dot(u, y)), abs(dot(u, z)))
        if ways & I_IN_J and abs(dot(u, off_in)) >= dot(c, thin) + half_deep[k] - flush_in:
            ways -= I_IN_J
        if ways & J_IN_I and abs(dot(u, off_out)) >= dot(c, deep) + half_thin[k] - flush_out:
            ways -= J_IN_I
        if ways == 0:
            return 0
        reach_in = add(reach_in, scale(half_deep[k], c))
        reach_out = add(reach_out, scale(half_thin[k], c))
    if ways & I_IN_J and (
        abs(dot(x, off_in)) >= thin[0] + reach_in[0]
        or abs(dot(y, off_in)) >= thin[1] + reach_in[1]
        or abs(dot(z, off_in)) >= thin[2] + reach_in[2]
    ):
        ways -= I_IN_J
    if ways & J_IN_I and (
        abs(dot(x, off_out)) >= deep[0] + reach_out[0]
        or abs(dot(y, off_out)) >= deep[1] + reach_out[1]
        or abs(dot(z, off_out)) >= deep[2] + reach_out[2]
    ):
        ways -= J_IN_I
    return ways
