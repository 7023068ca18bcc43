"""A mesh that is not convex stands: on a plane, on a box, with explicit and implicit methods."""

from __future__ import annotations

import pytest

from helpers.decks import run_deck
from helpers.surfaces import GROUND, IMPACT, angle_on_ground

SLAB = (
    '<Post_Graphic id="100" type="BoxDefinedFromCenter" center_marker_id="11" '
    'length_x="2" length_y="2" length_z="0.2"/>'
)
#: 1 kg on k d^1.5 with k = 1e6 N/m^1.5.
SAG = (9.81 / 1e6) ** (2.0 / 3.0)


@pytest.mark.parametrize(
    ("ground", "method"), [(GROUND, "DOPRI5"), (GROUND, "RADAU5"), (SLAB, "DOPRI5")]
)
def test_an_angle_stands(ground, method, tmp_path):
    run = run_deck(
        tmp_path, angle_on_ground(0.0501, IMPACT, ground), end_time=0.6, integrator=method
    )
    assert run.statistics["fcl_calls"] == 0
    assert abs(run.bodies.angular_velocity[-1]).max() < 1e-3
    assert run.contacts.force[-1, 0, 2] == pytest.approx(9.81, rel=1e-3)
    assert run.contacts.penetration[-1, 0] == pytest.approx(SAG, rel=0.02)
    assert run.contacts.area[-1, 0] == pytest.approx(0.03, rel=1e-3)
    assert run.contacts.incidents[-1, 0] == 1
