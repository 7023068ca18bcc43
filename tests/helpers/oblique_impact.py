"""Oblique impact of a sphere: Chung & Ooi, test 4.

Alumina, radius 2.5 mm, at 3.9 m/s on a plane, mu 0.092, restitution 0.98. Angles are measured from
the normal. Table: Y. C. Chung, J. Y. Ooi, Granular Matter 13 (2011) 643-656.
"""

from __future__ import annotations

import math

import pytest

from helpers.decks import GROUND, run_deck, sphere

RADIUS, SPEED, MU, E = 0.0025, 3.9, 0.092, 0.98
MASS = 4000 * 4 / 3 * math.pi * RADIUS**3
TABLE = {
    **{5.17: 0.9481, 10.16: 0.6870, 14.99: 0.6244, 20.06: 0.6161, 25.05: 0.6343, 30.12: 0.6837},
    **{35.03: 0.7372, 40.02: 0.7809, 50.0: 0.8451, 59.98: 0.8929, 69.96: 0.9316, 80.02: 0.9662},
    85.01: 0.9827,
}


def rebound(folder, angle, law):
    """Return tangential velocity, over that before, and spin after an impact at an angle."""
    along, down = SPEED * math.sin(math.radians(angle)), SPEED * math.cos(math.radians(angle))
    model = (
        GROUND
        + sphere(RADIUS + 1e-7, mass=MASS, radius=RADIUS, v=(along, 0.0, -down))
        + f"""
<Force_Contact id="301" num_i_graphics="1" i_graphics_id="200" num_j_graphics="1"
  j_graphics_id="100" cnf_type="HERTZ" i_elastic_modulus="3.8e11" i_poisson_ratio="0.23"
  restitution_coef="{E}" ref_velocity="{down!r}" cff_type="STICTION" mu_static="{MU}"
  mu_dynamic="{MU}" poisson_ratio="0.23" {law}/>"""
    )
    results = run_deck(folder, model, 6e-5, 1e-6)
    v, w = results["bodies/2/velocity"][-1], results["bodies/2/angular_velocity"][-1]
    assert v[2] == pytest.approx(E * down, rel=1e-3)
    return v[0] / along, w[1]
