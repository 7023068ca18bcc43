"""COULOMB_ON and COULOMB_DYNAMICONLY: Coulomb friction smoothed by STEP.

With slip speed v, transition velocities vs <= vd and u = v/vs:

    mu(v) = mu_s u (3 - u^2) / 2            v <= vs    (STEP from -vs to vs)
    mu(v) = STEP(v, vs, mu_s, vd, mu_d)     vs < v < vd
    mu(v) = mu_d                            v >= vd

and F = -mu(v) N t, t the direction of slip. Below vs the ratio mu/v is a polynomial,
so nothing is divided by v and the limit at v = 0 is 1.5 mu_s / vs.
Source: Altair MotionSolve Reference Guide, Force_Contact and CFFSUB.
This law never sticks: under a load f < mu_s N it creeps at mu(v) = f / N.
"""

from __future__ import annotations

import math

from mbsim.core.arrays import V5
from mbsim.core.blend import step
from mbsim.core.jitable import jitable
from mbsim.laws.catalog import FrictionInput, friction_law


@jitable
def _ramp_ratio(speed: float, mu: float, transition: float) -> float:
    """Return mu(v)/v [T/L] on the first branch, v <= transition."""
    u = speed / transition
    return 0.5 * mu * (3.0 - u * u) / transition


@jitable
def _against_slip(inputs: FrictionInput, ratio: float) -> V5:
    """Return the force against slip with |F| = ratio |v| N, no torque."""
    pull = -ratio * inputs.nforce
    return (pull * inputs.xdot[0], pull * inputs.xdot[1], 0.0, 0.0, 0.0)


@friction_law("COULOMB_ON", "mu_static", "mu_dynamic", "stiction_trans_vel", "friction_trans_vel")
def coulomb_on(
    inputs: FrictionInput,
    mu_static: float,
    mu_dynamic: float,
    stiction_trans_vel: float,
    friction_trans_vel: float,
) -> V5:
    """Return Fx, Fy, Mx, My, Tz on I: static peak at vs, dynamic value from vd on."""
    speed = math.hypot(inputs.xdot[0], inputs.xdot[1])
    if speed <= stiction_trans_vel:
        ratio = _ramp_ratio(speed, mu_static, stiction_trans_vel)
    elif speed < friction_trans_vel:
        ratio = step(speed, stiction_trans_vel, mu_static, friction_trans_vel, mu_dynamic) / speed
    else:
        ratio = mu_dynamic / speed
    return _against_slip(inputs, ratio)


@friction_law("COULOMB_DYNAMICONLY", "mu_dynamic", "friction_trans_vel")
def coulomb_dynamic_only(inputs: FrictionInput, mu_dynamic: float, friction_trans_vel: float) -> V5:
    """Return Fx, Fy, Mx, My, Tz on I: one ramp from 0 to mu_dynamic at vd."""
    speed = math.hypot(inputs.xdot[0], inputs.xdot[1])
    if speed <= friction_trans_vel:
        ratio = _ramp_ratio(speed, mu_dynamic, friction_trans_vel)
    else:
        ratio = mu_dynamic / speed
    return _against_slip(inputs, ratio)
