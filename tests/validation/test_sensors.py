"""Sensors (Sensor_Event): where they act, and what they do, against closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest

import mbsim
from helpers.decks import GRAVITY, GROUND, contact, run_deck, sphere, write_deck
from mbsim.errors import DeckError

G = 9.81
FALL = GROUND + sphere(1.0) + GRAVITY
PENDULUM = (
    GROUND
    + sphere(0.0, x=1.0)
    + GRAVITY
    + '<Reference_Marker id="11" body_id="1"/><Reference_Marker id="21" body_id="2"/>'
    + '<Constraint_Joint id="1" type="Spherical" i_marker_id="21" j_marker_id="11"/>'
)


def sensor(id, expr, compare="GE", value=0.0, located=True, **more):
    attributes = {"zero_crossing": "TRUE" if located else "FALSE", **more}
    text = " ".join(f'{name.rstrip("_")}="{given}"' for name, given in attributes.items())
    return (
        f'<Sensor_Event id="{id}" type="EXPRESSION" expr="{expr}" compare="{compare}" '
        f'value="{value!r}" {text}/>'
    )


def times(results, id):
    """Return when a sensor acted."""
    events = results["events"]
    mine = (events["kind"] == "sensor") & (events["element"] == id)
    return events["time"][mine]


@pytest.mark.parametrize("integrator", ["DOPRI5", "DOP853", "VERLET"])
def test_crossings_are_located_to_1e_9(tmp_path, integrator):
    watch = (
        sensor(1, "TIME", value=0.123456789)
        + sensor(2, "DZ(20)", "LE", 0.8)
        + sensor(3, "SIN(40*TIME)", "EQ")
        + sensor(4, "VZ(20)", "LT", -2.0)
        + sensor(5, "TIME", "GE", 0.0001, located=False)
    )
    results = run_deck(tmp_path, FALL + watch, 0.42, 0.02, integrator=integrator)
    np.testing.assert_allclose(times(results, 1), [0.123456789], rtol=0, atol=1e-15)
    np.testing.assert_allclose(times(results, 2), [math.sqrt(0.4 / G)], rtol=0, atol=1e-9)
    np.testing.assert_allclose(times(results, 3), math.pi / 40.0 * np.arange(6), rtol=0, atol=1e-9)
    np.testing.assert_allclose(times(results, 4), [2.0 / G], rtol=0, atol=1e-9)
    # not located: at the end of the step
    assert times(results, 5)[0] > 0.0002
    assert (np.diff(results["events"]["time"]) >= 0.0).all()


def test_two_crossings_between_the_ends_of_a_long_step_are_both_found(tmp_path):
    # above 0 for 0.02 around 0.21; the fall alone takes longer steps
    watch = sensor(1, "1E-4-(TIME-0.21)**2", "EQ", print="TRUE")
    results = run_deck(tmp_path, FALL + watch, 0.4, 0.01)
    np.testing.assert_allclose(times(results, 1), [0.2, 0.22], rtol=0, atol=1e-9)
    assert results.stats["h_largest"] > 0.02


def test_a_pendulum_passes_its_lowest_point_when_the_elliptic_integral_says(tmp_path):
    # from rest at 90 degrees: a quarter of the period is K(sin 45)/w
    a, b = 1.0, math.sqrt(0.5)
    while a - b > 1e-15:
        a, b = 0.5 * (a + b), math.sqrt(a * b)
    inertia = 1.0 + 0.4 * 0.1**2
    quarter = math.pi / (2.0 * a) * math.sqrt(inertia / G)
    watch = sensor(1, "DX(20)", "LE", 0.0)
    results = run_deck(tmp_path, PENDULUM + watch, 1.0, 0.05, tol=1e-11)
    np.testing.assert_allclose(times(results, 1), [quarter], rtol=0, atol=1e-9)


def test_actions(tmp_path):
    watch = (
        sensor(1, "TIME", value=0.1, print="TRUE", evaluate="DZ(20)")
        + sensor(2, "TIME", value=0.205, dt=0.001)
        + sensor(3, "TIME", value=0.21, halt="TRUE")
        + sensor(4, "TIME", value=0.055, hmax=0.001, stepsize=1e-4, print="TRUE")
    )
    request = '<Post_Request id="1" type="EXPRESSION" expr2="SENVAL(1)"/>'
    results = run_deck(tmp_path, FALL + watch + request, 1.0, 0.02)
    expected = [0, 0.02, 0.04, 0.055, *np.arange(0.06, 0.201, 0.02)]
    expected += [0.206, 0.207, 0.208, 0.209, 0.21]
    np.testing.assert_allclose(results["time"], expected, rtol=0, atol=1e-14)
    assert results.status == "finished"
    assert results.stats["halted_by_sensor"] == 3
    assert results.stats["h_smallest"] <= 1e-4
    # a row at the time of the event holds what is after it
    shown = np.where(results["time"] < 0.1, 0.0, 1.0 - 0.005 * G)
    np.testing.assert_allclose(results["requests/1"][:, 1], shown, atol=1e-12)


def test_return_goes_on_with_the_next_simulate(tmp_path):
    path = write_deck(tmp_path, FALL + sensor(1, "TIME", value=0.105, return_="TRUE"), 0.2, 0.02)
    second = '<Simulate analysis_type="Transient" end_time="0.3" print_interval="0.05"/></Command>'
    path.write_text(path.read_text().replace("</Command>", second))
    results = mbsim.simulate(mbsim.read_model(path))
    expected = [0, 0.02, 0.04, 0.06, 0.08, 0.1, 0.105, 0.155, 0.205, 0.255, 0.3]
    np.testing.assert_allclose(results["time"], expected, rtol=0, atol=1e-14)
    z = results["bodies/2/position"][:, 2]
    np.testing.assert_allclose(z, 1.0 - 0.5 * G * results["time"] ** 2, atol=1e-9)


def test_what_is_true_at_the_start_acts_there_and_only_when_it_becomes_true_again(tmp_path):
    watch = sensor(1, "COS(20*TIME)", "GE", 0.5) + sensor(
        2, "TIME", value=-1.0, evaluate="3", located=False
    )
    request = '<Post_Request id="1" type="EXPRESSION" expr2="SENVAL(2)"/>'
    results = run_deck(tmp_path, FALL + watch + request, 0.4, 0.01)
    again = (2.0 * math.pi - math.pi / 3.0) / 20.0
    np.testing.assert_allclose(times(results, 1), [0.0, again], rtol=0, atol=1e-9)
    assert times(results, 2).tolist() == [0.0]
    assert (results["requests/1"][:, 1] == 3.0).all()


def test_a_force_that_a_sensor_switches(tmp_path):
    # the force on the ball is SENVAL: it hovers from 0.1 on
    force = (
        '<Reference_Marker id="12" body_id="1"/>'
        '<Force_Scalar_TwoBody id="1" type="TRANSLATIONAL" i_marker_id="20" j_marker_id="12" '
        'expr="9.81*SENVAL(1)"/>'
    )
    model = FALL + sensor(1, "TIME", value=0.1, evaluate="1") + force
    results = run_deck(tmp_path, model, 0.3, 0.025)
    t = results["time"]
    flown = np.minimum(t, 0.1)
    exact = 1.0 - 0.5 * G * flown**2 - G * 0.1 * (t - flown)
    np.testing.assert_allclose(results["bodies/2/position"][:, 2], exact, atol=1e-12)


def test_width_counts_without_zero_crossing_alone(tmp_path):
    watch = sensor(1, "TIME", value=0.2, error_tol=0.05, located=False) + sensor(
        2, "TIME", value=0.2, error_tol=0.05
    )
    results = run_deck(tmp_path, FALL + sensor(9, "TIME", value=-1, hmax=0.001) + watch, 0.3, 0.1)
    assert 0.15 <= times(results, 1)[0] < 0.1511
    np.testing.assert_allclose(times(results, 2), [0.2], rtol=0, atol=1e-15)


def test_a_run_resumed_after_a_sensor_is_the_same_to_the_last_bit(tmp_path, monkeypatch):
    watch = sensor(1, "TIME", value=0.105, dt=0.007, hmax=0.01, evaluate="DZ(20)")
    watch += sensor(2, "DZ(20)", "LE", 0.7, print="TRUE")
    request = '<Post_Request id="1" type="EXPRESSION" expr2="SENVAL(1)"/>'
    impact = contact(stiffness=1e5, exponent=1.5, damping=50.0, dmax=1e-3)
    path = write_deck(tmp_path, FALL + watch + impact + request, 0.6, 0.02)
    model = mbsim.read_model(path)
    whole = mbsim.simulate(model, output=tmp_path / "whole")

    from mbsim.errors import Interrupted
    from mbsim.run import loop

    sense = loop.Runner._sense

    def stopping(runner, end, start=False):
        goes_on = sense(runner, end, start)
        runner.interrupted = True
        return goes_on

    monkeypatch.setattr(loop.Runner, "_sense", stopping)
    with pytest.raises(Interrupted, match=r"time 0\.105"):
        mbsim.simulate(model, output=tmp_path / "cut")
    monkeypatch.undo()
    resumed = mbsim.simulate(model, output=tmp_path / "cut", resume=True)
    for name in ("time", "state/y", "events", "requests/1"):
        np.testing.assert_array_equal(whole[name], resumed[name])


def test_touch_and_leave_stand_at_their_own_times(tmp_path):
    # without gravity and damping: the contact takes 2.9432 deepest depth / speed (Hertz)
    impact = contact(stiffness=1e5, exponent=1.5, damping=0.0, dmax=1e-3)
    model = GROUND + sphere(0.5, v=(0.0, 0.0, -4.0)) + impact
    results = run_deck(tmp_path, model, 0.3, 0.3, tol=1e-8)
    events = results["events"]
    assert events["kind"].tolist() == ["touch", "leave"]
    deepest = (1.25 * 4.0**2 / 1e5) ** 0.4
    expected = [0.1, 0.1 + 2.94327 * deepest / 4.0]
    np.testing.assert_allclose(events["time"], expected, rtol=0, atol=1e-6)


@pytest.mark.parametrize(
    ("statement", "said"),
    [
        (sensor(1, "DZ(77)"), "77"),
        (sensor(1, "TIME", "NE"), 'compare="NE".*GE, LE, GT, LT, EQ'),
        (sensor(1, "TIME", evaluate_id=3), 'evaluate_id="3": no Sensor_Evaluate has this id'),
        ('<Sensor_Evaluate id="3" expr="DZ(77)"/>', r"Sensor_Evaluate\[3\].*77"),
        (sensor(1, "TIME", dt=-1), 'dt="-1".*> 0'),
        ('<Post_Request id="1" type="EXPRESSION" expr2="SENVAL(4)"/>', "4"),
    ],
)
def test_what_cannot_be_is_one_clear_line(tmp_path, statement, said):
    with pytest.raises(DeckError, match=said):
        run_deck(tmp_path, FALL + statement)


def test_adams_sensor(tmp_path):
    path = tmp_path / "deck.adm"
    path.write_text(
        "a deck\nUNITS/FORCE=NEWTON, MASS=KILOGRAM, LENGTH=METER, TIME=SECOND\nPART/1, GROUND\n"
        "DIFF/1, IC=0.0, FUNCTION=1\n"
        "SENSOR/1, FUNCTION=DIF(1), VALUE=0.5, GE, ERROR=1E-3, HALT, PRINT\nEND\n"
    )
    results = mbsim.simulate(mbsim.read_model(path), end_time=2.0, print_interval=0.01)
    assert results.stats["halted_by_sensor"] == 1
    assert 0.499 <= results["time"][-1] == times(results, 1)[0]


def test_an_adams_sensor_with_bisection_is_located(tmp_path):
    path = tmp_path / "deck.adm"
    path.write_text(
        "a deck\nUNITS/FORCE=NEWTON, MASS=KILOGRAM, LENGTH=METER, TIME=SECOND\nPART/1, GROUND\n"
        "DIFF/1, IC=1.0, FUNCTION=-DIF(1)\n"
        "SENSOR/1, FUNCTION=DIF(1), VALUE=0.5, LE, ERROR=0.1, HALT, BISECTION\nEND\n"
    )
    results = mbsim.simulate(mbsim.read_model(path), end_time=2.0, print_interval=0.01, tol=1e-12)
    np.testing.assert_allclose(times(results, 1), [math.log(2.0)], rtol=0, atol=1e-9)
