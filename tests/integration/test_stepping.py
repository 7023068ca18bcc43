"""`mbsim.open`: steps against `simulate` and closed forms, inputs, states, signals, failures."""

from __future__ import annotations

import io
import math
import pickle
from pathlib import Path

import numpy as np
import pytest

import mbsim
from helpers.folders import MODELS
from mbsim.errors import ModelError, SolverError, UnknownSignal

#: A mass on a rail along z: m z'' = push - spring z, m = 1, spring = 100.
PUSHED = """<MotionSolve><Model>
<Body_Rigid id="1" isground="TRUE"/>
<Body_Rigid id="2" cg_id="20" mass="1" inertia_xx="0.01" inertia_yy="0.01" inertia_zz="0.01"/>
<Reference_Marker id="10" body_id="1"/>
<Reference_Marker id="20" body_id="2"/>
<Reference_Variable id="5" label="push" expr="0"/>
<Reference_Variable id="6" label="spring" expr="100"/>
<Reference_Variable id="7" label="ramp" expr="2*TIME"/>
<Constraint_Joint id="1" type="TRANSLATIONAL" i_marker_id="20" j_marker_id="10"/>
<Force_Vector_OneBody id="1" type="FORCEONLY" i_marker_id="20" fx_expression="0"
  fy_expression="0" fz_expression="VARVAL(5) - VARVAL(6)*DZ(20,10){force}"/>
<Post_Request id="1" type="EXPRESSION" expr2="VARVAL(5)" expr3="VARVAL(7)"
  expr4="DZ(20,10)"/>
{more}
</Model><Command>
<Simulate analysis_type="Transient" end_time="1" print_interval="0.01"/>
</Command></MotionSolve>"""
METHODS = ("AUTO", "DOPRI5", "DOP853", "RADAU5", "GALPHA")


def pushed(force="", more=""):
    """Return the deck as text."""
    return PUSHED.format(force=force, more=more)


def spun(speed="V", more=""):
    """Return the deck of a wheel that a motion turns about z."""
    return f"""<MotionSolve><Model>
<Body_Rigid id="1" isground="TRUE"/>
<Body_Rigid id="2" cg_id="20" mass="1" inertia_xx="0.01" inertia_yy="0.01" inertia_zz="0.01"/>
<Reference_Marker id="10" body_id="1"/>
<Reference_Marker id="20" body_id="2"/>
<Constraint_Joint id="1" type="REVOLUTE" i_marker_id="20" j_marker_id="10"/>
<Motion_Joint id="3" label="drive" joint_id="1" val_type="{speed}" expr="0"/>{more}
</Model><Command><Simulate analysis_type="Transient" end_time="1" print_interval="0.1"/></Command>
</MotionSolve>"""


@pytest.mark.parametrize("name", ["free_top.xml", "bouncing_sphere.xml", "lugre_stick_slip.xml"])
def test_one_step_to_the_end_is_simulate(name):
    model = mbsim.read_model(MODELS / name)
    end = min(0.3, model.simulations[-1].end_time)
    whole = mbsim.simulate(model, end_time=end, integrator="DOPRI5")
    with mbsim.open(model, end_time=end, integrator="DOPRI5") as sim:
        assert sim.step_to(end) == end
        assert sim.finished
        results = sim.results()
    assert results.status == "finished"
    assert results.signals().keys() == whole.signals().keys()
    for signal in whole.signals():
        np.testing.assert_array_equal(results[signal], whole[signal], err_msg=signal)


@pytest.mark.parametrize("method", METHODS)
def test_the_pattern_of_steps_changes_nothing_but_errors(method):
    # z(t) = push/k (1 - cos(w t)), w = 10
    found = []
    for count in (1, 7, 400):
        with mbsim.open(pushed(), integrator=method, tol=1e-8) as sim:
            sim.inputs["push"] = 3.0
            for k in range(1, count + 1):
                sim.step_to(k / count)
            assert sim.time == 1.0
            found.append(sim.signals["bodies/2/position/z"])
    exact = 0.03 * (1.0 - math.cos(10.0))
    np.testing.assert_allclose(found, exact, atol=2e-7)


def test_how_far_is_stepped_at_once_does_not_choose_the_method():
    # a contact that is stiff: the run's rest is worth the implicit method, a step's is not
    evaluations = []
    for pieces in (1, 100):
        with mbsim.open(MODELS / "pendulum_wheel.xml", end_time=1.0) as sim:
            sim.inputs["torque"] = 1e-12
            for k in range(pieces):
                sim.step_to((k + 1) / pieces)
            evaluations.append(sim.results().stats["rhs_evaluations"])
    # 320 and 690; where the explicit method is kept 9000
    assert evaluations[1] < 4 * evaluations[0]


@pytest.mark.parametrize("method", METHODS)
def test_what_is_set_between_steps_acts_from_there_on(method):
    """Exact between the times at which the force changes: no slope of the one before is used."""
    forces = [5.0, -20.0, 0.0, 40.0, 40.0, -7.0, 3.0, 100.0]
    z, v, w, h = 0.0, 0.0, 10.0, 0.1
    with mbsim.open(pushed(), integrator=method, tol=1e-8) as sim:
        for force in forces:
            sim.inputs["push"] = force
            sim.step(h)
            rest = force / 100.0
            z, v = (
                rest + (z - rest) * math.cos(w * h) + v / w * math.sin(w * h),
                v * math.cos(w * h) - (z - rest) * w * math.sin(w * h),
            )
            assert sim.signals["bodies/2/position/z"] == pytest.approx(z, abs=3e-6)
            assert sim.signals["bodies/2/velocity"][2] == pytest.approx(v, abs=3e-5)
            # the force that acts now, not that at the step's begin
            force_now = sim.signals["body_forces/1/force/z"]
            assert force_now == pytest.approx(force - 100.0 * z, abs=1e-3)
        assert sim.signals["requests/1/F2"] == forces[-1]


@pytest.mark.parametrize("method", [*METHODS, "VERLET"])
@pytest.mark.parametrize("name", ["bouncing_sphere.xml", "free_top.xml"])
def test_a_state_gone_back_to_goes_on_bit_by_bit(name, method):
    model = mbsim.read_model(MODELS / name)

    def go_on(sim):
        """Return what follows from here."""
        found = []
        for _ in range(12):
            sim.step(0.004)
            found.append((sim.time, *sim.state.arrays["method/y"]))
        return np.array(found)

    with mbsim.open(model, integrator=method) as sim:
        sim.step_to(0.05)
        kept = sim.state
        first = go_on(sim)
        packed = pickle.dumps(kept)
        sim.state = kept
        assert sim.time == kept.time == 0.05
        np.testing.assert_array_equal(go_on(sim), first)
        rows = len(sim.results()["time"])
        sim.state = kept.copy()
        np.testing.assert_array_equal(go_on(sim), first)
        assert len(sim.results()["time"]) == rows
    with mbsim.open(model, integrator=method) as other:
        other.state = pickle.loads(packed)
        np.testing.assert_array_equal(go_on(other), first)


def test_friction_that_sticks_goes_on_bit_by_bit_and_looking_changes_nothing():
    model = mbsim.read_model(MODELS / "lugre_stick_slip.xml")

    def run(look, back):
        with mbsim.open(model) as sim:
            for k in range(60):
                sim.step(0.004)
                if look:
                    assert len(list(map(sim.signals.get, sim.signals))) == len(sim.signals)
                if back and k % 7 == 3:
                    kept = sim.state
                    sim.step(0.01)
                    sim.state = kept
            return sim.state.arrays["method/y"], sim.results()["time"]

    (y, times), *others = (run(False, False), run(True, False), run(False, True))
    for other, other_times in others:
        np.testing.assert_array_equal(other, y)
        np.testing.assert_array_equal(other_times, times)


def test_rows_are_those_of_the_state_that_is_gone_back_to():
    with mbsim.open(pushed()) as sim:
        sim.inputs["push"] = 1.0
        sim.step_to(0.5)
        kept = sim.state
        before = sim.results()
        sim.inputs["push"] = -50.0
        sim.step_to(0.9)
        other = sim.state
        sim.state = kept
        assert sim.inputs["push"] == 1.0
        np.testing.assert_array_equal(
            sim.results()["bodies/2/position"], before["bodies/2/position"]
        )
        sim.step_to(1.0)
        sim.state = other
        results = sim.results()
    assert len(results["time"]) == 91
    assert results.status == "running"
    assert results["requests/1/F2"][-1] == -50.0
    assert results["requests/1/F2"][40] == 1.0


def test_signals_are_those_of_the_result_file():
    model = mbsim.read_model(MODELS / "bouncing_sphere.xml")
    with mbsim.open(model, integrator="DOPRI5") as sim:
        interval = model.simulations[0].print_interval
        for k in range(1, 6):
            sim.step_to(40 * k * interval)
        results = sim.results()
        last = len(results["time"]) - 1
        assert results["time"][last] == pytest.approx(sim.time)
        for name in sim.signals:
            np.testing.assert_allclose(
                sim.signals[name], results[name][last], rtol=1e-9, atol=1e-12, err_msg=name
            )
        assert {*sim.signals} == {n for n in results.signals()}
        assert sim.signals["bodies/2/velocity/mag"] == pytest.approx(
            np.linalg.norm(sim.signals["bodies/2/velocity"])
        )
        with pytest.raises(UnknownSignal, match="did you mean bodies/2/position"):
            sim.signals["bodies/2/positon"]
        with pytest.raises(UnknownSignal, match="bodies/2/position has x, y, z, mag"):
            sim.signals["bodies/2/position/w"]


def test_a_label_of_two_inputs_is_told_their_paths():
    deck = pushed().replace('label="spring"', 'label="push"')
    with mbsim.open(deck) as sim:
        with pytest.raises(ModelError, match="variables/5 and variables/6 have this label"):
            sim.inputs["push"] = 1.0
    with pytest.raises(ModelError, match="variables/5 and variables/6 have this label"):
        mbsim.open(deck, inputs="push")


def test_a_label_in_place_of_an_id_is_told_its_id():
    deck = pushed().replace('id="2" cg_id', 'id="2" label="Slider" cg_id')
    deck = deck.replace('Constraint_Joint id="1"', 'Constraint_Joint id="1" label="rail"')
    with mbsim.open(deck) as sim:
        for said in (sim.signals, sim.results()):
            for asked, meant in (
                ("bodies/slider/velocity/x", "bodies/2/velocity/x"),
                ("joints/rail/force", "joints/1/force"),
            ):
                with pytest.raises(UnknownSignal, match=rf"did you mean {meant}\?"):
                    said[asked]


def test_inputs_are_found_by_label_and_by_path():
    with mbsim.open(pushed()) as sim:
        assert dict(sim.inputs) == {"push": 0.0, "spring": 100.0}
        sim.inputs["variables/5"] = 4
        assert sim.inputs["push"] == 4.0
        assert "ramp" not in sim.inputs
        with pytest.raises(ModelError, match="did you mean push"):
            sim.inputs["pusch"] = 1.0
        with pytest.raises(ModelError, match="must be a finite number"):
            sim.inputs["push"] = math.nan
        with pytest.raises(ModelError, match=r"no input 'ramp'.*inputs=\[...\]\) names it"):
            sim.inputs["ramp"] = 1.0
    with mbsim.open(pushed(), inputs=["ramp"]) as sim:
        assert sim.inputs["ramp"] == 0.0
        sim.inputs["ramp"] = 0.25
        assert sim.signals["requests/1/F3"] == 0.25
    with pytest.raises(ModelError, match=r"no variable and no motion 'rump'; did you mean ramp"):
        mbsim.open(pushed(), inputs=["rump"])


def test_a_number_beside_time_changes_what_is_known_of_it_ahead():
    # a pulse whose time is an input: steps must not go over it
    deck = pushed(" + 1000*EXP(-((TIME-VARVAL(8))/0.001)**2)")
    deck = deck.replace(
        "<Constraint", '<Reference_Variable id="8" label="when" expr="9"/><Constraint', 1
    )
    with mbsim.open(deck, integrator="DOPRI5", tol=1e-6) as sim:
        sim.inputs["spring"] = 0.0
        sim.step_to(0.2)
        assert sim.signals["bodies/2/velocity/z"] == pytest.approx(0.0, abs=1e-9)
        sim.inputs["when"] = 0.7
        sim.step_to(1.0)
        # the impulse: 1000 sqrt(pi) 0.001
        assert sim.signals["bodies/2/velocity/z"] == pytest.approx(math.sqrt(math.pi), rel=1e-4)


@pytest.mark.parametrize("method", ["DOPRI5", "RADAU5"])
def test_motions_as_inputs(method):
    with mbsim.open(spun("V"), inputs=["drive"], integrator=method) as sim:
        sim.step(0.1)
        sim.inputs["drive"] = 3.0
        assert sim.signals["bodies/2/angular_velocity/z"] == pytest.approx(3.0, abs=1e-12)
        sim.step(0.1)
        sim.inputs["drive"] = -1.0
        sim.step(0.1)
        w, _, _, z = sim.signals["bodies/2/quaternion"]
        assert 2.0 * math.atan2(z, w) == pytest.approx(0.2, abs=1e-6)
    with mbsim.open(spun("A"), inputs=["motions/3"], integrator=method) as sim:
        sim.inputs["drive"] = 2.0
        sim.step(0.5)
        assert sim.signals["bodies/2/angular_velocity/z"] == pytest.approx(1.0, abs=1e-9)
        sim.inputs["drive"] = 0.0
        sim.step(0.5)
        assert sim.signals["bodies/2/angular_velocity/z"] == pytest.approx(1.0, abs=1e-9)
        # the torque that the motion takes: J alpha, and none
        assert sim.signals["motions/3/torque/mag"] == pytest.approx(0.0, abs=1e-9)


def test_what_would_make_positions_jump_is_no_input():
    with pytest.raises(ModelError, match=r'Motion_Joint\[3\]: as an input.*val_type="V" or "A"'):
        mbsim.open(spun("D"), inputs=["drive"])
    held = '<Constraint_General id="9" expr="DZ(20,10)-VARVAL(8)"/>'
    deck = pushed(more=held).replace(
        "<Constraint_Joint", '<Reference_Variable id="8" label="lift" expr="0"/><Constraint_Joint'
    )
    with mbsim.open(deck) as sim:
        assert dict(sim.inputs) == {"push": 0.0, "spring": 100.0}
    with pytest.raises(ModelError, match=r"Reference_Variable\[8\].*depend on it by Constraint_G"):
        mbsim.open(deck, inputs=["lift"])


def test_where_steps_may_not_go():
    with mbsim.open(pushed()) as sim:
        sim.step_to(0.5)
        assert sim.step_to(0.5) == 0.5
        with pytest.raises(ModelError, match="must go forward"):
            sim.step_to(0.4)
        with pytest.raises(ModelError, match=r"last Simulate ends at 1; mbsim.open\(..., end_time"):
            sim.step_to(1.5)
        assert sim.step_to(1.0 + 1e-12) == 1.0
    with pytest.raises(ModelError, match="the run is closed"):
        sim.step(0.1)
    with mbsim.open(pushed(), end_time=3.0) as sim:
        assert sim.step_to(3.0) == 3.0


def test_a_sensor_ends_the_run_as_it_does_in_simulate():
    sensor = (
        '<Sensor_Event id="4" expr="DZ(20,10)" compare="GE" value="0.01" error_tol="1e-9" '
        'halt="TRUE"/>'
    )
    deck = pushed(more=sensor).replace('label="push" expr="0"', 'label="push" expr="3"')
    whole = mbsim.simulate(deck)
    with mbsim.open(deck) as sim:
        reached = sim.step_to(0.9)
        assert reached == sim.time < 0.2
        assert sim.finished
        np.testing.assert_array_equal(sim.results()["time"], whole["time"])
        with pytest.raises(ModelError, match=r"Sensor_Event\[4\] ended the run"):
            sim.step(0.1)


def test_stages_follow_each_other_as_in_simulate():
    deck = (
        pushed()
        .replace(
            "</Command>",
            '<Simulate analysis_type="Transient" end_time="2" print_interval="0.01"/></Command>',
        )
        .replace('label="push" expr="0"', 'label="push" expr="3"')
    )
    whole = mbsim.simulate(deck, tol=1e-9)
    with mbsim.open(deck, tol=1e-9) as sim:
        for k in range(1, 9):
            sim.step_to(0.25 * k)
        results = sim.results()
        np.testing.assert_array_equal(results["time"], whole["time"])
        np.testing.assert_allclose(
            results["bodies/2/position/z"], whole["bodies/2/position/z"], atol=1e-7
        )
        sim.inputs["push"] = 0.0


def test_a_failure_is_that_of_simulate_and_can_be_gone_back_from():
    deck = pushed(" + SQRT(1+VARVAL(5))")
    with mbsim.open(deck, integrator="DOPRI5") as sim:
        sim.step_to(0.3)
        kept = sim.state
        sim.inputs["push"] = -2.0
        with pytest.raises(SolverError):
            sim.step_to(0.8)
        with pytest.raises(ModelError, match="set `state` to one from before"):
            sim.step(0.1)
        sim.state = kept
        assert sim.step_to(0.8) == 0.8


def test_results_in_a_folder(tmp_path):
    with mbsim.open(pushed()) as sim:
        sim.step_to(0.1)
        with sim.results(tmp_path) as results:
            assert results.path == tmp_path / "deck.h5"
            assert len(results["time"]) == 11
        sim.step_to(1.0)
        with sim.results(tmp_path) as results:
            assert len(results["time"]) == 101
            assert results.status == "finished"


def test_decks_as_text_files_and_paths(tmp_path):
    path = tmp_path / "mine.xml"
    path.write_text(pushed())
    whole = mbsim.simulate(mbsim.read_model(path))
    for given in (pushed(), io.StringIO(pushed()), io.BytesIO(pushed().encode()), path, str(path)):
        results = mbsim.simulate(given)
        np.testing.assert_array_equal(results["bodies/2/position"], whole["bodies/2/position"])
    with Path(path).open() as file:
        assert mbsim.read_model(file).name == "mine"
    with pytest.raises(ModelError, match="must be a path, XML as text"):
        mbsim.read_model(3)
    with pytest.raises(mbsim.MbsimError, match=r"^deck.xml:\d+: "):
        mbsim.read_model(pushed().replace("mass=", "mas="))


def test_overrides_as_a_dict():
    one = mbsim.read_model(
        pushed(), {"Body_Rigid[2].mass": np.float64(0.1), "Simulate.end_time": 2}
    )
    other = mbsim.read_model(pushed(), ["Body_Rigid[2].mass=0.1", "Simulate.end_time=2"])
    assert one.bodies[2].mass == 0.1
    assert one.simulations == other.simulations
    assert one.overrides == ("Body_Rigid[2].mass=0.1", "Simulate.end_time=2")
    assert mbsim.simulate(pushed(), overrides={"Simulate.end_time": 0.1})["time"][-1] == 0.1
    with pytest.raises(ModelError, match="this model is read already"):
        mbsim.simulate(one, overrides={"Simulate.end_time": 0.1})
    with pytest.raises(ModelError, match="must be a list of texts, or a dict"):
        mbsim.read_model(pushed(), "Simulate.end_time=2")


def test_linearised_against_closed_forms():
    with mbsim.open(pushed(), inputs=["ramp"]) as sim:
        sim.step(0.1)
        before = sim.state.arrays["method/y"]
        found = sim.linearize(["requests/1/F4", "requests/1/F2", "requests/1/F3"], ["push", "ramp"])
        np.testing.assert_array_equal(sim.state.arrays["method/y"], before)
    assert found.states == ("bodies/2/position/z", "bodies/2/velocity/z")
    np.testing.assert_allclose(found.A, [[0, 1], [-100, 0]], atol=1e-10)
    np.testing.assert_allclose(found.B, [[0, 0], [1, 0]], atol=1e-10)
    np.testing.assert_allclose(found.C, [[1, 0], [0, 0], [0, 0]], atol=1e-8)
    np.testing.assert_allclose(found.D, [[0, 0], [1, 0], [0, 1]], atol=1e-10)
    np.testing.assert_allclose(found.eigenvalues, [-10j, 10j], atol=1e-10)


#: A rod on a hinge about y at ground's origin, its centre l above it.
STANDING = """<MotionSolve><Model>
<Body_Rigid id="1" isground="TRUE"/>
<Body_Rigid id="2" cg_id="20" mass="2" inertia_xx="0.3" inertia_yy="0.3" inertia_zz="0.01"/>
<Reference_Marker id="10" body_id="1" theta="-1.5707963267948966"/>
<Reference_Marker id="20" body_id="2" pos_z="{l}"/>
<Reference_Marker id="21" body_id="2" theta="-1.5707963267948966"/>
<Reference_Variable id="1" label="torque" expr="0"/>
<Constraint_Joint id="1" type="REVOLUTE" i_marker_id="21" j_marker_id="10"/>
<Force_Vector_OneBody id="1" type="TORQUEONLY" i_marker_id="20" tx_expression="0"
  ty_expression="VARVAL(1)" tz_expression="0"/>
<Force_Gravity grav_z="-9.81"/>
</Model><Command><Simulate analysis_type="Transient" end_time="1" print_interval="0.1"/></Command>
</MotionSolve>"""


@pytest.mark.parametrize("length", [0.5, -0.5])
def test_a_pendulum_hanging_and_standing(length):
    # (J + m l^2) turn'' = m g l turn + torque
    inertia = 0.3 + 2.0 * 0.25
    with mbsim.open(STANDING.format(l=length)) as sim:
        found = sim.linearize()
    rates = np.sqrt(complex(2.0 * 9.81 * length / inertia))
    np.testing.assert_allclose(
        sorted(found.eigenvalues, key=lambda x: (x.real, x.imag)),
        sorted([rates, -rates], key=lambda x: (x.real, x.imag)),
        atol=1e-6,
    )
    # from the torque to the rate of the speed that was chosen
    turns = found.states[1].endswith("angular_velocity/y")
    assert abs(found.B[1, 0]) == pytest.approx((1.0 if turns else 0.5) / inertia, rel=1e-6)
    assert found.A.shape == (2, 2)


@pytest.mark.parametrize("integrator", METHODS)
def test_a_run_goes_on_after_it_is_linearised_as_it_would_have(integrator):
    """An implicit method's linearisation stands where that of `linearize` does."""
    model = mbsim.Model(name="damped")
    ball = model.body(mass=1, inertia=(0.1,) * 3, pos=(0, 0, 1))
    model.spring_damper(ball, model.ground, "TRANSLATIONAL", stiffness=1e5, damping=1e5, length=1)
    model.gravity(grav=(0, 0, -9.81))
    model.simulate(end_time=5, print_interval=0.1)
    found = []
    for looked in (False, True):
        with mbsim.open(model, integrator=integrator) as sim:
            sim.step(0.02)
            if looked:
                assert sim.linearize().A.shape == (12, 12)
            sim.step(0.02)
            found.append(sim.state.arrays["method/y"])
    np.testing.assert_array_equal(*found)


def test_a_state_of_another_run_is_refused_whole():
    def taken(**how):
        with mbsim.open(pushed(), **how) as other:
            other.step(0.3)
            return other.state

    with mbsim.open(pushed(), integrator="DOPRI5") as sim:
        sim.inputs["push"] = 2.0
        sim.step(0.2)
        before = sim.state
        for other, said in (
            (taken(integrator="DOP853"), "integrator was DOP853 and is DOPRI5 now"),
            (taken(end_time=0.5, integrator="DOPRI5"), "end_time was 0.5"),
            (
                taken(integrator="DOPRI5", overrides={"Body_Rigid[2].mass": 2}),
                r"Body_Rigid\[2\].mass was 2.* and is 1",
            ),
            (None, "NoneType given"),
        ):
            with pytest.raises(ModelError, match=said):
                sim.state = other
        np.testing.assert_array_equal(sim.state.arrays["method/y"], before.arrays["method/y"])
        sim.state = pickle.loads(pickle.dumps(before))
        sim.step(0.2)
        assert len(sim.results()["time"]) == 41


def test_what_cannot_be_linearised():
    with mbsim.open(MODELS / "drop_m.xml", integrator="MOREAU") as sim:
        with pytest.raises(ModelError, match="rigid contacts have no slope"):
            sim.linearize()
    with mbsim.open(spun("V"), inputs=["drive"]) as sim:
        with pytest.raises(ModelError, match=r'drive gives a velocity.*val_type="A"'):
            sim.linearize()
    with mbsim.open(MODELS / "free_top.xml", integrator="VERLET") as sim:
        with pytest.raises(ModelError, match="open with another method"):
            sim.linearize()
