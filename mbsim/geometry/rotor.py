"""The features of a solid of revolution that face a given direction: end disc, side line."""

from __future__ import annotations

import math

from mbsim.core.arrays import V3
from mbsim.core.jitable import jitable
from mbsim.core.rotation import add, any_tangent, cross, dot, norm, scale, sub
from mbsim.geometry.convex import Shape, slant

#: Over the larger radius: what is so near to a solid lies in it; how far above what touches a row
#: may be that says where that is.
ROUNDING, NEARLY = 1e-9, 0.1


@jitable
def end_facing(shape: Shape, d: V3) -> int:
    """Return -1, 0 or 1: the bottom end, the side or the top end is nearest to direction d.

    The border lies half-way between the normal of the end and that of the side.
    """
    c = dot(shape[4], d)
    side = math.acos(slant(shape[5]))
    angle = math.acos(min(1.0, max(-1.0, c)))
    if angle < 0.5 * side:
        return 1
    return -1 if angle > 0.5 * (math.pi + side) else 0


@jitable
def end_disc(shape: Shape, end: int) -> tuple[V3, V3, float]:
    """Return centre, outward normal and radius of the bottom (-1) or top (1) end."""
    o = scale(float(end), shape[4])
    return add(shape[1], scale(shape[5][2], o)), o, shape[5][1] if end > 0 else shape[5][0]


@jitable
def side_line(shape: Shape, d: V3) -> tuple[V3, V3, V3]:
    """Return bottom and top end of the straight line of the side that faces d, and its normal."""
    _, centre, _, _, a, size = shape
    w = sub(d, scale(dot(d, a), a))
    length = norm(w)
    w = scale(1.0 / length, w) if length > 1e-12 else any_tangent(a)
    low = add(sub(centre, scale(size[2], a)), scale(size[0], w))
    high = add(add(centre, scale(size[2], a)), scale(size[1], w))
    c = slant(size)
    return low, high, add(scale(math.sqrt(1.0 - c * c), w), scale(c, a))


@jitable
def side_distance(shape: Shape, p: V3) -> tuple[float, V3]:
    """Return the distance of p to the side taken as unlimited (< 0 inside), and its normal."""
    _, centre, _, _, a, size = shape
    d = sub(p, centre)
    z = dot(d, a)
    across = sub(d, scale(z, a))
    r = norm(across)
    w = scale(1.0 / r, across) if r > 1e-300 else any_tangent(a)
    c = slant(size)
    k = math.sqrt(1.0 - c * c)
    return (r - size[0]) * k + (z + size[2]) * c, add(scale(k, w), scale(c, a))


@jitable
def pointed(shape: Shape, d: V3) -> float:
    """Return how far d is from the normals of ends and side, where no single point is farthest.

    From the ends it is the sine, and not 1 less the cosine, which is 5e-7 for a thousandth.
    """
    return min(abs(dot(shape[4], d) - slant(shape[5])), norm(cross(shape[4], d)))


@jitable
def widest(size: V3) -> float:
    """Return the larger radius."""
    return max(size[0], size[1])


@jitable
def lies_in(shape: Shape, p: V3, room: float) -> bool:
    """Return whether p lies in a solid, or no farther outside than `room`."""
    _, centre, _, _, a, size = shape
    d = sub(p, centre)
    z = dot(d, a)
    part = min(1.0, max(0.0, 0.5 + 0.5 * z / size[2]))
    radius = size[0] + part * (size[1] - size[0])
    return abs(z) <= size[2] + room and norm(sub(d, scale(z, a))) <= radius + room
