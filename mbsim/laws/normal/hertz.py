"""HERTZ: two elastic solids that are round where they touch, with the damper of HUNT_CROSSLEY.

    F = k d^1.5 max(0, 1 + a d')      for depth d > 0
    k = 4/3 E* sqrt(R*),   1/E* = (1 - nu_i^2)/E_i + (1 - nu_j^2)/E_j,   1/R* = 1/R_i + 1/R_j

Stored: the spring's k d^2.5 / 2.5. With a = 0 the contact is elastic; a mass m at speed v then
goes dmax = (15 m v^2 / (16 E* sqrt(R*)))^(2/5) deep and stays 2.9432751843 dmax / v.
Source: K. L. Johnson, Contact Mechanics, Cambridge 1985, sections 4.2 and 11.4; a: see
`laws/restitution.py`.
"""

from __future__ import annotations

import math
from typing import Any

from mbsim.core.arrays import V2, V3
from mbsim.laws.catalog import normal_law
from mbsim.laws.restitution import dissipation_of, hunt_crossley
from mbsim.laws.spring import power_spring


def hertz_stiffness(
    i_elastic_modulus: float,
    j_elastic_modulus: float,
    i_poisson_ratio: float,
    j_poisson_ratio: float,
    i_radius: float,
    j_radius: float,
) -> float:
    """Return k [F/L^1.5] of moduli [F/L^2] and radii [L]; no modulus is rigid, inf is flat."""
    compliance = 0.0
    if i_elastic_modulus is not None:
        compliance += (1.0 - i_poisson_ratio**2) / i_elastic_modulus
    if j_elastic_modulus is not None:
        compliance += (1.0 - j_poisson_ratio**2) / j_elastic_modulus
    curvature = 1.0 / i_radius + 1.0 / j_radius
    return 4.0 / 3.0 / compliance / math.sqrt(curvature)


def hertz_constants(stiffness: float, *attributes: Any) -> V2:
    """Return stiffness k, given or of the materials, and dissipation a, given or by a rebound."""
    *materials, damping, restitution_coef, ref_velocity = attributes
    if materials[0] is not None or materials[1] is not None:
        stiffness = hertz_stiffness(*materials)
    return stiffness, dissipation_of(damping, restitution_coef, ref_velocity)


@normal_law(
    "HERTZ",
    *("stiffness", "i_elastic_modulus", "j_elastic_modulus", "i_poisson_ratio", "j_poisson_ratio"),
    *("i_radius", "j_radius", "damping", "restitution_coef", "ref_velocity"),
    constants=hertz_constants,
    of_shapes=True,
)
def hertz(depth: float, depth_rate: float, stiffness: float, dissipation: float) -> V3:
    """Return force [F], force at rate 0 [F] and stored energy [F L].

    `depth` [L] > 0 is overlap, `depth_rate` [L/T] > 0 is closing; `stiffness` [F/L^1.5],
    `dissipation` [T/L].
    """
    if depth <= 0.0:
        return 0.0, 0.0, 0.0
    spring, energy = power_spring(depth, stiffness, 1.5)
    return hunt_crossley(spring, depth_rate, dissipation), spring, energy
