"""Springs, dampers and scalar forces on free bodies, against closed forms."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from helpers import free_bodies as free
from helpers.free_bodies import imbalance
from mbsim.errors import ModelError, SolverError
from mbsim.expressions.parse import parse
from mbsim.model.elements import Marker, Request, ScalarForce, Variable

K, C, M, LENGTH = 100.0, 2.0, 1.5, 0.5
KINETIC, POTENTIAL, DISSIPATED = range(3)


def oscillation(t, x0, v0, mass, stiffness, damping):
    """Return x and v of the underdamped oscillation from x0, v0."""
    decay = damping / (2 * mass)
    w = math.sqrt(stiffness / mass - decay**2)
    s = (v0 + decay * x0) / w
    fade, cos, sin = np.exp(-decay * t), np.cos(w * t), np.sin(w * t)
    x = fade * (x0 * cos + s * sin)
    return x, fade * (s * w * cos - x0 * w * sin) - decay * x


@pytest.mark.parametrize("damping", [0.0, C])
@pytest.mark.parametrize("flip", [False, True])
def test_translational_spring_swings_as_its_closed_form(damping, flip):
    i, j = (10, 20) if flip else (20, 10)
    spring = free.spring_damper(1, "TRANSLATIONAL", i, j, K, damping, LENGTH, preload=3.0)
    body = free.body(2, mass=M, p=(0.0, 0.0, 0.7), v=(0, 0, 1.0))
    rows, _ = free.run(free.model(body, marker_forces=[spring], end_time=2.0))
    rest = LENGTH + 3.0 / K
    x, v = oscillation(rows["time"], 0.7 - rest, 1.0, M, K, damping)
    np.testing.assert_allclose(rows["y"][:, 2], rest + x, atol=1e-8)
    np.testing.assert_allclose(rows["y"][:, 9], v, atol=1e-7)
    assert np.abs(rows["y"][:, :2]).max() == 0.0
    # the force is that on I, whichever way round the spring is
    force = (3.0 - K * (rest + x - LENGTH) - damping * v) * (-1 if flip else 1)
    np.testing.assert_allclose(rows["applied"][:, 2], force, atol=2e-6)
    np.testing.assert_allclose(rows["applied"][:, [0, 1, 3, 4, 5]], 0.0, atol=1e-12)
    stretch = rest + x - LENGTH
    stored = 0.5 * K * stretch**2 - 3.0 * stretch
    np.testing.assert_allclose(rows["energy"][:, POTENTIAL], stored, atol=1e-7)
    assert imbalance(rows) < 1e-8
    assert (rows["energy"][-1, DISSIPATED] > 0.1) == (damping > 0)


def test_torsion_spring_counts_whole_turns():
    k, c, inertia = 0.4, 0.02, 0.3
    spring = free.spring_damper(1, "ROTATIONAL", 20, 10, k, c, 0.5, 0.1)
    body = free.body(2, inertia=(0.5, 0.5, inertia), w=(0, 0, 12.0))
    request = Request(1, "EXPRESSION", exprs=(parse("AZ(20,10)"), None, parse("SPDP(1,0,8)")))
    model = free.model(body, marker_forces=[spring], requests=[request], end_time=8.0)
    rows, runner = free.run(model)
    assert runner.system.values == [(1, 1), (1, 3)]
    rest = 0.5 + 0.1 / k
    x, v = oscillation(rows["time"], -rest, 12.0, inertia, k, c)
    # it turns by more than a whole turn, and back
    assert x.max() > 2.5 * math.pi
    assert x.min() < -2.5 * math.pi
    np.testing.assert_allclose(rows["value"][:, 0], rest + x, atol=1e-7)
    torque = 0.1 - k * (rest + x - 0.5) - c * v
    np.testing.assert_allclose(rows["value"][:, 1], torque, atol=1e-7)
    np.testing.assert_allclose(rows["applied"][:, 5], torque, atol=1e-7)
    assert imbalance(rows) < 1e-8


def test_spring_between_two_bodies_conserves_momentum():
    """Reduced mass: the distance oscillates with m1 m2 / (m1 + m2)."""
    bodies = [free.body(2, 2.0, v=(0, 0.3, 0)), free.body(3, 3.0, p=(0.8, 0, 0), v=(0, 0.3, 0))]
    spring = free.spring_damper(1, "TRANSLATIONAL", 20, 30, K, C, LENGTH)
    rows, _ = free.run(free.model(*bodies, marker_forces=[spring], end_time=2.0))
    x, _ = oscillation(rows["time"], 0.3, 0.0, 1.2, K, C)
    y = rows["y"]
    np.testing.assert_allclose(y[:, 13] - y[:, 0], LENGTH + x, atol=1e-8)
    np.testing.assert_allclose(2 * y[:, 7:10] + 3 * y[:, 20:23], [[0, 1.5, 0]] * len(y), atol=1e-9)
    assert imbalance(rows) < 1e-7


def test_springs_off_the_cg_close_the_energy_balance():
    """Two bodies tumble on springs and a damper with arms; angular momentum is conserved."""
    markers = [Marker(21, body_id=2, pos=(0.2, 0.1, 0.3)), Marker(31, body_id=3, pos=(1, 0.4, 0))]
    bodies = [
        free.body(2, 1.0, (0.1, 0.2, 0.15), v=(0.5, 0, 1), w=(1, 2, 0.5)),
        free.body(3, 2.0, (0.3, 0.1, 0.2), p=(1.0, 0, 0), w=(0, -1, 2)),
    ]
    springs = [
        free.spring_damper(1, "TRANSLATIONAL", 21, 31, 50.0, 0.7, 0.4),
        free.spring_damper(2, "TRANSLATIONAL", 30, 21, 30.0, 0.2, 0.9, preload=1.0),
    ]
    model = free.model(*bodies, markers=markers, marker_forces=springs, end_time=3.0)
    rows, runner = free.run(model)
    assert imbalance(rows) < 1e-7
    assert rows["energy"][-1, DISSIPATED] > 0.1
    inertia = runner.system.scene.bodies.inertia
    masses = runner.system.scene.bodies.mass
    angular = np.zeros((len(rows["y"]), 3))
    for b in range(2):
        y = rows["y"][:, 13 * b : 13 * b + 13]
        angular += masses[b] * np.cross(y[:, 0:3], y[:, 7:10])
        w, u = y[:, 3:4], y[:, 4:7]
        local = y[:, 10:13] @ inertia[b]
        angular += local + 2 * np.cross(u, np.cross(u, local) + w * local)
    np.testing.assert_allclose(angular, angular[[0]].repeat(len(angular), axis=0), atol=1e-7)


@pytest.mark.parametrize("kind", ["TRANSLATIONAL", "ROTATIONAL"])
def test_a_scalar_force_by_expression_is_the_spring_that_it_spells(kind):
    body = free.body(2, M, (0.2, 0.2, 0.3), p=(0, 0.1, 0.7), v=(0.3, 0, 1), w=(0, 0, 3))
    spring = free.spring_damper(1, kind, 20, 10, K, C, LENGTH, 3.0)
    text = {
        "TRANSLATIONAL": "3 - VARVAL(7)*(DM(20,10) - 0.5)\n - 2.0*VR(20,10)",
        "ROTATIONAL": "3 - VARVAL(7)*RTOD*DTOR*(AZ(20,10) - 0.5) - 2.0*WZ(20,10,10)",
    }[kind]
    force = ScalarForce(1, kind, parse(text), i_marker_id=20, j_marker_id=10)
    variable = Variable(7, parse("25*4"))
    common = free.model(body, end_time=1.0, g=(0, 0, -9.81))
    by_spring, _ = free.run(replace(common, marker_forces={"SPRINGDAMPER": {1: spring}}))
    by_force, _ = free.run(replace(common, scalar_forces={1: force}, variables={7: variable}))
    np.testing.assert_allclose(by_force["y"][:, :13], by_spring["y"][:, :13], atol=1e-7)
    np.testing.assert_allclose(by_force["applied"], by_spring["applied"], atol=1e-5)
    # what the expression does counts as lost: both balances close
    assert imbalance(by_spring) < 1e-7
    assert imbalance(by_force) < 1e-7


def test_a_force_of_time_alone_acts_on_i_only():
    """m z'' = F0 sin(w t) along J's z, which is global x; nothing acts on J's body."""
    x_axis = np.array([[0.0, 0, 1], [0, 1, 0], [-1, 0, 0]])
    marker = Marker(31, body_id=3, pos=(0, 5, 0), R=x_axis)
    force = ScalarForce(1, "TRANSLATIONAL", parse("2*SIN(3*TIME)"), "", 20, 31, action_only=True)
    bodies = [free.body(2, M), free.body(3, p=(0, 5, 0))]
    rows, _ = free.run(free.model(*bodies, markers=[marker], scalar_forces=[force], end_time=2.0))
    t = rows["time"]
    wanted = 2 / (3 * M) * (t - np.sin(3 * t) / 3)
    np.testing.assert_allclose(rows["y"][:, 0], wanted, atol=1e-8)
    np.testing.assert_allclose(rows["accel"][:, 0], 2 * np.sin(3 * t) / M, atol=1e-12)
    assert (rows["y"][:, 13:16] == rows["y"][0, 13:16]).all()
    assert imbalance(rows) < 1e-7


def test_a_torque_acts_on_i_only_or_on_both():
    torque = ScalarForce(1, "ROTATIONAL", parse("0.6"), i_marker_id=20, j_marker_id=30)
    bodies = [free.body(2, 1.0, (0.2, 0.2, 0.3)), free.body(3, 1.0, (0.2, 0.2, 0.2))]
    for alone in (False, True):
        force = replace(torque, action_only=alone)
        rows, _ = free.run(free.model(*bodies, scalar_forces=[force], end_time=1.0))
        np.testing.assert_allclose(rows["y"][:, 12], 2.0 * rows["time"], atol=1e-8)
        wanted = 0.0 if alone else -3.0
        np.testing.assert_allclose(rows["y"][:, 25], wanted * rows["time"], atol=1e-8)
        assert imbalance(rows) < 1e-8


def test_markers_that_coincide_give_no_direction_and_no_fault():
    spring = free.spring_damper(1, "TRANSLATIONAL", 20, 10, K, C, LENGTH)
    rows, _ = free.run(free.model(free.body(2), marker_forces=[spring], end_time=0.1))
    assert (rows["y"][:, :3] == 0.0).all()
    assert np.isfinite(rows["energy"]).all()


@pytest.mark.parametrize("text", ["SQRT(0.5 - TIME)", "LOG(TIME - 5)"])
def test_a_force_that_is_no_number_ends_the_run_and_is_named(text):
    force = ScalarForce(7, "TRANSLATIONAL", parse(text), i_marker_id=20, j_marker_id=10)
    model = free.model(free.body(2, p=(0, 0, 1)), scalar_forces=[force], end_time=1.0)
    with pytest.raises(SolverError, match="not finite") as caught:
        free.run(model)
    assert "Force_Scalar_TwoBody[7]" in str(caught.value)


@pytest.mark.parametrize("kind", ["TRANSLATIONAL", "ROTATIONAL"])
@pytest.mark.parametrize("damping", [0.0, 20.0])
def test_the_method_without_error_estimate_takes_stable_steps(kind, damping):
    spring = free.spring_damper(1, kind, 20, 10, 1e4, damping, 1.0)
    body = free.body(2, M, (M, M, M), p=(0, 0, 1.01), v=(0, 0, 0.5), w=(0, 0, 0.5))
    model = free.model(body, marker_forces=[spring], end_time=0.5)
    rows, _ = free.run(model, tol=1e-5, integrator="VERLET")
    if kind == "TRANSLATIONAL":
        x, _ = oscillation(rows["time"], 0.01, 0.5, M, 1e4, damping)
        np.testing.assert_allclose(rows["y"][:, 2], 1 + x, atol=2e-4)
    else:
        x, v = oscillation(rows["time"], -1.0, 0.5, M, 1e4, damping)
        np.testing.assert_allclose(rows["y"][:, 12], v, atol=2e-2 * np.abs(v).max())


def test_the_method_without_error_estimate_refuses_expressions():
    force = ScalarForce(7, "TRANSLATIONAL", parse("1"), i_marker_id=20, j_marker_id=10)
    with pytest.raises(ModelError, match=r"Force_Scalar_TwoBody\[7\]: integrator VERLET"):
        free.run(free.model(free.body(2), scalar_forces=[force]), integrator="VERLET")
