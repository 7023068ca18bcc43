"""S7: many spheres fall into an open box; a fast run that lets them tunnel does not count."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from mbsim.bench import deck as text
from mbsim.bench import parameters as p
from mbsim.bench.outcome import Outcome
from mbsim.bench.scene import Scene, Target, Variation

#: Penetration over radius below which a run counts.
PASS = 0.05
#: dmax of IMPACT's damper [m] and transition velocity of friction [m/s], left open by the scene.
DMAX, TRANSITION = 1e-5, 0.02

#: Walls by name: Euler angles psi, theta that turn z into the inward normal, and its direction.
_WALLS = (
    (-0.5 * math.pi, (-1.0, 0.0)),
    (0.5 * math.pi, (1.0, 0.0)),
    (0.0, (0.0, -1.0)),
    (math.pi, (0.0, 1.0)),
)


def walls(half: float) -> list[str]:
    """Return floor and four walls as planes whose normal, the marker's z, points inward.

    R = Rz(psi) Rx(theta) with theta = -90 degrees takes z to (-sin psi, cos psi, 0).
    """
    out = [text.FLOOR]
    for k, (psi, side) in enumerate(_WALLS):
        marker = text.attributes(
            id=11 + k,
            body_id=1,
            pos_x=half * side[0],
            pos_y=half * side[1],
            psi=psi,
            theta=-0.5 * math.pi,
        )
        out.append(f'<Reference_Marker {marker}/>\n<Post_Graphic id="{101 + k}" ')
        out[-1] += f'type="Plane" rm_id="{11 + k}"/>'
    return out


def _deck(count: int, variation: Variation) -> str:
    """Return the deck: one contact of all spheres with each other, one with the box."""
    places = p.s7_positions(count)
    spheres = [text.sphere(2 + k, p.S7.mass, p.S7.radius, x) for k, x in enumerate(places)]
    ids = [100 * (2 + k) for k in range(count)]
    law = text.impact(variation["k"], 1.0, p.S7.law.c, DMAX) | text.coulomb(p.S7.mu, TRANSITION)
    box = list(range(100, 105))
    return text.deck(
        f"{count} spheres fall into an open box",
        [
            text.GROUND,
            *walls(p.s7_half_width(count)),
            *spheres,
            text.contact(301, ids, ids, **law),
            text.contact(302, ids, box, **law),
            text.gravity(),
            *text.fixed_step(variation),
        ],
        p.S7.end_time,
        p.s7_sample(count),
    )


def deepest(centres: np.ndarray, half: float) -> float:
    """Return the largest penetration over radius among spheres, floor and walls, one row (n, 3)."""
    from scipy.spatial import cKDTree

    r = p.S7.radius
    depth = float(max(r - centres[:, 2].min(), r + np.abs(centres[:, :2]).max() - half, 0.0))
    pairs = cKDTree(centres).query_pairs(2.0 * r, output_type="ndarray")
    if len(pairs):
        gaps = np.linalg.norm(centres[pairs[:, 0]] - centres[pairs[:, 1]], axis=1)
        depth = max(depth, float(2.0 * r - gaps.min()))
    return depth / r


def _errors(count: int, outcome: Outcome, variant: str) -> dict[str, float]:
    """Return penetration over radius, largest and at the end, and how many spheres escaped.

    `pen_rows_over_r` is the largest over the rows; `pen_max_over_r`, which ours is held to, over
    all steps where the engine counts it, else over the rows too.
    """
    half, r = p.s7_half_width(count), p.S7.radius
    rows = outcome.position
    whole = np.isfinite(rows).all()
    sampled = max(deepest(row, half) for row in rows) if whole else math.nan
    counted = outcome.extra.get("peak_penetration", 0.0) / r
    end = rows[-1]
    outside = (np.abs(end[:, :2]).max(axis=1) > half) | (end[:, 2] < 0.0)
    return {
        "pen_rows_over_r": sampled,
        "pen_max_over_r": max(sampled, counted) if whole else math.nan,
        "pen_end_over_r": deepest(end, half) if whole else math.nan,
        "escaped": float(np.count_nonzero(outside)),
    }


#: Stiffness of the contacts [N/m]: the scene's own, and two that keep more spheres below `PASS`:
#: at 1e5 a single impact at 1.5 m/s goes deeper.
STIFFNESSES = (p.S7.law.k, 1.3 * p.S7.law.k, 2.0 * p.S7.law.k)

#: Fixed steps of MOREAU [s], of which a row every 10 ms is a multiple.
STEPS = (5e-3, 1e-2 / 3.0, 2e-3)


def _scene(count: int, **changes: Any) -> Scene:
    """Return the scene with `count` spheres.

    Steps of methods that estimate their error are too many for many spheres: VERLET's are as
    long as its stability allows. The others show so with 125 and 1000, up to a limit.
    """
    scene = Scene(
        name=f"S7_{count}",
        title=f"{count} spheres fall into an open box, 2 s",
        end_time=p.S7.end_time,
        measure="pen_rows_over_r",
        unit="largest penetration over radius, over the rows",
        deck=partial(_deck, count),
        errors=partial(_errors, count),
        own_measure="pen_max_over_r",
        variations=(*({"k": k} for k in STIFFNESSES), *({"k": p.S7.law.k, "h": h} for h in STEPS)),
        second=("pen_max_over_r", "over all steps, which is what counts"),
        pass_below=PASS,
        tolerances=(1e-1, 2e-2, 1e-2, 1e-3),
        sample=p.s7_sample(count),
        repeats=1,
        limit=40.0,
        patience=math.inf,
    )
    return replace(scene, **changes)


SCENES = (
    _scene(125),
    _scene(1000, targets=(Target(1 / 2),)),
    _scene(
        8000,
        integrators=("VERLET",),
        tolerances=(1e-2,),
        variations=({"k": STIFFNESSES[-1]},),
        limit=200.0,
    ),
)
