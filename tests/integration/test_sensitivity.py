"""Sensitivities against closed forms and differences of tight runs, and what is refused."""

from __future__ import annotations

import math

import numpy as np
import pytest
from click.testing import CliRunner

import mbsim
from helpers import tight_runs
from helpers.decks import run_model
from helpers.folders import MODELS
from mbsim.cli.main import main
from mbsim.errors import ModelError, UnknownSignal

SPRING = """<Deck><Model>
<Body_Rigid id="1" isground="TRUE"/>
<Body_Rigid id="2" cg_id="20" mass="2" inertia_xx="0.01" inertia_yy="0.02" inertia_zz="0.03"
 v_ic_x="0.3" v_ic_x_flag="TRUE"/>
<Reference_Marker id="10" body_id="1"/>
<Reference_Marker id="20" body_id="2" pos_x="1.2"/>
<Force_SpringDamper id="4" type="TRANSLATIONAL" i_marker_id="20" j_marker_id="10" stiffness="8"
 length="1"/>
<Reference_Variable id="6" expr="0.25"/>
<Force_Vector_TwoBody id="5" type="ForceOnly" i_marker_id="20" j_floating_marker_id="10"
 ref_marker_id="10" fx_expression="VARVAL(6)" fy_expression="0" fz_expression="0"/>
</Model><Command>
<Simulate analysis_type="Transient" end_time="5" print_interval="0.1"/>
</Command></Deck>"""

PENDULUM = """<Deck><Model>
<Body_Rigid id="1" isground="TRUE"/>
<Body_Rigid id="2" cg_id="20" mass="2" inertia_xx="0.1" inertia_yy="0.2" inertia_zz="0.17"/>
<Body_Rigid id="3" cg_id="30" mass="1.5" inertia_xx="0.05" inertia_yy="0.2" inertia_zz="0.17"/>
<Reference_Marker id="10" body_id="1"/>
<Reference_Marker id="11" body_id="1" theta="1.5707963267948966"/>
<Reference_Marker id="20" body_id="2" pos_x="0.5"/>
<Reference_Marker id="21" body_id="2" theta="1.5707963267948966"/>
<Reference_Marker id="22" body_id="2" pos_x="1.0"/>
<Reference_Marker id="30" body_id="3" pos_x="1.4" pos_y="0.1"/>
<Reference_Marker id="31" body_id="3" pos_x="1.0"/>
<Constraint_Joint id="1" type="REVOLUTE" i_marker_id="21" j_marker_id="11"/>
<Constraint_Joint id="2" type="SPHERICAL" i_marker_id="31" j_marker_id="22"/>
<Force_SpringDamper id="5" type="TRANSLATIONAL" i_marker_id="30" j_marker_id="10" stiffness="20"
 damping="0.3" length="0.9"/>
<Force_Gravity grav_z="-9.81"/>
<Post_Request id="7" type="MARKER_DISPLACEMENT" i_marker_id="30" j_marker_id="10"/>
</Model><Command>
<Simulate analysis_type="Transient" end_time="1" print_interval="0.05"/>
</Command></Deck>"""

BOX = """<Body_Rigid id="{id}" cg_id="{id}0" mass="1" inertia_xx="0.01" inertia_yy="0.01"
 inertia_zz="0.01" v_ic_x="{speed}" v_ic_x_flag="TRUE"/>
<Reference_Marker id="{id}0" body_id="{id}" pos_y="{id}" pos_z="0.0499975"/>
<Post_Graphic id="{id}00" type="BoxDefinedFromCenter" center_marker_id="{id}0" length_x="0.2"
 length_y="0.2" length_z="0.1"/>
<Force_Contact id="{id}01" num_i_graphics="1" i_graphics_id="{id}00" num_j_graphics="1"
 j_graphics_id="100" cnf_type="IMPACT" stiffness="1e6" exponent="1" damping="1000" dmax="1e-6"
 cff_type="STICTION" mu_static="{mu}" mu_dynamic="{mu}" tangential_stiffness="1e6"/>
"""

THROWN = """<Deck><Model>
<Body_Rigid id="1" isground="TRUE"/>
<Body_Rigid id="2" cg_id="20" mass="5" inertia_xx="0.0233" inertia_yy="0.0233" inertia_zz="0.0233"
 v_ic_x="5" v_ic_x_flag="TRUE"/>
<Reference_Marker id="10" body_id="1"/>
<Reference_Marker id="20" body_id="2" pos_z="0.118"/>
<Post_Graphic id="100" type="Plane" rm_id="10"/>
<Post_Graphic id="200" type="Sphere" center_marker_id="20" radius="0.108"/>
<Force_Contact id="301" num_i_graphics="1" i_graphics_id="200" num_j_graphics="1"
 j_graphics_id="100" cnf_type="IMPACT" stiffness="3e6" exponent="1.5" damping="200" dmax="1e-4"
 cff_type="COULOMB_ON" mu_static="0.3" mu_dynamic="0.3" stiction_trans_vel="0.02"
 friction_trans_vel="0.02"/>
<Force_Gravity grav_z="-9.81"/>
</Model><Command>
<Simulate analysis_type="Transient" end_time="0.2" print_interval="0.001"/>
</Command></Deck>"""

PUSH = """<Force_Vector_TwoBody id="401" type="ForceOnly" i_marker_id="20" j_floating_marker_id="10"
 ref_marker_id="10" fx_expression="0" fy_expression="0" fz_expression="{force}"/>
"""

TWO_BOXES = """<Deck><Model><Body_Rigid id="1" isground="TRUE"/><Reference_Marker id="10"
 body_id="1"/><Post_Graphic id="100" type="Plane" rm_id="10"/>{}
<Force_Gravity grav_z="-10"/></Model><Command>
<Simulate analysis_type="Transient" end_time="0.6" print_interval="0.1"/></Command></Deck>"""


def differences(deck, name, value, step, signals, **how):
    """Return differences of order 4 of tight runs, signal by signal."""
    whole, half = (
        tight_runs.differences(deck, name, value, part * step, signals, **how)
        for part in (1.0, 0.5)
    )
    return {signal: (4.0 * half[signal] - whole[signal]) / 3.0 for signal in signals}


def off(found, truth):
    """Return the largest difference over the largest value."""
    return float(np.abs(found - truth).max() / np.abs(truth).max())


@pytest.mark.parametrize("integrator", ["DOPRI5", "DOP853", "RADAU5", "GALPHA"])
def test_a_spring_is_as_its_closed_form(integrator):
    names = {"k": "Force_SpringDamper[4].stiffness", "m": "Body_Rigid[2].mass"}
    names |= {"v": "Body_Rigid[2].v_ic_x", "x": "Reference_Marker[20].pos_x"}
    names |= {"F": "Reference_Variable[6].expr"}
    run = mbsim.simulate(SPRING, integrator=integrator, tol=1e-9, sensitivity=list(names.values()))
    plain = mbsim.simulate(SPRING, integrator=integrator, tol=1e-9)
    assert (run["bodies/2/position"] == plain["bodies/2/position"]).all()
    t, k, m, v, F = run["time"], 8.0, 2.0, 0.3, 0.25
    w, u = math.sqrt(k / m), 0.2 - F / k  # u: from where it would rest
    c, s = np.cos(w * t), np.sin(w * t)
    by_w = -u * t * s + v * (t * c / w - s / w**2)
    truth = {
        "k": by_w / (2.0 * w * m) + F / k**2 * (c - 1.0),
        "m": -by_w * w / (2.0 * m),
        "v": s / w,
        "x": c,
        "F": (1.0 - c) / k,
    }
    for short, name in names.items():
        assert off(run.sensitivity("bodies/2/position/x", name), truth[short]) < 1e-6
        assert run.parameters[name]["known_until"] == math.inf


@pytest.mark.parametrize(
    ("integrator", "most"), [("DOPRI5", 1e-6), ("RADAU5", 1e-6), ("GALPHA", 2e-6)]
)
def test_joints_forces_and_requests_are_as_differences_of_tight_runs(integrator, most):
    names = {"Body_Rigid[2].mass": 2.0, "Force_SpringDamper[5].stiffness": 20.0}
    signals = ("bodies/3/position", "bodies/3/angular_velocity", "joints/1/force", "requests/7")
    run = mbsim.simulate(PENDULUM, integrator=integrator, tol=1e-9, sensitivity=list(names))
    for name, value in names.items():
        truth = differences(PENDULUM, name, value, 1e-2 * value, signals, integrator="DOP853")
        for signal in signals:
            assert off(run.sensitivity(signal, name), truth[signal]) < most


# a body that hangs on a stiff spring hardly moves, with vibrations of a radian a step and more
CHAIN = SPRING.replace(
    "</Model>",
    """<Body_Rigid id="3" cg_id="30" mass="2" inertia_xx="1" inertia_yy="1" inertia_zz="1"/>
<Reference_Marker id="30" body_id="3" pos_x="4"/><Reference_Marker id="12" body_id="1" pos_x="5"/>
<Force_SpringDamper id="7" type="TRANSLATIONAL" i_marker_id="30" j_marker_id="12" stiffness="1e6"
 length="1"/>
<Force_SpringDamper id="8" type="TRANSLATIONAL" i_marker_id="30" j_marker_id="20" stiffness="2"
 length="2.8"/></Model>""",
)


def test_what_vibrates_faster_than_steps_of_generalised_alpha_does_not_grow():
    name, signal = "Force_SpringDamper[4].stiffness", "bodies/2/position/x"
    run = mbsim.simulate(CHAIN, integrator="GALPHA", tol=1e-4, sensitivity=[name])
    assert run.stats["steps"] < 400
    truth = differences(
        CHAIN, name, 8.0, 1e-2, [signal, "bodies/3/position/x"], integrator="DOP853"
    )
    assert off(run.sensitivity(signal, name), truth[signal]) < 3e-3
    # of the hung body: its own vibration at most, as one that is damped leaves of it
    stiff, sure = run.sensitivity("bodies/3/position/x", name), truth["bodies/3/position/x"]
    assert np.abs(stiff).max() < 2.0 * np.abs(sure).max()
    assert run.parameters[name]["evaluations"] < run.stats["rhs_evaluations"]


def test_a_marker_of_a_joint_moves_where_the_joint_holds():
    name = "Reference_Marker[31].pos_x"
    run = mbsim.simulate(PENDULUM, integrator="DOPRI5", tol=1e-9, sensitivity=[name], end_time=0.5)
    how = {"integrator": "DOP853", "end_time": 0.5}
    truth = differences(PENDULUM, name, 1.0, 1e-4, ["bodies/3/position"], **how)
    assert off(run.sensitivity("bodies/3/position", name), truth["bodies/3/position"]) < 1e-6


@pytest.mark.parametrize("integrator", ["DOPRI5", "RADAU5", "GALPHA"])
def test_ten_impacts(integrator):
    name = "Reference_Marker[20].pos_z"
    how = {"print_interval": 0.06}
    deck = MODELS / "bouncing_sphere.xml"
    run = mbsim.simulate(deck, integrator=integrator, tol=1e-9, sensitivity=[name], **how)
    truth = differences(deck, name, 0.6, 1e-6, ["bodies/2/velocity/z"], integrator="DOP853", **how)
    found, sure = run.sensitivity("bodies/2/velocity/z", name), truth["bodies/2/velocity/z"]
    flies = run["contacts/301/penetration"] == 0.0
    assert np.count_nonzero(run["events"]["kind"] == "touch") == 10
    assert np.abs(found - sure)[flies].max() < 5e-4 * np.abs(sure)[flies].max()
    assert np.abs(found - sure)[flies & (run["time"] < 1.3)].max() < 1e-4 * 11.0


@pytest.mark.parametrize(
    ("integrator", "tol", "most"),
    [
        ("AUTO", 1e-8, 1e-4),
        ("DOPRI5", 1e-8, 1e-4),
        ("DOP853", 1e-8, 1e-4),
        ("RADAU5", 1e-8, 1e-4),
        ("GALPHA", 1e-8, 3e-4),
        ("GALPHA", 1e-9, 1e-4),
    ],
)
def test_thirty_impacts_add_no_error_of_their_own(integrator, tol, most):
    names = {"Reference_Marker[20].pos_z": (0.6, 3e-7), "Force_Contact[301].damping": (200.0, 5e-5)}
    how, signal = {"end_time": 4.5, "print_interval": 0.01}, "bodies/2/velocity/z"
    deck = MODELS / "bouncing_sphere.xml"
    run = mbsim.simulate(deck, integrator=integrator, tol=tol, sensitivity=list(names), **how)
    flies = run["contacts/301/penetration"] == 0.0
    assert np.count_nonzero(run["events"]["kind"] == "touch") >= 31
    for name, (value, step) in names.items():
        truth = differences(deck, name, value, step, [signal], integrator="DOP853", **how)[signal]
        assert off(run.sensitivity(signal, name)[flies], truth[flies]) < most


@pytest.mark.parametrize("integrator", ["DOPRI5", "DOP853", "RADAU5", "GALPHA"])
@pytest.mark.parametrize("force", ["0", "2*SIN(900*TIME)"])
def test_rows_within_impacts(integrator, force):
    # where a force is a function of time no derivative is carried by how much later a touch is
    name, how = "Reference_Marker[20].pos_z", {"end_time": 0.8, "print_interval": 4e-5}
    deck, signal = (MODELS / "bouncing_sphere.xml").read_text(), "bodies/2/velocity/z"
    deck = deck.replace("<Force_Gravity", PUSH.format(force=force) + "<Force_Gravity")
    run = mbsim.simulate(deck, integrator=integrator, tol=1e-9, sensitivity=[name], **how)
    touches = run["contacts/301/penetration"] > 0.0
    assert np.count_nonzero(touches) > 30
    truth = differences(deck, name, 0.6, 1e-7, [signal], integrator="DOP853", **how)[signal]
    found = run.sensitivity(signal, name)
    assert off(found, truth) < 3e-5
    assert off(found[~touches], truth[~touches]) < 1e-4


@pytest.mark.parametrize("integrator", ["AUTO", "DOPRI5", "DOP853", "RADAU5"])
def test_rows_within_steps_just_behind_an_impact(integrator):
    # friction takes mu times the impulse of the normal force, which knows nothing of it
    name = "Force_Contact[301].mu_dynamic"
    run = mbsim.simulate(THROWN, integrator=integrator, tol=1e-8, sensitivity=[name])
    assert np.count_nonzero(run["events"]["kind"] == "leave") == 2
    truth = (run["bodies/2/velocity/x"] - 5.0) / 0.3
    assert off(run.sensitivity("bodies/2/velocity/x", name), truth) < 1e-6


@pytest.mark.parametrize("integrator", ["DOPRI5", "DOP853", "RADAU5", "GALPHA"])
@pytest.mark.parametrize("tol", [1e-7, 1e-8, 1e-9, 1e-10])
def test_stick_and_slip_on_a_belt_are_as_their_closed_form(integrator, tol):
    # it slips from x = mu_s on, 1 by 0.2 later for every unit of mu_s; the spring gives 3e-5
    name = "Force_Contact[301].mu_static"
    how = {"end_time": 6.0, "integrator": integrator, "tol": tol, "print_interval": 0.4}
    with run_model("belt_stick_slip.xml", sensitivity=[name], **how) as run:
        found, t = run.sensitivity("bodies/2/position/x", name), run["time"]
        assert np.count_nonzero(run["events"]["kind"] == "stick") == 4
        slips = run["events"]["time"][run["events"]["kind"] == "slip"][-1]
        angle = t - slips
        truth = np.cos(angle) + 5.0 * (0.5 * np.sin(angle) - 0.2 * np.cos(angle))
        assert np.abs(found[(t > 0.0) & (angle < 0.0)]).max() < 4e-5
        assert found[angle > 0.0] == pytest.approx(truth[angle > 0.0], rel=5e-4)


@pytest.mark.parametrize("integrator", ["DOPRI5", "DOP853", "RADAU5", "GALPHA"])
@pytest.mark.parametrize("tol", [1e-5, 1e-8, 1e-11])
def test_two_boxes_stop_with_all_their_points_at_once(integrator, tol):
    # after v/(mu g), v^2/(2 mu g) on: eight points stick within 1e-10 s; springs give 1e-6
    mu, speed, g = 0.25, 1.0, 10.0
    boxes = "".join(BOX.format(id=id, mu=mu, speed=speed) for id in (2, 3))
    names = ["Force_Contact[201].mu_dynamic", "Body_Rigid[3].v_ic_x"]
    run = mbsim.simulate(TWO_BOXES.format(boxes), integrator=integrator, tol=tol, sensitivity=names)
    assert np.count_nonzero(run["events"]["kind"] == "stick") == 8
    truth = {
        (names[0], 2): -(speed**2) / (2.0 * mu**2 * g),
        (names[0], 3): 0.0,
        (names[1], 2): 0.0,
        (names[1], 3): speed / (mu * g),
    }
    for (name, body), value in truth.items():
        found = run.sensitivity(f"bodies/{body}/position/x", name)[-1]
        assert found == pytest.approx(value, rel=3e-6, abs=1e-12)


@pytest.mark.parametrize("integrator", ["DOPRI5", "DOP853", "RADAU5", "GALPHA"])
def test_points_of_a_block_stick_and_slip_at_its_reversals(integrator):
    name = "Force_Contact[301].mu_dynamic"
    how = {"end_time": 0.1, "print_interval": 0.001}
    deck, signal = MODELS / "sdnd100.xml", "bodies/2/position/x"
    run = mbsim.simulate(deck, integrator=integrator, tol=1e-10, sensitivity=[name], **how)
    assert np.count_nonzero(run["events"]["kind"] == "stick") == 12
    truth = differences(deck, name, 0.1, 1e-5, [signal], integrator="DOP853", **how)[signal]
    assert off(run.sensitivity(signal, name), truth) < 5e-5


@pytest.mark.parametrize("tol", [1e-7, 3e-9, 1e-9])
def test_slow_iterations_and_slips_just_before_they_end_leave_no_trace(tol):
    name = "Force_Contact[301].mu_dynamic"
    how = {"end_time": 0.1, "print_interval": 0.001}
    deck, signal = MODELS / "sdnd100.xml", "bodies/2/position/x"
    run = mbsim.simulate(deck, integrator="RADAU5", tol=tol, sensitivity=[name], **how)
    truth = differences(deck, name, 0.1, 1e-5, [signal], integrator="DOP853", **how)[signal]
    assert off(run.sensitivity(signal, name), truth) < 5e-5


@pytest.mark.parametrize("integrator", ["DOPRI5", "RADAU5"])
def test_parameters_of_one_law_are_as_each_alone(integrator):
    names = ["Force_Contact[301].mu_static", "Force_Contact[301].mu_dynamic"]
    how = {"end_time": 6.0, "integrator": integrator, "tol": 1e-8, "print_interval": 0.4}
    with run_model("belt_stick_slip.xml", sensitivity=names, **how) as run:
        together = [run.sensitivity("bodies/2/position/x", name) for name in names]
    for name, found in zip(names, together, strict=True):
        with run_model("belt_stick_slip.xml", sensitivity=[name], **how) as run:
            alone = run.sensitivity("bodies/2/position/x", name)
            assert run.parameters[name]["known_until"] == math.inf
            assert (found == alone).all()


@pytest.mark.parametrize("integrator", ["DOPRI5", "RADAU5", "GALPHA"])
def test_linearisations_of_derivatives_leave_a_run_that_sticks_and_slips_alone(integrator):
    names = ["Force_Contact[301].mu_static", "Force_Contact[301].mu_dynamic"]
    how = {"end_time": 6.0, "integrator": integrator, "tol": 1e-8, "print_interval": 0.4}
    with run_model("belt_stick_slip.xml", sensitivity=names, **how) as run:
        found, work = run["bodies/2/position"], run.stats["rhs_evaluations"]
    with run_model("belt_stick_slip.xml", **how) as run:
        assert (found == run["bodies/2/position"]).all()
        assert work == run.stats["rhs_evaluations"]


@pytest.mark.parametrize("integrator", ["DOPRI5", "DOP853"])
def test_a_last_stop_with_little_force_left_is_known(integrator):
    # of its time both sides of a difference are no straight line: it stops with 1/25 of the force
    name, how = "Force_Contact[301].mu_dynamic", {"print_interval": 0.002}
    deck, signal = MODELS / "sdnd100.xml", "bodies/2/position/x"
    run = mbsim.simulate(deck, integrator=integrator, tol=1e-8, sensitivity=[name], **how)
    assert run.parameters[name]["known_until"] == math.inf
    truth = differences(deck, name, 0.1, 3e-6, [signal], integrator="DOP853", **how)[signal]
    assert off(run.sensitivity(signal, name), truth) < 8e-5


@pytest.mark.parametrize(("tol", "end"), [(1e-6, 8.0), (1e-7, 10.0)])
def test_rounding_of_the_rates_of_normal_forces_ends_no_derivative(tol, end):
    names = ["Force_Contact[301].mu_static", "Force_Contact[301].mu_dynamic"]
    how = {"end_time": end, "integrator": "DOPRI5", "tol": tol, "print_interval": 0.4}
    with run_model("belt_stick_slip.xml", sensitivity=names, **how) as run:
        assert np.count_nonzero(run["events"]["kind"] == "stick") >= 4
        for name in names:
            assert run.parameters[name]["known_until"] == math.inf


BELT = MODELS / "belt_stick_slip.xml"


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("Force_Contact[301].mu_static", 1.0),
        pytest.param("Force_Contact[301].mu_dynamic", 0.5, marks=pytest.mark.slow),
    ],
)
def test_a_belt_through_six_sticks_and_six_slips(name, value):
    # what sticks moves by 2e-6: a tolerance of 1e-8 knows such a speed to 5e-3
    how, signal = {"end_time": 48.5, "print_interval": 0.4}, "bodies/2/position/x"
    truth = differences(BELT, name, value, 1e-4, [signal], integrator="DOP853", **how)[signal]
    for integrator, tol, most in (
        ("DOPRI5", 1e-8, 2e-4),
        ("DOPRI5", 1e-9, 5e-5),
        ("DOP853", 1e-8, 2e-5),
        ("RADAU5", 1e-8, 1e-4),
        ("GALPHA", 1e-8, 5e-5),
    ):
        run = mbsim.simulate(BELT, integrator=integrator, tol=tol, sensitivity=[name], **how)
        assert off(run.sensitivity(signal, name), truth) < most


@pytest.mark.parametrize("integrator", ["DOP853", "RADAU5", "GALPHA"])
def test_slips_are_not_rounded_with_the_depths_of_their_contacts(integrator):
    # corners slip as springs that stretch by 2e-6 a second reach mu N, and N is rounded to 1e-12
    name, signal = "Force_Contact[301].mu_dynamic", "bodies/2/position/x"
    how = {"end_time": 6.0, "print_interval": 0.1}
    truth = differences(BELT, name, 0.5, 3e-4, [signal], integrator="DOP853", **how)[signal]
    for tol in (1e-8, 3e-9, 1e-9, 1e-10):
        run = mbsim.simulate(BELT, integrator=integrator, tol=tol, sensitivity=[name], **how)
        assert off(run.sensitivity(signal, name), truth) < 2e-5


SPRING_OF_FRICTION, NORMAL_SPRING = 'tangential_stiffness="2.5e4"', 'stiffness="1e5" exponent="1"'


@pytest.mark.parametrize(
    "other",
    [
        {SPRING_OF_FRICTION: ""},
        {SPRING_OF_FRICTION: 'tangential_stiffness="1e3"'},
        {SPRING_OF_FRICTION: f'{SPRING_OF_FRICTION} tangential_damping="5"'},
        {SPRING_OF_FRICTION: "", NORMAL_SPRING: 'stiffness="1e7" exponent="1.5"'},
    ],
    ids=["Mindlin", "soft", "damped", "grows with depth"],
)
def test_what_sticks_slips_by_its_slow_stretch_with_any_spring(other):
    name, signal = "Body_Rigid[2].mass", "bodies/2/position/x"
    how, deck = {"end_time": 24.0, "print_interval": 0.4}, BELT.read_text()
    for given, instead in other.items():
        deck = deck.replace(given, instead)
    truth = differences(deck, name, 1.0, 3e-4, [signal], integrator="DOP853", **how)[signal]
    for integrator in ("DOP853", "RADAU5", "GALPHA"):
        run = mbsim.simulate(deck, integrator=integrator, tol=1e-8, sensitivity=[name], **how)
        assert off(run.sensitivity(signal, name), truth) < 1e-4


@pytest.mark.parametrize("integrator", ["RADAU5", "GALPHA"])
def test_a_ball_rolls_many_turns_with_an_implicit_method(integrator):
    name = "Body_Rigid[2].v_ic_x"
    deck, signals = MODELS / "bowling_ball.xml", ("bodies/2/position/x", "bodies/2/velocity/x")
    run = mbsim.simulate(deck, integrator=integrator, tol=1e-9, sensitivity=[name])
    truth = differences(deck, name, 5.0, 1e-2, signals, integrator="DOP853")
    # differences themselves scatter by 1.2e-5 of the speed
    for signal in signals:
        assert off(run.sensitivity(signal, name), truth[signal]) < 3e-5


def test_what_is_not_known_any_more_is_nan_and_said():
    # a force that pushes away from the line it moves along: any speed across is e^70 as large soon
    deck = SPRING.replace('fy_expression="0"', 'fy_expression="400*DY(20,10)"')
    deck = deck.replace('v_ic_x_flag="TRUE"', 'v_ic_x_flag="TRUE" v_ic_y="0" v_ic_y_flag="TRUE"')
    said, name = [], "Body_Rigid[2].v_ic_y"
    other, how = "Body_Rigid[2].mass", {"integrator": "DOPRI5", "tol": 1e-8}
    run = mbsim.simulate(deck, notify=said.append, sensitivity=[name, other], **how)
    alone = mbsim.simulate(deck, sensitivity=[other], **how)
    signal = "bodies/2/position/x"
    assert (run.sensitivity(signal, other) == alone.sensitivity(signal, other)).all()
    until = run.parameters[name]["known_until"]
    found = run.sensitivity("bodies/2/position/y", name)
    assert until < 5.0
    assert run.parameters[name]["why"] != ""
    assert np.isnan(found[run["time"] > until]).all()
    assert not np.isnan(found[run["time"] < until]).any()
    assert any("not known from time" in line and name in line for line in said)


@pytest.mark.parametrize(
    ("parameter", "said"),
    [
        ("Body_Rigid[9].mass", r"no Body_Rigid\[9\] in the deck"),
        ("Body_Rigid[2].cg_id", "changes what the model is made of|cannot be changed"),
        ("Force_SpringDamper[4].damping", "is not given in the deck"),
        ("Force_Vector_TwoBody[5].fx_expression", "is no number"),
        ("mass", "must be"),
    ],
)
def test_what_is_no_parameter_is_refused_by_name(parameter, said):
    with pytest.raises(ModelError, match=said):
        mbsim.simulate(SPRING, sensitivity=[parameter])


def test_methods_and_runs_without_sensitivities_are_refused():
    name = "Body_Rigid[2].mass"
    with pytest.raises(ModelError, match="integrator MOREAU has none"):
        mbsim.simulate(SPRING, integrator="MOREAU", sensitivity=[name])
    with pytest.raises(ModelError, match="named twice"):
        mbsim.simulate(SPRING, sensitivity=[name, name])


def test_they_are_kept_in_the_file(tmp_path):
    deck, name = tmp_path / "spring.xml", "Body_Rigid[2].mass"
    deck.write_text(SPRING)
    command = ["run", str(deck), "-o", str(tmp_path), "--sensitivity", name]
    done = CliRunner().invoke(main, command)
    assert done.exit_code == 0, done.output
    with mbsim.open_results(tmp_path / "spring.h5") as results:
        found = results.sensitivity("bodies/2/position", name)
        assert found.shape == results["bodies/2/position"].shape
        assert (results.sensitivity("bodies/2/position/x", name) == found[:, 0]).all()
        size = results.sensitivity("bodies/2/position/mag", name)
        assert size == pytest.approx(found[:, 0] * np.sign(results["bodies/2/position/x"]))
        assert name in results.parameters
        whole = f"sensitivity/{name}/bodies/2/position"
        assert results.signals()[whole] == 3
        assert results.find(f"sensitivity/{name}/bodies/*/position/x") == [f"{whole}/x"]
        assert (results[whole] == found).all()
        assert (results[f"{whole}/mag"] == size).all()
        with pytest.raises(UnknownSignal, match="--sensitivity"):
            results.sensitivity("bodies/2/position", "Body_Rigid[2].inertia_xx")
        with pytest.raises(UnknownSignal, match="no such signal"):
            results.sensitivity("bodies/7/position", name)
