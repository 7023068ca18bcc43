"""MOREAU: many impacts at once give back no more than bodies have the energy for."""

from __future__ import annotations

import numpy as np
import pytest

import mbsim
from helpers import rigid_decks as decks
from mbsim.bench import deck as text


def test_an_impact_on_what_is_about_to_open_makes_no_energy() -> None:
    """Balls A, B, C of one mass in a line, e = 1: A hits B at 1, from which C goes at 0.1.

    Newton's law alone gives A -0.3, B and C 0.7: 0.535 J of 0.505. At the end of compression all
    go at 1.1/3; with a part s of what follows kinetic energy is (0.40333 + 0.66667 s^2)/2 J.
    """
    places, speeds = (-0.2, 0.0, 0.2), (1.0, 0.0, 0.1)
    balls = [
        text.sphere(2 + k, 1.0, 0.1, (places[k], 0.0, 0.0), (speeds[k], 0.0, 0.0)) for k in range(3)
    ]
    ids = [200, 300, 400]
    parts = [*balls, text.contact(301, ids, ids, **decks.rubbed(0.0, 1.0))]
    whole = [text.GROUND, *parts, decks.FIXED.format(h=0.01)]
    results = mbsim.simulate(text.deck("line", whole, 0.01, 0.01), integrator="MOREAU")
    v = np.array([results[f"bodies/{2 + k}/velocity"][-1, 0] for k in range(3)])
    s = np.sqrt((1.01 - 1.21 / 3.0) / (2.0 / 3.0))
    exact = np.array([1.1 - 2.0 * s, 1.1 + s, 1.1 + s]) / 3.0
    assert v == pytest.approx(exact, abs=1e-6)
