"""Force_Element as rows: directions, unknowns, and where their residuals are."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from mbsim.arrays.model import Residuals, States
from mbsim.compile_model.instructions import USER, Instruction
from mbsim.compile_model.markers import MarkerTable
from mbsim.compile_model.programs import ProgramTable
from mbsim.forces.catalog import OfResidual, of_form
from mbsim.laws.residual import DIFFERENTIAL, inputs
from mbsim.model.elements import ForceElement, Model

if TYPE_CHECKING:
    from mbsim.plugins.types import UserResidual

#: Kind of these elements.
(STATEMENT,) = (kind.name for kind in of_form(OfResidual))


def results_of(element: ForceElement, user: UserResidual) -> int:
    """Return how many numbers an element gives: see `arrays.Residuals`."""
    return len(element.directions) + len(user.states) + len(user.unknowns) + 1


def values_of(element: ForceElement, user: UserResidual) -> list[int]:
    """Return at which of these numbers its unknowns stand."""
    first = len(element.directions) + len(user.states)
    return [first + k for k in range(len(user.unknowns))]


def direction_rows(markers: MarkerTable, i: int, j: int, direction: str) -> tuple[int, int]:
    """Return the marker row whose z an axis of J is, and the row of its angle or -1."""
    axis = "XYZ".index(direction[1])
    turned = markers.turned(j, axis)
    angle = markers.angle(markers.turned(i, axis), turned) if direction[0] == "R" else -1
    return turned, angle


def residuals_table(
    model: Model,
    markers: MarkerTable,
    programs: ProgramTable,
    users: Mapping[int, UserResidual],
    states: States,
) -> tuple[Residuals, States]:
    """Return the elements' rows, and the states with theirs behind the others.

    Scales that nobody gave are NaN until `fill_scales`.
    """
    elements = [model.force_elements[id] for id in users]
    axes = [direction_rows(markers, markers.row(e.i_marker_id), markers.row(e.j_marker_id), d)
            for e in elements for d in e.directions]  # fmt: skip
    unknowns = [unknown for user in users.values() for unknown in user.unknowns]
    kind = np.array([u.kind for u in unknowns], dtype=np.int64)
    is_state = kind == DIFFERENTIAL
    nz, count = len(states.program), int(is_state.sum())
    state, offset = np.full(len(kind), -1), np.full(len(kind), -1)
    state[is_state] = nz + np.arange(count)
    offset[is_state] = programs.first_state + state[is_state]
    most_axes = max((len(e.directions) for e in elements), default=0)
    most = max((len(user.unknowns) for user in users.values()), default=0)
    width = max([1, *(len(user.par) for user in users.values())]) if users else 0
    par = np.zeros((len(elements), width))
    for k, user in enumerate(users.values()):
        par[k, : len(user.par)] = user.par

    def whole(values: object) -> np.ndarray:
        return np.array(values, dtype=np.int64)

    table = Residuals(
        id=whole(list(users)),
        i=whole([markers.row(e.i_marker_id) for e in elements]),
        j=whole([markers.row(e.j_marker_id) for e in elements]),
        first=whole(np.cumsum([0, *(len(e.directions) for e in elements)])),
        begin=whole(np.cumsum([0, *(len(user.unknowns) for user in users.values())])),
        axis=whole([axis for axis, _ in axes]),
        angle=whole([angle for _, angle in axes]),
        kind=kind,
        state=whole(state),
        offset=whole(offset),
        initial=np.array([u.initial for u in unknowns], dtype=np.float64),
        scale=np.array([u.scale or np.nan for u in unknowns], dtype=np.float64),
        address=whole([user.address for user in users.values()]),
        twin=whole([user.twin for user in users.values()]),
        interpreted=whole([not user.compiled for user in users.values()]),
        user=whole([programs.users[STATEMENT, id] for id in users]),
        par=par,
        given=np.zeros(inputs(most_axes, most)),
        out=np.zeros(most),
        base=np.zeros(most),
        start=np.zeros(most),
        z=np.zeros(most),
        step=np.zeros(most),
        size=np.zeros(most),
        rows=np.zeros(most),
        by=np.zeros((2, most, most)),
        moves=np.zeros((2, most, most_axes)),
        A=np.zeros((most, most)),
        swap=np.zeros(most, dtype=np.int64),
        rise=np.zeros(most),
        slopes=np.zeros((3, most, max(most, most_axes))),
        unsolved=np.full(1, -1, dtype=np.int64),
    )
    made = [
        _program(programs, id, len(element.directions) + k)
        for element, (id, user) in zip(elements, users.items(), strict=True)
        for k in range(len(user.states))
    ]
    return table, States(
        np.append(states.program, whole(made)),
        np.append(states.offset, table.offset[is_state]),
        np.append(states.scale, table.scale[is_state]),
    )


def _program(programs: ProgramTable, id: int, result: int, calls: int = 0) -> int:
    """Return the row of a program that gives one result of an element."""
    row = programs.users[STATEMENT, id]
    programs.programs.append([Instruction(USER, (row, result, calls))])
    return len(programs.programs) - 1


def force_program(programs: ProgramTable, id: int, direction: int) -> int:
    """Return the row of a program that gives the force of an element along a direction."""
    return _program(programs, id, direction)


def mode_programs(
    model: Model, programs: ProgramTable, users: Mapping[int, UserResidual]
) -> list[int]:
    """Return programs that tell the modes of the elements that have some."""
    return [
        _program(programs, id, results_of(model.force_elements[id], user) - 1, calls=1)
        for id, user in users.items()
        if user.switches
    ]


def unknown_programs(
    model: Model, programs: ProgramTable, users: Mapping[int, UserResidual]
) -> list[int]:
    """Return programs that read the unknowns of all elements, as they were found last."""
    return [
        _program(programs, id, at)
        for id, user in users.items()
        for at in values_of(model.force_elements[id], user)
    ]


def fill_scales(residuals: Residuals, states: States, load: float, length: float) -> None:
    """Fill scales that nobody gave: a usual force or torque, and 1 for what is no force."""
    for e in range(len(residuals.id)):
        first, count = residuals.begin[e], residuals.first[e + 1] - residuals.first[e]
        for k in range(residuals.begin[e + 1] - first):
            if not np.isnan(residuals.scale[first + k]):
                continue
            turns = k < count and residuals.angle[residuals.first[e] + k] >= 0
            usual = load * length if turns else load
            residuals.scale[first + k] = usual if k < count else 1.0
    for u in np.flatnonzero(residuals.state >= 0):
        states.scale[residuals.state[u]] = residuals.scale[u]
