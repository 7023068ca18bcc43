"""Equal solids on each other: rims and corners that coincide carry the same however rounding lies.

Their common outline is that of either one, to rounding. A force that follows from which of the
two rounding leaves outside jumps, and steps fall to nothing.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
import trimesh

import mbsim
from mbsim.bench import deck as text
from mbsim.geometry.catalog import AT_DEPTH, AT_NORMAL, AT_POINT, AT_WEIGHT
from mbsim.geometry.pairs.revolution_pair import PAIR_ROWS, cylinder_cylinder

DEPTH, RADIUS = 4e-6, 0.1


def carried(offset: tuple[float, float], tilt: float) -> tuple[float, np.ndarray]:
    """Return force and torque for a stiffness of 1 of a cylinder that stands on an equal one."""
    cos, sin = math.cos(tilt), math.sin(tilt)
    upper = np.array([*offset, RADIUS - DEPTH, 1, 0, 0, 0, cos, -sin, 0, sin, cos])
    lower = np.array([0, 0, 0, 1, 0, 0, 0, 1.0, 0, 0, 0, 1])
    size, points = np.array([RADIUS, RADIUS / 2.0, 0.0, 0.0]), np.zeros((PAIR_ROWS + 1, 16))
    rows = points[: cylinder_cylinder(upper, size, lower, size, points)]
    rows = rows[(rows[:, AT_DEPTH] > 0.0) & (rows[:, AT_WEIGHT] > 0.0)]
    each = rows[:, AT_WEIGHT] * rows[:, AT_DEPTH]
    forces = each[:, None] * rows[:, AT_NORMAL : AT_NORMAL + 3]
    torque = np.cross(rows[:, AT_POINT : AT_POINT + 3], forces).sum(axis=0)
    return float(forces[:, 2].sum()), torque


@pytest.mark.parametrize("tilt", [0.0, 1e-12, 1e-9, 1e-7, 1e-5])
@pytest.mark.parametrize("way", [0.0, 1e-17, 1e-16, 1e-14, 1e-12, 1e-10, 1e-8])
def test_rims_that_coincide_carry_as_one(way: float, tilt: float) -> None:
    for angle in np.linspace(0.0, 2.0 * math.pi, 7):
        force, torque = carried((way * math.cos(angle), way * math.sin(angle)), tilt)
        assert force == pytest.approx(3.0 * DEPTH, rel=1e-4)
        # a tilted end is deeper on one side: 3 of the mean square of x over the rim
        assert np.abs(torque).max() < 3.0 * RADIUS**2 * tilt + 3.0 * DEPTH * way + 1e-13


def stacked(folder: Path, shape: str, count: int) -> str:
    """Return the deck of equal solids that stand on each other."""
    prism = trimesh.creation.cylinder(radius=RADIUS, height=RADIUS, sections=6)
    prism.export(folder / "prism.stl")
    parts, graphics = [text.GROUND, text.FLOOR], []
    for k in range(count):
        number, z = 2 + k, RADIUS * k
        middle = z + RADIUS / 2.0
        parts.append(text.body(number, 1.0, (3e-3, 3e-3, 5e-3), (0.0, 0.0, middle)))
        foot = middle if shape == "prism" else z
        parts.append(text.marker(10 * number + 1, number, (0.0, 0.0, foot)))
        size = text.attributes(type="Cylinder", radius=RADIUS, length=RADIUS)
        given = {
            "cylinder": f'{size} center_marker_id="{10 * number + 1}"',
            "prism": f'type="TriaMesh" file="prism.stl" rm_id="{10 * number + 1}"',
        }
        parts.append(f'<Post_Graphic id="{100 * number}" {given[shape]}/>')
        graphics.append(100 * number)
    law = text.impact(1e6, 1.0, 3e3, 1e-5) | text.coulomb(0.5, 1e-3)
    parts += [text.contact(301, graphics, [100], **law)]
    parts += [text.contact(302, graphics, graphics, **law), text.gravity()]
    path = folder / "stack.xml"
    path.write_text(text.deck("stack", parts, 0.02), encoding="utf-8")
    return str(path)


@pytest.mark.parametrize("shape", ["cylinder", "prism"])
def test_equal_solids_on_each_other_take_few_steps(tmp_path: Path, shape: str) -> None:
    results = mbsim.simulate(stacked(tmp_path, shape, 4), integrator="AUTO", tol=1e-4)
    assert results.stats["steps"] < 500
    assert np.abs(results["bodies/5/position"][:, :2]).max() < 1e-9


def test_prisms_that_coincide_carry_as_one(tmp_path: Path) -> None:
    deck = stacked(tmp_path, "prism", 2)
    with mbsim.open(deck, integrator="DOPRI5") as run:
        state = run.state
        start = np.array(state.arrays["method/y"])
        loads = []
        for way in (0.0, 1e-16, 1e-14, 1e-12, 1e-10, 1e-9):
            for angle in range(6):
                moved = state.copy()
                y = moved.arrays["method/y"]
                y[:] = start
                y[13:16] += (way * math.cos(angle), way * math.sin(angle), -1e-5)
                run.state = moved
                loads.append(float(run.signals["contacts/302/force"][2]))
    assert np.ptp(loads) < 1e-3 * np.abs(loads).max()


def test_a_box_half_beside_an_end_of_its_width_carries_as_beside_it(tmp_path: Path) -> None:
    """Corners lie on the rim there, and two edges only touch it: half a rim and two corners."""
    size = text.attributes(type="Cylinder", radius=RADIUS, length=RADIUS)
    sides = text.attributes(length_x=2.0 * RADIUS, length_y=2.0 * RADIUS, length_z=RADIUS)
    loads = []
    for way in (-1e-7, -1e-12, 0.0, 1e-12, 1e-7):
        place = (RADIUS + way, 0.0, 1.5 * RADIUS - DEPTH)
        parts = [
            text.GROUND,
            text.marker(11, 1, (0.0, 0.0, 0.0)),
            f'<Post_Graphic id="100" center_marker_id="11" {size}/>',
            text.body(2, 1.0, (3e-3, 3e-3, 5e-3), place),
            text.marker(21, 2, place),
            f'<Post_Graphic id="200" type="BoxDefinedFromCenter" center_marker_id="21" {sides}/>',
            text.contact(301, [200], [100], **text.impact(1e6, 1.0, 0.0, 1e-3)),
        ]
        path = tmp_path / "box.xml"
        path.write_text(text.deck("box", parts, 1.0), encoding="utf-8")
        with mbsim.open(str(path), integrator="DOPRI5") as run:
            loads.append(float(run.signals["contacts/301/force"][2]))
    assert loads == pytest.approx([3.5 * 1e6 * DEPTH] * 5, rel=1e-2)
