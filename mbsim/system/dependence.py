"""Forces by expressions of other forces: in which order they are evaluated, and which come late.

A force that needs other applied forces stands behind them. One that needs a reaction, of a joint
or a motion, is *late*, and so is what needs it: these, with the friction in joints, are settled
together when accelerations are known (`dynamics.late_forces`). Contacts are known before all.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from mbsim.errors import DeckError, Fault
from mbsim.model.elements import Model
from mbsim.model.names import element_name
from mbsim.system import arrays as a
from mbsim.system.programs import ELEMENT, NET, ProgramTable

_TABLES = {
    "SFORCE": ("Force_Scalar_TwoBody", "scalar_forces"),
    "VECTORFORCE": ("Force_Vector_TwoBody", "vector_forces"),
    "BODYFORCE": ("Force_Vector_OneBody", "body_forces"),
}


@dataclass
class _Needs:
    """What each applied force needs: rows of others, and whether a reaction."""

    rows: list[set[int]]
    reaction: list[bool]


def in_order(
    model: Model,
    applied: a.Applied,
    elements: list[tuple[str, int]],
    connections: a.Connections,
    connection_ids: Sequence[tuple[str, int]],
    programs: ProgramTable,
) -> tuple[a.Applied, list[tuple[str, int]]]:
    """Return the applied forces and their elements in an order in which each can be evaluated.

    Late ones have their kind raised by `arrays.LATE`, and are listed in `Applied.late`.

    Raises
    ------
    DeckError
        Where forces need each other.
    """
    needs = _needs(applied, elements, connections, connection_ids, programs)
    if not any(needs.rows) and not any(needs.reaction):
        return applied, elements
    order = _order(model, elements, needs)
    late = np.zeros(len(elements), dtype=bool)
    for row in order:
        late[row] = needs.reaction[row] or any(late[k] for k in needs.rows[row])
    kind = applied.kind + a.LATE * late
    at = np.array(order, dtype=np.int64)
    rows = {name: array[at] for name, array in applied._asdict().items() if name != "late"}
    rows["kind"] = kind[at]
    made = applied._replace(**rows)
    return made._replace(late=_late(made)), [elements[k] for k in order]


def _programs(applied: a.Applied, row: int) -> list[int]:
    """Return the programs of an applied force."""
    return [int(p) for p in (applied.program[row], *applied.components[row]) if p >= 0]


def _needs(
    applied: a.Applied,
    elements: list[tuple[str, int]],
    connections: a.Connections,
    connection_ids: Sequence[tuple[str, int]],
    programs: ProgramTable,
) -> _Needs:
    """Return what each applied force needs."""
    rows = {element: k for k, element in enumerate(elements)}
    held = set(connection_ids)
    found = _Needs([set() for _ in elements], [False for _ in elements])
    for row in range(len(elements)):
        for program in _programs(applied, row):
            for op, given, _, element in programs.programs[program]:
                if op == ELEMENT and element in rows:
                    found.rows[row].add(rows[element])
                elif op == ELEMENT and element in held:
                    found.reaction[row] = True
                elif op == NET:
                    _add_net(found, row, given[0], given[1], applied, connections)
    for row in range(len(elements)):
        # friction in joints is pressed by reactions
        if any(applied.connection[k] >= 0 for k in found.rows[row]):
            found.reaction[row] = True
        found.rows[row] = {k for k in found.rows[row] if applied.connection[k] < 0}
    return found


def _add_net(
    found: _Needs, row: int, i: int, j: int, applied: a.Applied, connections: a.Connections
) -> None:
    """Add all that acts between two markers to what a force needs."""
    ends = {(i, j), (j, i)}
    if any(pair in ends for pair in zip(connections.i, connections.j, strict=True)):
        found.reaction[row] = True
    for k in range(len(applied.kind)):
        alone = applied.alone[k] == 1
        if (alone and applied.i[k] == i and j == 0) or (
            not alone and (applied.i[k], applied.j[k]) in ends
        ):
            found.rows[row].add(k)


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
    names = [f"{_TABLES[statement][0]}[{id}]" for statement, id in ring]
    statement, id = ring[0]
    source = getattr(model, _TABLES[statement][1])[id].source
    what = "a force that needs itself" if len(ring) == 2 else "forces that need each other"
    name = element_name(source.file, _TABLES[statement][0], id)
    return DeckError([Fault(source.file, source.line, name, f"{what}: {' -> '.join(names)}")])


def _late(applied: a.Applied) -> np.ndarray[Any, Any]:
    """Return the unknowns that are settled together: row, component and program of each."""
    found = []
    for row in range(len(applied.kind)):
        if applied.kind[row] >= a.LATE:
            if applied.program[row] >= 0:
                found.append((row, a.SCALAR, int(applied.program[row])))
            components = enumerate(applied.components[row])
            found += [(row, c, int(program)) for c, program in components if program >= 0]
    if found:
        rubbing = np.flatnonzero(applied.connection >= 0)
        found += [(int(row), a.RUBBING, -1) for row in rubbing]
    return np.array(found, dtype=np.int64).reshape(-1, 3)
