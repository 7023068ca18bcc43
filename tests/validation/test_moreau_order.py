"""MOREAU is of order 2 where nothing meets, for what spins about axes that turn, too."""

from __future__ import annotations

import numpy as np
import pytest

import mbsim
from mbsim.bench import deck as text

ALONG_Y = [[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]
SPRING = (
    '<Force_SpringDamper id="9" type="TRANSLATIONAL" i_marker_id="30" j_marker_id="10"'
    ' stiffness="{k}" damping="0" length="0.5"/>'
)


def arm(spin: float, joint: str, force: str, h: float) -> str:
    """Return a deck: an arm swings about y on a hub, which spins about z."""
    parts = [
        text.GROUND,
        text.marker(10, 1, (0.0, 0.0, 0.0)),
        text.body(2, 1.0, (0.05, 0.05, 0.1), spin=(0.0, 0.0, spin)),
        text.body(
            3,
            1.0,
            (0.002, 0.02, 0.02),
            (0.5, 0.0, 0.0),
            velocity=(0.0, 0.5 * spin, 0.0),
            spin=(0.0, 0.0, spin),
        ),
        text.marker(23, 2, (0.2, 0.0, 0.0), ALONG_Y),
        text.marker(33, 3, (0.2, 0.0, 0.0), ALONG_Y),
        text.joint(1, "REVOLUTE", 20, 10),
        text.joint(2, joint, 33, 23),
        force,
        text.gravity(),
        f'<Param_Transient h_max="{h}" h_min="{h}"/>' if h > 0.0 else "",
    ]
    return text.deck("an arm on a hub that spins", parts, 1.0)


@pytest.mark.parametrize("joint", ["REVOLUTE", "SPHERICAL"])
@pytest.mark.parametrize("spin", [0.0, 5.0])
@pytest.mark.parametrize("k", [None, 1e-6, 50.0])
def test_half_the_step_leaves_a_quarter_of_the_error(
    joint: str, spin: float, k: float | None
) -> None:
    """A spring makes forces implicit, however soft it is."""
    force = "" if k is None else SPRING.format(k=k)
    exact = mbsim.simulate(arm(spin, joint, force, 0.0), integrator="DOP853", tol=1e-11)
    off = []
    for h in (0.005, 0.0025):
        found = mbsim.simulate(arm(spin, joint, force, h), integrator="MOREAU")
        apart = [found[f"bodies/{b}/position"] - exact[f"bodies/{b}/position"] for b in (2, 3)]
        off.append(np.abs(apart).max())
    assert off[0] > 3.5 * off[1]


#: What turns a body that spins: in global axes, in its own, by time, by its place and attitude.
TORQUES = (
    '<Force_Vector_OneBody id="1" type="TorqueOnly" i_marker_id="20" tx_expression="0.3"'
    ' ty_expression="0.1" tz_expression="0.2"/>',
    '<Force_Vector_OneBody id="1" type="TorqueOnly" i_marker_id="20" ref_marker_id="20"'
    ' tx_expression="0.3" ty_expression="0.1*COS(9*TIME)"/>',
    '<Force_Vector_OneBody id="1" type="ForceOnly" i_marker_id="21" fx_expression="3"'
    ' fy_expression="1" fz_expression="2"/>',
    '<Force_Bushing id="1" i_marker_id="20" j_marker_id="10" kx="100" ktx="1" kty="2" ktz="1"/>',
)
#: Beside it: nothing, or another body on a hinge.
ON_A_HINGE = (
    text.body(3, 1.0, (1.0, 1.0, 1.0), (5.0, 0.0, 0.0))
    + text.marker(13, 1, (5.0, 0.0, 0.0))
    + text.joint(1, "REVOLUTE", 30, 13)
)


@pytest.mark.parametrize("force", TORQUES)
@pytest.mark.parametrize(
    ("inertia", "beside"), [((0.01, 0.02, 0.015), ""), ((0.01, 0.01, 0.01), ON_A_HINGE)]
)
def test_torques_turn_what_spins_freely(
    force: str, inertia: tuple[float, float, float], beside: str
) -> None:
    """They act in the axes that the body has in the midst of the step, not at its begin."""

    def turned(h: float, **settings: object) -> np.ndarray:
        parts = [
            text.GROUND,
            text.marker(10, 1, (0.0, 0.0, 0.0)),
            text.body(2, 1.0, inertia, spin=(5.0, 3.0, 8.0)),
            text.marker(21, 2, (0.1, 0.0, 0.0)),
            force,
            beside,
            f'<Param_Transient h_max="{h}" h_min="{h}"/>' if h > 0.0 else "",
        ]
        return mbsim.simulate(text.deck("a body spins", parts, 0.5), **settings)[
            "bodies/2/quaternion"
        ]

    exact = turned(0.0, integrator="DOP853", tol=1e-11)
    off = [np.abs(turned(h, integrator="MOREAU") - exact).max() for h in (0.005, 0.0025)]
    assert off[0] > 3.5 * off[1]
    assert off[0] < 2e-3
