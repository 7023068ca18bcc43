"""Param_Unit: every documented unit name with its exact factor to SI.

Definitions: the international avoirdupois pound is 0.45359237 kg, the inch 0.0254 m,
standard gravity 9.80665 m/s^2; pound force, slug and slinch follow from these.
"""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction

from mbsim.model.elements import Units
from mbsim.reader.keywords import fold

_POUND = Fraction("0.45359237")
_GRAVITY = Fraction("9.80665")
_INCH = Fraction("0.0254")
_FOOT = 12 * _INCH
_POUND_FORCE = _POUND * _GRAVITY


def _table(**factors: Fraction | str | int) -> dict[str, Fraction]:
    """Return unit name -> exact factor to the SI unit."""
    return {name: Fraction(factor) for name, factor in factors.items()}


FORCE = _table(
    NEWTON=1,
    KNEWTON=1000,
    DYNE="1e-5",
    KILOGRAM_FORCE=_GRAVITY,
    POUND_FORCE=_POUND_FORCE,
    KPOUND_FORCE=1000 * _POUND_FORCE,
    OUNCE_FORCE=_POUND_FORCE / 16,
    POUNDAL=_POUND * _FOOT,
    CENTINEWTON="1e-2",
    MILLINEWTON="1e-3",
    MICRONEWTON="1e-6",
    MEGANEWTON=10**6,
    NANONEWTON="1e-9",
)
MASS = _table(
    KILOGRAM=1,
    GRAM="1e-3",
    MILLIGRAM="1e-6",
    MEGAGRAM=1000,
    TONNE=1000,
    MICROGRAM="1e-9",
    NANOGRAM="1e-12",
    POUND_MASS=_POUND,
    KPOUND_MASS=1000 * _POUND,
    OUNCE_MASS=_POUND / 16,
    SLUG=_POUND_FORCE / _FOOT,
    SLINCH=_POUND_FORCE / _INCH,
    US_TON=2000 * _POUND,
)
LENGTH = _table(
    METER=1,
    MILLIMETER="1e-3",
    CENTIMETER="1e-2",
    KILOMETER=1000,
    INCH=_INCH,
    FOOT=_FOOT,
    MILE=5280 * _FOOT,
    YARD=3 * _FOOT,
    MILS=_INCH / 1000,
    MICROINCH=_INCH / 10**6,
    MILLIINCH=_INCH / 1000,
    MICROMETER="1e-6",
    NANOMETER="1e-9",
    ANGSTROM="1e-10",
)
TIME = _table(
    SECOND=1,
    MILLISECOND="1e-3",
    MICROSECOND="1e-6",
    NANOSECOND="1e-9",
    MINUTE=60,
    HOUR=3600,
    DAY=86400,
)
#: How units are written; the others are written as their names in lower case.
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
    "KILOGRAM": "kg",
    "GRAM": "g",
    "MILLIGRAM": "mg",
    "MEGAGRAM": "Mg",
    "TONNE": "t",
    "MICROGRAM": "µg",
    "NANOGRAM": "ng",
    "POUND_MASS": "lb",
    "OUNCE_MASS": "oz",
    "SLUG": "slug",
}


def symbol(name: str) -> str:
    """Return how a unit is written: ``N``, ``mm``, ``slinch``."""
    return SYMBOLS.get(name, name.lower())


def names(table: Mapping[str, Fraction]) -> dict[str, str]:
    """Return folded spelling -> unit name of one table."""
    return {fold(name): name for name in table}


def make_units(
    force: str = "NEWTON",
    mass: str = "KILOGRAM",
    length: str = "METER",
    time: str = "SECOND",
    mass_mult_factor: float | None = None,
) -> Units:
    """Return the model's units with the factor on mass that makes F = m a hold.

    Parameters
    ----------
    force, mass, length, time : str
        Names out of the tables of this module.
    mass_mult_factor : float, optional
        The factor itself [-], > 0, in place of the one that follows from the names.

    Returns
    -------
    Units
        `mass_scale` = mass * length / time^2 / force, all in SI, rounded once.
    """
    scale = MASS[mass] * LENGTH[length] / TIME[time] ** 2 / FORCE[force]
    return Units(
        force=force,
        mass=mass,
        length=length,
        time=time,
        mass_scale=float(scale) if mass_mult_factor is None else mass_mult_factor,
        length_m=float(LENGTH[length]),
        time_s=float(TIME[time]),
    )
