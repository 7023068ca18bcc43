"""Force_Scalar_TwoBody, Adams' SFORCE: an expression along the line of two markers, or about z.

`type` TRANSLATIONAL: a positive force pushes I and J apart; ROTATIONAL: a positive torque acts on
I about J's z. `action_only`: nothing acts on J, and the line (or axis) is J's z.
"""

from __future__ import annotations

from mbsim.arrays.codes import AXIS_FORCE, AXIS_TORQUE, LINE_FORCE
from mbsim.forces.catalog import Acts, Adams, Expressed, Values, force


def _acts(values: Values) -> Acts:
    along = AXIS_FORCE if values["action_only"] else LINE_FORCE
    return Acts(AXIS_TORQUE if values["type"] == "ROTATIONAL" else along)


def _alone(values: Values) -> bool:
    alone: bool = values["action_only"]
    return alone


force(
    "SFORCE",
    "Force_Scalar_TwoBody",
    "scalar_forces",
    form=Expressed(_acts, _alone),
    title="scalar force",
    functions="SFORCE",
    adams=Adams("SFORCE"),
    table="scalar_forces",
    changes="expr",
)
