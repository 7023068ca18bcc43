"""Solids that come to rest: where FCL and the closed forms agree, and where FCL has one point."""

from __future__ import annotations

from pathlib import Path

import pytest

import mbsim
from helpers.decks import GRAVITY, GROUND, contact, write_deck

pytest.importorskip("fcl", reason="python-fcl is not there")

K, WEIGHT = 1e5, 9.81
BOX_GROUND = """<Body_Rigid id="1" isground="TRUE"/>
<Reference_Marker id="10" body_id="1" pos_z="-0.1"/>
<Post_Graphic id="100" type="BoxDefinedFromCenter" center_marker_id="10"
  length_x="1" length_y="1" length_z="0.2"/>"""
DRUM = """<Body_Rigid id="1" isground="TRUE"/>
<Reference_Marker id="10" body_id="1" pos_z="-0.2"/>
<Post_Graphic id="100" type="Cylinder" center_marker_id="10" radius="0.3" length="0.2"/>"""
BALL = ('type="Sphere" radius="0.1"', 0.1)
EGG = ('type="Ellipsoid" x_scale="0.1" y_scale="0.08" z_scale="0.06"', 0.06)
BOX = ('type="BoxDefinedFromCenter" length_x="0.2" length_y="0.2" length_z="0.1"', 0.05)
# these two begin at their marker
POST = ('type="Cylinder" radius="0.1" length="0.1"', 0.0)
CONE = ('type="Frustum" bottom_radius="0.1" top_radius="0.06" length="0.1"', 0.0)


def rest(folder, ground, solid, detector):
    """Return how deep a solid of 1 kg is after it was put down, and the log's words on the pair."""
    shape, up = solid
    model = (
        ground
        + GRAVITY
        + f"""
<Reference_Marker id="20" body_id="2" pos_z="0.0501"/>
<Reference_Marker id="21" body_id="2" pos_z="{up + 1e-4!r}"/>
<Body_Rigid id="2" cg_id="20" mass="1" inertia_xx="0.004" inertia_yy="0.004" inertia_zz="0.004"/>
<Post_Graphic id="200" {shape} center_marker_id="21"/>"""
        + contact(stiffness=K, exponent=1.0, damping=300.0, dmax=1e-6)
    )
    path = write_deck(folder, model, 0.1, 0.02)
    out = Path(folder) / detector
    results = mbsim.simulate(mbsim.read_model(path), detector=detector, output=out, tol=1e-6)
    log = "".join(file.read_text(encoding="utf-8") for file in out.parent.glob(f"{detector}*.log"))
    log += "".join(file.read_text(encoding="utf-8") for file in out.glob("*.log"))
    return 0.0501 - 1e-4 - results["bodies/2/position"][-1, 2], log


@pytest.mark.parametrize(
    ("ground", "solid", "exact", "by_fcl"),
    [
        (GROUND, BALL, 1, 1), (GROUND, EGG, 1, 1), (GROUND, BOX, 4, 4), (BOX_GROUND, BALL, 1, 1),
        (BOX_GROUND, BOX, 4, 4), (DRUM, BALL, 1, 1), (GROUND, POST, 3, 1), (GROUND, CONE, 3, 1),
        (BOX_GROUND, POST, 3, 1), (DRUM, BOX, 4, 1), (DRUM, POST, 3, 1),
    ],
)  # fmt: skip
def test_the_depth_at_rest_is_the_weight_over_the_points(tmp_path, ground, solid, exact, by_fcl):
    for detector, points in (("auto", exact), ("fcl", by_fcl)):
        depth, log = rest(tmp_path, ground, solid, detector)
        # what has not yet settled in 0.1 s, of which 2 m/c is 1/15
        assert depth == pytest.approx(WEIGHT / (points * K), rel=1e-3)
        assert ("one point" in log) == (points != exact)
