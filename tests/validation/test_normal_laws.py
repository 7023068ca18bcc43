"""Impacts under HUNT_CROSSLEY, HERTZ and POISSON against the exact relations of the laws."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq

from helpers.decks import COULOMB, GRAVITY, GROUND, contact, run_deck, sphere

SPEEDS = [0.1, 1.0, 5.0]
TOLERANCES = pytest.mark.parametrize(("tol", "allowed"), [(1e-5, 1e-3), (1e-9, 1e-6)])
NEAR_COLLAPSE = 1e-12


def rebound_of(A):
    """Return e of A (1 + e) = ln((1 + A) / (1 - e A))."""
    if A == 0.0:
        return 1.0

    def excess(e):
        return math.log1p(A) - math.log1p(-e * A) - A * (1.0 + e)

    # left of the root the excess is negative, at e = 1/A infinite
    return float(brentq(excess, 1e-9, min(1.0, 1.0 / A) * (1.0 - NEAR_COLLAPSE), xtol=1e-14))


def rebound_of_poisson(e, vn, v):
    """Return the ratio of speeds: integral_0^v u / K(u) du = integral_0^w u / K(-u) du."""

    def stiffness(u):
        s = (u + vn) / (2.0 * vn)
        return e**2 + (1.0 - e**2) * s * s * (3.0 - 2.0 * s)

    # outside of the blend K is 1 or e^2
    came = quad(lambda u: u / stiffness(u), 0.0, vn, epsrel=1e-13)[0] + 0.5 * (v**2 - vn**2)
    blend = quad(lambda u: u / stiffness(-u), 0.0, vn, epsrel=1e-13)[0]
    return math.sqrt(vn**2 + 2.0 * e**2 * (came - blend)) / v


def rebound(folder, v, tol, **law):
    """Return the ratio of speeds of a sphere that hits a plane at v, without gravity.

    The energy account has to close on the way.
    """
    model = GROUND + sphere(0.2, v=(0, 0, -v)) + contact(**law)
    results = run_deck(folder, model, end_time=0.5 / v + 1.0, print_interval=0.1, tol=tol)
    kinds = [event["kind"] for event in results["events"]]
    assert kinds == ["touch", "leave"]
    lost = results["energy/dissipated"][-1] + results["energy/kinetic"][-1]
    assert lost == pytest.approx(0.5 * v * v, rel=5e-3 if tol > 1e-6 else 5e-6)
    return results["bodies/2/velocity/z"][-1] / v


@TOLERANCES
@pytest.mark.parametrize("speed", SPEEDS)
@pytest.mark.parametrize("restitution", [0.2, 0.5, 0.8, 0.95, 1.0])
def test_hunt_crossley_gives_the_restitution_at_its_speed(
    tmp_path, restitution, speed, tol, allowed
):
    law = {"cnf_type": "HUNT_CROSSLEY", "stiffness": 1e6, "ref_velocity": speed}
    found = rebound(tmp_path, speed, tol, restitution_coef=restitution, **law)
    assert found == pytest.approx(restitution, abs=allowed)


@TOLERANCES
@pytest.mark.parametrize("exponent", [1.0, 1.5, 2.0, 2.2])
@pytest.mark.parametrize("speed", SPEEDS)
def test_hunt_crossley_falls_with_speed_as_the_relation_says(
    tmp_path, speed, exponent, tol, allowed
):
    law = {"cnf_type": "HUNT_CROSSLEY", "stiffness": 1e6, "exponent": exponent, "damping": 0.7}
    found = rebound(tmp_path, speed, tol, **law)
    assert found == pytest.approx(rebound_of(0.7 * speed), abs=allowed)


@TOLERANCES
@pytest.mark.parametrize("speed", SPEEDS)
def test_hertz_with_restitution_is_hunt_crossley(tmp_path, speed, tol, allowed):
    law = {"cnf_type": "HERTZ", "stiffness": 1e7, "restitution_coef": 0.6, "ref_velocity": speed}
    assert rebound(tmp_path, speed, tol, **law) == pytest.approx(0.6, abs=allowed)


@TOLERANCES
@pytest.mark.parametrize("speed", SPEEDS)
@pytest.mark.parametrize("restitution", [0.05, 0.2, 0.5, 0.8, 0.95, 1.0])
def test_poisson_follows_its_exact_relation(tmp_path, restitution, speed, tol, allowed):
    law = {"cnf_type": "POISSON", "penalty": 1e5, "normal_trans_vel": 1e-2}
    found = rebound(tmp_path, speed, tol, restitution_coef=restitution, **law)
    assert found == pytest.approx(rebound_of_poisson(restitution, 1e-2, speed), abs=allowed)


def test_poisson_tends_to_its_coefficient_with_the_square_of_the_blend(tmp_path):
    law = {"cnf_type": "POISSON", "penalty": 1e5, "restitution_coef": 0.5}
    errors = [
        rebound(tmp_path, 1.0, 1e-10, normal_trans_vel=vn, **law) - 0.5 for vn in (0.1, 0.01, 1e-3)
    ]
    assert 80.0 < errors[0] / errors[1] < 120.0
    assert 80.0 < errors[1] / errors[2] < 120.0
    # the manual states this figure for the default of 1e-3 at 1 m/s
    assert errors[2] == pytest.approx(2.1e-7, rel=0.1)


def test_poisson_without_restitution_leaves_slower_than_the_blend(tmp_path):
    law = {"cnf_type": "POISSON", "penalty": 1e5, "restitution_coef": 0.0}
    model = GROUND + sphere(0.2, v=(0, 0, -1.0)) + contact(normal_trans_vel=1e-3, **law)
    results = run_deck(tmp_path, model, end_time=4.0)
    assert 0.0 < results["bodies/2/velocity/z"][-1] < 1e-3


def test_hertz_of_two_spheres_by_materials(tmp_path):
    # Chung & Ooi, test 1, limestone: two spheres of radius 0.01 at +-10
    volume = 4.0 / 3.0 * math.pi * 0.01**3
    ball = {"mass": 2500 * volume, "radius": 0.01}
    model = (
        '<Body_Rigid id="1" isground="TRUE"/>'
        + sphere(0.02, v=(0, 0, -10.0), **ball)
        + sphere(-0.02, v=(0, 0, 10.0), body=3, **ball)
        + contact(
            200,
            300,
            cnf_type="HERTZ",
            **{f"{side}_elastic_modulus": 2e10 for side in "ij"},
            **{f"{side}_poisson_ratio": 0.25 for side in "ij"},
        )
    )
    results = run_deck(tmp_path, model, end_time=3e-3, print_interval=1e-4, tol=1e-9)
    # E* = E / (2 (1 - nu^2)), R* = R / 2, effective mass m / 2, approach at 20
    E, R, m = 2e10 / (2 * (1 - 0.25**2)), 0.005, 0.5 * ball["mass"]
    deepest = (15 * m * 20.0**2 / (16 * E * math.sqrt(R))) ** 0.4
    assert deepest == pytest.approx(3.6830403e-4, rel=1e-7)
    assert results["contacts/301/peak_penetration"] == pytest.approx(deepest, rel=1e-6)
    assert results["contacts/301/peak_force"] == pytest.approx(7108.2413, rel=1e-6)
    touch, leave = results["events"]["time"]
    assert leave - touch == pytest.approx(2.9432751843 * deepest / 20.0, rel=1e-6)


def test_given_radii_count_before_those_of_the_graphics(tmp_path):
    law = {"cnf_type": "HERTZ", "i_elastic_modulus": 1e8, "i_poisson_ratio": 0.0}
    still = {"z": 0.1 - 1e-4, "v": (0, 0, 0)}
    forces = []
    for radii in ({}, {"i_radius": 0.4}, {"i_radius": 0.4, "j_radius": 0.4}):
        model = GROUND + sphere(**still) + contact(**law, **radii)
        results = run_deck(tmp_path, model, end_time=1e-4, print_interval=1e-4)
        forces.append(results["contacts/301/force/z"][0])
    exact = 4.0 / 3.0 * 1e8 * 1e-4**1.5 * np.sqrt([0.1, 0.4, 0.2])
    np.testing.assert_allclose(forces, exact, rtol=1e-10)


LAWS = {
    "HUNT_CROSSLEY": {"stiffness": 1e6, "restitution_coef": 0.5, "ref_velocity": 1.0},
    "HERTZ": {"stiffness": 1e6, "damping": 2.0},
    "POISSON": {"penalty": 1e5, "restitution_coef": 0.5},
}


@pytest.mark.parametrize("name", LAWS)
def test_energy_closes_and_the_sphere_comes_to_rest(tmp_path, name):
    model = (
        GROUND
        + sphere(0.3, v=(1.0, 0, 0))
        + contact(cnf_type=name, **LAWS[name], **COULOMB)
        + GRAVITY
    )
    for tol in (1e-5, 1e-8):
        results = run_deck(tmp_path, model, end_time=4.0, tol=tol)
        total = sum(results[f"energy/{kind}"] for kind in ("kinetic", "potential", "dissipated"))
        scale = results["energy/kinetic"].max()
        # some thousand steps of local error tol
        assert np.abs(total - total[0]).max() < 300 * tol * scale
        assert (np.diff(results["energy/dissipated"]) > -tol * scale).all()
    assert results["contacts/301/force/z"][-1] == pytest.approx(9.81, rel=1e-4)
    assert abs(results["bodies/2/velocity/z"][-1]) < 1e-6
