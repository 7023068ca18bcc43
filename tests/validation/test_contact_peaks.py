"""The largest force, depth and slip of a contact are those of the motion, not of ends of steps."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import minimize_scalar

from helpers.decks import GRAVITY, GROUND, contact, run_deck, sphere

METHODS = ["DOPRI5", "DOP853", "RADAU5", "GALPHA", "AUTO"]
G, RADIUS, GAP, MU = 9.81, 0.1, 0.05, 0.3
FRICTION = {
    "cff_type": "COULOMB_ON",
    "mu_static": MU,
    "mu_dynamic": MU,
    "stiction_trans_vel": 1e-3,
    "friction_trans_vel": 2e-3,
}
#: The same force through all impacts, forces that peak before the depth does, and at the touch.
LAWS = {
    "undamped": {"stiffness": 1e5, "exponent": 1.5, "damping": 0.0, "dmax": 1e-4},
    "damped": {"stiffness": 1e5, "exponent": 1.5, "damping": 30.0, "dmax": 1e-4},
    "damped slowly": {"stiffness": 1e5, "exponent": 1.5, "damping": 300.0, "dmax": 1e-2},
    "damped at once": {"stiffness": 1e6, "exponent": 1.0, "damping": 300.0, "dmax": 1e-9},
}


def peaks_of_a_drop(law):
    """Return largest normal force and depth of 1 kg that falls by GAP."""

    def force(depth, rate):
        s = min(max(depth / law["dmax"], 0.0), 1.0)
        damping = law["damping"] * s * s * (3.0 - 2.0 * s)
        return max(0.0, law["stiffness"] * max(depth, 0.0) ** law["exponent"] + damping * rate)

    def turn(t, y):
        return y[1]

    turn.terminal = True
    start = [0.0, math.sqrt(2.0 * G * GAP)]
    # the damping's rise is resolved
    way = solve_ivp(
        lambda t, y: [y[1], G - force(*y)],
        (0.0, 0.1),
        start,
        "DOP853",
        rtol=1e-12,
        atol=1e-14,
        events=turn,
        dense_output=True,
        first_step=0.1 * law["dmax"],
        max_step=2e-5,
    )
    times = np.append(way.t, way.t_events[0])
    best = int(np.argmax([force(*y) for y in way.y.T]))
    found = minimize_scalar(
        lambda t: -force(*way.sol(t)),
        bounds=(times[max(best - 1, 0)], times[best + 1]),
        method="bounded",
        options={"xatol": 1e-12},
    )
    return -found.fun, way.sol(way.t_events[0][0])[0]


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("name", LAWS)
def test_peaks_of_an_impact(tmp_path, name, method):
    law = LAWS[name]
    force, depth = peaks_of_a_drop(law)
    # it slips all the time: friction is mu N
    model = (
        GROUND + GRAVITY + sphere(RADIUS + GAP, w=(0.0, 100.0, 0.0)) + contact(**law, **FRICTION)
    )
    for tol, allowed in ((1e-3, 5e-3), (1e-5, 5e-5)):
        # the order of the method that only keeps energy is 2
        results = run_deck(tmp_path, model, 0.15, 0.15, tol=tol, integrator=method)
        found = [results[f"contacts/301/peak_{q}"] for q in ("force", "penetration", "slip_speed")]
        wanted = [force * math.sqrt(1.0 + MU * MU), depth, 100.0 * RADIUS]
        np.testing.assert_allclose(found, wanted, rtol=allowed)
    assert results.stats["output_evaluations"] <= 12


@pytest.mark.parametrize("method", METHODS)
def test_slip_that_is_largest_where_a_contact_ends(tmp_path, method):
    # one slides off the other without friction, faster and faster; the force fades until it leaves,
    # so that the time of that is known less well than the motion
    model = (
        GROUND.replace('type="Plane"', 'type="Sphere" radius="0.5"').replace(
            "rm_id", "center_marker_id"
        )
        + GRAVITY
        + sphere(0.6 - 1e-4, x=0.05)
        + contact(stiffness=1e5, exponent=1.0, damping=300.0, dmax=1e-5)
    )
    best, found = (
        run_deck(tmp_path, model, 1.0, 0.1, tol=tol, integrator=given)
        for tol, given in ((1e-11, "DOP853"), (1e-7, method))
    )
    assert [event["kind"] for event in best["events"]][-1] == "leave"
    assert found["contacts/301/peak_slip_speed"] == pytest.approx(
        best["contacts/301/peak_slip_speed"], rel=1e-5
    )


@pytest.mark.parametrize("method", METHODS)
def test_a_peak_is_looked_for_once(tmp_path, method):
    # later impacts are weaker: nothing of them can be above what the first one did
    model = GROUND + GRAVITY + sphere(RADIUS + GAP) + contact(damping=30.0, dmax=1e-4)
    one, all_of_them = (
        run_deck(tmp_path, model, end, end, tol=1e-5, integrator=method) for end in (0.15, 0.9)
    )
    assert len([event for event in all_of_them["events"] if event["kind"] == "touch"]) > 2
    assert all_of_them.stats["output_evaluations"] == one.stats["output_evaluations"]
