"""Functions of slip speed that several friction laws are made of."""

from __future__ import annotations

import math

from mbsim.core.arrays import V2, V3, V5
from mbsim.core.jitable import jitable


@jitable
def against(direction: V2 | V3, size: float) -> V5:
    """Return a force of `size` against a vector of length 1 or 0; no torque."""
    return (-size * direction[0], -size * direction[1], 0.0, 0.0, 0.0)


@jitable
def tanh_ratio(speed: float, transition: float) -> float:
    """Return tanh(v/v_t)/v [T/L], 1/v_t at v = 0."""
    u = speed / transition
    return math.tanh(u) / speed if u > 1e-4 else (1.0 - u * u / 3.0) / transition


@jitable
def stribeck(
    speed: float, mu_static: float, mu_dynamic: float, velocity: float, exponent: float
) -> float:
    """Return mu_d + (mu_s - mu_d) exp(-(v/v_s)^alpha): static friction that sliding wears off."""
    return mu_dynamic + (mu_static - mu_dynamic) * math.exp(-((speed / velocity) ** exponent))
