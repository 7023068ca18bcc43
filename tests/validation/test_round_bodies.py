"""Cylinders, frusta and ellipsoids that stand, lie, roll, rock: against closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest

from helpers.decks import COULOMB, GRAVITY, GROUND, contact, run_deck

G = 9.81
BOX_GROUND = """<Body_Rigid id="1" isground="TRUE"/>
<Reference_Marker id="10" body_id="1" pos_z="-0.5"/>
<Post_Graphic id="100" type="BoxDefinedFromCenter" center_marker_id="10"
  length_x="2" length_y="2" length_z="1"/>"""
DRUM = """<Body_Rigid id="1" isground="TRUE"/>
<Reference_Marker id="10" body_id="1" pos_z="-0.5"/>
<Post_Graphic id="100" type="Cylinder" center_marker_id="10" radius="{r}" length="0.5"/>"""
SOLID = 'type="Cylinder" radius="0.1" length="0.2"'
CONE = 'type="Frustum" bottom_radius="0.12" top_radius="0.06" length="0.2"'
LAW = {"stiffness": 1e5, "exponent": 1.5, "damping": 300.0, "dmax": 1e-4, **COULOMB}
UNDAMPED = {"stiffness": 1e5, "exponent": 1.5}


def body(graphic, mass=1.0, z=0.1, x=0.0, y=0.0, half=0.1, axes="", ic="", inertia=None):
    """Return a body whose cg marker 20 has the shape's axis as z, the base `half` below it."""
    xx, zz = inertia or ((3 * 0.01 + 0.04) / 12, 0.005)
    return f"""
<Body_Rigid id="2" cg_id="20" mass="{mass!r}" inertia_xx="{mass * xx!r}" inertia_yy="{mass * xx!r}"
  inertia_zz="{mass * zz!r}" {ic}/>
<Reference_Marker id="20" body_id="2" pos_x="{x!r}" pos_y="{y!r}" pos_z="{z!r}" {axes}/>
<Reference_Marker id="21" body_id="2" rm_id="20" pos_z="{-half!r}"/>
<Post_Graphic id="200" center_marker_id="21" {graphic}/>"""


def along_y(x=1.0, z=0.0):
    """Return cosines of a marker whose z-axis is the global y: a solid that lies."""
    return f'a00="{x!r}" a20="{z!r}" a01="{z!r}" a11="0" a21="{-x!r}" a02="0" a12="1" a22="0"'


def given(**values):
    """Return initial velocities as attributes."""
    words = []
    for key, value in values.items():
        kind, axis = key.split("_")
        words.append(f'{kind}_ic_{axis}="{value!r}" {kind}_ic_{axis}_flag="TRUE"')
    return " ".join(words)


def rest_depth(share, weight=G, stiffness=1e5, exponent=1.5):
    """Return the depth at which incidents of this total share carry the weight."""
    return (weight / (share * stiffness)) ** (1 / exponent)


@pytest.mark.parametrize("graphic", [SOLID, CONE])
@pytest.mark.parametrize(
    ("ground", "x", "share"),
    [(GROUND, 0.0, 3.0), (BOX_GROUND, 0.0, 3.0), (BOX_GROUND, 0.95, 3.5),
     (DRUM.format(r=0.5), 0.0, 3.0), (DRUM.format(r=0.07), 0.02, 3.0),
     (DRUM.format(r=0.1), 0.05, 3.0)],
    ids=["plane", "box", "over an edge", "wide drum", "thin drum", "drum off centre"],
)  # fmt: skip
def test_a_dropped_solid_comes_to_stand(tmp_path, graphic, ground, x, share):
    # dropped flat from 1 mm above; a thin support under it carries as well
    model = ground + body(graphic, z=0.101, x=x) + contact(**LAW) + GRAVITY
    results = run_deck(tmp_path, model, end_time=1.0)
    late = results["time"] > 0.9
    assert np.abs(results["bodies/2/angular_velocity"][late]).max() < 1e-4
    # off the centre it leans by some 1e-2 rad, and smoothed friction creeps under that slope
    assert np.abs(results["bodies/2/velocity"][late]).max() < (1e-5 if x == 0.0 else 5e-4)
    assert results["contacts/301/force/z"][-1] == pytest.approx(G, rel=1e-3)
    depth = results["contacts/301/penetration"][-1]
    assert 0.5 * rest_depth(4.0) < depth < 3.0 * rest_depth(3.0)
    if x == 0.0:
        assert depth == pytest.approx(rest_depth(share), rel=1e-3)
    assert results.stats["fcl_calls"] == 0


@pytest.mark.parametrize("ground", [GROUND, BOX_GROUND], ids=["plane", "box"])
def test_a_lying_cylinder_rolls_straight_and_keeps_its_speed(tmp_path, ground):
    # the contact point is half a depth below the surface
    v, arm = 0.5, 0.1 - 0.5 * rest_depth(2.0)
    model = (
        ground
        + body(SOLID, x=-0.6, z=0.1 - rest_depth(2.0), axes=along_y(),
               ic=given(v_x=v, w_y=v / arm))
        + contact(**LAW) + GRAVITY
    )  # fmt: skip
    results = run_deck(tmp_path, model, end_time=2.0)
    assert results["bodies/2/velocity/x"][-1] == pytest.approx(v, rel=1e-4)
    assert np.abs(results["bodies/2/position/y"]).max() < 1e-6
    assert np.abs(results["bodies/2/angular_velocity"][:, [0, 2]]).max() < 1e-5
    depth = results["contacts/301/penetration"][-1]
    assert depth == pytest.approx(rest_depth(2.0), rel=1e-3)
    assert results.stats["fcl_calls"] == 0


@pytest.mark.parametrize("kind", ["Plane", "Box"])
def test_a_cylinder_rolls_down_an_incline(tmp_path, kind):
    # a = g sin(angle)/(1 + I/(m arm^2)), 2/3 g sin(angle) for an arm r; the contact point is half a
    # depth below the surface. Gravity is turned instead of the ground
    angle = math.radians(20.0)
    ground = GROUND if kind == "Plane" else BOX_GROUND
    gravity = f'<Force_Gravity grav_x="{G * math.sin(angle)!r}" grav_z="{-G * math.cos(angle)!r}"/>'
    z = 0.1 - rest_depth(2.0, G * math.cos(angle))
    model = (
        ground
        + body(SOLID, x=-0.8, z=z, axes=along_y())
        + contact(**{**LAW, "mu_static": 0.5, "mu_dynamic": 0.5,
                     "stiction_trans_vel": 1e-4, "friction_trans_vel": 2e-4})
        + gravity
    )  # fmt: skip
    results = run_deck(tmp_path, model, end_time=0.8)
    t, x = results["time"], results["bodies/2/position/x"]
    arm = 0.1 - 0.5 * rest_depth(2.0, G * math.cos(angle))
    expected = -0.8 + 0.5 * G * math.sin(angle) / (1.0 + 0.005 / arm**2) * t**2
    np.testing.assert_allclose(x, expected, atol=3e-4 * (expected[-1] + 0.8))
    assert np.abs(results["bodies/2/position/y"]).max() < 1e-6


@pytest.mark.parametrize("ground", [GROUND, BOX_GROUND], ids=["plane", "box"])
def test_a_frustum_lies_on_its_side(tmp_path, ground):
    # laid on its side it rests on the line between both rims
    fall, length = 0.06, 0.2
    half_angle = math.atan2(fall, length)
    c, s = math.cos(half_angle), math.sin(half_angle)
    # the axis is the half angle off the horizontal, so that the lower side is flat
    mid = 0.09
    axes = (f'a00="{s!r}" a10="0" a20="{c!r}" a01="0" a11="-1" a21="0" '
            f'a02="{c!r}" a12="0" a22="{-s!r}"')  # fmt: skip
    model = (
        ground
        + body(CONE, z=mid * c - rest_depth(2.0) + 1e-4, axes=axes)
        + contact(**LAW)
        + GRAVITY
    )
    results = run_deck(tmp_path, model, end_time=0.5)
    assert np.abs(results["bodies/2/velocity"][-1]).max() < 1e-4
    assert np.abs(results["bodies/2/angular_velocity"][-1]).max() < 2e-3


@pytest.mark.parametrize("ground", [GROUND, BOX_GROUND], ids=["plane", "box"])
def test_an_ellipsoid_rocks_with_its_closed_form(tmp_path, ground):
    # on its blunt side, friction free: omega^2 = m g (rho - c)/I with rho = a^2/c the radius of
    # curvature below, as the centre moves vertically only: potential m g (rho - c) angle^2/2
    a, c = 0.2, 0.1
    turn = 0.01
    height = math.sqrt((a * math.sin(turn)) ** 2 + (c * math.cos(turn)) ** 2)
    rest = rest_depth(1.0, G, 1e9)
    model = (
        ground
        + body(f'type="Ellipsoid" x_scale="{a}" y_scale="{a}" z_scale="{c}"', z=height - rest,
               half=0.0, inertia=((a * a + c * c) / 5, 2 * a * a / 5),
               axes=f'a00="{math.cos(turn)!r}" a20="{-math.sin(turn)!r}" '
                    f'a02="{math.sin(turn)!r}" a22="{math.cos(turn)!r}"')
        + contact(stiffness=1e9, exponent=1.5, damping=1e4, dmax=1e-5)
        + GRAVITY
    )  # fmt: skip
    results = run_deck(tmp_path, model, end_time=1.2, tol=1e-7)
    omega = math.sqrt(G * (a * a / c - c) / ((a * a + c * c) / 5))
    tilt = results["bodies/2/quaternion"][:, 2] * 2.0
    # amplitude 0.01: the period is longer by some 1e-4; contact compliance as little
    np.testing.assert_allclose(tilt, turn * np.cos(omega * results["time"]), atol=0.02 * turn)
    assert results.stats["fcl_calls"] == 0


@pytest.mark.parametrize(
    ("graphic", "ground"),
    [(SOLID, GROUND), (SOLID, BOX_GROUND), (CONE, BOX_GROUND), (SOLID, DRUM.format(r=0.5)),
     ('type="Ellipsoid" x_scale="0.1" y_scale="0.07" z_scale="0.05"', BOX_GROUND),
     ('type="Ellipsoid" x_scale="0.1" y_scale="0.07" z_scale="0.05"', DRUM.format(r=0.5))],
)  # fmt: skip
def test_a_tumbling_solid_keeps_its_energy(tmp_path, graphic, ground):
    # without friction and damping, bouncing on ends, rims and sides over the middle of its support
    turned = 'psi="0.3" theta="0.7" phi="0.2"'
    model = (
        ground
        + body(graphic, z=0.3, axes=turned, ic=given(w_x=1.0, w_y=-2.0))
        + contact(**UNDAMPED)
        + GRAVITY
    )
    results = run_deck(tmp_path, model, end_time=1.0, tol=1e-8)
    total = results["energy/kinetic"] + results["energy/potential"]
    assert results["contacts/301/peak_penetration"] > 0.0
    assert np.abs(total - total[0]).max() < 1e-5 * G


def test_a_cylinder_tilted_on_a_box_falls_back_without_gaining_energy(tmp_path):
    # let go at 0.1 rad on its rim it rocks from rim to rim and comes to rest
    t = 0.1
    axes = (
        f'a00="{math.cos(t)!r}" a20="{-math.sin(t)!r}" a02="{math.sin(t)!r}" a22="{math.cos(t)!r}"'
    )
    z = 0.1 * (math.cos(t) + math.sin(t))
    model = BOX_GROUND + body(SOLID, z=z, x=0.93, axes=axes) + contact(**LAW) + GRAVITY
    results = run_deck(tmp_path, model, end_time=2.0)
    total = results["energy/kinetic"] + results["energy/potential"]
    assert total.max() < total[0] + 1e-4 * G * z
    assert np.abs(results["bodies/2/angular_velocity"][-1]).max() < 1e-2
    assert results["bodies/2/position/z"][-1] == pytest.approx(0.1, abs=1e-3)


@pytest.mark.parametrize("tip", [2.0, -4.0])
def test_points_of_a_patch_that_leave_take_no_short_steps(tmp_path, tip):
    # their depth goes on otherwise than their rate has it: steps that ended where they would leave
    # fell to 1.6e-12 s, where RADAU5 sees nothing but rounding, and gave up beside a pendulum
    law = {"cnf_type": "HUNT_CROSSLEY", "stiffness": 3.4e5, "restitution_coef": 0.9}
    friction = {
        "cff_type": "COULOMB_DYNAMICONLY",
        "mu_dynamic": 0.135,
        "friction_trans_vel": 0.0023,
    }
    deck = f"""{GROUND}{GRAVITY}
<Body_Rigid id="2" cg_id="20" mass="0.25" inertia_xx="4.6e-4" inertia_yy="4.6e-4"
  inertia_zz="5.9e-4" v_ic_x="0.3" v_ic_x_flag="TRUE" w_ic_x="0.4" w_ic_x_flag="TRUE"
  w_ic_y="{tip}" w_ic_y_flag="TRUE"/>
<Reference_Marker id="20" body_id="2" pos_z="0.077"/>
<Reference_Marker id="21" body_id="2" pos_z="1e-5"/>
<Post_Graphic id="200" type="Cylinder" center_marker_id="21" radius="0.068" length="0.154"/>
{contact(**law, ref_velocity=1.0, exponent=1.5, **friction)}"""
    results = run_deck(tmp_path, deck, 0.25, 0.05, integrator="RADAU5", tol=1e-8)
    assert results.stats["h_smallest"] > 1e-10
