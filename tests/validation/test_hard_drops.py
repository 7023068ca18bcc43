"""Elastic and damped drops on hard ground: what an impact keeps of the energy, by every method.

Stiffness, mass, height and exponent are drawn at random, by a seed. What is kept is looked at in
flight and within the contact, whose energy counts as potential. What damping takes is compared with
an integration of its own of each contact.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from helpers.decks import COULOMB, GRAVITY, GROUND, contact, run_deck, sphere

METHODS = ("RADAU5", "GALPHA", "AUTO")
TOLERANCES = (1e-3, 1e-4, 1e-5, 1e-6, 1e-7)
#: A body on a bushing so stiff and damped that AUTO changes over to its implicit method.
BUSHING = """
<Reference_Marker id="30" body_id="3" pos_x="1.0"/>
<Body_Rigid id="3" cg_id="30" mass="1" inertia_xx="0.1" inertia_yy="0.1" inertia_zz="0.1"/>
<Reference_Marker id="31" body_id="1" pos_x="1.0" pos_z="0.01"/>
<Force_Bushing id="1" i_marker_id="30" j_marker_id="31" kx="1e4" ky="1e4" kz="1e4"
  cx="1e5" cy="1e5" cz="1e5" ktx="10" kty="10" ktz="10" ctx="1e3" cty="1e3" ctz="1e3"/>
"""


def drop(folder, method, tol, rng, law=None, more="", **moving):
    """Drop a sphere; return the largest error of its energy over m g h and tol."""
    k, m = 10.0 ** rng.uniform(8, 15), 10.0 ** rng.uniform(-3, 3)
    height, bounces = 10.0 ** rng.uniform(-2.0, 1.0), int(rng.integers(1, 5))
    exponent = float(rng.choice([1.0, 1.5, 1.5, 2.0]))
    given = {"stiffness": k, "exponent": exponent, "damping": 0.0} if law is None else law(k)
    model = GROUND + GRAVITY + sphere(0.1 + height, mass=m, **moving) + contact(**given) + more
    end = float(np.sqrt(2.0 * height / 9.81) * (2 * bounces + 0.6))
    results = run_deck(folder, model, end, end / 200.0, integrator=method, tol=tol)
    kept = results["energy/kinetic"] + results["energy/potential"] + results["energy/dissipated"]
    return float(np.abs(kept - kept[0]).max() / (m * 9.81 * height * tol))


def rebound(k, m, speed, damping, dmax):
    """Return how fast a sphere leaves an IMPACT, e = 1.5, under gravity, and after which time."""
    depth = (1.25 * m * speed**2 / k) ** 0.4
    time = depth / speed

    def moves(t, z):
        d, part = max(z[0], 0.0) * depth, min(1.0, max(z[0], 0.0) * depth / dmax)
        force = k * d**1.5 + part * part * (3.0 - 2.0 * part) * damping * z[1] * speed
        return [z[1], (9.81 - max(0.0, force) / m) * time / speed]

    def leaves(t, z):
        return z[0]

    leaves.terminal, leaves.direction = True, -1
    # short enough that the ends of the damper's ramp are not stepped over
    by = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-14, "events": leaves, "max_step": 0.05}
    found = solve_ivp(moves, (0.0, 1e4), [0.0, 1.0], **by)
    assert found.status == 1
    return -found.y[1, -1] * speed, found.t[-1] * time


def damped_drop(folder, method, tol, rng):
    """Drop a sphere that is damped; return the error of its energy in flight as `drop` does."""
    k, m = 10.0 ** rng.uniform(8, 15), 10.0 ** rng.uniform(-3, 3)
    height = 10.0 ** rng.uniform(-2.0, 1.0)
    # a part of what is critical, over a depth that is reached or not
    part, over = 10.0 ** rng.uniform(-2.5, -0.5), 10.0 ** rng.uniform(-2.0, 0.5)
    return damped(folder, method, tol, k, m, height, part, over)


def damped(folder, method, tol, k, m, height, part, over):
    """Return the error of a drop with this part of critical damping, dmax over the depth."""
    speed = np.sqrt(2.0 * 9.81 * height)
    depth = (1.25 * m * speed**2 / k) ** 0.4
    law = {"damping": 2.0 * part * np.sqrt(k * np.sqrt(depth) * m), "dmax": depth * over}
    flights, touches = [speed], [speed / 9.81]
    begins = [0.0]
    for _ in range(2):
        after, time = rebound(k, m, flights[-1], **law)
        begins.append(touches[-1] + time)
        flights.append(after)
        touches.append(begins[-1] + 2.0 * after / 9.81)
    model = GROUND + GRAVITY + sphere(0.1 + height, mass=m)
    model += contact(stiffness=k, exponent=1.5, **law)
    end = touches[-1] - 0.1 * (touches[-1] - begins[-1])
    results = run_deck(folder, model, end, end / 200.0, integrator=method, tol=tol)
    time, worst = results["time"], 0.0
    kept = results["energy/kinetic"] + results["energy/potential"] - m * 9.81 * 0.1
    for flown, begin, touch in zip(flights, begins, touches, strict=True):
        # not where it may still touch, or touch again
        near = 0.05 * (touch - begin)
        flies = (time >= begin + near) & (time <= touch - near)
        if flies.any():
            worst = max(worst, np.abs(kept[flies] - 0.5 * m * flown**2).max())
    return float(worst / (m * 9.81 * height * tol))


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("tol", TOLERANCES)
def test_a_hard_impact_keeps_energy(tmp_path, method, tol):
    """RADAU5 gained 1e5 times the energy: a linearisation in touch solved for flight."""
    rng = np.random.default_rng(1)
    assert max(drop(tmp_path, method, tol, rng) for _ in range(15)) < 30.0


@pytest.mark.slow
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("tol", TOLERANCES)
def test_two_hundred_impacts_keep_energy(tmp_path, method, tol):
    """GALPHA lost 300 tol where an impact was slow beside what its scene's size makes usual."""
    rng = np.random.default_rng(11)
    assert max(drop(tmp_path, method, tol, rng) for _ in range(200)) < 30.0


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("tol", [1e-4, 1e-7])
def test_what_damping_takes(tmp_path, method, tol):
    rng = np.random.default_rng(5)
    assert max(damped_drop(tmp_path, method, tol, rng) for _ in range(10)) < 30.0


def test_the_end_of_a_dampers_ramp_is_the_end_of_a_step(tmp_path):
    """Steps across it were taken where their error estimate vanished by chance: up to 130 tol."""
    for over in np.geomspace(0.03, 0.6, 24):
        assert damped(tmp_path, "AUTO", 1e-7, 1.4e11, 0.3, 0.012, 0.1, over) < 10.0, over


@pytest.mark.slow
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("tol", TOLERANCES)
def test_what_damping_takes_of_a_hundred(tmp_path, method, tol):
    rng = np.random.default_rng(6)
    assert max(damped_drop(tmp_path, method, tol, rng) for _ in range(100)) < 30.0


@pytest.mark.parametrize("method", METHODS)
def test_and_beside_a_stiff_bushing(tmp_path, method):
    """AUTO then runs its implicit method, whose energy is as good."""
    rng = np.random.default_rng(2)
    assert max(drop(tmp_path, method, 1e-5, rng, more=BUSHING) for _ in range(4)) < 30.0


@pytest.mark.parametrize("method", ["RADAU5", "GALPHA"])
@pytest.mark.parametrize("law", ["HUNT_CROSSLEY", "POISSON"])
def test_and_with_restitution(tmp_path, method, law):
    def given(k):
        stiff = "stiffness" if law == "HUNT_CROSSLEY" else "penalty"
        given = {"cnf_type": law, stiff: min(k, 1e11), "restitution_coef": 0.9}
        return given | ({"ref_velocity": 1.0} if law == "HUNT_CROSSLEY" else {})

    rng = np.random.default_rng(3)
    assert max(drop(tmp_path, method, 1e-4, rng, given) for _ in range(6)) < 30.0


@pytest.mark.parametrize("method", ["RADAU5", "GALPHA"])
def test_and_with_spin_and_friction(tmp_path, method):
    def given(k):
        return {"stiffness": k, "exponent": 1.5, "damping": 0.0} | COULOMB

    rng, moving = np.random.default_rng(4), {"v": (0.5, 0.3, 0.0), "w": (5.0, -3.0, 8.0)}
    assert max(drop(tmp_path, method, 1e-4, rng, given, **moving) for _ in range(4)) < 30.0


def linear_rebound(k, c, m, v):
    """Return at which speed a linear spring beside a damper throws back what comes at speed v.

    d = v/w e^(-b t) sin(w t) until k d + c d' = 0, b = c/(2 m), w^2 = k/m - b^2.
    """
    b = c / (2.0 * m)
    w = np.sqrt(k / m - b * b)
    t = (np.pi - np.arctan2(c * w, k - c * b)) / w
    return v * np.exp(-b * t) * (b / w * np.sin(w * t) - np.cos(w * t))


@pytest.mark.parametrize("method", ["DOPRI5", "DOP853", *METHODS])
@pytest.mark.parametrize("tol", [1e-5, 1e-7, 1e-9])
def test_a_damper_that_comes_in_at_once(tmp_path, method, tol):
    """Its force jumps at the touch, of which error estimates saw a 74th: 90 tol, whatever tol."""
    rng = np.random.default_rng(5)
    for _ in range(3):
        k, m, v = 10.0 ** rng.uniform(6, 11), 10.0 ** rng.uniform(-2, 2), 10.0 ** rng.uniform(-1, 1)
        c = 10.0 ** rng.uniform(-3, -0.3) * np.sqrt(k * m)
        law = contact(stiffness=k, exponent=1.0, damping=c, dmax=1e-13)
        model = GROUND + sphere(0.1 + 0.1 * v, mass=m, v=(0, 0, -v)) + law
        results = run_deck(tmp_path, model, 0.2, 0.1, integrator=method, tol=tol)
        error = abs(results["bodies/2/velocity"][-1, 2] / linear_rebound(k, c, m, v) - 1.0)
        assert error < 30.0 * tol, (k, c, m, v)
