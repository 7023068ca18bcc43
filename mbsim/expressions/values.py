"""Elementary functions of numbers: what `elementary` does, without derivatives.

Forces and requests need values alone, and these cost a tenth of jets. Every operation is done in
the order in which the jets do it, so that both give the same bits
(tests/contracts/test_values_of_jets.py).
"""

from __future__ import annotations

import math

from mbsim.core.arrays import F1
from mbsim.core.jitable import jitable
from mbsim.expressions.elementary import (
    ABS,
    ACOS,
    ADD,
    AINT,
    ASIN,
    ATAN,
    ATAN2,
    BISTOP,
    CHEBY,
    COS,
    COSH,
    DIV,
    EXP,
    FORCOS,
    FORSIN,
    HAVSIN,
    IF,
    LOG,
    LOG10,
    MAX,
    MIN,
    MOD,
    MUL,
    NEG,
    POLY,
    POW,
    SHF,
    SIGN,
    SIN,
    SINH,
    SQRT,
    STEP,
    STEP5,
    SUB,
    SWEEP,
    TAN,
    TANH,
    towards_zero,
)


@jitable
def power_value(x: float, n: float) -> float:
    """Return x^n."""
    return x * x if n == 2.0 else math.pow(x, n)


@jitable
def blend_value(x: float, x0: float, h0: float, x1: float, h1: float, fifth: bool) -> float:
    """Return STEP or, if `fifth`, STEP5."""
    if x <= x0:
        return h0
    if x >= x1:
        return h1
    a = (x - x0) / (x1 - x0)
    if fifth:
        return h0 + (h1 - h0) * (a * a * a * (10.0 + a * (6.0 * a - 15.0)))
    return h0 + (h1 - h0) * (a * a * (3.0 - 2.0 * a))


@jitable
def haversine_value(x: float, x0: float, h0: float, x1: float, h1: float) -> float:
    """Return HAVSIN."""
    if x <= x0:
        return h0
    if x >= x1:
        return h1
    angle = math.pi * ((x - x0) / (x1 - x0)) - 0.5 * math.pi
    return 0.5 * (h0 + h1) + 0.5 * ((h1 - h0) * math.sin(angle))


@jitable
def stop_value(
    depth: float, rate: float, stiffness: float, exponent: float, damping: float, dmax: float
) -> float:
    """Return max(0, k d^e + STEP(d, 0, 0, dmax, c) d'), 0 without depth."""
    if depth <= 0.0:
        return 0.0
    damper = blend_value(depth, 0.0, 0.0, dmax, damping, False) * rate
    force = stiffness * power_value(depth, exponent) + damper
    return force if force > 0.0 else 0.0


@jitable
def two_stops_value(s: F1, at: int) -> float:
    """Return BISTOP."""
    low = stop_value(s[at + 2] - s[at], -s[at + 1], s[at + 4], s[at + 5], s[at + 6], s[at + 7])
    high = stop_value(s[at] - s[at + 3], s[at + 1], s[at + 4], s[at + 5], s[at + 6], s[at + 7])
    return low - high


@jitable
def polynomial_value(s: F1, at: int, count: int) -> float:
    """Return POLY."""
    x, total = s[at] - s[at + 1], s[at + count - 1]
    for k in range(count - 2, 1, -1):
        total = total * x + s[at + k]
    return total


@jitable
def chebyshev_value(s: F1, at: int, count: int) -> float:
    """Return CHEBY."""
    x = s[at] - s[at + 1]
    before, now, total = x, 1.0, 0.0
    for k in range(2, count):
        total += s[at + k] * now
        before, now = now, 2.0 * (x * now) - before
    return total


@jitable
def fourier_value(s: F1, at: int, count: int, sines: bool) -> float:
    """Return FORSIN or FORCOS."""
    angle, total = s[at + 2] * (s[at] - s[at + 1]), s[at + 3]
    for k in range(4, count):
        turned = float(k - 3) * angle
        total += s[at + k] * (math.sin(turned) if sines else math.cos(turned))
    return total


@jitable
def harmonic_value(s: F1, at: int, count: int) -> float:
    """Return SHF."""
    angle = s[at + 3] * (s[at] - s[at + 1])
    if count > 4:
        angle -= s[at + 4]
    wave = s[at + 2] * math.sin(angle)
    return wave + s[at + 5] if count > 5 else wave


@jitable
def chirp_value(s: F1, at: int) -> float:
    """Return SWEEP."""
    x, x0, f0, x1, f1 = s[at], s[at + 2], s[at + 3], s[at + 4], s[at + 5]
    if x <= x0:
        cycles = f0 * x
    elif x < x1:
        way = x - x0
        cycles = f0 * x + (f1 - f0) / (2.0 * (x1 - x0)) * (way * way)
    else:
        cycles = f1 * x - 0.5 * ((f1 - f0) * (x1 + x0))
    on = blend_value(x, x0, 0.0, x0 + s[at + 6], 1.0, True)
    return on * s[at + 1] * math.sin(2.0 * math.pi * cycles)


@jitable
def extreme_value(s: F1, at: int, count: int, sign: float) -> float:
    """Return the largest (sign 1) or smallest (-1) of `count` numbers."""
    best = s[at]
    for k in range(at + 1, at + count):
        if sign * s[k] > sign * best:
            best = s[k]
    return best


@jitable
def value_of_one(op: int, x: float) -> float:  # noqa: C901
    """Return a function of one number.

    Many branches because of a chain of equalities a table of jumps is made.
    """
    if op == NEG:
        return -x
    if op == ABS:
        return abs(x)
    if op == SIN:
        return math.sin(x)
    if op == COS:
        return math.cos(x)
    if op == TAN:
        return math.tan(x)
    if op == ASIN:
        return math.asin(x)
    if op == ACOS:
        return 0.5 * math.pi - math.asin(x)
    if op == ATAN:
        return math.atan(x)
    if op == SINH:
        return math.sinh(x)
    if op == COSH:
        return math.cosh(x)
    if op == TANH:
        return math.tanh(x)
    if op == EXP:
        return math.exp(x)
    if op == LOG:
        return math.log(x)
    if op == LOG10:
        return math.log10(x)
    if op == SQRT:
        return math.sqrt(x)
    if op == AINT:
        return towards_zero(x)
    return math.copysign(towards_zero(abs(x) + 0.5), x)


@jitable
def value_of_two(op: int, x: float, y: float) -> float:
    """Return a function of two numbers that is neither a sum nor a product."""
    if op == POW:
        return power_value(x, y)
    if op == ATAN2:
        return math.atan2(x, y) if x != 0.0 or y != 0.0 else 0.0
    if op == MOD:
        return x - towards_zero(x / y) * y
    if op == SIGN:
        return abs(x) if y >= 0.0 else -abs(x)
    # DIM
    return x - y if x > y else 0.0


@jitable
def value_of_many(op: int, s: F1, at: int, count: int) -> float:
    """Return a function of the `count` numbers that stand from `at` on."""
    if op == STEP or op == STEP5:
        return blend_value(s[at], s[at + 1], s[at + 2], s[at + 3], s[at + 4], op == STEP5)
    if op == IF:
        return s[at + 1] if s[at] < 0.0 else (s[at + 2] if s[at] == 0.0 else s[at + 3])
    if op == MIN:
        return extreme_value(s, at, count, -1.0)
    if op == MAX:
        return extreme_value(s, at, count, 1.0)
    if op == POLY:
        return polynomial_value(s, at, count)
    if op == CHEBY:
        return chebyshev_value(s, at, count)
    if op == FORSIN:
        return fourier_value(s, at, count, True)
    if op == FORCOS:
        return fourier_value(s, at, count, False)
    if op == SHF:
        return harmonic_value(s, at, count)
    if op == BISTOP:
        return two_stops_value(s, at)
    if op == SWEEP:
        return chirp_value(s, at)
    if op == HAVSIN:
        return haversine_value(s[at], s[at + 1], s[at + 2], s[at + 3], s[at + 4])
    # IMPACT
    depth = s[at + 2] - s[at]
    return stop_value(depth, -s[at + 1], s[at + 3], s[at + 4], s[at + 5], s[at + 6])


@jitable
def apply_value(op: int, count: int, s: F1, top: int) -> int:
    """Replace the `count` topmost of `top` numbers by a function of them; return the new top."""
    at = top - count
    if op == ADD:
        s[at] = s[at] + s[at + 1]
    elif op == SUB:
        s[at] = s[at] - s[at + 1]
    elif op == MUL:
        s[at] = s[at] * s[at + 1]
    elif op == DIV:
        s[at] = s[at] / s[at + 1]
    elif count == 1:
        s[at] = value_of_one(op, s[at])
    elif op == MIN or op == MAX or count > 2:
        s[at] = value_of_many(op, s, at, count)
    else:
        s[at] = value_of_two(op, s[at], s[at + 1])
    return at + 1
