"""SimBenchmark's scenes: MOREAU's errors below the best that is published, in steps as long."""

from __future__ import annotations

import numpy as np
import pytest

import mbsim
from mbsim.bench import simbenchmark
from mbsim.bench.outcome import Outcome
from mbsim.bench.scenes import all_scenes


def error(name: str, bodies: int, tol: float, h: float | None, end: float | None = None) -> float:
    """Return the scene's own error of a run of MOREAU."""
    scene = all_scenes()[name]
    deck = scene.deck({} if h is None else {"h": h})
    results = mbsim.simulate(deck, integrator="MOREAU", tol=tol, end_time=end)

    def rows(signal: str) -> np.ndarray:
        return np.stack([results[f"bodies/{2 + k}/{signal}"] for k in range(bodies)], axis=1)

    outcome = Outcome(
        0.0,
        results["time"],
        rows("position"),
        rows("quaternion"),
        rows("velocity"),
        rows("angular_velocity"),
        {},
        "",
    )
    return scene.errors(outcome, "")[scene.measure]


def test_the_closed_forms_are_the_published_ones() -> None:
    """Accelerations of box and ball, and the energy of the balls that bounce."""
    assert simbenchmark.ROLLING.accelerations() == pytest.approx((0.7385, 0.2110), abs=1e-12)
    assert simbenchmark.BOUNCING.energy() == pytest.approx(24034.5)


@pytest.mark.parametrize(("h", "tol"), [(1e-3, 1e-4), (1e-2, 1e-6), (None, 1e-6)])
def test_balls_roll_on_a_box_that_is_pushed(h: float | None, tol: float) -> None:
    """Below 1e-10 m^2/s^2."""
    assert error("sb_rolling", 26, tol, h) < 1e-10


@pytest.mark.parametrize("h", [5e-3, None])
def test_elastic_balls_bounce_for_ever(h: float | None) -> None:
    """RaiSim has 1.9e-10 J^2 in steps of 1e-5 s."""
    assert error("sb_bouncing", 49, 1e-3, h) < 1.9e-10


@pytest.mark.parametrize(("h", "tol"), [(5e-3, 1e-3), (1e-3, 1e-5)])
def test_balls_of_a_heap_do_not_go_into_each_other(h: float, tol: float) -> None:
    """DART has 2.0e-7 m^2 in steps of 1e-4 s."""
    assert error("sb_666", 216, tol, h) < 2e-7


@pytest.mark.slow
def test_elastic_balls_of_a_heap_keep_their_energy() -> None:
    """RaiSim has 1.1e-3 J^2 in steps of 1e-4 s."""
    assert error("sb_666_elastic", 216, 1e-5, None) < 1.1e-3
