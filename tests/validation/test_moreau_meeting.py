"""MOREAU: impulses act where bodies meet, not where they are at the step's begin."""

from __future__ import annotations

import math

import numpy as np
import pytest

import mbsim
from helpers import rigid_decks as decks
from mbsim.bench import deck as text

STEPS = [{"h": 0.01}, {"h": 0.003}, {"tol": 1e-5}, {"tol": 1e-8}]


def run(parts: list[str], step: dict[str, float], end: float) -> mbsim.results.reading.Results:
    """Return a run of bodies with a step of h or by error."""
    fixed = [decks.FIXED.format(h=step["h"])] if "h" in step else []
    whole = text.deck("meeting", [text.GROUND, text.FLOOR, *parts, *fixed], end, 0.02)
    return mbsim.simulate(whole, integrator="MOREAU", tol=step.get("tol", 1e-5))


@pytest.mark.parametrize("step", STEPS)
@pytest.mark.parametrize("e", [0.0, 0.5])
def test_a_thrown_ball_that_bounces_rolls_at_five_sevenths_of_its_speed(
    step: dict[str, float], e: float
) -> None:
    """Its spin about where it touches is kept by friction of any kind: v + 2/5 r w = v0."""
    parts = [
        text.sphere(2, 1.0, 0.1, (0.0, 0.0, 0.4), (3.0, 0.0, 0.0)),
        text.contact(301, [200], [100], **decks.rubbed(0.5, e)),
        text.gravity(),
    ]
    results = run(parts, step, 1.4)
    assert results["bodies/2/velocity"][-1, 0] == pytest.approx(15.0 / 7.0, abs=1e-12)


@pytest.mark.parametrize("step", [{"h": 0.01}, {"tol": 1e-5}, {"tol": 1e-8}])
@pytest.mark.parametrize("shape", ["Cylinder", "Ellipsoid"])
def test_so_does_what_is_measured_where_it_overlaps(step: dict[str, float], shape: str) -> None:
    """A cylinder, and an ellipsoid that is a ball, on a large box: 2/3 and 5/7 of 3 m/s."""
    sizes = {
        "Cylinder": 'radius="0.1" length="0.2"',
        "Ellipsoid": 'x_scale="0.1" y_scale="0.1" z_scale="0.1"',
    }
    # a cylinder's marker is at its end
    end, inertia, part = (
        ("0.1", 0.005, 2.0 / 3.0) if shape == "Cylinder" else ("0", 0.004, 5.0 / 7.0)
    )
    parts = [
        text.body(2, 1.0, (0.006, inertia, 0.006), (0.0, 0.0, 0.4337), (3.0, 0.0, 0.0)),
        f'<Reference_Marker id="21" body_id="2" pos_y="{end}" pos_z="0.4337"'
        f' theta="{math.pi / 2}"/>',
        f'<Post_Graphic id="200" type="{shape}" center_marker_id="21" {sizes[shape]}/>',
        '<Reference_Marker id="11" body_id="1" pos_z="-0.5"/>',
        '<Post_Graphic id="101" type="BoxDefinedFromCenter" center_marker_id="11"'
        ' length_x="20" length_y="20" length_z="1"/>',
        text.contact(301, [200], [101], **decks.rubbed(0.5, 0.5)),
        text.gravity(),
    ]
    results = run(parts, step, 1.4)
    assert results["bodies/2/velocity"][-1, 0] == pytest.approx(3.0 * part, abs=2e-4)


@pytest.mark.parametrize("step", STEPS)
@pytest.mark.parametrize("mu", [0.0, 0.05, 0.5])
def test_spheres_that_meet_obliquely_part_as_they_should(step: dict[str, float], mu: float) -> None:
    """One at 3 m/s, half a radius pair beside the other's centre, e = 0.7: closed form.

    The impulse stops slip, or is mu times the normal one: slip changes by (2/m + 2 r^2/I) a
    tangential impulse.
    """
    e, n = 0.7, np.array([-math.sqrt(0.75), 0.5])
    parts = [
        text.sphere(2, 1.0, 0.1, (-0.613, 0.1, 1.0), (3.0, 0.0, 0.0)),
        text.sphere(3, 1.0, 0.1, (0.0, 0.0, 1.0), (0.0, 0.0, 0.0)),
        text.contact(301, [200], [300], **decks.rubbed(mu, e)),
    ]
    results = run(parts, step, 0.3)
    across = np.array([n[1], -n[0]])
    u = np.array([3.0, 0.0])
    along = -(1.0 + e) * (u @ n) / 2.0
    slip = u @ across
    impulse = along * n - math.copysign(min(mu * along, abs(slip) / 7.0), slip) * across
    off = 1e-6 if "h" in step else step["tol"]
    assert results["bodies/2/velocity"][-1, :2] == pytest.approx(u + impulse, abs=off)
    assert results["bodies/3/velocity"][-1, :2] == pytest.approx(-impulse, abs=off)


@pytest.mark.parametrize("step", STEPS)
def test_a_ball_and_a_box_that_meet_in_flight_keep_their_angular_momentum(
    step: dict[str, float],
) -> None:
    """The box stands still in the air; the ball, which spins not, hits it away from its centre."""
    box = decks.cube(3, 2.0, 0.2, (0.0, 0.0, 1.0))
    parts = [
        text.sphere(2, 1.0, 0.1, (-0.613, 0.07, 1.04), (3.0, 0.2, 0.0)),
        box,
        text.contact(301, [200], [300], **decks.rubbed(0.3, 0.5)),
    ]
    results = run(parts, step, 0.25)
    moments = []
    for row in (0, -1):
        moment = np.zeros(3)
        for id, mass, inertia in ((2, 1.0, 0.004), (3, 2.0, 2.0 * 0.04 / 6.0)):
            x, v, w = (
                results[f"bodies/{id}/{name}"][row]
                for name in ("position", "velocity", "angular_velocity")
            )
            moment += mass * np.cross(x, v) + inertia * w
        moments.append(moment)
    off = 2e-5 if "h" in step else step["tol"]
    assert moments[1] == pytest.approx(moments[0], abs=off)
    assert np.linalg.norm(results["bodies/3/angular_velocity"][-1]) > 1.0
