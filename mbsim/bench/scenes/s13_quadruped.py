"""quadruped: a trunk on four driven legs lands, stands and bobs on its feet."""

from __future__ import annotations

import numpy as np

from mbsim.bench import converged
from mbsim.bench import deck as text
from mbsim.bench.outcome import Outcome
from mbsim.bench.quadruped import WALKER, Link, foot_of, legs
from mbsim.bench.scene import Scene, Target, Variation

#: Axes of markers: z along global x for a shoulder, along y for hip and knee.
ABOUT_X = ((0.0, 0.0, 1.0), (0.0, 1.0, 0.0), (-1.0, 0.0, 0.0))
ABOUT_Y = ((1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.0, -1.0, 0.0))
DMAX = 1e-5  # m, of IMPACT's damper
#: Our reference: STICTION's law and this method and tolerance.
EXACT = ("RADAU5", 1e-8)
#: Fixed steps of MOREAU [s]; without one it finds them by error.
STEPS = (2e-2, 1e-2, 5e-3, 2e-3, 1e-3)


def _driven(k: int, link: Link) -> list[str]:
    """Return a link as body `3 + k`, its hinge and its drive."""
    number, parent = 3 + k, 2 if link.parent < 0 else 3 + link.parent
    mine, other = 10 * number + 1, 1000 + 10 * number + 2
    axes = ABOUT_X if link.axis[0] else ABOUT_Y
    target = f"{link.swing!r}*SIN({WALKER.rate!r}*TIME)" if link.swing else "0"
    torque = (
        f"{WALKER.stiffness!r}*({target}-AZ({mine},{other}))"
        f"-{WALKER.damping!r}*WZ({mine},{other},{other})"
    )
    drive = text.attributes(
        id=1 + k, type="Torque", i_marker_id=mine, j_marker_id=other, expr=torque
    )
    return [
        text.body(number, link.mass, [link.inertia] * 3, link.centre),
        text.marker(mine, number, link.hinge, axes),
        text.marker(other, parent, link.hinge, axes),
        text.joint(500 + number, "REVOLUTE", mine, other),
        f"<Force_Scalar_TwoBody {drive}/>",
    ]


def _foot(k: int, link: Link) -> str:
    """Return the foot of a shank, graphic `100 number`."""
    number = 3 + k
    ball = text.attributes(
        id=100 * number,
        type="Sphere",
        center_marker_id=10 * number + 3,
        radius=WALKER.foot,
    )
    return f"{text.marker(10 * number + 3, number, foot_of(link))}\n<Post_Graphic {ball}/>"


def _deck(variation: Variation) -> str:
    links, w = legs(), WALKER
    trunk = text.body(2, w.trunk_mass, w.trunk_inertia, (0.0, 0.0, w.height))
    shanks = [(k, link) for k, link in enumerate(links) if k % 3 == 2]
    law = text.impact(w.law.k, 1.0, w.law.c, DMAX)
    law |= {"cff_type": "STICTION", "mu_static": w.mu, "mu_dynamic": w.mu}
    return text.deck(
        "A trunk on four driven legs",
        [
            text.GROUND,
            text.FLOOR,
            trunk,
            *(line for k, link in enumerate(links) for line in _driven(k, link)),
            *(_foot(k, link) for k, link in shanks),
            text.contact(301, [100 * (3 + k) for k, _ in shanks], [100], **law),
            text.gravity(),
            *text.fixed_step(variation),
        ],
        w.end_time,
    )


def _errors(outcome: Outcome, variant: str) -> dict[str, float]:
    """Return how far the trunk's centre is from our converged run, largest and at the end [m].

    Raises
    ------
    ValueError
        If the rows are not those of the scene.
    """
    exact = converged.paths(_deck({}), *EXACT)[0]
    rows = np.rint(outcome.time / (WALKER.end_time / (len(exact) - 1))).astype(int)
    away = np.linalg.norm(outcome.position[:, 0] - exact[rows], axis=1)
    return {"path_max": float(away.max()), "path_end": float(away[-1])}


SCENES = (
    Scene(
        name="quadruped",
        title="a trunk on four driven legs lands and bobs, 2 s",
        end_time=WALKER.end_time,
        measure="path_max",
        unit="largest distance of the trunk from its converged path [m]",
        deck=_deck,
        errors=_errors,
        targets=(Target(1 / 3),),
        compared=(1e-6, 1e-1),
        variations=({}, *({"h": h} for h in STEPS)),
        integrators=("AUTO", "RADAU5", "MOREAU"),
        tolerances=(1e-2, 1e-3, 1e-4, 1e-5, 1e-6),
        repeats=3,
    ),
)
