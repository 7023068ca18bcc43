"""CONTENSOU: sliding and spinning on a round patch share one friction.

On a disc of radius R under uniform pressure, with v the slip of its middle, w the spin and
e = v/(R |w|),

    F = -mu_d N f(e) t,      M = -mu_d N R m(e) w/|w|

f -> e, m -> 2/3 where it only spins, f -> 1 - 1/(8 e^2), m -> 1/(4 e) where it only slides; between
these f and m are rational functions within 1.7 % of the integrals over the disc. So spin takes the
sticking from sliding, and a spinning disc comes to rest in both at once. Where both are
slow the force is smoothed: what counts is sqrt(v^2 + (R w)^2) against `friction_trans_vel`. R is
`patch_radius`, or where that is 0 (not given) that of a disc with the area of contact.
Sources: R. I. Leine, C. Glocker, Eur. J. Mech. A/Solids 22 (2003) 193-216 for the coupling; the
functions are fitted to the integrals here, see tests/analytic/test_friction_laws.py.
"""

from __future__ import annotations

import math

from mbsim.laws.catalog import Parameter, friction_law
from mbsim.laws.curves import tanh_ratio


@friction_law(
    "CONTENSOU", "mu_dynamic", "friction_trans_vel", Parameter("patch_radius", 0.0, positive=True)
)
def contensou(inputs, mu_dynamic, friction_trans_vel, patch_radius):
    """Return Fx, Fy, Mx, My, Tz on I."""
    R = patch_radius if patch_radius > 0.0 else inputs.radius
    v, turn = math.hypot(inputs.xdot[0], inputs.xdot[1]), R * inputs.xdot[2]
    w, pull = abs(turn), -mu_dynamic * inputs.nforce
    total = math.hypot(v, w)
    if total == 0.0:
        return 0.0, 0.0, 0.0, 0.0, 0.0

    # f/v and m/w in v and w, which hold where one of them is 0
    vv, vw, ww = v * v, v * w, w * w
    slide = (v * (vv - 0.24827 * vw + 0.16709 * ww) + 0.3005 * w * ww) / (
        vv * (vv - 0.24827 * vw + 0.29209 * ww) + ww * (0.11258 * vw + 0.3005 * ww)
    )
    part = w * (ww - 0.51658 * vw - 0.67546 * vv) + 1.6779 * v * vv
    whole = ww * (ww - 0.51658 * vw + 0.87846 * vv) + vv * (-2.3807 * vw + 4.4744 * vv)
    twist = 2.0 / 3.0 * part / whole
    smooth = total * tanh_ratio(total, friction_trans_vel)
    fx, fy = pull * smooth * slide * inputs.xdot[0], pull * smooth * slide * inputs.xdot[1]
    return fx, fy, 0.0, 0.0, pull * smooth * R * twist * turn
