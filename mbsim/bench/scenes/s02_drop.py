"""S2a, S2b, S2c: a sphere bounces on a plane under three contact laws."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from mbsim.bench import deck as text
from mbsim.bench import oracle
from mbsim.bench import parameters as p
from mbsim.bench.outcome import Outcome
from mbsim.bench.scene import Scene, Target, Variation

#: IMPACT's damper fades in over dmax; F = max(0, k d + c d') is its limit for a short one. This [m]
#: moves the end height by 1.5e-9 m in the first bounce, 1.5e-8 m over all.
SHORT_RAMP = 1e-10


def dropped(drop: p.Drop, comment: str, law: dict[str, object]) -> str:
    """Return the deck of a sphere at rest above the plane z = 0."""
    place = (0.0, 0.0, drop.radius + drop.gap)
    return text.deck(
        comment,
        [
            text.GROUND,
            text.FLOOR,
            text.sphere(2, drop.mass, drop.radius, place),
            text.contact(301, [200], [100], **law),
            text.gravity(),
        ],
        drop.end_time,
    )


def _impact(variation: Variation) -> str:
    return dropped(p.S2, "A sphere drops on a plane: IMPACT", text.impact(*p.S2A_LAW))


def _linear(variation: Variation) -> str:
    law = text.impact(p.S2B_LAW.k, 1.0, p.S2B_LAW.c, SHORT_RAMP)
    return dropped(p.S2, "A sphere drops on a plane: linear spring and damper", law)


def _hunt_crossley(variation: Variation) -> str:
    law = {
        "cnf_type": "HUNT_CROSSLEY",
        "stiffness": p.S2C_LAW.k,
        "exponent": 1.0,
        "damping": p.S2C_LAW.dissipation,
    }
    return dropped(p.S2, "A sphere drops on a plane: Hunt and Crossley", law)


def _errors(outcome: Outcome, variant: str) -> dict[str, float]:
    """Return the largest error of the height [m] over all rows and over the first bounce."""
    exact = oracle.s2(variant).height(outcome.time)
    error = np.abs(outcome.position[:, 0, 2] - p.S2.radius - exact)
    first = outcome.time <= p.S2.first_bounce + 1e-9
    return {"z_first_bounce": float(error[first].max()), "z_max": float(error.max())}


def _scene(name: str, title: str, deck: Callable[[Variation], str], *variants: str) -> Scene:
    return Scene(
        name=name,
        title=title,
        end_time=p.S2.end_time,
        measure="z_first_bounce",
        unit="largest error of the height up to 0.86 s (one bounce) [m]",
        deck=deck,
        errors=_errors,
        targets=(Target(1 / 3),),
        variants=variants,
        second=("z_max", "up to 3 s (six to ten bounces)"),
    )


SCENES = (
    _scene(
        "S2a",
        "bouncing sphere, IMPACT k = 1e8, e = 1.5, c = 200, dmax = 1e-4, 3 s",
        _impact,
        "impact",
    ),
    _scene(
        "S2b",
        "bouncing sphere, linear spring 1e6 and damper 60, 3 s",
        _linear,
        "linear",
        "linear_noclip",
        "mujoco",
    ),
    _scene(
        "S2c",
        "bouncing sphere, Hunt-Crossley k = 1e6, 0.05 s/m, 3 s",
        _hunt_crossley,
        "hc",
    ),
)
