"""Convex meshes of more than 512 edges: nothing falls through them."""

from __future__ import annotations

import numpy as np
import pytest

import mbsim
from mbsim.geometry.hull_overlap import Solid, hull_of, least_overlap
from mbsim.geometry.mesh_surface import Surface

RADIUS, STIFFNESS, MASS, WEIGHT = 0.3, 1e5, 1.0, 9.81


def ball(rings=16, sectors=24):
    """Return nodes and faces of a ball between circles of latitude, its poles at +-z."""
    nodes = [(0.0, 0.0, RADIUS)]
    for k in range(1, rings):
        a = np.pi * k / rings
        for b in 2.0 * np.pi * np.arange(sectors) / sectors:
            nodes.append(
                RADIUS * np.array([np.sin(a) * np.cos(b), np.sin(a) * np.sin(b), np.cos(a)])
            )
    nodes.append((0.0, 0.0, -RADIUS))
    faces = []
    last = len(nodes) - 1
    for s in range(sectors):
        t = (s + 1) % sectors
        faces.append((0, 1 + s, 1 + t))
        for k in range(rings - 2):
            a, b = 1 + k * sectors, 1 + (k + 1) * sectors
            faces += [(a + s, b + s, b + t), (a + s, b + t, a + t)]
        b = 1 + (rings - 2) * sectors
        faces.append((b + s, last, b + t))
    return nodes, faces


@pytest.mark.parametrize("shape", ["Sphere", "Ellipsoid"])
def test_a_body_rests_on_the_pole_of_a_fine_ball(tmp_path, shape):
    nodes, faces = ball()
    rows = [
        "\n".join(" ".join(f"{x!r}" for x in map(kind, row)) for row in table)
        for table, kind in ((nodes, float), (faces, int))
    ]
    size = 'radius="0.3"' if shape == "Sphere" else 'x_scale="0.3" y_scale="0.3" z_scale="0.3"'
    deck = tmp_path / "rest.xml"
    deck.write_text(f"""<MotionSolve><Model>
      <Force_Gravity grav_z="-9.81"/>
      <Body_Rigid id="1" isground="TRUE"/>
      <Body_Rigid id="2" cg_id="20" mass="1"
        inertia_xx="0.04" inertia_yy="0.04" inertia_zz="0.04"/>
      <Reference_Marker id="10" body_id="1"/>
      <Reference_Marker id="20" body_id="2" pos_z="0.601"/>
      <Post_Graphic id="1" type="TriaMesh" rm_id="10">
        <Nodes>{rows[0]}</Nodes><Faces>{rows[1]}</Faces></Post_Graphic>
      <Post_Graphic id="2" type="{shape}" center_marker_id="20" {size}/>
      <Force_Contact id="1" num_i_graphics="1" i_graphics_id="2" num_j_graphics="1"
        j_graphics_id="1"
        cnf_type="IMPACT" stiffness="1e5" exponent="1.5" damping="150" dmax="1e-4"/>
    </Model><Command>
      <Simulate analysis_type="Transient" end_time="0.4" print_interval="0.05"/>
    </Command></MotionSolve>""")
    results = mbsim.simulate(mbsim.read_model(deck))
    assert results.stats["fcl_calls"] == 0
    depth = (MASS * WEIGHT / STIFFNESS) ** (2.0 / 3.0)
    height = results["bodies/2/position"][-1]
    assert height[2] == pytest.approx(0.6 - depth, abs=0.02 * depth)
    # balanced on a point
    np.testing.assert_allclose(height[:2], 0.0, atol=1e-5)


@pytest.mark.parametrize("gap", [1e-3, 1e-6, 0.0, -1e-6, -1e-3])
def test_an_ellipsoid_meets_a_vertex_where_it_reaches_it(gap):
    """A vertex's normal, between those of its faces, is the ellipsoid's at the nearest point."""
    nodes, faces = ball()
    surface = Surface(np.array(nodes, float), np.array(faces), True)
    hull = hull_of(surface.vertices, surface.faces, surface.normals, surface.beside)
    rng = np.random.default_rng(4)
    for size in ([0.3, 0.3, 0.3], [0.1, 0.2, 0.4]):
        for k in (0, 1, 150, 190, len(nodes) - 1):
            n = surface.normals[(surface.faces == k).any(axis=1)].sum(axis=0)
            n /= np.linalg.norm(n)
            axes, _ = np.linalg.qr(rng.normal(size=(3, 3)))
            half = np.linalg.norm(axes.T @ n * size)
            lowest = -axes @ (np.square(size) * (axes.T @ n)) / half
            centre = surface.vertices[k] + gap * n - lowest
            f, way = least_overlap(hull, Solid("ELLIPSOID", np.array(size), centre, axes))
            if gap > 0.0:
                # apart by `gap`: some direction parts them, and none by more than that
                assert -gap - 1e-12 <= f < 0.0
            else:
                # the support points' rounding is 1e-16
                assert f == pytest.approx(-gap, abs=1e-12)
                np.testing.assert_allclose(way, n, atol=1e-6)
