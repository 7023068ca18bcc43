"""What runs of `models/` cost, in counters: within 2 % of what is written down."""

from __future__ import annotations

import pytest

import counters

CASES = counters.committed()


@pytest.mark.parametrize("case", CASES)
def test_counters_are_those_that_are_written_down(case):
    off = list(counters.changed(counters.count(case), CASES[case]))
    assert not off, f"{case}: (counter, now, before) {off}: python tests/counters.py writes it down"


def test_all_that_costs_is_counted_somewhere():
    totals = {name: sum(case[name] for case in CASES.values()) for name in counters.COUNTERS}
    idle = {"pair_listings", "python_calls"}
    assert len(CASES) >= 20
    assert all(count > 0 for name, count in totals.items() if name not in idle)


def test_a_change_of_more_than_its_share_is_told():
    kept = dict.fromkeys(counters.COUNTERS, 1000) | {"jacobians": 1}
    assert not list(counters.changed(kept | {"steps": 1020, "jacobians": 4}, kept))
    assert list(counters.changed(kept | {"steps": 1021}, kept)) == [("steps", 1021, 1000)]
    assert list(counters.changed(kept | {"steps": 979}, kept)) == [("steps", 979, 1000)]
    assert list(counters.changed(kept | {"jacobians": 5}, kept)) == [("jacobians", 5, 1)]
