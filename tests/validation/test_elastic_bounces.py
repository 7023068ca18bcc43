"""A sphere that bounces without loss: what its energy drifts by from bounce to bounce.

Where a force d^e begins and ends, no error estimate sees all of what a step makes wrong. Bounces
repeat that, so that errors of one sign add up: in 1e4 bounces to 1e4 times that of one.
"""

from __future__ import annotations

import math

import pytest

from helpers.decks import GROUND, run_deck, sphere

G, RADIUS = 9.81, 0.1


def drift(folder, stiffness, exponent, height, bounces, **settings):
    """Return the change of energy by bounce, over m g h, of a sphere of 1 kg; and the results."""
    flight = math.sqrt(2.0 * height / G)
    deepest = ((exponent + 1.0) * G * height / stiffness) ** (1.0 / (exponent + 1.0))
    # pi of a linear spring, 2.94 of Hertz' law
    period = 2.0 * flight + 3.0 * deepest / (G * flight)
    model = (
        GROUND
        + sphere(RADIUS + height, mass=1.0, radius=RADIUS)
        + f"""
<Force_Gravity grav_x="0" grav_y="0" grav_z="{-G}"/>
<Force_Contact id="301" num_i_graphics="1" i_graphics_id="200" num_j_graphics="1"
  j_graphics_id="100" cnf_type="IMPACT" stiffness="{stiffness!r}" exponent="{exponent!r}"
  damping="0" dmax="1e-4" cff_type="COULOMB_OFF"/>"""
    )
    end = bounces * period
    results = run_deck(folder, model, end, end / 40.0, **settings)
    z = results["bodies/2/position"][:, 2] - RADIUS
    last = max(k for k in range(len(z)) if z[k] > 0.1 * height)
    energy = 0.5 * results["bodies/2/velocity"][last, 2] ** 2 + G * z[last]
    passed = results["time"][last] / period
    return (energy / (G * height) - 1.0) / passed, results


@pytest.mark.parametrize("method", ["DOPRI5", "DOP853"])
@pytest.mark.parametrize("tol", [1e-5, 1e-7, 1e-9])
@pytest.mark.parametrize(
    ("stiffness", "exponent", "height"),
    [(1e7, 1.5, 0.01), (1e5, 1.0, 0.01), (1e9, 1.5, 0.1), (1e9, 2.2, 0.1), (1e6, 1.3, 0.01)],
)
def test_energy_drifts_by_a_few_tol_a_bounce(tmp_path, method, tol, stiffness, exponent, height):
    # about twenty steps each of which may err by tol; kinks unseen make 20 to 100 tol of it
    by_bounce, _ = drift(tmp_path, stiffness, exponent, height, 100, integrator=method, tol=tol)
    assert abs(by_bounce) < 4.0 * tol


@pytest.mark.parametrize("method", ["DOPRI5", "DOP853"])
def test_a_thousand_bounces_do_not_need_more_steps_for_it(tmp_path, method):
    by_bounce, results = drift(tmp_path, 1e7, 1.5, 0.01, 1000, integrator=method, tol=1e-7)
    assert abs(by_bounce) < 2e-7
    # some thirty steps of 6 or 12 evaluations
    assert results.stats["rhs_evaluations"] < 330_000
