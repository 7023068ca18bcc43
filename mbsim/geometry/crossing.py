"""Where an edge of one polyhedron crosses an edge of another: its weight, its place, its couple.

Seen along n the faces that look at each other have a polygon in common. A crossing of two edges
has the polygon's exterior angle over a right angle as its weight x; with the neighbouring face
of one polyhedron in place of the face the same crossing has 2 - x. With `t` from 0 to 1/2, how
far each face has given way to that neighbour, and o = t_i + t_j - 2 t_i t_j, the weight is

    s = (1 - o) x + o (2 - x)

The elastic energy is s E(d), with d the distance of the edges' lines: so beside the force there
is the couple -E ds/dw on I, with w a small turn of I against J. Without it an impact of two
edges would make or swallow energy as the edges turn against each other.
"""

from __future__ import annotations

import math

from mbsim.core.arrays import V3
from mbsim.core.blend import step, step_derivative
from mbsim.core.jitable import jitable
from mbsim.core.rotation import add, cross, dot, scale, sub

#: What n turns with: the face of J, the face of I, or an edge of each.
FACE_OF_J, FACE_OF_I, EDGES_MEET = range(3)
#: Part of the way from a face's normal to its neighbour's up to which the face is alone.
ALONE = 0.11
#: The place of a crossing is at most this many depths along the edge from where it is seen.
FARTHEST = 10.0
#: A point with a smaller weight is none: it would be an incident without force.
LEAST_WEIGHT = 1e-6


@jitable
def turning(kind: int, n: V3, u: V3, e: V3) -> tuple[int, V3, V3]:
    """Return how n turns as I turns: for `carried`; u, e are the edges whose normal n is."""
    if kind != EDGES_MEET:
        return kind, u, e
    # n stays square to both: dn = (e x n) a with a (e x n).u = -(u x n).w
    across = cross(e, n)
    return kind, cross(u, n), scale(1.0 / dot(across, u), across)


@jitable
def carried(q: V3, n: V3, turn: tuple[int, V3, V3]) -> V3:
    """Return the vector a with a.w = q.dn, dn the change of n as I turns by w and J stays."""
    kind, first, second = turn
    if kind == FACE_OF_J:
        return (0.0, 0.0, 0.0)
    if kind == FACE_OF_I:
        return cross(n, q)
    return scale(-dot(q, second), first)


@jitable
def given_way(out: V3, m: V3, side: V3, beyond: V3) -> tuple[float, float, V3]:
    """Return t, dt/d(tilt) and x with d(tilt) = x.d(out) for a face seen along -out.

    `m` is the face's outward normal, `side` the way across its edge in its plane, `beyond` the
    outward normal of the face beyond.
    """
    a, b = dot(out, side), dot(out, m)
    if a <= 1e-9 * b:
        # flat, or tilted the other way: most of all
        return 0.0, 0.0, m
    whole = math.atan2(dot(beyond, side), dot(beyond, m))
    tilt = math.atan2(a, b) / whole
    x = scale(1.0 / (a * a + b * b), sub(scale(b, side), scale(a, m)))
    slope = 0.5 * step_derivative(tilt, ALONE, 0.0, 0.5, 1.0, 1) / whole
    return 0.5 * step(tilt, ALONE, 0.0, 0.5, 1.0), slope, x


@jitable
def weight_of_crossing(
    u: V3,
    e: V3,
    n: V3,
    ends: bool,
    face_i: tuple[V3, V3],
    face_j: tuple[V3, V3],
    turn: tuple[int, V3, V3],
) -> tuple[float, V3]:
    """Return the weight of a crossing and the couple on I for a unit of energy.

    Parameters
    ----------
    u, e : tuple
        Unit vectors along the edges of I and J, each with the polygon to its left seen against n.
    n : tuple
        Unit vector from J into I along which the polyhedra are looked at.
    ends : bool
        Whether the polygon leaves I's edge there for that of J.
    face_i, face_j : tuple
        Outward normals of the face and of the face beyond the edge.
    turn : tuple
        See `turning`.
    """
    un, en, ue = dot(u, n), dot(e, n), cross(u, e)
    sin, cos = dot(ue, n), dot(u, e) - un * en
    sign = 1.0 if ends else -1.0
    x = math.atan2(sign * sin, cos) / (0.5 * math.pi)
    # rounding may turn parallel edges either way
    within = 0.0 < x < 2.0
    x = min(2.0, x + 4.0 if x <= -1.0 else max(0.0, x))
    side_i, side_j = cross(face_i[0], u), cross(e, face_j[0])
    t_i, slope_i, x_i = given_way(scale(-1.0, n), face_i[0], side_i, face_i[1])
    t_j, slope_j, x_j = given_way(n, face_j[0], side_j, face_j[1])
    other = t_i + t_j - 2.0 * t_i * t_j
    weight = (1.0 - other) * x + other * (2.0 - x)
    if weight <= LEAST_WEIGHT or not within:
        return weight, (0.0, 0.0, 0.0)

    # how sin and cos change with a turn of I
    by_sin = add(cross(u, cross(e, n)), carried(ue, n, turn))
    by_cos = sub(ue, scale(en, add(cross(u, n), carried(u, n, turn))))
    by_cos = sub(by_cos, scale(un, carried(e, n, turn)))
    factor = sign * (1.0 - 2.0 * other) / (0.5 * math.pi * (sin * sin + cos * cos))
    change = scale(factor, sub(scale(cos, by_sin), scale(sin, by_cos)))
    if slope_i > 0.0:
        part = (2.0 - 2.0 * x) * (1.0 - 2.0 * t_j) * slope_i
        change = sub(change, scale(part, add(cross(x_i, n), carried(x_i, n, turn))))
    if slope_j > 0.0:
        part = (2.0 - 2.0 * x) * (1.0 - 2.0 * t_i) * slope_j
        change = add(change, scale(part, carried(x_j, n, turn)))
    return weight, scale(-1.0, change)


@jitable
def middle_of_lines(p: V3, u: V3, e: V3, g: V3, way: V3, d: float) -> V3:
    """Return the middle of two lines where they are nearest to each other.

    The line along u goes through p, that along e through p + `way`; they are d apart along their
    common normal g. Lines that are nearly parallel are nearest far away: no farther than
    `FARTHEST` times as far from p as p is from the other line.
    """
    across = cross(e, g)
    along, slope = dot(way, across), dot(u, across)
    most = FARTHEST * math.sqrt(dot(way, way))
    part = most if along * slope >= 0.0 else -most
    if abs(along) < most * abs(slope):
        part = along / slope
    return add(p, add(scale(part, u), scale(0.5 * d, g)))
