"""Friction of a patch against spin: discs and boxes of triangles that spin on a plane."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from helpers.decks import EARTH, GRAVITY, run_deck
from helpers.surfaces import mesh_graphic

RADIUS, MU, G = 0.1, 0.3, 9.81
#: With a dent on top, so that it is not convex.
PUCK = trimesh.creation.revolve(
    np.array([[0, -0.01], [RADIUS, -0.01], [RADIUS, 0.01], [0.05, 0.01], [0.0, 0.0]]), sections=96
)
BLOCK = trimesh.creation.box((0.2, 0.2, 0.02))
IMPACT = 'cnf_type="IMPACT" stiffness="1e6" exponent="1.5" damping="1e3" dmax="1e-4"'
COULOMB = (
    'cff_type="COULOMB_ON" mu_static="0.3" mu_dynamic="0.3" stiction_trans_vel="1e-4" '
    'friction_trans_vel="2e-4"'
)
#: Without damping a disc that spins begins to wobble.
FIELD = (
    'contact_depth="FIELD" cnf_type="IMPACT" stiffness="1e8" exponent="1" damping="1e6" dmax="1e-6"'
)
SAG = (G / 1e6) ** (2.0 / 3.0)
INERTIA = 0.005


def spinning(shape, law, friction, spin, v=0.0, sag=SAG):
    flags = f'w_ic_z="{spin}" w_ic_z_flag="TRUE" v_ic_x="{v}" v_ic_x_flag="TRUE"'
    return (
        EARTH
        + '<Post_Graphic id="100" type="Plane" rm_id="10"/>'
        + f'<Body_Rigid id="2" cg_id="20" mass="1" inertia_xx="{INERTIA}" inertia_yy="{INERTIA}" '
        f'inertia_zz="{INERTIA}" {flags}/>'
        f'<Reference_Marker id="20" body_id="2" pos_z="{0.01 - sag}"/>'
        + mesh_graphic(200, 20, shape.vertices, shape.faces)
        + f'<Force_Contact id="301" i_graphics_id="200" j_graphics_id="100" {law} {friction}/>'
        + GRAVITY
    )


def slowing(run, time):
    """Return the mean torque against spin."""
    spin = run["bodies/2/angular_velocity"][:, 2]
    return (spin[0] - spin[-1]) / time * INERTIA


@pytest.mark.parametrize(
    ("law", "sag"),
    [(IMPACT, SAG), (FIELD, G / (1e8 * np.pi * RADIUS**2))],
    ids=["LARGEST", "FIELD"],
)
@pytest.mark.parametrize("method", ["DOPRI5", "RADAU5"])
def test_a_disc_slows_down_by_two_thirds_of_mu_f_r(law, sag, method, tmp_path):
    deck = spinning(PUCK, law, COULOMB, 20.0, sag=sag)
    run = run_deck(tmp_path, deck, 0.2, integrator=method)
    slows = slowing(run, 0.2)
    assert slows == pytest.approx(2.0 / 3.0 * MU * G * RADIUS, rel=0.012)
    assert np.abs(run["bodies/2/position"][-1, :2]).max() < 1e-6
    # friction took what the disc lost
    assert run.audit.balance < 1e-4 * run.audit.of
    assert run.audit.warnings == ()


def test_a_square_slows_down_by_its_mean_distance(tmp_path):
    # of a square of half edge a: a (sqrt(2) + asinh(1)) / 3
    run = run_deck(tmp_path, spinning(square(), IMPACT, COULOMB, 20.0), 0.2)
    slows = slowing(run, 0.2)
    mean = 0.1 * (np.sqrt(2.0) + np.arcsinh(1.0)) / 3.0
    assert slows == pytest.approx(MU * G * mean, rel=0.02)


def square():
    """Return a block 0.2 m square whose upper side has a dent in its middle."""
    shape = BLOCK.subdivide()
    top = (np.abs(shape.vertices[:, :2]).max(axis=1) < 1e-9) & (shape.vertices[:, 2] > 0.0)
    assert top.sum() == 1
    shape.vertices[top, 2] = 0.0
    return shape


@pytest.mark.parametrize("v", [0.2, 0.5, 0.8, 1.0, 2.0])
def test_spin_lets_a_disc_slide_on(v, tmp_path):
    """Sliding and spinning at once: against the integral of friction over the disc."""
    w = 10.0
    run = run_deck(tmp_path, spinning(PUCK, IMPACT, COULOMB, w, v), 0.01, 0.001)
    r = RADIUS * np.sqrt((np.arange(200) + 0.5) / 200)
    t = 2.0 * np.pi * (np.arange(400) + 0.5) / 400
    x, y = (r[:, None] * np.cos(t)).ravel(), (r[:, None] * np.sin(t)).ravel()
    slip = np.array([v - w * y, w * x])
    along = slip / np.linalg.norm(slip, axis=0)
    force, torque = MU * along[0].mean(), MU * (x * along[1] - y * along[0]).mean()
    found, about = run["contacts/301/force"][1], run["contacts/301/torque"][1, 2]
    # 7 % of mu N and of 2/3 mu N R
    assert -found[0] / found[2] == pytest.approx(force, abs=0.07 * MU)
    assert -about / found[2] == pytest.approx(torque, abs=0.07 * MU * 2.0 / 3.0 * RADIUS)


def test_what_keeps_something_or_knows_its_area_is_asked_once(tmp_path):
    laws = {
        "LUGRE": 'mu_static="0.3" mu_dynamic="0.3" stribeck_vel="0.01" bristle_stiffness="1e4"',
        "CONTENSOU": 'mu_dynamic="0.3" friction_trans_vel="2e-4" contact_points="REGION"',
    }
    slows = {}
    for name, more in laws.items():
        deck = spinning(PUCK, IMPACT, f'cff_type="{name}" {more}', 20.0)
        run = run_deck(tmp_path, deck, 0.1)
        slows[name] = slowing(run, 0.1)
    assert slows["LUGRE"] == pytest.approx(0.0, abs=1e-9)
    assert slows["CONTENSOU"] == pytest.approx(2.0 / 3.0 * MU * G * RADIUS, rel=1e-2)


def test_a_disc_comes_to_rest_under_steps_of_fixed_length(tmp_path):
    deck = spinning(PUCK, IMPACT, COULOMB, 1.0)
    run = run_deck(tmp_path, deck, 0.2, integrator="VERLET")
    assert abs(run["bodies/2/angular_velocity"][-1, 2]) < 1e-3
