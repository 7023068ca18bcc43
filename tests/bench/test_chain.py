"""Cost of an evaluation with the length of a chain: python -m pytest -m bench -s tests/bench"""

from __future__ import annotations

import numpy as np
import pytest

import mbsim
from mbsim.bench import report
from mbsim.bench.scenes.s08_linkages import chain_deck

pytestmark = pytest.mark.bench


@pytest.mark.parametrize("integrator", ["DOPRI5", "DOP853"])
def test_cost_of_an_evaluation_of_a_chain(tmp_path, integrator):
    few, many = report.CHAIN_BETWEEN
    costs = {}
    print()
    for rods in (2, few, 20, many):
        path = tmp_path / f"chain_{rods}.xml"
        path.write_text(chain_deck(rods, 2.0), encoding="utf-8")
        deck = mbsim.read_model(path)
        each = []
        for _ in range(4):
            stats = mbsim.simulate(deck, integrator=integrator, tol=1e-8).stats
            count = stats["rhs_evaluations"] + stats["output_evaluations"]
            each.append(1e9 * stats["loop_s"] / count)
        costs[rods] = min(each[1:])
        print(f"{integrator}, {rods} rods: {costs[rods]:.0f} ns an evaluation, all included")
    growth = costs[many] / costs[few]
    print(f"{integrator}: times {growth:.2f} from {few} to {many} rods (at most 5 asked)")
    assert np.isfinite(growth)
