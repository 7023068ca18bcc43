"""Patches of meshes that need not be convex: against exact overlaps, distances, and each other."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from helpers.pairs import entry, frame, random_rotation, turned
from helpers.surfaces import (
    PLANE,
    Meshed,
    box,
    call,
    incidents,
    overlap_volume,
    sphere,
    torus,
    wrench,
)
from mbsim.geometry.catalog import PAIRS, POINT, REGION_ROWS
from mbsim.geometry.mesh.merging import (
    GAIN,
    MOST_PEAKS,
    NORMAL,
    PEAK_NUMBERS,
    PLACE,
    SURFACE,
    strongest,
)

SAME = np.eye(3)


def below(vertices, faces):
    """Return the convex part of a convex mesh below z = 0, as points, and those in the plane."""
    a = vertices[faces]
    cut = []
    for k in range(3):
        p, q = a[:, k], a[:, (k + 1) % 3]
        through = (p[:, 2] < 0.0) != (q[:, 2] < 0.0)
        p, q = p[through], q[through]
        cut.append(p + (p[:, 2] / (p[:, 2] - q[:, 2]))[:, None] * (q - p))
    cut = np.vstack(cut)
    return np.vstack([vertices[vertices[:, 2] < 0.0], cut]), cut


@pytest.mark.parametrize("part", [0.05, 0.01])
def test_volume_and_area_on_a_plane_are_those_of_the_clipped_polyhedron(part):
    """An icosphere of 5120 triangles in 200 orientations, 1 km away."""
    vertices, faces = sphere(0.1, 4)
    mesh, rng = Meshed(vertices, faces, layered=False), np.random.default_rng(3)
    up, size = PLANE
    for _ in range(200):
        R = random_rotation(rng)
        p = np.array([1000.0, -300.0, 0.1 * (1.0 - part)])
        points = call("SURFACE-PLANE", frame(p, R), mesh.size, up, size)
        solid, cut = below(vertices @ R.T + [0.0, 0.0, p[2]], faces)
        volume, area = overlap_volume(points)
        assert volume == pytest.approx(ConvexHull(solid).volume, rel=1e-10)
        assert area == pytest.approx(ConvexHull(cut[:, :2]).volume, rel=1e-10)
        first, _ = incidents(points)
        lowest = -solid[:, 2].min()
        assert len(first) == 1
        assert first[0, 0] == pytest.approx(lowest, rel=1e-12)
        assert first[0, 3] == pytest.approx(-0.5 * lowest, rel=1e-12)


def test_a_mesh_above_a_plane_tells_its_distance():
    vertices, faces = torus(0.1, 0.03, 40, 20)
    mesh, rng = Meshed(vertices, faces, layered=False), np.random.default_rng(5)
    for _ in range(50):
        R = random_rotation(rng)
        points = call("SURFACE-PLANE", frame([0.0, 0.0, 0.2], R), mesh.size, *PLANE)
        assert points[:, 0] == pytest.approx(-(vertices @ R.T)[:, 2].min() * 1.0 - 0.2, rel=1e-12)


def test_four_legs_are_four_incidents_and_one_face_is_one():
    parts = [box(1.0, 1.0, 0.1), *(box(0.1, 0.1, 0.2) for _ in range(4))]
    legs = [(0.4, 0.4), (0.4, -0.4), (-0.4, 0.4), (-0.4, -0.4)]
    vertices = np.vstack(
        [parts[0][0], *(p[0] + [x, y, -0.3] for p, (x, y) in zip(parts[1:], legs, strict=True))]
    )
    faces = np.vstack([p[1] + 8 * k for k, p in enumerate(parts)])
    table = Meshed(vertices, faces, layered=False)
    points = call("SURFACE-PLANE", frame([0.0, 0.0, 0.399], SAME), table.size, *PLANE)
    first, _ = incidents(points)
    assert len(first) == 4
    assert first[:, 7] == pytest.approx(1.0, rel=1e-9)
    assert wrench(points, REGION_ROWS)[3:] == pytest.approx(0.0, abs=1e-12)
    points = call("SURFACE-PLANE", frame([0.0, 0.0, 0.599], SAME), table.size, *PLANE)
    assert points[:, 0].max() < 0.0


def fine_box(edges, cuts):
    """Return a box whose sides are grids of triangles."""
    axis = np.linspace(-0.5, 0.5, cuts + 1)
    u, v = np.meshgrid(axis, axis, indexing="ij")
    k = np.arange((cuts + 1) ** 2).reshape(cuts + 1, cuts + 1)
    quads = np.stack([k[:-1, :-1], k[1:, :-1], k[1:, 1:], k[:-1, 1:]], axis=2).reshape(-1, 4)
    vertices, faces = [], []
    for normal in range(3):
        for side in (-0.5, 0.5):
            p = np.empty((u.size, 3))
            p[:, normal], p[:, (normal + 1) % 3], p[:, (normal + 2) % 3] = (
                side,
                u.ravel(),
                v.ravel(),
            )
            turn = quads if side > 0 else quads[:, ::-1]
            faces += [
                turn[:, [0, 1, 2]] + len(vertices) * u.size,
                turn[:, [0, 2, 3]] + len(vertices) * u.size,
            ]
            vertices.append(p)
    unique, index = np.unique(np.round(np.vstack(vertices), 12), axis=0, return_inverse=True)
    return unique * edges, index.reshape(-1)[np.vstack(faces)]


@pytest.mark.parametrize("tilt", [0.0, 1e-3, 0.05])
def test_how_fine_a_flat_side_is_cut_does_not_matter(tilt):
    edges = np.array([0.4, 0.3, 0.2])
    R = turned((1.0, 0.3, 0.0), tilt)
    found = []
    for cuts in (1, 16):
        mesh = Meshed(*fine_box(edges, cuts), layered=False)
        p = np.array([0.0, 0.0, -((mesh.vertices @ R.T)[:, 2].min()) - 1e-3])
        found.append(wrench(call("SURFACE-PLANE", frame(p, R), mesh.size, *PLANE), REGION_ROWS))
    assert found[0] == pytest.approx(found[1], rel=1e-9, abs=1e-12)


def poses(mesh_i, mesh_j, depth, seed, count):
    """Yield frames of J at the origin and I, which overlaps by about `depth` along z."""
    rng = np.random.default_rng(seed)
    for _ in range(count):
        R, Q = random_rotation(rng), random_rotation(rng)
        low, high = mesh_i.vertices @ R.T, mesh_j.vertices @ Q.T
        low, high = low[low[:, 2].argmin()], high[high[:, 2].argmax()]
        p = high - low - [*rng.uniform(-2e-3, 2e-3, 2), depth]
        yield frame(p, R), frame(np.zeros(3), Q)


@pytest.fixture(scope="module")
def tori():
    return Meshed(*torus(0.1, 0.03, 32, 16)), Meshed(*torus(0.12, 0.04, 28, 14))


def test_changing_i_and_j_over_turns_the_wrench(tori):
    a, b = tori
    touched = 0
    for frame_a, frame_b in poses(a, b, 4e-3, 1, 40):
        there = wrench(call("SURFACE-SURFACE", frame_a, a.size, frame_b, b.size), REGION_ROWS)
        back = wrench(call("SURFACE-SURFACE", frame_b, b.size, frame_a, a.size), REGION_ROWS)
        touched += bool(there.any())
        assert there == pytest.approx(-back, rel=1e-8, abs=1e-12)
    assert touched > 10


def test_turning_moving_and_renumbering_the_scene_changes_nothing(tori):
    a, b = tori
    rng = np.random.default_rng(2)
    order = rng.permutation(len(a.faces))
    other = Meshed(a.vertices, np.roll(a.faces[order], 1, axis=1))
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    for frame_a, frame_b in poses(a, b, 4e-3, 3, 20):
        plain = wrench(call("SURFACE-SURFACE", frame_a, a.size, frame_b, b.size), REGION_ROWS)
        same = wrench(call("SURFACE-SURFACE", frame_a, other.size, frame_b, b.size), REGION_ROWS)
        assert same == pytest.approx(plain, rel=1e-10, abs=1e-13)
        moved = [frame(turn @ f[:3], turn @ f[3:].reshape(3, 3)) for f in (frame_a, frame_b)]
        found = call("SURFACE-SURFACE", moved[0], a.size, moved[1], b.size)
        after = wrench(found, REGION_ROWS)
        assert np.concatenate([turn.T @ after[:3], turn.T @ after[3:]]) == pytest.approx(
            plain, rel=1e-10, abs=1e-13
        )
        away = np.array([1000.0, 0.0, 0.0])
        far = [frame(f[:3] + away, f[3:].reshape(3, 3)) for f in (frame_a, frame_b)]
        found = call("SURFACE-SURFACE", far[0], a.size, far[1], b.size)
        after = wrench(found, REGION_ROWS, about=away)
        # the pose itself is rounded to 1e-13 m
        assert after == pytest.approx(plain, rel=1e-7, abs=1e-11)


def deepest_below(vertices, corners):
    """Return how deep the deepest of points inside a mesh is, by distance to its triangles."""
    from mbsim.geometry.mesh_contact import nearest_on_triangles

    deepest = 0.0
    for p in vertices:
        ways = corners - p
        a, b, c = (ways[:, k] for k in range(3))
        la, lb, lc = (np.linalg.norm(w, axis=1) for w in (a, b, c))
        over = (a * np.cross(b, c)).sum(axis=1)
        under = la * lb * lc + (a * b).sum(1) * lc + (b * c).sum(1) * la + (c * a).sum(1) * lb
        if np.arctan2(over, under).sum() > np.pi:
            q = nearest_on_triangles(p, corners)
            deepest = max(deepest, np.linalg.norm(q - p, axis=1).min())
    return deepest


def test_depth_and_direction_of_tori_against_distances(tori):
    a, b = tori
    compared = 0
    for frame_a, frame_b in poses(a, b, 4e-3, 7, 25):
        first, _ = incidents(call("SURFACE-SURFACE", frame_a, a.size, frame_b, b.size))
        if not len(first):
            continue
        R, Q = frame_a[3:].reshape(3, 3), frame_b[3:].reshape(3, 3)
        in_a = a.corners @ R.T + frame_a[:3]
        in_b = b.corners @ Q.T
        deepest = max(
            deepest_below(a.vertices @ R.T + frame_a[:3], in_b),
            deepest_below(b.vertices @ Q.T, in_a),
        )
        # vertices alone do not see where edges cross
        assert first[:, 0].max() >= 0.95 * deepest
        assert first[:, 0].max() <= 4.5e-3
        assert np.linalg.norm(first[:, 4:7], axis=1) == pytest.approx(1.0, rel=1e-12)
        assert first[0, 6] > 0.5
        compared += 1
    assert compared > 10


def test_a_box_on_a_slab_is_a_box_on_a_plane():
    """Flush sides, and a slab of which one corner is far from the box."""
    small, slab = Meshed(*box(0.2, 0.2, 0.2)), Meshed(*box(1.0, 1.0, 0.2))
    for tilt in (0.0, 0.01):
        R = turned((1.0, 0.0, 0.0), tilt)
        low = (small.vertices @ R.T)[:, 2].min()
        pose = frame([0.05, 0.1, -low - 1e-3], R)
        below_it = frame([0.0, 0.0, -0.1], SAME)
        first, numbers = incidents(call("SURFACE-SURFACE", pose, small.size, below_it, slab.size))
        plane, area = incidents(call("SURFACE-PLANE", pose, small.size, *PLANE))
        assert len(first) == len(plane) == 1
        # of two flat sides along the mean of their normals: 1/cos(tilt/2) times as deep
        assert first[0, 0] == pytest.approx(plane[0, 0] / np.cos(0.5 * tilt), rel=1e-9)
        assert first[0, 4:7] == pytest.approx(plane[0, 4:7], abs=2e-2)
        assert first[0, 1:3] == pytest.approx(plane[0, 1:3], abs=2e-3)
        assert numbers[0, 1] == pytest.approx(area[0, 1], rel=2e-2)


def test_an_overlap_deeper_than_the_layer_is_told():
    small, slab = Meshed(*box(0.2, 0.2, 0.2)), Meshed(*box(1.0, 1.0, 0.2))
    told = []
    for depth in (0.01, 0.12):
        points = np.zeros((PAIRS["SURFACE-SURFACE"].slots, POINT))
        pose = frame([0.05, 0.1, 0.1 - depth], SAME)
        arrays = (pose, small.size, frame([0.0, 0.0, -0.1], SAME), slab.size, points)
        told.append(entry("SURFACE-SURFACE")(*(a.ctypes.data for a in arrays)) < 0)
        assert points[:, 0].max() > 0.0
    assert told == [False, True]


def test_a_sphere_finds_the_nearest_point_of_a_mesh(tori):
    from mbsim.geometry.mesh_contact import nearest_on_triangles

    mesh, rng = tori[0], np.random.default_rng(9)
    for _ in range(200):
        u, v = rng.uniform(0.0, 2.0 * np.pi, 2)
        r = rng.uniform(0.035, 0.06)
        wide = 0.1 + r * np.cos(v)
        c = np.array([wide * np.cos(u), wide * np.sin(u), r * np.sin(v)])
        points = call(
            "SPHERE-SURFACE", frame(c, SAME), [0.02, 0, 0, 0], frame(np.zeros(3), SAME), mesh.size
        )
        near = nearest_on_triangles(c, mesh.corners)
        away = np.linalg.norm(near - c, axis=1).min()
        deepest = points[points[:, 0].argmax()]
        assert deepest[0] == pytest.approx(0.02 - away, rel=1e-10, abs=1e-14)
        if deepest[0] < 0.0:
            continue
        assert deepest[7] == 1.0


def test_a_sphere_in_a_groove_rests_on_both_of_its_sides():
    """A notch at right angles along y; its bottom is out of reach."""
    profile = np.array([[-1.0, 0.0], [0.0, -1.0], [1.0, 0.0], [1.0, -2.0], [-1.0, -2.0]])
    ring = [np.column_stack([profile[:, 0], np.full(5, y), profile[:, 1]]) for y in (-1.0, 1.0)]
    k = np.arange(5)
    m = (k + 1) % 5
    sides = np.vstack([np.column_stack([k, m, m + 5]), np.column_stack([k, m + 5, k + 5])])
    end = np.array([[0, 4, 1], [1, 4, 3], [1, 3, 2]])
    faces = np.vstack([sides, end, end[:, ::-1] + 5])
    mesh = Meshed(np.vstack(ring), orient(np.vstack(ring), faces), layered=False)
    for x in (0.0, 1e-4):
        c = [x, 0.0, -1.0 + 0.3 * np.sqrt(2.0) - 1e-3]
        points = call(
            "SPHERE-SURFACE", frame(c, SAME), [0.3, 0, 0, 0], frame(np.zeros(3), SAME), mesh.size
        )
        down = points[points[:, 0] > 0.0]
        assert len(down) == 2
        assert down[:, 7] == pytest.approx(1.0)
        assert sorted(down[:, 4]) == pytest.approx([-np.sqrt(0.5), np.sqrt(0.5)], abs=1e-9)


def orient(vertices, faces):
    """Return the faces such that the solid's volume is positive."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    volume = (a * np.cross(b, c)).sum()
    return faces if volume > 0.0 else faces[:, ::-1]


@pytest.mark.parametrize("kind", ["plane", "sphere"])
def test_nothing_jumps_along_a_way(kind, tori):
    """A torus sinks into a plane, a sphere passes over a torus: steps of the force are small."""
    mesh, last, largest = tori[0], None, 0.0
    R = turned((1.0, 0.4, 0.2), 0.03)
    for k in range(600):
        if kind == "plane":
            points = call("SURFACE-PLANE", frame([0, 0, 0.033 - 8e-6 * k], R), mesh.size, *PLANE)
            force = wrench(points, REGION_ROWS)
        else:
            c = [0.1 * np.cos(1e-3 * k) - 0.1, 0.08 - 2e-4 * k, 0.045]
            points = call(
                "SPHERE-SURFACE",
                frame(c, SAME),
                [0.03, 0, 0, 0],
                frame(np.zeros(3), SAME),
                mesh.size,
            )
            force = wrench(points)
        if last is not None:
            largest = max(largest, float(np.abs(force[:3] - last[:3]).max()))
        last = force
    assert largest < (4e-5 if kind == "plane" else 1e-3)


def test_a_sphere_among_more_points_than_slots_is_pressed_by_all():
    # 20 posts around the ball's lower half, each with its own overlap
    rng = np.random.default_rng(11)
    angles = 2 * np.pi * np.arange(20) / 20
    ways = np.column_stack([np.cos(angles), np.sin(angles), np.full(20, -0.6)]) / np.hypot(1, 0.6)
    depths = rng.uniform(1e-4, 1e-3, 20)
    vertices, faces = box(0.01, 0.01, 0.01)
    parts = []
    for n, depth in zip(ways, depths, strict=True):
        x = np.cross(n, [0.0, 0.0, 1.0])
        x /= np.linalg.norm(x)
        axes = np.column_stack([x, np.cross(n, x), n])
        parts.append(vertices @ axes.T + (0.1 + 0.005 - depth) * n)
    posts = Meshed(np.vstack(parts), np.vstack([faces + 8 * k for k in range(20)]), layered=False)
    size = np.array([0.1, 0.0, 0.0, 0.0])
    at = (frame(np.zeros(3), SAME), size, frame(np.zeros(3), SAME), posts.size)
    points = call("SPHERE-SURFACE", *at)
    assert (points[:, 0] > 0.0).sum() == len(points) == 8
    found = wrench(points)
    assert found[:3] == pytest.approx(-(depths[:, None] * ways).sum(axis=0), abs=1e-12)
    # all go through the centre, but for the middle of depths that differ
    assert abs(found[3:]).max() < 1e-3 * 0.1 * depths.sum()


def test_a_sphere_knows_a_wall_that_it_goes_through():
    vertices, faces = box(0.5, 0.5, 0.01)
    wall, upright = Meshed(vertices, faces, layered=False), frame(np.zeros(3), SAME)
    points = np.zeros((PAIRS["SPHERE-SURFACE"].slots, POINT))
    for radius in (0.002, 0.1):
        size = np.array([radius, 0.0, 0.0, 0.0])
        for depth in (0.1 * radius, 0.9 * min(radius, 0.01), radius + 0.003, radius + 0.0045):
            at = frame(np.array([0.013, 0.02, 0.005 + radius - depth]), SAME)
            arrays = (at, size, upright, wall.size, points)
            count = entry("SPHERE-SURFACE")(*(a.ctypes.data for a in arrays))
            assert (count < 0) == (depth > min(0.01, radius + 0.0036))


@pytest.mark.parametrize("pair", ["SURFACE-SURFACE", "FIELD-FIELD"])
@pytest.mark.parametrize("first", ["small", "large"])
@pytest.mark.parametrize("touches", [False, True])
def test_a_shell_inside_of_another_mesh_is_told_beside_one_that_is_not(pair, first, touches):
    """Two small boxes of one mesh: one in the core of a block, one beside it or in its surface."""
    (vertices, faces), block = box(0.02, 0.02, 0.02), Meshed(*box(0.4, 0.4, 0.4))
    other = [0.0, 0.0, 0.209 if touches else 0.3]
    told = []
    for inside in ([0.5, 0.0, 0.0], [0.0, 0.0, 0.0]):
        two = Meshed(
            np.vstack([vertices + other, vertices + inside]), np.vstack([faces, faces + 8])
        )
        still, points = frame(np.zeros(3), SAME), np.zeros((PAIRS[pair].slots, POINT))
        i, j = (two, block) if first == "small" else (block, two)
        arrays = (still, i.size, still, j.size, points)
        told.append(entry(pair)(*(a.ctypes.data for a in arrays)) < 0)
        assert (points[:, 0].max() > 0.0) == touches
    assert told == [False, True]


def test_nothing_jumps_where_peaks_are_more_than_slots():
    """Nine and more peaks of random depths and directions, which go up and down one by one."""
    rng = np.random.default_rng(6)
    speed, phase = rng.uniform(0.5, 2.0, 12), rng.uniform(0.0, 6.0, 12)
    place = rng.normal(size=(12, 3))
    away = rng.normal(size=(12, 3)) + np.array([0.0, 0.0, 2.0])
    last, ranks, largest = None, set(), 0.0
    for t in np.linspace(0.0, 3.0, 3001):
        peaks = np.zeros((12, PEAK_NUMBERS))
        peaks[:, 0] = np.maximum(0.0, 1.0 + np.sin(speed * t + phase) - 0.2)
        peaks[:, 1], peaks[:, GAIN] = peaks[:, 0] > 0.0, 1.0
        peaks[:, PLACE : PLACE + 3], peaks[:, NORMAL : NORMAL + 3], peaks[:, SURFACE] = (
            place,
            away,
            1,
        )
        ranks.add(tuple(np.argsort(-peaks[:, 0])[:9]))
        unit = away / np.linalg.norm(away, axis=1)[:, None]
        whole, area = (peaks[:, :1] * unit).sum(axis=0), peaks[:, 1].sum()
        many = strongest(peaks, 12, MOST_PEAKS)
        assert many <= MOST_PEAKS
        row = peaks[:many]
        n = (
            row[:, NORMAL : NORMAL + 3]
            / np.linalg.norm(row[:, NORMAL : NORMAL + 3], axis=1)[:, None]
        )
        force = (row[:, 0] * row[:, 1])[:, None] * n
        assert force.sum(axis=0) == pytest.approx(whole, rel=1e-12)
        assert row[:, SURFACE].sum() == pytest.approx(area, rel=1e-12)
        # of a law with an exponent, at the places where it acts
        harder = (row[:, 0] ** 1.5 * row[:, 1])[:, None] * n
        moments = np.cross(row[:, PLACE : PLACE + 3], harder).sum(axis=0)
        now = np.concatenate([harder.sum(axis=0), moments])
        if last is not None:
            largest = max(largest, abs(now - last).max())
        last = now
    assert len(ranks) > 20
    assert largest < 0.05
