"""STRIBECK: friction that falls from static to dynamic with speed, and a viscous part.

    F = -(N g(v) tanh(v/v_t) + c v) t,   g(v) = mu_d + (mu_s - mu_d) exp(-(v/v_s)^alpha)

It creeps below v_t in place of sticking. The falling branch feeds stick-slip.
Source: B. Armstrong-Helouvry et al., Automatica 30 (1994) 1083-1138.
"""

from __future__ import annotations

import math

from mbsim.core.arrays import V5
from mbsim.laws.catalog import FrictionInput, Parameter, friction_law
from mbsim.laws.curves import against, tanh_ratio
from mbsim.laws.curves import stribeck as falling


@friction_law(
    "STRIBECK",
    "mu_static",
    "mu_dynamic",
    "stiction_trans_vel",
    Parameter("stribeck_vel", positive=True, about="speed scale of the falling branch", unit="L/T"),
    Parameter("stribeck_exponent", 2.0, positive=True, about="exponent of the falling branch"),
    Parameter("viscous_coef", 0.0, about="force per slip speed, whatever N is", unit="F T/L"),
)
def stribeck(
    inputs: FrictionInput,
    mu_static: float,
    mu_dynamic: float,
    stiction_trans_vel: float,
    stribeck_vel: float,
    stribeck_exponent: float,
    viscous_coef: float,
) -> V5:
    """Return Fx, Fy, Mx, My, Tz on I."""
    speed = math.hypot(inputs.xdot[0], inputs.xdot[1])
    mu = falling(speed, mu_static, mu_dynamic, stribeck_vel, stribeck_exponent)
    pull = inputs.nforce * mu * tanh_ratio(speed, stiction_trans_vel)
    return against(inputs.xdot, pull + (viscous_coef if inputs.nforce > 0.0 else 0.0))
