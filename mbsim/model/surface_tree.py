"""The tree of oriented boxes over a mesh and its layer.

A long thin triangle that lies aslant fills little of a box along the axes of its mesh. Each node
here has axes of its own: those along which the corners of its triangles are spread most and
least. Triangles are put in order so that the boxes of the two halves of a node are small.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from mbsim.model.elements import Array

Indices = npt.NDArray[np.int64]

#: Numbers of a node: its axes by rows (9), then centre (the mesh's axes) and half edges (its own)
#: of the box of its triangles, and of the box of these and of their layer; its first triangle and
#: the first behind it.
ORIENTED = 23
ROWS, THIN, DEEP, FIRST, LAST = 0, 9, 15, 21, 22


#: Nodes of more triangles are cut so that neither part has more than this part of them.
MANY, EVEN = 32, 0.55
#: Room around the inner points of a layer, as a part of the mesh: a triangle that is flush with the
#: side of a box meets it where that may be a side between two prisms, and not the surface.
ROOM = 1e-9
#: Half edge of a box that holds nothing: it meets none, and its square is a number.
NOTHING = -1e150


def level_bounds(starts: Indices, levels: int, level: int) -> Indices:
    """Return where the nodes of a level begin, and the end, from where the leaves do."""
    bounds: Indices = starts[:: 2 ** (levels - level)]
    return bounds


def _by_component(points: Array) -> Array:
    """Return points (m, k, 3) with their components first and their triangles last, (3, k, m).

    Sums and bounds over corners are then sums and bounds of whole rows.
    """
    return np.ascontiguousarray(points.transpose(2, 1, 0))


def _turned(axes: Array, part: Indices, points: Array) -> Array:
    """Return points (3, k, m) along the axes (n, 3, 3), by rows, of the node of each triangle."""
    a = np.take(axes.transpose(1, 2, 0), part, axis=2)
    x, y, z = points
    found: Array = np.stack([a[i, 0] * x + a[i, 1] * y + a[i, 2] * z for i in range(3)])
    return found


def _node_axes(corners: Array, starts: Indices, part: Indices) -> Array:
    """Return the axes of spread (k, 3, 3) of what nodes hold, by rows; corners (3, 3, m)."""
    many = 3.0 * np.bincount(part)
    mean = np.add.reduceat(corners.sum(axis=1), starts, axis=1) / many
    off = corners - mean[:, None, part]
    spread = np.empty((len(many), 3, 3))
    for i in range(3):
        for j in range(i, 3):
            total = np.add.reduceat((off[i] * off[j]).sum(axis=0), starts)
            spread[:, i, j] = spread[:, j, i] = total
    axes: Array = np.linalg.eigh(spread)[1].transpose(0, 2, 1)
    return axes


def _areas_up_to(low: Array, high: Array, part: Indices) -> Array:
    """Return half the areas of the boxes (3, m) of triangles and those before in their nodes."""
    # shifted by more than all extents, one node's bounds say nothing in the next
    shift = part * (2.0 * float((high.max(axis=1) - low.min(axis=1)).max()))
    below = np.minimum.accumulate(low - shift, axis=1) + shift
    x, y, z = np.maximum.accumulate(high + shift, axis=1) - shift - below
    area: Array = x * y + y * z + z * x
    return area


def _sorted_within(key: Array, starts: Indices, part: Indices) -> Indices:
    """Return the order by a key within each node."""
    low = np.minimum.reduceat(key, starts)
    reach = np.maximum.reduceat(key, starts) - low
    # one sort of numbers is several times as fast as one by two keys
    along = (key - low[part]) / np.where(reach > 0.0, 2.0 * reach, 1.0)[part]
    found: Indices = np.argsort(part + along, kind="stable")
    return found


def _best_cuts(
    low: Array, high: Array, starts: Indices, part: Indices, most: int
) -> tuple[Array, Indices]:
    """Return the least cost of cutting each node, and how many triangles then come first.

    Cost is the sum over both parts of number times area of the box. A part has at most `most`;
    parts of many are nearly as large as each other, so that room is left for uneven cuts of few.
    """
    count = np.bincount(part)
    first = np.arange(len(part)) - starts[part] + 1
    rest = count[part] - first
    before = _areas_up_to(low, high, part)
    after = _areas_up_to(low[:, ::-1], high[:, ::-1], part[-1] - part[::-1])[::-1]
    cost = before * first
    cost[:-1] += after[1:] * rest[:-1]
    larger = np.maximum(first, rest)
    uneven = (count[part] > MANY) & (larger > np.ceil(EVEN * count[part]))
    cost[(rest == 0) | (larger > most) | uneven] = np.inf
    least = np.minimum.reduceat(cost, starts)
    at = np.flatnonzero(cost == least[part])
    _, chosen = np.unique(part[at], return_index=True)
    return least, np.where(count > 1, first[at[chosen]], 1)


def oriented_order(
    corners: Array, inner: Array, units: Array, levels: int, leaf: int
) -> tuple[Indices, Indices]:
    """Return the triangles in the order of the leaves of a tree, and where leaves begin.

    Parameters
    ----------
    corners, inner : ndarray, shape (m, 3, 3)
        Corners of the triangles and their inner points [L].
    units : ndarray, shape (m, 3)
        Unit normals.
    levels, leaf : int
        Levels below the root, and the most triangles of a leaf; some leaves have none.

    Notes
    -----
    Each node is cut in two along one of its axes, by the places of its triangles or by their
    normals (the sides of a plate part so), where number times area of the boxes is least.
    """
    order: Indices = np.arange(len(corners))
    points, below = _by_component(corners), _by_component(inner)
    normals = np.ascontiguousarray(units.T)[:, None]
    bounds: Indices = np.array([0, len(corners)])
    for level in range(levels):
        held = np.flatnonzero(np.diff(bounds))
        starts = bounds[held]
        part = np.repeat(np.arange(len(held)), np.diff(bounds)[held])
        here = points[:, :, order]
        axes = _node_axes(here, starts, part)
        outer = _turned(axes, part, here)
        under = _turned(axes, part, below[:, :, order])
        low = np.minimum(outer.min(axis=1), under.min(axis=1))
        high = np.maximum(outer.max(axis=1), under.max(axis=1))
        keys = (*outer.mean(axis=1), *_turned(axes, part, normals[:, :, order])[:, 0])
        most = leaf * 2 ** (levels - level - 1)
        least, found = np.full(len(held), np.inf), order
        split = np.ones(len(held), dtype=np.int64)
        for key in keys:
            sorted_ = _sorted_within(key, starts, part)
            cost, first = _best_cuts(low[:, sorted_], high[:, sorted_], starts, part, most)
            better = cost < least
            found = np.where(better[part], order[sorted_], found)
            split, least = np.where(better, first, split), np.minimum(cost, least)
        order = found
        middle = bounds[:-1].copy()
        middle[held] += split
        bounds = np.append(np.column_stack([bounds[:-1], middle]).ravel(), bounds[-1])
    return order, bounds


def _frames(corners: Array, units: Array, starts: Indices, part: Indices) -> list[Array]:
    """Return axes (k, 3, 3) that nodes may have: of spread, the mesh's own, upright on the side.

    Corners are (3, 3, m), components first.

    The last have the mean normal and, in its plane, the mesh's axis that is nearest to that of
    most spread: a side of a prism is so boxed whatever triangles it is cut into.
    """
    spread = _node_axes(corners, starts, part)
    own = np.broadcast_to(np.eye(3), spread.shape)
    normal = np.add.reduceat(units, starts, axis=0)
    length = np.linalg.norm(normal, axis=1)
    normal /= np.where(length > 0.0, length, 1.0)[:, None]
    along = np.eye(3)[np.abs(spread[:, 2]).argmax(axis=1)]
    along -= (along * normal).sum(axis=1)[:, None] * normal
    size = np.linalg.norm(along, axis=1)
    along /= np.where(size > 0.0, size, 1.0)[:, None]
    upright = np.stack([normal, np.cross(along, normal), along], axis=1)
    fit = (length > 0.0) & (size > 0.1)
    return [spread, own, np.where(fit[:, None, None], upright, spread)]


def _boxes_along(
    axes: Array, corners: Array, inner: Array, starts: Indices, part: Indices
) -> Array:
    """Return the rows of nodes that have these axes; corners and inner points (3, 3, m)."""
    outer, below = _turned(axes, part, corners), _turned(axes, part, inner)
    room = ROOM * float(np.ptp(corners.reshape(3, -1), axis=1).max())
    low, high = outer.min(axis=1), outer.max(axis=1)
    deep_low = np.minimum(low, below.min(axis=1) - room)
    deep_high = np.maximum(high, below.max(axis=1) + room)
    made = np.empty((len(axes), ORIENTED))
    made[:, ROWS:THIN] = axes.reshape(-1, 9)
    for at, least, most in ((THIN, low, high), (DEEP, deep_low, deep_high)):
        low = np.minimum.reduceat(least, starts, axis=1).T
        high = np.maximum.reduceat(most, starts, axis=1).T
        made[:, at : at + 3] = np.einsum("kij,ki->kj", axes, 0.5 * (low + high))
        made[:, at + 3 : at + 6] = 0.5 * (high - low)
    return made


def oriented_boxes(
    corners: Array, inner: Array, units: Array, starts: Indices, levels: int
) -> Array:
    """Return the oriented boxes of all nodes, shape (2^(levels + 1), `ORIENTED`).

    Triangles are in the order of the leaves, which begin at `starts`; node k of level l is row
    2^l + k.
    """
    made = np.zeros((2 ** (levels + 1), ORIENTED))
    made[:, [0, 4, 8]] = 1.0
    points, below = _by_component(corners), _by_component(inner)
    made[:, THIN + 3 : DEEP] = made[:, DEEP + 3 : FIRST] = NOTHING
    for level in range(levels + 1):
        bounds = level_bounds(starts, levels, level)
        held = np.flatnonzero(np.diff(bounds))
        part = np.repeat(np.arange(len(held)), np.diff(bounds)[held])
        nodes, least = np.zeros((len(held), ORIENTED)), np.full(len(held), np.inf)
        for axes in _frames(points, units, bounds[held], part):
            rows = _boxes_along(axes, points, below, bounds[held], part)
            size = np.zeros(len(rows))
            for at in (THIN, DEEP):
                x, y, z = rows[:, at + 3 : at + 6].T
                size += x * y + y * z + z * x
            # of boxes that are as small the first, whatever rounding tells
            smaller = size < least * (1.0 - 1e-9)
            nodes[smaller], least[smaller] = rows[smaller], size[smaller]
        nodes[:, FIRST], nodes[:, LAST] = bounds[held], bounds[held + 1]
        made[2**level + held] = nodes
    return made
