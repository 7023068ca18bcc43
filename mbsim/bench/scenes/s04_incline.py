"""S4stick and S4slip: a box on a plane under tilted gravity, held by friction or not."""

from __future__ import annotations

import math

from mbsim.bench import deck as text
from mbsim.bench import parameters as p
from mbsim.bench.outcome import Outcome
from mbsim.bench.scene import Scene, Variation

#: Each of four corners carries a quarter of the weight: the depth at rest [m].
DEPTH = p.S4.mass * p.GRAVITY * math.cos(p.S4.tilt) / (4.0 * p.S4.law.k)
DMAX = 1e-5  # m, of IMPACT's damper; the depth at rest is twice that


def _deck(comment: str, mu: float, end_time: float, variation: Variation) -> str:
    """Return the deck, with smoothed friction of a transition velocity `vs`, or with STICTION."""
    holds = {"cff_type": "STICTION", "mu_static": mu, "mu_dynamic": mu}
    friction = text.coulomb(mu, variation["vs"]) if "vs" in variation else holds
    law = text.impact(p.S4.law.k, 1.0, p.S4.law.c, DMAX) | friction
    return text.deck(
        comment,
        [
            text.GROUND,
            text.FLOOR,
            text.cuboid(2, p.S4.mass, p.S4.size, (0.0, 0.0, 0.5 * p.S4.size[2] - DEPTH)),
            text.contact(301, [200], [100], **law),
            text.gravity(p.GRAVITY * math.sin(p.S4.tilt), -p.GRAVITY * math.cos(p.S4.tilt)),
        ],
        end_time,
    )


def _stick(variation: Variation) -> str:
    comment = "A box held by friction on 20 degrees"
    return _deck(comment, p.S4.mu_stick, p.S4.stick_end_time, variation)


def _slip(variation: Variation) -> str:
    comment = "A box slides down 20 degrees"
    return _deck(comment, p.S4.mu_slip, p.S4.slip_end_time, variation)


def _way(outcome: Outcome) -> float:
    return float(outcome.position[-1, 0, 0] - outcome.position[0, 0, 0])


def _creep(outcome: Outcome, variant: str) -> dict[str, float]:
    """Return how far the box crept [m]."""
    return {"creep_abs": abs(_way(outcome))}


def _acceleration(outcome: Outcome, variant: str) -> dict[str, float]:
    """Return the relative error of the mean acceleration."""
    return {"acc_rel": abs(_way(outcome) / p.S4.slip_end_x - 1.0)}


SCENES = (
    Scene(
        name="S4stick",
        title="box on 20 degrees, mu = 0.5, held or by smoothed friction that creeps, 10 s",
        end_time=p.S4.stick_end_time,
        measure="creep_abs",
        unit="way crept in 10 s [m]",
        deck=_stick,
        errors=_creep,
        variations=({"vs": 1e-2}, {"vs": 1e-3}, {"vs": 1e-4}, {"stiction": 1.0}),
        tolerances=(1e-3, 1e-5),
    ),
    Scene(
        name="S4slip",
        title="box slides down 20 degrees, mu = 0.2, 2 s",
        end_time=p.S4.slip_end_time,
        measure="acc_rel",
        unit="relative error of x(2 s)",
        deck=_slip,
        errors=_acceleration,
        variations=({"vs": 1e-2}, {"vs": 1e-3}, {"vs": 1e-4}, {"vs": 1e-5}, {"stiction": 1.0}),
        tolerances=(1e-3, 1e-4, 1e-5, 1e-6, 1e-8, 1e-10),
    ),
)
