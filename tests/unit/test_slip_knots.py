"""Coefficients of friction that MOREAU reads off a law, between the speeds at which it asks."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from mbsim.core.blend import step
from mbsim.stepping.coefficients import knots_of

SAMPLES = np.geomspace(0.1, 1e3, 320)
LAWS: dict[str, Callable[[float], float]] = {
    "wide": lambda v: step(v, 0.1, 0.5, 40.0, 0.3),
    "narrow": lambda v: step(v, 0.2, 0.5, 0.2002, 0.3),
    "stribeck": lambda v: 0.3 + 0.2 * math.exp(-((v / 0.7) ** 2)),
    "viscous": lambda v: 0.3 + 1e-3 * v,
    "constant": lambda v: 0.3,
    "jump": lambda v: 0.5 if v < 0.33 else 0.3,
}


@pytest.mark.parametrize("name", LAWS)
def test_knots_say_what_the_law_says(name: str) -> None:
    """Between its knots a curve is straight to what was asked for, also where it is narrow."""
    law = LAWS[name]
    samples = np.column_stack([SAMPLES, [law(v) for v in SAMPLES]])
    knots = knots_of(law, samples, 1e-5)
    asked = np.unique(np.concatenate([np.geomspace(0.1, 1e3, 7001), np.linspace(0.1, 1, 7001)]))
    if name == "jump":
        asked = asked[abs(asked - 0.33) > 1e-8]
    off = np.interp(asked, knots[:, 0], knots[:, 1]) - [law(v) for v in asked]
    assert abs(off).max() < 1e-5
    assert len(knots) < 700
    assert (np.diff(knots[:, 0]) > 0.0).all()
