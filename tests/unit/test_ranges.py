"""Ranges of bytes: as a set of bytes, in little memory."""

from __future__ import annotations

import itertools
import random

import pytest

from mbsim.results.ranges import Ranges


@pytest.mark.parametrize("seed", range(20))
def test_merged_ranges_hold_the_bytes_that_were_added(seed: int) -> None:
    chance, ranges, held = random.Random(seed), Ranges(), set()
    for _ in range(chance.choice([1, 10, 1000, 3000])):
        first = chance.randrange(5000)
        end = first + chance.choice([0, 1, 5, 50])
        ranges.add(first, end)
        held.update(range(first, end))
    other = ranges.copied()
    other.add(9000, 9001)
    found = ranges.merged()
    assert {byte for first, end in found for byte in range(first, end)} == held
    assert all(one[1] < two[0] for one, two in itertools.pairwise(found))


def test_a_long_runs_chunks_take_no_memory() -> None:
    """They lie side by side, in another order than they come in, and between them are others."""
    ranges, size, most = Ranges(), 1 << 16, 0
    for k in range(0, 100_000, 2):
        for at in (k + 1, k):
            ranges.add(at * size, (at + 1) * size)
            ranges.add(64, 128)
            most = max(most, len(ranges))
    assert ranges.merged() == [[0, 100_000 * size]]
    assert most <= 600


def test_adding_to_many_that_stay_apart_costs_little(monkeypatch: pytest.MonkeyPatch) -> None:
    ranges, merges, merged = Ranges(), [], Ranges.merged
    monkeypatch.setattr(Ranges, "merged", lambda self: merges.append(len(self)) or merged(self))
    for k in range(100_000):
        ranges.add(3 * k, 3 * k + 1)
    assert len(ranges) == 100_000
    assert sum(merges) < 300_000
