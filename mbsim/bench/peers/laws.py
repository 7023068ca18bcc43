"""Normal laws of the scenes as plain functions: force (N) of depth (m) and its rate (m/s)."""

from __future__ import annotations

from collections.abc import Callable

from mbsim.bench import parameters as p

Law = Callable[[float, float], float]


def impact(depth: float, rate: float) -> float:
    """The law of S2a."""
    s = min(depth / p.S2A_LAW.dmax, 1.0)
    damping = p.S2A_LAW.c * s * s * (3.0 - 2.0 * s)
    return max(0.0, float(p.S2A_LAW.k * depth**p.S2A_LAW.e + damping * rate))


def linear(depth: float, rate: float) -> float:
    """The law of S2b."""
    return max(0.0, p.S2B_LAW.k * depth + p.S2B_LAW.c * rate)


def hunt_crossley(depth: float, rate: float) -> float:
    """The law of S2c."""
    return p.S2C_LAW.k * depth * max(0.0, 1.0 + p.S2C_LAW.dissipation * rate)


def stiff(depth: float, rate: float) -> float:
    """The law of S10a."""
    return max(0.0, p.S10A_LAW.k * depth + p.S10A_LAW.c * rate)


#: Plain numbers: compiled code reads no field of a dataclass.
_HERTZ_K, _HERTZ_E = p.S5.k, p.S5.e


def hertz(depth: float, rate: float) -> float:
    """The law of S5, without damping."""
    return float(_HERTZ_K * depth**_HERTZ_E)
