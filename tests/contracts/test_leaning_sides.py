"""Flat sides that lie, lean and leave: force and torque are the slopes of the energy stored.

A side lies up to 2 degrees and leans from 6 on, up to nearly half of the angle with its neighbours.
Force and torque are compared with differences of the energy over small displacements and turns.
"""

from __future__ import annotations

import itertools

import numpy as np
import pytest
import trimesh

from helpers import virtual_work
from helpers.pairs import frame, random_rotation, turned
from helpers.polyhedra import PLANE, Shape, box_mesh, mesh, points_of
from helpers.polyhedra import box as whole_box
from helpers.surfaces import PLANE as BELOW
from helpers.surfaces import Meshed, angle, box, call

STILL = frame(np.zeros(3), np.eye(3))
CYLINDER = trimesh.creation.cylinder(0.1, 0.2, sections=96)
RING = trimesh.creation.annulus(0.05, 0.1, 0.1, sections=32)
MESHES = {
    "ring": Meshed(RING.vertices, RING.faces),
    "angle": Meshed(*angle()),
    "slab": Meshed(*box(0.25, 0.35, 0.2)),
    "cylinder": Meshed(CYLINDER.vertices, CYLINDER.faces),
}
SLAB, TOP = Meshed(*box(0.7, 0.6, 0.2)), 0.1
HALF = np.array([0.1, 0.08, 0.05])
FINE = "cylinder of 192 corners"
#: Solids and convex meshes with a flat side, and the half height of each.
SOLIDS = {
    "box": (whole_box(HALF), 0.05),
    "box as a mesh": (mesh(*box_mesh(HALF)), 0.05),
    "cylinder": (Shape("CYLINDER", [0.1, 0.05, 0.0]), 0.05),
    "frustum": (Shape("FRUSTUM", [0.1, 0.07, 0.05]), 0.05),
    FINE: (mesh(CYLINDER.vertices, CYLINDER.faces), 0.1),
}
BED = (whole_box(np.array([0.3, 0.3, 0.2])), 0.2)
EXPONENTS = (1.0, 1.5, 2.2)
#: Tilts [degrees] at which sides lie, lean and change from the one to the other.
BANDS = ((0.0, 2.0), (2.0, 6.0), (6.0, 36.0))


def poses(rng, count, limits):
    """Yield random rotations by a tilt between limits [degrees] about a level axis, and a depth."""
    for _ in range(count):
        way, about = rng.uniform(0.0, 2.0 * np.pi, 2)
        tilt = np.radians(rng.uniform(*limits))
        lean = turned((np.cos(way), np.sin(way), 0.0), tilt)
        yield lean @ turned((0.0, 0.0, 1.0), about), 10.0 ** rng.uniform(-5.0, -3.0)


def on_plane(name, R, depth):
    """Return the frame of a mesh that is so deep below z = 0."""
    low = (MESHES[name].vertices @ R.T)[:, 2].min()
    return frame([0.01, 0.02, -low - depth], R)


def below(name, at, exponent=1.0):
    """Return energy and wrench of a mesh on the plane z = 0."""
    points = call("SURFACE-PLANE", at, MESHES[name].size, *BELOW)
    return virtual_work.measured(points, True, at[:3], exponent)


def compare(found, right, force=1e-7, torque=1e-8):
    """Compare a wrench with that of the energy: forces over F, torques over F and 0.1 m."""
    size = np.linalg.norm(right[:3])
    assert found[:3] == pytest.approx(right[:3], abs=force * size)
    assert found[3:] == pytest.approx(right[3:], abs=torque * size)


@pytest.mark.parametrize("limits", BANDS)
@pytest.mark.parametrize("name", MESHES)
def test_a_mesh_on_a_plane(name, limits):
    rng = np.random.default_rng(1)
    for (R, depth), exponent in zip(poses(rng, 24, limits), itertools.cycle(EXPONENTS)):
        at = on_plane(name, R, depth)
        right = virtual_work.slope(lambda f, e=exponent: below(name, f, e)[0], at)
        # differences of 1e-8 m in 1e-5 m: the third derivative of the energy
        compare(below(name, at, exponent)[1], right, 3e-6, 1e-6)


@pytest.mark.parametrize("limits", [*BANDS[:2], (6.0, 8.0)])
@pytest.mark.parametrize("name", MESHES)
def test_a_mesh_on_a_mesh(name, limits):
    """Depths are measured along the mean of both normals: off by some of the tilt times depth."""
    rng = np.random.default_rng(2)
    for (R, depth), exponent in zip(poses(rng, 12, limits), itertools.cycle(EXPONENTS)):
        low = (MESHES[name].vertices @ R.T)[:, 2].min()
        at = frame([0.0, 0.0, TOP - low - depth], R)

        def of(f, e=exponent):
            points = call("SURFACE-SURFACE", f, MESHES[name].size, STILL, SLAB.size)
            return virtual_work.measured(points, True, f[:3], e)

        compare(of(at)[1], virtual_work.slope(lambda f, of=of: of(f)[0], at), 2e-4, 2e-5)


@pytest.mark.parametrize("limits", BANDS)
@pytest.mark.parametrize(
    ("name", "bed"),
    # a mesh of so many corners on a box is two surfaces
    [(name, bed) for name in SOLIDS for bed in ("plane", "box") if (name, bed) != (FINE, "box")],
)
def test_solids_and_convex_meshes(name, bed, limits):
    (solid, half), (other, top) = SOLIDS[name], (PLANE, 0.0) if bed == "plane" else BED
    rng, errors = np.random.default_rng(3), []
    for (R, depth), exponent in zip(poses(rng, 24, limits), itertools.cycle(EXPONENTS)):

        def of(z, R=R, e=exponent):
            return points_of(solid, frame([0.013, 0.021, z], R), other, STILL)

        low, high = top, top + 4.0 * half
        for _ in range(60):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if of(middle)[:, 0].max() > depth else (low, middle)
        at = frame([0.013, 0.021, low], R)

        def energy(f, e=exponent):
            return virtual_work.measured(points_of(solid, f, other, STILL), False, f[:3], e)

        found = energy(at)[1]
        error = abs(found - virtual_work.slope(lambda f, of=energy: of(f)[0], at))
        errors.append(error.max() / np.linalg.norm(found[:3]))
    # a corner may pass an edge within the step of differences
    assert np.quantile(errors, 0.9) < 1e-6


def test_nothing_jumps_from_flat_to_upside_down():
    """In half a step of tilt force and torque change by about half as much."""
    for name in MESHES:
        worst = []
        for count in (4001, 8001):
            tilts = np.radians(np.linspace(0.0, 89.0, count))
            found = []
            for tilt in tilts:
                at = on_plane(name, turned((1.0, 0.3, 0.0), tilt), 1e-3)
                wrench = below(name, at)[1]
                found.append(np.concatenate([wrench[:3], 10.0 * wrench[3:]]) / 1e-3)
            worst.append(abs(np.diff(found, axis=0)).max())
        assert worst[1] < 0.6 * worst[0], name


@pytest.mark.parametrize("tilt", [0.03, 0.07, 0.1, 0.4])
def test_turned_exchanged_and_mirrored(tilt):
    rng = np.random.default_rng(5)
    R = turned((1.0, 0.3, 0.0), tilt) @ turned((0.0, 0.0, 1.0), 0.4)
    mesh_i = MESHES["ring"]
    low = (mesh_i.vertices @ R.T)[:, 2].min()
    at = frame([0.003, 0.002, TOP - low - 2e-4], R)

    def of(name, f_i, size_i, f_j, size_j, about):
        return virtual_work.measured(call(name, f_i, size_i, f_j, size_j), True, about, 1.5)[1]

    here = of("SURFACE-SURFACE", at, mesh_i.size, STILL, SLAB.size, np.zeros(3))
    back = of("SURFACE-SURFACE", STILL, SLAB.size, at, mesh_i.size, np.zeros(3))
    size = np.linalg.norm(here[:3])
    assert back == pytest.approx(-here, abs=1e-9 * size)

    Q, away = random_rotation(rng), np.array([0.3, -0.2, 0.5])
    frames = [frame(Q @ f[:3] + away, Q @ f[3:].reshape(3, 3)) for f in (at, STILL)]
    there = of("SURFACE-SURFACE", frames[0], mesh_i.size, frames[1], SLAB.size, away)
    expected = np.concatenate([Q @ here[:3], Q @ here[3:]])
    assert there == pytest.approx(expected, abs=1e-8 * size)

    # mirrored at x = 0: forces turn round along x, torques along y and z
    mirror = np.array([-1.0, 1.0, 1.0])
    other = Meshed(mesh_i.vertices * mirror, mesh_i.faces[:, ::-1])
    M = np.diag(mirror)
    mirrored = frame(M @ at[:3], M @ R @ M)
    seen = of("SURFACE-SURFACE", mirrored, other.size, STILL, SLAB.size, np.zeros(3))
    assert seen == pytest.approx(here * [-1, 1, 1, 1, -1, -1], abs=1e-8 * size)


def test_a_corner_of_a_leaning_box_has_the_force_of_its_depth_an_edge_somewhat_more():
    """D^16 = 4 sum c d^16: one corner of four gives D = d, two of them 2^(1/16) d."""
    for way, part in (((0.35, -0.25, 0.0), 1.0), ((1.0, 0.0, 0.0), 2.0 ** (1.0 / 16.0))):
        for degrees in (7.0, 20.0, 35.0):
            at = on_plane("slab", turned(way, np.radians(degrees)), 1e-5)
            assert below("slab", at)[1][2] == pytest.approx(part**2 * 1e-5, rel=1e-6)
