"""POISSON: a linear spring that is softer on release, so that it gives back e^2 of the work.

    F = K(d') d      for depth d > 0,      K = STEP(d', -vn, e^2 p, +vn, p)

with the penalty p, the restitution coefficient e and vn = normal_trans_vel. A mass that touches
at v leaves at w with

    integral_0^v u / K(u) du = integral_0^w u / K(-u) du,

so w -> e v as vn / v -> 0, with an error of order (vn / v)^2 (and w < vn where e = 0).

Stored: the energy K(0) d^2 / 2 of the spring at rest, K(0) = (1 + e^2) p / 2. As K rises with d',
(K(d') - K(0)) d' is never negative: half of the loss counts on the way in, half on the way out,
and after a whole impact kinetic energy and loss add up to what came in.
Source: MotionSolve names the three attributes and not the formula; this one is mbsim's own. The
ratio of stiffnesses is that of O. R. Walton, R. L. Braun, J. Rheol. 30 (1986) 949-980.
"""

from __future__ import annotations

from mbsim.core.arrays import V3
from mbsim.core.blend import step
from mbsim.laws.catalog import normal_law


def poisson_constants(penalty: float, restitution_coef: float, normal_trans_vel: float) -> V3:
    """Return stiffness on compression, stiffness on release and the half width of the blend."""
    e = restitution_coef or 0.0
    return penalty, e * e * penalty, normal_trans_vel


@normal_law(
    "POISSON",
    *("penalty", "restitution_coef", "normal_trans_vel"),
    constants=poisson_constants,
)
def poisson(
    depth: float, depth_rate: float, penalty: float, release: float, normal_trans_vel: float
) -> V3:
    """Return force [F], force at rate 0 [F] and stored energy [F L].

    `depth` [L] > 0 is overlap, `depth_rate` [L/T] > 0 is closing; `penalty` and `release`
    [F/L], `normal_trans_vel` [L/T] > 0.
    """
    if depth <= 0.0:
        return 0.0, 0.0, 0.0
    stiffness = step(depth_rate, -normal_trans_vel, release, normal_trans_vel, penalty)
    elastic = 0.5 * (penalty + release) * depth
    return stiffness * depth, elastic, 0.5 * elastic * depth
