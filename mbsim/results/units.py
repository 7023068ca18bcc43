"""Quantities, the model's units of them, and how units convert."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from mbsim.reader import units as u

#: How names of units are written; the others are written as their names in lower case.
SYMBOLS = {
    "NEWTON": "N",
    "KNEWTON": "kN",
    "MEGANEWTON": "MN",
    "CENTINEWTON": "cN",
    "MILLINEWTON": "mN",
    "MICRONEWTON": "µN",
    "NANONEWTON": "nN",
    "DYNE": "dyn",
    "KILOGRAM_FORCE": "kgf",
    "POUND_FORCE": "lbf",
    "KPOUND_FORCE": "klbf",
    "OUNCE_FORCE": "ozf",
    "POUNDAL": "pdl",
    "METER": "m",
    "MILLIMETER": "mm",
    "CENTIMETER": "cm",
    "KILOMETER": "km",
    "MICROMETER": "µm",
    "NANOMETER": "nm",
    "ANGSTROM": "Å",
    "INCH": "in",
    "FOOT": "ft",
    "YARD": "yd",
    "MILE": "mi",
    "MILS": "mil",
    "MICROINCH": "µin",
    "SECOND": "s",
    "MILLISECOND": "ms",
    "MICROSECOND": "µs",
    "NANOSECOND": "ns",
    "MINUTE": "min",
    "HOUR": "h",
    "DAY": "d",
}


@dataclass(frozen=True)
class Quantity:
    """What is measured, and the powers of force, length, time and radian in its unit."""

    name: str
    force: int = 0
    length: int = 0
    time: int = 0
    angle: int = 0


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
    """The model's units of force, length and time, by MotionSolve's names."""

    force: str = "NEWTON"
    length: str = "METER"
    time: str = "SECOND"

    @classmethod
    def of(cls, attributes: Mapping[str, Any]) -> UnitSystem:
        """Return the units of a result file: `units` holds force, mass, length, time."""
        words = str(attributes.get("units", "")).split()
        return cls(words[0], words[2], words[3]) if len(words) == 4 else cls()

    @property
    def summary(self) -> str:
        """Return the units in short: ``N, m, s``."""
        return ", ".join(SYMBOLS.get(n, n.lower()) for n in (self.force, self.length, self.time))

    def text(self, quantity: Quantity) -> str:
        """Return the unit of a quantity as it stands on an axis; empty if it has none."""
        force, length, time = (
            SYMBOLS.get(name, name.lower()) for name in (self.force, self.length, self.time)
        )
        # torques keep their N m
        if quantity == ENERGY and (force, length) == ("N", "m"):
            return "J"
        powers = [
            (force, quantity.force),
            ("rad", quantity.angle),
            (length, quantity.length),
            (time, quantity.time),
        ]
        over = "·".join(_power(unit, power) for unit, power in powers if power > 0)
        under = "·".join(_power(unit, -power) for unit, power in powers if power < 0)
        return f"{over or '1'}/{under}" if under else over

    def factor_to(self, other: UnitSystem, quantity: Quantity) -> float:
        """Return what a value in these units is multiplied with to be one in the others."""
        factor = (
            (u.FORCE[self.force] / u.FORCE[other.force]) ** quantity.force
            * (u.LENGTH[self.length] / u.LENGTH[other.length]) ** quantity.length
            * (u.TIME[self.time] / u.TIME[other.time]) ** quantity.time
        )
        return float(Fraction(factor))


def _power(unit: str, power: int) -> str:
    """Return a unit with its exponent."""
    return unit + {1: "", 2: "²", 3: "³"}.get(power, f"^{power}")
