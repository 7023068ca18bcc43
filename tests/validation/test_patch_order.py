"""A mesh that lies does so whichever of the two a contact calls I."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh

import mbsim
from mbsim.bench import deck as text


@pytest.mark.parametrize("integrator", ["DOPRI5", "RADAU5"])
def test_a_plane_may_be_i(tmp_path: Path, integrator: str) -> None:
    """Gain and stiffness of a patch are those of the pair: only its normal turns with the order."""
    trimesh.creation.annulus(0.05, 0.1, 0.1, sections=16).export(tmp_path / "ring.stl")
    law = {"cnf_type": "IMPACT", "stiffness": 1e5, "exponent": 1.5, "damping": 50.0, "dmax": 1e-4}
    ends = []
    for first, second in (([200], [100]), ([100], [200])):
        parts = [
            text.GROUND,
            text.FLOOR,
            text.body(2, 2.0, [0.02, 0.03, 0.04], (0.01, 0.02, 0.05), spin=(0.1, 0.0, 0.0)),
            text.marker(21, 2, (0.0, 0.0, 0.05)),
            '<Post_Graphic id="200" type="TriaMesh" rm_id="21" file="ring.stl"/>',
            text.contact(301, first, second, **law, **text.coulomb(0.3, 1e-2)),
            text.gravity(),
        ]
        (tmp_path / "lies.xml").write_text(text.deck("lies", parts, 0.1, 0.01), encoding="utf-8")
        results = mbsim.simulate(tmp_path / "lies.xml", integrator=integrator)
        assert results.audit.warnings == ()
        ends.append(results["bodies/2/position"][-1])
    assert np.abs(ends[0] - ends[1]).max() < 1e-9
