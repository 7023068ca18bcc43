"""Force_DryFriction between markers, rigid and with a spring: closed forms, holding, resume."""

from __future__ import annotations

import math

import numpy as np
import pytest

import mbsim
from helpers.blocks import GROUND, body, spring
from helpers.decks import drift, run_deck, run_in_pieces, write_deck
from mbsim.errors import DeckError, ModelError

IMPLICIT = ("RADAU5", "GALPHA")


def friction(more, i=20, j=10, type="TX"):
    """Return a Force_DryFriction."""
    return f"""
<Force_DryFriction id="7" type="{type}" i_marker_id="{i}" j_marker_id="{j}" {more}/>"""


def test_sdnd100_turns_and_stops_where_it_must(tmp_path):
    # each half period pi/100 of slip takes 2 F/k = 0.2 mm of the amplitude, until k x < F
    model = GROUND + body(2, 1.0, x=0.00085) + spring(1e4) + friction('friction="1"')
    half = math.pi / 100.0
    results = run_deck(tmp_path, model, 0.2, half, integrator="RADAU5", tol=1e-9)
    x = results["bodies/2/position"][:, 0]
    np.testing.assert_allclose(x[:5] * 1e3, [0.85, -0.65, 0.45, -0.25, 0.05], rtol=0, atol=1e-8)
    events = results["events"]
    assert events["kind"].tolist() == ["slip", "slip", "slip", "stick"]
    assert events["element"].tolist() == [7] * 4
    np.testing.assert_allclose(events["time"], half * np.arange(1, 5), rtol=0, atol=1e-9)
    # from there on nothing moves at all, under the force of the spring
    assert np.ptp(x[4:]) == 0.0
    np.testing.assert_allclose(results["bodies/2/velocity"][5:], 0.0, rtol=0, atol=0)
    force = results["dry_frictions/7/force"][5:, 0]
    np.testing.assert_allclose(force, 0.5, rtol=1e-6)
    assert drift(results) < 1e-8 * results["energy/potential"][0]


@pytest.mark.parametrize("method", ["DOPRI5", "DOP853", *IMPLICIT])
def test_a_spring_before_the_slider_gives_way_and_sticks_in_time(method, tmp_path):
    # stick: x = v/w sin(w t); slip from k x = F on; stick again where x' = 0
    k, c, v, f = 50.0, 4.0, 1.0, 1.0
    model = GROUND + body(2, 1.0, v=v) + spring(c) + friction('friction="1" dx="0.02"')
    w, slow = math.sqrt(k + c), math.sqrt(c)
    first = math.asin(f / k * w / v) / w
    speed, place = v * math.cos(w * first), f / k
    second = first + math.atan(speed * slow / (c * place + f)) / slow
    end = math.hypot(place + f / c, speed / slow) - f / c
    results = run_deck(tmp_path, model, 1.0, second, integrator=method, tol=1e-9)
    events = results["events"]
    assert events["kind"][:2].tolist() == ["slip", "stick"]
    close = 1e-6 if method == "GALPHA" else 1e-8
    np.testing.assert_allclose(events["time"][:2], [first, second], rtol=0, atol=close)
    assert results["bodies/2/position"][1, 0] == pytest.approx(end, abs=close)
    assert drift(results) < 1e-6


#: The seed's oscillator on friction; 3 kg of it stop within 15 s.
SEED = (
    GROUND
    + body(2, 3.0, v=1.0)
    + """
<Force_Scalar_TwoBody id="1" type="Force" action_only="TRUE" i_marker_id="20" j_marker_id="12"
  expr="-DX(20,10)-0.3*DX(20,10)**2-VX(20,10)-2*VX(20,10)**2"/>
<Reference_Marker id="12" body_id="1" psi="1.5707963267948966" theta="1.5707963267948966"/>"""
)


@pytest.mark.parametrize("method", IMPLICIT)
def test_what_sticks_needs_the_static_force_at_once(method, tmp_path):
    model = SEED + friction('friction="0.1"')
    results = run_deck(tmp_path, model, 16.5, 0.15, integrator=method, tol=1e-6)
    events = results["events"]
    at = events["time"][events["kind"] == "stick"][-1]
    rows = results["time"] > at
    x = results["bodies/2/position"][rows, 0]
    force = results["dry_frictions/7/force"][rows, 0]
    assert rows.sum() > 20
    assert np.ptp(x) < 1e-14
    np.testing.assert_allclose(force, x + 0.3 * x * x, rtol=0, atol=1e-6)
    assert np.abs(force).max() < 0.1


RAMP = """
<Force_Scalar_TwoBody id="1" type="Force" action_only="TRUE" i_marker_id="20" j_marker_id="12"
  expr="IF(TIME-0.8: 10*TIME, 10*TIME, 0)"/>
<Reference_Marker id="12" body_id="1" psi="1.5707963267948966" theta="1.5707963267948966"/>"""


@pytest.mark.parametrize("method", IMPLICIT)
def test_two_masses_part_and_meet_as_friction_lets_them(method, tmp_path):
    # 10 t pulls 2 kg, which drag 1 kg: 10 t/3 = F_s parts them; the relative speed w, w' =
    # (10 t - F)/2 - F, then loses 3 F/2 a second from 0.8 s on, when nothing pulls any more
    static, level, end = 1.5, 1.0, 0.8
    parts = 3.0 * static / 10.0
    speed = 10.0 * (end**2 - parts**2) / 4.0 - 1.5 * level * (end - parts)
    meets = end + speed / (1.5 * level)
    both = 10.0 * end**2 / 2.0 / 3.0
    model = GROUND + body(2, 2.0) + body(3, 1.0) + RAMP
    model += friction(f'friction="{level}" friction_static="{static}"', i=30, j=20)
    results = run_deck(tmp_path, model, 1.5, integrator=method, tol=1e-7)
    events = results["events"]
    assert events["kind"].tolist() == ["slip", "stick"]
    np.testing.assert_allclose(events["time"], [parts, meets], rtol=0, atol=1e-4)
    for id in (2, 3):
        assert results[f"bodies/{id}/velocity"][-1, 0] == pytest.approx(both, abs=1e-4)


@pytest.mark.parametrize(("dx", "method"), [(0.0, "RADAU5"), (1e-3, "RADAU5"), (1e-3, "DOPRI5")])
def test_friction_about_an_axis_stops_a_spin(dx, method, tmp_path):
    model = GROUND + body(2, 1.0, w=3.0) + friction(f'friction="0.2" dx="{dx}"', type="RX")
    results = run_deck(tmp_path, model, 2.0, integrator=method, tol=1e-8)
    events = results["events"]
    stop = events["time"][events["kind"] == "stick"][0]
    # 0.1 kg m2 under 0.2 N m
    assert stop == pytest.approx(1.5, abs=1e-9 if dx == 0.0 else 1e-3)
    turned = results["bodies/2/angular_velocity"][:, 0]
    if dx == 0.0:
        assert np.abs(turned[results["time"] > 1.5]).max() < 1e-30
    assert np.abs(turned[results["time"] > 1.51]).max() <= 1e-30 + (0.2 * dx / 0.1) ** 0.5 * 1.001


def test_what_is_at_rest_stays_where_the_force_is_within_the_limit(tmp_path):
    model = GROUND + body(2, 1.0, x=0.05) + spring(10.0) + friction('friction="1"')
    results = run_deck(tmp_path, model, 1.0)
    assert len(results["events"]) == 0
    np.testing.assert_array_equal(results["bodies/2/position"][:, 0], 0.05)
    np.testing.assert_allclose(results["dry_frictions/7/force"][:, 0], 0.5, rtol=1e-12)


@pytest.mark.parametrize(
    ("more", "rest"),
    [
        # held where it is; in series 1000/11 N/m; slid until the limit holds
        ('friction="1"', 0.05),
        ('friction="1" dx="0.01"', 0.05 / 1.1),
        ('friction="0.2"', 0.02),
        ('friction="0.2" dx="0.01"', 0.02),
    ],
)
def test_a_static_simulate_finds_where_friction_holds(more, rest, tmp_path):
    path = write_deck(tmp_path, GROUND + body(2, 1.0, x=0.05) + spring(10.0) + friction(more))
    both = path.read_text().replace("<Command>", '<Command><Simulate analysis_type="Static"/>')
    path.write_text(both, encoding="utf-8")
    results = mbsim.simulate(mbsim.read_model(path), integrator="RADAU5", tol=1e-8)
    x = results["bodies/2/position"][:, 0]
    np.testing.assert_allclose(x, rest, rtol=0, atol=1e-9)
    np.testing.assert_allclose(results["dry_frictions/7/force"][:, 0], 10.0 * rest, rtol=1e-7)


@pytest.mark.parametrize(("dx", "method"), [(0.0, "RADAU5"), (0.0, "GALPHA"), (0.02, "DOPRI5")])
def test_resumed_it_is_the_same_run(dx, method, tmp_path, monkeypatch):
    text = GROUND + body(2, 1.0, x=0.85) + spring(4.0) + friction(f'friction="0.4" dx="{dx}"')
    model = mbsim.read_model(write_deck(tmp_path, text, 8.0, 0.1))
    settings = {"integrator": method, "tol": 1e-5}
    straight = mbsim.simulate(model, **settings)
    assert len(straight["events"]) >= 4
    found = run_in_pieces(model, tmp_path, monkeypatch, **settings)
    for name in straight.keys():
        np.testing.assert_array_equal(found[name], straight[name], err_msg=name)
    found.close()


@pytest.mark.parametrize("method", ["RADAU5", "GALPHA"])
def test_what_rests_under_a_load_that_comes_and_goes_slips_in_time(method, tmp_path):
    # nothing moves, so that no error shortens a step: it is not to miss the load's peak
    push = """
<Force_Vector_OneBody id="3" type="ForceOnly" i_marker_id="20" ref_marker_id="10"
  fx_expression="1.01*SIN(9*TIME)" fy_expression="0" fz_expression="0"/>"""
    results = run_deck(
        tmp_path,
        GROUND + body(2, 1.0) + push + friction('friction="1"'),
        3.0,
        0.5,
        integrator=method,
    )
    times = results["events"]["time"][results["events"]["kind"] == "slip"]
    np.testing.assert_allclose(times[0], math.asin(1.0 / 1.01) / 9.0, rtol=0, atol=1e-6)
    # at every peak
    assert len(times) == 9


def test_what_a_motion_drives_is_rubbed_both_ways(tmp_path):
    turned = 'psi="1.5707963267948966" theta="1.5707963267948966"'
    model = (
        GROUND
        + body(2, 1.0)
        + f"""
<Reference_Marker id="12" body_id="1" {turned}/><Reference_Marker id="21" body_id="2" {turned}/>
<Constraint_Joint id="1" type="TRANSLATIONAL" i_marker_id="21" j_marker_id="12"/>
<Motion_Joint id="1" joint_id="1" motion_type="T" val_type="D" expr="SIN(3*TIME)"/>"""
        + friction('friction="0.7"')
    )
    results = run_deck(tmp_path, model, 3.0, 0.05, integrator="RADAU5", tol=1e-8)
    speed = np.cos(3.0 * results["time"])
    force = results["dry_frictions/7/force"][:, 0]
    np.testing.assert_allclose(force[1:], -0.7 * np.sign(speed[1:]), rtol=1e-12)
    turns = np.sin(3.0 * np.array([0.0, *(math.pi / 6.0 * k for k in (1, 3, 5)), 3.0]))
    way = np.abs(np.diff(turns)).sum()
    assert results["energy/dissipated"][-1] == pytest.approx(0.7 * way, rel=1e-6)


def test_two_frictions_side_by_side_hold_together(tmp_path):
    # 1 N and 2 N hold 2.5 N, and not 3.5
    for x, held in ((0.25, True), (0.35, False)):
        model = GROUND + body(2, 1.0, x=x) + spring(10.0) + friction('friction="1"')
        model += friction('friction="2"').replace('id="7"', 'id="8"')
        results = run_deck(tmp_path, model, 0.2, integrator="RADAU5")
        force = results["dry_frictions/7/force"][:, 0] + results["dry_frictions/8/force"][:, 0]
        np.testing.assert_allclose(force, 2.5 if held else 3.0, rtol=1e-9)
        assert (results["bodies/2/position"][-1, 0] == x) == held


def test_explicit_methods_refuse_rigid_friction(tmp_path):
    model = mbsim.read_model(write_deck(tmp_path, GROUND + body(2, 1.0) + friction('friction="1"')))
    for method in ("DOPRI5", "DOP853"):
        with pytest.raises(ModelError, match=r"Force_DryFriction\[7\]: dx=0: rigid .* GALPHA or"):
            mbsim.simulate(model, integrator=method)
    with pytest.raises(ModelError, match=r"Force_DryFriction\[7\]: integrator VERLET"):
        mbsim.simulate(model, integrator="VERLET")


def test_auto_says_that_it_runs_the_implicit_method(tmp_path):
    text = GROUND + body(2, 1.0) + friction('friction="1"')
    from mbsim.run.settings import settle

    settings = settle(mbsim.read_model(write_deck(tmp_path, text)))
    assert settings.integrator == "RADAU5"
    said = "integrator AUTO: RADAU5 from the start, for Force_DryFriction[7] is rigid"
    assert said in settings.notes


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ('friction="0"', 'friction="0": must be a number > 0'),
        ("", "friction: missing"),
        ('friction="1" dx="-1"', 'dx="-1": must be'),
        ('friction="1" friction_static="0.5"', "must be a number >= friction (1)"),
        ('friction="1" scale="2"', 'scale="2": is Muscade'),
    ],
)
def test_what_a_deck_may_not_say(more, said, tmp_path):
    path = write_deck(tmp_path, GROUND + body(2, 1.0) + friction(more))
    with pytest.raises(DeckError) as error:
        mbsim.read_model(path)
    assert said in str(error.value)


def test_the_other_types_and_markers(tmp_path):
    for type in ("TX", "TY", "TZ", "RX", "RY", "RZ"):
        text = GROUND + body(2, 1.0) + friction('friction="1" dx="0.1"', type=type)
        (made,) = mbsim.read_model(write_deck(tmp_path, text)).table("DRYFRICTION").values()
        assert made.type == type
    with pytest.raises(DeckError, match='type="T": must be'):
        mbsim.read_model(write_deck(tmp_path, GROUND + body(2, 1.0) + friction("", type="T")))
    path = write_deck(tmp_path, GROUND + body(2, 1.0) + friction('friction="1"', j=99))
    with pytest.raises(DeckError, match="j_marker_id"):
        mbsim.read_model(path)
