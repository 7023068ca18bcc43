"""S6 and S10b: cubes at rest on each other, equal ones, and a heavy one on a light one."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mbsim.bench import deck as text
from mbsim.bench import parameters as p
from mbsim.bench.outcome import Outcome
from mbsim.bench.overlap import beyond, corners, deepest_pair
from mbsim.bench.scene import Scene, Target, Variation

DMAX = 1e-5  # m, of IMPACT's damper
TRANSITION = 1e-3  # m/s, of smoothed friction
#: Friction that holds, and smoothed friction, which creeps.
FRICTION: tuple[Variation, ...] = ({"stiction": 1.0}, {"stiction": 0.0})
#: Fixed steps of MOREAU [s]; without one it finds them by error.
STEPS = (2e-2, 1e-2, 5e-3, 2e-3)
#: What is varied: friction, and steps of MOREAU, whose friction holds by either law.
VARIATIONS: tuple[Variation, ...] = (*FRICTION, *({"stiction": 0.0, "h": h} for h in STEPS))


def friction(mu: float, variation: Variation) -> dict[str, object]:
    """Return the attributes of STICTION or of COULOMB_ON."""
    if variation["stiction"]:
        return {"cff_type": "STICTION", "mu_static": mu, "mu_dynamic": mu}
    return text.coulomb(mu, TRANSITION)


def _deck(
    comment: str,
    masses: Sequence[float],
    pile: p.Stack | p.HeavyOnLight,
    variation: Variation,
) -> str:
    edge = pile.edge
    cubes = [
        text.cuboid(2 + k, mass, (edge, edge, edge), (0.0, 0.0, (k + 0.5) * edge))
        for k, mass in enumerate(masses)
    ]
    law = text.impact(pile.law.k, 1.0, pile.law.c, DMAX) | friction(pile.mu, variation)
    below = [100, *(100 * (2 + k) for k in range(len(masses) - 1))]
    contacts = [
        text.contact(301 + k, [100 * (2 + k)], [below[k]], **law) for k in range(len(masses))
    ]
    return text.deck(
        comment,
        [text.GROUND, text.FLOOR, *cubes, *contacts, text.gravity(), *text.fixed_step(variation)],
        pile.end_time,
    )


def _stack(variation: Variation) -> str:
    return _deck("Ten cubes on each other", [p.S6.mass] * p.S6.count, p.S6, variation)


def _heavy(variation: Variation) -> str:
    return _deck("A heavy cube on a light one", [p.S10B.mass, p.S10B.above], p.S10B, variation)


def _errors(edge: float, outcome: Outcome) -> dict[str, float]:
    """Return drift and depth at the end [m], and the fastest velocity in the last second [m/s]."""
    end, late = outcome.position[-1], outcome.time >= outcome.time[-1] - 1.0
    drift = np.linalg.norm(end[:, :2] - outcome.position[0][:, :2], axis=1).max()
    depth = max(
        deepest_pair(end, outcome.quaternion[-1], edge),
        beyond(corners(end, outcome.quaternion[-1], edge)),
    )
    return {
        "drift": float(drift),
        "pen_max": depth,
        "v_res": float(np.abs(outcome.velocity[late]).max()),
    }


SCENES = (
    Scene(
        name="S6",
        title="ten touching cubes on each other, 10 s",
        end_time=p.S6.end_time,
        measure="drift",
        unit="largest horizontal way of a cube [m]",
        deck=_stack,
        errors=lambda outcome, variant: _errors(p.S6.edge, outcome),
        targets=(Target(1 / 2),),
        compared=(1e-12, 1e-2),
        variations=VARIATIONS,
        second=("pen_max", "largest depth at the end"),
        integrators=("AUTO", "RADAU5", "MOREAU"),
        tolerances=(1e-2, 1e-3, 1e-5, 1e-7, 1e-9),
        repeats=3,
    ),
    Scene(
        name="S10b",
        title="a cube of 10 t on one of 1 kg, 5 s",
        end_time=p.S10B.end_time,
        measure="pen_max",
        unit="largest depth at the end [m]",
        deck=_heavy,
        errors=lambda outcome, variant: _errors(p.S10B.edge, outcome),
        targets=(Target(1 / 2),),
        compared=(1e-9, 1e-2),
        variations=VARIATIONS,
        second=("drift", "largest horizontal way of a cube"),
        integrators=("AUTO", "RADAU5", "MOREAU"),
        tolerances=(1e-2, 1e-3, 1e-5, 1e-7, 1e-9),
        repeats=3,
    ),
)
