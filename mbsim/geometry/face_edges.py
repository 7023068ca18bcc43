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
from mbsim.geometry.manifold import TURN, turn_of

#: Columns of an edge.
ENTERS_X, ENTERS_Y, LEAVES_X, LEAVES_Y, ENTERS, LEAVES, TURNS, CUT = range(8)


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
    row[ENTERS_X], row[ENTERS_Y] = ax + low * tx, ay + low * ty
    row[LEAVES_X], row[LEAVES_Y] = ax + high * tx, ay + high * ty
    row[ENTERS] = 1.0 if foot - half > 0.0 else 0.0
    row[LEAVES] = 1.0 if foot + half < length else 0.0
    return 1


@jitable
def cut_edge(work: F2, e: int, ax: float, ay: float, bx: float, by: float, r: float) -> int:
    """Write edge e, which goes from a to b; return what `clip_edge` does."""
    work[2 * e + 1, TURNS] = math.atan2(by - ay, bx - ax)
    code = clip_edge(work[2 * e], ax, ay, bx, by, r)
    work[2 * e, CUT] = 1.0 if code == 1 else 0.0
    return code


@jitable
def end_at_corners(work: F2, count: int) -> None:
    """Let a cut edge enter or leave the disc at its corner where the edge beyond is not cut.

    That is a corner on the circle, whose other edge only touches it. `count` is how many edges
    the face has.
    """
    for e in range(count):
        if work[2 * e, CUT] == 1.0 and work[2 * ((e + 1) % count), CUT] == 0.0:
            work[2 * e, LEAVES] = 1.0
        if work[2 * e, CUT] == 1.0 and work[2 * ((e + count - 1) % count), CUT] == 0.0:
            work[2 * e, ENTERS] = 1.0


@jitable
def chord_normals(work: F2, count: int) -> tuple[float, float]:
    """Return the sum of the normals of a face's edges within the disc, each as long as its chord.

    The normal of a border adds up to 0 around it: what chords lack the arcs have.
    """
    x, y = 0.0, 0.0
    for e in range(count):
        if work[2 * e, CUT] == 1.0:
            x -= work[2 * e, LEAVES_Y] - work[2 * e, ENTERS_Y]
            y += work[2 * e, LEAVES_X] - work[2 * e, ENTERS_X]
    return x, y


@jitable
def fill_arcs(work: F2, count: int, cuts: int) -> float:
    """Write the arcs of the disc over a face: start and length [rad] into the rows 2 e + 1.

    They go from where one edge leaves to where the next enters; `cuts` edges do. Returns the sum
    of their lengths.
    """
    arcs, total = work[1::2], 0.0
    for e in range(count):
        arcs[e, 0] = arcs[e, 1] = 0.0
        if work[2 * e, CUT] == 0.0 or work[2 * e, LEAVES] == 0.0:
            continue
        for step in range(1, count + 1):
            g = (e + step) % count
            if work[2 * g, CUT] == 1.0:
                start = math.atan2(work[2 * e, LEAVES_Y], work[2 * e, LEAVES_X])
                stop = math.atan2(work[2 * g, ENTERS_Y], work[2 * g, ENTERS_X])
                length = (stop - start) % TURN
                # a corner on the circle: rounding must not make it a whole turn
                length = 0.0 if cuts > 1 and length > TURN - 1e-9 else length
                arcs[e, 0], arcs[e, 1] = start, length
                total += length
                break
    if cuts == 0:
        arcs[0, 1] = total = TURN
    return total


@jitable
def corner_turn(row: F1, turn: float, before: float, side: int) -> tuple[float, float, float]:
    """Return (angle, x, y): the turn of the border where an edge enters (0) or leaves (1) the disc.

    `row` is what `clip_edge` wrote, `turn` the direction of the edge, `before` of the one before.
    """
    x, y = (row[ENTERS_X], row[ENTERS_Y]) if side == 0 else (row[LEAVES_X], row[LEAVES_Y])
    tx, ty = math.cos(turn), math.sin(turn)
    if side == 1:
        # where an edge ends within the disc the next one has the corner
        return (turn_of(tx, ty, -y, x) if row[LEAVES] == 1.0 else 0.0), x, y
    if row[ENTERS] == 1.0:
        return turn_of(-y, x, tx, ty), x, y
    return turn_of(math.cos(before), math.sin(before), tx, ty), x, y
