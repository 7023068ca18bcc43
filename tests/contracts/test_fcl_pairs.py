"""Every pair that can go to FCL: depth, normal and point against what the geometry says."""

from __future__ import annotations

import itertools
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("fcl")

from helpers.pairs import random_rotation
from mbsim.geometry.catalog import POINT
from mbsim.geometry.fcl_detector import FclDetector
from mbsim.geometry.mesh_contact import against_convex, lowest_side
from mbsim.geometry.mesh_surface import Surface
from mbsim.geometry.support import support
from mbsim.model.elements import Graphic
from mbsim.model.hull import polyhedron_of

SIZES = {
    "SPHERE": (0.3, 0.0, 0.0),
    "ELLIPSOID": (0.4, 0.25, 0.15),
    "BOX": (0.4, 0.3, 0.2),
    "CYLINDER": (0.25, 0.4, 0.0),
    "FRUSTUM": (0.3, 0.15, 0.35),
    "PLANE": (0.0, 0.0, 0.0),
}
PRIMITIVES = tuple(SIZES)
HALF = np.array([0.4, 0.3, 0.2])
CUTS = 16


def grid_box(half=HALF, cuts=CUTS):
    """Return vertices and faces of a box whose sides are `cuts` x `cuts` squares."""
    ticks = np.linspace(-1.0, 1.0, cuts + 1)
    vertices, index, faces = [], {}, []

    def number(p):
        key = tuple(np.round(p, 9) + 0.0)
        if key not in index:
            index[key] = len(vertices)
            vertices.append(np.array(p) * half)
        return index[key]

    for k, sign in itertools.product(range(3), (-1.0, 1.0)):
        u, v = (k + 1) % 3, (k + 2) % 3
        for a, b in itertools.product(range(cuts), range(cuts)):
            square = []
            for x, y in ((a, b), (a + 1, b), (a + 1, b + 1), (a, b + 1)):
                p = np.zeros(3)
                p[k], p[u], p[v] = sign, ticks[x], ticks[y]
                square.append(number(p))
            square = square if sign > 0.0 else square[::-1]
            faces += [[square[0], square[1], square[2]], [square[0], square[2], square[3]]]
    return np.array(vertices), np.array(faces)


def dented_box():
    """Return the fine box with a dent in the lower half of its side at -x: no hull."""
    vertices, faces = grid_box()
    vertices = vertices.copy()
    low = (vertices[:, 0] < -0.39) & (abs(vertices[:, 1]) < 0.2) & (vertices[:, 2] < 0.05)
    low &= vertices[:, 2] > -0.15
    vertices[low, 0] += 0.1
    return vertices, faces


def grid_ball(radius=0.3, cuts=CUTS):
    """Return a ball with the vertices of a cube's grid."""
    vertices, faces = grid_box(np.ones(3), cuts)
    return radius * vertices / np.linalg.norm(vertices, axis=1, keepdims=True), faces


MESHES = {
    "FINE": grid_box(),
    "COARSE": grid_box(cuts=1),
    "DENTED": dented_box(),
    "BALL": grid_ball(),
}


def graphic(name):
    if name in PRIMITIVES:
        return Graphic(id=1, shape=name)
    vertices, faces = MESHES[name]
    return Graphic(
        id=1, shape="MESH", vertices=vertices, faces=faces, hull=polyhedron_of(vertices, faces)
    )


class Asked:
    """FCL's detector for one pair of shapes."""

    def __init__(self, name_i, name_j, slots=1):
        self.names = (name_i, name_j)
        graphics = [graphic(name_i), graphic(name_j)]
        self.size = np.array([SIZES.get(name, (0.0, 0.0, 0.0)) for name in self.names])
        one = np.zeros(1, dtype=np.int64)
        self.points = np.zeros((slots, POINT))
        self.frames = np.zeros((2, 12))
        scene = SimpleNamespace(
            graphics=SimpleNamespace(size=self.size, radius=np.array([0.6, 0.6])),
            pairs=SimpleNamespace(kind=one, slot=one, graphic_i=one, graphic_j=one + 1),
            kinds=SimpleNamespace(slots=one + slots, swapped=one),
            work=SimpleNamespace(points=self.points, frames=self.frames, fcl=one),
        )
        self.detector = FclDetector(scene, graphics)

    def rows(self, frame_i, frame_j):
        """Return the touching rows for two frames (p, R)."""
        for k, (p, R) in enumerate((frame_i, frame_j)):
            self.frames[k] = np.concatenate([p, R.ravel()])
        code = self.detector._answer(1)
        if self.detector.failure is not None:
            raise self.detector.failure
        assert code == 0
        return self.points[self.points[:, 0] > 0.0].copy()


def farthest(name, R, d):
    """Return the farthest point of a shape at the origin in direction d."""
    if name in PRIMITIVES:
        return support(name, np.array(SIZES[name]), np.zeros(3), R, d)
    vertices = MESHES[name][0] @ R.T
    return vertices[np.argmax(vertices @ d)]


def spread(name, R, low, depth):
    """Return how far apart a mesh's vertices are that are as low as `low`, to half the depth."""
    if name in PRIMITIVES:
        return 0.0
    vertices = MESHES[name][0] @ R.T
    near = vertices[vertices[:, 2] <= low[2] + 0.5 * depth]
    return np.linalg.norm(near - low, axis=1).max()


def slots_of(i, j):
    return 8 if {i, j} <= {"BOX", "PLANE"} else 1


def turns(count, seed):
    rng = np.random.default_rng(seed)
    return [random_rotation(rng) for _ in range(count)]


#: Shapes with a flat side at z = +height, large enough for all to stand on.
FLOORS = {"BOX": 0.2, "PLANE": 0.0, "FINE": 0.2, "COARSE": 0.2, "DENTED": 0.2}
GUESTS = ("SPHERE", "ELLIPSOID", "BOX", "CYLINDER", "FRUSTUM", "FINE", "COARSE", "DENTED", "BALL")
DEPTHS = (1e-5, 1e-4, 1e-3)


@pytest.mark.parametrize("order", ["I on J", "J on I"])
@pytest.mark.parametrize("floor", FLOORS)
@pytest.mark.parametrize("guest", GUESTS)
def test_a_shape_pressed_into_a_flat_side(guest, floor, order):
    swapped = order == "J on I"
    names = (floor, guest) if swapped else (guest, floor)
    asked = Asked(*names, slots_of(*names))
    place = np.array([0.031, -0.023, FLOORS[floor]])
    for number, (turn, world) in enumerate(zip(turns(6, 1), turns(6, 2), strict=True)):
        low = farthest(guest, turn, np.array([0.0, 0.0, -1.0]))
        for part in DEPTHS:
            depth = part * 0.3
            origin = place - low - np.array([0.0, 0.0, depth])
            frame = (world @ origin, world @ turn)
            frames = ((np.zeros(3), world), frame) if swapped else (frame, (np.zeros(3), world))
            rows = asked.rows(*frames)
            what = f"pose {number}, depth {part:g}"
            assert len(rows) >= 1, what
            row = rows[np.argmax(rows[:, 0])]
            n = world[:, 2] * (-1.0 if swapped else 1.0)
            assert row[0] == pytest.approx(depth, rel=0.02), what
            assert row[4:7] @ n > 1.0 - 1e-5, what
            np.testing.assert_allclose(
                world.T @ row[1:4],
                place - [0.0, 0.0, 0.5 * depth],
                atol=1.5 * depth + 2e-4 + spread(guest, turn, low, depth),
            )


@pytest.mark.parametrize("other", ["SPHERE", "ELLIPSOID", "BOX", "FINE", "COARSE"])
@pytest.mark.parametrize("mesh", ["FINE", "COARSE", "DENTED"])
def test_a_shape_pressed_into_an_edge(other, mesh):
    """The edge x = 0.4, z = 0.2 of the mesh, along y; a box meets it with its own, across."""
    n = np.array([1.0, 0.0, 1.0]) / np.sqrt(2.0)
    asked = Asked(other, mesh)
    turn = np.eye(3)
    if other not in ("SPHERE", "ELLIPSOID"):
        # its edge x = -0.4, z = -0.2 along y goes to -n, along (1, 0, -1)
        x = np.array([0.0, 1.0, 0.0])
        along = np.array([1.0, 0.0, -1.0]) / np.sqrt(2.0)
        a = (n + x) / np.sqrt(2.0)
        turn = np.column_stack([a, along, np.cross(a, along)])
    low = farthest(other, turn, -n)
    if other not in ("SPHERE", "ELLIPSOID"):
        low = turn @ np.array([-0.4, 0.017, -0.2 if np.cross(a, along) @ n > 0 else 0.2])
    for world in turns(4, 3):
        for part in DEPTHS:
            depth = 0.3 * part
            origin = np.array([0.4, 0.013, 0.2]) - depth * n - low
            rows = asked.rows((world @ origin, world @ turn), (np.zeros(3), world))
            assert len(rows) == 1
            assert rows[0, 0] == pytest.approx(depth, rel=0.02)
            assert rows[0, 4:7] @ world @ n > 1.0 - (1e-4 if other != "ELLIPSOID" else 1e-2)


@pytest.mark.parametrize("name", ["FINE", "DENTED", "BALL"])
def test_a_sphere_on_a_mesh_is_its_distance_to_the_surface(name):
    trimesh = pytest.importorskip("trimesh")
    vertices, faces = MESHES[name]
    solid = trimesh.Trimesh(vertices, faces, process=False)
    rng = np.random.default_rng(4)
    asked = Asked("SPHERE", name)
    points, index = solid.sample(60, return_index=True, seed=5)
    checked = 0
    for p, f, part in zip(points, index, itertools.cycle(DEPTHS)):
        centre = p + solid.face_normals[f] * 0.3 * (1.0 - part)
        corners = vertices[faces]
        q, away, _ = trimesh.proximity.closest_point_naive(solid, [centre])
        depth = 0.3 - away[0]
        world, shift = random_rotation(rng), rng.normal(size=3)
        rows = asked.rows((shift + world @ centre, np.eye(3)), (shift, world))
        assert len(corners) == len(faces)
        assert len(rows) == 1
        assert rows[0, 0] == pytest.approx(depth, rel=1e-6)
        n = (centre - q[0]) / away[0]
        np.testing.assert_allclose(world.T @ rows[0, 4:7], n, atol=1e-6)
        checked += 1
    assert checked == 60


@pytest.mark.parametrize("floor", ["BOX", "CYLINDER", "FINE"])
def test_a_ball_of_twisted_squares_on_a_flat_side(floor):
    """The ball is not quite convex: what a piece cannot know of its neighbours adds no depth."""
    assert graphic("BALL").hull is None
    height = 0.4 if floor == "CYLINDER" else 0.2
    asked = Asked(floor, "BALL")
    rng = np.random.default_rng(6)
    for turn, world in zip(turns(12, 7), turns(12, 8), strict=True):
        depth = rng.uniform(1e-3, 3e-3)
        top = farthest("BALL", turn, np.array([0.0, 0.0, 1.0]))
        origin = top + np.array([0.02, 0.01, height - depth])
        rows = asked.rows((world @ origin, world), (np.zeros(3), world @ turn))
        assert len(rows) == 1
        assert rows[0, 0] == pytest.approx(depth, rel=0.01)
        assert rows[0, 4:7] @ world[:, 2] > 1.0 - 1e-5


def test_shapes_that_fcl_sees_touch_and_are_apart_have_support_points():
    # FCL is given a polyhedron around a frustum: measured, the frustum may still be apart
    size, n = np.array(SIZES["FRUSTUM"]), np.array([0.0, 0.0, 1.0])
    points = lowest_side(lambda d: support("FRUSTUM", size, np.zeros(3), np.eye(3), d), n, -1e-3)
    assert len(points) >= 1
    assert points[:, 2].max() == pytest.approx(-0.35, abs=1e-9)
    vertices, faces = MESHES["FINE"]
    surface = Surface(vertices, faces, convex=True)
    touched = np.flatnonzero(surface.normals[:, 2] > 0.9)
    depth, _, out = against_convex(
        surface,
        touched,
        surface.normals[touched],
        lambda d: support("BOX", np.array([0.1, 0.1, 0.1]), np.array([0, 0, 0.301]), np.eye(3), d),
        np.vstack([np.eye(3), -np.eye(3)]),
    )
    assert depth == pytest.approx(-1e-3, abs=1e-12)
    assert out[2] == pytest.approx(1.0)
