"""BROWN_MCPHEE: one smooth curve with a static peak at v_t and the dynamic value beyond.

    F = -N (mu_d tanh(4 v/v_t) + (mu_s - mu_d) (v/v_t) / ((v/2 v_t)^2 + 3/4)^2) t - c v t

The second part is 1 at v = v_t, its peak, so that F there is N (mu_s - mu_d + mu_d tanh 4).
It creeps in place of sticking.
Source: P. Brown, J. McPhee, J. Comput. Nonlinear Dynam. 11 (2016) 054502.
"""

from __future__ import annotations

import math

from mbsim.core.arrays import V5
from mbsim.laws.catalog import FrictionInput, Parameter, friction_law
from mbsim.laws.curves import against, tanh_ratio


@friction_law(
    "BROWN_MCPHEE",
    "mu_static",
    "mu_dynamic",
    "stiction_trans_vel",
    Parameter("viscous_coef", 0.0, about="force per slip speed, whatever N is", unit="F T/L"),
)
def brown_mcphee(
    inputs: FrictionInput,
    mu_static: float,
    mu_dynamic: float,
    stiction_trans_vel: float,
    viscous_coef: float,
) -> V5:
    """Return Fx, Fy, Mx, My, Tz on I."""
    speed = math.hypot(inputs.xdot[0], inputs.xdot[1])
    u = speed / stiction_trans_vel
    dynamic = mu_dynamic * tanh_ratio(speed, 0.25 * stiction_trans_vel)
    peak = (mu_static - mu_dynamic) / stiction_trans_vel / (0.25 * u * u + 0.75) ** 2
    viscous = viscous_coef if inputs.nforce > 0.0 else 0.0
    return against(inputs.xdot, inputs.nforce * (dynamic + peak) + viscous)
