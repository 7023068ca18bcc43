"""Decks with many expressions: nothing is compiled for any one of them."""

from __future__ import annotations

from helpers import free_bodies as free
from mbsim.compile_model.build import build
from mbsim.core import jit
from mbsim.expressions.parse import parse
from mbsim.model.elements import Marker, ScalarForce


def model_of(count):
    """Return a body that `count` forces of different expressions push, 2 N in all."""
    forces = [
        ScalarForce(
            k + 1,
            "TRANSLATIONAL",
            parse(f"{2 / count!r}*(1 + {k}*(DX(20,21) - DX(20,21)))"),
            i_marker_id=20,
            j_marker_id=21,
            action_only=True,
        )
        for k in range(count)
    ]
    ground = Marker(21, body_id=1)
    return free.model(free.body(2), markers=[ground], scalar_forces=forces, end_time=0.1)


def test_a_thousand_forces_compile_nothing_that_two_do_not():
    few, _ = free.run(model_of(2))
    before = jit.compile_seconds
    many, _ = free.run(model_of(1000))
    assert jit.compile_seconds == before
    # x = F t^2 / 2 m along the ground marker's z
    assert abs(many["y"][-1][2] - 0.01) < 1e-9
    assert abs(few["y"][-1][2] - 0.01) < 1e-9


def test_programs_grow_as_the_deck_does():
    sizes = [len(build(model_of(count)).scene.programs.quick) for count in (10, 1000)]
    assert sizes[1] == 100 * sizes[0]
