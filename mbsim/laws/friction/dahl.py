"""DAHL: friction as a spring that gives way, without a difference of static and dynamic.

    F = -k z,   z' = v - |v| k z / (mu_d N)

so that |F| never exceeds mu_d N, nearing it over the length mu_d N/k, the same at any speed. Along
one straight way F = -Fc + (F0 + Fc) exp(-k x/Fc) with Fc = mu_d N. As k is constant no energy comes
of it, whatever N does: k z^2/2 grows by k z v less |v| (k z)^2/(mu_d N).
As N goes to 0 the spring would follow ever faster, at k |v|/(mu_d N); it follows at most FASTEST
times as fast as the mass m that slips would swing on it, sqrt(k/m): where mu_d N is less than
sqrt(k m) |v|/FASTEST as at that, and gives the part of its force that mu_d N is of it.
Under a load that goes to and fro it drifts a little: it does not hold like STICTION.
Source: P. R. Dahl, A solid friction model, Aerospace Corp. TOR-0158 (1968), exponent 1.
"""

from __future__ import annotations

import math

from mbsim.laws.catalog import FASTEST, LASTS, SLIP, FrictionInput, Parameter, friction_law


@friction_law(
    "DAHL",
    "mu_dynamic",
    Parameter("bristle_stiffness", positive=True, about="stiffness along the surface", unit="F/L"),
    memory=2,
    carried=2,
)
def dahl(
    inputs: FrictionInput, memory: tuple[float, ...], mu_dynamic: float, bristle_stiffness: float
) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Return (Fx, Fy, Mx, My, Tz, energy of the spring, mode) and the rate of the stretch."""
    z, v = memory, inputs.xdot
    limit = mu_dynamic * inputs.nforce
    speed = math.hypot(v[0], v[1])
    least = max(limit, math.sqrt(bristle_stiffness * inputs.mass) * speed / FASTEST)
    if least <= 0.0:
        return (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, SLIP, 0.0, 1.0, 0.0), (z[0], z[1], 0.0, 0.0)
    wear = bristle_stiffness * speed / least
    pull = limit / least * bristle_stiffness
    stored = 0.5 * pull * (z[0] * z[0] + z[1] * z[1])
    size, unit = least / bristle_stiffness, LASTS * math.sqrt(bristle_stiffness / inputs.mass)
    force = (-pull * z[0], -pull * z[1], 0.0, 0.0, 0.0, stored, SLIP, 0.0, size, unit)
    return force, (z[0], z[1], v[0] - wear * z[0], v[1] - wear * z[1])
