"""Bodies whose mesh is not convex, on a flat side: they come to rest, tip where they should."""

from __future__ import annotations

import math

import numpy as np
import pytest
import trimesh

from helpers import decks
from helpers.decks import run_deck
from helpers.surfaces import mesh_graphic
from mbsim import simulate

MASS, G, STIFFNESS = 2.0, 9.81, 1e5
RADIUS, SECTIONS = 0.1, 24
#: The rim has corners: nearest to the middle it is there.
REACH = RADIUS * math.cos(math.pi / SECTIONS)
#: A channel on two feet, 20 mm wide each, 0.2 m apart over all; profile in x, z.
PROFILE = np.array(
    [[-0.1, 0], [-0.08, 0], [-0.08, 0.04], [0.08, 0.04], [0.08, 0], [0.1, 0], [0.1, 0.06]]
)
PROFILE = np.vstack([PROFILE, [[-0.1, 0.06]]])


def ring():
    """Return a ring on z = 0 as vertices and faces."""
    mesh = trimesh.creation.annulus(0.05, RADIUS, 0.1, sections=SECTIONS)
    return np.add(mesh.vertices, (0.0, 0.0, 0.05)), mesh.faces


def channel():
    """Return a channel on z = 0, 0.15 m long."""
    count = len(PROFILE)
    ends = [np.insert(PROFILE, 1, y, axis=1) for y in (-0.075, 0.075)]
    flat = np.array([[0, 1, 2], [0, 2, 7], [2, 3, 6], [2, 6, 7], [3, 4, 5], [3, 5, 6]])
    k = np.arange(count)
    m = (k + 1) % count
    around = np.vstack(
        [np.column_stack([k, m + count, m]), np.column_stack([k, k + count, m + count])]
    )
    return np.vstack(ends), np.vstack([flat, flat[:, ::-1] + count, around])


GROUNDS = {
    "plane": '<Post_Graphic id="100" type="Plane" rm_id="10"/>',
    "box": '<Reference_Marker id="11" body_id="1" pos_z="-0.1"/><Post_Graphic id="100" '
    'type="BoxDefinedFromCenter" center_marker_id="11" length_x="0.5" length_y="0.4" '
    'length_z="0.2"/>',
    "ring": mesh_graphic(100, 10, (ring()[0] - [0.0, 0.0, 0.1]) * [1.1, 1.1, 1.0], ring()[1]),
}


def deck(mesh, beside, ground="plane", sag=2e-4, height=0.05, law="", damping=300.0, friction=""):
    """Return a body on a ground; its mass centre is `beside` (x, y) its middle [m]."""
    at = f'pos_x="{beside[0]!r}" pos_y="{beside[1]!r}" pos_z="{height - sag!r}"'
    return (
        decks.EARTH
        + GROUNDS[ground]
        + f'<Body_Rigid id="2" cg_id="20" mass="{MASS}" inertia_xx="0.02" inertia_yy="0.03" '
        f'inertia_zz="0.04"/><Reference_Marker id="20" body_id="2" {at}/>'
        f'<Reference_Marker id="21" body_id="2" pos_z="{-sag!r}"/>'
        + mesh_graphic(200, 21, *mesh)
        + '<Force_Contact id="301" i_graphics_id="200" j_graphics_id="100" cnf_type="IMPACT" '
        f'stiffness="{STIFFNESS!r}" exponent="1" damping="{damping!r}" dmax="1e-4" {law} '
        f"{friction}/>" + decks.GRAVITY
    )


COULOMB = (
    'cff_type="COULOMB_ON" mu_static="0.3" mu_dynamic="0.3" stiction_trans_vel="1e-3" '
    'friction_trans_vel="2e-3"'
)


@pytest.mark.parametrize("friction", ["", COULOMB], ids=["smooth", "rough"])
@pytest.mark.parametrize(("method", "tol"), [("DOPRI5", 1e-5), ("RADAU5", 1e-4), ("GALPHA", 1e-6)])
@pytest.mark.parametrize("part", [0.3, 0.6, 0.8])
@pytest.mark.parametrize("shape", ["ring", "channel"])
def test_it_comes_to_rest(shape, part, method, tol, friction, tmp_path):
    mesh, way = (ring(), (1.0, 0.0)) if shape == "ring" else (channel(), (1.0, 0.75))
    beside = (part * RADIUS * way[0], part * RADIUS * way[1])
    run = run_deck(tmp_path, deck(mesh, beside, friction=friction), 3.0, integrator=method, tol=tol)
    force = run["contacts/301/force"][-20:, 2]
    assert force == pytest.approx(MASS * G, rel=2e-5)
    assert abs(run["bodies/2/angular_velocity"][-20:]).max() < 1e-4
    assert run.audit.warnings == ()
    left = run["energy/kinetic"] + run["energy/potential"]
    assert np.diff(left).max() <= max(2.0 * run.audit.balance, 1e-12)


@pytest.mark.parametrize("ground", ["box", "ring"])
@pytest.mark.parametrize("beside", [(0.05, 0.0), (0.0, -0.075)])
def test_on_other_bodies_too(ground, beside, tmp_path):
    run = run_deck(
        tmp_path, deck(ring(), beside, ground, friction=COULOMB), 3.0, integrator="RADAU5", tol=1e-4
    )
    assert run["contacts/301/force"][-20:, 2] == pytest.approx(MASS * G, rel=2e-5)
    assert run.audit.warnings == ()


@pytest.mark.parametrize("method", ["DOPRI5", "RADAU5", "GALPHA"])
def test_without_a_damper_energy_stays(method, tmp_path):
    """Rocking by a milliradian, which lifts one side of it."""
    model = deck(ring(), (0.05, 0.0), sag=0.0, damping=0.0)
    run = run_deck(tmp_path, model, 1.0, integrator=method, tol=1e-7)
    total = run["energy/kinetic"] + run["energy/potential"]
    moves = float(np.ptp(run["energy/kinetic"]))
    assert moves > 1e-3
    assert np.ptp(total) < (3e-3 if method == "GALPHA" else 2e-4) * moves


@pytest.mark.parametrize("shape", ["ring", "channel"])
def test_it_tips_where_its_mass_centre_leaves_what_holds_it(shape, tmp_path):
    mesh, edge = (ring(), REACH) if shape == "ring" else (channel(), 0.1)
    # towards the middle of an edge
    angle = math.pi / SECTIONS if shape == "ring" else 0.0
    for part, tips in ((0.97, False), (1.03, True)):
        beside = (part * edge * math.cos(angle), part * edge * math.sin(angle))
        run = run_deck(tmp_path, deck(mesh, beside, damping=1e3), 1.5, tol=1e-5)
        upright = run["bodies/2/angular_velocity"][-1]
        fell = float(np.linalg.norm(upright)) > 0.1 or run["bodies/2/position/z"][-1] < 0.045
        assert fell == tips


def analysed(model, commands):
    """Return the results of a deck of these statements."""
    return simulate(
        f"<MotionSolve><Model>{model}</Model><Command>{commands}</Command></MotionSolve>"
    )


def test_frequencies_are_those_of_springs_at_its_corners():
    """Heave k/m; rocking, of the fourth power, 3 k sum c_i x_i^2 / I."""
    model = deck(ring(), (0.0, 0.0), damping=0.0)
    commands = '<Simulate analysis_type="Static"/><Simulate analysis_type="Linear"/>'
    (found,) = analysed(model, commands).linear
    squares = np.sort(abs(found.eigenvalues.imag))[::2][-3:] ** 2
    rocking = 3.0 * STIFFNESS * 0.5 * RADIUS**2
    # the weight, whose lever is 0.05 m above the ground, takes a little
    right = np.sort([STIFFNESS / MASS, rocking / 0.02, rocking / 0.03])
    assert squares == pytest.approx(right, rel=2e-3)


@pytest.mark.parametrize("beside", [(0.0, 0.0), (0.03, 0.02), (0.08, 0.0), (0.085, 0.01)])
def test_static_analysis_finds_where_it_comes_to_rest(beside, tmp_path):
    model = deck(ring(), beside)
    found = analysed(model, '<Simulate analysis_type="Static"/>')
    run = run_deck(tmp_path, model, 4.0, integrator="RADAU5", tol=1e-6)
    assert found["bodies/2/position/z"][-1] == pytest.approx(
        run["bodies/2/position/z"][-1], abs=2e-8
    )
    assert found["contacts/301/force"][-1, 2] == pytest.approx(MASS * G, rel=1e-9)
