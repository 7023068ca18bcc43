"""How deep equal cubes are in each other and beyond planes, from rows of any engine."""

from __future__ import annotations

import numpy as np

from mbsim.bench.parameters import axes_of

#: Axes along which two edges are nearer to parallel than this say nothing new.
PARALLEL = 1e-6


def corners(position: np.ndarray, quaternion: np.ndarray, edge: float) -> np.ndarray:
    """Return the corners (n, 8, 3) of cubes with centres (n, 3) and attitudes (n, 4), w first."""
    signs = np.array(np.meshgrid(*[(-0.5, 0.5)] * 3)).reshape(3, 8).T * edge
    found: np.ndarray = position[:, None, :] + np.einsum("nij,kj->nki", axes_of(quaternion), signs)
    return found


def deepest_pair(position: np.ndarray, quaternion: np.ndarray, edge: float) -> float:
    """Return the largest overlap [m] of two of n cubes, each along the axis where it is least.

    The separating axes are the normals of the faces and the products of edges (15 a pair).
    """
    from scipy.spatial import cKDTree

    pairs = cKDTree(position).query_pairs(np.sqrt(3.0) * edge, output_type="ndarray")
    if not len(pairs):
        return 0.0
    R = axes_of(quaternion)
    a, b = R[pairs[:, 0]], R[pairs[:, 1]]  # (m, 3, 3), axes in columns
    between = position[pairs[:, 0]] - position[pairs[:, 1]]
    faces = np.concatenate([a, b], axis=2)
    edges = np.cross(a[:, :, :, None], b[:, :, None, :], axis=1).reshape(len(pairs), 3, 9)
    axes = np.concatenate([faces, edges], axis=2)
    length = np.linalg.norm(axes, axis=1)
    useful = length > PARALLEL
    axes = axes / np.where(useful, length, 1.0)[:, None, :]
    reach = 0.5 * edge * sum(np.abs(np.einsum("mik,mij->mkj", R_, axes)).sum(1) for R_ in (a, b))
    overlap = reach - np.abs(np.einsum("mi,mij->mj", between, axes))
    least = np.where(useful, overlap, np.inf).min(axis=1)
    return float(max(least.max(), 0.0))


def beyond(points: np.ndarray, half: float | None = None) -> float:
    """Return how far [m] the farthest of points (..., 3) is below z = 0 or outside of a box.

    `half` is half the inner width of an open box about the z axis; None for a plane alone.
    """
    depth = -float(points[..., 2].min())
    if half is not None:
        depth = max(depth, float(np.abs(points[..., :2]).max()) - half)
    return max(depth, 0.0)
