"""What implicit methods linearised goes on after a resume, bit for bit, and through every flush."""

from __future__ import annotations

import re

import numpy as np
import pytest

import mbsim
from helpers.folders import MODELS
from mbsim.errors import Interrupted
from mbsim.integrators import scheme
from mbsim.results import recorder
from mbsim.run import loop

STIFF = MODELS / "stiff"
COUNTED = ("steps", "rejected", "rhs_evaluations", "jacobians", "factorizations", "method_changes")


@pytest.fixture
def impatient(monkeypatch):
    """Let runs come back to Python every few evaluations, and write all each time."""
    monkeypatch.setattr("mbsim.run.divergence.RETURN_SECONDS", 1e-6)
    monkeypatch.setattr(loop, "FIRST_BUDGET", 7)


def same(one, other):
    """Compare all signals and counts of two runs, bit for bit."""
    assert sorted(one.keys()) == sorted(other.keys())
    for name in one.keys():
        np.testing.assert_array_equal(one[name], other[name], err_msg=name)
    for name in COUNTED:
        assert one.stats[name] == other.stats[name], name


def resumed(model, folder, stops, after=-1.0, **settings):
    """Return a run that is interrupted, and resumed, after each so many returns to Python.

    Returns up to the time `after` are not counted. And at how many of these an implicit method of
    AUTO's ran.
    """
    stiff = 0
    for k, most in enumerate(stops):
        returns = 0

        def stop(time, step, until, most=most):
            nonlocal returns
            returns += 1 if time > after else 0
            if returns == most:
                raise Interrupted("enough")

        with pytest.raises(Interrupted):
            mbsim.simulate(model, output=folder, progress=stop, resume=k > 0, **settings)
        with mbsim.open_results(folder / f"{model.name}.h5") as kept:
            stiff += kept.tables("checkpoint")["method/memory"][scheme.STIFF] == 1.0
    return mbsim.simulate(model, output=folder, resume=True, **settings), stiff


#: Contact with friction, a loop with a stop, `Control_Diff`; how much of each is run [s].
DECKS = {"rebound": 0.3, "box_stack": 0.05, "four_bar_stop": 0.3, "lugre": 10.0}


@pytest.mark.parametrize("name", DECKS)
@pytest.mark.parametrize("method", ["RADAU5", "GALPHA"])
def test_resumed_it_is_the_same_run(name, method, tmp_path, impatient):
    model = mbsim.read_model(STIFF / f"{name}.xml")
    settings = {"integrator": method, "end_time": DECKS[name], "tol": 1e-5}
    straight = mbsim.simulate(model, **settings)
    assert straight.stats["jacobians"] < straight.stats["steps"]
    quarter = straight.stats["steps"] // 4
    found, _ = resumed(model, tmp_path, [quarter] * 3, **settings)
    same(found, straight)


@pytest.mark.parametrize("name", ["incline_creep", "box_stack", "lugre", "four_bar_stop"])
def test_resumed_while_it_is_stiff_auto_is_the_same_run(name, tmp_path, impatient):
    model = mbsim.read_model(STIFF / f"{name}.xml")
    straight = mbsim.simulate(model, tol=1e-6, output=tmp_path / "straight")
    log = (tmp_path / "straight" / f"{name}.log").read_text("utf-8")
    changed = float(re.search(r"time (\S+): .*RADAU5 from (?:here|the begin) on", log)[1])
    found, stiff = resumed(model, tmp_path, [2, 3, 3], changed, tol=1e-6)
    assert stiff >= 2
    same(found, straight)


@pytest.mark.parametrize("method", ["RADAU5", "GALPHA"])
def test_when_results_are_written_changes_nothing(method, tmp_path, impatient, monkeypatch):
    model = mbsim.read_model(STIFF / "four_bar_stop.xml")
    settings = {"integrator": method, "end_time": 0.03}
    straight = mbsim.simulate(model, **settings)
    monkeypatch.setattr(recorder.Recorder, "due", lambda self: True)
    same(mbsim.simulate(model, output=tmp_path, **settings), straight)


@pytest.mark.parametrize("method", ["DOPRI5", "RADAU5"])
@pytest.mark.parametrize(("name", "end"), [("sdnd100", 0.1), ("lugre_stick_slip", 9.0)])
def test_memory_of_friction_goes_on_where_it_was(name, end, method, tmp_path, impatient):
    model = mbsim.read_model(STIFF.parent / f"{name}.xml")
    settings = {"integrator": method, "end_time": end}
    straight = mbsim.simulate(model, **settings)
    found, _ = resumed(model, tmp_path, [straight.stats["steps"] // 4] * 3, **settings)
    same(found, straight)
