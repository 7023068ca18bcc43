"""COULOMB_ROLLING: COULOMB_ON, and a torque against rolling.

    M = -r_r N STEP(w, 0, 0, w_t, 1) w/|w|     w the relative angular velocity in the contact plane

r_r is `rolling_arm` [L], the lever arm of the normal force (a coefficient of rolling friction times
the radius), w_t `rolling_trans_vel` [rad/T]. Like COULOMB_ON it creeps in place of holding. It acts
on rolling only, not on spin about the normal.
Source: the lever arm is textbook mechanics; smoothing as in COULOMB_ON.
"""

from __future__ import annotations

import math

from mbsim.core.arrays import V5
from mbsim.laws.catalog import FrictionInput, Parameter, friction_law
from mbsim.laws.friction.coulomb import coulomb_on


@friction_law(
    "COULOMB_ROLLING",
    "mu_static",
    "mu_dynamic",
    "stiction_trans_vel",
    "friction_trans_vel",
    Parameter("rolling_arm", positive=True, about="lever arm of N that resists rolling", unit="L"),
    Parameter(
        "rolling_trans_vel",
        1e-2,
        positive=True,
        about="rolling speed from which the torque is whole",
        unit="rad/T",
    ),
)
def coulomb_rolling(
    inputs: FrictionInput,
    mu_static: float,
    mu_dynamic: float,
    stiction_trans_vel: float,
    friction_trans_vel: float,
    rolling_arm: float,
    rolling_trans_vel: float,
) -> V5:
    """Return Fx, Fy, Mx, My, Tz on I."""
    fx, fy, _, _, _ = coulomb_on(
        inputs, mu_static, mu_dynamic, stiction_trans_vel, friction_trans_vel
    )
    w = inputs.rolling
    speed = math.hypot(w[0], w[1])
    u = speed / rolling_trans_vel
    # STEP over w is u^2 (3 - 2u): its ratio to w needs no division by w
    ratio = u * (3.0 - 2.0 * u) / rolling_trans_vel if u < 1.0 else 1.0 / speed
    pull = -rolling_arm * inputs.nforce * ratio
    return fx, fy, pull * w[0], pull * w[1], 0.0
