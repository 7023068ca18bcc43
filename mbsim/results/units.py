"""Quantities, the model's units of them, and how units convert."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from mbsim.errors import ModelError
from mbsim.reader import units as u


@dataclass(frozen=True)
class Quantity:
    """What is measured, and the powers of force, length, time, radian and mass in its unit.

    `per` is what else it is divided by: a number whose unit is not known.
    """

    name: str
    force: int = 0
    length: int = 0
    time: int = 0
    angle: int = 0
    mass: int = 0
    per: str = ""


TIME = Quantity("Time", time=1)
INCIDENTS = Quantity("Number of incidents")
POSITION = Quantity("Position", length=1)
VELOCITY = Quantity("Velocity", length=1, time=-1)
ACCELERATION = Quantity("Acceleration", length=1, time=-2)
SPIN = Quantity("Angular velocity", time=-1, angle=1)
ENERGY = Quantity("Energy", force=1, length=1)
FORCE = Quantity("Force", force=1)
TORQUE = Quantity("Torque", force=1, length=1)


@dataclass(frozen=True)
class UnitSystem:
    """The model's units of force, length, time and mass, by MotionSolve's names."""

    force: str = "NEWTON"
    length: str = "METER"
    time: str = "SECOND"
    mass: str = "KILOGRAM"

    @classmethod
    def of(cls, attributes: Mapping[str, Any]) -> UnitSystem:
        """Return the units of a result file: `units` holds force, mass, length, time."""
        words = str(attributes.get("units", "")).split()
        return cls(words[0], words[2], words[3], words[1]) if len(words) == 4 else cls()

    @property
    def summary(self) -> str:
        """Return the units in short: ``N, m, s``."""
        return ", ".join(u.symbol(n) for n in (self.force, self.length, self.time))

    def text(self, quantity: Quantity) -> str:
        """Return the unit of a quantity as it stands on an axis; empty if it has none."""
        force, length, time = (u.symbol(name) for name in (self.force, self.length, self.time))
        # torques keep their N m
        if quantity == ENERGY and (force, length) == ("N", "m"):
            return "J"
        powers = [
            (force, quantity.force),
            ("rad", quantity.angle),
            (length, quantity.length),
            (time, quantity.time),
            (u.symbol(self.mass), quantity.mass),
        ]
        over = "·".join(_power(unit, power) for unit, power in powers if power > 0)
        below = [_power(unit, -power) for unit, power in powers if power < 0]
        below += [quantity.per] if quantity.per else []
        under = "·".join(below) if len(below) < 2 else f"({'·'.join(below)})"
        return f"{over or '1'}/{under}" if under else over

    def factor_to(self, other: UnitSystem, quantity: Quantity) -> float:
        """Return what a value in these units is multiplied with to be one in the others.

        Raises
        ------
        ModelError
            If the quantity is divided by a number whose unit is not known.
        """
        if quantity.per and self != other:
            raise ModelError(
                f"{quantity.name}: the unit of {quantity.per} is not known, so it cannot be shown "
                f"in {other.summary}; give runs in the same units"
            )
        factor = (
            (u.FORCE[self.force] / u.FORCE[other.force]) ** quantity.force
            * (u.LENGTH[self.length] / u.LENGTH[other.length]) ** quantity.length
            * (u.TIME[self.time] / u.TIME[other.time]) ** quantity.time
            * (u.MASS[self.mass] / u.MASS[other.mass]) ** quantity.mass
        )
        return float(Fraction(factor))


def _power(unit: str, power: int) -> str:
    """Return a unit with its exponent."""
    return unit + {1: "", 2: "²", 3: "³"}.get(power, f"^{power}")


#: Units in SI by what may be written: factor, and powers of force, length, time and radian.
_WRITTEN: dict[str, tuple[float, tuple[int, int, int, int]]] = {
    written: (float(factor), powers)
    for table, powers in (
        (u.FORCE, (1, 0, 0, 0)),
        (u.LENGTH, (0, 1, 0, 0)),
        (u.TIME, (0, 0, 1, 0)),
    )
    for name, factor in table.items()
    for written in (u.symbol(name), name.lower())
} | {
    "um": (1e-6, (0, 1, 0, 0)),
    "us": (1e-6, (0, 0, 1, 0)),
    "J": (1.0, (1, 1, 0, 0)),
    "rad": (1.0, (0, 0, 0, 1)),
    "deg": (math.pi / 180.0, (0, 0, 0, 1)),
    "1": (1.0, (0, 0, 0, 0)),
}
_FACTOR = re.compile(r"([^\W\d\u00b2\u00b3]+|1)\s*(?:\^?\s*(\d)|([\u00b2\u00b3]))?")


def in_si(unit: str) -> tuple[float, tuple[int, ...]]:
    """Return what a unit is in SI, and its powers of force, length, time and radian.

    Parameters
    ----------
    unit : str
        ``mm``, ``m/s``, ``rad/s^2``, ``N*m``: symbols or names of Param_Unit, what follows a slash
        being divided by.

    Raises
    ------
    ValueError
        If it is no unit; the message says which part is not known.
    """
    factor, powers = 1.0, [0, 0, 0, 0]
    for place, part in enumerate(unit.split("/")):
        sign = 1 if place == 0 else -1
        for word in re.split(r"[*\u00b7\s]+", part.strip()):
            found = _FACTOR.fullmatch(word)
            if found is None or found[1] not in _WRITTEN:
                raise ValueError(f"{word!r} is not known; units are such as mm, m/s, N*m, deg, ms")
            raised = int(found[2] or {"\u00b2": 2, "\u00b3": 3}.get(found[3] or "", 1))
            one, each = _WRITTEN[found[1]]
            factor *= one ** (sign * raised)
            powers = [old + sign * raised * new for old, new in zip(powers, each, strict=True)]
    return factor, tuple(powers)


def factor_from(unit: str, quantity: Quantity, model: UnitSystem) -> float:
    """Return what a number in `unit` is multiplied with to be one in the model's units.

    Raises
    ------
    ValueError
        If it is no unit, or one of another quantity; the message says what is allowed.
    """
    factor, powers = in_si(unit)
    wanted = (quantity.force, quantity.length, quantity.time, quantity.angle)
    if powers != wanted:
        allowed = model.text(quantity)
        what = f"is measured in units such as {allowed}" if allowed else "has no known unit"
        raise ValueError(f"{unit!r} does not fit: {quantity.name.lower()} {what}")
    return factor / (
        float(u.FORCE[model.force]) ** quantity.force
        * float(u.LENGTH[model.length]) ** quantity.length
        * float(u.TIME[model.time]) ** quantity.time
    )
