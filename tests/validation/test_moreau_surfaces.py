"""Meshes that are not convex, with rigid contacts: they stand, tip, slide and fall into holes."""

import math

import numpy as np
import pytest
import trimesh

import mbsim
from helpers.mesh_parts import prism_of, write_stl

G = 9.81
LAW = (
    'cnf_type="POISSON" penalty="1e5" restitution_coef="0" cff_type="COULOMB_ON" '
    'mu_static="0.3" mu_dynamic="0.3" stiction_trans_vel="0.01" friction_trans_vel="0.02"'
)
SHAPES = {
    "box": 'type="BoxDefinedFromCenter" center_marker_id="{c}" length_x=".2" length_y=".3" '
    'length_z=".1"',
    "cylinder": 'type="Cylinder" center_marker_id="{b}" radius="0.1" length="0.1"',
    "sphere": 'type="Sphere" center_marker_id="{c}" radius="0.1"',
    "ring": 'type="TriaMesh" rm_id="{c}" file="ring.stl"',
    "angle": 'type="TriaMesh" rm_id="{c}" file="angle.stl"',
}
HALF = {"sphere": 0.1}


def body(number, shape, z, cg=(0.0, 0.0, 0.0), yaw=0.0, at=(0.0, 0.0)):
    """Return a body with its shape's middle at height z; `cg` [m] is beside that, in its axes."""
    c, s = math.cos(yaw), math.sin(yaw)
    axes = f'a00="{c!r}" a10="{s!r}" a20="0" a01="{-s!r}" a11="{c!r}" a21="0" '
    axes += 'a02="0" a12="0" a22="1"'
    half = HALF.get(shape, 0.05)

    def marker(id, x, y, z):
        x, y = at[0] + c * x - s * y, at[1] + s * x + c * y
        place = f'pos_x="{x!r}" pos_y="{y!r}" pos_z="{z!r}"'
        return f'<Reference_Marker id="{id}" body_id="{number}" {place} {axes}/>'

    return "\n".join([
        f'<Body_Rigid id="{number}" cg_id="{10 * number}" mass="2" '
        'inertia_xx="0.02" inertia_yy="0.03" inertia_zz="0.04"/>',
        marker(10 * number, cg[0], cg[1], z + cg[2]),
        marker(10 * number + 1, 0.0, 0.0, z),
        marker(10 * number + 2, 0.0, 0.0, z - half),
        f'<Post_Graphic id="{100 * number}" '
        f"{SHAPES[shape].format(c=10 * number + 1, b=10 * number + 2)}/>",
    ])  # fmt: skip


def run(folder, bodies, pairs, end=0.5, gravity=(0.0, 0.0, -G), **options):
    """Run bodies over a plane (100) with contacts of these pairs of graphics."""
    trimesh.creation.annulus(0.05, 0.1, 0.1, sections=64).export(folder / "ring.stl")
    outline = [(0, 0), (0.2, 0), (0.2, 0.05), (0.05, 0.05), (0.05, 0.2), (0, 0.2)]
    angle = prism_of(np.array(outline), [[0, 1, 3], [1, 2, 3], [0, 3, 5], [3, 4, 5]], 0.05)
    write_stl(folder / "angle.stl", angle)
    contacts = "\n".join(
        f'<Force_Contact id="{300 + k}" num_i_graphics="1" i_graphics_id="{i}" '
        f'num_j_graphics="1" j_graphics_id="{j}" {LAW}/>'
        for k, (i, j) in enumerate(pairs)
    )
    deck = folder / "deck.xml"
    deck.write_text(
        '<MotionSolve><Model><Body_Rigid id="1" isground="TRUE"/>'
        '<Reference_Marker id="10" body_id="1"/><Post_Graphic id="100" type="Plane" rm_id="10"/>'
        + "\n".join(bodies)
        + contacts
        + f'<Force_Gravity grav_x="{gravity[0]!r}" grav_z="{gravity[2]!r}"/></Model>'
        f'<Command><Simulate analysis_type="Transient" end_time="{end}" print_interval="0.01"/>'
        "</Command></MotionSolve>"
    )
    return mbsim.simulate(deck, integrator="MOREAU", **options)


def moved(results, number):
    """Return by how much a body's cg has moved at the end."""
    at = results[f"bodies/{number}/position"]
    return at[-1] - at[0]


@pytest.mark.parametrize("yaw", [0.0, 0.4])
@pytest.mark.parametrize(
    ("lower", "upper", "cg"),
    [
        ("ring", "ring", (0.06, 0.0, 0.0)),
        ("ring", "box", (0.05, 0.0, 0.0)),
        ("box", "ring", (0.05, 0.0, 0.0)),
        ("cylinder", "ring", (0.05, 0.0, 0.0)),
        ("ring", "cylinder", (0.05, 0.0, 0.0)),
        ("box", "angle", (0.05, 0.02, 0.0)),
    ],
)
def test_what_lies_on_what_stays(tmp_path, lower, upper, cg, yaw):
    """With compliant contacts such a body may rock for ever (manual: trust/before-trusting)."""
    bodies = [body(2, lower, 0.05), body(3, upper, 0.15, cg=cg, yaw=yaw)]
    told = []
    results = run(tmp_path, bodies, [(200, 100), (300, 200)], notify=told.append)
    assert np.abs(moved(results, 2)).max() < 1e-6
    assert np.abs(moved(results, 3)).max() < 1e-6
    assert results.stats["steps"] < 40
    assert not [line for line in told if "warning" in line]


@pytest.mark.parametrize(("beside", "tips"), [(0.0985, False), (0.1005, True)])
@pytest.mark.parametrize("lower", ["plane", "box"])
def test_a_ring_tips_where_its_cg_leaves_the_rim(tmp_path, lower, beside, tips):
    """The rim's corner on x is 0.1 m out."""
    wide = "box" if lower == "box" else None
    bodies = [body(2, "ring", 0.05, cg=(beside, 0.0, 0.0))]
    pairs = [(200, 100)]
    if wide:
        # the box is 0.3 m wide along y: the ring's cg is turned there
        bodies = [body(2, "box", 0.05), body(3, "ring", 0.15, cg=(0.0, beside, 0.0))]
        pairs = [(200, 100), (300, 200)]
    results = run(tmp_path, bodies, pairs, end=1.0)
    assert (abs(moved(results, 3 if wide else 2)[2]) > 1e-3) == tips


@pytest.mark.parametrize(("beside", "tips"), [(0.0245, True), (0.0255, False)])
def test_an_angle_tips_into_the_hole_of_a_ring(tmp_path, beside, tips):
    """It covers the ring where x + y > 0.05 m, between where its two legs pass the hole's rim."""
    bodies = [body(2, "ring", 0.05), body(3, "angle", 0.15, cg=(beside, beside, 0.0))]
    results = run(tmp_path, bodies, [(200, 100), (300, 200)], end=1.0)
    assert (np.abs(moved(results, 3)).max() > 1e-3) == tips


def test_a_ball_falls_into_the_hole_of_a_ring(tmp_path):
    """It rests on the hole's 64 edges, 0.05 cos(pi/64) m from the middle."""
    bodies = [body(2, "ring", 0.05), body(3, "sphere", 0.2)]
    results = run(tmp_path, bodies, [(200, 100), (300, 200)], end=1.0)
    inner = 0.05 * math.cos(math.pi / 64)
    assert moved(results, 3)[2] == pytest.approx(math.sqrt(0.1**2 - inner**2) - 0.1, abs=2e-5)


@pytest.mark.parametrize("shape", ["ring", "angle"])
@pytest.mark.parametrize("on", ["plane", "box"])
def test_a_mesh_slides_as_friction_lets_it(tmp_path, shape, on):
    """a = g (sin - mu cos); below atan(mu) it stays."""
    for slope in (0.2, 0.6):
        gravity = (G * math.sin(slope), 0.0, -G * math.cos(slope))
        cg = (0.05, 0.05, -0.04) if shape == "angle" else (0.0, 0.0, -0.04)
        if on == "plane":
            results = run(tmp_path, [body(2, shape, 0.05, cg=cg)], [(200, 100)], 0.1, gravity)
            number = 2
        else:
            held = body(2, "box", 0.05).replace('mass="2"', 'mass="1e9"')
            bodies = [held, body(3, shape, 0.15, cg=cg, at=(-0.05, -0.05))]
            pairs = [(300, 200)]
            joint = (
                '<Constraint_Joint id="1" type="FIXED" i_marker_id="20" j_marker_id="29"/>'
                '<Reference_Marker id="29" body_id="1" pos_z="0.05"/>'
            )
            results = run(tmp_path, [*bodies, joint], pairs, 0.1, gravity)
            number = 3
        way = max(0.0, G * (math.sin(slope) - 0.3 * math.cos(slope)) * 0.1**2 / 2.0)
        assert moved(results, number)[0] == pytest.approx(way, abs=2e-6)
