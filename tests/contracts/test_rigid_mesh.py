"""Cylinders and frusta on convex meshes as rigid contact has them, against the pairs with a box."""

from __future__ import annotations

import ctypes

import numpy as np
import pytest
import trimesh

from helpers.pairs import SIZES, entry, frame, random_rotation, turned
from mbsim.compile_model.contacts import pair_address
from mbsim.geometry.catalog import AT_DEPTH, AT_NORMAL, AT_POINT, AT_WEIGHT, POINT, RIGID_PAIRS
from mbsim.geometry.pairs.revolution_box import BOX_ROWS
from mbsim.geometry.pairs.rigid_mesh import RIGID_ROWS
from mbsim.model.hull import polyhedron_of

HALF = np.array([0.3, 0.25, 0.2])
LIES = (np.eye(3), turned([1, 0, 0], 0.5 * np.pi), turned([0, 1, 0], 0.5 * np.pi))


def rigid(shape):
    """Return the compiled pair of a shape and a mesh as a function of ctypes."""
    address = pair_address(RIGID_PAIRS[f"{shape}-MESH"])
    return ctypes.CFUNCTYPE(ctypes.c_int64, *[ctypes.c_void_p] * 5)(address)


class Pairs:
    """A solid on a box, and on the box as a mesh."""

    def __init__(self, shape):
        box = trimesh.creation.box(2.0 * HALF)
        self.packed = polyhedron_of(np.array(box.vertices, float), np.array(box.faces))
        self.mesh = np.array([self.packed.ctypes.data, len(self.packed), 0.0, 0.0])
        self.size = np.append(SIZES[shape], 0.0)
        self.on_mesh, self.on_box = rigid(shape), entry(f"{shape}-BOX")

    def rows(self, call, count, frame_i, size_j, frame_j):
        points = np.full((count, POINT), np.nan)
        arrays = (frame_i, self.size, frame_j, size_j, points)
        assert call(*(a.ctypes.data for a in arrays)) == count
        assert not np.isnan(points).any()
        return points

    def mesh_rows(self, frame_i, frame_j):
        return self.rows(self.on_mesh, RIGID_ROWS, frame_i, self.mesh, frame_j)

    def box_rows(self, frame_i, frame_j):
        return self.rows(self.on_box, BOX_ROWS, frame_i, np.append(HALF, 0.0), frame_j)


def wrench(points):
    """Return force and torque about the origin of linear springs at all points that touch."""
    points = points[points[:, AT_DEPTH] > 0.0]
    push = (points[:, AT_DEPTH] * points[:, AT_WEIGHT])[:, None] * points[:, AT_NORMAL:AT_WEIGHT]
    return np.concatenate([push.sum(0), np.cross(points[:, AT_POINT:AT_NORMAL], push).sum(0)])


def poses(pairs, count, seed):
    """Yield frames that overlap by 1e-6 to 1e-2: in any pose, nearly lying, and lying exactly."""
    rng = np.random.default_rng(seed)
    for k in range(count):
        Q, R = random_rotation(rng), random_rotation(rng)
        way = rng.normal(size=3)
        if k % 3 > 0:
            spun = Q @ turned([0, 0, 1], rng.uniform(0.0, 6.0))
            tilt = 10.0 ** rng.uniform(-9.0, -1.0) if k % 3 == 1 else 0.0
            R = spun @ turned(rng.normal(size=3), tilt) @ LIES[rng.integers(3)]
            way = 0.9 * Q[:, 2] + 0.5 * way
        at, depth = 0.4 * way / np.linalg.norm(way), 10.0 ** rng.uniform(-6.0, -2.0)
        frame_j = frame(np.zeros(3), Q)
        for _ in range(8):
            points = pairs.box_rows(frame(at, R), frame_j)
            deepest = points[points[:, AT_DEPTH].argmax()]
            at = at + (deepest[AT_DEPTH] - depth) * deepest[AT_NORMAL:AT_WEIGHT]
        yield frame(at, R), frame_j


@pytest.mark.parametrize("shape", ["CYLINDER", "FRUSTUM"])
def test_a_box_and_its_mesh_hold_a_solid_alike(shape):
    pairs, off = Pairs(shape), 0
    for frame_i, frame_j in poses(pairs, 1500, 1):
        one = wrench(pairs.mesh_rows(frame_i, frame_j))
        other = wrench(pairs.box_rows(frame_i, frame_j))
        size = max(np.linalg.norm(one[:3]), np.linalg.norm(other[:3]))
        off += np.abs(one - other).max() > 1e-6 * size
    assert off == 0


@pytest.mark.parametrize("shape", ["CYLINDER", "FRUSTUM"])
def test_no_point_is_where_shapes_are_apart(shape):
    """Some direction parts them: what is looked at is told to be apart, by no more than it is."""
    pairs, rng, seen = Pairs(shape), np.random.default_rng(3), 0
    for frame_i, frame_j in poses(pairs, 150, 2):
        away = rng.normal(size=3)
        for gap in (1e-3, 1e-2, 0.1):
            moved = frame_i.copy()
            moved[:3] += gap * away / np.linalg.norm(away)
            told = pairs.mesh_rows(moved, frame_j)[:, AT_DEPTH].max()
            true = pairs.box_rows(moved, frame_j)[:, AT_DEPTH].max()
            if true < 0.0:
                assert told <= 0.0
                seen += 1
    assert seen > 50


@pytest.mark.parametrize("tilt", [0.2, 0.5, 0.25 * np.pi, 1.0])
@pytest.mark.parametrize("beside", [0.0, 0.1])
@pytest.mark.parametrize("shape", ["CYLINDER", "FRUSTUM"])
def test_an_end_lies_on_an_edge_as_on_a_line(shape, beside, tilt):
    """The edge along y is as long as the chord below the end, or shorter: its ends hold."""
    pairs, depth = Pairs(shape), 1e-4
    radius, half = SIZES[shape][0], SIZES[shape][2 if shape == "FRUSTUM" else 1]
    turn = turned([0, 1, 0], tilt)
    top = (turn @ [np.copysign(HALF[0], -tilt), 0.0, HALF[2]])[[0, 2]]
    frame_i = frame(np.array([top[0] + beside, 0.0, top[1] + half - depth]), np.eye(3))
    reach = min(HALF[1], np.sqrt(radius**2 - beside**2))
    for points in (pairs.mesh_rows, pairs.box_rows):
        rows = points(frame_i, frame(np.zeros(3), turn))
        rows = rows[rows[:, AT_DEPTH] > 0.0]
        assert len(rows) == 2
        np.testing.assert_allclose(rows[:, AT_DEPTH], depth, rtol=1e-9)
        np.testing.assert_allclose(np.sort(rows[:, AT_POINT + 1]), [-reach, reach], atol=1e-9)
        np.testing.assert_allclose(rows[:, AT_POINT], top[0], atol=1e-9)
