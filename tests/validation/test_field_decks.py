"""contact_depth="FIELD" and VOLUME in runs: what lies stands, what rocks and bounces keeps time."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

import mbsim
from helpers.decks import GRAVITY, GROUND, run_deck, write_deck
from mbsim.errors import DeckError

FIELD = (
    'contact_depth="FIELD" cnf_type="IMPACT" stiffness="{}" exponent="1" damping="{}" dmax="1e-6"'
)
LAYER = 'cnf_type="VOLUME" i_elastic_modulus="1e5" i_poisson_ratio="0" i_layer_depth="1"'


def mesh(id, marker, shape, extra=""):
    nodes = " ".join(repr(float(x)) for x in shape.vertices.ravel())
    faces = " ".join(str(int(k)) for k in shape.faces.ravel())
    return (
        f'<Post_Graphic id="{id}" type="TriaMesh" rm_id="{marker}" {extra}><Nodes>{nodes}</Nodes>'
        f"<Faces>{faces}</Faces></Post_Graphic>"
    )


def body(z, inertia=1.0 / 6.0, start="", marker=""):
    return (
        f'<Body_Rigid id="2" cg_id="20" mass="1" inertia_xx="{inertia!r}" '
        f'inertia_yy="{inertia!r}" inertia_zz="{inertia!r}" {start}/>'
        f'<Reference_Marker id="20" body_id="2" pos_z="{z!r}" {marker}/>'
    )


def contact(law):
    return f'<Force_Contact id="301" i_graphics_id="200" j_graphics_id="100" {law}/>'


def cube(halvings=0):
    box = trimesh.creation.box((1.0, 1.0, 1.0))
    for _ in range(halvings):
        box = box.subdivide()
    return box


def test_a_box_sinks_as_deep_however_it_is_cut_and_stands(tmp_path):
    sags = []
    for shape in (cube(), cube(4)):
        model = GROUND + body(0.5) + mesh(200, 20, shape) + contact(FIELD.format(1e5, 1e3))
        results = run_deck(tmp_path, model + GRAVITY, 0.3)
        sags.append(0.5 - results["bodies/2/position"][-1, 2])
        assert np.abs(results["bodies/2/angular_velocity"]).max() < 1e-12
    assert sags[1] == pytest.approx(sags[0], rel=1e-6)
    assert sags[0] == pytest.approx(9.81e-5, rel=1e-4)


@pytest.mark.parametrize("exponent", [1.0, 1.5])
def test_the_law_is_a_pressure_over_the_face(tmp_path, exponent):
    # a ring's flat side of the area A is as stiff as with LARGEST where k and c are A times less
    ring = trimesh.creation.annulus(0.05, 0.1, 0.1, sections=24)
    area = float(12.0 * np.sin(2.0 * np.pi / 24) * (0.1**2 - 0.05**2))
    forces = []
    for depth, share in (("LARGEST", 1.0), ("FIELD", area)):
        law = (
            f'contact_depth="{depth}" cnf_type="IMPACT" stiffness="{1e6 / share!r}" '
            f'exponent="{exponent}" damping="{200.0 / share!r}" dmax="1e-9"'
        )
        start = 'v_ic_z="-0.01" v_ic_z_flag="TRUE"'
        model = GROUND + body(0.05 - 1e-4, start=start) + mesh(200, 20, ring) + contact(law)
        forces.append(run_deck(tmp_path, model, 1e-3)["contacts/301/force"][0, 2])
    wanted = 1e6 * 1e-4**exponent + 200.0 * 0.01
    assert forces == pytest.approx([wanted, wanted], rel=1e-9)


def test_volume_is_a_bed_of_the_constrained_modulus(tmp_path):
    model = GROUND + body(0.5) + mesh(200, 20, cube()) + contact(f'{LAYER} damping="300"')
    results = run_deck(tmp_path, model + GRAVITY, 0.6)
    assert 0.5 - results["bodies/2/position"][-1, 2] == pytest.approx(9.81e-5, rel=1e-3)


def test_a_box_rocks_on_a_uniform_bed(tmp_path):
    start = 'w_ic_x="1e-3" w_ic_x_flag="TRUE"'
    model = GROUND + body(0.5 - 9.81e-5, start=start) + mesh(200, 20, cube())
    results = run_deck(tmp_path, model + contact(FIELD.format(1e5, 0)) + GRAVITY, 0.3, 2e-4)
    w, t = results["bodies/2/angular_velocity"][:, 0], results["time"][:]
    k = np.flatnonzero(w[:-1] * w[1:] < 0.0)
    zeros = t[k] - w[k] * (t[k + 1] - t[k]) / (w[k + 1] - w[k])
    # 4 k a^4/3 of the face of 2 a = 1, less what tips the weight over
    exact = np.sqrt((1e5 / 12.0 - 9.81 * 0.5) / (1.0 / 6.0))
    assert np.pi / np.diff(zeros).mean() == pytest.approx(exact, rel=1e-2)


@pytest.mark.parametrize(("tol", "most"), [(None, 1e-3), (1e-8, 1e-6)])
def test_ten_bounces_of_a_mesh_on_a_mesh_keep_the_energy(tol, most, tmp_path):
    slab = trimesh.creation.box((4.0, 4.0, 1.0))
    slab.apply_translation((0.0, 0.0, -0.5))
    small = trimesh.creation.box((0.4, 0.3, 0.2))
    model = GROUND.replace('<Post_Graphic id="100" type="Plane" rm_id="10"/>', mesh(100, 10, slab))
    model += body(0.5, 0.01, marker='phi="0.3" theta="0.5"') + mesh(200, 20, small)
    model += contact(FIELD.format(1e7, 0)) + GRAVITY
    results = run_deck(tmp_path, model, 6.0, **({} if tol is None else {"tol": tol}))
    z, v = results["bodies/2/position"][:, 2], results["bodies/2/velocity"]
    w = results["bodies/2/angular_velocity"]
    energy = 0.5 * (v**2).sum(axis=1) + 0.005 * (w**2).sum(axis=1) + 9.81 * z
    apart = results["contacts/301/incidents"][:] == 0
    assert ((v[:-1, 2] < 0.0) & (v[1:, 2] > 0.0)).sum() >= 10
    assert np.abs(energy[apart] / energy[0] - 1.0).max() < most
    # on corners and edges what is stored counts in the balance
    assert not results.audit.warnings


def test_a_box_that_rolls_off_a_slab_is_not_warned_of(tmp_path):
    """It touches the slab's edge with its side, and the slab's top with its edge."""
    slab = trimesh.creation.box((1.0, 1.0, 1.0))
    slab.apply_translation((0.0, 0.0, -0.5))
    small = trimesh.creation.box((0.4, 0.3, 0.2))
    model = GROUND.replace('<Post_Graphic id="100" type="Plane" rm_id="10"/>', mesh(100, 10, slab))
    start = 'v_ic_x="0.3" v_ic_x_flag="TRUE"'
    place = 'phi="0.3" theta="0.5" pos_x="0.45"'
    model += body(0.3, 0.01, start, place) + mesh(200, 20, small)
    results = run_deck(tmp_path, model + contact(FIELD.format(1e7, 0)) + GRAVITY, 0.6)
    assert results["contacts/301/peak_penetration"] > 1e-3
    assert not results.audit.warnings


def test_a_smooth_sphere_rolls_at_the_height_of_a_true_one(tmp_path):
    ball = trimesh.creation.icosphere(3)
    start = 'v_ic_x="1" v_ic_x_flag="TRUE" w_ic_y="1" w_ic_y_flag="TRUE"'
    # (K/h) pi d^2 (1 - d/3) bears the weight at d = 0.0125
    stiffness = 9.81 / (np.pi * 0.0125**2 * (1.0 - 0.0125 / 3.0))
    model = GROUND + body(1.0 - 0.0125, 0.4, start) + mesh(200, 20, ball, 'facets="SMOOTH"')
    results = run_deck(tmp_path, model + contact(FIELD.format(stiffness, 0)) + GRAVITY, 0.5)
    depth = 1.0 - results["bodies/2/position"][:, 2]
    np.testing.assert_allclose(depth, 0.0125, rtol=1e-2)


def test_what_has_no_field_is_refused(tmp_path):
    ball = '<Post_Graphic id="200" type="Sphere" center_marker_id="20" radius="0.5"/>'
    path = write_deck(tmp_path, GROUND + body(0.5) + ball + contact(LAYER))
    with pytest.raises(DeckError, match="SPHERE on PLANE"):
        mbsim.simulate(mbsim.read_model(path))
    path = write_deck(tmp_path, GROUND + body(0.5) + mesh(200, 20, cube()) + contact(LAYER))
    with pytest.raises(DeckError, match="without FCL"):
        mbsim.simulate(mbsim.read_model(path), detector="fcl")
