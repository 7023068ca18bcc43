"""Linear analyses of decks: what moves, where they stand between others, modes as motions."""

import math

import numpy as np
import pytest

import mbsim
from helpers.folders import CORPUS
from mbsim.errors import ResultsError
from mbsim.results.mode_motion import motion_of_mode

PENDULUM = CORPUS / "linear_pendulum.xml"


@pytest.fixture(scope="module")
def swinging(tmp_path_factory):
    folder = tmp_path_factory.mktemp("linear")
    mbsim.simulate(mbsim.read_model(PENDULUM), output=folder)
    with mbsim.open_results(folder / "linear_pendulum.h5") as results:
        yield results


def test_a_mode_is_a_motion_about_where_it_was_found(swinging):
    # (K - w^2 M) t = 0: the centre of the upper rod goes by x, that of the lower one by y
    mode = swinging.linear[0].modes[0]
    square = (2 * math.pi * mode.frequency) ** 2
    coupling = 1.0 * 0.4
    upper = (2 * 0.5 + 1.0) * 9.81 - square * (0.3 + 2 * 0.25 + 1.0)
    turns = upper / (square * coupling)  # of the lower rod over that of the upper one
    place = {name: k for k, name in enumerate(swinging.linear[0].numbers)}
    x, y = (mode.shape[place[f"bodies/{id}/position/x"]].real for id in (2, 3))
    assert y / x == pytest.approx((1.0 + 0.4 * turns) / 0.5, rel=1e-6)

    motion = motion_of_mode(swinging, 1)
    p = motion["bodies/3/position"]
    size = swinging.attribute("graphics", "size")
    np.testing.assert_allclose(p[10], swinging["bodies/3/position"][0], atol=1e-9)
    np.testing.assert_allclose(p[0], p[40], atol=1e-9)
    assert motion["time"][40] == pytest.approx(1 / mode.frequency)
    assert 0.01 * size < abs(p[0, 0] - p[20, 0]) <= 0.2 * size
    with pytest.raises(ResultsError, match="modes 1 to 2, and no 3"):
        motion_of_mode(swinging, 3)


def test_rows_are_those_of_the_analyses_that_take_time(swinging):
    np.testing.assert_allclose(swinging["time"], [0, 0.05, 0.1])
    assert not [name for name in swinging.signals() if name.startswith("linear")]


def test_a_state_keeps_what_was_linearised():
    with mbsim.open(PENDULUM) as sim:
        state = sim.state
        sim.step(0.05)
        sim.linear.found.clear()
        sim.state = state
        found = sim.results().linear
    assert [model.time for model in found] == [0.0]
    assert len(found[0].modes) == 2


def test_a_pendulum_that_moves():
    # J t'' = -m g a sin t at t = 60 degrees, turning at 2 rad/s: x = a sin t is the state
    deck = """<MotionSolve><Model>
  <Body_Rigid id="1" isground="TRUE"/>
  <Body_Rigid id="2" cg_id="20" mass="2" inertia_xx="0.3" inertia_yy="0.3" inertia_zz="0.01"
    w_ic_y="-2" w_ic_y_flag="TRUE"/>
  <Reference_Marker id="10" body_id="1" a11="0" a12="1" a21="-1" a22="0"/>
  <Reference_Marker id="20" body_id="2" pos_x="{x}" pos_z="-0.25"/>
  <Reference_Marker id="21" body_id="2" a11="0" a12="1" a21="-1" a22="0"/>
  <Constraint_Joint id="1" type="REVOLUTE" i_marker_id="21" j_marker_id="10"/>
  <Force_Gravity grav_z="-9.81"/>
</Model><Command><Simulate analysis_type="Linear"/></Command></MotionSolve>"""
    told = []
    model = mbsim.read_model(deck.format(x=0.5 * math.sin(math.pi / 3)))
    (found,) = mbsim.simulate(model, notify=told.append).linear
    assert any("the model moves here" in line for line in told)
    inertia, turn, rate = 0.3 + 2 * 0.25, math.pi / 3, 2.0
    if found.states[0] == "bodies/2/turn/y":
        A = [[0, 1], [-2 * 9.81 * 0.5 / inertia * math.cos(turn), 0]]
        np.testing.assert_allclose(found.A, A, atol=1e-6)
    else:
        assert found.states == ("bodies/2/position/x", "bodies/2/velocity/x")
        # x' = a cos(t) t', x'' = -a sin(t) t'^2 - a cos(t) m g a sin(t)/J, t' = x'/(a cos t)
        sine, cosine, k = math.sin(turn), math.cos(turn), 2 * 9.81 * 0.5 / inertia
        # by t at constant x', over x_t
        at = -0.5 * cosine * rate**2 - 2 * rate**2 * 0.5 * sine**2 / cosine
        at -= 0.5 * k * (cosine**2 - sine**2)
        A = [[0, 1], [at / (0.5 * cosine), -2 * sine * rate / cosine]]
        np.testing.assert_allclose(found.A, A, rtol=1e-6, atol=1e-6)


def test_a_request_finds_the_model_of_a_run_with_inputs(tmp_path):
    from mbsim.run.replay import Replay

    deck = tmp_path / "linear.xml"
    deck.write_text((CORPUS / "linear.xml").read_text("utf-8"), encoding="utf-8")
    mbsim.simulate(mbsim.read_model(deck), output=tmp_path)
    with mbsim.open_results(tmp_path / "linear.h5") as results:
        assert Replay(results).system.model.looked_at == (2, 3)
