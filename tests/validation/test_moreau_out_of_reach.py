"""MOREAU in fixed steps: a motion beyond what a mechanism can reach ends the run there."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

import mbsim
from helpers import rigid_decks as decks
from mbsim.bench import deck as text
from mbsim.errors import SolverError
from mbsim.model.elements import Model

#: Axes of a marker whose z is along global x.
ALONG_X = ((0.0, 0.0, 1.0), (0.0, 1.0, 0.0), (-1.0, 0.0, 0.0))


def slider_crank(folder: Path, link: float, h: float, scale: float = 1.0) -> Model:
    """Return a crank of length 1, times `scale`, that a motion turns at 1/s, beside a ball.

    It starts stretched along x. A link shorter than the crank cannot follow beyond sin(t) = link.
    """
    crank, end, turns = scale, scale * (1.0 + link), (0.1 * scale**2,) * 3
    parts = [
        text.body(2, 1.0, turns, (0.5 * crank, 0.0, scale)),
        text.body(3, 1.0, turns, (crank + 0.5 * scale * link, 0.0, scale)),
        text.body(4, 1.0, turns, (end, 0.0, scale)),
        *(text.marker(number, number // 10, (0.0, 0.0, scale)) for number in (11, 21)),
        *(text.marker(number, number // 10, (crank, 0.0, scale)) for number in (22, 31)),
        *(text.marker(number, number // 10, (end, 0.0, scale)) for number in (32, 41)),
        *(text.marker(number, number // 10, (end, 0.0, scale), ALONG_X) for number in (12, 42)),
        text.joint(1, "REVOLUTE", 21, 11),
        text.joint(2, "REVOLUTE", 31, 22),
        text.joint(3, "SPHERICAL", 41, 32),
        text.joint(4, "TRANSLATIONAL", 42, 12),
        '<Motion_Joint id="1" joint_id="1" val_type="D" type="EXPRESSION" expr="TIME"/>',
        text.sphere(5, 1.0, 0.1 * scale, (0.0, 5.0 * scale, 0.1 * scale)),
        text.contact(301, [500], [100], **decks.rubbed(0.5)),
        text.gravity(),
    ]
    return decks.model(folder, parts, 3.0, h, 0.1)


@pytest.mark.parametrize("h", [5e-2, 1e-2, 1e-3])
@pytest.mark.parametrize(("link", "scale"), [(0.8, 1.0), (0.999, 1.0), (0.8, 1e-3), (0.8, 1e3)])
def test_a_link_that_is_too_short_ends_the_run(
    tmp_path: Path, link: float, scale: float, h: float
) -> None:
    with pytest.raises(SolverError) as error:
        mbsim.simulate(slider_crank(tmp_path, link, h, scale), integrator="MOREAU")
    said = str(error.value)
    assert "Constraint_Joint[3]" in said
    time = float(said.split("from time ")[1].split()[0])
    # less than 10 tol of its length is not seen
    assert math.asin(link) - h < time <= math.asin(link + 1e-3) + h


@pytest.mark.parametrize("h", [0.1, 1e-2, 1e-3])
@pytest.mark.parametrize("link", [1.0, 1.001, 1.2])
def test_a_link_that_is_long_enough_goes_on(tmp_path: Path, link: float, h: float) -> None:
    """One as long as the crank goes straight through its fold, at a quarter of a turn."""
    results = mbsim.simulate(slider_crank(tmp_path, link, h), integrator="MOREAU")
    end = math.cos(3.0) + math.sqrt(link**2 - math.sin(3.0) ** 2)
    if link == 1.0:
        end = 2.0 * math.cos(3.0)
    assert results["bodies/4/position"][-1, 0] == pytest.approx(end, abs=1e-9)
