"""Forces of pairs without friction and damping are the slopes of an energy: sum of share E(depth).

Judged by central differences over small displacements and turns of I, at random poses.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from helpers.pairs import SIZES, candidates, frame, random_rotation, turned
from helpers.polyhedra import PLANE, Shape, box, box_mesh, mesh, points_of
from mbsim.geometry.catalog import COUPLE, COUPLE_OF_FORCE, PAIRS, POINT

#: Step of the differences, as a length and an angle; their error is some 1e-16 / STEP + STEP^2.
STEP = 1e-6
LEVER = 0.3
#: Pairs whose patches of several points have no potential, alone where they touch at one.
PATCHES = ("CYLINDER-BOX", "FRUSTUM-BOX", "CYLINDER-CYLINDER", "FRUSTUM-CYLINDER")
PATCHES += ("FRUSTUM-FRUSTUM",)


def hull_mesh(rng, corners=9, radius=0.3):
    """Return vertices and faces of the hull of random points of a sphere."""
    vertices = rng.normal(size=(corners, 3))
    vertices *= radius / np.linalg.norm(vertices, axis=1)[:, None]
    faces = ConvexHull(vertices).simplices.astype(np.int64)
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    inward = (np.cross(b - a, c - a) * (a - vertices.mean(axis=0))).sum(axis=1) < 0.0
    faces[inward] = faces[inward][:, ::-1]
    return vertices, faces


def energy(rows):
    """Return the energy of springs of stiffness 1."""
    down = rows[rows[:, 0] > 0.0]
    return 0.5 * down[:, 7] @ down[:, 0] ** 2


def felt(rows, about):
    """Return force and torque on I of springs of stiffness 1, with couples."""
    down = rows[rows[:, 0] > 0.0]
    force = (down[:, 7] * down[:, 0])[:, None] * down[:, 4:7]
    torque = np.cross(down[:, 1:4] - about, force)
    torque += 0.5 * down[:, :1] ** 2 * down[:, COUPLE : COUPLE + 3]
    torque += down[:, :1] * down[:, COUPLE_OF_FORCE : COUPLE_OF_FORCE + 3]
    return np.concatenate([force.sum(axis=0), torque.sum(axis=0)])


def moved(f, k, way):
    """Return a frame moved along axis k, or turned about axis k - 3."""
    p, R = f[:3].copy(), f[3:].reshape(3, 3)
    if k < 3:
        p[k] += way
        return frame(p, R)
    return frame(p, turned(np.eye(3)[k - 3], way) @ R)


def pressed(rows_of, depth, rng):
    """Return frames of I and J, at random, that are `depth` deep."""
    while True:
        frame_j, R = frame(np.zeros(3), random_rotation(rng)), random_rotation(rng)
        way, aside = rng.normal(size=3), rng.uniform(-0.2, 0.2, 3)
        way /= np.linalg.norm(way)
        low, high = 0.0, 3.0
        if rows_of(frame(aside, R), frame_j)[:, 0].max() < depth:
            continue
        for _ in range(50):
            middle = 0.5 * (low + high)
            if rows_of(frame(aside + middle * way, R), frame_j)[:, 0].max() > depth:
                low = middle
            else:
                high = middle
        return frame(aside + low * way, R), frame_j


def off(rows_of, frame_i, frame_j, step=STEP):
    """Return how far force and torque are from the slope of the energy, over their size."""
    rows = rows_of(frame_i, frame_j)
    scale = np.array([1.0, 1.0, 1.0, LEVER, LEVER, LEVER])
    wrench = felt(rows, frame_i[:3])
    slope = [
        energy(rows_of(moved(frame_i, k, step), frame_j))
        - energy(rows_of(moved(frame_i, k, -step), frame_j))
        for k in range(6)
    ]
    error = (wrench + np.array(slope) / (2.0 * step)) / scale
    return np.abs(error).max() / np.abs(wrench / scale).max()


def judge(rows_of, depth, rng, count, single=False):
    """Return the error at the pose that is worse than all but one in fifty.

    A pose within STEP of a change of features has no slope; there is hardly ever one.
    """
    errors = []
    while len(errors) < count:
        frame_i, frame_j = pressed(rows_of, depth, rng)
        down = rows_of(frame_i, frame_j)
        if not single or ((down[:, 0] > 0.0).sum() == 1 and down[:, 7].max() == 1.0):
            errors.append(off(rows_of, frame_i, frame_j))
    return np.quantile(errors, 0.98)


@pytest.mark.parametrize("depth", [1e-3, 1e-2])
@pytest.mark.parametrize(
    "name",
    [n for n in PAIRS if not {"MESH", "SURFACE", "FIELD"} & set(n.split("-")) and n not in PATCHES],
)
def test_primitives(name, depth):
    def rows_of(frame_i, frame_j):
        return candidates(name, frame_i, frame_j)[1]

    assert judge(rows_of, depth, np.random.default_rng(1), 50) < 1e-7


@pytest.mark.parametrize("name", PATCHES)
def test_solids_of_revolution_that_meet_askew(name):
    """One point carries, with the force of the least overlap, and in the same row from now on.

    Only what lies on another within some angle has a patch; of random poses few do.
    """

    def rows_of(frame_i, frame_j):
        return candidates(name, frame_i, frame_j)[1]

    def touching(rows):
        return frozenset(np.flatnonzero((rows[:, 0] > 0.0) & (rows[:, 7] > 1e-3)))

    rng, errors, others = np.random.default_rng(7), [], 0
    for _ in range(60):
        frame_i, frame_j = pressed(rows_of, 1e-3, rng)
        errors.append(off(rows_of, frame_i, frame_j))
        rows = {
            touching(rows_of(moved(frame_i, k, way), frame_j))
            for k in range(6)
            for way in (-1e-9, 0.0, 1e-9)
        }
        others += len(rows) > 1
    assert np.quantile(errors, 0.9) < 1e-7
    # a pose within 1e-9 of a change of features
    assert others <= 2


@pytest.mark.parametrize("name", ["MESH-BOX", "MESH-MESH", "SPHERE-MESH", "MESH-PLANE"])
def test_convex_meshes(name):
    rng = np.random.default_rng(2)
    for depth in (1e-3, 1e-2):
        one, two = mesh(*hull_mesh(rng)), mesh(*hull_mesh(rng))
        i, j = {
            "MESH-BOX": (one, box(np.array([0.4, 0.3, 0.2]))),
            "MESH-MESH": (one, two),
            "SPHERE-MESH": (Shape("SPHERE", [0.3, 0.0, 0.0]), two),
            "MESH-PLANE": (one, PLANE),
        }[name]

        def rows_of(frame_i, frame_j, i=i, j=j):
            return points_of(i, frame_i, j, frame_j)

        assert judge(rows_of, depth, rng, 50) < 1e-7


@pytest.mark.parametrize("kinds", ["box", "mesh"])
@pytest.mark.parametrize("tilt", [1e-3, 0.02, 0.3])
def test_faces_on_faces(kinds, tilt):
    """Corners and crossings together, tilted so little that all of them touch, and more."""
    rng = np.random.default_rng(3)
    half = np.array([0.1, 0.1, 0.1])
    i = box(half) if kinds == "box" else mesh(*box_mesh(half))
    j, errors = box(half), []
    for _ in range(30):
        axis = np.array([*rng.normal(size=2), 0.0])
        R = turned(axis, tilt) @ turned([0, 0, 1], rng.uniform(0.2, 1.3))
        low = (R @ (np.array(np.meshgrid(*[[-1, 1]] * 3)).reshape(3, -1) * 0.1)).min(axis=1)[2]
        p = np.array([*rng.uniform(-0.05, 0.05, 2), 0.1 - low - 2e-3])
        frames = (frame(p, R), frame(np.zeros(3), np.eye(3)))
        if energy(points_of(i, frames[0], j, frames[1])) > 0.0:
            errors.append(off(lambda a, b: points_of(i, a, j, b), *frames))
    assert len(errors) > 20
    # a corner may pass an edge within STEP
    assert np.quantile(errors, 0.93) < 1e-7


def rotor_on_hull(shape, swapped, rng):
    """Return the rows of FCL's detector for a round solid and a convex mesh."""
    fcl_pairs = pytest.importorskip("test_fcl_pairs")
    fcl_pairs.MESHES["HULL"] = hull_mesh(rng, 12)
    names = ("HULL", shape) if swapped else (shape, "HULL")
    asked = fcl_pairs.Asked(*names)

    def rows_of(frame_i, frame_j):
        sides = [(f[:3], f[3:].reshape(3, 3)) for f in (frame_i, frame_j)]
        rows = asked.rows(*sides)
        return rows if len(rows) else np.zeros((1, POINT))

    return rows_of


@pytest.mark.parametrize("swapped", [False, True])
@pytest.mark.parametrize("shape", ["CYLINDER", "FRUSTUM", "ELLIPSOID"])
def test_round_solids_on_convex_meshes(shape, swapped):
    rng = np.random.default_rng(4)
    rows_of = rotor_on_hull(shape, swapped, rng)
    errors = [off(rows_of, *pressed(rows_of, depth, rng)) for depth in (1e-3, 1e-2) * 4]
    # two ways out may be as short
    assert np.quantile(errors, 0.7) < 1e-7


#: How solids lie on a box of half height 0.2 whose top is flat: which way up, how high their centre
#: is, how far it may be off the middle and still lie.
FLAT = {
    "CYLINDER stands": ("CYLINDER", np.eye(3), 0.4, 0.5),
    "CYLINDER lies": ("CYLINDER", turned([0, 1, 0], 0.5 * np.pi), 0.25, 0.65),
    "FRUSTUM stands": ("FRUSTUM", np.eye(3), 0.35, 0.5),
    "FRUSTUM hangs": ("FRUSTUM", turned([1, 0, 0], np.pi), 0.35, 0.4),
}


@pytest.mark.parametrize("tilt", [0.0, 1e-5, 1e-4, 1e-3])
@pytest.mark.parametrize("pose", FLAT)
def test_flat_on_flat(pose, tilt):
    """An end or a straight side on a face, over its edges or not, presses where the depth grows."""
    shape, R, height, reach = FLAT[pose]
    rng, errors = np.random.default_rng(8), []
    i, j = Shape(shape, np.append(SIZES[shape], 0.0)), mesh(*box_mesh(np.array([0.3, 0.3, 0.2])))
    for _ in range(20):
        aside = rng.uniform(-reach, reach, 2)
        lean = turned([*rng.normal(size=2), 0.0], tilt) @ turned([0, 0, 1], rng.uniform(0.0, 6.0))
        frames = (frame([*aside, 0.2 + height - 1e-3], lean @ R), frame(np.zeros(3), np.eye(3)))
        if energy(points_of(i, frames[0], j, frames[1])) > 0.0:
            # the point goes from rim to rim within some 1e-4
            errors.append(off(lambda a, b: points_of(i, a, j, b), *frames, step=3e-8))
    assert len(errors) > 9
    # a rim may pass an edge within a step
    assert np.quantile(errors, 0.85) < 1e-6


@pytest.mark.parametrize("shape", ["CYLINDER", "FRUSTUM", "CONE", "ELLIPSOID"])
def test_depth_on_a_convex_mesh_begins_at_0(shape, monkeypatch):
    """As a solid comes nearer the depth grows from 0 by no more than it moves."""
    if shape == "CONE":
        fcl_pairs = pytest.importorskip("test_fcl_pairs")
        monkeypatch.setitem(fcl_pairs.SIZES, "FRUSTUM", (0.3, 0.0, 0.35))
    rng = np.random.default_rng(5)
    rows_of = rotor_on_hull("FRUSTUM" if shape == "CONE" else shape, False, rng)
    for _ in range(4):
        frame_i, frame_j = pressed(rows_of, 1e-2, rng)
        away = (frame_i[:3] - frame_j[:3]) / np.linalg.norm(frame_i[:3] - frame_j[:3])
        depths = []
        for way in np.linspace(0.0, 0.05, 26):
            f = frame_i.copy()
            f[:3] += way * away
            depths.append(rows_of(f, frame_j)[0, 0])
        steps = -np.diff(depths)
        assert depths[0] == pytest.approx(1e-2, rel=1e-6)
        assert steps.min() >= -1e-12
        assert steps.max() <= 0.05 / 25 + 1e-12
