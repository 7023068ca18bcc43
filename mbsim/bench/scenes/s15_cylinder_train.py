"""cylinder_train: ten cylinders roll down a slope, one behind the other, and pile up at a wall."""

from __future__ import annotations

import numpy as np

from mbsim.bench import converged
from mbsim.bench import deck as text
from mbsim.bench.daily import TRAIN
from mbsim.bench.outcome import Outcome
from mbsim.bench.scene import Scene, Target, Variation

#: dmax of IMPACT's damper [m] and transition velocity of friction [m/s].
DMAX, TRANSITION = 1e-5, 1e-3
#: Our reference.
EXACT = ("RADAU5", 1e-7)
#: Axes of markers: z along -x, as a wall looks, and along y, as a cylinder lies.
BACK = ((0.0, 0.0, -1.0), (0.0, 1.0, 0.0), (1.0, 0.0, 0.0))
ALONG_Y = ((1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.0, -1.0, 0.0))
#: Fixed steps of MOREAU [s]; without one it finds them by error.
STEPS = (5e-2, 2e-2, 1e-2, 5e-3, 2e-3, 1e-3)


def _cylinder(number: int, x: float) -> list[str]:
    """Return a cylinder as body `number` with graphic `100 number`."""
    along, across = TRAIN.inertia
    shape = text.attributes(
        id=100 * number,
        type="Cylinder",
        center_marker_id=10 * number + 1,
        radius=TRAIN.radius,
        length=TRAIN.length,
    )
    end = (x, -TRAIN.length / 2.0, TRAIN.radius)
    return [
        text.body(number, TRAIN.mass, (across, along, across), (x, 0.0, TRAIN.radius)),
        text.marker(10 * number + 1, number, end, ALONG_Y),
        f"<Post_Graphic {shape}/>",
    ]


def _deck(variation: Variation) -> str:
    law = text.impact(TRAIN.law.k, 1.0, TRAIN.law.c, DMAX) | text.coulomb(TRAIN.mu, TRANSITION)
    cylinders = [100 * (2 + k) for k in range(TRAIN.count)]
    x, _, z = TRAIN.pull()
    return text.deck(
        "A train of cylinders rolls down a slope",
        [
            text.GROUND,
            text.FLOOR,
            text.marker(13, 1, (TRAIN.wall, 0.0, 0.0), BACK),
            '<Post_Graphic id="101" type="Plane" rm_id="13"/>',
            *(
                line
                for k, at in enumerate(TRAIN.centres().tolist())
                for line in _cylinder(2 + k, at)
            ),
            text.contact(301, cylinders, [100, 101], **law),
            text.contact(302, cylinders, cylinders, **law),
            text.gravity(x, z),
            *text.fixed_step(variation),
        ],
        TRAIN.end_time,
    )


def _errors(outcome: Outcome, variant: str) -> dict[str, float]:
    """Return distances of the centres from our converged run [m], rms and largest.

    `pen_end` is how deep a cylinder is in the next one, the wall or the slope at the end, as if
    their axes were still along y.
    """
    exact = np.stack(converged.paths(_deck({}), *EXACT), axis=1)
    rows = np.rint(outcome.time / (TRAIN.end_time / (len(exact) - 1))).astype(int)
    away = np.linalg.norm(outcome.position - exact[rows], axis=2)
    end = outcome.position[-1]
    gaps = np.linalg.norm(np.diff(end[:, ::2], axis=0), axis=1) - 2.0 * TRAIN.radius
    deepest = min(gaps.min(), end[:, 2].min() - TRAIN.radius, TRAIN.wall - TRAIN.radius - end[0, 0])
    return {
        "path_rms": float(np.sqrt(np.mean(away**2))),
        "path_max": float(away.max()),
        "pen_end": max(float(-deepest), 0.0),
    }


SCENES = (
    Scene(
        name="cylinder_train",
        title="ten cylinders roll down a slope and pile up at a wall, 3 s",
        end_time=TRAIN.end_time,
        measure="path_rms",
        unit="distance of the cylinders from their converged paths, rms [m]",
        deck=_deck,
        errors=_errors,
        targets=(Target(1 / 2),),
        compared=(1e-7, 1e-1),
        variations=({}, *({"h": h} for h in STEPS)),
        integrators=("AUTO", "GALPHA", "MOREAU"),
        tolerances=(1e-2, 1e-3, 1e-4, 1e-5),
        repeats=3,
    ),
)
