"""STEP and STEP5: the polynomial blends of the deck language, with derivatives."""

from __future__ import annotations

from mbsim.core.jitable import jitable


@jitable
def step(x: float, x0: float, h0: float, x1: float, h1: float) -> float:
    """Return the cubic blend from h0 (x <= x0) to h1 (x >= x1), slope 0 at both ends."""
    if x <= x0:
        return h0
    if x >= x1:
        return h1
    s = (x - x0) / (x1 - x0)
    return h0 + (h1 - h0) * s * s * (3.0 - 2.0 * s)


@jitable
def step_derivative(x: float, x0: float, h0: float, x1: float, h1: float, order: int) -> float:
    """Return the derivative of `step` of order 0, 1 or 2 with respect to x."""
    if order == 0:
        return step(x, x0, h0, x1, h1)
    if x <= x0 or x >= x1:
        return 0.0
    width = x1 - x0
    s = (x - x0) / width
    if order == 1:
        return (h1 - h0) * 6.0 * s * (1.0 - s) / width
    return (h1 - h0) * (6.0 - 12.0 * s) / (width * width)


@jitable
def step5_derivative(x: float, x0: float, h0: float, x1: float, h1: float, order: int) -> float:
    """Return the quintic blend s^3 (10 - 15 s + 6 s^2) or its derivative of order 1 or 2."""
    if x <= x0:
        return h0 if order == 0 else 0.0
    if x >= x1:
        return h1 if order == 0 else 0.0
    width = x1 - x0
    s = (x - x0) / width
    if order == 0:
        return h0 + (h1 - h0) * s * s * s * (10.0 + s * (6.0 * s - 15.0))
    if order == 1:
        return (h1 - h0) * 30.0 * s * s * (1.0 - s) * (1.0 - s) / width
    return (h1 - h0) * 60.0 * s * (1.0 - s) * (1.0 - 2.0 * s) / (width * width)
