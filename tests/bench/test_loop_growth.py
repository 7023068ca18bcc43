"""Cost of an evaluation of mechanisms with many loops.

python -m pytest -m bench -s tests/bench/test_loop_growth.py
"""

from __future__ import annotations

import numpy as np
import pytest

import mbsim
from helpers.decks import write_deck
from helpers.known_mechanisms import four_bars
from helpers.many_loops import ladder, separate

pytestmark = pytest.mark.bench


def cost(stats):
    """Return microseconds of the compiled loop for each of its evaluations, rows included."""
    return 1e6 * stats["loop_s"] / (stats["rhs_evaluations"] + stats["output_evaluations"])


@pytest.mark.parametrize("kind", [four_bars, ladder, separate])
@pytest.mark.parametrize("integrator", ["DOPRI5", "RADAU5"])
def test_cost_of_an_evaluation_by_loops(tmp_path, kind, integrator):
    costs = {}
    print()
    for n in (1, 2, 5, 10, 20, 40, 80):
        model = mbsim.read_model(write_deck(tmp_path, kind(n).xml(), 0.5, 0.1))
        runs = [mbsim.simulate(model, integrator=integrator, tol=1e-6).stats for _ in range(3)]
        costs[n] = min(map(cost, runs))
        print(f"{integrator}, {kind.__name__}({n}): {costs[n]:.1f} us an evaluation, rows included")
    growth = costs[80] / costs[10]
    print(f"{integrator}, {kind.__name__}: times {growth:.1f} from 10 to 80 (at most 16 asked)")
    assert np.isfinite(growth)
