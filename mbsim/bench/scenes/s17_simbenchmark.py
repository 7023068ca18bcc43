"""sb_rolling, sb_bouncing, sb_666, sb_666_elastic: SimBenchmark's scenes, by its own errors."""

from __future__ import annotations

from functools import partial

import numpy as np

from mbsim.bench import deck as text
from mbsim.bench import parameters as p
from mbsim.bench.outcome import Outcome
from mbsim.bench.scene import Scene, Target, Variation
from mbsim.bench.simbenchmark import BOUNCING, ELASTIC, PILE, ROLLING, Balls

#: Fixed steps of MOREAU [s]; without one it finds them by error.
STEPS = (1e-2, 5e-3, 1e-3)
#: Of contacts without compliance; where a method needs some, this is it [N/m].
PENALTY = 1e7


def _law(e: float) -> dict[str, object]:
    return {"cnf_type": "POISSON", "penalty": PENALTY, "restitution_coef": e}


def _balls(balls: Balls, variation: Variation) -> str:
    """Return the deck of balls that fall on the floor and on each other."""
    places = balls.centres().tolist()
    ids = [100 * (2 + k) for k in range(len(places))]
    return text.deck(
        f"{len(places)} balls fall on a floor",
        [
            text.GROUND,
            text.FLOOR,
            *(text.sphere(2 + k, balls.mass, balls.radius, at) for k, at in enumerate(places)),
            text.contact(301, ids, [100], **_law(balls.restitution)),
            text.contact(302, ids, ids, **_law(balls.restitution)),
            text.gravity(),
            *text.fixed_step(variation),
        ],
        balls.end_time,
    )


def _rolling(variation: Variation) -> str:
    """Return the deck of balls on a box that is pushed."""
    r = ROLLING
    places = r.centres().tolist()
    ids = [100 * (3 + k) for k in range(len(places))]
    x, y = (r.force * part for part in r.direction)
    push = text.attributes(
        id=1,
        type="ForceOnly",
        i_marker_id=20,
        ref_marker_id=10,
        fx_expression=repr(x),
        fy_expression=repr(y),
        fz_expression="0",
    )
    return text.deck(
        "Balls roll on a box that is pushed over the floor",
        [
            text.GROUND,
            text.FLOOR,
            text.cuboid(2, r.box_mass, r.box, (0.0, 0.0, r.box[2] / 2.0)),
            *(text.sphere(3 + k, r.mass, r.radius, at) for k, at in enumerate(places)),
            text.contact(301, [200], [100], **_law(0.0), **text.coulomb(r.mu_floor, 1e-3)),
            text.contact(302, ids, [200], **_law(0.0), **text.coulomb(r.mu_balls, 1e-3)),
            f"<Force_Vector_OneBody {push}/>",
            text.gravity(),
            *text.fixed_step(variation),
        ],
        r.end_time,
    )


def _depths(balls: Balls, outcome: Outcome, variant: str) -> dict[str, float]:
    """Return the mean over rows of the sum of squared depths, of pairs and at the floor [m^2]."""
    from scipy.spatial import cKDTree

    sums = []
    for centres in outcome.position:
        if not np.isfinite(centres).all():
            return {"depth_square": float("nan")}
        floor = np.minimum(centres[:, 2] - balls.radius, 0.0)
        pairs = cKDTree(centres).query_pairs(2.0 * balls.radius, output_type="ndarray")
        apart = np.linalg.norm(centres[pairs[:, 0]] - centres[pairs[:, 1]], axis=1)
        sums.append((floor**2).sum() + ((2.0 * balls.radius - apart) ** 2).sum())
    return {"depth_square": float(np.mean(sums))}


def _energies(balls: Balls, outcome: Outcome, variant: str) -> dict[str, float]:
    """Return the mean over rows of (E - E0)^2 [J^2]; what contacts store is not counted."""
    speeds = (outcome.velocity**2).sum(axis=(1, 2))
    spins = 0.4 * balls.radius**2 * (outcome.angular_velocity**2).sum(axis=(1, 2))
    heights = outcome.position[:, :, 2].sum(axis=1)
    energy = balls.mass * (0.5 * (speeds + spins) + p.GRAVITY * heights)
    return {"energy_square": float(np.mean((energy - balls.energy()) ** 2))}


def _speeds(outcome: Outcome, variant: str) -> dict[str, float]:
    """Return the mean over rows of the squared velocity errors of the box and of one ball."""
    box, ball = ROLLING.accelerations()
    along = np.array([*ROLLING.direction, 0.0])
    off = 0.0
    for body, a in ((0, box), (1, ball)):
        exact = np.outer(a * outcome.time, along)
        off += float(((outcome.velocity[:, body] - exact) ** 2).sum(axis=1).mean())
    return {"velocity_square": off}


def _scene(name: str, balls: Balls, title: str, measure: str) -> Scene:
    errors = _depths if measure == "depth_square" else _energies
    return Scene(
        name=name,
        title=f"{title} (published: {balls.published})",
        end_time=balls.end_time,
        measure=measure,
        unit=(
            "mean of the sum of squared depths [m^2]"
            if measure == "depth_square"
            else "mean of (E - E0)^2 [J^2]"
        ),
        deck=partial(_balls, balls),
        errors=partial(errors, balls),
        targets=(Target(1 / 2),),
        compared=(1e-10, 1e2),
        variations=({}, *({"h": h} for h in STEPS)),
        integrators=("MOREAU", "VERLET"),
        tolerances=(1e-3, 1e-4, 1e-5),
        repeats=1,
        patience=30.0,
    )


SCENES = (
    Scene(
        name="sb_rolling",
        title=f"25 balls roll on a box that is pushed, 4 s (published: {ROLLING.published})",
        end_time=ROLLING.end_time,
        measure="velocity_square",
        unit="mean of the squared velocity errors of box and ball [m^2/s^2]",
        deck=_rolling,
        errors=_speeds,
        targets=(Target(1 / 2),),
        compared=(1e-14, 1.0),
        variations=({}, *({"h": h} for h in STEPS)),
        integrators=("MOREAU", "VERLET"),
        tolerances=(1e-4, 1e-5, 1e-6),
        repeats=3,
    ),
    _scene("sb_bouncing", BOUNCING, "49 elastic balls bounce, 20 s", "energy_square"),
    _scene("sb_666", PILE, "216 balls fall in a heap, 10 s", "depth_square"),
    _scene("sb_666_elastic", ELASTIC, "216 elastic balls fall in a heap, 10 s", "energy_square"),
)
