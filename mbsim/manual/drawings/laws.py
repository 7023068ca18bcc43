"""Pictures of the laws of contact: friction over slip, force over depth."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

from mbsim.laws.catalog import FRICTION_LAWS, NORMAL_LAWS
from mbsim.laws.slip_test import Conditions, cycle, sample_of, samples, steady, usual_parameters
from mbsim.manual.pictures import picture

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Impacts: attributes of the law, of a mass of 1 kg.
_NORMAL: dict[str, dict[str, Any]] = {
    "IMPACT": {"stiffness": 1e6, "exponent": 1.5, "damping": 100.0, "dmax": 1e-3},
    "HUNT_CROSSLEY": {
        "stiffness": 1e6,
        "exponent": 1.5,
        "damping": None,
        "restitution_coef": 0.5,
        "ref_velocity": 1.0,
    },
    "HERTZ": {
        "stiffness": 0.0,
        "i_elastic_modulus": 7e6,
        "i_poisson_ratio": 0.3,
        "j_elastic_modulus": None,
        "j_poisson_ratio": None,
        "i_radius": 0.05,
        "j_radius": float("inf"),
        "damping": None,
        "restitution_coef": 0.5,
        "ref_velocity": 1.0,
    },
    "VOLUME": {
        "i_elastic_modulus": 1e6,
        "i_poisson_ratio": 0.3,
        "i_layer_depth": 0.5,
        "j_elastic_modulus": None,
        "j_poisson_ratio": None,
        "j_layer_depth": None,
        "exponent": 1.0,
        "damping": 0.3,
    },
    "POISSON": {"penalty": 1e5, "restitution_coef": 0.5, "normal_trans_vel": 1e-2},
}
#: Speeds at which a mass hits [m/s].
_SPEEDS = (0.5, 1.0)


def _friction(figure: Figure, names: Sequence[str]) -> None:
    """Draw friction over slip speed, and through a slip to and fro."""
    at = Conditions()
    left, right = figure.subplots(1, 2)
    for name in names:
        usual = {k: v or 0.0 for k, v in usual_parameters(FRICTION_LAWS[name]).items()}
        law = sample_of(FRICTION_LAWS[name], usual, at)
        speeds = [v for v in samples(law, at, 120) if v <= 0.03]
        left.plot([1e3 * v for v in speeds], steady(law, at, speeds), label=name)
        x, force = cycle(law, at)
        right.plot([1e3 * each for each in x[::3]], force[::3], label=name)
    left.set(xlabel="slip speed of a long slide [mm/s]", ylabel="friction / normal force")
    right.set(xlabel="slip to and fro [mm]", ylabel="friction on I / normal force")
    if len(names) > 1:
        left.legend()


def _impact(figure: Figure, name: str) -> None:
    """Draw force over depth of a mass of 1 kg that hits at several speeds."""
    law = NORMAL_LAWS[name]
    constants = law.constants(*(_NORMAL[name][each] for each in law.parameters))
    axis = figure.subplots()
    for speed in _SPEEDS:
        d, v, h = 0.0, speed, 2e-6 / speed
        depths, forces = [0.0], [0.0]
        while d >= 0.0:
            # velocity Verlet with the force at the middle of the step
            d += 0.5 * h * v
            force = law.law(d, v, *constants)[0]
            v -= h * force
            d += 0.5 * h * v
            depths.append(1e3 * d)
            forces.append(1e-3 * force)
        keep = max(1, len(depths) // 250)
        label = f"{speed:g} m/s in, {-v:.3f} m/s out"
        axis.plot(depths[::keep], forces[::keep], label=label)
    axis.set(xlabel="depth [mm]", ylabel="force [kN]")
    axis.legend()


def _register() -> None:
    """Register one picture a law."""
    for name in FRICTION_LAWS:
        picture(f"law-{name.lower()}.svg")(partial(_friction, names=[name]))
    for name in _NORMAL:
        picture(f"law-{name.lower()}.svg")(partial(_impact, name=name))


@picture("law-friction.svg")
def friction(figure: Figure) -> None:
    """Draw a law that creeps, one of bristles and one that holds."""
    _friction(figure, ["COULOMB_ON", "LUGRE", "STICTION"])


_register()
