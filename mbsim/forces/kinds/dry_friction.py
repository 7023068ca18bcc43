"""Force_DryFriction (ours; Muscade's DryFriction): a slider, with a spring in series.

`type` TX, TY, TZ: x is along that axis of J [L], and both bodies are pushed at I's origin; RX, RY,
RZ: the angle about it [rad]. `friction` is the force or torque F of slip, `friction_static` the one
F_s that begins it (F unless given), and `dx` what the spring gives until it reaches `friction`: its
stiffness k is friction/dx. With u where the slider is,

    stick    f = k (x - u)                  while abs(f) <= F_s
    slip     f = F sign, u = x - f/k        while x goes on the way of the sign

f acts against x; what it does in slip is lost, the spring gives back f^2/(2 k). An integrator
that ends its steps where this changes keeps to one of the two within each, `frozen`. Any other has
the return mapping of the step: f = k (x - u), at most the limit, and at its end u = x - f/k
(J. C. Simo, T. J. R. Hughes, Computational Inelasticity, 1998, ch. 1). That is the friction of the
seed, P. Maincon's DryFriction of Muscade, but for the rule by which f goes on within a step: a
rate x' = f'/k by the integrator's own formula rings, and need not converge.

dx = 0 is rigid friction, with 0 for k: here is what it does in slip; what sticks is held by an
equation of velocity 0, its multiplier the force (`dynamics.stiction.rigid_friction`).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from mbsim.arrays.codes import (
    AXIS_FORCE_AT_I,
    AXIS_TORQUE,
    SLIDER_LIMIT,
    SLIDER_STATIC,
    SLIDER_STIFFNESS,
)
from mbsim.core.arrays import V2, V3
from mbsim.core.jitable import jitable
from mbsim.forces.catalog import Acts, Finding, Parameter, Switched, Values, force
from mbsim.forces.formula import Kept

#: f of a row is that of slip but for so many parts of it: it was turned into the global frame.
ROUNDED = 1e-12


@jitable
def dry_force(
    x: float, slider: float, slides: float, k: float, limit: float, static: float, frozen: float
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
    frozen: float,
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
def dry_commit(
    x: float,
    rate: float,
    slider: float,
    slides: float,
    k: float,
    limit: float,
    static: float,
    frozen: float,
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


def _acts(values: Values) -> Acts:
    turns, axis = values["type"][0] == "R", "XYZ".index(values["type"][1])
    return Acts(AXIS_TORQUE, axis, turns=True) if turns else Acts(AXIS_FORCE_AT_I, axis)


def _check(values: Values) -> Iterator[Finding]:
    friction, static = values["friction"], values["friction_static"]
    if static is not None and static < friction:
        yield Finding(f"must be a number >= friction ({friction:g})", "friction_static")


def _constants(values: Values) -> Sequence[float]:
    """Return stiffness, 0 where it is infinite, and the forces of slip and of its begin."""
    friction, dx, static = values["friction"], values["dx"], values["friction_static"]
    return friction / dx if dx > 0.0 else 0.0, friction, friction if static is None else static


@jitable
def _against(x: float, par: Sequence[float], kept: Kept) -> V2:
    """Return f against x, and 1 where it gives way to x."""
    if par[SLIDER_STIFFNESS] == 0.0:
        return kept.mode * par[SLIDER_LIMIT], 1.0
    return dry_force(
        x,
        kept.slider,
        kept.mode,
        par[SLIDER_STIFFNESS],
        par[SLIDER_LIMIT],
        par[SLIDER_STATIC],
        kept.frozen,
    )


def _force(x: float, rate: float, par: Sequence[float], kept: Kept, law: Any) -> V3:
    size, gives = _against(x, par, kept)
    k = par[SLIDER_STIFFNESS]
    return -size, 0.5 * size * size / k if k > 0.0 else 0.0, gives * size * rate


def _slopes(x: float, rate: float, par: Sequence[float], kept: Kept, law: Any) -> V2:
    _, gives = _against(x, par, kept)
    return -par[SLIDER_STIFFNESS] if gives == 0.0 else 0.0, 0.0


def _side(x: float, rate: float, par: Sequence[float], kept: Kept, law: Any) -> float:
    k, limit, static = par[SLIDER_STIFFNESS], par[SLIDER_LIMIT], par[SLIDER_STATIC]
    return dry_mode(x, rate, kept.slider, kept.mode, k, limit, static, 1)


def _commit(x: float, rate: float, par: Sequence[float], kept: Kept) -> V3:
    """Return slider, mode, and what the spring loses as it snaps from the force that slid first."""
    k, limit, static = par[SLIDER_STIFFNESS], par[SLIDER_LIMIT], par[SLIDER_STATIC]
    stored, _ = dry_force(x, kept.slider, kept.mode, k, limit, static, kept.frozen)
    slider, mode, force = dry_commit(x, rate, kept.slider, kept.mode, k, limit, static, kept.frozen)
    return slider, mode, 0.5 * (stored * stored - force * force) / k


def _modes(values: Values, force: np.ndarray, torque: np.ndarray) -> list[str]:
    """Return stick or slip of each row: in slip f is `friction`, else it is not.

    What sticks after friction_static holds more than that, what sticks else less.
    """
    f = np.linalg.norm(torque if _acts(values).turns else force, axis=1)
    slips = np.abs(f - values["friction"]) <= ROUNDED * values["friction"]
    return ["slip" if each else "stick" for each in slips]


force(
    "DRYFRICTION",
    "Force_DryFriction",
    "dry_frictions",
    Parameter(
        "type",
        None,
        words=("TX", "TY", "TZ", "RX", "RY", "RZ"),
        about="along J's axis (T) or about it (R)",
    ),
    Parameter(
        "friction", None, positive=True, about="force or torque while it slips", unit="F or F L"
    ),
    Parameter(
        "friction_static",
        None,
        positive=True,
        optional=True,
        about="what begins the slip",
        unit="F or F L",
        shown="friction",
    ),
    Parameter("dx", about="give before it slips; 0: none", unit="L or rad"),
    form=Switched(_acts, _constants, _force, _side, _slopes, _commit, rigid_by="dx"),
    title="dry friction",
    about="a dry slider between two markers that holds and slips",
    check=_check,
    told={"mode": _modes},
    refused={
        "scale": "is Muscade's x'scale, by which it tells stick from slip; here the mode is "
        "kept, and there is nothing to scale"
    },
)
