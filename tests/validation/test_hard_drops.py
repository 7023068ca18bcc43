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
