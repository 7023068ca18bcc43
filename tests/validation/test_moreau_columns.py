"""MOREAU on columns of cubes: steps of the deck's length, loose tolerances, what bounces on top."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import mbsim
from mbsim.bench import deck as text

EDGE = 0.2


def column(folder: Path, count: int, ball: bool, step: float, tol: float) -> mbsim.Results:
    """Run cubes of 1 kg on each other for 4 s, and a ball that falls on the topmost one."""
    parts = [
        text.cuboid(2 + k, 1.0, (EDGE,) * 3, (0.0, 0.0, (k + 0.5) * EDGE)) for k in range(count)
    ]
    if ball:
        parts.append(text.sphere(2 + count, 1.0, 0.05, (0.01, 0.0, count * EDGE + 0.15)))
    return run(folder, parts, step, tol)


def run(folder: Path, parts: list[str], step: float, tol: float, *apart: str) -> mbsim.Results:
    """Run bodies 2, 3, ... on a floor, and on each other, for 4 s, and others apart from them."""
    law = text.impact(1e5, 1.0, 30.0, 1e-5) | text.coulomb(0.5, 1e-3)
    statements, body = [text.GROUND, text.FLOOR, *parts, *apart], 2
    for k, bodies in enumerate((parts, apart)):
        ids = [100 * (body + row) for row in range(len(bodies))]
        body += len(bodies)
        if ids:
            statements.append(text.contact(301 + 2 * k, ids, [100], **law))
            statements.append(text.contact(302 + 2 * k, ids, ids, **law))
    statements += [text.gravity(), *text.fixed_step({"h": step})]
    path = folder / "column.xml"
    path.write_text(text.deck("a column of cubes", statements, 4.0), encoding="utf-8")
    return mbsim.simulate(path, integrator="MOREAU", tol=tol)


def moved(results: mbsim.Results, count: int) -> float:
    """Return the largest way of a cube from its place [m]."""
    places = np.stack([results[f"bodies/{2 + k}/position"] for k in range(count)])
    return float(np.abs(places - places[:, :1]).max())


@pytest.mark.parametrize("tol", [1e-2, 1e-3])
@pytest.mark.parametrize("step", [2e-2, 1e-2, 5e-3, 2e-3])
@pytest.mark.parametrize("count", [10, 30])
def test_a_column_stands(tmp_path: Path, count: int, step: float, tol: float) -> None:
    """It fell over within 7 s, as what sweeps left of velocities went on from step to step.

    The last sweep changed them by no more than may be left, and in a column each changes little.
    """
    results = column(tmp_path, count, False, step, tol)
    assert results.audit.warnings == ()
    assert moved(results, count) < 0.3 * tol * EDGE
    energy = results["energy/kinetic"] + results["energy/potential"]
    assert energy.max() - energy[0] < 1e-4 * energy[0]
    # it sleeps
    assert results.stats["contact_sweeps"] < 2000


@pytest.mark.parametrize("tol", [1e-2, 1e-3])
@pytest.mark.parametrize("step", [2e-2, 1e-2, 5e-3, 2e-3])
def test_a_column_stands_below_a_ball_that_bounces(tmp_path: Path, step: float, tol: float) -> None:
    """It went 2 cm to the side: what moves is solved as close as what the others bear asks for."""
    results = column(tmp_path, 5, True, step, tol)
    assert results.audit.warnings == ()
    assert moved(results, 5) < 2.5 * tol * EDGE


@pytest.mark.parametrize("tol", [1e-2, 1e-3])
@pytest.mark.parametrize("step", [2e-2, 1e-2, 5e-3])
def test_a_high_column_stands(tmp_path: Path, step: float, tol: float) -> None:
    """A hundred cubes fell over: Newton's method was for small piles, and sweeps end too soon."""
    results = column(tmp_path, 100, False, step, tol)
    assert results.audit.warnings == ()
    # lengths are judged by that of all of it
    assert moved(results, 100) < 1e-3 * tol * 100 * EDGE
    assert results.stats["asleep_at_end"] == 100
    assert results.stats["contact_sweeps"] < 2000


@pytest.mark.parametrize("step", [2e-2, 5e-3])
def test_a_pyramid_comes_to_rest(tmp_path: Path, step: float) -> None:
    """Twenty layers of cubes side by side crept on by 2 to 9 mm in two seconds, and never slept."""
    rows = [(row, place) for row in range(20) for place in range(20 - row)]
    parts = [
        text.cuboid(
            2 + k, 1.0, (EDGE,) * 3, ((place + 0.5 * row) * 1.02 * EDGE, 0.0, (row + 0.5) * EDGE)
        )
        for k, (row, place) in enumerate(rows)
    ]
    results = run(tmp_path, parts, step, 1e-2)
    assert results.audit.warnings == ()
    assert moved(results, len(rows)) < 1e-4
    assert results.stats["asleep_at_end"] == len(rows)


@pytest.mark.parametrize("count", [10, 100])
def test_a_column_stands_beside_a_heap_that_moves(tmp_path: Path, count: int) -> None:
    """What moves elsewhere has most points, and takes most sweeps: the column is judged for itself.

    Lengths are judged by its own group.
    """
    cubes = [
        text.cuboid(2 + k, 1.0, (EDGE,) * 3, (0.0, 0.0, (k + 0.5) * EDGE)) for k in range(count)
    ]
    rng = np.random.default_rng(3)
    balls = []
    for k in range(100):
        place = (3.0 + 0.21 * (k % 5), 0.21 * (k // 5 % 5), 0.3 + 0.25 * (k // 25))
        speed = (*rng.normal(scale=0.5, size=2), 0.0)
        balls.append(text.sphere(2 + count + k, 1.0, 0.1, place, speed))
    results = run(tmp_path, cubes, 1e-2, 1e-2, *balls)
    assert moved(results, count) < 1e-4
