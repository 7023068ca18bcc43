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
#: of the box of its triangles, and of the box of these and of their layer.
ORIENTED = 21
ROWS, THIN, DEEP = 0, 9, 15


def node_bounds(count: int, level: int) -> Indices:
    """Return where the nodes of a level begin, and `count`: node k has those from k to k + 1."""
    bounds: Indices = np.arange(2**level + 1) * count // 2**level
    return bounds


def _node_axes(corners: Array, bounds: Indices, part: Indices) -> Array:
    """Return the axes of spread (k, 3, 3) of what the nodes hold, by rows."""
    many = 3.0 * np.diff(bounds)[:, None]
    mean = np.add.reduceat(corners.sum(axis=1), bounds[:-1], axis=0) / many
    off = corners - mean[part][:, None]
    spread = np.add.reduceat(np.einsum("tki,tkj->tij", off, off), bounds[:-1], axis=0)
    axes: Array = np.linalg.eigh(spread)[1].transpose(0, 2, 1)
    return axes


def _areas(low: Array, high: Array, starts: Indices) -> Array:
    """Return half the areas of the boxes of runs of triangles, shape (k,)."""
    below = np.minimum.reduceat(low, starts, axis=0)
    x, y, z = (np.maximum.reduceat(high, starts, axis=0) - below).T
    area: Array = x * y + y * z + z * x
    return area


def _sorted_within(key: Array, bounds: Indices, part: Indices) -> Indices:
    """Return the order by a key within each node."""
    low = np.minimum.reduceat(key, bounds[:-1])
    reach = np.maximum.reduceat(key, bounds[:-1]) - low
    # one sort of numbers is several times as fast as one by two keys
    along = (key - low[part]) / np.where(reach > 0.0, 2.0 * reach, 1.0)[part]
    found: Indices = np.argsort(part + along, kind="stable")
    return found


def oriented_order(corners: Array, inner: Array, units: Array, levels: int) -> Indices:
    """Return the triangles in the order of the leaves of a tree.

    Parameters
    ----------
    corners, inner : ndarray, shape (m, 3, 3)
        Corners of the triangles and their inner points [L].
    units : ndarray, shape (m, 3)
        Unit normals.

    Notes
    -----
    Each node is halved along one of its axes, by the places of its triangles or by their normals
    (the sides of a plate part so): whichever gives the smaller boxes.
    """
    count = len(corners)
    order: Indices = np.arange(count)
    for level in range(levels):
        halves = node_bounds(count, level + 1)
        bounds = halves[::2]
        part = np.repeat(np.arange(2**level), np.diff(bounds))
        here = corners[order]
        axes = _node_axes(here, bounds, part)[part]
        own = np.einsum("tij,tkj->tki", axes, np.concatenate([here, inner[order]], axis=1))
        low, high = own.min(axis=1), own.max(axis=1)
        keys = np.hstack([own[:, :3].mean(axis=1), np.einsum("tij,tj->ti", axes, units[order])])
        least, found = np.full(2**level, np.inf), order
        for key in keys.T:
            sorted_ = _sorted_within(key, bounds, part)
            area = _areas(low[sorted_], high[sorted_], halves[:-1]).reshape(-1, 2).sum(axis=1)
            smaller = area < least
            found = np.where(smaller[part], order[sorted_], found)
            least = np.minimum(area, least)
        order = found
    return order


def _frames(corners: Array, units: Array, bounds: Indices, part: Indices) -> list[Array]:
    """Return axes (k, 3, 3) that nodes may have: of spread, the mesh's own, upright on the side.

    The last have the mean normal and, in its plane, the mesh's axis that is nearest to that of
    most spread: a side of a prism is so boxed whatever triangles it is cut into.
    """
    spread = _node_axes(corners, bounds, part)
    own = np.broadcast_to(np.eye(3), spread.shape)
    normal = np.add.reduceat(units, bounds[:-1], axis=0)
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
    """Return the rows of nodes that have these axes."""
    outer = np.einsum("tij,tkj->tki", axes[part], corners)
    both = np.concatenate([outer, np.einsum("tij,tkj->tki", axes[part], inner)], axis=1)
    made = np.empty((len(axes), ORIENTED))
    made[:, ROWS:THIN] = axes.reshape(-1, 9)
    for at, points in ((THIN, outer), (DEEP, both)):
        low = np.minimum.reduceat(points.min(axis=1), starts, axis=0)
        high = np.maximum.reduceat(points.max(axis=1), starts, axis=0)
        made[:, at : at + 3] = np.einsum("kij,ki->kj", axes, 0.5 * (low + high))
        made[:, at + 3 : at + 6] = 0.5 * (high - low)
    return made


def oriented_boxes(corners: Array, inner: Array, units: Array, levels: int) -> Array:
    """Return the oriented boxes of all nodes, shape (2^(levels + 1), `ORIENTED`).

    Triangles are in the order of the leaves; node k of level l is row 2^l + k.
    """
    made = np.zeros((2 ** (levels + 1), ORIENTED))
    for level in range(levels + 1):
        bounds = node_bounds(len(corners), level)
        part = np.repeat(np.arange(2**level), np.diff(bounds))
        nodes, least = made[2**level : 2 ** (level + 1)], np.full(2**level, np.inf)
        for axes in _frames(corners, units, bounds, part):
            rows = _boxes_along(axes, corners, inner, bounds[:-1], part)
            size = np.zeros(len(rows))
            for at in (THIN, DEEP):
                x, y, z = rows[:, at + 3 : at + 6].T
                size += x * y + y * z + z * x
            # of boxes that are as small the first, whatever rounding tells
            smaller = size < least * (1.0 - 1e-9)
            nodes[smaller], least[smaller] = rows[smaller], size[smaller]
    return made
