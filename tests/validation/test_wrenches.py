"""Bushings and vector forces on free bodies: closed forms, energy, action and reaction."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from helpers import free_bodies as free
from mbsim.errors import ModelError, SolverError
from mbsim.expressions.parse import parse
from mbsim.forces.turning import turning_torque
from mbsim.model.elements import BodyForce, Marker, Request, VectorForce

KINETIC, POTENTIAL, DISSIPATED = range(3)
TILTED = free.rotation((1, 2, -1), 0.7)


def decaying(t, x0, v0, mass, stiffness, damping):
    """Return x of the underdamped oscillation from x0, v0."""
    decay = damping / (2 * mass)
    w = math.sqrt(stiffness / mass - decay**2)
    return np.exp(-decay * t) * (x0 * np.cos(w * t) + (v0 + decay * x0) / w * np.sin(w * t))


def imbalance(rows):
    """Return how far the sum of energies goes from its start, over the largest kinetic energy."""
    total = rows["energy"][:, :3].sum(axis=1)
    return np.abs(total - total[0]).max() / rows["energy"][:, KINETIC].max()


def momenta(rows, masses, inertias):
    """Return momentum and angular momentum about the origin of all bodies, (n, 6)."""
    made = np.zeros((len(rows["y"]), 6))
    for b, (mass, inertia) in enumerate(zip(masses, inertias, strict=True)):
        y = rows["y"][:, 13 * b : 13 * b + 13]
        p, q, v, w = y[:, :3], y[:, 3:7], y[:, 7:10], y[:, 10:13]
        turned = np.array([rotate(q[k], inertia * w[k]) for k in range(len(y))])
        made[:, :3] += mass * v
        made[:, 3:] += mass * np.cross(p, v) + turned
    return made


def rotate(q, a):
    """Return a turned by the quaternion q, w first."""
    u = q[1:]
    return a + 2 * np.cross(u, np.cross(u, a) + q[0] * a)


def two_bodies(**elements):
    """Return a model of two free bodies with tilted markers 21 and 31 away from their cgs."""
    first = free.body(2, 1.5, (0.1, 0.2, 0.25), (0, 0, 0.7), (0, 0, 1.0), (1, 2, 3))
    second = free.body(3, 1.0, (0.3, 0.2, 0.25), (1, 0, 0), (0, 0.2, 0), (0.4, -1, 0.2))
    markers = [
        Marker(21, body_id=2, pos=(0.1, 0.2, 0.8), R=TILTED),
        Marker(31, body_id=3, pos=(0.9, 0.1, 0.1), R=free.rotation((0, 1, 1), 0.4)),
    ]
    return free.model(first, second, markers=markers, end_time=2.0, **elements)


def of_two(rows):
    return momenta(rows, (1.5, 1.0), np.array([(0.1, 0.2, 0.25), (0.3, 0.2, 0.25)]))


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_bushing_swings_along_its_axes_as_the_closed_form(axis):
    K, C, preload = (40.0, 70.0, 90.0, 0, 0, 0), (1.0, 2.0, 3.0, 0, 0, 0), 2.0
    F0 = np.zeros(6)
    F0[axis] = preload
    e = TILTED[:, axis]
    ground = Marker(11, body_id=1, pos=(0, 0, 0), R=TILTED)
    body = free.body(2, 1.5, p=tuple(0.3 * e), v=tuple(0.8 * e))
    bushing = free.bushing(1, 20, 11, K, C, F0)
    rows, _ = free.run(free.model(body, markers=[ground], marker_forces=[bushing], end_time=2.0))
    rest = preload / K[axis]
    x = rest + decaying(rows["time"], 0.3 - rest, 0.8, 1.5, K[axis], C[axis])
    np.testing.assert_allclose(rows["y"][:, :3], x[:, None] * e, atol=2e-8)
    assert imbalance(rows) < 1e-8
    assert rows["energy"][-1, DISSIPATED] > 0.1


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_bushing_turns_about_its_axes_as_the_closed_form(axis):
    K, C, preload = (0.0,) * 3 + (0.4, 0.5, 0.6), (0.0,) * 3 + (0.02, 0.03, 0.04), 0.1
    T0, w = np.zeros(6), np.zeros(3)
    T0[3 + axis], w[axis] = preload, 3.0
    body = free.body(2, inertia=(0.3, 0.3, 0.3), w=w)
    rows, _ = free.run(free.model(body, marker_forces=[free.bushing(1, 20, 10, K, C, T0)]))
    rest = preload / K[3 + axis]
    x = rest + decaying(rows["time"], -rest, 3.0, 0.3, K[3 + axis], C[3 + axis])
    # beyond two thirds of half a turn
    assert x.max() > 2.0
    half = rows["y"][:, 4 + axis]
    np.testing.assert_allclose(half, np.sin(x / 2), atol=1e-8)
    assert imbalance(rows) < 1e-8


@pytest.mark.parametrize("size", [1e-5, 9e-4, 2e-3, 0.5, 2.0, 3.1])
def test_the_torque_is_the_gradient_of_what_a_bushing_stores(size):
    k = (5.0, 3.0, 8.0)
    n = np.array([2.0, -1.0, 0.5])
    theta = size * n / np.linalg.norm(n)
    torque = np.array(turning_torque.py_func(theta, k) if hasattr(turning_torque, "py_func")
                      else turning_torque(theta, k))  # fmt: skip
    for axis in np.eye(3):
        h = 1e-4 * min(size, 0.1)
        ends = []
        for sign in (1, -1):
            R = free.rotation(axis, sign * h) @ free.rotation(theta, size)
            angle = math.acos(min(1.0, 0.5 * (np.trace(R) - 1)))
            skew = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
            angle = math.atan2(np.linalg.norm(skew), np.trace(R) - 1)
            turned = angle * skew / np.linalg.norm(skew)
            ends.append(0.5 * turned @ (np.array(k) * turned))
        assert axis @ torque == pytest.approx((ends[0] - ends[1]) / (2 * h), rel=1e-5, abs=1e-7)


@pytest.mark.parametrize("damped", [False, True])
def test_a_bushing_keeps_energy_and_momenta_in_any_motion(damped):
    damping = (1.0, 2.0, 3.0, 0.1, 0.2, 0.3) if damped else (0.0,) * 6
    preload = (3.0, -1.0, 2.0) + ((0.1, -0.2, 0.3) if damped else (0.0,) * 3)
    bushing = free.bushing(1, 21, 31, (50, 60, 70, 5, 6, 7), damping, preload)
    rows, _ = free.run(two_bodies(marker_forces=[bushing]))
    assert imbalance(rows) < 1e-8
    assert np.ptp(rows["energy"][:, KINETIC]) > 1.0
    if not damped:
        assert np.abs(rows["energy"][:, DISSIPATED]).max() == 0.0
    np.testing.assert_allclose(of_two(rows), of_two(rows)[:1].repeat(len(rows["y"]), 0), atol=2e-8)


def test_a_vector_force_acts_and_reacts_at_the_origin_of_i():
    texts = ("-50*DX(21,31,31)", "-60*DY(21,31,31)-VX(21,31)", "3*SIN(TIME)", "1", None, "TIME")
    exprs = tuple(parse(text) if text else None for text in texts)
    requests = [
        Request(1, "EXPRESSION", exprs=tuple(parse(f"GFORCE(1,0,{c},31)") for c in range(1, 9))),
        Request(2, "EXPRESSION", exprs=tuple(parse(f"VFORCE(1,1,{c},31)") for c in range(1, 9))),
        Request(3, "EXPRESSION", exprs=(parse("FX(21,30,31)"), parse("TZ(30,21,31)"))),
    ]
    # the J marker's own place does not matter
    force = VectorForce(1, "FORCEANDTORQUE", exprs, "", 21, 30, 31)
    rows, _ = free.run(two_bodies(vector_forces=[force], requests=requests))
    kept = of_two(rows)
    np.testing.assert_allclose(kept, kept[:1].repeat(len(kept), 0), atol=2e-7)
    assert imbalance(rows) < 1e-7
    value, t = rows["value"], rows["time"]
    np.testing.assert_allclose(value[:, 3], 3 * np.sin(t), atol=1e-12)
    np.testing.assert_allclose(value[:, 5:8], np.column_stack((t**0, 0 * t, t)), atol=1e-12)
    np.testing.assert_allclose(value[:, 8:16] * [1, -1, -1, -1, 1, -1, -1, -1], value[:, :8],
                               atol=1e-12)  # fmt: skip
    np.testing.assert_allclose(value[:, 16], value[:, 1], atol=1e-12)
    np.testing.assert_allclose(value[:, 17], -t, atol=1e-12)


def test_a_force_on_one_body_is_along_its_reference_marker():
    exprs = (parse("2"), None, parse("TIME"), None, parse("0.5"), None)
    ground = Marker(11, body_id=1, pos=(5, 0, 0), R=TILTED)
    body = free.body(2, 1.5, (0.1, 0.2, 0.3))
    force = BodyForce(1, "FORCEANDTORQUE", exprs, "", 20, 0, 11)
    rows, _ = free.run(free.model(body, markers=[ground], body_forces=[force]))
    t = rows["time"][:, None]
    v = (TILTED[:, 0] * 2 * t + TILTED[:, 2] * t**2 / 2) / 1.5
    np.testing.assert_allclose(rows["y"][:, 7:10], v, atol=1e-9)
    np.testing.assert_allclose(momenta(rows, (1.5,), np.array([(0.1, 0.2, 0.3)]))[:, 3:],
        0.5 * t * TILTED[:, 1] + np.cross(rows["y"][:, :3], 1.5 * v), atol=1e-8)  # fmt: skip
    assert imbalance(rows) < 1e-8


def test_a_vector_force_that_is_no_number_stops_the_run():
    force = BodyForce(1, "FORCEONLY", (parse("1/(TIME-TIME)"), *[None] * 5), "", 20)
    with pytest.raises(SolverError):
        free.run(free.model(free.body(2), body_forces=[force]))


def hung(damping, preload=0.0):
    """Return two free bodies that a stiff bushing joins away from both cgs, shaken."""
    K = (4e3, 6e3, 5e3, 30.0, 20.0, 25.0)
    C = tuple(damping * k for k in K)
    model = two_bodies(marker_forces=[free.bushing(1, 21, 31, K, C, (preload, 0, 0, 0, 0, 0))])
    place = {"pos": (0.5, 0.1, 0.4), "R": TILTED}
    markers = {id: replace(model.markers[id], **place) for id in (21, 31)}
    return replace(model, markers=model.markers | markers)


@pytest.mark.parametrize("damping", [0.0, 0.01])
@pytest.mark.parametrize("preload", [0.0, 200.0])
def test_the_method_without_error_estimate_follows_a_bushing(damping, preload):
    model = hung(damping, preload)
    rows, _ = free.run(model, tol=1e-7, integrator="VERLET")
    exact, _ = free.run(model, tol=1e-11, integrator="DOP853")
    half = exact["time"] <= 0.2
    off = np.abs(rows["y"] - exact["y"])[half]
    assert off[:, [0, 1, 2, 13, 14, 15]].max() < 2e-4


@pytest.mark.parametrize("damping", [0.0, 0.01, 0.1])
def test_its_largest_steps_are_stable_with_a_bushing(damping):
    rows, _ = free.run(hung(damping), tol=0.1, integrator="VERLET")
    total = rows["energy"][:, :2].sum(axis=1)
    # stable steps of 0.9 of the limit see 1/(1 - 0.81) of the energy; others double it for ever
    assert total.max() < 6.0 * total[0]


@pytest.mark.parametrize("kind", ["vector_forces", "body_forces"])
def test_the_method_without_error_estimate_refuses_vector_forces(kind):
    exprs = (parse("1"), *(None,) * 5)
    if kind == "vector_forces":
        force = VectorForce(7, "FORCEANDTORQUE", exprs, "", 20, 10)
    else:
        force = BodyForce(7, "FORCEANDTORQUE", exprs, "", 20)
    with pytest.raises(ModelError, match=r"Force_Vector_.*\[7\]: integrator VERLET is for forces"):
        free.run(free.model(free.body(2), **{kind: [force]}), integrator="VERLET")
