"""The edges of a face that lies on the end disc of a solid of revolution.

All is in the plane of the disc, about its middle. A row of eight numbers stands for an edge: where
it enters the disc (x, y) and leaves it (x, y), whether it does each on the circle (0/1), its
direction [rad], whether any of it is in the disc (0/1). Of edge e that is row 2 e, but for the
direction, which is in row 2 e + 1.
"""

from __future__ import annotations

import math

from mbsim.core.arrays import F1, F2
from mbsim.core.jitable import jitable
from mbsim.geometry.manifold import turn_of


@jitable
def clip_edge(row: F1, ax: float, ay: float, bx: float, by: float, r: float) -> int:
    """Cut one edge a-b of the face with the circle of radius r around 0.

    Writes into `row` enter x, y, leave x, y, on circle there (0/1 each), and returns
    1 if some of it is within, 0 if not, -1 if the circle lies beyond the edge.
    """
    tx, ty = bx - ax, by - ay
    length = math.sqrt(tx * tx + ty * ty)
    tx, ty = tx / length, ty / length
    # distance of the line in front of the circle's centre
    h = ax * ty - ay * tx
    if h <= -r:
        return -1
    if h >= r:
        return 0
    half = math.sqrt(r * r - h * h)
    foot = -(ax * tx + ay * ty)
    low, high = max(0.0, foot - half), min(length, foot + half)
    if low >= high:
        return 0 if h > 0.0 else -1
    row[0], row[1] = ax + low * tx, ay + low * ty
    row[2], row[3] = ax + high * tx, ay + high * ty
    row[4] = 1.0 if foot - half > 0.0 else 0.0
    row[5] = 1.0 if foot + half < length else 0.0
    return 1


@jitable
def end_at_corners(work: F2, count: int) -> None:
    """Let a cut edge enter or leave the disc at its corner where the edge beyond is not cut.

    That is a corner on the circle, whose other edge only touches it. `count` is how many edges
    the face has.
    """
    for e in range(count):
        if work[2 * e, 7] == 1.0 and work[2 * ((e + 1) % count), 7] == 0.0:
            work[2 * e, 5] = 1.0
        if work[2 * e, 7] == 1.0 and work[2 * ((e + count - 1) % count), 7] == 0.0:
            work[2 * e, 4] = 1.0


@jitable
def corner_turn(row: F1, turn: float, before: float, side: int) -> tuple[float, float, float]:
    """Return (angle, x, y): the turn of the border where an edge enters (0) or leaves (1) the disc.

    `row` is what `clip_edge` wrote, `turn` the direction of the edge, `before` of the one before.
    """
    x, y = row[2 * side], row[2 * side + 1]
    tx, ty = math.cos(turn), math.sin(turn)
    if side == 1:
        # where an edge ends within the disc the next one has the corner
        return (turn_of(tx, ty, -y, x) if row[5] == 1.0 else 0.0), x, y
    if row[4] == 1.0:
        return turn_of(-y, x, tx, ty), x, y
    return turn_of(math.cos(before), math.sin(before), tx, ty), x, y
