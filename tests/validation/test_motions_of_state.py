"""Motions whose expr depends on the state: closed forms, independent integrations, errors."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import mbsim
from helpers.shafts import TWO_SHAFTS
from mbsim.errors import Interrupted

#: Methods and tolerances; GALPHA is of order 2, and would take minutes at 1e-9.
RUNS = [
    *((method, tol) for method in ("DOPRI5", "RADAU5") for tol in (1e-5, 1e-9)),
    *(("GALPHA", 1e-5), ("GALPHA", 1e-7), ("DOP853", 1e-7), ("AUTO", 1e-7)),
]
#: Errors over tolerances: of explicit methods and RADAU5 about 0.01, of GALPHA about 1.
LEFT = {"GALPHA": 10.0}

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
SHAFTS = (
    TWO_SHAFTS
    + """
  <Post_Request id="1" type="EXPRESSION" expr1="AZ(20,10)" expr2="AZ(30,11)" expr3="WZ(30)"
    {force}/>"""
)
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
        lambda _, y: [y[1], rise(*y)[0]],
        (0, times[-1]),
        start_of_shafts(),
        t_eval=times,
        rtol=1e-11,
        atol=1e-12,
    )
    q, u = found.y
    return q, 2 * np.sin(q) + times, 2 * np.cos(q) * u + 1, rise(q, u)[1]


def start_of_shafts():
    """Return q1 and q1' at the start: of 2 q1' + 1 = q2' those of least kinetic energy.

    q1' = -8/17, as q1'^2 + 4 (2 q1' + 1)^2 is least there.
    """
    return [0.0, -8 / 17]


@pytest.mark.parametrize(("method", "tol"), RUNS)
def test_a_displacement_that_depends_on_another(tmp_path, method, tol):
    results = mbsim.simulate(read(tmp_path, shafts(DISPLACED)), integrator=method, tol=tol)
    left = tol * LEFT.get(method, 1)
    for number, wanted in enumerate(shafts_by_scipy(results["time"]), start=1):
        assert column(results, number) == pytest.approx(wanted, abs=left)


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


@pytest.mark.parametrize(("method", "tol"), RUNS)
def test_a_velocity_that_depends_on_where_it_is(tmp_path, method, tol):
    """x' = -2 x: x = exp(-2 t), the force m x'' = 12 x."""
    model = read(tmp_path, cart('val_type="V" expr="-2*VARVAL(9)"'))
    results = mbsim.simulate(model, integrator=method, tol=tol)
    x, left = np.exp(-2 * results["time"]), tol * LEFT.get(method, 1)
    assert column(results, 1) == pytest.approx(x, abs=left)
    assert column(results, 2) == pytest.approx(-2 * x, abs=2 * left)
    assert column(results, 3) == pytest.approx(12 * x, abs=12 * left)


@pytest.mark.parametrize(("method", "tol"), RUNS)
def test_an_acceleration_that_depends_on_how_it_moves(tmp_path, method, tol):
    """x'' = -25 x - 2 x': x = exp(-t) (cos w t + sin w t / w), w^2 = 24."""
    model = read(tmp_path, cart('val_type="A" expr="-25*DZ(20)-2*VZ(20)"'))
    results = mbsim.simulate(model, integrator=method, tol=tol)
    t, w, left = results["time"], np.sqrt(24), tol * LEFT.get(method, 1)
    x = np.exp(-t) * (np.cos(w * t) + np.sin(w * t) / w)
    v = -25 / w * np.exp(-t) * np.sin(w * t)
    assert column(results, 1) == pytest.approx(x, abs=left)
    assert column(results, 2) == pytest.approx(v, abs=5 * left)
    assert column(results, 3) == pytest.approx(3 * (-25 * x - 2 * v), abs=100 * left)


def test_an_acceleration_takes_as_many_steps_as_the_force_of_it(tmp_path):
    """What it depends on is in Newton's matrix: poses and velocities, stiff ones too."""
    expr = "-1e6*(DZ(20)-SIN(TIME))-1e4*VZ(20)"
    force = f"""<Force_Vector_OneBody id="1" type="ForceOnly" i_marker_id="20" fx_expression="0"
      fy_expression="0" fz_expression="3*({expr})"/>"""
    forced = CART.format(motion=force, x=1, start="").replace("MOTION(1,0,4,0)", "0")
    one, other = (
        mbsim.simulate(read(tmp_path, model), integrator="RADAU5", tol=1e-6).stats
        for model in (cart(f'val_type="A" expr="{expr}"'), forced)
    )
    assert one["rhs_evaluations"] == other["rhs_evaluations"]
    assert one["jacobians"] == other["jacobians"]


STATIC = """
  <Body_Rigid id="1" isground="TRUE"/>
  <Body_Rigid id="2" cg_id="20" mass="1" inertia_xx="1" inertia_yy="1" inertia_zz="1"/>
  <Body_Rigid id="3" cg_id="30" mass="2" inertia_xx="1" inertia_yy="1" inertia_zz="1"/>
  <Reference_Marker id="10" body_id="1"/>
  <Reference_Marker id="20" body_id="2"/>
  <Reference_Marker id="30" body_id="3"/>
  <Constraint_Joint id="1" type="TRANSLATIONAL" i_marker_id="20" j_marker_id="10"/>
  <Constraint_Joint id="2" type="TRANSLATIONAL" i_marker_id="30" j_marker_id="10"/>
  <Motion_Joint id="1" joint_id="2" val_type="{type}" expr="{expr}"/>
  <Force_Gravity grav_z="-10"/>
  <Force_Vector_OneBody id="1" type="ForceOnly" i_marker_id="20" fx_expression="0"
    fy_expression="0" fz_expression="-100*DZ(20)"/>
  <Post_Request id="1" type="EXPRESSION" expr1="DZ(20)" expr2="DZ(30)" expr3="MOTION(1,0,4,0)"/>"""


def test_statics_hold_what_a_displacement_follows(tmp_path):
    """z2 = 3 z1 carries 2 kg: 100 z1 = -10 - 3 20 by virtual work, z1 = -0.7."""
    model = read(
        tmp_path, STATIC.format(type="D", expr="3*DZ(20)"), '<Simulate analysis_type="Static"/>'
    )
    results = mbsim.simulate(model)
    found = [column(results, number)[-1] for number in (1, 2, 3)]
    assert found == pytest.approx([-0.7, -2.1, 20.0], abs=1e-6)


@pytest.mark.parametrize("type", ["V", "A"])
def test_statics_hold_rates_where_they_are(tmp_path, type):
    model = read(
        tmp_path, STATIC.format(type=type, expr="1+DZ(20)"), '<Simulate analysis_type="Static"/>'
    )
    results = mbsim.simulate(model)
    found = [column(results, number)[-1] for number in (1, 2)]
    assert found == pytest.approx([-0.1, 0.0], abs=1e-6)


def test_moreau_runs_them(tmp_path):
    model = read(
        tmp_path,
        cart('val_type="V" expr="-2*DZ(20)"'),
        '<Param_Transient h_max="1e-3"/>' + RUN,
    )
    results = mbsim.simulate(model, integrator="MOREAU")
    assert column(results, 1) == pytest.approx(np.exp(-2 * results["time"]), abs=2e-3)


def test_resumed_it_is_the_same_run(tmp_path, monkeypatch):
    """Turns that angles have counted are kept: the shaft is driven for more than one."""
    from mbsim.run import divergence, loop

    monkeypatch.setattr(divergence, "RETURN_SECONDS", 1e-5)
    monkeypatch.setattr(loop, "FIRST_BUDGET", 5)
    held = '<Motion_Joint id="1" joint_id="2" val_type="D" expr="2*AZ(20,10)+TIME"/>'
    model = read(tmp_path, shafts(held), '<Simulate end_time="8" print_interval="0.1"/>')
    whole = mbsim.simulate(model, output=tmp_path / "whole")
    stopped = []

    def stop(t, h, end):
        if t > 5 and not stopped:
            stopped.append(t)
            raise KeyboardInterrupt

    with pytest.raises((KeyboardInterrupt, Interrupted)):
        mbsim.simulate(model, output=tmp_path / "part", progress=stop)
    rest = mbsim.simulate(model, output=tmp_path / "part", resume=True)
    assert stopped[0] < 8
    assert np.array_equal(column(whole, 2), column(rest, 2))
    # q2 = 2 q1 + t, a1 = 3 - 2 m, 4 (2 a1) = m
    q = -2 / 17 * 4 * whole["time"] + 3 / 17 * whole["time"] ** 2 / 2
    assert column(whole, 1) == pytest.approx(q, abs=1e-3)
    assert abs(column(whole, 1)).max() > 1
