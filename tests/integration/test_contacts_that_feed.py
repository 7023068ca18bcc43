"""A contact whose force has no potential and keeps a body rocking is told; others are not."""

from __future__ import annotations

import math

import numpy as np
import pytest
import trimesh

from helpers import decks
from helpers.decks import run_deck
from helpers.surfaces import mesh_graphic
from mbsim.results import audit

GAVE = "Force_Contact[301] gave"


def ring_on_plane(beside, depth, damping=100.0):
    """Return a ring, lying, whose mass centre is `beside` [m] its middle."""
    mesh = trimesh.creation.annulus(0.05, 0.1, 0.1, sections=24)
    return decks.GROUND + (
        '<Body_Rigid id="2" cg_id="20" mass="2" inertia_xx="0.02" inertia_yy="0.03" '
        f'inertia_zz="0.04"/><Reference_Marker id="20" body_id="2" pos_x="{beside!r}" '
        'pos_z="0.0499"/><Reference_Marker id="21" body_id="2" pos_z="0.0499"/>'
        + mesh_graphic(200, 21, mesh.vertices, mesh.faces)
        + '<Force_Contact id="301" i_graphics_id="200" j_graphics_id="100" cnf_type="IMPACT" '
        f'stiffness="1e5" exponent="1" damping="{damping!r}" dmax="1e-4" {depth}/>'
    )


def dome_on_plane():
    """Return a dome on a facet of 40 mm in its middle; the next facets rise by 8 degrees.

    Its mass centre is 10 mm beside the middle. Such a facet is none of the sides that lie.
    """
    rise = 0.08 * math.tan(math.radians(8.0))
    profile = [(0, 0), (0.02, 0), (0.1, rise), (0.1, 0.06), (0.05, 0.06), (0, 0.04)]
    mesh = trimesh.creation.revolve(np.array(profile), sections=24)
    return (
        decks.GROUND
        + '<Body_Rigid id="2" cg_id="20" mass="2" inertia_xx="0.004" inertia_yy="0.004" '
        'inertia_zz="0.004"/><Reference_Marker id="20" body_id="2" pos_x="0.01" pos_z="0.0099"/>'
        '<Reference_Marker id="21" body_id="2" pos_z="-0.0001"/>'
        + mesh_graphic(200, 21, mesh.vertices, mesh.faces)
        + '<Force_Contact id="301" i_graphics_id="200" j_graphics_id="100" cnf_type="IMPACT" '
        'stiffness="1e5" exponent="1" damping="100" dmax="1e-4"/>'
    )


@pytest.mark.parametrize("method", ["DOPRI5", "RADAU5", "GALPHA"])
@pytest.mark.parametrize("tol", [1e-4, 1e-5])
def test_what_rocks_on_a_force_without_a_potential_is_told(method, tol, tmp_path):
    deck = dome_on_plane() + decks.GRAVITY
    run = run_deck(tmp_path, deck, end_time=1.0, integrator=method, tol=tol)
    # nothing drives it, and it does not come to rest
    assert np.ptp(run["contacts/301/force"][-100:, 2]) > 2.0
    assert any(GAVE in said and "has no potential" in said for said in run.audit.warnings)


@pytest.mark.parametrize(
    ("beside", "depth"),
    [(0.0, ""), (0.05, ""), (0.05, 'contact_depth="FIELD"'), (0.02, 'contact_depth="FIELD"')],
)
def test_what_loses_its_energy_is_not(beside, depth, tmp_path):
    run = run_deck(tmp_path, ring_on_plane(beside, depth) + decks.GRAVITY, end_time=3.0)
    assert run.audit.warnings == ()
    left = run["energy/kinetic"] + run["energy/potential"]
    # it never rises, but by what the balance is off
    assert np.diff(left[::20]).max() <= run.audit.balance
    assert left[0] - left[-1] > 10.0 * run.audit.balance


@pytest.mark.parametrize("tol", [1e-3, 1e-5, 1e-7])
def test_a_force_with_a_potential_is_not_however_it_bounces(tol, tmp_path):
    deck = decks.GROUND + decks.sphere(1.0) + decks.GRAVITY
    deck += decks.contact(cnf_type="IMPACT", stiffness=1e5, exponent=1.5, damping=1.0, dmax=1e-4)
    run = run_deck(tmp_path, deck, end_time=2.0, tol=tol)
    assert not any(GAVE in said for said in run.audit.warnings)


def test_what_is_no_mesh_is_not_called_one(tmp_path, monkeypatch):
    """A bound that all contacts are beyond: the ring is told to be a mesh, the ball is not."""
    monkeypatch.setattr(audit, "FEEDS", -math.inf)
    monkeypatch.setattr(audit, "FEEDS_ERRORS", -math.inf)
    deck = decks.GROUND + decks.sphere(0.0999) + decks.GRAVITY + decks.contact()
    for model, meshes in ((deck, False), (ring_on_plane(0.02, "") + decks.GRAVITY, True)):
        run = run_deck(tmp_path, model, end_time=0.1)
        (said,) = [line for line in run.audit.warnings if GAVE in line]
        assert ("not convex" in said) == meshes
