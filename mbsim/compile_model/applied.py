"""Springs, dampers, scalar and vector forces, kinds of `forces.catalog`, what acts in joints."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from mbsim.arrays import codes
from mbsim.arrays.model import Applied
from mbsim.compile_model.markers import MarkerTable
from mbsim.compile_model.programs import ProgramTable
from mbsim.forces.catalog import FORCES
from mbsim.laws.catalog import FRICTION_LAWS, NORMAL_LAWS
from mbsim.model.elements import (
    DryFriction,
    ForceElement,
    JointFriction,
    JointLimit,
    MarkerForce,
    Model,
    ScalarForce,
    SpringDamper,
    VectorForce,
)

_FRICTIONS = {
    "TRANSLATIONAL": codes.SLIDE_FRICTION,
    "REVOLUTE": codes.TURN_FRICTION,
    "CYLINDRICAL": codes.SCREW_FRICTION,
    "SPHERICAL": codes.BALL_FRICTION,
}


def applied_forces(
    model: Model, markers: MarkerTable, programs: ProgramTable, laws: bool = True
) -> tuple[Applied, list[tuple[str, int]]]:
    """Return the forces between markers, and for each row its element: (statement, id).

    Without `laws` those of friction and limits are left out, which would be compiled.
    """
    given = [
        (statement, element)
        for statement, table in _tables(model).items()
        for element in table.values()
    ]
    n = len(given)
    found = [_law(element) if laws else (0, np.zeros(0)) for _, element in given]
    made = Applied(
        kind=np.zeros(n, dtype=np.int64),
        with_reactions=np.zeros(n, dtype=np.int64),
        i=np.zeros(n, dtype=np.int64),
        j=np.zeros(n, dtype=np.int64),
        par=np.zeros((n, 8 if model.marker_forces else 4)),
        program=np.full(n, -1, dtype=np.int64),
        components=np.full((n, 6), -1, dtype=np.int64),
        axes=np.zeros(n, dtype=np.int64),
        angle=np.full(n, -1, dtype=np.int64),
        alone=np.zeros(n, dtype=np.int64),
        bounds=np.zeros((n, 2)),
        law=np.zeros(n, dtype=np.int64),
        slopes=np.zeros(n, dtype=np.int64),
        law_par=np.zeros((n, max([1, *(len(values) for _, values in found)]))),
        id=np.array([element.id for _, element in given], dtype=np.int64),
        connection=np.full(n, -1, dtype=np.int64),
        equation=np.full(n, -1, dtype=np.int64),
        by_reactions=np.zeros((0, 3), dtype=np.int64),
    )
    for k, (statement, element) in enumerate(given):
        made.law[k], values = found[k]
        made.law_par[k, : len(values)] = values
        _FILL[statement](model, markers, programs, made, k, element)
    return made, [(statement, element.id) for statement, element in given]


def _tables(model: Model) -> dict[str, Mapping[int, Any]]:
    """Return the elements that push, by statement."""
    return {
        "SPRINGDAMPER": model.spring_dampers,
        "SFORCE": model.scalar_forces,
        **{name: model.table(name) for name in FORCES},
        "VECTORFORCE": model.vector_forces,
        "BODYFORCE": model.body_forces,
        "JOINTFRICTION": model.joint_frictions,
        "JOINTLIMIT": model.joint_limits,
        "DRYFRICTION": model.dry_frictions,
        "FORCEELEMENT": model.force_elements,
    }


def _add_spring(
    model: Model,
    markers: MarkerTable,
    programs: ProgramTable,
    made: Applied,
    k: int,
    spring: SpringDamper,
) -> None:
    """Fill row k with a spring-damper."""
    made.i[k], made.j[k] = markers.row(spring.i_marker_id), markers.row(spring.j_marker_id)
    made.par[k, :4] = spring.stiffness, spring.damping, spring.length, spring.preload
    made.kind[k] = codes.LINE_FORCE
    if spring.type == "ROTATIONAL":
        made.kind[k] = codes.AXIS_TORQUE
        made.angle[k] = markers.angle(int(made.i[k]), int(made.j[k]))


def _add_scalar(
    model: Model,
    markers: MarkerTable,
    programs: ProgramTable,
    made: Applied,
    k: int,
    force: ScalarForce,
) -> None:
    """Fill row k with a scalar force by an expression."""
    made.i[k], made.j[k] = markers.row(force.i_marker_id), markers.row(force.j_marker_id)
    made.program[k] = programs.add(force.expr, force, forces=True)
    made.alone[k] = int(force.action_only)
    along = codes.AXIS_FORCE if force.action_only else codes.LINE_FORCE
    made.kind[k] = codes.AXIS_TORQUE if force.type == "ROTATIONAL" else along


def _add_marker_force(
    model: Model,
    markers: MarkerTable,
    programs: ProgramTable,
    made: Applied,
    k: int,
    force: MarkerForce,
) -> None:
    """Fill row k with a force of a kind of `forces.catalog`."""
    made.i[k], made.j[k] = markers.row(force.i_marker_id), markers.row(force.j_marker_id)
    made.kind[k] = codes.MARKER_FORCE
    kind = FORCES[force.kind]
    bounds = kind.bounds(kind.constants(force.values))
    made.par[k] = (*bounds[: codes.REST], *bounds.rest)


def _add_vector(
    model: Model,
    markers: MarkerTable,
    programs: ProgramTable,
    made: Applied,
    k: int,
    force: VectorForce,
) -> None:
    """Fill row k with a vector force by expressions."""
    made.i[k], made.j[k] = markers.row(force.i_marker_id), markers.row(force.j_floating_marker_id)
    made.kind[k] = codes.VECTOR_FORCE
    made.alone[k] = int(force.action_only)
    made.axes[k] = markers.row(force.ref_marker_id)
    for c, expression in enumerate(force.exprs):
        if expression is not None:
            made.components[k, c] = programs.add(expression, force, forces=True)


def _law(element: Any) -> tuple[int, np.ndarray[Any, Any]]:
    """Return address and parameters of the law of an element; address 0 where it has none."""
    if isinstance(element, JointLimit):
        normal = NORMAL_LAWS[element.cnf_type]
        from mbsim.laws import abi  # what only a run needs

        return abi.normal_address(normal), abi.normal_constants(normal, element)
    if isinstance(element, MarkerForce):
        kind = FORCES[element.kind]
        constants = np.array(kind.constants(element.values), dtype=np.float64)
        from mbsim.forces.abi import wrench_address  # what only a run needs

        return wrench_address(kind.name, len(constants)), constants
    if not isinstance(element, JointFriction) or element.cff_type == "COULOMB_OFF":
        return 0, np.zeros(0)
    friction = FRICTION_LAWS[element.cff_type]
    from mbsim.laws import abi  # what only a run needs

    return abi.friction_address(friction), abi.friction_parameters(friction, element)


def _place(model: Model, markers: MarkerTable, made: Applied, k: int, joint_id: int) -> None:
    """Put row k between the markers of its joint."""
    joint = model.joints[joint_id]
    made.i[k], made.j[k] = markers.row(joint.i_marker_id), markers.row(joint.j_marker_id)


def _add_friction(
    model: Model,
    markers: MarkerTable,
    programs: ProgramTable,
    made: Applied,
    k: int,
    friction: JointFriction,
) -> None:
    """Fill row k with friction in a joint."""
    _place(model, markers, made, k, friction.joint_id)
    made.kind[k] = _FRICTIONS[model.joints[friction.joint_id].type]
    made.par[k, : len(friction.constants)] = friction.constants
    made.with_reactions[k] = 1
    # joints are the first connections, in the order of the model
    made.connection[k] = list(model.joints).index(friction.joint_id)


def _add_limit(
    model: Model,
    markers: MarkerTable,
    programs: ProgramTable,
    made: Applied,
    k: int,
    limit: JointLimit,
) -> None:
    """Fill row k with a limit of a joint."""
    _place(model, markers, made, k, limit.joint_id)
    made.kind[k] = codes.TURN_LIMIT if limit.direction == "R" else codes.SLIDE_LIMIT
    made.bounds[k, 0] = -math.inf if limit.lower is None else limit.lower
    made.bounds[k, 1] = math.inf if limit.upper is None else limit.upper
    if limit.direction == "R":
        made.angle[k] = markers.angle(int(made.i[k]), int(made.j[k]))


def _add_dry(
    model: Model,
    markers: MarkerTable,
    programs: ProgramTable,
    made: Applied,
    k: int,
    friction: DryFriction,
) -> None:
    """Fill row k with dry friction."""
    made.i[k], made.j[k] = markers.row(friction.i_marker_id), markers.row(friction.j_marker_id)
    axis = "XYZ".index(friction.type[1])
    made.axes[k] = markers.turned(int(made.j[k]), axis)
    made.kind[k] = codes.DRY_SLIDE
    if friction.type[0] == "R":
        made.kind[k] = codes.DRY_TURN
        made.angle[k] = markers.angle(markers.turned(int(made.i[k]), axis), int(made.axes[k]))
    static = friction.friction_static
    made.par[k, 0] = friction.friction / friction.dx if friction.dx > 0.0 else 0.0
    made.par[k, 1] = friction.friction
    made.par[k, 2] = friction.friction if static is None else static


def _add_element(
    model: Model,
    markers: MarkerTable,
    programs: ProgramTable,
    made: Applied,
    k: int,
    element: ForceElement,
) -> None:
    """Fill row k with an element of a user's residual."""
    from mbsim.compile_model.force_elements import force_program

    made.i[k], made.j[k] = markers.row(element.i_marker_id), markers.row(element.j_marker_id)
    made.kind[k], made.axes[k] = codes.RESIDUAL, made.j[k]
    made.par[k, 0] = list(model.force_elements).index(element.id)
    for at, direction in enumerate(element.directions):
        c = 3 * "TR".index(direction[0]) + "XYZ".index(direction[1])
        made.components[k, c] = force_program(programs, element.id, at)


#: What fills a row, by statement.
_FILL: dict[str, Callable[..., None]] = {
    "SPRINGDAMPER": _add_spring,
    "SFORCE": _add_scalar,
    **{name: _add_marker_force for name in FORCES},
    "VECTORFORCE": _add_vector,
    "BODYFORCE": _add_vector,
    "JOINTFRICTION": _add_friction,
    "JOINTLIMIT": _add_limit,
    "DRYFRICTION": _add_dry,
    "FORCEELEMENT": _add_element,
}
