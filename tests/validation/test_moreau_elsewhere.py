"""MOREAU: what moves or stands elsewhere changes nothing of a contact."""

from __future__ import annotations

import numpy as np
import pytest

import mbsim
from helpers import rigid_decks as decks
from mbsim.bench import deck as text

OTHERS = {
    "a large body that is held": [
        text.body(9, 1.0, [400.0] * 3, (3.0, 4.0, 5.0)),
        text.marker(91, 1, (3.0, 4.0, 5.0)),
        text.joint(9, "FIXED", 90, 91),
    ],
    "a fast one": [text.body(9, 1.0, [1e-3] * 3, (3.0, 4.0, 5.0), (200.0, 0.0, 0.0))],
}
ALONG_X = ((0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0))


def carried(others: list[str]) -> mbsim.Results:
    """Return the motion of a box that lies 10 um deep in a belt, which starts to move."""
    parts = [
        text.GROUND,
        text.cuboid(2, 10.0, (4.0, 0.5, 0.2), (0.0, 0.0, -0.1)),
        text.marker(21, 2, (0.0, 0.0, -0.5), ALONG_X),
        text.marker(22, 1, (0.0, 0.0, -0.5), ALONG_X),
        text.joint(1, "TRANSLATIONAL", 21, 22),
        '<Motion_Joint id="1" joint_id="1" joint_type="TRANSLATIONAL" motion_type="T" val_type="V" '
        'expr="0.5*STEP(TIME,0,0,0.05,1)"/>',
        text.cuboid(3, 0.5, (0.1, 0.12, 0.1), (0.0, 0.0, 0.05 - 1e-5)),
        text.contact(301, [300], [200], **decks.rubbed(0.4, 0.5)),
        text.gravity(),
        decks.FIXED.format(h=1e-3),
    ]
    deck = text.deck("carried", [*parts, *others], 0.3, 0.01)
    return mbsim.simulate(deck, integrator="MOREAU", tol=1e-8)


@pytest.mark.parametrize("name", OTHERS)
def test_what_is_elsewhere_changes_no_contact(name: str) -> None:
    """What the solver may leave, and which gaps are none, is for each group of bodies to say."""
    alone, beside = carried([]), carried(OTHERS[name])
    for what in ("position", "velocity"):
        path = f"bodies/3/{what}"
        assert np.abs(alone[path] - beside[path]).max() < 1e-10
