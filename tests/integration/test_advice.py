"""What `mbsim check` says of contacts, against closed forms and runs."""

from __future__ import annotations

import math
import re

import pytest

import mbsim
from helpers.folders import PACKAGES
from mbsim.compile_model.advice import advice
from mbsim.laws.catalog import NORMAL_LAWS
from mbsim.laws.impact_test import impact_of, resting_depth

MODELS = PACKAGES / "models"


def said(model, about):
    """Return the numbers of the line about something that advice says."""
    read = model if hasattr(model, "bodies") else mbsim.read_model(model)
    lines = [text for _, text in advice(read) if about in text]
    assert len(lines) == 1, lines
    return [float(each) for each in re.findall(r"\d[\d.]*(?:e[+-]?\d+)?", lines[0])]


def test_creep_is_that_of_the_closed_form_and_of_the_run():
    speed, degrees = said(MODELS / "incline_creep.xml", "creeps")
    assert speed == pytest.approx(5.3688e-4, rel=1e-3)
    assert degrees == pytest.approx(20.0)
    results = mbsim.simulate(MODELS / "incline_creep.xml", end_time=1.0, print_interval=0.5)
    assert results["bodies/2/velocity/mag"][-1] == pytest.approx(speed, rel=1e-3)


def test_depth_at_rest_is_that_of_the_weight_and_of_the_run():
    load, one, four, points = said(MODELS / "incline_creep.xml", "at rest under")
    weight = 9.81 * math.cos(math.radians(20.0))
    assert (load, points) == (pytest.approx(weight, rel=1e-3), 4)
    assert one == pytest.approx(weight / 1e5, rel=1e-2)
    results = mbsim.simulate(MODELS / "incline_creep.xml", end_time=1.0, print_interval=0.5)
    assert 0.05 - results["bodies/2/position/z"][-1] == pytest.approx(four, rel=1e-2)


def test_an_impact_is_that_of_hertz():
    speed, _, depth, time, rebound = said(MODELS / "hertz_sphere.xml", "it is met at")[:5]
    assert speed == pytest.approx(0.2)
    assert depth == pytest.approx(4.9717175e-5, rel=1e-2)
    assert time == pytest.approx(7.3165664e-4, rel=1e-2)
    assert rebound == pytest.approx(1.0, abs=1e-3)


def test_a_linear_spring_touches_for_half_a_period():
    law = NORMAL_LAWS["IMPACT"]
    hit = impact_of(law, (1e4, 1.0, 0.0, 1.0), 0.5, 2.0)
    assert hit.time == pytest.approx(math.pi * math.sqrt(2.0 / 1e4), rel=1e-3)
    assert hit.depth == pytest.approx(0.5 * math.sqrt(2.0 / 1e4), rel=1e-5)
    assert hit.rebound == pytest.approx(1.0, rel=1e-9)
    assert resting_depth(law, (1e4, 1.5, 0.0, 1.0), 10.0, 1.0) == pytest.approx(1e-2, rel=1e-9)
    assert resting_depth(law, (1e4, 1.5, 0.0, 1.0), 1e9, 1.0) == math.inf


def test_speed_and_rebound_of_a_dropped_ball_are_those_of_the_run():
    speed, _, _, _, rebound = said(MODELS / "bouncing_sphere.xml", "it is met at")[:5]
    assert speed == pytest.approx(math.sqrt(2.0 * 9.81 * 0.5), rel=1e-3)
    results = mbsim.simulate(MODELS / "bouncing_sphere.xml", end_time=0.6, print_interval=1e-3)
    v = results["bodies/2/velocity/z"]
    first = next(k for k in range(1, len(v)) if v[k] > 0.0 and v[k] <= v[k - 1])
    leaves = v[first - 1] + 9.81 * 1e-3  # it leaves within a row of its fastest
    assert rebound == pytest.approx(leaves / speed, rel=5e-3)


def tower(count, **changes):
    model = mbsim.Model()
    shapes = [
        model.graphic(
            "BoxDefinedFromCenter",
            marker=model.body(mass=2, inertia=(1, 1, 1), pos=(0, 0, 0.05 + 0.1 * k)),
            length=(0.1, 0.1, 0.1),
        )
        for k in range(count)
    ]
    apart = model.graphic(
        "Sphere", marker=model.body(mass=50, inertia=(1, 1, 1), pos=(9, 0, 9)), radius=0.1
    )
    law = {"stiffness": 1e5, "exponent": 1, "damping": 10, "dmax": 1e-3} | changes
    model.contact([*shapes, apart], [*shapes, apart], "IMPACT", **law)
    model.contact(shapes, model.graphic("Plane", marker=model.ground), "IMPACT", **law)
    model.gravity(grav=(0, 0, -10))
    model.simulate(end_time=10, num_steps=10)
    return mbsim.read_model(model)


def test_the_lowest_contact_carries_all_that_stands_above():
    loads = {
        name: float(re.findall(r"under ([\d.]+)", text)[0])
        for name, text in advice(tower(5))
        if "at rest under" in text
    }
    assert loads == {"Force_Contact[1]": 4 * 20.0, "Force_Contact[2]": 5 * 20.0}


def test_it_says_which_setting_to_change():
    def texts(**changes):
        return " ".join(text for _, text in advice(tower(2, **changes)))

    assert "raise its stiffness" in texts(stiffness=1e3)
    assert "lower dmax" in texts(dmax=0.1)
    assert "costly by explicit methods" in texts(stiffness=1e12)
    quiet = texts(stiffness=1e6, dmax=1e-5)
    assert not any(word in quiet for word in ("raise", "lower", "costly"))


def test_steps_of_an_explicit_method_are_as_long_as_it_says():
    model = mbsim.Model()
    ball = model.graphic(
        "Sphere", marker=model.body(mass=1, inertia=(1, 1, 1), pos=(0, 0, 0.1)), radius=0.1
    )
    plane = model.graphic("Plane", marker=model.ground)
    model.contact(ball, plane, "IMPACT", stiffness=1e9, exponent=1, damping=3e5, dmax=1e-9)
    model.gravity(grav=(0, 0, -9.81))
    model.simulate(end_time=100, num_steps=10)
    step, steps = said(mbsim.read_model(model), "costly")[:2]
    assert steps == pytest.approx(100 / step, rel=0.05)
    # both roots of s^2 + 3e5 s + 1e9
    fastest = 0.5 * (3e5 + math.sqrt(9e10 - 4e9))
    assert step == pytest.approx(3.3 / fastest, rel=0.05)
    results = mbsim.simulate(model, end_time=0.05, print_interval=0.01, integrator="DOPRI5")
    taken = results.stats["steps"]
    assert 0.5 < taken * step / 0.05 < 2.0


def test_joints_are_not_guessed_about():
    assert not [text for _, text in advice(mbsim.read_model(MODELS / "gear_pair.xml"))]


@pytest.mark.parametrize(
    ("units", "written"),
    [
        ("", {"9.81 N of", "m deep", "m/s by a mass of 1 kg", "s long"}),
        (
            'force_unit="POUND_FORCE" mass_unit="SLUG" length_unit="FOOT"',
            {"lbf of", "ft/s", "slug"},
        ),
        ('mass_unit="TONNE" length_unit="MILLIMETER"', {"N of", "mm deep", "mm/s by", "1 t:"}),
    ],
)
def test_every_number_has_its_unit(units, written):
    model = mbsim.read_model(
        f"""<MotionSolve><Model><Param_Unit {units}/>
        <Body_Rigid id="1" isground="TRUE"/>
        <Body_Rigid id="2" mass="1" cg_id="20" inertia_xx="1" inertia_yy="1" inertia_zz="1"/>
        <Reference_Marker id="10" body_id="1"/><Reference_Marker id="20" body_id="2" pos_z="0.6"/>
        <Post_Graphic id="100" type="Plane" rm_id="10"/>
        <Post_Graphic id="200" type="Sphere" center_marker_id="20" radius="0.1"/>
        <Force_Contact id="1" i_graphics_id="200" j_graphics_id="100" cnf_type="IMPACT"
        stiffness="1e6" exponent="1.5" damping="10" dmax="1e-3"/>
        <Force_Gravity grav_z="-9.81"/></Model></MotionSolve>"""
    )
    text = " ".join(line for _, line in advice(model))
    assert {part for part in written if part not in text} == set()
