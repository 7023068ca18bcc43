"""A constraint whose expression follows TIME drives: what it puts in is work of motions."""

from __future__ import annotations

import numpy as np
import pytest

import mbsim
from mbsim.bench import deck as text


def bead(expr: str, step: str = "") -> str:
    """Return a deck: a bead of 2 kg, 0.8 m from the origin, that an expression holds."""
    parts = [
        text.GROUND,
        text.marker(10, 1, (0.0, 0.0, 0.0)),
        text.body(2, 2.0, (0.01, 0.02, 0.03), (0.8, 0.0, 0.0), velocity=(0.0, 1.0, 0.5)),
        f'<Constraint_General id="1" expr="{expr}"/>',
        '<Reference_Variable id="1" expr="0.8 + 0.1*SIN(6*TIME)"/>',
        text.gravity(),
        step,
    ]
    return text.deck("a bead", parts, 0.5)


@pytest.mark.parametrize(
    ("method", "tol", "step", "most"),
    [
        ("DOP853", 1e-8, "", 1e-6),
        ("RADAU5", 1e-6, "", 1e-5),
        ("GALPHA", 1e-5, "", 1e-2),
        ("MOREAU", 1e-4, "", 1e-2),
        ("MOREAU", 1e-4, '<Param_Transient h_max="0.001" h_min="0.001"/>', 1e-3),
    ],
)
@pytest.mark.parametrize("length", ["(0.8 + 0.1*SIN(6*TIME))", "VARVAL(1)"])
def test_the_balance_has_what_a_constraint_puts_in(
    method: str, tol: float, step: str, most: float, length: str
) -> None:
    """The bead is pulled in and let out as it swings round: some joules, of which none is lost."""
    results = mbsim.simulate(
        bead(f"DM(20,10)**2 - {length}**2", step), integrator=method, tol=tol, print_interval=0.05
    )
    work = results["energy/work_of_motions"]
    total = results["energy/kinetic"] + results["energy/potential"] - work
    assert np.abs(work).max() > 1.0
    assert np.abs(total - total[0]).max() < most
    assert results.audit.warnings == ()


def test_one_that_only_holds_puts_in_nothing() -> None:
    results = mbsim.simulate(bead("DM(20,10)**2 - 0.64"))
    assert "energy/work_of_motions" not in set(results)
