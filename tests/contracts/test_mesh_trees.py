"""Trees of boxes over meshes and their layers: nothing that touches is passed over."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from helpers.mesh_parts import bolt, gear
from helpers.pairs import random_rotation
from helpers.surfaces import Meshed, angle, box, call, incidents, torus
from mbsim.geometry.mesh.candidates import list_of, moved_at_most
from mbsim.geometry.mesh.distance import least_gap, triangle_distance
from mbsim.geometry.mesh.oriented import I_IN_J, J_IN_I, box_distance, ways_between
from mbsim.geometry.mesh.overlap import EDGES, PRISM, measure_pair_of, nodes_of, place_triangle
from mbsim.geometry.mesh.polygon import CORNER as POLYGON_CORNER
from mbsim.geometry.mesh.polygon import CORNERS
from mbsim.geometry.mesh.prism import apart, piece_in_prism
from mbsim.geometry.mesh.record import PATCH_NUMBERS, PEAK, SUMS
from mbsim.geometry.mesh.tree import leaf_range
from mbsim.geometry.pairs.surface import pose_of
from mbsim.model.flat_parts import fewer_triangles
from mbsim.model.mesh import merge_vertices
from mbsim.model.surface import (
    AT_BOXES,
    AT_KEPT,
    AT_ORIENTED,
    AT_TRIANGLES,
    INNER,
    KEPT,
    LEAF,
    LEVELS,
    LISTS,
    NODE,
    POSE,
    TRIANGLE,
)
from mbsim.model.surface_tree import DEEP, FIRST, LAST, ORIENTED, ROWS, THIN

TETRAHEDRON = (
    np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]),
    np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]),
)
MESHES = {
    "tetrahedron": TETRAHEDRON,
    "box": box(0.3, 0.2, 0.1),
    "angle": angle(),
    "torus": torus(0.1, 0.03, 16, 8),
    "gear": merge_vertices(*gear(20, 2.0, 10.0, 6)),
    "bolt": merge_vertices(*bolt(5.0, 20.0, 8.0, 6.0)),
}


def random_pose(rng, size):
    return np.concatenate([size * rng.normal(size=3), random_rotation(rng).ravel()])


@pytest.mark.parametrize("layered", [True, False])
@pytest.mark.parametrize("name", list(MESHES))
def test_boxes_hold_what_their_nodes_do(name, layered):
    mesh = Meshed(*MESHES[name], layered=layered)
    data, count = mesh.data, len(mesh.faces)
    levels, slack = int(data[LEVELS]), 1e-12 * np.ptp(mesh.vertices)
    table = data[int(data[AT_TRIANGLES]) :][: count * TRIANGLE].reshape(count, TRIANGLE)
    outer, inner = table[:, :INNER].reshape(-1, 3, 3), table[:, INNER:18].reshape(-1, 3, 3)
    found = []
    for k in range(2**levels):
        first, last = leaf_range(data, 2**levels + k)
        assert 0 <= last - first <= LEAF
        found += range(first, last)
        node = 2**levels + k
        while node > 0 and first < last:
            row = data[int(data[AT_BOXES]) + NODE * node :][:NODE]
            for at, points in ((0, outer), (6, inner), (6, outer)):
                away = np.abs(points[first:last] - row[at : at + 3]) - row[at + 3 : at + 6]
                assert away.max() < slack
            if layered:
                row = data[int(data[AT_ORIENTED]) + ORIENTED * node :][:ORIENTED]
                axes = row[ROWS:THIN].reshape(3, 3)
                assert axes @ axes.T == pytest.approx(np.eye(3), abs=1e-12)
                assert row[FIRST] <= first
                assert row[LAST] >= last
                for at, points in ((THIN, outer), (DEEP, inner), (DEEP, outer)):
                    off = (points[first:last] - row[at : at + 3]) @ axes.T
                    assert (np.abs(off) - row[at + 3 : at + 6]).max() < slack
            node //= 2
    assert found == list(range(count))


def random_node(rng):
    thin = [*rng.normal(size=3), *rng.uniform(0.0, 1.0, size=3)]
    return np.array([*random_rotation(rng).ravel(), *thin, *thin, 0.0, 0.0])


def test_boxes_with_a_common_point_have_room():
    rng = np.random.default_rng(1)
    shared = 0
    for _ in range(300):
        a, b, pose = random_node(rng), random_node(rng), random_pose(rng, 0.5)
        room = ways_between(a, 0, b, 0, I_IN_J | J_IN_I, pose, 0.0)
        assert room in (0, I_IN_J | J_IN_I)
        distance = box_distance(a, 0, b, 0, pose)
        assert (distance == 0.0) == (room > 0)
        own = (2.0 * rng.random((400, 3)) - 1.0) * a[THIN + 3 : DEEP]
        points = a[THIN : THIN + 3] + own @ a[:9].reshape(3, 3)
        placed = pose[:3] + points @ pose[3:].reshape(3, 3).T
        off = np.abs((placed - b[THIN : THIN + 3]) @ b[:9].reshape(3, 3).T) - b[THIN + 3 : DEEP]
        if (off.max(axis=1) < 0.0).any():
            shared += 1
            assert room
        # no point of a is nearer to b than the bound
        assert np.linalg.norm(np.maximum(off, 0.0), axis=1).min() >= distance - 1e-12
    assert shared > 20


def test_each_way_asks_for_the_boxes_of_its_own():
    """Nodes that stand beside each other with thin boxes apart and one deep box over the other."""
    upright, pose = np.eye(3).ravel(), np.concatenate([[1.0, 0.0, 0.0], np.eye(3).ravel()])
    thin, deep = [0.0, 0.0, 0.0, 0.4, 1.0, 1.0], [0.0, 0.0, 0.0, 0.7, 1.0, 1.0]
    plain = np.array([*upright, *thin, *thin, 0.0, 0.0])
    layered = np.array([*upright, *thin, *deep, 0.0, 0.0])
    assert ways_between(plain, 0, plain, 0, I_IN_J | J_IN_I, pose, 0.0) == 0
    assert ways_between(plain, 0, layered, 0, I_IN_J | J_IN_I, pose, 0.0) == I_IN_J
    assert ways_between(layered, 0, plain, 0, I_IN_J | J_IN_I, pose, 0.0) == J_IN_I
    assert ways_between(layered, 0, layered, 0, I_IN_J | J_IN_I, pose, 0.0) == I_IN_J | J_IN_I
    assert ways_between(layered, 0, layered, 0, J_IN_I, pose, 0.0) == J_IN_I


@pytest.mark.parametrize("name", ["box", "angle", "torus"])
def test_the_walk_finds_all_pairs_of_triangles_that_overlap(name):
    mesh, rng = Meshed(*MESHES[name]), np.random.default_rng(4)
    count, size = len(mesh.faces), float(np.ptp(mesh.vertices, axis=0).min())
    work, sums = np.empty((2 * CORNERS, POLYGON_CORNER)), np.empty(SUMS)
    a, b = np.empty(PRISM), np.empty(PRISM)
    node, values, other = np.empty(PATCH_NUMBERS), np.empty(EDGES), np.empty(EDGES)
    found = 0
    # the torus has 256 triangles: some of them will do
    for _ in range(2 if name == "torus" else 10):
        pose, origin = random_pose(rng, 0.4 * size), (0.1 * size, 0.0, 0.0)
        many, nodes, _, pairs = nodes_of(mesh.data, mesh.data, pose, origin, np.empty((1, 1)))
        told = {tuple(pair): k for k, pair in enumerate(pairs[:many].astype(int).tolist())}
        for i in range(0, count, 3 if name == "torus" else 1):
            place_triangle(mesh.data, i, pose, True, origin, a)
            for j in range(count):
                place_triangle(mesh.data, j, pose, False, origin, b)
                if measure_pair_of(a, b, I_IN_J | J_IN_I, node, values, other, work, sums):
                    if node[PEAK] > 1e-13 * size:
                        assert nodes[told[i, j]] == pytest.approx(node, rel=1e-12, abs=1e-18)
                        found += 1
    assert found > 30


def turned_a_little(pose, rng, size):
    """Return a pose moved and turned by about `size` of a length of 1."""
    by = Rotation.from_rotvec(size * rng.normal(size=3)).as_matrix()
    turned = by @ pose[3:].reshape(3, 3)
    return np.concatenate([pose[:3] + size * rng.normal(size=3), turned.ravel()])


def test_what_is_kept_of_a_walk_changes_no_bit():
    """Two pairs in turn: one moves on, and one is another mesh in the same rows now and then."""
    angle_, box_ = (Meshed(*MESHES[name]) for name in ("angle", "box"))
    rng, origin, rows = np.random.default_rng(11), (0.02, 0.0, 0.0), np.zeros((2, 1, 1))
    pose, walked, pieces = np.concatenate([[0.12, 0.0, 0.0], np.eye(3).ravel()]), 0, 0
    for step in range(24):
        # slow, fast, at rest
        size = (1e-4, 1e-2, 0.0)[step // 8 % 3]
        pose = turned_a_little(pose, rng, size * 0.05)
        for row, other in ((rows[0], angle_), (rows[step // 6 % 2], box_)):
            fresh = Meshed.__new__(Meshed)
            fresh.data = angle_.data.copy()
            fresh.data[int(fresh.data[AT_KEPT]) :][: 1 + LISTS * KEPT] = 0.0
            want = nodes_of(fresh.data, other.data, pose, origin, np.zeros((1, 1)))
            at = list_of(angle_.data, float(row.ctypes.data), float(other.data.ctypes.data))
            known = angle_.data[at + POSE : at + POSE + 12].copy()
            got = nodes_of(angle_.data, other.data, pose, origin, row)
            walked += not np.array_equal(known, angle_.data[at + POSE : at + POSE + 12])
            assert got[0] == want[0]
            pieces += got[0]
            for one, two in zip(got[1:], want[1:], strict=True):
                assert np.array_equal(one[: got[0]], two[: got[0]])
    assert pieces > 100
    assert walked < 32  # of 48


def test_nearer_than_the_reach_of_a_list():
    """No point of a mesh moves farther than is told, and some corner of its box nearly so far."""
    mesh, rng = Meshed(*MESHES["angle"]), np.random.default_rng(3)
    for size in (1e-6, 1e-3, 0.3):
        before = random_pose(rng, 1.0)
        after = turned_a_little(before, rng, size)
        ways = [
            np.linalg.norm((after - before)[:3] + (after - before)[3:].reshape(3, 3) @ p)
            for p in mesh.vertices
        ]
        most = moved_at_most(mesh.data, before, after)
        assert max(ways) <= most * (1.0 + 1e-12)
        assert most <= 4.0 * max(ways)


def test_the_bound_of_two_triangles_is_no_more_than_their_distance():
    rng = np.random.default_rng(2)
    weights = rng.dirichlet(np.ones(3), size=60)
    parted = 0
    for _ in range(300):
        p, q = rng.normal(size=(3, 3)), rng.normal(size=(3, 3)) + np.eye(3)[0]
        bound = triangle_distance(tuple(map(tuple, p)), tuple(map(tuple, q)))
        apart_by = np.linalg.norm((weights @ p)[:, None] - (weights @ q)[None], axis=2).min()
        assert 0.0 <= bound <= apart_by
        parted += bound > 0.0
        # a corner of one within the other: they meet
        met = np.vstack([q[:2], weights[0] @ p])
        assert triangle_distance(tuple(map(tuple, p)), tuple(map(tuple, met))) < 1e-12
    assert parted > 50


def test_what_is_told_apart_has_no_piece():
    rng = np.random.default_rng(3)
    work, sums = np.empty((2 * CORNERS, POLYGON_CORNER)), np.empty(SUMS)
    mesh = Meshed(*torus(0.1, 0.03, 16, 8))
    at = int(mesh.data[AT_TRIANGLES])
    told = pieces = 0
    for _ in range(1500):
        t = rng.integers(len(mesh.faces))
        prism = mesh.data[at + TRIANGLE * t :][:24]
        outer, inner = prism[:9].reshape(3, 3), prism[9:18].reshape(3, 3)
        centre = np.vstack([outer, inner]).mean(axis=0)
        tri = centre + 0.03 * rng.normal(size=(1, 3)) + 0.02 * rng.normal(size=(3, 3))
        corners = tuple(map(tuple, tri))
        node, values = np.zeros(PATCH_NUMBERS), np.zeros(6)
        piece_in_prism(prism, corners, 1.0, node, values, work, sums)
        pieces += node[PEAK] > 0.0
        if apart(tuple(map(tuple, outer)), tuple(map(tuple, inner)), corners):
            told += 1
            assert node[PEAK] < 1e-15
    assert told > 200
    assert pieces > 100


@pytest.mark.parametrize("name", ["box", "angle", "gear"])
def test_flush_parts_have_no_incident_and_a_gap_is_found(name):
    """A copy beside the part, its flat side against the part's; then a thousandth away."""
    vertices, faces = fewer_triangles(*MESHES[name])
    mesh = Meshed(vertices, faces)
    size = float(np.ptp(vertices[:, 2]))
    upright = np.eye(3).ravel()
    still = np.concatenate([np.zeros(3), upright])
    for gap in (0.0, 1e-3 * size):
        beside = np.concatenate([[0.0, 0.0, size + gap], upright])
        points = call("SURFACE-SURFACE", beside, mesh.size, still, mesh.size)
        assert len(incidents(points)[0]) == 0
        assert -points[0, 0] == pytest.approx(gap, rel=1e-9)
        assert least_gap(mesh.data, mesh.data, pose_of(beside, still), 1.0) == pytest.approx(gap)
