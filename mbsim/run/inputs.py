"""What the caller of a run sets between steps: variables and motions whose value is a number.

An input is a NUMBER of programs with a row of its own (`compile_model.programs`): setting it
writes that row, and the place of its copy in the shortened programs.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, MutableMapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsim.arrays.codes import CODE_OPERAND, CODE_OPERATION
from mbsim.errors import ModelError
from mbsim.expressions.elementary import NUMBER, TIME
from mbsim.expressions.tree import Expression, Number, references
from mbsim.model.elements import InputElement, Model
from mbsim.model.names import element_name
from mbsim.results.names import nearest

if TYPE_CHECKING:
    from mbsim.arrays.scene import Scene

#: Tables of a model that have inputs, and what their elements are called in decks.
_TABLES = {"variables": "Reference_Variable", "motions": "Motion_Joint"}


def _seen_through(model: Model, expression: Expression) -> Iterator[int]:
    """Yield the variables that an expression uses, those that they use included."""
    waiting, seen = [expression], set[int]()
    while waiting:
        for reference in references(waiting.pop()):
            id = reference.id
            if reference.statement == "VARIABLE" and id not in seen and id in model.variables:
                seen.add(id)
                yield id
                waiting.append(model.variables[id].expr)


def _holding(model: Model) -> dict[int, str]:
    """Return the variables on which positions depend that constraints hold, and which do."""
    found: dict[int, str] = {}
    holding = [
        (motion.statement, motion.id, motion.expr)
        for motion in model.motions.values()
        if motion.val_type == "D" and motion.expr is not None
    ]
    general = model.general_constraints.values()
    holding += [("Constraint_General", each.id, each.expr) for each in general]
    for statement, number, expression in holding:
        name = element_name(model.file, statement, number)
        for id in _seen_through(model, expression):
            found.setdefault(id, name)
    return found


def _names(model: Model) -> dict[str, tuple[str, int]]:
    """Return the elements that may be inputs, by path and, where it is the only one, by label."""
    found = {f"{table}/{id}": (table, id) for table in _TABLES for id in model.table(table)}
    labels = {label: paths[0] for label, paths in _labels(model).items() if len(paths) == 1}
    return found | {label: found[path] for label, path in labels.items()}


def _labels(model: Model) -> dict[str, list[str]]:
    """Return the paths of the elements that may be inputs, by label."""
    labels: dict[str, list[str]] = {}
    for table in _TABLES:
        for id, element in model.table(table).items():
            if element.label:
                labels.setdefault(element.label, []).append(f"{table}/{id}")
    return labels


def _named(model: Model, name: str, holding: Mapping[int, str]) -> tuple[str, int]:
    """Return the element of an input that the caller names; refuse what cannot be one."""
    known = _names(model)
    if name not in known:
        near = nearest(name, known)
        hint = f"; did you mean {' or '.join(near)}?" if near else f"; there is {', '.join(known)}"
        alike = _labels(model).get(name)
        hint = f"; {' and '.join(alike)} have this label" if alike else hint
        raise ModelError(f"inputs: no variable and no motion {name!r}{hint}")
    table, id = known[name]
    element = model.table(table)[id]
    where = f"{model.file}:{element.source.line}: "
    where += element_name(model.file, getattr(element, "statement", _TABLES[table]), id)
    if table == "motions" and element.val_type == "D":
        raise ModelError(
            f"{where}: as an input, its displacement would jump, and bodies with it; let it give a "
            'velocity or an acceleration: val_type="V" or "A"'
        )
    if table == "variables" and id in holding:
        raise ModelError(
            f"{where}: cannot be an input: positions depend on it by {holding[id]}, and would jump"
        )
    return table, id


def with_inputs(model: Model, names: Sequence[str]) -> tuple[Model, dict[str, int]]:
    """Return the model with its inputs, and which input each name stands for.

    Parameters
    ----------
    model : Model
    names : sequence of str
        Labels or paths, ``torque`` or ``variables/3``, of variables and motions to be set from
        outside; beside them every variable whose expression is a number can be.
    """
    holding = _holding(model)
    chosen = {
        ("variables", id): variable.expr.root.value
        for id, variable in model.variables.items()
        if isinstance(variable.expr.root, Number) and id not in holding
    }
    for element in (_named(model, name, holding) for name in names):
        root = model.table(element[0])[element[1]].expr.root
        chosen[element] = root.value if isinstance(root, Number) else 0.0
    rows = {element: k for k, element in enumerate(chosen)}
    inputs = tuple(InputElement(*element, value) for element, value in chosen.items())
    found = {name: rows[element] for name, element in _names(model).items() if element in rows}
    return replace(model, inputs=inputs), found


class Inputs(MutableMapping[str, float]):
    """The inputs of a run by name, as numbers; what is set holds from the present time on.

    Labels and paths (``variables/3``) both find them; iteration gives each once.
    """

    def __init__(
        self, model: Model, scene: Scene, names: Mapping[str, int], changed: Callable[[int], None]
    ) -> None:
        self._rows, self._changed, self._labels = names, changed, _labels(model)
        self._count = len(model.inputs)
        self._shown = {k: name for name, k in names.items()}  # the label, where there is one
        self.look_at(scene)

    def look_at(self, scene: Scene) -> None:
        """Find the places of inputs in the programs that hold from here on."""
        programs = scene.programs
        self._number, self._operand = programs.number, programs.operand
        code = programs.quick
        numbers = code[:, CODE_OPERATION] == NUMBER
        # operands of shortened instructions are no rows
        self._places = [
            np.flatnonzero(numbers & (code[:, CODE_OPERAND] == k)).tolist()
            for k in range(self._count)
        ]
        self.timed = _beside_time(scene, self._count)

    @property
    def values_now(self) -> tuple[float, ...]:
        """The numbers of all inputs, in the model's order."""
        return tuple(self._number[: self._count].tolist())

    def put(self, row: int, value: float) -> None:
        """Write the number of an input."""
        self._number[row] = value
        for place in self._places[row]:
            self._operand[place] = value

    def __getitem__(self, name: str) -> float:
        return float(self._number[self.row_of(name)])

    def __setitem__(self, name: str, value: float) -> None:
        row = self._rows.get(name)
        if row is None:
            row = self.row_of(name)
        value = float(value)
        if value == self._number[row]:
            return
        if not math.isfinite(value):
            raise ModelError(f"inputs[{name!r}] = {value}: must be a finite number")
        self.put(row, value)
        self._changed(row)

    def __delitem__(self, name: str) -> None:
        raise TypeError("inputs are the model's: their values can be set, none taken out")

    def __contains__(self, name: object) -> bool:
        return name in self._rows

    def __iter__(self) -> Iterator[str]:
        return (self._shown[k] for k in sorted(self._shown))

    def __len__(self) -> int:
        return len(self._shown)

    def __repr__(self) -> str:
        return repr(dict(self))

    def _ipython_key_completions_(self) -> list[str]:
        return list(self)

    def row_of(self, name: str) -> int:
        """Return the row of an input."""
        if name in self._rows:
            return self._rows[name]
        near = nearest(name, self._rows)
        there = f"there is {', '.join(self)}." if self._rows else "there is none."
        hint = f"did you mean {' or '.join(near)}?" if near else there
        if len(alike := self._labels.get(name, ())) > 1:
            hint = f"{' and '.join(alike)} have this label."
        raise ModelError(
            f"no input {name!r}; {hint} A variable whose expression is no number, and a motion, "
            "is one where mbsim.open(..., inputs=[...]) names it"
        )


def _beside_time(scene: Scene, count: int) -> frozenset[int]:
    """Return the inputs in whose programs TIME stands as well."""
    programs: Any = scene.programs
    found: set[int] = set()
    for first, end in zip(programs.start[:-1], programs.start[1:], strict=True):
        code = programs.code[first:end]
        if (code[:, CODE_OPERATION] == TIME).any():
            rows = code[code[:, CODE_OPERATION] == NUMBER, CODE_OPERAND]
            found.update(rows[rows < count].tolist())
    return frozenset(found)
