"""Names of `mbsim request` that are of elements between markers: what rows have of them.

``Constraint_Joint[1].force``, ``Force_Element[3].bristle``: as the result file has them; what an
element's subroutine names by `espy`, ``Force_Scalar_TwoBody[1].stretch``; and of dry friction
whether it sticks, ``Force_DryFriction[1].mode``.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from mbsim.errors import ModelError
from mbsim.forces.catalog import FORCES, ForceKind
from mbsim.reader.keywords import fold
from mbsim.results.elements import GROUPS
from mbsim.results.names import PARTS, parts_of

if TYPE_CHECKING:
    from mbsim.model.elements import Model
    from mbsim.results.reading import Results

Value = float | str
#: What subroutines name at every row, by statement and id.
Espied = Sequence[Mapping[tuple[str, int], Mapping[str, Value]]]
_NAME = re.compile(r"([A-Za-z]\w*)\[(\d+)\]\.([A-Za-z_]\w*)(?:/(\w+))?")
_CONTACT = "Force_Contact"
#: Groups of a result file by statements' names, folded.
_PATHS = {fold(group.title): group.path for group in GROUPS.values() if group.title != _CONTACT}
_PATHS |= {fold("Motion_Marker"): "motions", fold("Control_Diff"): "diffs"}


def is_of_element(name: str) -> bool:
    """Return whether a name is of an element, and not of a contact."""
    match = _NAME.fullmatch(name.strip())
    return match is not None and fold(match[1]) != fold(_CONTACT)


def columns_of(
    results: Results, name: str, espied: Callable[[], Espied], model: Callable[[], Model]
) -> dict[str, list[Value]]:
    """Return the columns that a name stands for.

    Parameters
    ----------
    results : Results
    name : str
        For which `is_of_element` holds.
    espied : callable
        Evaluates all rows again: called where the file has no such signal.
    model : callable
        Returns the model of the run.

    Raises
    ------
    ModelError
        If there is no such element or signal.
    """
    match = _NAME.fullmatch(name.strip())
    assert match is not None
    statement, id, signal, part = match.groups()
    path = f"{_PATHS.get(fold(statement), '')}/{id}/"
    signals = results.signals()
    stored = {each[len(path) :]: n for each, n in signals.items() if each.startswith(path)}
    if signal in stored:
        return _stored(results, name.strip(), f"{path}{signal}", stored[signal], part or "")
    kinds = (FORCES[each] for each in FORCES)
    kind = next((each for each in kinds if path == f"{each.path}/{id}/"), None)
    if kind is not None and signal in kind.told and stored and not part:
        return {name.strip(): _told(results, path, model(), kind, int(id), signal)}
    rows = espied()
    found = [
        signals
        for row in rows
        for (one, number), signals in row.items()
        if (fold(one), number) == (fold(statement), int(id))
    ]
    known = dict.fromkeys(key for signals in found for key in signals)
    if signal not in known or part:
        there = ", ".join((*stored, *known))
        if not there:
            raise ModelError(f"{name}: no such element, or nothing is recorded of it")
        raise ModelError(f"{name}: no such signal; there are {there}")
    values = [signals.get(signal) for signals in found]
    text = any(isinstance(value, str) for value in values)
    return {name.strip(): [("" if text else math.nan) if v is None else v for v in values]}


def _told(
    results: Results, path: str, model: Model, kind: ForceKind, id: int, signal: str
) -> list[Value]:
    """Return what a kind of forces tells of the rows of an element."""
    if any(each.changes or each.inactive for each in model.simulations):
        name = f"{kind.statement}[{id}].{signal}"
        raise ModelError(f"{name}: not known where <Command> changes elements")
    wrench = (np.asarray(results[f"{path}{each}"]).reshape(-1, 3) for each in ("force", "torque"))
    return list(kind.told[signal](model.table(kind.name)[id].values, *wrench))


def _stored(
    results: Results, name: str, stored: str, numbers: int, part: str
) -> dict[str, list[Value]]:
    """Return a signal of the file, by components where it has several."""
    table = np.asarray(results[stored], dtype=np.float64)
    if numbers == 1:
        if part:
            raise ModelError(f"{name}: no such part; it is one number")
        return {name: table.tolist()}
    parts = parts_of(numbers)
    if part and part not in parts:
        raise ModelError(f"{name}: no such part; there are /{', /'.join(parts)}")
    if part == "mag":
        return {name: np.linalg.norm(table, axis=1).tolist()}
    if part:
        return {name: table[:, PARTS[numbers][part]].tolist()}
    return {f"{name}/{each}": table[:, k].tolist() for each, k in PARTS[numbers].items()}
