"""MOREAU where bodies land on what rests, or while they rest on a point of theirs already."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

import mbsim
from mbsim.bench import deck as text
from mbsim.bench import parameters as p
from mbsim.bench.scenes import s09_tori

EDGE, STEPS = 0.2, (0.01, 0.002, None)


def run(
    folder: Path, parts: Sequence[str], damping: float, h: float | None, end: float, tol: float
) -> mbsim.Results:
    """Run bodies 2, 3, ... on a floor by steps of length h, or by error."""
    law = text.impact(1e6, 1.0, damping, 1e-4) | text.coulomb(0.5, 0.01)
    ids = [100 * (2 + k) for k in range(len(parts))]
    statements = [text.GROUND, text.FLOOR, *parts, text.contact(301, ids, [100], **law)]
    if len(ids) > 1:
        statements.append(text.contact(302, ids, ids, **law))
    statements.append(text.gravity())
    if h is not None:
        statements += text.fixed_step({"h": h})
    path = folder / "deck.xml"
    path.write_text(text.deck("lands", statements, end), encoding="utf-8")
    return mbsim.simulate(mbsim.read_model(path), integrator="MOREAU", tol=tol)


def tilt(results: mbsim.Results, body: int) -> float:
    """Return the angle between a body's axis and the vertical at the end [rad]."""
    _, x, y, _ = results[f"bodies/{body}/quaternion"][-1]
    return 2.0 * math.asin(math.hypot(x, y))


@pytest.mark.parametrize("h", STEPS)
@pytest.mark.parametrize("angle", [5e-4, 1e-3, 3e-3])
@pytest.mark.parametrize("damping", [200.0, 2000.0])
def test_a_box_on_its_edge_falls_flat(tmp_path, damping, angle, h) -> None:
    """It hung tilted where free fall of a step from rest is more than its gaps, for good."""
    c, s = math.cos(angle), math.sin(angle)
    box = text.cuboid(
        2,
        1.0,
        (EDGE,) * 3,
        (0.0, 0.0, 0.5 * EDGE * (c + s)),
        axes=((c, 0, s), (0, 1, 0), (-s, 0, c)),
    )
    results = run(tmp_path, [box], damping, h, 0.5, 1e-4)
    assert tilt(results, 2) < 5e-5
    assert results["bodies/2/position"][-1, 2] == pytest.approx(0.5 * EDGE, abs=1e-5)


@pytest.mark.parametrize("h", STEPS)
@pytest.mark.parametrize("damping", [200.0, 600.0, 2000.0])
@pytest.mark.parametrize("gaps", [(2e-4, 0.0), (0.0, 2e-4), (1e-4, 2e-4), (0.0, 1e-3)])
def test_boxes_that_fall_a_little_way_come_to_rest(tmp_path, gaps, damping, h) -> None:
    """Two that touch hung above the floor; one above another one hopped for ever."""
    below = 0.5 * EDGE + gaps[0]
    boxes = [
        text.cuboid(2, 1.0, (EDGE,) * 3, (0.0, 0.0, below)),
        text.cuboid(3, 1.0, (EDGE,) * 3, (0.0, 0.0, below + EDGE + gaps[1])),
    ]
    results = run(tmp_path, boxes, damping, h, 1.0, 1e-4)
    for body, rests in ((2, 0.5 * EDGE), (3, 1.5 * EDGE)):
        assert results[f"bodies/{body}/position"][-1, 2] == pytest.approx(rests, abs=2e-5)
        assert np.abs(results[f"bodies/{body}/velocity"][-1]).max() < 1e-3


def peaks(height: np.ndarray) -> np.ndarray:
    """Return the heights of a bouncing ball's peaks above 1 cm."""
    inner = height[1:-1]
    return inner[(inner > height[:-2]) & (inner >= height[2:]) & (inner > 0.01)]


@pytest.mark.parametrize("damping", [30.0, 200.0])
def test_a_ball_bounces_on_what_rests_as_its_restitution_says(tmp_path, damping) -> None:
    """The acceleration of the flight was taken off by that of what rests: it was given energy."""
    found = []
    for h in STEPS:
        parts = [
            text.sphere(2, 1.0, 0.05, (0.0, 0.0, EDGE + 0.05 + 0.3)),
            text.cuboid(3, 5.0, (2.0 * EDGE, 2.0 * EDGE, EDGE), (0.0, 0.0, 0.5 * EDGE)),
        ]
        results = run(tmp_path, parts, damping, h, 1.2, 1e-3)
        found.append(peaks(results["bodies/2/position"][:, 2] - EDGE - 0.05))
        energy = results.audit.entries["energy"]
        assert energy.value < 1e-5
        # rows every 10 ms miss a peak by up to g (5 ms)^2 / 2
        square = found[-1] / np.append(0.3, found[-1][:-1])
        assert np.ptp(square) < 0.02 + 1.3e-4 / found[-1].min()
    for other in found[1:]:
        assert other == pytest.approx(found[0], abs=2e-4)


@pytest.mark.parametrize(("h", "tol"), [(0.01, 1e-6), (0.01, 1e-4), (0.005, 1e-4), (None, 1e-4)])
def test_a_torus_that_has_rolled_on_its_rim_lies_flat(tmp_path, h, tol) -> None:
    """It rested tilted by up to 1.4e-3 rad on one of its corners, those across 0.3 mm above."""
    path = tmp_path / "deck.xml"
    deck = s09_tori.SCENES[0].deck({} if h is None else {"h": h})
    path.write_text(deck, encoding="utf-8")
    results = mbsim.simulate(mbsim.read_model(path), integrator="MOREAU", tol=tol)
    assert tilt(results, 2) < 5e-5
    assert results["bodies/2/position"][-1, 2] == pytest.approx(p.S9.tube, abs=5e-6)
