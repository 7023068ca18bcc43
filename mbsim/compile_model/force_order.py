"""Forces by expressions of other forces: in which order, and which depend on reactions.

A force that needs other applied forces stands behind them. One that needs a reaction, of a joint
or a motion, depends on reactions, and so does what needs it: these, with the friction in joints,
are settled together when accelerations are known (`forces.reaction_forces`). Contacts are known
before all.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from mbsim.arrays import codes
from mbsim.arrays.model import Applied, Connections, States
from mbsim.compile_model.instructions import ELEMENT, NET
from mbsim.compile_model.programs import ProgramTable
from mbsim.errors import DeckError, Fault
from mbsim.forces.catalog import FORCES
from mbsim.model.elements import Model
from mbsim.model.names import element_name


@dataclass
class _Needs:
    """What each applied force needs: rows of others, and whether a reaction."""

    rows: list[set[int]]
    reaction: list[bool]


def in_order(
    model: Model,
    applied: Applied,
    elements: list[tuple[str, int]],
    connections: Connections,
    connection_ids: Sequence[tuple[str, int]],
    programs: ProgramTable,
) -> tuple[Applied, list[tuple[str, int]]]:
    """Return the applied forces and their elements in an order in which each can be evaluated.

    Those by reactions are marked in `Applied.with_reactions`, and listed in `Applied.by_reactions`.

    Raises
    ------
    DeckError
        Where forces need each other.
    """
    needs = _needs(applied, elements, connections, connection_ids, programs)
    if not any(needs.rows) and not any(needs.reaction):
        return applied, elements
    order = _order(model, elements, needs)
    by_reactions = np.zeros(len(elements), dtype=bool)
    for row in order:
        by_reactions[row] = needs.reaction[row] or any(by_reactions[k] for k in needs.rows[row])
    at = np.array(order, dtype=np.int64)
    rows = {name: array[at] for name, array in applied._asdict().items() if name != "by_reactions"}
    rows["with_reactions"] = np.maximum(applied.with_reactions, by_reactions)[at]
    made = applied._replace(**rows)
    return made._replace(by_reactions=_by_reactions(made)), [elements[k] for k in order]


def _programs(applied: Applied, row: int) -> list[int]:
    """Return the programs of an applied force."""
    return [int(p) for p in (applied.program[row], *applied.components[row]) if p >= 0]


def _needs(
    applied: Applied,
    elements: list[tuple[str, int]],
    connections: Connections,
    connection_ids: Sequence[tuple[str, int]],
    programs: ProgramTable,
) -> _Needs:
    """Return what each applied force needs."""
    found = _Needs([], [])
    for row in range(len(elements)):
        rows, reaction = _needed(
            _programs(applied, row), applied, elements, connections, connection_ids, programs
        )
        found.rows.append(rows)
        found.reaction.append(reaction)
    return found


def _needed(
    wanted: list[int],
    applied: Applied,
    elements: list[tuple[str, int]],
    connections: Connections,
    connection_ids: Sequence[tuple[str, int]],
    programs: ProgramTable,
) -> tuple[set[int], bool]:
    """Return the rows of forces that programs need, and whether they need a reaction."""
    place = {element: k for k, element in enumerate(elements)}
    held = set(connection_ids)
    rows: set[int] = set()
    reaction = False
    for program in wanted:
        for op, given, _, element in programs.programs[program]:
            if op == ELEMENT and element in place:
                rows.add(place[element])
            elif op == ELEMENT:
                reaction |= element in held
            elif op == NET:
                ends = {(given[0], given[1]), (given[1], given[0])}
                pairs = zip(connections.i, connections.j, strict=True)
                reaction |= any(pair in ends for pair in pairs)
                rows |= _between(given[0], given[1], applied)
    # friction in joints is pressed by reactions
    joint_friction = {k for k in rows if applied.connection[k] >= 0}
    return rows - joint_friction, reaction or bool(joint_friction)


def _between(i: int, j: int, applied: Applied) -> set[int]:
    """Return the rows of what acts between two markers, and of what acts on i alone without j."""
    found = set()
    for k in range(len(applied.form)):
        if applied.alone[k] == 1:
            counts = applied.i[k] == i and j == 0
        else:
            counts = (applied.i[k], applied.j[k]) in ((i, j), (j, i))
        if counts:
            found.add(k)
    return found


def check_states(
    model: Model,
    states: States,
    applied: Applied,
    elements: list[tuple[str, int]],
    connections: Connections,
    connection_ids: Sequence[tuple[str, int]],
    programs: ProgramTable,
) -> None:
    """Refuse slopes that need a reaction: they are evaluated with the forces, before those.

    Raises
    ------
    DeckError
        Naming the state.
    """
    # states of elements, which stand behind these, look at no forces
    for state, program in zip(model.differentials.values(), states.program, strict=False):
        rows, reaction = _needed(
            [int(program)], applied, elements, connections, connection_ids, programs
        )
        if reaction or any(applied.with_reactions[k] == 1 for k in rows):
            source = state.source
            name = element_name(source.file, "Control_Diff", state.id)
            why = (
                f"in {state.expr.text!r}: needs reactions of joints or motions, which are not "
                "known yet when slopes are; forces that need none, and contacts, can be used"
            )
            raise DeckError([Fault(source.file, source.line, name, why)])


def _order(model: Model, elements: list[tuple[str, int]], needs: _Needs) -> list[int]:
    """Return the rows, each behind those that it needs, else as they were; refuse circles."""
    order: list[int] = []
    done = [False] * len(elements)
    for first in range(len(elements)):
        way: list[tuple[int, list[int]]] = [] if done[first] else [(first, _sorted(needs, first))]
        while way:
            row, waiting = way[-1]
            if not waiting:
                done[row] = True
                order.append(row)
                way.pop()
                continue
            other = waiting.pop(0)
            if any(other == k for k, _ in way):
                rows = [k for k, _ in way]
                raise _circle(model, [elements[k] for k in [*rows[rows.index(other) :], other]])
            if not done[other]:
                way.append((other, _sorted(needs, other)))
    return order


def _sorted(needs: _Needs, row: int) -> list[int]:
    return sorted(needs.rows[row])


def _circle(model: Model, ring: list[tuple[str, int]]) -> DeckError:
    """Return the fault of forces that need each other."""
    names = [element_name(model.file, FORCES[name].statement, id) for name, id in ring]
    kind, id = ring[0]
    source = model.table(kind)[id].source
    what = "a force that needs itself" if len(ring) == 2 else "forces that need each other"
    name = element_name(source.file, FORCES[kind].statement, id)
    return DeckError([Fault(source.file, source.line, name, f"{what}: {' -> '.join(names)}")])


def _by_reactions(applied: Applied) -> np.ndarray[Any, Any]:
    """Return the unknowns that are settled together: row, component and program of each."""
    found = []
    for row in range(len(applied.form)):
        if applied.with_reactions[row] == 1:
            if applied.program[row] >= 0:
                found.append((row, codes.SCALAR, int(applied.program[row])))
            components = enumerate(applied.components[row])
            found += [(row, c, int(program)) for c, program in components if program >= 0]
    if found:
        joint_friction = np.flatnonzero(applied.connection >= 0)
        found += [(int(row), codes.JOINT_FRICTION, -1) for row in joint_friction]
    return np.array(found, dtype=np.int64).reshape(-1, 3)
