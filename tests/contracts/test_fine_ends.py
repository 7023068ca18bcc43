"""Cylinders as meshes of many sides, as CAD systems write them: standing, and on their like.

Their ends have more corners than a pair has points, and one corner in the middle where all
triangles meet. Which corner is deepest, and which triangles meet over a corner, rounding tells.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh

import mbsim
from helpers.pairs import frame, turned
from helpers.surfaces import Meshed, box, call, incidents, wrench
from mbsim.bench import deck as text
from mbsim.bench.parameters import GRAVITY
from mbsim.geometry.catalog import REGION_ROWS

RADIUS, HEIGHT, DEPTH = 0.1, 0.1, 1e-5
LAW = text.impact(1e6, 1.0, 3e3, 1e-5) | text.coulomb(0.5, 1e-3)


def cylinder(sides: int) -> trimesh.Trimesh:
    """Return an upright prism about its middle whose ends are fans of triangles."""
    return trimesh.creation.cylinder(radius=RADIUS, height=HEIGHT, sections=sides)


def stack(folder: Path, sides: int, count: int) -> str:
    """Return the deck of a stack of equal prisms on a plane."""
    cylinder(sides).export(folder / "cylinder.stl")
    parts, graphics = [text.GROUND, text.FLOOR], []
    for k in range(count):
        number = 2 + k
        parts.append(text.body(number, 1.0, (3e-3, 3e-3, 5e-3), (0.0, 0.0, HEIGHT * (0.5 + k))))
        parts.append(
            f'<Post_Graphic id="{100 * number}" type="TriaMesh" file="cylinder.stl" '
            f'rm_id="{10 * number}"/>'
        )
        graphics.append(100 * number)
    parts.append(text.contact(301, graphics, [100], **LAW))
    if count > 1:
        parts.append(text.contact(302, graphics, graphics, **LAW))
    path = folder / "stack.xml"
    path.write_text(text.deck("stack", [*parts, text.gravity()], 0.03), encoding="utf-8")
    return str(path)


@pytest.mark.parametrize("sides", [33, 40, 65, 96])
def test_a_fine_cylinder_stands_in_few_steps(tmp_path: Path, sides: int) -> None:
    """That of 40 sides took 3497 steps, now 16: two corners of one point took turns."""
    results = mbsim.simulate(stack(tmp_path, sides, 1), integrator="RADAU5")
    assert results.stats["steps"] < 60
    assert results["contacts/301/force"][-1] == pytest.approx([0.0, 0.0, GRAVITY], abs=1e-2)
    assert np.abs(results["bodies/2/position"][:, :2]).max() < 1e-9


def test_equal_fine_cylinders_on_each_other_take_few_steps(tmp_path: Path) -> None:
    """They did not come to an end within minutes."""
    results = mbsim.simulate(stack(tmp_path, 40, 2), integrator="RADAU5")
    assert results.stats["steps"] < 60
    assert abs(results["contacts/302/force"][-1, 2]) == pytest.approx(GRAVITY, abs=1e-2)


@pytest.mark.parametrize("sides", [33, 40, 96])
def test_a_tilt_of_a_standing_end_turns_no_force(tmp_path: Path, sides: int) -> None:
    """The righting moment is the slope of an energy, with no jump where it stands upright."""
    with mbsim.open(stack(tmp_path, sides, 1), integrator="DOPRI5") as run:
        state = run.state
        start = np.array(state.arrays["method/y"])
        found = []
        for tilt in (0.0, 1e-16, 1e-14, 1e-12, 1e-10):
            for way in np.linspace(0.0, 2.0 * np.pi, 9):
                moved = state.copy()
                y = moved.arrays["method/y"]
                y[:] = start
                y[2] -= DEPTH
                y[3:7] = (1.0, 0.5 * tilt * np.cos(way), 0.5 * tilt * np.sin(way), 0.0)
                run.state = moved
                spin = run.signals["bodies/2/acceleration"]
                torque = run.signals["contacts/301/torque"]
                found.append((tilt, np.concatenate([spin, np.asarray(torque) / RADIUS])))
        at_rest = found[0][1]
        for tilt, value in found:
            assert np.abs(value - at_rest).max() < (1e-9 + 10.0 * tilt * RADIUS / DEPTH) * 40.0


SAME = np.eye(3)
STEP = 2.0 * np.pi / 40
#: Where one stands on the other: on its like, turned by a side, on a corner of a box, one aside.
PLACES = {
    "equal": (0.0, 0.0, 0.0),
    "turned": (0.0, 0.0, STEP),
    "corner in the middle": (RADIUS, 0.0, 0.0),
    "corner beside": (RADIUS * (1.0 - np.cos(STEP)), RADIUS * np.sin(STEP), 0.0),
}


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("sides", [40, 96])
def test_corners_on_corners_are_no_incidents_of_their_own(sides: int, place: str) -> None:
    """Pieces of 1e-35 m^2 had the whole force of the law each: up to 5 of it, or -1."""
    made = cylinder(sides)
    mesh = Meshed(made.vertices, made.faces)
    block = Meshed(*box(2.0 * RADIUS, 2.0 * RADIUS, HEIGHT))
    x, y, yaw = PLACES[place]
    rng = np.random.default_rng(1)
    for other in (mesh, block):
        for k in range(25):
            away = 1e-16 * rng.normal(size=2) * (k > 0)
            tilt = turned(rng.normal(size=3), 1e-15 * rng.normal() * (k > 5))
            turn = tilt @ turned((0.0, 0.0, 1.0), yaw)
            at = np.array([x + away[0], y + away[1], HEIGHT - DEPTH])
            upper, lower = frame(at, turn), frame(np.zeros(3), SAME)
            rows = call("SURFACE-SURFACE", upper, mesh.size, lower, other.size)
            assert len(incidents(rows)[0]) == 1
            assert wrench(rows, REGION_ROWS)[2] == pytest.approx(DEPTH, rel=1e-6)
