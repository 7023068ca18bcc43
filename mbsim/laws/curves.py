"""Functions of slip speed that several friction laws are made of."""

from __future__ import annotations

import math

from mbsim.core.jitable import jitable


@jitable
def against(direction, size):
    """Return a force of `size` against a vector of length 1 or 0; no torque."""
    return (-size * direction[0], -size * direction[1], 0.0, 0.0, 0.0)


@jitable
def tanh_ratio(speed, transition):
    """Return tanh(v/v_t)/v [T/L], 1/v_t at v = 0."""
    u = speed / transition
    return math.tanh(u) / speed if u > 1e-4 else (1.0 - u * u / 3.0) / transition


@jitable
def stribeck(speed, mu_static, mu_dynamic, velocity, exponent):
    """Return mu_d + (mu_s - mu_d) exp(-(v/v_s)^alpha): static friction that sliding wears off."""
    return mu_dynamic + (mu_static - mu_dynamic) * math.exp(-((speed / velocity) ** exponent))
