"""VISCOUS: friction in proportion to slip and normal force, F = -c N v; a block: v0 exp(-c g t).

Template of a friction law: copy it into mbsim/laws/friction/, change name, formula and parameters,
and cite the formula's source here. `laws.catalog` says what a law may look at and return.
"""

from __future__ import annotations

from mbsim.core.arrays import V5
from mbsim.laws.catalog import FrictionInput, Parameter, friction_law


# a name of Force_Contact's own (`"mu_dynamic"`) stands for its attribute, a Parameter is a new one
@friction_law("VISCOUS", Parameter("slip_coef", None, about="force over slip and N", unit="T/L"))
def viscous(inputs: FrictionInput, slip_coef: float) -> V5:
    """Return Fx, Fy, Mx, My, Tz on I; `slip_coef` [T/L]."""
    pull = -slip_coef * inputs.nforce
    return pull * inputs.xdot[0], pull * inputs.xdot[1], 0.0, 0.0, 0.0
