"""What elements are called in messages and logs: in the words of the deck that they come from."""

from __future__ import annotations

import functools

from mbsim.forces.catalog import FORCES

#: Adams' statements by the XML's.
ADAMS = {
    "Body_Rigid": "PART",
    "Reference_Marker": "MARKER",
    "Constraint_Joint": "JOINT",
    "Constraint_Jprim": "JPRIM",
    "Constraint_General": "GCON",
    "Constraint_Coupler": "COUPLER",
    "Constraint_PTCV": "PTCV",
    "Constraint_CVCV": "CVCV",
    "Post_Graphic": "GRAPHICS",
    "Force_Contact": "CONTACT",
    "Force_JointFriction": "FRICTION",
    "Motion_Joint": "MOTION",
    "Motion_Marker": "MOTION",
    **{FORCES[name].statement: adams.name for name in FORCES if (adams := FORCES[name].adams)},
    "Reference_Variable": "VARIABLE",
    "Reference_Spline": "SPLINE",
    "Reference_ParamCurve": "CURVE",
    "Reference_Array": "ARRAY",
    "Post_Request": "REQUEST",
    "Reference_Matrix": "MATRIX",
    "Control_Diff": "DIFF",
    "Control_SISO": "TFSISO",
    "Control_StateEqn": "LSE",
    "Sensor_Event": "SENSOR",
}


def statement_name(file: str, statement: str) -> str:
    """Return an XML statement as the deck `file` calls it."""
    return ADAMS.get(statement, statement) if is_adams(file) else statement


def element_name(file: str, statement: str, id: int) -> str:
    """Return an element of the deck `file` as it is written there.

    Parameters
    ----------
    file : str
        The deck, an Adams deck where it ends in ``.adm`` or ``.acf``.
    statement : str
        The XML's name of the statement: ``Body_Rigid``.
    id : int

    Returns
    -------
    str
        ``Body_Rigid[2]``, of an Adams deck ``PART/2``.
    """
    name = statement_name(file, statement)
    return f"{name}/{id}" if is_adams(file) else f"{name}[{id}]"


@functools.cache
def is_adams(file: str) -> bool:
    """Return whether a deck is one of Adams, by its name."""
    return file.lower().endswith(".adm") or is_commands(file)


@functools.cache
def is_commands(file: str) -> bool:
    """Return whether a file holds Adams' commands, by its name."""
    return file.lower().endswith(".acf")
