"""Points of contact in result files are those of their contact, whatever method runs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import mbsim
from mbsim.bench import deck as text


@pytest.mark.parametrize("integrator", ["RADAU5", "DOPRI5", "MOREAU"])
@pytest.mark.parametrize("sleep", ["TRUE", "FALSE"])
def test_forces_of_points_sum_up_to_those_of_contacts(tmp_path: Path, integrator, sleep) -> None:
    """With MOREAU they were 0, and all of the first contact."""
    law = text.impact(1e5, 1.0, 600.0, 1e-4) | text.coulomb(0.3, 0.01)
    parts = [
        text.GROUND,
        text.FLOOR,
        text.cuboid(2, 1.0, (0.2, 0.2, 0.2), (0.0, 0.0, 0.1), (0.5, 0.0, 0.0)),
        text.sphere(3, 1.0, 0.1, (0.0, 0.0, 0.3)),
        text.contact(302, [300], [200], **law),
        text.contact(301, [200], [100], **law),
        f'<Param_Transient sleep="{sleep}"/>' if integrator == "MOREAU" else "",
        text.gravity(),
    ]
    path = tmp_path / "deck.xml"
    path.write_text(text.deck("points", parts, 0.4), encoding="utf-8")
    run = mbsim.simulate(
        mbsim.read_model(path), integrator=integrator, tol=1e-5, contact_points=True
    )
    offsets, of = run["contact_points/offsets"], run["contact_points/contact"]
    force, slip = run["contact_points/force"], run["contact_points/slip_speed"]
    for contact in (301, 302):
        net, fastest = (run[f"contacts/{contact}/{name}"] for name in ("force", "slip_speed"))
        assert np.abs(net[:, 2]).max() > 5.0
        for k in range(len(run["time"])):
            mine = np.flatnonzero(of[offsets[k] : offsets[k + 1]] == contact) + offsets[k]
            assert force[mine].sum(axis=0) == pytest.approx(net[k], abs=1e-9)
            assert slip[mine].max(initial=0.0) == pytest.approx(fastest[k], abs=1e-12)
    assert run["contacts/301/slip_speed"].max() > 0.1
