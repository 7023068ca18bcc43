"""S3: a sliding sphere begins to roll; held to rigid Coulomb friction and to its own law."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from mbsim.bench import deck as text
from mbsim.bench import parameters as p
from mbsim.bench.outcome import Outcome
from mbsim.bench.scene import Scene, Target, Variation

LAW = p.ImpactLaw(k=1e8, e=1.5, c=200.0, dmax=1e-4)
TRANSITION = 0.02  # m/s, of the smoothed friction
#: Static equilibrium: k d^e = m g.
DEPTH = (p.S3.mass * p.GRAVITY / LAW.k) ** (1.0 / LAW.e)
#: Fixed steps of MOREAU [s]; without one it finds them by error.
STEPS = (1e-1, 4e-2, 2e-2, 1e-2, 5e-3)
#: The variant whose contacts are rigid, and whose friction is Coulomb's.
RIGID = "rigid"


def _deck(variation: Variation) -> str:
    """Return the deck: the sphere starts at its static depth with no spin."""
    place, speed = (0.0, 0.0, p.S3.radius - DEPTH), (p.S3.speed, 0.0, 0.0)
    law = text.impact(*LAW) | text.coulomb(p.S3.mu, TRANSITION)
    return text.deck(
        "A sliding sphere begins to roll",
        [
            text.GROUND,
            text.FLOOR,
            text.sphere(2, p.S3.mass, p.S3.radius, place, speed),
            text.contact(301, [200], [100], **law),
            text.gravity(),
            *text.fixed_step(variation),
        ],
        p.S3.end_time,
    )


@lru_cache
def law_solution(lever: float) -> float:
    """Return x at the end for the smoothed law at constant normal force m g.

    Parameters
    ----------
    lever : float
        Distance from the centre to the contact point [m]. With slip u = v - w `lever`
        and I = 2/5 m r^2: v' = -mu(u) g, u' = -mu(u) g (1 + 5/2 (lever/r)^2).
    """
    from scipy.integrate import solve_ivp

    gain = 1.0 + 2.5 * (lever / p.S3.radius) ** 2

    def rate(t: float, y: np.ndarray) -> list[float]:
        s = y[2] / TRANSITION
        mu = p.S3.mu * (0.5 * s * (3.0 - s * s) if s < 1.0 else 1.0)
        return [y[1], -mu * p.GRAVITY, -mu * p.GRAVITY * gain]

    start = [0.0, p.S3.speed, p.S3.speed]
    # the law has a kink in its second derivative at u = TRANSITION: the step ends there
    transition = (p.S3.speed - TRANSITION) / (p.S3.mu * p.GRAVITY * gain)
    for t0, t1 in ((0.0, transition), (transition, p.S3.end_time)):
        done = solve_ivp(rate, (t0, t1), start, method="DOP853", rtol=1e-13, atol=1e-15)
        start = list(done.y[:, -1])
    return float(start[0])


def _errors(outcome: Outcome, variant: str) -> dict[str, float]:
    """Return errors of place, speed and onset of rolling, all against rigid Coulomb friction.

    `x_law` is the place against the solution of the law that a method solves: the rigid one,
    or our smoothed one at the contact point that it uses, half of the depth above the deepest.
    """
    x = outcome.position[:, 0, 0] - outcome.position[0, 0, 0]
    v = outcome.velocity[:, 0, 0]
    slip = np.abs(v - outcome.angular_velocity[:, 0, 1] * p.S3.radius)
    rolls = np.flatnonzero(slip < 1e-3 * p.S3.speed)
    onset = float(outcome.time[rolls[0]]) if len(rolls) else math.nan
    rigid = variant == RIGID
    own = p.S3.end_x if rigid else law_solution(p.S3.radius - 0.5 * DEPTH)
    return {
        "x_abs": abs(float(x[-1]) - p.S3.end_x),
        "x_law": abs(float(x[-1]) - own),
        "v_rel": abs(float(v[-1]) - p.S3.roll_speed) / p.S3.speed,
        "t_roll_abs": abs(onset - p.S3.roll_time),
    }


SCENES = (
    Scene(
        name="S3",
        title="sliding sphere begins to roll, 2 s",
        end_time=p.S3.end_time,
        measure="x_abs",
        unit="error of x(2 s) against rigid Coulomb friction [m]",
        deck=_deck,
        errors=_errors,
        own_measure="x_law",
        targets=(Target(1 / 20, up_to=2e-4), Target(1 / 2)),
        second=("x_law", "against its own law, which is what counts"),
        variants=("smoothed", RIGID),
        variations=({}, *({"h": h} for h in STEPS)),
    ),
)
