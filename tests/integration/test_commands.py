"""Several Simulates in sequence, with commands between them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import mbsim
from helpers.decks import EARTH
from helpers.folders import MODELS
from mbsim.errors import DeckError, Interrupted, ModelError

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

    from mbsim.run import divergence, loop

    before = divergence.RETURN_SECONDS, loop.FIRST_BUDGET
    divergence.RETURN_SECONDS, loop.FIRST_BUDGET = 1e-5, 5
    try:
        with pytest.raises((KeyboardInterrupt, Interrupted)):
            mbsim.simulate(deck, output=tmp_path / "part", progress=stop)
    finally:
        divergence.RETURN_SECONDS, loop.FIRST_BUDGET = before
    rest = mbsim.simulate(deck, output=tmp_path / "part", resume=True)
    assert runner["stopped"] < 2.0
    assert np.array_equal(whole["bodies/2/position"], rest["bodies/2/position"])


BALL = """<Body_Rigid id="3" cg_id="30" mass="0.5" inertia_xx="0.002" inertia_yy="0.002"
 inertia_zz="0.002" v_ic_x="1" v_ic_x_flag="TRUE"/>
<Reference_Marker id="30" body_id="3" pos_x="2" pos_z="0.12"/>
<Post_Graphic id="300" type="Sphere" center_marker_id="30" radius="0.1"/>
<Post_Graphic id="100" type="Plane" rm_id="10"/>"""
LAWS = {
    "IMPACT": 'cnf_type="Impact" stiffness="1e4" exponent="1.5" damping="10" dmax="1e-3"',
    "POISSON": 'cnf_type="Poisson" penalty="1e4" restitution_coef="0.5" normal_trans_vel="0.01"',
    "HUNT": """cnf_type="HUNT_CROSSLEY" stiffness="1e4" exponent="1.5" damping="10"
 restitution_coef="0.5" """,
}
FRICTION = """cff_type="COULOMB_ON" mu_static="0.5" mu_dynamic="0.3" stiction_trans_vel="0.01"
 friction_trans_vel="0.02" """
SLIDER = """<Reference_Marker id="22" body_id="2" pos_z="-1"/>
<Reference_Marker id="12" body_id="1" pos_z="-1"/>
<Constraint_Joint id="4" type="CYLINDRICAL" i_marker_id="22" j_marker_id="12"/>"""
JOINT_FRICTION = """<Force_JointFriction id="5" joint_id="4" cff_type="COULOMB_ON" mu_static="0.5"
 mu_dynamic="0.3" stiction_trans_vel="0.01" friction_trans_vel="0.02" pin_radius="0.1"
 preload="20"/>"""
STOP = """<Force_JointLimit id="6" joint_id="4" motion_type="T" lower="-0.02" upper="0.02"
 cnf_type="IMPACT" stiffness="1e4" exponent="1.5" damping="5" dmax="1e-3"/>"""
DRIVE = """<Motion_Joint id="7" joint_id="4" motion_type="R" val_type="D" expr="SIN(TIME)"/>"""
FALL = '<Force_Gravity grav_x="0.3" grav_z="-9.81"/>'


def touch(law, more=FRICTION):
    """Return a ball over a plane."""
    return f"""{EARTH}{BALL}{FALL}<Force_Contact id="1" num_i_graphics="1" i_graphics_id="300"
 num_j_graphics="1" j_graphics_id="100" {LAWS[law]} {more}/>"""


MOVING = BODY.replace("/>", ' v_ic_z="0.5" v_ic_z_flag="TRUE" w_ic_z="2" w_ic_z_flag="TRUE"/>', 1)
SLIDES = EARTH + MOVING + SPRING + PUSH + SLIDER + JOINT_FRICTION + STOP + FALL


@pytest.mark.parametrize(
    ("model", "statement", "name", "before", "after"),
    [
        (touch("IMPACT"), 'Force_Contact id="1"', "stiffness", "1e4", "3e4"),
        (touch("IMPACT"), 'Force_Contact id="1"', "exponent", "1.5", "1.3"),
        (touch("IMPACT"), 'Force_Contact id="1"', "damping", "10", "2"),
        (touch("IMPACT"), 'Force_Contact id="1"', "dmax", "1e-3", "5e-3"),
        (touch("IMPACT"), 'Force_Contact id="1"', "mu_static", "0.5", "0.35"),
        (touch("IMPACT"), 'Force_Contact id="1"', "mu_dynamic", "0.3", "0.1"),
        (touch("IMPACT"), 'Force_Contact id="1"', "stiction_trans_vel", "0.01", "0.015"),
        (touch("IMPACT"), 'Force_Contact id="1"', "friction_trans_vel", "0.02", "0.9"),
        (touch("POISSON"), 'Force_Contact id="1"', "penalty", "1e4", "2e4"),
        (touch("POISSON"), 'Force_Contact id="1"', "restitution_coef", "0.5", "0.8"),
        (touch("POISSON"), 'Force_Contact id="1"', "normal_trans_vel", "0.01", "0.5"),
        (SLIDES, 'Force_SpringDamper id="7"', "damping", "0.5", "5"),
        (SLIDES, 'Force_SpringDamper id="7"', "length", "0.8", "0.9"),
        (SLIDES, 'Force_Scalar_TwoBody id="8"', "expr", "VARVAL(9)", "3*VARVAL(9) - VZ(20)"),
        (SLIDES, 'Force_JointFriction id="5"', "mu_dynamic", "0.3", "0.1"),
        (SLIDES, 'Force_JointFriction id="5"', "preload", "20", "5"),
        (SLIDES, 'Force_JointFriction id="5"', "pin_radius", "0.1", "0.3"),
        (SLIDES, 'Force_JointLimit id="6"', "upper", "0.02", "0.01"),
        (SLIDES, 'Force_JointLimit id="6"', "lower", "-0.02", "0.005"),
        (SLIDES, 'Force_JointLimit id="6"', "stiffness", "1e4", "3e4"),
        (SLIDES + DRIVE, 'Motion_Joint id="7"', "expr", "SIN(TIME)", "2*SIN(3*TIME)"),
        (SLIDES, "Force_Gravity", "grav_z", "-9.81", "-3"),
    ],
)
def test_a_change_before_the_first_simulate_is_the_deck_so_written(
    tmp_path, model, statement, name, before, after
):
    """To the last bit, or, where the deck sets scales and an assembly, to the tolerance."""
    at = model.index(f"<{statement}")
    end = model.index("/>", at)
    own = model[at:end]
    assert f'{name}="{before}"' in own
    written = model[:at] + own.replace(f'{name}="{before}"', f'{name}="{after}"') + model[end:]
    change = f'<{statement} {name}="{after}"/>'
    body = 3 if 'Body_Rigid id="3"' in model else 2
    runs = [
        mbsim.simulate(read(tmp_path, commands, deck), tol=1e-7)
        for deck, commands in (
            (model, change + simulate(0.4)),
            (written, simulate(0.4)),
            (model, simulate(0.4)),
        )
    ]
    changed, same, other = (
        np.hstack([r[f"bodies/{body}/{what}"] for what in ("position", "quaternion")]) for r in runs
    )
    scales = statement == "Force_Gravity" or "Motion" in statement
    np.testing.assert_allclose(changed, same, rtol=0, atol=1e-6 if scales else 0)
    assert np.abs(changed - other).max() > 1e-9


def test_set_reaches_the_element_and_its_changes(tmp_path):
    """[7] is the element, [7][2] its first change; a change that is not there is named."""
    commands = simulate(1) + CHANGED + simulate(2)
    deck = read(tmp_path, commands, overrides=["Force_SpringDamper[7][2].stiffness=90"])
    assert deck.table("SPRINGDAMPER")[7].stiffness == 100
    assert deck.simulations[1].changes[0].element.stiffness == 90
    deck = read(tmp_path, commands, overrides=["Force_SpringDamper[7].damping=3"])
    assert deck.table("SPRINGDAMPER")[7].damping == 3
    changed = deck.simulations[1].changes[0].element
    assert (changed.stiffness, changed.damping) == (250, 3)
    with pytest.raises(mbsim.errors.ModelError, match=r"no Force_SpringDamper\[7\]\[3\].*2 of"):
        read(tmp_path, commands, overrides=["Force_SpringDamper[7][3].stiffness=90"])
    with pytest.raises(DeckError, match="--set"):
        read(tmp_path, commands, overrides=["Force_SpringDamper[7][2].stiffness=-1"])


def test_a_force_may_not_come_to_follow_from_others(tmp_path):
    change = '<Force_Scalar_TwoBody id="8" expr="JOINT(4, 0, 4, 0)"/>'
    deck = read(tmp_path, change + simulate(1), SLIDES)
    with pytest.raises(DeckError, match=r"Force_Scalar_TwoBody\[8\].*other forces than before"):
        mbsim.simulate(deck)


def test_check_and_info_show_the_sequence(tmp_path):
    """All statements in their order, with times and changes."""
    import json

    from click.testing import CliRunner

    from mbsim.cli.main import main

    commands = f'<Simulate analysis_type="Static"/>{simulate(1)}{CHANGED}{simulate(2)}'
    read(tmp_path, commands)
    deck = str(tmp_path / "deck.xml")
    shown = CliRunner().invoke(main, ["check", deck])
    assert shown.exit_code == 0
    lines = [line.strip() for line in shown.output.splitlines()]
    at = lines.index("simulate STATIC at 0")
    assert lines[at : at + 4] == [
        "simulate STATIC at 0",
        "simulate TRANSIENT at 0 to 1",
        'change Force_SpringDamper[7]: stiffness="250"',
        "simulate TRANSIENT at 1 to 2",
    ]
    told = CliRunner().invoke(main, ["info", deck, "--json"])
    assert told.exit_code == 0
    made = json.loads(told.output)["simulations"]
    assert [s["analysis_type"] for s in made] == ["STATIC", "TRANSIENT", "TRANSIENT"]
    assert [(s["start_time"], s["end_time"]) for s in made] == [(0, 0), (0, 1), (1, 2)]
    assert made[-1]["changes"] == ['Force_SpringDamper[7]: stiffness="250"']


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("pendulum_wheel.xml", r"degrees of freedom: 4, where a kinematic analysis takes 0"),
        ("free_top.xml", r"degrees of freedom: 6, where a kinematic analysis takes 0"),
    ],
)
def test_a_kinematic_analysis_of_what_forces_move_is_refused(name, said):
    text = (MODELS / name).read_text("utf-8")
    model = mbsim.read_model(text.replace('analysis_type="Transient"', 'analysis_type="Kinematic"'))
    with pytest.raises(ModelError, match=said):
        mbsim.simulate(model)


def test_a_kinematic_analysis_of_an_adams_deck_is_refused_in_its_words(tmp_path):
    (tmp_path / "falls.adm").write_text(
        "falls\nPART/1, GROUND\nMARKER/10, PART=1\nPART/2, MASS=1, CM=20, IP=1,1,1\n"
        "MARKER/20, PART=2\nACCGRAV/KGRAV=-9.81\nUNITS/FORCE=NEWTON, MASS=KILOGRAM, "
        "LENGTH=METER, TIME=SECOND\nEND\n"
    )
    (tmp_path / "falls.acf").write_text("falls\n\nSIMULATE/KINEMATICS, END=1, STEPS=10\nSTOP\n")
    with pytest.raises(ModelError, match=r"SIMULATE/KINEMATICS: degrees of freedom: 6.*let DYN"):
        mbsim.simulate(mbsim.read_model(tmp_path / "falls.acf"))
