"""chain_box: a chain of 50 links falls onto a box and hangs over both its edges."""

from __future__ import annotations

import numpy as np

from mbsim.bench import converged
from mbsim.bench import deck as text
from mbsim.bench.daily import CHAIN
from mbsim.bench.outcome import Outcome
from mbsim.bench.scene import Scene, Target, Variation
from mbsim.bench.scenes.s01_top import rotations
from mbsim.bench.scenes.s08_linkages import HINGE

#: dmax of IMPACT's damper [m] and transition velocity of friction [m/s].
DMAX, TRANSITION = 1e-5, 0.01
#: Our reference.
EXACT = ("AUTO", 1e-7)
#: Fixed steps of MOREAU [s].
STEPS = (1e-2, 5e-3, 2e-3, 1e-3, 5e-4)


def _link(k: int, x: float) -> list[str]:
    """Return a link as body `2 + k` with its ball, and the hinge on the link before."""
    number, end, z = 2 + k, x + CHAIN.length / 2.0, CHAIN.height
    ball = text.attributes(
        id=100 * number, type="Sphere", center_marker_id=10 * number + 1, radius=CHAIN.ball
    )
    lines = [
        text.body(number, CHAIN.mass, CHAIN.inertia, (x, 0.0, z)),
        text.marker(10 * number + 1, number, (end, 0.0, z), HINGE),
        f"<Post_Graphic {ball}/>",
    ]
    if k:
        begin = (x - CHAIN.length / 2.0, 0.0, z)
        lines += [
            text.marker(10 * number + 2, number, begin, HINGE),
            text.joint(500 + k, "REVOLUTE", 10 * number + 2, 10 * number - 9),
        ]
    return lines


def _deck(variation: Variation) -> str:
    a, b, c = CHAIN.box
    box = text.attributes(
        id=100,
        type="BoxDefinedFromCenter",
        center_marker_id=10,
        length_x=a,
        length_y=b,
        length_z=c,
    )
    law = text.impact(CHAIN.law.k, 1.0, CHAIN.law.c, DMAX) | text.coulomb(CHAIN.mu, TRANSITION)
    balls = [100 * (2 + k) for k in range(CHAIN.count)]
    return text.deck(
        "A chain falls onto a box",
        [
            text.GROUND,
            text.marker(10, 1, (0.0, 0.0, -c / 2.0)),
            f"<Post_Graphic {box}/>",
            text.marker(15, 1, (0.0, 0.0, CHAIN.floor)),
            '<Post_Graphic id="101" type="Plane" rm_id="15"/>',
            *(line for k, x in enumerate(CHAIN.centres().tolist()) for line in _link(k, x)),
            text.contact(301, balls, [100, 101], **law),
            text.gravity(),
            *text.fixed_step(variation),
        ],
        CHAIN.end_time,
    )


def _errors(outcome: Outcome, variant: str) -> dict[str, float]:
    """Return distances of links from our converged run, and the largest gap of a hinge [m].

    `path_rms` is over all links and rows, `path_max` the largest.
    """
    exact = np.stack(converged.paths(_deck({}), *EXACT), axis=1)
    rows = np.rint(outcome.time / (CHAIN.end_time / (len(exact) - 1))).astype(int)
    away = np.linalg.norm(outcome.position - exact[rows], axis=2)
    q = outcome.quaternion
    x = rotations(q.reshape(-1, 4))[:, :, 0].reshape(outcome.position.shape)
    half = CHAIN.length / 2.0 * x
    gaps = (outcome.position + half)[:, :-1] - (outcome.position - half)[:, 1:]
    return {
        "path_rms": float(np.sqrt(np.mean(away**2))),
        "path_max": float(away.max()),
        "joint_gap": float(np.linalg.norm(gaps, axis=2).max()),
    }


SCENES = (
    Scene(
        name="chain_box",
        title="a chain of 50 links falls onto a box and hangs over it, 1 s",
        end_time=CHAIN.end_time,
        measure="path_rms",
        unit="distance of the links from their converged paths, rms [m]",
        deck=_deck,
        errors=_errors,
        targets=(Target(1 / 2),),
        compared=(1e-7, 1e-1),
        variations=({}, *({"h": h} for h in STEPS)),
        integrators=("AUTO", "RADAU5", "DOPRI5", "MOREAU"),
        tolerances=(1e-2, 1e-3, 1e-4, 1e-5, 1e-6),
        repeats=3,
    ),
)
