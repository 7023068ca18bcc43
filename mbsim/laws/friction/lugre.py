"""LUGRE: bristles that bend, with a static peak, a falling branch and a viscous part.

    F = -(s0 z + s1 z' + s2 v),   z' = v - s0 |v| z / g,
    g = N (mu_d + (mu_s - mu_d) exp(-(v/v_s)^2))

s0 is `bristle_stiffness`, s1 `bristle_damping`, s2 `viscous_coef`. From slip to force it is
passive where s1 <= 4 g/|v|; the published set (s1 = sqrt(1e5)) breaks that at high slip. With
`damping_trans_vel` v_d the damping of the bristles is s1 exp(-(v/v_d)^2), which keeps it.
Under a load that goes to and fro it drifts: it does not hold like STICTION.
As N goes to 0 the bristles would follow ever faster, at s0 |v|/g; they follow at most FASTEST
times as fast as the mass m that slips would swing on them, sqrt(s0/m): where g is less than
sqrt(s0 m) |v|/FASTEST as at that, and give less force in the same ratio: g, in a steady slide.
Sources: C. Canudas de Wit et al., IEEE Trans. Automatic Control 40 (1995) 419-425; N. Barabanov,
R. Ortega, ibid. 45 (2000) 675-686 on passivity.
"""

from __future__ import annotations

import math

from mbsim.core.arrays import V2
from mbsim.laws.catalog import FASTEST, LASTS, SLIP, FrictionInput, Parameter, friction_law
from mbsim.laws.curves import stribeck as falling


@friction_law(
    "LUGRE",
    "mu_static",
    "mu_dynamic",
    Parameter("stribeck_vel", positive=True, about="speed scale of the falling branch", unit="L/T"),
    Parameter("bristle_stiffness", positive=True, about="stiffness along the surface", unit="F/L"),
    Parameter("bristle_damping", 0.0, about="damping of the bristles", unit="F T/L"),
    Parameter("viscous_coef", 0.0, about="force per slip speed, whatever N is", unit="F T/L"),
    Parameter(
        "damping_trans_vel",
        math.inf,
        positive=True,
        about="slip speed above which the bristles' damping fades",
        unit="L/T",
        usual="never",
    ),
    memory=2,
    carried=2,
)
def lugre(
    inputs: FrictionInput,
    memory: V2,
    mu_static: float,
    mu_dynamic: float,
    stribeck_vel: float,
    bristle_stiffness: float,
    bristle_damping: float,
    viscous_coef: float,
    damping_trans_vel: float,
) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Return (Fx, Fy, Mx, My, Tz, energy of the bristles, mode) and the rate of their bend."""
    z, v = memory, inputs.xdot
    speed = math.hypot(v[0], v[1])
    g = inputs.nforce * falling(speed, mu_static, mu_dynamic, stribeck_vel, 2.0)
    least = max(g, math.sqrt(bristle_stiffness * inputs.mass) * speed / FASTEST)
    if least <= 0.0:
        return (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, SLIP, 0.0, 1.0, 0.0), (z[0], z[1], 0.0, 0.0)
    part, wear = g / least, bristle_stiffness * speed / least
    rate = (v[0] - wear * z[0], v[1] - wear * z[1])
    damping = bristle_damping * math.exp(-((speed / damping_trans_vel) ** 2))
    viscous = viscous_coef if g > 0.0 else 0.0
    fx = -part * (bristle_stiffness * z[0] + damping * rate[0]) - viscous * v[0]
    fy = -part * (bristle_stiffness * z[1] + damping * rate[1]) - viscous * v[1]
    stored = 0.5 * part * bristle_stiffness * (z[0] * z[0] + z[1] * z[1])
    size, unit = least / bristle_stiffness, LASTS * math.sqrt(bristle_stiffness / inputs.mass)
    return (fx, fy, 0.0, 0.0, 0.0, stored, SLIP, 0.0, size, unit), (z[0], z[1], rate[0], rate[1])
