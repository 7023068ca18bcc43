"""Runs at tolerances near what numbers of 16 digits hold come to their end, as far as they say."""

from __future__ import annotations

import numpy as np
import pytest

from helpers.decks import GRAVITY, GROUND, contact, run_deck, run_model, sphere


@pytest.mark.parametrize(
    ("name", "method", "tol", "end"),
    [
        ("pendulum_wall.xml", "RADAU5", 1e-11, 0.6),
        ("pendulum_wall.xml", "RADAU5", 1e-12, 0.6),
        ("slider_crank_clearance.xml", "RADAU5", 1e-11, 0.007),
        ("slider_crank_clearance.xml", "RADAU5", 1e-12, 0.05),
        ("pendulum_wall.xml", "GALPHA", 1e-9, 0.6),
    ],
)
def test_joints_near_a_touch_leave_no_error_that_no_step_is_short_enough_for(
    name, method, tol, end
):
    """What joints round velocities by grows as a step gets shorter, as before a touch.

    Steps fell to 1e-15 s there: at 1e-10 after 0.1 s of the slider, at 1e-11 after 6 ms.
    """
    results = run_model(name, integrator=method, tol=tol, end_time=end)
    assert results["time"][-1] == end
    loose = run_model(name, integrator="DOPRI5", tol=1e-9, end_time=end)
    for body in (2, 3, 4):
        signal = f"bodies/{body}/position"
        if signal in loose:
            assert np.abs(results[signal][-1] - loose[signal][-1]).max() < 1e-7


LAWS = {
    "LUGRE": {
        "mu_static": 0.4, "mu_dynamic": 0.3, "stribeck_vel": 0.1, "bristle_stiffness": 1e4,
        "bristle_damping": 20,
    },
    "DAHL": {"mu_dynamic": 0.3, "bristle_stiffness": 1e4},
    "STICTION": {"mu_static": 0.4, "mu_dynamic": 0.3, "tangential_stiffness": 5e4},
}  # fmt: skip


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize(("method", "tol"), [("RADAU5", 1e-11), ("DOPRI5", 1e-12)])
def test_what_begins_in_exact_touch_and_slides_gets_under_way(tmp_path, law, method, tol):
    """Friction with memory begins within a step, of what hardly presses yet.

    Its stretch, which gives no force then, asked for steps of 3e-12 s, in which the ball did not
    fall by the last digit of its height.
    """
    model = GROUND + GRAVITY + sphere(0.1, v=(1.0, 0.3, 0.0), w=(3.0, -2.0, 20.0))
    model += contact(damping=30, dmax=1e-4, cff_type=law, **LAWS[law])
    ends = [
        run_deck(tmp_path, model, 0.2, 0.02, integrator=one, tol=each)["bodies/2/velocity"][-1]
        for one, each in ((method, tol), ("DOPRI5", 1e-9))
    ]
    assert np.abs(ends[0] - ends[1]).max() < 1e-8
