"""Points of rigid contact between meshes that are not convex, on shapes of which they are known."""

import ctypes

import numpy as np
import pytest
import trimesh

from helpers.pairs import random_rotation
from helpers.surfaces import Meshed
from mbsim.compile_model import pair_adapter
from mbsim.core import jit
from mbsim.geometry.catalog import (
    AT_DEPTH,
    AT_NORMAL,
    AT_POINT,
    AT_WEIGHT,
    PAIRS,
    POINT,
    RIGID_PAIRS,
    Pair,
)

HALF_I, HALF_J = np.array([0.1, 0.15, 0.05]), np.array([0.12, 0.1, 0.08])
UPRIGHT = np.eye(3)


def rows(pair: Pair, pose_i, size_i, pose_j, size_j):
    """Return the rows of a pair that are points; a pose is origin and rotation."""
    address = jit.address(
        pair_adapter.adapt_pair(pair.points, pair.slots), pair_adapter.SIGNATURE, allocates=True
    )
    points = np.zeros((pair.slots, POINT))
    frames = [np.concatenate([p, R.ravel()]) for p, R in (pose_i, pose_j)]
    arrays = [frames[0], size_i, frames[1], size_j, points]
    kind = ctypes.CFUNCTYPE(ctypes.c_int64, *[ctypes.c_void_p] * len(arrays))
    kind(address)(*(a.ctypes.data for a in arrays))
    return points[points[:, AT_WEIGHT] > 0.0]


def as_mesh(solid):
    """Return a mesh as it is packed."""
    return Meshed(np.array(solid.vertices), np.array(solid.faces))


def place(points):
    """Return the places of points."""
    return points[:, AT_POINT : AT_POINT + 3]


def deepest(points):
    """Return depth and normal of the deepest point."""
    k = points[:, AT_DEPTH].argmax()
    return points[k, AT_DEPTH], points[k, AT_NORMAL : AT_NORMAL + 3]


def boxes_at(way, R_i, R_j):
    """Return two boxes' poses where they overlap by 1e-4 m, I being moved along `way`."""
    sizes = np.append(HALF_I, 0.0), np.append(HALF_J, 0.0)
    near, far = 0.0, 0.6
    for _ in range(40):
        middle = 0.5 * (near + far)
        found = rows(PAIRS["BOX-BOX"], (middle * way, R_i), sizes[0], (np.zeros(3), R_j), sizes[1])
        near, far = (middle, far) if found[:, AT_DEPTH].max() > 1e-4 else (near, middle)
    return (near * way, R_i), (np.zeros(3), R_j), sizes


def test_boxes_taken_as_meshes_touch_as_boxes_do():
    rng, pair = np.random.default_rng(1), RIGID_PAIRS["SURFACE-SURFACE"]
    i, j = (as_mesh(trimesh.creation.box(2.0 * half)) for half in (HALF_I, HALF_J))
    for _ in range(150):
        way = rng.normal(size=3)
        R_i = random_rotation(rng) if rng.random() < 0.7 else UPRIGHT
        R_j = random_rotation(rng) if rng.random() < 0.5 else UPRIGHT
        at_i, at_j, sizes = boxes_at(way / np.linalg.norm(way), R_i, R_j)
        depth, n = deepest(rows(PAIRS["BOX-BOX"], at_i, sizes[0], at_j, sizes[1]))
        found = rows(pair, at_i, i.size, at_j, j.size)
        mine, m = deepest(found)
        assert mine == pytest.approx(depth, abs=1e-9)
        assert m @ n > 1.0 - 1e-9
        # nothing is pushed another way
        assert (found[:, AT_NORMAL : AT_NORMAL + 3] @ n).min() > 0.99


@pytest.mark.parametrize("depth", [1e-9, 1e-6, 1e-4])
@pytest.mark.parametrize("tilt", [0.0, 1e-9, 1e-6])
@pytest.mark.parametrize("yaw", [0.0, 0.4])
def test_a_ring_on_a_ring_is_held_all_round(yaw, tilt, depth):
    ring = as_mesh(trimesh.creation.annulus(0.05, 0.1, 0.1, sections=32))
    c, s = np.cos(yaw), np.sin(yaw)
    R = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    R = R @ np.array([[1.0, 0.0, 0.0], [0.0, 1.0, -tilt], [0.0, tilt, 1.0]])
    at = np.array([0.0, 0.0, 0.1 - depth])
    pair = RIGID_PAIRS["SURFACE-SURFACE"]
    found = rows(pair, (at, R), ring.size, (np.zeros(3), UPRIGHT), ring.size)
    n = found[:, AT_NORMAL : AT_NORMAL + 3]
    assert n[:, 2].min() > 1.0 - 1e-5
    if tilt * 0.1 < depth:
        # as far out as the rims go in eight directions, up to where corners are cut
        for angle in np.arange(8) * np.pi / 4.0:
            way = np.array([np.cos(angle), np.sin(angle), 0.0])
            assert (place(found) @ way).max() > 0.095


@pytest.mark.parametrize("turned", [False, True])
def test_corners_of_a_mesh_on_a_plane_are_those_of_its_hull(turned):
    rng = np.random.default_rng(3)
    solid = trimesh.creation.annulus(0.05, 0.1, 0.1, sections=12)
    mesh, pair = as_mesh(solid), RIGID_PAIRS["SURFACE-PLANE"]
    for _ in range(20):
        R = random_rotation(rng) if turned else UPRIGHT
        at = np.array([0.3, -0.2, 0.2])
        found = rows(pair, (at, R), mesh.size, (np.zeros(3), UPRIGHT), np.zeros(4))
        heights = solid.vertices @ R.T + at
        assert found[:, AT_DEPTH].max() == pytest.approx(-heights[:, 2].min(), abs=1e-12)
        lowest = heights[heights[:, 2] < heights[:, 2].min() + 1e-9]
        hull = lowest if len(lowest) < 3 else lowest[np.hypot(*(lowest - at)[:, :2].T) > 0.09]
        for corner in hull:
            away = np.linalg.norm(place(found)[:, :2] - corner[:2], axis=1)
            assert away.min() < 1e-9
