"""What acts in a model and what is asked for, as rows and programs; laws only where it runs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from mbsim.arrays.model import Applied, Residuals, Sensors, States, Switching
from mbsim.compile_model.applied import applied_forces, link_points
from mbsim.compile_model.force_elements import STATEMENT
from mbsim.compile_model.force_order import check_states, in_order
from mbsim.compile_model.gravity import Pull, pulls
from mbsim.compile_model.instructions import Instruction
from mbsim.compile_model.markers import MarkerTable, body_rows
from mbsim.compile_model.mechanism import Mechanism, RigidSlot, constrain
from mbsim.compile_model.param_surfaces import Function
from mbsim.compile_model.programs import ProgramTable
from mbsim.compile_model.states import sensors_table, states_table
from mbsim.compile_model.switching import switching_table
from mbsim.expressions.elementary import NUMBER
from mbsim.model.elements import Model
from mbsim.model.forces import rigid_forces
from mbsim.model.placement import place
from mbsim.model.subroutines import wanted

if TYPE_CHECKING:
    from mbsim.compile_model.subroutines import StateReader
    from mbsim.plugins.subroutine import UserSubroutine
    from mbsim.plugins.types import UserResidual


def _values(
    model: Model, programs: ProgramTable, residuals: Mapping[int, UserResidual] | None
) -> list[tuple[int, int]]:
    """Make the programs of requests, the last of all; return request and F number of each.

    Before them those of the unknowns of elements are made, which have no request: id 0.
    """
    made = []
    if residuals:
        from mbsim.compile_model.force_elements import unknown_programs

        made = [(0, k) for k, _ in enumerate(unknown_programs(model, programs, residuals))]
    for request in model.requests.values():
        for k, expression in enumerate(request.exprs):
            if expression is not None:
                programs.add(expression, request, forces=True, accelerations=True)
                made.append((request.id, k + 1))
    for id in model.looked_at:
        # no request has a negative id
        programs.add(model.variables[id].expr, model.variables[id], forces=True, accelerations=True)
        made.append((-id, 0))
    return made


def _state_reader(model: Model, programs: ProgramTable, looks: bool) -> StateReader | None:
    """Return what serves py_sysfnc where a script has it."""
    if not looks:
        return None
    from mbsim.compile_model.subroutines import StateReader

    return StateReader(model, programs)


@dataclass
class Acting:
    """What acts and what is asked for, as rows and programs, which are made in one order."""

    programs: ProgramTable
    applied: Applied
    applied_ids: list[tuple[str, int]]
    mechanism: Mechanism
    states: States
    sensors: Sensors
    switching: Switching
    reader: StateReader | None
    pulls: list[Pull]
    values: list[tuple[int, int]]
    residuals: Residuals | None
    nothing: int  # program that is 0, -1 where nothing is ever switched off


def _link_rigid(
    model: Model, mechanism: Mechanism, applied: Applied, applied_ids: list[tuple[str, int]]
) -> None:
    """Let rigid forces and their equations know each other.

    Theirs are the last but for those of contacts.
    """
    rigid = rigid_forces(model)
    rigid_slots = int((mechanism.equations.slot >= 0).sum())
    first = len(mechanism.equations.program) - rigid_slots - len(rigid)
    for k, (kind, force) in enumerate(rigid):
        row = applied_ids.index((kind.name, force.id))
        applied.equation[row], mechanism.equations.dry[first + k] = first + k, row


def acting(
    model: Model,
    table: MarkerTable,
    first_state: int,
    subroutines: Mapping[tuple[str, int], UserSubroutine | None],
    looks: bool,
    runs: bool = True,
    residuals: Mapping[int, UserResidual] | None = None,
    rigid_slots: Sequence[RigidSlot] = (),
    surfaces: Mapping[int, Function] | None = None,
) -> Acting:
    """Return forces, constraints, states, sensors and requests; `first_state`: offset in y.

    `looks` says whether a script has py_sysfnc. What only a run needs, laws and what subroutines
    look at, is left out unless it `runs`; so are the unknowns of `residuals`, by element.
    `rigid_slots`: slots whose friction is rigid. `surfaces`: what gives points of each, where they
    are to be known.
    """
    programs = ProgramTable(
        table,
        model.variables,
        model.differentials,
        first_state,
        model.shown,
        model.splines,
        model.arrays,
    )
    programs.inputs = model.inputs
    elements = [(STATEMENT, id) for id in model.force_elements]
    programs.users = {element: k for k, element in enumerate([*subroutines, *elements])}
    applied, applied_ids = applied_forces(model, table, programs, laws=runs)
    mechanism = constrain(model, table, programs, rigid_slots, surfaces)
    applied, applied_ids = in_order(
        model, applied, applied_ids, mechanism.connections, mechanism.elements, programs
    )
    _link_rigid(model, mechanism, applied, applied_ids)
    link_points(model, applied, applied_ids)
    states = states_table(model, programs)
    table_of_residuals, modes = None, []
    if residuals:
        from mbsim.compile_model.force_elements import mode_programs, residuals_table

        table_of_residuals, states = residuals_table(model, table, programs, residuals, states)
        modes = mode_programs(model, programs, residuals)
    nothing = -1
    if any(simulation.inactive for simulation in model.simulations):
        nothing = len(programs.programs)
        programs.programs.append([Instruction(NUMBER, value=0.0)])
    held = (mechanism.connections, mechanism.elements, programs)
    check_states(model, states, applied, applied_ids, *held)
    return Acting(
        programs,
        applied,
        applied_ids,
        mechanism,
        states,
        sensors_table(model, programs),
        switching_table(model, programs, applied_ids, modes),
        _state_reader(model, programs, looks) if runs else None,
        pulls(model, programs),
        _values(model, programs, residuals),  # the last of all
        table_of_residuals,
        nothing,
    )


def check_expressions(model: Model) -> None:
    """Raise what is wrong with expressions where they stand, as `build` would."""
    placement = place(model)
    users = {(each.kind, each.id): None for each in wanted(model)}
    table = MarkerTable(placement, body_rows(model, placement))
    acting(model, table, 0, users, looks=False, runs=False)
