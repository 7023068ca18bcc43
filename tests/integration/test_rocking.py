"""Bodies that rock from a flat side to its edges and back: their energy, whatever holds them."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation
from test_bodies_on_sides import GROUNDS, channel, ring

from helpers import decks
from helpers.decks import run_deck
from helpers.pairs import turned
from helpers.surfaces import mesh_graphic

CYLINDER = trimesh.creation.cylinder(0.1, 0.1, sections=96)
#: Meshes whose mass centre is 0.04 m above their flat side: two that are not convex, one that is.
SHAPES = {
    "ring": ring(),
    "channel": channel(),
    "cylinder": (np.add(CYLINDER.vertices, (0.0, 0.0, 0.05)), CYLINDER.faces),
}
#: Stiffness that goes with an exponent.
STIFFNESS = {1.0: 1e5, 1.5: 1e7, 2.2: 5e9}
#: It falls from 7 degrees, and rocks at each side up to about that.
TILT, HEIGHT = np.radians(7.0), 0.04


def deck(shape, exponent, ground="plane", damping=0.0, friction=""):
    """Return a tilted body that touches the ground at its lowest corner."""
    vertices, faces = np.asarray(SHAPES[shape][0]) - [0.0, 0.0, HEIGHT], SHAPES[shape][1]
    R = turned((1.0, 0.3, 0.0), TILT)
    first, second, third = (float(x) for x in Rotation.from_matrix(R).as_euler("ZXZ"))
    high = 1e-4 - float((vertices @ R.T)[:, 2].min())
    return (
        decks.EARTH
        + GROUNDS[ground]
        + '<Body_Rigid id="2" cg_id="20" mass="2" inertia_xx="0.01" inertia_yy="0.012" '
        f'inertia_zz="0.015"/><Reference_Marker id="20" body_id="2" pos_z="{high!r}" '
        f'psi="{first!r}" theta="{second!r}" phi="{third!r}"/>'
        + mesh_graphic(200, 20, vertices, faces)
        + '<Force_Contact id="301" i_graphics_id="200" j_graphics_id="100" cnf_type="IMPACT" '
        f'stiffness="{STIFFNESS[exponent]!r}" exponent="{exponent!r}" damping="{damping!r}" '
        f'dmax="1e-4" {friction}/>' + decks.GRAVITY
    )


METHODS = [(exponent, "DOPRI5", 1e-8) for exponent in STIFFNESS]
METHODS += [(1.5, "DOP853", 1e-9), (1.0, "RADAU5", 1e-8), (1.5, "GALPHA", 1e-8)]


@pytest.mark.parametrize(("exponent", "method", "tol"), METHODS)
@pytest.mark.parametrize("shape", SHAPES)
def test_without_a_damper_energy_stays(shape, exponent, method, tol, tmp_path):
    run = run_deck(tmp_path, deck(shape, exponent), 2.0, 0.002, integrator=method, tol=tol)
    energy = run["energy/kinetic"] + run["energy/potential"]
    fell = float(np.ptp(run["energy/kinetic"]))
    assert fell > 0.1
    assert abs(energy - energy[0]).max() < (1e-3 if method == "GALPHA" else 5e-5) * fell
    assert run.audit.warnings == ()


@pytest.mark.parametrize("shape", ["ring", "channel"])
def test_on_a_box_too(shape, tmp_path):
    """Sides of two meshes are seen along the mean of their normals, which is nearly exact."""
    run = run_deck(tmp_path, deck(shape, 1.5, "box"), 2.0, 0.002, integrator="DOPRI5", tol=1e-8)
    energy = run["energy/kinetic"] + run["energy/potential"]
    assert abs(energy - energy[0]).max() < 2e-4 * np.ptp(run["energy/kinetic"])
    assert run.audit.warnings == ()


def test_after_fifty_rocks_it_has_what_it_had(tmp_path):
    run = run_deck(tmp_path, deck("channel", 1.5), 12.0, 0.002, integrator="DOP853", tol=1e-9)
    energy, touches = (
        run["energy/kinetic"] + run["energy/potential"],
        run["contacts/301/force"][:, 2] > 0.0,
    )
    assert np.count_nonzero(touches[1:] & ~touches[:-1]) > 50
    assert abs(energy - energy[0]).max() < 1e-5 * np.ptp(run["energy/kinetic"])


FRICTIONS = {
    "smooth": "",
    "rough": 'cff_type="COULOMB_ON" mu_static="0.3" mu_dynamic="0.3" stiction_trans_vel="1e-3" '
    'friction_trans_vel="2e-3"',
    "sticks": 'cff_type="STICTION" mu_static="0.3" mu_dynamic="0.3"',
}


@pytest.mark.parametrize("friction", FRICTIONS)
@pytest.mark.parametrize(("method", "tol"), [("DOPRI5", 1e-7), ("RADAU5", 1e-6)])
@pytest.mark.parametrize("shape", SHAPES)
def test_dampers_and_friction_only_take_energy(shape, method, tol, friction, tmp_path):
    model = deck(shape, 1.5, damping=300.0, friction=FRICTIONS[friction])
    run = run_deck(tmp_path, model, 3.0, 0.002, integrator=method, tol=tol)
    energy = run["energy/kinetic"] + run["energy/potential"]
    assert np.diff(energy).max() < max(2.0 * run.audit.balance, 1e-9)
    assert energy[0] - energy[-1] > 0.1 * np.ptp(run["energy/kinetic"])
    assert run.audit.warnings == ()


@pytest.mark.parametrize(
    ("shape", "ground"), [("ring", "plane"), ("ring", "box"), ("cylinder", "plane")]
)
def test_which_graphic_is_named_first_has_no_part(shape, ground, tmp_path):
    # friction is asked at places that are counted from axes of the first one
    model = deck(shape, 1.5, ground, damping=300.0)
    turned_round = model.replace(
        'i_graphics_id="200" j_graphics_id="100"', 'i_graphics_id="100" j_graphics_id="200"'
    )
    assert turned_round != model
    one, other = (
        run_deck(tmp_path, text, 0.3, integrator="DOPRI5", tol=1e-8)
        for text in (model, turned_round)
    )
    for axis in "xyz":
        signal = f"bodies/2/position/{axis}"
        assert other[signal] == pytest.approx(one[signal], abs=1e-7)
    assert other["energy/kinetic"] == pytest.approx(one["energy/kinetic"], abs=1e-5)
