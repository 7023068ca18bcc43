"""Force_Scalar_TwoBody, Adams' SFORCE: an expression along the line of two markers, or about z.

`type` TRANSLATIONAL: a positive force pushes I and J apart; ROTATIONAL: a positive torque acts on
I about J's z. `action_only`: nothing acts on J, and the line (or axis) is J's z.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from mbsim.arrays.codes import AXIS_FORCE, AXIS_TORQUE, LINE_FORCE
from mbsim.forces.catalog import (
    USERS,
    Acts,
    Adams,
    Expressed,
    Given,
    Parameter,
    Reading,
    Values,
    force,
    marker,
)


def _acts(values: Values) -> Acts:
    along = AXIS_FORCE if values["action_only"] else LINE_FORCE
    return Acts(AXIS_TORQUE if values["type"] == "ROTATIONAL" else along)


def _alone(values: Values) -> bool:
    alone: bool = values["action_only"]
    return alone


_ATTRIBUTES = (
    Parameter(
        "type",
        None,
        words=("TRANSLATIONAL", "ROTATIONAL"),
        others={"TRANSLATIONAL": "FORCE FORCE_ONLY", "ROTATIONAL": "TORQUE TORQUE_ONLY"},
        about="force along I-J, torque about J's z",
    ),
    marker("i_marker_id"),
    marker("j_marker_id"),
    Parameter(
        "expr",
        kind="expression",
        optional=True,
        alias="val_expression val",
        about="the force, > 0 pushes apart; or the torque on I",
        unit="F or F L",
    ),
    USERS,
    # Adams' ACTIONONLY
    Parameter(
        "action_only",
        kind="flag",
        optional=True,
        alias="is_action_only",
        about="nothing acts on J",
        shown="FALSE",
    ),
)


def _read(given: Given, values: dict[str, Any]) -> Mapping[str, Any] | None:
    user = given.subroutine("SFOSUB") if given.by_user() else None
    if user is not None:
        values["expr"] = given.result(user)
    return values | {"user": user} if {"type", "expr"} <= set(values) else None


force(
    "SFORCE",
    "Force_Scalar_TwoBody",
    "scalar_forces",
    form=Expressed(_acts, _alone),
    title="scalar force",
    functions="SFORCE",
    adams=Adams("SFORCE"),
    table="scalar_forces",
    reading=Reading(_ATTRIBUTES, _read),
    changes="expr",
    about="a force along a line or a torque, by an expression",
)
