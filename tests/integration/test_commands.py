"""Several Simulates in sequence, with commands between them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import mbsim
from mbsim.errors import DeckError, Interrupted

EARTH = '<Body_Rigid id="1" isground="TRUE"/><Reference_Marker id="10" body_id="1"/>'
BODY = """<Body_Rigid id="2" cg_id="20" mass="2" inertia_xx="1" inertia_yy="1" inertia_zz="1"/>
<Reference_Marker id="20" body_id="2" pos_z="-1"/>"""
SPRING = """<Force_SpringDamper id="7" type="TRANSLATIONAL" i_marker_id="20" j_marker_id="10"
 stiffness="100" damping="0.5" length="0.8"/>"""
PUSH = """<Force_Scalar_TwoBody id="8" type="TRANSLATIONAL" i_marker_id="20" j_marker_id="10"
 expr="VARVAL(9)"/><Reference_Variable id="9" expr="2*TIME"/>"""
MODEL = EARTH + BODY + SPRING + PUSH


def simulate(end, interval=0.1):
    """Return a Simulate."""
    return f'<Simulate analysis_type="Transient" end_time="{end}" print_interval="{interval}"/>'


def read(folder, commands, model=MODEL, overrides=()):
    """Return the model of a deck."""
    path = Path(folder) / "deck.xml"
    path.write_text(f"<Deck><Model>{model}</Model>\n<Command>\n{commands}\n</Command></Deck>")
    return mbsim.read_model(path, overrides)


CHANGED = '<Force_SpringDamper id="7" stiffness="250"/>\n'


def test_a_changed_spring_is_another_model_from_there_on(tmp_path):
    """As the model with the new spring, begun with the state in which the first part ended."""
    both = mbsim.simulate(read(tmp_path, simulate(1) + CHANGED + simulate(2)), tol=1e-10)
    first = mbsim.simulate(read(tmp_path, simulate(1)), tol=1e-10)
    z, v = (first[f"bodies/2/{name}"][-1, 2] for name in ("position", "velocity"))
    again = EARTH + BODY.replace('pos_z="-1"', f'pos_z="{float(z)!r}"') + SPRING + PUSH
    again = again.replace('mass="2"', f'mass="2" v_ic_z="{float(v)!r}" v_ic_z_flag="TRUE"')
    again = again.replace('stiffness="100"', 'stiffness="250"').replace("2*TIME", "2*(TIME+1)")
    second = mbsim.simulate(read(tmp_path, simulate(1), again), tol=1e-10)
    kept = first["bodies/2/position"][:, 2]
    assert both["bodies/2/position"][:10, 2] == pytest.approx(kept[:10], abs=1e-9)
    assert both["bodies/2/position"][10:, 2] == pytest.approx(
        second["bodies/2/position"][:, 2], abs=1e-9
    )
    assert len(both["time"]) == 21


def test_expressions_change_through_variables(tmp_path):
    """A longer expression than before, with other constants."""
    change = '<Reference_Variable id="9" expr="2*TIME + 3*SIN(4*TIME)"/>'
    both = mbsim.simulate(read(tmp_path, change + simulate(1)), tol=1e-10)
    model = MODEL.replace('expr="2*TIME"', 'expr="2*TIME + 3*SIN(4*TIME)"')
    one = mbsim.simulate(read(tmp_path, simulate(1), model), tol=1e-10)
    assert np.array_equal(both["bodies/2/position"], one["bodies/2/position"])


def test_static_takes_the_changed_spring(tmp_path):
    """Equilibria of two springs: k x = m g + F; TIME stands still at 0."""
    gravity = '<Force_Gravity grav_z="-10"/>'
    deck = read(tmp_path, CHANGED + '<Simulate analysis_type="Static"/>', MODEL + gravity)
    z = mbsim.simulate(deck)["bodies/2/position"][-1, 2]
    assert z == pytest.approx(-(0.8 + 20.0 / 250.0), abs=1e-12)


@pytest.mark.parametrize(
    ("statement", "said"),
    [
        ('<Force_SpringDamper id="70" stiffness="1"/>', "changes no element"),
        ('<Force_SpringDamper id="7" i_marker_id="10"/>', "cannot change between simulations"),
        ('<Force_SpringDamper id="7" stiffness="-3"/>', 'stiffness="-3": must be'),
        ('<Reference_Variable id="9" expr="TIME+"/>', "expr"),
        ('<Body_Rigid id="2" mass="3"/>', "belongs in <Model>"),
    ],
)
def test_a_change_that_cannot_be_is_refused_with_its_line(tmp_path, statement, said):
    """The line is that of the command."""
    with pytest.raises(DeckError) as error:
        read(tmp_path, simulate(1) + "\n" + statement + "\n" + simulate(2))
    assert said in str(error.value)
    # behind the model's lines stand <Command> and the first Simulate
    assert f":{MODEL.count(chr(10)) + 4}:" in str(error.value)


def test_resume_in_the_second_part_is_bit_equal(tmp_path):
    """The change before the interruption holds again."""
    commands = simulate(1, 0.01) + CHANGED + simulate(2, 0.01)
    deck = read(tmp_path, commands)
    whole = mbsim.simulate(deck, output=tmp_path / "whole")
    runner = {}

    def stop(t, h, end):
        if t > 1.2 and not runner:
            runner["stopped"] = t
            raise KeyboardInterrupt

    from mbsim import simulation

    before = simulation.RETURN_SECONDS, simulation.FIRST_BUDGET
    simulation.RETURN_SECONDS, simulation.FIRST_BUDGET = 1e-5, 5
    try:
        with pytest.raises((KeyboardInterrupt, Interrupted)):
            mbsim.simulate(deck, output=tmp_path / "part", progress=stop)
    finally:
        simulation.RETURN_SECONDS, simulation.FIRST_BUDGET = before
    rest = mbsim.simulate(deck, output=tmp_path / "part", resume=True)
    assert runner["stopped"] < 2.0
    assert np.array_equal(whole["bodies/2/position"], rest["bodies/2/position"])
