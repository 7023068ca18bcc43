"""An end that a face's edges only touch: a cylinder as wide as the block it stands on.

Which of the edges cut a rim that they touch is decided by rounding, and so is which way an upright
end is tilted. Neither may move what carries.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import mbsim
from helpers.pairs import candidates, frame, turned
from mbsim.bench import deck as text
from mbsim.bench.parameters import GRAVITY
from mbsim.geometry.catalog import AT_DEPTH, AT_NORMAL, AT_POINT, AT_WEIGHT

RADIUS, HALF, DEPTH = 0.1, 0.05, 1e-5
SIZES = {
    "CYLINDER": np.array([RADIUS, HALF, 0.0]),
    "FRUSTUM": np.array([RADIUS, 0.8 * RADIUS, HALF]),
    "BOX": np.array([RADIUS, RADIUS, HALF]),
}


def carried(solid: str, offset: np.ndarray, yaw: float, tilt: np.ndarray) -> np.ndarray:
    """Return force, and torque over the radius, for a stiffness of 1 of a solid on a block."""
    turn = turned((0.0, 0.0, 1.0), yaw)
    angle = float(np.linalg.norm(tilt))
    turn = turned((*tilt, 0.0), angle) @ turn if angle > 0.0 else turn
    i = frame(np.array([*offset, 2.0 * HALF - DEPTH]), turn)
    count, rows = candidates(f"{solid}-BOX", i, frame(np.zeros(3), np.eye(3)), SIZES)
    rows = rows[:count][rows[:count, AT_DEPTH] > 0.0]
    forces = (rows[:, AT_WEIGHT] * rows[:, AT_DEPTH])[:, None] * rows[:, AT_NORMAL : AT_NORMAL + 3]
    torque = np.cross(rows[:, AT_POINT : AT_POINT + 3], forces).sum(axis=0)
    return np.concatenate([forces.sum(axis=0), torque / RADIUS])


@pytest.mark.parametrize("solid", ["CYLINDER", "FRUSTUM"])
@pytest.mark.parametrize("way", [0.0, 1e-12, 1e-9, 1e-6, 1e-4, 1e-3, 1e-2])
def test_roundings_of_the_pose_move_no_force(solid: str, way: float) -> None:
    rng = np.random.default_rng(1)
    for yaw in (0.0, 0.3):
        offset = way * np.array([1.0, 0.5])
        found = carried(solid, offset, yaw, np.zeros(2))
        # 3 of the depth; a part of the rim in place of which there are corners has up to 4
        assert 3.0 - 1e-5 < found[2] / DEPTH < 3.3
        for small in (1e-16, 1e-14, 1e-12, 1e-10):
            for _ in range(20):
                push, tilt = small * rng.normal(size=2), 10.0 * small * rng.normal(size=2)
                near = carried(solid, offset + push, yaw, tilt)
                # how much of a rim an edge cuts off grows with the root of how far it is beyond it
                most = 30.0 * small / DEPTH + 3.0 * np.sqrt(2.0 * small / RADIUS) + 1e-9
                assert np.abs(near - found).max() < most * found[2]


@pytest.mark.parametrize("way", [0.0, 1e-9, 1e-6, 1e-4])
def test_a_cylinder_on_a_block_as_wide_takes_few_steps(tmp_path: Path, way: float) -> None:
    """It took up to 11,659 steps, now 20 to 23."""
    law = text.impact(1e6, 1.0, 3e3, 1e-5) | text.coulomb(0.5, 1e-3)
    place = (way, 2.0 * way, 3.0 * HALF)
    size = text.attributes(type="Cylinder", radius=RADIUS, length=2.0 * HALF)
    parts = [text.GROUND, text.FLOOR]
    parts += [text.cuboid(2, 1.0, (2.0 * RADIUS, 2.0 * RADIUS, 2.0 * HALF), (0.0, 0.0, HALF))]
    parts += [text.body(3, 1.0, (3e-3, 3e-3, 5e-3), place)]
    parts += [text.marker(31, 3, (way, 2.0 * way, 2.0 * HALF))]
    parts += [f'<Post_Graphic id="300" center_marker_id="31" {size}/>']
    parts += [text.contact(301, [200], [100], **law), text.contact(302, [300], [200], **law)]
    path = tmp_path / "block.xml"
    path.write_text(text.deck("block", [*parts, text.gravity()], 0.03), encoding="utf-8")
    results = mbsim.simulate(str(path), integrator="RADAU5")
    assert results.stats["steps"] < 60
    assert results["contacts/302/force"][-1, 2] == pytest.approx(GRAVITY, rel=1e-3)
