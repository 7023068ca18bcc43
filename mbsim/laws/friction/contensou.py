"""CONTENSOU: sliding and spinning on a round patch share one friction.

On a disc of radius R under uniform pressure, with v the slip of its middle, w the spin and
e = v/(R |w|),

    F = -mu_d N f(e) t,      M = -mu_d N R m(e) w/|w|

are integrals of sliding friction over the disc. With K(k), E(k) the complete elliptic integrals of
modulus k and D = (K - E)/k^2,

    e <= 1, k = e      f = 4/(3 pi) e (E + K - D)    m = 4/(9 pi) (4 E - 2 k^2 E - (1 - k^2) K)
    e >= 1, k = 1/e    f = 4/(3 pi) (E + K - D)      m = 4/(9 pi k) (4 E - 5 K + 2 D + 3 k^2 K)

f -> e, m -> 2/3 where it only spins, f -> 1 - 1/(8 e^2), m -> 1/(4 e) where it only slides. So
spin takes the sticking from sliding, and a spinning disc comes to rest in both at once. Where both
are slow the force is smoothed: what counts is sqrt(v^2 + (R w)^2) against `friction_trans_vel`. R
is `patch_radius`, or where that is 0 (not given) that of a disc with the area of contact.
Sources: R. I. Leine, C. Glocker, Eur. J. Mech. A/Solids 22 (2003) 193-216 for the coupling;
Z. Farkas, G. Bartels, T. Unger, D. E. Wolf, Phys. Rev. Lett. 90 (2003) 248302 for the integrals.
"""

from __future__ import annotations

import math

from mbsim.core.arrays import V2, V3, V5
from mbsim.core.jitable import jitable
from mbsim.laws.catalog import FrictionInput, Parameter, friction_law
from mbsim.laws.curves import tanh_ratio

#: Up to this modulus what cancels in m of a disc that mostly slides is left out.
_SLIDES = 0.02


@jitable
def elliptic(k: float) -> V3:
    """Return K, E and (K - E)/k^2 of modulus k, 0 <= k <= 1, by the arithmetic-geometric mean.

    At 1 - k < 1e-17 K counts as it is there; it has no weight then.
    """
    b = math.sqrt(max(1e-34, (1.0 - k) * (1.0 + k)))
    # c_1 / k^2, and the sum of 2^(n-1) c_n^2 / k^2
    part, total, weight = 0.5 / (1.0 + b), 0.5, 1.0
    a, b, c = 0.5 * (1.0 + b), math.sqrt(b), part * k * k
    for _ in range(12):
        total += weight * part * c
        if c <= 1e-9 * a:
            break
        part *= 0.25 * c / (0.5 * (a + b))
        a, b = 0.5 * (a + b), math.sqrt(a * b)
        weight *= 2.0
        c = part * k * k
    K = math.pi / (a + b)
    D = K * total
    return K, K - k * k * D, D


@jitable
def disc_friction(v: float, w: float) -> V2:
    """Return f/v and m/w for v = slip and w = |R spin|, not both 0, scaled by sqrt(v^2 + w^2)."""
    total = math.hypot(v, w)
    if v <= w:
        K, E, D = elliptic(v / w)
        k2 = (v / w) ** 2
        slide = 4.0 / (3.0 * math.pi) * (E + K - D) * total / w
        twist = 4.0 / (9.0 * math.pi) * (4.0 * E - 2.0 * k2 * E - (1.0 - k2) * K) * total / w
        return slide, twist
    k = w / v
    K, E, D = elliptic(k)
    k2 = k * k
    slide = 4.0 / (3.0 * math.pi) * (E + K - D) * total / v
    if k < _SLIDES:
        # m/k: terms of K, E and D up to k^6
        twist = 0.25 + k2 / 48.0 + 3.0 / 512.0 * k2 * k2
    else:
        twist = 4.0 / (9.0 * math.pi) * (4.0 * E - 5.0 * K + 2.0 * D + 3.0 * k2 * K) / k2
    return slide, twist * total / v


@friction_law(
    "CONTENSOU",
    "mu_dynamic",
    "friction_trans_vel",
    Parameter(
        "patch_radius",
        0.0,
        positive=True,
        about="radius of the disc of contact",
        unit="L",
        usual="of the area",
    ),
    of_area=True,
)
def contensou(
    inputs: FrictionInput, mu_dynamic: float, friction_trans_vel: float, patch_radius: float
) -> V5:
    """Return Fx, Fy, Mx, My, Tz on I."""
    R = patch_radius if patch_radius > 0.0 else inputs.radius
    v, turn = math.hypot(inputs.xdot[0], inputs.xdot[1]), R * inputs.xdot[2]
    total = math.hypot(v, turn)
    if total == 0.0:
        return 0.0, 0.0, 0.0, 0.0, 0.0
    slide, twist = disc_friction(v, abs(turn))
    pull = -mu_dynamic * inputs.nforce * tanh_ratio(total, friction_trans_vel)
    fx, fy = pull * slide * inputs.xdot[0], pull * slide * inputs.xdot[1]
    return fx, fy, 0.0, 0.0, pull * R * twist * turn
