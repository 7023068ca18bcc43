"""Fast bodies and thin walls of meshes: thrown back, or told of with time and element.

The worst case is a wall of the mesh that a body touches already: the pair is in touch, so nothing
is measured of what lies ahead but by its motion bound (`geometry.mesh.motion`).
"""

from __future__ import annotations

import pytest
import trimesh

from helpers.decks import GROUND, run_deck

METHODS = ["AUTO", "RADAU5", "GALPHA", "DOPRI5", "DOP853", "VERLET"]
#: A floor, and at x = 0.3 a wall on it, 0.1 m high and 2 mm thick: corners (x, z) of its section.
SECTION = [(-1, -0.05), (0.302, -0.05), (0.302, 0), (0.302, 0.1), (0.3, 0.1), (0.3, 0), (-1, 0)]
PARTS = [(0, 1, 5), (0, 5, 6), (1, 2, 5), (2, 3, 4), (2, 4, 5)]
BALL = '<Post_Graphic id="200" type="Sphere" center_marker_id="20" radius="0.01"/>'


def tray():
    n = len(SECTION)
    nodes = [(x, y, z) for y in (-0.2, 0.2) for x, z in SECTION]
    faces = [face for a, b, c in PARTS for face in ((a, b, c), (n + a, n + c, n + b))]
    for k in range(n):
        j = (k + 1) % n
        faces += [(k, n + k, j), (j, n + k, n + j)]
    return mesh(100, 10, nodes, faces)


def mesh(id, marker, nodes, faces):
    numbers = " ".join(repr(float(x)) for p in nodes for x in p)
    corners = " ".join(str(int(k)) for face in faces for k in face)
    return (
        f'<Post_Graphic id="{id}" type="TriaMesh" rm_id="{marker}"><Nodes>{numbers}</Nodes>'
        f"<Faces>{corners}</Faces></Post_Graphic>"
    )


def ring():
    made = trimesh.creation.torus(0.03, 0.01, 24, 12)
    return mesh(200, 20, made.vertices, made.faces)


def run(shape, speed, stiffness, method, folder):
    """Slide a body of 1 kg over the floor, which it touches, at the wall."""
    deck = (
        GROUND.partition('<Post_Graphic id="100"')[0]
        + '<Body_Rigid id="2" cg_id="20" mass="1" inertia_xx="0.006" inertia_yy="0.006" '
        f'inertia_zz="0.011" v_ic_x="{speed}" v_ic_x_flag="TRUE"/>'
        '<Reference_Marker id="20" body_id="2" pos_z="0.009999"/>'
        + shape
        + tray()
        + '<Force_Contact id="301" i_graphics_id="200" j_graphics_id="100" cnf_type="IMPACT" '
        f'stiffness="{stiffness}" exponent="1.5" damping="0"/>'
    )
    run = run_deck(folder, deck, 0.6 / speed, 0.06 / speed, integrator=method)
    told = [line for line in run.audit.warnings if "too deep into each other" in line]
    return run, told


def assert_told(run, told, speed):
    assert run["bodies/2/position"][-1, 0] > 0.3
    (line,) = told
    assert line.startswith("Post_Graphic[200] of Body_Rigid[2] and Post_Graphic[100] of Body_Rigid")
    since = float(line.partition("first at time ")[2].split()[0])
    assert 0.23 < since * speed < 0.35


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("speed", [3.0, 10.0, 400.0])
def test_a_ball_that_a_wall_cannot_hold_is_told(speed, method, tmp_path):
    # 100 N/m^1.5 over the wall hold back 4e-6 J
    assert_told(*run(BALL, speed, 100.0, method, tmp_path), speed)


@pytest.mark.parametrize("method", METHODS)
def test_a_ring_that_a_wall_cannot_hold_is_told(method, tmp_path):
    assert_told(*run(ring(), 30.0, 100.0, method, tmp_path), 30.0)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(("speed", "stiffness"), [(1.0, 1e9), (10.0, 1e11)])
def test_a_ball_that_a_wall_holds_is_thrown_back(speed, stiffness, method, tmp_path):
    result, told = run(BALL, speed, stiffness, method, tmp_path)
    assert told == []
    assert result["bodies/2/velocity"][-1, 0] == pytest.approx(-speed, rel=1e-2)
