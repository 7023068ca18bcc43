"""contact_points="REGION": one incident a pair, with an area that friction and users see."""

from __future__ import annotations

import numpy as np
import pytest

import mbsim
from helpers.decks import GRAVITY, GROUND, run_deck, write_deck
from helpers.libraries import compiled
from mbsim.errors import DeckError, Interrupted, ModelError
from mbsim.run.replay import request

BOX = (
    '<Post_Graphic id="200" type="BoxDefinedFromCenter" center_marker_id="20" '
    'length_x="0.1" length_y="0.1" length_z="0.2"/>'
)
COULOMB = (
    'cff_type="COULOMB_ON" mu_static="{0}" mu_dynamic="{0}" stiction_trans_vel="1e-4" '
    'friction_trans_vel="1e-4"'
)
TILTED = 'phi="0.3" theta="0.2"'


def block(z=0.0999, marker="", start="", graphic=BOX):
    """Return a block of 1 kg, 0.1 x 0.1 x 0.2 m, pressed 0.1 mm into the ground."""
    return f"""
<Body_Rigid id="2" cg_id="20" mass="1" inertia_xx="4.17e-3" inertia_yy="4.17e-3"
 inertia_zz="1.67e-3" {start}/>
<Reference_Marker id="20" body_id="2" pos_z="{z}" {marker}/>
<Reference_Marker id="21" body_id="2" pos_z="-0.1"/>
{graphic}"""


def contact(points="REGION", friction="", damping=100, sides=("200", "100"), normal=""):
    """Return a contact of graphics I and J."""
    law = normal or f'cnf_type="IMPACT" stiffness="1e6" exponent="1.5" damping="{damping}"'
    return f"""
<Force_Contact id="301" contact_points="{points}" i_graphics_id="{sides[0]}"
 j_graphics_id="{sides[1]}" {law} dmax="1e-5" {friction}/>"""


@pytest.mark.parametrize(("mu", "slides"), [(0.3, True), (0.45, False)])
def test_a_block_on_20_degrees_slides_or_sticks_as_on_its_corners(mu, slides, tmp_path):
    slope = '<Force_Gravity grav_x="3.3552" grav_z="-9.2184"/>'
    ends = {}
    for points in ("POINTS", "REGION"):
        model = GROUND + block() + contact(points, COULOMB.format(mu)) + slope
        results = run_deck(tmp_path, model, 0.5)
        ends[points] = results["bodies/2/position"][-1, 0]
        speed = results["bodies/2/velocity"][:, 0]
        # 0.1 x 0.1 and a corner's place each
        area = results["contacts/301/area"][-1]
        assert area == (pytest.approx(0.01, rel=1e-4) if points == "REGION" else 0.0)
        assert results["contacts/301/incidents"][-1] == (1 if points == "REGION" else 4)
        if slides:
            # once it has settled
            gained = 0.2 * (3.3552 - mu * 9.2184)
            assert speed[-1] - speed[30] == pytest.approx(gained, rel=1e-4)
    if slides:
        assert ends["REGION"] == pytest.approx(ends["POINTS"], rel=1e-2)
    else:
        # it leans into the slope, then creeps
        assert 0.0 < ends["REGION"] < 2e-3


def test_flat_it_rests_as_deep_as_on_its_corners(tmp_path):
    ends = [
        run_deck(tmp_path, GROUND + block() + contact(points) + GRAVITY, 0.5)
        for points in ("POINTS", "REGION")
    ]
    one, other = (end["bodies/2/position"][-1, 2] for end in ends)
    assert one == pytest.approx(other, abs=1e-8)
    assert 0.1 - other == pytest.approx((9.81 / 4e6) ** (2 / 3), rel=1e-4)
    # swapped: the force on I, which is the ground
    model = GROUND + block() + contact(sides=("100", "200")) + GRAVITY
    swapped = run_deck(tmp_path, model, 0.5)
    assert swapped["contacts/301/force"][-1, 2] == pytest.approx(-9.81, rel=1e-4)
    assert swapped["contacts/301/area"][-1] == pytest.approx(0.01, rel=1e-9)


@pytest.mark.parametrize("damping", [0, 100])
def test_energy_closes_to_the_tolerance_while_a_box_tumbles(damping, tmp_path):
    model = GROUND + block(0.12, TILTED) + contact(damping=damping) + GRAVITY
    errors = []
    for tol in (1e-5, 1e-8):
        results = run_deck(tmp_path, model, 0.6, tol=tol)
        total = sum(results[f"energy/{kind}"] for kind in ("kinetic", "potential", "dissipated"))
        errors.append(np.abs(total - total[0]).max())
        assert np.all(np.diff(results["energy/dissipated"]) > -1e-7)
    print(damping, errors, results["energy/kinetic"].max())
    assert errors[0] < 1e-3
    assert errors[1] < 1e-6


def test_a_tilted_body_that_lands_comes_to_rest(tmp_path):
    # without the couple of its points a body rocks on for ever: tilting moves the place little
    friction = COULOMB.format(0.3)
    model = GROUND + block(0.12, TILTED) + contact(friction=friction) + GRAVITY
    results = run_deck(tmp_path, model, 1.0)
    # what spins on a region goes on: the law has no torque about the normal
    assert np.abs(results["bodies/2/angular_velocity"][-1, :2]).max() < 1e-3
    assert results["contacts/301/area"][-1] == pytest.approx(0.01, rel=1e-3)


@pytest.mark.parametrize("method", ["RADAU5", "GALPHA"])
def test_implicit_methods_agree(method, tmp_path):
    model = GROUND + block(0.12, TILTED) + contact(friction=COULOMB.format(0.3)) + GRAVITY
    one = run_deck(tmp_path, model, 0.15, integrator="DOP853", tol=1e-9)
    other = run_deck(tmp_path, model, 0.15, integrator=method, tol=1e-7)
    there = [results["bodies/2/position"][-1] for results in (one, other)]
    np.testing.assert_allclose(*there, atol=1e-5)


def test_the_same_force_again_and_its_area(tmp_path):
    friction = 'cff_type="CONTENSOU" mu_dynamic="0.3" friction_trans_vel="1e-3"'
    start = 'v_ic_x="0.3" v_ic_x_flag="TRUE" w_ic_z="9" w_ic_z_flag="TRUE"'
    model = GROUND + block(0.105, 'phi="0.1" theta="0.1"', start) + contact(friction=friction)
    path = write_deck(tmp_path, model + GRAVITY, 0.3, 0.001)
    mbsim.simulate(mbsim.read_model(path), output=tmp_path)
    with mbsim.open_results(tmp_path / "deck.h5") as results:
        one = "Force_Contact[301].incident[0]."
        names = [
            "Force_Contact[301].force/x", "Force_Contact[301].torque/y", "Force_Contact[301].area",
            f"{one}area", f"{one}force/z",
        ]  # fmt: skip
        _, columns = request(results, names)
        found = dict(columns) if not isinstance(columns, dict) else columns
        force, area = results["contacts/301/force"], results["contacts/301/area"]
        np.testing.assert_array_equal(np.array(found[names[0]], float), force[:, 0])
        torque = results["contacts/301/torque"][:, 1]
        np.testing.assert_array_equal(np.array(found[names[1]], float), torque)
        np.testing.assert_array_equal(np.array(found[names[2]], float), area)
        touches = results["contacts/301/incidents"] == 1
        np.testing.assert_array_equal(np.array(found[names[3]], float)[touches], area[touches])
        assert 0 < touches.sum() < len(touches)


LAW = """
def CFFSUB(id, time, par, npar, loci, locj, x, xdot, nforce, dflag, iflag):
    area = py_get_contact_area()
    return [-40.0 * area * xdot[0], -40.0 * area * xdot[1], -0.1 * area * xdot[2]]
"""
FORTRAN = """subroutine law(id, time, par, npar, loci, locj, x, xdot, nforce, area, dflag, iflag, r)
    implicit none
    integer :: id, npar
    double precision :: time, par(*), loci(3), locj(3), x(3), xdot(3), nforce, area, r(3)
    logical :: dflag, iflag
    r(1) = -40d0 * area * xdot(1)
    r(2) = -40d0 * area * xdot(2)
    r(3) = -0.1d0 * area * xdot(3)
end subroutine
"""


def test_users_functions_are_given_the_area(tmp_path):
    # a film of oil: F = -40 A v slows 1 kg at the rate of 0.4 1/s
    start = 'v_ic_x="0.5" v_ic_x_flag="TRUE"'
    (tmp_path / "law.py").write_text(LAW, encoding="utf-8")

    def run(how, **settings):
        model = GROUND + block(start=start) + contact(friction=how) + GRAVITY
        return run_deck(tmp_path, model, 0.5, tol=1e-9, **settings)["bodies/2/velocity"][:, 0]

    user = 'cff_type="USERCFF" cff_param_string="USER(0)" cff_fnc_name="{}"'
    scripted = user.format("CFFSUB") + ' script_name="law.py"'
    results = [run(scripted), run(scripted, interpret_plugins=True)]
    library = compiled(tmp_path, FORTRAN, "f90", "law")
    results.append(run(user.format("law") + f' cff_dll_name="{library}"'))
    for speed in results:
        assert speed[-1] == pytest.approx(0.5 * np.exp(-40 * 0.01 * 0.5), rel=1e-3)
        np.testing.assert_allclose(speed, results[0], atol=1e-10)


def test_a_users_normal_force_is_given_the_area(tmp_path):
    # a bed of 1e8 N/m^3 under the block: 1 kg rests at 9.81/(4 1e8 0.01) of it
    text = """
def CNFSUB(id, time, par, npar, loci, ni, locj, nj, gap, gapdot, gapdotdot, dflag, iflag):
    return py_get_contact_area() * (-1e8 * gap - 1e5 * gapdot)
"""
    (tmp_path / "bed.py").write_text(text, encoding="utf-8")
    law = 'cnf_type="USERCNF" cnf_param_string="USER(0)" cnf_fnc_name="CNFSUB" script_name="bed.py"'
    model = GROUND + block(0.1) + contact(normal=law).replace('dmax="1e-5"', "") + GRAVITY
    rests = []
    for interpret in (False, True):
        results = run_deck(tmp_path, model, 0.3, interpret_plugins=interpret)
        rests.append(results["bodies/2/position"][-1, 2])
    assert 0.1 - rests[0] == pytest.approx(9.81 / 4e6, rel=1e-3)
    assert rests[1] == pytest.approx(rests[0], abs=1e-9)


CYLINDER = (
    '<Post_Graphic id="200" type="Cylinder" center_marker_id="21" radius="0.05" length="0.2"/>'
)
BALL = '<Post_Graphic id="200" type="Sphere" center_marker_id="20" radius="0.1"/>'
CONTENSOU = 'cff_type="CONTENSOU" mu_dynamic="0.3" friction_trans_vel="1e-3"'


@pytest.mark.parametrize(
    ("graphic", "points", "friction", "said"),
    [
        (BALL, "REGION", CONTENSOU, "(SPHERE on PLANE) touches in a point, so cff_type=CONTENSOU"),
        (BOX, "POINTS", CONTENSOU, 'patch_radius: cff_type="CONTENSOU" needs patch_radius, or'),
        (BOX, "PATCH", "", 'contact_points="PATCH": must be one of POINTS, REGION'),
    ],
)
def test_what_has_no_area_is_said(graphic, points, friction, said, tmp_path):
    model = GROUND + block(graphic=graphic) + contact(points, friction) + GRAVITY
    with pytest.raises(DeckError) as refused:
        run_deck(tmp_path, model, 0.1)
    assert said in str(refused.value)


def test_pairs_without_a_closed_form_of_their_area_are_named(tmp_path):
    other = CYLINDER.replace("200", "100").replace('"21"', '"10"')
    ground = GROUND[: GROUND.index("<Post_Graphic")] + other
    model = ground + block(graphic=CYLINDER) + contact() + GRAVITY
    with pytest.raises(ModelError, match=r"CYLINDER on CYLINDER\) has no closed form of its area"):
        run_deck(tmp_path, model, 0.1)
    with pytest.raises(ModelError, match=r"BOX on PLANE\) is found by FCL, which gives no area"):
        run_deck(tmp_path, GROUND + block() + contact() + GRAVITY, 0.1, detector="fcl")


def test_a_ball_is_one_point_without_area(tmp_path):
    ends = [
        run_deck(tmp_path, GROUND + block(0.11, graphic=BALL) + contact(points) + GRAVITY, 0.3)
        for points in ("POINTS", "REGION")
    ]
    one, other = (end["bodies/2/position"] for end in ends)
    np.testing.assert_array_equal(one, other)
    assert not ends[1]["contacts/301/area"].any()


def test_resumed_it_is_the_same_run(tmp_path):
    friction = CONTENSOU
    start = 'v_ic_x="0.3" v_ic_x_flag="TRUE" w_ic_z="9" w_ic_z_flag="TRUE"'
    model = GROUND + block(0.12, TILTED, start) + contact(friction=friction) + GRAVITY
    path = write_deck(tmp_path, model, 0.5)
    straight = mbsim.simulate(mbsim.read_model(path))

    def stop(time, step, until):
        if time > 0.2:
            raise Interrupted("enough")

    with pytest.raises(Interrupted):
        mbsim.simulate(mbsim.read_model(path), output=tmp_path, progress=stop)
    found = mbsim.simulate(mbsim.read_model(path), output=tmp_path, resume=True)
    for name in ("bodies/2/position", "contacts/301/area", "contacts/301/force"):
        np.testing.assert_array_equal(found[name], straight[name])


def test_many_boxes_are_found_as_they_come_near(tmp_path):
    # a set: more pairs than are listed one by one
    boxes, many = [], 310
    for k in range(many):
        x, y = 0.2 * (k % 20), 0.2 * (k // 20)
        start = 'v_ic_x="1" v_ic_x_flag="TRUE"'
        text = block(0.1 - 1.8e-4, f'pos_x="{x}" pos_y="{y}"', start)
        for old, new in (
            ('"2"', 3 + k),
            ('"20"', 1000 + k),
            ('"21"', 2000 + k),
            ('"200"', 5000 + k),
        ):
            text = text.replace(old, f'"{new}"')
        boxes.append(text)
    ids = " ".join(str(5000 + k) for k in range(many))
    model = GROUND + "".join(boxes) + contact(sides=(ids, "100")) + GRAVITY
    # they leave the places where they were listed, and the list is made anew
    path = write_deck(tmp_path, model, 0.1, 0.01)
    mbsim.simulate(mbsim.read_model(path), output=tmp_path)
    results = mbsim.open_results(tmp_path / "deck.h5")
    assert results.stats["pair_listings"] > 2
    assert results["contacts/301/incidents"][-1] == many
    assert results["contacts/301/area"][-1] == pytest.approx(many * 0.01, rel=1e-6)
    assert results["contacts/301/force"][-1, 2] == pytest.approx(many * 9.81, rel=1e-2)
    names = ["Force_Contact[301].area", "Force_Contact[301].force/z"]
    _, columns = request(results, names)
    np.testing.assert_array_equal(columns[names[0]], results["contacts/301/area"])
    np.testing.assert_array_equal(columns[names[1]], results["contacts/301/force"][:, 2])
    results.close()
