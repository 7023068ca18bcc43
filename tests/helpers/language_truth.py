"""Functions of numbers as the manual defines them, written once more with NumPy for whole arrays.

Forms differ from those of the simulator where the mathematics has another one. `CASES` says of
each function with which arguments it is called: it is drawn at random within its domain.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

#: Most arguments that are taken here of functions that take many.
MOST_ARGS = 9


def cubic(x, x0, h0, x1, h1):
    """Return STEP by Hermite's basis: values h0 and h1, slopes 0 at both ends."""
    s = np.clip((x - x0) / (x1 - x0), 0.0, 1.0)
    return (1 + 2 * s) * (1 - s) ** 2 * h0 + s**2 * (3 - 2 * s) * h1


def quintic(x, x0, h0, x1, h1):
    """Return STEP5 by Hermite's basis: slopes and second derivatives are 0 at both ends as well."""
    s = np.clip((x - x0) / (x1 - x0), 0.0, 1.0)
    r = 1 - s
    return r**3 * (1 + 3 * s + 6 * s**2) * h0 + s**3 * (1 + 3 * r + 6 * r**2) * h1


def half_wave(x, x0, h0, x1, h1):
    """Return HAVSIN by the versed sine."""
    s = np.clip((x - x0) / (x1 - x0), 0.0, 1.0)
    return h0 + (h1 - h0) * np.sin(np.pi * s / 2) ** 2


def impact(x, rate, x1, k, e, c, d):
    """Return IMPACT; it never pulls."""
    depth = np.maximum(x1 - x, 0.0)
    return np.where(x < x1, np.maximum(0.0, k * depth**e - cubic(depth, 0, 0, d, c) * rate), 0.0)


def between_stops(x, rate, x1, x2, k, e, c, d):
    """Return BISTOP: IMPACT at x1, and mirrored at x2."""
    return impact(x, rate, x1, k, e, c, d) - impact(-x, -rate, -x2, k, e, c, d)


def sweep(x, a, x0, f0, x1, f1, dx):
    """Return SWEEP: the phase is f0 x up to x0 and grows by the frequency from there on."""
    s = np.clip(x, x0, x1) - x0
    # the mean frequency of the part that is swept, and what is before and after it
    swept = s * (f0 + (f1 - f0) * s / (x1 - x0) / 2)
    cycles = f0 * np.minimum(x, x0) + swept + f1 * np.maximum(x - x1, 0.0)
    return quintic(x, x0, 0, x0 + dx, 1) * a * np.sin(2 * np.pi * cycles)


def power_series(x, x0, *a):
    """Return POLY as the sum that it is."""
    return sum(factor * (x - x0) ** j for j, factor in enumerate(a))


def chebyshev_series(x, x0, *a):
    """Return CHEBY by T_j(cos p) = cos j p within -1 to 1."""
    return sum(factor * np.cos(j * np.arccos(x - x0)) for j, factor in enumerate(a))


def fourier_series(wave, x, x0, w, *a):
    """Return FORSIN or FORCOS."""
    return a[0] + sum(factor * wave(j * w * (x - x0)) for j, factor in enumerate(a[1:], 1))


def harmonic(x, x0, a, w, phase=0.0, b=0.0):
    """Return SHF."""
    return a * np.sin(w * (x - x0) - phase) + b


def nearest_whole(x):
    """Return ANINT: halves go away from 0."""
    return np.sign(x) * np.floor(np.abs(x) + 0.5)


class Case(NamedTuple):
    """A call with a number of arguments: its truth, and what draws the arguments (args, n)."""

    text: str  # {0}, {1}, ... are the arguments
    truth: Callable[..., Any]
    draw: Callable[[np.random.Generator, int], Any]
    functions: tuple[str, ...] = ()  # of the language, that the text calls


def ranges(*pairs):
    """Return what draws each argument from its own range."""

    def draw(rng, n):
        return np.array([rng.uniform(low, high, n) for low, high in pairs])

    return draw


def ramps(rng, n):
    """Draw x and x0 < x1, x before, between and behind, and two heights."""
    x0, width = rng.uniform(-2, 2, n), rng.uniform(0.5, 2, n)
    x = x0 + width * rng.uniform(-0.5, 1.5, n)
    return np.array([x, x0, rng.uniform(-3, 3, n), x0 + width, rng.uniform(-3, 3, n)])


def stops(rng, n):
    """Draw the arguments of IMPACT; half of the points have depth."""
    x1 = rng.uniform(-1, 1, n)
    depth, rate = rng.uniform(-0.5, 0.5, n), rng.uniform(-2, 2, n)
    k, e, c, d = (rng.uniform(*pair, n) for pair in ((5, 50), (1.1, 2.5), (0.1, 3), (0.2, 1)))
    return np.array([x1 - depth, rate, x1, k, e, c, d])


def gaps(rng, n):
    """Draw the arguments of BISTOP: below, between and above."""
    x, rate, x1, k, e, c, d = stops(rng, n)
    gap = rng.uniform(0.2, 0.6, n)
    x = x1 + rng.uniform(-0.5, 1.0, n)
    return np.array([x, rate, x1, x1 + gap, k, e, c, d])


def sweeps(rng, n):
    """Draw the arguments of SWEEP: x before, while and after the frequency moves."""
    x0, width = rng.uniform(-1, 1, n), rng.uniform(0.5, 2, n)
    x = x0 + width * rng.uniform(-0.3, 1.5, n)
    a, f0, f1, dx = (rng.uniform(*pair, n) for pair in ((-3, 3), (0.2, 1), (0.2, 2), (0.3, 1)))
    return np.array([x, a, x0, f0, x0 + width, f1, dx])


def series(reach, *others):
    """Return what draws x near x0, given further arguments, and coefficients up to `MOST_ARGS`."""

    def draw(rng, n):
        x0 = rng.uniform(-1, 1, n)
        fixed = [rng.uniform(low, high, n) for low, high in others]
        left = MOST_ARGS - 2 - len(fixed)
        return np.array(
            [x0 + rng.uniform(-reach, reach, n), x0, *fixed, *rng.normal(0, 1, (left, n))]
        )

    return draw


def whole_or_not(rng, n):
    """Draw x, of which one in twenty is 0."""
    x = rng.normal(0, 1, n) * (rng.random(n) > 0.05)
    return np.array([x, *rng.normal(0, 2, (3, n))])


def away(rng, n):
    """Draw two numbers, the second at least 0.3 from 0."""
    return np.array([rng.uniform(-5, 5, n), rng.choice([-1, 1], n) * rng.uniform(0.3, 3, n)])


def call(name, count, truth, draw, least=None):
    """Return calls of a function with `least` to `count` arguments."""
    return [
        Case(f"{name}({', '.join(f'{{{k}}}' for k in range(m))})", truth, draw, (name,))
        for m in range(count if least is None else least, count + 1)
    ]


CASES = [
    *call("ABS", 1, lambda x: np.sqrt(x * x), ranges((-3, 3))),
    *call("SIN", 1, np.sin, ranges((-20, 20))),
    *call("COS", 1, lambda x: np.exp(1j * x).real, ranges((-20, 20))),
    *call("TAN", 1, lambda x: np.sin(x) / np.cos(x), ranges((-1.4, 1.4))),
    *call("ASIN", 1, lambda x: np.arctan2(x, np.sqrt((1 - x) * (1 + x))), ranges((-0.9, 0.9))),
    *call("ACOS", 1, lambda x: np.arctan2(np.sqrt((1 - x) * (1 + x)), x), ranges((-0.9, 0.9))),
    *call("ATAN", 1, lambda x: np.angle(1 + 1j * x), ranges((-20, 20))),
    *call("SINH", 1, lambda x: (np.exp(x) - np.exp(-x)) / 2, ranges((-4, 4))),
    *call("COSH", 1, lambda x: (np.exp(x) + np.exp(-x)) / 2, ranges((-4, 4))),
    *call("TANH", 1, lambda x: 1 - 2 / (np.exp(2 * x) + 1), ranges((-4, 4))),
    *call("EXP", 1, np.exp, ranges((-5, 5))),
    *call("LOG", 1, np.log, ranges((0.2, 9))),
    *call("LOG10", 1, lambda x: np.log(x) / np.log(10), ranges((0.2, 9))),
    *call("SQRT", 1, lambda x: x**0.5, ranges((0.2, 9))),
    *call("AINT", 1, np.trunc, ranges((-9, 9))),
    *call("ANINT", 1, nearest_whole, ranges((-9, 9))),
    *call("ATAN2", 2, lambda y, x: np.angle(x + 1j * y), away),
    *call("MOD", 2, np.fmod, away),
    *call("SIGN", 2, lambda x, y: np.abs(x) * np.sign(y), away),
    *call("DIM", 2, lambda x, y: np.maximum(x - y, 0.0), ranges((-3, 3), (-3, 3))),
    *call("MIN", 4, lambda *x: np.min(x, axis=0), ranges(*[(-3, 3)] * 4), 2),
    *call("MAX", 4, lambda *x: np.max(x, axis=0), ranges(*[(-3, 3)] * 4), 2),
    *call("IF", 4, lambda x, a, b, c: np.select([x < 0, x == 0], [a, b], c), whole_or_not),
    *call("STEP", 5, cubic, ramps),
    *call("STEP5", 5, quintic, ramps),
    *call("HAVSIN", 5, half_wave, ramps),
    *call("SHF", 6, harmonic, ranges((-2, 2), (-2, 2), (-2, 2), (0.3, 3), (-3, 3), (-3, 3)), 4),
    *call("POLY", MOST_ARGS, power_series, series(1.5), 3),
    *call("CHEBY", MOST_ARGS, chebyshev_series, series(0.9), 3),
    *call("FORSIN", MOST_ARGS, lambda *x: fourier_series(np.sin, *x), series(3, (0.2, 1)), 4),
    *call("FORCOS", MOST_ARGS, lambda *x: fourier_series(np.cos, *x), series(3, (0.2, 1)), 4),
    *call("IMPACT", 7, impact, stops),
    *call("SWEEP", 7, sweep, sweeps),
    *call("BISTOP", 8, between_stops, gaps),
    # operators, where one side is a number as well
    Case("{0} + {1} - {2}", lambda x, y, z: x + y - z, ranges(*[(-3, 3)] * 3)),
    Case("{0}*{1}/{2}", lambda x, y, z: x * y / z, ranges((-3, 3), (-3, 3), (0.3, 3))),
    Case(
        "{0}/{1}**{2}",
        lambda x, y, z: x / np.exp(z * np.log(y)),
        ranges((-3, 3), (0.4, 3), (-2, 2)),
    ),
    Case("-{0}**2", lambda x: -(x * x), ranges((-3, 3))),
    Case("{0}**3 - {0}**2.5", lambda x: x * x * (x - np.sqrt(x)), ranges((0.2, 3))),
    Case("2.5**{0}", lambda x: np.exp(x * np.log(2.5)), ranges((-3, 3))),
    Case("({0} + 2)*3 - 1", lambda x: 3 * x + 5, ranges((-3, 3))),
    Case("2 - 3*{0}", lambda x: 2 - 3 * x, ranges((-3, 3))),
    Case("2/({0} - 4)/5", lambda x: 0.4 / (x - 4), ranges((-3, 3))),
    Case("RTOD*{0} + 30D/PI*DTOR", lambda x: np.degrees(x) + np.radians(1) / 6, ranges((-3, 3))),
]
