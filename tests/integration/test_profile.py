"""`--profile`: parts of the time add up to it, and nothing of it is there without."""

from __future__ import annotations

import time

import pytest

from helpers.decks import run_model
from mbsim.arrays.hooks import Hook
from mbsim.core import profile
from mbsim.core.problem import Problem
from mbsim.run import hook_profile

#: Hooks that are no functions.
NO_FUNCTION = {Hook.TANGENT, Hook.STEPPING}


def test_parts_add_up_to_the_time_of_the_run():
    run_model("drop_m.xml", end_time=0.1)
    began = time.perf_counter()
    with run_model("drop_m.xml", end_time=0.1, profile=True) as results:
        took = time.perf_counter() - began
        stats = results.stats
    parts = {name: stats[f"profile_{name}_s"] for name in profile.PARTS}
    assert all(seconds >= 0.0 for seconds in parts.values())
    assert 0.5 * took < sum(parts.values()) <= took
    if profile.DIVIDES:
        names = (*profile.LOOP_PARTS, "method")
        inside = sum(stats[f"profile_loop_{name}_s"] for name in names)
        assert inside == pytest.approx(parts["loop"], rel=0.02)


@pytest.mark.skipif(not profile.DIVIDES, reason="the loop is one part on this processor")
@pytest.mark.parametrize("deck", ["drop_m.xml", "ellipsoid_on_box.xml", "four_bar_stop.xml"])
def test_calls_are_those_that_are_counted_and_the_run_is_the_same(deck):
    with run_model(deck, end_time=0.2) as plain:
        counted, position = plain.stats, plain["bodies/position"]
    with run_model(deck, end_time=0.2, profile=True) as timed:
        stats = timed.stats
        assert (timed["bodies/position"] == position).all()
    counters = ("steps", "rhs_evaluations", "narrowphase_pairs", "fcl_calls")
    assert [stats[name] for name in counters] == [counted[name] for name in counters]
    # those before the loop are not its part
    evaluations = stats["profile_loop_evaluation_calls"]
    assert evaluations >= 0.99 * counted["rhs_evaluations"]
    assert not any(name.startswith("profile") for name in counted)


def test_a_later_run_has_nothing_of_it():
    with run_model("drop_m.xml", end_time=0.1, profile=True):
        pass
    assert profile.running is None
    with run_model("drop_m.xml", end_time=0.1) as results:
        assert not any(name.startswith("profile") for name in results.stats)


def test_every_hook_is_counted_to_a_part():
    assert set(hook_profile.PARTS_OF_SCENE) == set(Hook) - NO_FUNCTION
    assert set(hook_profile.PARTS_OF_PROBLEM) == set(Problem._fields) - {"context"}
    named = {*hook_profile.PARTS_OF_SCENE.values(), *hook_profile.PARTS_OF_PROBLEM.values()}
    assert named == set(profile.LOOP_PARTS)
