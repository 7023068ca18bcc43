"""Force_Gravity by expressions of TIME, in the model and between simulations."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from helpers import free_bodies as free
from helpers.minimal_deck import deck, read
from mbsim.errors import DeckError
from mbsim.expressions.parse import parse
from mbsim.model.elements import Gravity, Simulation

GRAVITY = '<Force_Gravity grav_z="-9.81"/>'


def test_a_body_falls_under_gravity_over_time_and_constant_gravity():
    gravity = Gravity((0.5, 0.0, 0.0), exprs=(None, parse("SIN(TIME)"), parse("-2*4")))
    model = replace(free.model(free.body(2, 1.5), end_time=2.0), gravity=gravity)
    rows, runner = free.run(model)
    t = rows["time"]
    exact = np.column_stack((0.25 * t**2, t - np.sin(t), -4 * t**2))
    np.testing.assert_allclose(rows["y"][:, :3], exact, atol=1e-8)
    # a constant expression is a number and has a potential
    np.testing.assert_array_equal(runner.system.scene.world.gravity, [0.5, 0.0, -8.0])
    potential = -1.5 * (0.5 * exact[:, 0] - 8.0 * exact[:, 2])
    np.testing.assert_allclose(rows["energy"][:, 1], potential, atol=1e-6)
    total = rows["energy"][:, :3].sum(axis=1)
    np.testing.assert_allclose(total, total[0], atol=1e-6)


def test_gravity_changes_between_simulations_to_an_expression_and_back():
    stages = (
        Simulation(end_time=1.0, print_interval=0.1),
        Simulation("TRANSIENT", 1.0, 2.0, 0.1, gravity=Gravity(exprs=(None, None, parse("TIME")))),
        Simulation("TRANSIENT", 2.0, 3.0, 0.1, gravity=Gravity((0.0, 0.0, -2.0))),
    )
    model = replace(free.model(free.body(2), g=(0, 0, -1)), simulations=stages)
    rows, _ = free.run(model)
    v = rows["y"][:, 9]
    t = rows["time"]
    exact = np.where(t <= 1, -t, np.where(t <= 2, -1 + (t**2 - 1) / 2, 0.5 - 2 * (t - 2)))
    np.testing.assert_allclose(v, exact, atol=1e-8)


def test_a_deck_gives_numbers_or_expressions_of_time(tmp_path):
    text = '<Force_Gravity grav_x="1.5" grav_z="-9.81*STEP(TIME,0,0,1,1)"/>'
    gravity = read(tmp_path, deck((GRAVITY, text))).gravity
    assert gravity.g == (1.5, 0.0, 0.0)
    assert gravity.exprs[:2] == (None, None)
    assert gravity.exprs[2].text == "-9.81*STEP(TIME,0,0,1,1)"


@pytest.mark.parametrize(("given", "said"), [("DX(20)", "uses DX"), ("1+", "no expression")])
def test_gravity_that_is_no_expression_of_time_is_refused(tmp_path, given, said):
    with pytest.raises(DeckError, match="grav_y") as error:
        read(tmp_path, deck((GRAVITY, f'<Force_Gravity grav_y="{given}"/>')))
    assert said in str(error.value)
