"""Step control shared by the one-step methods: first step, next step, why to stop."""

from __future__ import annotations

import math

from mbsim.core.jitable import jitable

SAFETY = 0.9
SHRINK = 0.2
GROW = 3.0
HOLD = 1.2


@jitable
def next_factor(error: float, before: float, order: float, memory: float, rejected: bool) -> float:
    """Return the factor from this step to the next, for error / tol now and in the step before.

    PI control with exponents (1 - 3 b/4)/k and b/k, k = order of the error's step power, b =
    `memory` (0 to 0.4): the memory of the last error keeps the step from thrashing at a
    stability limit, and slows its growth after a switch.
    Source: K. Gustafsson, ACM Trans. Math. Softw. 17 (1991) 533; E. Hairer, G. Wanner, Solving
    ODEs II (1996), section IV.2.
    """
    if error == 0.0:
        return GROW
    if rejected:
        return max(SHRINK, SAFETY * error ** (-1.0 / order))
    growth = error ** (-(1.0 - 0.75 * memory) / order)
    factor = SAFETY * growth * max(before, 1e-4) ** (memory / order)
    return min(GROW, max(SHRINK, factor))


@jitable
def extrapolated_factor(error: float, before: float, order: float, ratio: float) -> float:
    """Return the factor from this step of an implicit method to the next.

    The error is extrapolated from this and the last one, `ratio` being this step over the last, 0
    if there was none. A step that would grow by less than HOLD is kept: its factors are.
    Source: K. Gustafsson, ACM Trans. Math. Softw. 20 (1994) 496; E. Hairer, G. Wanner, Solving
    ODEs II (1996), section IV.8.
    """
    error = max(error, 1e-10)
    factor = SAFETY * error ** (-1.0 / order)
    if ratio > 0.0:
        factor *= min(1.0, ratio * (max(before, 1e-2) / error) ** (1.0 / order))
    factor = min(GROW, max(SHRINK, factor))
    return 1.0 if 1.0 <= factor <= HOLD else factor


@jitable
def quantised(h: float) -> float:
    """Return h rounded down to six binary digits.

    Rounding errors in an error estimate then leave the next step as it is. Without this they
    grow from step to step at contacts, and a deck in mm takes other steps than in m.
    """
    if not 0.0 < h < math.inf:
        return h
    digits, exponent = math.frexp(h)
    return math.ldexp(math.floor(64.0 * digits + 1e-6) / 64.0, exponent)


@jitable
def smallest_step(t: float, own: float, h_min: float) -> float:
    """Return the step below which time itself does not advance cleanly, or the deck's h_min.

    `own` is the problem's own time: what the step is measured by at time 0.
    """
    return max(h_min, 16.0 * 2.2e-16 * max(abs(t), 1e-3 * own))


@jitable
def starting_step(rate: float, curvature: float, tol: float, order: float, span: float) -> float:
    """Return a first step from |f| and |f'| in the scaled norm [1/T], [1/T^2].

    Hairer, Norsett and Wanner, Solving ODEs I, section II.4, with y of size one.
    """
    largest = max(rate, math.sqrt(curvature))
    if largest <= 1e-15 / span:
        return span
    return min(span, (0.01 * tol) ** (1.0 / order) / largest)
