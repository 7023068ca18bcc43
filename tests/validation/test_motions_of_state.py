"""Motions whose expr depends on the state: closed forms, independent integrations, errors."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import mbsim
from mbsim.errors import DeckError

METHODS = ["DOPRI5", "DOP853", "RADAU5", "GALPHA", "AUTO"]
#: What a tolerance may leave: of GALPHA, which is of order 2, a hundred times as much.
LEFT = {"GALPHA": 3e3}

CART = """
  <Body_Rigid id="1" isground="TRUE"/>
  <Body_Rigid id="2" cg_id="20" mass="3" inertia_xx="1" inertia_yy="1" inertia_zz="1"
    {start}/>
  <Reference_Marker id="10" body_id="1"/>
  <Reference_Marker id="20" body_id="2" pos_z="{x}"/>
  <Constraint_Joint id="1" type="TRANSLATIONAL" i_marker_id="20" j_marker_id="10"/>
  <Reference_Variable id="9" expr="DZ(20)"/>
  {motion}
  <Post_Request id="1" type="EXPRESSION" expr1="DZ(20)" expr2="VZ(20)" expr3="MOTION(1,0,4,0)"/>"""
SHAFTS = """
  <Body_Rigid id="1" isground="TRUE"/>
  <Body_Rigid id="2" cg_id="20" mass="1" inertia_xx="1" inertia_yy="1" inertia_zz="1"/>
  <Body_Rigid id="3" cg_id="30" mass="1" inertia_xx="4" inertia_yy="4" inertia_zz="4"/>
  <Reference_Marker id="10" body_id="1"/>
  <Reference_Marker id="11" body_id="1" pos_x="1"/>
  <Reference_Marker id="20" body_id="2"/>
  <Reference_Marker id="30" body_id="3" pos_x="1"/>
  <Constraint_Joint id="1" type="REVOLUTE" i_marker_id="20" j_marker_id="10"/>
  <Constraint_Joint id="2" type="REVOLUTE" i_marker_id="30" j_marker_id="11"/>
  {held}
  <Force_Scalar_TwoBody id="1" type="Torque" i_marker_id="20" j_marker_id="10" expr="3"/>
  <Post_Request id="1" type="EXPRESSION" expr1="AZ(20,10)" expr2="AZ(30,11)" expr3="WZ(30)"
    {force}/>"""
DISPLACED = '<Motion_Joint id="1" joint_id="2" val_type="D" expr="2*SIN(AZ(20,10))+TIME"/>'
RUN = '<Simulate end_time="2" num_steps="4"/>'


def read(folder, model, command=RUN):
    deck = folder / "deck.xml"
    deck.write_text(
        f"<MotionSolve><Model>{model}</Model><Command>{command}</Command></MotionSolve>"
    )
    return mbsim.read_model(deck)


def cart(motion, x=1.0, start=""):
    return CART.format(motion=f'<Motion_Joint id="1" joint_id="1" {motion}/>', x=x, start=start)


def shafts(held):
    return SHAFTS.format(held=held, force='expr4="MOTION(1,0,8,0)"' if "Motion" in held else "")


def column(results, number):
    return results[f"requests/1/F{number}"]


def shafts_by_scipy(times):
    """Return q1, q2, q2' and the torque on shaft 2: of q2 = 2 sin q1 + t by Lagrange's equations.

    Inertias 1 and 4, a torque 3 on the first: q1'' = 3 - m f', 4 q2'' = m, f' = 2 cos q1.
    """

    def rise(q, u):
        slope, bend = 2 * np.cos(q), -2 * np.sin(q)
        a = (3 - 4 * slope * bend * u * u) / (1 + 4 * slope * slope)
        return a, 4 * (slope * a + bend * u * u)

    found = solve_ivp(
        lambda _, y: [y[1], rise(*y)[0]], (0, times[-1]), start_of_shafts(), t_eval=times,
        rtol=1e-11, atol=1e-12,
    )
    q, u = found.y
    return q, 2 * np.sin(q) + times, 2 * np.cos(q) * u + 1, rise(q, u)[1]


def start_of_shafts():
    """Return q1 and q1' at the start: of 2 q1' + 1 = q2' those of least kinetic energy.

    q1' = -8/17, as q1'^2 + 4 (2 q1' + 1)^2 is least there.
    """
    return [0.0, -8 / 17]


@pytest.mark.parametrize("tol", [1e-5, 1e-9])
@pytest.mark.parametrize("method", METHODS)
def test_a_displacement_that_depends_on_another(tmp_path, method, tol):
    if method == "GALPHA" and tol < 1e-8:
        tol = 1e-7
    results = mbsim.simulate(read(tmp_path, shafts(DISPLACED)), integrator=method, tol=tol)
    left = tol * LEFT.get(method, 300)
    for number, wanted in enumerate(shafts_by_scipy(results["time"]), start=1):
        assert column(results, number) == pytest.approx(wanted, abs=left * (1 + 30 * (number > 3)))


def test_it_is_what_a_general_constraint_holds(tmp_path):
    general = '<Constraint_General id="1" expr="AZ(30,11)-2*SIN(AZ(20,10))-TIME"/>'
    one, other = (
        mbsim.simulate(read(tmp_path, shafts(held)), integrator="DOPRI5", tol=1e-8)
        for held in (DISPLACED, general)
    )
    for number in (1, 2, 3):
        assert column(one, number) == pytest.approx(column(other, number), abs=1e-7)


def test_the_work_is_what_the_motion_puts_in(tmp_path):
    """Kinetic energy less the work of the torque, 3 q1, is the work of the motion."""
    results = mbsim.simulate(read(tmp_path, shafts(DISPLACED)), integrator="DOPRI5", tol=1e-9)
    kinetic = results["energy/kinetic"]
    gained = kinetic - kinetic[0] - 3 * column(results, 1)
    assert results["energy/work_of_motions"] == pytest.approx(gained, abs=1e-6)
    assert abs(gained).max() > 1


@pytest.mark.parametrize("tol", [1e-5, 1e-9])
@pytest.mark.parametrize("method", METHODS)
def test_a_velocity_that_depends_on_where_it_is(tmp_path, method, tol):
    """x' = -2 x: x = exp(-2 t), the force m x'' = 12 x."""
    if method == "GALPHA" and tol < 1e-8:
        tol = 1e-7
    model = read(tmp_path, cart('val_type="V" expr="-2*VARVAL(9)"'))
    results = mbsim.simulate(model, integrator=method, tol=tol)
    x, left = np.exp(-2 * results["time"]), tol * LEFT.get(method, 300)
    assert column(results, 1) == pytest.approx(x, abs=left)
    assert column(results, 2) == pytest.approx(-2 * x, abs=2 * left)
    assert column(results, 3) == pytest.approx(12 * x, abs=12 * left)


@pytest.mark.parametrize("tol", [1e-5, 1e-9])
@pytest.mark.parametrize("method", METHODS)
def test_an_acceleration_that_depends_on_how_it_moves(tmp_path, method, tol):
    """x'' = -25 x - 2 x': x = exp(-t) (cos w t + sin w t / w), w^2 = 24."""
    if method == "GALPHA" and tol < 1e-8:
        tol = 1e-7
    model = read(tmp_path, cart('val_type="A" expr="-25*DZ(20)-2*VZ(20)"'))
    results = mbsim.simulate(model, integrator=method, tol=tol)
    t, w, left = results["time"], np.sqrt(24), tol * LEFT.get(method, 300)
    x = np.exp(-t) * (np.cos(w * t) + np.sin(w * t) / w)
    v = -25 / w * np.exp(-t) * np.sin(w * t)
    assert column(results, 1) == pytest.approx(x, abs=left)
    assert column(results, 2) == pytest.approx(v, abs=5 * left)
    assert column(results, 3) == pytest.approx(3 * (-25 * x - 2 * v), abs=100 * left)
