"""Dry friction of Force_DryFriction: a spring in series with a slider, or rigid.

x is the displacement, u where the slider is, k the stiffness, F the force at which it slides on and
F_s that at which it begins to (F unless given):

    stick    f = k (x - u)                  while abs(f) <= F_s
    slip     f = F sign, u = x - f/k        while x goes on the way of the sign

f acts against x; what it does in slip is lost, the spring gives back f^2/(2 k). An integrator
that ends its steps where this changes keeps to one of the two within each, `frozen`. Any other has
the return mapping of the step: f = k (x - u), at most the limit, and at its end u = x - f/k
(J. C. Simo, T. J. R. Hughes, Computational Inelasticity, 1998, ch. 1). That is the friction of the
seed, P. Maincon's DryFriction of Muscade, but for the rule by which f goes on within a step: a
rate x' = f'/k by the integrator's own formula rings, and need not converge.
"""

from __future__ import annotations

import math

from mbsim.core.arrays import V2, V3
from mbsim.core.jitable import jitable


@jitable
def dry_force(
    x: float, slider: float, slides: float, k: float, limit: float, static: float, frozen: int
) -> V2:
    """Return the force f against x, and 1 where it gives way to x, 0 where it is the spring's.

    Parameters
    ----------
    x, slider : float
        Displacement, and place of the slider at the committed state [L or rad]; no number: not yet.
    slides : float
        0, or the sign of f in slip at the committed state.
    k : float
        Stiffness [F/L or FL/rad].
    limit, static : float
        Force of slip, and the one that begins it [F or FL].
    frozen : int
        1 to keep to the mode of the committed state.

    Returns
    -------
    float, float
    """
    if math.isnan(slider):
        return 0.0, 1.0
    if frozen == 1 and slides != 0.0:
        return slides * limit, 1.0
    force = k * (x - slider)
    most = static if slides == 0.0 else limit
    if frozen == 1 or abs(force) <= most:
        return force, 0.0
    return math.copysign(most, force), 1.0


@jitable
def dry_mode(
    x: float,
    rate: float,
    slider: float,
    slides: float,
    k: float,
    limit: float,
    static: float,
    frozen: int,
) -> float:
    """Return the mode that the point asks for: 0 to stick, or the sign of f in slip.

    The arguments are those of `dry_force`, and the rate of x.
    """
    if math.isnan(slider):
        return 0.0
    if slides != 0.0 and frozen == 1:
        return slides if slides * rate >= 0.0 else 0.0
    force = k * (x - slider)
    most = static if slides == 0.0 else limit
    return math.copysign(1.0, force) if abs(force) > most else 0.0


@jitable
def rigid_mode(force: float, rate: float, slides: float, static: float, rest: float) -> float:
    """Return the mode that a point asks for where k is infinite.

    Parameters
    ----------
    force : float
        f that holds x' at 0; it counts in stick alone.
    rate, slides, static : float
        As of `dry_mode`.
    rest : float
        What x' may be the other way by rounding alone.

    Returns
    -------
    float
    """
    if slides != 0.0:
        return slides if slides * rate >= -rest else 0.0
    return math.copysign(1.0, force) if abs(force) > static else 0.0


@jitable
def dry_commit(
    x: float,
    rate: float,
    slider: float,
    slides: float,
    k: float,
    limit: float,
    static: float,
    frozen: int,
) -> V3:
    """Return slider, mode and the force that hold from here on; arguments as of `dry_mode`."""
    if math.isnan(slider):
        return x, 0.0, 0.0
    force, gives = dry_force(x, slider, slides, k, limit, static, frozen)
    mode = dry_mode(x, rate, slider, slides, k, limit, static, frozen)
    if mode != 0.0:
        force = mode * limit
    elif gives == 0.0:
        return slider, mode, force
    return x - force / k, mode, force
