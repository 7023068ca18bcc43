"""When compiled code comes back to Python decides nothing: not of results, steps or failures."""

from __future__ import annotations

import numpy as np
import pytest

import mbsim
from helpers.folders import MODELS
from mbsim.compile_model import scratch
from mbsim.core import problem
from mbsim.errors import Interrupted, SolverError
from mbsim.integrators import scheme
from mbsim.run import divergence as divergence
from mbsim.run import loop
from mbsim.run.methods import Methods

#: Evaluations from one return to the next, and rows and events that fit until then.
RETURNS = {"1": (1, 256), "997": (997, 256), "5003": (5003, 3), "1 row": (10**9, 1)}
COUNTED = (
    *("steps", "rejected", "rhs_evaluations", "output_evaluations", "jacobians"),
    *("factorizations", "method_changes", "narrowphase_pairs", "h_smallest", "h_largest"),
)
#: Decks by method: AUTO changes over and back in the first two; sensors, friction that holds,
#: an impact, a loop, joints.
RUNS = {
    ("AUTO", "stiff/incline_creep", 1.0): {},
    # begins anew with RADAU5
    ("AUTO", "stiff/rolling_sphere", 0.02): {},
    ("AUTO", "stiff/four_bar_stop", 0.3): {},
    ("AUTO", "slider_crank_clearance", 0.02): {"tol": 1e-7},
    ("AUTO", "sdnd100", 0.2): {},
    ("DOPRI5", "bouncing_sphere", 1.0): {},
    ("DOPRI5", "four_bar_stop", 0.1): {},
    ("DOP853", "bouncing_sphere", 1.0): {},
    ("DOP853", "lugre_stick_slip", 1.0): {},
    ("RADAU5", "bouncing_sphere", 0.5): {},
    ("RADAU5", "stiff/four_bar_stop", 0.2): {},
    ("RADAU5", "stiction_rigid", 1.0): {},
    ("GALPHA", "bouncing_sphere", 0.5): {"tol": 1e-4},
    ("GALPHA", "stiff/box_stack", 0.05): {},
    ("VERLET", "bouncing_sphere", 0.5): {"tol": 1e-3},
    ("VERLET", "drop_m", 0.3): {"tol": 1e-3},
}


def returning(patch, budget, rows):
    """Let compiled code come back after so many evaluations or rows."""
    patch.setattr(loop, "FIRST_BUDGET", budget)
    patch.setattr(loop, "next_budget", lambda *called: budget)
    patch.setattr(scratch, "ROWS", rows)


def same(one, other, counted=COUNTED):
    """Compare all signals and counts of two runs, bit for bit."""
    assert sorted(one.keys()) == sorted(other.keys())
    for name in one.keys():
        np.testing.assert_array_equal(one[name], other[name], err_msg=name)
    for name in counted:
        assert one.stats[name] == other.stats[name], name


@pytest.mark.parametrize(("method", "deck", "end"), RUNS)
def test_a_run_is_the_same_whenever_it_returns(method, deck, end):
    model = mbsim.read_model(MODELS / f"{deck}.xml")
    settings = {"integrator": method, "end_time": end, "print_interval": end / 150.0}
    settings |= RUNS[method, deck, end]
    with pytest.MonkeyPatch.context() as patch:
        returning(patch, 10**9, 256)
        one = mbsim.simulate(model, **settings)
    for budget, rows in RETURNS.values():
        with pytest.MonkeyPatch.context() as patch:
            returning(patch, budget, rows)
            same(mbsim.simulate(model, **settings), one)


def test_auto_changes_over_behind_the_step_that_decides_it(monkeypatch):
    """A table of rows that is full, or a sensor, does not put the decision off."""
    model = mbsim.read_model(MODELS / "stiff" / "incline_creep.xml")
    times = []
    change_over = Methods.change_over

    def noted(self):
        times[-1].append((self.arrays.memory[scheme.TIME], int(self.arrays.counts[scheme.STEPS])))
        return change_over(self)

    monkeypatch.setattr(Methods, "change_over", noted)
    for budget, rows in ((10**9, 256), *RETURNS.values()):
        times.append([])
        returning(monkeypatch, budget, rows)
        # a row within every step: the table is full behind each
        mbsim.simulate(model, end_time=0.3, print_interval=1e-4)
    assert times[0]
    assert all(one == times[0] for one in times)


@pytest.mark.parametrize(
    ("method", "end"),
    [("AUTO", 0.02), pytest.param("DOP853", 0.004, marks=pytest.mark.slow), ("GALPHA", 0.02)],
)
def test_contact_problems_on_the_way_change_nothing(method, end, tmp_path):
    model = mbsim.read_model(MODELS / "stiff" / "box_stack.xml")
    settings = {"integrator": method, "end_time": end}
    one = mbsim.simulate(model, **settings)
    other = mbsim.simulate(model, output=tmp_path, dump_fclib=5, **settings)
    assert any((tmp_path / "fclib").iterdir())
    # writing a problem looks for contacts once more
    same(one, other, [name for name in COUNTED if name != "narrowphase_pairs"])


@pytest.fixture
def impatient(monkeypatch):
    """Give up where steps are on average shorter than a thousandth of the time, over 10,000."""
    monkeypatch.setattr(divergence, "STALLED", 10_000)
    monkeypatch.setattr(divergence, "SLIVER", 1e-3)


def given_up(model, folder, **settings):
    """Return what a run says that gives up, its steps and its rows."""
    with pytest.raises(SolverError) as stopped:
        mbsim.simulate(model, integrator="DOPRI5", output=folder, **settings)
    with mbsim.open_results(folder / f"{model.name}.h5") as kept:
        return str(stopped.value), kept.stats["steps"], len(kept["time"])


def test_a_run_gives_up_at_the_same_step_whenever_it_returns(tmp_path, monkeypatch, impatient):
    model = mbsim.read_model(MODELS / "stiff" / "bushing_chain.xml")
    ends = []
    for name, (budget, rows) in RETURNS.items():
        returning(monkeypatch, budget, rows)
        ends.append(given_up(model, tmp_path / name))
    assert ends[0][1] % problem.WATCH_EVERY == 0
    assert all(end == ends[0] for end in ends)


def test_a_resumed_run_gives_up_where_the_straight_one_does(tmp_path, monkeypatch, impatient):
    model = mbsim.read_model(MODELS / "stiff" / "bushing_chain.xml")
    straight = given_up(model, tmp_path / "a")
    returning(monkeypatch, 997, 256)
    left = [50]

    def stop(time, step, until):
        left[0] -= 1
        if left[0] == 0:
            raise Interrupted("enough")

    with pytest.raises(Interrupted):
        mbsim.simulate(model, integrator="DOPRI5", output=tmp_path / "b", progress=stop)
    assert given_up(model, tmp_path / "b", resume=True) == straight


@pytest.mark.parametrize("calls", [3, 12, 40])
@pytest.mark.parametrize("deck", ["jammed_wedge", "box_stack", "incline_creep"])
def test_a_run_that_ends_while_auto_may_go_back_goes_on_as_if_it_had_not(
    deck, calls, tmp_path, monkeypatch
):
    """It is found stiff behind some 100 evaluations; rows of what was tried are dropped."""
    model = mbsim.read_model(MODELS / "stiff" / f"{deck}.xml")
    settings = {"end_time": 0.02, "print_interval": 1e-4, "output": tmp_path}
    one = mbsim.simulate(model, **{**settings, "output": None})
    returning(monkeypatch, 1, 256)
    times = []

    def progress(t, h, end):
        times.append(t)
        if len(times) == calls:
            raise KeyboardInterrupt

    with pytest.raises(Interrupted):
        mbsim.simulate(model, progress=progress, **settings)
    same(mbsim.simulate(model, resume=True, **settings), one)
