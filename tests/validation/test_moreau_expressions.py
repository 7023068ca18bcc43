"""MOREAU with expressions that look at joints: motions by the state, forces by reactions."""

from __future__ import annotations

import numpy as np
import pytest

import mbsim
from mbsim.bench import deck as text
from mbsim.errors import ModelError

ALONG_Y = [[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]


def torque(joint: str, expr: str) -> str:
    """Return a torque by an expression in a hinge: of the first body, or of the second."""
    i, j = (21, 10) if joint == "first" else (31, 11)
    names = text.attributes(id=1, type="Torque", i_marker_id=i, j_marker_id=j, expr=expr)
    return f"<Force_Scalar_TwoBody {names}/>"


def swings(*more: str) -> str:
    """Return a deck: two bodies swing about y on hinges of their own."""
    parts = [
        text.GROUND,
        text.marker(10, 1, (0.0, 0.0, 0.0), ALONG_Y),
        text.marker(11, 1, (1.0, 0.0, 0.0), ALONG_Y),
        text.body(2, 1.0, (0.02, 0.03, 0.04), (0.1, 0.0, 0.05), spin=(0.0, 2.0, 0.0)),
        text.body(3, 2.0, (0.04, 0.03, 0.04), (1.1, 0.0, 0.1)),
        text.marker(21, 2, (0.0, 0.0, 0.0), ALONG_Y),
        text.marker(31, 3, (1.0, 0.0, 0.0), ALONG_Y),
        text.joint(1, "REVOLUTE", 21, 10),
        text.joint(2, "REVOLUTE", 31, 11),
        text.gravity(),
        *more,
    ]
    return text.deck("two swings", parts, 0.5, 0.05)


#: What looks at the other joint's force, at its own, at a motion's, and at how the joint moves.
LOOKS = {
    "reaction": [torque("first", "-0.01*JOINT(2,0,1,0)")],
    "own reaction": [torque("first", "-0.05*JOINT(1,0,1,0)*STEP(WZ(21,10,10),-0.1,-1,0.1,1)")],
    "drive": [
        '<Motion_Joint id="1" joint_id="1" val_type="D" expr="SIN(5*TIME)"/>',
        torque("second", "0.3*MOTION(1,0,8,0)"),
    ],
    "acceleration": [
        '<Motion_Joint id="1" joint_id="1" val_type="A" expr="-25*AZ(21,10) - 2*WZ(21,10,10)"/>'
    ],
}


@pytest.mark.parametrize("name", LOOKS)
def test_what_looks_at_joints_is_of_order_two(name: str) -> None:
    """Reactions are settled within the step, and velocities are those that joints leave."""
    deck = swings(*LOOKS[name])
    exact, off = mbsim.simulate(deck, integrator="DOP853", tol=1e-9), []
    for h in (0.005, 0.0025):
        step = f'<Param_Transient h_max="{h}" h_min="{h}"/></Model>'
        found = mbsim.simulate(deck.replace("</Model>", step), integrator="MOREAU")
        apart = [found[f"bodies/{b}/position"] - exact[f"bodies/{b}/position"] for b in (2, 3)]
        off.append(np.abs(apart).max())
    assert off[0] > 3.5 * off[1]
    assert off[0] < 1e-3


def test_reactions_beside_contacts_are_refused() -> None:
    """They would lack the impulses of contacts."""
    law = text.impact(1e5, 1.5, 10.0, 1e-4)
    ball = text.sphere(4, 1.0, 0.1, (5.0, 0.0, 0.1))
    contact = text.contact(301, [400], [100], **law, cff_type="COULOMB_OFF")
    deck = swings(*LOOKS["reaction"], ball, text.FLOOR.splitlines()[1], contact)
    with pytest.raises(ModelError, match=r"Force_Scalar_TwoBody\[1\].*looks at reactions"):
        mbsim.simulate(deck, integrator="MOREAU")
