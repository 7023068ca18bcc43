"""bin_50 and bin_200: cubes fall into an open box and come to rest in a pile."""

from __future__ import annotations

from functools import partial

from mbsim.bench import deck as text
from mbsim.bench import parameters as p
from mbsim.bench.outcome import Outcome
from mbsim.bench.overlap import beyond, corners, deepest_pair
from mbsim.bench.scene import Scene, Target, Variation
from mbsim.bench.scenes.s07_grains import walls

#: dmax of IMPACT's damper [m] and transition velocity of friction [m/s].
DMAX, TRANSITION = 1e-5, 0.02
#: Depth of the pile [m] below which a run counts.
PASS = 1e-4
#: Fixed steps of MOREAU [s]; without one it finds them by error.
STEPS = (5e-3, 2e-3)


def _deck(count: int, variation: Variation) -> str:
    places, turns = p.bin_start(count)
    edges = (p.BIN.edge,) * 3
    cubes = [
        text.cuboid(2 + k, p.BIN.mass, edges, place, axes=axes)
        for k, (place, axes) in enumerate(zip(places, p.axes_of(turns).tolist(), strict=True))
    ]
    ids = [100 * (2 + k) for k in range(count)]
    law = text.impact(p.BIN.law.k, 1.0, p.BIN.law.c, DMAX) | text.coulomb(p.BIN.mu, TRANSITION)
    return text.deck(
        f"{count} cubes fall into an open box",
        [
            text.GROUND,
            *walls(p.BIN.half_width),
            *cubes,
            text.contact(301, ids, ids, **law),
            text.contact(302, ids, list(range(100, 105)), **law),
            text.gravity(),
            *text.fixed_step(variation),
        ],
        p.BIN.end_time,
        p.BIN.sample,
    )


def _errors(outcome: Outcome, variant: str) -> dict[str, float]:
    """Return depths [m]: of the pile at rest, over its late rows; and over all, or all steps.

    `pen_max` is over all steps where the engine counts it; an engine may count its own measure.
    """
    edge, half = p.BIN.edge, p.BIN.half_width
    depths = [
        max(deepest_pair(x, q, edge), beyond(corners(x, q, edge), half))
        for x, q in zip(outcome.position, outcome.quaternion, strict=True)
    ]
    late = [depth for t, depth in zip(outcome.time, depths, strict=True) if t >= p.BIN.late]
    return {
        "pen_late": max(late),
        "pen_max": max(*depths, outcome.extra.get("peak_penetration", 0.0)),
    }


def _scene(count: int) -> Scene:
    return Scene(
        name=f"bin_{count}",
        title=f"{count} cubes fall into an open box, 2 s",
        end_time=p.BIN.end_time,
        measure="pen_late",
        unit=f"largest depth from {p.BIN.late:g} s on, over the rows [m]",
        deck=partial(_deck, count),
        errors=_errors,
        targets=(Target(1 / 2),),
        second=("pen_max", "over all steps"),
        pass_below=PASS,
        variations=({}, *({"h": h} for h in STEPS)),
        integrators=("MOREAU", "VERLET"),
        tolerances=(2e-2, 1e-2, 2.5e-3, 1e-3),
        sample=p.BIN.sample,
        repeats=1,
        limit=60.0,
    )


SCENES = (_scene(50), _scene(200))
