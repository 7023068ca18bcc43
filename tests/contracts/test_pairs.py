"""What every closed-form pair has to keep, and that it agrees with FCL where FCL is exact."""

from __future__ import annotations

import ctypes

import numpy as np
import pytest

from mbsim.geometry.catalog import NOT_MINE, PAIRS, POINT
from mbsim.geometry.support import support
from mbsim.system.build import pair_address

# radius, half edges, radius and half length; a plane has no size
SIZES = {
    "SPHERE": np.array([0.3, 0.0, 0.0]),
    "BOX": np.array([0.4, 0.3, 0.2]),
    "CYLINDER": np.array([0.25, 0.4, 0.0]),
    "PLANE": np.zeros(3),
}
POSES = 400


def frame(p, R):
    return np.concatenate([p, np.asarray(R).ravel()])


def random_rotation(rng):
    q = rng.normal(size=4)
    w, x, y, z = q / np.linalg.norm(q)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def random_poses(name, seed):
    """Yield frames of I and J, near each other, for a pair by name."""
    rng = np.random.default_rng(seed)
    for _ in range(POSES):
        p = rng.uniform(-0.5, 0.5, 3)
        yield frame(p, random_rotation(rng)), frame(rng.uniform(-0.1, 0.1, 3), random_rotation(rng))


def candidates(name, frame_i, frame_j):
    pair = PAIRS[name]
    shape_i, shape_j = name.split("-")
    points = np.full((pair.slots, POINT), np.nan)
    count = pair.points(frame_i, SIZES[shape_i], frame_j, SIZES[shape_j], points)
    return count, points


# pairs of meshes have their own tests: their rows depend on the mesh
@pytest.fixture(params=[name for name in PAIRS if "MESH" not in name])
def name(request):
    return request.param


def test_fills_every_row_with_numbers_and_unit_normals(name):
    used = 0
    for frame_i, frame_j in random_poses(name, 1):
        count, points = candidates(name, frame_i, frame_j)
        if count == NOT_MINE:
            continue
        used += 1
        assert count == PAIRS[name].slots
        assert np.isfinite(points).all()
        np.testing.assert_allclose(np.linalg.norm(points[:, 4:7], axis=1), 1.0, atol=1e-12)
    # a cylinder at random near a box is seldom over the middle of a face
    assert used > 0 or name == "CYLINDER-BOX"


def test_compiled_equals_plain(name):
    shape_i, shape_j = name.split("-")
    pointer = ctypes.c_void_p
    call = ctypes.CFUNCTYPE(ctypes.c_int64, *[pointer] * 5)(pair_address(PAIRS[name]))
    for frame_i, frame_j in random_poses(name, 2):
        count, points = candidates(name, frame_i, frame_j)
        other = np.full_like(points, np.nan)
        arrays = (frame_i, SIZES[shape_i], frame_j, SIZES[shape_j], other)
        assert call(*[array.ctypes.data for array in arrays]) == count
        if count != NOT_MINE:
            np.testing.assert_allclose(other, points, rtol=0, atol=1e-14)


def test_does_not_depend_on_where_the_scene_stands(name):
    rng = np.random.default_rng(5)
    Q, shift = random_rotation(rng), np.array([3.0, -2.0, 1.0])
    for frame_i, frame_j in list(random_poses(name, 3))[:100]:
        count, points = candidates(name, frame_i, frame_j)
        moved = [frame(Q @ f[:3] + shift, Q @ f[3:].reshape(3, 3)) for f in (frame_i, frame_j)]
        count_moved, points_moved = candidates(name, *moved)
        assert count == count_moved
        if count == NOT_MINE:
            continue
        np.testing.assert_allclose(points_moved[:, 0], points[:, 0], atol=1e-13)
        np.testing.assert_allclose(points_moved[:, 1:4], points[:, 1:4] @ Q.T + shift, atol=1e-12)
        np.testing.assert_allclose(points_moved[:, 4:7], points[:, 4:7] @ Q.T, atol=1e-12)


def test_sphere_pair_is_symmetric_under_exchange():
    for frame_i, frame_j in random_poses("SPHERE-SPHERE", 4):
        _, points = candidates("SPHERE-SPHERE", frame_i, frame_j)
        _, other = candidates("SPHERE-SPHERE", frame_j, frame_i)
        np.testing.assert_allclose(points[0, :4], other[0, :4], atol=1e-14)
        np.testing.assert_allclose(points[0, 4:7], -other[0, 4:7], atol=1e-14)


def fcl_answer(name, frame_i, frame_j):
    """Return FCL's contacts as rows of depth, point, normal from J into I."""
    fcl = pytest.importorskip("fcl")
    made = []
    for shape, f in zip(name.split("-"), (frame_i, frame_j), strict=True):
        size = SIZES[shape]
        geometry = {
            "SPHERE": lambda s=size: fcl.Sphere(s[0]),
            "BOX": lambda s=size: fcl.Box(*(2 * s)),
            "CYLINDER": lambda s=size: fcl.Cylinder(s[0], 2 * s[1]),
            "PLANE": lambda: fcl.Halfspace(np.array([0.0, 0.0, 1.0]), 0.0),
        }[shape]()
        made.append(fcl.CollisionObject(geometry, fcl.Transform(f[3:].reshape(3, 3), f[:3])))
    request = fcl.CollisionRequest(num_max_contacts=8, enable_contact=True)
    result = fcl.CollisionResult()
    fcl.collide(*made, request, result)
    return [(c.penetration_depth, np.array(c.pos), -np.array(c.normal)) for c in result.contacts]


@pytest.mark.parametrize(
    ("name", "tolerance"),
    [
        ("SPHERE-PLANE", 1e-12),
        ("SPHERE-SPHERE", 1e-12),
        ("SPHERE-BOX", 1e-7),
        ("BOX-PLANE", 1e-12),
        ("CYLINDER-PLANE", 1e-12),
    ],
)
def test_deepest_point_equals_fcl(name, tolerance):
    touching = 0
    for frame_i, frame_j in random_poses(name, 6):
        _, points = candidates(name, frame_i, frame_j)
        found = fcl_answer(name, frame_i, frame_j)
        deepest = points[points[:, 0].argmax()]
        assert (len(found) > 0) == (deepest[0] > 0.0) or abs(deepest[0]) < 1e-6
        # FCL reports a sphere deep in a box otherwise: only shallow contacts are comparable
        if not found or (name == "SPHERE-BOX" and deepest[0] > SIZES["SPHERE"][0]):
            continue
        touching += 1
        depth, _, n = max(found, key=lambda contact: contact[0])
        assert deepest[0] == pytest.approx(depth, abs=tolerance)
        np.testing.assert_allclose(deepest[4:7], n, atol=100 * tolerance)
    assert touching > 20


@pytest.mark.parametrize("name", ["BOX-PLANE", "CYLINDER-PLANE"])
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
