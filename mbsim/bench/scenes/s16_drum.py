"""drum_300 and drum_3000: spheres in a drum that turns; who lets them tunnel does not count."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from mbsim.bench import deck as text
from mbsim.bench import drum as d
from mbsim.bench import parameters as p
from mbsim.bench.outcome import Outcome
from mbsim.bench.scene import Scene, Target, Variation

#: Penetration over radius below which a run counts.
PASS = 0.05
#: dmax of IMPACT's damper [m] and transition velocity of friction [m/s].
DMAX, TRANSITION = 1e-5, 0.02
#: Stiffness of the contacts [N/m]: the softest lets single impacts go deeper than `PASS`.
STIFFNESSES = (1e5, 3e5, 1e6)
#: Fixed steps of MOREAU [s], of which a row every 20 ms is a multiple.
STEPS = (2e-2, 1e-2, 5e-3, 2e-3, 1e-3)
#: What carries the drum: a bushing [N/m], for a method for free bodies knows its stiffness.
CARRIED = 1e9


def _faces(drum: d.Drum) -> tuple[list[str], list[int]]:
    """Return the planes of the drum, body 2, and their graphics; normals look inward."""
    lines, graphics = [], []

    def plane(number: int, place: list[float], axes: list[list[float]]) -> None:
        lines.append(text.marker(number, 2, place, axes))
        lines.append(f'<Post_Graphic id="{number}" type="Plane" rm_id="{number}"/>')
        graphics.append(number)

    for k, normal in enumerate(d.outward()):
        z = -normal
        y = np.array([0.0, 1.0, 0.0])
        axes = np.column_stack([np.cross(y, z), y, z])
        plane(50001 + k, (drum.apothem * normal).tolist(), (axes + 0.0).tolist())
    for k, side in enumerate((-1.0, 1.0)):
        axes = np.column_stack([[1.0, 0.0, 0.0], [0.0, 0.0, side], [0.0, -side, 0.0]])
        plane(50101 + k, [0.0, side * drum.half_length, 0.0], (axes + 0.0).tolist())
    return lines, graphics


def _deck(drum: d.Drum, variation: Variation) -> str:
    """Return the deck: the drum is body 2, spheres follow."""
    spheres = [
        text.sphere(3 + k, drum.mass, drum.radius, x) for k, x in enumerate(d.places(drum).tolist())
    ]
    faces, inner = _faces(drum)
    ids = [100 * (3 + k) for k in range(drum.count)]
    law = text.impact(variation["k"], 1.0, drum.damping, DMAX) | text.coulomb(drum.mu, TRANSITION)
    bushing = text.attributes(
        id=1,
        i_marker_id=20,
        j_marker_id=10,
        kx=CARRIED,
        ky=CARRIED,
        kz=CARRIED,
        preload_z=d.HEAVY * p.GRAVITY,
    )
    return text.deck(
        f"{drum.count} spheres in a drum that turns",
        [
            text.GROUND,
            text.marker(10, 1, (0.0, 0.0, 0.0)),
            text.body(2, d.HEAVY, [d.HEAVY] * 3, spin=(0.0, drum.spin, 0.0)),
            *faces,
            f"<Force_Bushing {bushing}/>",
            *spheres,
            text.contact(900001, ids, ids, **law),
            text.contact(900002, ids, inner, **law),
            text.gravity(),
            *text.fixed_step(variation),
        ],
        drum.end_time,
        drum.sample,
    )


def _errors(drum: d.Drum, outcome: Outcome, variant: str) -> dict[str, float]:
    """Return penetration over radius: over the rows, over all steps, and at the end.

    `pen_max_over_r`, which ours is held to, is over all steps where the engine counts it. `lift` is
    how far the spheres' common centre has moved along x [m]: up with the drum's wall.
    """
    rows = zip(outcome.position, outcome.quaternion, strict=True)
    depths = [d.deepest(drum, x[0], q[0], x[1:]) for x, q in rows]
    counted = outcome.extra.get("peak_penetration", 0.0) / drum.radius
    lift = outcome.position[-1, 1:, 0].mean() - outcome.position[0, 1:, 0].mean()
    return {
        "pen_rows_over_r": max(depths),
        "pen_max_over_r": max(*depths, counted),
        "pen_end_over_r": depths[-1],
        "lift": float(lift),
    }


def _scene(drum: d.Drum, **changes: Any) -> Scene:
    scene = Scene(
        name=f"drum_{drum.count}",
        title=f"{drum.count} spheres in a drum that turns, 1 s",
        end_time=drum.end_time,
        measure="pen_rows_over_r",
        unit="largest penetration over radius, over the rows",
        deck=partial(_deck, drum),
        errors=partial(_errors, drum),
        own_measure="pen_max_over_r",
        targets=(Target(1 / 2),),
        variations=(
            *({"k": k} for k in STIFFNESSES),
            *({"k": STIFFNESSES[0], "h": h} for h in STEPS),
        ),
        second=("pen_max_over_r", "over all steps, which is what counts"),
        pass_below=PASS,
        integrators=("VERLET", "MOREAU"),
        tolerances=(1e-1, 1e-2),
        sample=drum.sample,
        repeats=1,
        limit=60.0,
        patience=math.inf,
    )
    return replace(scene, **changes)


SCENES = (
    _scene(d.DRUMS[300]),
    _scene(
        d.DRUMS[3000],
        # a step of MOREAU goes through all spheres for each wrench on the drum's bushing
        integrators=("VERLET",),
        variations=tuple({"k": k} for k in STIFFNESSES[:2]),
        limit=200.0,
    ),
)
