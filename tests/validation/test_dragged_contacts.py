"""STICTION without give where joints hold a body on a belt that begins to move across.

The equation of what sticks follows from those of joints and motions there, and while the belt
stands they agree. It went on to stick, without a force, when the belt had 0.5 m/s.
"""

from __future__ import annotations

import numpy as np
import pytest

import mbsim
from mbsim.bench import deck as text
from mbsim.bench.parameters import GRAVITY

#: Axes whose z is the global y, as joints along the belt have them.
ALONG_Y = [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]]
LEVEL = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
MU = 0.4
SHAPES = {
    "Sphere": {"radius": 0.1},
    "BoxDefinedFromCenter": {"length_x": 0.2, "length_y": 0.2, "length_z": 0.2},
}


def dragged(shape: str, joint: str, speed: float, method: str) -> mbsim.results.Results:
    """Return a body that starts along x, held by a joint, on a belt that swings along y."""
    law = {
        **text.impact(1e6, 1.0, 2000.0, 1e-5),
        "cff_type": "STICTION",
        "mu_static": 0.5,
        "mu_dynamic": MU,
        "tangential_stiffness": "INFINITE",
    }
    place = (0.0, 0.0, 0.1 - GRAVITY / 1e6 / (1.0 if shape == "Sphere" else 4.0))
    axes = ALONG_Y if joint == "PLANAR" else LEVEL
    parts = [
        text.GROUND,
        text.body(2, 10.0, (1.0, 1.0, 1.0)),
        text.marker(11, 1, (0.0, 0.0, 0.0), ALONG_Y),
        text.marker(21, 2, (0.0, 0.0, 0.0), ALONG_Y),
        text.joint(1, "TRANSLATIONAL", 21, 11),
        '<Motion_Joint id="1" joint_id="1" motion_type="T" val_type="V" expr="0.5*SIN(10*TIME)"/>',
        '<Post_Graphic id="200" type="Plane" rm_id="20"/>',
        text.body(3, 1.0, (0.01, 0.01, 0.01), place, (speed, 0.0, 0.0)),
        text.marker(12, 1, place, axes),
        text.marker(31, 3, place, axes),
        text.joint(2, joint, 31, 12),
        f'<Post_Graphic id="300" type="{shape}" center_marker_id="30" '
        f"{text.attributes(**SHAPES[shape])}/>",
        text.contact(301, [300], [200], **law),
        text.gravity(),
    ]
    return mbsim.simulate(text.deck("dragged", parts, 0.6), integrator=method, tol=1e-6)


@pytest.mark.parametrize("method", ["RADAU5", "GALPHA"])
@pytest.mark.parametrize("shape", list(SHAPES))
@pytest.mark.parametrize(("joint", "speed"), [("PLANAR", 0.3), ("TRANSLATIONAL", 0.0)])
def test_what_cannot_go_with_a_belt_slips_on_it(shape, joint, speed, method) -> None:
    """Friction of mu_d N is against the whole slip, and turns round with the belt."""
    results = dragged(shape, joint, speed, method)
    assert results.audit.warnings == ()
    t, force = results["time"][2:], results["contacts/301/force"][2:]
    slip = np.zeros((len(t), 2))
    slip[:, 0] = results["bodies/3/velocity/x"][2:]
    if shape == "Sphere":
        slip[:, 0] -= 0.1 * results["bodies/3/angular_velocity/y"][2:]
    slip[:, 1] = -0.5 * np.sin(10.0 * t)
    wanted = -MU * force[:, 2:] * slip / np.linalg.norm(slip, axis=1)[:, None]
    # but where a row is as the belt turns
    turns = np.abs(slip[:, 1]) < 0.01
    assert np.count_nonzero(turns) <= 2
    assert force[~turns, :2] == pytest.approx(wanted[~turns], abs=2e-3 * GRAVITY)
    assert results["motions/1/force"][-1, 1] == pytest.approx(
        10.0 * 5.0 * np.cos(6.0) + force[-1, 1], abs=2e-3 * GRAVITY
    )
