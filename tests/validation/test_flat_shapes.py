"""Boxes and convex meshes on edges and on each other: what a run makes of their points."""

from __future__ import annotations

import numpy as np
import pytest

from helpers.decks import COULOMB, FLOATING, GRAVITY, GROUND, INERTIA, contact, cube, run_deck


def table(x):
    """Return a slab with its top at z = 0 that ends at this x."""
    return f"""{FLOATING}
    <Reference_Marker id="11" body_id="1" pos_x="{x - 0.5}" pos_z="-0.1"/>
    <Post_Graphic id="100" type="BoxDefinedFromCenter" center_marker_id="11"
      length_x="1" length_y="1" length_z="0.2"/>"""


TETRAHEDRON = """<Body_Rigid id="2" cg_id="20" mass="1" inertia_xx="0.003" inertia_yy="0.003"
  inertia_zz="0.003"/>
<Reference_Marker id="20" body_id="2" pos_z="0.25" psi="0.3" theta="0.5" phi="0.2"/>
<Post_Graphic id="200" type="TriaMesh" rm_id="20">
  <Nodes>.1 .1 .1 .1 -.1 -.1 -.1 .1 -.1 -.1 -.1 .1</Nodes>
  <Faces>0 1 2 0 3 1 0 2 3 1 3 2</Faces></Post_Graphic>"""


def test_a_stack_of_three_boxes_stands(tmp_path):
    law = {"stiffness": 1e6, "exponent": 1.5, "damping": 500, "dmax": 1e-4, **COULOMB}
    model = GROUND + GRAVITY
    for k in range(3):
        # each turned, so that corners of one lie on faces of the next and edges cross
        model += cube(k + 2, (0.01 * k, 0.0, 0.1 + 0.2 * k), (0.2 * k, 0.0, 0.0))
        model += contact(100 * (k + 2), 100 * (k + 1), id=k + 1, **law)
    results = run_deck(tmp_path, model, end_time=1.0)
    assert results.stats["fcl_calls"] == 0
    assert np.abs(results["bodies/4/angular_velocity"][-1]).max() < 1e-4
    for k in range(3):
        force = results[f"contacts/{k + 1}/force/z"][-1]
        assert force == pytest.approx((3 - k) * 9.81, rel=1e-4)
        assert results[f"bodies/{k + 2}/position/x"][-1] == pytest.approx(0.01 * k, abs=1e-3)


def test_a_box_slides_off_a_table(tmp_path):
    # without friction at speed v the centre is over the edge at t = 0; from then on, at first,
    # I theta'' = m g v t, theta = g v t^3 / (6 I/m)
    v, before, after = 0.3, 0.2, 0.06
    law = {"stiffness": 1e7, "exponent": 1.5, "damping": 1000, "dmax": 1e-5}
    depth = (9.81 / 4 / 1e7) ** (2 / 3)
    model = table(0.0) + GRAVITY + contact(**law)
    model += cube(2, (-v * before, 0.0, 0.1 - depth), v=(v, 0.0, 0.0))
    results = run_deck(tmp_path, model, end_time=before + after, print_interval=0.01)
    tilt = 2.0 * results["bodies/2/quaternion"][:, 2]
    time = results["time"]
    assert results.stats["fcl_calls"] == 0
    assert np.abs(tilt[time < before]).max() < 1e-3
    assert tilt[-1] == pytest.approx(9.81 * v * after**3 / (6 * INERTIA), rel=0.05)


def test_a_box_lies_across_the_edge_of_another(tmp_path):
    # a cube balanced on the upper edge of a fixed one that stands on its edge
    law = {"stiffness": 1e6, "exponent": 1.5, "damping": 500, "dmax": 1e-4}
    ridge = f"""{FLOATING}
    <Reference_Marker id="11" body_id="1" theta="{np.pi / 4}"/>
    <Post_Graphic id="100" type="BoxDefinedFromCenter" center_marker_id="11"
      length_x="0.6" length_y="0.2" length_z="0.2"/>"""
    # two crossings carry, each with a share of 1 where edges cross at right angles
    depth = (9.81 / 2 / 1e6) ** (2 / 3)
    model = ridge + GRAVITY + contact(**law)
    model += cube(2, (0.0, 0.0, 0.1 * np.sqrt(2) + 0.1 - depth))
    results = run_deck(tmp_path, model, end_time=0.1)
    assert results["contacts/301/incidents"][-1] == 2
    assert results["contacts/301/force/z"][-1] == pytest.approx(9.81, rel=1e-6)
    assert np.abs(results["bodies/2/velocity"]).max() < 1e-5


@pytest.mark.parametrize(
    ("angles", "other", "allowed"),
    [
        # edge on edge, crossed at right angles
        ((np.pi / 2, np.pi / 4, 0.0), (0.0, np.pi / 4, 0.0), 1e-6),
        # a face on an edge
        ((0.3, 0.0, 0.0), (0.0, np.pi / 4, 0.0), 3e-4),
        # face on face, tilted: corners and crossings
        ((0.3, 0.01, 0.0), (0.0, 0.0, 0.0), 1e-3),
        # corner on face
        ((0.4, 0.9, 0.6), (0.0, 0.0, 0.0), 1e-6),
    ],
)
def test_an_elastic_bounce_keeps_energy(tmp_path, angles, other, allowed):
    law = {"stiffness": 1e6, "exponent": 1.5, "damping": 0, "dmax": 1e-3}
    model = FLOATING + contact(300, 200, **law)
    model += cube(2, (0.0, 0.0, 0.0), other)
    model += cube(3, (0.03, 0.02, 0.36), angles, v=(0.0, 0.0, -3.0))
    results = run_deck(tmp_path, model, end_time=0.1, tol=1e-8)
    assert results["contacts/301/peak_force"] > 100.0
    energy = results["energy/kinetic"]
    assert abs(energy[-1] / energy[0] - 1.0) < allowed


@pytest.mark.parametrize("floor", ["plane", "table"])
def test_a_tetrahedron_comes_to_rest_on_a_face(tmp_path, floor):
    law = {"stiffness": 1e5, "damping": 200, "dmax": 1e-4, **COULOMB}
    ground = GROUND if floor == "plane" else table(0.5)
    results = run_deck(tmp_path, ground + TETRAHEDRON + contact(**law) + GRAVITY, end_time=2.5)
    assert results.stats["fcl_calls"] == 0
    assert results.stats["steps"] < 5000
    assert results["contacts/301/incidents"][-1] == 3
    assert np.abs(results["bodies/2/angular_velocity"][-1]).max() < 1e-4
    # three corners of share 4/3; the centre of a regular tetrahedron is at a quarter of its height
    depth = (9.81 / 4 / 1e5) ** (2 / 3)
    assert results["bodies/2/position/z"][-1] == pytest.approx(0.1 / np.sqrt(3) - depth, abs=1e-6)
