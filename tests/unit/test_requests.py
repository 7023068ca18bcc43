"""Requests against closed forms, finite differences and frames made independently."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from mbsim.model.elements import Request
from mbsim.model.frames import quaternion, rotation_313
from mbsim.model.placement import MarkerPlace
from mbsim.results.motion import Motion, matrices, motion, rotate
from mbsim.results.requests import angles_313, evaluate, rotation_angle

MARKER, J, REF, GROUND = 1, 2, 3, 4
random = np.random.default_rng(7)
R_I, R_J, R_REF = (rotation_313(*random.uniform(-3, 3, 3)) for _ in range(3))
P_I, P_J, P_GROUND = (random.normal(size=3) for _ in range(3))
EYE, ZERO = np.eye(3), np.zeros(3)

#: MARKER on body 10, J and REF on body 20, GROUND on ground.
MARKERS = {
    MARKER: MarkerPlace(MARKER, 10, ZERO, EYE, P_I, R_I),
    J: MarkerPlace(J, 20, ZERO, EYE, P_J, R_J),
    REF: MarkerPlace(REF, 20, ZERO, EYE, ZERO, R_REF),
    GROUND: MarkerPlace(GROUND, 1, P_GROUND, R_REF, P_GROUND, R_REF),
}
# two bodies that spin about fixed axes at growing rate, and travel on parabolas
AXES = [np.array([1.0, 2.0, 2.0]) / 3.0, np.array([0.0, 0.6, -0.8])]
RATES, GROWTH = [2.0, -1.3], [0.7, 0.4]
START = [np.array([1.0, -2.0, 0.5]), np.array([0.0, 3.0, 1.0])]
SPEED = [np.array([0.3, 0.1, -0.4]), np.array([-1.0, 0.0, 0.2])]
PULL = [np.array([0.0, 0.0, -9.81]), np.array([1.0, 1.0, 0.0])]


def moving(t: np.ndarray[Any, Any]) -> Motion:
    """Return both bodies at times t (n,)."""
    n = len(t)
    y, accel = np.zeros((n, 27)), np.zeros((n, 12))
    for b in range(2):
        s = t[:, None]
        half = 0.5 * (RATES[b] * s + 0.5 * GROWTH[b] * s * s)
        w = (RATES[b] + GROWTH[b] * s) * AXES[b]
        row = y[:, 13 * b : 13 * b + 13]
        row[:, 0:3] = START[b] + SPEED[b] * s + 0.5 * PULL[b] * s * s
        row[:, 3:4], row[:, 4:7] = np.cos(half), np.sin(half) * AXES[b]
        row[:, 7:10] = SPEED[b] + PULL[b] * s
        # a body that turns about a fixed axis has it at the same place in its own axes
        row[:, 10:13] = w
        accel[:, 6 * b : 6 * b + 3] = PULL[b]
        accel[:, 6 * b + 3 : 6 * b + 6] = GROWTH[b] * AXES[b]
    return motion([10, 20], y, accel)


def request(kind: str, j: int | None = None, ref: int | None = None, i: int = MARKER) -> Request:
    """Return a request."""
    return Request(1, f"MARKER_{kind}", i_marker_id=i, j_marker_id=j, ref_marker_id=ref)


T = np.linspace(0.0, 2.0, 23)


@pytest.mark.parametrize("j", [None, J, GROUND])
def test_velocity_is_the_derivative_of_displacement(j: int | None) -> None:
    h = 1e-5
    ahead, behind, here = moving(T + h), moving(T - h), moving(T)
    displaced = request("DISPLACEMENT", j)
    slope = evaluate(displaced, MARKERS, ahead) - evaluate(displaced, MARKERS, behind)
    velocity = evaluate(request("VELOCITY", j), MARKERS, here)
    np.testing.assert_allclose(velocity[:, 1:4], slope[:, 1:4] / (2 * h), rtol=1e-7, atol=1e-7)
    np.testing.assert_allclose(velocity[:, 0], np.linalg.norm(velocity[:, 1:4], axis=1))
    np.testing.assert_allclose(velocity[:, 4], np.linalg.norm(velocity[:, 5:8], axis=1))


@pytest.mark.parametrize("j", [None, J, GROUND])
def test_acceleration_is_the_derivative_of_velocity(j: int | None) -> None:
    h = 1e-5
    asked = request("VELOCITY", j)
    slope = evaluate(asked, MARKERS, moving(T + h)) - evaluate(asked, MARKERS, moving(T - h))
    acceleration = evaluate(request("ACCELERATION", j), MARKERS, moving(T))
    for columns in (slice(1, 4), slice(5, 8)):
        np.testing.assert_allclose(
            acceleration[:, columns], slope[:, columns] / (2 * h), rtol=1e-6, atol=1e-6
        )


@pytest.mark.parametrize("kind", ["DISPLACEMENT", "VELOCITY", "ACCELERATION"])
def test_reference_marker_only_resolves(kind: str) -> None:
    bodies = moving(T)
    plain = evaluate(request(kind, J), MARKERS, bodies)
    turned = evaluate(request(kind, J, REF), MARKERS, bodies)
    R = matrices(bodies.q[:, 1]) @ R_REF
    np.testing.assert_allclose(turned[:, 0], plain[:, 0])
    for n in range(len(T)):
        np.testing.assert_allclose(turned[n, 1:4], R[n].T @ plain[n, 1:4], atol=1e-12)
        if kind == "DISPLACEMENT":
            np.testing.assert_array_equal(turned[n, 4:], plain[n, 4:])
        else:
            np.testing.assert_allclose(turned[n, 5:8], R[n].T @ plain[n, 5:8], atol=1e-12)


def test_angles_are_of_i_in_j() -> None:
    bodies = moving(T)
    table = evaluate(request("DISPLACEMENT", J), MARKERS, bodies)
    for n in range(len(T)):
        i = matrices(bodies.q[n, 0]) @ R_I
        j = matrices(bodies.q[n, 1]) @ R_J
        np.testing.assert_allclose(j @ rotation_313(*table[n, 5:8]), i, atol=1e-12)
        assert math.cos(table[n, 4]) == pytest.approx(0.5 * (np.trace(j.T @ i) - 1.0))


def test_body_on_a_turntable() -> None:
    # unit circle at 2 rad/s: v = 2, a = -4 towards the centre
    markers = {MARKER: MarkerPlace(MARKER, 5, ZERO, EYE, np.array([1.0, 0.0, 0.0]), EYE)}
    t = np.array([0.0, 0.3])
    y = np.zeros((2, 14))
    y[:, 3], y[:, 6], y[:, 12] = np.cos(t), np.sin(t), 2.0
    bodies = motion([5], y, np.zeros((2, 6)))
    angle = 2.0 * t
    displacement = evaluate(request("DISPLACEMENT"), markers, bodies)
    np.testing.assert_allclose(displacement[:, 1], np.cos(angle), atol=1e-15)
    np.testing.assert_allclose(displacement[:, 4], angle, atol=1e-15)
    np.testing.assert_allclose(displacement[:, 5:8], [[a, 0, 0] for a in angle], atol=1e-15)
    velocity = evaluate(request("VELOCITY"), markers, bodies)
    np.testing.assert_allclose(velocity[0], [2, 0, 2, 0, 2, 0, 0, 2], atol=1e-15)
    acceleration = evaluate(request("ACCELERATION"), markers, bodies)
    np.testing.assert_allclose(acceleration[:, 1], -4 * np.cos(angle), atol=1e-14)
    np.testing.assert_allclose(acceleration[:, 4], 0.0)


def test_markers_that_stand_still() -> None:
    table = evaluate(request("DISPLACEMENT", i=GROUND), MARKERS, moving(T))
    assert table.shape == (len(T), 8)
    np.testing.assert_allclose(table[:, 1:4], np.tile(P_GROUND, (len(T), 1)))
    assert not evaluate(request("VELOCITY", i=GROUND), MARKERS, moving(T)).any()
    assert evaluate(request("VELOCITY"), MARKERS, moving(T[:0])).shape == (0, 8)


@pytest.mark.parametrize("psi", [-3.0, -1.0, 0.0, 0.5, 2.9])
@pytest.mark.parametrize("theta", [0.0, 1e-12, 1e-6, 0.3, 1.5, 3.0, math.pi - 1e-6, math.pi])
@pytest.mark.parametrize("phi", [-2.0, 0.0, 1.2, 3.1])
def test_angles_round_trip(psi: float, theta: float, phi: float) -> None:
    R = rotation_313(psi, theta, phi)
    found = [float(angle[0]) for angle in angles_313(R[None])]
    np.testing.assert_allclose(rotation_313(*found), R, atol=1e-9)
    assert 0.0 <= found[1] <= math.pi
    if 1e-6 < theta < math.pi - 1e-6:
        np.testing.assert_allclose(found, [psi, theta, phi], atol=1e-12)
    if theta in (0.0, 1e-12, math.pi):
        assert found[2] == 0.0


@pytest.mark.parametrize("angle", [0.0, 1e-9, 1.0, math.pi - 1e-9, math.pi])
def test_rotation_angle(angle: float) -> None:
    q = np.array([[math.cos(0.5 * angle), *(math.sin(0.5 * angle) * AXES[0])]])
    assert rotation_angle(matrices(q))[0] == pytest.approx(angle, abs=2e-15)


def test_rotate_is_the_matrix_of_the_quaternion() -> None:
    R = np.array([rotation_313(*random.uniform(-3, 3, 3)) for _ in range(50)])
    q = np.array([quaternion(matrix) for matrix in R])
    np.testing.assert_allclose(matrices(q), R, atol=1e-14)
    v = random.normal(size=(50, 3))
    np.testing.assert_allclose(rotate(q, v), (R @ v[..., None])[..., 0], atol=1e-14)
