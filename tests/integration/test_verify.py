"""`--verify`: error bars that hold against a run at a far smaller tolerance."""

from __future__ import annotations

import math

import numpy as np
import pytest

import mbsim
from helpers.decks import run_model
from helpers.folders import MODELS
from mbsim.errors import Interrupted, ModelError, UnknownSignal
from mbsim.results import error_bars
from mbsim.run import verify


@pytest.mark.parametrize("deck", ["drop_m", "four_bar_stop"])
def test_true_errors_are_within_three_bars(deck):
    with (
        run_model(f"{deck}.xml", end_time=1.0, verify=True) as run,
        run_model(f"{deck}.xml", end_time=1.0, integrator="DOP853", tol=1e-11) as truth,
    ):
        for id in run.ids("bodies"):
            for signal in ("position", "velocity"):
                name = f"bodies/{id}/{signal}"
                error = np.linalg.norm(run[name] - truth[name], axis=1)
                bar = run.errors[name]
                assert bar.shape == error.shape
                assert (error <= 3.0 * bar).mean() >= 0.98
                assert run.errors.reproducible_until(name) == math.inf
        # no bar says nothing: those of positions are far below the motion
        assert (run.errors[name] < 0.1 * np.ptp(run[name], axis=0).max()).all()


def test_bars_are_kept_in_the_file_and_the_run_is_as_without(tmp_path):
    model = mbsim.read_model(MODELS / "bowling_ball.xml")
    with (
        mbsim.simulate(model, end_time=0.3, output=tmp_path, verify=True) as first,
        mbsim.simulate(model, end_time=0.3) as plain,
    ):
        bars = first.errors["bodies/2/position"]
        assert (first["bodies/2/position"] == plain["bodies/2/position"]).all()
        assert set(plain.signals()) == set(first.signals())
        with pytest.raises(UnknownSignal, match="--verify"):
            plain.errors["bodies/2/position"]
    with mbsim.open_results(tmp_path / "bowling_ball.h5") as kept:
        assert (kept.errors["bodies/2/position"] == bars).all()
        assert (kept.errors["bodies/2/position/x"] == bars).all()
        assert kept.errors["contacts/301/peak_force"] >= 0.0
        assert kept.errors["energy/kinetic"].shape == kept["time"].shape
        assert kept.checked
        assert kept.status == "finished"


@pytest.mark.parametrize("integrator", ["VERLET", "RADAU5"])
def test_other_methods_have_bars(integrator):
    with run_model("sphere_pair.xml", integrator=integrator, verify=True) as run:
        assert (run.errors["bodies/2/position"] > 0.0).all()


def test_what_is_interrupted_while_it_is_verified_is_complete(tmp_path, monkeypatch):
    def stop(self, full):
        raise Interrupted("interrupted at time 0.1")

    monkeypatch.setattr(verify.Reruns, "all", stop)
    model = mbsim.read_model(MODELS / "drop_m.xml")
    with pytest.raises(Interrupted, match="without error bars"):
        mbsim.simulate(model, end_time=0.3, output=tmp_path, verify=True)
    with mbsim.open_results(tmp_path / "drop_m.h5") as kept:
        assert kept.status == "finished"
        assert "bodies/2/position" not in kept.errors


def test_verify_takes_three_values():
    with pytest.raises(ModelError, match="full"):
        run_model("drop_m.xml", verify="twice")


def test_a_window_keeps_a_part_of_the_bar_before():
    time = np.linspace(0.0, 1.0, 81)
    apart = np.where(time < 0.02, 1.0, 0.0)
    bar = error_bars.widened(apart, error_bars.windows_of(time))
    assert bar[0] == 1.0
    assert bar[-1] == pytest.approx(error_bars.DECAY**39)


def test_positions_off_by_a_tenth_are_the_horizon():
    time = np.linspace(0.0, 10.0, 11)
    off = 0.011 * time[:, None]
    assert error_bars.horizons(time, off, 1.0) == (3.0, 10.0)
    assert error_bars.horizons(time, off, 100.0) == (math.inf, math.inf)


@pytest.mark.parametrize("steps", [{"integrator": "MOREAU"}, {}])
def test_what_rests_is_not_called_irreproducible(steps):
    """Positions that move by less than steps may be off, and other runs otherwise, are sure."""
    said = []
    deck = MODELS / "rigid" / "block_holds.xml"
    run = mbsim.simulate(deck, end_time=2.0, verify=True, notify=said.append, **steps)
    assert run.errors.reproducible_until("bodies/2/position") == math.inf
    assert not [line for line in said if "unsure" in line or "reproducible" in line]
    moved = np.ptp(run["bodies/2/position"], axis=0).max()
    assert moved < 1e-3 * run.attributes["length"]


def test_events_are_held_against_those_of_their_kind_in_their_order():
    kind = [("time", float), ("kind", "U8"), ("element", int)]
    run = np.array([(0.1, "touch", 1), (0.2, "leave", 1), (0.5, "touch", 1)], dtype=kind)
    rerun = np.array([(0.11, "touch", 1), (0.2, "leave", 1)], dtype=kind)
    bars, said = error_bars.events_apart(run, [rerun])
    assert bars[:2] == pytest.approx([0.03, 0.0])
    assert math.isnan(bars[2])
    assert said == ["touch of 1: 2 times, 1 in a rerun"]
