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
