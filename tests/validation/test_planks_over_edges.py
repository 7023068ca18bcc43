"""A plank on two edges of boxes is one on a slope: it slips where the slope is above mu.

Its face presses across itself, far from any side of the boxes.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
import trimesh

from helpers.decks import contact, run_deck
from helpers.surfaces import mesh_graphic

G = 9.81
APART, THICK, SIDE = 0.3, 0.05, 0.1
END = 0.2


def shape(kind, id, marker, edges):
    """Return a box, or a mesh of the same size."""
    if kind == "MESH":
        box = trimesh.creation.box(edges)
        return mesh_graphic(id, marker, box.vertices, box.faces)
    x, y, z = edges
    return (
        f'<Post_Graphic id="{id}" type="BoxDefinedFromCenter" center_marker_id="{marker}" '
        f'length_x="{x}" length_y="{y}" length_z="{z}"/>'
    )


def plank(kinds, angle, mu, swapped):
    """Return a plank of 1 kg, sunk as far as its weight will; x is up the slope."""
    s, c = math.sin(angle), math.cos(angle)
    text = f'<Body_Rigid id="1" isground="TRUE"/><Force_Gravity grav_z="{-G}"/>'
    for id, way in ((11, -APART), (12, APART)):
        # the edge is the upper left one
        x, z = way * c + 0.5 * SIDE, way * s - 0.5 * SIDE
        text += f'<Reference_Marker id="{id}" body_id="1" pos_x="{x!r}" pos_z="{z!r}"/>'
        text += shape(kinds[1], 10 * id, id, (SIDE, 0.4, SIDE))
    high = 0.5 * THICK - G * c / 4e6
    text += (
        '<Body_Rigid id="2" cg_id="20" mass="1" inertia_xx="0.001" inertia_yy="0.08" '
        'inertia_zz="0.08"/><Reference_Marker id="20" body_id="2" '
        f'pos_x="{-s * high!r}" pos_z="{c * high!r}" a00="{c!r}" a10="0" a20="{s!r}" a01="0" '
        f'a11="1" a21="0" a02="{-s!r}" a12="0" a22="{c!r}"/>'
    ) + shape(kinds[0], 200, 20, (1.0, 0.1, THICK))
    for k, id in enumerate((110, 120)):
        i, j = (id, 200) if swapped else (200, id)
        text += contact(
            i=i,
            j=j,
            id=301 + k,
            exponent=1.0,
            stiffness=1e6,
            damping=1e3,
            dmax=1e-6,
            cff_type="STICTION",
            mu_static=mu,
            mu_dynamic=mu,
            tangential_stiffness="INFINITE",
        )
    return text


@pytest.mark.parametrize("kinds", [("BOX", "BOX"), ("MESH", "BOX"), ("BOX", "MESH")])
@pytest.mark.parametrize("degrees", [30.0, 60.0])
def test_a_plank_over_two_edges(kinds, degrees, tmp_path):
    angle = math.radians(degrees)
    for swapped in (False, True):
        for part in (0.98, 1.02):
            mu = part * math.tan(angle)
            text = plank(kinds, angle, mu, swapped)
            results = run_deck(tmp_path, text, END, 0.1, integrator="RADAU5", tol=1e-6)
            assert results.stats["steps"] < 100
            way = np.diff(results["bodies/2/position"][[0, -1]], axis=0)[0]
            along = way @ [math.cos(angle), 0.0, math.sin(angle)]
            pull = G * max(0.0, math.sin(angle) - mu * math.cos(angle))
            assert along == pytest.approx(-0.5 * pull * END**2, rel=1e-3, abs=1e-7)
