"""Pairs that are one incident: the area, the place, the force, and what tilting does to them."""

from __future__ import annotations

import ctypes
import functools

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.spatial.transform import Rotation

from mbsim.compile_model.contacts import region_address
from mbsim.geometry.catalog import AREA, PAIRS, POINT, REGION_ROWS, REGIONS
from mbsim.model.hull import polyhedron_of

SIZES = {
    "BOX": np.array([0.4, 0.3, 0.2]),
    "CYLINDER": np.array([0.25, 0.4, 0.0]),
    "FRUSTUM": np.array([0.3, 0.15, 0.35]),
    "PLANE": np.zeros(3),
}
HEIGHT = {"BOX": 0.2, "CYLINDER": 0.4, "FRUSTUM": 0.35}
BODIES = [name for name in REGIONS if "MESH" not in name]
FLAT = np.concatenate([np.zeros(3), np.eye(3).ravel()])


@functools.cache
def entry(name):
    """Return the compiled region as a function of ctypes."""
    return ctypes.CFUNCTYPE(ctypes.c_int64, *[ctypes.c_void_p] * 5)(region_address(name))


def rows_of(name, frame_i, frame_j=FLAT):
    """Return the rows of a pair that is one incident."""
    rows = np.full((PAIRS[name].slots + REGION_ROWS, POINT), np.nan)
    size_i, size_j = (SIZES[shape] for shape in name.split("-"))
    arrays = (frame_i, size_i, frame_j, size_j, rows)
    assert entry(name)(*(array.ctypes.data for array in arrays)) == len(rows)
    return rows


def placed(name, depth, tilt, way=0.4, turn=0.3, place=(0.07, 0.04)):
    """Return the frame of a shape that stands, tilted, with its lowest point at a depth."""
    shape, other = name.split("-")
    axis = np.array([np.cos(way), np.sin(way), 0.0])
    R = (Rotation.from_rotvec(tilt * axis) * Rotation.from_rotvec([0, 0, turn])).as_matrix()
    down = R.T @ np.array([0.0, 0.0, -1.0])
    if shape == "BOX":
        low = np.abs(down) @ SIZES[shape]
    else:
        bottom, top, half = SIZES[shape] if shape == "FRUSTUM" else (0.25, 0.25, 0.4)
        radial = np.hypot(down[0], down[1])
        low = max(bottom * radial - half * down[2], top * radial + half * down[2])
    ground = SIZES["BOX"][2] if other == "BOX" else 0.0
    return np.concatenate([[*place, ground + low - depth], R.ravel()])


def width(name, frame, x):
    """Return the length of the line at x of the ground that lies inside the shape, cut exactly."""
    shape, other = name.split("-")
    ground = SIZES["BOX"][2] if other == "BOX" else 0.0
    R = frame[3:].reshape(3, 3)
    a, b = R.T @ (np.array([x, 0.0, ground]) - frame[:3]), R.T @ np.array([0.0, 1.0, 0.0])
    low, high = (-0.3, 0.3) if other == "BOX" else (-9.0, 9.0)
    if other == "BOX" and abs(x) > 0.4:
        return 0.0
    # in the shape's axes the line is a + s b
    walls = [(k, SIZES[shape][k]) for k in range(3)] if shape == "BOX" else [(2, 0.4)]
    for k, half in walls:
        if b[k] == 0.0:
            if abs(a[k]) > half:
                return 0.0
            continue
        ends = sorted([(-half - a[k]) / b[k], (half - a[k]) / b[k]])
        low, high = max(low, ends[0]), min(high, ends[1])
    if shape == "CYLINDER":
        aa, ab = b[0] ** 2 + b[1] ** 2, a[0] * b[0] + a[1] * b[1]
        root = ab * ab - aa * (a[0] ** 2 + a[1] ** 2 - 0.25**2)
        if root <= 0.0:
            return 0.0
        low, high = max(low, (-ab - root**0.5) / aa), min(high, (-ab + root**0.5) / aa)
    return max(0.0, high - low)


def cut(name, frame):
    """Return the area that a shape cuts from the ground, by quadrature over lines."""
    edges = np.linspace(-0.9, 0.9, 401)
    inside = np.array([width(name, frame, x) > 0.0 for x in edges])
    if not inside.any():
        return 0.0
    first, last = edges[inside.argmax() - 1], edges[len(edges) - inside[::-1].argmax()]
    for at, sign in ((first, 1), (last, -1)):
        # to where the cut begins, so that the quadrature sees its ends
        low, high = at, at + sign * (edges[1] - edges[0])
        for _ in range(60):
            middle = 0.5 * (low + high)
            low, high = (low, middle) if width(name, frame, middle) > 0.0 else (middle, high)
        first, last = (high, last) if sign == 1 else (first, high)
    # x = middle - half cos t takes the roots at both ends out
    middle, half = 0.5 * (first + last), 0.5 * (last - first)
    whole, _ = quad(
        lambda t: width(name, frame, middle - half * np.cos(t)) * half * np.sin(t),
        0.0, np.pi, limit=2000, epsabs=1e-11, epsrel=1e-11,
    )  # fmt: skip
    return whole


@pytest.mark.parametrize("name", ["BOX-PLANE", "CYLINDER-PLANE", "CYLINDER-BOX"])
@pytest.mark.parametrize("tilt", [0.0, 1e-3, 0.02, 0.3, 0.8, 1.2])
def test_area_is_that_of_the_cut(name, tilt):
    frame = placed(name, 3e-3, tilt)
    assert rows_of(name, frame)[1, AREA] == pytest.approx(cut(name, frame), rel=1e-7, abs=1e-9)


@pytest.mark.parametrize("angle", [np.pi / 2 - 1e-3, np.pi / 2 - 1e-8, np.pi / 2])
def test_a_cylinder_that_lies_has_its_strip(angle):
    # the chord at a depth of 2 mm, its length between both ends
    frame = placed("CYLINDER-PLANE", 2e-3, angle, way=0.0, turn=0.0)
    expected = cut("CYLINDER-PLANE", frame)
    assert rows_of("CYLINDER-PLANE", frame)[1, AREA] == pytest.approx(expected, rel=1e-6)
    flat = 0.8 * 2.0 * np.sqrt(2e-3 * (0.5 - 2e-3))
    if angle == np.pi / 2:
        assert expected == pytest.approx(flat, rel=1e-9)


@pytest.mark.parametrize("way", [0.4, 2.0])
@pytest.mark.parametrize("tilt", [0.0, 1e-4, 2e-3, 0.02])
def test_area_of_two_boxes_is_their_common_polygon(way, tilt):
    # along the normal of J's face: I's lowest face over it, as far as it is below
    frame = placed("BOX-BOX", 2e-3, tilt, way)
    rows, R = rows_of("BOX-BOX", frame), frame[3:].reshape(3, 3)
    corners = np.array([[1, 1, -1], [-1, 1, -1], [-1, -1, -1], [1, -1, -1]]) * SIZES["BOX"]
    polygon = list(frame[:3] + corners @ R.T)
    for a, b in (
        ([1, 0, 0], 0.4), ([-1, 0, 0], 0.4), ([0, 1, 0], 0.3), ([0, -1, 0], 0.3), ([0, 0, 1], 0.2)
    ):  # fmt: skip
        kept = []
        for p, q in zip(polygon, [*polygon[1:], polygon[0]], strict=True):
            here, there = p @ a - b, q @ a - b
            if here <= 0:
                kept.append(p)
            if (here <= 0) != (there <= 0):
                kept.append(p + here / (here - there) * (q - p))
        polygon = kept
    x, y = np.array(polygon).T[:2]
    area = 0.5 * abs(x @ np.roll(y, -1) - y @ np.roll(x, -1))
    # normals of the points lie between those of both faces
    assert rows[1, AREA] == pytest.approx(area, rel=1e-12 if tilt == 0.0 else 5.0 * tilt)


@pytest.mark.parametrize("tilt", [0.0, 2e-3, 0.02, 0.3])
def test_area_of_a_frustums_end(tilt):
    # the segment of its lower end below the ground, seen from above
    frame = placed("FRUSTUM-PLANE", 3e-3, tilt)
    s, c = np.sin(tilt), np.cos(tilt)
    x = min(0.3, (0.3 * s - 3e-3) / s) if tilt else -0.3
    x = max(x, -0.3)
    area = c * 2.0 * quad(lambda u: np.sqrt(0.09 - u * u), x, 0.3, epsabs=1e-13)[0]
    assert rows_of("FRUSTUM-PLANE", frame)[1, AREA] == pytest.approx(area, rel=1e-7)
    frame = placed("FRUSTUM-BOX", 3e-3, tilt, place=(0.05, 0.0))
    if tilt > 0.0:
        assert rows_of("FRUSTUM-BOX", frame)[1, AREA] <= area * (1 + 1e-9)


@pytest.mark.parametrize("name", BODIES)
def test_flat_it_is_what_its_points_are(name):
    rows = rows_of(name, placed(name, 1e-3, 0.0, place=(0.0, 0.0), turn=0.0))
    points = rows[REGION_ROWS:][rows[REGION_ROWS:, 0] > 0.0]
    assert rows[0, 0] == pytest.approx(1e-3, rel=0.04 if name == "FRUSTUM-BOX" else 1e-9)
    assert rows[0, 7] == pytest.approx(points[:, 7].sum(), rel=0.04)
    np.testing.assert_allclose(rows[0, 4:7], [0, 0, 1], atol=1e-12)
    np.testing.assert_allclose(rows[0, 1:3], 0.0, atol=1e-9)
    face = {"BOX": 0.48, "CYLINDER": np.pi / 16, "FRUSTUM": np.pi * 0.09}[name.split("-")[0]]
    assert rows[1, AREA] == pytest.approx(face, rel=1e-9)


@pytest.mark.parametrize("name", BODIES)
@pytest.mark.parametrize("tilt", [0.0, 3e-3, 0.02, 0.3, 0.75])
def test_force_and_torque_of_a_linear_law_are_those_of_the_points(name, tilt):
    rows = rows_of(name, placed(name, 4e-3, tilt))
    points = rows[REGION_ROWS:]
    points = points[points[:, 0] > 0.0]
    force = (points[:, 0] * points[:, 7])[:, None] * points[:, 4:7]
    torque = np.cross(points[:, 1:4], force).sum(axis=0)
    one = rows[0, 0] * rows[0, 7] * rows[0, 4:7]
    np.testing.assert_allclose(one, force.sum(axis=0), rtol=1e-12, atol=1e-15)
    # normals of points differ by the tilt: then a torque along the force is left
    n = rows[0, 4:7]
    left = np.cross(rows[0, 1:4], one) - torque
    np.testing.assert_allclose(left - (left @ n) * n, 0.0, atol=1e-14)


@pytest.mark.parametrize("name", ["BOX-PLANE", "CYLINDER-PLANE", "FRUSTUM-PLANE"])
@pytest.mark.parametrize("exponent", [1.0, 1.5, 2.2])
@pytest.mark.parametrize("tilt", [3e-3, 0.02, 0.3, 0.75])
def test_force_and_place_follow_from_the_energy(name, exponent, tilt):
    # E = S d^(e+1)/(e+1); a displacement and small turns change it by the wrench at the place
    whole = REGIONS[name].whole

    def energy(frame):
        depth = rows_of(name, frame)[0, 0]
        return whole * max(0.0, depth) ** (exponent + 1.0) / (exponent + 1.0)

    frame = placed(name, 4e-3, tilt)
    row = rows_of(name, frame)[0]
    force = row[7] * row[0] ** exponent * row[4:7]
    torque = np.cross(row[1:4] - frame[:3], force)
    h = 1e-7
    for way in range(3):
        pushed = [frame.copy(), frame.copy()]
        turned = [frame.copy(), frame.copy()]
        for k, sign in ((0, h), (1, -h)):
            pushed[k][way] += sign
            turn = Rotation.from_rotvec(sign * np.eye(3)[way]).as_matrix()
            turned[k][3:] = (turn @ frame[3:].reshape(3, 3)).ravel()
        push = (energy(pushed[1]) - energy(pushed[0])) / (2 * h)
        twist = (energy(turned[1]) - energy(turned[0])) / (2 * h)
        size = np.linalg.norm(force)
        assert push == pytest.approx(force[way], abs=1e-6 * size)
        assert twist == pytest.approx(torque[way], abs=1e-6 * size)


@pytest.mark.parametrize(
    ("name", "columns"),
    [
        ("BOX-PLANE", (0, 1, 2)),
        ("CYLINDER-PLANE", (0, 1, 2)),
        # the points of a cylinder on a box change where its side takes over from its end
        ("CYLINDER-BOX", (2,)),
    ],
)
def test_nothing_jumps_from_standing_over_an_edge_to_lying(name, columns):
    def found(tilt):
        # depth, force over the law's, area
        rows = rows_of(name, placed(name, 2e-3, tilt, place=(0.02, 0.01)))
        return np.array([rows[0, 0], rows[0, 7], rows[1, AREA]])[list(columns)]

    for low, high in ((0.0, 1e-3), (1e-3, 0.02), (0.02, 1.5), (1.5, np.pi / 2)):
        tilts = np.linspace(low, high, 700)
        rises = np.abs(np.diff([found(tilt) for tilt in tilts], axis=0))
        for k, column in enumerate(rises.T):
            # what changes most in a step changes less in a part of it, but for rounding
            at = int(column.argmax())
            near = [found(tilt)[k] for tilt in np.linspace(tilts[at], tilts[at + 1], 65)]
            assert np.abs(np.diff(near)).max() < 0.5 * max(column[at], 1e-9)


@pytest.mark.parametrize("name", BODIES)
def test_apart_it_says_the_distance_and_no_area(name):
    for gap in (1e-6, 0.05, 1.0):
        rows = rows_of(name, placed(name, -gap, 0.1))
        assert rows[1, AREA] == 0.0
        assert rows[0, 0] == rows[REGION_ROWS:, 0].max() <= -0.5 * gap


@pytest.mark.parametrize("tilt", [0.0, 1e-3, 0.02, 0.3, 0.8, 1.2])
def test_the_mesh_of_a_box_on_a_plane_is_a_box(tilt):
    # wherever it has other rows, with the same corners
    corners = (
        np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * SIZES["BOX"]
    )
    faces = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    triangles = np.array([part for a, b, c, d in faces for part in ([a, b, c], [a, c, d])])
    hull = polyhedron_of(corners, triangles)
    size = np.array([float(hull.ctypes.data), float(len(hull)), 0.0])
    frame = placed("BOX-PLANE", 3e-3, tilt)
    rows = np.full((PAIRS["MESH-PLANE"].slots + REGION_ROWS, POINT), np.nan)
    arrays = (frame, size, FLAT, SIZES["PLANE"], rows)
    assert entry("MESH-PLANE")(*(array.ctypes.data for array in arrays)) == REGION_ROWS + 8
    of_box = rows_of("BOX-PLANE", frame)
    np.testing.assert_allclose(rows[:2], of_box[:2], rtol=1e-9, atol=1e-12)
