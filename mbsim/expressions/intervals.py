"""Bounds of expressions of TIME over spans of time: interval arithmetic on jets.

A bound is a value with its first and second derivative, each an interval that holds all that they
are within the span, jumps left out; `level` says which derivative may jump there: 0 the value
itself, 1 its slope, 2 its curvature, SMOOTH none of them. All are arrays over the spans, so that
many are bounded at once. A span of no width gives the value at a point. Rounding is not enclosed:
a switch that only rounding reaches is none.

Source: R. E. Moore, R. B. Kearfott, M. J. Cloud, Introduction to Interval Analysis (2009).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from mbsim.expressions.bounds import (
    ALL,
    ONE,
    SMOOTH,
    ZERO,
    Array,
    Bound,
    Range,
    add,
    chain,
    either,
    either_range,
    exponential,
    holds,
    logarithm,
    minus_range,
    negative,
    number,
    over,
    plus_range,
    power,
    power_range,
    rising,
    scaled_range,
    square_range,
    sub,
    times,
    times_range,
    where,
    where_range,
)
from mbsim.expressions.elementary import CODES, LN10


def _sin(u: Range) -> Range:
    """Return the bounds of a sine: its ends, and 1 and -1 where it gets there."""
    low, high = np.sin(u.lo), np.sin(u.hi)
    turns = 2.0 * math.pi
    top = np.floor((u.hi - 0.5 * math.pi) / turns) >= np.ceil((u.lo - 0.5 * math.pi) / turns)
    bottom = np.floor((u.hi + 0.5 * math.pi) / turns) >= np.ceil((u.lo + 0.5 * math.pi) / turns)
    least = np.where(bottom, -1.0, np.minimum(low, high))
    most = np.where(top, 1.0, np.maximum(low, high))
    lost = ~(np.abs(u.lo) < 1e15) | ~(np.abs(u.hi) < 1e15)
    return where_range(lost, Range(-1.0, 1.0), Range(least, most))


def _cos(u: Range) -> Range:
    # the ends by cos itself: the shifted argument rounds otherwise
    found = _sin(Range(u.lo + 0.5 * math.pi, u.hi + 0.5 * math.pi))
    point = u.lo == u.hi
    return where_range(point, Range(np.cos(u.lo), np.cos(u.hi)), found)


def sine(u: Bound) -> Bound:
    """Return sin u."""
    s, c = _sin(u.value), _cos(u.value)
    return chain(u, s, c, Range(-s.hi, -s.lo))


def cosine(u: Bound) -> Bound:
    """Return cos u."""
    s, c = _sin(u.value), _cos(u.value)
    return chain(u, c, Range(-s.hi, -s.lo), Range(-c.hi, -c.lo))


def _tangent(u: Bound) -> Bound:
    pole = np.floor(u.value.lo / math.pi - 0.5) != np.floor(u.value.hi / math.pi - 0.5)
    t = where_range(pole, ALL, rising(np.tan, u.value))
    slope = plus_range(ONE, square_range(t))
    return chain(u, t, slope, scaled_range(times_range(t, slope), 2.0), np.where(pole, 0, SMOOTH))


def _arc_sine(u: Bound) -> Bound:
    c = minus_range(ONE, square_range(u.value))
    f1 = power_range(c, np.asarray(-0.5))
    return chain(
        u, rising(np.arcsin, u.value), f1, times_range(u.value, power_range(c, np.asarray(-1.5)))
    )


def _arc_tangent(u: Bound) -> Bound:
    f1 = power_range(plus_range(ONE, square_range(u.value)), np.asarray(-1.0))
    f2 = scaled_range(times_range(u.value, square_range(f1)), -2.0)
    return chain(u, rising(np.arctan, u.value), f1, f2)


def _arc_tangent2(u: Bound, v: Bound) -> Bound:
    """Return atan2(u, v); the cut where v < 0 jumps."""
    square = plus_range(square_range(u.value), square_range(v.value))
    inverse = power_range(square, np.asarray(-1.0))
    turned = minus_range(times_range(u.slope, v.value), times_range(u.value, v.slope))
    first = times_range(turned, inverse)
    growth = plus_range(times_range(u.value, u.slope), times_range(v.value, v.slope))
    bent = minus_range(times_range(u.bend, v.value), times_range(u.value, v.bend))
    bent = minus_range(bent, scaled_range(times_range(first, growth), 2.0))
    cut = (u.value.lo <= 0.0) & (u.value.hi >= 0.0) & (v.value.lo <= 0.0)
    corners = [np.arctan2(a, b) for a in u.value for b in v.value]
    value = Range(np.minimum.reduce(corners), np.maximum.reduce(corners))
    value = where_range(cut, Range(-math.pi, math.pi), value)
    level = np.minimum(np.minimum(u.level, v.level), np.where(cut, 0, SMOOTH))
    return Bound(value, first, times_range(bent, inverse), level)


def _hyperbolic_sine(u: Bound) -> Bound:
    s, c = rising(np.sinh, u.value), _cosh(u.value)
    return chain(u, s, c, s)


def _cosh(u: Range) -> Range:
    low, high = np.cosh(u.lo), np.cosh(u.hi)
    least = np.where(holds(u, 0.0), 1.0, np.minimum(low, high))
    return Range(least, np.maximum(low, high))


def _hyperbolic_cosine(u: Bound) -> Bound:
    c = _cosh(u.value)
    return chain(u, c, rising(np.sinh, u.value), c)


def _hyperbolic_tangent(u: Bound) -> Bound:
    t = rising(np.tanh, u.value)
    slope = minus_range(ONE, square_range(t))
    return chain(u, t, slope, scaled_range(times_range(t, slope), -2.0))


def absolute(u: Bound) -> Bound:
    """Return |u|."""
    v = u.value
    size = Range(np.zeros_like(v.lo + v.hi), np.maximum(-v.lo, v.hi))
    bent = either(u, negative(u), 1)._replace(value=size)
    # one that begins or ends where slopes jump has them jump: its neighbour may not
    return where(v.lo > 0.0, u, where(v.hi < 0.0, negative(u), bent))


def _steps(u: Bound, rounded: Callable[[Array], Array]) -> Bound:
    """Return a function of steps that rises: AINT and ANINT."""
    low, high = rounded(u.value.lo), rounded(u.value.hi)
    return Bound(Range(low, high), ZERO, ZERO, np.where(low == high, SMOOTH, 0))


def _nearest(x: Array) -> Array:
    return np.copysign(np.floor(np.abs(x) + 0.5), x)


def _remainder(u: Bound, v: Bound) -> Bound:
    """Return u - v AINT(u / v)."""
    whole = _steps(over(u, v), np.trunc)
    found = sub(u, times(whole, v))
    most = np.maximum(np.abs(v.value.lo), np.abs(v.value.hi))
    least = np.where(u.value.lo >= 0.0, 0.0, -most)
    most = np.where(u.value.hi <= 0.0, 0.0, most)
    across = whole.level == 0
    value = where_range(across, Range(least, most), found.value)
    return found._replace(value=value)


def _signed(u: Bound, v: Bound) -> Bound:
    """Return |u| with the sign of v."""
    size = absolute(u)
    other = where(v.value.hi < 0.0, negative(size), either(size, negative(size), 0))
    return where(v.value.lo >= 0.0, size, other)


def largest(u: Bound, v: Bound) -> Bound:
    """Return the larger of two."""
    both = either(u, v, 1)
    both = both._replace(value=Range(np.maximum(u.value.lo, v.value.lo), both.value.hi))
    return where(u.value.lo > v.value.hi, u, where(v.value.lo > u.value.hi, v, both))


def _maximum(parts: Sequence[Bound]) -> Bound:
    best = parts[0]
    for part in parts[1:]:
        best = largest(best, part)
    return best


def _minimum(parts: Sequence[Bound]) -> Bound:
    return negative(_maximum([negative(part) for part in parts]))


def _choice(a: Bound, b: Bound, c: Bound, d: Bound) -> Bound:
    """Return IF(a: b, c, d)."""
    v = a.value
    naught = (v.lo == 0.0) & (v.hi == 0.0)
    mixed = either(either(b, d, 0), c, 0)
    return where(v.hi < 0.0, b, where(v.lo > 0.0, d, where(naught, c, mixed)))


def _blend(parts: Sequence[Bound], kind: str) -> Bound:
    """Return STEP, STEP5 or HAVSIN of (x, x0, h0, x1, h1)."""
    x, x0, h0, x1, h1 = parts
    s = over(sub(x, x0), sub(x1, x0))
    low, high = np.clip(s.value.lo, 0.0, 1.0), np.clip(s.value.hi, 0.0, 1.0)
    inside = Range(low, high)
    # outside derivatives are 0
    out = (s.value.lo < 0.0) | (s.value.hi > 1.0)
    middle = holds(inside, 0.5)
    if kind == "HAVSIN":
        value = rising(lambda a: 0.5 - 0.5 * np.cos(math.pi * a), inside)
        first = scaled_range(_sin(scaled_range(inside, math.pi)), 0.5 * math.pi)
        second = scaled_range(_cos(scaled_range(inside, math.pi)), 0.5 * math.pi**2)
    elif kind == "STEP":
        value = rising(lambda a: a * a * (3.0 - 2.0 * a), inside)
        ends = [6.0 * a * (1.0 - a) for a in inside]
        first = Range(np.minimum(*ends), np.where(middle, 1.5, np.maximum(*ends)))
        second = Range(6.0 - 12.0 * high, 6.0 - 12.0 * low)
    else:
        value = rising(lambda a: a * a * a * (10.0 + a * (6.0 * a - 15.0)), inside)
        ends = [30.0 * (a * (1.0 - a)) ** 2 for a in inside]
        first = Range(np.minimum(*ends), np.where(middle, 1.875, np.maximum(*ends)))
        bends = [60.0 * a * (1.0 - a) * (1.0 - 2.0 * a) for a in inside]
        # extremes at (1 -+ sqrt(1/3)) / 2
        most = 10.0 / math.sqrt(3.0)
        up, down = (holds(inside, 0.5 * (1.0 + k / math.sqrt(3.0))) for k in (-1.0, 1.0))
        second = Range(
            np.where(down, -most, np.minimum(*bends)), np.where(up, most, np.maximum(*bends))
        )
    first = where_range(out, either_range(first, ZERO), first)
    second = where_range(out, either_range(second, ZERO), second)
    edge = out & (s.value.hi >= 0.0) & (s.value.lo <= 1.0)
    level = np.where(edge, SMOOTH if kind == "STEP5" else 2, SMOOTH)
    part = chain(s, value, first, second, level)
    found = add(h0, times(sub(h1, h0), part))
    # one without width jumps
    width = minus_range(x1.value, x0.value)
    before, behind = x.value.hi < x0.value.lo, x.value.lo > x1.value.hi
    found = where(width.lo > 0.0, found, either(h0, h1, 0))
    return where(before, h0, where(behind, h1, found))


def _stop(depth: Bound, rate: Bound, k: Bound, e: Bound, c: Bound, dmax: Bound) -> Bound:
    """Return max(0, k d^e + STEP(d, 0, 0, dmax, c) d'), 0 without depth."""
    zero = number(0.0)
    spring = times(k, power(largest(depth, zero), e))
    damper = times(_blend((depth, zero, zero, dmax, c), "STEP"), rate)
    return where(depth.value.hi <= 0.0, zero, largest(add(spring, damper), zero))


def _series(x: Bound, factors: Sequence[Bound], chebyshev: bool) -> Bound:
    total = factors[-1]
    if not chebyshev:
        for factor in reversed(factors[:-1]):
            total = add(times(total, x), factor)
        return total
    before, now, total = x, number(1.0), number(0.0)
    for factor in factors:
        total = add(total, times(factor, now))
        before, now = now, sub(times(number(2.0), times(x, now)), before)
    return total


def _fourier(parts: Sequence[Bound], wave: Callable[[Bound], Bound]) -> Bound:
    angle, total = times(parts[2], sub(parts[0], parts[1])), parts[3]
    for k, factor in enumerate(parts[4:], 1):
        total = add(total, times(factor, wave(times(number(float(k)), angle))))
    return total


def _harmonic(parts: Sequence[Bound]) -> Bound:
    angle = times(parts[3], sub(parts[0], parts[1]))
    if len(parts) > 4:
        angle = sub(angle, parts[4])
    wave = times(parts[2], sine(angle))
    return add(wave, parts[5]) if len(parts) > 5 else wave


def _chirp(parts: Sequence[Bound]) -> Bound:
    """Return SWEEP(x, a, x0, f0, x1, f1, dx)."""
    x, a, x0, f0, x1, f1, dx = parts
    zero, growth, rise = number(0.0), sub(f1, f0), sub(x1, x0)
    way = _minimum([largest(sub(x, x0), zero), rise])
    first, last = times(f0, x), sub(times(f1, x), times(number(0.5), times(growth, add(x1, x0))))
    cycles = add(first, times(over(growth, times(number(2.0), rise)), times(way, way)))
    cycles = add(cycles, times(growth, largest(sub(x, x1), zero)))
    # without width the frequency jumps, and the division by it says nothing
    cycles = where(rise.value.lo > 0.0, cycles, either(first, last, 0))
    behind = (x.value.lo >= x1.value.hi) & (x.value.lo > x0.value.hi)
    cycles = where(x.value.hi <= x0.value.lo, first, where(behind, last, cycles))
    on = _blend((x, x0, zero, add(x0, dx), number(1.0)), "STEP5")
    return times(times(on, a), sine(times(number(2.0 * math.pi), cycles)))


def _two_stops(parts: Sequence[Bound]) -> Bound:
    x, rate, low, high, *law = parts
    return sub(
        _stop(sub(low, x), negative(rate), *law),
        _stop(sub(x, high), rate, *law),
    )


_TABLE: dict[str, Callable[..., Bound]] = {
    "ADD": add,
    "SUB": sub,
    "MUL": times,
    "DIV": over,
    "POW": power,
    "NEG": negative,
    "ABS": absolute,
    "SIN": sine,
    "COS": cosine,
    "TAN": _tangent,
    "ASIN": _arc_sine,
    "ACOS": lambda u: sub(number(0.5 * math.pi), _arc_sine(u)),
    "ATAN": _arc_tangent,
    "SINH": _hyperbolic_sine,
    "COSH": _hyperbolic_cosine,
    "TANH": _hyperbolic_tangent,
    "EXP": exponential,
    "LOG": logarithm,
    "LOG10": lambda u: over(logarithm(u), number(LN10)),
    "SQRT": lambda u: power(u, number(0.5)),
    "AINT": lambda u: _steps(u, np.trunc),
    "ANINT": lambda u: _steps(u, _nearest),
    "ATAN2": _arc_tangent2,
    "MOD": _remainder,
    "SIGN": _signed,
    "DIM": lambda u, v: largest(sub(u, v), number(0.0)),
    "MIN": lambda *parts: _minimum(parts),
    "MAX": lambda *parts: _maximum(parts),
    "IF": _choice,
    "STEP": lambda *parts: _blend(parts, "STEP"),
    "STEP5": lambda *parts: _blend(parts, "STEP5"),
    "HAVSIN": lambda *parts: _blend(parts, "HAVSIN"),
    "SHF": lambda *parts: _harmonic(parts),
    "POLY": lambda x, x0, *factors: _series(sub(x, x0), factors, False),
    "CHEBY": lambda x, x0, *factors: _series(sub(x, x0), factors, True),
    "FORSIN": lambda *parts: _fourier(parts, sine),
    "FORCOS": lambda *parts: _fourier(parts, cosine),
    "IMPACT": lambda x, rate, x1, *law: _stop(sub(x1, x), negative(rate), *law),
    "BISTOP": lambda *parts: _two_stops(parts),
    "SWEEP": lambda *parts: _chirp(parts),
}
_BY_CODE = {CODES[name]: function for name, function in _TABLE.items()}


def apply(op: int, parts: Sequence[Bound]) -> Bound:
    """Return an elementary function of bounds, by its operation code."""
    return _BY_CODE[op](*parts)
