"""MOREAU: what rests sleeps, costs nothing, and wakes in the step in which something happens."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import mbsim
from helpers import rigid_decks as decks
from helpers.forgetful import forgetful
from mbsim.bench import deck as text
from mbsim.results.reading import Results

#: A force along x on body 2 from 1 s on: the box slides from then.
PUSH = (
    '<Reference_Marker id="21" body_id="2" pos_z="0.1"/>'
    '<Force_Vector_TwoBody id="401" type="ForceOnly" i_marker_id="21" j_floating_marker_id="12"'
    ' ref_marker_id="12" fx_expression="IF(TIME-1:0,0,8)" fy_expression="0" fz_expression="0"/>'
    '<Reference_Marker id="12" body_id="1"/>'
)


def run(folder: Path, parts: list[str], end: float, sleep: bool, h: float = 0.005) -> Results:
    """Return a run by steps of h whose bodies may sleep, or not."""
    decks.model(folder, parts, end, h)
    deck = (folder / "rigid.xml").read_text()
    said = "TRUE" if sleep else "FALSE"
    deck = deck.replace("<Param_Transient ", f'<Param_Transient sleep="{said}" ')
    return mbsim.simulate(deck, integrator="MOREAU", tol=1e-4)


def standing(count: int) -> list[str]:
    """Return touching cubes on each other, on the floor."""
    ids = [100 * (2 + k) for k in range(count)]
    cubes = [decks.cube(2 + k, 1.0, 0.2, (0.0, 0.0, 0.2 * k + 0.1)) for k in range(count)]
    law = decks.rubbed(0.5)
    both = [text.contact(301, ids, ids, **law), text.contact(302, ids, [100], **law)]
    return [*cubes, *both, text.gravity()]


def test_what_sleeps_takes_no_sweeps_and_keeps_its_forces(tmp_path: Path) -> None:
    """Twice as long takes as many sweeps; the floor still carries all of it."""
    short, long = (run(tmp_path, standing(5), end, True) for end in (1.0, 4.0))
    assert long.stats["asleep_at_end"] == 5
    assert long.stats["contact_sweeps"] == short.stats["contact_sweeps"]
    assert long["contacts/302/force"][-1, 2] == pytest.approx(5.0 * 9.81, rel=1e-4)
    for body in range(2, 7):
        x = long[f"bodies/{body}/position"]
        assert np.abs(x[-1] - x[0]).max() < 1e-4
    awake = run(tmp_path, standing(5), 1.0, False)
    assert awake.stats["asleep_at_end"] == 0
    assert awake.stats["contact_sweeps"] >= awake.stats["contact_solves"]


def test_what_is_hit_wakes_in_that_step(tmp_path: Path) -> None:
    """A ball rolls at a row of cubes that sleep: all goes as it does where nothing ever slept.

    It goes on as well from one that it hits to the next one, a little farther off.
    """
    cubes = [decks.cube(2 + k, 1.0, 0.2, (0.23 * k, 0.0, 0.1)) for k in range(3)]
    ball = text.sphere(9, 6.0, 0.1, (-2.2, 0.0, 0.1), (2.0, 0.0, 0.0), (0.0, 20.0, 0.0))
    ids, law = [200, 300, 400, 900], decks.rubbed(0.2)
    both = [text.contact(301, ids, ids, **law), text.contact(302, ids, [100], **law)]
    parts = [*cubes, ball, *both, text.gravity()]
    sleeping, awake = run(tmp_path, parts, 1.5, True), run(tmp_path, parts, 1.5, False)
    for body in (2, 3, 4, 9):
        name = f"bodies/{body}/position"
        assert np.abs(sleeping[name] - awake[name]).max() < 1e-4
    # it did hit them, and pushed the farthest one off its place
    moved = awake["bodies/4/position"]
    assert np.abs(moved[-1] - moved[0]).max() > 0.5
    assert sleeping.stats["bodies_in_steps"] < 0.7 * awake.stats["bodies_in_steps"]


def test_what_is_loaded_wakes_in_that_step(tmp_path: Path) -> None:
    """A force that sets in at 1 s moves a box that sleeps as it does one that never slept."""
    cube = decks.cube(2, 1.0, 0.2, (0.0, 0.0, 0.1))
    floor = text.contact(302, [200], [100], **decks.rubbed(0.5))
    parts = [cube, floor, text.gravity(), PUSH]
    sleeping, awake = run(tmp_path, parts, 1.5, True), run(tmp_path, parts, 1.5, False)
    x = sleeping["bodies/2/position"][:, 0]
    assert np.abs(x - awake["bodies/2/position"][:, 0]).max() < 1e-6
    a = 8.0 - 0.5 * 9.81
    assert x[-1] == pytest.approx(0.5 * a * 0.25, rel=2e-2)
    assert sleeping.stats["contact_sweeps"] < 0.6 * awake.stats["contact_sweeps"]


def test_what_hangs_in_the_air_for_a_moment_does_not_sleep(tmp_path: Path) -> None:
    """A ball thrown upwards by 1 m/s turns round: nothing holds it."""
    ball = text.sphere(2, 1.0, 0.1, (0.0, 0.0, 0.1), (0.0, 0.0, 1.0))
    parts = [ball, text.contact(301, [200], [100], **decks.rubbed(0.0)), text.gravity()]
    z = run(tmp_path, parts, 0.2, True, 1e-4)["bodies/2/position"][:, 2]
    assert z[-1] == pytest.approx(0.1 + 0.2 - 0.5 * 9.81 * 0.04, abs=1e-6)


def field(shape: str, side: int, ball: str) -> tuple[list[str], list[int]]:
    """Return shapes that rest on the floor by rows, and what moves; and all graphics."""
    places = [(0.3 * i, 0.3 * j, 0.1) for i in range(side) for j in range(side)]
    ids = list(range(10, 10 + side * side))
    solids = [
        text.sphere(b, 1.0, 0.1, x) if shape == "sphere" else decks.cube(b, 1.0, 0.2, x)
        for b, x in zip(ids, places, strict=True)
    ]
    return [*solids, ball], [*(100 * b for b in ids), 200]


def among(
    folder: Path, shape: str, side: int, ball: str, end: float, sleep: bool = True, h: float = 0.005
) -> Results:
    """Return a run of a body among so many rows of others that rest."""
    parts, ids = field(shape, side, ball)
    law = decks.rubbed(0.5)
    both = [text.contact(301, ids, ids, **law)] if side > 0 else []
    parts += [*both, text.contact(302, ids, [100], **law), text.gravity()]
    return run(folder, parts, end, sleep, h)


@pytest.mark.parametrize(
    ("shape", "place", "speed"),
    [
        ("sphere", (-1.0, -1.0, 20.0), (0.5, 0.7, 9.0)),  # flies
        ("sphere", (-0.5, -0.5, 0.1), (0.1, 0.1, 0.0)),  # rolls
        ("box", (-0.5, -0.5, 0.1), (0.1, 0.1, 0.0)),
    ],
)
def test_what_sleeps_is_not_gone_through(
    tmp_path: Path, shape: str, place: tuple[float, ...], speed: tuple[float, ...]
) -> None:
    """One body moves among 64: of bodies and pairs a step looks at those of that one alone."""
    ball = text.sphere(2, 1.0, 0.1, place, speed)
    short, long = (among(tmp_path, shape, 8, ball, end) for end in (1.0, 1.5))
    assert short.stats["asleep_at_end"] == long.stats["asleep_at_end"] == 64
    steps = long.stats["steps"] - short.stats["steps"]
    placed = long.stats["bodies_in_steps"] - short.stats["bodies_in_steps"]
    pairs = sum(
        long.stats[name] - short.stats[name] for name in ("narrowphase_pairs", "skipped_pairs")
    )
    # the step after compiled code was left goes through everything
    assert placed <= 1.1 * steps + 3 * 65
    assert pairs <= 3.0 * steps + 3 * 200


def test_what_rolls_among_sleepers_finds_them(tmp_path: Path) -> None:
    """A ball rolls through a field that sleeps, hits some, which hit others: as without sleep."""
    ball = text.sphere(2, 3.0, 0.1, (-0.6, 0.45, 0.1), (2.0, 0.13, 0.0), (0.0, 20.0, 0.0))
    # which of two steps takes a hit is decided by rounding: that moves bodies by v h
    sleeping, awake = (
        among(tmp_path, "sphere", 5, ball, 2.5, sleep, 0.001) for sleep in (True, False)
    )
    assert sleeping.stats["pair_listings"] > 3
    hit = 0
    for body in (2, *range(10, 35)):
        x, y = (found[f"bodies/{body}/position"] for found in (sleeping, awake))
        hit += np.abs(y[-1] - y[0]).max() > 0.05
        assert np.abs(x - y).max() < 2e-3, body
    assert hit > 4
    assert sleeping.stats["bodies_in_steps"] < 0.8 * awake.stats["bodies_in_steps"]


@pytest.mark.parametrize("budget", [1, 40])
def test_when_a_run_pauses_changes_no_bit_of_it(tmp_path: Path, budget: int) -> None:
    """A ball rolls among sleepers and wakes some; what no checkpoint holds is forgotten between."""
    ball = text.sphere(2, 3.0, 0.1, (-0.3, 0.45, 0.1), (2.0, 0.13, 0.0), (0.0, 20.0, 0.0))
    straight = among(tmp_path, "sphere", 5, ball, 0.8)
    with pytest.MonkeyPatch.context() as patch:
        forgetful(patch, budget)
        paused = among(tmp_path, "sphere", 5, ball, 0.8)
    assert straight.stats["bodies_in_steps"] < 0.9 * 26 * straight.stats["steps"]
    for body in (2, *range(10, 35)):
        for name in ("position", "quaternion", "velocity"):
            signal = f"bodies/{body}/{name}"
            np.testing.assert_array_equal(paused[signal], straight[signal], err_msg=signal)
    for name in ("steps", "contact_sweeps", "pair_listings", "asleep_at_end"):
        assert paused.stats[name] == straight.stats[name], name
