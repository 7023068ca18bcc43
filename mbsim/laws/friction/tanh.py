"""TANH: F = -mu_d N tanh(v/v_t) t, smooth everywhere, with one coefficient.

It creeps in place of sticking: under a load f < mu_d N at v_t artanh(f / (mu_d N)).
Source: E. Pennestri et al., Review and comparison of dry friction force models, Nonlinear
Dynamics 83 (2016) 1785-1801.
"""

from __future__ import annotations

import math

from mbsim.core.arrays import V5
from mbsim.core.jitable import jitable
from mbsim.laws.catalog import FrictionInput, friction_law
from mbsim.laws.curves import against, tanh_ratio


@jitable
def _ratio(speed: float, mu_dynamic: float, friction_trans_vel: float) -> float:
    return mu_dynamic * tanh_ratio(speed, friction_trans_vel)


@friction_law("TANH", "mu_dynamic", "friction_trans_vel")
def tanh(inputs: FrictionInput, mu_dynamic: float, friction_trans_vel: float) -> V5:
    """Return Fx, Fy, Mx, My, Tz on I."""
    speed = math.hypot(inputs.xdot[0], inputs.xdot[1])
    return against(inputs.xdot, inputs.nforce * _ratio(speed, mu_dynamic, friction_trans_vel))
