"""What a signal measures: its quantity."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import TYPE_CHECKING

from mbsim.model.request_types import TYPES
from mbsim.results.names import PARTS, of_slope
from mbsim.results.requests import measures_of
from mbsim.results.units import (
    ACCELERATION,
    ENERGY,
    FORCE,
    INCIDENTS,
    POSITION,
    SPIN,
    TIME,
    TORQUE,
    VELOCITY,
    Quantity,
)

if TYPE_CHECKING:
    from mbsim.model.elements import Model
    from mbsim.results.reading import Results

#: By the last word of a signal's name.
_BY_NAME = {
    "time": TIME,
    "position": POSITION,
    "quaternion": Quantity("Quaternion"),
    "velocity": VELOCITY,
    "angular_velocity": SPIN,
    "acceleration": ACCELERATION,
    "force": FORCE,
    "torque": TORQUE,
    "penetration": Quantity("Penetration", length=1),
    "slip_speed": Quantity("Slip speed", length=1, time=-1),
    "incidents": INCIDENTS,
    "value": Quantity("State"),
    "area": Quantity("Contact area", length=2),
    "kinetic": ENERGY,
    "potential": ENERGY,
    "dissipated": ENERGY,
    "work_of_motions": ENERGY,
}

#: By the measure of a request: `request_types.TYPES`, of an expression `requests.measures_of`.
_BY_MEASURE = {
    "displacement": Quantity("Displacement", length=1),
    "angle": Quantity("Angle", angle=1),
    "velocity": VELOCITY,
    "angular_velocity": SPIN,
    "acceleration": ACCELERATION,
    "angular_acceleration": Quantity("Angular acceleration", time=-2, angle=1),
    "force": FORCE,
    "torque": TORQUE,
}


def quantity_of(results: Results, dataset: str, column: int = 0) -> Quantity:
    """Return what a column of a signal measures; of an unknown one a quantity of its name."""
    parameter, signal = of_slope(dataset)
    if parameter:
        return by_parameter(quantity_of(results, signal, column), parameter)
    group, _, last = dataset.rpartition("/")
    if group == "requests":
        kind = str(results.attribute(dataset, "type") or "")
        if kind in TYPES and TYPES[kind].measures:
            return _BY_MEASURE[TYPES[kind].measures[column // 4]]
        measures = results.attribute(dataset, "measures")
        if measures is not None and measures[column] in _BY_MEASURE:
            return _BY_MEASURE[measures[column]]
        last = f"request {last}"
    known = _BY_NAME.get(last)
    return known or Quantity(last.replace("_", " ").capitalize())


#: A power in the unit of an attribute, as statements declare it: ``F T/L``, ``M L^2``.
_POWER = re.compile(r"(F|L|T|rad|M)(?:\^(\d))?")
_BASES = {"F": "force", "L": "length", "T": "time", "rad": "angle", "M": "mass"}


def by_parameter(quantity: Quantity, parameter: str) -> Quantity:
    """Return what the derivative of a quantity by a parameter of the deck measures."""
    attribute = parameter.rpartition(".")[2]
    name, powers = f"{quantity.name} by {attribute}", _powers_of(parameter)
    if powers is None:
        return replace(quantity, name=name, per=attribute)
    below = {base: getattr(quantity, base) - power for base, power in powers.items()}
    return replace(quantity, name=name, **below)


def _powers_of(parameter: str) -> dict[str, int] | None:
    """Return the powers in the unit of an attribute, None where it follows from something else."""
    from mbsim.reader.keywords import fold
    from mbsim.reader.statements import BY_KEY

    element, _, attribute = parameter.rpartition(".")
    statement = BY_KEY.get(fold(element.partition("[")[0]))
    declared = statement.spec_names.get(fold(attribute)) if statement is not None else None
    if statement is None or declared is None:
        return None
    spec = statement.attributes[declared]
    if not spec.unit:
        return {} if spec.kind.allowed.startswith("a number") else None
    powers = dict.fromkeys(_BASES.values(), 0)
    for sign, part in zip((1, -1), spec.unit.split("/"), strict=False):
        for word in part.split():
            found = _POWER.fullmatch(word)
            if found is None:  # as of a stiffness that goes with an exponent
                return None
            powers[_BASES[found[1]]] += sign * int(found[2] or 1)
    return powers


#: Signals of several columns; and what may follow the name of such a one.
_VECTORS = ("position", "quaternion", "velocity", "angular_velocity", "acceleration")
_WRENCHES = ("force", "torque")
_PARTS = {"mag", *(part for parts in PARTS.values() for part in parts)}


def quantity_in(model: Model, signal: str) -> tuple[Quantity, bool]:
    """Return what a signal of a model measures, and whether it is one column."""
    name, _, part = signal.strip("/").rpartition("/")
    whole = not name or part not in _PARTS
    if whole:
        name = signal.strip("/")
    group, _, last = name.rpartition("/")
    if group == "requests":
        request = model.requests.get(int(last)) if last.isdecimal() else None
        if whole or request is None or not part.startswith("F"):
            return Quantity(f"Request {last}"), False
        column = int(part[1:]) - 1
        if TYPES[request.type].measures:
            return _BY_MEASURE[TYPES[request.type].measures[column // 4]], True
        measure = measures_of(request)[column]
        return _BY_MEASURE.get(measure, Quantity(f"Request {last}")), True
    vector = last in (*_VECTORS, *_WRENCHES)
    return _BY_NAME.get(last, Quantity(last.replace("_", " ").capitalize())), vector != whole
