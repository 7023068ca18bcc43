"""Stacks of boxes put down touching on a slope, STICTION: they come to rest, in few steps.

All boxes fall together at first: the upper ones press each other by what they have been slowed, so
that normal forces go from rounding to the weight, box by box.
"""

from __future__ import annotations

import math
import re

import numpy as np
import pytest
import trimesh

from helpers.decks import contact, run_deck
from helpers.surfaces import mesh_graphic

G = 9.81


def stack(count, edge, mass, tilt, **law):
    """Return boxes of one size on each other, just touching, and gravity that is tilted."""
    inertia = mass * edge**2 / 6.0
    text = f"""
<Body_Rigid id="1" isground="TRUE"/><Reference_Marker id="10" body_id="1"/>
<Post_Graphic id="100" type="Plane" rm_id="10"/>
<Force_Gravity grav_x="{G * math.sin(tilt)!r}" grav_z="{-G * math.cos(tilt)!r}"/>"""
    for k in range(count):
        id = k + 2
        text += f"""
<Body_Rigid id="{id}" cg_id="{id}0" mass="{mass!r}" inertia_xx="{inertia!r}"
  inertia_yy="{inertia!r}" inertia_zz="{inertia!r}"/>
<Reference_Marker id="{id}0" body_id="{id}" pos_z="{(k + 0.5) * edge!r}"/>
<Post_Graphic id="{id}00" type="BoxDefinedFromCenter" center_marker_id="{id}0"
  length_x="{edge!r}" length_y="{edge!r}" length_z="{edge!r}"/>"""
        text += contact(
            i=100 * id,
            j=100 * id - 100,
            id=301 + k,
            dmax=1e-5,
            cff_type="STICTION",
            mu_dynamic=law["mu_static"],
            **law,
        )
    return text


def rigid(k, e, c, mu):
    """Return the law of a stack whose friction has no give."""
    return {
        "stiffness": k,
        "exponent": e,
        "damping": c,
        "mu_static": mu,
        "tangential_stiffness": "INFINITE",
    }


CASES = [
    # corners of boxes that rock pass edges to and fro
    ("RADAU5", 1e-4, (5, 0.3, 1.0, 0.1), (3431300.0, 1.5, 280.285, 0.203), 0.3363, 150),
    # what has just touched asked for slip, and nothing was let go
    ("AUTO", 1e-3, (6, 0.1, 1.0, 0.334), (39300000.0, 1.5, 645.687, 1.009), 0.146, 200),
    ("GALPHA", 1e-4, (6, 0.1, 1.0, 0.321), (7503900.0, 1.3, 681.439, 0.926), 0.1383, 800),
    # what was let go moved otherwise once the rest was held, and went back at once
    ("GALPHA", 1e-4, (3, 0.1, 0.5, 0.116), (565600.0, 1.5, 88.885, 0.197), 0.5302, 700),
    # one corner was counted twice in every other step
    ("AUTO", 1e-3, (6, 0.2, 1.0, 0.33), (180700.0, 1.0, 4.251, 0.697), 0.05, 600),
    # a corner lifts while it sticks
    ("RADAU5", 1e-6, (3, 0.1, 1.0, 0.298), (22047200.0, 1.1, 499.024, 0.911), 0.01, 600),
    ("AUTO", 1e-5, (3, 0.2, 1.0, 0.2), (1e5, 1.0, 100.0, 0.5), 0.5, 250),
    # edges next to parallel crossed with a normal across the faces, and the box was held along that
    ("AUTO", 1e-3, (4, 0.1, 0.5, 0.232), (141300.0, 1.3, 4.619, 0.315), 0.09, 250),
    # the row of another corner became a corner, and that was held at the middle of the box
    ("AUTO", 1e-3, (5, 0.1, 0.5, 0.261), (243100.0, 1.5, 3.635, 0.769), 0.14, 350),
]


def of_meshes(text, which):
    """Return a deck in which boxes, by where they are in the stack, are meshes of the same size."""
    for k in which:
        id = k + 2
        found = re.search(
            rf'<Post_Graphic id="{id}00" type="Box\w+" center_marker_id="(\d+)"\s+'
            r'length_x="([^"]+)"[^>]*/>',
            text,
        )
        cube = trimesh.creation.box((float(found[2]),) * 3)
        made = mesh_graphic(100 * id, int(found[1]), cube.vertices, cube.faces)
        text = text.replace(found[0], made)
    return text


#: Which are meshes; the rest are boxes.
MESHES = [(2, (0, 1)), (2, (0,)), (2, (1,)), (3, (0, 2))]


@pytest.mark.parametrize(("count", "which"), MESHES)
def test_a_stack_of_meshes_is_one_of_boxes(count, which, tmp_path):
    """With little damping their corners rock for long."""
    boxes = stack(count, 0.2, 1.0, 0.1, **rigid(1e6, 1.0, 2.0, 0.5))
    ends = []
    for text in (boxes, of_meshes(boxes, which)):
        results = run_deck(tmp_path, text, 0.03, 0.01, integrator="AUTO", tol=1e-4)
        assert results["time"][-1] == pytest.approx(0.03)
        assert results.stats["steps"] < 150 * count
        ends.append(np.array([results[f"bodies/{k + 2}/position"][-1] for k in range(count)]))
    np.testing.assert_allclose(ends[1], ends[0], rtol=0, atol=2e-6)


@pytest.mark.parametrize(("method", "tol", "boxes", "law", "end", "steps"), CASES)
def test_a_stack_on_a_slope_needs_few_steps(method, tol, boxes, law, end, steps, tmp_path):
    model = stack(*boxes, **rigid(*law))
    results = run_deck(tmp_path, model, end, end / 50.0, integrator=method, tol=tol)
    assert results["time"][-1] == pytest.approx(end)
    assert results.stats["steps"] < steps


@pytest.mark.parametrize("which", [(), (1, 2)])
def test_what_has_just_touched_is_not_said_to_be_above_its_cone(which, tmp_path):
    """It is held by 1e-9 of what presses most, though less presses: friction was 1 above mu N."""
    boxes = stack(3, 0.1, 1.0, 0.1, **rigid(1e6, 1.5, 500.0, 0.4))
    results = run_deck(tmp_path, of_meshes(boxes, which), 0.005, 0.001, integrator="AUTO", tol=1e-4)
    assert results.audit.warnings == ()
