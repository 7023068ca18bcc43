"""MOREAU: nothing passes through anything within a step, whatever gives its contact points."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import mbsim
from helpers import rigid_decks as decks
from mbsim.bench import deck as text
from mbsim.errors import ModelError, SolverError

#: A plate of 2 mm across x, its middle at 1 m.
PLATE = (
    '<Reference_Marker id="10" body_id="1" pos_x="1.0"/>'
    '<Post_Graphic id="100" type="BoxDefinedFromCenter" center_marker_id="10"'
    ' length_x="0.002" length_y="4" length_z="4"/>'
)
#: What flies, with its cg in its middle, and how far that is from the plate where it lies on it.
SHAPES = {
    "Cylinder": ('<Post_Graphic id="200" type="Cylinder" center_marker_id="21"', 0.1),
    "Ellipsoid": ('<Post_Graphic id="200" type="Ellipsoid" center_marker_id="20"', 0.05),
    "Frustum": ('<Post_Graphic id="200" type="Frustum" center_marker_id="21"', 0.1),
}
SIZES = {
    "Cylinder": 'radius="0.1" length="0.2"/>',
    "Ellipsoid": 'x_scale="0.05" y_scale="0.1" z_scale="0.1"/>',
    "Frustum": 'bottom_radius="0.1" top_radius="0.1" length="0.2"/>',
}


def flying(shape: str, speed: float) -> list[str]:
    """Return body 2 of 1 kg with a shape about its cg at the origin, and its speed along x."""
    graphic, _ = SHAPES[shape]
    return [
        text.body(2, 1.0, (0.004, 0.004, 0.004), (0.0, 0.0, 0.0), (speed, 0.0, 0.0)),
        text.marker(21, 2, (0.0, 0.0, -0.1)),
        f"{graphic} {SIZES[shape]}",
    ]


def run(parts: list[str], h: float, end: float) -> mbsim.results.Results:
    """Return a run by steps of h, without gravity."""
    whole = [text.GROUND, PLATE, *parts, decks.FIXED.format(h=h)]
    return mbsim.simulate(text.deck("near", whole, end, h), integrator="MOREAU")


@pytest.mark.parametrize("shape", list(SHAPES))
def test_what_is_fast_stops_at_a_thin_plate(shape: str) -> None:
    """It goes 2 m in a step, through 2 mm: 1000 times as far as the plate is thick."""
    parts = [*flying(shape, 400.0), text.contact(301, [200], [100], **decks.rubbed(0.3))]
    x = run(parts, 0.005, 0.05)["bodies/2/position"][:, 0]
    wanted = 1.0 - 0.001 - SHAPES[shape][1]
    assert x[-1] == pytest.approx(wanted, abs=1e-6)
    assert x.max() < wanted + 1e-6


def test_what_impulses_throw_at_a_plate_stops_there() -> None:
    """A heavy ball pushes an ellipsoid that rests at first: both end in a row at the plate."""
    parts = [
        *flying("Ellipsoid", 0.0),
        text.sphere(3, 1000.0, 0.1, (-0.3, 0.0, 0.0), (10.0, 0.0, 0.0)),
        text.contact(301, [300], [200], **decks.rubbed(0.0)),
        text.contact(302, [200], [100], **decks.rubbed(0.0)),
    ]
    results = run(parts, 0.2, 0.8)
    assert results["bodies/2/position"][-1, 0] == pytest.approx(0.949, abs=1e-6)
    assert results["bodies/3/position"][-1, 0] == pytest.approx(0.799, abs=1e-6)
    assert abs(results["bodies/3/velocity"][-1, 0]) < 1e-9


def test_a_fast_ball_among_many_is_looked_for_far_off() -> None:
    """It goes 5 radii in a step: near pairs of all others need not be so far apart for that.

    With a skin for all of what it needs there was no place for so many pairs.
    """
    places = 0.205 * np.array(list(np.ndindex(6, 6, 10)), dtype=float)
    speeds = np.zeros_like(places)
    speeds[180] = 100.0, 60.0, 30.0
    ids = [100 * (2 + k) for k in range(len(places))]
    balls = [
        text.sphere(2 + k, 1.0, 0.1, places[k].tolist(), speeds[k].tolist())
        for k in range(len(places))
    ]
    parts = [*balls, text.contact(301, ids, ids, **decks.rubbed(0.0, 0.5))]
    whole = [text.GROUND, *parts, decks.FIXED.format(h=0.005)]
    results = mbsim.simulate(text.deck("near", whole, 0.01, 0.005), integrator="MOREAU")
    ends = np.array([results[f"bodies/{2 + k}/position"][-1] for k in range(len(places))])
    v = np.array([results[f"bodies/{2 + k}/velocity"][-1] for k in range(len(places))])
    assert v.sum(axis=0) == pytest.approx(speeds[180], rel=1e-9)
    assert (v**2).sum() < (speeds**2).sum()
    apart = np.linalg.norm(ends[:, None] - ends[None], axis=2) + np.eye(len(ends))
    assert apart.min() > 0.2 - 1e-4


def test_a_cylinder_stands_on_a_box(tmp_path: Path) -> None:
    """It neither sinks nor trembles although its pair has no points while it is a hair apart."""
    parts = [
        '<Reference_Marker id="11" body_id="1" pos_z="-0.1"/>',
        '<Post_Graphic id="101" type="BoxDefinedFromCenter" center_marker_id="11"'
        ' length_x="1" length_y="1" length_z="0.2"/>',
        text.body(2, 1.0, (0.006, 0.006, 0.005), (0.0, 0.0, 0.1)),
        text.marker(21, 2, (0.0, 0.0, 0.0)),
        '<Post_Graphic id="200" type="Cylinder" center_marker_id="21" radius="0.1" length="0.2"/>',
        text.contact(301, [200], [101], **decks.rubbed(0.3)),
        text.gravity(),
    ]
    model = decks.model(tmp_path, parts, 1.0, 0.005)
    results = mbsim.simulate(model, integrator="MOREAU", tol=1e-6)
    assert results["bodies/2/position"][-1, 2] == pytest.approx(0.1, abs=1e-7)
    assert results["contacts/301/force"][1:, 2] == pytest.approx(9.81, rel=1e-5)
    assert results.audit.warnings == ()


def test_what_fcl_measures_is_refused_by_name(tmp_path: Path) -> None:
    """FCL says nothing of shapes that are apart, so something could pass through."""
    model = decks.ball(tmp_path, 0.5, 0.5, 0.1, 0.01)
    with pytest.raises(ModelError, match=r"Force_Contact\[301\].*MOREAU.*FCL"):
        mbsim.simulate(model, integrator="MOREAU", detector="fcl")


def boxes_in_flight(rise: float) -> list[str]:
    """Return eight boxes side by side, 0.25 m above a plane, that fly up at `rise` [m/s]."""
    ids = [200 + 100 * k for k in range(8)]
    return [
        text.GROUND,
        text.FLOOR,
        *(
            text.cuboid(2 + k, 1.0, (0.1, 0.1, 0.1), (float(k), 0.0, 0.3), (0.0, 0.0, rise))
            for k in range(8)
        ),
        text.contact(301, ids, [100], **decks.rubbed(0.3)),
        text.gravity(),
    ]


def test_a_step_that_reaches_more_points_than_there_is_room_for_is_taken_shorter(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Long steps of free flight reach all corners of all boxes; none of them touches."""
    monkeypatch.setattr("mbsim.stepping.setup.POINTS_EACH", 1)
    deck = text.deck("near", boxes_in_flight(4.0), 0.8)
    results = mbsim.simulate(deck, integrator="MOREAU", tol=1e-2)
    assert results.stats["rejected"] > 0
    t = results["time"]
    height = 0.3 + 4.0 * t - 0.5 * 9.81 * t**2
    np.testing.assert_allclose(results["bodies/2/position"][:, 2], height, atol=1e-9)


def test_touching_points_without_room_end_the_run_and_are_said(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """They fall by 0.25 m in 0.2258 s."""
    monkeypatch.setattr("mbsim.stepping.setup.POINTS_EACH", 1)
    deck = text.deck("near", boxes_in_flight(0.0), 0.8)
    with pytest.raises(SolverError, match=r"more contact points .* room for at time 0\.2257"):
        mbsim.simulate(deck, integrator="MOREAU", tol=1e-2)
