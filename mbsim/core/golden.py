"""The least value of a function of one number, by golden sections.

J. Kiefer, Sequential minimax search for a maximum, Proc. Amer. Math. Soc. 4 (1953) 502.
"""

from __future__ import annotations

import math
from collections.abc import Callable

_PART = 0.5 * (math.sqrt(5.0) - 1.0)


def minimum(
    f: Callable[[float], float],
    low: float,
    high: float,
    absolute: float = 0.0,
    relative: float = 0.0,
) -> tuple[float, float]:
    """Return (f(x), x) of the least value between `low` and `high`.

    Parameters
    ----------
    f : callable
        A function with one minimum there; of one with several, one of them is found.
    low, high : float
        Where it is looked for.
    absolute, relative : float
        x is within `absolute` + `relative` * abs(x) of the minimum; one must be more than rounding.
    """
    left, right = high - _PART * (high - low), low + _PART * (high - low)
    at_left, at_right = f(left), f(right)
    while high - low > absolute + relative * abs(high):
        if at_left < at_right:
            high, right, at_right = right, left, at_left
            left = high - _PART * (high - low)
            at_left = f(left)
        else:
            low, left, at_left = left, right, at_right
            right = low + _PART * (high - low)
            at_right = f(right)
    return min((at_left, left), (at_right, right))
