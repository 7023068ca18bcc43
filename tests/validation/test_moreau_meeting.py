"""MOREAU: impulses act where bodies meet, not where they are at the step's begin."""

from __future__ import annotations

import math

import numpy as np
import pytest

import mbsim
from helpers import rigid_decks as decks
from mbsim.bench import deck as text

STEPS = [{"h": 0.01}, {"h": 0.003}, {"tol": 1e-5}, {"tol": 1e-8}]


def run(parts: list[str], step: dict[str, float], end: float) -> mbsim.results.reading.Results:
    """Return a run of bodies with a step of h or by error."""
    fixed = [decks.FIXED.format(h=step["h"])] if "h" in step else []
    whole = text.deck("meeting", [text.GROUND, text.FLOOR, *parts, *fixed], end, 0.02)
    return mbsim.simulate(whole, integrator="MOREAU", tol=step.get("tol", 1e-5))


@pytest.mark.parametrize("step", STEPS)
@pytest.mark.parametrize("e", [0.0, 0.5])
def test_a_thrown_ball_that_bounces_rolls_at_five_sevenths_of_its_speed(
    step: dict[str, float], e: float
) -> None:
    """Its spin about where it touches is kept by friction of any kind: v + 2/5 r w = v0."""
    parts = [
        text.sphere(2, 1.0, 0.1, (0.0, 0.0, 0.4), (3.0, 0.0, 0.0)),
        text.contact(301, [200], [100], **decks.rubbed(0.5, e)),
        text.gravity(),
    ]
    results = run(parts, step, 1.4)
    assert results["bodies/2/velocity"][-1, 0] == pytest.approx(15.0 / 7.0, abs=1e-12)


@pytest.mark.parametrize("step", STEPS)
@pytest.mark.parametrize("mu", [0.0, 0.05, 0.5])
def test_spheres_that_meet_obliquely_part_as_they_should(step: dict[str, float], mu: float) -> None:
    """One at 3 m/s, half a radius pair beside the other's centre, e = 0.7: closed form.

    The impulse stops slip, or is mu times the normal one: slip changes by (2/m + 2 r^2/I) a
    tangential impulse.
    """
    e, n = 0.7, np.array([-math.sqrt(0.75), 0.5])
    parts = [
        text.sphere(2, 1.0, 0.1, (-0.613, 0.1, 1.0), (3.0, 0.0, 0.0)),
        text.sphere(3, 1.0, 0.1, (0.0, 0.0, 1.0), (0.0, 0.0, 0.0)),
        text.contact(301, [200], [300], **decks.rubbed(mu, e)),
    ]
    results = run(parts, step, 0.3)
    across = np.array([n[1], -n[0]])
    u = np.array([3.0, 0.0])
    along = -(1.0 + e) * (u @ n) / 2.0
    slip = u @ across
    impulse = along * n - math.copysign(min(mu * along, abs(slip) / 7.0), slip) * across
    off = 1e-6 if "h" in step else step["tol"]
    assert results["bodies/2/velocity"][-1, :2] == pytest.approx(u + impulse, abs=off)
    assert results["bodies/3/velocity"][-1, :2] == pytest.approx(-impulse, abs=off)


@pytest.mark.parametrize("step", STEPS)
def test_a_ball_and_a_box_that_meet_in_flight_keep_their_angular_momentum(
    step: dict[str, float],
) -> None:
    """The box stands still in the air; the ball, which spins not, hits it away from its centre."""
    box = decks.cube(3, 2.0, 0.2, (0.0, 0.0, 1.0))
    parts = [
        text.sphere(2, 1.0, 0.1, (-0.613, 0.07, 1.04), (3.0, 0.2, 0.0)),
        box,
        text.contact(301, [200], [300], **decks.rubbed(0.3, 0.5)),
    ]
    results = run(parts, step, 0.25)
    moments = []
    for row in (0, -1):
        moment = np.zeros(3)
        for id, mass, inertia in ((2, 1.0, 0.004), (3, 2.0, 2.0 * 0.04 / 6.0)):
            x, v, w = (
                results[f"bodies/{id}/{name}"][row]
                for name in ("position", "velocity", "angular_velocity")
            )
            moment += mass * np.cross(x, v) + inertia * w
        moments.append(moment)
    off = 2e-5 if "h" in step else step["tol"]
    assert moments[1] == pytest.approx(moments[0], abs=off)
    assert np.linalg.norm(results["bodies/3/angular_velocity"][-1]) > 1.0
