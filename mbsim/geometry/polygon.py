"""Convex polygons that remember where their edges come from.

A polygon is three columns of a scratch array: x, y of a vertex (counter-clockwise) and the tag
of the edge that starts there. Clipping by half-planes keeps tags, so that the kind of every
vertex follows from the tags of its two edges alone: corners that coincide, edges that lie on
each other and rounding change which vertices there are, never how the exterior angles add up.
"""

from __future__ import annotations

from mbsim.core.arrays import F2
from mbsim.core.jitable import jitable

X, Y, TAG = range(3)


@jitable
def clip(
    polygon: F2,
    count: int,
    out: F2,
    nx: float,
    ny: float,
    limit: float,
    tag: float,
    tie: float = 0.0,
) -> int:
    """Write the part of a polygon with nx x + ny y <= limit into `out`; return its vertices.

    Parameters
    ----------
    polygon, out : ndarray, shape (capacity, 3)
        Two convex polygons of m and n corners have m + n in common at most.
    count : int
        Vertices of `polygon`.
    nx, ny, limit : float
        The half-plane.
    tag : float
        Of the edge that the half-plane's border becomes.
    tie : float
        A vertex that is outside by no more than that is on the border, and stays.
    """
    kept, capacity = 0, len(out)
    for k in range(count):
        after = k + 1 if k + 1 < count else 0
        here = nx * polygon[k, X] + ny * polygon[k, Y] - limit
        there = nx * polygon[after, X] + ny * polygon[after, Y] - limit
        if here <= tie and kept < capacity:
            out[kept, X], out[kept, Y] = polygon[k, X], polygon[k, Y]
            out[kept, TAG] = polygon[k, TAG]
            kept += 1
        if (here <= tie) != (there <= tie) and kept < capacity:
            # one that stays though it is outside is where its edge goes out or comes in
            part = min(1.0, max(0.0, here / (here - there)))
            out[kept, X] = polygon[k, X] + part * (polygon[after, X] - polygon[k, X])
            out[kept, Y] = polygon[k, Y] + part * (polygon[after, Y] - polygon[k, Y])
            # leaving, the border begins here; coming back, what is left of the edge does
            out[kept, TAG] = tag if here <= tie else polygon[k, TAG]
            kept += 1
    return kept
