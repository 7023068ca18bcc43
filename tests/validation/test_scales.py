"""Errors are judged by what moves: not by the run's length, by units or by what is elsewhere."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

import mbsim
from helpers.decks import COULOMB, GRAVITY, GROUND, contact, run_deck, sphere, write_deck
from helpers.folders import MODELS
from mbsim.compile_model.groups import find_groups, natural_speed
from mbsim.model.placement import place

METHODS = ["AUTO", "DOPRI5", "DOP853", "RADAU5", "GALPHA"]
UNITS = (
    '<Param_Unit force_unit="{0}" mass_unit="KILOGRAM" length_unit="{1}" time_unit="{2}"/>'
    '<Body_Rigid id="1" isground="TRUE"/><Reference_Marker id="10" body_id="1"/>'
)


def bushing(id, i, j, stiffness):
    """Return a spring along x."""
    return f'<Force_Bushing id="{id}" i_marker_id="{i}" j_marker_id="{j}" kx="{stiffness!r}"/>'


def pushed(force, mass=1.0, body=2, radius=0.1):
    """Return a weightless ball at rest that a force along x of TIME pushes."""
    return sphere(0.0, mass, radius, body=body) + (
        f'<Force_Vector_OneBody id="{body}" type="ForceOnly" i_marker_id="{10 * body}" '
        f'fx_expression="{force}"/>'
    )


def ball_on_spring(force, rate, stiffness, radius):
    """Return a ball at rest on a spring, pushed to and fro."""
    ball = pushed(f"{force!r}*SIN({rate!r}*TIME)", radius=radius)
    return ball + bushing(1, 20, 10, stiffness)


#: At 2 Hz, pushed at 3 Hz.
SPRING = GROUND + ball_on_spring(3.0, 20.0, 160.0, 0.1)
#: A ball that slips on the ground and rolls at last.
SLIPS = (
    GROUND
    + sphere(0.0995, v=(1.0, 0.0, 0.0))
    + contact(damping=100, dmax=1e-4, **COULOMB)
    + GRAVITY
)
FLYWHEEL = """
<Body_Rigid id="9" cg_id="90" mass="3" inertia_xx="0.1" inertia_yy="0.1" inertia_zz="0.1"
  w_ic_z="1500" w_ic_z_flag="TRUE"/>
<Reference_Marker id="90" body_id="9" pos_x="2" pos_z="1"/>
<Reference_Marker id="91" body_id="1" pos_x="2" pos_z="1"/>
<Constraint_Joint id="9" type="REVOLUTE" i_marker_id="90" j_marker_id="91"/>"""


def groups_of(folder, model):
    model = mbsim.read_model(write_deck(folder, model))
    return model, find_groups(model, place(model))


# --- which bodies belong together --------------------------------------------------------------


def test_groups_are_joined_by_what_acts_between_bodies_and_not_through_ground(tmp_path):
    balls = "".join(sphere(1.0, body=b, x=float(b)) for b in range(2, 10))
    model = (
        GROUND
        + balls
        + '<Constraint_Joint id="1" type="SPHERICAL" i_marker_id="20" j_marker_id="30"/>'
        + bushing(1, 30, 40, 1.0)
        + contact(500, 600)
        # both on ground
        + contact(700, 100, id=302)
        + contact(800, 100, id=303)
        # looks at another by a variable
        + '<Reference_Variable id="1" expr="DX(90)"/>'
        + '<Force_Vector_OneBody id="3" type="ForceOnly" i_marker_id="80" '
        'fx_expression="-VARVAL(1)"/>'
    )
    _, groups = groups_of(tmp_path, model)
    assert groups.of_body == [0, 0, 0, 1, 1, 2, 3, 3]
    assert groups.of_contact == [1, 2, 3]


def test_length_is_of_what_acts_and_touches(tmp_path):
    model = (
        GROUND
        + sphere(0.5, radius=0.1, x=3.0)
        + contact()
        # nothing acts at these, nothing touches that
        + '<Reference_Marker id="29" body_id="2" pos_x="1e3"/>'
        + '<Reference_Marker id="19" body_id="1" pos_y="1e3"/>'
        + '<Post_Graphic id="199" type="Sphere" center_marker_id="19" radius="50"/>'
        + '<Post_Request id="1" type="MARKER_DISPLACEMENT" i_marker_id="29" j_marker_id="19"/>'
        + FLYWHEEL
    )
    _, groups = groups_of(tmp_path, model)
    # the ball's box, and the plane's marker
    assert groups.length[0] == pytest.approx(math.hypot(3.1, 0.2, 0.6), rel=1e-12)
    # a body of one point is as large as a solid sphere with its radius of gyration
    gyration = math.sqrt(0.3 / (2.0 * 3.0))
    box = 2.0 * math.sqrt(3.0) * gyration / math.sqrt(0.6)
    assert groups.length[1] == pytest.approx(box, rel=1e-12)
    assert groups.start == pytest.approx([0.0, 1500.0 * gyration], rel=1e-12)


def test_a_body_at_rest_has_a_speed_in_any_units(tmp_path):
    ball = sphere(0.0, radius=0.1)
    _, metres = groups_of(tmp_path, UNITS.format("NEWTON", "METER", "SECOND") + ball)
    ball = sphere(0.0, radius=100.0)
    model, other = groups_of(tmp_path, UNITS.format("KNEWTON", "MILLIMETER", "MILLISECOND") + ball)
    assert other.length == pytest.approx([1e3 * length for length in metres.length], rel=1e-12)
    # metres a second are millimetres a millisecond
    assert other.speed == pytest.approx(metres.speed, rel=1e-12)
    assert natural_speed(model.units, 1.0) == pytest.approx(math.sqrt(9.80665e-3), rel=1e-12)


# --- what results do not depend on -------------------------------------------------------------


@pytest.mark.parametrize("method", ["AUTO", "RADAU5", "GALPHA"])
@pytest.mark.parametrize("model", [SPRING, SLIPS], ids=["spring", "slips"])
def test_a_marker_that_nobody_uses_changes_no_bit(tmp_path, method, model):
    found = [
        run_deck(tmp_path, model + more, 0.2, integrator=method)
        for more in (
            "",
            '<Reference_Marker id="19" body_id="1" pos_x="1e3"/>'
            '<Reference_Marker id="29" body_id="2" pos_y="-20"/>'
            '<Post_Graphic id="190" type="Sphere" center_marker_id="19" radius="5"/>',
        )
    ]
    for name in ("bodies/2/position", "bodies/2/velocity"):
        np.testing.assert_array_equal(found[0][name], found[1][name])
    assert found[0].stats["steps"] == found[1].stats["steps"]


@pytest.mark.parametrize("method", ["DOPRI5", "RADAU5"])
@pytest.mark.parametrize("model", [SPRING, SLIPS], ids=["spring", "slips"])
def test_a_flywheel_elsewhere_changes_nothing_beyond_the_tolerance(tmp_path, method, model):
    """It bounds the steps with its own error, but does not loosen what others are judged by."""
    tol = 1e-6
    exact = run_deck(tmp_path, model, 0.2, integrator="DOP853", tol=1e-11)
    found = run_deck(tmp_path, model + FLYWHEEL, 0.2, integrator=method, tol=tol)
    apart = np.abs(found["bodies/2/velocity"] - exact["bodies/2/velocity"]).max()
    assert apart < 100.0 * tol


@pytest.mark.parametrize("method", ["DOPRI5", "DOP853", "RADAU5"])
def test_how_long_the_run_lasts_changes_nothing_beyond_rounding(tmp_path, method):
    """Steps are the same up to the last before the shorter run's end."""
    short, long = (
        run_deck(tmp_path, SPRING, end, 1e-3, integrator=method, tol=1e-5) for end in (0.1, 5.0)
    )
    n = len(short["time"]) - 1
    assert short["time"][n] == 0.1
    scale = np.abs(short["bodies/2/velocity"]).max()
    apart = np.abs(short["bodies/2/velocity"][:n] - long["bodies/2/velocity"][:n]).max()
    assert apart < 1e-5 * scale


@pytest.mark.parametrize("method", ["DOPRI5", "DOP853", "RADAU5", "GALPHA"])
def test_units_of_time_and_length_change_nothing_beyond_the_tolerance(tmp_path, method):
    tol, length, time = 1e-5, 1e3, 1e3
    metres = UNITS.format("NEWTON", "METER", "SECOND") + ball_on_spring(3.0, 20.0, 160.0, 0.1)
    # kN, mm and ms: mm/ms is m/s, and kN/mm is MN/m
    small = UNITS.format("KNEWTON", "MILLIMETER", "MILLISECOND")
    small += ball_on_spring(3e-3, 20.0 / time, 160e-6, 0.1 * length)
    one = run_deck(tmp_path, metres, 0.5, 0.05, integrator=method, tol=tol)
    two = run_deck(tmp_path, small, 0.5 * time, 0.05 * time, integrator=method, tol=tol)
    scale = np.abs(one["bodies/2/velocity"]).max()
    apart = np.abs(one["bodies/2/velocity"] - two["bodies/2/velocity"]).max()
    assert apart < 100.0 * tol * scale
    assert two.stats["steps"] == pytest.approx(one.stats["steps"], rel=0.1)


# --- short runs --------------------------------------------------------------------------------


@pytest.mark.parametrize("method", ["DOPRI5", "DOP853", "RADAU5"])
@pytest.mark.parametrize("end", [1e-3, 1.0])
def test_runs_of_any_length_converge(tmp_path, method, end):
    """A ball at rest that is pushed by sin(w t) F for five periods: x and v in closed form."""
    w = 10.0 * math.pi / end
    force, worst = 0.1 / end**2, []
    for tol in 10.0 ** -np.arange(4, 11, 2):
        model = GROUND + pushed(f"{force!r}*SIN({w!r}*TIME)")
        run = run_deck(tmp_path, model, end, end / 20, integrator=method, tol=tol)
        t = run["time"]
        exact = force / w * (1.0 - np.cos(w * t))
        wrong = np.abs(run["bodies/2/velocity"][:, 0] - exact).max() / (2.0 * force / w)
        assert wrong < 30.0 * tol
        worst.append(wrong)
    assert all(after < max(0.2 * before, 1e-11) for before, after in itertools.pairwise(worst))


@pytest.mark.parametrize("method", ["AUTO", "RADAU5"])
def test_what_rests_for_long_is_judged_by_its_speed_when_it_is_pushed(tmp_path, method):
    """A ball at rest for 9 s, then pushed: v to the tolerance of v, whatever there was before."""
    model = GROUND + pushed("STEP(TIME, 9, 0, 9.5, {0})")
    for force in (1e-3, 1.0, 1e3):
        run = run_deck(tmp_path, model.format(force), 10.0, 0.1, integrator=method, tol=1e-7)
        # half of the ramp, and half a second
        exact = 0.75 * force
        assert run["bodies/2/velocity"][-1, 0] == pytest.approx(exact, rel=3e-5)


@pytest.mark.parametrize("name", ["sphere_pair", "hertz_sphere", "hunt_crossley_pair"])
def test_short_impacts_converge(name):
    """Decks of a tenth of a millisecond and more, judged by L over their end before."""
    model = mbsim.read_model(MODELS / f"{name}.xml")
    ends = [
        mbsim.simulate(model, integrator="DOPRI5", tol=tol)["bodies/2/velocity"][-1]
        for tol in (1e-5, 1e-7, 1e-12)
    ]
    scale = np.abs(ends[-1]).max()
    for tol, end in zip((1e-5, 1e-7), ends, strict=False):
        assert np.abs(end - ends[-1]).max() < 30.0 * tol * scale


# --- energy ------------------------------------------------------------------------------------


@pytest.mark.parametrize(("method", "most"), [("RADAU5", 900), ("GALPHA", 2500)])
def test_a_slow_body_between_strong_forces_is_not_judged_by_its_own_energy(method, most):
    """Spring and damper exchange 5000 J, the body has 5e-3 J: 3387 and 32,823 evaluations."""
    taken = {}
    for strength in (1e3, 1e6, 1e9):
        names = ("stiffness", "damping")
        changes = [f"Force_SpringDamper[1].{name}={strength!r}" for name in names]
        model = mbsim.read_model(MODELS / "stiff/overdamped.xml", changes)
        run = mbsim.simulate(model, integrator=method, tol=1e-5)
        taken[strength] = run.stats["rhs_evaluations"]
        # x' = -x once the begin, of 1/c, is over
        left = run["bodies/2/position"][-1, 0] - 1.0
        assert left == pytest.approx(0.1 * math.exp(-1.0), rel=5e-3)
        assert run.audit.balance < 1e-4 * run.audit.of
        assert not run.audit.warnings
    assert max(taken.values()) < most
