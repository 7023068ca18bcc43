"""Elastic and damped drops on hard ground: what an impact keeps of the energy, by every method.

Stiffness, mass, height and exponent are drawn at random, by a seed. What is kept is looked at in
flight and within the contact, whose energy counts as potential.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from decks_io import COULOMB, GRAVITY, GROUND, contact, run_deck, sphere

METHODS = ("RADAU5", "GALPHA", "AUTO")
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
    height, bounces = 10.0 ** rng.uniform(-1.3, 0.5), int(rng.integers(1, 5))
    exponent = float(rng.choice([1.0, 1.5, 1.5, 2.0]))
    given = {"stiffness": k, "exponent": exponent, "damping": 0.0} if law is None else law(k)
    model = GROUND + GRAVITY + sphere(0.1 + height, mass=m, **moving) + contact(**given) + more
    end = float(np.sqrt(2.0 * height / 9.81) * (2 * bounces + 0.6))
    results = run_deck(folder, model, end, end / 200.0, integrator=method, tol=tol)
    kept = results["energy/kinetic"] + results["energy/potential"] + results["energy/dissipated"]
    return float(np.abs(kept - kept[0]).max() / (m * 9.81 * height * tol))


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("tol", [1e-3, 1e-4, 1e-5, 1e-6, 1e-7])
def test_a_hard_impact_keeps_energy(tmp_path, method, tol):
    """RADAU5 gained 1e5 times the energy: a linearisation in touch solved for flight."""
    rng = np.random.default_rng(1)
    assert max(drop(tmp_path, method, tol, rng) for _ in range(15)) < 30.0


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


def rebound(k, c, m, v):
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
        error = abs(results["bodies/2/velocity"][-1, 2] / rebound(k, c, m, v) - 1.0)
        assert error < 30.0 * tol, (k, c, m, v)
