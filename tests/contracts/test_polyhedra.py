"""Boxes and convex meshes on each other: one answer for every pose, and no jumps."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

import mbsim
from helpers.decks import GROUND, contact, write_deck
from helpers.pairs import frame, random_rotation
from helpers.polyhedra import CUBE, PLANE, Shape, box, box_mesh, mesh, points_of, rotation
from mbsim.compile_model.pairing import plan_pairs
from mbsim.geometry.catalog import COUPLE
from mbsim.model import hull as packed
from mbsim.model.hull import polyhedron_of

COUNTS = [1000, pytest.param(100_000, marks=pytest.mark.slow)]


TETRAHEDRON = (
    0.1 * np.array([[1.0, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]),
    np.array([[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]]),
)


def poses(count, seed, away=0.4):
    rng = np.random.default_rng(seed)
    for _ in range(count):
        half_i, half_j = rng.uniform(0.1, 0.4, (2, 3))
        yield (
            (half_i, frame(rng.uniform(-away, away, 3), random_rotation(rng))),
            (half_j, frame(rng.uniform(-0.1, 0.1, 3), random_rotation(rng))),
        )


def used(points):
    """Return the rows that are points, in a fixed order."""
    rows = points[points[:, 0] != 0.0]
    return rows[np.lexsort(np.round(rows[:, :4], 9).T)]


def brute_depth(half_i, frame_i, half_j, frame_j):
    """Return the least overlap over the 15 axes of two boxes, straight from its definition."""
    Ri, Rj = frame_i[3:].reshape(3, 3), frame_j[3:].reshape(3, 3)
    axes = [*Ri.T, *Rj.T, *[np.cross(u, e) for u in Ri.T for e in Rj.T]]
    axes = [n / np.linalg.norm(n) for n in axes if np.linalg.norm(n) > 1e-8]
    return min(
        np.abs(Ri.T @ n) @ half_i + np.abs(Rj.T @ n) @ half_j - abs((frame_i[:3] - frame_j[:3]) @ n)
        for n in axes
    )


@pytest.mark.parametrize("count", COUNTS)
def test_boxes_at_random(count):
    touching = 0
    for (half_i, frame_i), (half_j, frame_j) in poses(count, 1):
        i, j = box(half_i), box(half_j)
        points = points_of(i, frame_i, j, frame_j)
        assert np.isfinite(points).all()
        np.testing.assert_allclose(np.linalg.norm(points[:, 4:7], axis=1), 1.0, atol=1e-12)
        least = brute_depth(half_i, frame_i, half_j, frame_j)
        if least <= 0.0:
            # apart: every row bounds the distance from below
            assert (points[:, 0] >= least - 1e-12).all()
            assert (points[:, 0] < 0.0).all()
            continue
        touching += 1
        # the deepest point is exactly as deep as the boxes have to move apart
        assert points[:, 0].max() == pytest.approx(least, rel=2e-6, abs=1e-9)
        assert ((points[:, 7] >= 0.0) & (points[:, 7] <= 2.0)).all()
    assert touching > 0.8 * count


def test_shares_of_nearly_parallel_faces_add_up_to_4():
    # exact up to a tilt of 10 degrees
    rng = np.random.default_rng(2)
    for _ in range(500):
        tilt, turn = rng.uniform(-0.02, 0.02, 3), rng.uniform(-np.pi, np.pi)
        tilt[2] = 0.0
        R = rotation([0, 0, turn]) @ rotation(tilt)
        p = np.array([*rng.uniform(-0.1, 0.1, 2), 0.199])
        points = points_of(box(CUBE), frame(p, R), box(CUBE), frame(np.zeros(3), np.eye(3)))
        assert points[points[:, 0] != 0.0, 7].sum() == pytest.approx(4.0, abs=1e-3)


def test_boxes_are_symmetric_under_exchange():
    for (half_i, frame_i), (half_j, frame_j) in poses(500, 3):
        i, j = box(half_i), box(half_j)
        one, two = points_of(i, frame_i, j, frame_j), points_of(j, frame_j, i, frame_i)
        # normal and couple are those of I
        two[:, 4:7] *= -1.0
        two[:, COUPLE:] *= -1.0
        if one[:, 0].max() < 0.0:
            np.testing.assert_allclose(one[:, 0], two[:, 0], atol=1e-12)
            continue
        np.testing.assert_allclose(used(one), used(two), atol=1e-8)


def test_depth_is_between_fcl_and_what_its_preference_for_faces_allows():
    # FCL's boxes take an axis of two edges only if it is 5 % less deep than the best face's
    fcl = pytest.importorskip("fcl")
    equal = 0
    for (half_i, frame_i), (half_j, frame_j) in poses(1000, 4):
        objects = [
            fcl.CollisionObject(fcl.Box(*(2 * half)), fcl.Transform(f[3:].reshape(3, 3), f[:3]))
            for half, f in ((half_i, frame_i), (half_j, frame_j))
        ]
        result = fcl.CollisionResult()
        request = fcl.CollisionRequest(num_max_contacts=8, enable_contact=True)
        fcl.collide(*objects, request, result)
        deepest = points_of(box(half_i), frame_i, box(half_j), frame_j)[:, 0].max()
        found = max((c.penetration_depth for c in result.contacts), default=0.0)
        assert (found > 0.0) == (deepest > 0.0)
        if found > 0.0:
            assert found / 1.05 - 1e-9 <= deepest <= found * (1.0 + 2e-6)
            equal += abs(deepest - found) < 1e-9
    assert equal > 400


@pytest.mark.parametrize(
    ("p", "w"),
    [
        ([0.0, 0.0, 0.1999], [0, 0, 0]),  # edges on edges
        ([0.2, 0.2, 0.2], [0, 0, 0]),  # corner on corner
        ([0.1999, 0.1999, 0.1999], [0, 0, 0]),
        ([0.05, 0.0, 0.1999], [0, 0, 0]),  # one pair of edges in line
        ([0.0, 0.0, 0.1999], [0, 0, np.pi / 4]),
        ([0.0, 0.0, 0.1 + 0.1 * np.sqrt(2) - 1e-4], [np.pi / 4, 0, 0]),
        ([0.0, 0.0, 0.2 * np.sqrt(2) - 1e-4], [np.pi / 2, 0, 0]),
        ([0.0, 0.0, 0.0], [0, 0, 0]),  # one in the other
        ([0.0, 0.0, 1e-9], [1e-9, 1e-9, 1e-9]),
        ([0.0, 0.0, 0.1999], [1e-9, 0, 0]),
        ([0.0, 0.0, 0.1999], [0, 0, 1e-9]),
    ],
)
@pytest.mark.parametrize("thin", [1.0, 1e-3])
@pytest.mark.parametrize("as_mesh", [False, True])
def test_special_poses(p, w, thin, as_mesh):
    half = CUBE * [1.0, 1.0, thin]
    p = np.array([p[0], p[1], p[2] if thin == 1.0 else p[2] - 0.0999])
    i = mesh(*box_mesh(half)) if as_mesh else box(half)
    fi, fj = frame(p, rotation(w)), frame(np.zeros(3), np.eye(3))
    points = points_of(i, fi, box(CUBE), fj)
    assert np.isfinite(points).all()
    np.testing.assert_allclose(np.linalg.norm(points[:, 4:7], axis=1), 1.0, atol=1e-12)
    least = brute_depth(half, fi, CUBE, fj)
    assert points[:, 0].max() == pytest.approx(least, abs=1e-8)
    assert points[points[:, 0] > 0.0, 7].sum() < 4.5


def wrench(points):
    """Return force and torque about the origin of springs at the points."""
    rows = points[points[:, 0] > 0.0]
    force = (rows[:, 7] * rows[:, 0])[:, None] * rows[:, 4:7]
    return np.concatenate([force.sum(axis=0), 10.0 * np.cross(rows[:, 1:4], force).sum(axis=0)])


def largest_jump(i, j, path, count):
    """Return the largest change of a wrench between neighbours on a path, over the largest."""
    fj = frame(np.zeros(3), np.eye(3))
    all_ = np.array([wrench(points_of(i, path(s), j, fj)) for s in np.linspace(0, 1, count)])
    steps = np.linalg.norm(np.diff(all_, axis=0), axis=1)
    return steps.max() / np.linalg.norm(all_, axis=1).max()


PATHS = {
    # a corner over an edge, an edge over a corner, and all over each other
    "slide": lambda s, tilt: frame(
        [0.25 * s - 0.12, 0.17 * s, 0.199], rotation([0, 0, 0.4]) @ rotation(tilt)
    ),
    "along": lambda s, tilt: frame([0.3 * s - 0.15, 0.0, 0.199], rotation(tilt)),
    "twist": lambda s, tilt: frame([0.03, 0.02, 0.199], rotation([0, 0, 3 * s]) @ rotation(tilt)),
    "rock": lambda s, tilt: frame(
        [0.03, 0.02, 0.199], rotation([2 * tilt[0] * (2 * s - 1), tilt[1], 0.3])
    ),
}


@pytest.mark.parametrize("kinds", ["box", "mesh"])
@pytest.mark.parametrize("name", list(PATHS))
@pytest.mark.parametrize("size", [1e-4, 1e-3])
def test_force_and_torque_have_no_jump(name, size, kinds):
    """A path ten times finer has steps ten times smaller, down to the tilt.

    Where a corner becomes two crossings the normals turn by the faces' tilt, and nothing else
    may jump.
    """
    i = box(CUBE) if kinds == "box" else mesh(*box_mesh(CUBE))
    tilt = size * np.array([0.8, -0.6, 0.0])
    count = 300
    coarse = largest_jump(i, box(CUBE), lambda s: PATHS[name](s, tilt), count)
    fine = largest_jump(i, box(CUBE), lambda s: PATHS[name](s, tilt), 10 * count)
    assert fine < 0.15 * coarse + 2.0 * size


def test_a_corner_keeps_its_row():
    # rolled over an edge by a right angle, the two corners of that edge stay in their rows
    rows = []
    for angle in np.linspace(0.05, np.pi / 2 - 0.05, 60):
        p = [0.0, 0.0, 0.1 + 0.1 * (np.sin(angle) + np.cos(angle)) - 1e-5]
        points = points_of(
            box(CUBE),
            frame(p, rotation([angle, 0, 0])),
            box(10 * CUBE),
            frame([0, 0, -0.9], np.eye(3)),
        )
        rows.append(np.flatnonzero(points[:, 0] > 0.0).tolist())
    assert all(len(row) == 2 for row in rows)
    assert all(a == b for a, b in pairwise(rows))


# convex meshes


@pytest.mark.parametrize("cuts", [1, 4])
def test_a_mesh_of_a_box_is_a_box(cuts):
    for (half_i, frame_i), (half_j, frame_j) in poses(150, 7):
        i = mesh(*box_mesh(half_i, cuts))
        as_boxes = points_of(box(half_i), frame_i, box(half_j), frame_j)
        for j in (box(half_j), mesh(*box_mesh(half_j, cuts))):
            as_mesh = points_of(i, frame_i, j, frame_j)
            if as_boxes[:, 0].max() > 0.0:
                np.testing.assert_allclose(used(as_mesh)[:, :7], used(as_boxes)[:, :7], atol=1e-8)
            else:
                assert as_mesh[:, 0].max() < 0.0
        np.testing.assert_allclose(
            np.sort(points_of(i, frame_i, PLANE, frame_j)[:, 0]),
            np.sort(points_of(box(half_i), frame_i, PLANE, frame_j)[:, 0]),
            atol=1e-12,
        )


@pytest.mark.parametrize("other", ["PLANE", "BOX", "MESH"])
def test_compiled_meshes_equal_plain_ones_wherever_the_scene_stands(other):
    rng = np.random.default_rng(8)
    i = mesh(*TETRAHEDRON)
    j = {"PLANE": PLANE, "BOX": box(CUBE), "MESH": mesh(*box_mesh(CUBE))}[other]
    Q, shift = random_rotation(rng), np.array([3.0, -2.0, 1.0])
    touching = 0
    for _ in range(200):
        frames = [
            frame(rng.uniform(-0.12, 0.12, 3), random_rotation(rng)),
            frame(rng.uniform(-0.05, 0.05, 3), random_rotation(rng)),
        ]
        points = points_of(i, frames[0], j, frames[1])
        assert np.isfinite(points).all()
        np.testing.assert_allclose(np.linalg.norm(points[:, 4:7], axis=1), 1.0, atol=1e-12)
        plain = points_of(i, frames[0], j, frames[1], plain=True)
        np.testing.assert_allclose(points, plain, rtol=0, atol=1e-12)
        moved = [frame(Q @ f[:3] + shift, Q @ f[3:].reshape(3, 3)) for f in frames]
        other_place = points_of(i, moved[0], j, moved[1])
        np.testing.assert_allclose(other_place[:, 0], points[:, 0], atol=1e-9)
        there = points[:, 0] != 0.0
        np.testing.assert_allclose(other_place[there, 4:7], points[there, 4:7] @ Q.T, atol=1e-7)
        touching += points[:, 0].max() > 0.0
    assert touching > 50


def test_what_is_convex():
    vertices, faces = box_mesh(CUBE, 3)
    hull = polyhedron_of(vertices, faces)
    assert hull is not None
    head = hull[[packed.CORNERS, packed.FACES, packed.EDGES, packed.COLOURS]]
    assert head.tolist() == [8, 6, 12, 4]
    np.testing.assert_allclose(hull[int(hull[packed.AT_WEIGHTS]) :][:8], 1.0, atol=1e-12)
    # single precision, turned: flat sides stay one face
    turned = (vertices @ rotation([0.3, 0.2, 0.5]).T).astype(np.float32).astype(float)
    hull = polyhedron_of(turned, faces)
    assert hull is not None
    assert hull[packed.FACES] == 6
    # a dent, an open mesh, a mesh inside out
    dented = vertices.copy()
    inner = np.flatnonzero((np.abs(vertices) < 0.09).sum(axis=1) == 2)[0]
    dented[inner] *= 0.99
    assert polyhedron_of(dented, faces) is None
    assert polyhedron_of(vertices, faces[1:]) is None
    assert polyhedron_of(vertices, faces[:, ::-1]) is None
    hull = polyhedron_of(*TETRAHEDRON)
    assert hull is not None
    np.testing.assert_allclose(hull[int(hull[packed.AT_WEIGHTS]) :][:4], 4 / 3, atol=1e-12)


def test_a_fine_mesh_has_a_row_for_each_patch_and_its_deepest_corner():
    trimesh = pytest.importorskip("trimesh")
    ball = trimesh.creation.icosphere(3)
    i = mesh(np.array(ball.vertices), np.array(ball.faces, dtype=np.int64))
    rng = np.random.default_rng(9)
    for _ in range(50):
        fi = frame(rng.uniform(-0.1, 0.1, 3) + np.array([0, 0, 0.85]), random_rotation(rng))
        points = points_of(i, fi, PLANE, frame(np.zeros(3), np.eye(3)))
        assert len(points) == packed.MOST_ROWS
        low = (ball.vertices @ fi[3:].reshape(3, 3).T + fi[:3])[:, 2].min()
        assert points[:, 0].max() == pytest.approx(-low, abs=1e-13)
        shares = points[points[:, 0] > 0.0, 7]
        assert (shares > 0.0).all()
        # facets of a ball are no sides: its deepest corner carries
        assert shares.tolist() == [1.0]


def test_a_fine_cylinder_of_triangles_stands_on_its_rim():
    n = 100
    angle = 2 * np.pi * np.arange(n) / n
    rim = 0.1 * np.column_stack([np.cos(angle), np.sin(angle)])
    vertices = np.vstack([np.column_stack([rim, np.full(n, z)]) for z in (-0.2, 0.2)])
    faces = [[0, k + 1, k] for k in range(1, n - 1)]
    faces += [[n, n + k, n + k + 1] for k in range(1, n - 1)]
    for k in range(n):
        after = (k + 1) % n
        faces += [[k, after, n + after], [k, n + after, n + k]]
    i = mesh(vertices, np.array(faces))
    ground = frame(np.zeros(3), np.eye(3))
    standing = points_of(i, frame([0, 0, 0.1999], np.eye(3)), PLANE, ground)
    down = standing[standing[:, 0] > 0.0]
    assert down[:, 7].sum() == pytest.approx(4.0, abs=1e-12)
    np.testing.assert_allclose(down[:, 7] @ down[:, 1:3], 0.0, atol=0.01)
    tilted = points_of(i, frame([0, 0, 0.21], rotation([0.3, 0.0, 0.0])), PLANE, ground)
    assert tilted[tilted[:, 0] > 0.0, 7].sum() == pytest.approx(1.0, abs=1e-12)


@pytest.mark.parametrize("plain", [False, True])
def test_a_sphere_on_the_mesh_of_a_box_is_one_on_a_box(plain):
    rng = np.random.default_rng(10)
    ball = Shape("SPHERE", [0.15, 0.0, 0.0])
    touching = 0
    for _ in range(300):
        half = rng.uniform(0.1, 0.4, 3)
        fi = frame(rng.uniform(-0.5, 0.5, 3), random_rotation(rng))
        fj = frame(rng.uniform(-0.1, 0.1, 3), random_rotation(rng))
        on_box = points_of(ball, fi, box(half), fj)
        on_mesh = points_of(ball, fi, mesh(*box_mesh(half, 2)), fj, plain)
        np.testing.assert_allclose(on_mesh, on_box, atol=1e-9)
        touching += on_box[0, 0] > 0.0
    assert touching > 100


def test_detector_names_are_what_is_used(tmp_path):
    nodes = " ".join(repr(float(x)) for x in TETRAHEDRON[0].ravel())
    convex = "0 1 2 0 3 1 0 2 3 1 3 2"
    # the same solid with a corner pushed in through its middle face
    vertices, faces = box_mesh(CUBE, 2)
    vertices[np.abs(vertices).sum(axis=1).argmin()] *= 0.5
    dent = " ".join(repr(float(x)) for x in vertices.ravel())
    dented = " ".join(map(str, faces.ravel()))
    body = '<Body_Rigid id="{0}" cg_id="{0}0" mass="1" inertia_xx="1" inertia_yy="1" '
    body += 'inertia_zz="1"/><Reference_Marker id="{0}0" body_id="{0}" pos_z="{0}"/>'
    shapes = (
        (body.format(2) + f'<Post_Graphic id="200" type="TriaMesh" rm_id="20"><Nodes>{nodes}')
        + f"</Nodes><Faces>{convex}</Faces></Post_Graphic>"
        + (body.format(3) + f'<Post_Graphic id="300" type="TriaMesh" rm_id="30"><Nodes>{dent}')
        + f"</Nodes><Faces>{dented}</Faces></Post_Graphic>"
        + body.format(4)
        + '<Post_Graphic id="400" type="Sphere" center_marker_id="40" radius=".1"/>'
        + body.format(5)
        + '<Post_Graphic id="500" type="BoxDefinedFromCenter" center_marker_id="50" '
        + 'length_x=".1" length_y=".1" length_z=".1"/>'
    )
    wanted = {
        (200, 100): ("closed form MESH-PLANE", 4),
        (100, 200): ("closed form MESH-PLANE", 4),
        (300, 100): ("patches of triangles", 16),
        (400, 200): ("closed form SPHERE-MESH", 1),
        (500, 200): ("closed form MESH-BOX", 12),
        (200, 300): ("patches of triangles", 16),
        (500, 300): ("patches of triangles", 16),
        (300, 400): ("closed form SPHERE-SURFACE", 8),
    }
    model = GROUND + shapes
    for k, (i, j) in enumerate(wanted):
        model += contact(i, j, id=k + 1)
    plans = plan_pairs(mbsim.read_model(write_deck(tmp_path, model)))
    assert [(plan.kind.detector, plan.kind.slots) for plan in plans.pairs] == list(wanted.values())
