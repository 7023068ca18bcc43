"""Activate and Deactivate: what takes no part gives nothing, and what comes back fits in."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import mbsim
from mbsim.errors import Interrupted, ModelError

_BODY = 'mass="1" inertia_xx="1" inertia_yy="1" inertia_zz="1"'
#: A ball above a plane, and a bar that turns about y in a joint with friction.
DECK = f"""<MotionSolve><Model>
<Body_Rigid id="1" isground="TRUE"/><Reference_Marker id="10" body_id="1"/>
<Reference_Marker id="11" body_id="1" a11="0" a21="1" a12="1" a22="0" a00="-1"/>
<Body_Rigid id="2" cg_id="20" {_BODY}/><Reference_Marker id="20" body_id="2" pos_z="1.1"/>
<Body_Rigid id="3" cg_id="30" {_BODY} w_ic_y="2" w_ic_y_flag="TRUE"/>
<Reference_Marker id="30" body_id="3"/>
<Reference_Marker id="31" body_id="3" a11="0" a21="1" a12="1" a22="0" a00="-1"/>
<Constraint_Joint id="1" type="REVOLUTE" i_marker_id="31" j_marker_id="11"/>
<Force_JointFriction id="1" joint_id="1" mu_static="0.3" mu_dynamic="0.3" pin_radius="0.1"
 cff_type="COULOMB_ON"/>
<Force_Gravity grav_z="-10"/>
<Post_Graphic id="1" type="Sphere" center_marker_id="20" radius="0.1"/>
<Post_Graphic id="2" type="Plane" rm_id="10"/>
<Force_Contact id="1" num_i_graphics="1" i_graphics_id="1" num_j_graphics="1" j_graphics_id="2"
 cnf_type="IMPACT" stiffness="1e5" exponent="1.5" damping="0" dmax="0.01" cff_type="COULOMB_OFF"/>
<Sensor_Event id="1" type="EXPRESSION" expr="TIME" compare="GE" value="0.1"
 error_tol="1e-6" zero_crossing="TRUE"
 return="TRUE"/>
<Post_Request id="1" type="EXPRESSION" expr2="DZ(20)" expr3="WY(30)"/>
</Model><Command>COMMANDS</Command></MotionSolve>"""


def switch(what: str, kind: str, id: int = 1) -> str:
    """Return an Activate or a Deactivate."""
    return f'<{what} element_type="{kind}" element_id="{id}"/>'


def until(end: float, steps: int = 3) -> str:
    """Return a Simulate."""
    return f'<Simulate analysis_type="Transient" end_time="{end}" num_steps="{steps}"/>'


def deck(*commands: str) -> str:
    """Return the deck with these commands."""
    return DECK.replace("COMMANDS", "".join(commands))


QUIET = switch("Deactivate", "SENSOR")


@pytest.mark.parametrize("method", ["AUTO", "RADAU5"])
def test_what_takes_no_part_gives_nothing_and_what_comes_back_acts(method: str) -> None:
    """Falling and turning free until 0.3; then as a run in which all was active from there on."""
    off = switch("Deactivate", "FRICTION") + switch("Deactivate", "CONTACT")
    on = switch("Activate", "FRICTION") + switch("Activate", "CONTACT")
    found = mbsim.simulate(deck(QUIET, off, until(0.3), on, until(0.6)), integrator=method)
    times, rows = found["time"], found["requests/1"]
    free = times <= 0.3
    assert rows[free, 1] == pytest.approx(1.1 - 5.0 * times[free] ** 2, abs=1e-6)
    assert rows[free, 2] == pytest.approx(2.0, abs=1e-9)
    # from 0.3 on friction of 0.3 10 N presses at the pin: w' = -0.3 on 1 kg m^2
    assert rows[-1, 2] == pytest.approx(2.0 - 0.3 * 0.3, abs=1e-4)
    always = mbsim.simulate(deck(QUIET, until(0.6)), integrator=method, tol=1e-7)
    # elastic: it rises as it fell
    assert rows[-1, 1] == pytest.approx(always["requests/1"][-1, 1], abs=2e-3)


def test_a_contact_off_is_fallen_through() -> None:
    found = mbsim.simulate(deck(QUIET, switch("Deactivate", "CONTACT"), until(1.0)))
    assert found["requests/1"][-1, 1] == pytest.approx(1.1 - 5.0, abs=1e-6)
    assert not found["contacts/1/force"].any()


def test_a_sensor_acts_where_it_is_activated_and_true() -> None:
    found = mbsim.simulate(deck(QUIET, until(0.2), switch("Activate", "SENSOR"), until(0.4)))
    assert found["time"][-1] == pytest.approx(0.2)


def test_resumed_among_simulates_it_is_the_same_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # back in Python every few evaluations
    monkeypatch.setattr("mbsim.run.divergence.RETURN_SECONDS", 1e-6)
    monkeypatch.setattr("mbsim.run.loop.FIRST_BUDGET", 5)
    commands = QUIET, until(0.2), switch("Deactivate", "JOINT"), switch("Deactivate", "FRICTION")
    path = tmp_path / "deck.xml"
    path.write_text(deck(*commands, until(0.4), switch("Activate", "JOINT"), until(0.6)))
    whole = mbsim.simulate(path, output=tmp_path / "whole")

    def stop(time: float, step: float, end: float) -> None:
        if 0.2 < time < 0.4:
            raise KeyboardInterrupt

    with pytest.raises(Interrupted):
        mbsim.simulate(path, output=tmp_path / "part", progress=stop)
    rest = mbsim.simulate(path, output=tmp_path / "part", resume=True)
    assert np.array_equal(whole["requests/1"], rest["requests/1"])
    # let go it falls, 2/15 s before its last row; held anew it is back where the joint is
    fallen = whole["bodies/3/position"][:, 2]
    assert fallen.min() == pytest.approx(-5.0 * (2.0 / 15.0) ** 2, abs=1e-6)
    assert fallen[-1] == pytest.approx(0.0, abs=1e-9)


def test_rigid_contacts_refuse_what_is_switched() -> None:
    with pytest.raises(ModelError, match="MOREAU cannot run this: elements are not active"):
        mbsim.simulate(deck(switch("Deactivate", "CONTACT"), until(1)), integrator="MOREAU")
