"""Force_Element (ours): forces along and about axes of J by a user's residual.

What it exerts are unknowns of its own, which the residual makes 0; they, their slopes and what is
kept of a step are in `dynamics.forces.force_element` and `dynamics.linearization.element_slopes`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from mbsim.forces.catalog import USERS, Given, OfResidual, Parameter, Reading, force, marker

_ATTRIBUTES = (
    marker("i_marker_id"),
    marker("j_marker_id"),
    Parameter(
        "direction",
        None,
        words=("TX", "TY", "TZ", "RX", "RY", "RZ"),
        kind="words",
        about="along and about axes of J",
    ),
    USERS,
)


def _read(given: Given, values: dict[str, Any]) -> Mapping[str, Any] | None:
    user = given.subroutine("residual")
    if "direction" not in values:
        return None
    values["directions"] = values.pop("direction")
    return values | {"user": user}


force(
    "FORCEELEMENT",
    "Force_Element",
    "force_elements",
    form=OfResidual(),
    title="force element",
    table="force_elements",
    reading=Reading(_ATTRIBUTES, _read),
    about="forces between two markers by a residual of your own",
)
