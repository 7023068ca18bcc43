"""DAHL: friction as a spring that gives way, without a difference of static and dynamic.

    F = -k z,   z' = v - |v| k z / (mu_d N)

so that |F| never exceeds mu_d N, nearing it over the length mu_d N/k, the same at any speed. Along
one straight way F = -Fc + (F0 + Fc) exp(-k x/Fc) with Fc = mu_d N. As k is constant no energy comes
of it, whatever N does: k z^2/2 grows by k z v less |v| (k z)^2/(mu_d N).
As N goes to 0 the spring would follow ever faster; so below a thousandth of the usual mu_d N it
follows as at that, and gives the part of its force that N is of that load.
Under a load that goes to and fro it drifts a little: it does not hold like STICTION.
Source: P. R. Dahl, A solid friction model, Aerospace Corp. TOR-0158 (1968), exponent 1.
"""

from __future__ import annotations

import math

from mbsim.laws.catalog import LEAST, SLIP, Parameter, friction_law


def _usual(load: float, mu_dynamic: float, bristle_stiffness: float) -> float:
    """Return how far the spring is stretched under a usual load [L]."""
    return max(mu_dynamic, 1e-3) * load / bristle_stiffness


@friction_law(
    "DAHL", "mu_dynamic", Parameter("bristle_stiffness", positive=True), memory=2, size=_usual
)
def dahl(inputs, memory, mu_dynamic, bristle_stiffness):
    """Return (Fx, Fy, Mx, My, Tz, energy of the spring, mode) and the rate of the stretch."""
    z, v = memory, inputs.xdot
    limit = mu_dynamic * inputs.nforce
    least = max(limit, LEAST * bristle_stiffness * inputs.size)
    if least <= 0.0:
        return (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, SLIP), (0.0, 0.0)
    wear = bristle_stiffness * math.hypot(v[0], v[1]) / least
    pull = limit / least * bristle_stiffness
    stored = 0.5 * pull * (z[0] * z[0] + z[1] * z[1])
    force = (-pull * z[0], -pull * z[1], 0.0, 0.0, 0.0, stored, SLIP)
    return force, (v[0] - wear * z[0], v[1] - wear * z[1])
