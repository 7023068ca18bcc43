"""MOREAU with joints and motions: smooth phases of order 2, contacts that hold mechanisms."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import mbsim
from helpers import rigid_decks as decks
from helpers.folders import MODELS
from mbsim.bench import deck as text
from mbsim.bench.scenes import s14_chain_box


def fixed(name: str, h: float, end: float, dt: float) -> mbsim.results.Results:
    """Return a run of a model by steps of h."""
    step = f'<Param_Transient h_max="{h}" h_min="{h}"/></Model>'
    deck = (MODELS / f"{name}.xml").read_text(encoding="utf-8").replace("</Model>", step)
    return mbsim.simulate(deck, integrator="MOREAU", end_time=end, print_interval=dt)


@pytest.mark.parametrize("name", ["four_bar", "slider_crank"])
def test_mechanisms_are_of_order_two(name: str) -> None:
    """Against DOP853 at 1e-11: half the step leaves a quarter; joints stay closed."""
    exact = mbsim.simulate(
        MODELS / f"{name}.xml", integrator="DOP853", tol=1e-11, end_time=0.5, print_interval=0.02
    )
    errors = []
    for h in (0.005, 0.0025, 0.00125):
        results = fixed(name, h, 0.5, 0.02)
        moved = [k for k in exact if k.startswith("bodies/") and k.endswith("/position")]
        errors.append(max(np.abs(results[k] - exact[k]).max() for k in moved))
        assert results.audit.entries["position"].value < 1e-12
        assert results.audit.warnings == ()
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert orders.min() > 1.8
    assert errors[-1] < 3e-5


def lid(folder: Path, mu: float) -> mbsim.results.Results:
    """Return a lid on a hinge at the origin that falls from level onto a block under its end."""
    parts = [
        text.body(2, 2.0, (0.01, 0.2, 0.2), (0.5, 0.0, 0.3)),
        '<Post_Graphic id="200" type="BoxDefinedFromCenter" center_marker_id="20"'
        ' length_x="1" length_y="0.4" length_z="0.02"/>',
        text.marker(21, 2, (0.0, 0.0, 0.3), [[1, 0, 0], [0, 0, 1], [0, -1, 0]]),
        text.marker(11, 1, (0.0, 0.0, 0.3), [[1, 0, 0], [0, 0, 1], [0, -1, 0]]),
        text.joint(1, "REVOLUTE", 21, 11),
        text.sphere(3, 1.0, 0.1, (0.8, 0.0, 0.1)),
        text.contact(301, [200], [300], **decks.rubbed(mu)),
        text.contact(302, [300], [100], **decks.rubbed(mu)),
        text.gravity(),
    ]
    return mbsim.simulate(decks.model(folder, parts, 2.0, 0.002), integrator="MOREAU", tol=1e-6)


def test_a_lid_on_a_hinge_falls_on_a_ball_and_rests(tmp_path: Path) -> None:
    """Its hinge and the ball carry it; moments about the hinge give what the ball does."""
    results = lid(tmp_path, 1.0)
    assert np.abs(results["bodies/2/velocity"][-1]).max() < 1e-6
    # the hinge, half a metre from the lid's middle along its x axis, which turns about y
    w, _, y, _ = results["bodies/2/quaternion"].T
    axis = np.stack([1.0 - 2.0 * y * y, 0.0 * y, -2.0 * w * y], axis=1)
    hinge = results["bodies/2/position"] - 0.5 * axis
    assert np.abs(hinge - [0.0, 0.0, 0.3]).max() < 1e-9
    force, place = results["contacts/301/force"][-1], results["bodies/3/position"][-1]
    # the normal force is along the line from the ball's centre to the lid
    assert force[2] > 0.0
    assert results["contacts/302/force"][-1, 2] == pytest.approx(force[2] + 9.81, rel=1e-5)
    assert float(results["contacts/301/peak_penetration"]) < 1e-4
    assert place[0] > 0.5


def farthest(tol: float) -> float:
    """Return how far the belt takes the block, from the parabola through the three rows there."""
    path = MODELS / "belt_stick_slip.xml"
    x = mbsim.simulate(path, integrator="MOREAU", tol=tol, end_time=12.0)["bodies/2/position"][:, 0]
    k = int(np.argmax(x))
    slope, bent = x[k + 1] - x[k - 1], x[k + 1] - 2.0 * x[k] + x[k - 1]
    return float(x[k] - slope * slope / (8.0 * bent))


def test_a_belt_slips_and_sticks() -> None:
    """A block on a spring and a belt that a motion drives: farthest where the closed form says."""
    off = {tol: farthest(tol) - 1.0385164807 for tol in (1e-7, 7e-7, 1e-6, 1.1e-6, 1.5e-6, 1e-5)}
    for tol in (7e-7, 1e-6, 1.1e-6, 1.5e-6):
        assert off[tol] == pytest.approx(0.0, abs=2e-6)
    assert abs(off[1e-7]) < 0.5 * abs(off[1e-6])
    assert abs(off[1e-5]) < 2e-5


def on_a_spring(place: float, fx: str) -> str:
    """Return the belt at rest, its block at a place and pushed by fx."""
    deck = (MODELS / "belt_stick_slip.xml").read_text(encoding="utf-8")
    deck = deck.replace("0.2*TIME", "0*TIME").replace("-DX(20,11)", fx)
    for marker in ("20", "21"):
        at = f'<Reference_Marker id="{marker}" body_id="2" '
        deck = deck.replace(at, f'{at}pos_x="{place}" ')
    return deck


@pytest.mark.parametrize("tol", [1e-5, 3e-7])
@pytest.mark.parametrize("place", [1.85, 1.95])
def test_what_turns_round_sticks_by_its_sticking_friction(place: float, tol: float) -> None:
    """Where the spring pulls by more than sliding friction and less than sticking friction."""
    deck = on_a_spring(place, "-DX(20,11)")
    results = mbsim.simulate(deck, integrator="MOREAU", tol=tol, end_time=6.0)
    assert results["bodies/2/position"][-1, 0] == pytest.approx(1.0 - place, abs=3.0 * tol)


@pytest.mark.parametrize("tol", [1e-4, 1e-6])
def test_friction_yields_when_the_load_gets_there(tol: float) -> None:
    """A load 1.2 sin t on a block that sticks by 1 and slides by 0.5: x is that of its integral."""
    deck = on_a_spring(0.0, "1.2*SIN(TIME)")
    results = mbsim.simulate(deck, integrator="MOREAU", tol=tol, end_time=2.0)
    t0 = np.arcsin(1.0 / 1.2)
    t = np.maximum(results["time"], t0)
    exact = 1.2 * (np.cos(t0) * (t - t0) - np.sin(t) + 1.0 / 1.2) - 0.25 * (t - t0) ** 2
    assert np.abs(results["bodies/2/position"][:, 0] - exact).max() < 30.0 * tol


def test_a_slider_runs_between_guides() -> None:
    """With clearance: it stays between them, as compliant contact has it to the clearance."""
    path = MODELS / "slider_crank_clearance.xml"
    rigid = mbsim.simulate(path, integrator="MOREAU", end_time=0.05)
    soft = mbsim.simulate(path, end_time=0.05)
    way = np.abs(rigid["bodies/4/position"] - soft["bodies/4/position"]).max()
    assert way < 1e-3
    assert rigid.audit.warnings == ()
    assert float(rigid["contacts/301/peak_penetration"]) < 1e-6


@pytest.mark.slow
def test_a_chain_comes_down_on_a_box(tmp_path: Path) -> None:
    """What overlaps comes out at a bounded speed: short steps do not turn light links at once.

    Pushed out in one go a link turned by far more than an error may be, however short the step.
    """
    scene = next(scene for scene in s14_chain_box.SCENES if scene.name == "chain_box")
    deck = tmp_path / "chain.xml"
    deck.write_text(scene.deck({}), encoding="utf-8")
    results = mbsim.simulate(deck, integrator="MOREAU", tol=1e-2, end_time=0.5)
    energy = results["energy/kinetic"] + results["energy/potential"]
    assert energy.max() <= energy[0] + 1e-2 * results["energy/kinetic"].max()
    # a tenth of tol of the model's length, 2.8 m, does not count
    assert max(results[f"contacts/{c}/penetration"].max() for c in results.ids("contacts")) < 3e-3
