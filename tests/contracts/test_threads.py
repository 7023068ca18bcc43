"""A nut on the thread of its bolt: pushed along it or turned on it, it is pushed back."""

from __future__ import annotations

import numpy as np
import pytest

from helpers.pairs import frame, turned
from helpers.surfaces import call
from helpers.threads import bolt, nut
from mbsim.compile_model.surfaces import packed
from mbsim.geometry.catalog import REGION_ROWS
from mbsim.model.elements import Graphic
from mbsim.model.mesh import solid_fault

PITCH, GAP = 1.5, 0.1
#: What the nut may move along the bolt: the gap across flanks of 30 degrees.
PLAY = GAP * np.tan(np.pi / 6)
BOLT = bolt(10.0, PITCH, -4.5, 4.5, 18)
NUT = nut(10.0, PITCH, -2.0, 2.0, 18, 8.5, GAP)
SAME = frame(np.zeros(3), np.eye(3))


@pytest.fixture(scope="module")
def sides():
    made = []
    for vertices, faces in (NUT, BOLT):
        assert solid_fault(vertices, faces) == ""
        data = packed(Graphic(id=1, shape="MESH", vertices=vertices, faces=faces), layered=True)
        made.append((data, np.array([0.0, 0.0, 0.0, data.ctypes.data])))
    return made


def axial(pair, sides, z, turn=0.0):
    """Return the force along the bolt per unit of stiffness at a nut's height and angle."""
    at = frame([0.0, 0.0, z], turned((0, 0, 1), turn))
    first = call(pair, at, sides[0][1], SAME, sides[1][1])[::REGION_ROWS]
    first = first[first[:, 0] > 0.0]
    return float((first[:, 0] * first[:, 7]) @ first[:, 6])


@pytest.mark.parametrize("pair", ["SURFACE-SURFACE", "FIELD-FIELD"])
@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_what_pushes_a_nut_along_its_bolt_is_pushed_back(pair, side, sides):
    assert axial(pair, sides, 0.0) == 0.0
    assert axial(pair, sides, side * 0.9 * PLAY) == 0.0
    forces = [-side * axial(pair, sides, side * (PLAY + d)) for d in (0.003, 0.01, 0.03)]
    assert 0.0 < forces[0] < forces[1] < forces[2]
    # the field has a force for every part of the flanks; of depths that stand out there are fewer
    # the deeper the nut is
    assert pair == "SURFACE-SURFACE" or forces[2] > 2.0 * forces[1] > 4.0 * forces[0]


@pytest.mark.parametrize("pair", ["SURFACE-SURFACE", "FIELD-FIELD"])
@pytest.mark.parametrize("notches", [1, 5, 9])
def test_a_nut_that_turns_goes_along_by_its_pitch(pair, notches, sides):
    # by whole notches of the mesh, so that corners meet again as they did
    turn = 2.0 * np.pi * notches / 18
    on = PITCH * notches / 18
    assert axial(pair, sides, on, turn) == 0.0
    assert (
        axial(pair, sides, on + PLAY + 0.01, turn)
        < 0.0
        < axial(pair, sides, on - PLAY - 0.01, turn)
    )
