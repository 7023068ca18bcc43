"""Every statement the reader knows, and how the two sections of a deck are gone through."""

from __future__ import annotations

from mbsim.reader.activity import ACTIVATE, DEACTIVATE
from mbsim.reader.bodies import BODY_RIGID, PARAM_UNIT, REFERENCE_MARKER
from mbsim.reader.changes import CHANGEABLE, change
from mbsim.reader.clusters import REFERENCE_2D_CLUSTER, SUBSYSTEM_PLANAR
from mbsim.reader.command import FORCE_GRAVITY, PARAM_STATIC, PARAM_TRANSIENT, SIMULATE, STOP
from mbsim.reader.constraints import (
    CONSTRAINT_COUPLER,
    CONSTRAINT_GENERAL,
    CONSTRAINT_JOINT,
    CONSTRAINT_JPRIM,
    MOTION_JOINT,
    MOTION_MARKER,
)
from mbsim.reader.contact import FORCE_CONTACT
from mbsim.reader.control_siso import CONTROL_SISO
from mbsim.reader.control_state_eqn import CONTROL_STATE_EQN
from mbsim.reader.controls import CONTROL_DIFF, SENSOR_EVALUATE, SENSOR_EVENT
from mbsim.reader.curves import CONSTRAINT_CVCV, CONSTRAINT_PTCV, REFERENCE_PARAM_CURVE
from mbsim.reader.draft import Draft
from mbsim.reader.forces import force_statements
from mbsim.reader.gears import CONSTRAINT_GEAR
from mbsim.reader.graphics import POST_GRAPHIC
from mbsim.reader.keywords import fold, nearest
from mbsim.reader.linear_analysis import (
    CONTROL_PLANT_INPUT,
    CONTROL_PLANT_OUTPUT,
    PARAM_LINEAR,
)
from mbsim.reader.matrix import REFERENCE_MATRIX
from mbsim.reader.multi_point import FORCE_MULTI_POINT
from mbsim.reader.output_statements import OUTPUT_STATEMENTS
from mbsim.reader.param_simulation import PARAM_SIMULATION
from mbsim.reader.parse import Node
from mbsim.reader.points import BODY_POINT
from mbsim.reader.requests import POST_REQUEST
from mbsim.reader.statement import Statement
from mbsim.reader.surfaces import CONSTRAINT_PTSF, REFERENCE_PARAM_SURFACE
from mbsim.reader.tables import REFERENCE_ARRAY, REFERENCE_SPLINE
from mbsim.reader.variable import REFERENCE_VARIABLE

STATEMENTS = (
    PARAM_UNIT,
    BODY_RIGID,
    BODY_POINT,
    REFERENCE_MARKER,
    POST_GRAPHIC,
    FORCE_CONTACT,
    FORCE_GRAVITY,
    PARAM_SIMULATION,
    PARAM_TRANSIENT,
    PARAM_STATIC,
    PARAM_LINEAR,
    CONSTRAINT_JOINT,
    CONSTRAINT_JPRIM,
    CONSTRAINT_COUPLER,
    CONSTRAINT_GENERAL,
    CONSTRAINT_PTCV,
    CONSTRAINT_CVCV,
    CONSTRAINT_PTSF,
    CONSTRAINT_GEAR,
    MOTION_JOINT,
    MOTION_MARKER,
    *force_statements(),
    FORCE_MULTI_POINT,
    REFERENCE_VARIABLE,
    CONTROL_DIFF,
    CONTROL_SISO,
    CONTROL_STATE_EQN,
    CONTROL_PLANT_INPUT,
    CONTROL_PLANT_OUTPUT,
    REFERENCE_SPLINE,
    REFERENCE_ARRAY,
    REFERENCE_MATRIX,
    REFERENCE_PARAM_CURVE,
    REFERENCE_PARAM_SURFACE,
    REFERENCE_2D_CLUSTER,
    SUBSYSTEM_PLANAR,
    SENSOR_EVENT,
    SENSOR_EVALUATE,
    POST_REQUEST,
    ACTIVATE,
    DEACTIVATE,
    SIMULATE,
    STOP,
    *OUTPUT_STATEMENTS,
)
BY_KEY = {fold(statement.name): statement for statement in STATEMENTS}

# documented statements (or members of documented families) that would change the motion; those
# that have been built are none of them
_DOCUMENTED = (
    "Body_Flexible Body_Point Constraint_CVCV Constraint_Gear "
    "Constraint_PTCV Constraint_PTdCV "
    "Constraint_PTSF Constraint_UserConstr Control_FMU Control_PlantInput "
    "Control_PlantOutput Control_SISO Control_StateEqn "
    "Force_Beam Force_Field Force_MultiPoint Force_Penalty "
    "Force_StateEqn Force_TwoBody "
    "Force_FlexModal Force_PTdSF Post_UserAPI Reference_2DCluster Reference_PlantState "
    "Reference_DeformCurve "
    "Reference_DeformSurface Reference_FlexData Reference_Matrix Reference_ParamCurve "
    "Reference_ParamSurface Reference_String "
    "Sensor_Evaluate Sensor_Proximity UserProgramControl"
).split()
NOT_BUILT = [name for name in _DOCUMENTED if fold(name) not in BY_KEY]
#: Documented statements that mbsim has another way for.
REFUSED = {
    "Control_TransferFunction": "MotionSolve's decks have a transfer function as Control_SISO",
    "Load_Command": "a run's commands are those of its deck; write them into this <Command>",
    "Load_Model": "a run is one deck; give the other file to a mbsim run of its own",
    "Save": "the result file keeps the state; a run cut short goes on with mbsim run --resume",
}
_REFUSED = {fold(name): f"{name} is not taken: {why}" for name, why in REFUSED.items()}
_PARAMETERS = (PARAM_TRANSIENT, PARAM_STATIC, PARAM_LINEAR)
_NOT_AFTER_STOP = (ACTIVATE, DEACTIVATE, SIMULATE, *_PARAMETERS, FORCE_GRAVITY)
_NOT_BUILT = {fold(name): name for name in NOT_BUILT}


def known_attributes(node: Node) -> list[str] | None:
    """Return the attributes that an element of this tag may have, None where that is open."""
    statement = BY_KEY.get(node.key)
    if statement is None or statement.any_attribute(node):
        return None
    others = [name for s in statement.attributes.values() for name in s.alias.split()]
    return [*statement.attributes, *others]


def read_section(section: Node, draft: Draft) -> None:
    """Read all statements of one <Model> or <Command> into the draft, in the order of the deck.

    Param_Unit goes first wherever it stands, because warnings depend on it.
    """
    draft.in_command = section.key == "command"
    if section.text:
        draft.fault(section.line, section.tag, f"text {section.text[:40]!r} between statements")
    for node in sorted(section.children, key=lambda node: node.key != "paramunit"):
        _read_statement(section, node, draft)


def _read_statement(section: Node, node: Node, draft: Draft) -> None:
    """Read one statement, or refuse it by name."""
    statement = BY_KEY.get(node.key)
    refusal = _refusal(statement, node, draft)
    if statement is None or refusal:
        id = node.find("id")
        label = node.tag + (f"[{id.value.strip()[:40]}]" if id else "")
        draft.fault(node.line, label, refusal)
    elif draft.in_command and statement.name in CHANGEABLE:
        change(statement, node, draft)
    else:
        statement.read(node, draft)
        if statement.name in CHANGEABLE and (id := node.find("id")):
            draft.nodes.setdefault((statement.name, id.value.strip()), node)


def _refusal(statement: Statement | None, node: Node, draft: Draft) -> str:
    """Return why a statement cannot stand where it does, or an empty string."""
    if statement is None:
        if node.key in _NOT_BUILT:
            return f"{_NOT_BUILT[node.key]} is documented but not built yet"
        if node.key in _REFUSED:
            return _REFUSED[node.key]
        known = [*(statement.name for statement in STATEMENTS), *NOT_BUILT, *REFUSED]
        return f"unknown statement <{node.tag}>{nearest(node.tag, known)}"
    if draft.stop_line and (statement in _NOT_AFTER_STOP or statement.name in CHANGEABLE):
        return f"is never reached after Stop on line {draft.stop_line}"
    if not draft.in_command:
        return "" if statement.in_model else f"{statement.name} belongs in <Command>"
    if statement.in_command or statement.name in CHANGEABLE:
        return ""
    also = f"elements that can change between simulations: {', '.join(CHANGEABLE)}"
    return f"{statement.name} belongs in <Model>; {also}"
