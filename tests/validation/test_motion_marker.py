"""Motion_Marker: motions between two markers, each direction against what it says."""

from __future__ import annotations

import numpy as np
import pytest

from helpers import free_bodies as free
from helpers.minimal_deck import added, read
from mbsim.errors import DeckError
from mbsim.expressions.parse import parse
from mbsim.model.elements import Marker, Motion


def moved(direction, val_type, text, ic_disp=None, w=(0, 0, 0)):
    """Run a free body whose marker 21 is moved along or about the axes of ground's marker 11."""
    at = (0.2, -0.1, 0.3)
    body = free.body(2, 1.5, p=at, w=w)
    markers = [Marker(21, body_id=2, pos=at, R=free.TILTED), Marker(11, body_id=1, R=free.TILTED)]
    motion = Motion(1, "", None, 21, 11, direction, val_type, parse(text), ic_disp)
    return free.run(free.model(body, markers=markers, motions=[motion], end_time=1.0))[0]


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_point_moves_along_an_axis_of_j(axis):
    start = float(np.array((0.2, -0.1, 0.3)) @ free.TILTED[:, axis])
    rows = moved("XYZ"[axis], "D", f"{start!r}+0.5*TIME**2".replace("+-", "-"))
    x = rows["y"][:, :3] @ free.TILTED
    np.testing.assert_allclose(x[:, axis], start + 0.5 * rows["time"] ** 2, atol=1e-9)
    np.testing.assert_allclose(np.delete(x - x[0], axis, axis=1), 0.0, atol=1e-12)
    # the motion's force is that of a mass which is accelerated by 1
    np.testing.assert_allclose(rows["joint"][:, :3], 1.5 * free.TILTED[:, axis] + 0 * x, atol=1e-8)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_body_turns_about_an_axis_of_j(axis):
    rows = moved(f"B{axis + 1}", "V", "2*TIME")
    np.testing.assert_allclose(rows["y"][:, 3], np.cos(rows["time"] ** 2 / 2), atol=1e-8)
    turned = rows["y"][:, 4:7] @ free.TILTED
    np.testing.assert_allclose(turned[:, axis], np.sin(rows["time"] ** 2 / 2), atol=1e-8)


MOTION = '<Motion_Marker id="3" i_marker_id="20" j_marker_id="10" '


def test_a_deck_gives_motions_between_markers(tmp_path):
    text = added(f'{MOTION} direction="b2" val_type="A" expr="SIN(TIME)" ic_vel="2"/>')
    motion = read(tmp_path, text).motions[3]
    assert (motion.statement, motion.joint_id, motion.direction) == ("Motion_Marker", None, "B2")
    assert (motion.i_marker_id, motion.j_marker_id, motion.ic_vel) == (20, 10, 2.0)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (f'{MOTION} val_type="D" expr="1"/>', "direction: missing"),
        (f'{MOTION} direction="R" val_type="D" expr="1"/>', "must be one of X, Y, Z, B1, B2, B3"),
        (f'{MOTION} direction="X" val_type="D"/>', "Motion_Marker[3]: expr: missing"),
        (f'{MOTION} direction="X" val_type="D" expr="VX(20)"/>', "Motion_Marker[3]: expr="),
        (f'{MOTION.replace("10", "77")} direction="X" val_type="D" expr="1"/>', 'id="77": no'),
        (
            '<Motion_Joint id="3" joint_id="1" val_type="D" expr="0"/>'
            f'{MOTION} direction="X" val_type="D" expr="1"/>',
            "already used by a Motion_Joint",
        ),
    ],
)
def test_what_is_wrong_with_a_motion_is_said(tmp_path, text, said):
    with pytest.raises(DeckError) as error:
        read(tmp_path, added(text))
    assert said in str(error.value)
