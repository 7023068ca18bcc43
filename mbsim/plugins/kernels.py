"""What a compiled user function calls in place of the names that it wrote.

Compiled arithmetic returns nan or inf where Python raises; a branch on that number would
then go on quietly. These functions raise as Python does, so that a compiled function
fails at the inputs at which the interpreted one fails.
"""

from __future__ import annotations

import math

from mbsim.core.blend import step5_derivative, step_derivative
from mbsim.core.jitable import jitable


@jitable
def mbsim_step(
    x: float, x0: float, h0: float, x1: float, h1: float, order: int
) -> tuple[float, int]:
    """Return the value of STEP or its derivative, and 0, or 1 if there is none."""
    if order < 0 or order > 2 or not x1 > x0:
        return (0.0, 1)
    return (float(step_derivative(float(x), float(x0), float(h0), float(x1), float(h1), order)), 0)


@jitable
def mbsim_step5(
    x: float, x0: float, h0: float, x1: float, h1: float, order: int
) -> tuple[float, int]:
    """Return the value of STEP5 or its derivative, and 0, or 1 if there is none."""
    if order < 0 or order > 2 or not x1 > x0:
        return (0.0, 1)
    return (float(step5_derivative(float(x), float(x0), float(h0), float(x1), float(h1), order)), 0)


@jitable
def mbsim_int(x: float) -> int:
    """Return int(x); Python refuses what is not finite."""
    if not math.isfinite(x):
        raise ValueError("cannot convert to integer")
    return int(x)


@jitable
def mbsim_floor(x: float) -> int:
    """Return floor(x) of a finite x."""
    if not math.isfinite(x):
        raise ValueError("cannot convert to integer")
    return math.floor(x)


@jitable
def mbsim_ceil(x: float) -> int:
    """Return ceil(x) of a finite x."""
    if not math.isfinite(x):
        raise ValueError("cannot convert to integer")
    return math.ceil(x)


@jitable
def mbsim_trunc(x: float) -> int:
    """Return trunc(x) of a finite x."""
    if not math.isfinite(x):
        raise ValueError("cannot convert to integer")
    return math.trunc(x)


@jitable
def mbsim_sqrt(x: float) -> float:
    """Return sqrt(x), x >= 0 (nan goes through, as in Python)."""
    if x < 0.0:
        raise ValueError("math domain error")
    return math.sqrt(x)


@jitable
def mbsim_power(x: float, y: float) -> float:
    """Return x**y; complex results and division by zero are errors here."""
    if (x == 0.0 and y < 0.0) or (x < 0.0 and y != math.floor(y)):
        raise ValueError("math domain error")
    value = math.pow(x, y)
    if math.isinf(value) and not (math.isinf(x) or math.isinf(y)):
        raise ValueError("math range error")
    return value


@jitable
def _checked(value: float, x: float) -> float:
    """Return `value`, a function of x, unless x is fine and the value is not."""
    if not math.isfinite(value) and not math.isnan(x):
        if math.isnan(value) or not math.isinf(x):
            raise ValueError("math domain or range error")
    return value


@jitable
def mbsim_hypot(x: float, y: float) -> float:
    """Return hypot(x, y)."""
    return _checked(math.hypot(x, y), x + y)


@jitable
def mbsim_fmod(x: float, y: float) -> float:
    """Return fmod(x, y)."""
    return _checked(math.fmod(x, y), x + y)


@jitable
def mbsim_log(x: float) -> float:
    """Return log(x), x > 0."""
    return _checked(math.log(x), x)


@jitable
def mbsim_log10(x: float) -> float:
    """Return log10(x), x > 0."""
    return _checked(math.log10(x), x)


@jitable
def mbsim_log1p(x: float) -> float:
    """Return log1p(x), x > -1."""
    return _checked(math.log1p(x), x)


@jitable
def mbsim_exp(x: float) -> float:
    """Return exp(x) unless it overflows."""
    return _checked(math.exp(x), x)


@jitable
def mbsim_expm1(x: float) -> float:
    """Return expm1(x) unless it overflows."""
    return _checked(math.expm1(x), x)


@jitable
def mbsim_sinh(x: float) -> float:
    """Return sinh(x) unless it overflows."""
    return _checked(math.sinh(x), x)


@jitable
def mbsim_cosh(x: float) -> float:
    """Return cosh(x) unless it overflows."""
    return _checked(math.cosh(x), x)


@jitable
def mbsim_sin(x: float) -> float:
    """Return sin(x) of a finite x."""
    return _checked(math.sin(x), x)


@jitable
def mbsim_cos(x: float) -> float:
    """Return cos(x) of a finite x."""
    return _checked(math.cos(x), x)


@jitable
def mbsim_tan(x: float) -> float:
    """Return tan(x) of a finite x."""
    return _checked(math.tan(x), x)


@jitable
def mbsim_asin(x: float) -> float:
    """Return asin(x), |x| <= 1."""
    return _checked(math.asin(x), x)


@jitable
def mbsim_acos(x: float) -> float:
    """Return acos(x), |x| <= 1."""
    return _checked(math.acos(x), x)


@jitable
def mbsim_acosh(x: float) -> float:
    """Return acosh(x), x >= 1."""
    return _checked(math.acosh(x), x)


@jitable
def mbsim_atanh(x: float) -> float:
    """Return atanh(x), |x| < 1."""
    return _checked(math.atanh(x), x)
