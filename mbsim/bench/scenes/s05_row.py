"""S5: a ball flies at four that touch: Hertz contact without loss passes a wave along."""

from __future__ import annotations

import numpy as np

from mbsim.bench import deck as text
from mbsim.bench import parameters as p
from mbsim.bench.outcome import Outcome
from mbsim.bench.scene import Scene, Target, Variation


def _deck(variation: Variation) -> str:
    """Return the deck: five balls on the x-axis, neighbours in contact, no gravity."""
    places = p.s5_positions()
    balls = [
        text.sphere(
            2 + k,
            p.S5.mass,
            p.S5.radius,
            (float(x), 0.0, 0.0),
            (p.S5.speed if k == 0 else 0.0, 0.0, 0.0),
        )
        for k, x in enumerate(places)
    ]
    law = text.impact(p.S5.k, p.S5.e, 0.0, 0.0)
    contacts = [
        text.contact(301 + k, [200 + 100 * k], [300 + 100 * k], **law)
        for k in range(len(places) - 1)
    ]
    return text.deck(
        "A ball flies at a row of balls that touch",
        [text.GROUND, *balls, *contacts],
        p.S5.end_time,
    )


def _errors(outcome: Outcome, variant: str) -> dict[str, float]:
    """Return errors of the end velocities [m/s] and of energy and momentum, relative."""
    v = outcome.velocity[-1, :, 0]
    ideal = np.array([0.0, 0.0, 0.0, 0.0, p.S5.speed])
    return {
        "v_vs_hertz": float(np.abs(v - np.array(p.S5.end_v)).max()),
        "v_vs_ideal": float(np.abs(v - ideal).max()),
        "E_rel": abs(float((outcome.velocity[-1] ** 2).sum()) / p.S5.speed**2 - 1.0),
        "P_rel": abs(float(v.sum()) / p.S5.speed - 1.0),
    }


SCENES = (
    Scene(
        name="S5",
        title="five balls in a row, Hertz k = 1e8, no damping, 0.3 s",
        end_time=p.S5.end_time,
        measure="v_vs_hertz",
        unit="largest error of the end velocities [m/s]",
        deck=_deck,
        errors=_errors,
        targets=(Target(1 / 3),),
    ),
)
