"""Initial velocities: what the deck gives is kept, the rest follows, what cannot be is named."""

import re

import numpy as np

import mbsim
from helpers import mechanics as mech
from helpers.mechanism_decks import Joint, Scene


def double_pendulum():
    """Two rods of 1 m on pins along y, hanging out along x; the deck gives some velocities."""
    axis = mech.euler313(180, 90, 180)
    bodies = [mech.Body(1.0, (0.01, 0.08, 0.08), (x, 0, 0)) for x in (0.5, 1.5)]
    joints = [
        Joint("REVOLUTE", 1, 0, (0, 0, 0), axis),
        Joint("REVOLUTE", 2, 1, (1, 0, 0), axis),
    ]
    return Scene(bodies, joints)


def start(tmp_path, given, said=None):
    """Run with these velocities of the first rod, and none of the second."""
    text = re.sub(r' [vw]_ic_\w+="[^"]*"', "", double_pendulum().xml())
    text = text.replace('<Body_Rigid id="2"', f'<Body_Rigid id="2" {given}')
    deck = tmp_path / "deck.xml"
    deck.write_text(
        f"<M><Model>{text}</Model><Command>"
        '<Simulate analysis_type="Transient" end_time="0.1" print_interval="0.1"/></Command></M>'
    )
    return mbsim.simulate(mbsim.read_model(deck), notify=said)


def test_a_turn_of_one_rod_carries_the_other(tmp_path):
    results = start(tmp_path, 'w_ic_y="2" w_ic_y_flag="TRUE"')
    np.testing.assert_allclose(results["bodies/2/angular_velocity"][0], [0, 2, 0], atol=1e-12)
    # the pin moves at 2 m/s down: of all that go with it the slowest second rod
    v, w = results["bodies/3/velocity"][0], results["bodies/3/angular_velocity"][0]
    np.testing.assert_allclose(v + np.cross(w, [-0.5, 0, 0]), [0, 0, -2], atol=1e-12)


def test_a_velocity_of_the_centre_turns_the_rod(tmp_path):
    results = start(tmp_path, 'v_ic_z="-6" v_ic_z_flag="TRUE"')
    np.testing.assert_allclose(results["bodies/2/velocity"][0], [0, 0, -6], atol=1e-12)
    np.testing.assert_allclose(results["bodies/2/angular_velocity"][0], [0, 12, 0], atol=1e-12)


def test_what_cannot_be_is_named(tmp_path):
    said = []
    start(tmp_path, 'v_ic_y="3" v_ic_y_flag="TRUE"', said.append)
    assert any("Body_Rigid[2]: velocity v y = 3 of the deck cannot hold" in line for line in said)
