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
from typing import Any, NamedTuple

import numpy as np

from mbsim.expressions.elementary import CODES, LN10

SMOOTH = 3

Array = Any


class Range(NamedTuple):
    """Intervals from `lo` to `hi`."""

    lo: Array
    hi: Array


class Bound(NamedTuple):
    """A function over spans: its value and two derivatives, and which of them may jump."""

    value: Range
    slope: Range
    bend: Range
    level: Array


ZERO, ONE = Range(0.0, 0.0), Range(1.0, 1.0)
ALL = Range(-math.inf, math.inf)


def number(c: Array) -> Bound:
    """Return what does not change."""
    c = np.asarray(c, dtype=np.float64)
    return Bound(Range(c, c), ZERO, ZERO, SMOOTH)


def time(lo: Array, hi: Array) -> Bound:
    """Return TIME from lo to hi."""
    return Bound(Range(lo, hi), ONE, ZERO, SMOOTH)


def _known(x: Array) -> Array:
    """Return products with 0 times infinity as 0: what is 0 stays so."""
    return np.where(np.isnan(x), 0.0, x)


def _plus(u: Range, v: Range) -> Range:
    return Range(u.lo + v.lo, u.hi + v.hi)


def _minus(u: Range, v: Range) -> Range:
    return Range(u.lo - v.hi, u.hi - v.lo)


def _times(u: Range, v: Range) -> Range:
    a, b = _known(u.lo * v.lo), _known(u.lo * v.hi)
    c, d = _known(u.hi * v.lo), _known(u.hi * v.hi)
    return Range(
        np.minimum(np.minimum(a, b), np.minimum(c, d)),
        np.maximum(np.maximum(a, b), np.maximum(c, d)),
    )


def _square(u: Range) -> Range:
    return _power(u, np.asarray(2.0))


def _scaled(u: Range, c: Array) -> Range:
    return _times(u, Range(c, c))


def _either(u: Range, v: Range) -> Range:
    return Range(np.minimum(u.lo, v.lo), np.maximum(u.hi, v.hi))


def _where(mask: Array, u: Range, v: Range) -> Range:
    return Range(np.where(mask, u.lo, v.lo), np.where(mask, u.hi, v.hi))


def where(mask: Array, u: Bound, v: Bound) -> Bound:
    """Return u where the mask holds, else v."""
    return Bound(
        _where(mask, u.value, v.value),
        _where(mask, u.slope, v.slope),
        _where(mask, u.bend, v.bend),
        np.where(mask, u.level, v.level),
    )


def either(u: Bound, v: Bound, level: Array) -> Bound:
    """Return what may be u or v, with what jumps between them."""
    lowest = np.minimum(np.minimum(u.level, v.level), level)
    value, slope = _either(u.value, v.value), _either(u.slope, v.slope)
    return Bound(value, slope, _either(u.bend, v.bend), lowest)


def _holds(u: Range, c: Array) -> Array:
    """Return whether intervals hold a number."""
    return (u.lo <= c) & (c <= u.hi)


def _chain(u: Bound, f: Range, f1: Range, f2: Range, level: Array = SMOOTH) -> Bound:
    """Return f(u) from the bounds of f and its derivatives over u."""
    bend = _plus(_times(f2, _square(u.slope)), _times(f1, u.bend))
    return Bound(f, _times(f1, u.slope), bend, np.minimum(u.level, level))


def add(u: Bound, v: Bound) -> Bound:
    """Return u + v."""
    level = np.minimum(u.level, v.level)
    return Bound(_plus(u.value, v.value), _plus(u.slope, v.slope), _plus(u.bend, v.bend), level)


def negative(u: Bound) -> Bound:
    """Return -u."""
    value, slope, bend = (Range(-part.hi, -part.lo) for part in u[:3])
    return Bound(value, slope, bend, u.level)


def sub(u: Bound, v: Bound) -> Bound:
    """Return u - v."""
    return add(u, negative(v))


def times(u: Bound, v: Bound) -> Bound:
    """Return u v."""
    slope = _plus(_times(u.slope, v.value), _times(u.value, v.slope))
    bend = _plus(_times(u.bend, v.value), _times(u.value, v.bend))
    bend = _plus(bend, _scaled(_times(u.slope, v.slope), 2.0))
    return Bound(_times(u.value, v.value), slope, bend, np.minimum(u.level, v.level))


def _power(u: Range, n: Array) -> Range:
    """Return u^n for numbers n; all there is where it has no bound."""
    whole = n == np.floor(n)
    even = whole & (np.mod(n, 2.0) == 0.0)
    low, high = np.power(np.abs(u.lo), n), np.power(np.abs(u.hi), n)
    up = Range(np.minimum(low, high), np.maximum(low, high))
    sided = Range(np.copysign(low, u.lo), np.copysign(high, u.hi))
    # odd powers of what is below 0 fall where n < 0
    odd = Range(np.minimum(sided.lo, sided.hi), np.maximum(sided.lo, sided.hi))
    across = (u.lo < 0.0) & (u.hi > 0.0)
    result = _where(even | (u.lo >= 0.0), up, odd)
    result = _where(across & even, Range(np.zeros_like(up.hi), up.hi), result)
    # a root of what is partly below 0 is taken of the rest
    result = _where(~whole & (u.lo < 0.0), _where(u.hi >= 0.0, Range(0.0, high), ALL), result)
    result = _where((n < 0.0) & (u.lo <= 0.0) & (u.hi >= 0.0), ALL, result)
    return _where(n == 0.0, ONE, result)


def power(u: Bound, v: Bound) -> Bound:
    """Return u^v."""
    n = v.value.lo
    steady = np.all((n == v.value.hi) & (v.slope.lo == 0.0) & (v.slope.hi == 0.0))
    if steady:
        f1, f2 = _scaled(_power(u.value, n - 1.0), n), _power(u.value, n - 2.0)
        pole = (n < 0.0) & _holds(u.value, 0.0)
        level = np.where(pole, 0, SMOOTH)
        return _chain(u, _power(u.value, n), f1, _scaled(f2, n * (n - 1.0)), level)
    return _exponential(times(v, _logarithm(u)))


def _inverse(u: Bound) -> Bound:
    """Return 1 / u."""
    return power(u, number(-1.0))


def over(u: Bound, v: Bound) -> Bound:
    """Return u / v."""
    steady = np.all((v.value.lo == v.value.hi) & (v.slope.lo == 0.0) & (v.slope.hi == 0.0))
    if steady and np.all(v.value.lo != 0.0):
        c = 1.0 / v.value.lo
        parts = (_scaled(part, c) for part in u[:3])
        return Bound(*parts, np.minimum(u.level, v.level))
    return times(u, _inverse(v))


def _sin(u: Range) -> Range:
    """Return the bounds of a sine: its ends, and 1 and -1 where it gets there."""
    low, high = np.sin(u.lo), np.sin(u.hi)
    turns = 2.0 * math.pi
    top = np.floor((u.hi - 0.5 * math.pi) / turns) >= np.ceil((u.lo - 0.5 * math.pi) / turns)
    bottom = np.floor((u.hi + 0.5 * math.pi) / turns) >= np.ceil((u.lo + 0.5 * math.pi) / turns)
    least = np.where(bottom, -1.0, np.minimum(low, high))
    most = np.where(top, 1.0, np.maximum(low, high))
    lost = ~(np.abs(u.lo) < 1e15) | ~(np.abs(u.hi) < 1e15)
    return _where(lost, Range(-1.0, 1.0), Range(least, most))


def _cos(u: Range) -> Range:
    # the ends by cos itself: the shifted argument rounds otherwise
    found = _sin(Range(u.lo + 0.5 * math.pi, u.hi + 0.5 * math.pi))
    point = u.lo == u.hi
    return _where(point, Range(np.cos(u.lo), np.cos(u.hi)), found)


def sine(u: Bound) -> Bound:
    """Return sin u."""
    s, c = _sin(u.value), _cos(u.value)
    return _chain(u, s, c, Range(-s.hi, -s.lo))


def cosine(u: Bound) -> Bound:
    """Return cos u."""
    s, c = _sin(u.value), _cos(u.value)
    return _chain(u, c, Range(-s.hi, -s.lo), Range(-c.hi, -c.lo))


def _rising(f: Callable[[Array], Array], u: Range) -> Range:
    """Return a function that rises everywhere; nan, out of its domain, is all there is."""
    low, high = f(u.lo), f(u.hi)
    return Range(np.where(np.isnan(low), -np.inf, low), np.where(np.isnan(high), np.inf, high))


def _exponential(u: Bound) -> Bound:
    e = _rising(np.exp, u.value)
    return _chain(u, e, e, e)


def _logarithm(u: Bound) -> Bound:
    one = _power(u.value, np.asarray(-1.0))
    two = _power(u.value, np.asarray(-2.0))
    level = np.where(u.value.lo <= 0.0, 0, SMOOTH)
    return _chain(u, _rising(np.log, u.value), one, Range(-two.hi, -two.lo), level)


def _tangent(u: Bound) -> Bound:
    pole = np.floor(u.value.lo / math.pi - 0.5) != np.floor(u.value.hi / math.pi - 0.5)
    t = _where(pole, ALL, _rising(np.tan, u.value))
    slope = _plus(ONE, _square(t))
    return _chain(u, t, slope, _scaled(_times(t, slope), 2.0), np.where(pole, 0, SMOOTH))


def _arc_sine(u: Bound) -> Bound:
    c = _minus(ONE, _square(u.value))
    f1 = _power(c, np.asarray(-0.5))
    return _chain(u, _rising(np.arcsin, u.value), f1, _times(u.value, _power(c, np.asarray(-1.5))))


def _arc_tangent(u: Bound) -> Bound:
    f1 = _power(_plus(ONE, _square(u.value)), np.asarray(-1.0))
    f2 = _scaled(_times(u.value, _square(f1)), -2.0)
    return _chain(u, _rising(np.arctan, u.value), f1, f2)


def _arc_tangent2(u: Bound, v: Bound) -> Bound:
    """Return atan2(u, v); the cut where v < 0 jumps."""
    square = _plus(_square(u.value), _square(v.value))
    inverse = _power(square, np.asarray(-1.0))
    turned = _minus(_times(u.slope, v.value), _times(u.value, v.slope))
    first = _times(turned, inverse)
    growth = _plus(_times(u.value, u.slope), _times(v.value, v.slope))
    bent = _minus(_times(u.bend, v.value), _times(u.value, v.bend))
    bent = _minus(bent, _scaled(_times(first, growth), 2.0))
    cut = (u.value.lo <= 0.0) & (u.value.hi >= 0.0) & (v.value.lo <= 0.0)
    corners = [np.arctan2(a, b) for a in u.value for b in v.value]
    value = Range(np.minimum.reduce(corners), np.maximum.reduce(corners))
    value = _where(cut, Range(-math.pi, math.pi), value)
    level = np.minimum(np.minimum(u.level, v.level), np.where(cut, 0, SMOOTH))
    return Bound(value, first, _times(bent, inverse), level)


def _hyperbolic_sine(u: Bound) -> Bound:
    s, c = _rising(np.sinh, u.value), _cosh(u.value)
    return _chain(u, s, c, s)


def _cosh(u: Range) -> Range:
    low, high = np.cosh(u.lo), np.cosh(u.hi)
    least = np.where(_holds(u, 0.0), 1.0, np.minimum(low, high))
    return Range(least, np.maximum(low, high))


def _hyperbolic_cosine(u: Bound) -> Bound:
    c = _cosh(u.value)
    return _chain(u, c, _rising(np.sinh, u.value), c)


def _hyperbolic_tangent(u: Bound) -> Bound:
    t = _rising(np.tanh, u.value)
    slope = _minus(ONE, _square(t))
    return _chain(u, t, slope, _scaled(_times(t, slope), -2.0))


def absolute(u: Bound) -> Bound:
    """Return |u|."""
    v = u.value
    size = Range(np.zeros_like(v.lo + v.hi), np.maximum(-v.lo, v.hi))
    bent = either(u, negative(u), 1)._replace(value=size)
    return where(v.lo >= 0.0, u, where(v.hi <= 0.0, negative(u), bent))


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
    value = _where(across, Range(least, most), found.value)
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
    return where(u.value.lo >= v.value.hi, u, where(v.value.lo > u.value.hi, v, both))


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
    middle = _holds(inside, 0.5)
    if kind == "HAVSIN":
        value = _rising(lambda a: 0.5 - 0.5 * np.cos(math.pi * a), inside)
        first = _scaled(_sin(_scaled(inside, math.pi)), 0.5 * math.pi)
        second = _scaled(_cos(_scaled(inside, math.pi)), 0.5 * math.pi**2)
    elif kind == "STEP":
        value = _rising(lambda a: a * a * (3.0 - 2.0 * a), inside)
        ends = [6.0 * a * (1.0 - a) for a in inside]
        first = Range(np.minimum(*ends), np.where(middle, 1.5, np.maximum(*ends)))
        second = Range(6.0 - 12.0 * high, 6.0 - 12.0 * low)
    else:
        value = _rising(lambda a: a * a * a * (10.0 + a * (6.0 * a - 15.0)), inside)
        ends = [30.0 * (a * (1.0 - a)) ** 2 for a in inside]
        first = Range(np.minimum(*ends), np.where(middle, 1.875, np.maximum(*ends)))
        bends = [60.0 * a * (1.0 - a) * (1.0 - 2.0 * a) for a in inside]
        # extremes at (1 -+ sqrt(1/3)) / 2
        most = 10.0 / math.sqrt(3.0)
        up, down = (_holds(inside, 0.5 * (1.0 + k / math.sqrt(3.0))) for k in (-1.0, 1.0))
        second = Range(
            np.where(down, -most, np.minimum(*bends)), np.where(up, most, np.maximum(*bends))
        )
    first = _where(out, _either(first, ZERO), first)
    second = _where(out, _either(second, ZERO), second)
    edge = out & (high > low)
    level = np.where(edge, SMOOTH if kind == "STEP5" else 2, SMOOTH)
    part = _chain(s, value, first, second, level)
    found = add(h0, times(sub(h1, h0), part))
    # one without width jumps
    width = _minus(x1.value, x0.value)
    before, behind = x.value.hi <= x0.value.lo, x.value.lo >= x1.value.hi
    behind &= x.value.lo > x0.value.hi
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
    zero, growth = number(0.0), sub(f1, f0)
    way = _minimum([largest(sub(x, x0), zero), sub(x1, x0)])
    cycles = add(
        times(f0, x), times(over(growth, times(number(2.0), sub(x1, x0))), times(way, way))
    )
    cycles = add(cycles, times(growth, largest(sub(x, x1), zero)))
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
    "EXP": _exponential,
    "LOG": _logarithm,
    "LOG10": lambda u: over(_logarithm(u), number(LN10)),
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


class Curve:
    """A curve of cubic pieces, as `compile_model.splines` makes them, and its bounds."""

    def __init__(self, piece: Array, order: int) -> None:
        factors = np.array(piece[:, 1:], dtype=np.float64)
        for _ in range(order):
            factors = np.column_stack(
                (factors[:, 1:] * np.arange(1.0, factors.shape[1]), np.zeros(len(factors)))
            )
        self.factors = factors
        # where each piece begins; the first goes on backwards from the first knot
        self.begin = np.array(piece[:, 0])
        self.knots = np.array(piece[1:, 0])
        self.levels = self._levels()
        ends = np.append(self.knots[1:], self.knots[-1]) - self.begin[1:]
        whole = np.zeros(len(ends))
        inner = [self._of_piece(np.arange(1, len(piece)), whole, ends, k) for k in range(3)]
        self.inner = [Range(r.lo[:-1], r.hi[:-1]) for r in inner]

    def _levels(self) -> Array:
        """Return which derivative jumps at each knot."""
        at = np.arange(1, len(self.factors))
        left = np.where(at == 1, 0.0, self.begin[at] - self.begin[at - 1])
        found = np.full(len(at), SMOOTH)
        for k in reversed(range(SMOOTH)):
            one, other = self._point(at - 1, left, k), self._point(at, np.zeros(len(at)), k)
            size = np.max(np.abs(np.concatenate([one, other])))
            found[np.abs(one - other) > 1e-9 * size] = k
        return found

    def _derived(self, rows: Array, order: int) -> Array:
        c = self.factors[rows]
        for _ in range(order):
            c = np.column_stack((c[:, 1:] * np.arange(1.0, c.shape[1]), np.zeros(len(c))))
        return c

    def _point(self, rows: Array, s: Array, order: int) -> Array:
        c = self._derived(rows, order)
        return c[:, 0] + s * (c[:, 1] + s * (c[:, 2] + s * c[:, 3]))

    def _of_piece(self, rows: Array, low: Array, high: Array, order: int) -> Range:
        """Return the bounds of a derivative over a part of a piece: its ends and extremes."""
        c = self._derived(rows, order)
        found = [self._point(rows, s, order) for s in (low, high)]
        # c1 + 2 c2 s + 3 c3 s^2 = 0
        root = np.sqrt(np.maximum(c[:, 2] ** 2 - 3.0 * c[:, 1] * c[:, 3], 0.0))
        with np.errstate(divide="ignore", invalid="ignore"):
            places = [(-c[:, 2] + root) / (3.0 * c[:, 3]), (-c[:, 2] - root) / (3.0 * c[:, 3])]
            places.append(-c[:, 1] / (2.0 * c[:, 2]))
        for s in places:
            inside = np.where(np.isfinite(s), np.clip(s, low, high), low)
            found.append(self._point(rows, inside, order))
        return Range(np.minimum.reduce(found), np.maximum.reduce(found))

    def bound(self, x: Bound) -> Bound:
        """Return the bound of the curve at a bound."""
        shape = np.broadcast(x.value.lo, x.value.hi).shape
        lo, hi = (np.broadcast_to(part, shape).ravel() for part in x.value)
        # the last knot belongs to the piece before it
        first = np.searchsorted(self.knots, lo, "right")
        last = np.searchsorted(self.knots, hi, "left")
        last = np.maximum(last, np.minimum(first, last + 1))
        first = np.minimum(first, last)
        right = np.where(first == last, hi, self.knots[np.minimum(first, len(self.knots) - 1)])
        left = np.where(first == last, lo, self.begin[last])
        parts = []
        for k in range(3):
            found = _either(
                self._of_piece(first, lo - self.begin[first], right - self.begin[first], k),
                self._of_piece(last, left - self.begin[last], hi - self.begin[last], k),
            )
            parts.append(self._between(first, last, found, k))
        # knot k lies between pieces k and k + 1
        pairs = np.column_stack((first, np.maximum(last, first + 1))).ravel()
        lowest = np.minimum.reduceat(np.append(self.levels, [SMOOTH, SMOOTH]), pairs)[::2]
        level = np.where(first == last, SMOOTH, lowest)
        shaped = [Range(r.lo.reshape(shape), r.hi.reshape(shape)) for r in parts]
        return _chain(x, *shaped, level.reshape(shape))

    def _between(self, first: Array, last: Array, found: Range, k: int) -> Range:
        """Return the bounds with all whole pieces between the first and the last."""
        many = last - first > 1
        if not many.any():
            return found
        # rows of `inner` are those of pieces from 1 on
        pairs = np.column_stack((first[many], last[many] - 1)).ravel()
        end = len(self.inner[k].lo)
        low, high = (np.append(part, fill) for part, fill in
                     zip(self.inner[k], (np.inf, -np.inf), strict=True))  # fmt: skip
        pairs = np.minimum(pairs, end)
        least, most = np.minimum.reduceat(low, pairs)[::2], np.maximum.reduceat(high, pairs)[::2]
        lo, hi = found.lo.copy(), found.hi.copy()
        lo[many], hi[many] = np.minimum(lo[many], least), np.maximum(hi[many], most)
        return Range(lo, hi)
