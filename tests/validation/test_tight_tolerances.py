"""Runs at tolerances near what numbers of 16 digits hold come to their end, as far as they say."""

from __future__ import annotations

import numpy as np
import pytest

from helpers.decks import run_model


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
