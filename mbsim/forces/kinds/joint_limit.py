"""Force_JointLimit (ours): a normal law pushes a joint's displacement back between two bounds.

`direction` T: x [L] is how far I is along J's z; R: the angle about it [rad], whole turns counted,
the law's force being a torque and its depth an angle. With N(d, d') the law,

    F = N(lower - x, -x')  below,    F = -N(x - upper, x')  above,

stored and lost as the law says. The sides of its switches: between the bounds, below, above, and
with the law's force 0 there or not.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from mbsim.arrays.codes import AXIS_FORCE, AXIS_TORQUE
from mbsim.core.arrays import V3
from mbsim.core.jitable import jitable
from mbsim.forces.catalog import Acts, Switched, Values, force
from mbsim.forces.formula import Kept, ask


def _acts(values: Values) -> Acts:
    turns = values["direction"] == "R"
    return Acts(AXIS_TORQUE, turns=True) if turns else Acts(AXIS_FORCE)


def _constants(values: Values) -> Sequence[float]:
    """Return lower and upper bound."""
    lower, upper = values["lower"], values["upper"]
    return -math.inf if lower is None else lower, math.inf if upper is None else upper


@jitable
def _pushed_back(x: float, rate: float, par: Sequence[float], law: Any) -> V3:
    """Return F, stored energy and lost power."""
    side, depth, closing = 1.0, par[0] - x, -rate
    if x - par[1] > depth:
        side, depth, closing = -1.0, x - par[1], rate
    # a displacement that is no number is passed on
    if depth <= 0.0:
        return 0.0, 0.0, 0.0
    force, elastic, stored = ask(law, depth, closing)
    return side * force, stored, (force - elastic) * closing


def _force(x: float, rate: float, par: Sequence[float], kept: Kept, law: Any) -> V3:
    return _pushed_back(x, rate, par, law)


def _side(x: float, rate: float, par: Sequence[float], kept: Kept, law: Any) -> float:
    if par[0] <= x <= par[1]:
        return 0.0
    size, _, _ = _pushed_back(x, rate, par, law)
    return (1.0 if x < par[0] else 2.0) + (2.0 if size != 0.0 else 0.0)


force(
    "JOINTLIMIT",
    "Force_JointLimit",
    "joint_limits",
    form=Switched(_acts, _constants, _force, _side, law="cnf_type"),
    title="joint limit",
    table="joint_limits",
    changes="lower upper stiffness exponent damping dmax penalty restitution_coef ref_velocity "
    "normal_trans_vel",
)
