"""The contact law, step control and energy account against numbers made elsewhere."""

from __future__ import annotations

import math

import numpy as np
import pytest

from helpers.decks import COULOMB, GRAVITY, GROUND, contact, run_deck, run_model, sphere
from helpers.reference import RESTITUTION, drop_height


@pytest.mark.parametrize(("tol", "allowed"), [(1e-5, 1e-3), (1e-8, 1e-5)])
@pytest.mark.parametrize(("damping", "rebound", "duration", "deepest"), RESTITUTION)
def test_restitution_table(tmp_path, damping, rebound, duration, deepest, tol, allowed):
    model = GROUND + sphere(0.2, v=(0, 0, -1.0)) + contact(damping=damping, dmax=1e-3)
    results = run_deck(tmp_path, model, end_time=0.5, tol=tol)
    assert results["bodies/2/velocity/z"][-1] == pytest.approx(rebound, abs=allowed)
    touch, leave = results["events"]["time"]
    assert leave - touch == pytest.approx(duration, rel=10 * allowed)
    assert results["contacts/301/peak_penetration"] == pytest.approx(deepest, rel=10 * allowed)


def convergence(errors):
    """Assert that errors fall 3 times a decade on average and never rise more than twice.

    An error may pass through zero at one tolerance: each is held against the two before. One
    that begins small has to end below 30 tol.
    """
    errors = np.maximum(errors, 1e-13)
    assert errors[-1] < max(errors[0] / 3.0 ** (len(errors) - 1), 30 * 1e-9), errors
    before = np.maximum(errors[1:-1], errors[:-2])
    assert (errors[2:] / before).max() <= 2.0, errors


def test_bouncing_sphere_converges():
    errors = []
    for tol in 10.0 ** -np.arange(3, 10):
        results = run_model("bouncing_sphere.xml", tol=tol)
        exact = drop_height(results["time"], 0.6, 0.1, 1.0, 1e8, 1.5, 200.0, 1e-4)
        errors.append(np.abs(results["bodies/2/position/z"] - exact).max())
    convergence(np.array(errors))


@pytest.mark.parametrize(
    ("name", "signal"),
    [("drop_m.xml", "bodies/2/position"), ("free_top.xml", "bodies/2/quaternion"),
     ("sphere_pair.xml", "bodies/1/velocity"), ("bowling_ball.xml", "bodies/2/position"),
     ("drop_mm.xml", "bodies/2/position"), ("incline_slip.xml", "bodies/2/position"),
     ("sliding_block.xml", "bodies/2/position"), ("mesh_on_plane.xml", "bodies/2/position"),
     ("ellipsoid_on_box.xml", "bodies/2/position/z"),
     ("hunt_crossley_pair.xml", "bodies/1/position"), ("poisson_walls.xml", "bodies/2/position")],
)  # fmt: skip
def test_models_converge(name, signal):
    exact = run_model(name, tol=1e-12)[signal]
    errors = []
    for tol in 10.0 ** -np.arange(3, 10):
        errors.append(np.abs(run_model(name, tol=tol)[signal] - exact).max())
    # over the signal's size: the same deck in mm has a thousand times the error in m
    convergence(np.array(errors) / np.abs(exact).max())


def test_energy_balance_closes(tmp_path):
    model = (
        GROUND
        + sphere(0.6, v=(2.0, 0, 0))
        + contact(stiffness=1e6, damping=50, dmax=1e-3, **COULOMB)
        + GRAVITY
    )
    for tol in (1e-6, 1e-9):
        results = run_deck(tmp_path, model, end_time=2.0, tol=tol)
        total = sum(results[f"energy/{kind}"] for kind in ("kinetic", "potential", "dissipated"))
        scale = results["energy/kinetic"].max()
        # some hundred steps of local error tol
        assert np.abs(total - total[0]).max() < 100 * tol * scale
        assert (np.diff(results["energy/dissipated"]) > -1e-12 * scale).all()


def test_forces_in_rows_are_those_of_the_row(tmp_path):
    model = GROUND + sphere(0.6) + contact(damping=50, dmax=1e-3) + GRAVITY
    results = run_deck(tmp_path, model, end_time=1.0)
    z, vz = results["bodies/2/position/z"], results["bodies/2/velocity/z"]
    depth = np.maximum(0.1 - z, 0.0)
    s = np.minimum(depth / 1e-3, 1.0)
    force = np.maximum(0.0, 1e5 * depth**1.5 - 50 * s * s * (3 - 2 * s) * vz)
    np.testing.assert_allclose(results["contacts/301/force/z"], force, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(results["bodies/2/acceleration/z"], force - 9.81, rtol=1e-9)
    np.testing.assert_allclose(results["contacts/301/penetration"], depth, atol=1e-14)


def test_first_depth_of_an_impact_is_limited(tmp_path):
    # at a loose tolerance the guard alone keeps the restitution of a stiff contact
    model = GROUND + sphere(1.1, v=(0, 0, -3.0)) + contact(stiffness=1e9)
    results = run_deck(tmp_path, model, end_time=0.7, tol=1e-2)
    assert results["bodies/2/velocity/z"][-1] == pytest.approx(3.0, rel=0.05)


def test_thin_plate_is_not_jumped_over(tmp_path):
    plate = """<Body_Rigid id="1" isground="TRUE"/><Reference_Marker id="10" body_id="1"/>
    <Post_Graphic id="100" type="BoxDefinedFromCenter" center_marker_id="10"
      length_x="4" length_y="4" length_z="0.01"/>"""
    model = plate + sphere(3.0, radius=0.02, v=(0, 0, -5.0)) + contact(stiffness=1e8)
    results = run_deck(tmp_path, model, end_time=1.0)
    assert results["bodies/2/velocity/z"][-1] == pytest.approx(5.0, rel=1e-2)


def test_friction_is_called_for_touching_incidents_only(tmp_path):
    model = GROUND + sphere(0.6) + contact(**COULOMB) + GRAVITY
    falling = run_deck(tmp_path, model, end_time=0.3)
    assert falling.stats["friction_calls"] == 0
    assert falling.stats["normal_calls"] < 100
    assert falling.stats["skipped_pairs"] > 0
    bouncing = run_deck(tmp_path, model, end_time=1.0)
    assert 0 < bouncing.stats["friction_calls"] <= bouncing.stats["normal_calls"]


def test_separated_pairs_are_not_looked_at_in_every_stage(tmp_path):
    many = "".join(sphere(1.0, body=k, x=10.0 * k) for k in range(2, 12))
    links = "".join(contact(100 * k, 100 * (k + 1), id=500 + k) for k in range(2, 11))
    results = run_deck(tmp_path, many + links + GRAVITY, end_time=1.0)
    looked = results.stats["narrowphase_pairs"]
    assert looked < 0.1 * (looked + results.stats["skipped_pairs"])


def bound(results, energy):
    """Assert that a run that finished has finite numbers and did not make energy."""
    for name in ("bodies/2/position", "bodies/2/velocity", "bodies/2/angular_velocity"):
        assert np.isfinite(results[name]).all()
    total = results["energy/kinetic"] + results["energy/potential"]
    # the start may hold contact energy; afterwards nothing may add more than error control allows
    assert total.max() <= total[0] + 1e-3 * max(abs(total[0]), energy)


STABILITY = [
    *[(f"k=1e{n}", {"stiffness": 10.0**n}, {}) for n in range(3, 12)],
    *[
        (f"vs=1e-{n}", {**COULOMB, "stiction_trans_vel": 10.0**-n,
                        "friction_trans_vel": 2 * 10.0**-n}, {"v": (0.5, 0.2, 0.0)})
        for n in range(1, 7)
    ],
    ("damping=0", {"damping": 0}, {}),
    ("damping=1e3", {"damping": 1e3, "dmax": 1e-4}, {}),
    ("damping=1e6", {"damping": 1e6, "dmax": 1e-4}, {}),
    ("damping=1e9", {"damping": 1e9, "dmax": 1e-5}, {}),
    ("exponent=1", {"exponent": 1.0, "damping": 100, "dmax": 1e-4}, {}),
    ("exponent=3", {"exponent": 3.0, "stiffness": 1e9}, {}),
    ("spin=1e3 z", COULOMB, {"w": (0.0, 0.0, 1e3)}),
    ("spin=1e3 y", COULOMB, {"w": (0.0, 1e3, 0.0)}),
    ("light", {}, {"mass": 1e-4}),
    ("heavy", {}, {"mass": 1e4}),
    ("fast", {}, {"v": (0.0, 0.0, -100.0)}),
    ("overlap", {}, {"z": 0.09}),
    ("micro", {"stiffness": 1e5}, {"radius": 1e-6, "mass": 1e-14, "z": 3e-6}),
    ("kilometre", {"stiffness": 1e9}, {"radius": 1e3, "mass": 1e12, "z": 1.5e3}),
]  # fmt: skip


@pytest.mark.parametrize(("name", "law", "body"), STABILITY, ids=[case[0] for case in STABILITY])
def test_stability(tmp_path, name, law, body):
    values = {"z": 0.15, **body}
    z = values.pop("z")
    model = GROUND + sphere(z, **values) + contact(**law) + GRAVITY
    mass, v = values.get("mass", 1.0), values.get("v", (0, 0, 0))
    energy = mass * (9.81 * z + 0.5 * float(np.dot(v, v)))
    end_time = 0.3 if name != "kilometre" else 30.0
    # some 240 bounces of the small one add up
    results = run_deck(tmp_path, model, end_time, tol=1e-6 if name == "micro" else 1e-5)
    assert results.attributes["status"] == "finished"
    bound(results, energy)


def test_mass_ratio_of_1e4(tmp_path):
    model = (
        GROUND
        + sphere(0.0999, mass=1.0)
        + sphere(0.2998, mass=1e4, body=3)
        + contact(200, 100, id=1, stiffness=1e8, damping=1e4, dmax=1e-4)
        + contact(300, 200, id=2, stiffness=1e8, damping=1e4, dmax=1e-4)
        + GRAVITY
    )
    results = run_deck(tmp_path, model, end_time=0.5)
    assert results.attributes["status"] == "finished"
    assert np.isfinite(results["bodies/3/position"]).all()
    assert results["bodies/3/position/z"][-1] == pytest.approx(0.29, abs=0.01)


def test_vertical_stack_stands(tmp_path):
    balls = "".join(sphere(0.1 + 0.2 * k - 1e-5, body=k + 2) for k in range(4))
    law = {"stiffness": 1e6, "damping": 300, "dmax": 1e-4, **COULOMB}
    pairs = contact(200, 100, id=1, **law) + "".join(
        contact(100 * (k + 3), 100 * (k + 2), id=2 + k, **law) for k in range(3)
    )
    results = run_deck(tmp_path, GROUND + balls + pairs + GRAVITY, end_time=2.0)
    # exactly vertical: no sideways force exists
    assert np.abs(results["bodies/5/position/x"]).max() < 1e-9
    assert results["contacts/1/force/z"][-1] == pytest.approx(4 * 9.81, rel=1e-4)


def test_a_box_comes_to_rest_flat(tmp_path):
    box = """<Body_Rigid id="2" cg_id="20" mass="1" inertia_xx="0.0041667"
      inertia_yy="0.0041667" inertia_zz="0.0066667"/>
    <Reference_Marker id="20" body_id="2" pos_z="0.25" psi="0.3" theta="0.5" phi="0.2"/>
    <Post_Graphic id="200" type="BoxDefinedFromCenter" center_marker_id="20"
      length_x="0.2" length_y="0.2" length_z="0.1"/>"""
    law = {"stiffness": 1e5, "damping": 200, "dmax": 1e-4, **COULOMB}
    results = run_deck(tmp_path, GROUND + box + contact(**law) + GRAVITY, end_time=2.5)
    assert np.abs(results["bodies/2/angular_velocity"][-1]).max() < 1e-3
    assert results["contacts/301/incidents"][-1] == 4
    depth = (9.81 / 4 / 1e5) ** (2 / 3)
    assert results["bodies/2/position/z"][-1] == pytest.approx(0.05 - depth, abs=1e-6)


def test_a_cylinder_stands_and_one_rolls(tmp_path):
    def cylinder(markers):
        return f"""<Body_Rigid id="2" cg_id="20" mass="1" inertia_xx="0.0058333"
          inertia_yy="0.0058333" inertia_zz="0.005" v_ic_x="{0.0 if "stand" in markers else 1.0}"
          v_ic_x_flag="TRUE"/>
        <Reference_Marker id="20" body_id="2" pos_z="0.0999" {markers.replace("stand", "")}/>
        <Reference_Marker id="21" body_id="2" rm_id="20" pos_z="-0.1"/>
        <Post_Graphic id="200" type="Cylinder" center_marker_id="21" radius="0.1" length="0.2"/>"""

    law = {"stiffness": 1e6, "exponent": 1, "damping": 300, "dmax": 1e-5, **COULOMB}
    standing = run_deck(
        tmp_path, GROUND + cylinder("stand") + contact(**law) + GRAVITY, end_time=1.0
    )
    assert standing["contacts/301/incidents"][-1] == 3
    assert np.abs(standing["bodies/2/angular_velocity"][-1]).max() < 1e-6
    lying = run_deck(
        tmp_path,
        GROUND + cylinder(f'theta="{math.pi / 2!r}"') + contact(**law) + GRAVITY,
        end_time=2.0,
    )
    assert lying["contacts/301/incidents"][-1] == 2
    # a solid cylinder keeps 2/3 of its speed; the axis is along y
    assert lying["bodies/2/velocity/x"][-1] == pytest.approx(2.0 / 3.0, rel=2e-3)


def shape(body, kind, z, x=0.0, angles=(0.3, 0.5, 0.2)):
    """Return a body of 1 kg with one graphic, turned."""
    graphic = {
        "ellipsoid": 'type="Ellipsoid" center_marker_id="{m}" x_scale=".1" y_scale=".12" '
        'z_scale=".08"',
        "box": 'type="BoxDefinedFromCenter" center_marker_id="{m}" length_x=".2" length_y=".2" '
        'length_z=".2"',
        "cylinder": 'type="Cylinder" center_marker_id="{c}" radius=".1" length=".2"',
    }[kind].format(m=10 * body, c=10 * body + 1)
    psi, theta, phi = angles
    return f"""<Body_Rigid id="{body}" cg_id="{10 * body}" mass="1" inertia_xx="0.0058"
      inertia_yy="0.0058" inertia_zz="0.005"/>
    <Reference_Marker id="{10 * body}" body_id="{body}" pos_x="{x}" pos_z="{z}"
      psi="{psi}" theta="{theta}" phi="{phi}"/>
    <Reference_Marker id="{10 * body + 1}" body_id="{body}" rm_id="{10 * body}" pos_z="-0.1"/>
    <Post_Graphic id="{100 * body}" {graphic}/>"""


LAW = {"stiffness": 1e5, "damping": 200, "dmax": 1e-3, **COULOMB}
FLOORS = {
    "plane": GROUND,
    "slab": GROUND.replace(
        'type="Plane" rm_id="10"',
        'type="BoxDefinedFromCenter" center_marker_id="10" length_x="2" length_y="2" '
        'length_z="0.02"',
    ),
}


@pytest.mark.parametrize("floor", list(FLOORS))
@pytest.mark.parametrize("kind", ["ellipsoid", "box", "cylinder"])
def test_energy_closes_for_tumbling_shapes(tmp_path, kind, floor):
    model = FLOORS[floor] + shape(2, kind, 0.3) + contact(**LAW) + GRAVITY
    results = run_deck(tmp_path, model, end_time=1.0, tol=1e-6)
    total = sum(results[f"energy/{kind}"] for kind in ("kinetic", "potential", "dissipated"))
    assert np.abs(total - total[0]).max() < 1e-5 * total[0]


def test_energy_closes_between_ellipsoids(tmp_path):
    # the least depth of two round shapes is found to rounding, not where FCL stopped
    model = (
        GROUND
        + shape(2, "ellipsoid", 0.0799, angles=(0, 0, 0))
        + shape(3, "ellipsoid", 0.3, x=0.02, angles=(0.3, 0.4, 0.5))
        + contact(200, 100, id=1, **LAW)
        + contact(300, 200, id=2, **LAW)
        + GRAVITY
    )
    results = run_deck(tmp_path, model, end_time=0.3, tol=1e-6)
    assert results["contacts/2/peak_force"] > 10.0
    total = sum(results[f"energy/{kind}"] for kind in ("kinetic", "potential", "dissipated"))
    assert np.abs(total - total[0]).max() < 1e-6 * total[0]


@pytest.mark.parametrize("kinds", [("box", "box"), ("box", "cylinder"), ("cylinder", "cylinder")])
def test_shapes_on_shapes_come_to_rest(tmp_path, kinds):
    model = GROUND + shape(2, kinds[0], 0.1, angles=(0, 0, 0)) + shape(3, kinds[1], 0.45, x=0.02)
    model += contact(200, 100, id=1, **LAW) + contact(300, 100, id=2, **LAW)
    model += contact(300, 200, id=3, **LAW) + GRAVITY
    results = run_deck(tmp_path, model, end_time=1.5)
    total = results["energy/kinetic"] + results["energy/potential"]
    assert total.max() <= total[0] * 1.02
    assert np.isfinite(results["bodies/3/position"]).all()
    assert results["bodies/3/position/z"][-1] > 0.09


def test_energy_lost_is_kept_for_each_contact(tmp_path):
    # a ball that only rubs loses 1/7 of what it has, m v^2 / 2, until it rolls
    depth = (9.81 / 1e8) ** (2 / 3)
    model = (
        GROUND
        + sphere(0.1 - depth, v=(2.0, 0, 0))
        + sphere(5.0, body=3)
        + contact(stiffness=1e8, damping=200, dmax=1e-4, **{**COULOMB, "mu_dynamic": 0.3})
        + contact(300, 100, id=302)
        + GRAVITY
    )
    out = tmp_path / "out"
    results = run_deck(tmp_path, model, end_time=0.8, tol=1e-8, output=out)
    text = (out / "deck.log").read_text()
    lost = [float(part.split()[0]) for part in text.split("energy lost, damper and friction")[1:]]
    assert lost[0] == pytest.approx(0.5 * 4.0 * 2.0 / 7.0, rel=2e-3)
    # the other ball is still falling
    assert len(lost) == 1
    assert results["energy/dissipated"][-1] == pytest.approx(sum(lost), rel=1e-4)


@pytest.mark.parametrize("method", ["DOPRI5", "DOP853"])
@pytest.mark.parametrize(("name", "allowed"), [("bowling_ball", 1e-3), ("cam_roller", 2e-7)])
def test_rows_of_explicit_methods_hold_in_stiff_contact(name, allowed, method):
    # the steps are at their bound of stability: DOP853's rows between them were 2.8e-3 and 3.7e-7
    # off, its steps 4e-7 and 1e-12
    exact, rows = (
        np.concatenate([r[f"bodies/{b}/velocity"] for b in r.ids("bodies")])
        for r in (
            run_model(f"{name}.xml", integrator="DOPRI5", tol=1e-9),
            run_model(f"{name}.xml", integrator=method, tol=1e-5),
        )
    )
    assert np.abs(rows - exact).max() < allowed
