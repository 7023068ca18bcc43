"""MOREAU: what contacts take is what is missing of the energy, however long a step is.

In rows between steps too: they are before an impact or behind it.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import mbsim
from helpers import rigid_decks as decks
from helpers.folders import MODELS
from mbsim.bench import deck as text
from mbsim.results.reading import Results


def unbalanced(results: Results) -> np.ndarray:
    """Return what is missing of the energy at each row, over its size."""
    energy = results["energy/kinetic"] + results["energy/potential"] + results["energy/dissipated"]
    size = max(np.ptp(results["energy/potential"]), results["energy/kinetic"].max())
    return np.abs(energy - energy[0]) / size


@pytest.mark.parametrize("e", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("h", [0.3, 0.1, 0.031, None])
def test_a_ball_that_lands_or_rebounds_in_a_long_step(
    tmp_path: Path, e: float, h: float | None
) -> None:
    """One that rests behind an impact is not pulled on by its weight there."""
    results = mbsim.simulate(decks.ball(tmp_path, 0.5, e, 2.0, h), integrator="MOREAU", tol=1e-4)
    assert unbalanced(results).max() < 1e-9
    assert np.diff(results["energy/dissipated"]).min() > -1e-9


@pytest.mark.parametrize("mu", [0.2, 0.5])
@pytest.mark.parametrize("gap", [1e-4, 1e-6])
@pytest.mark.parametrize("h", [0.1, None])
def test_a_block_that_comes_to_lie_on_a_slope(
    tmp_path: Path, mu: float, gap: float, h: float | None
) -> None:
    """It begins a little above it; friction holds it or lets it slide, and never drives it."""
    parts = [
        decks.cube(2, 1.0, 0.2, (0.0, 0.0, 0.1 + gap)),
        text.contact(301, [200], [100], **decks.rubbed(mu)),
        text.gravity(3.355, -9.218),
    ]
    results = mbsim.simulate(
        decks.model(tmp_path, parts, 3.0, h, 0.1), integrator="MOREAU", tol=1e-4
    )
    lost = results["energy/dissipated"]
    assert np.diff(lost).min() > -1e-5
    # rows within a long step have losses on a straight line
    energy = (results["energy/kinetic"] + results["energy/potential"] + lost)[[0, -1]]
    assert energy[1] == pytest.approx(energy[0], abs=2e-3 * max(1.0, lost[-1]))
    if h is None:
        assert results.audit.warnings == ()


@pytest.mark.parametrize("tol", [1e-4, 1e-5])
def test_a_block_that_has_rocked_rests_without_taking_energy(tol: float) -> None:
    """Behind infinitely many impacts steps by error get long; its points lie on, or nearly so."""
    deck = (MODELS / "rigid" / "rocking_block.xml").read_text(encoding="utf-8")
    free = deck.replace(' h_max="0.0005" h_min="0.0005"', "")
    assert free != deck
    results = mbsim.simulate(free, tol=tol)
    lost = results["energy/dissipated"]
    assert np.diff(lost[results["time"] > 4.0]).min() > -1e-6
    came_down = results["energy/potential"][0] - results["energy/potential"][-1]
    assert lost[-1] == pytest.approx(came_down, abs=5.0 * tol)
    assert results.audit.warnings == ()


@pytest.mark.parametrize("h", [0.1, 0.07, 0.04])
def test_rows_that_a_steps_begin_misses_by_rounding(tmp_path: Path, h: float) -> None:
    """Steps go on from rows, whose times are not theirs to the last bit; the ball is elastic.

    Its energy at each row is what it had; on a line through the impact it would be less.
    """
    for dt in (0.01, 0.02, 0.005):
        model = decks.ball(tmp_path, 0.5, 1.0, 2.0, h)
        results = mbsim.simulate(model, integrator="MOREAU", print_interval=dt)
        energy = results["energy/kinetic"] + results["energy/potential"]
        assert np.abs(energy - energy[0]).max() < 1e-9


def test_an_impact_of_what_rises_at_the_begin_of_a_step_is_one(tmp_path: Path) -> None:
    """A ball hops as high as it flies within half a step; rows between are of its hops."""
    results = mbsim.simulate(decks.ball(tmp_path, 0.5, 0.5, 1.2, 0.1), integrator="MOREAU")
    assert unbalanced(results).max() < 1e-9


@pytest.mark.parametrize(
    ("deck", "part"),
    [("belt_stick_slip", 1e-5), ("cam", 0.02), ("cam_roller", 0.02), ("geneva", 1e-3)],
)
def test_motions_do_the_work_of_what_contacts_press_on_them(deck: str, part: float) -> None:
    """A belt that drags a block, cams that lift, a crank that turns a wheel."""
    results = mbsim.simulate(mbsim.read_model(MODELS / f"{deck}.xml"), integrator="MOREAU")
    assert results.audit.warnings == ()
    given = results["energy/work_of_motions"]
    energy = results["energy/kinetic"] + results["energy/potential"] + results["energy/dissipated"]
    size = max(np.ptp(given), np.ptp(energy))
    assert np.abs(energy - energy[0] - given + given[0]).max() < part * size


@pytest.mark.parametrize("h", [0.01, 0.002])
def test_a_belt_drags_with_the_work_of_its_friction(tmp_path: Path, h: float) -> None:
    """A cube is put on a plate that a motion drives at 1 m/s: it gets m v^2/2, and as much is lost.

    mu g t = v: it goes along after 0.204 s.
    """
    parts = [
        text.cuboid(2, 5.0, (4.0, 1.0, 0.2), (0.0, 0.0, -0.1)),
        text.marker(12, 1, (0.0, 0.0, 0.0), [[0, 0, 1], [0, 1, 0], [-1, 0, 0]]),
        text.marker(22, 2, (0.0, 0.0, 0.0), [[0, 0, 1], [0, 1, 0], [-1, 0, 0]]),
        text.joint(1, "TRANSLATIONAL", 22, 12),
        '<Motion_Joint id="1" joint_id="1" motion_type="T" val_type="V" expr="1"/>',
        decks.cube(3, 1.0, 0.2, (0.0, 0.0, 0.1)),
        text.contact(301, [300], [200], **decks.rubbed(0.5)),
        text.gravity(),
    ]
    results = mbsim.simulate(decks.model(tmp_path, parts, 0.5, h), integrator="MOREAU")
    assert results["bodies/3/velocity"][-1, 0] == pytest.approx(1.0, rel=1e-6)
    given = results["energy/work_of_motions"]
    assert given[-1] - given[0] == pytest.approx(1.0, rel=0.02)
    assert results["energy/dissipated"][-1] == pytest.approx(0.5, rel=0.02)
    assert results.audit.warnings == ()


def test_energy_that_a_coarse_step_leaves_is_laid_to_it(tmp_path: Path) -> None:
    """A rigid contact has no force without a potential, so that is not what is said of it.

    Columns of cubes, 1 mm apart, that bounce on each other.
    """
    law, edge, said = text.impact(1e5, 1.0, 30.0, 1e-5) | text.coulomb(0.5, 1e-3), 0.2, []
    for count in (8, 9, 10):
        cubes = [
            text.cuboid(2 + k, 1.0, (edge,) * 3, (0.0, 0.0, (k + 0.5) * edge + 1e-3 * (k + 1)))
            for k in range(count)
        ]
        ids = [100 * (2 + k) for k in range(count)]
        contacts = [text.contact(301, ids, [100], **law), text.contact(302, ids, ids, **law)]
        model = decks.model(tmp_path, [*cubes, *contacts, text.gravity()], 3.0, 5e-3, 5e-3)
        said += mbsim.simulate(model, integrator="MOREAU", tol=1e-3).audit.warnings
    assert any("choose a shorter one" in line for line in said)
    assert not any("meshes" in line for line in said)
