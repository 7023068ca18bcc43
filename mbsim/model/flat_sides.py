"""Flat sides of a mesh that a body can lie on: the corners of their hulls, and their borders.

A rigid body on a flat side is held by the corners of the side's convex hull. Each has the hull's
exterior angle there over a whole turn as its share: all shares are 1, and a border that a file cuts
finer or coarser has the same ones all along.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from mbsim.core.blend import step
from mbsim.model.elements import Array
from mbsim.model.flat_parts import parts_of
from mbsim.model.mesh import Faces

Indices = npt.NDArray[np.int64]

#: Cosines of the tilt at which a side begins to lie (6 degrees) and lies (2).
LEANS, LIES = 0.9945, 0.9994
#: Both tilts are at most these parts of the least angle with a neighbour. Tilted more, a side leans
#: on its corners, which hold up to such parts of that angle: two sides do not hold at once.
#: Beside neighbours that are nearly in its plane a side holds while it is less deep than some part
#: (`ROOM` the whole, faded between `SHALLOW` and `DEEP` of it) of its width times that angle: else
#: what is below has more sides, and is a round surface.
LIES_OF, LEANS_OF, SHALLOW, DEEP = 0.25, 0.5, 0.1, 0.5
HOLDS_OF, LEAVES_OF = 0.4, 0.5
#: Numbers of a side: how far it is one (0 to 1), its outward normal and height, how many corners
#: its convex hull has and where they begin, how many edges its border has and where they begin, the
#: cosines of the tilts at which it begins to lie, lies, begins to hold and holds, its room.
#: A corner has its place and its share, an edge its two ends with the side to the left.
SIDE_ROW = 14
AS_SIDE, NORMAL, HEIGHT, HULL_COUNT, AT_HULL, BORDER_COUNT, AT_BORDER = 0, 1, 4, 5, 6, 7, 8
AT_LEANING, AT_LYING, AT_LEAVING, AT_HOLDING, ROOM = 9, 10, 11, 12, 13
HULL_CORNER, BORDER_EDGE, SHARE = 4, 6, 3


def part_of_side(wide: float, bend: float) -> float:
    """Return 1 for a face that a body can lie on, 0 for a facet of a round surface.

    Parameters
    ----------
    wide : float
        Width of the face over that of the mesh: of a side over 0.6, of a facet below 0.3.
    bend : float
        Least angle with one of its neighbours [degrees]: of a side 25, of a facet 10.
    """
    return float(max(step(wide, 0.3, 0.0, 0.6, 1.0), step(bend, 10.0, 0.0, 25.0, 1.0)))


def exterior_angles(points: Array) -> Array:
    """Return the exterior angle [rad] at every corner (k, 3) of a convex polygon in space."""
    edge = np.roll(points, -1, axis=0) - points
    edge = edge / np.linalg.norm(edge, axis=1)[:, None]
    before = np.roll(edge, 1, axis=0)
    cross = np.linalg.norm(np.cross(before, edge), axis=1)
    angle: Array = np.arctan2(cross, (before * edge).sum(axis=1))
    return angle


def _hull(points: Array, near: float) -> Indices:
    """Return the corners of the convex hull of points (k, 2) in order, `near` beyond each other."""
    order = np.lexsort((points[:, 1], points[:, 0]))
    chains = []
    for way in (order, order[::-1]):
        chain: list[int] = []
        for k in way.tolist():
            while len(chain) > 1:
                a, b = points[chain[-2]], points[chain[-1]]
                e, d = points[k] - a, b - a
                if e[0] * d[1] - e[1] * d[0] < -near * math.hypot(*e):
                    break
                chain.pop()
            if not chain or np.abs(points[k] - points[chain[-1]]).max() > near:
                chain.append(k)
        chains.append(chain[:-1])
    return np.array([*chains[0], *chains[1]], dtype=np.int64)


def _limits(bend: float, width: float) -> tuple[float, float, float, float, float]:
    """Return the cosines of the tilts at which a side begins to lie, lies, begins to hold, holds.

    The last number is its room [L].

    `bend` is the least angle with a neighbour [degrees].
    """
    angle = math.radians(bend)
    round_part = 1.0 - step(bend, 10.0, 0.0, 25.0, 1.0)
    room = width * angle / round_part if round_part > 0.0 else math.inf
    leans, lies = max(LEANS, math.cos(LEANS_OF * angle)), max(LIES, math.cos(LIES_OF * angle))
    return leans, lies, math.cos(LEAVES_OF * angle), math.cos(HOLDS_OF * angle), room


def sides_of(vertices: Array, faces: Faces, beside: Indices) -> tuple[Indices, Array]:
    """Return the side of each face, -1 where it has none, and all sides as one array of numbers.

    Parameters
    ----------
    vertices : ndarray, shape (n, 3)
        Positions [L], shape axes.
    faces : ndarray of int, shape (m, 3)
        Triangles of a closed mesh, counter-clockwise seen from outside.
    beside : ndarray of int, shape (m, 3)
        The face beyond each edge, edge k from corner k to the next.
    """
    part, normal = parts_of(vertices, faces)
    count, size = len(normal), np.ptp(vertices, axis=0).max()
    other = part[beside]
    border = other != part[:, None]
    along = np.where(border, (normal[part][:, None] * normal[other]).sum(axis=2), -1.0)
    least = np.full(count, -1.0)
    np.maximum.at(least, part, along.max(axis=1))
    bend = np.degrees(np.arccos(np.clip(least, -1.0, 1.0)))
    low, high = np.full((count, 3), np.inf), np.full((count, 3), -np.inf)
    np.minimum.at(low, part, vertices[faces].min(axis=1))
    np.maximum.at(high, part, vertices[faces].max(axis=1))
    wide = (high - low).max(axis=1) / size
    found = [(p, part_of_side(float(wide[p]), float(bend[p]))) for p in range(count)]
    sides = [(p, lies) for p, lies in found if lies > 0.0]
    number = np.full(count, -1)
    number[[p for p, _ in sides]] = np.arange(len(sides))

    a, b, c = (vertices[faces[:, k]] for k in range(3))
    area = np.bincount(part, 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1), count)
    order = np.argsort(part, kind="stable")
    first = np.searchsorted(part[order], np.arange(count + 1))
    rows, tail = [], []
    at = SIDE_ROW * len(sides)
    for p, lies in sides:
        mine, n = order[first[p] : first[p + 1]], normal[p]
        f, k = np.nonzero(border[mine])
        start, end = faces[mine[f], k], faces[mine[f], (k + 1) % 3]
        x = np.cross(n, np.eye(3)[np.abs(n).argmin()])
        x = x / np.linalg.norm(x)
        ring = vertices[start]
        ring = ring[_hull(np.column_stack([ring @ x, ring @ np.cross(n, x)]), 1e-9 * size)]
        share = exterior_angles(ring) / (2.0 * math.pi)
        edges = np.hstack([vertices[start], vertices[end]])
        after = at + ring.size + len(ring)
        height = float((ring @ n).mean())
        row = [lies, *n, height, len(ring), at, len(edges), after]
        length = np.linalg.norm(edges[:, 3:] - edges[:, :3], axis=1).sum()
        rows.append([*row, *_limits(float(bend[p]), 2.0 * float(area[p] / length))])
        tail += [np.column_stack([ring, share / share.sum()]).ravel(), edges.ravel()]
        at = after + edges.size
    table = np.array(rows, dtype=np.float64).reshape(-1)
    return number[part], np.concatenate([table, *tail])
