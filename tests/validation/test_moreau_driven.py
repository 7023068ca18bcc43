"""MOREAU with motions: what they give, the work they do, and where joints leave what nothing holds.

A crank turns about z by a motion and carries a rod on a universal joint, a load on the rod's end.
"""

from __future__ import annotations

import numpy as np
import pytest

import mbsim
from mbsim.bench import deck as text

ACROSS = [[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]
SLOW = ((0.004, 0.002, 0.001), 0.4)


def crank(motion: str, h: float | None = None) -> str:
    """Return the deck of the crank, by steps of h."""
    parts = [
        text.GROUND,
        text.marker(10, 1, (0.0, 0.0, 0.0)),
        text.body(2, 1.0, (0.001, 0.01, 0.01), (0.15, 0.0, 0.0)),
        text.marker(21, 2, (0.0, 0.0, 0.0)),
        text.marker(22, 2, (0.3, 0.0, 0.0), ACROSS),
        text.body(3, 0.8, (0.002, 0.008, 0.009), (0.45, 0.0, -0.1), spin=(0.0, 2.0, 0.0)),
        text.marker(31, 3, (0.3, 0.0, 0.0)),
        text.joint(1, "REVOLUTE", 21, 10),
        text.joint(2, "UNIVERSAL", 31, 22),
        text.gravity(),
        motion,
    ]
    if h is not None:
        parts.append(f'<Param_Transient h_max="{h}" h_min="{h}"/>')
    return text.deck("a crank that a motion turns", parts, SLOW[1], 0.02)


def turned(kind: str, expression: str) -> str:
    """Return the motion of the crank's hinge."""
    return (
        '<Motion_Joint id="7" joint_id="1" joint_type="REVOLUTE" motion_type="R" '
        f'val_type="{kind}" type="EXPRESSION" expr="{expression}"/>'
    )


@pytest.mark.parametrize(
    ("kind", "expression"),
    [
        ("D", "0.7*SIN(6*TIME)"),
        ("V", "3*COS(5*TIME)+1"),
        ("A", "20*SIN(7*TIME)"),
        ("A", "5-20*AZ(21,10)"),
    ],
)
def test_motions_and_their_work_are_of_order_two(kind: str, expression: str) -> None:
    """Against DOP853: displacements, velocities and accelerations, of time and of the state."""
    motion = turned(kind, expression)
    exact = mbsim.simulate(crank(motion), integrator="DOP853", tol=1e-11)
    off, work = [], []
    for h in SLOW[0]:
        results = mbsim.simulate(crank(motion, h), integrator="MOREAU")
        assert results.audit.warnings == ()
        moved = [f"bodies/{b}/{what}" for b in (2, 3) for what in ("position", "velocity")]
        off.append(max(np.abs(results[k] - exact[k]).max() for k in moved))
        kinds = [k for k in exact if k.startswith("energy/")]
        work.append(max(np.abs(results[k] - exact[k]).max() for k in kinds))
    for errors in (off, work):
        assert np.log2(np.array(errors[:-1]) / errors[1:]).min() > 1.8
    assert off[-1] < 1e-3
    assert work[-1] < 1e-4 * np.abs(exact["energy/kinetic"]).max()


@pytest.mark.parametrize("joint", ["FIXED", "REVOLUTE", "TRANSLATIONAL"])
def test_least_changes_of_positions_leave_the_centre_where_it_is(joint: str) -> None:
    """Two bodies spin about each other: no gap is so small that the child alone closes it."""
    for h in (0.004, 0.001, 0.00025):
        parts = [
            text.GROUND,
            text.body(2, 3.0, (0.02, 0.03, 0.04), (0.0, 0.0, 0.0), spin=(1.0, 3.0, 6.0)),
            text.body(3, 1.0, (0.01, 0.02, 0.02), (0.3, 0.0, 0.1), spin=(1.0, 3.0, 6.0)),
            text.marker(21, 2, (0.1, 0.0, 0.0)),
            text.marker(31, 3, (0.1, 0.0, 0.0)),
            text.joint(1, joint, 31, 21),
            f'<Param_Transient h_max="{h}" h_min="{h}"/>',
        ]
        deck = text.deck("two bodies that nothing holds", parts, 0.4, 0.02)
        results = mbsim.simulate(deck, integrator="MOREAU")
        centre = 0.75 * results["bodies/2/position"] + 0.25 * results["bodies/3/position"]
        flown = 0.75 * results["bodies/2/velocity"] + 0.25 * results["bodies/3/velocity"]
        left = centre - centre[0] - results["time"][:, None] * flown[0]
        assert np.abs(left).max() < 1e-9


@pytest.mark.parametrize("h", [0.005, 0.00125])
def test_a_lever_that_is_driven_lifts_a_ball_by_the_work_of_its_motion(h: float) -> None:
    """Without friction, and moved smoothly: the work is what lever and ball have of energy."""
    parts = [
        text.GROUND,
        text.marker(10, 1, (0.0, 0.0, 0.0)),
        text.body(2, 1.0, (0.001, 0.01, 0.01), (0.0, 0.0, 0.0)),
        '<Post_Graphic id="200" type="BoxDefinedFromCenter" center_marker_id="20"'
        ' length_x="1" length_y="1" length_z="0.1"/>',
        text.joint(1, "TRANSLATIONAL", 20, 10),
        text.sphere(3, 2.0, 0.1, (0.1, 0.0, 0.15)),
        text.contact(301, [200], [300], cnf_type="POISSON", restitution_coef=0.0, penalty=1e6),
        text.gravity(),
        '<Motion_Joint id="7" joint_id="1" joint_type="TRANSLATIONAL" motion_type="T" '
        'val_type="D" type="EXPRESSION" expr="0.1*(1-COS(3*TIME))"/>',
        f'<Param_Transient h_max="{h}" h_min="{h}"/>',
    ]
    deck = text.deck("a table that lifts a ball", parts, 1.0, 0.05)
    results = mbsim.simulate(deck, integrator="MOREAU")
    lifted = 0.15 + 0.1 * (1.0 - np.cos(3.0))
    assert results["bodies/3/position"][-1, 2] == pytest.approx(lifted, abs=1e-5)
    total = results["energy/kinetic"] + results["energy/potential"]
    done = results["energy/work_of_motions"]
    assert np.abs(total - total[0] - done).max() < 1e-4 * np.abs(done).max()
    assert results.audit.warnings == ()
