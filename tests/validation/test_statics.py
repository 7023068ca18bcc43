"""Simulate analysis_type="Static" against closed forms, transients and another minimiser."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

import mbsim
from helpers.decks import EARTH, GROUND, sphere
from mbsim.errors import SolverError

G = 9.81
STATIC = '<Simulate analysis_type="Static"/>'
GRAVITY = f'<Force_Gravity grav_z="{-G}"/>'


def run(folder, model, command=STATIC, **settings):
    """Run model statements by the given commands."""
    path = Path(folder) / "deck.xml"
    text = f"<Deck><Model>{model}</Model><Command>{command}</Command></Deck>"
    path.write_text(text, encoding="utf-8")
    return mbsim.simulate(mbsim.read_model(path), **settings)


def box(body, z, edge=0.2, mass=2.0, x=0.0):
    """Return statements of a cube."""
    inertia = mass * edge**2 / 6.0
    return f"""
<Body_Rigid id="{body}" cg_id="{10 * body}" mass="{mass}" inertia_xx="{inertia}"
  inertia_yy="{inertia}" inertia_zz="{inertia}"/>
<Reference_Marker id="{10 * body}" body_id="{body}" pos_x="{x}" pos_z="{z}"/>
<Post_Graphic id="{100 * body}" type="BoxDefinedFromCenter"
  center_marker_id="{10 * body}" length_x="{edge}" length_y="{edge}"
  length_z="{edge}"/>
"""


def contact(id, i, j, stiffness=1e6, exponent=1.5, damping=200, dmax=1e-4, more=""):
    """Return statements of an IMPACT contact."""
    return f"""
<Force_Contact id="{id}" num_i_graphics="1" i_graphics_id="{i}" num_j_graphics="1"
  j_graphics_id="{j}" cnf_type="Impact" stiffness="{stiffness}" exponent="{exponent}"
  damping="{damping}" dmax="{dmax}" {more}/>
"""


def test_mass_on_a_spring_hangs_at_its_closed_form(tmp_path):
    """k x = m g."""
    model = f"""{EARTH}{sphere(-0.9, mass=3.0)}{GRAVITY}
<Force_SpringDamper id="1" type="TRANSLATIONAL" i_marker_id="20" j_marker_id="10"
  stiffness="500" damping="3" length="0.5"/>"""
    results = run(tmp_path, model)
    assert results["time"].tolist() == [0.0]
    z = results["bodies/2/position"][-1]
    assert z == pytest.approx([0.0, 0.0, -(0.5 + 3.0 * G / 500.0)], abs=1e-13)
    assert not results["bodies/2/velocity"].any()


@pytest.mark.parametrize("exponent", [1.0, 1.5, 2.2])
def test_sphere_dropped_on_a_plane_rests_at_the_depth_of_its_law(tmp_path, exponent):
    """k d^e = m g; it starts in the air, from where it would take a transient."""
    model = GROUND + sphere(1.0, mass=2.0) + GRAVITY
    results = run(tmp_path, model + contact(1, 200, 100, exponent=exponent))
    depth = (2.0 * G / 1e6) ** (1.0 / exponent)
    assert 0.1 - results["bodies/2/position"][-1, 2] == pytest.approx(depth, rel=1e-9)
    assert results["bodies/2/position"][-1, :2] == pytest.approx([0.0, 0.0], abs=1e-15)


def test_static_of_a_stack_is_where_the_transient_ends(tmp_path):
    """Three boxes on each other: static = late transient to 1e-8 of the model's size."""
    stack = box(2, 0.1) + box(3, 0.3) + box(4, 0.5)
    pairs = [(200, 100), (300, 200), (400, 300)]
    friction = (
        'cff_type="COULOMB_ON" mu_static="0.5" mu_dynamic="0.4" stiction_trans_vel="1e-3" '
        'friction_trans_vel="1e-2"'
    )
    contacts = "".join(contact(k, i, j, more=friction) for k, (i, j) in enumerate(pairs, 1))
    model = GROUND + stack + contacts + GRAVITY
    still = run(tmp_path, model)
    late = run(
        tmp_path,
        model,
        '<Simulate analysis_type="Transient" end_time="3" print_interval="0.5"/>',
        tol=1e-9,
    )
    for body in (2, 3, 4):
        name = f"bodies/{body}/position"
        assert np.abs(still[name][-1] - late[name][-1]).max() < 1e-8
        turns = still[f"bodies/{body}/quaternion"][-1] - late[f"bodies/{body}/quaternion"][-1]
        assert np.abs(turns).max() < 1e-8
    # four corners bear each face: k d^1.5 = weight above / 4
    for body, above in ((2, 3), (3, 2), (4, 1)):
        below = still[f"bodies/{body - 1}/position"][-1, 2] + 0.1 if body > 2 else 0.0
        depth = below - (still[f"bodies/{body}/position"][-1, 2] - 0.1)
        assert depth == pytest.approx((2.0 * G * above / 4.0 / 1e6) ** (1.0 / 1.5), rel=1e-7)


def test_sphere_rests_in_a_v_of_planes(tmp_path):
    """Both planes at 45 degrees press with m g / sqrt(2): depth by the law, exponent 2."""
    planes = "".join(
        f"""<Reference_Marker id="{k}" body_id="1" theta="{sign * math.pi / 4.0!r}"/>
<Post_Graphic id="{10 * k}" type="Plane" rm_id="{k}"/>"""
        for k, sign in ((11, 1.0), (12, -1.0))
    )
    contacts = contact(1, 200, 110, exponent=2.0) + contact(2, 200, 120, exponent=2.0)
    model = EARTH + planes + sphere(0.5, x=0.2) + contacts + GRAVITY
    position = run(tmp_path, model)["bodies/2/position"][-1]
    depth = math.sqrt(G / math.sqrt(2.0) / 1e6)
    assert position == pytest.approx([0.2, 0.0, math.sqrt(2.0) * (0.1 - depth)], abs=1e-9)


PENDULUM = f"""{EARTH}
<Body_Rigid id="2" cg_id="20" mass="2" inertia_xx="0.1" inertia_yy="0.1" inertia_zz="0.1"/>
<Reference_Marker id="20" body_id="2" pos_x="0.5"/>
<Reference_Marker id="21" body_id="2" pos_x="0"/>
<Reference_Marker id="12" body_id="1" theta="-1.5707963267948966"/>
<Reference_Marker id="22" body_id="2" theta="-1.5707963267948966"/>
<Constraint_Joint id="1" type="REVOLUTE" i_marker_id="22" j_marker_id="12"/>
"""


def test_pendulum_hangs_down(tmp_path):
    """From the horizontal to below its pivot, not to the balance on top of it."""
    results = run(tmp_path, PENDULUM + GRAVITY)
    assert results["bodies/2/position"][-1] == pytest.approx([0.0, 0.0, -0.5], abs=1e-10)


def test_body_without_support_is_named(tmp_path):
    """Nothing to rest on: one line that names the body, exit code 3."""
    with pytest.raises(SolverError, match=r"nothing holds Body_Rigid\[2\]|rests on nothing"):
        run(tmp_path, GROUND + sphere(1.0) + GRAVITY)
    assert SolverError.exit_code == 3


def test_static_then_transient_stays(tmp_path):
    """A transient that follows begins at rest and stays there."""
    model = GROUND + sphere(0.3) + contact(1, 200, 100) + GRAVITY
    command = STATIC + '<Param_Transient integr_tol="1e-7"/>'
    command += '<Simulate analysis_type="Transient" end_time="1" print_interval="0.1"/>'
    results = run(tmp_path, model, command)
    z = results["bodies/2/position"][:, 2]
    assert len(z) == 11
    assert np.abs(z - z[0]).max() < 1e-9
    assert 0.1 - z[0] == pytest.approx((G / 1e6) ** (1 / 1.5), rel=1e-9)


def _bar(body, mass, start, end, first):
    """Return statements of a bar with its cg in the middle, and markers at both ends."""
    (x0, y0), (x1, y1) = start, end
    return f"""
<Body_Rigid id="{body}" cg_id="{first}" mass="{mass}" inertia_xx="0.1" inertia_yy="0.1"
  inertia_zz="0.1"/>
<Reference_Marker id="{first}" body_id="{body}" pos_x="{(x0 + x1) / 2}" pos_y="{(y0 + y1) / 2}"/>
<Reference_Marker id="{first + 1}" body_id="{body}" pos_x="{x0}" pos_y="{y0}"/>
<Reference_Marker id="{first + 2}" body_id="{body}" pos_x="{x1}" pos_y="{y1}"/>
"""


_A, _B, _C, _D, _S = (0.0, 0.0), (0.3, 0.6), (1.8, 1.2), (2.0, 0.0), (3.0, 1.5)
_FOUR_BAR = (
    EARTH
    + f'<Reference_Marker id="11" body_id="1" pos_x="{_D[0]}"/>'
    + f'<Reference_Marker id="12" body_id="1" pos_x="{_S[0]}" pos_y="{_S[1]}"/>'
    + _bar(2, 1.0, _A, _B, 20)
    + _bar(3, 2.0, _B, _C, 30)
    + _bar(4, 1.5, _D, _C, 40)
    + "".join(
        f'<Constraint_Joint id="{k}" type="REVOLUTE" i_marker_id="{i}" j_marker_id="{j}"/>'
        for k, (i, j) in enumerate(((21, 10), (31, 22), (32, 42), (41, 11)), 1)
    )
    + f'<Force_Gravity grav_y="{-G}"/>'
)


def _loop(angle):
    """Return B and C of the four-bar for the crank's angle, by two circles."""
    length = {k: math.dist(*ends) for k, ends in enumerate(((_A, _B), (_B, _C), (_D, _C)))}
    b = length[0] * np.array([math.cos(angle), math.sin(angle)])
    d = np.array(_D) - b
    far = float(np.linalg.norm(d))
    x = (far**2 + length[1] ** 2 - length[2] ** 2) / (2.0 * far)
    e = d / far
    return b, b + x * e + math.sqrt(length[1] ** 2 - x * x) * np.array([-e[1], e[0]])


def test_four_bar_with_a_spring_is_where_its_energy_is_least(tmp_path):
    """Against scipy's minimiser over the crank's angle."""
    from scipy.optimize import minimize_scalar

    def energy(angle):
        b, c = _loop(angle)
        heights = 1.0 * b[1] / 2 + 2.0 * (b[1] + c[1]) / 2 + 1.5 * c[1] / 2
        return G * heights + 0.5 * 150.0 * (math.dist(c, _S) - 0.4) ** 2

    start = math.atan2(_B[1], _B[0])
    found = minimize_scalar(energy, bracket=(start, start - 0.1), options={"xtol": 1e-13})
    spring = (
        '<Force_SpringDamper id="1" type="TRANSLATIONAL" i_marker_id="42" j_marker_id="12" '
        'stiffness="150" length="0.4"/>'
    )
    results = run(tmp_path, _FOUR_BAR + spring)
    b, c = _loop(found.x)
    # an energy is flat at its least: 1e-8 of it is all that a minimiser can see
    assert results["bodies/2/position"][-1, :2] == pytest.approx(b / 2, abs=3e-7)
    assert results["bodies/3/position"][-1, :2] == pytest.approx((b + c) / 2, abs=3e-7)

    def slope(angle, h=1e-4):
        return (
            8 * (energy(angle + h) - energy(angle - h))
            - energy(angle + 2 * h)
            + energy(angle - 2 * h)
        ) / (12 * h)

    crank = results["bodies/2/position"][-1]
    assert abs(slope(math.atan2(crank[1], crank[0]))) < 1e-8 * G


def test_motions_hold_their_displacement_and_run_on_afterwards(tmp_path):
    """A crank that is driven stays at the angle of its time; then it turns at its rate."""
    motion = (
        '<Motion_Joint id="1" joint_id="1" motion_type="R" val_type="D" expr="0.4 + 0.5*TIME"/>'
    )
    pendulum = PENDULUM.replace(f"{EARTH}", EARTH) + GRAVITY + motion
    command = STATIC + '<Simulate analysis_type="Transient" end_time="1" print_interval="0.5"/>'
    results = run(tmp_path, pendulum, command)
    for k, t in enumerate((0.0, 0.5, 1.0)):
        angle = 0.4 + 0.5 * t
        x, _, z = results["bodies/2/position"][k]
        assert abs(math.atan2(z, x)) == pytest.approx(angle, abs=1e-9)
    assert np.abs(results["bodies/2/angular_velocity"][:, 1]) == pytest.approx(0.5, abs=1e-9)


def test_a_bound_on_iterations_ends_the_search(tmp_path):
    """The error says how far it came."""
    model = GROUND + sphere(1.0) + contact(1, 200, 100) + GRAVITY
    with pytest.raises(SolverError, match=r"in 3 iterations: residual 9\.81"):
        run(tmp_path, model, '<Param_Static max_num_iter="3"/>' + STATIC)


def test_what_does_not_exist_is_refused(tmp_path):
    """By name, with the line."""
    from mbsim.errors import DeckError

    model = GROUND + sphere(1.0) + contact(1, 200, 100) + GRAVITY
    with pytest.raises(DeckError, match='Param_Static: method="NEWTON": must be one of MKEAM'):
        run(tmp_path, model, '<Param_Static method="NEWTON"/>' + STATIC)
    with pytest.raises(DeckError, match="Frequency Response"):
        run(tmp_path, model, '<Simulate analysis_type="Frequency Response"/>')


def test_box_on_a_slope_finds_no_rest(tmp_path):
    """Slip laws bear nothing at rest; the error names the body."""
    slope = f'<Force_Gravity grav_x="{0.3 * G}" grav_z="{-G}"/>'
    with pytest.raises(SolverError, match=r"residual .*Body_Rigid\[2\]"):
        run(tmp_path, GROUND + box(2, 0.1) + contact(1, 200, 100) + slope)


def test_what_only_friction_holds_is_said_to_be_so(tmp_path):
    """A box beside the middle of another one tilts it and slides off; with friction it rests."""
    frictional = 'cff_type="COULOMB_ON" mu_static="0.3" mu_dynamic="0.3" stiction_trans_vel="0.01"'
    deck = GROUND + box(2, 0.1) + box(3, 0.3, x=0.03) + GRAVITY
    for more, said in ((f'{frictional} friction_trans_vel="0.02"', "Force_Contact[1]"), ("", "")):
        pairs = contact(1, 200, 100, more=more) + contact(2, 300, 200, more=more)
        with pytest.raises(SolverError) as raised:
            run(tmp_path, deck + pairs)
        assert ("friction alone" in str(raised.value)) == bool(said)
        assert said in str(raised.value)


def held(expr, states):
    """Return a sphere of 2 kg that a force along z of ground holds, with states."""
    return f"""{EARTH}{sphere(-0.9, mass=2.0)}{GRAVITY}{states}
<Force_Scalar_TwoBody id="1" type="Force" i_marker_id="20" j_marker_id="10"
  expr="{expr}" action_only="TRUE"/>"""


def state(id, expr, ic=0.0):
    return f'<Control_Diff id="{id}" expr="{expr}" ic="{ic}"/>'


def test_a_state_comes_to_rest_with_the_body_that_it_pushes(tmp_path):
    """z' = (x - z)/0.1 lags behind a cubic spring that stretches with it: 0 = x - z."""
    model = held("-300*(DIF(5)**3 + DIF(5)) + 4*DZ(20)", state(5, "(DZ(20) - DIF(5))/0.1"))
    model += '<Post_Request id="1" type="EXPRESSION" expr1="DIF(5)" expr2="DIF1(5)"/>'
    results = run(tmp_path, model)
    z = results["bodies/2/position"][-1, 2]
    assert -300 * (z**3 + z) + 4 * z == pytest.approx(2 * G, abs=1e-9)
    assert results["requests/1"][-1, 0] == pytest.approx(z, abs=1e-12)
    assert results["requests/1"][-1, 1] == pytest.approx(0.0, abs=1e-10)


def test_the_integral_part_of_a_controller_holds_the_weight(tmp_path):
    """z' = x + 0.5 has its equilibrium by the body alone; for the body alone nothing holds it."""
    integral = state(5, "DZ(20) + 0.5")
    results = run(tmp_path, held("-40*(DZ(20) + 0.5) - 9*VZ(20) - 60*DIF(5)", integral))
    assert results["bodies/2/position"][-1, 2] == pytest.approx(-0.5, abs=1e-11)


def test_states_at_rest_stay_there(tmp_path):
    """A transient from the equilibrium moves nothing; two states, one of them not linear."""
    states = state(5, "2 - EXP(DIF(5)) + 0.3*DIF(6)", ic=3.0)
    states += state(6, "DZ(20) - DIF(6)*(1 + DIF(6)**2)", ic=1.0)
    after = '<Simulate analysis_type="Transient" end_time="1" print_interval="0.1"/>'
    results = run(tmp_path, held("-200*DZ(20) + 9*DIF(5)", states), STATIC + after, tol=1e-9)
    z = results["bodies/2/position"][:, 2]
    assert z == pytest.approx(np.full(len(z), z[0]), abs=1e-9)
    six = z[0]
    for _ in range(60):
        six -= (six + six**3 - z[0]) / (1 + 3 * six**2)
    assert 200 * z[0] == pytest.approx(9 * math.log(2 + 0.3 * six) - 2 * G, abs=1e-8)


@pytest.mark.parametrize("slope", ["1", "DIF(6)**2 + 1", "1 + TIME"])
def test_a_state_without_equilibrium_is_named(tmp_path, slope):
    states = state(5, "-DIF(5)") + state(6, slope, ic=0.7)
    with pytest.raises(SolverError, match=r"the rate of Control_Diff\[6\].* stays 1 after"):
        run(tmp_path, held("-200*DZ(20) + 9*DIF(5)", states))


def test_two_rests_in_a_row_keep_a_row_each(tmp_path):
    """The spring changes between them; the rows stand at one time, in their order."""
    model = f"""{EARTH}{sphere(-0.9, mass=3.0)}{GRAVITY}
<Force_SpringDamper id="1" type="TRANSLATIONAL" i_marker_id="20" j_marker_id="10"
  stiffness="500" damping="3" length="0.5"/>"""
    change = '<Force_SpringDamper id="1" stiffness="250"/>'
    after = '<Simulate analysis_type="Transient" end_time="0.2" print_interval="0.1"/>'
    results = run(tmp_path, model, STATIC + change + STATIC + after)
    assert results["time"].tolist() == pytest.approx([0.0, 0.0, 0.1, 0.2])
    z = results["bodies/2/position"][:, 2]
    assert z[0] == pytest.approx(-(0.5 + 3.0 * G / 500.0), abs=1e-12)
    assert z[1:] == pytest.approx(np.full(3, -(0.5 + 3.0 * G / 250.0)), abs=1e-9)
