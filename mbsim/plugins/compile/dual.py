"""Numbers that carry a derivative: what Python code makes of an argument, on its branch.

A difference does not see f'/k beside x' where k is large; a derivative does. Functions of `math`
drop it, as `float` does: then differences have to do.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any


class Dual(float):
    """A float with its derivative `d` by one argument."""

    d: float

    def __new__(cls, value: float, d: float) -> Dual:
        """Return a number with its derivative."""
        made = super().__new__(cls, value)
        made.d = d
        return made


def slope(value: Any) -> float:
    """Return the derivative of a number, 0 of one that has none."""
    return value.d if isinstance(value, Dual) else 0.0


def _put(name: str, rule: Callable[[float, float, float, float], float]) -> None:
    """Add an operation of two numbers; `rule` takes both and their derivatives."""
    plain, reflected = getattr(float, f"__{name}__"), getattr(float, f"__r{name}__")

    def forward(self: Dual, other: Any) -> Any:
        if not isinstance(other, (int, float)):
            return NotImplemented
        found = plain(self, other)
        # a power may be complex
        made = isinstance(found, float)
        return Dual(found, rule(float(self), float(other), self.d, slope(other))) if made else found

    def backward(self: Dual, other: Any) -> Any:
        if not isinstance(other, (int, float)):
            return NotImplemented
        found = reflected(self, other)
        made = isinstance(found, float)
        return Dual(found, rule(float(other), float(self), slope(other), self.d)) if made else found

    setattr(Dual, f"__{name}__", forward)
    setattr(Dual, f"__r{name}__", backward)


def _power(a: float, b: float, da: float, db: float) -> float:
    """Return the derivative of a ** b, where there is one."""
    by_base = b * a ** (b - 1.0) * da if da != 0.0 and (a != 0.0 or b >= 1.0) else 0.0
    return by_base + (a**b * math.log(a) * db if db != 0.0 and a > 0.0 else 0.0)


_put("add", lambda a, b, da, db: da + db)
_put("sub", lambda a, b, da, db: da - db)
_put("mul", lambda a, b, da, db: da * b + a * db)
_put("truediv", lambda a, b, da, db: da / b - a / b * (db / b))
_put("pow", _power)


def _negative(self: Dual) -> Dual:
    return Dual(-float(self), -self.d)


def _absolute(self: Dual) -> Dual:
    return Dual(abs(float(self)), math.copysign(1.0, self) * self.d)


for _name, _function in (
    ("__neg__", _negative),
    ("__abs__", _absolute),
    ("__pos__", lambda self: self),
):
    setattr(Dual, _name, _function)
