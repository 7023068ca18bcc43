"""What a normal law does to a mass that meets it, and to one that rests on it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from mbsim.laws.catalog import NormalLaw

#: Steps over the time in which an elastic force would stop the mass.
STEPS = 2000
#: Of the bisections for a depth: their factor falls to rounding.
_HALVINGS = 200


class Impact(NamedTuple):
    """An impact: rebound speed over closing speed, its time [T] and greatest depth [L]."""

    rebound: float
    time: float
    depth: float


def impact_of(law: NormalLaw, constants: Sequence[float], speed: float, mass: float) -> Impact:
    """Return what becomes of a mass that meets a law at a speed.

    The law alone acts: m d'' = -F(d, d') from d = 0, d' = speed, by Runge and Kutta's method.

    Parameters
    ----------
    law, constants
        The law and the numbers that it takes.
    speed : float
        Closing speed [L/T], > 0.
    mass : float
        Effective mass [M such that F = m a].
    """

    def slope(d: float, v: float) -> tuple[float, float]:
        return v, -law.law(d, v, *constants)[0] / mass

    # the time in which an elastic force would stop it
    depth = speed * 1e-6
    while law.law(depth, 0.0, *constants)[2] < 0.5 * mass * speed * speed and depth < 1e9 * speed:
        depth *= 1.5
    h = 2.0 * depth / speed / STEPS
    d, v, deepest = 0.0, speed, 0.0
    for k in range(100 * STEPS):
        a1, b1 = slope(d, v)
        a2, b2 = slope(d + 0.5 * h * a1, v + 0.5 * h * b1)
        a3, b3 = slope(d + 0.5 * h * a2, v + 0.5 * h * b2)
        a4, b4 = slope(d + h * a3, v + h * b3)
        d += h / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4)
        v += h / 6.0 * (b1 + 2.0 * b2 + 2.0 * b3 + b4)
        deepest = max(deepest, d)
        if d <= 0.0:
            return Impact(max(0.0, min(1.0, -v / speed)), k * h, deepest)
    return Impact(0.0, 100 * STEPS * h, deepest)


def resting_depth(law: NormalLaw, constants: Sequence[float], force: float, size: float) -> float:
    """Return the depth [L] at which a law gives `force` [F] > 0 at rest, up to `size` [L].

    It is found by bisection of its logarithm; infinity where the law gives less up to there.
    """
    low, high = 1e-15 * size, size
    if law.law(high, 0.0, *constants)[1] < force:
        return float("inf")
    for _ in range(_HALVINGS):
        middle = (low * high) ** 0.5
        if law.law(middle, 0.0, *constants)[1] < force:
            low = middle
        else:
            high = middle
    return high
