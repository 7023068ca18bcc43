"""What every closed-form pair has to keep, and that it agrees with FCL where FCL is exact."""

from __future__ import annotations

import numpy as np
import pytest

from helpers.pairs import (
    LYING,
    ROLLER,
    SIZES,
    SLAB,
    UPRIGHT,
    candidates,
    entry,
    frame,
    random_rotation,
    turned,
)
from mbsim.geometry.catalog import PAIRS, POINT
from mbsim.geometry.support import support

POSES = 400
MANY = 100_000


def random_poses(name, seed, count=POSES):
    """Yield frames of I and J, near each other, for a pair by name."""
    rng = np.random.default_rng(seed)
    for _ in range(count):
        p = rng.uniform(-0.5, 0.5, 3)
        yield frame(p, random_rotation(rng)), frame(rng.uniform(-0.1, 0.1, 3), random_rotation(rng))


def heights(shape, size, R, d):
    """Return the support function of a shape about its centre in directions d, shape (n, 3)."""
    local = d @ R
    if shape == "SPHERE":
        return np.full(len(d), size[0])
    if shape == "ELLIPSOID":
        return np.linalg.norm(local * size, axis=1)
    if shape == "BOX":
        return np.abs(local) @ size
    bottom, top, half = size if shape == "FRUSTUM" else (size[0], size[0], size[1])
    radial = np.hypot(local[:, 0], local[:, 1])
    return np.maximum(bottom * radial - half * local[:, 2], top * radial + half * local[:, 2])


def least_overlap(name, frame_i, frame_j, rng):
    """Return the least overlap over directions, sampled on the sphere and then ever nearer."""
    shape_i, shape_j = name.split("-")
    Ri, Rj = frame_i[3:].reshape(3, 3), frame_j[3:].reshape(3, 3)
    apart = frame_i[:3] - frame_j[:3]

    def overlap(d):
        here = heights(shape_i, SIZES[shape_i], Ri, -d) + heights(shape_j, SIZES[shape_j], Rj, d)
        return here - d @ apart

    d = rng.normal(size=(1500, 3))
    d /= np.linalg.norm(d, axis=1)[:, None]
    d = d[np.argsort(overlap(d))[:12]]
    radius = 0.1
    for _ in range(45):
        near = d[:, None, :] + radius * rng.normal(size=(len(d), 12, 3))
        near = np.concatenate([d[:, None, :], near], axis=1)
        near /= np.linalg.norm(near, axis=2)[:, :, None]
        values = overlap(near.reshape(-1, 3)).reshape(len(d), -1)
        d = near[np.arange(len(d)), values.argmin(axis=1)]
        radius *= 0.75
    return values.min()


def wrench(points, about=(0.0, 0.0, 0.0)):
    """Return force and torque on I of springs of stiffness 1, with the shares."""
    down = points[points[:, 0] > 0.0]
    force = (down[:, 7] * down[:, 0])[:, None] * down[:, 4:7]
    return np.concatenate(
        [force.sum(axis=0), np.cross(down[:, 1:4] - np.asarray(about), force).sum(axis=0)]
    )


# pairs of meshes have their own tests: their rows depend on the mesh
OF_MESHES = {"MESH", "SURFACE", "FIELD"}
SOLIDS = [name for name in PAIRS if not OF_MESHES & set(name.split("-"))]


@pytest.fixture(params=SOLIDS)
def name(request):
    return request.param


def well_formed(name, poses):
    """Check the rows at many poses; return how many the pair took."""
    used = 0
    for frame_i, frame_j in poses:
        count, points = candidates(name, frame_i, frame_j)
        used += 1
        assert count == PAIRS[name].slots
        assert np.isfinite(points).all()
        assert np.abs((points[:, 4:7] ** 2).sum(axis=1) - 1.0).max() < 1e-12
        assert points[:, 7].min() > 0.0
        # no more than the corners of a face
        assert points[points[:, 0] > 0.0, 7].sum() < 6.0 + 1e-9 or name.startswith("BOX")
    return used


def test_fills_every_row_with_numbers_and_unit_normals(name):
    assert well_formed(name, random_poses(name, 1)) > 0


@pytest.mark.slow
def test_fills_every_row_at_many_poses(name):
    used = well_formed(name, random_poses(name, 11, MANY // len(list(PAIRS)) + 1))
    assert used > 0


def test_compiled_equals_plain(name):
    for frame_i, frame_j in random_poses(name, 2, POSES // 4):
        count, points = candidates(name, frame_i, frame_j, plain=True)
        other_count, other = candidates(name, frame_i, frame_j)
        assert other_count == count
        # compiled sums may be contracted: the last bit of a normal found by iteration differs
        deepest = points[:, 0].max()
        assert (other[:, 0].max() > 0.0) == (deepest > 0.0)
        if 0.0 < deepest < 0.05:
            assert other[:, 0].max() == pytest.approx(deepest, abs=1e-12)
            np.testing.assert_allclose(wrench(other), wrench(points), rtol=0, atol=1e-8)


def test_does_not_depend_on_where_the_scene_stands(name):
    rng = np.random.default_rng(5)
    Q, shift = random_rotation(rng), np.array([3.0, -2.0, 1.0])
    for frame_i, frame_j in random_poses(name, 3, POSES):
        count, points = candidates(name, frame_i, frame_j)
        moved = [frame(Q @ f[:3] + shift, Q @ f[3:].reshape(3, 3)) for f in (frame_i, frame_j)]
        count_moved, points_moved = candidates(name, *moved)
        assert count == count_moved
        depth, depth_moved = points[:, 0].max(), points_moved[:, 0].max()
        assert (depth > 0.0) == (depth_moved > 0.0)
        # apart, a bound of the distance is asked for; deep, ways out that are as short are as good
        if not 0.0 < depth < 0.05:
            continue
        assert depth_moved == pytest.approx(depth, abs=1e-12)
        # a normal found by iteration is as exact as sqrt(rounding) where f is flat
        here, there = wrench(points, frame_i[:3]), wrench(points_moved, moved[0][:3])
        np.testing.assert_allclose(there[:3], Q @ here[:3], atol=1e-7)
        np.testing.assert_allclose(there[3:], Q @ here[3:], atol=1e-7)


@pytest.mark.parametrize("name", [n for n in SOLIDS if len(set(n.split("-"))) == 1])
def test_is_symmetric_under_exchange(name):
    compared = 0
    for frame_i, frame_j in random_poses(name, 4):
        count, points = candidates(name, frame_i, frame_j)
        other_count, other = candidates(name, frame_j, frame_i)
        assert count == other_count
        deepest, reverse = points[points[:, 0].argmax()], other[other[:, 0].argmax()]
        assert deepest[0] == pytest.approx(reverse[0], abs=1e-12)
        if not 0.0 < deepest[0] < 0.1:
            # deep, several ways out may be as short
            continue
        compared += 1
        # two crossed sides share their force between points along J's line: to second order in
        # the angle at which they cross it matters which is J
        allowed = 1e-8 if len(points) == 1 else deepest[0]
        np.testing.assert_allclose(wrench(points), -wrench(other), atol=allowed)
    assert compared > 20


CONVEX_PAIRS = [n for n in SOLIDS if "PLANE" not in n]


@pytest.mark.parametrize("name", CONVEX_PAIRS)
def test_depth_is_the_least_overlap_and_the_gap_a_lower_bound(name):
    # the sampled minimum is at kinks good to 1e-4 of the size; it is never below the true one
    rng = np.random.default_rng(8)
    compared, missed = 0, 0
    for frame_i, frame_j in random_poses(name, 9, 120):
        _, points = candidates(name, frame_i, frame_j)
        deepest = points[:, 0].max()
        least = least_overlap(name, frame_i, frame_j, rng)
        if least <= 0.0:
            assert -deepest <= -least + 1e-4
            assert deepest <= 0.0
        elif least < 0.1:
            compared += 1
            assert deepest >= least - 1e-3
            # a rim that presses on a rim has side valleys
            missed += deepest > least + 1e-9
    assert compared > 5
    assert missed <= 0.02 * compared + 1


def fcl_shapes(name, frame_i, frame_j):
    """Return FCL's objects of both shapes."""
    fcl = pytest.importorskip("fcl")
    made = []
    for shape, f in zip(name.split("-"), (frame_i, frame_j), strict=True):
        size = SIZES[shape]
        geometry = {
            "SPHERE": lambda s=size: fcl.Sphere(s[0]),
            "ELLIPSOID": lambda s=size: fcl.Ellipsoid(*s),
            "BOX": lambda s=size: fcl.Box(*(2 * s)),
            "CYLINDER": lambda s=size: fcl.Cylinder(s[0], 2 * s[1]),
            "PLANE": lambda: fcl.Halfspace(np.array([0.0, 0.0, 1.0]), 0.0),
        }[shape]()
        made.append(fcl.CollisionObject(geometry, fcl.Transform(f[3:].reshape(3, 3), f[:3])))
    return fcl, made


def fcl_answer(name, frame_i, frame_j):
    """Return FCL's contacts as rows of depth, point, normal from J into I."""
    fcl, made = fcl_shapes(name, frame_i, frame_j)
    request = fcl.CollisionRequest(num_max_contacts=8, enable_contact=True)
    result = fcl.CollisionResult()
    fcl.collide(*made, request, result)
    return [(c.penetration_depth, np.array(c.pos), -np.array(c.normal)) for c in result.contacts]


@pytest.mark.parametrize(
    ("name", "tolerance"),
    [
        # FCL has closed forms of these too: equal to rounding
        ("SPHERE-PLANE", 1e-12),
        ("SPHERE-SPHERE", 1e-12),
        ("SPHERE-CYLINDER", 1e-12),
        ("BOX-PLANE", 1e-12),
        ("CYLINDER-PLANE", 1e-12),
        ("ELLIPSOID-PLANE", 1e-12),
        # FCL stops its search at 1e-7
        ("SPHERE-BOX", 1e-7),
    ],
)
def test_deepest_point_equals_fcl(name, tolerance):
    touching = 0
    for frame_i, frame_j in random_poses(name, 6):
        _, points = candidates(name, frame_i, frame_j)
        found = fcl_answer(name, frame_i, frame_j)
        deepest = points[points[:, 0].argmax()]
        assert (len(found) > 0) == (deepest[0] > 0.0) or abs(deepest[0]) < 1e-6
        # FCL reports a sphere's centre deep in a solid otherwise: only shallow ones compare
        if not found or (name.startswith("SPHERE") and deepest[0] > SIZES["SPHERE"][0]):
            continue
        touching += 1
        depth, _, n = max(found, key=lambda contact: contact[0])
        assert deepest[0] == pytest.approx(depth, abs=tolerance)
        np.testing.assert_allclose(deepest[4:7], n, atol=100 * tolerance)
    assert touching > 20


@pytest.mark.parametrize(
    "name", [n for n in CONVEX_PAIRS if "FRUSTUM" not in n and n != "SPHERE-SPHERE"]
)
def test_agrees_with_fcl_on_touch_depth_and_distance(name):
    # FCL's depth is along where its solver stops, never less than the least: an upper bound.
    # Its distance is exact to 1e-6, ours is a lower bound of it
    pytest.importorskip("fcl")
    touching = 0
    for frame_i, frame_j in random_poses(name, 10):
        _, points = candidates(name, frame_i, frame_j)
        deepest = points[:, 0].max()
        found = fcl_answer(name, frame_i, frame_j)
        if found:
            touching += 1
            assert deepest > -1e-6
            depth = max(contact[0] for contact in found)
            if deepest < 0.05:
                assert deepest <= depth + 1e-6
        else:
            fcl, made = fcl_shapes(name, frame_i, frame_j)
            distance = fcl.distance(*made, fcl.DistanceRequest(), fcl.DistanceResult())
            assert deepest <= 1e-6
            assert -deepest <= distance + 1e-6
    assert touching > 20


DRUM = (frame(np.zeros(3), UPRIGHT), np.array([0.1, 0.1, 0.0]))
LYING_DRUM = (frame(np.zeros(3), LYING), np.array([0.1, 0.1, 0.0]))
PEG = (frame([0.0, 0.0, -0.05], UPRIGHT), np.array([0.04, 0.05, 0.05]))
D = 1e-3  # depth
# a solid 1 mm deep that is moved where features change: what pushes it must not jump
PATHS = {
    "stands over an edge": ("CYLINDER-BOX", SLAB, lambda s: (
        [0.85 + 0.15 * s, 0, 0.1 - D], turned((0.3, 1, 0), 2e-3))),
    "stands over a corner": ("CYLINDER-BOX", SLAB, lambda s: (
        [0.85 + 0.15 * s, 0.88 + 0.1 * s, 0.1 - D], turned((0.3, 1, 0), 2e-3))),
    "tilts over an edge": ("CYLINDER-BOX", SLAB, lambda s: (
        [0.95, 0, 0.1 - D], turned((0.3, 1, 0), 2e-2 * (s - 0.5)))),
    "tilt turns": ("CYLINDER-BOX", SLAB, lambda s: (
        [0.95, 0, 0.1 - D], turned((np.cos(7 * s), np.sin(7 * s), 0), 3e-3))),
    "tiny tilt turns": ("CYLINDER-BOX", SLAB, lambda s: (
        [0.95, 0, 0.1 - D], turned((np.cos(7 * s), np.sin(7 * s), 0), 1e-8))),
    "lies over an edge": ("CYLINDER-BOX", SLAB, lambda s: ([0, 0.85 + 0.2 * s, 0.1 - D], LYING)),
    "rolls over an edge": ("CYLINDER-BOX", SLAB, lambda s: ([0.95 + 0.1 * s, 0, 0.1 - D], LYING)),
    "rolls askew over a corner": ("CYLINDER-BOX", SLAB, lambda s: (
        [0.85 + 0.2 * s, 0.9 + 0.2 * s, 0.1 - D], turned((0, 0, 1), 0.4) @ LYING)),
    "tips over an edge, lying": ("CYLINDER-BOX", SLAB, lambda s: (
        [0, 0.98, 0.1 - D], turned((1, 0, 0), 0.02 * (s - 0.5)) @ LYING)),
    "larger than the box": ("CYLINDER-BOX", PEG, lambda s: (
        [0.1 * s, 0.02 * s, 0.1 - D], turned((0, 1, 0), 1e-3))),
    "end on end": ("CYLINDER-CYLINDER", DRUM, lambda s: (
        [0.02 + 0.12 * s, 0, 0.2 - D], turned((0.3, 1, 0), 2e-3))),
    "side on side turns": ("CYLINDER-CYLINDER", LYING_DRUM, lambda s: (
        [0, 0.03, 0.2 - D], turned((0, 0, 1), 0.6 * (s - 0.5)) @ LYING)),
    "side on side slides": ("CYLINDER-CYLINDER", LYING_DRUM, lambda s: (
        [0, 0.18 * s, 0.2 - D], turned((1, 0, 0), 3e-3) @ LYING)),
}  # fmt: skip


@pytest.mark.parametrize("path", list(PATHS))
def test_forces_do_not_jump_where_features_change(path):
    name, (frame_j, size_j), pose = PATHS[path]
    sizes = {"CYLINDER": ROLLER, "BOX": size_j}
    steps = np.linspace(0.0, 1.0, 3001)
    felt = []
    for s in steps:
        p, R = pose(s)
        _, points = candidates(name, frame(p, R), frame_j, sizes)
        # in units of the depth, torque over the radius
        felt.append(wrench(points, np.asarray(p)) / D / np.array([1, 1, 1, 0.1, 0.1, 0.1]))
    felt = np.array(felt)
    assert np.abs(felt).max() > 1.0
    # a chord grows with the root of the way: sqrt(2 r ds) / r is 0.03 a step
    assert np.abs(np.diff(felt, axis=0)).max() < 0.04


@pytest.mark.parametrize(
    "name", ["BOX-PLANE", "CYLINDER-PLANE", "FRUSTUM-PLANE", "ELLIPSOID-PLANE"]
)
def test_deepest_corner_is_the_support_point(name):
    shape = name.split("-")[0]
    for frame_i, frame_j in random_poses(name, 7):
        _, points = candidates(name, frame_i, frame_j)
        n = frame_j[3:].reshape(3, 3)[:, 2]
        low = support(shape, SIZES[shape], frame_i[:3], frame_i[3:].reshape(3, 3), -n)
        assert points[:, 0].max() == pytest.approx(-n @ (low - frame_j[:3]), abs=1e-13)


def test_upright_cylinder_has_isotropic_stiffness_against_tilting():
    # the torque of three equal springs at 120 degrees does not depend on the tilt's direction
    moments = []
    for angle in np.linspace(0.0, 2 * np.pi, 13):
        axis = np.array([np.cos(angle), np.sin(angle), 0.0])
        K = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
        t = 1e-6
        R = np.eye(3) + np.sin(t) * K + (1 - np.cos(t)) * K @ K
        _, points = candidates(
            "CYLINDER-PLANE", frame([0, 0, 0.4 - 1e-3], R), frame(np.zeros(3), np.eye(3))
        )
        down = points[points[:, 0] > 0]
        moment = sum(np.cross(row[1:4], row[0] * row[4:7]) for row in down)
        moments.append([moment @ axis, np.linalg.norm(moment - (moment @ axis) * axis)])
    moments = np.array(moments)
    np.testing.assert_allclose(moments[:, 0], moments[0, 0], rtol=1e-6)
    assert moments[:, 1].max() < 1e-6 * abs(moments[0, 0])


def test_box_over_the_middle_of_a_face_is_a_box_on_a_plane():
    slab = frame([0.0, 0.0, -0.5], np.eye(3))
    small = np.array([0.1, 0.1, 0.1])
    points = np.zeros((PAIRS["BOX-BOX"].slots, POINT))
    count = PAIRS["BOX-BOX"].points(
        frame([0.3, 0.2, 0.099], np.eye(3)), small, slab, np.array([2.0, 2.0, 0.5]), points
    )
    assert count == len(points)
    down = points[points[:, 0] > 0]
    assert len(down) == 4
    np.testing.assert_allclose(down[:, 0], 1e-3, atol=1e-15)
    np.testing.assert_allclose(down[:, 4:7], [[0, 0, 1]] * 4)
    np.testing.assert_array_equal(down[:, 7], 1.0)
    # the other way round the normal still points from J into I
    count = PAIRS["BOX-BOX"].points(
        slab, np.array([2.0, 2.0, 0.5]), frame([0.3, 0.2, 0.099], np.eye(3)), small, points
    )
    assert count == len(points)
    np.testing.assert_allclose(points[points[:, 0] > 0][:, 4:7], [[0, 0, -1]] * 4)


#: Shapes that stand: size, half height, and how far out their lowest point is when they are tilted
#: towards (0.8, 0.6); and large ones below them, which end at z = 0: size, half height.
STANDING = {
    "CYLINDER": (np.array([0.25, 0.4, 0.0]), 0.4, 0.25),
    "FRUSTUM": (np.array([0.3, 0.15, 0.35]), 0.35, 0.3),
    "BOX": (np.array([0.4, 0.3, 0.2]), 0.2, 0.5),
}
BELOW = {
    "CYLINDER": (np.array([3.0, 0.4, 0.0]), 0.4),
    "FRUSTUM": (np.array([4.0, 3.0, 0.4]), 0.4),
    "BOX": (np.array([3.0, 2.5, 0.4]), 0.4),
}


@pytest.mark.parametrize("tilt", [1e-7, 1e-5, 1e-3, 1e-2])
@pytest.mark.parametrize(
    ("name", "top"),
    [
        *(("CYLINDER-BOX", top) for top in ("CYLINDER", "BOX")),
        *(("FRUSTUM-BOX", top) for top in ("FRUSTUM", "BOX")),
        *(("FRUSTUM-CYLINDER", top) for top in ("FRUSTUM", "CYLINDER")),
        ("CYLINDER-CYLINDER", "CYLINDER"),
        ("FRUSTUM-FRUSTUM", "FRUSTUM"),
    ],
)
def test_what_is_tilted_presses_at_its_lowest_point(name, top, tilt):
    """However little it is tilted, where it is tilted by more than it is deep."""
    shapes = name.split("-")
    below = shapes[1] if shapes[0] == top else shapes[0]
    (size, half, far), (under, high) = STANDING[top], BELOW[below]
    low = turned((-0.6, 0.8, 0.0), tilt) @ [0.8 * far, 0.6 * far, -half]
    depth = 0.1 * far * tilt
    centre = np.array([0.3, 0.2, -depth - low[2]])
    sides = [
        (frame(centre, turned((-0.6, 0.8, 0.0), tilt)), size),
        (frame([0.0, 0.0, -high], UPRIGHT), under),
    ]
    if shapes[0] != top:
        sides.reverse()
    points = np.full((PAIRS[name].slots, POINT), np.nan)
    entry(name)(*(a.ctypes.data for a in (*sides[0], *sides[1], points)))
    force = wrench(points)
    assert abs(force[2]) == pytest.approx(depth, rel=1e-3)
    place = np.array([-force[4], force[3]]) / force[2]
    assert place == pytest.approx(centre[:2] + low[:2], abs=1e-3 * far)
