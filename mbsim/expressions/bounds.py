"""Bounds of a value and its two derivatives over spans of time, and their arithmetic."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

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


ALL = Range(-math.inf, math.inf)
ZERO, ONE = Range(0.0, 0.0), Range(1.0, 1.0)


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


def plus_range(u: Range, v: Range) -> Range:
    """Return u + v."""
    return Range(u.lo + v.lo, u.hi + v.hi)


def minus_range(u: Range, v: Range) -> Range:
    """Return u - v."""
    return Range(u.lo - v.hi, u.hi - v.lo)


def times_range(u: Range, v: Range) -> Range:
    """Return u v."""
    a, b = _known(u.lo * v.lo), _known(u.lo * v.hi)
    c, d = _known(u.hi * v.lo), _known(u.hi * v.hi)
    return Range(
        np.minimum(np.minimum(a, b), np.minimum(c, d)),
        np.maximum(np.maximum(a, b), np.maximum(c, d)),
    )


def square_range(u: Range) -> Range:
    """Return u^2."""
    return power_range(u, np.asarray(2.0))


def scaled_range(u: Range, c: Array) -> Range:
    """Return c u."""
    return times_range(u, Range(c, c))


def either_range(u: Range, v: Range) -> Range:
    """Return the interval that holds both."""
    return Range(np.minimum(u.lo, v.lo), np.maximum(u.hi, v.hi))


def where_range(mask: Array, u: Range, v: Range) -> Range:
    """Return u where the mask holds, else v."""
    return Range(np.where(mask, u.lo, v.lo), np.where(mask, u.hi, v.hi))


def where(mask: Array, u: Bound, v: Bound) -> Bound:
    """Return u where the mask holds, else v."""
    return Bound(
        where_range(mask, u.value, v.value),
        where_range(mask, u.slope, v.slope),
        where_range(mask, u.bend, v.bend),
        np.where(mask, u.level, v.level),
    )


def either(u: Bound, v: Bound, level: Array) -> Bound:
    """Return what may be u or v, with what jumps between them."""
    lowest = np.minimum(np.minimum(u.level, v.level), level)
    value, slope = either_range(u.value, v.value), either_range(u.slope, v.slope)
    return Bound(value, slope, either_range(u.bend, v.bend), lowest)


def holds(u: Range, c: Array) -> Array:
    """Return whether intervals hold a number."""
    return (u.lo <= c) & (c <= u.hi)


def chain(u: Bound, f: Range, f1: Range, f2: Range, level: Array = SMOOTH) -> Bound:
    """Return f(u) from the bounds of f and its derivatives over u."""
    bend = plus_range(times_range(f2, square_range(u.slope)), times_range(f1, u.bend))
    return Bound(f, times_range(f1, u.slope), bend, np.minimum(u.level, level))


def add(u: Bound, v: Bound) -> Bound:
    """Return u + v."""
    level = np.minimum(u.level, v.level)
    return Bound(
        plus_range(u.value, v.value),
        plus_range(u.slope, v.slope),
        plus_range(u.bend, v.bend),
        level,
    )


def negative(u: Bound) -> Bound:
    """Return -u."""
    value, slope, bend = (Range(-part.hi, -part.lo) for part in u[:3])
    return Bound(value, slope, bend, u.level)


def sub(u: Bound, v: Bound) -> Bound:
    """Return u - v."""
    return add(u, negative(v))


def times(u: Bound, v: Bound) -> Bound:
    """Return u v."""
    slope = plus_range(times_range(u.slope, v.value), times_range(u.value, v.slope))
    bend = plus_range(times_range(u.bend, v.value), times_range(u.value, v.bend))
    bend = plus_range(bend, scaled_range(times_range(u.slope, v.slope), 2.0))
    return Bound(times_range(u.value, v.value), slope, bend, np.minimum(u.level, v.level))


def power_range(u: Range, n: Array) -> Range:
    """Return u^n for numbers n; all there is where it has no bound."""
    whole = n == np.floor(n)
    even = whole & (np.mod(n, 2.0) == 0.0)
    low, high = np.power(np.abs(u.lo), n), np.power(np.abs(u.hi), n)
    up = Range(np.minimum(low, high), np.maximum(low, high))
    sided = Range(np.copysign(low, u.lo), np.copysign(high, u.hi))
    # odd powers of what is below 0 fall where n < 0
    odd = Range(np.minimum(sided.lo, sided.hi), np.maximum(sided.lo, sided.hi))
    across = (u.lo < 0.0) & (u.hi > 0.0)
    result = where_range(even | (u.lo >= 0.0), up, odd)
    result = where_range(across & even, Range(np.zeros_like(up.hi), up.hi), result)
    # a root of what is partly below 0 is taken of the rest
    result = where_range(
        ~whole & (u.lo < 0.0), where_range(u.hi >= 0.0, Range(0.0, high), ALL), result
    )
    result = where_range((n < 0.0) & (u.lo <= 0.0) & (u.hi >= 0.0), ALL, result)
    return where_range(n == 0.0, ONE, result)


def power(u: Bound, v: Bound) -> Bound:
    """Return u^v."""
    n = v.value.lo
    steady = np.all((n == v.value.hi) & (v.slope.lo == 0.0) & (v.slope.hi == 0.0))
    if steady:
        f1, f2 = scaled_range(power_range(u.value, n - 1.0), n), power_range(u.value, n - 2.0)
        pole = (n < 0.0) & holds(u.value, 0.0)
        level = np.where(pole, 0, SMOOTH)
        return chain(u, power_range(u.value, n), f1, scaled_range(f2, n * (n - 1.0)), level)
    return exponential(times(v, logarithm(u)))


def _inverse(u: Bound) -> Bound:
    """Return 1 / u."""
    return power(u, number(-1.0))


def over(u: Bound, v: Bound) -> Bound:
    """Return u / v."""
    steady = np.all((v.value.lo == v.value.hi) & (v.slope.lo == 0.0) & (v.slope.hi == 0.0))
    if steady and np.all(v.value.lo != 0.0):
        c = 1.0 / v.value.lo
        slope, bend = (scaled_range(part, c) for part in u[1:3])
        value = _quotient(u.value, v.value)
        return Bound(value, slope, bend, np.minimum(u.level, v.level))
    found = times(u, _inverse(v))
    clear = (v.value.lo > 0.0) | (v.value.hi < 0.0)
    with np.errstate(all="ignore"):
        return found._replace(value=where_range(clear, _quotient(u.value, v.value), found.value))


def _quotient(u: Range, v: Range) -> Range:
    """Return u / v where v is not 0 anywhere, rounded as a run rounds it: AINT of it may jump."""
    corners = [_known(a / b) for a in u for b in v]
    return Range(np.minimum.reduce(corners), np.maximum.reduce(corners))


def rising(f: Callable[[Array], Array], u: Range) -> Range:
    """Return a function that rises everywhere; nan, out of its domain, is all there is."""
    low, high = f(u.lo), f(u.hi)
    return Range(np.where(np.isnan(low), -np.inf, low), np.where(np.isnan(high), np.inf, high))


def exponential(u: Bound) -> Bound:
    """Return e^u."""
    e = rising(np.exp, u.value)
    return chain(u, e, e, e)


def logarithm(u: Bound) -> Bound:
    """Return ln u."""
    one = power_range(u.value, np.asarray(-1.0))
    two = power_range(u.value, np.asarray(-2.0))
    level = np.where(u.value.lo <= 0.0, 0, SMOOTH)
    return chain(u, rising(np.log, u.value), one, Range(-two.hi, -two.lo), level)
