"""Force_Vector_TwoBody, Adams' VFORCE, VTORQUE and GFORCE, and Force_Vector_OneBody.

Six expressions are force and torque on I along the axes of the reference marker (none and 0:
global). Of two bodies, that of the floating J marker takes the opposite at the origin of I,
wherever that marker is; of one, nothing does.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from mbsim.forces.catalog import (
    COMPONENTS,
    USERS,
    Adams,
    Components,
    Given,
    Parameter,
    Reading,
    force,
    marker,
)

#: Which of COMPONENTS a type does not have.
_NOT_OF_TYPE = {
    "FORCEONLY": COMPONENTS[3:],
    "TORQUEONLY": COMPONENTS[:3],
    "FORCEANDTORQUE": (),
}
#: What the subroutine of a type is called where the deck does not say.
_SUBROUTINES = {
    "FORCEONLY": "VFOSUB",
    "TORQUEONLY": "VTOSUB",
    "FORCEANDTORQUE": "GFOSUB",
}


def _component(name: str) -> Parameter:
    about = f"{'force' if name[0] == 'f' else 'torque'} on I along {name[1]}"
    unit = "F" if name[0] == "f" else "F L"
    return Parameter(name, kind="expression", optional=True, about=about, unit=unit, shown="0")


_I = marker("i_marker_id")
_J = marker("j_floating_marker_id", "marker of the body that takes the opposite at I's origin")
_ATTRIBUTES = (
    Parameter(
        "type",
        None,
        words=tuple(_NOT_OF_TYPE),
        others={"FORCEONLY": "FORCE", "TORQUEONLY": "TORQUE"},
        about="which components there are",
    ),
    Parameter(
        "ref_marker_id",
        kind="id",
        optional=True,
        about="marker along whose axes they are",
        shown="global frame",
    ),
    *map(_component, COMPONENTS),
    USERS,
)


def _read(given: Given, values: dict[str, Any]) -> Mapping[str, Any]:
    type = values.setdefault("type", "FORCEANDTORQUE")
    for name in _NOT_OF_TYPE[type]:
        if given.given(name):
            has = ", ".join(each for each in COMPONENTS if each not in _NOT_OF_TYPE[type])
            given.fault(f"does not belong to type {type}, which has {has}", name)
    user = None
    exprs = [values.pop(name, None) for name in COMPONENTS]
    if given.by_user(COMPONENTS):
        user = given.subroutine(_SUBROUTINES[type])
        built = [name not in _NOT_OF_TYPE[type] for name in COMPONENTS]
        exprs = [given.result(user, sum(built[:k])) if built[k] else None for k in range(6)]
    elif not any(map(given.given, COMPONENTS)):
        given.fault(f"{COMPONENTS[0]} ... {COMPONENTS[-1]}: missing; at least one must be given")
    return values | {"exprs": tuple(exprs), "user": user}


force(
    "VECTORFORCE",
    "Force_Vector_TwoBody",
    "vector_forces",
    form=Components(alone=False),
    title="vector force",
    functions="VFORCE VTORQ GFORCE",  # of a Force_Vector_OneBody too
    adams=Adams("GFORCE"),
    table="vector_forces",
    reading=Reading((_I, _J, *_ATTRIBUTES), _read),
    about="force and torque between two bodies by components",
    spellings="VFORCE VTORQUE GFORCE",
)
force(
    "BODYFORCE",
    "Force_Vector_OneBody",
    "body_forces",
    form=Components(alone=True, known_as="VECTORFORCE"),
    title="body force",
    table="body_forces",
    reading=Reading((_I._replace(alias="marker_id"), *_ATTRIBUTES), _read),
    about="force and torque on one body by components",
)
