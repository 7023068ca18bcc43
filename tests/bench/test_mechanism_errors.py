"""Errors of mechanisms with known answers against tol, and what is left of their constraints.

python -m pytest -m bench -s tests/bench/test_mechanism_errors.py
"""

from __future__ import annotations

import numpy as np
import pytest

from helpers import known_mechanisms as known
from helpers import squeezer
from helpers.decks import run_deck
from helpers.mechanics import matrix
from helpers.mechanism_decks import residual

pytestmark = pytest.mark.bench

TOLS = (1e-5, 1e-7, 1e-8, 1e-9, 1e-10)


@pytest.mark.parametrize("tol", TOLS)
@pytest.mark.parametrize("method", ["DOPRI5", "DOP853"])
def test_errors(method, tol, tmp_path):
    settings = {"tol": tol, "integrator": method}
    scene, loads = squeezer.scene()
    results = run_deck(tmp_path, scene.xml(), 0.03, 1e-4, **settings)
    digits, rate_digits = squeezer.correct_digits(results)
    left = residual(results, scene.mechanism(loads))[0]
    print(f"\n{method} tol {tol:g}")
    print(f"squeezer: digits {digits:.2f}, of rates {rate_digits:.2f}; residual {left:.1e}")
    assert digits > 3

    scene = known.bricard()
    results = scene.run(tmp_path, 10.0, 0.1, **settings)
    drift, left = (
        np.abs(known.passive(results)).max(),
        residual(results, scene.mechanism())[0],
    )
    print(f"Bricard, 10 s: energy drift {drift:.1e} J; residual {left:.1e}")
    assert left < 1e-9

    results = known.four_bars(2).run(tmp_path, 20.0, 0.5, **settings)
    p, q = results["bodies/2/position"][-1], results["bodies/2/quaternion"][-1]
    tip = p + 0.5 * matrix(q)[:, 1]
    error = np.abs(tip[:2] - (0.8397465743, 0.5429785364)).max()
    print(f"N-four-bar, N = 2, 20 s: {error:.1e} m")

    results = known.heavy_top().run(tmp_path, 2.0, 0.5, **settings)
    end = results["bodies/2/position"][-1]
    error = np.abs(end - (-0.15041682, -0.72416559, -0.67302227)).max()
    print(f"heavy top, 2 s: {error:.1e} m")
