"""A closed triangle mesh packed with its tree of boxes, as the contact patches read it.

One array holds all: a header, the boxes of a complete binary tree over the triangles, the
triangles in the order of its leaves, a mark for each triangle that the patches use while they
work (it is -1 in between), and for a mesh with a layer the oriented boxes of the same tree and
room for the leaves that pairs with other meshes keep (`geometry.mesh.candidates`).
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from mbsim.model.elements import Array
from mbsim.model.flat_sides import sides_of
from mbsim.model.mesh import Faces, joined
from mbsim.model.surface_tree import NOTHING, level_bounds, oriented_boxes, oriented_order

#: Numbers of the header: triangles, levels of the tree below its root, where boxes, triangles,
#: marks, oriented boxes (`model.surface_tree`), the first triangles of leaves and those of shells
#: (what hangs together through edges), the lists of pairs and the flat sides (`model.flat_sides`)
#: begin, length of the whole, its volume [L^3], its flat sides. Behind the first triangles of
#: shells stands the shell of each triangle.
HEADER = 13
(
    TRIANGLES, LEVELS, AT_BOXES, AT_TRIANGLES, AT_MARKS, AT_ORIENTED, AT_LEAVES, AT_SHELLS,
    AT_KEPT, AT_SIDES, LENGTH, SOLID, SIDES,
) = range(HEADER)  # fmt: skip
#: Lists that a mesh keeps, and pairs of leaves of one at most. Which list is given up next (TURN)
#: stands before them. A list: what tells its pair, how far I may move from a pose until it is not
#: known any more (below 0: it is not), for how many evaluations the next one is made, how many
#: pairs of leaves there are, that pose of I in J's axes, the last one that was looked at, and the
#: places of the oriented boxes of both leaves.
LISTS, MOST_LEAVES, TURN = 4, 512, 0
ROWS, OTHER, REACH, AHEAD, COUNT, POSE, LAST_POSE, LEAVES = 0, 1, 2, 3, 4, 5, 17, 29
KEPT = LEAVES + 2 * MOST_LEAVES
#: Most triangles of a leaf.
LEAF = 4
#: Numbers of a node (from 1; those below node k are 2 k and 2 k + 1): centre and half edges of the
#: box of its triangles, and of the box of these and of their layer.
NODE = 12
BOX, DEEP_BOX = 0, 6
#: Numbers of a triangle: corners, their inner points in the layer and depths of these, the corners
#: in the order of their numbers in the mesh, the triangles beyond the edges (edge k from corner k
#: to the next), its number in the mesh, unit normal, the angle-weighted normals of the corners, its
#: flat side (-1: none).
TRIANGLE = 41
CORNER, INNER, DEPTH, ORDER, BESIDE, NUMBER, UNIT, CORNER_NORMAL = 0, 9, 18, 21, 24, 27, 28, 31
SIDE = 40

Indices = npt.NDArray[np.int64]


def leaves_order(middles: Array, levels: int) -> tuple[Indices, Indices]:
    """Return the triangles in the order of the leaves of a tree, and where leaves begin.

    Each node is halved along the longest side of what it holds.
    """
    count = len(middles)
    order: Indices = np.arange(count)
    starts: Indices = np.arange(2**levels + 1) * count // 2**levels
    for level in range(levels):
        bounds = level_bounds(starts, levels, level)
        part = np.repeat(np.arange(2**level), np.diff(bounds))
        here = middles[order]
        low = np.minimum.reduceat(here, bounds[:-1], axis=0)
        high = np.maximum.reduceat(here, bounds[:-1], axis=0)
        longest = (high - low).argmax(axis=1)
        order = order[np.lexsort((here[np.arange(count), longest[part]], part))]
    return order, starts


def _boxes(low: Array, high: Array, starts: Indices, levels: int) -> Array:
    """Return centre and half edges of the boxes of all nodes, shape (2^(levels + 1), 6)."""
    made = np.zeros((2 ** (levels + 1), 6))
    made[:, 3:] = NOTHING
    for level in range(levels + 1):
        bounds = level_bounds(starts, levels, level)
        held = np.flatnonzero(np.diff(bounds))
        least = np.minimum.reduceat(low, bounds[held], axis=0)
        most = np.maximum.reduceat(high, bounds[held], axis=0)
        made[2**level + held, :3] = 0.5 * (least + most)
        # rounded outward
        outward = 0.5 * (most - least) * (1.0 + 1e-15) + 1e-15 * np.abs(least)
        made[2**level + held, 3:] = outward
    return made


def beyond_edges(faces: Faces) -> Indices:
    """Return the face beyond each edge of each face of a closed mesh, shape (m, 3)."""
    count = int(faces.max()) + 1
    start, end = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    ahead, back = start * count + end, end * count + start
    order = np.argsort(ahead)
    beside: Indices = (order[np.searchsorted(ahead[order], back)] // 3).reshape(-1, 3)
    return beside


def _corner_normals(corners: Array, faces: Faces, units: Array) -> Array:
    """Return the angle-weighted normal of every corner (m, 3, 3), of any length.

    A point whose nearest point is a vertex is outside where it is above that normal (Baerentzen
    and Aanaes 2005).
    """
    ahead = np.roll(corners, -1, axis=1) - corners
    back = np.roll(corners, 1, axis=1) - corners
    angle = np.arctan2(np.linalg.norm(np.cross(ahead, back), axis=2), (ahead * back).sum(axis=2))
    total = np.zeros((int(faces.max()) + 1, 3))
    np.add.at(total, faces.ravel(), (angle[:, :, None] * units[:, None, :]).reshape(-1, 3))
    return total[faces]


def pack(
    vertices: Array, faces: Faces, inner: Array | None = None, depth: Array | None = None
) -> Array:
    """Return a closed mesh as one packed array.

    Parameters
    ----------
    vertices : ndarray, shape (n, 3)
        Positions [L], shape axes.
    faces : ndarray of int, shape (m, 3)
        Triangles of a closed mesh, counter-clockwise seen from outside.
    inner : ndarray, shape (n, 3), optional
        The inner points of its layer (`model.surface_layer`) [L]. Without them the mesh has no
        layer and no oriented boxes: it can be used on planes and under spheres alone.
    depth : ndarray, shape (n,), optional
        The depths of these [L].
    """
    layered = inner is not None
    inner = vertices if inner is None else inner
    depth = np.zeros(len(vertices)) if depth is None else depth
    count = len(faces)
    # room for uneven cuts
    levels = max(0, int(np.ceil(np.log2(max(count / LEAF, 1.0))))) + int(layered)
    corners, below = vertices[faces], inner[faces]
    units = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(units, axis=1)
    units = units / np.where(length > 0.0, length, 1.0)[:, None]
    if layered:
        order, starts = oriented_order(corners, below, units, levels, LEAF)
    else:
        order, starts = leaves_order(corners.mean(axis=1), levels)
    place = np.empty(count, dtype=np.int64)
    place[order] = np.arange(count)
    beyond = beyond_edges(faces)
    side, sides = sides_of(vertices, faces, beyond)
    beside, ordered = place[beyond[order]], faces[order]
    corners, below, units = corners[order], below[order], units[order]

    low, high = corners.min(axis=1), corners.max(axis=1)
    deep_low, deep_high = np.minimum(low, below.min(axis=1)), np.maximum(high, below.max(axis=1))
    boxes = np.hstack([
        _boxes(low, high, starts, levels), _boxes(deep_low, deep_high, starts, levels)
    ])  # fmt: skip
    table = np.hstack([
        corners.reshape(count, 9), below.reshape(count, 9), depth[ordered],
        np.argsort(ordered, axis=1), beside, order[:, None], units,
        _corner_normals(corners, ordered, units).reshape(count, 9), side[order][:, None],
    ])  # fmt: skip
    oriented = (
        oriented_boxes(corners, below, units, starts, levels).ravel() if layered else np.zeros(0)
    )
    marks = np.full(count, -1.0)
    shell = joined(np.repeat(np.arange(count), 3), beside.ravel(), count)
    shells = np.concatenate([np.unique(shell, return_index=True)[1], shell])
    kept = np.zeros((1 + LISTS * KEPT) * layered)
    parts = [boxes.ravel(), table.ravel(), marks, oriented, starts, shells, kept, sides]
    at = HEADER + np.cumsum([0, *map(len, parts)])
    a, b, c = (corners - corners.mean(axis=(0, 1))).swapaxes(0, 1)
    solid = float((np.cross(a, b) * c).sum()) / 6.0
    packed: Array = np.concatenate([[count, levels, *at, solid, side.max() + 1], *parts])
    return packed
