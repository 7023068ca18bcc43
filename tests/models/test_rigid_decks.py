"""The decks of `models/rigid/`, run as they are, against their references."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import mbsim
import rigid_references as references
from helpers import woodpecker
from mbsim.bench import ours
from mbsim.bench import parameters as p
from mbsim.bench.scenes import all_scenes
from mbsim.bench.simbenchmark import BOUNCING
from mbsim.results.reading import Results

G = 9.81
DECKS = sorted(path.stem for path in references.FOLDER.glob("*.xml"))
#: These take some seconds.
LONG = {"balls_666_elastic"}


def off(name: str, results: Results) -> np.ndarray:
    """Return how far each column is from the deck's table, at most [m]."""
    times, columns, exact = references.table(name)
    np.testing.assert_allclose(results["time"], times, rtol=0.0, atol=1e-9)
    found = []
    for column in columns:
        body, axis = column.split("/")
        found.append(results[f"bodies/{body}/position"][:, "xyz".index(axis)])
    return np.abs(np.stack(found, axis=1) - exact).max(axis=0)


def every(results: Results, bodies: int, signal: str) -> np.ndarray:
    """Return a signal of bodies 2 and on: (rows, bodies, 3)."""
    return np.stack([results[f"bodies/{2 + k}/{signal}"] for k in range(bodies)], axis=1)


def scenes_error(name: str, results: Results) -> dict[str, float]:
    """Return what the scene of the benchmark measures."""
    scene = all_scenes()[references.SCENES[name][0][0]]
    return scene.errors(ours.outcome(results, 0.0), "")


def still(results: Results, bodies: int) -> float:
    """Return how far bodies get from where they begin, at most [m]."""
    places = every(results, bodies, "position")
    return float(np.abs(places - places[0]).max())


def bouncing_ball(results: Results) -> None:
    height, e, h = 0.5, 0.5, 0.002
    fall = math.sqrt(2.0 * height / G)
    exact, speed, begin = [], e * G * fall, fall
    for t in results["time"]:
        while t > begin + 2.0 * speed / G and speed > 1e-9:
            begin, speed = begin + 2.0 * speed / G, e * speed
        flown = t - begin
        bounces = max(speed * flown - 0.5 * G * flown**2, 0.0)
        exact.append(height - 0.5 * G * t * t if t < fall else bounces)
    z = results["bodies/2/position"][:, 2] - 0.1
    assert np.abs(z - exact).max() < 30.0 * h * h
    rest = fall * (1.0 + e) / (1.0 - e)
    assert results["time"][np.abs(z) > 1e-9][-1] == pytest.approx(rest, abs=0.01 + h)
    assert results["contacts/301/force"][-1, 2] == pytest.approx(G, rel=1e-9)


def rocking_block(results: Results) -> None:
    assert off("rocking_block", results).max() < 0.01
    early = results["time"] < 0.3
    exact = references.table("rocking_block")[2]
    assert np.abs(results["bodies/2/position"][early, 0] - exact[early, 0]).max() < 1e-4
    assert results["bodies/2/position"][-1] == pytest.approx([-0.1, 0.0, 0.4], abs=1e-5)


def woodpecker_toy(results: Results) -> None:
    assert (off("woodpecker", results) < [4e-4, 4e-5, 4e-4]).all()


def painleve_rod(results: Results) -> None:
    assert off("painleve_rod", results).max() < 6e-4
    energy = results["energy/kinetic"] + results["energy/potential"]
    assert np.diff(energy).max() < 1e-9
    assert np.abs(results["bodies/2/velocity"][-1]).max() < 1e-9


def block_holds(results: Results) -> None:
    assert still(results, 1) < 1e-9


def block_slides(results: Results) -> None:
    way = results["bodies/2/position"][-1, 0]
    assert way == pytest.approx(p.S4.slip_end_x, rel=1e-6)


def cube_stack(results: Results) -> None:
    assert still(results, p.S6.count) < 1e-7
    for k in range(p.S6.count):
        above = (p.S6.count - k) * p.S6.mass * G
        assert results[f"contacts/{301 + k}/force"][-1, 2] == pytest.approx(above, rel=1e-5)


def heavy_on_light(results: Results) -> None:
    assert still(results, 2) < 1e-6
    weight = (p.S10B.mass + p.S10B.above) * G
    assert results["contacts/301/force"][-1, 2] == pytest.approx(weight, rel=1e-6)
    assert max(float(results[f"contacts/{c}/peak_penetration"]) for c in (301, 302)) < 1e-6


def carried(results: Results, bodies: int, mass: float, contact: int) -> None:
    """Compare what a box takes with the weight of bodies that have come to rest."""
    force = results[f"contacts/{contact}/force"][-1]
    weight = bodies * mass * G
    assert force == pytest.approx([0.0, 0.0, weight], abs=1e-3 * weight)
    assert np.abs(every(results, bodies, "velocity")[-1]).max() < 0.01
    energy = results["energy/kinetic"] + results["energy/potential"]
    # at tol 1e-3 the solver leaves some of it
    assert np.diff(energy).max() < 1e-5 * energy[0]


def spheres_in_box(results: Results) -> None:
    carried(results, 125, p.S7.mass, 302)
    found = scenes_error("spheres_in_box", results)
    assert found["pen_max_over_r"] < 0.05
    assert found["escaped"] == 0
    assert every(results, 125, "position")[-1, :, 2].mean() == pytest.approx(0.0674, abs=0.0027)


def boxes_in_bin(results: Results) -> None:
    carried(results, 50, p.BIN.mass, 302)
    found = scenes_error("boxes_in_bin", results)
    assert found["pen_late"] < 1e-4
    assert found["pen_max"] < 2e-3


def balls_on_box(results: Results) -> None:
    assert scenes_error("balls_on_box", results)["velocity_square"] < 1e-10


def bouncing_balls(results: Results) -> None:
    assert scenes_error("bouncing_balls", results)["energy_square"] < 1.9e-10
    # parabolas of the same height for ever
    drop = BOUNCING.height - BOUNCING.radius
    fall = math.sqrt(2.0 * drop / G)
    t = np.mod(results["time"] + fall, 2.0 * fall) - fall
    z = every(results, 49, "position")[:, :, 2]
    assert np.abs(z - (BOUNCING.height - 0.5 * G * t**2)[:, None]).max() < 1e-6


def balls_666(results: Results) -> None:
    assert scenes_error("balls_666", results)["depth_square"] < 2e-7
    force = results["contacts/301/force"][-1]
    assert force == pytest.approx([0.0, 0.0, 216 * 10.0 * G], abs=1e-3)


def balls_666_elastic(results: Results) -> None:
    assert scenes_error("balls_666_elastic", results)["energy_square"] < 1.1e-3


#: Deck -> what holds it to its reference.
CHECKS: dict[str, Callable[[Results], None]] = {
    "balls_666": balls_666,
    "balls_666_elastic": balls_666_elastic,
    "balls_on_box": balls_on_box,
    "block_holds": block_holds,
    "block_slides": block_slides,
    "bouncing_ball": bouncing_ball,
    "bouncing_balls": bouncing_balls,
    "boxes_in_bin": boxes_in_bin,
    "cube_stack": cube_stack,
    "heavy_on_light": heavy_on_light,
    "painleve_rod": painleve_rod,
    "rocking_block": rocking_block,
    "spheres_in_box": spheres_in_box,
    "woodpecker": woodpecker_toy,
}


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=pytest.mark.slow if n in LONG else ()) for n in DECKS]
)
def test_deck_is_near_its_reference(name: str) -> None:
    assert name in CHECKS, f"models/rigid/{name}.xml: no reference"
    results = mbsim.simulate(mbsim.read_model(references.path(name)))
    assert results.audit.warnings == ()
    CHECKS[name](results)


def test_all_decks_are_of_moreau_small_and_say_their_reference() -> None:
    assert set(CHECKS) == set(DECKS)
    for name in DECKS:
        text = references.path(name).read_text("utf-8")
        comment = text[: text.index("-->")]
        assert "Reference: " in comment, name
        assert 'integrator_type="MOREAU"' in text
        assert len(text) < 200_000


@pytest.mark.parametrize("name", sorted(references.SCENES))
def test_decks_of_many_bodies_are_the_benchmarks(name: str) -> None:
    assert references.path(name).read_text("utf-8") == references.deck(name)


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(references.TABLES))
def test_table_is_what_its_command_gives(name: str) -> None:
    times, columns, exact = references.table(name)
    assert tuple(columns) == references.TABLES[name][0]
    np.testing.assert_allclose(references.TABLES[name][1](times), exact, rtol=0.0, atol=1e-8)


def test_the_woodpecker_goes_through_the_published_limit_cycle() -> None:
    """With small angles, as published; the reference's own steps are judged by that."""
    times = np.arange(0.0, 0.17, 1e-4)
    found = woodpecker.solve(woodpecker.PUBLISHED, times, 2e-6, curved=False)
    sizes: Any = [0.1, 0.3, 0.3, 1.0, 7.0]
    away = np.abs(found - woodpecker.PUBLISHED)[:, 1:] / sizes
    again = times > 0.1
    # angles and velocities are printed to 3 or 4 digits
    assert away[again].max(axis=1).min() < 6e-3
    assert times[again][away[again].max(axis=1).argmin()] == pytest.approx(0.1457, abs=1e-3)
