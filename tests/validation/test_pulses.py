"""Forces of TIME whose pulses are shorter than a step: the impulse is the exact integral."""

from __future__ import annotations

import math

import numpy as np
import pytest

import mbsim
from helpers.decks import GRAVITY, GROUND, contact, run_deck, run_in_pieces, sphere, write_deck
from mbsim.compile_model.timetable import Timetable, _Group
from mbsim.errors import SolverError

METHODS = ["DOPRI5", "DOP853", "RADAU5", "GALPHA", "AUTO"]
ROOT_PI = math.sqrt(math.pi)
#: Where SIN(2 PI t) is above 0.99, a part of its period.
ABOVE = 0.5 - math.asin(0.99) / math.pi
BODY = """
<Body_Rigid id="1" isground="TRUE"/>
<Reference_Marker id="10" body_id="1"/>
<Body_Rigid id="2" cg_id="20" mass="1" inertia_xx="1" inertia_yy="1" inertia_zz="1"/>
<Reference_Marker id="20" body_id="2"/>
"""


def power_of_sine(n):
    """Return the mean of sin^n over a period: (n - 1)!! / n!! for even n."""
    return math.prod((k - 1.0) / k for k in range(2, n + 1, 2))


def force(expression):
    return BODY + (
        '<Force_Vector_OneBody id="1" type="ForceOnly" i_marker_id="20" ref_marker_id="10" '
        f'fx_expression="{expression}"/>'
    )


#: Expression, what is beside it, and the impulse over ten seconds.
PULSES = {
    "sine": ("100*SIN(2*PI*TIME)**400", "", 1e3 * power_of_sine(400)),
    "gauss": ("100*EXP(-((TIME-5)/0.01)**2)", "", ROOT_PI),
    "max": (
        "MAX(0,SIN(2*PI*TIME)-0.99)*1E4",
        "",
        1e5 * (math.sqrt(1.0 - 0.99**2) / math.pi - 0.99 * ABOVE),
    ),
    "periodic if": ("IF(SIN(2*PI*TIME)-0.99: 0, 0, 100)", "", 1e3 * ABOVE),
    "train": ("100*MAX(0, AINT(MOD(TIME,1)+0.01))", "", 10.0),
    "square": ("IF(TIME-5.003: 0, 100, IF(TIME-5.013: 100, 0, 0))", "", 1.0),
    "steps": ("STEP(TIME,5,0,5.001,100)*STEP(TIME,5.01,1,5.011,0)", "", 1.0),
    "mod": ("IF(MOD(TIME,0.5)-0.001: 1000, 0, 0)", "", 20.0),
    "sign": ("50*(SIGN(1,TIME-5)-SIGN(1,TIME-5.01))", "", 1.0),
    "havsin": ("HAVSIN(TIME,5,0,5.01,100)-HAVSIN(TIME,5.01,0,5.02,100)", "", 1.0),
    "tanh": ("50*(TANH((TIME-5)*1E3)-TANH((TIME-5.01)*1E3))", "", 1.0),
    "variable": (
        "VARVAL(7)*100",
        '<Reference_Variable id="7" type="EXPRESSION" expr="EXP(-((TIME-5)/0.01)**2)"/>',
        ROOT_PI,
    ),
    "spline": (
        "LINSPL(TIME,0,5,0)",
        '<Reference_Spline id="5" x="0,4.99,5,5.01,10" y="0,0,100,0,0"/>',
        1.0,
    ),
    "beside a state": ("EXP(-((TIME-5)/0.01)**2)*(100+0*DX(20,10))", "", ROOT_PI),
    "choice beside a state": (
        "IF(ABS(TIME-5)-0.005: 100+0*DX(20,10), 0, 0*VX(20,10))",
        "",
        1.0,
    ),
}


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("name", PULSES)
def test_the_impulse_is_the_integral(tmp_path, name, method):
    expression, beside, wanted = PULSES[name]
    path = write_deck(tmp_path, beside + force(expression), 10.0, 0.1)
    model = mbsim.read_model(path)
    for tol in (1e-3, 1e-5):
        got = mbsim.simulate(model, integrator=method, tol=tol)["bodies/2/velocity/x"][-1]
        # tol is of a step's error over the speed so far, and several steps go through a pulse
        assert got == pytest.approx(wanted, abs=5.0 * tol * max(1.0, wanted))


@pytest.mark.parametrize("tol", [1e-3, 1e-5])
def test_a_narrow_pulse_late_in_a_long_run_is_met(tmp_path, tol):
    # 1e-6 s in 1e4 s; time itself has 16 digits, so the pulse's edges 2e-6 of its width
    results = run_deck(tmp_path, force("IF(ABS(TIME-7777.7)-5E-7: 1E6, 0, 0)"), 1e4, 100.0, tol=tol)
    assert results["bodies/2/velocity/x"][-1] == pytest.approx(1.0, abs=1e-5)
    assert results.stats["steps"] < 100


def test_a_ball_at_rest_is_kicked_after_hours(tmp_path):
    model = (
        GROUND
        + sphere(0.1 - (9.81 / 1e5) ** (2.0 / 3.0))
        + contact(damping=50, dmax=1e-4)
        + GRAVITY
        + '<Force_Vector_OneBody id="1" type="ForceOnly" i_marker_id="20" ref_marker_id="10" '
        'fx_expression="2*EXP(-((TIME-9000.05)/0.05)**2)"/>'
    )
    results = run_deck(tmp_path, model, 1e4, 100.0)
    assert results["bodies/2/velocity/x"][-1] == pytest.approx(0.1 * ROOT_PI, rel=1e-4)
    assert results["bodies/2/velocity/x"][89] == 0.0


def test_units_of_time_do_not_matter(tmp_path):
    # 100 N for 10 ms on 1 kg, in N, kg, m and ms: 1e-3 m/ms
    unit = (
        '<Param_Unit force_unit="NEWTON" mass_unit="KILOGRAM" length_unit="METER" '
        'time_unit="MILLISECOND"/>'
    )
    model = unit + force("100*EXP(-((TIME-5000)/10)**2)")
    results = run_deck(tmp_path, model, 1e4, 100.0)
    assert results["bodies/2/velocity/x"][-1] == pytest.approx(1e-3 * ROOT_PI, rel=1e-5)


def test_gravity_that_pulses(tmp_path):
    model = BODY + '<Force_Gravity grav_x="100*EXP(-((TIME-5)/0.01)**2)"/>'
    for method in ("AUTO", "VERLET"):
        results = run_deck(tmp_path, model, 10.0, 0.1, integrator=method, tol=1e-4)
        assert results["bodies/2/velocity/x"][-1] == pytest.approx(ROOT_PI, rel=1e-4)


def test_a_state_whose_slope_pulses(tmp_path):
    model = BODY + '<Control_Diff id="3" expr="100*EXP(-((TIME-5)/0.01)**2)"/>'
    results = run_deck(tmp_path, model, 10.0, 0.1, tol=1e-7)
    assert results["diffs/3/value"][-1] == pytest.approx(ROOT_PI, rel=1e-5)


@pytest.mark.parametrize("located", ["TRUE", "FALSE"])
def test_a_sensor_of_time_sees_what_is_shorter_than_a_step(tmp_path, located):
    # SIN(2 PI t) is above 0.9999 for 4.5 ms; nothing else makes steps short
    watch = (
        f'<Sensor_Event id="1" type="EXPRESSION" zero_crossing="{located}" compare="GE" '
        'value="0.9999" expr="SIN(2*PI*TIME)*STEP(TIME,3,0,3.1,1)" halt="TRUE"/>'
    )
    results = run_deck(tmp_path, force("0*DX(20)") + watch, 10.0, 10.0)
    assert results["time"][-1] == pytest.approx(3.25 - math.acos(0.9999) / (2 * math.pi), abs=1e-9)


@pytest.mark.parametrize(
    ("expression", "end"),
    [
        ("10*SIN(2*PI*TIME)", 10.0),
        ("10*SIN(2*PI*TIME)-40*DX(20,10)", 20.0),
        ("3*SIN(2*PI*TIME)+2*COS(17*TIME)", 20.0),
        ("SWEEP(TIME,5,1,0.5,9,5,0.1)", 10.0),
        ("HAVSIN(TIME,1,0,9,1)", 10.0),
    ],
)
def test_slow_functions_cost_nothing(tmp_path, monkeypatch, expression, end):
    model = mbsim.read_model(write_deck(tmp_path, force(expression), end, end / 10.0))
    for tol in (1e-3, 1e-5):
        bounded = mbsim.simulate(model, tol=tol).stats["rhs_evaluations"]
        with monkeypatch.context() as patch:
            made = Timetable.__init__

            def unbounded(self, *arguments, made=made):
                made(self, *arguments)
                self.timed = False

            patch.setattr(Timetable, "__init__", unbounded)
            free = mbsim.simulate(model, tol=tol).stats["rhs_evaluations"]
        assert bounded <= 1.03 * free + 12


def test_steps_of_given_length_are_not_looked_into(tmp_path, monkeypatch):
    # cells shorter than h_min bound no step: a driven ram took seconds for what changed nothing
    ram = (
        '<Constraint_Joint id="1" type="TRANSLATIONAL" i_marker_id="20" j_marker_id="10"/>'
        '<Motion_Joint id="1" joint_id="1" motion_type="T" val_type="D" '
        'expr="0.1*STEP(TIME,0.1,0,0.4,1)"/>'
        '<Param_Transient integrator_type="MOREAU" h_max="1e-3" h_min="1e-3"/>'
    )
    looked, judge = [0], _Group.judge

    def counted(self, member, *others):
        looked[0] += len(member)
        return judge(self, member, *others)

    monkeypatch.setattr(_Group, "judge", counted)
    run = run_deck(tmp_path, BODY + ram, 0.5, 0.01, tol=1e-8)
    assert run.stats["steps"] == 500
    assert looked[0] < 20 * 500
    t = np.clip((run["time"] - 0.1) / 0.3, 0.0, 1.0)
    np.testing.assert_allclose(
        run["bodies/2/position/z"], 0.1 * t * t * (3.0 - 2.0 * t), atol=1e-12
    )


def test_a_run_in_pieces_is_the_same(tmp_path, monkeypatch):
    # some hundred pulses: more rows than the table has at first
    path = write_deck(tmp_path, force("100*SIN(20*PI*TIME)**400"), 20.0, 0.5)
    model = mbsim.read_model(path)
    straight = mbsim.simulate(model)
    pieces = run_in_pieces(model, tmp_path / "out", monkeypatch)
    np.testing.assert_array_equal(straight["state/y"], pieces["state/y"])
    assert straight.stats["steps"] == pieces.stats["steps"]
    wanted = 2e3 * power_of_sine(400)
    assert straight["bodies/2/velocity/x"][-1] == pytest.approx(wanted, rel=1e-5)  # tol


def test_a_pole_of_time_says_where(tmp_path):
    with pytest.raises(SolverError, match=r"time 4\.99|time 5"):
        run_deck(tmp_path, force("1/(TIME-5)**2"), 10.0, 0.1)
