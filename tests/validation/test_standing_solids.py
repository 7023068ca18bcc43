"""Solids of revolution that stand, slide and spin: their own axes, and noise, change nothing."""

from __future__ import annotations

import numpy as np
import pytest
from lxml import etree
from scipy.special import ellipe, ellipk

import mbsim
from helpers import random_decks
from helpers.decks import GRAVITY, GROUND, run_deck
from helpers.invariances import CHANGES
from helpers.standing import apart, poses_of

LAWS = {
    "COULOMB_ON": (
        'mu_static="0.35" mu_dynamic="0.25" stiction_trans_vel="0.01" friction_trans_vel="0.05"'
    ),
    "LUGRE": (
        'mu_static="0.3" mu_dynamic="0.25" stribeck_vel="0.05" '
        'bristle_stiffness="1e4" bristle_damping="10"'
    ),
    "DAHL": 'mu_dynamic="0.25" bristle_stiffness="1e4"',
    "STICTION": 'mu_static="0.3" mu_dynamic="0.25" tangential_stiffness="1e4"',
}
SHAPES = {
    "cylinder": 'type="Cylinder" radius="0.1" length="0.08"',
    "frustum": 'type="Frustum" bottom_radius="0.1" top_radius="0.06" length="0.08"',
    "ellipsoid": 'type="Ellipsoid" x_scale="0.1" y_scale="0.1" z_scale="0.04"',
}
TOL = 1e-7


def deck(shape, law, turn=0.0, vx=0.5, wz=4.0, slope=1.0, end=0.3, above=0.0):
    """Return a solid that stands on a plane, its own axes turned about its axis; in SI units."""
    # the marker of a cylinder and a frustum is at the end on which they stand
    low = above + (0.04 if shape == "ellipsoid" else 0.0)
    c, s = np.cos(turn), np.sin(turn)
    return f"""<MotionSolve><Model>
<Param_Unit force_unit="NEWTON" mass_unit="KILOGRAM" length_unit="METER" time_unit="SECOND"/>
<Body_Rigid id="1" isground="TRUE"/>
<Reference_Marker id="10" body_id="1"/>
<Post_Graphic id="100" type="Plane" rm_id="10"/>
<Reference_Marker id="20" body_id="2" pos_z="{above + 0.04}"/>
<Reference_Marker id="21" body_id="2" pos_z="{low}" a00="{c}" a10="{s}" a20="0"
  a01="{-s}" a11="{c}" a21="0" a02="0" a12="0" a22="1"/>
<Body_Rigid id="2" cg_id="20" mass="1" inertia_xx="0.0035" inertia_yy="0.003" inertia_zz="0.005"
  v_ic_x="{vx}" v_ic_x_flag="TRUE" w_ic_z="{wz}" w_ic_z_flag="TRUE"/>
<Post_Graphic id="200" {SHAPES[shape]} center_marker_id="21"/>
<Force_Gravity grav_x="{slope}" grav_z="-9.8"/>
<Force_Contact id="1" num_i_graphics="1" i_graphics_id="200" num_j_graphics="1"
  j_graphics_id="100" cnf_type="IMPACT" stiffness="2e5" exponent="1.5" damping="50" dmax="1e-4"
  cff_type="{law}" {LAWS[law]}/>
</Model><Command>
<Simulate analysis_type="Transient" end_time="{end}" print_interval="{end / 6}"/>
</Command></MotionSolve>"""


def run(path, text, method="DOPRI5"):
    """Return the poses of a text's body, positions over 0.1 m."""
    path.write_text(text, encoding="utf-8")
    found = random_decks.run(path, method, TOL, 0.1)
    assert found.status == "ok"
    assert not found.warnings
    return poses_of(found, [2])


@pytest.mark.parametrize("vx", [0.5, 0.0])
@pytest.mark.parametrize(
    ("shape", "law"),
    [*(("cylinder", law) for law in LAWS), ("frustum", "LUGRE"), ("ellipsoid", "LUGRE")],
)
def test_the_motion_depends_on_no_axes_of_its_own(tmp_path, shape, law, vx):
    text = deck(shape, law, vx=vx)
    plain = run(tmp_path / "plain.xml", text)
    turned = run(tmp_path / "turned.xml", deck(shape, law, turn=0.7, vx=vx))
    assert apart(plain, turned).max() < 1000.0 * TOL
    for name in ("rotated", "mirrored", "swapped", "idle"):
        root = etree.fromstring(text.encode())
        change = CHANGES[name](np.random.default_rng(4), root, 0.1)
        seen = run(tmp_path / f"{name}.xml", etree.tostring(root, encoding="unicode"))
        long = change({body: (0.1 * p, R) for body, (p, R) in plain.items()})
        expected = {body: (p / 0.1, R) for body, (p, R) in long.items()}
        assert apart(expected, seen).max() < 1000.0 * TOL, name


def test_implicit_methods_see_the_same_friction(tmp_path):
    for law in LAWS:
        text = deck("cylinder", law)
        one, other = run(tmp_path / "e.xml", text), run(tmp_path / "i.xml", text, "RADAU5")
        assert apart(one, other).max() < 1000.0 * TOL, law


@pytest.mark.parametrize("ratio", [0.3, 0.9, 1.5])
def test_friction_is_that_of_a_ring_that_slips_and_spins(tmp_path, ratio):
    # the mean over a ring of how fast it slips, by a complete elliptic integral, and its slopes
    k = 4.0 * ratio / (1.0 + ratio) ** 2
    speed = 2.0 / np.pi * (1.0 + ratio) * ellipe(k)
    along = ((ratio + 1.0) * ellipe(k) + (ratio - 1.0) * ellipk(k)) / (np.pi * ratio)
    about = speed - ratio * along
    # so heavy to tilt that it stays upright, and as deep as it rests
    deep = -((9.8 / 6e5) ** (2.0 / 3.0))
    text = deck(
        "cylinder", "COULOMB_ON", vx=40.0 * ratio, wz=400.0, slope=0.0, end=0.02, above=deep
    )
    text = text.replace('"0.0035" inertia_yy="0.003"', '"1e4" inertia_yy="1e4"')
    path = tmp_path / "ring.xml"
    path.write_text(text, encoding="utf-8")
    with mbsim.simulate(mbsim.read_model(path), tol=1e-6) as results:
        x, y, z = (results[f"contacts/1/force/{n}"] for n in "xyz")
        slowed = np.ptp(results["bodies/2/angular_velocity"][:, 2])
    assert z == pytest.approx(9.8, rel=1e-6)
    assert x / z == pytest.approx(-0.25 * along, abs=0.25 * 0.035)
    assert y / z == pytest.approx(0.0, abs=1e-6)
    assert 0.005 * slowed / 0.02 == pytest.approx(0.25 * 0.98 * about, abs=0.25 * 0.98 * 0.035)


@pytest.mark.parametrize("law", ["COULOMB_ON", "STICTION", "LUGRE"])
def test_the_tip_of_a_cone_rubs_as_a_rim_of_next_to_no_radius(law, tmp_path):
    """Where its three points fell on one place to the last digit there was no friction, or NaN.

    Steps shrank with tol, or the run ended: what rubbed and what did not took turns by rounding.
    """
    seen = []
    for top in (0.0, 1e-7):
        model = (
            GROUND
            + GRAVITY
            + f"""<Body_Rigid id="2" cg_id="20" mass="1" inertia_xx="0.002" inertia_yy="0.003"
            inertia_zz="0.001" v_ic_x="0.5" v_ic_x_flag="TRUE" v_ic_z="-1" v_ic_z_flag="TRUE"
            w_ic_y="2" w_ic_y_flag="TRUE"/><Reference_Marker id="20" body_id="2" pos_z="0.11"/>
            <Reference_Marker id="21" body_id="2" pos_z="0.2" theta="2.9"/>
            <Post_Graphic id="200" type="Frustum" center_marker_id="21" bottom_radius="0.07"
            top_radius="{top!r}" length="0.2"/>
            <Force_Contact id="301" i_graphics_id="200" j_graphics_id="100" cnf_type="IMPACT"
            stiffness="1e5" exponent="1.5" cff_type="{law}" {LAWS[law]}/>"""
        )
        run = run_deck(tmp_path, model, 0.06, 0.002, integrator="DOPRI5", tol=1e-7)
        moves = (run[f"bodies/2/{name}"][-1] for name in ("velocity", "angular_velocity"))
        seen.append((run.stats["steps"], *moves))
    (steps, *tip), (most, *rim) = seen
    assert steps < 1.3 * most
    for here, there in zip(tip, rim, strict=True):
        np.testing.assert_allclose(here, there, rtol=0.0, atol=1e-5)
