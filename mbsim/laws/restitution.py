"""Hunt-Crossley damping, and the one that gives a wanted restitution at a reference speed.

With F = f(d) max(0, 1 + a d') and no other force, a mass that touches at speed v leaves at e v:

    A (1 + e) = ln((1 + A) / (1 - e A)),      A = a v

whatever the mass and the spring f(d), because v dv / (1 + a v) = -f(d) dd / m. So e falls with
speed, from 1 at v = 0, and the rebound speed stays below 1/a.
Source: K. H. Hunt, F. R. E. Crossley, J. Appl. Mech. 42 (1975) 440-445 for the force; the
relation is the integral above over the way in and the way out.
"""

from __future__ import annotations

import math

from mbsim.core.jitable import jitable


@jitable
def hunt_crossley(spring: float, depth_rate: float, dissipation: float) -> float:
    """Return `spring` [F] with the factor max(0, 1 + a d'); `dissipation` is a [T/L]."""
    # fast separation would make the factor negative; contact cannot pull
    return spring * max(0.0, 1.0 + dissipation * depth_rate)


def dissipation_of(
    damping: float, restitution_coef: float | None, ref_velocity: float | None
) -> float:
    """Return a [T/L]: `damping`, or what gives `restitution_coef` at `ref_velocity` [L/T]."""
    if restitution_coef is None or ref_velocity is None:
        return damping
    return dimensionless_damping(restitution_coef) / ref_velocity


def dimensionless_damping(restitution: float) -> float:
    """Return A > 0 with A (1 + e) = ln((1 + A) / (1 - e A)) for a restitution 0 < e <= 1.

    The root lies in (0, 1/e) and is the only one there besides A = 0; it is bracketed to the
    last bit. e = 1 gives 0.
    """
    e = restitution
    if e == 1.0:
        return 0.0

    # the excess falls from 0 at A = 0, then rises to infinity at A = 1/e
    low, high = 0.0, 1.0 / e
    while True:
        middle = 0.5 * (low + high)
        if not low < middle < high:
            return middle
        if e * middle >= 1.0 or _excess(middle, e) > 0.0:
            high = middle
        else:
            low = middle


def _excess(A: float, e: float) -> float:
    """Return ln((1 + A) / (1 - e A)) - A (1 + e), without cancellation where A is small."""
    if A > 0.05:
        return math.log1p(A) - math.log1p(-e * A) - A * (1.0 + e)
    # sum of A^n / n (e^n - (-1)^n) from n = 2 on: the terms of n = 1 cancel
    total, power = 0.0, A
    for n in range(2, 14):
        power *= A
        sign = 1.0 if n % 2 == 0 else -1.0
        # e^2 - 1 is exact as a product
        factor = (e - 1.0) * (e + 1.0) if n == 2 else e**n - sign
        total += power / n * factor
    return total
