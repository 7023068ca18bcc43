"""Springs, dampers, scalar forces, and what acts in joints, as rows."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from mbsim.laws import abi
from mbsim.laws.catalog import FRICTION_LAWS, NORMAL_LAWS
from mbsim.model.elements import JointFriction, JointLimit, Model
from mbsim.system import arrays as a
from mbsim.system.markers import MarkerTable
from mbsim.system.programs import ProgramTable

_FRICTIONS = {
    "TRANSLATIONAL": a.SLIDE_FRICTION,
    "REVOLUTE": a.TURN_FRICTION,
    "CYLINDRICAL": a.SCREW_FRICTION,
    "SPHERICAL": a.BALL_FRICTION,
}


def applied_forces(
    model: Model, markers: MarkerTable, programs: ProgramTable
) -> tuple[a.Applied, list[tuple[str, int]]]:
    """Return the forces between markers, and for each row its element: (statement, id)."""
    springs, forces = model.spring_dampers.values(), model.scalar_forces.values()
    frictions, limits = list(model.joint_frictions.values()), list(model.joint_limits.values())
    elements = [("SPRINGDAMPER", spring.id) for spring in springs]
    elements += [("SFORCE", force.id) for force in forces]
    first = len(elements)
    elements += [("JOINTFRICTION", friction.id) for friction in frictions]
    elements += [("JOINTLIMIT", limit.id) for limit in limits]
    n = len(elements)
    laws = [_law(element) for element in (*frictions, *limits)]
    made = a.Applied(
        kind=np.zeros(n, dtype=np.int64),
        i=np.zeros(n, dtype=np.int64),
        j=np.zeros(n, dtype=np.int64),
        par=np.zeros((n, 4)),
        program=np.full(n, -1, dtype=np.int64),
        angle=np.full(n, -1, dtype=np.int64),
        alone=np.zeros(n, dtype=np.int64),
        bounds=np.zeros((n, 2)),
        law=np.zeros(n, dtype=np.int64),
        law_par=np.zeros((n, max([1, *(len(values) for _, values in laws)]))),
        id=np.array([id for _, id in elements], dtype=np.int64),
        connection=np.full(n, -1, dtype=np.int64),
    )
    for k, element in enumerate([*springs, *forces]):
        made.i[k], made.j[k] = markers.row(element.i_marker_id), markers.row(element.j_marker_id)
        made.kind[k] = a.AXIS_TORQUE if element.type == "ROTATIONAL" else a.LINE_FORCE
    for k, spring in enumerate(springs):
        made.par[k] = spring.stiffness, spring.damping, spring.length, spring.preload
        if made.kind[k] == a.AXIS_TORQUE:
            made.angle[k] = markers.angle(int(made.i[k]), int(made.j[k]))
    for k, force in enumerate(forces, len(springs)):
        made.program[k] = programs.add(force.expr, force)
        if force.action_only:
            made.alone[k] = 1
            if made.kind[k] == a.LINE_FORCE:
                made.kind[k] = a.AXIS_FORCE
    for k, (address, values) in enumerate(laws, first):
        made.law[k] = address
        made.law_par[k, : len(values)] = values
    for k, friction in enumerate(frictions, first):
        _add_friction(model, markers, made, k, friction)
    for k, limit in enumerate(limits, first + len(frictions)):
        _add_limit(model, markers, made, k, limit)
    return made, elements


def _law(element: JointFriction | JointLimit) -> tuple[int, np.ndarray[Any, Any]]:
    """Return address and parameters of the law of an element; address 0 for COULOMB_OFF."""
    if isinstance(element, JointLimit):
        normal = NORMAL_LAWS[element.cnf_type]
        return abi.normal_address(normal), abi.normal_constants(normal, element)
    if element.cff_type == "COULOMB_OFF":
        return 0, np.zeros(0)
    friction = FRICTION_LAWS[element.cff_type]
    return abi.friction_address(friction), abi.friction_parameters(friction, element)


def _place(model: Model, markers: MarkerTable, made: a.Applied, k: int, joint_id: int) -> None:
    """Put row k between the markers of its joint."""
    joint = model.joints[joint_id]
    made.i[k], made.j[k] = markers.row(joint.i_marker_id), markers.row(joint.j_marker_id)


def _add_friction(
    model: Model, markers: MarkerTable, made: a.Applied, k: int, friction: JointFriction
) -> None:
    """Fill row k with friction in a joint."""
    _place(model, markers, made, k, friction.joint_id)
    made.kind[k] = _FRICTIONS[model.joints[friction.joint_id].type]
    radius = friction.pin_radius or friction.ball_radius or 0.0
    made.par[k] = radius, friction.preload, friction.bending_reaction_arm, 0.0
    # joints are the first connections, in the order of the model
    made.connection[k] = list(model.joints).index(friction.joint_id)


def _add_limit(
    model: Model, markers: MarkerTable, made: a.Applied, k: int, limit: JointLimit
) -> None:
    """Fill row k with a limit of a joint."""
    _place(model, markers, made, k, limit.joint_id)
    made.kind[k] = a.TURN_LIMIT if limit.direction == "R" else a.SLIDE_LIMIT
    made.bounds[k, 0] = -math.inf if limit.lower is None else limit.lower
    made.bounds[k, 1] = math.inf if limit.upper is None else limit.upper
    if limit.direction == "R":
        made.angle[k] = markers.angle(int(made.i[k]), int(made.j[k]))
