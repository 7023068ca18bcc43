"""STICTION of contacts without give: closed forms, independent integrations, holding, resume."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import mbsim
from helpers.decks import contact, drift, run_deck, run_in_pieces, sphere, write_deck
from helpers.folders import MODELS, USERFUNCS
from mbsim.errors import DeckError, ModelError
from mbsim.run.replay import request

G = 9.81
IMPLICIT = ("RADAU5", "GALPHA")


def plane(tilt=0.0):
    """Return a plane and gravity that is tilted by so many degrees about y instead of it."""
    x, z = (-G * f(math.radians(tilt)) for f in (math.sin, math.cos))
    return f"""
<Body_Rigid id="1" isground="TRUE"/><Reference_Marker id="10" body_id="1"/>
<Post_Graphic id="100" type="Plane" rm_id="10"/>
<Force_Gravity grav_x="{x!r}" grav_z="{z!r}"/>"""


def block(v=(0.0, 0.0), tilt=0.0, low=False, height=0.1):
    """Return 1 kg on four points of 1e6 N/m, as deep as it rests; `low`: the cg is where it rubs.

    There friction turns nothing, so that all points press alike.
    """
    depth = G * math.cos(math.radians(tilt)) / 4e6
    middle = 0.5 * height - depth
    cg = -0.5 * depth if low else middle
    flags = "".join(
        f'v_ic_{axis}="{part!r}" v_ic_{axis}_flag="TRUE" '
        for axis, part in zip("xy", v, strict=True)
    )
    inertia = (0.04 + height**2) / 12.0
    return f"""
<Body_Rigid id="2" cg_id="20" mass="1" inertia_xx="{inertia!r}" inertia_yy="{inertia!r}"
  inertia_zz="{0.08 / 12.0!r}" {flags}/>
<Reference_Marker id="20" body_id="2" pos_z="{cg!r}"/>
<Reference_Marker id="21" body_id="2" pos_z="{middle!r}"/>
<Post_Graphic id="200" type="BoxDefinedFromCenter" center_marker_id="21"
  length_x="0.2" length_y="0.2" length_z="{height!r}"/>"""


def stiction(static=0.5, dynamic=0.4, **more):
    """Return a contact that holds without give."""
    given = {"cnf_type": "IMPACT", "stiffness": 1e6, "exponent": 1, "damping": 1e3, "dmax": 1e-6}
    given |= {"cff_type": "STICTION", "mu_static": static, "mu_dynamic": dynamic}
    return contact(**(given | {"tangential_stiffness": "INFINITE"} | more))


def push(x, y="0"):
    """Return a force on the block's cg, by expressions."""
    return f"""
<Force_Vector_OneBody id="401" type="ForceOnly" i_marker_id="20" ref_marker_id="10"
  fx_expression="{x}" fy_expression="{y}" fz_expression="0"/>"""


def events(results, kind):
    """Return when something of a kind happened, each time once for all points."""
    found = results["events"]
    return np.unique(found["time"][found["kind"] == kind])


def test_sdnd100_turns_and_stops_where_it_must():
    half = math.pi / 100.0
    model = mbsim.read_model(MODELS / "stiction_rigid.xml")
    results = mbsim.simulate(model, integrator="RADAU5", tol=1e-9, print_interval=half)
    x = results["bodies/2/position"][:, 0] * math.sqrt(2.0)
    np.testing.assert_allclose(x[:5] * 1e3, [0.85, -0.65, 0.45, -0.25, 0.05], rtol=0, atol=1e-9)
    np.testing.assert_allclose(events(results, "slip"), half * np.arange(1, 4), rtol=0, atol=1e-9)
    np.testing.assert_allclose(events(results, "stick"), 4.0 * half, rtol=0, atol=1e-9)
    # from there on it does not slip at all
    assert np.ptp(x[5:]) < 1e-18
    assert np.abs(results["bodies/2/velocity"][5:, :2]).max() < 1e-16
    force = results["contacts/301/force"][-1, :2]
    np.testing.assert_allclose(force, 0.5 / math.sqrt(2.0), rtol=1e-6)


@pytest.mark.parametrize("method", IMPLICIT)
def test_a_block_stays_on_an_incline_at_four_points(method, tmp_path):
    model = plane(20.0) + block(tilt=20.0) + stiction()
    results = run_deck(tmp_path, model, 110.0, 1.0, integrator=method, tol=1e-8)
    slope = G * math.sin(math.radians(20.0))
    assert events(results, "slip").size == 0
    # no point slips; the block rocks a little on its springs as it settles
    speed, height = results["contacts/301/slip_speed"], 0.05
    assert speed.max() < 1e-12
    spin = results["bodies/2/angular_velocity"][:, 1]
    x = results["bodies/2/position"][results["time"] >= 10.0, 0]
    np.testing.assert_allclose(
        results["bodies/2/velocity"][:, 0], height * spin, rtol=0, atol=1e-4 * np.abs(spin).max()
    )
    assert np.ptp(x) < (1e-15 if method == "RADAU5" else 1e-8)
    # what is shared out over points that lie in a plane but for their depths
    assert results["contacts/301/force"][-1, 0] == pytest.approx(slope, rel=1e-5)


@pytest.mark.parametrize(("method", "close"), [("RADAU5", 1e-8), ("GALPHA", 1e-5)])
def test_what_is_pushed_slips_when_its_static_friction_is_passed(method, close, tmp_path):
    # 2 t = mu_s m g; then m x'' = 2 t - mu_d m g
    static, dynamic, end = 0.5, 0.3, 4.0
    begins = 0.5 * static * G
    model = plane() + block(low=True) + stiction(static, dynamic) + push("2*TIME")
    results = run_deck(tmp_path, model, end, 0.1, integrator=method, tol=1e-8)
    np.testing.assert_allclose(events(results, "slip"), begins, rtol=0, atol=1e-8)
    assert len(results["events"]) == 8  # four points
    way = end - begins
    x = (end**3 - begins**3) / 3.0 - begins**2 * way - 0.5 * dynamic * G * way**2
    place = results["bodies/2/position"]
    assert place[-1, 0] == pytest.approx(x, abs=close)
    # it is held in the plane, half of its depth below where it rubs as it slides: a moment of that,
    # 1.2e-6 m, over the springs' 4e4 N m turns it, and moves the cg on that arm
    arm, stiff = G / 8e6, 4e6 * 0.1**2
    turned = static * G * arm / stiff * arm
    assert np.abs(place[results["time"] < begins, :2]).max() < 1.1 * turned


@pytest.mark.parametrize(("method", "close"), [("RADAU5", 1e-9), ("GALPHA", 1e-6)])
def test_a_block_thrown_across_an_incline_stops_where_it_must(method, close, tmp_path):
    v, tilt, mu = (0.3, 1.0), math.radians(10.0), 0.4

    def slides(t, z):
        part = mu * G * math.cos(tilt) / math.hypot(z[2], z[3])
        return [z[2], z[3], -G * math.sin(tilt) - part * z[2], -part * z[3]]

    def stops(t, z):
        return math.hypot(z[2], z[3]) - 1e-9

    stops.terminal = True
    by = {"method": "Radau", "rtol": 1e-11, "atol": 1e-13, "events": stops}
    found = solve_ivp(slides, (0.0, 1.0), [0.0, 0.0, *v], **by)
    model = plane(10.0) + block(v=v, tilt=10.0, low=True) + stiction(0.5, mu)
    results = run_deck(tmp_path, model, 1.0, 0.05, integrator=method, tol=1e-8)
    np.testing.assert_allclose(
        results["bodies/2/position"][-1, :2], found.y[:2, -1], rtol=0, atol=close
    )
    np.testing.assert_allclose(events(results, "stick"), found.t[-1], rtol=0, atol=10.0 * close)
    assert drift(results) < 1e-5
    assert np.ptp(results["bodies/2/position"][results["time"] > 0.4, :2], axis=0).max() < 1e-16


@pytest.mark.parametrize("method", IMPLICIT)
def test_a_sphere_rolls_down_an_incline_without_slip(method, tmp_path):
    # a = g sin/(1 + J/(m r^2)): 5/7 of g sin for J = 2/5 m r^2; r to the middle of the depth
    mass, radius, tilt = 2.0, 0.1, math.radians(20.0)
    depth = (mass * G * math.cos(tilt) / 1e5) ** (2.0 / 3.0)
    r = radius - 0.5 * depth
    ball = sphere(radius - depth, mass=mass, radius=radius, inertia=0.4 * mass * r * r)
    model = plane(20.0) + ball + stiction(stiffness=1e5, exponent=1.5, damping=100, dmax=1e-3)
    results = run_deck(tmp_path, model, 2.0, 0.1, integrator=method, tol=1e-8)
    fall = -5.0 / 7.0 * G * math.sin(tilt)
    np.testing.assert_allclose(
        results["bodies/2/position"][:, 0], 0.5 * fall * results["time"] ** 2, rtol=0, atol=1e-9
    )
    assert results["contacts/301/slip_speed"].max() < 1e-14
    # friction holds with 2/7 of the weight along the plane, and takes nothing
    force = results["contacts/301/force"][-1, 0]
    assert force == pytest.approx(2.0 / 7.0 * mass * G * math.sin(tilt), rel=1e-9)
    assert drift(results) < 1e-9


@pytest.mark.parametrize(
    ("angle", "margin", "tol", "slip"),
    [
        (20.0, 0.003, 1e-5, 9.7e-7),
        (20.0, 0.01, 1e-5, 2.1e-7),
        # loose: what Newton's iteration left, some 1e-9 m, let what was held slip again after 2 s,
        # and what slid slide ten times as far
        (5.0, 1e-3, 1e-3, 6.88e-7),
        (10.0, 1e-4, 1e-3, 1.473e-5),
    ],
)
def test_a_block_put_down_near_its_limit_slips_a_little_and_holds(
    angle, margin, tol, slip, tmp_path
):
    # as deep on all points as it would rest on a plane: it tilts onto its front points at first.
    # The slip is that of a planar integration; a point let go alone slid 0.7 m in 3 s
    tilt = math.radians(angle)
    depth = 2.0 * G * math.cos(tilt) / 4e6
    body = f"""
<Body_Rigid id="2" cg_id="20" mass="2" inertia_xx="0.02" inertia_yy="0.02" inertia_zz="0.03"/>
<Reference_Marker id="20" body_id="2" pos_z="{0.05 - depth!r}"/>
<Post_Graphic id="200" type="BoxDefinedFromCenter" center_marker_id="20"
  length_x="0.3" length_y="0.3" length_z="0.1"/>"""
    mu = math.tan(tilt) * (1.0 + margin)
    model = plane(angle) + body + stiction(mu, mu, damping=2e3, dmax=1e-5)
    results = run_deck(tmp_path, model, 3.0, 0.1, integrator="RADAU5", tol=tol)
    place, turn = results["bodies/2/position"], results["bodies/2/quaternion"]
    text = place[:, 0] - 0.05 * 2.0 * turn[:, 2]  # the middle of its lower face
    assert -text[-1] == pytest.approx(slip, rel=0.05)
    assert np.ptp(text[6:]) < 1e-12
    assert len(events(results, "slip")) == len(events(results, "stick")) == 1


def turned_block(scale, tilt, margin, down, psi):
    """Return a block that is turned by psi, put down flat on an incline that falls along `down`."""
    pull, mu = G * scale * math.sin(tilt), math.tan(tilt) * (1.0 + margin)
    gx, gy, gz = pull * math.cos(down), pull * math.sin(down), -G * scale * math.cos(tilt)
    z, turn = (0.05 - 2.0 * G * math.cos(tilt) / 4e6) * scale, 0.02 * scale**2
    unit = "METER" if scale == 1.0 else "MILLIMETER"
    given = {"stiffness": 1e6 / scale, "damping": 2e3 / scale, "dmax": 1e-5 * scale}
    block = f"""
<Param_Unit force_unit="NEWTON" mass_unit="KILOGRAM" length_unit="{unit}" time_unit="SECOND"/>
<Body_Rigid id="1" isground="TRUE"/><Reference_Marker id="10" body_id="1"/>
<Post_Graphic id="100" type="Plane" rm_id="10"/>
<Force_Gravity grav_x="{gx!r}" grav_y="{gy!r}" grav_z="{gz!r}"/>
<Body_Rigid id="2" cg_id="20" mass="2" inertia_xx="{turn!r}" inertia_yy="{turn!r}"
  inertia_zz="{1.5 * turn!r}"/>
<Reference_Marker id="20" body_id="2" pos_z="{z!r}" psi="{psi!r}"/>
<Post_Graphic id="200" type="BoxDefinedFromCenter" center_marker_id="20"
  length_x="{0.3 * scale!r}" length_y="{0.3 * scale!r}" length_z="{0.1 * scale!r}"/>"""
    return block + stiction(mu, mu, **given)


@pytest.mark.parametrize("tol", [1e-3, 1e-5, 1e-7, 1e-9])
@pytest.mark.parametrize(("scale", "turned"), [(1.0, 1.0), (1000.0, 0.3)], ids=["m", "mm"])
def test_and_a_block_that_is_turned_on_its_incline(scale, turned, tol, tmp_path):
    # as before, but a corner is in front: each point slips a little otherwise. What begins to slip
    # is slower than any tolerance, and each way across was met by the whole of friction: Newton's
    # iteration ended for steps of 1e-9 s alone. A square block tilts alike about all lines
    tilt, margin, down = math.radians(20.0), 1e-3, 2.0
    model = turned_block(scale, tilt, margin, down, down + turned)
    results = run_deck(tmp_path, model, 3.0, 0.1, integrator="RADAU5", tol=tol)
    w, x, y, v = results["bodies/2/quaternion"].T
    up = np.array([2.0 * (x * v + w * y), 2.0 * (y * v - w * x)]).T
    text = results["bodies/2/position"][:, :2] / scale - 0.05 * up  # the middle of its lower face
    way = text[-1] @ [math.cos(down), math.sin(down)]
    # that of a planar integration
    assert way == pytest.approx(3.161e-6, rel=0.05)
    assert np.ptp(text[-8:], axis=0).max() < 1e-11
    assert results.stats["steps"] < 1000


@pytest.mark.parametrize("scale", [1.0, 1000.0], ids=["m", "mm"])
@pytest.mark.parametrize("method", IMPLICIT)
def test_a_block_that_slows_down_ever_so_little_stops_and_holds(method, scale, tmp_path):
    # turned on its incline, so that no axis is that of slip, and put down flat, it tilts onto its
    # front points and slides on at some 1e-4 m/s, slowed by 2e-4 of what pulls it. Errors of
    # velocities across, all within the tolerance, took so much from friction that it crept for ever
    tilt, margin, across = math.radians(30.0), 2e-4, 5.4
    model = turned_block(scale, tilt, margin, across, 2.0)
    results = run_deck(tmp_path, model, 1.0, 0.1, integrator=method)
    place = results["bodies/2/position"] / scale
    assert len(events(results, "stick")) > 0
    # GALPHA goes on rocking a little on its springs, by tol of what it sinks in (4e-6 m) or so; it
    # pitches at sqrt(4e6*0.15^2/0.02) = 2100 rad/s, and that is the speed its rocking has
    most = 1e-12 if method == "RADAU5" else 1e-9
    assert np.ptp(place[-4:], axis=0).max() < most
    speed = np.abs(results["bodies/2/velocity"][-4:]).max() / scale
    assert speed < (1e-10 if method == "RADAU5" else 2100.0 * most)


def test_blocks_on_each_other_part_where_the_weaker_friction_gives_way(tmp_path):
    # 2 kg on friction that holds, 1 kg on it by mu = 0.2; the lower is pulled: 4 t - 0.3*3 g drags
    # both from t1 on, the upper one slips from where their common acceleration passes 0.2 g
    t1 = 0.3 * 3.0 * G / 4.0
    t2 = (3.0 * 0.2 * G + 0.3 * 3.0 * G) / 4.0
    z = 0.1 - 3.0 * G / 4e6
    upper = f"""
<Body_Rigid id="3" cg_id="30" mass="1" inertia_xx="0.01" inertia_yy="0.01" inertia_zz="0.01"/>
<Reference_Marker id="30" body_id="3" pos_z="{z - 0.5 * G / 4e6!r}"/>
<Reference_Marker id="31" body_id="3" pos_z="{z + 0.05 - G / 4e6!r}"/>
<Post_Graphic id="300" type="BoxDefinedFromCenter" center_marker_id="31"
  length_x="0.1" length_y="0.1" length_z="0.1"/>"""
    lower = f"""
<Body_Rigid id="2" cg_id="20" mass="2" inertia_xx="0.02" inertia_yy="0.02" inertia_zz="0.02"/>
<Reference_Marker id="20" body_id="2"/>
<Reference_Marker id="21" body_id="2" pos_z="{z - 0.05!r}"/>
<Post_Graphic id="200" type="BoxDefinedFromCenter" center_marker_id="21"
  length_x="0.4" length_y="0.4" length_z="0.1"/>"""
    guide = "".join(
        f'<Constraint_Joint id="{b}" type="PLANAR" i_marker_id="{b}2" j_marker_id="12"/>'
        f'<Reference_Marker id="{b}2" body_id="{b}" {turn}/>'
        for b, turn in ((2, 'theta="1.5707963267948966"'), (3, 'theta="1.5707963267948966"'))
    )
    guide += '<Reference_Marker id="12" body_id="1" theta="1.5707963267948966"/>'
    model = plane() + lower + upper + guide + stiction(0.3, 0.3)
    model += stiction(0.2, 0.2, i=300, j=200, id=302) + push("4*TIME")
    results = run_deck(tmp_path, model, t2 + 0.3, 0.05, integrator="RADAU5", tol=1e-7)
    slips = results["events"][results["events"]["kind"] == "slip"]
    first = {id: slips["time"][slips["element"] == id].min() for id in (301, 302)}
    assert first[301] == pytest.approx(t1, abs=2e-3)
    assert first[302] == pytest.approx(t2, abs=2e-2)
    v = results["bodies/3/velocity"][-1, 0]
    assert v == pytest.approx((t2 - t1) ** 2 * 4.0 / 6.0 + 0.2 * G * 0.3, rel=2e-2)


def test_incidents_show_what_holds_them(tmp_path):
    # pushed where it rubs all points hold alike
    model = plane(20.0) + block(tilt=20.0, low=True) + stiction()
    results = run_deck(tmp_path, model, 0.1, 0.05, integrator="RADAU5")
    first = "Force_Contact[301].incident"
    names = [f"{first}[{k}].{what}" for k in range(4) for what in ("friction", "mode", "slip")]
    _, columns = request(results, names)
    for k in range(4):
        assert columns[f"{first}[{k}].mode"] == ["stick"] * 3
        held = np.hypot(columns[f"{first}[{k}].friction/x"], columns[f"{first}[{k}].friction/y"])
        np.testing.assert_allclose(held, 0.25 * G * math.sin(math.radians(20.0)), rtol=1e-5)
        assert max(columns[f"{first}[{k}].slip"]) < 1e-12


def test_explicit_methods_refuse_it_by_name(tmp_path):
    model = mbsim.read_model(write_deck(tmp_path, plane() + block() + stiction()))
    said = r"deck.xml:\d+: Force_Contact\[301\]: tangential_stiffness=INFINITE: rigid .* RADAU5"
    for method in ("DOPRI5", "DOP853", "VERLET"):
        with pytest.raises(ModelError, match=said):
            mbsim.simulate(model, integrator=method)
    from mbsim.run.settings import settle

    settings = settle(model)
    assert settings.integrator == "RADAU5"
    said = "integrator AUTO: RADAU5 from the start, for Force_Contact[301] is rigid"
    assert said in settings.notes


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ({"tangential_stiffness": "inf"}, "must be a number > 0 or INFINITE"),
        (
            {"tangential_damping": 1},
            "tangential_damping=.* means nothing with tangential_stiffness",
        ),
        ({"rotational_stiffness": 1, "torsion_radius": 1}, "means nothing with tangential_stiff"),
    ],
)
def test_what_means_nothing_with_it_is_said(more, said, tmp_path):
    with pytest.raises(DeckError, match=said):
        mbsim.read_model(write_deck(tmp_path, plane() + block() + stiction(**more)))


def test_pairs_that_fcl_finds_are_refused(tmp_path):
    model = mbsim.read_model(write_deck(tmp_path, plane() + block() + stiction()))
    with pytest.raises(DeckError, match=r"Force_Contact\[301\]: .*INFINITE: .* found by FCL"):
        mbsim.simulate(model, detector="fcl")


@pytest.mark.parametrize("method", IMPLICIT)
def test_resumed_it_is_the_same_run(method, tmp_path, monkeypatch):
    text = plane() + block() + stiction(0.5, 0.3) + push("6*SIN(9*TIME)", "0.1*TIME")
    model = mbsim.read_model(write_deck(tmp_path, text, 1.5, 0.05))
    settings = {"integrator": method, "tol": 1e-5}
    straight = mbsim.simulate(model, **settings)
    assert len(straight["events"]) >= 12
    found = run_in_pieces(model, tmp_path, monkeypatch, **settings)
    for name in straight.keys():
        np.testing.assert_array_equal(found[name], straight[name], err_msg=name)
    found.close()


@pytest.mark.parametrize("method", IMPLICIT)
def test_what_rests_under_a_load_that_comes_and_goes_slips_in_time(method, tmp_path):
    # nothing moves, so that no error shortens a step: it is not to miss the load's peak
    model = (
        plane()
        + block(low=True)
        + stiction(0.5, 0.3)
        + push("4.95*SIN(9*(TIME-2))*STEP(TIME,1,0,2,1)")
    )
    results = run_deck(tmp_path, model, 2.2, 0.1, integrator=method)
    begins = 2.0 + math.asin(0.5 * G / 4.95) / 9.0
    np.testing.assert_allclose(events(results, "slip")[0], begins, rtol=0, atol=1e-6)


def test_beside_an_element_of_the_users_own_both_remember(tmp_path):
    # apart from each other, so that each goes as it goes alone
    script = USERFUNCS / "dry_friction_element.py"
    other = """
<Body_Rigid id="3" cg_id="30" mass="1" inertia_xx="0.1" inertia_yy="0.1" inertia_zz="0.1"/>
<Reference_Marker id="30" body_id="3" pos_x="0.85"/>
<Force_Vector_TwoBody id="402" type="ForceOnly" i_marker_id="30" j_floating_marker_id="10"
  ref_marker_id="10" fx_expression="-4*DX(30,10)" fy_expression="0" fz_expression="0"/>"""
    own = f"""
<Force_Element id="7" i_marker_id="30" j_marker_id="10" direction="TX" script_name="{script}"
  usrsub_fnc_name="dry_friction" usrsub_param_string="USER(0.4, 0.02)"/>"""
    text = plane() + block(low=True) + stiction(0.5, 0.3) + push("6*SIN(9*TIME)")
    settings = {"integrator": "RADAU5", "tol": 1e-7}
    both = run_deck(tmp_path, text + other + own, 1.5, 0.05, **settings)
    block_alone = run_deck(tmp_path, text, 1.5, 0.05, **settings)
    other_alone = run_deck(tmp_path, plane() + other + own, 1.5, 0.05, **settings)
    for id, alone in ((2, block_alone), (3, other_alone)):
        name = f"bodies/{id}/position"
        np.testing.assert_allclose(both[name], alone[name], rtol=0, atol=2e-6)
    slips = both["events"][both["events"]["kind"] == "slip"]
    assert len(slips) > 4
    assert np.ptp(both["force_elements/7/f"]) > 0.39


def boxes_of_one_size(count, damping):
    """Return boxes of 1 kg and 0.1 m on each other, which just touch, and their contacts."""
    boxes, ids = "", []
    for k in range(count):
        marker, z = 20 + 10 * k, 0.05 + 0.1 * k
        boxes += f"""
<Body_Rigid id="{2 + k}" cg_id="{marker}" mass="1" inertia_xx="0.001667" inertia_yy="0.001667"
  inertia_zz="0.001667"/><Reference_Marker id="{marker}" body_id="{2 + k}" pos_z="{z}"/>
<Post_Graphic id="{10 * marker}" type="BoxDefinedFromCenter" center_marker_id="{marker}"
  length_x="0.1" length_y="0.1" length_z="0.1"/>"""
        ids.append(str(10 * marker))
    law = f"""cnf_type="IMPACT" stiffness="1e6" exponent="1" damping="{damping}" dmax="1e-5"
  cff_type="STICTION" mu_static="0.5" mu_dynamic="0.4" tangential_stiffness="INFINITE" """
    lists = f'num_i_graphics="{count}" i_graphics_id="{" ".join(ids)}"'
    return (
        boxes
        + f'<Force_Contact id="301" {lists} {lists.replace("i_", "j_")} {law}/>'
        + f'<Force_Contact id="302" {lists} num_j_graphics="1" j_graphics_id="100" {law}/>'
    )


@pytest.mark.parametrize("damping", [100, 1000])
@pytest.mark.parametrize("method", ["RADAU5", "GALPHA"])
def test_boxes_of_one_size_on_each_other_hold_a_push(method, damping, tmp_path):
    # whose corners touch is not to be said by rounding: edges lie on each other
    model = plane() + boxes_of_one_size(3, damping) + push("STEP(TIME,0,0,0.5,10)")
    results = run_deck(tmp_path, model, 1.0, 0.1, integrator=method)
    # 10 N are 2.5e-6 m of four contacts of 1e6 N/m that the lowest box turns on
    assert abs(results["bodies/2/position"][-1, :2]).max() < 1e-5
    assert len(results["events"]) < 150
    assert results.stats["steps"] < 2000


@pytest.mark.parametrize("count", [2, 3])
@pytest.mark.parametrize("method", ["RADAU5", "GALPHA"])
def test_boxes_of_one_size_on_each_other_slide_as_one(method, count, tmp_path):
    # what holds a corner that passes an edge holds on there
    most = 6.0 * count
    text = plane() + boxes_of_one_size(count, 300) + push(f"STEP(TIME,0,0,0.5,{most!r})")
    results = run_deck(tmp_path, text, 1.0, 0.1, integrator=method)

    def force(t):
        part = min(1.0, t / 0.5)
        return most * part * part * (3.0 - 2.0 * part)

    def moves(t, y):
        return [y[1], force(t) / count - 0.4 * G]

    begins = brentq(lambda t: force(t) - 0.5 * G * count, 0.0, 0.5, xtol=1e-14)
    way = solve_ivp(moves, (begins, 1.0), [0.0, 0.0], rtol=1e-11, atol=1e-12).y[0, -1]
    slips = events(results, "slip")
    # what it does while it settles is another thing
    np.testing.assert_allclose(slips[slips > 0.1][0], begins, rtol=0, atol=2e-4)
    for body in range(2, 2 + count):
        assert results[f"bodies/{body}/position"][-1, 0] == pytest.approx(way, rel=1e-3)
    assert results.stats["steps"] < 2000
