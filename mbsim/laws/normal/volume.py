"""VOLUME: two elastic layers in series, pressed by the volume in which the shapes overlap.

    F = (K/h) V max(0, 1 + a d')
    K = (1 - nu) E / ((1 + nu) (1 - 2 nu)),   1/(K/h) = h_i/K_i + h_j/K_j

K is the modulus of a layer that is bonded to a rigid body and cannot widen, h its depth, so K/h is
the stiffness of a unit of area; a side without a modulus is rigid. V is the volume of the overlap
with a plane; else it is |G|, the slope of the potential U of the patch's field
(`contact_depth="FIELD"`, `geometry.mesh.field`). The stored energy is (K/h) U. The law is asked
with the depth d = 2 U/|G| for a unit of the weight |G|/d. An exponent e other than 1 takes
(K/h) h (d/h)^e, h = h_i + h_j of the elastic sides: no exact slope of its energy where the patch's
shape changes with the depth. `damping` is a [T/L], as of HUNT_CROSSLEY.

Source: K. L. Johnson, Contact Mechanics, Cambridge 1985, section 4.3 (elastic foundation), with
the constrained modulus of its section 5.8.
"""

from __future__ import annotations

from mbsim.core.arrays import V3
from mbsim.laws.catalog import normal_law
from mbsim.laws.restitution import hunt_crossley
from mbsim.laws.spring import power_spring


def constrained_modulus(elastic_modulus: float, poisson_ratio: float) -> float:
    """Return K [F/L^2] of a layer that is pressed and cannot widen."""
    nu = poisson_ratio
    return (1.0 - nu) * elastic_modulus / ((1.0 + nu) * (1.0 - 2.0 * nu))


def layers_stiffness(
    i_elastic_modulus: float | None,
    j_elastic_modulus: float | None,
    i_poisson_ratio: float | None,
    j_poisson_ratio: float | None,
    i_layer_depth: float | None,
    j_layer_depth: float | None,
    exponent: float,
) -> float:
    """Return k [F/L^(2 + e)] of the force a unit of area k d^e; a side without modulus is rigid."""
    compliance, depth = 0.0, 0.0
    for modulus, ratio, layer in (
        (i_elastic_modulus, i_poisson_ratio, i_layer_depth),
        (j_elastic_modulus, j_poisson_ratio, j_layer_depth),
    ):
        if modulus is not None and layer is not None:
            # the one modulus that MotionSolve has of a layer is its own
            compliance += layer / constrained_modulus(modulus, ratio or 0.0)
            depth += layer
    stiffness: float = depth ** (1.0 - exponent) / compliance
    return stiffness


def volume_constants(
    i_elastic_modulus: float | None,
    j_elastic_modulus: float | None,
    i_poisson_ratio: float | None,
    j_poisson_ratio: float | None,
    i_layer_depth: float | None,
    j_layer_depth: float | None,
    exponent: float,
    damping: float,
) -> V3:
    """Return stiffness of a unit of area, exponent and dissipation."""
    stiffness = layers_stiffness(
        i_elastic_modulus,
        j_elastic_modulus,
        i_poisson_ratio,
        j_poisson_ratio,
        i_layer_depth,
        j_layer_depth,
        exponent,
    )
    return stiffness, exponent, damping


@normal_law(
    "VOLUME",
    *("i_elastic_modulus", "j_elastic_modulus", "i_poisson_ratio", "j_poisson_ratio"),
    *("i_layer_depth", "j_layer_depth", "exponent", "damping"),
    constants=volume_constants,
    of_shapes=True,
)
def volume(
    depth: float, depth_rate: float, stiffness: float, exponent: float, dissipation: float
) -> V3:
    """Return force [F/L^2], force at rate 0 [F/L^2] and stored energy [F/L], of a unit of weight.

    `depth` [L] > 0 is overlap, `depth_rate` [L/T] > 0 is closing; `stiffness` [F/L^(2 + e)],
    `exponent` [-], `dissipation` [T/L].
    """
    if depth <= 0.0:
        return 0.0, 0.0, 0.0
    spring, energy = power_spring(depth, stiffness, exponent)
    return hunt_crossley(spring, depth_rate, dissipation), spring, energy
