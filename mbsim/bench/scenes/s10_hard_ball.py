"""S10a: a hard light ball rebounds; a rebound above 1 is energy created."""

from __future__ import annotations

import numpy as np

from mbsim.bench import deck as text
from mbsim.bench import oracle
from mbsim.bench import parameters as p
from mbsim.bench.outcome import Outcome
from mbsim.bench.scene import Scene, Target, Variation
from mbsim.bench.scenes.s02_drop import dropped

#: dmax [m] so short that the damper acts from the first touch: it costs 3e-11 of the rebound.
SHORT_RAMP = 1e-12


def _deck(variation: Variation) -> str:
    law = text.impact(p.S10A_LAW.k, 1.0, p.S10A_LAW.c, SHORT_RAMP)
    return dropped(p.S10A, "A hard light ball rebounds", law)


def rebound(outcome: Outcome) -> float:
    """Return rebound height over drop height, from a parabola through the three highest rows.

    Flight is a parabola in time, also with a fixed step, so that the apex between rows is met.
    """
    height = outcome.position[:, 0, 2] - p.S10A.radius
    # the highest row after the first contact, which comes at 0.32 s; flight ends at 0.96 s
    late = (outcome.time > 0.4) & (outcome.time < 0.9)
    top = int(np.flatnonzero(late)[np.argmax(height[late])])
    rows = slice(top - 1, top + 2)
    a, b, c = np.polyfit(outcome.time[rows] - outcome.time[top], height[rows], 2)
    apex = c - b * b / (4.0 * a) if a < 0.0 else c
    return float(apex / p.S10A.gap)


def _errors(outcome: Outcome, variant: str) -> dict[str, float]:
    """Return the rebound ratio and its distance from the reference of the law."""
    ratio = rebound(outcome)
    return {
        "rebound_error": abs(ratio - oracle.s10a_rebound(variant)),
        "rebound_over_drop": ratio,
    }


SCENES = (
    Scene(
        name="S10a",
        title="ball of 0.1 kg, k = 1e9, c = 10, one rebound, 1 s",
        end_time=p.S10A.end_time,
        measure="rebound_error",
        unit="error of rebound height over drop height",
        deck=_deck,
        errors=_errors,
        targets=(Target(1 / 3),),
        variants=("linear", "linear_noclip", "mujoco"),
    ),
)
