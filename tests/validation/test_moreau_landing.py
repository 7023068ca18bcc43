"""MOREAU where bodies land on what rests, or while they rest on a point of theirs already."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

import mbsim
from helpers.mesh_parts import prism_of
from helpers.surfaces import mesh_graphic
from mbsim.bench import deck as text
from mbsim.bench import parameters as p
from mbsim.bench.scenes import s09_tori

EDGE, STEPS = 0.2, (0.01, 0.002, None)


def run(
    folder: Path,
    parts: Sequence[str],
    damping: float,
    h: float | None,
    end: float,
    tol: float,
    mu: float = 0.5,
    graphics: Sequence[int] = (),
) -> mbsim.Results:
    """Run bodies 2, 3, ... on a floor by steps of length h, or by error."""
    law = text.impact(1e6, 1.0, damping, 1e-4)
    law |= text.coulomb(mu, 0.01) if mu > 0.0 else {}
    ids = graphics or [100 * (2 + k) for k in range(len(parts))]
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


def ball(shape: str, radius: float, height: float) -> str:
    """Return body 2 of 1 kg, round, its centre above the origin."""
    if shape == "sphere":
        return text.sphere(2, 1.0, radius, (0.0, 0.0, height))
    inertia = 0.4 * radius**2
    scales = text.attributes(x_scale=1.5 * radius, y_scale=1.2 * radius, z_scale=radius)
    whole = text.body(2, 1.0, (inertia, inertia, inertia), (0.0, 0.0, height))
    return f'{whole}\n<Post_Graphic id="200" type="Ellipsoid" center_marker_id="20" {scales}/>'


def base(shape: str) -> str:
    """Return body 3 of 5 kg, EDGE high, on the floor below the origin."""
    centre = (0.0, 0.0, 0.5 * EDGE)
    if shape == "box":
        return text.cuboid(3, 5.0, (2.0 * EDGE, 2.0 * EDGE, EDGE), centre)
    whole = text.body(3, 5.0, (0.08, 0.08, 0.12), centre)
    if shape == "cylinder":
        sizes = text.attributes(radius=EDGE, length=EDGE)
        graphic = f'<Post_Graphic id="300" type="Cylinder" center_marker_id="31" {sizes}/>'
        return f"{whole}\n{text.marker(31, 3, (0.0, 0.0, 0.0))}\n{graphic}"
    # a block with a groove along one side
    outline = np.array([[-0.2, -0.1], [0.2, -0.1], [0.1, 0.0], [0.2, 0.1], [-0.2, 0.1]])
    corners, faces = prism_of(outline, [[0, 1, 2], [0, 2, 4], [2, 3, 4]], EDGE)
    corners = np.column_stack([corners[:, 0], -corners[:, 2], corners[:, 1]])
    return f"{whole}\n{mesh_graphic(300, 30, corners, faces)}"


#: The energy that may be missed [J], and by how much peaks may differ [m].
ALLOWED = {"box": (1e-5, 2e-4), "cylinder": (1e-4, 2e-4), "grooved": (1e-4, 5e-4)}


@pytest.mark.parametrize("damping", [30.0, 200.0])
@pytest.mark.parametrize("shape", ["sphere", "ellipsoid"])
@pytest.mark.parametrize("below", ALLOWED)
def test_a_ball_bounces_on_what_rests_as_its_restitution_says(
    tmp_path, below, shape, damping
) -> None:
    """The acceleration of the flight was taken off by that of what rests: it was given energy."""
    found = []
    for h in (0.05, 0.02, *STEPS):
        parts = [ball(shape, 0.05, EDGE + 0.05 + 0.3), base(below)]
        results = run(tmp_path, parts, damping, h, 1.2, 1e-3)
        energy = results.audit.entries["energy"]
        assert energy.value < ALLOWED[below][0], h
        if h is not None and h > STEPS[0]:
            continue
        found.append(peaks(results["bodies/2/position"][:, 2] - EDGE - 0.05))
        # rows every 10 ms miss a peak by up to g (5 ms)^2 / 2
        square = found[-1] / np.append(0.3, found[-1][:-1])
        assert np.ptp(square) < 0.02 + 1.3e-4 / found[-1].min()
    for other in found[1:]:
        assert other == pytest.approx(found[0], abs=ALLOWED[below][1])


def slides(mu: float) -> tuple[list[str], float, float]:
    """Return a ball above a box that slides, how high its top is, and what mu is."""
    forward = (1.0, 0.0, 0.0)
    box = text.cuboid(3, 5.0, (4.0 * EDGE, 4.0 * EDGE, EDGE), (0.0, 0.0, 0.5 * EDGE), forward)
    along = (0.3, (0.0, 0.0, 0.0)) if mu > 0.0 else (0.0, forward)
    return [text.sphere(2, 1.0, 0.05, (along[0], 0.0, EDGE + 0.35), along[1]), box], EDGE, mu


def stacked() -> tuple[list[str], float, float]:
    """Return a ball above two boxes that lie on each other."""
    edges = (2.0 * EDGE, 2.0 * EDGE, EDGE)
    boxes = [
        text.cuboid(3, 5.0, edges, (0.0, 0.0, 0.5 * EDGE)),
        text.cuboid(4, 2.0, edges, (0.0, 0.0, 1.5 * EDGE)),
    ]
    return [text.sphere(2, 1.0, 0.05, (0.0, 0.0, 2.0 * EDGE + 0.35)), *boxes], 2.0 * EDGE, 0.0


@pytest.mark.parametrize("h", [0.05, 0.02, *STEPS])
@pytest.mark.parametrize(
    "scene", [slides(0.0), slides(0.2), stacked()], ids=["slides", "brakes", "stacked"]
)
def test_what_others_carry_is_hit_while_it_moves(tmp_path, scene, h) -> None:
    """A box that slid shared its part of the step with what hit it; energy was .2 J off."""
    parts, top, mu = scene
    results = run(tmp_path, parts, 30.0, h, 1.2, 1e-3, mu)
    assert results.audit.entries["energy"].value < 1e-3
    rests = results["bodies/3/position"][:, 2]
    assert np.abs(rests - rests[0]).max() < 3e-5
    found = peaks(results["bodies/2/position"][:, 2] - top - 0.05)
    square = found / np.append(0.3, found[:-1])
    # of the stack part of what an impact leaves goes into what lies below
    assert square == pytest.approx(square[0], abs=0.02)


@pytest.mark.parametrize("h", [0.02, *STEPS])
@pytest.mark.parametrize("speed", [0.0, 1.0])
def test_balls_that_bounce_at_other_times_do_so_as_alone(tmp_path, speed, h) -> None:
    """Behind an impact what holds the box was not known: others met it as if it fell."""
    box = text.cuboid(
        3, 5.0, (3.0 * EDGE,) * 2 + (EDGE,), (0.0, 0.0, 0.5 * EDGE), (speed, 0.0, 0.0)
    )
    parts, forward = [box], (speed, 0.0, 0.0)
    for body, y, height, mass in ((8, -0.2, 0.17, 1.0), (9, 0.2, 0.31, 3.0)):
        parts.append(text.sphere(body, mass, 0.05, (0.0, y, EDGE + 0.05 + height), forward))
    results = run(tmp_path, parts, 600.0, h, 0.9, 1e-4, 0.0, [300, 800, 900])
    assert results.audit.entries["energy"].value < 1e-4
    gained = np.diff(results["energy/kinetic"] + results["energy/potential"])
    assert gained.max() < 1e-4


def joined(kind: str, speed: float) -> tuple[list[str], list[int]]:
    """Return a ball above a box that joints or a spring hold to another one, and graphics."""
    forward, centre = (speed, 0.0, 0.0), (0.0, 0.0, 0.5 * EDGE)
    box = text.cuboid(3, 4.0, (3.0 * EDGE, 3.0 * EDGE, EDGE), centre, forward)
    place = (0.0, EDGE, 1.5 * EDGE) if kind == "FIXED" else (0.0, 3.0 * EDGE, 0.5 * EDGE)
    other = text.cuboid(4, 1.0, (EDGE,) * 3, place, forward)
    end = (0.0, EDGE, EDGE) if kind == "FIXED" else (0.0, 2.0 * EDGE, 0.5 * EDGE)
    ends = [text.marker(35, 3, end), text.marker(45, 4, end)]
    if kind == "spring":
        # along y, from the box' side to that of the other one
        ends = [
            text.marker(35, 3, (0.0, 1.5 * EDGE, 0.5 * EDGE)),
            text.marker(45, 4, (0.0, 2.5 * EDGE, 0.5 * EDGE)),
        ]
        given = text.attributes(
            id=7,
            type="TRANSLATIONAL",
            i_marker_id=35,
            j_marker_id=45,
            stiffness=1e6,
            damping=1e2,
            length=EDGE,
        )
        held = f"<Force_SpringDamper {given}/>"
    else:
        held = text.joint(7, kind, 35, 45)
    falls = text.sphere(8, 1.0, 0.05, (0.0, -0.5 * EDGE, EDGE + 0.35), forward)
    return [box, other, *ends, held, falls], [300, 800] if kind == "FIXED" else [300, 400, 800]


@pytest.mark.parametrize("h", [0.02, *STEPS])
@pytest.mark.parametrize("speed", [0.0, 1.0])
@pytest.mark.parametrize("kind", ["FIXED", "SPHERICAL", "spring"])
def test_a_ball_bounces_on_what_joints_hold_to_others_as_alone(tmp_path, kind, speed, h) -> None:
    """What carries a mechanism was not known: on a box that slid the ball was given 1 %."""
    parts, graphics = joined(kind, speed)
    results = run(tmp_path, parts, 30.0, h, 0.9, 1e-4, 0.0, graphics)
    assert results.audit.warnings == ()
    assert results.audit.entries["energy"].value < 1e-6
    found = peaks(results["bodies/8/position"][:, 2] - EDGE - 0.05)
    square = found / np.append(0.3, found[:-1])
    assert square == pytest.approx(square[0], abs=0.01)


@pytest.mark.parametrize("h", [0.05, 0.02, *STEPS])
def test_what_a_joint_holds_to_a_ball_goes_its_way_in_an_impact(tmp_path, h) -> None:
    """Its part of the step before the impact was 1/2, as of what nothing hits: both took that."""
    high = EDGE + 0.05
    parts = [
        text.sphere(2, 1.0, 0.05, (0.0, 0.0, 0.35)),
        text.sphere(3, 2.0, 0.05, (0.0, 0.0, 0.3 + high)),
        text.marker(25, 2, (0.0, 0.0, 0.4)),
        text.marker(35, 3, (0.0, 0.0, 0.4)),
        text.joint(7, "FIXED", 25, 35),
    ]
    results = run(tmp_path, parts, 30.0, h, 1.2, 1e-4, 0.0, [200])
    assert results.audit.entries["energy"].value < 1e-9
    found = peaks(results["bodies/2/position"][:, 2] - 0.05)
    square = found / np.append(0.3, found[:-1])
    assert square == pytest.approx(square[0], abs=0.01)


def gained(folder: Path, h: float | None, tol: float) -> float:
    """Return by how much energy changes as two balls that a joint holds rebound aslant, over it."""
    place = (0.0, 0.0, 0.468)
    parts = [
        text.sphere(3, 2.0, 0.1, place),
        text.sphere(4, 1.0, 0.1, (0.0, 0.4, 0.568)),
        text.marker(35, 3, (0.0, 0.2, 0.468)),
        text.marker(45, 4, (0.0, 0.2, 0.468)),
        text.joint(7, "FIXED", 35, 45),
    ]
    results = run(folder, parts, 0.0, h, 0.6, tol, 0.6, [300, 400])
    energy = results["energy/kinetic"] + results["energy/potential"]
    return float(np.abs(energy - energy[0]).max() / energy[0])


def test_energy_of_a_mechanism_that_turns_is_off_by_the_step_where_it_is_hit(tmp_path) -> None:
    """What joints do is found in the step's midst, and an impact is elsewhere in it: of order 1."""
    assert gained(tmp_path, 5e-3, 1e-4) < 2e-2
    assert gained(tmp_path, 5e-4, 1e-4) < 2e-3
    assert gained(tmp_path, None, 1e-4) < 2e-3


@pytest.mark.parametrize(("h", "tol"), [(0.01, 1e-6), (0.01, 1e-4), (0.005, 1e-4), (None, 1e-4)])
def test_a_torus_that_has_rolled_on_its_rim_lies_flat(tmp_path, h, tol) -> None:
    """It rested tilted by up to 1.4e-3 rad on one of its corners, those across 0.3 mm above."""
    path = tmp_path / "deck.xml"
    deck = s09_tori.SCENES[0].deck({} if h is None else {"h": h})
    path.write_text(deck, encoding="utf-8")
    results = mbsim.simulate(mbsim.read_model(path), integrator="MOREAU", tol=tol)
    assert tilt(results, 2) < 5e-5
    assert results["bodies/2/position"][-1, 2] == pytest.approx(p.S9.tube, abs=5e-6)


@pytest.mark.parametrize("end", [1.1990, 1.1995, 1.2, 1.2005])
def test_what_rests_holds_in_very_short_steps(tmp_path, end) -> None:
    """It rests a micrometre above the floor, and was let go in a step shorter than that falls.

    Nothing was known of what carries it in the next step, and a ball that lands then went through.
    """
    parts = [ball("ellipsoid", 0.05, EDGE + 0.05 + 0.3), base("cylinder")]
    results = run(tmp_path, parts, 200.0, None, end, 1e-3)
    assert results.audit.entries["energy"].value < ALLOWED["cylinder"][0]


@pytest.mark.parametrize("restitution", [1.0, 0.99])
@pytest.mark.parametrize("together", [0.2, 0.5, 0.9])
@pytest.mark.parametrize("lands", [0.3, 0.6, 0.95])
def test_a_ball_that_meets_another_one_as_it_lands_keeps_its_energy(
    tmp_path, lands, together, restitution
) -> None:
    """Impacts of one step were each taken where they are, its way by the first: 5 % was made."""
    h, speed, radius = 0.02, 2.0, 0.1
    # the fifth step has both
    fall, meet = h * (4.0 + lands), h * (4.0 + together)
    z, x = radius + 0.5 * p.GRAVITY * fall**2, radius + speed * meet
    parts = [
        text.sphere(2, 1.0, radius, (-x, 0.0, z), (speed, 0.0, 0.0)),
        text.sphere(3, 1.0, radius, (x, 0.0, z), (-speed, 0.0, 0.0)),
    ]
    law = {"cnf_type": "POISSON", "penalty": 1e6, "restitution_coef": restitution}
    statements = [text.GROUND, text.FLOOR, *parts, text.contact(301, [200, 300], [100], **law)]
    statements += [text.contact(302, [200], [300], **law), text.gravity()]
    path = tmp_path / "deck.xml"
    statements += text.fixed_step({"h": h})
    path.write_text(text.deck("two at once", statements, 0.2), encoding="utf-8")
    results = mbsim.simulate(mbsim.read_model(path), integrator="MOREAU", tol=1e-3)
    energy = results["energy/kinetic"] + results["energy/potential"]
    assert np.diff(energy).max() < 1e-9 * energy[0]
    # two impacts of each ball lose 1 - e^2 of what closes, at most
    assert energy[-1] > restitution**2.2 * energy[0] * (1.0 - 1e-9)
