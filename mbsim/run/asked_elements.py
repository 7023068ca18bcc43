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
from mbsim.reader.keywords import fold
from mbsim.results.elements import GROUPS
from mbsim.results.names import PARTS, parts_of

if TYPE_CHECKING:
    from mbsim.model.elements import Model
    from mbsim.results.reading import Results

Value = float | str
#: What subroutines name at every row, by statement and id.
Espied = Sequence[Mapping[tuple[str, int], Mapping[str, Value]]]
#: Dry friction slips where its force is that of slip but for so many parts of it: it is turned into
#: the global frame, and stored.
ROUNDED = 1e-12
_NAME = re.compile(r"([A-Za-z]\w*)\[(\d+)\]\.([A-Za-z_]\w*)(?:/(\w+))?")
_CONTACT, _DRY, _KIND = "Force_Contact", "dry_frictions", "DRYFRICTION"
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
    if path.startswith(f"{_DRY}/") and signal == "mode" and stored and not part:
        return {name.strip(): _dry_modes(results, path, model(), int(id))}
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


def _dry_modes(results: Results, path: str, model: Model, id: int) -> list[Value]:
    """Return stick or slip of a Force_DryFriction: in slip its force is `friction`, else it is not.

    What sticks after friction_static holds more than that, what sticks else less.
    """
    if any(each.changes or each.inactive for each in model.simulations):
        raise ModelError(
            f"Force_DryFriction[{id}].mode: not known where <Command> changes elements"
        )
    values = model.table(_KIND)[id].values
    turns = str(values["type"]).startswith("R")
    force = results[f"{path}torque" if turns else f"{path}force"]
    size = np.linalg.norm(np.atleast_2d(np.asarray(force, dtype=np.float64)), axis=1)
    slips = np.abs(size - values["friction"]) <= ROUNDED * values["friction"]
    return ["slip" if each else "stick" for each in slips]


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
