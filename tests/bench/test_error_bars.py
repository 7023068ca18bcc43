"""How often error bars of --verify cover true errors: prints a table.

A true error is that against DOP853 at 1e-11, or RADAU5 at 1e-9 where the run turned implicit. Each
signal counts once for every window of time: its largest error there against its largest bar.
"""

from __future__ import annotations

import numpy as np
import pytest

import mbsim
from helpers.folders import MODELS
from mbsim.results import error_bars
from mbsim.results.error_bar_file import over_time

DECKS = [
    "drop_m",
    "bowling_ball",
    "bouncing_sphere",
    "sliding_block",
    "incline_slip",
    "contensou_disc",
    "four_bar",
    "four_bar_stop",
    "slider_crank",
    "pendulum_wall",
    "free_top",
    "sphere_pair",
    "hertz_sphere",
    "dry_friction_element",
    "flyball_governor",
    "cam_roller",
    "belt_stick_slip",
    "stiction_incline",
    "stiff/rolling_sphere",
    "stiff/rebound",
]


def judged(deck, verify=True):
    """Return bars and true errors of all windows of all signals."""
    path = MODELS / f"{deck}.xml"
    with mbsim.simulate(mbsim.read_model(path)) as plain:
        stiff = plain.stats["implicit_evaluations"] > 0
        scales = error_bars._scales(over_time(plain))
    with mbsim.simulate(mbsim.read_model(path), verify=verify) as results:
        run, bars = over_time(results), results.tables("errors")
    method, tol = ("RADAU5", 1e-9) if stiff else ("DOP853", 1e-11)
    with mbsim.simulate(mbsim.read_model(path), integrator=method, tol=tol) as truth:
        true = error_bars.apart_from(run, over_time(truth))
    window, found = error_bars.windows_of(run["time"]), []
    for name, error in true.items():
        kind = error_bars._kind(name)
        if kind == "incidents":
            continue
        bar = bars[name]
        for k in range(error_bars.WINDOWS):
            rows = window == k
            if rows.any():
                least = 1e-9 * scales[kind]
                most = np.nanmax(error[rows].reshape(rows.sum(), -1), axis=0)
                own = bar[rows].reshape(rows.sum(), -1).max(axis=0)
                found += [(b, max(e, least)) for b, e in zip(own, most, strict=True) if e > least]
    return np.array(found).reshape(-1, 2)


@pytest.mark.bench
@pytest.mark.parametrize("verify", [True, "full"])
def test_how_often_bars_cover_errors(verify):
    every = []
    print(f"\n{'deck':<24}{'windows':>8}{'1x':>7}{'3x':>7}{'bar/error':>11}")
    for deck in DECKS:
        found = judged(deck, verify)
        every.append(found)
        if len(found):
            _say(deck, found)
    whole = np.concatenate(every)
    _say("all", whole)
    assert (whole[:, 1] <= 3.0 * whole[:, 0]).mean() > 0.9


def _say(deck, found):
    bar, error = found.T
    covered = [(error <= times * bar).mean() for times in (1.0, 3.0)]
    ratio = np.median(bar / error)
    print(
        f"{deck:<24}{len(found):>8}{covered[0]:>7.3f}{covered[1]:>7.3f}{ratio:>11.2f}", flush=True
    )
