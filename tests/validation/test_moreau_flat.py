"""MOREAU: what lies on ends, sides and faces rests, and a train of cylinders stays in line.

Bodies that a rounding tilts touch at one end of a line or at one corner. Held there alone they turn
about it until the other end is deep: stacks toppled, and logs rolled apart.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
import trimesh

import mbsim
from helpers import rigid_decks as decks
from mbsim.bench import deck as text
from mbsim.bench.daily import TRAIN
from mbsim.bench.scenes import s15_cylinder_train as train
from mbsim.results.reading import Results

#: Axes of a marker whose z is along global y, as a log lies.
ALONG_Y = ((1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.0, -1.0, 0.0))
#: Half the width of what is stacked, and its height over that.
HALF, HIGH = 0.1, {"disc": 0.02}


def shape(folder: Path, kind: str, graphic: int, marker: int, size: float, height: float) -> str:
    """Return a shape that stands on its marker; a prism's is in its middle."""
    file = ""
    if kind == "cylinder" or kind == "disc":
        given = text.attributes(type="Cylinder", radius=size, length=height)
    elif kind == "frustum":
        sizes = {"bottom_radius": size, "top_radius": 0.8 * size, "length": height}
        given = text.attributes(type="Frustum", **sizes)
    elif kind == "box":
        sizes = {"length_x": 2.0 * size, "length_y": 2.0 * size, "length_z": height}
        given = text.attributes(type="BoxDefinedFromCenter", **sizes)
    else:
        prism = trimesh.creation.cylinder(radius=size, height=height, sections=6)
        prism.export(folder / "prism.stl")
        given, file = 'type="TriaMesh"', 'file="prism.stl"'
    place = "rm_id" if kind == "prism" else "center_marker_id"
    return f'<Post_Graphic id="{graphic}" {given} {place}="{marker}" {file}/>'


def stack(folder: Path, kinds: list[str], scale: float, h: float) -> tuple[Results, float]:
    """Return the run of a stack, each body a hundredth of its width beside the one below."""
    parts, graphics, z = [], [], 0.0
    for k, kind in enumerate(kinds):
        number, size = 2 + k, scale * HALF
        height = scale * HIGH.get(kind, HALF)
        at = (0.02 * size * k, 0.0, z + height / 2.0)
        turns = (size * size / 4.0 + height * height / 12.0,) * 2 + (size * size / 2.0,)
        middle = kind in ("box", "prism")
        foot = at if middle else (at[0], at[1], z)
        parts += [
            text.body(number, 1.0, turns, at),
            text.marker(10 * number + 1, number, foot),
            shape(folder, kind, 100 * number, 10 * number + 1, size, height),
        ]
        graphics.append(100 * number)
        z += height
    law = decks.rubbed(0.5)
    parts += [text.contact(301, graphics, [100], **law)]
    parts += [text.contact(302, graphics, graphics, **law), text.gravity()]
    model = decks.model(folder, parts, 100.0 * h, h, h)
    return mbsim.simulate(model, integrator="MOREAU", tol=1e-4), scale


def moved(results: Results, count: int) -> float:
    """Return how far the farthest body comes from where it was."""
    places = [np.asarray(results[f"bodies/{2 + k}/position"]) for k in range(count)]
    return max(float(np.abs(place - place[0]).max()) for place in places)


@pytest.mark.parametrize(
    "kinds",
    [
        ["cylinder"] * 6,
        ["prism"] * 6,
        ["frustum", "cylinder", "cylinder"],
        ["cylinder", "box"] * 3,
        ["box", "cylinder"] * 3,
        ["prism", "box"] * 3,
        ["disc"] * 6,
        ["prism", "cylinder"] * 3,
        ["cylinder", "prism"] * 3,
        ["prism", "frustum", "prism"],
    ],
    ids="-".join,
)
@pytest.mark.parametrize("h", [1e-2, 5e-3])
def test_a_stack_rests(tmp_path: Path, kinds: list[str], h: float) -> None:
    results, scale = stack(tmp_path, kinds, 1.0, h)
    assert moved(results, len(kinds)) < 2e-3 * HALF * scale
    load = results["contacts/301/force"][-20:, 2].mean()
    assert load == pytest.approx(len(kinds) * 9.81, rel=1e-2)


@pytest.mark.parametrize("scale", [1e-3, 100.0])
def test_a_stack_of_any_size_rests(tmp_path: Path, scale: float) -> None:
    results, _ = stack(
        tmp_path, ["cylinder", "cylinder", "box", "cylinder"], scale, 1e-2 * math.sqrt(scale)
    )
    assert moved(results, 4) < 2e-3 * HALF * scale


def test_a_pile_of_logs_rests(tmp_path: Path) -> None:
    parts, graphics, radius, length = [], [], 0.1, 0.3
    places = [(row, i) for row in range(4) for i in range(4 - row)]
    for number, (row, i) in enumerate(places, 2):
        x, z = (2 * i + row) * radius, radius * (1.0 + row * math.sqrt(3.0))
        along, across = radius**2 / 2.0, radius**2 / 4.0 + length**2 / 12.0
        size = text.attributes(type="Cylinder", radius=radius, length=length)
        parts += [
            text.body(number, 1.0, (across, along, across), (x, 0.0, z)),
            text.marker(10 * number + 1, number, (x, -length / 2.0, z), ALONG_Y),
            f'<Post_Graphic id="{100 * number}" center_marker_id="{10 * number + 1}" {size}/>',
        ]
        graphics.append(100 * number)
    for marker, x, side in ((15, -radius, 1.0), (16, 7.0 * radius, -1.0)):
        wall = ((0.0, 0.0, side), (0.0, 1.0, 0.0), (-side, 0.0, 0.0))
        parts += [text.marker(marker, 1, (x, 0.0, 0.0), wall)]
        parts += [f'<Post_Graphic id="{marker + 90}" type="Plane" rm_id="{marker}"/>']
    law = decks.rubbed(0.5)
    parts += [text.contact(301, graphics, [100, 105, 106], **law)]
    parts += [text.contact(302, graphics, graphics, **law), text.gravity()]
    model = decks.model(tmp_path, parts, 1.0, 1e-2, 1e-2)
    results = mbsim.simulate(model, integrator="MOREAU", tol=1e-4)
    assert moved(results, len(places)) < 1e-4 * radius


def out_of_line(h: float) -> float:
    """Return how far the axis of a cylinder of the train turns out of its line at most."""
    results = mbsim.simulate(train._deck({"h": h}), integrator="MOREAU", tol=1e-4)
    most = 0.0
    for number in range(2, 12):
        w, x, y, z = np.asarray(results[f"bodies/{number}/quaternion"]).T
        most = max(most, float(np.hypot(2.0 * (x * y - w * z), 2.0 * (y * z + w * x)).max()))
    return most


@pytest.mark.parametrize("tol", [1e-2, 1e-3])
@pytest.mark.parametrize("h", [0.01, 0.008, 0.0055, 0.003])
def test_cylinders_that_pile_up_do_not_turn_into_each_other(h: float, tol: float) -> None:
    """One end was hit, and the other one came down within the step, up to 0.14 m deep.

    It was no point of the step, which turned the cylinder by what kept the first end out.
    """
    results = mbsim.simulate(train._deck({"h": h}), integrator="MOREAU", tol=tol)
    assert results.audit.warnings == ()
    assert results["contacts/302/peak_penetration"] < 0.01 * TRAIN.radius


@pytest.mark.parametrize("h", [1e-2, 5e-3, 2e-3])
def test_a_train_of_cylinders_stays_in_line(h: float) -> None:
    """That is unstable: what the solver leaves grows from impact to impact, so five runs decide."""
    turns = [out_of_line(h * (1.0 + part)) for part in (0.0, 1e-9, 1e-7, 1e-5, 1e-3)]
    assert np.median(turns) < 5e-3


def slab(folder: Path, kind: str, sides: tuple[float, float, float]) -> str:
    """Return a slab of ground whose top is at z = 0, as a box or as a convex mesh."""
    if kind == "box":
        names = ("length_x", "length_y", "length_z")
        given = text.attributes(**dict(zip(names, sides, strict=True)))
        graphic = f'type="BoxDefinedFromCenter" center_marker_id="15" {given}'
    else:
        trimesh.creation.box(sides).export(folder / "slab.stl")
        graphic = 'type="TriaMesh" rm_id="15" file="slab.stl"'
    return text.marker(15, 1, (0.0, 0.0, -0.5 * sides[2])) + f'<Post_Graphic id="105" {graphic}/>'


@pytest.mark.parametrize("kind", ["box", "mesh"])
@pytest.mark.parametrize(("h", "tol", "allowed"), [(2e-3, 1e-3, 5e-5), (None, 1e-5, 1e-5)])
def test_a_cylinder_rolls_down_a_slab(
    tmp_path: Path, h: float | None, tol: float, allowed: float, kind: str
) -> None:
    """A solid cylinder that rolls is accelerated by 2/3 of what pulls along the slope."""
    radius, length, tilt = 0.1, 0.3, 0.2
    along, across = radius**2 / 2.0, radius**2 / 4.0 + length**2 / 12.0
    size = text.attributes(type="Cylinder", radius=radius, length=length)
    parts = [
        slab(tmp_path, kind, (20.0, 4.0, 1.0)),
        text.body(2, 1.0, (across, along, across), (0.0, 0.0, radius)),
        text.marker(21, 2, (0.0, -length / 2.0, radius), ALONG_Y),
        f'<Post_Graphic id="200" center_marker_id="21" {size}/>',
        text.contact(301, [200], [105], **decks.rubbed(0.5)),
        text.gravity(9.81 * math.sin(tilt), -9.81 * math.cos(tilt)),
    ]
    results = mbsim.simulate(decks.model(tmp_path, parts, 1.0, h), integrator="MOREAU", tol=tol)
    way = np.asarray(results["bodies/2/position"])[-1]
    assert way[0] == pytest.approx(0.5 * 2.0 / 3.0 * 9.81 * math.sin(tilt), abs=allowed)
    assert np.abs(way[1:] - (0.0, radius)).max() < 1e-7


@pytest.mark.parametrize("kind", ["box", "mesh"])
@pytest.mark.parametrize(("over", "holds"), [(0.095, True), (0.105, False)])
def test_a_cylinder_over_an_edge_stands_or_falls(
    tmp_path: Path, kind: str, over: float, holds: bool
) -> None:
    """Its end lies on a slab 0.2 wide: what is over the edge may be just less than a half."""
    radius, height = 0.2, 0.1
    size = text.attributes(type="Cylinder", radius=radius, length=height)
    turns = (radius**2 / 4.0 + height**2 / 12.0,) * 2 + (radius**2 / 2.0,)
    parts = [
        slab(tmp_path, kind, (0.2, 1.0, 0.5)),
        text.body(2, 1.0, turns, (over, 0.0, 0.5 * height)),
        text.marker(21, 2, (over, 0.0, 0.0)),
        f'<Post_Graphic id="200" center_marker_id="21" {size}/>',
        text.contact(301, [200], [105], **decks.rubbed(0.5)),
        text.gravity(),
    ]
    results = mbsim.simulate(decks.model(tmp_path, parts, 1.0, 2e-3), integrator="MOREAU")
    assert (moved(results, 1) < 1e-4 * radius) == holds


@pytest.mark.parametrize("sections", [5, 12, 13, 64])
@pytest.mark.parametrize("shape", ["cylinder", "frustum"])
def test_an_end_on_a_prism_stands(tmp_path: Path, sections: int, shape: str) -> None:
    """A prism of any number of corners under an end that is wider, or as wide."""
    trimesh.creation.cylinder(radius=0.1, height=0.3, sections=sections).export(
        tmp_path / "prism.stl"
    )
    for radius in (0.1, 0.15):
        if shape == "cylinder":
            size = text.attributes(type="Cylinder", radius=radius, length=0.2)
        else:
            sizes = {"bottom_radius": radius, "top_radius": 0.05, "length": 0.2}
            size = text.attributes(type="Frustum", **sizes)
        parts = [
            text.marker(15, 1, (0.0, 0.0, -0.15)),
            '<Post_Graphic id="105" type="TriaMesh" rm_id="15" file="prism.stl"/>',
            text.body(2, 1.0, (0.01, 0.01, 0.01), (0.05, 0.0, 0.1)),
            text.marker(21, 2, (0.05, 0.0, 0.0)),
            f'<Post_Graphic id="200" center_marker_id="21" {size}/>',
            text.contact(301, [200], [105], **decks.rubbed(0.5)),
            text.gravity(),
        ]
        results = mbsim.simulate(decks.model(tmp_path, parts, 0.5, 5e-3), integrator="MOREAU")
        assert moved(results, 1) < 1e-4 * radius
