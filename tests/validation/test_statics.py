"""Simulate analysis_type="Static" against closed forms, transients and another minimiser."""

from __future__ import annotations

from pathlib import Path

import pytest

import mbsim
from tests.decks_io import GROUND, sphere

G = 9.81
STATIC = '<Simulate analysis_type="Static"/>'
GRAVITY = f'<Force_Gravity grav_z="{-G}"/>'
EARTH = '<Body_Rigid id="1" isground="TRUE"/><Reference_Marker id="10" body_id="1"/>'


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
<Post_Graphic id="{100 * body}" type="Box" cm_id="{10 * body}" x="{edge}" y="{edge}" z="{edge}"/>
"""


def contact(id, i, j, stiffness=1e6, exponent=1.5, damping=2e4, dmax=1e-4, more=""):
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
    assert results.time.tolist() == [0.0]
    z = results.bodies[2].position[-1]
    assert z == pytest.approx([0.0, 0.0, -(0.5 + 3.0 * G / 500.0)], abs=1e-13)
    assert not results.bodies[2].velocity.any()


@pytest.mark.parametrize("exponent", [1.0, 1.5, 2.2])
def test_sphere_dropped_on_a_plane_rests_at_the_depth_of_its_law(tmp_path, exponent):
    """k d^e = m g; it starts in the air, from where it would take a transient."""
    model = GROUND + sphere(1.0, mass=2.0) + GRAVITY
    results = run(tmp_path, model + contact(1, 200, 100, exponent=exponent))
    depth = (2.0 * G / 1e6) ** (1.0 / exponent)
    assert 0.1 - results.bodies[2].position[-1, 2] == pytest.approx(depth, rel=1e-9)
    assert results.bodies[2].position[-1, :2] == pytest.approx([0.0, 0.0], abs=1e-15)
